"""Precision of a result: standard deviations, correlations; what check points and control left out say of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import angle_rates, angles
from photostrip.notes import Document
from photostrip.pipeline.results import Result, StripResult
from photostrip.points import take_rows
from photostrip.result.derived import MIXED
from photostrip.result.given import PARTS, Differences, chances, differences, size_columns, stand_out, turned
from photostrip.result.numbers import PER_RADIAN, attributes, natural, record, rms
from photostrip.result.table import Table
from photostrip.statistics import chi2_quantile, normal_quantile, squares_p_value
from photostrip.strip.fitted_strip import CheckErrors

ROWS, COLUMNS = np.triu_indices(6, 1)
CORRELATIONS = tuple(f"c{row + 1}{column + 1}" for row, column in zip(ROWS.tolist(), COLUMNS.tolist(), strict=True))
SIGMAS = ("sigma_x", "sigma_y", "sigma_z", "sigma_angle_1", "sigma_angle_2", "sigma_angle_3")
OUTSIDE = 0.05  # share of sound differences that lie outside their ellipse or interval
INSIDE = {"plan": float(np.sqrt(chi2_quantile(1 - OUTSIDE, 2))), "height": normal_quantile(1 - OUTSIDE / 2)}


def plan_and_height(level: Floats) -> Floats:
    """Return standard deviations in plan (of both coordinates together) and in height.

    level: (n, 3, 3), covariances along east, north and up.
    Returns (n, 2), square roots of the variances of east plus north, and of up.
    """
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.column_stack([level[:, 0, 0] + level[:, 1, 1], level[:, 2, 2]]))


def point_columns(result: Result) -> Document:
    """Return columns of ``points``: standard deviations, empty when unknown, and correlations of the coordinates."""
    precision, level, frame = result.precision, result.level_covariances, result.output
    if precision is None or level is None:
        return dict.fromkeys(("sigma_x", "sigma_y", "sigma_z"))
    order = list(frame.order)
    covariances = (precision.points if frame.kind == "geocentric" else level)[:, order][:, :, order]
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
        correlations = covariances / (sigma[:, :, None] * sigma[:, None, :])
    return {
        **{f"sigma_{axis}": sigma[:, k] for k, axis in enumerate("xyz")},
        **{f"correlation_{axes}": correlations[:, k, j] for axes, (k, j) in MIXED.items()},
    }


def photo_columns(result: Result, axes: Floats, rotations: Floats, given: Floats) -> Document:
    """Return columns of ``photos``: standard deviations of centre and angles, and their correlations.

    An angle's rows take the small rotation about the axes of the output to the angles of the system.

    axes, rotations: (m, 3, 3), axes of the output at the perspective centres, rows in the Cartesian frame; photo to
        those axes.
    given: (m, 6, 6), covariances in the axes of the Cartesian frame, as in ``pipeline.Precision``.
    Returns standard deviations of x, y, z in metres and of the angles in their exported unit, and correlations.
    """
    turn = np.zeros((len(axes), 6, 6))
    turn[:, :3, :3] = axes[:, list(result.output.order)]
    turn[:, 3:, 3:] = _rates(rotations, result.settings.angle_system) @ axes * PER_RADIAN[result.settings.angle_unit]
    covariances = turn @ given @ turn.transpose(0, 2, 1)
    return _of_covariances(covariances)


def centre_columns(result: Result, place: Floats, given: Floats | None) -> Document:
    """Return the same of perspective centres alone: nothing is known of the angles."""
    if given is None:
        return dict.fromkeys(SIGMAS)
    covariances = np.full((len(place), 6, 6), np.nan)
    covariances[:, :3, :3] = turned(given[:, :3, :3], result.output.axes_at(place)[:, list(result.output.order)])
    return _of_covariances(covariances)


def _of_covariances(covariances: Floats) -> Document:
    """Return standard deviations and correlations of x, y, z and the three angles."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
        correlations = covariances[:, ROWS, COLUMNS] / (sigma[:, ROWS] * sigma[:, COLUMNS])
    return {**dict(zip(SIGMAS, sigma.T, strict=True)), **dict(zip(CORRELATIONS, correlations.T, strict=True))}


def _rates(rotations: Floats, system: str) -> Floats:
    """Return changes of the angles by small rotations about the output's axes; NaN where they cannot be separated."""
    try:
        return np.asarray(np.linalg.inv(angle_rates(angles(rotations, system), system)), float)
    except GeometryError:  # some photo is the exception
        single = [
            _rates(rotation[None], system) if len(rotations) > 1 else np.full((1, 3, 3), np.nan)
            for rotation in rotations
        ]
        return np.concatenate(single)


