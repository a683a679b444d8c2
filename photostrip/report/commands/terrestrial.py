"""Reports of direction computations: from their documents to sections of sentences, facts and tables."""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import calibrated, fixed, short
from photostrip.report.page.parts import DASH, Column, Facts, Part, Section, Table, Words, numbered
from photostrip.report.page.tables import number, over_plane, tabulated, words

ANGLE_DECIMALS = 5  # in deg and gon: 0.04 and 0.03 seconds of arc


def direction_report(document: Document) -> tuple[str, tuple[Section, ...]]:
    title, build = BUILDERS[document["kind"]]
    return title, build(document)


def _camera_facts(document: Document) -> list[tuple[str, str]]:
    camera = document["camera"]
    x0, z0 = camera["principal_point_mm"]
    interior = f"f {short(camera['principal_distance_mm'], 9)} mm"
    interior += f", principal point {short(x0, 9)}, {short(z0, 9)} mm" if (x0, z0) != (0.0, 0.0) else ""
    rows = [("camera", f"{camera['name']}, {interior}")]
    if "orientation" in document:
        angles = document["orientation"]
        values = ", ".join(f"{name} {fixed(angles[name], ANGLE_DECIMALS)}" for name in ("alpha", "omega", "kappa"))
        rows.append(("orientation", f"{values} {angles['unit']}"))
    return rows


def _sigma(document: Document) -> str:
    return f"{short(document['image_sigma_um'])} µm in the photo, of x, z and the principal distance"


def _conversion(document: Document) -> tuple[Section, ...]:
    unit = document["orientation"]["unit"]
    facts = _camera_facts(document)
    columns = [words("point", "id"), number("x", "x", 4, "mm"), number("z", "z", 4, "mm")]
    columns += [number(name, name, ANGLE_DECIMALS, unit) for name in ("lambda", "beta")]
    if "image_sigma_um" in document:
        facts.append(("standard deviation", _sigma(document)))
        columns += [number(f"m_{name}", f"sigma_{name}_arcsec", 2, "″") for name in ("lambda", "beta")]
    return (Section("", (Facts(tuple(facts)), tabulated(document["points"], columns))),)


def _accuracy(document: Document) -> tuple[Section, ...]:
    printed = document["formulas"] == "as printed"
    points = document["points"]
    facts = [*_camera_facts(document), ("standard deviation", _sigma(document)), ("formulas", document["formulas"])]
    strictest = {name: min(row[f"{name}_arcsec"] for row in points) for name in ("horizontal", "vertical")}
    facts.append(
        (
            "needed everywhere",
            f"horizontal {fixed(strictest['horizontal'], 2)}″, vertical {fixed(strictest['vertical'], 2)}″",
        )
    )
    sections = [
        Section("", (Facts(tuple(facts)),)),
        Section("Horizontal directions, m_lambda in ″", (_matrix(points, "horizontal_arcsec"),)),
    ]
    if not printed:
        sections.append(Section("Vertical directions, m_beta in ″", (_matrix(points, "vertical_arcsec"),)))
        return tuple(sections)
    note = (
        "The vertical directions inherit sec(lambda') from eq. 3, where cos(lambda') is right; without --as-printed the"
        " exact values are given."
    )
    sections += [
        Section("Vertical directions as printed (eq. 6), m_beta in ″", (_matrix(points, "vertical_arcsec"),)),
        Section("Vertical directions as printed (eq. 5), m_beta in ″", (_matrix(points, "vertical_eq5_arcsec"),)),
        Section("Vertical directions, exact, m_beta in ″", (_matrix(points, "vertical_exact_arcsec"), Words(note))),
    ]
    return tuple(sections)


def _matrix(points: Sequence[Document], name: str) -> Table:
    return over_plane(
        points, ("x", "z"), name, Column("z \\ x", "mm"), lambda value: fixed(value, 2), lambda at: short(at, 9)
    )


