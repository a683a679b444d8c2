"""The result of a network of models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.block import block_result
from photostrip.pipeline.common_points import in_output
from photostrip.pipeline.inputs import MeasuredModels
from photostrip.pipeline.results import (
    AdjustedStrips,
    Bundle,
    Precision,
    StripResult,
    Ties,
)
from photostrip.pipeline.strips.models import depth_of
from photostrip.points import PhotoPoints, locate
from photostrip.units import MILLIMETRES


def adjusted_strips(
    models: MeasuredModels, observations: PhotoPoints, output: GroundFrame, bundle: Bundle
) -> AdjustedStrips:
    """Put the solution of a network of models where the pipeline has its results."""
    block, screened, measured = bundle.block, bundle.screened, models.points
    solution, count = screened.solution, len(measured.point_ids)
    used = block.rows[screened.selection.images]
    held = np.zeros(len(solution.points), bool)
    held[measured.node[used]] = True
    number = np.flatnonzero(held[:count])
    cartesian = solution.points + block.origin
    covariances = screened.precision.points * bundle.unit**2
    shown = _photos_of_points(models, used, count)
    points = in_output(number, cartesian[number], shown[number], observations.point_ids, output)
    strips = tuple(_strip(strip, models, bundle, used, cartesian, held) for strip in bundle.start.strips)
    sigma = float(np.median(measured.sigma)) * bundle.unit
    basis = "a-priori" if bundle.unit == 1.0 else "a-posteriori"
    precision = Precision(
        points=covariances[number],
        photos=tuple(_of_centers(strip, held, covariances) for strip in strips),
        sigma=(sigma,) * len(strips),
        basis=(basis,) * len(strips),
    )
    return AdjustedStrips(
        strips=strips,
        points=points,
        ties=Ties.none(),  # a point has one position
        observations=observations,
        precision=precision,
        notes=block_result.notes(bundle),
        bundle=bundle,
    )


def _photos_of_points(models: MeasuredModels, used: Numbers, count: int) -> Numbers:
    """Count the photos that show each point in a model that has it."""
    measured, photos = models.points, models.points.photo_ids
    shows = np.zeros((len(measured.model_ids), 2), np.intp)
    for strip in models.strips:
        flown = locate(strip.photos, photos)
        shows[locate(strip.models, measured.model_ids)] = np.column_stack([flown[:-1], flown[1:]])
    rows = used[measured.node[used] < count]
    pairs = np.column_stack([np.repeat(measured.node[rows], 2), shows[measured.model[rows]].ravel()])
    return np.bincount(np.unique(pairs, axis=0)[:, 0], minlength=count)


def _strip(
    strip: StripResult, models: MeasuredModels, bundle: Bundle, used: Numbers, cartesian: Floats, held: Flags
) -> StripResult:
    """Return a strip the points, centres and models of the network, in its own intermediate frame."""
    stages, frame, measured = strip.of_models, strip.intermediate, models.points
    formed, solution = stages.formed, bundle.screened.solution
    inside = np.zeros(len(measured), bool)
    inside[used] = True
    in_strip = np.unique(formed.models.node[inside[formed.models.row]])
    place = np.minimum(np.searchsorted(formed.node, in_strip), len(formed.node) - 1)
    known = formed.node[place] == in_strip
    formed = replace(
        formed,
        used=inside[formed.models.row],
        node=in_strip,
        node_xyz=np.where(known[:, None], formed.node_xyz[place], np.nan),
        node_models=np.bincount(formed.models.node[inside[formed.models.row]], minlength=len(cartesian))[in_strip],
    )
    centers = np.full((len(stages.strip.photos), 3), np.nan)
    of_centers = formed.photos
    there = (of_centers >= 0) & held[of_centers]
    centers[there] = frame.intermediate_from_cartesian(cartesian[of_centers[there]])
    xyz = frame.intermediate_from_cartesian(cartesian[formed.point])
    own = locate(stages.strip.models, bundle.start.photos)
    at = np.searchsorted(formed.point, strip.formed.point[strip.control_rows])
    return replace(
        strip,
        control_rows=np.minimum(at, len(formed.point) - 1),
        polynomial=None,
        xyz=xyz,
        cartesian=cartesian[formed.point],
        rays=formed.photo_count,
        depth=depth_of(centers, xyz),
        model_stages=replace(
            stages,
            formed=formed,
            centers=centers,
            rotations=frame.intermediate_rotations(solution.rotations[own]),
            scales=solution.scales[own] * MILLIMETRES,
        ),
    )


def _of_centers(strip: StripResult, held: Flags, covariances: Floats) -> Floats:
    """Covariances (f, 6, 6) of the photos of a strip: of their centres alone."""
    found = np.full((len(strip.strip.photos), 6, 6), np.nan)
    nodes = strip.of_models.formed.photos
    known = np.flatnonzero((nodes >= 0) & held[nodes])
    found[known, :3, :3] = covariances[nodes[known]]
    return found
