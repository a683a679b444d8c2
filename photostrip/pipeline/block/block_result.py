"""The result of a bundle adjustment as the pipeline goes on with it: strips, points, precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from photostrip.arrays import Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network import self_calibration
from photostrip.pipeline.block import block_notes
from photostrip.pipeline.common_points import in_output
from photostrip.pipeline.inputs import Inputs
from photostrip.pipeline.results import Adjusted, AdjustedStrips, Bundle, Precision, StripResult, Ties
from photostrip.points import PhotoPoints
from photostrip.strip.resection.resection import of_known_photos


def adjusted_strips(inputs: Inputs, observations: PhotoPoints, output: GroundFrame, bundle: Bundle) -> AdjustedStrips:
    """Put the solution of a bundle adjustment where the pipeline has its results."""
    block, screened, start = bundle.block, bundle.screened, bundle.start
    solution = screened.solution
    used = block.rows[screened.selection.images]
    rays = np.bincount(observations.point[used], minlength=len(observations.point_ids))
    number = np.flatnonzero(rays)
    cartesian = solution.points[number] + block.origin
    points = in_output(number, cartesian, rays[number], observations.point_ids, output)
    calibrated = _calibrated(observations, bundle)
    count = [len(strip.photos) for strip in inputs.strips]
    first = np.cumsum([0, *count])
    places = [(n, int(first[n])) for n, strip in enumerate(inputs.strips) if len(strip.photos) > 1]
    strips = tuple(
        _strip(strip, begin, calibrated, used, points, bundle)
        for strip, (_, begin) in zip(start.strips, places, strict=True)
    )
    sigma = np.median(block.problem.images.sigma) * bundle.unit
    covariances = bundle.screened.precision.points[number] * bundle.unit**2
    photos = tuple(bundle.photo_covariances[begin : begin + count[n]] for n, begin in places)
    basis = "a-priori" if bundle.unit == 1.0 else "a-posteriori"
    precision = Precision(points=covariances, photos=photos, sigma=(sigma,) * len(strips), basis=(basis,) * len(strips))
    return AdjustedStrips(
        strips=strips,
        points=points,
        ties=Ties.none(),  # a point has one position
        observations=calibrated,
        precision=precision,
        notes=block_notes.notes(bundle),
        bundle=bundle,
    )


def _calibrated(observations: PhotoPoints, bundle: Bundle) -> PhotoPoints:
    """Image coordinates with the calibration that was found."""
    problem = bundle.block.problem
    if not len(bundle.screened.solution.common):
        return observations
    photo = bundle.start.rows_of(observations.photo_ids)[observations.photo]
    shift = self_calibration.image_shift(problem, bundle.screened.solution.common, observations.xy, photo)
    return replace(observations, xy=observations.xy + shift)


def _strip(
    strip: StripResult, begin: int, observations: PhotoPoints, used: Numbers, points: Adjusted, bundle: Bundle
) -> StripResult:
    """Return a strip the points and orientations of the bundle, in its own intermediate frame."""
    solution, frame = bundle.screened.solution, strip.intermediate
    photos = strip.strip.photos
    numbers = slice(begin, begin + len(photos))
    centers = frame.intermediate_from_cartesian(solution.centers[numbers] + bundle.block.origin)
    rotations = frame.intermediate_rotations(solution.rotations[numbers])
    position = strip.of_photos.strip.positions(observations)
    rows = used[position[used] >= 0]
    rows = rows[np.argsort(position[rows], kind="stable")]
    measured = np.zeros(len(observations.point_ids), bool)
    measured[observations.point[position >= 0]] = True
    inside = measured[points.number]
    number, cartesian = points.number[inside], points.cartesian[inside]
    xyz = frame.intermediate_from_cartesian(cartesian)
    formed = strip.of_photos.formed
    at = np.minimum(np.searchsorted(formed.point, number), len(formed.point) - 1)
    known = formed.point[at] == number
    models = np.where(known, formed.model_count[at], 0)
    shape = np.where(known[:, None], formed.xyz[at], np.nan)
    control_at = np.searchsorted(number, formed.point[strip.control_rows])
    at_rows = np.searchsorted(number, observations.point[rows])
    oriented = strip.of_photos.strip.oriented(centers, rotations)
    resection = of_known_photos(observations.xy, xyz, position[rows], oriented, rows, at_rows)
    stages = replace(
        strip.of_photos,
        formed=replace(formed, point=number, xyz=shape, model_count=models),
        resection=resection,
        rows=rows,
    )
    return replace(
        strip,
        control_rows=np.minimum(control_at, len(number) - 1),
        xyz=xyz,
        cartesian=cartesian,
        rays=points.rays[inside],
        polynomial=None,
        photo_stages=stages,
    )
