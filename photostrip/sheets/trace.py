"""A trace: every stage of every strip, iteration by iteration, with the symbols of the formulas (eq. 125 to 151)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress, pairwise
from typing import Any, NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.geometry.similarity import Similarity, pair_scales
from photostrip.notes import counted
from photostrip.pipeline.results import Result, StripResult
from photostrip.report.page.parts import Facts, Part, Words
from photostrip.report.page.tables import Cell, Field, fields, written
from photostrip.result.numbers import PER_RADIAN
from photostrip.sheets.replay import PairRound, pair_rounds, similarity_steps
from photostrip.sheets.sheet import Fact, Rows, Sheet, constant, hidden, listed
from photostrip.strip import absolute_orientation
from photostrip.strip.formed_strip import FirstPhoto, base_angles, base_frames, intersect_models
from photostrip.strip.pair_screening import stages, tested
from photostrip.strip.polynomial import POWERS, degree_of
from photostrip.strip.relative_orientation import ELEMENTS

CUBIC = 3  # degree of eq. 150
DEGREE = "polynomial.degree"
FOUR_BANDS = "control at four distances along the strip"
PAIRED = 15  # control points whose 105 distances can still be read
PRIMED = ("α1′", "κ1′", "α2′", "ω2′", "κ2′")
TURNS, TURN_HEADS = ("alpha", "omega", "kappa"), ("α", "ω", "κ")
SIMILARITY, SIMILARITY_HEADS = ("xi", "eta", "theta"), ("ξ", "η", "θ")
TESTS = {"parallax": "|q|, mm,", "grubbs": "Grubbs' G", "tau": "tau"}
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


class Departure(NamedTuple):
    subject: str
    source: str  # where the textbook decides
    key: str  # of ``processing``
    textbook: tuple[str, ...]  # values of the key that follow it
    words: str  # what the textbook does
    here: dict[str, str]  # what the program does, by its name for it


CHOICES = (
    Departure(
        subject="gross errors in pairs",
        source="[004a]",
        key="relative.screening",
        textbook=("parallax+grubbs",),
        words="residual y parallax, then Grubbs' test",
        here={
            "auto": "robust start where needed, search for the smallest set of wrong points, readmission",
            "tau": "residual over its own standard deviation",
            "deletion": "search for the smallest set of wrong points",
            "robust": "re-weighting",
            "none": "not searched for",
        },
    ),
    Departure(
        subject="intersection",
        source="eq. 138",
        key="intersection",
        textbook=("left",),
        words="point on the left ray",
        here={"mean": "Y is the mean of both rays, in the base frame"},
    ),
    Departure(
        subject="scale transfer",
        source="eq. 139-141",
        key="scale_transfer",
        textbook=("distances",),
        words="mean of the ratios of distances, weights as chosen",
        here={"least_squares": "ratios weighted by their precision"},
    ),
    Departure(
        subject="control",
        source="eq. 149",
        key="control_weights",
        textbook=("equal",),
        words="equal weights",
        here={"stated": "weighted by their standard deviations and those of the strip's points"},
    ),
    Departure(
        subject="adjustment",
        source="eq. 150",
        key="adjustment",
        textbook=("polynomial",),
        words="polynomials",
        here={
            "similarity": "none",
            "bundle": "bundle adjustment, which the strip only starts",
        },
    ),
    Departure(
        subject="degree",
        source="eq. 150",
        key=DEGREE,
        textbook=("3",),
        words="cubic",
        here={},
    ),
)


def departures_of(result: Result) -> list[tuple[str, ...]]:
    """Return where what a run did departs from the textbook, whatever its settings asked for."""
    settings = result.settings
    degrees, asked = [_degrees(strip) for strip in result.strips], settings.polynomial.degree
    whole = all(degree == (CUBIC, CUBIC) for degree in degrees)
    done = {
        "relative.screening": settings.relative.screening,
        "intersection": settings.formation.intersection,
        "scale_transfer": settings.formation.scale_transfer,
        "adjustment": "bundle" if result.bundle is not None else _adjusted(result),
        DEGREE: str(CUBIC) if whole else _said_degrees(degrees, asked),
        "control_weights": settings.absolute.control_weights,
    }
    return [
        (
            each.subject,
            each.source,
            each.words,
            each.here.get(done[each.key], done[each.key]),
            FOUR_BANDS if each.key == DEGREE and asked == str(CUBIC) else f"processing.{each.key}: {each.textbook[0]}",
        )
        for each in CHOICES
        if done[each.key] not in each.textbook
    ]


def _adjusted(result: Result) -> str:
    return "polynomial" if any(strip.polynomial is not None for strip in result.strips) else "similarity"


def _degrees(strip: StripResult) -> tuple[int, int]:
    """Return the degrees in plan and in height that a strip was given; 0 where none."""
    if strip.polynomial is None:
        return 0, 0
    plan, _, height = (degree_of(axis.terms) for axis in strip.polynomial.axes)
    return plan, height


def _said_degrees(degrees: Sequence[tuple[int, int]], asked: str) -> str:
    told = [f"{plan} in plan, {height} in height" for plan, height in dict.fromkeys(degrees)]
    why = "by evidence" if asked == "auto" else f"{asked} asked for"
    return f"{'; '.join(told)} ({why})"


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
        if strip.model_stages is None:
            tables += [*_pairs(result, strip, unit), *_chain(strip, unit), *_scale_transfer(result, strip)]
        tables += [*_absolute(result, strip, unit), *_polynomial(result, strip)]
    facts = [Fact("name", result.inputs.name), Fact("angles", unit), Fact("symbols", SYMBOLS)]
    return Sheet("trace", f"Trace: {result.inputs.name}", facts, tables, main="pair_points")


def _greek(keys: Sequence[str], heads: Sequence[str], form: str, rank: int = 0) -> tuple[Field, ...]:
    return tuple(Field(key, form, head, rank=rank) for key, head in zip(keys, heads, strict=True))


def _used(used: Any) -> Cell:  # noqa: ANN401 (a truth value, of numpy or not)
    return Cell("" if used else "not used", bool(used))


def _turned(rotation: Floats, factor: float) -> list[float]:
    angles: list[float] = (alpha_omega_kappa(rotation).ravel() * factor).tolist()
    return angles


def _pairs(result: Result, strip: StripResult, unit: str) -> Iterator[Rows]:
    """Give relative orientation of every pair: rounds of the iteration, rejections, parallaxes and model points."""
    photos, orientation, formed = strip.strip.photos, strip.of_photos.orientation, strip.of_photos.formed
    factor, ids = PER_RADIAN[unit], result.refined.observations.point_ids
    bases, rotations = orientation.relative
    who = hidden("strip", "left", "right")
    own = ("bx", "by", "bz"), ("tau", "nu", *TURNS)
    for number, rounds in enumerate(pair_rounds(result, strip)):
        names = (strip.strip.id, photos[number], photos[number + 1])
        title = f"Relative orientation of {names[1]} – {names[2]}"
        for count, each in enumerate(rounds, 1):
            yield _round(names, each, count, unit, title if count == 1 else "")
        yield listed(
            "pair_rejected",
            "",
            (
                *constant(strip=names[0], left=names[1], right=names[2]),
                Field("point", head="rejected", of=lambda each: ids[orientation.point[each.row]]),
                Field("test"),
                *fields("value limit", "ratio g4"),
                Field("q", "mm 4", of="worst"),
                Field("readmitted", head="", of=lambda at: Cell("taken back" if at.readmitted else "", at.readmitted)),
            ),
            [each for each in strip.of_photos.rejections if orientation.pairs.pair[each.row] == number],
        )
        yield from _largest(result, strip, number, names)
        base = (bases[number] * formed.first.base).tolist()
        angles = [*(np.array(base_angles(bases[number])) * factor).tolist(), *_turned(rotations[number], factor)]
        told = ", ".join(f"{name} {value:z.6f}" for name, value in zip(own[0], base, strict=True))
        turns = zip(("τ", "ν", *TURN_HEADS), angles, strict=True)
        told += f"; {', '.join(f'{name} {value:z.6f}' for name, value in turns)} {unit}."
        sigma0 = orientation.sigma0[number] * 1000
        yield Rows(
            "pairs",
            "",
            (*who, *hidden("sigma0_um", form="um 2"), *hidden(*ELEMENTS, *own[0], *own[1], form=f"{unit} 6")),
            [(*names, sigma0, *(orientation.elements[number] * factor), *base, *angles)],
            above=(
                f"In the system of the left photo: {told}",
                f"σ0 of an image coordinate: {written(sigma0, 'um 2')} µm. The points, eq. 137-138:",
            ),
        )
        yield _points(result, strip, number, names)


def _largest(result: Result, strip: StripResult, number: int, names: tuple[str, ...]) -> Iterator[Rows]:
    """Give the largest value of each test of single residuals that is left in a pair, beside its limit."""
    orientation, ids = strip.of_photos.orientation, result.refined.observations.point_ids
    rows = orientation.pairs.rows_of(np.array([number]))
    tests = []
    for test, bound in stages(result.settings.relative, strip.of_photos.sigma):
        value, limit, _ = (each[rows] for each in tested(orientation, test, bound))
        worst = int(np.argmax(np.where(orientation.used[rows], value, -np.inf)))
        tests.append((*names, test, ids[orientation.point[rows[worst]]], value[worst], limit[worst]))
    said = [f"{TESTS[test]} {value:.4g} at {point}, limit {limit:.4g}" for *_, test, point, value, limit in tests]
    columns = (*hidden("strip", "left", "right", "test", "point"), *hidden("value", "limit", form="ratio g5"))
    yield Rows("pair_tests", "", columns, tests, above=[f"What is left: {'; '.join(said)}."] if said else [])


def _round(names: tuple[str, ...], each: PairRound, count: int, unit: str, title: str) -> Rows:
    """Give elements before each step and what is added, in the end the elements found."""
    factor, which = PER_RADIAN[unit], "all points" if count == 1 else "without the rejected points"
    rows: list[tuple[Any, ...]] = [
        (*names, count, each.points, number, step.squares, *(step.elements * factor), *(step.step * factor))
        for number, step in enumerate(each.steps, 1)
    ]
    nothing = Cell("", None)
    rows.append(
        (*names, count, each.points, Cell("end", None), nothing, *(each.end * factor), *[nothing] * len(ELEMENTS))
    )
    columns = (
        *hidden("strip", "left", "right", "round", "points"),
        Field("iteration", "count", "step"),
        Field("[wqq]", "mm² e4"),
        *_greek(ELEMENTS, PRIMED, f"{unit} 6"),
        *_greek([f"d_{name}" for name in ELEMENTS], [f"d{name}" for name in PRIMED], f"{unit} e1", rank=1),
    )
    above = [Words(f"Round {count}, {which}: {counted(each.points, 'point')}", "head")]
    return Rows("pair_steps", title, columns, rows, above=above)


def _points(result: Result, strip: StripResult, number: int, names: tuple[str, ...]) -> Rows:
    """Give image coordinates, parallax, ray factor and strip coordinates of the points of a pair."""
    orientation, ids = strip.of_photos.orientation, result.refined.observations.point_ids
    formed = strip.of_photos.formed
    rows = orientation.pairs.rows_of(np.array([number]))
    pairs = orientation.pairs.take(np.array([number]))
    left = FirstPhoto(formed.rotations[number], formed.first.base)
    model, _ = intersect_models(orientation.take(np.array([number])), left, left_ray=formed.left_ray)
    image = np.column_stack([pairs.left, pairs.right, orientation.parallax[rows], model.ray_factor * left.base])
    points = [ids[point] for point in orientation.point[rows]]
    columns = (
        *hidden("strip", "left", "right"),
        Field("point"),
        *fields("x1 y1 x2 y2 q", "mm 4"),
        Field("N", "ratio 7"),
        *fields("X Y Z", "strip 6"),
        Field("used", head=""),
    )
    return Rows(
        "pair_points",
        "",
        columns,
        [
            (*names, point, *values, *xyz, _used(weight > 0))
            for point, values, xyz, weight in zip(points, image, formed.model_xyz[rows], pairs.weight, strict=True)
        ],
    )


def _chain(strip: StripResult, unit: str) -> Iterator[Rows]:
    """Give orientation and place of every photo in the strip, and the base that leads to it."""
    formed, factor, photos = strip.of_photos.formed, PER_RADIAN[unit], strip.strip.photos
    rows: list[tuple[Any, ...]] = []
    for number, photo in enumerate(photos):
        base: list[Any] = [Cell("", None)] * 6
        if number:
            directions = (formed.base_direction[number - 1], formed.base_inclination[number - 1])
            base = [*(each * factor for each in directions), *(formed.centers[number] - formed.centers[number - 1])]
            base.append(formed.scale_factor[number - 1])
        turn = formed.rotations[number]
        rows.append((strip.strip.id, photo, *base, *_turned(turn, factor), *formed.centers[number], *turn.ravel()))
    columns = (
        *hidden("strip"),
        Field("photo"),
        *_greek(("tau", "nu"), ("τ", "ν"), f"{unit} 6"),
        *fields("BX BY BZ", " 6"),
        Field("k", " 7"),
        *_greek(TURNS, TURN_HEADS, f"{unit} 6"),
        *fields("Xs Ys Zs", " 6"),
        *hidden(*MATRIX, form=" 8"),
    )
    title = f"Chain of strip {strip.strip.id}: orientation and base of every photo, eq. 125-136"
    yield Rows("chain", title, columns, rows)
    places = fields(" ".join(MATRIX), " 8")
    matrices = [(photo, *turn.ravel()) for photo, turn in zip(photos, formed.rotations, strict=True)]
    note = "A = A_taunu A(α2′, ω2′, κ2′), eq. 131-133, by rows."
    yield Rows("", "", (Field("photo"), *places), matrices, note=note)
    turns = base_frames(formed.rotations[:-1], strip.of_photos.orientation.elements).reshape(-1, 9)
    frames = [(strip.strip.id, *names, *turn) for names, turn in zip(pairwise(photos), turns.tolist(), strict=True)]
    note = (
        "A_taunu = A(α1, ω1, κ1) A(α1′, 0, κ1′)ᵀ, base frame to strip, eq. 128, by rows; its first column is the base."
    )
    yield Rows("base_frames", "", (*hidden("strip"), Field("left"), Field("right"), *places), frames, note=note)


def _scale_transfer(result: Result, strip: StripResult) -> Iterator[Rows]:
    """Give the pass points of every junction: distances, ratios, the factor."""
    formed, ids = strip.of_photos.formed, result.refined.observations.point_ids
    joined, form = formed.junctions, result.settings.formation.scale_transfer
    for number, factor in enumerate(joined.factor.tolist()):
        who = (strip.strip.id, strip.strip.photos[number + 1])
        rows = np.flatnonzero(joined.junction == number)
        center = formed.centers[number + 1]
        before = np.linalg.norm(formed.model_xyz[joined.before[rows]] - center, axis=1)
        after = np.linalg.norm(formed.model_xyz[joined.after[rows]] - center, axis=1) / formed.scale_factor[number + 1]
        k, ratios = factor * formed.scale_factor[number], joined.ratio[rows] * formed.scale_factor[number]
        one = joined.spread[number] * k
        columns = (
            *hidden("strip", "photo"),
            Field("point"),
            *fields("D D'", " 7"),
            Field("k_t", " 7", "k_t"),
            Field("", " e1", "k_t - k"),
            Field("used", head=""),
        )
        values = np.column_stack([before, after, ratios, ratios - k])
        points = [ids[point] for point in joined.point[rows]]
        yield Rows(
            "junction_points",
            f"Scale transfer at photo {who[1]}, eq. 139-141",
            columns,
            [
                (*who, point, *row, _used(used))
                for point, row, used in zip(points, values, joined.used[rows], strict=True)
            ],
        )
        spread = "" if np.isnan(one) else f"; standard deviation of one ratio {one:.1e}"
        said = f"k = {k:z.9f} ({form.replace('_', ' ')}){spread}."
        columns = (*hidden("strip", "photo", "form"), *hidden("k", "sd_of_one", form=" 7"))
        yield Rows("junctions", "", columns, [(*who, form, k, one)], above=[said])


def _absolute(result: Result, strip: StripResult, unit: str) -> Iterator[Rows]:
    similarity, frame, factor = strip.absolute.similarity, strip.intermediate, PER_RADIAN[unit]
    points, name = strip.formed.xyz[strip.control_rows], strip.strip.id
    moved = similarity(points)
    given = absolute_orientation.Targets(strip.control, result.frames, frame).of(moved)
    axes = "; ".join(" ".join(f"{value:z.9f}" for value in row) for row in frame.axes)
    facts = Facts(
        (
            ("A0", f"{frame.azimuth * factor:z.6f} {unit}"),
            ("origin, m", ", ".join(f"{value:z.4f}" for value in frame.origin)),
            ("M, by rows", axes),
        )
    )
    title = f"Absolute orientation of strip {name}, eq. 142-149"
    keys = ("A0", "origin_x", "origin_y", "origin_z", *(f"M_{place}" for place in MATRIX))
    first = (name, frame.azimuth * factor, *frame.origin, *frame.axes.ravel())
    columns = (*hidden("strip"), *hidden(*keys, form=" 7"), *hidden("sigma0", form=" g4"))
    yield Rows("absolute", title, columns, [(*first, strip.absolute.sigma0)], above=[facts])
    yield from _approximate(strip, points, given, similarity.scale)
    nothing = Cell("", None)
    steps: list[tuple[Any, ...]] = [
        (name, number, step.squares, *_similarity(step.similarity, factor), *step.step)
        for number, step in enumerate(similarity_steps(result, strip), 1)
    ]
    steps.append((name, Cell("end", None), nothing, *_similarity(similarity, factor), *[nothing] * 7))
    sigma0 = strip.absolute.sigma0
    yield Rows(
        "similarity_steps",
        "",
        (
            *hidden("strip"),
            Field("iteration", "count", "step"),
            Field("[wvv]", " g6"),
            Field("s", " 7"),
            *_greek(SIMILARITY, SIMILARITY_HEADS, f"{unit} 6"),
            *fields("X0 Y0 Z0", "m 4"),
            *fields("dX0 dY0 dZ0", "m e1", rank=1),
            *hidden("d_rotation_1", "d_rotation_2", "d_rotation_3", "d_scale", form="m e1"),
        ),
        steps,
        note="no redundancy" if np.isnan(sigma0) else f"σ0 = {sigma0:.4g}",
    )
    yield Rows(
        "similarity_control",
        "",
        (
            *hidden("strip"),
            Field("point"),
            Field("use"),
            *fields("X Y Z", "strip 6"),
            *fields("given_X given_Y given_Z", "m 3", "X Y Z", "given, m"),
            *fields("vX vY vZ", "m 3"),
        ),
        [
            (name, point, "".join(compress("xyz", use)), *row)
            for point, use, row in zip(
                strip.control.ids, strip.control.use.tolist(), np.hstack([points, given, moved - given]), strict=True
            )
        ],
        note="v: strip minus given after the similarity, in the intermediate frame.",
    )


def _similarity(found: Similarity, factor: float) -> tuple[float, ...]:
    return (found.scale, *_turned(found.rotation, factor), *found.shift)


def _approximate(strip: StripResult, points: Floats, given: Floats, scale: float) -> Iterator[Rows]:
    """Give the scale r from the distances of control points that are given in full, t = s / r; eq. 145-148."""
    full = np.flatnonzero(strip.control.use.all(axis=1))
    if len(full) < 2:
        return
    found, name = pair_scales(points[full], given[full]), strip.strip.id
    ids, centroid = [strip.control.ids[row] for row in full.tolist()], points[full].mean(axis=0)
    pairs = [
        (name, ids[first], ids[second], source, target, target / source)
        for first, second, source, target in zip(
            found.first.tolist(), found.second.tolist(), found.source.tolist(), found.target.tolist(), strict=True
        )
    ]
    columns = (Field("D", "strip 6"), Field("DG", "m 3"), Field("r", " g9"))
    yield Rows(
        "control_distances",
        "",
        (*hidden("strip"), Field("from"), Field("to"), *columns),
        pairs if len(full) <= PAIRED else [],
    )
    r, t = found.mean, scale / found.mean
    center = ", ".join(f"{value:z.6f}" for value in centroid)
    keys = (
        *hidden("strip"),
        *hidden("r", "t", form=" g9"),
        *hidden("centroid_x", "centroid_y", "centroid_z", form=" 6"),
    )
    said = f"r = {r:.9g}, t = s/r = {t:.9g}; centroid of the strip's control {center}."
    yield Rows("approximate", "", keys, [(name, r, t, *centroid)], above=[said])


def _polynomial(result: Result, strip: StripResult) -> Iterator[Rows]:
    found, name = strip.polynomial, strip.strip.id
    if found is None:
        return
    xyz = strip.absolute.similarity(strip.formed.xyz[strip.control_rows])
    corrected = found(xyz)
    given = absolute_orientation.Targets(strip.control, result.frames, strip.intermediate).of(corrected)
    who = hidden("strip")
    yield listed(
        "polynomial_evidence",
        f"Polynomials of strip {name}, eq. 150-151",
        (
            *constant(strip=name, found=found.degree),
            Field("group"),
            Field("degree", "count"),
            *fields("rms left_out", "m 4"),
            Field("F", " g4", of="f"),
            Field("p", " g3"),
            Field("taken", head="", of=lambda each: Cell("taken" if each.accepted else "", bool(each.accepted))),
        ),
        found.evidence,
    )
    terms = [
        (name, axis, *row, fit.sigma0)
        for axis, fit in zip("XYZ", found.axes, strict=True)
        for row in zip(fit.terms, fit.coefficients.tolist(), fit.sigmas.tolist(), strict=True)
    ]
    none: list[Part | str] = [] if terms else ["No term is taken."]
    columns = (Field("axis", head="added to"), Field("term"), Field("coefficient", " e8"), Field("sigma", " e2", "±"))
    yield Rows("polynomial_terms", "", (*who, *columns, *hidden("sigma0", form="m 3")), terms, above=none)
    left = np.hstack([xyz[:, :2], given - xyz, corrected - given])
    yield Rows(
        "polynomial_control",
        "",
        (*who, Field("point"), *fields("X Y lX lY lZ vX vY vZ", "m 3")),
        [(name, point, *row) for point, row in zip(strip.control.ids, left, strict=True)],
        note="l: given minus strip; v: corrected minus given.",
    )
