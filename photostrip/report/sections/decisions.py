"""What was decided without being asked for, with the reason; and what each control coordinate weighed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import LEAST_PROBABILITY, fixed, metres, micrometres, ratio, short
from photostrip.report.page.parts import Facts, Section, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.strip import elsewhere

WEIGHED = ("polynomial", "covariance")
NOT_COMPARED = "the strip's own covariance does not determine it"
NO_DEGREE = "none: no degree improves on chance, or predicts control held back any better"
AGREEING, LIMIT = "10 %", 0.9  # methods that differ by less are said to agree; the ratio that is the limit
WEIGHTS_SHOWN = 24  # control points; --verbose prints all


def decisions_section(document: Document) -> Section:
    """Say what `auto` came to, and why."""
    rows = tuple(_decisions(document))
    parts = (Facts(rows),) if rows else (Words("Nothing: every choice is made in the project file."),)
    return Section("Decided automatically", parts)


def _decisions(document: Document) -> Iterator[tuple[str, str]]:
    settings = document["settings"]
    yield from choice_rows(document)
    taken = {block["strip"]: block["taken"] for block in document.get("choices", [])}
    for block in document.get("polynomials", []):
        label = "polynomial" if len(document["strips"]) == 1 else f"polynomial of {block['strip']}"
        if block["asked"] == "auto":
            yield label, _degree(block)
        elif taken.get(block["strip"]) == "covariance":
            fix = "`processing.adjustment: polynomial` takes it"
            yield label, f"degree {block['asked']} was asked for and weighed, and is not in the result; {fix}"
    if "relative" in settings:
        yield from _screening(document, settings["relative"])
    elif settings["links"]["screening"] == "auto":
        gone = counted(document["counts"]["rejected_in_links"], "point")
        yield (
            "screening",
            f"every common point of each link tested as a whole, the worst left out first; {gone} left out",
        )
    interior = document["corrections"]["interior"]
    if interior and settings["interior"]["transform"] == "auto":
        what = " and ".join(interior["transforms"])
        yield (
            "fiducial marks",
            f"{what} transformation: affine where four or more marks determine it, otherwise conformal",
        )
    curvature = document["corrections"]["earth_curvature"]
    if curvature["asked"] == "auto":
        yield "Earth curvature", f"{curvature['treatment']}, as the frame of the control requires"
    yield from _heights(document, settings.get("refinement", {}))


def choice_rows(document: Document) -> Iterator[tuple[str, str]]:
    """Say for each strip what was taken and why."""
    blocks = document.get("choices", [])
    for block in blocks:
        yield "chosen adjustment" if len(blocks) == 1 else f"adjustment of {block['strip']}", choice_line(block)


def choices_in_short(document: Document) -> Iterator[tuple[str, str]]:
    """Say in a line for each strip what was taken, with the ratios of both witnesses."""
    blocks = document.get("choices", [])
    for block in blocks:
        left_out = "" if block["left_out"] is None else f", left-out errors {ratio(block['left_out']['ratio'])}"
        known = f", with the results {ratio(block['difference']['ratio'])}" if block["apart"] else ""
        why = f"covariance over polynomial: σ {ratio(block['predicted']['ratio'])}{known}{left_out}"
        text = f"{block['taken']}; {why if block['predicted']['count'] else NOT_COMPARED}"
        yield "chosen adjustment" if len(blocks) == 1 else f"adjustment of {block['strip']}", text


def choice_line(block: Document) -> str:
    """Say what was taken, why, and what both witnesses say of both methods."""
    predicted, left_out = block["predicted"], block["left_out"]
    if not predicted["count"]:
        return f"{block['taken']}: {NOT_COMPARED}"
    text = f"{block['taken']}, {_why(block)}: standard deviations of new points, of one plan coordinate/of the height, "
    text += _figures(predicted)
    apart = block["difference"]
    text += f"; the results differ by {metres(apart['plan'])}/{metres(apart['height'])} m"
    text += f" (ratio with that {_ratio(apart['ratio'])})"
    if left_out is None:
        return f"{text}; no control can be left out"
    excess = f"; those of the covariance are {ratio(block['excess'])} times what it lets expect"
    by = counted(left_out["count"], block["left_out_by"])
    return f"{text}; errors at {by} left out in turn {_figures(left_out)}{excess}"


def _why(block: Document) -> str:
    if block["contradicted"]:
        return "because left-out control contradicts the standard deviations of the covariance"
    if block["taken"] == "polynomial":
        return f"which the covariance of the strip betters by less than {AGREEING}"
    if block["apart"]:
        return f"because the results differ by more than predictions that agree within {AGREEING} let expect"
    percent = 100 * (1 - block["predicted"]["ratio"])
    return f"which betters the polynomial by {fixed(percent, 1 if _at_limit(block['predicted']['ratio']) else 0)} %"


def _ratio(value: float | None) -> str:
    """Write a ratio, with as many digits as show on which side of the limit it is."""
    return ratio(value) if value is None or not _at_limit(value) else fixed(value, 3)


def _at_limit(value: float) -> bool:
    return abs(value - LIMIT) < 0.01  # noqa: PLR2004 (the last digit of what is written)


def _figures(witness: Document) -> str:
    """Give plan and height of both methods, and their ratio."""
    each = [f"{metres(witness[name]['plan'])}/{metres(witness[name]['height'])} m" for name in WEIGHED]
    return f"{each[0]} with the polynomial, {each[1]} with the covariance (ratio {_ratio(witness['ratio'])})"


def _degree(block: Document) -> str:
    """Say which degree was chosen in plan and in height, and what spoke for it."""
    text = chosen_degrees(block)
    if text == NO_DEGREE:
        return text
    return f"{text}; F is the ratio of the gain over the degree before, p its probability by chance"


def chosen_degrees(block: Document) -> str:
    """Say of which degree a polynomial is, in plan and in height."""
    parts = []
    for group in ("plan", "height"):
        chosen = [row for row in block["evidence"] if row["group"] == group and row["accepted"] and row["degree"]]
        parts.append(f"{_step(chosen[-1])} in {group}" if chosen else f"none in {group}")
    if all(part.startswith("none") for part in parts):
        return NO_DEGREE
    plan, height = (part.rpartition(" in ")[0] for part in parts)
    return f"{plan} in plan and in height" if plan == height else " and ".join(parts)


def _step(row: Document) -> str:
    if row["f"] is None or row["p"] is None:
        return f"degree {row['degree']}"
    probability = f"p = {row['p']:.3f}" if row["p"] >= LEAST_PROBABILITY else f"p below {LEAST_PROBABILITY:g}"
    return f"degree {row['degree']} (F = {row['f']:.1f}, {probability})"


def _screening(document: Document, settings: Document) -> Iterator[tuple[str, str]]:
    counts = document["counts"]
    if settings["screening"] == "auto":
        gone = counted(counts["rejected_in_pairs"], "point")
        yield (
            "screening",
            f"robust start, then a global test of each pair, points left out singly and in sets; {gone} left out",
        )
    elif settings["screening"] == "parallax+grubbs" and settings["parallax_limit"] is None:
        sigma = micrometres(document["summary"]["sigma_given_um"])
        text = f"four times its standard deviation, which follows from the {sigma} µm stated for an image coordinate"
        yield "limit of y parallax", text


def _heights(document: Document, settings: Document) -> Iterator[tuple[str, str]]:
    wanted = [name for name, key in (("refraction", "refraction"), ("curvature", "earth_radius")) if settings.get(key)]
    if wanted and (settings["flying_height"] is None or settings["ground_height"] is None):
        known = document["strips"] or [document["summary"]]
        heights = ", ".join(f"{short(each['flying_height'])} m" for each in known)
        without = "it" if len(wanted) == 1 else "them"
        label = f"heights for {' and '.join(wanted)}"
        yield label, f"from a first run without {without}; flying height above ground {heights}"


def weights_section(document: Document, *, everything: bool) -> Section:
    """Return the standard deviation of every control coordinate as stated and as it counted in the fit."""
    control = [row for row in document["control"] if row["role"] == "control" and row["measured"]]
    shown = control if everything else control[:WEIGHTS_SHOWN]
    axes = document["frame"]["axes"]
    up = next((place for place, axis in enumerate(axes) if axis in {"up", "z"}), 2)

    def sigma(key: str, place: int) -> Callable[[Document], float | None]:
        """Return what reads a standard deviation of a coordinate that counts: plan, height or both."""
        letter = "z" if place == up else "x"
        return lambda row: row[key][place] if letter in row["use"] else None

    columns = (
        words("point", "id"),
        words("use", "use"),
        *(number(f"σ {axis}", sigma("sigma", n), 3, "given, m", rank=1) for n, axis in enumerate(axes)),
        *(number(f"σ {axis}", sigma("sigma_fit", n), 3, "in fit, m") for n, axis in enumerate(axes)),
        words("list", "list", rank=2),
    )
    rest = len(control) - len(shown)
    more = f"{elsewhere(rest, 'points', 'weights', 'control')}; " if rest else ""
    note = f"{more}in fit: combined with that of a model point; the weight of a coordinate is 1 / σ²"
    if len({row["list"] for row in control}) > 1:
        note += "; columns in the order of the axes of each list"
    parts = tabulated(shown, columns, note=note) if shown else Words("No control point was measured.")
    return Section("Weights of the control", (parts,))
