"""The document of displacements: what goes out as JSON and CSV, and what reports and pictures are made from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.formats.output.csv_text import to_csv
from photostrip.formats.output.terrestrial_directions import ARCSEC, IMAGE_UM, RATIO, Attitude, head
from photostrip.notes import Document, Note
from photostrip.result.numbers import natural_rank, rounded, significant
from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.monitoring import REASONS, CameraState, Monitoring, Step
from photostrip.terrestrial.normal_case import SIDES, Phototheodolite, ellipses
from photostrip.units import ARCSECONDS, MICROMETRES

if TYPE_CHECKING:
    from photostrip.terrestrial.camera_motion import OneStation, OneStationResult

METRE = 6  # decimals: a micrometre on the ground
COVARIANCES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class ReportFrame(NamedTuple):
    """Axes and times as the user wants them."""

    axes: tuple[str, str, str]  # names of the ground axes in the user's order
    order: tuple[int, int, int]  # which internal axis each of them is
    time_unit: str


def displacement_document(
    name: str,
    result: Monitoring,
    cameras: tuple[Phototheodolite, Phototheodolite],
    frame: ReportFrame,
    notes: Iterable[Note] = (),
) -> Document:
    """Return the document of displacements: numbers rounded, points in natural order."""
    axes, order = frame.axes, list(frame.order)
    series = result.series
    times = None if series.times is None else rounded(series.times, METRE)
    document = head("displacements")
    document["name"] = name
    document["frame"] = {"axes": list(axes)}
    document["units"] = {
        "x, y, z, dx, dy, dz, sigma": f"metres along {', '.join(axes)}",
        "covariance": "square metres: xx, xy, xz, yy, yz, zz",
        "ellipse": "semi-axes in metres; azimuth of the major axis in degrees",
        "rate": f"metres per {frame.time_unit}",
        "_um": "micrometres in the photo, normal case",
        "_arcsec": "seconds of arc",
    }
    document["stations"] = [_station(result, side, cameras[side], order) for side in range(len(SIDES))]
    document["base"] = rounded(result.pair.base, METRE)
    document["settings"] = {
        "significance": result.settings.significance,
        "limit": rounded(result.limit, RATIO),
        "moved_camera": result.settings.moved_camera,
    }
    document["epochs"] = [
        {"id": epoch} if times is None else {"id": epoch, "time": times[number]}
        for number, epoch in enumerate(series.epochs)
    ]
    document["summary"] = _summary(result)
    document["cameras"] = [_camera(result, state) for state in result.cameras]
    ranked = np.argsort(natural_rank(series.points))
    document["points"] = [_point(result, int(row), order, axes) for row in ranked]
    document["not_stable"] = [{"epoch": series.epochs[number], "point": point} for number, point in result.rejected]
    document["notes"] = [
        {"code": note.code, "severity": note.severity, "message": note.message} for note in (*notes, *result.notes)
    ]
    return document


def one_station_document(
    measured: OneStation, result: OneStationResult, camera: Phototheodolite, attitude: Attitude, significance: float
) -> Document:
    """Return displacements from one station; axes are east, north, up, or right, ahead, up where alpha is 0."""
    document = head("one-station", camera)
    document["orientation"] = {
        "unit": attitude.unit,
        **dict(zip(("alpha", "omega", "kappa"), attitude.angles, strict=True)),
    }
    document["settings"] = {"significance": significance}
    document["turn"] = None
    if result.turn is not None:
        names = ("right", "up", "counter_clockwise")
        values, sigmas = (rounded(each * ARCSECONDS, ARCSEC) for each in (result.turn.values, result.turn.sigma))
        document["turn"] = {
            **{f"{name}_arcsec": value for name, value in zip(names, values, strict=True)},
            **{f"sigma_{name}_arcsec": value for name, value in zip(names, sigmas, strict=True)},
            "statistic": rounded(result.turn.statistic, RATIO),
        }
    document["points"] = []
    for row, name in enumerate(measured.points):
        d, s = rounded(result.values[row], METRE), rounded(result.sigma[row], METRE)
        document["points"].append(
            {
                "id": name,
                "stable": bool(measured.stable[row]),
                "components": result.components[row],
                **{f"d{axis}": value for axis, value in zip("xyz", d, strict=True)},
                **{f"sigma_{axis}": value for axis, value in zip("xyz", s, strict=True)},
                "length": rounded(np.linalg.norm(result.values[row]), METRE),
                "statistic": rounded(result.statistic[row], RATIO),
                "limit": rounded(result.limit[row], RATIO),
                "significant": bool(result.statistic[row] > result.limit[row]),
            }
        )
    return document


def _station(result: Monitoring, side: int, camera: Phototheodolite, order: list[int]) -> Document:
    given = head("", camera)["camera"]
    return {"side": SIDES[side], "camera": given, **_by_axis("", result.pair.centers[side][order])}


def _by_axis(head: str, values: Floats) -> Document:
    return {f"{head}{axis}": value for axis, value in zip("xyz", rounded(values, METRE), strict=True)}


def _summary(result: Monitoring) -> Document:
    """Count, and compare the scatter of the stable points with the stated standard deviations."""
    turns = [state.turn for state in result.cameras if state.turn is not None]
    dof = sum(max(turn.dof, 0) for turn in turns)
    weighted = sum(turn.weighted_sum for turn in turns)
    last = result.since_first[-1]
    stable = result.series.stable
    limits = [float(np.sqrt(chi2_quantile(tail, dof) / dof)) if dof else np.nan for tail in (0.025, 0.975)]
    return {
        "points": len(result.series.points),
        "stable": int(stable.sum()),
        "determined": int(np.isfinite(last.values[:, 0]).sum()),
        "significant": int((result.significant(last) & ~stable).sum()),
        "stable_significant": int((result.significant(last) & stable).sum()),
        "turned_cameras": sum(state.moved for state in result.cameras),
        "stable_scatter": rounded(np.sqrt(weighted / dof) if dof else np.nan, RATIO),
        "stable_scatter_range": rounded(limits, RATIO),
        "stable_redundancy": dof,
        "parallax_rms_um": [_rms_um(values) for values in result.parallax],
    }


def _rms_um(values: Floats) -> float | None:
    known = values[np.isfinite(values)]
    found: float | None = rounded(np.sqrt(np.mean(known**2)) * MICROMETRES if len(known) else np.nan, IMAGE_UM)
    return found


def _camera(result: Monitoring, state: CameraState) -> Document:
    row: Document = {"epoch": result.series.epochs[state.epoch], "side": state.side, "determined": False}
    turn = state.turn
    if turn is None:
        return row
    used = (turn.weights > 0).any(axis=1)
    values, sigma = rounded(turn.values * ARCSECONDS, ARCSEC), rounded(turn.sigma * ARCSECONDS, ARCSEC)
    names = ("right", "up", "counter_clockwise")
    return row | {
        "determined": True,
        **{f"{name}_arcsec": value for name, value in zip(names, values, strict=True)},
        **{f"sigma_{name}_arcsec": value for name, value in zip(names, sigma, strict=True)},
        "stable_points": int(used.sum()),
        "redundancy": turn.dof,
        "statistic": rounded(turn.statistic, RATIO),
        "limit": rounded(chi2_quantile(1 - result.settings.significance, len(names)), RATIO),
        "turned": state.moved,
        "removed": state.removed,
    }


def _point(result: Monitoring, row: int, order: list[int], axes: Sequence[str]) -> Document:
    series = result.series
    epochs = []
    for number, epoch in enumerate(series.epochs):
        reason = REASONS.get(int(result.reason[number, row]))
        entry: Document = {"epoch": epoch}
        if reason is not None:
            entry["reason"] = reason
        if np.isfinite(result.positions[number].values[row, 0]):
            entry |= _by_axis("", result.positions[number].values[row][order])
            entry |= _by_axis("sigma_", result.positions[number].sigma[row][order])
            entry["parallax_um"] = rounded(result.parallax[number, row] * MICROMETRES, IMAGE_UM)
        if number and np.isfinite(result.since_first[number - 1].values[row, 0]):
            entry["since_first"] = _step(result, result.since_first[number - 1], row, order, axes)
            if number > 1:
                step = result.since_previous[number - 1]
                known = np.isfinite(step.values[row, 0])
                entry["since_previous"] = _step(result, step, row, order, axes) if known else None
        epochs.append(entry)
    point: Document = {"id": series.points[row], "stable": bool(series.stable[row]), "epochs": epochs}
    rates = result.rates
    if rates is not None and np.isfinite(rates.step.values[row, 0]):
        dof = int(rates.dof[row])
        limit = chi2_quantile(1 - result.settings.significance, dof) if dof else np.nan
        point["rate"] = _step(result, rates.step, row, order, axes) | {
            "misfit": rounded(rates.misfit[row], RATIO),
            "misfit_limit": rounded(limit, RATIO),
            "uniform": None if not dof else bool(rates.misfit[row] <= limit),
        }
    return point


def _step(result: Monitoring, step: Step, row: int, order: list[int], axes: Sequence[str]) -> Document:
    """Return a displacement, or a rate, with its precision and its test."""
    covariance = step.covariance[row][np.ix_(order, order)]
    plan = [place for place, axis in enumerate(axes) if axis != "up"]
    plan.sort(key=lambda place: axes[place] in {"north", "ahead"})  # to the right or east first
    major, minor, azimuth = ellipses(covariance[np.ix_(plan, plan)], 1 - result.settings.significance)
    values = step.values[row][order]
    tested = bool(np.isfinite(step.statistic[row]))
    return {
        **_by_axis("d", values),
        **_by_axis("sigma_", np.sqrt(np.diag(covariance))),
        "length": rounded(np.linalg.norm(values), METRE),
        "covariance": significant([covariance[place] for place in COVARIANCES], 6),
        "ellipse": {
            "major": rounded(major, METRE),
            "minor": rounded(minor, METRE),
            "azimuth_deg": rounded(np.degrees(azimuth), 2),
        },
        "statistic": rounded(step.statistic[row], RATIO),
        "significant": bool(step.statistic[row] > result.limit) if tested else None,
    }


def displacements_csv(document: Document) -> str:
    """Return the displacements since the first epoch as CSV: a row for each point and later epoch.

    Cells are empty where a point has no displacement.
    """
    names = ("dx", "dy", "dz", "sigma_x", "sigma_y", "sigma_z", "length", "statistic", "significant")
    rows = []
    for point in document["points"]:
        for entry in point["epochs"][1:]:
            step: Document = entry.get("since_first") or {}
            place = [entry.get(axis) if step else None for axis in "xyz"]
            values = [step.get(name) for name in names]
            rows.append([point["id"], entry["epoch"], int(point["stable"]), *place, *values, entry.get("reason", "")])
    return to_csv(("point", "epoch", "stable", "x", "y", "z", *names, "reason"), rows)


def cameras_csv(document: Document) -> str:
    turn = ("right", "up", "counter_clockwise")
    names = (
        "epoch",
        "side",
        *(f"{name}_arcsec" for name in turn),
        *(f"sigma_{name}_arcsec" for name in turn),
        "stable_points",
        "statistic",
        "limit",
        "turned",
        "removed",
    )
    return to_csv(names, ([row.get(name) for name in names] for row in document["cameras"]))
