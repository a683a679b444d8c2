"""What was decided without being asked for, with the reason; and what each control coordinate weighed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import LEAST_PROBABILITY, micrometres, short
from photostrip.report.page.parts import Facts, Section, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.models import of_models
from photostrip.report.sections.strip import elsewhere

NO_DEGREE = "none: no degree improves on chance, or predicts control held back any better"
WEIGHTS_SHOWN = 24  # control points; --verbose prints all


def decisions_section(document: Document) -> Section:
    """Say what `auto` came to, and why."""
    rows = tuple(_decisions(document))
    parts = (Facts(rows),) if rows else (Words("Nothing: every choice is made in the project file."),)
    return Section("Decided automatically", parts)


def _decisions(document: Document) -> Iterator[tuple[str, str]]:
    settings = document["settings"]
    if settings["adjustment"] == "auto":
        yield "adjustment", _adjustment(document)
    for block in document.get("polynomials", []):
        label = "polynomial" if len(document["strips"]) == 1 else f"polynomial of {block['strip']}"
        if block["asked"] == "auto":
            yield label, _degree(document["polynomial_evidence"].where(strip=block["strip"]))
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


def _adjustment(document: Document) -> str:
    if "bundle" in document:
        units = "models" if of_models(document) else "photos"
        return f"bundle, which all {units} together determine"
    return "polynomial: no bundle could be had, the notes say why"


def _degree(evidence: Sequence[Document]) -> str:
    """Say which degree was chosen in plan and in height, and what spoke for it."""
    text = chosen_degrees(evidence)
    if text == NO_DEGREE:
        return text
    return f"{text}; F is the ratio of the gain over the degree before, p its probability by chance"


def chosen_degrees(evidence: Sequence[Document]) -> str:
    """Say of which degree a polynomial is, in plan and in height."""
    parts = []
    for group in ("plan", "height"):
        chosen = [row for row in evidence if row["group"] == group and row["accepted"] and row["degree"]]
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
        return lambda row: row[f"{key}_{place + 1}"] if letter in row["use"] else None

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
