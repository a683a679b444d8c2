"""The plan of one model as a plain document: what is printed, drawn and written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.planning.closed_form import ORDER
from photostrip.planning.deformation import DEFORMATION_TERMS
from photostrip.planning.model_plan import (
    BothForms,
    Forecast,
    GivenErrors,
    ModelSpec,
    NamedPoint,
    simple_accuracy,
    source_example,
)
from photostrip.planning.single_model import ELEMENTS, FREE, PARAMETERS
from photostrip.result.numbers import GROUND, micrometres, rms, rounded, significant
from photostrip.units import ARCSECONDS, MICROMETRES

IN_PHOTO = 2  # decimals of mm: places of points
AXES = ("x", "y", "z")
ROUNDING_DECIMALS = 9  # decimals of coefficients below which there are errors of rounding only
DIGITS = 8  # of coefficients, so that two forms can be compared


def model_document(
    name: str,
    camera: str,
    forecast: Forecast,
    given: GivenErrors | None = None,
    forms: BothForms | None = None,
    *,
    printed: bool = False,
) -> Document:
    """Return the plan of one model as a document: keys carry units, plan is both coordinates together.

    given: what errors or misclosures do that the plan gives.
    forms: operators and closed form side by side; `printed` with the misprints of the source.
    """
    document = _expected(name, camera, forecast) | _named_points(forecast)
    if given is not None:
        document |= _given(forecast.spec, given) | _bent(forecast.spec, given, forecast.places)
    if forms is not None:
        document |= _forms(forms, [point.name for point in forecast.spec.control], printed=printed)
    return document


def _expected(name: str, camera: str, forecast: Forecast) -> Document:
    spec = forecast.spec
    unit = spec.ground_unit
    shares = forecast.shares()
    together = forecast.sigmas
    adjusted = forecast.adjusted_sigmas
    worst = int(np.argmax(together[:, 2]))
    return {
        "kind": "model",
        "name": name,
        "camera": {"name": camera, "principal_distance_mm": significant(spec.focal, 9)},
        "geometry": {
            "base_mm": rounded(spec.base, 3),
            "width_mm": rounded(spec.width, 3),
            "scale": significant(spec.scale, 9),
            "flying_height_m": rounded(spec.focal * unit, 1),
            "base_m": rounded(spec.base * unit, 1),
        },
        "image_sigma_um": micrometres(spec.image_sigma),
        "parallax_sigma_um": micrometres(spec.parallax_sigma),
        "orientation": {
            "points": len(spec.orientation_points) or 6 * spec.zone_points,
            "sigmas": _element_sigmas(forecast),
        },
        "control": _control(forecast),
        "control_sigma_m": list(spec.control_sigma),
        "points": [
            {"x_mm": x, "y_mm": y, **sigmas}
            for (x, y), sigmas in zip(rounded(forecast.places, IN_PHOTO), _sigmas(together, adjusted), strict=True)
        ],
        "sources": [_share(source, values) for source, values in shares.items()],
        "worst": {
            "x_mm": rounded(forecast.places[worst, 0], IN_PHOTO),
            "y_mm": rounded(forecast.places[worst, 1], IN_PHOTO),
            "sigma_plan_m": rounded(np.hypot(*together[worst, :2]), GROUND),
            "sigma_z_m": rounded(together[worst, 2], GROUND),
        },
        "simple": [
            {
                "place": each.place,
                "x_mm": rounded(each.at[0], IN_PHOTO),
                "y_mm": rounded(each.at[1], IN_PHOTO),
                "source_plan_m": rounded(each.source.plan, GROUND),
                "source_z_m": rounded(each.source.height, GROUND),
                "rigorous_plan_m": rounded(each.rigorous.plan, GROUND),
                "rigorous_z_m": rounded(each.rigorous.height, GROUND),
            }
            for each in simple_accuracy(spec)
        ],
    }


def _with_plan(sigmas: Floats) -> list[list[float]]:
    """Give along, across, plan and height of each point, rounded."""
    plan = np.hypot(sigmas[:, 0], sigmas[:, 1])
    rows: list[list[float]] = rounded(np.column_stack([sigmas[:, :2], plan, sigmas[:, 2]]), GROUND)
    return rows


def _sigmas(plain: Floats, adjusted: Floats) -> list[Document]:
    """Return the standard deviations of each point, alone and with the elements as unknowns."""
    names = ("sigma_x_m", "sigma_y_m", "sigma_plan_m", "sigma_z_m", "adjusted_plan_m", "adjusted_z_m")
    rows = zip(_with_plan(plain), _with_plan(adjusted), strict=True)
    return [dict(zip(names, (*alone, *together[2:]), strict=True)) for alone, together in rows]


def _element_sigmas(forecast: Forecast) -> list[Document]:
    found = (_element(name, value) for name, value in zip(FREE, forecast.elements.tolist(), strict=True))
    return [{"element": each["element"], "sigma": each["value"], "unit": each["unit"]} for each in found]


def _element(name: str, value: float) -> Document:
    if name in ("dby", "dbz"):
        return {"element": name, "value": rounded(value * MICROMETRES, 2), "unit": "um"}
    return {"element": name, "value": rounded(value * ARCSECONDS, 2), "unit": "arcsec"}


def _control(forecast: Forecast) -> list[Document]:
    rows = zip(forecast.spec.control, _with_plan(forecast.at_control), strict=True)
    return [
        {
            "point": point.name,
            "x_mm": rounded(point.at[0], IN_PHOTO),
            "y_mm": rounded(point.at[1], IN_PHOTO),
            "use": point.use,
            "sigma_plan_m": s[2],
            "sigma_z_m": s[3],
        }
        for point, s in rows
    ]


def _share(source: str, sigmas: Floats) -> Document:
    plan, height = np.hypot(sigmas[:, 0], sigmas[:, 1]), sigmas[:, 2]
    return {
        "source": source,
        "plan_rms_m": rounded(rms(plan), GROUND),
        "plan_max_m": rounded(plan.max(), GROUND),
        "z_rms_m": rounded(rms(height), GROUND),
        "z_max_m": rounded(height.max(), GROUND),
    }


def _named_points(forecast: Forecast) -> Document:
    """Return the expected errors of the named points, under the key ``named``; nothing without any."""
    spec = forecast.spec
    if not spec.points:
        return {}
    rows = zip(spec.points, _sigmas(forecast.at_points, forecast.at_points_adjusted), strict=True)
    return {"named": [{**_place(point.name, point.at, point.height), **sigmas} for point, sigmas in rows]}


def _place(name: str, at: tuple[float, float], height: float) -> Document:
    return {
        "point": name,
        "x_mm": rounded(at[0], IN_PHOTO),
        "y_mm": rounded(at[1], IN_PHOTO),
        "height_m": rounded(height, GROUND),
    }


def _given(spec: ModelSpec, given: GivenErrors) -> Document:
    """Return what given errors or misclosures do to the points, under the key ``given``; lengths on the ground."""
    unit = spec.ground_unit
    every: tuple[NamedPoint, ...] = (*spec.points, *spec.control)
    places = [_place(point.name, point.at, point.height) for point in every]
    found = given.correction
    of_points = [
        {**place, **_xyz("plain", plain), **_xyz("adjusted", adjusted)}
        for place, plain, adjusted in zip(places, found.plain * unit, found.corrected * unit, strict=True)
    ]
    document: Document = {
        "elements": [_element(name, value) for name, value in zip(ELEMENTS, spec.element_errors, strict=True)],
        "misclosures": [
            {"point": point.name, **_xyz("misclosure", misclosure)}
            for point, misclosure in zip(spec.control, given.misclosures * unit, strict=True)
        ],
        "parameters": [
            _parameter(name, value, unit) for name, value in zip(PARAMETERS, found.parameters.tolist(), strict=True)
        ],
        "adjusted_elements": [
            _element(name, value) for name, value in zip(FREE, found.adjusted.elements.tolist(), strict=True)
        ],
        "corrections": of_points,
    }
    if given.parts is not None:
        document["errors"] = [
            {
                **place,
                "parts": [
                    {"part": name, **_xyz("error", getattr(given.parts, name)[row] * unit)}
                    for name in ("measuring", "orientation", "absolute", "total")
                ],
                "causes": [
                    {"cause": name, **_xyz("error", getattr(given.parts, f"from_{name}")[row] * unit)}
                    for name in ("measuring", "elements", "control")
                ],
            }
            for row, place in enumerate(places)
        ]
    return {"given": document}


def _xyz(name: str, values: Floats) -> Document:
    return dict(zip((f"{name}_{axis}_m" for axis in AXES), rounded(values, GROUND), strict=True))


def _parameter(name: str, value: float, unit: float) -> Document:
    if name in ("dX0", "dY0", "dZ0"):
        return {"parameter": name, "value": rounded(value * unit, GROUND), "unit": "m"}
    if name == "dlambda":
        return {"parameter": name, "value": rounded(value * 1e6, 2), "unit": "ppm"}
    return {"parameter": name, "value": rounded(value * ARCSECONDS, 2), "unit": "arcsec"}


def _bent(spec: ModelSpec, given: GivenErrors, places: Floats) -> Document:
    """Return the model as given errors of its elements bend it, under the key ``bent``; nothing without any."""
    bent, unit = given.bent, spec.ground_unit
    if bent is None:
        return {}
    twist, bending = bent.surface[3:].tolist()
    rows = zip(rounded(places, IN_PHOTO), bent.raised * unit, bent.left * unit, strict=True)
    return {
        "bent": {
            "surface": [
                {
                    "term": name,
                    "value": significant(value * unit),
                    "unit": "m" if not power else f"m/mm{'²' if power == 2 else ''}",
                }
                for name, value, power in zip(DEFORMATION_TERMS, bent.surface.tolist(), (0, 1, 1, 2, 2), strict=True)
            ],
            # against the middle of the model
            "twist_at_corner_m": rounded(abs(twist) * spec.base / 2 * spec.width * unit, GROUND),
            "bending_at_corner_m": rounded(abs(bending) * (spec.base / 2) ** 2 * unit, GROUND),
            "points": [
                {"x_mm": x, "y_mm": y, **_xyz("raised", raised), **_xyz("left", left)} for (x, y), raised, left in rows
            ],
        }
    }


def _digits(value: float) -> float:
    """Round so that two forms can be compared; what is nothing but rounding becomes 0."""
    return float(significant(round(float(value), ROUNDING_DECIMALS), DIGITS))


def _forms(forms: BothForms, control: Sequence[str], *, printed: bool) -> Document:
    """Return operators and closed form side by side, under the key ``closed_form``; `printed`: with the misprints."""
    rows, kernels = [], []
    for point, name in enumerate(forms.names):
        for axis, letter in enumerate(AXES):
            for column, element in enumerate(ORDER):
                values = {
                    "operators": _digits(forms.operators[point, axis, column]),
                    "closed": _digits(forms.closed[point, axis, column]),
                }
                if printed:
                    values["printed"] = _digits(forms.printed[point, axis, column])
                unit = "mm/mm" if element == "dbz" else "mm/rad"
                rows.append({"point": name, "axis": letter, "element": element, "unit": unit, **values})
        for number, target in enumerate(control):
            for field, here, there in KERNELS:
                weights = {
                    "operators": _digits(forms.weights[point, AXES.index(here), number, AXES.index(there)]),
                    "closed": _digits(getattr(forms.kernels, field)[point, number]),
                }
                if printed:
                    weights["printed"] = _digits(getattr(forms.printed_kernels, field)[point, number])
                kernels.append({"point": name, "control": target, "of": here, "from": there, **weights})
    return {
        "closed_form": {
            "as_printed": printed,
            "sums": [
                {"sum": f"c{number}", "of": f"m({of})", "value": _digits(value), "unit": f"mm^{power}"}
                for number, (value, (of, power)) in enumerate(zip(forms.sums.tolist(), SUMS, strict=True), 1)
            ],
            "coefficients": rows,
            "weights": kernels,
        }
    }


# fields of the kernels: of which coordinate of a point, from which misclosure
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


def source_example_document() -> Document:
    """Return the worked example of the source, computed again, beside its printed numbers."""
    return {
        "kind": "model-source-table",
        "name": "the worked example of the source",
        "rows": [
            {
                "place": row.place,
                "quantity": row.quantity,
                "printed_um": row.printed,
                "formula_um": rounded(row.formula, 1),
                "assumed_um": rounded(row.assumed, 1),
                "rigorous_left_um": rounded(row.left, 1),
                "rigorous_right_um": rounded(row.right, 1),
            }
            for row in source_example()
        ],
    }
