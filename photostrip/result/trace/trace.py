"""The document of a trace: every stage of every strip with the symbols of the formulas, for pencil and paper."""

from __future__ import annotations

from dataclasses import replace
from itertools import compress

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.geometry.similarity import Similarity, pair_scales
from photostrip.notes import Document
from photostrip.pipeline.results import Result, StripResult
from photostrip.points import ControlPoints
from photostrip.result.numbers import EXACT, PER_RADIAN, rounded, significant
from photostrip.result.table import rows_of
from photostrip.result.trace.departures import departures_of
from photostrip.result.trace.replay import PairRound, SimilarityStep, pair_rounds, similarity_steps
from photostrip.strip import absolute_orientation
from photostrip.strip.polynomial_terms import POWERS
from photostrip.strip.relative_orientation.solution import ELEMENTS
from photostrip.strip.strip_formation.strip import FirstPhoto, base_angles, intersect_models

SCHEMA = 1
ANGLE, CHANGE, SQUARES, IMAGE, MODEL, COSINE, METRES = 9, 6, 6, 5, 9, 10, 4  # decimals, digits of steps and squares
RATIO = 10  # digits
PAIRED = 15  # control points whose 105 distances can still be read
SYMBOLS = {
    "x1, y1, x2, y2": "image coordinates of the left and right photo, mm from the principal point, corrected",
    "alpha1 to kappa2": "elements of relative orientation in the base frame, written with a prime",
    "q": "y1h - y2h, y parallax of the photos turned into the base frame, mm",
    "[wqq]": "sum of the weighted squares of q, mm^2",
    "tau, nu": "direction and inclination of the base, in the strip; of one pair in the left photo, with bx, by, bz",
    "A": "rotation of a photo, image to strip, by rows",
    "BX, BY, BZ": "components of the base, scale of the strip",
    "N": "ray factor of the left ray, from the model whose base is as long as the first one",
    "D, D'": "distance of a pass point from the common centre, in the model before and after the junction",
    "k": "scale factor of a model; k_t of one pass point",
    "r, t": "D_G/D of two control points, over all pairs sum of D_G over sum of D; s = r t",
    "A0": "azimuth of X of the intermediate frame, clockwise from north",
    "M": "axes of the intermediate frame, as columns, in the Cartesian frame",
    "s, xi, eta, theta": "scale and angles of the similarity, in the sense of alpha, omega, kappa",
    "[wvv]": "sum of the weighted squares of the misclosures, without unit",
    f"a0..a{len(POWERS) - 1}": f"coefficients of {', '.join(POWERS)}, what is added to a coordinate",
    "l": "free term of eq. 151, given minus strip; v: what the polynomial leaves",
}


def trace_of(result: Result) -> Document:
    """Return every stage of a run, iteration by iteration; angles in the unit of the output.

    Of a bundle adjustment these are the stages of the strip method that started it.
    """
    if result.bundle is not None:
        result = replace(result, strips=result.bundle.start.strips, frames=(*result.frames, result.output))
    unit = result.settings.angle_unit
    return {
        "photostrip_trace": SCHEMA,
        "name": result.inputs.name,
        "angles": unit,
        "symbols": SYMBOLS,
        "departures": [] if result.model_strips else departures_of(result.settings),
        "strips": [_strip(result, strip, PER_RADIAN[unit]) for strip in result.strips],
    }


def _strip(result: Result, strip: StripResult, factor: float) -> Document:
    """Return the stages of a strip; links of independent models are in the result, their way to the ground is here."""
    of_photos = strip.model_stages is None
    return {
        "strip": strip.strip.id,
        "pairs": _pairs(result, strip, factor) if of_photos else [],
        "chain": _chain(strip, factor) if of_photos else [],
        "scale_transfer": _scale_transfer(result, strip) if of_photos else [],
        "absolute": _absolute(result, strip, factor),
        "polynomial": _polynomial(result, strip),
    }


def _pairs(result: Result, strip: StripResult, factor: float) -> list[Document]:
    """Relative orientation of every pair: rounds of the iteration, rejections, parallaxes and model points."""
    photos, orientation = strip.strip.photos, strip.of_photos.orientation
    return [
        {
            "left": photos[number],
            "right": photos[number + 1],
            "rounds": [_round(each, factor) for each in rounds],
            "rejected": _rejected(result, strip, number),
            "sigma0_um": rounded(orientation.sigma0[number] * 1000, 2),
            "elements": _named(orientation.elements[number] * factor, ANGLE),
            "photo_system": _in_left_photo(strip, number, factor),
            "points": _points(result, strip, number),
        }
        for number, rounds in enumerate(pair_rounds(result, strip))
    ]


