"""What the adjustments gave on fixed projects, in full precision, and the present program beside it.

``make`` runs the program on the projects of ``oracle_projects.py`` and packs what it gave into ``oracle.npz``;
``compare`` runs them again and prints the largest difference by project and kind of quantity.

* ``--against engine`` (default): what the adjustments hand back inside the program, before anything is rounded. Exit
  code 1 where a quantity differs by more than 1e-9 (of the extent, the largest of its column, or itself: ``Table``), a
  coordinate by more than 1e-6 of its standard deviation, or a rejection at all.
* ``--against results``: what users see, by id: points in units of their standard deviations, standard deviations, rms
  at check points and against the truth, status, rejections. Exit code 1 where, with the same rays rejected, a point
  moves by more than 0.03 standard deviations, or the rms at check points by more than 5 %. It needs nothing of the
  inside of the program.

Projects are simulated anew from their seeds. Of long tables every k-th row is kept, in the order of names (``SAMPLE``
rows at most); the last row, ``rms``, is the root mean square of all rows of the table, so that none can change unseen.

Usage: python benchmarks/oracle.py make
       python benchmarks/oracle.py compare [--only NAME ...] [--quick] [--methods M ...] [--against engine|results]
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported

import numpy as np  # noqa: E402

import photostrip  # noqa: E402
from benchmarks.oracle_projects import EVERY, Project, projects  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from photostrip.pipeline.results import Bundle, StripResult
    from photostrip.pipeline.results import Result as Computed

    Floats = NDArray[np.float64]

Document = dict[str, Any]

FILE = Path(__file__).with_suffix(".npz")
SAMPLE = 30  # rows that are kept of a table
# Another kernel of the same BLAS (OPENBLAS_CORETYPE=Nehalem) moves bundle, polynomial and similarity by less.
TOLERANCES = {"auto": 1e-7}
TOLERANCE = 1e-9  # of the other methods
IN_SIGMA = 1e-6  # standard deviations that a coordinate may move; what an adjustment leaves when its steps end
LENGTHS = {"absolute": 1.0, "metres": 100.0}
MOVED, CHECK_CHANGE = 0.03, 0.05  # standard deviations of a point; part of the rms at check points
KINDS = ("places", "turns", "residuals", "redundancy", "tests", "sigmas", "correlations", "numbers")
ALL = "rms"  # the last row of a table


@dataclass(frozen=True, eq=False)
class Table:
    """Quantities of one kind, a row for each thing that they belong to.

    Parameters
    ----------
    kind : str
        One of ``KINDS``.
    measure : str
        What a difference is divided by: ``extent`` of all coordinates together; the value ``own``; the largest value of
        its ``column`` or 1, for what is in units of standard deviations; one of ``LENGTHS``: 1, ``absolute``, for what
        has no unit and lies between -1 and 1, and 100 m, ``metres``, for differences of ground coordinates of millions
        of metres, whose last digit is 1e-9 m.
    names : tuple of str
        What each row belongs to; unique.
    values : ndarray, (n, c)
    rows : int
        Rows of the whole table.
    sigma : str
        Title of the table with the standard deviations of the same rows; empty when there is none.
    """

    kind: str
    measure: str
    names: tuple[str, ...]
    values: Floats
    rows: int
    sigma: str = ""


@dataclass(frozen=True, eq=False)
class Run:
    """What one way of adjusting one project gave.

    Parameters
    ----------
    tables : dict of str to Table
        Of the inside of the program, by title.
    facts : dict
        The same of what is compared exactly.
    points : Table
        Of the result: x, y, z and their standard deviations.
    figures : dict
        Of the result: status, rms, rejections.
    """

    tables: dict[str, Table] = field(default_factory=dict)
    facts: Document = field(default_factory=dict)
    points: Table | None = None
    figures: Document = field(default_factory=dict)


# ------------------------------------------------------------------------------- where in the program everything is
# All that this file knows of the inside of the program stands between here and the next line. What moves there is
# followed here, and nothing else changes.


def inside(computed: Computed) -> tuple[dict[str, Table], Document]:
    """Take everything from a run, by title."""
    tables: dict[str, Table] = {}
    facts: Document = {}
    if computed.bundle is not None:
        _of_bundle(computed.bundle, tables, facts)
    _of_points(computed, tables, facts)
    for strip in computed.strips:
        _of_strip(computed, strip, tables)
    return tables, facts


def _of_bundle(found: Bundle, tables: dict[str, Table], facts: Document) -> None:
    """Take solution, cofactors, reliability and rejections of the last adjustment of a bundle."""
    screened = found.screened
    problem, solution, cofactors = screened.problem, screened.solution, screened.precision
    photos = [problem.photo_name(n) for n in range(problem.photos)]
    shown = np.flatnonzero(np.isfinite(cofactors.points[:, 0, 0]))
    points = [problem.point_name(n) for n in shown.tolist()]
    common = list(problem.common_names())

    tables["bundle: centres"] = table("places", "extent", photos, solution.centers, "bundle: sigmas of photos")
    tables["bundle: points"] = table("places", "extent", points, solution.points[shown], "bundle: sigmas of points")
    tables["bundle: rotations"] = table("turns", "absolute", photos, solution.rotations.reshape(-1, 9))
    covariances(tables, "bundle", "points", points, cofactors.points[shown])
    covariances(tables, "bundle", "photos", photos, cofactors.photos)
    if common:
        sigma = np.sqrt(np.diag(cofactors.common))
        own = np.sqrt(np.diagonal(cofactors.photos, axis1=1, axis2=2))
        with_photos = cofactors.photo_common / own[:, :, None] / sigma
        tables["bundle: common over sigma"] = table("places", "column", common, solution.common / sigma)
        tables["bundle: sigmas of common"] = table("sigmas", "own", common, sigma)
        tables["bundle: correlations of common"] = table(
            "correlations", "absolute", common, cofactors.common / sigma / sigma[:, None]
        )
        tables["bundle: correlations of photos and common"] = table(
            "correlations", "absolute", photos, with_photos.reshape(len(photos), -1)
        )
        tables["bundle: redundancy of common"] = table(
            "redundancy", "absolute", common, cofactors.common_residuals / (cofactors.common_residuals + sigma**2)
        )

    observed: dict[str, Iterable[tuple[int | None, int | None]]] = {
        "image": zip(problem.images.photo.tolist(), problem.images.point.tolist(), strict=True),
        "control": ((None, point) for point in problem.control.point.tolist()),
        "position": ((photo, None) for photo in problem.positions.photo.tolist()),
        "attitude": ((photo, None) for photo in problem.attitudes.photo.tolist()),
    }
    whole = {
        "image": (found.block.problem.images.photo, found.block.problem.images.point),
        "control": (None, found.block.problem.control.point),
        "position": (found.block.problem.positions.photo, None),
        "attitude": (found.block.problem.attitudes.photo, None),
    }

    def name_of(photo: int | None, point: int | None) -> str:
        parts = ["" if photo is None else problem.photo_name(photo), "" if point is None else problem.point_name(point)]
        return "/".join(part for part in parts if part)

    for group in found.groups:
        names = [name_of(*each) for each in observed[group.kind]]
        tables[f"bundle: residuals, {group.kind}"] = table("residuals", "column", names, group.error / group.sigma)
        tables[f"bundle: redundancy, {group.kind}"] = table("redundancy", "absolute", names, group.redundancy)
        tables[f"bundle: test values, {group.kind}"] = table("tests", "column", names, group.standardised)
    blocks = cofactors.image_residuals / problem.images.sigma[:, :, None] / problem.images.sigma[:, None, :]
    names = [name_of(*each) for each in zip(problem.images.photo.tolist(), problem.images.point.tolist(), strict=True)]
    tables["bundle: correlations of image residuals"] = table("correlations", "absolute", names, blocks[:, 0, 1])

    def of_rejection(kind: str, row: int) -> str:
        photo, point = whole[kind]
        return name_of(None if photo is None else int(photo[row]), None if point is None else int(point[row]))

    rejected = screened.rejections
    facts["rejections in the bundle"] = [
        [each.kind, of_rejection(each.kind, each.row), list(each.axes), each.test, each.cause, each.readmitted]
        for each in rejected
    ]
    tables["bundle: rejections"] = table(
        "tests",
        "own",
        [f"{number:04d} {of_rejection(each.kind, each.row)}" for number, each in enumerate(rejected)],
        np.array([[each.value, each.limit] for each in rejected]).reshape(-1, 2),
    )
    shared = screened.common
    facts["errors that groups share"] = [[each.kind, each.of, each.rival, each.number] for each in shared]
    facts["bundle"] = {
        "redundancy": int(solution.redundancy),
        "free": bool(solution.free),
        "common": common,
        "unit": "stated" if found.unit == 1.0 else "found",
    }
    numbers = {
        "chi_square": solution.chi_square,
        "sigma0": solution.sigma0,
        "limit": screened.limit.value,
        "limit of two rays": screened.limit.both,
        "level": screened.limit.alpha,
        "unit": found.unit,
        **{f"component {each.name}": each.factor for each in found.components},
    }
    tables["bundle: numbers"] = table("numbers", "own", list(numbers), np.array(list(numbers.values())))


def _of_points(computed: Computed, tables: dict[str, Table], facts: Document) -> None:
    """Take the points of all strips, differences at given points, and the tests of check points."""
    ids = computed.refined.observations.point_ids
    names = [ids[number] for number in computed.points.number.tolist()]
    tables["points"] = table("places", "extent", names, computed.points.cartesian, "sigmas of points")
    tables["differences at control"] = table(
        "residuals", "metres", computed.inputs.control.ids, computed.control_differences
    )
    for number, fold in enumerate(computed.folds):
        if fold.result is None:
            continue
        of_fold = dict(zip(fold.result.inputs.control.ids, fold.result.control_differences, strict=True))
        left_out = [name for name in fold.left_out if name in of_fold]
        tables[f"left out in turn, {number:02d}"] = table(
            "residuals", "metres", left_out, np.array([of_fold[name] for name in left_out]).reshape(-1, 3)
        )
    precision = computed.precision
    if precision is None:
        return
    covariances(tables, "", "points", names, precision.points)
    tables["sigma of an image coordinate"] = table(
        "numbers", "own", [strip.strip.id for strip in computed.strips], np.array(precision.sigma)
    )
    facts["precision"] = list(precision.basis)
    for number, check in enumerate(precision.checks):
        if check is None:
            continue
        checked = [f"{check.ids[check.point[row]]} {check.axis[row]}" for row in range(check.coordinates)]
        title, sigma = f"check points, {number}", np.sqrt(np.diag(check.covariance))
        tables[title] = table("residuals", "metres", checked, check.difference, f"{title}: sigmas")
        tables[f"{title}: sigmas"] = table("sigmas", "own", checked, sigma)
        tables[f"test of check points, {number}"] = table(
            "numbers", "own", ["squares", "independent"], np.array([check.squares, check.independent])
        )


def _of_strip(computed: Computed, strip: StripResult, tables: dict[str, Table]) -> None:
    """Take the photos of a strip, or the perspective centres of its models."""
    title, photos = f"strip {strip.strip.id}", strip.strip.photos
    sigmas = f"{title}: sigmas of photos"
    centers = strip.intermediate.cartesian_from_intermediate(strip.centers)
    tables[f"{title}: centres"] = table("places", "extent", photos, centers, sigmas)
    if strip.photo_stages is not None:
        rotations = strip.photo_stages.resection.rotations
        tables[f"{title}: rotations"] = table("turns", "absolute", photos, rotations.reshape(-1, 9))
    if computed.precision is not None:
        row = [each.strip.id for each in computed.strips].index(strip.strip.id)
        covariances(tables, title, "photos", photos, computed.precision.photos[row])


# ------------------------------------------------------------------------------------------------ what users see


def outside(result: photostrip.Result, truth: Document | None) -> tuple[Table, Document]:
    """Take points and figures from a result, as any script could."""
    points = result.points
    columns = [points[name] for name in ("x", "y", "z", "sigma_x", "sigma_y", "sigma_z") if name in points.columns]
    values = np.column_stack([np.asarray(column, float) for column in columns])
    document = result.document
    checked: Document = document["summary"].get("check") or {}
    figures: Document = {
        "status": result.status,
        "adjustment": document["adjustment"],
        "rms at check points": [(checked.get(part) or {}).get("rms") for part in ("plan", "height")],
        "rejected": [
            [each[key] for key in ("stage", "strip", "photo", "other_photo", "point", "test", "readmitted")]
            for each in document["rejected"]
        ],
        "notes": sorted({each["code"] for each in document["notes"]}),
        "findings": sorted({each["code"] for each in document["findings"]}),
    }
    if truth is not None and not _free(document):
        errors = photostrip.compare(result, truth).document["points"]
        figures["rms against the truth"] = [_truly(errors, part) for part in ("plan", "height")]
    return table("places", "extent", points["id"].tolist(), values), figures


def _free(document: Document) -> bool:
    """Whether a result is in a frame of its own, with which no truth can be compared."""
    return bool(document.get("bundle", {}).get("free_network"))


def _truly(errors: Sequence[Document], part: str) -> float | None:
    """Root mean square of the true errors of all points that are not control."""
    parts = [(each["count"], each[part]["rms"]) for each in errors if each["role"] != "control" and each["count"]]
    known = [(count, rms) for count, rms in parts if rms is not None]
    if not known:
        return None
    return float(np.sqrt(sum(count * rms**2 for count, rms in known) / sum(count for count, _ in known)))


# ------------------------------------------------------------------------------------------------------- tables


def table(kind: str, measure: str, names: Sequence[str], values: ArrayLike, sigma: str = "") -> Table:
    """Make a whole table; names that stand twice are numbered."""
    seen: Counter[str] = Counter()
    unique = []
    for name in names:
        seen[name] += 1
        unique.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    array = np.asarray(values, float)
    columns = int(np.prod(array.shape[1:]))
    return Table(kind, measure, tuple(unique), array.reshape(len(names), columns), len(names), sigma)


def covariances(tables: dict[str, Table], of: str, things: str, names: Sequence[str], blocks: Floats) -> None:
    """Add covariances as standard deviations and correlations."""
    title = f"{of}: {{}} of {things}" if of else f"{{}} of {things}"
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))
        correlation = blocks / sigma[:, :, None] / sigma[:, None, :]
    rows, columns = np.triu_indices(blocks.shape[1], 1)
    tables[title.format("sigmas")] = table("sigmas", "own", names, sigma)
    tables[title.format("correlations")] = table("correlations", "absolute", names, correlation[:, rows, columns])


def sampled(given: Table, most: int = SAMPLE) -> Table:
    """Keep every k-th row in the order of names, and the root mean square of all rows."""
    order = sorted(range(len(given.names)), key=lambda row: given.names[row])
    kept = order[:: max(1, -(-len(order) // most))]
    finite = np.where(np.isfinite(given.values), given.values, 0.0)
    rms = np.sqrt((finite**2).mean(axis=0)) if order else np.zeros(given.values.shape[1])
    names = (*(given.names[row] for row in kept), ALL)
    values = np.concatenate([given.values[kept], rms[None]])
    return Table(given.kind, given.measure, names, values, given.rows, given.sigma)


def at_rows(given: Table, names: Sequence[str]) -> Table:
    """Give the rows of these names; NaN where there is none."""
    place = {name: row for row, name in enumerate(given.names)}
    finite = np.where(np.isfinite(given.values), given.values, 0.0)
    values = np.full((len(names), given.values.shape[1]), np.nan)
    for row, name in enumerate(names):
        if name in place:
            values[row] = given.values[place[name]]
        elif name == ALL and len(finite):
            values[row] = np.sqrt((finite**2).mean(axis=0))
        elif name == ALL:
            values[row] = 0.0
    return Table(given.kind, given.measure, tuple(names), values, given.rows, given.sigma)


# ---------------------------------------------------------------------------------------------------- runs, packing


def runs(wanted: Sequence[Project], methods: Sequence[str], *, engine: bool) -> Iterator[tuple[str, Run]]:
    """Make the projects and adjust them, under the names ``project/method``."""
    for project in wanted:
        with tempfile.TemporaryDirectory() as folder:
            path, truth = project.made(Path(folder))
            for method in project.methods:
                if method in methods:
                    yield f"{project.name}/{method}", adjusted(path, project, method, truth, engine=engine)


def adjusted(path: Path, project: Project, method: str, truth: Document | None, *, engine: bool) -> Run:
    processing = {**project.keys.get("processing", {}), "adjustment": method}
    try:
        result = photostrip.load(path, **{**project.keys, "processing": processing}).run()
    except photostrip.GeometryError as error:
        return Run(facts={"refused": error.code}, figures={"refused": error.code, "message": str(error)})
    except photostrip.InputError as error:
        codes = sorted({fault.code for fault in error.faults})
        return Run(facts={"refused": codes}, figures={"refused": codes, "message": str(error)})
    points, figures = outside(result, truth)
    if not engine:
        return Run(points=points, figures=figures)
    assert result.computed is not None  # noqa: S101
    tables, facts = inside(result.computed)
    return Run(tables, {**facts, "rejected": figures["rejected"]}, points, figures)


def pack(file: Path, found: dict[str, Run]) -> None:
    """Write runs as one array of numbers and one text that says what they are."""
    numbers: list[Floats] = []
    index: Document = {}

    def noted(given: Table) -> Document:
        kept = sampled(given)
        numbers.append(kept.values.ravel())
        shape = list(kept.values.shape)
        return {"of": [kept.kind, kept.measure, kept.sigma], "names": kept.names, "shape": shape, "rows": kept.rows}

    for name, run in found.items():
        index[name] = {
            "tables": {title: noted(each) for title, each in run.tables.items()},
            "points": None if run.points is None else noted(run.points),
            "facts": run.facts,
            "figures": run.figures,
        }
    text = np.frombuffer(json.dumps(index, separators=(",", ":")).encode(), np.uint8)
    np.savez_compressed(file, numbers=np.concatenate(numbers), index=text)


def unpack(file: Path) -> dict[str, Run]:
    """Read what ``pack`` wrote."""
    with np.load(file) as packed:
        numbers, index = packed["numbers"], json.loads(packed["index"].tobytes())
    begin = 0

    def read(entry: Document) -> Table:
        nonlocal begin
        rows, columns = entry["shape"]
        values = numbers[begin : begin + rows * columns].reshape(rows, columns)
        begin += rows * columns
        kind, measure, sigma = entry["of"]
        return Table(kind, measure, tuple(entry["names"]), values, entry["rows"], sigma)

    found = {}
    for name, each in index.items():
        tables = {title: read(entry) for title, entry in each["tables"].items()}
        points = None if each["points"] is None else read(each["points"])
        found[name] = Run(tables, each["facts"], points, each["figures"])
    return found


# ------------------------------------------------------------------------------------------- against the engine


@dataclass(frozen=True)
class Difference:
    """The largest difference of a table."""

    kind: str
    title: str
    size: float
    in_sigma: float = float("nan")
    at: str = ""


def differences(then: Run, now: Run) -> Iterator[Difference]:
    """Compare all tables of a run."""
    for title, before in then.tables.items():
        if title not in now.tables:
            yield Difference(before.kind, title, np.inf, at="is not there")
            continue
        whole = now.tables[title]
        if whole.rows != before.rows or whole.values.shape[1] != before.values.shape[1]:
            shapes = f"{before.rows} rows of {before.values.shape[1]}, now {whole.rows} of {whole.values.shape[1]}"
            yield Difference(before.kind, title, np.inf, at=shapes)
            continue
        after = at_rows(whole, before.names)
        off = np.abs(after.values - before.values)
        off = np.where(_alike(before.values, after.values), 0.0, np.where(np.isnan(off), np.inf, off))
        relative = _divided(off, _scale(before))
        in_sigma = float("nan")
        if before.sigma in then.tables:
            sigma = then.tables[before.sigma].values[:-1, : off.shape[1]]
            in_sigma = float(_divided(off[:-1], sigma).max(initial=0.0))
        at = ""
        if relative.any():
            row, column = np.unravel_index(int(relative.argmax()), relative.shape)
            place = f"{before.names[row]}, column {column + 1}"
            at = f"{place}: {before.values[row, column]:.15g}, now {after.values[row, column]:.15g}"
        yield Difference(before.kind, title, float(relative.max(initial=0.0)), in_sigma, at)
    for title in now.tables.keys() - then.tables.keys():
        yield Difference(now.tables[title].kind, title, np.inf, at="is new")


def _alike(first: Floats, second: Floats) -> NDArray[np.bool_]:
    """Where two arrays have the same value, or none."""
    return (first == second) | (np.isnan(first) & np.isnan(second))


def _divided(off: Floats, by: Floats) -> Floats:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(off == 0.0, 0.0, np.where(by > 0.0, off / by, np.inf))


def _scale(given: Table) -> Floats:
    """Return what differences in a table are divided by; its last row is no part of an extent."""
    size = np.where(np.isfinite(given.values), np.abs(given.values), 0.0)
    if given.measure == "own":
        return size
    if given.measure in LENGTHS:
        return np.full_like(size, LENGTHS[given.measure])
    if given.measure == "column":
        return np.broadcast_to(np.maximum(size.max(axis=0), 1.0), size.shape)
    rows = given.values[:-1][np.isfinite(given.values[:-1]).all(axis=1)]
    extent = float(np.ptp(rows, axis=0).max()) if len(rows) > 1 else float(size.max())
    return np.full_like(size, extent)


def against_engine(stored: dict[str, Run], found: Iterator[tuple[str, Run]], *, everything: bool) -> bool:
    """Print differences of all quantities; whether none is too large."""
    width = max(map(len, stored))
    print(f"{'':{width}}  " + "".join(f"{kind:>13}" for kind in (*KINDS, "of sigma")) + "  exact")
    worst: dict[str, tuple[float, str]] = {}
    good = True
    for name, now in found:
        if name not in stored:
            print(f"{name:{width}}  is not in the file")
            good = False
            continue
        then = stored[name]
        every = list(differences(then, now))
        sizes = {kind: max((d.size for d in every if d.kind == kind), default=float("nan")) for kind in KINDS}
        in_sigma = max((d.in_sigma for d in every if d.in_sigma == d.in_sigma), default=float("nan"))
        exact = sorted(key for key in then.facts.keys() | now.facts.keys() if then.facts.get(key) != _plain(now, key))
        cells = "".join(f"{_shown(size):>13}" for size in (*sizes.values(), in_sigma))
        print(f"{name:{width}}  {cells}  {'; '.join(exact) if exact else 'same'}", flush=True)
        tolerance = TOLERANCES.get(name.partition("/")[2], TOLERANCE)
        beyond = [d for d in every if d.size > tolerance or d.in_sigma > IN_SIGMA]
        good = good and not exact and not beyond
        for each in every:
            if each.size > worst.get(each.kind, (0.0, ""))[0]:
                worst[each.kind] = each.size, f"{name}: {each.title}: {each.at}"
            if everything or each in beyond:
                print(f"    {_shown(each.size):>8}  {each.title}  {each.at}".rstrip())
        for key in exact:
            for line in _changes(then.facts.get(key), _plain(now, key)):
                print(f"    {key}: {line}")
    print("\nlargest differences")
    for kind in KINDS:
        size, where = worst.get(kind, (0.0, ""))
        print(f"  {kind:13}{_shown(size):>9}  {where}".rstrip())
    print(f"\n{'nothing differs' if good else 'DIFFERENT'} by more than is allowed")
    return good


def _plain(run: Run, key: str) -> Any:  # noqa: ANN401 (as it was packed)
    """Return a fact as it comes out of the file."""
    return json.loads(json.dumps(run.facts[key])) if key in run.facts else None


def _shown(size: float) -> str:
    if np.isnan(size):
        return "-"
    return "0" if size == 0.0 else f"{size:.0e}"


def _changes(then: Any, now: Any) -> Iterator[str]:  # noqa: ANN401 (facts)
    """Say in lines where two lists, or two values, differ first and most."""
    if not (isinstance(then, list) and isinstance(now, list)):
        yield f"{then}, now {now}"
        return
    before, after = Counter(map(json.dumps, then)), Counter(map(json.dumps, now))
    yield from (f"only then {each}" for each in (before - after).elements())
    yield from (f"only now  {each}" for each in (after - before).elements())
    if before == after:
        place = next(n for n, (a, b) in enumerate(zip(then, now, strict=True)) if a != b)
        yield f"in another order from number {place} on: {then[place]}, now {now[place]}"


# --------------------------------------------------------------------------------------------- against the results


def against_results(stored: dict[str, Run], found: Iterator[tuple[str, Run]], *, everything: bool) -> bool:
    """Print how results differ; whether none differs by more than is allowed."""
    width = max(map(len, stored))
    head = ("points", "moved", "rms", "sigmas from", "to", "check plan", "height", "true plan", "height", "out", "in")
    print("points: how many both have; moved, rms: in standard deviations; sigmas, check, true: now over then;")
    print("out, in: rejected only now, only then\n")
    print(f"{'':{width}}  " + "".join(f"{title:>12}" for title in head) + "  status")
    good = True
    for name, now in found:
        if name not in stored:
            print(f"{name:{width}}  is not in the file")
            continue
        then = stored[name]
        if then.points is None or now.points is None:
            words = [str(each.figures.get("message") or each.figures["status"]) for each in (then, now)]
            same = then.figures.get("refused") == now.figures.get("refused")
            print(f"{name:{width}}  {'refused as before' if same else f'{words[0]}; NOW {words[1]}'}")
            good = good and same
            continue
        good = _of_results(f"{name:{width}}", then, now, everything=everything) and good
    print(f"\n{'within what is allowed' if good else 'DIFFERENT'}: {MOVED:g} sigma, {CHECK_CHANGE:.0%} at check points")
    return good


def _of_results(name: str, then: Run, now: Run, *, everything: bool) -> bool:
    """Print one line, and what is behind it."""
    assert then.points is not None  # noqa: S101
    assert now.points is not None  # noqa: S101
    names = then.points.names[:-1]
    before, after = then.points.values[:-1], at_rows(now.points, names).values
    both = np.isfinite(after[:, 0])
    ends, moved, ratio = (np.nan, np.nan), np.full(len(names), np.nan), np.full((len(names), 3), np.nan)
    if before.shape[1] == after.shape[1] == 6:
        with np.errstate(invalid="ignore", divide="ignore"):
            moved = np.abs((after - before)[:, :3] / before[:, 3:]).max(axis=1)
            ratio = after[:, 3:] / before[:, 3:]
        known = ratio[np.isfinite(ratio)]
        ends = (known.min(), known.max()) if len(known) else ends
    known = moved[np.isfinite(moved)]
    most, rms = (known.max(), np.sqrt((known**2).mean())) if len(known) else (np.nan, np.nan)
    checks = _ratios(then.figures, now.figures, "rms at check points")
    truths = _ratios(then.figures, now.figures, "rms against the truth")
    was, is_now = (Counter(map(json.dumps, _out(each.figures["rejected"]))) for each in (then, now))
    out, back = list((is_now - was).elements()), list((was - is_now).elements())
    count = f"{both.sum()}/{len(names)}" if not both.all() or now.points.rows != then.points.rows else str(len(names))
    cells = [count, *(_two(each) for each in (most, rms, *ends, *checks, *truths)), str(len(out)), str(len(back))]
    status = [each.figures["status"] for each in (then, now)]
    print(
        f"{name}  " + "".join(f"{cell:>12}" for cell in cells) + f"  {' -> '.join(dict.fromkeys(status))}", flush=True
    )
    beyond = (moved > MOVED) & (not out and not back)
    for row in np.flatnonzero(np.isfinite(moved) & (beyond | everything)).tolist():
        shift = ", ".join(f"{value:+.4f}" for value in (after - before)[row, :3])
        print(f"    point {names[row]}: {shift}, {moved[row]:.3f} sigma")
    for words, entries in (("only now", out), ("only then", back)):
        for entry in entries if everything else entries[:5]:
            print(f"    rejected {words}: {entry}")
        if not everything and len(entries) > 5:
            print(f"    rejected {words}: {len(entries) - 5} more")
    for key in ("notes", "findings"):
        gone, new = (set(each.figures[key]) for each in (then, now))
        if gone != new:
            print(f"    {key}: gone {sorted(gone - new)}, new {sorted(new - gone)}")
    far = any(np.isfinite(each) and abs(each - 1.0) > CHECK_CHANGE for each in checks)
    return not beyond.any() and not far and bool(both.all())


def _out(rejected: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Return what was left out in the end: photo, other photo and point, whatever found it."""
    return [list(each[2:5]) for each in rejected if not each[6]]


