"""A trace: every stage of every strip, iteration by iteration, with the symbols of the formulas (eq. 125 to 151)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import compress
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.geometry.similarity import pair_scales
from photostrip.notes import counted
from photostrip.pipeline.results import Result, StripResult
from photostrip.report.page.parts import Facts, Words
from photostrip.report.page.tables import Cell, Field, fields, with_unit, written
from photostrip.result.numbers import PER_RADIAN
from photostrip.sheets.replay import PairRound, pair_rounds, similarity_steps
from photostrip.sheets.sheet import Fact, Filled, Rows, Sheet, filled, hidden, same, table, taken
from photostrip.strip import absolute_orientation
from photostrip.strip.formed_strip import FirstPhoto, base_angles, base_frames, intersect_models
from photostrip.strip.pair_screening import stages, tested
from photostrip.strip.polynomial import POWERS, degree_of
from photostrip.strip.relative_orientation import ELEMENTS

CUBIC = 3  # degree of eq. 150
DEGREE = "polynomial.degree"
FOUR_BANDS = "control at four distances along the strip"
PAIRED = 15  # control points whose 105 distances can still be read
ANGLES, PRIMED = " ".join(ELEMENTS), "α1′ κ1′ α2′ ω2′ κ2′"
TURNS, TURN_HEADS = "alpha omega kappa", "α ω κ"
END, NOTHING = Cell("end", None), Cell("", None)
TESTS = {"parallax": "|q|, mm", "grubbs": "Grubbs' G", "tau": "tau"}
SYMBOLS = {
    "x1, y1, x2, y2": "image coordinates of the left and right photo, mm from the principal point, corrected",
    "alpha1 to kappa2": "elements of relative orientation in the base frame, written with a prime",
    "q": "y1h - y2h, y parallax of the photos turned into the base frame, mm",
    "[wqq]": "sum of the weighted squares of q, mm^2",
    "tau, nu": "direction and inclination of the base, in the strip; of one pair in the left photo, with bx, by, bz",
    "A, A_taunu": "rotation of a photo, image to strip, and of a base frame to strip, by rows",
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
MATRIX = tuple(f"{row}{column}" for row in "abc" for column in "123")


# subject, where the textbook decides, key of ``processing``, its value that follows the textbook, what this does
CHOICES = (
    (
        "gross errors in pairs",
        "[004a]",
        "relative.screening",
        "parallax+grubbs",
        "residual y parallax, then Grubbs' test",
    ),
    ("intersection", "eq. 138", "intersection", "left", "point on the left ray"),
    (
        "scale transfer",
        "eq. 139-141",
        "scale_transfer",
        "distances",
        "mean of the ratios of distances, weights as chosen",
    ),
    ("control", "eq. 149", "control_weights", "equal", "equal weights"),
    ("adjustment", "eq. 150", "adjustment", "polynomial", "polynomials"),
    ("degree", "eq. 150", DEGREE, str(CUBIC), "cubic"),
)
HERE = {  # what the program does by other values of the keys
    "auto": "robust start where needed, search for the smallest set of wrong points, readmission",
    "tau": "residual over its own standard deviation",
    "deletion": "search for the smallest set of wrong points",
    "robust": "re-weighting",
    "none": "not searched for",
    "mean": "Y is the mean of both rays, in the base frame",
    "least_squares": "ratios weighted by their precision",
    "stated": "weighted by their standard deviations and those of the strip's points",
    "similarity": "none",
    "bundle": "bundle adjustment, which the strip only starts",
}


def departures_of(result: Result) -> list[tuple[str, ...]]:
    """Return where what a run did departs from the textbook, whatever its settings asked for."""
    settings, asked = result.settings, result.settings.polynomial.degree
    formed = any(strip.polynomial is not None for strip in result.strips)
    degrees = dict.fromkeys(map(_degrees, result.strips))
    said = "; ".join(f"{plan} in plan, {height} in height" for plan, height in degrees)
    done = {
        "relative.screening": settings.relative.screening,
        "intersection": settings.formation.intersection,
        "scale_transfer": settings.formation.scale_transfer,
        "adjustment": "bundle" if result.bundle is not None else "polynomial" if formed else "similarity",
        DEGREE: f"{said} ({'by evidence' if asked == 'auto' else f'{asked} asked for'})",
        "control_weights": settings.absolute.control_weights,
    }
    if set(degrees) == {(CUBIC, CUBIC)}:
        done[DEGREE] = str(CUBIC)
    cures = {DEGREE: FOUR_BANDS} if asked == str(CUBIC) else {}
    return [
        (subject, source, words, HERE.get(done[key], done[key]), cures.get(key, f"processing.{key}: {textbook}"))
        for subject, source, key, textbook, words in CHOICES
        if done[key] != textbook
    ]


def _degrees(strip: StripResult) -> tuple[int, int]:
    """Return the degrees in plan and in height that a strip was given; 0 where none."""
    if strip.polynomial is None:
        return 0, 0
    plan, _, height = (degree_of(axis.terms) for axis in strip.polynomial.axes)
    return plan, height


def trace_sheet(result: Result) -> Sheet:
    """Return every stage of a run, iteration by iteration; angles in the unit of the output.

    Of a bundle adjustment these are the stages of the strip method that started it; links of independent models are in
    the result, their way to the ground is here.
    """
    if result.bundle is not None:
        result = replace(result, strips=result.bundle.start.strips, frames=(*result.frames, result.output))
    unit = result.settings.angle_unit
    symbols = Rows("", "Symbols", (), (), above=[Facts(tuple(SYMBOLS.items())), Words(f"Angles in {unit}.")])
    columns = (Field("subject"), Field("source"), Field("textbook"), Field("here"), Field("key", head="to follow it"))
    departures = [] if result.model_strips else departures_of(result)
    tables = [symbols, Rows("departures", "Where this run departs from the textbook", columns, departures)]
    for strip in result.strips:
        formed = [] if strip.is_of_models else [*_pairs(result, strip, unit), *_chain(strip, unit)]
        formed += [] if strip.is_of_models else _scale_transfer(result, strip)
        for each in (*formed, *_absolute(result, strip, unit), *_polynomial(result, strip)):
            with_strip = [*hidden("strip"), *each.fields]
            tables.append(replace(each, fields=with_strip, rows=[(strip.strip.id, *row) for row in each.rows]))
    facts = [Fact("name", result.inputs.name), Fact("angles", unit), Fact("symbols", SYMBOLS)]
    return Sheet("trace", f"Trace: {result.inputs.name}", facts, tables, main="pair_points")


def _used(used: Iterable[Any]) -> Filled:
    return Field("used", head=""), [Cell("" if each else "not used", bool(each)) for each in used]


def _pairs(result: Result, strip: StripResult, unit: str) -> Iterator[Rows]:
    """Give relative orientation of every pair: rounds of the iteration, rejections, parallaxes and model points."""
    photos, orientation, formed = strip.strip.photos, strip.of_photos.orientation, strip.of_photos.formed
    factor, ids = PER_RADIAN[unit], result.refined.observations.point_ids
    bases, rotations = orientation.relative
    for number, rounds in enumerate(pair_rounds(result, strip)):
        left, right = photos[number : number + 2]
        who = same(left=left, right=right)
        for count, each in enumerate(rounds, 1):
            yield _round(who, each, count, unit, f"Relative orientation of {left} – {right}" if count == 1 else "")
        rejected = [each for each in strip.of_photos.rejections if orientation.pairs.pair[each.row] == number]
        rejections = (
            Field("point", head="rejected", of=lambda each: ids[orientation.point[each.row]]),
            Field("test"),
            *fields("value limit", "ratio g4"),
            Field("q", "mm 4", of="worst"),
            Field("readmitted", head="", of=lambda at: Cell("taken back" if at.readmitted else "", at.readmitted)),
        )
        yield table("pair_rejected", "", [*who, *taken(rejections, rejected)])
        yield from _largest(result, strip, number, who)
        base = bases[number] * formed.first.base
        turns = [
            *np.array(base_angles(bases[number])) * factor,
            *(alpha_omega_kappa(rotations[number]) * factor).ravel(),
        ]
        columns = [
            *who,
            (Field("sigma0_um", "um 2", "σ0"), orientation.sigma0[number] * 1000),
            *filled(hidden(*ELEMENTS, form=f"{unit} 6"), [orientation.elements[number] * factor]),
            *filled(fields("bx by bz", " 6"), [base]),
            *filled(fields(f"tau nu {TURNS}", f"{unit} 6", f"τ ν {TURN_HEADS}"), [turns]),
        ]
        note = "σ0 of an image coordinate; base and right photo in the system of the left one. The points, eq. 137-138:"
        yield table("pairs", "", columns, note=note)
        yield _points(result, strip, number, who)


def _largest(result: Result, strip: StripResult, number: int, who: Sequence[Filled]) -> Iterator[Rows]:
    """Give the largest value of each test of single residuals that is left in a pair, beside its limit."""
    orientation, ids = strip.of_photos.orientation, result.refined.observations.point_ids
    rows = orientation.pairs.rows_of(np.array([number]))
    tests = []
    for test, bound in stages(result.settings.relative, strip.of_photos.sigma):
        value, limit, _ = (each[rows] for each in tested(orientation, test, bound))
        worst = int(np.argmax(np.where(orientation.used[rows], value, -np.inf)))
        tests.append((Cell(TESTS[test], test), ids[orientation.point[rows[worst]]], value[worst], limit[worst]))
    columns = (Field("test", head="what is left"), Field("point"), *fields("value limit", "ratio g4"))
    yield table("pair_tests", "", [*who, *filled(columns, tests)])


def _round(who: Sequence[Filled], each: PairRound, count: int, unit: str, title: str) -> Rows:
    """Give elements before each step and what is added, in the end the elements found."""
    factor, which = PER_RADIAN[unit], "all points" if count == 1 else "without the rejected points"
    added = (f"d_{name}" for name in ELEMENTS), (f"d{name}" for name in PRIMED.split())
    steps = fields(" ".join(added[0]), f"{unit} e1", " ".join(added[1]), rank=1)
    columns = [
        *who,
        *same(round=count, points=each.points),
        (Field("iteration", "count", "step"), [*range(1, len(each.squares) + 1), END]),
        (Field("[wqq]", "mm² e4"), [*each.squares, NOTHING]),
        *filled(fields(ANGLES, f"{unit} 6", PRIMED), each.elements * factor),
        *filled(steps, [*each.added * factor, [NOTHING] * len(ELEMENTS)]),
    ]
    above = [Words(f"Round {count}, {which}: {counted(each.points, 'point')}", "head")]
    return table("pair_steps", title, columns, above=above)


def _points(result: Result, strip: StripResult, number: int, who: Sequence[Filled]) -> Rows:
    """Give image coordinates, parallax, ray factor and strip coordinates of the points of a pair."""
    orientation, ids = strip.of_photos.orientation, result.refined.observations.point_ids
    formed, rows = strip.of_photos.formed, orientation.pairs.rows_of(np.array([number]))
    pairs = orientation.pairs.take(np.array([number]))
    left = FirstPhoto(formed.rotations[number], formed.first.base)
    model, _ = intersect_models(orientation.take(np.array([number])), left, left_ray=formed.left_ray)
    image = np.column_stack([pairs.left, pairs.right, orientation.parallax[rows]])
    columns = [
        *who,
        (Field("point"), [ids[point] for point in orientation.point[rows]]),
        *filled(fields("x1 y1 x2 y2 q", "mm 4"), image),
        (Field("N", "ratio 7"), model.ray_factor * left.base),
        *filled(fields("X Y Z", "strip 6"), formed.model_xyz[rows]),
        _used(pairs.weight > 0),
    ]
    return table("pair_points", "", columns)


def _chain(strip: StripResult, unit: str) -> Iterator[Rows]:
    """Give orientation and place of every photo in the strip, and the base that leads to it."""
    formed, factor, photos = strip.of_photos.formed, PER_RADIAN[unit], strip.strip.photos
    directions = np.column_stack([formed.base_direction, formed.base_inclination]) * factor
    bases = np.column_stack([directions, np.diff(formed.centers, axis=0), formed.scale_factor])
    photo = (Field("photo"), list(photos))
    places, turns = fields(" ".join(MATRIX), " 8"), formed.rotations.reshape(-1, 9)
    before = (*fields("tau nu", f"{unit} 6", "τ ν"), *fields("BX BY BZ", " 6"), Field("k", " 7"))
    columns = [
        photo,
        *filled(before, [[NOTHING] * len(before), *bases]),
        *filled(fields(TURNS, f"{unit} 6", TURN_HEADS), alpha_omega_kappa(formed.rotations) * factor),
        *filled(fields("Xs Ys Zs", " 6"), formed.centers),
        *filled(hidden(*MATRIX, form=" 8"), turns),
    ]
    yield table("chain", f"Chain of strip {strip.strip.id}: orientation and base of every photo, eq. 125-136", columns)
    note = "A = A_taunu A(α2′, ω2′, κ2′), eq. 131-133, by rows."
    yield table("", "", [photo, *filled(places, turns)], note=note)
    frames = base_frames(formed.rotations[:-1], strip.of_photos.orientation.elements).reshape(-1, 9)
    pair = [(Field("left"), list(photos[:-1])), (Field("right"), list(photos[1:]))]
    note = "A_taunu = A(α1, ω1, κ1) A(α1′, 0, κ1′)ᵀ, base frame to strip, eq. 128, by rows; first column: the base."
    yield table("base_frames", "", [*pair, *filled(places, frames)], note=note)


def _scale_transfer(result: Result, strip: StripResult) -> Iterator[Rows]:
    """Give the pass points of every junction: distances, ratios, the factor."""
    formed, ids = strip.of_photos.formed, result.refined.observations.point_ids
    joined, form = formed.junctions, result.settings.formation.scale_transfer
    for number, factor in enumerate(joined.factor.tolist()):
        photo = strip.strip.photos[number + 1]
        who, rows = same(photo=photo), np.flatnonzero(joined.junction == number)
        center = formed.centers[number + 1]
        before = np.linalg.norm(formed.model_xyz[joined.before[rows]] - center, axis=1)
        after = np.linalg.norm(formed.model_xyz[joined.after[rows]] - center, axis=1) / formed.scale_factor[number + 1]
        k, ratios = factor * formed.scale_factor[number], joined.ratio[rows] * formed.scale_factor[number]
        columns = [
            *who,
            (Field("point"), [ids[point] for point in joined.point[rows]]),
            (Field("D", " 7"), before),
            (Field("D'", " 7"), after),
            (Field("k_t", " 7", "k_t"), ratios),
            (Field("", " e1", "k_t - k"), ratios - k),
            _used(joined.used[rows]),
        ]
        yield table("junction_points", f"Scale transfer at photo {photo}, eq. 139-141", columns)
        found = [*fields("k", " 9"), Field("form", head="weights"), Field("sd_of_one", " e1", "sd of one ratio")]
        yield table("junctions", "", [*who, *filled(found, [(k, form, joined.spread[number] * k)])])


def _absolute(result: Result, strip: StripResult, unit: str) -> Iterator[Rows]:
    similarity, frame, factor = strip.absolute.similarity, strip.intermediate, PER_RADIAN[unit]
    points, sigma0 = strip.formed.xyz[strip.control_rows], strip.absolute.sigma0
    moved = similarity(points)
    given = absolute_orientation.Targets(strip.control, result.frames, frame).of(moved)
    origin, axes = written(frame.origin, "m 4"), "; ".join(written(row, " 9") for row in frame.axes)
    azimuth = with_unit(frame.azimuth * factor, f"{unit} 6")
    facts = Facts((("A0", azimuth), ("origin, m", origin), ("M, by rows", axes)))
    keys = hidden("A0", "origin_x", "origin_y", "origin_z", *(f"M_{place}" for place in MATRIX), form=" 7")
    laid = filled(keys, [[frame.azimuth * factor, *frame.origin, *frame.axes.ravel()]])
    columns = [*laid, (Field("sigma0", " g4", shown=False), sigma0)]
    yield table("absolute", f"Absolute orientation of strip {strip.strip.id}, eq. 142-149", columns, above=[facts])
    yield from _approximate(strip, points, given, similarity.scale)
    steps = similarity_steps(result, strip)
    before, squares, added = zip(*steps, strict=True)
    turns = hidden("d_rotation_1", "d_rotation_2", "d_rotation_3", "d_scale", form="m e1")
    states = [*before, similarity]
    angles = alpha_omega_kappa(np.array([each.rotation for each in states])) * factor
    columns = [
        (Field("iteration", "count", "step"), [*range(1, len(steps) + 1), END]),
        (Field("[wvv]", " g6"), [*squares, NOTHING]),
        (Field("s", " 7"), [each.scale for each in states]),
        *filled(fields("xi eta theta", f"{unit} 6", "ξ η θ"), angles),
        *filled(fields("X0 Y0 Z0", "m 4"), [each.shift for each in states]),
        *filled((*fields("dX0 dY0 dZ0", "m e1", rank=1), *turns), [*added, [NOTHING] * 7]),
    ]
    yield table("similarity_steps", "", columns, note="no redundancy" if np.isnan(sigma0) else f"σ0 = {sigma0:.4g}")
    columns = [
        (Field("point"), list(strip.control.ids)),
        (Field("use"), ["".join(compress("xyz", use)) for use in strip.control.use]),
        *filled(fields("X Y Z", "strip 6"), points),
        *filled(fields("given_X given_Y given_Z", "m 3", "X Y Z", "given, m"), given),
        *filled(fields("vX vY vZ", "m 3"), moved - given),
    ]
    note = "v: strip minus given after the similarity, in the intermediate frame."
    yield table("similarity_control", "", columns, note=note)


def _approximate(strip: StripResult, points: Floats, given: Floats, scale: float) -> Iterator[Rows]:
    """Give the scale r from the distances of control points that are given in full, t = s / r; eq. 145-148."""
    full = np.flatnonzero(strip.control.use.all(axis=1))
    if len(full) < 2:
        return
    found = pair_scales(points[full], given[full])
    ids, centroid = [strip.control.ids[row] for row in full.tolist()], points[full].mean(axis=0)
    few = slice(None) if len(full) <= PAIRED else slice(0)
    columns = [
        (Field("from"), [ids[row] for row in found.first[few]]),
        (Field("to"), [ids[row] for row in found.second[few]]),
        (Field("D", "strip 6"), found.source[few]),
        (Field("DG", "m 3"), found.target[few]),
        (Field("r", " g9"), (found.target / found.source)[few]),
    ]
    yield table("control_distances", "", columns)
    columns = [*filled(fields("r t", " g9"), [(found.mean, scale / found.mean)])]
    columns += filled(fields("centroid_x centroid_y centroid_z", " 6"), [centroid])
    yield table("approximate", "", columns, note="t = s/r; the centroid is that of the strip's control.")


def _polynomial(result: Result, strip: StripResult) -> Iterator[Rows]:
    found = strip.polynomial
    if found is None:
        return
    xyz = strip.absolute.similarity(strip.formed.xyz[strip.control_rows])
    corrected = found(xyz)
    given = absolute_orientation.Targets(strip.control, result.frames, strip.intermediate).of(corrected)
    evidence = (
        Field("group"),
        Field("degree", "count"),
        *fields("rms left_out", "m 4"),
        Field("F", " g4", of="f"),
        Field("p", " g3"),
        Field("taken", head="", of=lambda each: Cell("taken" if each.accepted else "", bool(each.accepted))),
    )
    tried = [*same(found=found.degree), *taken(evidence, found.evidence)]
    yield table("polynomial_evidence", f"Polynomials of strip {strip.strip.id}, eq. 150-151", tried)
    terms = [
        (axis, *row, fit.sigma0)
        for axis, fit in zip("XYZ", found.axes, strict=True)
        for row in zip(fit.terms, fit.coefficients, fit.sigmas, strict=True)
    ]
    added = (Field("axis", head="added to"), Field("term"), Field("coefficient", " e8"), Field("sigma", " e2", "±"))
    columns = [*filled((*added, *hidden("sigma0", form="m 3")), terms)]
    yield table("polynomial_terms", "", columns, above=[] if terms else ["No term is taken."])
    left = np.hstack([xyz[:, :2], given - xyz, corrected - given])
    columns = [
        (Field("point"), list(strip.control.ids)),
        *filled(fields("X Y lX lY lZ vX vY vZ", "m 3"), left),
    ]
    yield table("polynomial_control", "", columns, note="l: given minus strip; v: corrected minus given.")
