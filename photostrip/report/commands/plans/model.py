"""Report of the plan of one model."""

from __future__ import annotations

from collections.abc import Callable

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import fixed, metres, micrometres, short, signed
from photostrip.report.page.parts import Column, Facts, Section, Table, Words, numbered
from photostrip.report.page.tables import Shown, number, over_plane, tabulated, words

USES = {"xyz": "in full", "xy": "in plan", "z": "in height"}
SAME_FORM = 1e-6  # relative: below it two forms say the same
UNITS = {"um": "µm", "arcsec": "″", "m": "m", "ppm": "ppm"}
PARTS = {
    "measuring": "measuring, dx1",
    "orientation": "relative orientation, dx2",
    "absolute": "absolute orientation, dx3",
    "total": "all: dx1 + dx2 - dx3",
}
CAUSES = {"measuring": "measuring, δ1", "elements": "the elements, δ2", "control": "given coordinates, δ3"}


def model_sections(document: Document) -> tuple[Section, ...]:
    geometry, worst = document["geometry"], document["worst"]
    sigmas = "; ".join(
        f"{each['element']} {fixed(each['sigma'], 1)}{' µm' if each['unit'] == 'um' else '″'}"
        for each in document["orientation"]["sigmas"]
    )
    facts = Facts(
        (
            ("camera", f"{document['camera']['name']}, f {short(document['camera']['principal_distance_mm'], 9)} mm"),
            (
                "photos",
                (
                    f"1:{geometry['scale']:g}, {fixed(geometry['flying_height_m'], 0)} m above the ground; base"
                    f" {fixed(geometry['base_mm'], 1)} mm, {fixed(geometry['base_m'], 0)} m"
                ),
            ),
            (
                "measuring",
                (
                    f"{micrometres(document['image_sigma_um'])} µm for an image coordinate,"
                    f" {micrometres(document['parallax_sigma_um'])} µm for a y parallax"
                ),
            ),
            ("orientation", f"{counted(document['orientation']['points'], 'point')}: {sigmas}"),
            ("control", _control(document)),
            (
                "worst height",
                f"{metres(worst['sigma_z_m'])} m at x {fixed(worst['x_mm'], 1)}, y {fixed(worst['y_mm'], 1)} mm",
            ),
        )
    )
    return (
        Section("", (facts,)),
        Section("Standard deviation in plan (both coordinates), m", (_grid(document["points"], "sigma_plan_m"),)),
        Section("Standard deviation in height, m", (_grid(document["points"], "sigma_z_m"),)),
        Section("What each source of errors does alone", (_sources(document),)),
        Section("At the control", (_at_control(document),)),
        Section("The simple formulas, relative orientation and measuring only", (_simple(document),)),
        *_named(document),
        *_given(document),
        *_bent(document),
        *_forms(document),
    )


def _control(document: Document) -> str:
    points = document["control"]
    kinds = [f"{sum(p['use'] == use for p in points)} {word}" for use, word in USES.items()]
    given = ", ".join(kind for kind in kinds if not kind.startswith("0 "))
    sigma = ", ".join(metres(value) for value in document["control_sigma_m"])
    return f"{given}; given to {sigma} m along, across and in height"


def _grid(points: list[Document], name: str, form: Callable[[float], str] = metres) -> Table:
    return over_plane(points, ("x_mm", "y_mm"), name, Column("y \\ x", "mm"), form, lambda at: fixed(at, 0))


def _sources(document: Document) -> Table:
    columns = (
        words("source", "source"),
        number("plan rms", "plan_rms_m", 3, "m"),
        number("plan max", "plan_max_m", 3, "m"),
        number("height rms", "z_rms_m", 3, "m"),
        number("height max", "z_max_m", 3, "m"),
    )
    *single, each, together = document["sources"]
    foot = tabulated((each, together), columns).rows
    note = "over the points above; dalpha2 is the turn of the right photo against the base"
    return tabulated(single, columns, foot, note)


def _at_control(document: Document) -> Table:
    return tabulated(
        document["control"],
        (
            number("x", "x_mm", 1, "mm"),
            number("y", "y_mm", 1, "mm"),
            words("given", lambda point: USES[point["use"]]),
            number("plan", "sigma_plan_m", 3, "m"),
            number("height", "sigma_z_m", 3, "m"),
        ),
        note="of the adjusted model point; the given coordinates stay what they are",
    )


