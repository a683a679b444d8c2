"""Sections on points and photos: what is left at given ones, their precision, residuals, what was rejected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import nlargest
from itertools import groupby
from math import fabs, hypot
from operator import itemgetter
from typing import Any

from photostrip.notes import Document, before, counted, listed
from photostrip.report.page.parts import Facts, Part, Table, Words
from photostrip.report.page.tables import (
    Field,
    Rows,
    column_of,
    fields,
    fixed,
    keyed,
    largest_of,
    metres,
    micrometres,
    note_of,
    signed,
    tabulated,
    taken,
    with_unit,
    worst_first,
)
from photostrip.report.sections.project import cameras_of, scale_word

AXES = ("x", "y", "z")
LETTERS = {"east": "x", "north": "y", "up": "z"}  # of `use`
DIFFERENCES = ("dx", "dy", "dz")
PARTS = "plan", "height"
IDS_NAMED = 12
WORST_POINTS = 8
FAILED_SHOWN = 3  # folds of a cross-validation that could not be adjusted
MOST_MARKS, WORST_MARKS = 100, 50  # of given points: more are summed up point by point, with the worst of them
UNTESTED = dict.fromkeys(("plan", "height", "p_plan", "p_height"))
MEANING = (
    "σ: of the adjusted point; d/σ: difference over its standard deviation, with that of the given point (in plan by "
    "the whole covariance, 95 % lie below 2.45); p: probability of a larger one"
)
BASES = {"a-priori": "as stated", "a-posteriori": "found by the adjustment"}


def _given(document: Document, role: str) -> Rows:
    """Return the given points of a role that have coordinates in the result."""
    return document["control"].where(role=role, measured=True)


def control(document: Document, most: int | None = None) -> Iterator[Part]:
    rows = _given(document, "control")
    rows = rows[[use != "off" for use in rows.values("use")]]
    wrong = " Coordinates with a minus under `use` were found wrong and were not used; the last lines leave them out."
    yield Words(
        "Adjusted minus given. These points took part in the adjustment: what is left here is smaller than the errors "
        "between them." + wrong * any(rows.values("rejected"))
    )
    yield given_table(document, rows, "control", most)
    yield from _unused(document)


def given_table(document: Document, given: Rows, role: str, most: int | None) -> Table:
    """Return the table of given points of a role with their differences, the worst first."""
    summary = document["summary"]
    shown, note = worst_first(given, "normalised", ("point", role, "control"), most)
    used = Field("use"), [_used(row) for row in shown]
    known = (size for size, out in zip(given.values("normalised"), given.values("rejected"), strict=True) if not out)
    plan, height = summary[role]["plan"], summary[role]["height"]
    over = max((each for each in known if each is not None), default=None)
    rms, mean, most_of_all = _sums(_differences(document), given)
    rms |= {"plan_um": micrometres(plan["rms_um"]), "height_um": micrometres(height["rms_um"])}
    rms |= {"normalised": fixed(summary[role]["normalised"], 2)}
    most_of_all |= {"plan_um": micrometres(plan["max_um"]), "height_um": micrometres(height["max_um"])}
    most_of_all |= {"normalised": fixed(over, 2)}
    other = "the adjustment" if "bundle" in document else "a model point"
    below = (
        f"plan, height: at {scale_word(document)} scale; d/σ: the largest over the standard deviation of the given "
        f"point and of {other}"
    )
    keys = "id used dx dy dz plan_um height_um normalised:1 sigma_1:2 sigma_2:2 sigma_3:2 strips:3"
    return keyed(shown, keys, note_of(note, below), foot=(rms, mean, most_of_all), used=used)


def _used(row: Document) -> str:
    """Coordinates that count, then with a minus those that were found wrong."""
    if not row["rejected"]:
        return str(row["use"])
    kept = "".join(letter for letter in row["use"] if letter not in row["rejected"])
    return f"{kept} -{row['rejected']}".strip()


def _differences(document: Document) -> list[tuple[str, str]]:
    """Return the keys of differences with their axes."""
    return list(zip(DIFFERENCES, document["frame"]["axes"], strict=True))


def _sums(axes: Iterable[tuple[str, str]], rows: Rows) -> list[dict[str, str]]:
    """Return the lines below differences: rms, mean and largest along each axis of those that count."""
    values = {key: [row[key] for row in rows if row[key] is not None and _counts(row, axis)] for key, axis in axes}
    return [
        {"id": "rms"} | {key: metres(_rms(own)) for key, own in values.items()},
        {"id": "mean"} | {key: signed(sum(own) / len(own) if own else None) for key, own in values.items()},
        {"id": "largest"} | {key: signed(max(own, key=fabs, default=None)) for key, own in values.items()},
    ]


def _counts(row: Document, axis: str) -> bool:
    """Whether a difference counts in sums: not at rejected control, nor at a check point beside all others."""
    out = row["stands_out"] if row.get("role") == "check" else ()
    if axis not in LETTERS:  # neither plan nor height
        return not row.get("rejected") and not out
    return LETTERS[axis] not in row.get("rejected", "") and ("height" if axis == "up" else "plan") not in out


def _unused(document: Document) -> Iterator[Part]:
    """Name given points that were not used, and say why."""
    rows = document["control"]
    refused = set(column_of(document["not_determined"], "id"))
    lost = rows.where(measured=False).values("id")
    named = {
        "given, but not measured": [name for name in lost if name not in refused],
        "without coordinates": [name for name in lost if name in refused],
        "switched off": rows.where(measured=True, role="control", use="off").values("id"),
    }
    if facts := tuple((label, listed(names, IDS_NAMED)) for label, names in named.items() if names):
        yield Facts(facts)


def positions(document: Document, most: int | None = None) -> Iterator[Part]:
    """Give what is left at the camera positions that took part in the adjustment."""
    rows = document.get("positions", ())
    if not len(rows):
        return
    over = zip(*(rows.values(f"normalised_{axis}") for axis in LETTERS), strict=True)
    worst = [max((fabs(each) for each in row if each is not None), default=0.0) for row in over]
    shown, note = worst_first(rows, worst, ("camera position", "positions", "positions"), most)
    below = note_of(note, "d/σ: difference over its standard deviation")
    used = Field("use"), [_used(row) for row in shown]
    foot = [{"photo": line.pop("id"), **line} for line in _sums([(f"d_{axis}", axis) for axis in LETTERS], rows)]
    wrong = " A minus under `use`: found wrong, not used." * any(rows.values("rejected"))
    yield Words(f"Adjusted minus given, offset and drift taken off.{wrong}")
    yield keyed(shown, "photo used d_* normalised_* sigma_*:2", below, foot=foot, used=used)


def check(document: Document, most: int | None = None) -> Iterator[Part]:
    given = _given(document, "check")
    if not len(given):
        unproven = " What lies between the control points is not proven by anything in this report."
        yield Words("None." + unproven * ("cross_validation" not in document))
        return
    yield Words("Adjusted minus given: how good the new points are.")
    tests = document.get("precision", {}).get("check", {})
    if not tests or not len(tests["points"]):
        yield given_table(document, given, "check", most)
        return
    points = document["points"].where(role="check")
    known, tested = ({row["id"]: row for row in rows} for rows in (points, tests["points"]))
    chances = [-_chance(tested[name]) if name in tested else -1.0 for name in given.values("id")]
    shown, note = worst_first(given, chances, ("point", "check", "control"), most)
    quantities = points.quantities | given.quantities | tests["points"].quantities
    blank = dict.fromkeys(quantities)
    rows = [blank | known.get(row["id"], {}) | row | UNTESTED | tested.get(row["id"], {}) for row in shown]
    odd = [row["id"] for row in given if row["stands_out"]]
    below = note_of(note, MEANING, f"the last lines are without {listed(odd, IDS_NAMED)}" if odd else "")
    seen = {part: (tests[part]["rms"], tests[part]) for part in PARTS}
    yield _unseen(document, given, rows, seen, "use:2 strips:3", below, quantities)


def cross_validation(document: Document, most: int | None = None) -> Iterator[Part]:
    """Give differences at control that was left out in turn."""
    if "cross_validation" not in document:
        return
    block = document["cross_validation"]
    rows = block["points"]
    failed = [fold for fold in block["folds"] if fold["reason"]]
    chance = "" if block["p"] is None else f" Probability of larger errors: {100 * block['p']:.1f} %."
    yield Words(
        f"The same adjustment without some of the control, {counted(len(block['folds']) - len(failed), 'time')}: "
        f"adjusted minus given at the points that it did not see.{chance}"
    )
    for fold in failed[:FAILED_SHOWN]:
        yield Words(f"not without {listed(fold['left_out'], IDS_NAMED)}: {fold['reason']}", "look", "-")
    if len(rows):
        where = ("point", "cross-validation", "cross_validation")
        shown, note = worst_first(rows, [-_chance(row) for row in rows], where, most)
        seen = {f"z_{part}": (block[part]["ratio"], block[part]) for part in PARTS}
        explained = most is not None and document["summary"]["check"]["plan"]["count"]  # above, at the check points
        below = note if explained else note_of(note, MEANING)
        yield _unseen(document, rows, shown, seen, "fold:2", below, rows.quantities)


def _chance(row: Document) -> float:
    """Return how probable the difference of a point is, in plan or in height."""
    return min((chance for part in PARTS if (chance := row[f"p_{part}"]) is not None), default=1.0)


def _unseen(
    document: Document,
    rows: Sequence[Document],
    shown: Rows,
    seen: dict[str, tuple[float | None, Document]],
    more: str,
    note: str,
    quantities: Mapping[str, Any],
) -> Table:
    """Return the table of points that the adjustment has not seen.

    seen: by the keys of columns, rms of the differences over their standard deviations, and how many lie inside their
        95 % limits.
    more: further columns.
    """
    rms, *others = _sums(_differences(document), rows)
    rms |= {key: fixed(ratio, 2) for key, (ratio, _) in seen.items()}
    inside = {key: f"{part['inside_95']} of {part['count']}" for key, (_, part) in seen.items() if part["count"]}
    plan, height = seen
    keys = f"id dx dy dz sigma_x:1 sigma_y:1 sigma_z:1 {plan} p_plan {height} p_height {more}"
    return keyed(shown, keys, note, foot=(rms, *others, {"id": "in 95 %"} | inside), quantities=quantities)


def _rms(values: Sequence[float]) -> float | None:
    return (sum(value * value for value in values) / len(values)) ** 0.5 if values else None


def weights(document: Document) -> Iterator[Part]:
    """Give the standard deviation of every control coordinate as stated and as it counted in the fit."""
    if "bundle" in document:
        return
    given = _given(document, "control")
    if not len(given):
        yield Words("No control point was measured.")
        return
    letters = {f"_{n}": "z" if axis in {"up", "z"} else "x" for n, axis in enumerate(document["frame"]["axes"], 1)}
    rows = [  # what does not count weighs nothing
        row | {key: None for key in row if letters.get(key[-2:], "") not in row["use"]} for row in given
    ]
    note = note_of(
        "σ: as given, then in the fit, combined with that of a model point; the weight of a coordinate is 1 / σ²",
        "columns in the order of the axes of each list" if len(set(given.values("list"))) > 1 else "",
    )
    yield keyed(rows, "id use sigma_1:1 sigma_2:1 sigma_3:1 sigma_fit_* list:2", note, quantities=given.quantities)


def ties(document: Document) -> Iterator[Part]:
    """Give differences of points that two strips share."""
    if document["counts"]["strips"] < 2 or "bundle" in document:
        return
    rows = document["ties"]
    if not len(rows):
        yield Words("The strips have no points in common.")
        return
    foot = {key: metres(_rms(rows.values(key))) for key in DIFFERENCES}
    foot |= {key: micrometres(_rms(rows.values(key))) for key in ("plan_um", "height_um")}
    note = "second strip minus first; the result is their mean"
    yield keyed(rows, "id strips dx dy dz plan_um height_um", note, foot=[{"id": "rms", **foot}])


def images(document: Document) -> Iterator[Part]:
    """Give photos and points with the largest image residuals under the final orientations."""
    if "links" in document:
        return
    text = (
        "Photos and points come from one adjustment. "
        if "bundle" in document
        else "Every photo is oriented again on its adjusted points, so that orientations and points agree. "
    )
    yield Words(f"{text}rms of the image residuals {micrometres(document['summary']['image_rms_um'])} µm.")
    rays = Counter(column_of(document["points"], "rays"))
    yield Facts((("points by photos", ", ".join(f"{rays[n]} on {counted(n, 'photo')}" for n in sorted(rays))),))
    columns = {"photos": "id image_rms_um points strip:1 *:2", "points": "id image_rms_um rays role:1 *:2"}
    for block, keys in columns.items():
        rows = document[block]
        worst = taken(rows, largest_of(rows, "image_rms_um", WORST_POINTS))
        yield keyed(worst, keys, f"the worst {len(worst)} of {len(rows)} {block}")


def precision(document: Document) -> Iterator[Part]:
    """Give standard deviations carried from the image coordinates and the control to points and photos."""
    if "precision" not in document:
        return
    block = document["precision"]
    measured = "model" if "links" in document else "image"
    yield Words(
        f"Standard deviations propagated from the {measured} coordinates and the control through every step of the "
        "adjustment. They cover random errors: what a lens, the film or refraction does to a whole strip is "
        "not included."
    )
    basis = list(block["basis"] if len(document["strips"]) else block["basis"][:1])
    sigmas = [f"{micrometres(each['sigma_um'])} µm, {BASES[each['basis']]}" for each in basis]
    if len(basis) > 1:
        sigmas = [f"strip {each['strip']} {sigma}" for each, sigma in zip(basis, sigmas, strict=True)]
    facts = [(f"{measured} coordinates", ", ".join(sigmas)), *precision_lines(block, "points, {}")]
    yield Facts((*facts, *_check(block.get("check"))))
    yield _least_precise(document["points"])
    if len(block["along"]):
        keys = "photo distance points plan height centre_plan:1 centre_height:1"
        note = "rms of the points nearest to each photo, and its perspective centre; distance: from the first photo"
        yield keyed(block["along"], f"{keys} strip:2" if len(document["strips"]) > 1 else keys, note)


def precision_lines(block: Document, label: str) -> Iterator[tuple[str, str]]:
    """Say how precise points are in plan, east and north together, and in height."""
    for name, part in block["points"].items():
        yield label.format(name), f"rms {metres(part['rms'])} m, largest {metres(part['max'])} m at {part['worst']}"


def _check(check: Document | None) -> Iterator[tuple[str, str]]:
    """Say how the errors at check points go with the standard deviations."""
    if not check:
        return
    parts = [
        f"{part['inside_95']} of {part['count']} inside the 95 % {what}, rms {fixed(part['rms'], 2)}"
        for part, what in ((check["plan"], "ellipse in plan"), (check["height"], "interval in height"))
        if part["count"]
    ]
    yield "check points", f"{'; '.join(parts)} in units of their standard deviations"
    for test in check["tests"]:
        count = counted(test["coordinates"], "coordinate")
        text = (
            f"chi-square {fixed(test['squares'], 1)} for {count}, probability of a larger one {100 * test['p']:.1f} %"
        )
        yield "all together" if len(check["tests"]) == 1 else f"together, strip {test['strip']}", text


def _least_precise(points: Rows) -> Table:
    """Points with the largest error ellipse, and with the largest standard deviation in height."""
    places = largest_of(points, "ellipse_a", WORST_POINTS // 2)
    by_height = [place for place in largest_of(points, "sigma_z", WORST_POINTS) if place not in places]
    note = "the least precise in plan, then in height; a, b: semi-axes of the standard error ellipse in plan (39 %)"
    keys = "id sigma_x sigma_y sigma_z ellipse_a ellipse_b ellipse_azimuth_deg:1 rays:2 role:3"
    return keyed(taken(points, [*places, *by_height[: WORST_POINTS - len(places)]]), keys, note)


def marks(document: Document, most: int | None = None) -> Iterator[Part]:
    """Give what is left at marks of given points on each photo, in pixels where its camera has some."""
    place = {name: number for number, name in enumerate(document["control"].values("id"))}
    rows = sorted(_marks(document), key=lambda mark: place[mark["point"]])
    if rows:
        text = "Measured minus computed from the adjusted coordinates: what shows here is a mark beside its point."
        yield Words(text)
    for unit, decimals in (("px", 2), ("µm", 1)):
        own = [mark for mark in rows if mark["unit"] == unit]
        if not own:
            continue
        yield Facts(tuple(_summed(own, f"{unit} {decimals}")))
        lengths = [mark["length"] for mark in own]
        shown, note = worst_first(own, lengths, ("mark", "marks", "residuals"), most)
        if len(shown) > MOST_MARKS:
            yield _by_point(own, unit, decimals)
            shown = nlargest(WORST_MARKS, own, key=itemgetter("length"))
            note = f"the worst {WORST_MARKS} of {len(own)}; `residuals` in result.json has all"
        tested = any(mark["test"] is not None for mark in shown)
        columns = (
            *map(Field, ("point", "role", "photo")),
            *fields("x y", f"{unit} +{decimals}", "v_x v_y"),
            Field("test", " 2", shown=tested),
            Field("state", head=""),
        )
        below = note_of(note, "test: the larger of both over its standard deviation" if tested else "")
        yield tabulated(columns, ([mark[column.key] for column in columns] for mark in shown), below)


def _by_point(marks: Sequence[Document], unit: str, decimals: int) -> Table:
    """Sum up the marks of each given point, in the order of the list."""
    sizes = fields("rms largest", f"{unit} {decimals}")
    columns, rows = (Field("point"), Field("role"), Field("marks", " 0"), *sizes, Field("on")), []
    for _, group in groupby(marks, itemgetter("point")):
        own = list(group)
        rms, worst = _rms_and_worst(own)
        rows.append([worst["point"], worst["role"], len(own), rms, worst["length"], worst["photo"]])
    return tabulated(columns, rows, "rms of a coordinate; largest: the mark farthest from its point")


def _rms_and_worst(marks: Sequence[Document]) -> tuple[float, Document]:
    """Return the rms of a coordinate of marks, and the mark farthest from its point."""
    rms = (sum(mark["length"] ** 2 for mark in marks) / (2 * len(marks))) ** 0.5
    return rms, max(marks, key=itemgetter("length"))


def _marks(document: Document) -> Iterator[Document]:
    """Give the rays of given points, photo by photo, with their residuals."""
    roles = dict(zip(document["control"].values("id"), document["control"].values("role"), strict=True))
    cameras = cameras_of(document)
    for row in document["residuals"].where(point=set(roles)) if "residuals" in document else ():  # not of a baseline
        x, y = row["vx_um"], row["vy_um"]
        if x is None or y is None:
            continue
        pixel = 1000.0 * (cameras.get(row["photo"], {}).get("pixel_size_mm") or 0.0)
        size = pixel or 1.0
        tests = [row.get("test_x"), row.get("test_y")]
        yield {
            "point": row["point"],
            "role": roles[row["point"]],
            "photo": row["photo"],
            "x": x / size,
            "y": y / size,
            "unit": "px" if pixel else "µm",
            "length": hypot(x, y) / size,
            "test": None if None in tests else max(map(abs, tests)),
            "used": row["used"],
            "state": "" if row["used"] else "not used",
        }


def _summed(marks: Sequence[Document], form: str) -> Iterator[tuple[str, str]]:
    """Sum up the marks of control and of check points that took part."""
    for role in ("control", "check"):
        own = [mark for mark in marks if mark["used"] and mark["role"] == role]
        if own:
            rms, worst = _rms_and_worst(own)
            largest = f"{with_unit(worst['length'], form)} at {worst['point']} on {worst['photo']}"
            yield role, f"{counted(len(own), 'mark')}, rms {with_unit(rms, form)}; largest {largest}"


def rejected(document: Document) -> Iterator[Part]:
    rows = standing_rejections(document)
    keys = "point photo+other_photo test value limit unit reason:1"
    note = "value: of the test, beyond its limit"
    yield keyed(rows, keys, note) if len(rows) else Words("Nothing was rejected.")


def standing_rejections(document: Document) -> Rows:
    """Return the measurements that were rejected and not taken back."""
    return document["rejected"].where(readmitted=False)


def not_determined(document: Document) -> Iterator[Part]:
    """Name points that have no coordinates, by reason."""
    for reason, names in missing_points(document):
        yield Words(f"{counted(len(names), 'point')} ({reason}): {listed(names, len(names))}", mark="-")
    if not len(document["not_determined"]):
        yield Words("None.")


def missing_points(document: Document) -> list[tuple[str, list[str]]]:
    missing = sorted(document["not_determined"], key=itemgetter("reason"))
    return [(reason, [row["id"] for row in group]) for reason, group in groupby(missing, key=itemgetter("reason"))]


def notes(document: Document) -> Iterator[Part]:
    for each in document["notes"]:
        yield Words(f"{each['severity']}: {sentence_of(each)}", "look" if each["severity"] == "warning" else "", "-")
    if not len(document["notes"]):
        yield Words("None.")


def sentence_of(note: Document) -> str:
    """Return a note with its place."""
    return before(note["file"], note["line"], note["column"]) + str(note["message"])
