"""Measured image coordinates brought to the principal point and freed of what bends rays.

Source: [001] for interior orientation and corrections, see docs/image-coordinates.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.given_points import measured_control
from photostrip.pipeline.strips.absolute import orient_on_control, reject_wrong_control
from photostrip.pipeline.strips.forming import form_photos
from photostrip.triangulation.image_coordinates import corrections, interior

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.frames import GroundFrames
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.image_coordinates.mark_fit import InteriorOrientation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


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
    orientation = interior.orient(inputs.fiducials, inputs.cameras, settings.interior)
    return PhotoCoordinates(interior.transform(inputs.observations, orientation), orientation)


def correct(photo: PhotoCoordinates, inputs: Inputs, settings: Settings, ground: GroundFrames) -> corrections.Refined:
    """Image coordinates reduced to the principal point, free of distortion and refraction.

    Refraction and Earth curvature need heights; where they are not given, the strips without these corrections tell
    them.
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
    """Mean heights of cameras and ground from the strips as they lie on their control.

    Neither a correction of the strips' deformation nor a bundle adjustment changes these means by what matters to
    refraction.
    """
    control = measured_control(inputs.control, observations)
    formed = form_photos(inputs, observations, settings)
    if settings.adjustment == "bundle":
        from photostrip.pipeline.block.datum import known_of  # a strip needs none of its libraries
        from photostrip.pipeline.block.start import start

        begin = start(inputs, settings, formed, observations, known_of(inputs, control, ground))
        centers, points = begin.centers, begin.points[np.isfinite(begin.points[:, 0])]
    else:
        screened = [
            reject_wrong_control(orient_on_control(stage, control, ground.control), settings) for stage in formed
        ]
        oriented = [each.oriented for each in screened]
        cartesian = [each.intermediate.cartesian_from_intermediate for each in oriented]
        centers = np.concatenate(
            [
                placed(each.absolute.similarity(each.stage.formed.centers))
                for placed, each in zip(cartesian, oriented, strict=True)
            ]
        )
        points = _means(
            np.concatenate([each.stage.formed.point for each in oriented]),
            np.concatenate([placed(each.xyz) for placed, each in zip(cartesian, oriented, strict=True)]),
        )
    frame = ground.control[0] if ground.control else ground.output
    return Heights(float(_heights(centers, frame).mean()), float(_heights(points, frame).mean()))


def _means(number: Numbers, xyz: Floats) -> Floats:
    """Mean position of every point over its strips."""
    _, inverse = np.unique(number, return_inverse=True)
    sums = np.column_stack([np.bincount(inverse, column) for column in xyz.T])
    return np.asarray(sums / np.bincount(inverse)[:, None], float)


def _heights(points: Floats, frame: GroundFrame) -> Floats:
    heights: Floats = points[:, 2] if frame.kind == "local" else frame.geodetic(points)[:, 2]
    return heights