def _simple(document: Document) -> Table:
    return tabulated(
        document["simple"],
        (
            words("place", "place"),
            number("plan", "source_plan_m", 3, "source, m"),
            number("height", "source_z_m", 3, "source, m"),
            number("plan", "rigorous_plan_m", 3, "rigorous, m"),
            number("height", "rigorous_z_m", 3, "rigorous, m"),
        ),
    )


def _named(document: Document) -> tuple[Section, ...]:
    if "named" not in document:
        return ()
    table = tabulated(
        document["named"],
        (
            words("point", "point"),
            number("x", "x_mm", 1, "mm"),
            number("y", "y_mm", 1, "mm"),
            number("above", "height_m", 1, "m"),
            number("along", "sigma_x_m", 3, "m"),
            number("across", "sigma_y_m", 3, "m"),
            number("height", "sigma_z_m", 3, "m"),
            number("plan", "adjusted_plan_m", 3, "adjusted, m"),
            number("height", "adjusted_z_m", 3, "adjusted, m"),
        ),
        note="standard deviations; adjusted: with the elements as unknowns; x, y on the ground at photo scale",
    )
    return (Section("At the points named", (table,)),)


def _given(document: Document) -> tuple[Section, ...]:
    """Say what given errors or misclosures do to the points."""
    if "given" not in document:
        return ()
    given = document["given"]
    adjusted = "; ".join(_valued(each, "element") for each in given["adjusted_elements"])
    facts = [
        ("orientation", "; ".join(_valued(each, "parameter") for each in given["parameters"])),
        ("elements found", adjusted),
    ]
    if any(each["value"] for each in given["elements"]):
        facts.insert(0, ("elements given", "; ".join(_valued(each, "element") for each in given["elements"])))
    sections = [
        Section(
            "Misclosures at the control, model minus given",
            (
                tabulated(given["misclosures"], (words("control", "point"), *_signed_columns("misclosure"))),
                Facts(tuple(facts)),
            ),
        )
    ]
    if "errors" in given:
        sections.append(Section("Errors of the points that follow", (_errors(given["errors"]),)))
    corrections = tabulated(
        given["corrections"],
        (
            words("point", "point"),
            *_signed_columns("plain", "plain, m"),
            *_signed_columns("adjusted", "adjusted, m"),
        ),
        note="to be subtracted; plain: dx3 of the absolute orientation alone; adjusted: with the elements found",
    )
    return (*sections, Section("Corrections from the misclosures", (corrections,)))


def _errors(points: list[Document]) -> Table:
    """List the parts of each point's errors, without those that are zero at all points."""
    parts, causes = (_felt(points, kind, name) for kind, name in (("parts", "part"), ("causes", "cause")))
    rows = []
    for point in points:
        of_point = [{"of": PARTS[each["part"]], **each} for each in point["parts"] if each["part"] in parts]
        if len(causes) > 1:
            of_point += [{"of": CAUSES[each["cause"]], **each} for each in point["causes"] if each["cause"] in causes]
        rows += [{"point": "" if number else point["point"], **row} for number, row in enumerate(of_point)]
    return tabulated(
        rows,
        (words("point", "point"), words("part", "of"), *_signed_columns("error")),
        note="δ1 + δ2 + δ3 are the same errors by what causes them" if len(causes) > 1 else "",
    )


def _felt(points: list[Document], kind: str, name: str) -> set[str]:
    """Name the parts that are not zero everywhere."""
    axes = ("error_x_m", "error_y_m", "error_z_m")
    return {each[name] for point in points for each in point[kind] if any(each[axis] for axis in axes)}


def _signed_columns(name: str, unit: str = "m") -> tuple[Shown, ...]:
    heads = (("along", "x"), ("across", "y"), ("height", "z"))
    return tuple(number(head, f"{name}_{axis}_m", signed, unit) for head, axis in heads)


def _valued(each: Document, name: str) -> str:
    unit = UNITS[each["unit"]]
    value = fixed(each["value"], 3 if unit == "m" else 1)
    return f"{each[name]} {value}{'' if unit == '″' else ' '}{unit}"


