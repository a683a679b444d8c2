"""What ``photostrip check`` prints of a project: contents, frames, standard deviations, rows that are used."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.angles import UNITS, AngleUnit
from photostrip.report.page.numbers import short
from photostrip.report.page.parts import DASH, Facts, Section, Words
from photostrip.report.page.tables import number, tabulated, words

# What is printed without --verbose: points with a row each in the table of control, kinds of them when there are more,
# frames that are decoded, tables of which all rows are used.
POINTS_SHOWN, KINDS_SHOWN, FRAMES_SHOWN, TABLES_SHOWN = 12, 6, 2, 4


def check_sections(document: Document, *, everything: bool = False) -> tuple[Section, ...]:
    """Return the sections for one project that could be read, from what was decoded."""
    return (
        _contents(document),
        _frames(document["frames"], UNITS[document["angle_unit"]], everything=everything),
        _sigmas(document["control"], everything=everything),
        _rows(document["rows"], everything=everything),
    )


def verdict(path: str, faults: int, notes: int) -> str:
    """Say in one line how a project stands."""
    if faults:
        return f"{path}: FAULTY, {counted(faults, 'fault')}"
    return f"{path}: OK, ready to run" + (f"; {counted(notes, 'remark')}" if notes else "")


def _contents(document: Document) -> Section:
    counts = document["counts"]
    control = "control {control_plan} in plan, {control_height} in height; check {check_plan} in plan, {check_height}"
    models = document.get("model_sigma")
    rows = [
        ("project", document["name"]),
        ("photos", _in_strips(counts)),
        _measured(counts),
        ("given and measured", f"{control.format(**counts)} in height"),
        ("model sigma" if models else "image sigma", _image_sigma(models or document["image_sigma"])),
    ]
    return Section("Contents", (Facts(tuple(rows)),))


def _in_strips(counts: Document) -> str:
    in_strips = counts["photos"] - counts["in_no_order"]
    parts = [f"{in_strips} in {counted(counts['strips'], 'strip')}"] if in_strips else []
    return ", ".join([*parts, *([f"{counts['in_no_order']} in no given order"] if counts["in_no_order"] else [])])


def _measured(counts: Document) -> tuple[str, str]:
    points = f"of {counted(counts['points'], 'point')}, {counts['new']} new"
    if "models" not in counts:
        return "image points", f"{counts['image_points']} {points}"
    models, centers = counted(counts["models"], "model"), counted(counts["model_centers"], "perspective centre")
    return "model points", f"{counts['model_points']} {points}, in {models}; {centers}"


def _image_sigma(sigma: Document) -> str:
    if sigma["smallest_um"] is None:
        return DASH
    low, high = (short(sigma[key]) for key in ("smallest_um", "largest_um"))
    size = f"{low} µm" if low == high else f"{low} to {high} µm"
    parts = []
    if sigma["rows_with_own"]:
        parts.append(f"{counted(sigma['rows_with_own'], 'row')} with their own")
    if sigma["rows_with_default"]:
        parts.append(f"{counted(sigma['rows_with_default'], 'row')} from {_source(sigma['default_from'])}")
    return f"{size}; {', '.join(parts)}"


def _frames(frames: Sequence[Document], unit: AngleUnit, *, everything: bool) -> Section:
    parts: list[Words | Facts] = []
    shown = frames if everything else frames[:FRAMES_SHOWN]
    for frame in shown:
        name = frame["file"] or "output"
        also = " (also of the results)" if frame["is_output"] and frame["file"] else ""
        parts.append(Words(f"{name}{also}: {frame['frame']}", "head"))
        parts.append(Facts(tuple(_decoded(frame, unit))))
    if len(frames) > len(shown):
        parts.append(Words(f"{counted(len(frames) - len(shown), 'more frame')}; --verbose decodes all"))
    return Section("Ground frames, decoded at one point", tuple(part for part in parts if part != Facts(())))


def _decoded(frame: Document, unit: AngleUnit) -> Iterator[tuple[str, str]]:
    """Return the facts of one frame: a point as given, as decoded, and back."""
    if "point" not in frame:
        return
    places = 8 if frame["kind"] == "geographic" else 3
    named = zip(frame["axes"], frame["given"], strict=True)
    given = (f"{axis} {DASH if value != value else format(value, f'.{places}f')}" for axis, value in named)  # noqa: PLR0124
    yield f"  point {frame['point']}", ", ".join(given)
    if "geodetic" in frame:
        longitude, latitude, height = frame["geodetic"]
        east, north = "E" if longitude >= 0 else "W", "N" if latitude >= 0 else "S"
        text = f"{abs(latitude):.7f} deg {north}, {abs(longitude):.7f} deg {east}, {height:.3f} m above the ellipsoid"
        yield "  latitude, longitude", text
        yield (
            "  geocentric",
            ", ".join(f"{axis} {value:.3f}" for axis, value in zip("XYZ", frame["cartesian"], strict=True)),
        )
    yield "  and back", f"{frame['back_mm']:.6f} mm from the given point"
    if "convergence_deg" in frame:
        low, high = (f"{value * unit.per_degree:+.{4 + unit.more}f}" for value in frame["convergence_deg"])
        size = low if low == high else f"{low} to {high}"
        yield "  grid convergence", f"{size} {unit.name} (grid north from true north, clockwise)"
    if frame["kind"] != "local" and frame["datum_accuracy"] != 0.0:
        accuracy = frame["datum_accuracy"]
        yield "  datum shift", "accuracy unknown" if accuracy is None else f"accuracy {accuracy:g} m"
    yield "  extent", f"{frame['span_m'] / 1000:.3f} km"


def _sigmas(control: Sequence[Document], *, everything: bool) -> Section:
    """Table of the standard deviation that each control coordinate gets, and where it stands."""
    axes = control[0]["axes"] if control and all(each["axes"] == control[0]["axes"] for each in control) else "xyz"
    if everything or len(control) <= POINTS_SHOWN:
        kinds, note = [[each] for each in control], ""
    else:
        kinds, note = _kinds(control)

    def sigma(place: int) -> Callable[[Sequence[Document]], str]:
        return lambda kind: DASH if kind[0]["sigma"][place] is None else short(kind[0]["sigma"][place])

    columns = (
        words("point", lambda kind: kind[0]["id"] + (", …" if len(kind) > 1 else "")),
        *([] if len(kinds) == len(control) else [number("points", len)]),
        words("role", lambda kind: _role(kind[0])),
        *(number(f"σ {axis}", sigma(n), unit="m") for n, axis in enumerate(axes)),
        number("photos", _photos),
        words("from", lambda kind: _sources(kind[0], line=len(kind) == 1)),
    )
    return Section("Standard deviations of the control", (tabulated(kinds, columns, note=note),))


def _kinds(control: Sequence[Document]) -> tuple[list[list[Document]], str]:
    """Put points together that have the same role and standard deviations from the same place, the most first."""
    found: dict[tuple[object, ...], list[Document]] = {}
    for each in control:
        found.setdefault((_role(each), *each["sigma"], _sources(each, line=False)), []).append(each)
    kinds = sorted(found.values(), key=len, reverse=True)
    rest = sum(map(len, kinds[KINDS_SHOWN:]))
    return kinds[:KINDS_SHOWN], f"{f'{rest} more points; ' if rest else ''}--verbose prints every point"


def _role(each: Document) -> str:
    return str(each["role"]) if any(each["counts"]) else "off"


def _photos(kind: Sequence[Document]) -> str:
    low, high = (function(each["photos"] for each in kind) for function in (min, max))
    return str(low) if low == high else f"{low} to {high}"


def _sources(each: Document, *, line: bool) -> str:
    sources = {id(source): source for source in each["sigma_from"] if source}.values()  # most often one for all axes
    return "; ".join(dict.fromkeys(_source(source, line=line) for source in sources)) or DASH


def _source(place: Document, *, line: bool = True) -> str:
    """Say where a standard deviation stands: its own row, or a key of the project; the file without its folder.

    The line of a row is left out where many rows are spoken of.
    """
    name, row = place["file"].rpartition("/")[2], place["source"] == "row"
    where = f"{name}:{place['line']}" if place["line"] and (line or not row) else name
    return f"its row, {where}" if row else f"{place['key']}, {where}"


def _rows(rows: Sequence[Document], *, everything: bool) -> Section:
    whole = [table for table in rows if table["used"] == table["rows"]]
    silent = [] if everything else whole[TABLES_SHOWN:]
    parts = [
        Words(f"{table['file']}: {table['used']} of {counted(table['rows'], 'row')} used")
        for table in rows
        if table not in silent
    ]
    if silent:
        parts.append(Words(f"{counted(len(silent), 'more table')}: all rows used"))
    return Section("Rows of the tables", tuple(parts))