def _theodolite(document: Document) -> tuple[Section, ...]:
    given, supported = document["theodolite"], document["supported_um"]
    one = f"horizontal {short(given['horizontal_arcsec'])}″, vertical {short(given['vertical_arcsec'])}″"
    mean = (
        f"horizontal {fixed(given['mean_horizontal_arcsec'], 2)}″, vertical {fixed(given['mean_vertical_arcsec'], 2)}″"
    )
    facts = [
        *_camera_facts(document),
        ("theodolite, one round", one),
        (f"mean of {counted(given['rounds'], 'round')}", mean),
        (
            "supports in the photo",
            (
                f"{fixed(supported['by_both'], 2)} µm everywhere (horizontal {fixed(supported['by_horizontal'], 2)},"
                f" vertical {fixed(supported['by_vertical'], 2)})"
            ),
        ),
    ]
    if "wanted" in document:
        wanted = document["wanted"]
        horizontal, vertical = wanted["rounds_horizontal"], wanted["rounds_vertical"]
        facts.append(
            (
                f"for {short(wanted['image_sigma_um'])} µm",
                f"{counted(max(horizontal, vertical), 'round')} (horizontal {horizontal}, vertical {vertical})",
            )
        )
    return (
        Section("", (Facts(tuple(facts)),)),
        Section(
            "Standard deviation of image coordinates that it supports, µm",
            (_matrix(document["points"], "supported_um"),),
        ),
    )


def _examples(document: Document) -> tuple[Section, ...]:
    table = tabulated(
        document["examples"],
        (
            words("camera", "camera"),
            number("f", "f_mm", short, "mm"),
            number("m_lambda", "horizontal_printed_arcsec", 1, "printed ″"),
            number("m_lambda", "horizontal_exact_arcsec", 2, "exact ″"),
            number("m_beta", "vertical_printed_arcsec", 1, "printed ″"),
            number("with 1.18", "vertical_with_printed_factor_arcsec", 2, "″"),
            number("eq. 6", "vertical_eq6_arcsec", 2, "″"),
            number("eq. 5", "vertical_eq5_arcsec", 2, "″"),
            number("m_beta", "vertical_exact_arcsec", 2, "exact ″"),
        ),
    )
    first = document["examples"][0]
    facts = Facts(
        (
            ("point", f"x {short(first['x_mm'])} mm, z {short(first['z_mm'])} mm"),
            ("standard deviation", f"{short(first['image_sigma_um'])} µm"),
        )
    )
    return (Section("", (facts, table)), Section("What is wrong in print", _misprints(document)))


def _misprints(document: Document) -> tuple[Part, ...]:
    """Explain the misprints with the numbers of the examples."""
    first, second = document["examples"]
    small = [100 * (1 - row["vertical_eq6_arcsec"] / row["vertical_eq5_arcsec"]) for row in (first, second)]
    z = short(first["z_mm"])
    return numbered(
        (
            "Eq. 3 computes beta with sec(lambda') = sqrt(1 + x²/f²); it must be cos(lambda'). Put back into eq. 2, the"
            f" printed form returns z = {fixed(first['z_returned_by_printed_eq3_mm'], 1)} mm for z = {z} mm with"
            f" f = {short(first['f_mm'])} mm. The derivatives of beta (eq. 4) and m_beta (eq. 5, 6) inherit it."
        ),
        (
            f"Eq. 6 also drops x² under the root of the numerator of eq. 5, which makes it {fixed(small[0], 0)} % and"
            f" {fixed(small[1], 0)} % smaller in the two examples; the source admits 10-20 %."
        ),
        (
            f"The factor 1 + x²/f² is {short(first['factor_of_camera'], 3)} for f = {short(first['f_mm'])} mm only."
            f" The second example uses the same {short(second['factor_printed'], 3)}, but for f ="
            f" {short(second['f_mm'])} mm it is {short(second['factor_of_camera'], 3)}."
        ),
        (
            "With all terms of first order and the cosine the radicand of eq. 6 is f² + x² + z², where"
            " f² + z² (1 + x²/f²) is printed: m_beta = m rho / sqrt(f² + x² + z²). m_lambda is right:"
            " m rho / sqrt(2 (f² + x²))."
        ),
        (
            "The printed results are rounded, mostly to 0.5″; m_lambda of the second example is printed as 6.0″ where"
            f" its own formula gives {fixed(second['horizontal_exact_arcsec'], 2)}″."
        ),
    )


