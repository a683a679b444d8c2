"""Sections on models: how independent ones fit each other and lie in the strip, and which models are deformed."""

from __future__ import annotations

from photostrip.notes import Document, counted
from photostrip.report.page.angles import angle_unit
from photostrip.report.page.numbers import fixed, joined, micrometres, percent, ratio, signed
from photostrip.report.page.parts import DASH, Facts, Section, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.strip import DIRECTIONS, photos_of, worst_first


def of_models(document: Document) -> bool:
    return "links" in document


def scale_word(document: Document) -> str:
    """Return the scale to which differences on the ground are brought: that of the photos or of the models."""
    return "model" if of_models(document) else "photo"


def links_section(document: Document, *, everything: bool) -> Section:
    """Links: how good the model coordinates are, link by link."""
    summary, links = document["summary"], document["links"]
    if not links:
        return Section("Links of the models", (Words("One model: nothing was linked."),))
    shown, note = worst_first(
        links, lambda link: link["sigma0"] or 0.0, ("links", "links", "links"), everything=everything
    )
    sigma0 = (
        f"{micrometres(summary['sigma0_um'])} µm for a model coordinate (stated: "
        f"{micrometres(summary['sigma_given_um'])} µm), redundancy {summary['redundancy']}"
    )
    worst = max(links, key=lambda link: (link["largest"] or 0.0) / (link["limit"] or 1.0))
    largest = (
        f"{ratio(worst['largest'])} at {worst['largest_point']} of models {worst['before']} and {worst['after']}, "
        f"limit {ratio(worst['limit'])}"
    )
    out = sum(len(link["points_rejected"]) for link in links)
    total = out + sum(link["points_used"] + link["center"] for link in links)
    gone = f"{out} of {counted(total, 'common point')}, {percent(out, total)}"
    facts = Facts((("σ0", sigma0), ("largest test value", largest), ("rejected", gone)))
    below = (
        "σ0: ratio to what is expected from the standard deviations of both models; along, across, up: rms differences "
        "of the common points; far end: uncertainty of the second model's far end, in standard deviations of a "
        "coordinate"
    )
    return Section("Links of the models", (facts, tabulated(shown, LINKS, note=joined(note, below))))


LINKS = (
    words("models", lambda link: f"{link['before']} – {link['after']}"),
    number("points", "points_used"),
    words("center", lambda link: "yes" if link["center"] else "no"),
    number("rej.", lambda link: len(link["points_rejected"])),
    number("σ0", "sigma0", 2),
    *(number(name, f"discrepancy_{name}", 3, "m") for name in DIRECTIONS),
    *(number(name, f"discrepancy_um_{name}", 1, "µm", rank=2) for name in DIRECTIONS),
    number("scale ratio", "factor", 6, rank=2),
    number("far end", "far_end", 2, "σ", rank=1),
    number("detect.", "detectable_um", 1, "µm", rank=3),
    words("strip", "strip", rank=4),
)
MODELS = (
    words("model", "id"),
    words("photos", photos_of),
    number("points", "points_used"),
    number("rej.", "points_rejected"),
    number("centres", "centers"),
    number("scale 1:", "model_scale", 0),
    number("base", "base", 2, "m"),
    words("strip", "strip", rank=2),
)


def models_section(document: Document, *, everything: bool) -> Section:
    """Models: what each one holds, and its scale."""
    models = document["models"]
    middle = document["summary"]["model_scale"] or 1.0
    shown, note = worst_first(
        models,
        lambda m: abs(m["model_scale"] / middle - 1),
        ("models", "models", "models"),
        everything=everything,
    )
    placed = "has one position in the network" if "bundle" in document else "gets the mean of its positions"
    text = (
        "The models are independent: each has its own scale, rotation and origin, and is linked to the model before "
        f"it. A point in several models {placed}. The rotations of the photos are not known from model coordinates."
    )
    counts: dict[int, int] = {}
    for point in document["points"]:
        counts[point["models"]] = counts.get(point["models"], 0) + 1
    by_models = ", ".join(f"{counts[n]} in {counted(n, 'model')}" for n in sorted(counts))
    missing = [photo["id"] for photo in document["photos"] if photo["x"] is None]
    facts = [("points by models", by_models)]
    if missing:
        facts.append(("photos without a centre", ", ".join(missing)))
    return Section("Models", (Words(text), Facts(tuple(facts)), tabulated(shown, MODELS, note=note)))


def project_rows(document: Document) -> list[tuple[str, str]]:
    """Return what the section on the project says of the links."""
    settings = document["settings"]["links"]
    text = str(settings["screening"])
    if text == "auto":
        text = f"each common point as a whole, level {settings['alpha']:g} for the strip"
    named = [f"{name} {', '.join(settings[name])}" for name in ("keep", "drop") if settings[name]]
    return [("screening", "; ".join([text, *named])), ("links", "a similarity in space from model to model")]


def measured(document: Document) -> tuple[tuple[str, str], ...]:
    counts = document["counts"]
    centers = f"{counts['model_centers']} of perspective centres"
    points = f"{counts['model_points']} of points, {counts['model_points_used']} used; {centers}"
    gone = counts["rejected_in_links"]
    return (("model coordinates", points), ("rejected", f"{gone} in links" if gone else DASH))


def deformation_section(document: Document) -> Section:
    """Twist and bending of the models that have the height control for it."""
    rows, unit = document["deformations"], angle_unit(document)
    bent = sum(row["significant"] for row in rows)
    means = [
        f"{name} {signed(each['at_corner_m'])} m at a corner, t = {fixed(each['t'], 1)}"
        for name, each in document.get("common_deformation", {}).items()
        if each["t"] is not None
    ]
    enough = f"{counted(len(rows), 'model')} {'has' if len(rows) == 1 else 'have'} enough height control"
    verdict = f"{bent or 'none'} of them {'are' if bent > 1 else 'is'} deformed"
    # of data that contradict themselves as a whole metres mean nothing
    sound = not any(each["severity"] == "error" and not each["accepted"] for each in document.get("findings", []))
    common = f" On average over all models: {'; '.join(means)}." if means and sound else ""
    text = Words(
        f"{enough} to show twist (x y) and bending (x²); {verdict} (t test of all together at 5 %).{common}",
        "look" if bent else "",
    )
    columns = (
        words("photos", photos_of),
        number("points", lambda row: len(row["points"])),
        number("twist", "twist_at_corner_m", 3, "at a corner, m"),
        number("t", "twist_t", 1),
        number("bending", "bending_at_corner_m", 3, "at a corner, m"),
        number("t", "bending_t", 1),
        number("limit of t", "t_limit", 1),
        number("Δω2", lambda row: unit.of_seconds(row["omega2_arcsec"]), 1, unit.small, rank=2),
        number("Δα2 – Δα1", lambda row: unit.of_seconds(row["alpha2_minus_alpha1_arcsec"]), 1, unit.small, rank=2),
        words("strip", "strip", rank=3),
    )
    return Section("Deformation of models", (text, tabulated(rows, columns)))
