"""Two results beside each other: numbers by the kind of their tolerance, ids, choices and findings as sets."""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.notes import Document
from photostrip.result.certificate import OF_VALUES, faults_of_edited
from photostrip.result.description import LEFT_OUT, Block, Columns, Quantity, described
from photostrip.result.distances import difference_in_plan_and_height, plan_and_height
from photostrip.result.numbers import MATRIX
from photostrip.result.table import Table

WORDS = {"photos": "photo", "points": "point", "control": "given point", "strips": "strip", "models": "model"}
Member = tuple[str, str, str]  # block, id, what it is


def members_of(document: Document, kind: str) -> set[Member]:
    """Return the members of one set of a result: ``ids``, ``choices``, ``rejected`` or ``findings``."""
    return set(MEMBERS[kind](document))


def missing_and_new(now: set[Member], before: set[Member]) -> tuple[list[Document], list[Document]]:
    """Return what stands in the baseline only, and what in the result only, in order."""
    return [_plain(each) for each in sorted(before - now)], [_plain(each) for each in sorted(now - before)]


def _plain(member: Member) -> Document:
    block, name, what = member
    return {"block": block, "id": name, "what": what}


def _ids(document: Document) -> Iterator[Member]:
    for block, word in WORDS.items():
        for name in names_of(document[block]):
            yield block, name, f"{word} {name}"


def _choices(document: Document) -> Iterator[Member]:
    """Return what is neither a number nor an id, but decides what the numbers are."""
    yield "status", "", f"status {document['status']}"
    yield "adjustment", "", f"adjustment {document['adjustment']}"
    for block in document.get("polynomials", []):
        yield "polynomials", block["strip"], f"degree {block['degree']} of strip {block['strip']}"
        for axis in "xyz":
            terms = " ".join(document["polynomial_terms"].where(strip=block["strip"], axis=axis)["term"]) or "none"
            yield "polynomials", block["strip"], f"terms of {axis}, strip {block['strip']}: {terms}"
    for row in document["points"]:
        if row["role"] != "new":
            yield "points", row["id"], f"{row['id']} is {row['role']}"
    for row in document["control"]:
        yield "control", row["id"], f"{row['id']} counts as {row['role']} in {row['use']}"
    for each in document["tolerances"]:
        yield "tolerances", each["name"], f"tolerance {each['name']} {'kept' if each['passed'] else 'NOT KEPT'}"


def _rejected(document: Document) -> Iterator[Member]:
    for row in document["rejected"]:
        if not row["readmitted"]:
            photos = " – ".join(photo for photo in (row["photo"], row["other_photo"]) if photo)
            where = f" on {photos}" if photos else ""
            yield "rejected", row["point"], f"{row['point']}{where}, {row['stage'].replace('_', ' ')}"


def _findings(document: Document) -> Iterator[Member]:
    """Return notes by their code and what they are about; their words hold numbers that are compared elsewhere."""
    for note in document["notes"]:
        about = [f"strip {note['strip']}"] if note["strip"] else []
        about += [f"photo {photo}" for photo in note["photos"]] + [f"point {point}" for point in note["points"]]
        yield "notes", note["code"], f"{note['severity']} {note['code']}{': ' if about else ''}{', '.join(about)}"
    for each in document.get("findings", []):
        about = [f"{one} {name}" for one in ("strip", "photo", "point") for name in each[f"{one}s"]]
        words = f"{each['severity']} {each['code']}, {each['title']}{': ' if about else ''}{', '.join(about)}"
        yield "findings", each["code"], words
    for row in document["not_determined"]:
        yield "not_determined", row["id"], f"point {row['id']} has no coordinates"


MEMBERS = {"ids": _ids, "choices": _choices, "rejected": _rejected, "findings": _findings}