def _ratios(then: Document, now: Document, key: str) -> list[float]:
    pairs = zip(then.get(key) or (None, None), now.get(key) or (None, None), strict=True)
    return [after / before if before and after is not None else float("nan") for before, after in pairs]


def _two(value: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{value:.3f}" if abs(value) >= 1e-3 or value == 0.0 else f"{value:.0e}"  # noqa: PLR2004


# --------------------------------------------------------------------------------------------------- command line


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the file, or compare with it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", nargs="?", choices=("make", "compare"), default="compare")
    parser.add_argument("--file", type=Path, default=FILE)
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="projects with these texts in their names"
    )
    parser.add_argument("--quick", action="store_true", help="a few projects of each sort")
    parser.add_argument("--methods", nargs="+", choices=EVERY, default=EVERY)
    parser.add_argument("--against", choices=("engine", "results"), default="engine")
    given = parser.parse_args(arguments)
    began = time.monotonic()
    wanted = [each for each in projects() if each.quick or not given.quick]
    wanted = [each for each in wanted if not given.only or any(text in each.name for text in given.only)]
    if not wanted:
        parser.error(f"no project is called {' or '.join(given.only)}")
    if given.command == "make":
        if given.only or given.quick or given.methods != EVERY:
            parser.error("make takes all projects")
        found = dict(runs(wanted, EVERY, engine=True))
        pack(given.file, found)
        refused = sum(run.points is None for run in found.values())
        size = given.file.stat().st_size / 1e6
        print(f"{given.file}: {len(wanted)} projects, {len(found)} runs, {refused} refused, {size:.2f} MB", end="")
        print(f", {time.monotonic() - began:.0f} s")
        return 0
    stored = unpack(given.file)
    engine = given.against == "engine"
    compared = against_engine if engine else against_results
    good = compared(stored, runs(wanted, given.methods, engine=engine), everything=bool(given.only))
    print(f"{time.monotonic() - began:.0f} s")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
