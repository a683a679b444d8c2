"""What was asked for and corrected, and how much there is of everything."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from math import hypot

from photostrip.notes import Document, counted
from photostrip.report.page.angles import AngleUnit, angle_unit
from photostrip.report.page.numbers import fixed, joined, metres, micrometres, short
from photostrip.report.page.parts import Facts, Section
from photostrip.report.page.tables import Shown, angle, number, tabulated, words
from photostrip.report.sections.models import measured, of_models, project_rows, scale_word
from photostrip.report.sections.strip import worst_first


def project_section(document: Document) -> Section:
    meaning = document["conventions"]
    scale, models = scale_word(document), of_models(document)
    rows = [
        ("adjustment", adjustment_of(document)),
        ("ground frame", document["frame"]["description"]),
        ("differences", meaning["dx, dy, dz"]),
        (f"at {scale} scale", f"metres divided by the denominator of the {scale} scale, in micrometres (µm)"),
        ("rotations", f"{meaning['angle_1 to angle_3']}; {meaning['r11 to r33']}"),
        *((f"camera {camera['id']}", camera_line(camera)) for camera in document["cameras"]),
        *_corrections(document["corrections"])[1 if models else 0 :],
        *(project_rows(document) if models else _of_photos(document["settings"])),
    ]
    return Section("Project", (Facts(tuple(rows)),))


def _of_photos(settings: Document) -> list[tuple[str, str]]:
    transfer = settings["formation"]["scale_transfer"].replace("_", " ")
    return [("screening", _screening(settings["relative"])), ("scale transfer", transfer)]


def fiducials_section(document: Document, *, everything: bool) -> Section:
    """Interior orientation: the transformation of each photo, and what is left at its marks."""
    rows, unit = document["fiducials"], angle_unit(document)
    marks = list(document["fiducial_marks"])
    largest: dict[str, float] = {}
    for mark in marks:
        largest[mark["photo"]] = max(largest.get(mark["photo"], 0.0), _length(mark))

    def worst(row: Document) -> float:
        return largest.get(row["photo"], 0.0)

    photos, note = worst_first(rows, worst, ("photos", "fiducials", "fiducials"), everything=everything)
    shown, rest = worst_first(marks, _length, ("marks", "fiducials", "fiducial_marks"), everything=everything)
    shapes = (
        words("photo", "photo"),
        words("transformation", "transform"),
        number("marks", "marks"),
        number("σ0", "sigma0_um", 1, "µm"),
        number("largest", worst, 1, "µm"),
        number("scale x", "scale_x", 6),
        number("scale y", "scale_y", 6),
        angle("turn", "rotation_deg", 4, unit, rank=1),
        angle("shear", "shear_deg", 4, unit, rank=1),
        words("", lambda row: "mirrored" if row["mirrored"] else "", rank=2),
    )
    coefficients = (
        words("photo", lambda pair: pair[0]["photo"]),
        words("of", lambda pair: COORDINATES[pair[1]]),
        *(number(term, _coefficient(n), partial(short, digits=10)) for n, term in enumerate(("x", "y", "xy", "1"))),
    )
    denominator = any(row["transform"] == "projective" for row in rows)
    lines = [(row, axis) for row in photos for axis in range(3 if denominator else 2)]
    residuals = (
        words("photo", "photo"),
        words("mark", "mark"),
        number("v x", "vx_um", 1, "µm"),
        number("v y", "vy_um", 1, "µm"),
    )
    tables = (
        tabulated(photos, shapes, note=joined(note, "scale: photo over measured; turn, shear: counter-clockwise")),
        tabulated(lines, coefficients, note="photo coordinates, mm, from the measured ones"),
        tabulated(shown, residuals, note=joined(rest, "transformed minus calibrated")),
    )
    return Section("Interior orientation", tables)


COORDINATES = ("x", "y", "divided by")


def _coefficient(term: int) -> Callable[[tuple[Document, int]], float]:
    return lambda pair: float(pair[0]["coefficients"][pair[1]][term])


def _length(mark: Document) -> float:
    return hypot(mark["vx_um"], mark["vy_um"])


def adjustment_of(document: Document) -> str:
    """Say how the points were adjusted, and who wanted it."""
    text = _adjustment_of(document)
    return f"{text}; chosen by `auto`" if document["settings"]["adjustment"] == "auto" else text


def _adjustment_of(document: Document) -> str:
    if document["adjustment"] != "polynomial":
        return str(document["adjustment"])
    asked = document["settings"]["polynomial"]["degree"]
    return f"polynomial, degree {'by evidence' if asked == 'auto' else f'{asked} asked for'}"


def cameras_of(document: Document) -> dict[str, Document]:
    """Return the camera of each photo, as far as the result says it; of a single photo older ones may not."""
    cameras = {row["id"]: row for row in document["cameras"]}
    of_strip = {strip["id"]: cameras[strip["camera"]] for strip in document["strips"] if strip["camera"] in cameras}
    single = {photo: camera for camera in cameras.values() for photo in camera["single_photos"]}
    only = next(iter(cameras.values())) if len(cameras) == 1 else None
    found = {photo["id"]: single.get(photo["id"]) or of_strip.get(photo["strip"], only) for photo in document["photos"]}
    return {photo: camera for photo, camera in found.items() if camera is not None}


def camera_line(camera: Document) -> str:
    x0, y0 = camera["principal_point_mm"]
    text = f"principal distance {camera['principal_distance_mm']:g} mm, principal point {x0:g}, {y0:g} mm"
    if camera["format_mm"]:
        text += ", format {:g} x {:g} mm".format(*camera["format_mm"])
    if camera["pixel_size_mm"]:
        text += f", pixels of {1000 * camera['pixel_size_mm']:g} µm"
    return f"{text}, {'distortion ' + camera['distortion'] if camera['distortion'] else 'no distortion'}"


def _corrections(corrections: Document) -> list[tuple[str, str]]:
    effects = (("principal_point", "principal point"), ("distortion", "lens distortion"), ("refraction", "refraction"))
    image = [
        f"{name} up to {micrometres(corrections[key]['largest_um'])} µm"
        if corrections[key]["applied"]
        else f"{name} none"
        for key, name in effects
    ]
    curvature = corrections["earth_curvature"]
    size = f", up to {metres(curvature['largest'])} m in height" if curvature["largest"] else ""
    if "largest_um" in curvature:
        size = f", up to {micrometres(curvature['largest_um'])} µm"
    interior = corrections["interior"]
    rows = [("image corrections", ", ".join(image)), ("Earth curvature", f"{curvature['treatment']}{size}")]
    return [*([("fiducial marks", interior_line(interior))] if interior else []), *rows]


def interior_line(interior: Document) -> str:
    """Say how the fiducial marks were transformed, and what is left at them."""
    text = f"{' and '.join(interior['transforms'])} transformation of {counted(interior['photos'], 'photo')}"
    if interior["largest_um"] is not None:
        text += (
            f"; residuals rms {micrometres(interior['rms_um'])} µm, largest {micrometres(interior['largest_um'])} µm, "
            f"at mark {interior['largest_mark']} of photo {interior['largest_photo']}"
        )
    if interior.get("interpolated"):
        text += "; the residuals are interpolated to the points"
    return text


def _screening(settings: Document) -> str:
    method, limit = settings["screening"], settings["parallax_limit"]
    if method not in {"parallax+grubbs", "tau"}:
        return str(method)
    text = f"{method}, level {settings['grubbs_alpha']:g}"
    if method == "parallax+grubbs":
        text += f", y parallax up to {'4 times its standard deviation' if limit is None else f'{limit * 1000:g} µm'}"
    return text


def counts_section(document: Document) -> Section:
    facts = Facts(tuple(counts_rows(document)))
    strips = document["strips"]
    return Section("Counts", (facts, tabulated(strips, _strips(angle_unit(document)))) if len(strips) > 1 else (facts,))


def counts_rows(document: Document) -> Iterator[tuple[str, str]]:
    """Count photos, points and measurements; scale, height and base."""
    counts, strips = document["counts"], document["strips"]
    flown = counted(counts["strips"], "strip") if counts["strips"] else "no strip"
    yield "photos", f"{counts['photos']} in {flown}, {counted(counts['models'], 'model')}"
    by_role = (
        f"{counts['points']}: {counts['new_points']} new, {counts['control_points']} control "
        f"({counts['control_plan']} in plan, {counts['control_height']} in height), {counts['check_points']} check"
    )
    yield "points", by_role
    if of_models(document):
        yield from measured(document)
    else:
        yield "image points", f"{counts['image_points']} measured, {counts['image_points_used']} used"
        yield "rejected", _rejections(counts)
    yield "without coordinates", counted(counts["not_determined"], "point")
    if len(strips) == 1:
        yield f"{scale_word(document)} scale", _scale(strips[0], angle_unit(document))
    elif not strips:  # single photos, which form none
        summary = document["summary"]
        scale = f"1:{summary['photo_scale']:.0f}, flying height {fixed(summary['flying_height'], 0)} m above ground"
        yield "photo scale", scale
    size = document["summary"].get("gsd")
    if size:
        text = f"{short(size['median'], 3)} m, {short(size['least'], 3)} to {short(size['largest'], 3)} m"
        yield "ground sample", f"{text}: what a pixel covers, median and range of the photos"


def _rejections(counts: Document) -> str:
    text = "{rejected_in_pairs} in pairs, {rejected_in_scale_transfer} in scale transfers".format(**counts)
    if "rejected_in_bundle" in counts:
        return f"{counts['rejected_in_bundle']} in the bundle adjustment; while the strips were formed {text}"
    points = counts["rejected_for_rays"]
    return f"{text}, {counted(points, 'point')} with rays that contradict each other" if points else text


def _scale(strip: Document, unit: AngleUnit) -> str:
    return (
        f"1:{strip['photo_scale'] or strip['model_scale']:.0f}, flying height {fixed(strip['flying_height'], 0)} m "
        f"above ground, base {fixed(strip['base'], 0)} m, azimuth {unit.text(strip['azimuth_deg'], 1)} {unit.name}"
    )


def _strips(unit: AngleUnit) -> tuple[Shown, ...]:
    return (
        words("strip", "id"),
        number("photos", "photos"),
        number("points", "points"),
        number("scale 1:", lambda strip: f"{strip['photo_scale'] or strip['model_scale']:.0f}"),
        number("height", "flying_height", 0, "m"),
        number("base", "base", 0, "m"),
        angle("azimuth", "azimuth_deg", 1, unit),
        number("σ0", "sigma0_um", 1, "µm"),
        number("image rms", "image_rms_um", 1, "µm", rank=1),
    )