# Kinds of quantities and the unit of their absolute tolerances. Statistics have two: metres, micrometres.
UNITS = {
    "plan": "m",
    "height": "m",
    "rotation": "deg",
    "sigma0": "um",
    "scale": "",
    "precision": "m",
    "statistics": "m",
    "counts": "",
}
SETS = ("ids", "choices", "rejected", "findings")


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of one kind of quantity; the larger of its two parts counts."""

    absolute: float = 0.0
    relative: float = 0.0  # difference allowed, as a share of the size in the baseline
    absolute_um: float = 0.0  # as `absolute`, for statistics in micrometres
    ignore: bool = False


@dataclass(frozen=True)
class SetTolerance:
    """How many elements of a set may be missing or new."""

    missing: int = 0
    new: int = 0
    ignore: bool = False


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of all kinds.

    The defaults let pass what another processor or another version of the numerical libraries changes, and hardly
    anything else: two units of the last digit that result.json shows.
    """

    # plan, height: ground points, perspective centres and differences at control, metres
    plan: Tolerance = Tolerance(absolute=0.0002)
    height: Tolerance = Tolerance(absolute=0.0002)
    # angle between two rotations, and elements of relative orientation, degrees
    rotation: Tolerance = Tolerance(absolute=2e-6)
    sigma0: Tolerance = Tolerance(absolute=0.02)  # standard deviation of an image coordinate of weight one, micrometres
    scale: Tolerance = Tolerance(relative=1e-8)  # scale factors of models, junctions and of the strip, ratios
    precision: Tolerance = Tolerance(absolute=0.0002, relative=0.001)
    statistics: Tolerance = Tolerance(absolute=0.0002, relative=0.001, absolute_um=0.11)
    counts: Tolerance = Tolerance()
    # ids, choices, rejected, findings: photos, points, models and given points; adjustment, degrees, terms, roles,
    # status and verdicts; measurements taken out; notes and points without coordinates
    ids: SetTolerance = SetTolerance()
    choices: SetTolerance = SetTolerance()
    rejected: SetTolerance = SetTolerance()
    findings: SetTolerance = SetTolerance()

    def of(self, kind: str) -> Tolerance:
        found: Tolerance = getattr(self, kind)
        return found

    def allowed(self, kind: str, unit: str, before: float) -> float:
        """Return the largest difference that is allowed for a number.

        The absolute part of a tolerance holds for numbers in the unit of their kind only: a statistic without a unit
        has the relative part alone.
        """
        tolerance = self.of(kind)
        absolute = tolerance.absolute if unit == UNITS[kind] else tolerance.absolute_um if unit == "um" else 0.0
        return max(absolute, tolerance.relative * abs(before))


NAME = "name"  # said of the columns that name the rows of a table


class ComparedNumber(NamedTuple):
    """One number of a result."""

    kind: str
    block: str
    id: str  # id of the photo, point, model or strip; empty for the whole project
    name: str
    unit: str  # its unit; empty for ratios and counts
    value: float | None  # the number; None where the result has none


def quantities_of(document: Document) -> Iterator[ComparedNumber]:
    """Return all single numbers of a result whose description has a kind of tolerance.

    The combination of block, id and name stands once.
    """
    for key, block in described().items():
        if isinstance(block, Columns) and key in document:
            yield from _of_table(key, document[key])
        elif isinstance(block, Block) and key in document:
            yield from _of_block(key, "", document[key], block)


def _of_block(block: str, path: str, values: Document, entries: Block) -> Iterator[ComparedNumber]:
    for key, value in values.items():
        entry, name = entries.get(key), f"{path}.{key}" if path else key
        if isinstance(entry, Block) and isinstance(value, dict):
            yield from _of_block(block, name, value, entry)
        elif isinstance(entry, Quantity) and entry.compared:
            yield ComparedNumber(kind=entry.compared, block=block, id="", name=name, unit=entry.unit, value=value)


def _of_table(block: str, table: Table) -> Iterator[ComparedNumber]:
    ids = names_of(table)
    for key in table.columns:
        entry = table.quantities[key]
        if entry.compared and entry.compared != NAME:
            for name, value in zip(ids, table.values(key), strict=True):
                yield ComparedNumber(kind=entry.compared, block=block, id=name, name=key, unit=entry.unit, value=value)


def names_of(table: Table) -> list[str]:
    """Return what the rows of a table are called; a model by its photos, which may stand in several strips."""
    columns = [table.values(key) for key in table.columns if table.quantities[key].compared == NAME]
    return [" – ".join(row) for row in zip(*columns, strict=True)]


