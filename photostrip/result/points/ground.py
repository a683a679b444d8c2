"""Ground coordinates of a result: its frame, its points, ties between strips, points without coordinates."""

from __future__ import annotations

import math

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.notes import Document
from photostrip.pipeline.results import ROLES, Result
from photostrip.result.numbers import GROUND, natural_rank, to_decimals
from photostrip.result.points.checked import CHECKED, checked_of
from photostrip.result.points.given import size_columns
from photostrip.result.points.precision import point_columns
from photostrip.result.quantities import coordinate_decimals
from photostrip.result.table import Table

KEPT = 1e-3  # of a pixel on the ground that the coordinates of a free network show


def coordinates(result: Result, enu: Floats) -> Document:
    """Return the columns x, y, z of coordinates in the internal order, with the decimals of their frame."""
    columns = zip("xyz", result.output.order, coordinate_decimals(frame_of(result)), strict=True)
    return {axis: to_decimals(enu[:, k], count) for axis, k, count in columns}


def ground_decimals(result: Result) -> int:
    """Return the decimals of lengths: of a free network, in which a metre may be anything, those that pixels need."""
    bundle = result.bundle
    if bundle is None or not bundle.screened.solution.free:
        return GROUND
    of_strips = [(strip.of_photos.strip.camera, strip.scale_number) for strip in result.photo_strips]
    scales = of_strips + [(single.strip.camera, single.scale_number) for single in bundle.singles]
    pixels = [scale * camera.pixel_size / 1000 for camera, scale in scales if camera.pixel_size is not None]
    return max([GROUND, *(math.ceil(-math.log10(KEPT * pixel)) for pixel in pixels)])


def frame_of(result: Result) -> Document:
    """Return the block ``frame``: what the coordinates of the result refer to."""
    frame = result.output
    spec = frame.spec
    corrected = spec.curvature_radius is not None and frame.origin is not None
    return {
        "crs": spec.crs,
        "axes": list(frame.axes),
        "kind": frame.kind,
        "plan_unit": frame.plan_unit,
        "height_unit": frame.height_unit,
        "plan_factor": frame.plan_factor,
        "height_factor": frame.height_factor,
        "ellipsoid": None if frame.ellipsoid is None else list(frame.ellipsoid),
        "heights": spec.height,
        **({} if spec.geoid_undulation is None else {"geoid_undulation": spec.geoid_undulation}),
        **({"curvature": {"radius": spec.curvature_radius, "origin": list(frame.origin or ())}} if corrected else {}),
        **({} if (decimals := ground_decimals(result)) == GROUND else {"decimals": decimals}),
        "description": frame.describe(),
    }


def points_of(result: Result, image_rms: Floats, rank: Numbers) -> Table:
    """Return the list ``points``, in natural order of their ids.

    image_rms: (n,), root mean square image residual of each point as numbered in the observations, mm.
    rank: (n,), place of each of them in natural order.
    """
    points, ids = result.points, result.refined.observations.point_ids
    models = np.zeros(len(ids), np.intp)
    for strip in result.strips:
        models[strip.formed.point] += strip.formed.model_count
    columns = {
        "id": np.array(ids, object)[points.number],
        "role": np.array(ROLES, object)[result.roles],
        **coordinates(result, points.ground),
        **point_columns(result),
        "rays": points.rays,
        "models": models[points.number],
        "checked": np.array(CHECKED, object)[checked_of(result, models[points.number])],
        "image_rms_um": image_rms[points.number] * 1000.0,
    }
    return Table.of("points", columns)[np.argsort(rank[points.number])]


def ties_of(result: Result, rank: Numbers) -> Table:
    """Return the list ``ties``: points of two strips with their differences, second minus first."""
    ties, ids = result.ties, result.refined.observations.point_ids
    names = [strip.strip.id for strip in result.strips]
    scale = np.array([strip.scale_number for strip in result.strips])[ties.strips].mean(axis=1)
    level, axes = _level_ties(result), result.output.user_from_internal(ties.difference)
    columns = {
        "id": [ids[number] for number in ties.number],
        "strips": [[names[first], names[second]] for first, second in ties.strips],
        **size_columns(axes, np.hypot(level[:, 0], level[:, 1]), level[:, 2], scale),
    }
    return Table.of("ties", columns)[np.lexsort((ties.strips[:, 1], ties.strips[:, 0], rank[ties.number]))]


def _level_ties(result: Result) -> Floats:
    """Differences of ties to the east, to the north and up."""
    if result.output.kind != "geocentric":
        return result.ties.difference
    place = result.points.cartesian[np.searchsorted(result.points.number, result.ties.number)]
    level: Floats = np.einsum("nij,nj->ni", result.output.level_axes_at(place), result.ties.difference)
    return level


def not_determined_of(result: Result) -> Table:
    """Return the list ``not_determined``: measured points without coordinates, and why."""
    names = tuple(result.not_determined)
    order = [names[row] for row in np.argsort(natural_rank(names))]
    return Table.of("not_determined", {"id": order, "reason": [result.not_determined[name] for name in order]})