def precision_of(result: Result, found: Differences) -> Document:
    """Return the block ``precision`` under its key; nothing when no covariances are known.

    found: what is left at the given points.

    It says what the covariances rest on, how large they are, and how they change along the strips.
    """
    precision, level = result.precision, result.level_covariances
    if precision is None or level is None:
        return {}
    sigma = plan_and_height(level)
    names = [result.refined.observations.point_ids[number] for number in result.points.number]
    basis = [
        {"strip": strip.strip.id, "sigma_um": value * 1000.0, "basis": basis}
        for strip, value, basis in zip(result.strips, precision.sigma, precision.basis, strict=True)
    ]
    block = {
        "basis": Table.of_rows("precision.basis", basis or _basis_of_singles(result)),
        "points": {name: _summed(column, names) for name, column in zip(("plan", "height"), sigma.T, strict=True)},
        "along": Table.joined(
            "precision.along",
            (
                _along(result, strip, sigma, photos)
                for strip, photos in zip(result.strips, precision.photos, strict=True)
            ),
        ),
    }
    check = _check(result, found)
    return {"precision": record("precision", block | ({"check": check} if check else {}))}


def _basis_of_singles(result: Result) -> list[Document]:
    """Say for each photo that is a strip of its own what its covariances rest on."""
    if result.bundle is None:
        return []
    bundle = result.bundle
    sigma_um = 1000.0 * np.median(bundle.block.problem.images.sigma) * bundle.unit
    basis = "a-priori" if bundle.unit == 1.0 else "a-posteriori"
    return [{"strip": each.strip.id, "sigma_um": sigma_um, "basis": basis} for each in bundle.singles]


def _summed(sigma: Floats, names: list[str]) -> Document:
    """Sum up standard deviations: root mean square, the largest, and whose it is."""
    if np.isnan(sigma).all():
        return {"rms": None, "max": None, "worst": None}
    worst = int(np.nanargmax(sigma))
    return {"rms": rms(sigma), "max": sigma[worst], "worst": names[worst]}


def _along(result: Result, strip: StripResult, sigma: Floats, photos: Floats) -> Table:
    """Precision along a strip: of the points nearest to each photo, and of its perspective centre."""
    centers = strip.placed.centers.copy()
    known, places = np.isfinite(centers[:, 0]), np.arange(len(centers))
    if not known.any():
        return Table.of_rows("precision.along", ())
    for column in centers.T:  # a photo without a centre stands at the others' mean distance
        column[~known] = np.interp(places[~known], places[known], column[known])
    along = centers[:, 0]
    order = np.argsort(along, kind="stable")
    between = (along[order][1:] + along[order][:-1]) / 2
    nearest = order[np.searchsorted(between, strip.xyz[:, 0])]
    rows = np.searchsorted(result.points.number, strip.formed.point)
    count = np.bincount(nearest, minlength=len(centers))
    with np.errstate(invalid="ignore"):
        plan, height = (np.sqrt(np.bincount(nearest, column**2, len(centers)) / count) for column in sigma[rows].T)
    level = result.output.level_axes_at(strip.intermediate.cartesian_from_intermediate(centers))
    centre_plan, centre_height = plan_and_height(turned(photos[:, :3, :3], level)).T
    columns = {
        "strip": strip.strip.id,
        "photo": strip.strip.photos,
        "distance": along - along[0],
        "points": count,
        "plan": plan,
        "height": height,
        "centre_plan": centre_plan,
        "centre_height": centre_height,
    }
    return Table.of("precision.along", columns)


def _check(result: Result, found: Differences) -> Document:
    """Compare the differences at check points with what the covariances let expect; empty without check points.

    The covariance of a difference is that of the point and that of the given coordinate. Errors go together along a
    strip: all of them are tested with their joint covariance, which weighs most what is known best, and their rms in
    plan and in height, in which bends of a strip weigh most, against what their correlations let expect. Points that
    stand out take no part in these tests: they have been named.
    """
    rows, values = found.checks
    if result.precision is None or np.isnan(values).all():
        return {}
    ids = [result.inputs.control.ids[row] for row in rows]
    left_out = {result.inputs.control.ids[row] for row in np.flatnonzero(found.stands_out.any(axis=1))}
    names = [strip.strip.id for strip in result.strips] if result.bundle is None else [""]
    kept = [None if errors is None else errors.without(left_out) for errors in result.precision.checks]
    tests = {name: errors for name, errors in zip(names, kept, strict=False) if errors is not None}
    sound = values[[name not in left_out for name in ids]]
    points = {"id": ids, "plan": values[:, 0], "height": values[:, 1], **chances(values)}
    return {
        "plan": _inside(sound[:, 0], INSIDE["plan"], 2) | {"p": _larger(result, tests.values(), (0, 1))},
        "height": _inside(sound[:, 1], INSIDE["height"], 1) | {"p": _larger(result, tests.values(), (2,))},
        "points": Table.of("precision.check.points", points),
        "tests": Table.of_rows(
            "precision.check.tests",
            (
                {"strip": name, **attributes(errors, "points coordinates independent squares"), "p": errors.probability}
                for name, errors in tests.items()
            ),
        ),
    }