SCHEMA = 1
RECORDS_IN_SETS = {
    "photos",
    "points",
    "models",
    "strips",
    "polynomials",
    "polynomial_terms",
}  # whose records a set counts
SAME_FRAME = {
    "crs": "the CRS",
    "kind": "the kind of frame",
    "axes": "the order of the axes",
    "plan_unit": "the unit of plan coordinates",
    "height_unit": "the unit of heights",
    "heights": "the heights",
}


def baseline_of(document: Document) -> Document:
    """Return a result without the version and the residuals of single measurements, two thirds of it: a baseline."""
    return {key: value for key, value in document.items() if key not in LEFT_OUT}


def compare_results(
    document: Document, baseline: Document, tolerances: Tolerances | None = None, files: tuple[str, str] = ("", "")
) -> Document:
    """Compare a result with a baseline, which may be a short one.

    Returns ``status`` (``same``, ``different``); ``kinds``: for each kind of quantity how many were compared and how
        many differ by more than allowed, and the worst; ``differences``: all of these, worst first; ``lacking``: the
        quantities that one of the two does not have at all, which is a difference where the result lacks them;
        ``sets``: what is missing and new in each set.
    Raises InputError when they cannot be compared: other frames, nothing in common, a document that is not whole.
    """
    _require_comparable(document, baseline, files)
    tolerances = tolerances or Tolerances()
    with faults_of_edited("compared", (document, files[0]), (baseline, files[1]), errors=OF_VALUES):
        numbers = _Numbers(_by_place(document), _by_place(baseline))
        rows = [*_compared(numbers, tolerances), *_located(document, baseline, tolerances)]
        lacking = list(_lacking(numbers, tolerances))
        sets = [_set(kind, document, baseline, tolerances) for kind in SETS]
        name = document["name"]
    kinds = [_kind(kind, rows, tolerances) for kind in UNITS]
    differences = sorted((row for row in rows if row["differs"]), key=_rank)
    different = bool(differences) or any(each["differs"] for each in (*lacking, *sets))
    return {
        "photostrip_compare": SCHEMA,
        "result": files[0],
        "baseline": files[1],
        "name": name,
        "status": "different" if different else "same",
        "kinds": kinds,
        "sets": sets,
        "lacking": lacking,
        "differences": [_without_verdict(row) for row in differences],
    }


def _require_comparable(document: Document, baseline: Document, files: tuple[str, str]) -> None:
    """Refuse results of different frames, or of different strips, with all reasons."""
    faults = []
    frame, other = (_frame(each) for each in (document, baseline))
    for key, words in SAME_FRAME.items():
        now, before = frame.get(key), other.get(key)
        if _folded(now) != _folded(before):
            message = f"cannot be compared with {files[1] or 'the baseline'}: {words} is {_shown(now)}"
            fix = "write both in one frame (`output` in the project), or renew the baseline with --update"
            faults.append(
                Fault(message, "not-comparable", file=files[0], key=f"frame.{key}", expected=_shown(before), fix=fix)
            )
    if not faults and not _common_points(document, baseline):
        message = f"cannot be compared with {files[1] or 'the baseline'}: no point is in both"
        fix = "is it the baseline of another strip?"
        faults.append(Fault(message, "not-comparable", file=files[0], key="points", expected="the same strip", fix=fix))
    if faults:
        raise InputError(faults)


def _frame(document: Document) -> Document:
    """Return the frame of a document; an empty one when there is none."""
    return dict(document.get("frame") or {})


def _common_points(document: Document, baseline: Document) -> bool:
    now, before = (set(each["points"]["id"]) if "points" in each else set() for each in (document, baseline))
    return bool(now & before)


def _folded(value: object) -> object:
    return value.casefold() if isinstance(value, str) else value


