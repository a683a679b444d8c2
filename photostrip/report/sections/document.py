"""The accuracy report: from the document of a result to sections, worst things first. Nothing is computed here.

The only input is the content of result.json, so that ``photostrip report`` prints what ``photostrip run`` printed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, InputError
from photostrip.report.page.figures import counted, fixed, metres, micrometres, short, unit
from photostrip.report.page.parts import Column, Facts, Part, Section, Table, Words
from photostrip.report.sections import (
    bundle_sections,
    covariance_sections,
    decision_sections,
    deformation_sections,
    finding_sections,
    ground_sections,
    model_sections,
    precision_sections,
    strip_sections,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

Document = dict[str, Any]

HEADLINES = {
    "good": "GOOD: nothing calls for a second look.",
    "look": "LOOK at {number} before you use this:",
    "failed": "FAILED: {failed}.",
}
LOOK_SHOWN = 10


def sections_of(document: Document, *, everything: bool = False) -> tuple[Section, ...]:
    """Return the sections of the accuracy report.

    Parameters
    ----------
    everything : bool
        Whether all rows of all tables are wanted, not only the worst of long ones.
    """
    several, bundle = len(document["strips"]) > 1, "bundle" in document
    models = model_sections.of_models(document)
    found = [
        verdict_section(document, everything=everything),
        *finding_sections.findings_sections(document),
        project_section(document),
        decision_sections.decisions_section(document),
        counts_section(document),
        *(
            [
                model_sections.links_section(document, everything=everything),
                model_sections.models_section(document, everything=everything),
            ]
            if models
            else [
                strip_sections.relative_section(document, everything=everything),
                strip_sections.junction_section(document, everything=everything),
            ]
        ),
        strip_sections.absolute_section(document),
        *([strip_sections.polynomial_section(document, everything=everything)] if document.get("polynomials") else []),
        *(
            [covariance_sections.covariance_section(document, everything=everything)]
            if "covariance" in document
            else []
        ),
        *bundle_sections.bundle_sections(document),
        *([] if bundle else [decision_sections.weights_section(document, everything=everything)]),
        *([precision_sections.precision_section(document, everything=everything)] if "precision" in document else []),
        *([deformation_sections.deformation_section(document)] if document.get("deformations") else []),
        ground_sections.control_section(document, everything=everything),
        ground_sections.check_section(document, everything=everything),
        *([ground_sections.ties_section(document, everything=everything)] if several and not bundle else []),
        *([] if models else [ground_sections.image_section(document)]),
        ground_sections.rejected_section(document, everything=everything),
        ground_sections.not_determined_section(document, everything=everything),
        ground_sections.notes_section(document, everything=everything),
    ]
    return (*found, Section("", (Words(headline(document), document["status"]), _accuracy(document))))


def chosen_sections(document: Document, *, quiet: bool = False, everything: bool = False) -> tuple[Section, ...]:
    """Return the sections that are wanted: all of them, or the verdict that stands at the end."""
    sections = sections_of(document, everything=everything)
    return sections[-1:] if quiet else sections


def require_complete(document: Document, file: str) -> None:
    """Refuse a document that was read from a file and cannot be reported.

    Parameters
    ----------
    document : dict
        What stands in the file; a user may have cut or edited it.

    Raises
    ------
    InputError
        When something that the report shows is missing or of another kind.
    """
    try:
        title_of(document)
        sections_of(document, everything=True)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        what = f"key {error} is missing" if isinstance(error, KeyError) else f"a value is of another kind ({error})"
        message = f"cannot be reported: {what}"
        fix = "run the project again"
        raise InputError(Fault(message, "result-incomplete", file, expected="a whole result.json", fix=fix)) from None


def title_of(document: Document) -> str:
    """Return the title of the report."""
    return f"Accuracy report: {document['name']}"


def headline(document: Document) -> str:
    """Say in one sentence whether the result can be used."""
    tolerances = document["tolerances"]
    failed = sum(not each["passed"] for each in tolerances)
    number = counted(len(document["verdict"]["look_at"]), "thing")
    reasons = [f"{failed} of {counted(len(tolerances), 'tolerance')} not kept"] if failed else []
    wrong = sum(each["severity"] == "error" and not each["accepted"] for each in document.get("findings", []))
    if wrong:
        reasons.append(f"the data contradict themselves, {counted(wrong, 'finding')}")
    return HEADLINES[document["status"]].format(number=number, failed="; ".join(reasons))


def _accuracy(document: Document) -> Words:
    text = document["verdict"]["accuracy"]
    return Words(f"{text[0].upper()}{text[1:]}.")


def verdict_section(document: Document, *, everything: bool = False) -> Section:
    """Whether the result can be used, and what to look at."""
    look_at = document["verdict"]["look_at"]
    shown = look_at if everything else look_at[:LOOK_SHOWN]
    parts: list[Part] = [Words(headline(document), document["status"]), _accuracy(document)]
    parts += [Words(text, "", f"{number}.") for number, text in enumerate(shown, 1)]
    if len(look_at) > len(shown):
        parts.append(Words(f"{len(look_at) - len(shown)} more in `verdict` of result.json"))
    if document["tolerances"]:
        parts.append(_tolerances(document["tolerances"]))
    return Section("Verdict", tuple(parts))


def _tolerances(tolerances: Sequence[Document]) -> Table:
    columns = (
        Column("tolerance", left=True),
        Column("found"),
        Column("allowed"),
        Column("", left=True),
        Column("", left=True),
    )
    rows = tuple(
        (
            each["name"],
            fixed(each["value"], 2 if each["unit"] == "um" else 4),
            short(each["limit"], 6),
            unit(each["unit"]),
            "kept" if each["passed"] else "NOT KEPT",
        )
        for each in tolerances
    )
    return Table(columns, rows)


def project_section(document: Document) -> Section:
    """Project: what was asked for, and what its numbers mean."""
    meaning = document["conventions"]
    scale, models = model_sections.scale_word(document), model_sections.of_models(document)
    rows = [
        ("adjustment", _adjustment(document)),
        ("ground frame", document["frame"]["description"]),
        ("differences", meaning["dx, dy, dz"]),
        (f"at {scale} scale", f"metres divided by the denominator of the {scale} scale, in micrometres (µm)"),
        ("rotations", f"{meaning['angles']}; {meaning['rotation']}"),
        *((f"camera {camera['id']}", _camera(camera)) for camera in document["cameras"]),
        *_corrections(document["corrections"])[1 if models else 0 :],
        *(model_sections.project_rows(document) if models else _of_photos(document["settings"])),
    ]
    return Section("Project", (Facts(tuple(rows)),))


def _of_photos(settings: Document) -> list[tuple[str, str]]:
    """Say how photos are made a strip."""
    transfer = settings["formation"]["scale_transfer"].replace("_", " ")
    return [("screening", _screening(settings["relative"])), ("scale transfer", transfer)]


def _adjustment(document: Document) -> str:
    if document["adjustment"] == "covariance":
        alone = document["settings"].get("covariance", {}).get("distances") is False
        return "with the covariance of the strip itself" + (", control alone" if alone else "")
    if document["adjustment"] != "polynomial":
        return str(document["adjustment"])
    return f"polynomial, degree {document['settings']['polynomial']['degree']}"


def _camera(camera: Document) -> str:
    x0, y0 = camera["principal_point_mm"]
    text = f"principal distance {camera['principal_distance_mm']:g} mm, principal point {x0:g}, {y0:g} mm"
    if camera["format_mm"]:
        text += ", format {:g} x {:g} mm".format(*camera["format_mm"])
    return f"{text}, {'distortion ' + camera['distortion'] if camera['distortion'] else 'no distortion'}"


def _corrections(corrections: Document) -> list[tuple[str, str]]:
    effects = (("principal_point", "principal point"), ("distortion", "lens distortion"), ("refraction", "refraction"))
    image = [f"{name} {_effect(corrections[key])}" for key, name in effects]
    curvature = corrections["earth_curvature"]
    size = f", up to {metres(curvature['largest'])} m in height" if curvature["largest"] else ""
    if "largest_um" in curvature:
        size = f", up to {micrometres(curvature['largest_um'])} µm"
    interior = corrections["interior"]
    rows = [("image corrections", ", ".join(image)), ("Earth curvature", f"{curvature['treatment']}{size}")]
    return [*([("fiducial marks", _interior(interior))] if interior else []), *rows]


def _effect(effect: Document) -> str:
    return f"up to {micrometres(effect['largest_um'])} µm" if effect["applied"] else "none"


def _interior(interior: Document) -> str:
    text = f"{' and '.join(interior['transforms'])} transformation of {counted(interior['photos'], 'photo')}"
    if interior["largest_um"] is not None:
        text += (
            f"; residuals rms {micrometres(interior['rms_um'])} µm, largest {micrometres(interior['largest_um'])} µm, "
            f"at mark {interior['largest_mark']} of photo {interior['largest_photo']}"
        )
    if interior.get("interpolated"):
        text += "; interpolated to the points"
    return text


def _screening(settings: Document) -> str:
    method, limit = settings["screening"], settings["parallax_limit"]
    if method not in {"parallax+grubbs", "tau"}:
        return str(method)
    text = f"{method}, level {settings['grubbs_alpha']:g}"
    if method == "parallax+grubbs":
        text += f", y parallax up to {'4 of its standard deviations' if limit is None else f'{limit * 1000:g} µm'}"
    return text


def counts_section(document: Document) -> Section:
    """How much there is of everything."""
    counts, strips = document["counts"], document["strips"]
    by_role = (
        f"{counts['points']}: {counts['new_points']} new, {counts['control_points']} control "
        f"({counts['control_plan']} in plan, {counts['control_height']} in height), {counts['check_points']} check"
    )
    rows = [
        ("photos", f"{counts['photos']} in {counted(counts['strips'], 'strip')}, {counted(counts['models'], 'model')}"),
        ("points", by_role),
        *(
            model_sections.measured(document)
            if model_sections.of_models(document)
            else (
                ("image points", f"{counts['image_points']} measured, {counts['image_points_used']} used"),
                ("rejected", _rejections(counts)),
            )
        ),
        ("without coordinates", counted(counts["not_determined"], "point")),
    ]
    if len(strips) == 1:
        rows.append((f"{model_sections.scale_word(document)} scale", _scale(strips[0])))
        return Section("Counts", (Facts(tuple(rows)),))
    return Section("Counts", (Facts(tuple(rows)), _strips(strips)))


def _rejections(counts: Document) -> str:
    text = "{rejected_in_pairs} in pairs, {rejected_in_scale_transfer} in scale transfers".format(**counts)
    if "rejected_in_bundle" in counts:
        return f"{counts['rejected_in_bundle']} in the bundle adjustment; while the strips were formed {text}"
    points = counts["rejected_for_rays"]
    return f"{text}, {counted(points, 'point')} with rays that contradict each other" if points else text


def _scale(strip: Document) -> str:
    return (
        f"1:{strip['photo_scale'] or strip['model_scale']:.0f}, flying height {fixed(strip['flying_height'], 0)} m "
        f"above ground, base {fixed(strip['base'], 0)} m, azimuth {strip['azimuth_deg']:.1f} deg"
    )


def _strips(strips: Sequence[Document]) -> Table:
    columns = (
        Column("strip", left=True),
        Column("photos"),
        Column("points"),
        Column("scale 1:"),
        Column("height", "m"),
        Column("base", "m"),
        Column("azimuth", "deg"),
        Column("σ0", "µm"),
        Column("image rms", "µm", rank=1),
    )
    rows = tuple(
        (
            s["id"],
            str(s["photos"]),
            str(s["points"]),
            f"{s['photo_scale'] or s['model_scale']:.0f}",
            fixed(s["flying_height"], 0),
            fixed(s["base"], 0),
            f"{s['azimuth_deg']:.1f}",
            micrometres(s["sigma0_um"]),
            micrometres(s["image_rms_um"]),
        )
        for s in strips
    )
    return Table(columns, rows)