def _in_left_photo(strip: StripResult, number: int, factor: float) -> Document:
    """Return base and right photo in the system of the left one; the base is as long as the first one."""
    formed = strip.of_photos.formed
    bases, rotations = strip.of_photos.orientation.relative
    base, angles = bases[number] * formed.first.base, np.array(base_angles(bases[number])) * factor
    return {
        **dict(zip(("bx", "by", "bz"), rounded(base, MODEL), strict=True)),
        **dict(zip(("tau", "nu"), rounded(angles, ANGLE), strict=True)),
        **dict(zip(("alpha", "omega", "kappa"), _angles(rotations[number], factor), strict=True)),
    }


def _named(values: Floats, decimals: int) -> Document:
    return dict(zip(ELEMENTS, rounded(values, decimals), strict=True))


def _round(each: PairRound, factor: float) -> Document:
    steps = [
        {
            "iteration": number,
            "elements": _named(step.elements * factor, ANGLE),
            "[wqq]": significant(step.squares, SQUARES),
            "d": dict(zip(ELEMENTS, significant(step.step * factor, CHANGE), strict=True)),
        }
        for number, step in enumerate(each.steps, 1)
    ]
    return {"points": each.points, "steps": steps, "end": _named(each.end * factor, ANGLE)}


def _rejected(result: Result, strip: StripResult, number: int) -> list[Document]:
    ids, orientation = result.refined.observations.point_ids, strip.of_photos.orientation
    return [
        {
            "point": ids[orientation.point[each.row]],
            "test": each.test,
            "value": significant(each.value),
            "limit": significant(each.limit),
            "q": rounded(each.worst, IMAGE),
            "readmitted": bool(each.readmitted),
        }
        for each in strip.of_photos.rejections
        if orientation.pairs.pair[each.row] == number
    ]


def _points(result: Result, strip: StripResult, number: int) -> list[Document]:
    """Image coordinates, parallax, ray factor and strip coordinates of the points of a pair."""
    orientation, ids = strip.of_photos.orientation, result.refined.observations.point_ids
    formed = strip.of_photos.formed
    rows = orientation.pairs.rows_of(np.array([number]))
    pairs = orientation.pairs.take(np.array([number]))
    left = FirstPhoto(formed.rotations[number], formed.first.base)
    model, _ = intersect_models(orientation.take(np.array([number])), left, left_ray=formed.left_ray)
    image = rounded(np.column_stack([pairs.left, pairs.right]).T, IMAGE)
    columns = {
        "point": [ids[point] for point in orientation.point[rows]],
        **dict(zip(("x1", "y1", "x2", "y2"), image, strict=True)),
        "q": rounded(orientation.parallax[rows], IMAGE),
        "N": rounded(model.ray_factor * left.base, MODEL),
        **dict(zip("XYZ", rounded(formed.model_xyz[rows].T, MODEL), strict=True)),
        "used": (pairs.weight > 0).tolist(),
    }
    return rows_of(columns)


def _chain(strip: StripResult, factor: float) -> list[Document]:
    """Orientation and place of every photo in the strip, and the base that leads to it."""
    formed, found = strip.of_photos.formed, []
    for number, photo in enumerate(strip.strip.photos):
        turn = dict(zip(("alpha", "omega", "kappa"), _angles(formed.rotations[number], factor), strict=True))
        row: Document = {"photo": photo, **turn, "A": rounded(formed.rotations[number].ravel(), COSINE)}
        row["S"] = rounded(formed.centers[number], MODEL)
        if number:
            base = formed.centers[number] - formed.centers[number - 1]
            row |= {
                "tau": rounded(formed.base_direction[number - 1] * factor, ANGLE),
                "nu": rounded(formed.base_inclination[number - 1] * factor, ANGLE),
                "B": rounded(base, MODEL),
                "k": rounded(formed.scale_factor[number - 1], MODEL),
            }
        found.append(row)
    return found


def _angles(rotation: Floats, factor: float) -> list[float]:
    values: list[float] = rounded(alpha_omega_kappa(rotation).ravel() * factor, ANGLE)
    return values


def _scale_transfer(result: Result, strip: StripResult) -> list[Document]:
    """Pass points of every junction: distances, ratios, the factor."""
    formed, ids = strip.of_photos.formed, result.refined.observations.point_ids
    joined, found = formed.junctions, []
    for number, factor in enumerate(joined.factor.tolist()):
        rows = np.flatnonzero(joined.junction == number)
        center = formed.centers[number + 1]
        before = np.linalg.norm(formed.model_xyz[joined.before[rows]] - center, axis=1)
        after = np.linalg.norm(formed.model_xyz[joined.after[rows]] - center, axis=1) / formed.scale_factor[number + 1]
        points = {
            "point": [ids[point] for point in joined.point[rows]],
            "D": rounded(before, MODEL),
            "D'": rounded(after, MODEL),
            "k_t": rounded(joined.ratio[rows] * formed.scale_factor[number], MODEL),
            "used": joined.used[rows].tolist(),
        }
        found.append(
            {
                "photo": strip.strip.photos[number + 1],
                "form": result.settings.formation.scale_transfer,
                "points": rows_of(points),
                "k": rounded(factor * formed.scale_factor[number], MODEL),
                "sd_of_one": rounded(joined.spread[number] * factor * formed.scale_factor[number], MODEL),
            }
        )
    return found


