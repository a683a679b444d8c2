"""The bundle adjustment in a result: convergence, sigma0, reliability, variance components, calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.network import reliability
from photostrip.network.hypotheses import ALL, DRIFT, HEIGHTS_ONLY, LIST, OF_CAMERAS, OF_PHOTOS, OFFSET
from photostrip.network.observations import PRINCIPAL_DISTANCE, corrections, drift_columns
from photostrip.network.problem import CALIBRATION, BundleProblem, BundleSettings
from photostrip.notes import Document
from photostrip.pipeline.results import Bundle, Result
from photostrip.rejection import UNCONTROLLED
from photostrip.result.given import COUNTED, PLACES
from photostrip.result.numbers import PER_RADIAN, attributes, record, rms
from photostrip.result.points import ImageResiduals
from photostrip.result.table import Table
from photostrip.statistics import TEST_LEVEL
from photostrip.strip.corrections import FORWARD
from photostrip.units import MICROMETRES

OBSERVED = (reliability.IMAGE, reliability.CONTROL, reliability.POSITION, reliability.ATTITUDE)
SAME = 1e-3  # parts by which standard deviations that are taken for one may differ
SHOWN = 10  # observations named as the weakest and as the worst


class GroupKind(NamedTuple):
    """How observations of a kind are written."""

    name: str
    axes: tuple[str, ...]
    unit: str
    factor: float  # of the unit in the unit of the adjustment


def kinds(angle_unit: str, *, of_models: bool = False) -> dict[str, GroupKind]:
    """Return how observations are written, with angles in the unit of the output; rays or model coordinates first."""
    measured = ("model", CARTESIAN_AXES) if of_models else ("image", ("x", "y"))
    return {
        reliability.IMAGE: GroupKind(*measured, "um", MICROMETRES),
        reliability.CONTROL: GroupKind("control", GROUND_AXES, "m", 1.0),
        reliability.POSITION: GroupKind("position", GROUND_AXES, "m", 1.0),
        reliability.ATTITUDE: GroupKind("attitude", ("1", "2", "3"), angle_unit, PER_RADIAN[angle_unit]),
    }


def bundle_of(result: Result) -> Document:
    """Return the block ``bundle`` under its key; nothing when there was no bundle adjustment."""
    found = result.bundle
    if found is None:
        return {}
    screened, settings = found.screened, result.settings.bundle
    problem, solution = screened.problem, screened.solution
    shift, groups = screened.limit.shifts(settings.power), _tested(found)
    written = kinds(result.settings.angle_unit, of_models=problem.of_models)
    block: Document = {
        "free_network": solution.free,
        "sigma0": solution.sigma0,
        "redundancy": solution.redundancy,
        "sigma0_test": _sigma0(found),
        "observations": {written[group.kind].name: int(np.isfinite(group.sigma).sum()) for group in found.groups},
        "unknowns": {
            f"{problem.unit}s": problem.unknowns * problem.photos,
            "points": 3 * int(np.isfinite(screened.precision.points[:, 0, 0]).sum()),
            "common": len(solution.common),
        },
        "iterations": len(solution.steps),
        "adjustments": screened.rounds,
        "convergence": Table.of_rows(
            "bundle.convergence",
            (
                attributes(step, "chi_square length damping shift") | {"turn_deg": np.degrees(step.turn)}
                for step in solution.steps
            ),
        ),
        "screening": _screening(found, settings, written),
        "reliability": {
            "power": settings.power,
            "noncentrality": shift[reliability.IMAGE],
            "noncentrality_given": shift[reliability.CONTROL],
            **_image_sigma(found),
            "groups": Table.of_rows(
                "bundle.reliability.groups",
                (_group(group, shift[group.kind], written[group.kind]) for group in groups),
            ),
            "weakest": _foremost("weakest", found, shift, written, [-group.redundancy for group in groups]),
            "worst": _foremost("worst", found, shift, written, [np.abs(group.standardised) for group in groups]),
        },
        "variance_components": Table.of_rows(
            "bundle.variance_components",
            (
                {"group": each.name} | attributes(each, "observations redundancy factor sigma estimated")
                for each in found.components
            ),
        ),
        "calibration": Table.of_rows("bundle.calibration", _calibration(result, found)),
        "correlations": Table.of_rows("bundle.correlations", map(asdict, found.correlations)),
        "corrections": Table.of_rows("bundle.corrections", _corrections(found)),
        "taken_up": Table.of_rows("bundle.taken_up", _taken_up(found)),
    }
    return {"bundle": record("bundle", block)}


def _tested(found: Bundle) -> list[reliability.Group]:
    """Return the observations with the standard deviations by which the search for gross errors tests them."""
    return [replace(each, sigma=each.sigma * found.screened.limit.unit) for each in found.groups]


def _sigma0(found: Bundle) -> Document:
    test = found.sigma0
    passed = test.passed if np.isfinite(test.lower) else None
    return attributes(test, "sigma0 redundancy lower upper") | {"level": TEST_LEVEL, "passed": passed}


def _screening(found: Bundle, settings: BundleSettings, written: Mapping[str, GroupKind]) -> Document:
    screened = found.screened
    out = screened.out
    return {
        "method": settings.screening,
        "test": settings.test,
        "alpha": screened.limit.alpha,
        "limit": screened.limit.value,
        "alpha_given": screened.limit.alpha_of_given,
        "limit_given": screened.limit.given,
        "unit": screened.limit.unit,
        "rejected": {written[kind].name: sum(each.kind == kind for each in out) for kind in OBSERVED},
        "readmitted": len(screened.rejections) - len(out),
    }


def _calibration(result: Result, found: Bundle) -> list[Document]:
    """Return the parameters of the self-calibration: the first of the common unknowns."""
    covariance = found.screened.precision.common[: len(found.parameters), : len(found.parameters)]
    sigma, cameras = np.sqrt(np.diag(covariance)), result.inputs.camera_named
    problem, columns = found.screened.problem, [each.title for each in CALIBRATION.values()]
    rows, like = [], np.arange(len(problem.camera_ids)) if problem.cameras.like is None else problem.cameras.like
    for each, row in zip(found.parameters, covariance / np.outer(sigma, sigma), strict=True):
        number, column = problem.camera_ids.index(each.camera), columns.index(each.name)
        camera = cameras[problem.camera_ids[like[number]]]  # a photo that is shifted has one of its own like it
        measured = problem.cameras.of_photo[problem.images.photo] == number
        given = _given_calibration(camera)[column]
        rows.append(
            {
                "parameter": each.name,
                "given": given,
                "adjusted": given + each.value,
                **attributes(each, "camera unit value sigma p significant"),
                "corner_um": abs(each.value) * _at_corner(camera, problem.images.xy[measured])[column] * MICROMETRES,
                "sigma_a_priori": each.prior if np.isfinite(each.prior) else None,
                "controlled": each.redundancy,
                "correlations": row,
            }
        )
    return rows


def _given_calibration(camera: Camera) -> Floats:
    """Return the calibration as it is given, (10,), in the order of ``CALIBRATION``; NaN for a table of distortion.

    Distortion as it is added to image points; that which is added to ideal points to first order.
    """
    lens, coefficients = camera.distortion, np.zeros(7)
    if lens is not None:
        coefficients = np.array([*lens.k, *lens.p, *lens.b]) * (1.0 if lens.direction == FORWARD else -1.0)
        coefficients[:3] += np.nan if lens.radius else 0.0
    return np.array([camera.principal_distance, *camera.principal_point, *coefficients])


def _at_corner(camera: Camera, measured: Floats) -> Floats:
    """Return how far each parameter at one moves an image point at most, mm, in a corner of the format, (10,).

    measured: (n, 2), image points, whose corners are taken where the format is not known.
    """
    reach = np.array(camera.format) / 2.0 if camera.format else np.abs(measured).max(axis=0)
    xy = (reach * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)]) - camera.principal_point).T
    moved = corrections(xy)
    moved[PRINCIPAL_DISTANCE] = xy / camera.principal_distance
    return np.asarray(np.hypot(*moved.transpose(1, 0, 2)).max(axis=1), float)


def positions_of(result: Result) -> Document:
    """Return the table ``positions`` under its key: camera positions, adjusted minus given; nothing without any."""
    if result.bundle is None or not len(result.bundle.block.problem.positions):
        return {}
    found, stated = result.bundle.screened, result.bundle.block.problem.positions.sigma
    given, used = np.isfinite(stated), np.isfinite(found.problem.positions.sigma)
    cofactor = np.diagonal(found.precision.position_residuals, axis1=1, axis2=2)
    sigma, off = np.where(given, stated, np.nan), np.where(given, found.solution.position_residuals, np.nan)
    share = np.where(used, cofactor, sigma**2 - cofactor) / sigma**2  # left out: minus that of the adjusted
    checked = np.where(share >= UNCONTROLLED, share, np.nan)
    values = {
        "d": off,
        "normalised": off / (sigma * np.sqrt(checked) * found.limit.unit),
        "sigma": sigma,
        "redundancy": np.where(used, share, np.nan),
    }
    words = np.array(("", *COUNTED), object)
    columns = {
        "photo": [found.problem.photo_name(photo) for photo in found.problem.positions.photo.tolist()],
        "use": words[given @ PLACES],
        "rejected": words[(given & ~used) @ PLACES],
        **{f"{key}_{axis}": size[:, k] for key, size in values.items() for k, axis in enumerate(GROUND_AXES)},
    }
    return {"positions": Table.of("positions", columns)}


def _corrections(found: Bundle) -> Iterator[Document]:
    """Return offsets and drifts of the camera positions, group by group: the last of the common unknowns."""
    problem, solution, precision = found.screened.problem, found.screened.solution, found.screened.precision
    given, names = problem.positions, problem.common_names()
    offset, drift = drift_columns(given, len(found.parameters))
    sigma = np.sqrt(np.diag(precision.common)) * found.unit
    strips = {strip.strip.id for strip in found.start.strips}
    for group in range(len(given.offset_sigma)):
        name, time = problem.group_ids[group], given.time[given.group == group]
        for kind, columns in ((OFFSET, offset[group]), (DRIFT, drift[group])):
            for axis in np.flatnonzero(columns >= 0).tolist():
                number = int(columns[axis])
                value, length = float(solution.common[number]), float(np.ptp(time)) if kind == DRIFT else 1.0
                yield {
                    "name": names[number],
                    "group": f"strip {name}" if name in strips else name.removeprefix("of "),
                    "kind": kind,
                    "axis": problem.position_axes[axis],
                    "value": value,
                    "sigma": float(sigma[number]),
                    "whole": value * length,
                    "whole_sigma": float(sigma[number]) * length,
                }


def _taken_up(found: Bundle) -> Iterator[Document]:
    """Return what the search took up as common to many observations, in its order, and the adjustment went on with."""
    problem = found.screened.problem
    for each in found.screened.common:
        of = "the block" if each.of == ALL else "each group" if each.kind in {OFFSET, DRIFT} else each.of
        if each.kind == LIST:
            of = "points given in height only" if each.number == HEIGHTS_ONLY else f"control[{each.number}]"
        elif each.kind in OF_CAMERAS:
            of = problem.camera_ids[each.number]
        elif each.kind in OF_PHOTOS:
            of = problem.photo_name(each.number)
        sizes = {
            f"{name}_{axis}": value
            for name, size in (("shift", each.shift), ("sigma", each.sigma))
            for axis, value in zip(GROUND_AXES, size or (np.nan,) * len(GROUND_AXES), strict=True)
        }
        yield {"cause": each.kind, "of": of, "rivals": list(each.rivals), **sizes}


def image_fit(found: Bundle) -> Document:
    solution, sigma = found.screened.solution, found.screened.problem.images.sigma
    return {
        "sigma0_um": solution.sigma0 * rms(sigma) * MICROMETRES,
        "redundancy": solution.redundancy,
        "image_rms_um": rms(solution.image_residuals) * MICROMETRES,
    }


def _group(group: reliability.Group, shift: float, kind: GroupKind) -> Document:
    """Sum up the redundancy of one kind of observations; effects of errors of those that others check."""
    given = np.isfinite(group.sigma)
    controlled = given & (group.redundancy >= UNCONTROLLED)
    share = group.redundancy[given] if given.any() else np.zeros(1)  # where all of the group was rejected
    effects = group.detectable(shift) * kind.factor, group.external(shift)
    detectable, external = (each[controlled] if controlled.any() else np.array([np.nan]) for each in effects)
    return {
        "group": kind.name,
        "observations": int(given.sum()),
        "redundancy": share.sum(),
        "mean": share.mean(),
        "smallest": share.min(),
        "uncontrolled": int((given & ~controlled).sum()),
        "detectable": np.median(detectable),
        "detectable_largest": detectable.max(),
        "unit": kind.unit,
        "external": np.median(external),
        "external_largest": external.max(),
    }


def with_reliability(result: Result, images: Sequence[ImageResiduals], residuals: Table) -> Table:
    """Add to the table ``residuals`` how well each ray is checked by the others; None for rays that took no part.

    Without a bundle adjustment the table stays as it is.
    """
    found = result.bundle
    if found is None or result.model_strips:
        return residuals
    (group,) = (each for each in found.groups if each.kind == reliability.IMAGE)
    columns = {"redundancy": group.redundancy, "test": group.standardised / found.screened.limit.unit}
    columns |= {} if _image_sigma(found) else {"sigma": group.sigma * MICROMETRES}
    at = np.full(len(result.refined.observations), len(group.sigma))  # the last row: a ray that took no part
    at[found.block.rows[found.screened.selection.images]] = np.arange(len(group.sigma))
    at = at[np.concatenate([image.rows for image in images])]
    values = {key: np.vstack([column, np.full(2, np.nan)])[at] for key, column in columns.items()}
    units = {"redundancy": "", "test": "", "sigma": "_um"}
    return residuals.with_columns(
        **{f"{key}_{axis}{units[key]}": of_key[:, k] for key, of_key in values.items() for k, axis in enumerate("xy")}
    )


def _image_sigma(found: Bundle) -> Document:
    """Return the stated standard deviation of image coordinates, µm, where all have the same."""
    sigma = found.screened.problem.images.sigma
    same = not found.screened.problem.of_models and bool(np.ptp(sigma) <= SAME * sigma.max())
    return {"image_sigma_um": float(sigma.max()) * MICROMETRES} if same else {}


def _foremost(
    name: str, found: Bundle, shift: Mapping[str, float], written: Mapping[str, GroupKind], values: list[Floats]
) -> Table:
    """Return the observations with the largest of the values that are given for each group."""
    chosen = []
    groups = _tested(found)
    for number, (group, value) in enumerate(zip(groups, values, strict=True)):
        known = np.isfinite(group.sigma) & np.isfinite(value)
        flat = np.where(known, value, -np.inf).ravel()
        best = np.argsort(-flat, kind="stable")[:SHOWN]
        chosen += [(-float(flat[at]), number, int(at)) for at in best.tolist() if np.isfinite(flat[at])]
    rows = []
    for _, number, at in sorted(chosen)[:SHOWN]:
        group = groups[number]
        place = np.array([divmod(at, group.sigma.shape[1])])
        columns = _observed(found, group, place, shift[group.kind], written[group.kind])
        rows.append({key: column[0] for key, column in columns.items()})
    return Table.of_rows(f"bundle.reliability.{name}", rows)


def _observed(found: Bundle, group: reliability.Group, at: Numbers, shift: float, kind: GroupKind) -> dict[str, Any]:
    """Return columns of everything about observed coordinates, (n, 2): row and axis."""
    count, problem, (row, axis) = len(at), found.screened.problem, at.T
    names = [names_of_observation(problem, group.kind, each) for each in row.tolist()]
    checked = group.redundancy[row, axis] >= UNCONTROLLED
    external = np.where(checked, group.external(shift)[row, axis], np.nan)
    return {
        "kind": [kind.name] * count,
        "photo": [None if problem.of_models else unit for unit, _ in names],
        **({"model": [unit for unit, _ in names]} if problem.of_models else {}),
        "point": [point for _, point in names],
        "axis": [kind.axes[each] for each in axis.tolist()],
        "redundancy": group.redundancy[row, axis],
        "error": group.error[row, axis] * kind.factor,
        "standardised": group.standardised[row, axis],
        "detectable": np.where(checked, group.detectable(shift)[row, axis] * kind.factor, np.nan),
        "unit": [kind.unit] * count,
        "external": external,
        "effect": _effect(found, group.kind, row, external),
    }


def _effect(found: Bundle, kind: str, row: Numbers, external: Floats) -> Floats:
    """Return the largest shift of its own point or camera by an error that is just not found, metres."""
    problem, precision = found.screened.problem, found.screened.precision
    if kind == reliability.IMAGE:
        blocks = precision.points[problem.images.point[row]]
    elif kind == reliability.CONTROL:
        blocks = precision.points[problem.control.point[row]]
    else:
        part = problem.positions if kind == reliability.POSITION else problem.attitudes
        blocks = precision.photos[part.photo[row], :3, :3]
    known = np.isfinite(external) & np.isfinite(blocks).all(axis=(1, 2))
    largest = np.linalg.eigvalsh(np.where(known[:, None, None], blocks, 0.0))[:, -1]
    return np.asarray(np.where(known, external * np.sqrt(largest), np.nan), float)


def names_of_observation(problem: BundleProblem, kind: str, row: int) -> tuple[str | None, str | None]:
    """Return photo, or model, and point of an observation, as far as it has them."""
    if kind == reliability.IMAGE:
        images = problem.images
        return problem.photo_name(int(images.photo[row])), problem.point_name(int(images.point[row]))
    if kind == reliability.CONTROL:
        return None, problem.point_name(int(problem.control.point[row]))
    part = problem.positions if kind == reliability.POSITION else problem.attitudes
    return problem.photo_name(int(part.photo[row])), None