def _larger(result: Result, tests: Iterable[CheckErrors], axes: Sequence[int]) -> float | None:
    """Probability of a larger rms of the differences, each over its own standard deviation; None where it is unknown.

    The axes of geocentric lists are neither plan nor height.
    """
    if any(frame.kind == "geocentric" for frame in result.frames):
        return None
    parts = [errors.take(rows) for errors in tests if len(rows := np.flatnonzero(np.isin(errors.axis, axes)))]
    squares = sum(part.own_squares for part in parts)
    return squares_p_value(squares, [part.correlation for part in parts]) if parts else None


def _inside(values: Floats, limit: float, coordinates: int) -> Document:
    """Count the differences within their 95 % ellipse or interval; their rms, of one coordinate."""
    known = values[~np.isnan(values)]
    size = np.sqrt(np.mean(known**2) / coordinates) if len(known) else None
    inside = int((np.abs(known) <= limit).sum())
    return {"count": len(known), "inside_95": inside, "rms": size}


LEAST = 1e-300  # probability below which it is all the same
Columns = dict[str, list[object]]


def cross_validation_of(result: Result) -> Document:
    """Return the block ``cross_validation`` under its key; nothing when no control was left out.

    The errors of different folds come from nearly the same measurements. The probability of all of them together is
    the harmonic mean of those of the folds, which holds for tests that are not independent.

    Source: [Wilson 2019].
    """
    if not result.folds:
        return {}
    folds: list[Document] = []
    columns = Columns()
    for number, fold in enumerate(result.folds, 1):
        chance = None
        if fold.result is not None:
            chance = _joint(fold.result)
            for name, values in _left_out(fold.result, number).items():
                columns.setdefault(name, []).extend(values)
        folds.append({"left_out": list(fold.left_out), "p": chance, "reason": fold.reason})
    known = [fold["p"] for fold in folds if fold["p"] is not None]
    summed = {} if not columns else _summed_folds(columns)
    block = {
        "folds": Table.of_rows("cross_validation.folds", folds),
        "p": len(known) / sum(1 / max(chance, LEAST) for chance in known) if known else None,
        **{part: summed.get(part, dict.fromkeys(("count", "rms", "rms_um", "inside_95", "ratio"))) for part in PARTS},
    }
    points = Table.of("cross_validation.points", columns) if columns else Table.of_rows("cross_validation.points", ())
    order = sorted(range(len(points)), key=lambda row: natural(points["id"][row]))
    return {"cross_validation": record("cross_validation", block | {"points": points[order]})}


def _joint(result: Result) -> float | None:
    """Probability of larger errors at the points of a fold, of its strips together; None when nothing is predicted."""
    tests = [] if result.precision is None else [each for each in result.precision.checks if each is not None]
    return min(1.0, len(tests) * min(each.probability for each in tests)) if tests else None


def _left_out(result: Result, fold: int) -> dict[str, Sequence[object]]:
    """Return the columns of the points that were left out in a fold."""
    found = differences(result)
    rows, over = found.checks
    at = result.control_rows[rows]
    there = replace(
        result,
        points=take_rows(result.points, at, ("number", "cartesian", "ground", "rays")),
        precision=None if result.precision is None else take_rows(result.precision, at, ("points",)),
    )
    sigma = {key: column for key, column in point_columns(there).items() if key.startswith("sigma")}
    differ = size_columns(found.axes[rows], found.plan[rows], found.height[rows], found.scale[rows])
    columns = {
        **differ,
        **{key: np.full(len(rows), np.nan) if column is None else column for key, column in sigma.items()},
        "chance_plan": found.chance[rows, 0],
        "chance_height": found.chance[rows, 1],
        "z_plan": over[:, 0],
        "z_height": over[:, 1],
        **chances(over),
    }
    ids = [result.inputs.control.ids[row] for row in rows]
    return {"id": ids, "fold": [fold] * len(rows), **{key: column.tolist() for key, column in columns.items()}}


def _summed_folds(columns: Columns) -> Document:
    """Sum up the differences in plan and height; say in the columns which of them stand out."""
    values: dict[str, Floats] = {
        name: np.array(column, float) for name, column in columns.items() if name not in {"id", "fold"}
    }
    likely = {part: np.array(columns.pop(f"chance_{part}"), float) for part in PARTS}
    odd = {part: stand_out(values[part], 2 if part == "plan" else 1, likely[part]) for part in PARTS}
    columns["stands_out"] = [[part for part in PARTS if odd[part][row]] for row in range(len(columns["id"]))]
    return {
        part: {
            "count": int(np.isfinite(values[part]).sum()),
            "rms": rms(values[part]),
            "rms_um": rms(values[f"{part}_um"]),
            "inside_95": int((np.abs(values[f"z_{part}"]) <= INSIDE[part]).sum()),
            "ratio": rms(values[f"z_{part}"]) / (2.0 if part == "plan" else 1.0) ** 0.5,
        }
        for part in PARTS
    }
