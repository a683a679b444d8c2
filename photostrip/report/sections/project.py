"""What was asked for and corrected, what was decided without being asked for, and how much there is of everything."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.parts import DASH, Facts, Part, Words
from photostrip.report.page.tables import LEAST_PROBABILITY, angle_unit, fixed, keyed, metres, micrometres, short

UNKNOWN_PIXEL = 0.001  # mm: what stands in a result for a pixel whose size nobody states
NO_DEGREE = "none: no degree improves on chance, or predicts control held back any better"


def of_models(document: Document) -> bool:
    return "links" in document


def scale_word(document: Document) -> str:
    """Return the scale to which differences on the ground are brought: that of the photos or of the models."""
    return "model" if of_models(document) else "photo"


def project(document: Document) -> Iterator[Part]:
    meaning, settings = document["conventions"], document["settings"]
    scale, models = scale_word(document), of_models(document)
    rows = [
        ("adjustment", adjustment_of(document)),
        ("ground frame", document["frame"]["description"]),
        ("differences", meaning["dx, dy, dz"]),
        (f"at {scale} scale", f"metres divided by the denominator of the {scale} scale, in micrometres (µm)"),
        ("rotations", f"{meaning['angle_1 to angle_3']}; {meaning['r11 to r33']}"),
        *((f"camera {camera['id']}", camera_line(camera)) for camera in document["cameras"]),
        *_corrections(document["corrections"], models=models),
        ("screening", _of_links(settings["links"]) if models else _of_pairs(settings["relative"])),
    ]
    if models:
        rows.append(("links", "a similarity in space from model to model"))
    else:
        rows.append(("scale transfer", settings["formation"]["scale_transfer"].replace("_", " ")))
    yield Facts(tuple(rows))


def adjustment_of(document: Document) -> str:
    """Say how the points were adjusted, and who wanted it."""
    text = str(document["adjustment"])
    if text == "polynomial":
        asked = document["settings"]["polynomial"]["degree"]
        text = f"polynomial, degree {'by evidence' if asked == 'auto' else f'{asked} asked for'}"
    return f"{text}; chosen by `auto`" if document["settings"]["adjustment"] == "auto" else text


def cameras_of(document: Document) -> dict[str, Document]:
    """Return the camera of each photo, as far as the result says it; of a single photo older ones may not."""
    cameras = {row["id"]: row for row in document["cameras"]}
    of_strip = {strip["id"]: cameras[strip["camera"]] for strip in document["strips"] if strip["camera"] in cameras}
    single = {photo: camera for camera in cameras.values() for photo in camera["single_photos"]}
    only = next(iter(cameras.values())) if len(cameras) == 1 else None
    photos = zip(*(document["photos"].values(key) for key in ("id", "strip")), strict=True)
    found = {photo: single.get(photo) or of_strip.get(strip, only) for photo, strip in photos}
    return {photo: camera for photo, camera in found.items() if camera is not None}


def camera_line(camera: Document) -> str:
    unit = camera.get("unit") or "mm"
    size = camera["pixel_size_mm"] if unit == "px" else 1.0
    x0, y0 = (each / size for each in camera["principal_point_mm"])
    text = (
        f"principal distance {camera['principal_distance_mm'] / size:g} {unit}, principal point {x0:g}, {y0:g} {unit}"
    )
    if unit == "px":
        text += " from the middle, y up"
    if camera["format_mm"]:
        text += ", format {:g} x {:g} {unit}".format(*(each / size for each in camera["format_mm"]), unit=unit)
    unknown = unit == "px" and size == UNKNOWN_PIXEL
    if camera["pixel_size_mm"] and not unknown:
        text += f", pixels of {1000 * camera['pixel_size_mm']:g} µm"
    text += f", distortion {camera['distortion']}" if camera["distortion"] else ", no distortion"
    return text + "; µm in this report are pixels" * unknown


def _corrections(corrections: Document, *, models: bool) -> Iterator[tuple[str, str]]:
    curvature, interior = corrections["earth_curvature"], corrections["interior"]
    if interior:
        yield "fiducial marks", interior_line(interior)
    if not models:
        image = (
            f"{key.replace('distortion', 'lens distortion').replace('_', ' ')} "
            + (f"up to {micrometres(corrections[key]['largest_um'])} µm" if corrections[key]["applied"] else "none")
            for key in ("principal_point", "distortion", "refraction")
        )
        yield "image corrections", ", ".join(image)
    size = f", up to {metres(curvature['largest'])} m in height" if curvature["largest"] else ""
    if "largest_um" in curvature:
        size = f", up to {micrometres(curvature['largest_um'])} µm"
    yield "Earth curvature", f"{curvature['treatment']}{size}"


def interior_line(interior: Document) -> str:
    """Say how the fiducial marks were transformed, and what is left at them."""
    text = f"{' and '.join(interior['transforms'])} transformation of {counted(interior['photos'], 'photo')}"
    if interior["largest_um"] is not None:
        text += (
            f"; residuals rms {micrometres(interior['rms_um'])} µm, largest {micrometres(interior['largest_um'])} µm, "
            f"at mark {interior['largest_mark']} of photo {interior['largest_photo']}"
        )
    return text + "; the residuals are interpolated to the points" * bool(interior.get("interpolated"))


def _of_pairs(settings: Document) -> str:
    method, limit = settings["screening"], settings["parallax_limit"]
    if method not in {"parallax+grubbs", "tau"}:
        return str(method)
    text = f"{method}, level {settings['grubbs_alpha']:g}"
    if method == "parallax+grubbs":
        text += f", y parallax up to {'4 times its standard deviation' if limit is None else f'{limit * 1000:g} µm'}"
    return text


def _of_links(settings: Document) -> str:
    text = str(settings["screening"])
    if text == "auto":
        text = f"each common point as a whole, level {settings['alpha']:g} for the strip"
    named = [f"{name} {', '.join(settings[name])}" for name in ("keep", "drop") if settings[name]]
    return "; ".join([text, *named])


def counts(document: Document) -> Iterator[Part]:
    yield Facts(tuple(counts_rows(document)))
    if len(document["strips"]) > 1:
        scale = "model_scale" if of_models(document) else "photo_scale"
        keys = f"id photos points {scale} flying_height base azimuth_deg sigma0_um image_rms_um:1"
        yield keyed(document["strips"], keys)


def counts_rows(document: Document) -> Iterator[tuple[str, str]]:
    """Count photos, points and measurements; scale, height and base."""
    counts, strips, summary, unit = document["counts"], document["strips"], document["summary"], angle_unit(document)
    flown = f"in {counted(counts['strips'], 'strip')}, {counted(counts['models'], 'model')}"
    if counts["strips"] in {0, counts["photos"]}:
        flown = "in no strip"
    yield "photos", f"{counts['photos']} {flown}"
    text = "{points}: {new_points} new, {control_points} control ({control_plan} in plan, {control_height} in height), "
    yield "points", f"{text}{{check_points}} check".format(**counts)
    if of_models(document):
        text = "{model_points} of points, {model_points_used} used; {model_centers} of perspective centres"
        yield "model coordinates", text.format(**counts)
        yield "rejected", f"{counts['rejected_in_links']} in links" if counts["rejected_in_links"] else DASH
    else:
        yield "image points", "{image_points} measured, {image_points_used} used".format(**counts)
        yield "rejected", _rejections(counts)
    yield "without coordinates", counted(counts["not_determined"], "point")
    if len(strips) == 1:
        (strip,) = strips
        text = (
            f"1:{strip['photo_scale'] or strip['model_scale']:.0f}, flying height {fixed(strip['flying_height'], 0)} m "
            f"above ground, base {fixed(strip['base'], 0)} m, azimuth {unit.text(strip['azimuth_deg'], 1)} {unit.name}"
        )
        yield f"{scale_word(document)} scale", text
    elif not len(strips):  # single photos, which form none
        scale = f"1:{summary['photo_scale']:.0f}, flying height {fixed(summary['flying_height'], 0)} m above ground"
        yield "photo scale", scale
    if size := summary.get("gsd"):
        text = f"{short(size['median'], 3)} m, {short(size['least'], 3)} to {short(size['largest'], 3)} m"
        yield "ground sample", f"{text}: what a pixel covers, median and range of the photos"


def _rejections(counts: Document) -> str:
    text = "{rejected_in_pairs} in pairs, {rejected_in_scale_transfer} in scale transfers".format(**counts)
    if "rejected_in_bundle" in counts:
        return f"{counts['rejected_in_bundle']} in the bundle adjustment; while the strips were formed {text}"
    points = counts["rejected_for_rays"]
    return f"{text}, {counted(points, 'point')} with rays that contradict each other" if points else text


def decisions(document: Document) -> Iterator[Part]:
    """Say what `auto` came to, and why."""
    rows = tuple(_decisions(document))
    yield Facts(rows) if rows else Words("Nothing: every choice is made in the project file.")


def _decisions(document: Document) -> Iterator[tuple[str, str]]:
    settings, counts = document["settings"], document["counts"]
    if settings["adjustment"] == "auto":
        bundle = f"bundle, which all {'models' if of_models(document) else 'photos'} together determine"
        why_not = "polynomial: no bundle could be had, the notes say why"
        yield "adjustment", bundle if "bundle" in document else why_not
    for block in document.get("polynomials", []):
        if block["asked"] == "auto":
            text = chosen_degrees(document["polynomial_evidence"].where(strip=block["strip"]))
            how = "F: variance ratio of what it gains over the degree before; p: probability of such a gain by chance"
            label = "polynomial" if len(document["strips"]) == 1 else f"polynomial of {block['strip']}"
            yield label, text if text == NO_DEGREE else f"{text}; {how}"
    if "relative" in settings:
        if settings["relative"]["screening"] == "auto":
            text = "robust start, then a global test of each pair, points left out singly and in sets"
            yield "screening", f"{text}; {counted(counts['rejected_in_pairs'], 'point')} left out"
        elif settings["relative"]["screening"] == "parallax+grubbs" and settings["relative"]["parallax_limit"] is None:
            sigma = f"{micrometres(document['summary']['sigma_given_um'])} µm stated for an image coordinate"
            yield "limit of y parallax", f"four times its standard deviation, which follows from the {sigma}"
    elif settings["links"]["screening"] == "auto":
        text = "every common point of each link tested as a whole, the worst left out first"
        yield "screening", f"{text}; {counted(counts['rejected_in_links'], 'point')} left out"
    interior = document["corrections"]["interior"]
    if interior and settings["interior"]["transform"] == "auto":
        text = "transformation: affine where four or more marks determine it, otherwise conformal"
        yield "fiducial marks", f"{' and '.join(interior['transforms'])} {text}"
    curvature = document["corrections"]["earth_curvature"]
    if curvature["asked"] == "auto":
        yield "Earth curvature", f"{curvature['treatment']}, as the frame of the control requires"
    yield from _heights(document, settings.get("refinement", {}))


def chosen_degrees(evidence: Sequence[Document]) -> str:
    """Say of which degree a polynomial is, in plan and in height, and what spoke for it."""
    chosen = {row["group"]: _step(row) for row in evidence if row["accepted"] and row["degree"]}
    if not chosen:
        return NO_DEGREE
    plan, height = (chosen.get(group, "none") for group in ("plan", "height"))
    return f"{plan} in plan and in height" if plan == height else f"{plan} in plan and {height} in height"


def _step(row: Document) -> str:
    if row["f"] is None or row["p"] is None:
        return f"degree {row['degree']}"
    probability = f"p = {row['p']:.3f}" if row["p"] >= LEAST_PROBABILITY else f"p below {LEAST_PROBABILITY:g}"
    return f"degree {row['degree']} (F = {row['f']:.1f}, {probability})"


def _heights(document: Document, settings: Document) -> Iterator[tuple[str, str]]:
    asked = [name for name, key in (("refraction", "refraction"), ("curvature", "earth_radius")) if settings.get(key)]
    if asked and (settings["flying_height"] is None or settings["ground_height"] is None):
        known = list(document["strips"]) or [document["summary"]]
        heights = ", ".join(f"{short(each['flying_height'])} m" for each in known)
        without = "it" if len(asked) == 1 else "them"
        label = f"heights for {' and '.join(asked)}"
        yield label, f"from a first run without {without}; flying height above ground {heights}"
