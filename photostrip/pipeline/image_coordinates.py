"""Measured image coordinates brought to the principal point and freed of what bends rays.

Source: [001] for interior orientation and corrections, see docs/image-coordinates.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.points import PhotoPoints
from photostrip.strip import corrections

if TYPE_CHECKING:
    from photostrip.strip.interior import InteriorOrientation


@dataclass(frozen=True, eq=False)
class PhotoCoordinates:
    """Image points in the system of the photo."""

    observations: PhotoPoints
    interior: InteriorOrientation | None  # None where no fiducial marks were measured


@dataclass(frozen=True)
class Heights:
    """Mean heights above the ellipsoid, metres, or above the plane of a local frame."""

    flying: float
    ground: float


def orient_interior(inputs: Inputs, settings: Settings) -> PhotoCoordinates:
    """Interior orientation, when fiducial marks were measured."""
    if inputs.fiducials is None:
        return PhotoCoordinates(inputs.observations, None)
    from photostrip.strip import interior

    orientation = interior.orient(inputs.fiducials, inputs.cameras, settings.interior)
    return PhotoCoordinates(interior.transform(inputs.observations, orientation), orientation)


def correct(photo: PhotoCoordinates, inputs: Inputs, settings: Settings, ground: GroundFrames) -> corrections.Refined:
    """Image coordinates reduced to the principal point, free of distortion and refraction.

    Refraction and Earth curvature need heights; where they are not given, they are those of the strips without these
    corrections.
    """
    if inputs.models is not None:  # there are none: the observations only name the points
        return corrections.Refined(photo.observations, {})
    wanted = settings.refinement
    if wanted.needs_heights and (wanted.flying_height is None or wanted.ground_height is None):
        plain = replace(wanted, refraction=False, earth_radius=None)
        bent = corrections.refine(photo.observations, inputs.cameras, plain).observations
        heights = heights_of(bent, inputs, settings, ground)
        wanted = replace(wanted, flying_height=heights.flying, ground_height=heights.ground)
    return corrections.refine(photo.observations, inputs.cameras, wanted)


def heights_of(observations: PhotoPoints, inputs: Inputs, settings: Settings, ground: GroundFrames) -> Heights:
    """Mean heights of cameras and ground from the strips, adjusted as they will be, in the frames of the run."""
    # a check, which asks for no heights, does without the fifty modules of a strip
    from photostrip.pipeline.common_points import mean_points
    from photostrip.pipeline.given_points import measured_control
    from photostrip.pipeline.strips.method import adjust_formed, form_photos

    control = measured_control(inputs.control, observations)
    formed = form_photos(inputs, observations, settings)
    if settings.together:
        from photostrip.pipeline.block.adjust import adjust_block  # a strip needs none of its libraries

        adjusted = adjust_block(inputs, settings, observations, control, ground, formed)
        strips, points = adjusted.strips, adjusted.points.cartesian
        singles = () if adjusted.bundle is None else adjusted.bundle.singles
    else:
        strips = tuple(adjust_formed(stage, control, ground.control, settings) for stage in formed)
        points, singles = mean_points(strips).xyz, ()
    of_strips = [strip.intermediate.cartesian_from_intermediate(strip.centers) for strip in strips]
    centers = np.concatenate([*of_strips, *(single.center[None] for single in singles)])
    frame = ground.control[0] if ground.control else ground.output
    return Heights(float(_heights(centers, frame).mean()), float(_heights(points, frame).mean()))


def _heights(points: Floats, frame: GroundFrame) -> Floats:
    heights: Floats = points[:, 2] if frame.kind == "local" else frame.geodetic(points)[:, 2]
    return heights
