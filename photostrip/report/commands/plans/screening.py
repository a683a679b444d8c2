"""Report of the experiment of screening."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from photostrip.notes import Document
from photostrip.report.page.numbers import fixed, short
from photostrip.report.page.parts import Facts, Section, Table
from photostrip.report.page.tables import number, tabulated, words


def screening_sections(document: Document) -> tuple[Section, ...]:
    """Make the sections: the experiment, methods, detection by zone and by size, what an undetected error does."""
    layout = document["layout"]
    points = layout["zone_points"]
    geometry = f"f {short(layout['principal_distance_mm'])} mm, b {short(layout['base_mm'])} mm"
    reach, width = short(layout["zone_reach_mm"]), short(layout["width_mm"])
    within = f"up to {reach} mm from their middles, {width} mm off the base"
    facts = Facts(
        (
            ("pairs", f"{document['repetitions']} times {document['models']}, {geometry}"),
            ("points", f"{sum(points)}: {', '.join(map(str, points))} in the zones 1 to 6, {within}"),
            ("measuring", f"{fixed(layout['parallax_sigma_um'], 1)} µm for a y parallax"),
            ("errors", f"{document['errors']} of a y parallax in {document['models']} pairs, two in some"),
        )
    )
    rows = document["detection"]
    return (
        Section("", (facts,)),
        Section("Methods", (_methods(document),)),
        Section("Found, % of the errors of a zone", (_shares(rows, "zone", "zone"),)),
        Section("Found, % of the errors of a size", (_shares(rows, "size_um", "size, µm"),)),
        Section("What one undetected error does to the elements, minutes of arc", (_effects(document["effects"]),)),
    )


def _methods(document: Document) -> Table:
    limit, level = short(document["parallax_limit_um"]), f"{100 * document['grubbs_alpha']:g} %"
    note = f"parallax+grubbs: limit {limit} µm, {level}; change: largest of the elements in pairs that kept an error"
    return tabulated(
        document["methods"],
        (
            words("method", "method"),
            number("by parallax", "parallax_percent", 1, "%"),
            number("by later tests", "later_percent", 1, "%"),
            number("missed", "missed_percent", 1, "%"),
            number("good lost", "good_lost_per_error", 3, "per error"),
            number("change", "mean_change_arcmin", 1, "mean, ′"),
            number("change", "worst_change_arcmin", 1, "worst, ′"),
        ),
        note=note,
    )


def _shares(rows: Sequence[Document], key: str, head: str) -> Table:
    """Show the shares that each method finds, by zone or by size."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    lines = []
    for value in dict.fromkeys(row[key] for row in rows):
        line = {"value": value}
        for method in methods:
            those = [row for row in rows if row[key] == value and row["method"] == method]
            errors = sum(row["errors"] for row in those)
            line |= {"errors": errors, method: 100 * sum(row["found"] for row in those) / errors if errors else None}
        lines.append(line)
    columns = (number(head, "value", short), number("errors", "errors"))
    return tabulated(lines, (*columns, *(number(method, method, 1) for method in methods)))


def _listed(key: str, place: int) -> Callable[[Document], float]:
    return lambda row: row[key][place]


def _effects(rows: Sequence[Document]) -> Table:
    """Show the change of every element by zone at the largest size, and of the worst by zone and size."""
    sizes = list(dict.fromkeys(row["size_um"] for row in rows))
    lines = []
    for zone in dict.fromkeys(row["zone"] for row in rows):
        those = {row["size_um"]: row for row in rows if row["zone"] == zone}
        lines.append({**those[sizes[-1]], "largest": [those[size]["largest_arcmin"] for size in sizes]})
    names = (("α1′", "alpha1"), ("κ1′", "kappa1"), ("α2′", "alpha2"), ("ω2′", "omega2"), ("κ2′", "kappa2"))
    columns = (
        number("zone", "zone"),
        *(number("largest", _listed("largest", place), 1, f"{size:g} µm") for place, size in enumerate(sizes)),
        *(number(symbol, f"{name}_arcmin", 1, f"{sizes[-1]:g} µm") for symbol, name in names),
    )
    return tabulated(lines, columns, note="root mean squares over the pairs; largest: of the five elements of a pair")