def _shown(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else "missing" if value is None else str(value)


Key = tuple[str, str, str]  # block, id, name


class _Numbers(NamedTuple):
    """The single numbers of two results by their place."""

    now: dict[Key, ComparedNumber]
    before: dict[Key, ComparedNumber]


def _by_place(document: Document) -> dict[Key, ComparedNumber]:
    return {(q.block, q.id, q.name): q for q in quantities_of(document)}


def _compared(numbers: _Numbers, tolerances: Tolerances) -> Iterator[Document]:
    """Return a row for every number whose place both have; it may be empty in one of them."""
    for key, now in numbers.now.items():
        then = numbers.before.get(key)
        if then is None or now.value is None or then.value is None:
            continue
        # a difference of decimal numbers has noise in its last bits: a tolerance of one digit lets one digit pass
        noise = 4 * sys.float_info.epsilon * max(abs(now.value), abs(then.value))
        allowed = tolerances.allowed(then.kind, then.unit, then.value)
        size = max(abs(now.value - then.value) - noise, 0.0)
        yield _row(then._replace(value=now.value), then.value, size, allowed, tolerances)
    for key, now in numbers.now.items():
        if now.value is not None and _is_empty(key, numbers.before):
            yield _row(now, None, math.inf, 0.0, tolerances)
    for key, then in numbers.before.items():
        if then.value is not None and _is_empty(key, numbers.now):
            yield _row(then._replace(value=None), then.value, math.inf, 0.0, tolerances)


def _is_empty(key: Key, other: dict[Key, ComparedNumber]) -> bool:
    """Whether the other result has nothing at the place of a number, or at a place that would hold it."""
    block, name, path = key
    places = [path, *(path[: found.start()] for found in re.finditer(r"[.\[]", path))]
    return any((found := other.get((block, name, place))) is not None and found.value is None for place in places)


def _lacking(numbers: _Numbers, tolerances: Tolerances) -> Iterator[Document]:
    """Return the quantities that one of the two does not have at all, with how many numbers the other has.

    A record that one of them lacks is not meant: sets tell of those.
    """
    for file, own, other in (("result", numbers.before, numbers.now), ("baseline", numbers.now, numbers.before)):
        records = {(block, name) for block, name, _ in other}
        absent = [
            q
            for key, q in own.items()
            if q.value is not None and key not in other and not _is_empty(key, other)
            if q.block not in RECORDS_IN_SETS or (q.block, q.id) in records
        ]
        for (kind, block, name), number in Counter((q.kind, q.block, q.name) for q in absent).items():
            differs = file == "result" and not tolerances.of(kind).ignore
            yield {"file": file, "kind": kind, "block": block, "name": name, "numbers": number, "differs": differs}


def _located(document: Document, baseline: Document, tolerances: Tolerances) -> Iterator[Document]:
    """Return a row for every place, difference at a given point and rotation that stands in both."""
    for kind, block, name, size in (
        *_places("points", document, baseline),
        *_places("photos", document, baseline),
        *_control(document, baseline),
        *_rotations(document, baseline),
    ):
        quantity = ComparedNumber(kind=kind, block=block, id=name, name=kind, unit=UNITS[kind], value=None)
        yield _row(quantity, None, size, tolerances.of(kind).absolute, tolerances)


def _row(now: ComparedNumber, before: float | None, size: float, allowed: float, tolerances: Tolerances) -> Document:
    """Return a number with the size of its difference, None where there is a number in one only."""
    return {
        "kind": now.kind,
        "block": now.block,
        "id": now.id,
        "name": now.name,
        "unit": now.unit,
        "before": before,
        "now": now.value,
        "difference": float(f"{size:.6g}") if math.isfinite(size) else None,
        "allowed": allowed,
        "differs": size > allowed and not tolerances.of(now.kind).ignore,
    }


def _rank(row: Document) -> tuple[int, float, str, str]:
    """Worst first: what is gone or appeared, then by how often it exceeds what is allowed, then where nothing is."""
    size, place = row["difference"], (row["block"], row["id"])
    if size is None:
        return 0, 0.0, *place
    return (1, -size / row["allowed"], *place) if row["allowed"] else (2, -size, *place)


def _kind(kind: str, rows: list[Document], tolerances: Tolerances) -> Document:
    tolerance = tolerances.of(kind)
    of_kind = [row for row in rows if row["kind"] == kind]
    worst = min(of_kind, key=_rank, default=None)
    allowed = {"absolute": tolerance.absolute, "relative": tolerance.relative}
    if tolerance.absolute_um:
        allowed["absolute_um"] = tolerance.absolute_um
    return {
        "kind": kind,
        "unit": UNITS[kind],
        "ignored": tolerance.ignore,
        "allowed": allowed,
        "compared": len(of_kind),
        "different": sum(row["differs"] for row in of_kind),
        "worst": None if worst is None or worst["difference"] == 0 else _without_verdict(worst),
    }


def _without_verdict(row: Document) -> Document:
    return {key: value for key, value in row.items() if key != "differs"}


Difference = tuple[str, str, str, float]  # kind, block, id, size; infinite where there is a number in one only


def _places(block: str, document: Document, baseline: Document) -> Iterator[Difference]:
    """Compare places, in plan and in height; a photo may have no place in both."""
    now, before = _shared(document[block], baseline[block])
    one, other = _columns(now, "x", "y", "z"), _columns(before, "x", "y", "z")
    known = np.flatnonzero(~(np.isnan(one) & np.isnan(other)).all(axis=1))
    sizes = plan_and_height(baseline["frame"], one[known], other[known])
    for kind, size in zip(("plan", "height"), sizes, strict=True):
        yield from _sizes(kind, block, now["id"][known].tolist(), size)


def _control(document: Document, baseline: Document) -> Iterator[Difference]:
    """Compare the differences at given points, in plan and in height, as far as each counts."""
    now, before = _shared(document["control"], baseline["control"])
    row_of = {name: row for row, name in enumerate(baseline["points"].values("id"))}
    known = np.array([row for row, name in enumerate(now["id"]) if name in row_of], np.intp)
    now, before = now[known], before[known]
    at = _columns(baseline["points"], "x", "y", "z")[[row_of[name] for name in now["id"]]]
    one, other = _columns(now, "dx", "dy", "dz"), _columns(before, "dx", "dy", "dz")
    sizes = [difference_in_plan_and_height(baseline["frame"], delta, at) for delta in (one, other, one - other)]
    for k, kind in enumerate(("plan", "height")):
        there = np.flatnonzero(np.isfinite(sizes[0][k]) | np.isfinite(sizes[1][k]))
        yield from _sizes(kind, "control", now["id"][there].tolist(), sizes[2][k][there])


def _rotations(document: Document, baseline: Document) -> Iterator[Difference]:
    """Compare rotations by the angle of the rotation from one to the other, which no convention of angles changes."""
    now, before = _shared(document["photos"], baseline["photos"])
    one, other = _columns(now, *MATRIX), _columns(before, *MATRIX)
    known = np.flatnonzero(~(np.isnan(one) & np.isnan(other)).all(axis=1))
    # 2 sqrt(2) sin(angle / 2) is the length of the difference: exact for the smallest angles, unlike the cosine
    half = np.minimum(np.linalg.norm(one - other, axis=1)[known] / math.sqrt(8.0), 1.0)
    yield from _sizes("rotation", "photos", now["id"][known].tolist(), np.degrees(2.0 * np.arcsin(half)))


def _sizes(kind: str, block: str, ids: list[str], sizes: Floats) -> Iterator[Difference]:
    for name, size in zip(ids, sizes.tolist(), strict=True):
        yield kind, block, name, size if math.isfinite(size) else math.inf


def _shared(now: Table, before: Table) -> tuple[Table, Table]:
    """Return the rows that stand in both tables, by id, in the same order."""
    row_of = {name: row for row, name in enumerate(before.values("id"))}
    rows = [row for row, name in enumerate(now.values("id")) if name in row_of]
    return now[rows], before[[row_of[name] for name in now["id"][rows]]]


def _columns(table: Table, *keys: str) -> Floats:
    return np.column_stack([table[key] for key in keys])


def _set(kind: str, document: Document, baseline: Document, tolerances: Tolerances) -> Document:
    tolerance: SetTolerance = getattr(tolerances, kind)
    missing, new = missing_and_new(members_of(document, kind), members_of(baseline, kind))
    too_many = len(missing) > tolerance.missing or len(new) > tolerance.new
    return {
        "kind": kind,
        "ignored": tolerance.ignore,
        "allowed": {"missing": tolerance.missing, "new": tolerance.new},
        "compared": len(members_of(baseline, kind)),
        "missing": missing,
        "new": new,
        "differs": too_many and not tolerance.ignore,
    }