def _absolute(result: Result, strip: StripResult, factor: float) -> Document:
    similarity, frame = strip.absolute.similarity, strip.intermediate
    points = strip.formed.xyz[strip.control_rows]
    moved = similarity(points)
    given = absolute_orientation.Targets(strip.control, result.frames, frame).of(moved)
    control = {
        "point": strip.control.ids,
        "use": ["".join(compress("xyz", use)) for use in strip.control.use.tolist()],
        "strip": rounded(points, MODEL),
        "oriented": rounded(moved, METRES),
        "given": rounded(given, METRES),
    }
    return {
        "A0": rounded(frame.azimuth * factor, ANGLE),
        "origin": rounded(frame.origin, METRES),
        "M": rounded(frame.axes.ravel(), COSINE),
        "steps": [
            _similarity_step(number, step, factor) for number, step in enumerate(similarity_steps(result, strip), 1)
        ],
        **_similarity(similarity, factor),
        "approximate": _approximate(strip.control, points, given, similarity.scale),
        "sigma0": significant(strip.absolute.sigma0),
        "control": rows_of(control),
    }


def _approximate(control: ControlPoints, points: Floats, given: Floats, scale: float) -> Document | None:
    """Return the scale r from the distances of control points that are given in full, t = s / r; eq. 145-148."""
    full = np.flatnonzero(control.use.all(axis=1))
    if len(full) < 2:
        return None
    found = pair_scales(points[full], given[full])
    ids = [control.ids[row] for row in full.tolist()]
    pairs = {
        "from": [ids[row] for row in found.first.tolist()],
        "to": [ids[row] for row in found.second.tolist()],
        "D": rounded(found.source, MODEL),
        "DG": rounded(found.target, METRES),
        "r": significant(found.target / found.source, RATIO),
    }
    return {
        "centroid": rounded(points[full].mean(axis=0), MODEL),
        "pairs": rows_of(pairs) if len(full) <= PAIRED else [],
        "r": significant(found.mean, RATIO),
        "t": significant(scale / found.mean, RATIO),
    }


def _similarity_step(number: int, step: SimilarityStep, factor: float) -> Document:
    return {
        "iteration": number,
        "[wvv]": significant(step.squares, SQUARES),
        **_similarity(step.similarity, factor),
        "d_shift": significant(step.step[:3], CHANGE),
        "d_rotation": significant(step.step[3:6], CHANGE),
        "d_scale": significant(step.step[6], CHANGE),
    }


def _similarity(found: Similarity, factor: float) -> Document:
    return {
        "s": significant(found.scale, EXACT),
        **dict(zip(("xi", "eta", "theta"), _angles(found.rotation, factor), strict=True)),
        "shift": rounded(found.shift, METRES),
    }


def _polynomial(result: Result, strip: StripResult) -> Document | None:
    found = strip.polynomial
    if found is None:
        return None
    xyz = strip.absolute.similarity(strip.formed.xyz[strip.control_rows])
    corrected = found(xyz)
    given = absolute_orientation.Targets(strip.control, result.frames, strip.intermediate).of(corrected)
    axes = {
        name: {
            "terms": list(axis.terms),
            "coefficients": significant(axis.coefficients, 10),
            "sigmas": significant(axis.sigmas),
            "sigma0": rounded(axis.sigma0, METRES),
        }
        for name, axis in zip("XYZ", found.axes, strict=True)
    }
    control = {
        "point": strip.control.ids,
        "X": rounded(xyz[:, 0], METRES),
        "Y": rounded(xyz[:, 1], METRES),
        "l": rounded(given - xyz, METRES),
        "v": rounded(corrected - given, METRES),
    }
    evidence = [
        {
            "group": each.group,
            "degree": each.degree,
            "rms": rounded(each.rms, METRES),
            "left_out": rounded(each.left_out, METRES),
            "F": significant(each.f),
            "p": significant(each.p),
            "taken": each.accepted,
        }
        for each in found.evidence
    ]
    return {"degree": found.degree, "evidence": evidence, "axes": axes, "control": rows_of(control)}