def _bent(document: Document) -> tuple[Section, ...]:
    """Show the deformation by given errors of the elements, on the grid."""
    if "bent" not in document:
        return ()
    bent, points = document["bent"], document["bent"]["points"]
    surface = tabulated(
        bent["surface"], (words("term", "term"), number("value", "value", short), words("unit", "unit"))
    )
    corner = Words(
        f"dZ = E0 + A x + B y + C x y + D x². Twist C moves a corner by {metres(bent['twist_at_corner_m'])} m against"
        f" the middle, bending D by {metres(bent['bending_at_corner_m'])} m; E0, A, B go into the absolute orientation."
    )
    return (
        Section("The model bent by the given elements", (surface, corner)),
        Section("Height errors before levelling, dZ, m", (_grid(points, "raised_z_m", signed),)),
        Section("Height errors that the absolute orientation leaves, m", (_grid(points, "left_z_m", signed),)),
        Section("Errors along the flight that it leaves, m", (_grid(points, "left_x_m", signed),)),
        Section("Errors across the flight that it leaves, m", (_grid(points, "left_y_m", signed),)),
    )


def _forms(document: Document) -> tuple[Section, ...]:
    """Show operators and closed form side by side."""
    if "closed_form" not in document:
        return ()
    forms = document["closed_form"]
    sums = tabulated(
        forms["sums"],
        (words("sum", "sum"), words("of", "of"), number("value", "value", _long), words("unit", "unit")),
        note="m(u, v) = Σuv - ΣuΣv/n over the control",
    )
    beside = [number("operators", "operators", _long), number("closed form", "closed", _long)]
    if forms["as_printed"]:
        beside += [number("as printed", "printed", _long), words("", _misprint)]
    coefficients = tabulated(
        forms["coefficients"],
        (words("point", "point"), words("of", "axis"), words("per", "element"), *beside, words("unit", "unit")),
        note="eq. 9 (x), 10 (y), 11 (z): error of the point per error of the element, less what the control takes back",
    )
    weights = tabulated(
        forms["weights"],
        (words("point", "point"), words("control", "control"), words("of", "of"), words("from", "from"), *beside),
        note="what a misclosure at the control gives to the point",
    )
    return (
        Section("Sums over the control, c1 to c15", (sums,)),
        Section("Coefficients of the elements in both forms", (coefficients,)),
        Section("Weights of the misclosures in both forms", (weights,)),
    )


def _misprint(row: Document) -> str:
    closed, printed = row["closed"], row["printed"]
    return "misprint" if abs(printed - closed) > SAME_FORM * max(abs(closed), abs(printed)) else ""


def _long(value: float) -> str:
    return short(value, 6)


def source_example_sections(document: Document) -> tuple[Section, ...]:
    rows = document["rows"]
    table = tabulated(
        rows,
        (
            words("place", "place"),
            words("of", "quantity"),
            number("printed", "printed_um", 0, "µm"),
            number("constant", "formula_um", 1, "µm"),
            number("unrounded", "assumed_um", 1, "µm"),
            number("rigorous", "rigorous_left_um", 1, "left, µm"),
            number("rigorous", "rigorous_right_um", 1, "right, µm"),
        ),
        note="m_q = 10 µm, f = b = a, at photo scale",
    )
    central = next(row for row in rows if (row["place"], row["quantity"]) == ("central", "plan"))
    side = next(row for row in rows if (row["place"], row["quantity"]) == ("side", "height"))
    wrong = numbered(
        (
            f"The text says {fixed(central['printed_um'], 0)} µm in plan at the middle; the constant of the same text"
            f" gives {fixed(central['formula_um'], 0)} µm."
        ),
        (
            "The constants follow when each κ has the standard deviation m_q / b. Six standard points give 1.55 m_q / b"
            " for each and 0.82 m_q / b for their difference, which alone counts."
        ),
        (
            "They take an x parallax to have √2 times the standard deviation of a y parallax, and to be independent of"
            " the left coordinate that is part of it. With equally good coordinates both parallaxes have the same, and"
            f" the side points are {fixed(side['rigorous_left_um'], 1)} and {fixed(side['rigorous_right_um'], 1)} µm in"
            f" height, not {fixed(side['printed_um'], 0)}."
        ),
    )
    return (Section("", (table,)), Section("What is wrong in print", wrong))
