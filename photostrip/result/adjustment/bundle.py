"""The bundle adjustment in a result: convergence, sigma0, reliability, variance components, calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.result.numbers import GROUND, Document, Plain, rounded, significant
from photostrip.triangulation.bundle.quality import reliability

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from photostrip.pipeline import Result
    from photostrip.pipeline.results import Bundle
    from photostrip.triangulation.bundle.settings import Settings
    from photostrip.triangulation.bundle.snooping import Rejection
    from photostrip.triangulation.bundle.solution import Solution

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

SHOWN = 10  # observations named as the weakest and as the worst
AXES = {
    reliability.IMAGE: ("x", "y"),
    reliability.CONTROL: ("east", "north", "up"),
    reliability.POSITION: ("east", "north", "up"),
    reliability.ATTITUDE: ("1", "2", "3"),
}
UNITS = {
    reliability.IMAGE: ("um", 1000.0, 2),
    reliability.CONTROL: ("m", 1.0, GROUND),
    reliability.POSITION: ("m", 1.0, GROUND),
    reliability.ATTITUDE: ("deg", 180 / np.pi, 6),
}
SHORT = 6  # digits
MICROMETRES = 1000.0  # in a millimetre
RELIABILITY = ("redundancy_x", "redundancy_y", "test_x", "test_y", "detectable_x_um", "detectable_y_um")


def bundle_of(result: Result) -> Document:
    """Return the block ``bundle``.

    Returns
    -------
    dict
        The block under its key; empty when there was no bundle adjustment.
    """
    found = result.bundle
    if found is None:
        return {}
    screened, settings = found.screened, result.settings.bundle
    problem, solution = screened.problem, screened.solution
    shift = reliability.noncentrality(settings.alpha, settings.power)
    observed = {group.kind: int(np.isfinite(group.sigma).sum()) for group in found.groups}
    block: Document = {
        "free_network": solution.free,
        "sigma0": significant(solution.sigma0, SHORT),
        "redundancy": solution.redundancy,
        "sigma0_test": _sigma0(found),
        "observations": observed,
        "unknowns": {
            "photos": 6 * problem.photos,
            "points": 3 * len(result.points.number),
            "common": len(solution.common),
        },
        "iterations": len(solution.steps),
        "adjustments": screened.rounds,
        "convergence": _convergence(solution),
        "screening": _screening(found, settings),
        "reliability": {
            "power": settings.power,
            "noncentrality": rounded(shift, 3),
            "groups": [_group(group, shift) for group in found.groups],
            "weakest": _named(result, found, "weakest"),
            "worst": _named(result, found, "worst"),
        },
        "variance_components": _components(found),
        "calibration": _calibration(found),
        "correlations": [
            {"first": each.first, "second": each.second, "value": rounded(each.value, 4)} for each in found.correlations
        ],
        "given": [
            _row(found, group, (row, axis), shift)
            for group in found.groups
            if group.kind != reliability.IMAGE
            for row, axis in np.argwhere(np.isfinite(group.sigma)).tolist()
        ],
        "positions": list(_positions(found)),
        "corrections": list(_corrections(found)),
    }
    return {"bundle": block}


def _convergence(solution: Solution) -> list[Document]:
    return [
        {
            "chi_square": significant(step.chi_square, 10),
            "length": significant(step.length),
            "damping": significant(step.damping),
            "shift": significant(step.shift),
            "turn_deg": significant(np.degrees(step.turn)),
        }
        for step in solution.steps
    ]


def _screening(found: Bundle, settings: Settings) -> Document:
    """Sum up the search for gross errors."""
    screened = found.screened
    out = [each for each in screened.rejections if not each.readmitted]
    return {
        "method": settings.screening,
        "test": settings.test,
        "alpha": settings.alpha,
        "limit": rounded(reliability.limit(settings.test, settings.alpha, screened.solution.redundancy), 3),
        "rejected": {kind: sum(each.kind == kind for each in out) for kind in AXES},
        "readmitted": len(screened.rejections) - len(out),
    }


def _components(found: Bundle) -> list[Document]:
    return [
        {
            "group": each.name,
            "observations": each.observations,
            "redundancy": rounded(each.redundancy, 1),
            "factor": significant(each.factor),
            "sigma": significant(each.sigma),
            "estimated": each.estimated,
        }
        for each in found.components
    ]


def _calibration(found: Bundle) -> list[Document]:
    return [
        {
            "camera": each.camera,
            "parameter": each.name,
            "unit": each.unit,
            "value": significant(each.value, 6),
            "sigma": significant(each.sigma),
            "p": significant(each.p),
            "significant": each.significant,
            "sigma_a_priori": significant(each.prior) if np.isfinite(each.prior) else None,
            "controlled": rounded(each.redundancy, 2),
        }
        for each in found.parameters
    ]


def _sigma0(found: Bundle) -> Document:
    test = found.sigma0
    return {
        "sigma0": significant(test.sigma0, SHORT),
        "redundancy": test.redundancy,
        "lower": rounded(test.lower, 4),
        "upper": rounded(test.upper, 4),
        "level": reliability.SIGMA0_LEVEL,
        "passed": test.passed if np.isfinite(test.lower) else None,
    }


def _group(group: reliability.Group, shift: float) -> Document:
    """Sum up the redundancy of one kind of observations."""
    unit, factor, decimals = UNITS[group.kind]
    given = np.isfinite(group.sigma)
    share, controlled = group.redundancy[given], group.redundancy[given] >= reliability.UNCONTROLLED
    detectable = group.detectable(shift)[given][controlled] * factor
    external = group.external(shift)[given][controlled]
    return {
        "group": group.kind,
        "observations": int(given.sum()),
        "redundancy": rounded(share.sum(), 2),
        "mean": rounded(share.mean(), 3),
        "smallest": rounded(share.min(), 3),
        "uncontrolled": int((~controlled).sum()),
        "detectable": rounded(np.median(detectable), decimals) if len(detectable) else None,
        "detectable_largest": rounded(detectable.max(), decimals) if len(detectable) else None,
        "unit": unit,
        "external": rounded(np.median(external), 2) if len(external) else None,
        "external_largest": rounded(external.max(), 2) if len(external) else None,
    }


def with_reliability(result: Result, residuals: list[Document]) -> list[Document]:
    """Add to the list ``residuals`` how well each ray is checked by the others.

    Returns
    -------
    list of dict
        The same, without a bundle adjustment; otherwise with redundancy numbers, standardised residuals and detectable
        errors of x and y, None for rays that took no part.
    """
    found = result.bundle
    if found is None:
        return residuals
    shift = reliability.noncentrality(result.settings.bundle.alpha, result.settings.bundle.power)
    (group,) = (each for each in found.groups if each.kind == reliability.IMAGE)
    values = np.column_stack([group.redundancy, group.standardised, group.detectable(shift) * MICROMETRES])
    rounds = [rounded(values[:, column], decimals) for column, decimals in enumerate((3, 3, 2, 2, 2, 2))]
    images = found.screened.problem.images
    problem = found.screened.problem
    names = [
        (problem.photo_name(p), problem.point_name(q))
        for p, q in zip(images.photo.tolist(), images.point.tolist(), strict=True)
    ]
    row_of = {name: row for row, name in enumerate(names)}
    rows = []
    for each in residuals:
        at = [row_of.get((each["photo"], point), -1) for point in each["points"]]
        columns = {
            name: [None if row < 0 else column[row] for row in at]
            for name, column in zip(RELIABILITY, rounds, strict=True)
        }
        rows.append({**each, **columns})
    return rows


def _named(result: Result, found: Bundle, what: str) -> list[Document]:
    """Name the observations that are hardest to check, or that fit worst."""
    shift = reliability.noncentrality(result.settings.bundle.alpha, result.settings.bundle.power)
    chosen = []
    for number, group in enumerate(found.groups):
        value = np.where(
            np.isfinite(group.sigma), -group.redundancy if what == "weakest" else np.abs(group.standardised), np.nan
        )
        flat = np.where(np.isfinite(value), value, -np.inf).ravel()
        best = np.argsort(-flat, kind="stable")[:SHOWN]
        chosen += [(-float(flat[at]), number, int(at)) for at in best.tolist() if np.isfinite(flat[at])]
    rows = []
    for _, number, at in sorted(chosen)[:SHOWN]:
        group = found.groups[number]
        rows.append(_row(found, group, divmod(at, group.sigma.shape[1]), shift))
    return rows


def _row(found: Bundle, group: reliability.Group, at: tuple[int, int], shift: float) -> Document:
    """Tell everything about one observed coordinate."""
    unit, factor, decimals = UNITS[group.kind]
    photo, point = _names(found, group.kind, at[0])
    checked = group.redundancy[at] >= reliability.UNCONTROLLED
    external = group.external(shift)[at] if checked else np.nan
    return {
        "kind": group.kind,
        "photo": photo,
        "point": point,
        "axis": AXES[group.kind][at[1]],
        "redundancy": rounded(group.redundancy[at], 3),
        "error": rounded(group.error[at] * factor, decimals),
        "standardised": rounded(group.standardised[at], 2),
        "detectable": rounded(group.detectable(shift)[at] * factor, decimals) if checked else None,
        "unit": unit,
        "external": rounded(external, 2),
        "effect": _effect(found, group.kind, at[0], float(external)),
    }


def _effect(found: Bundle, kind: str, row: int, external: float) -> Plain:
    """Return the largest shift of its own point or camera by an error that is just not found, metres."""
    problem, precision = found.screened.problem, found.screened.precision
    if not np.isfinite(external):
        return None
    if kind == reliability.IMAGE:
        block = precision.points[problem.images.point[row]]
    elif kind == reliability.CONTROL:
        block = precision.points[problem.control.point[row]]
    else:
        part = problem.positions if kind == reliability.POSITION else problem.attitudes
        block = precision.photos[part.photo[row], :3, :3]
    return rounded(external * np.sqrt(np.linalg.eigvalsh(block)[-1]), GROUND) if np.isfinite(block).all() else None


def _names(found: Bundle, kind: str, row: int) -> tuple[str | None, str | None]:
    """Photo and point of a row."""
    problem = found.screened.problem
    if kind == reliability.IMAGE:
        images = problem.images
        return problem.photo_name(int(images.photo[row])), problem.point_name(int(images.point[row]))
    if kind == reliability.CONTROL:
        return None, problem.point_name(int(problem.control.point[row]))
    part = problem.positions if kind == reliability.POSITION else problem.attitudes
    return problem.photo_name(int(part.photo[row])), None


def _positions(found: Bundle) -> Iterator[Document]:
    """Return the differences at camera positions, adjusted minus given."""
    problem, solution = found.screened.problem, found.screened.solution
    given = problem.positions
    for row in range(len(given)):
        use = np.isfinite(given.sigma[row])
        moved = rounded(np.where(use, solution.position_residuals[row], np.nan), GROUND)
        yield {
            "photo": problem.photo_name(int(given.photo[row])),
            "d_east": moved[0], "d_north": moved[1], "d_up": moved[2],
            "sigma": rounded(np.where(use, given.sigma[row], np.nan), GROUND),
        }  # fmt: skip


def _corrections(found: Bundle) -> Iterator[Document]:
    """Give offsets and drifts of the camera positions of the strips."""
    problem, solution, precision = found.screened.problem, found.screened.solution, found.screened.precision
    names = problem.common_names()
    first = len(names) - sum(
        3 * int((s > 0).sum()) for s in (problem.positions.offset_sigma, problem.positions.drift_sigma)
    )
    for number in range(first, len(names)):
        sigma = float(np.sqrt(precision.common[number, number])) * found.unit
        yield {"name": names[number], "value": significant(solution.common[number], 6), "sigma": significant(sigma)}


def with_bundle(result: Result, rejected: list[Document]) -> list[Document]:
    """Bring the list ``rejected`` of the strip method up to date with the bundle adjustment.

    Parameters
    ----------
    rejected : list of dict
        What was taken out while the strips were formed and brought to the ground.

    Returns
    -------
    list of dict
        The same, without a bundle adjustment; otherwise what it uses after all is marked as re-admitted, and what it
        took out itself, of stage ``bundle``, comes last.
    """
    found = result.bundle
    if found is None:
        return rejected
    problem, selection = found.block.problem, found.screened.selection
    images = problem.images
    inside = np.flatnonzero(selection.images).tolist()
    used = {(problem.photo_name(int(images.photo[n])), problem.point_name(int(images.point[n]))) for n in inside}
    control = {
        problem.point_name(int(point))
        for point, yes, sigma in zip(problem.control.point, selection.control, problem.control.sigma, strict=True)
        if (yes | ~np.isfinite(sigma)).all()
    }
    rows = []
    for each in rejected:
        photos = [photo for photo in (each["photo"], each["other_photo"]) if photo is not None]
        back = all((photo, each["point"]) in used for photo in photos) if photos else each["point"] in control
        after_all = {"readmitted": True, "blamed": [], "reason": "used by the bundle adjustment"}
        rows.append({**each, **after_all} if back else each)
    return rows + [_rejection(found, each) for each in found.screened.rejections]


def _rejection(found: Bundle, each: Rejection) -> Document:
    problem = found.block.problem
    unit, factor, decimals = UNITS[each.kind]
    images = problem.images
    photo: str | None = None
    point: str | None = None
    if each.kind == reliability.IMAGE:
        photo, point = problem.photo_name(int(images.photo[each.row])), problem.point_name(int(images.point[each.row]))
    elif each.kind == reliability.CONTROL:
        point = problem.point_name(int(problem.control.point[each.row]))
    else:
        part = problem.positions if each.kind == reliability.POSITION else problem.attitudes
        photo = problem.photo_name(int(part.photo[each.row]))
    axis = AXES[each.kind][each.axis]
    size = rounded(each.size * factor, decimals)
    reason = (
        "does not fit the other observations"
        if size is None
        else f"{axis} is wrong by about {size:+g} {unit.replace('um', 'µm')}"
    )
    if each.readmitted:
        reason = "taken back: it fits after the others went"
    strip = next((s.strip.id for s in found.start.strips if photo in s.strip.photos), "") if photo else ""
    return {
        "strip": strip,
        "photo": photo,
        "other_photo": None,
        "point": point,
        "stage": "bundle",
        "test": each.test,
        "value": rounded(each.value, 2),
        "limit": rounded(each.limit, 2),
        "unit": "",
        "parallax_um": None,
        "zone": None,
        "size": size,
        "size_unit": unit,
        "readmitted": each.readmitted,
        "blamed": [photo] if photo is not None and point is not None and not each.readmitted else [],
        "reason": reason,
    }


def image_fit(result: Result) -> tuple[float, float, int]:
    """Give sigma0 of the image coordinates, their stated standard deviation and their rms residual, mm, of a bundle.

    Returns
    -------
    sigma0, rms : float
        Standard deviation of an image coordinate found, and rms of the residuals, mm.
    """
    found = result.bundle
    if found is None:
        raise ValueError("no bundle adjustment")
    solution, sigma = found.screened.solution, found.screened.problem.images.sigma
    stated = float(np.sqrt(np.mean(sigma**2)))
    rms = float(np.sqrt(np.mean(solution.image_residuals**2)))
    return solution.sigma0 * stated, rms, solution.redundancy