def _orientation(document: Document) -> tuple[Section, ...]:
    summary = document["summary"]
    lower, upper = summary["sigma0_range"]
    given = []
    if "eccentricity_m" in document:
        given.append(("front node", f"{short(document['eccentricity_m'])} m ahead of the theodolite's axes"))
    if "refraction" in document:
        given.append(("refraction", f"k {short(document['refraction'])} of the photo's rays"))
    facts = [
        *_camera_facts(document),
        *given,
        ("points", f"{summary['points_used']} of {summary['points']} used, {summary['directions_used']} directions"),
        ("redundancy", str(summary["redundancy"]) if summary["redundancy"] else "0: no check"),
        (
            "sigma0",
            DASH
            if summary["sigma0"] is None
            else f"{fixed(summary['sigma0'], 2)} times the stated standard deviations; between {fixed(lower, 2)} and"
            f" {fixed(upper, 2)} is as expected",
        ),
        ("condition number", short(summary["condition"], 3)),
    ]
    elements = Table(
        (Column("element", left=True), Column("value"), Column("", left=True), Column("sigma"), Column("", left=True)),
        tuple(_element(row) for row in document["elements"]),
    )
    points = tabulated(
        document["points"],
        (
            words("point", "id"),
            number("v lambda", "v_lambda_arcsec", 1, "″"),
            number("v beta", "v_beta_arcsec", 1, "″"),
            number("redundancy", "redundancy_lambda", 2, "lambda"),
            number("redundancy", "redundancy_beta", 2, "beta"),
            words("", lambda point: "" if point["used"] else "rejected"),
        ),
    )
    parts: list[Part] = [Facts(tuple(facts))]
    if summary["sigma0"] is not None and not lower <= summary["sigma0"] <= upper:
        parts.append(Words("The scatter of the directions does not agree with the stated standard deviations.", "look"))
    sections = [Section("", tuple(parts)), Section("Elements", (elements,)), Section("Residuals", (points,))]
    if document["rejected"]:
        sections.append(Section("Rejected", tuple(map(_rejected, document["rejected"]))))
    return tuple(sections)


def _element(row: Document) -> tuple[str, ...]:
    if row["unit"] == "mm":
        return row["name"], fixed(row["value"], 4), "mm", fixed(row["sigma"], 1), "µm"
    if not row["unit"]:
        return row["name"], fixed(row["value"], 3), "", fixed(row["sigma"], 3), ""
    return row["name"], fixed(row["value"], ANGLE_DECIMALS), row["unit"], fixed(row["sigma"], 1), "″"


def _rejected(row: Document) -> Words:
    test = (
        f"p value {short(row['value'], 2)}, limit {short(row['limit'], 2)}"
        if row["test"] == "deletion"
        else f"chi-square {short(row['value'], 3)}, limit {short(row['limit'], 3)}"
    )
    miss = f"lambda {fixed(row['lambda_arcsec'], 1)}″, beta {fixed(row['beta_arcsec'], 1)}″"
    return Words(f"{row['point']}: {miss} off the orientation without it ({test})", mark="-")


def _cameras(document: Document) -> tuple[Section, ...]:
    table = tabulated(
        document["cameras"],
        (
            words("camera", "id"),
            number("f", "principal_distance_mm", calibrated, "mm"),
            number("x0", "x0_mm", calibrated, "mm"),
            number("z0", "z0_mm", calibrated, "mm"),
            number("format", _format, str, "mm"),
        ),
    )
    return (Section("", (table,)),)


def _format(camera: Document) -> str:
    return DASH if camera["width_mm"] is None else f"{short(camera['width_mm'])} × {short(camera['height_mm'])}"


BUILDERS = {
    "directions": ("Directions of image points", _conversion),
    "photo-coordinates": ("Image coordinates of directions", _conversion),
    "direction-accuracy": ("Required accuracy of correction directions", _accuracy),
    "theodolite-accuracy": ("Image accuracy that a theodolite supports", _theodolite),
    "worked-examples": ("The worked examples of the source", _examples),
    "photo-orientation": ("Orientation of a photo by directions", _orientation),
    "cameras": ("Cameras", _cameras),
}
