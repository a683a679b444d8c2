"""The plan of one model: expected errors, what given errors do, operators and closed form side by side.

Plan is both coordinates together; places are millimetres at photo scale.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import counted
from photostrip.planning.closed_form import ORDER
from photostrip.planning.deformation import DEFORMATION_TERMS, base_frame_elements, relative_errors
from photostrip.planning.model_plan import BothForms, Forecast, GivenErrors, ModelSpec, NamedPoint, simple_accuracy
from photostrip.planning.single_model import ELEMENTS, FREE, PARAMETERS
from photostrip.report.page.tables import Cell, Field, fields, with_unit
from photostrip.result.numbers import rms
from photostrip.sheets.sheet import Fact, Rows, Sheet, by_columns, hidden, plain
from photostrip.units import ARCSECONDS, MICROMETRES

USES = {"xyz": "in full", "xy": "in plan", "z": "in height"}
SAME_FORM = 1e-6  # relative: below it two forms say the same
ROUNDING_DECIMALS = 9  # of coefficients: what is smaller is error of rounding only
PLACE = fields("x_mm y_mm", "mm 1", "x y")
HEADS = "along across height"
PARTS = {
    "measuring": "measuring, dx1",
    "orientation": "relative orientation, dx2",
    "absolute": "absolute orientation, dx3",
    "total": "all: dx1 + dx2 - dx3",
}
CAUSES = {
    "from_measuring": "measuring, δ1",
    "from_elements": "the elements, δ2",
    "from_control": "given coordinates, δ3",
}
# kernels of the closed form: of which coordinate of a point, from which misclosure
KERNELS = (
    ("along_along", "x", "x"),
    ("along_across", "x", "y"),
    ("across_across", "y", "y"),
    ("across_along", "y", "x"),
    ("up", "z", "z"),
)
# what c1 to c15 are sums of, and their power of mm
SUMS = (
    ("x, x", 2), ("y, y", 2), ("x, y", 2), ("x², x", 3), ("y², y", 3), ("x², y", 3), ("y², x", 3), ("x y, y", 3),
    ("x y, x", 3), ("x³, x", 4), ("x³, y", 4), ("x² y, x", 4), ("x y², y", 4), ("x² y, y", 4), ("x y², x", 4),
)  # fmt: skip


def model_sheet(
    name: str,
    camera: str,
    forecast: Forecast,
    given: GivenErrors | None = None,
    forms: BothForms | None = None,
    *,
    printed: bool = False,
) -> Sheet:
    """Return the plan of a model.

    given: what errors or misclosures do that the plan gives.
    forms: operators and closed form; `printed`: with the misprints of the source.
    """
    facts, tables = _expected(name, camera, forecast), [*_tables(forecast)]
    if given is not None:
        facts += _given_facts(forecast.spec, given)
        tables += [*_given(forecast.spec, given), *_bent(forecast.spec, given, forecast.places)]
    if forms is not None:
        tables += _forms(forms, [point.name for point in forecast.spec.control], printed=printed)
    return Sheet("model", "Expected errors over one model", facts, tables)


def _expected(name: str, camera: str, forecast: Forecast) -> list[Fact]:
    spec, unit = forecast.spec, forecast.spec.ground_unit
    points = len(spec.orientation_points) or 6 * spec.zone_points
    sigmas, values = _elements(FREE, forecast.elements)
    geometry = {
        "base_mm": plain(spec.base, "mm 1"),
        "width_mm": plain(spec.width, "mm 1"),
        "scale": plain(spec.scale, "ratio g7"),
        "flying_height_m": plain(spec.focal * unit, "m 0"),
        "base_m": plain(spec.base * unit, "m 0"),
    }
    photos = f"1:{spec.scale:g}, {spec.focal * unit:.0f} m above the ground; base {spec.base:.1f} mm,"
    image, parallax = 1000 * spec.image_sigma, 1000 * spec.parallax_sigma
    measuring = f"{image:.1f} µm for an image coordinate, {parallax:.1f} µm for a y parallax"
    kinds = [f"{number} {USES[use]}" for use in USES if (number := sum(p.use == use for p in spec.control))]
    given = f"{', '.join(kinds)}; given to {', '.join(f'{each:.3f}' for each in spec.control_sigma)} m along, across"
    worst = int(np.argmax(forecast.sigmas[:, 2]))
    (x, y), sigma = forecast.places[worst].tolist(), float(forecast.sigmas[worst, 2])
    where = {"x_mm": plain(x, "mm 1"), "y_mm": plain(y, "mm 1"), "sigma_z_m": plain(sigma, "m 3")}
    focal = {"name": camera, "principal_distance_mm": plain(spec.focal, "mm g9")}
    return [
        Fact("name", name),
        Fact("camera", focal, text=f"{camera}, f {spec.focal:.9g} mm"),
        Fact("geometry", geometry, text=f"{photos} {spec.base * unit:.0f} m", label="photos"),
        Fact("image_sigma_um", image, "um 1", text=measuring, label="measuring"),
        Fact("parallax_sigma_um", plain(parallax, "um 1")),
        Fact("orientation", {"points": points, **values}, text=f"{counted(points, 'point')}: {sigmas}"),
        Fact("control_sigma_m", list(spec.control_sigma), text=f"{given} and in height", label="control"),
        Fact("worst", where, text=f"{sigma:.3f} m at x {x:.1f}, y {y:z.1f} mm", label="worst height"),
    ]


def _elements(names: Sequence[str], values: Floats | Sequence[float]) -> tuple[str, dict[str, float]]:
    """Return elements in print and in JSON: dby and dbz in micrometres, angles in seconds of arc."""
    shift = {"dby", "dbz"}
    forms = ["um 1" if name in shift else "arcsec 1" for name in names]
    sizes = [
        float(value) * (MICROMETRES if name in shift else ARCSECONDS) for name, value in zip(names, values, strict=True)
    ]
    return _said(names, sizes, forms)


def _said(names: Sequence[str], sizes: Sequence[float], forms: Sequence[str]) -> tuple[str, dict[str, float]]:
    listed = list(zip(names, sizes, forms, strict=True))
    text = "; ".join(f"{name} {with_unit(size, form)}" for name, size, form in listed)
    return text, {f"{name}_{form.split()[0]}": plain(size, form) for name, size, form in listed}


def _with_plan(sigmas: Floats) -> Floats:
    """Give along, across, plan and height of each point."""
    return np.column_stack([sigmas[:, :2], np.hypot(sigmas[:, 0], sigmas[:, 1]), sigmas[:, 2]])


def _tables(forecast: Forecast) -> Iterator[Rows]:
    spec = forecast.spec
    both = ("sigma_plan_m", "sigma_z_m")
    sigmas, adjusted = _with_plan(forecast.sigmas), _with_plan(forecast.adjusted_sigmas)[:, 2:]
    yield Rows(
        "points",
        "",
        (
            Field("x_mm", "mm 0"),
            Field("y_mm", "mm 0", "y \\ x"),
            *hidden("sigma_x_m", "sigma_y_m", form="m 3"),
            Field("sigma_plan_m", "m 3", "Standard deviation in plan (both coordinates), m"),
            Field("sigma_z_m", "m 3", "Standard deviation in height, m"),
            *hidden("adjusted_plan_m", "adjusted_z_m", form="m 3"),
        ),
        by_columns(forecast.places[:, 0].tolist(), forecast.places[:, 1], sigmas, adjusted),
        across="x_mm",
        tables=both,
    )
    yield Rows(
        "sources",
        "What each source of errors does alone",
        (
            Field("source"),
            *fields("plan_rms_m plan_max_m z_rms_m z_max_m", "m 3", "plan_rms plan_max height_rms height_max"),
        ),
        [
            (source, rms(plan), plan.max(), rms(values[:, 2]), values[:, 2].max())
            for source, values in forecast.shares().items()
            for plan in [np.hypot(values[:, 0], values[:, 1])]
        ],
        note="over the points above; dalpha2 is the turn of the right photo against the base",
    )
    yield Rows(
        "control",
        "At the control",
        (
            Field("point", shown=False),
            *PLACE,
            Field("use", head="given"),
            *fields(" ".join(both), "m 3", "plan height"),
        ),
        [
            (point.name, *point.at, Cell(USES[point.use], point.use), *sigma[2:])
            for point, sigma in zip(spec.control, _with_plan(forecast.at_control), strict=True)
        ],
        note="of the adjusted model point; the given coordinates stay what they are",
    )
    yield Rows(
        "simple",
        "The simple formulas, relative orientation and measuring only",
        (
            Field("place"),
            *hidden("x_mm", "y_mm", form="mm 1"),
            *fields("source_plan_m source_z_m", "m 3", "plan height", "source, m"),
            *fields("rigorous_plan_m rigorous_z_m", "m 3", "plan height", "rigorous, m"),
        ),
        [
            (each.place, *each.at, each.source.plan, each.source.height, each.rigorous.plan, each.rigorous.height)
            for each in simple_accuracy(spec)
        ],
    )
    yield _single_errors(spec)
    if spec.points:
        sigmas, adjusted = _with_plan(forecast.at_points), _with_plan(forecast.at_points_adjusted)[:, 2:]
        yield Rows(
            "named",
            "At the points named",
            (
                Field("point"),
                *PLACE,
                Field("height_m", "m 1", "above"),
                *fields("sigma_x_m sigma_y_m", "m 3", "along across"),
                Field("sigma_plan_m", "m 3", shown=False),
                Field("sigma_z_m", "m 3", "height"),
                *fields("adjusted_plan_m adjusted_z_m", "m 3", "plan height", "adjusted, m"),
            ),
            [(*_place(point), *row) for point, row in zip(spec.points, np.hstack([sigmas, adjusted]), strict=True)],
            note="standard deviations; adjusted: with the elements as unknowns; x, y on the ground at photo scale",
        )


def _single_errors(spec: ModelSpec) -> Rows:
    """Give what one error of each kind does to a corner of the model, by the differentials of the normal case."""
    corner, one = np.array([spec.base, spec.width, spec.base]), spec.image_sigma
    kinds = {
        "x of the left photo": ((one, 0.0, 0.0), 0.0, 0.0),
        "y of the left photo": ((0.0, one, 0.0), 0.0, 0.0),
        "x parallax": ((0.0, 0.0, spec.parallax_sigma), 0.0, 0.0),
        "principal distance": ((0.0, 0.0, 0.0), 0.0, one),
        "base, 1 ppm": ((0.0, 0.0, 0.0), 1e-6, 0.0),
    }
    ground = np.array([spec.base, spec.width, -spec.focal]) * spec.ground_unit
    return Rows(
        "single",
        "What one error of each kind does to the corner of the model, eq. 10.7",
        (Field("error_of", head="error of"), Field("error_um", "um 1", "error"), *fields("x_m y_m z_m", "m +4", HEADS)),
        [
            (
                name,
                (sum(errors) + focal) * MICROMETRES or None,
                *(relative_errors(corner, spec.focal, errors, base=base, principal_distance=focal) * ground),
            )
            for name, (errors, base, focal) in kinds.items()
        ],
        note=f"of one standard deviation; the corner at x {spec.base:.1f}, y {spec.width:.1f} mm",
    )


def _place(point: NamedPoint) -> tuple[Any, ...]:
    return point.name, *point.at, point.height


def _given_facts(spec: ModelSpec, given: GivenErrors) -> list[Fact]:
    """Say which elements are given, and what the misclosures show."""
    forms = {"dX0": ("m 3", spec.ground_unit), "dY0": ("m 3", spec.ground_unit), "dZ0": ("m 3", spec.ground_unit)}
    forms["dlambda"] = ("ppm 1", 1e6)
    kinds = [forms.get(name, ("arcsec 1", ARCSECONDS)) for name in PARAMETERS]
    values = given.correction.parameters.tolist()
    sizes = [value * factor for value, (_, factor) in zip(values, kinds, strict=True)]
    turned, parameters = _said(PARAMETERS, sizes, [form for form, _ in kinds])
    shown, adjusted = _elements(FREE, given.correction.adjusted.elements)
    text, elements = _elements(ELEMENTS, spec.element_errors)
    return [
        Fact("element_errors", elements, text=text if any(spec.element_errors) else "", label="elements given"),
        Fact("parameters", parameters, text=turned, label="their orientation"),
        Fact("adjusted_elements", adjusted, text=shown, label="elements found"),
    ]


def _xyz(name: str, below: str = "m") -> tuple[Field, ...]:
    return fields(f"{name}_x_m {name}_y_m {name}_z_m", "m +3", HEADS, below)


def _given(spec: ModelSpec, given: GivenErrors) -> Iterator[Rows]:
    """Give what errors or misclosures do to the points, on the ground."""
    unit, found = spec.ground_unit, given.correction
    every: tuple[NamedPoint, ...] = (*spec.points, *spec.control)
    misclosures = by_columns([point.name for point in spec.control], given.misclosures * unit)
    title = "Misclosures at the control, model minus given"
    yield Rows("misclosures", title, (Field("point", head="control"), *_xyz("misclosure")), misclosures)
    place = (Field("point"), *hidden("x_mm", "y_mm", form="mm 1"), Field("height_m", "m 1", shown=False))
    if given.parts is not None:
        felt = [
            {name: text for name, text in kind.items() if np.round(getattr(given.parts, name) * unit, 4).any()}
            for kind in (PARTS, CAUSES)
        ]
        both = felt[0] | (felt[1] if len(felt[1]) > 1 else {})
        yield Rows(
            "errors",
            "Errors of the points that follow",
            (*place, Field("part"), *_xyz("error")),
            [
                (Cell("" if number else point.name, point.name), *_place(point)[1:], Cell(text, name), *xyz)
                for row, point in enumerate(every)
                for number, (name, text) in enumerate(both.items())
                for xyz in [getattr(given.parts, name)[row] * unit]
            ],
            note="δ1 + δ2 + δ3 are the same errors by what causes them" if len(felt[1]) > 1 else "",
        )
    yield Rows(
        "corrections",
        "Corrections from the misclosures",
        (*place, *_xyz("plain", "plain, m"), *_xyz("adjusted", "adjusted, m")),
        [
            (*_place(point), *row)
            for point, row in zip(every, np.hstack([found.plain, found.corrected]) * unit, strict=True)
        ],
        note="to be subtracted; plain: dx3 of the absolute orientation alone; adjusted: with the elements found",
    )


def _bent(spec: ModelSpec, given: GivenErrors, places: Floats) -> Iterator[Rows]:
    """Give the model as given errors of its elements bend it."""
    bent, unit = given.bent, spec.ground_unit
    if bent is None:
        return
    twist, bending = bent.surface[3:].tolist()  # against the middle of the model
    corner = abs(twist) * spec.base / 2 * spec.width * unit, abs(bending) * (spec.base / 2) ** 2 * unit
    words = (
        f"dZ = E0 + A x + B y + C x y + D x². Twist C moves a corner by {corner[0]:.3f} m against the middle, bending D"
        f" by {corner[1]:.3f} m; E0, A, B go into the absolute orientation."
    )
    alpha1, _, alpha2, _, _ = base_frame_elements(spec.element_errors, spec.base).tolist()
    constant, tilt = -(spec.focal**2) / spec.base * (alpha2 - alpha1) * unit, -alpha1 * spec.base * unit
    frames = (
        "dx2 at the control counts heights from the left photo as it lies, dZ from the base and without the constant"
        f" f (dα2′ - dα1′) of eq. 10.9: dx2 is {constant:+.3f} m more, and {tilt:+.3f} m over a base by the tilt dα1′."
        " The absolute orientation takes both back."
    )
    units = ("m", "m/mm", "m/mm", "m/mm²", "m/mm²")
    yield Rows(
        "surface",
        "The model bent by the given elements",
        (Field("term"), Field("value", "ratio g4"), Field("unit")),
        [*zip(DEFORMATION_TERMS, (bent.surface * unit).tolist(), units, strict=True)],
        below=(words, frames),
    )
    heights = {
        "c_um": "What the elements add to the x parallax, c of eq. 10.9, µm",
        "py_um": "y parallaxes that they leave, µm",
        "raised_z_m": "Height errors before levelling, dZ, m",
        "left_z_m": "Height errors that the absolute orientation leaves, m",
        "left_x_m": "Errors along the flight that it leaves, m",
        "left_y_m": "Errors across the flight that it leaves, m",
    }
    keys = [f"{name}_{axis}_m" for name in ("raised", "left") for axis in "xyz"]
    yield Rows(
        "bent",
        "",
        (
            Field("x_mm", "mm 0"),
            Field("y_mm", "mm 0", "y \\ x"),
            *(Field(key, "um +1", heights[key]) for key in ("c_um", "py_um")),
            *(Field(key, "m +3", heights.get(key), shown=key in heights) for key in keys),
        ),
        by_columns(
            places[:, 0].tolist(),
            places[:, 1],
            bent.c * MICROMETRES,
            bent.parallax * MICROMETRES,
            bent.raised * unit,
            bent.left * unit,
        ),
        across="x_mm",
        tables=tuple(heights),
    )


def _forms(forms: BothForms, control: Sequence[str], *, printed: bool) -> Iterator[Rows]:
    """Give operators and closed form side by side, with the printed form and its misprints if wanted."""
    beside = fields("operators closed", "ratio g6", "operators closed_form")
    if printed:
        beside += (Field("printed", "ratio g6", "as printed"), Field("", head=""))

    def compared(operators: float, closed: float, as_printed: float) -> tuple[Any, ...]:
        values = [round(float(each), ROUNDING_DECIMALS) for each in (operators, closed, as_printed)]
        largest = SAME_FORM * max(map(abs, values[1:]))
        return (*values, "misprint" if abs(values[2] - values[1]) > largest else "") if printed else tuple(values[:2])

    yield Rows(
        "sums",
        "Sums over the control, c1 to c15",
        (Field("sum"), Field("of"), Field("value", "ratio g6"), Field("unit")),
        [
            (f"c{number}", f"m({of})", value, f"mm^{power}")
            for number, (value, (of, power)) in enumerate(zip(forms.sums.tolist(), SUMS, strict=True), 1)
        ],
        note="m(u, v) = Σuv - ΣuΣv/n over the control",
    )
    axes = list(enumerate("xyz"))
    yield Rows(
        "coefficients",
        "Coefficients of the elements in both forms",
        (Field("point"), Field("axis", head="of"), Field("element", head="per"), *beside, Field("unit")),
        [
            (
                name,
                letter,
                element,
                *compared(*(form[point, axis, column] for form in (forms.operators, forms.closed, forms.printed))),
                "mm/mm" if element == "dbz" else "mm/rad",
            )
            for (point, name), (axis, letter), (column, element) in product(
                enumerate(forms.names), axes, enumerate(ORDER)
            )
        ],
        note="eq. 9 (x), 10 (y), 11 (z): error of the point per error of the element, less what the control takes back",
    )
    yield Rows(
        "weights",
        "Weights of the misclosures in both forms",
        (Field("point"), Field("control"), Field("of"), Field("from"), *beside),
        [
            (
                name,
                target,
                here,
                there,
                *compared(
                    forms.weights[point, "xyz".index(here), number, "xyz".index(there)],
                    getattr(forms.kernels, kernel)[point, number],
                    getattr(forms.printed_kernels, kernel)[point, number],
                ),
            )
            for (point, name), (number, target), (kernel, here, there) in product(
                enumerate(forms.names), enumerate(control), KERNELS
            )
        ],
        note="what a misclosure at the control gives to the point",
    )
