"""What ``photostrip check`` prints of a project: contents, frames, standard deviations, rows that are used."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.parts import DASH, Facts, Section, Words
from photostrip.report.page.tables import UNITS, AngleUnit, Field, short, tabulated

# What is printed without --verbose: points with a row each in the table of control, kinds of them when there are more,
# frames that are decoded, tables of which all rows are used.
POINTS_SHOWN, KINDS_SHOWN, FRAMES_SHOWN, TABLES_SHOWN = 12, 6, 2, 4


def check_sections(document: Document, *, everything: bool = False) -> tuple[Section, ...]:
    """Return the sections for one project that could be read, from what was decoded."""
    return (
        _contents(document),
        _frames(document["frames"], UNITS[document["angle_unit"]], everything=everything),
        _sigmas(document["control"], everything=everything),
        *map(_cameras, document["cameras"]),
        _rows(document["rows"], everything=everything),
    )


def verdict(path: str, faults: int, notes: int) -> str:
    """Say in one line how a project stands."""
    if faults:
        return f"{path}: FAULTY, {counted(faults, 'fault')}"
    return f"{path}: OK, ready to run" + (f"; {counted(notes, 'remark')}" if notes else "")


def _contents(document: Document) -> Section:
    counts, models = document["counts"], document.get("model_sigma")
    control = "control {control_plan} in plan, {control_height} in height; check {check_plan} in plan, {check_height}"
    in_strips = counts["photos"] - counts["in_no_order"]
    photos = [f"{in_strips} in {counted(counts['strips'], 'strip')}"] if in_strips else []
    photos += [f"{counts['in_no_order']} in no given order"] if counts["in_no_order"] else []
    points = f"of {counted(counts['points'], 'point')}, {counts['new']} new"
    measured = "image points", f"{counts.get('image_points')} {points}"
    if "models" in counts:
        centers = counted(counts["model_centers"], "perspective centre")
        text = f"{counts['model_points']} {points}, in {counted(counts['models'], 'model')}; {centers}"
        measured = "model points", text
    rows = (
        ("project", document["name"]),
        ("photos", ", ".join(photos)),
        measured,
        ("given and measured", f"{control.format(**counts)} in height"),
        ("model sigma" if models else "image sigma", _image_sigma(models or document["image_sigma"])),
    )
    return Section("Contents", (Facts(rows),))


def _image_sigma(sigma: Document) -> str:
    if sigma["smallest_um"] is None:
        return DASH
    pixel = sigma.get("pixel_um")
    low, high = (short(sigma[key] / (pixel or 1.0)) for key in ("smallest_um", "largest_um"))
    size = (low if low == high else f"{low} to {high}") + (" px" if pixel else " µm")
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
        also = " (also of the results)" if frame["is_output"] and frame["file"] else ""
        parts.append(Words(f"{frame['file'] or 'output'}{also}: {frame['frame']}", "head"))
        parts += [Facts(facts)] if (facts := tuple(_decoded(frame, unit))) else []
    if len(frames) > len(shown):
        parts.append(Words(f"{counted(len(frames) - len(shown), 'more frame')}; --verbose decodes all"))
    return Section("Ground frames, decoded at one point", tuple(parts))


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
        cartesian = zip("XYZ", frame["cartesian"], strict=True)
        yield "  geocentric", ", ".join(f"{axis} {value:.3f}" for axis, value in cartesian)
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
    kinds, note = [[each] for each in control], ""
    if not everything and len(control) > POINTS_SHOWN:
        kinds, note = _kinds(control)
    columns = (
        Field("point"),
        Field("points", "count", shown=len(kinds) < len(control)),
        Field("role"),
        *(Field(f"σ {axis}", "m g4") for axis in axes),
        Field("photos", "count"),
        Field("from"),
    )
    rows = []
    for kind in kinds:
        first, alone = kind[0], len(kind) == 1
        low, high = (function(each["photos"] for each in kind) for function in (min, max))
        photos = low if low == high else f"{low} to {high}"
        name = first["id"] + ("" if alone else ", …")
        rows.append((name, len(kind), _role(first), *first["sigma"], photos, _sources(first, line=alone)))
    return Section("Standard deviations of the control", (tabulated(columns, rows, note),))


def _cameras(given: Document) -> Section:
    """Say where given positions of cameras lie: far from the control they are in another frame, or unit."""
    pairs = zip(given["smallest_sigma_m"], given["largest_sigma_m"], strict=True)
    sigma = ", ".join(short(low) if low == high else f"{short(low)} to {short(high)}" for low, high in pairs)
    rows = [("photos", str(given["photos"])), ("frame", given["frame"]), ("σ east, north, up", f"{sigma} m")]
    if given["above_control_m"] is not None:
        where = (
            f"{given['above_control_m']:.4g} m above the control, {given['beside_control_m']:.0f} m beside its middle"
        )
        rows.append(("their middle", where))
    return Section(given["key"].replace("_", " ").capitalize(), (Facts(tuple(rows)),))


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
