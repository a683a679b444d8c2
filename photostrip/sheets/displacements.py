"""Displacements between epochs, from two stations or from one: tables of cameras, of each epoch, of rates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import counted
from photostrip.project.terrestrial import ReportFrame, Survey
from photostrip.report.page.parts import DASH, Words
from photostrip.report.page.tables import Cell, Field, fields
from photostrip.result.numbers import natural_rank
from photostrip.sheets.directions import camera_facts
from photostrip.sheets.sheet import Fact, Rows, Sheet, filled, hidden, plain, table
from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.camera_motion import OneStation, OneStationResult
from photostrip.terrestrial.monitoring import REASONS, CameraState, Monitoring, Step
from photostrip.terrestrial.normal_case import SIDES, Attitude, Phototheodolite, ellipses
from photostrip.units import ARCSECONDS, MICROMETRES

COVARIANCES = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}
VERDICTS = {True: "moved", False: "", None: "not tested"}
TURNS = ("right", "up", "counter_clockwise")
TURNED = fields(" ".join(f"{name}_arcsec" for name in TURNS), "arcsec 1", "right up ccw")
TURN_SIGMAS = fields(" ".join(f"sigma_{name}_arcsec" for name in TURNS), "arcsec 1", "± ± ±")


def displacement_sheet(survey: Survey, result: Monitoring) -> Sheet:
    """Return displacements: verdict and set-up, the cameras, each epoch, rates, notes; points in natural order."""
    series, frame = result.series, survey.frame
    last = result.since_first[-1]
    moved = int((result.significant(last) & ~series.stable).sum())
    tested = np.isfinite(last.values[:, 0]) & ~series.stable
    level = result.settings.significance
    verdict = (
        f"{counted(moved, 'point')} of {int(tested.sum())} moved between {series.epochs[0]} and {series.epochs[-1]} by"
        f" more than chance allows ({100 * level:.4g} % level)."
    )
    tables = [_stations(survey, result), _cameras(result), *_epochs(result, frame), _positions(result, frame)]
    if result.rates is not None:
        tables.append(_rates(result, frame))
    notes = [(note.code, note.severity, note.message) for note in (*survey.notes, *result.notes)]
    tables.append(_notes(notes))
    return Sheet(
        "displacements",
        f"Displacements: {survey.name}",
        _facts(survey, result, moved),
        tables,
        main="displacements",
        words=[Words(verdict, "look" if moved else "good")],
    )


def _facts(survey: Survey, result: Monitoring, moved: int) -> list[Fact]:
    """Count, and compare the scatter of the stable points with the stated standard deviations."""
    series, (left, right) = result.series, survey.cameras
    cameras = [f"{each.name} (f {each.principal_distance:.9g} mm)" for each in (left, right)]
    turns = [state.turn for state in result.cameras if state.turn is not None]
    dof = sum(max(turn.dof, 0) for turn in turns)
    scatter = float(np.sqrt(sum(turn.weighted_sum for turn in turns) / dof)) if dof else np.nan
    limits = [float(np.sqrt(chi2_quantile(tail, dof) / dof)) if dof else np.nan for tail in (0.025, 0.975)]
    parallax = [_rms_um(values) for values in result.parallax]
    measured = f"{', '.join(DASH if np.isnan(each) else f'{each:.1f}' for each in parallax)} µm"
    expected = f"between {limits[0]:.2f} and {limits[1]:.2f} is as expected"
    stable = int(series.stable.sum())
    times = {} if series.times is None else dict(zip(series.epochs, series.times.tolist(), strict=True))
    return [
        Fact("name", survey.name),
        Fact("cameras_used", [left.name, right.name], text=" and ".join(dict.fromkeys(cameras)), label="cameras"),
        Fact("base", result.pair.base, "m 3"),
        Fact("axes", list(survey.frame.axes), text=", ".join(survey.frame.axes)),
        Fact("epochs", list(series.epochs), text=", ".join(series.epochs)),
        Fact("times", times),
        Fact("time_unit", survey.frame.time_unit),
        Fact("points", len(series.points), text=f"{len(series.points)}, {stable} of them stable"),
        Fact("stable", stable),
        Fact("determined", int(np.isfinite(result.since_first[-1].values[:, 0]).sum())),
        Fact("significant", moved),
        Fact("stable_significant", int((result.significant(result.since_first[-1]) & series.stable).sum())),
        Fact("turned_cameras", sum(state.moved for state in result.cameras)),
        Fact(
            "parallax_rms_um",
            plain(parallax, "um 1"),
            text="not measured: the rays were made to meet" if np.isnan(parallax).all() else measured,
            label="vertical parallaxes, rms",
        ),
        Fact(
            "stable_scatter",
            scatter,
            "ratio 3",
            f"{scatter:.2f} times the stated standard deviations; {expected}" if dof else DASH,
            "stable points, scatter",
        ),
        Fact("stable_scatter_range", plain(limits, "ratio 3")),
        Fact("stable_redundancy", dof),
        Fact("significance", result.settings.significance),
        Fact("limit", plain(result.limit, "ratio 3")),
        Fact("moved_camera", result.settings.moved_camera),
        Fact("not_stable", [{"epoch": series.epochs[number], "point": point} for number, point in result.rejected]),
    ]


def _rms_um(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2)) * MICROMETRES) if len(known) else np.nan


def _stations(survey: Survey, result: Monitoring) -> Rows:
    names = list(zip(SIDES, (camera.name for camera in survey.cameras), strict=True))
    centers = np.array(result.pair.centers)[:, list(survey.frame.order)]
    columns = filled(hidden("side", "camera"), names) + filled(hidden("x", "y", "z", form="m 4"), centers)
    return table("stations", "", columns)


def _cameras(result: Monitoring) -> Rows:
    determined = any(state.turn is not None for state in result.cameras)
    columns = (
        Field("epoch"),
        Field("side", head="camera"),
        *TURNED,
        *TURN_SIGMAS,
        Field("stable_points", "count", "points"),
        *hidden("redundancy"),
        Field("statistic", "ratio 1", "test"),
        Field("limit", "ratio 1"),
        Field("turned", head=""),
        *hidden("removed"),
    )
    return Rows(
        "cameras",
        "Cameras" if determined else "",
        columns if determined else [replace(each, shown=False) for each in columns],
        [camera_row(result, state) for state in result.cameras],
        note="Turns against the first epoch in the camera's own axes; ccw: counter-clockwise for the photographer.",
    )


def camera_row(result: Monitoring, state: CameraState) -> tuple[Any, ...]:
    """Return what is known of one camera in one epoch; stable points that lost all weight do not count."""
    head, turn = (result.series.epochs[state.epoch], state.side), state.turn
    if turn is None:
        return (*head, *[None] * 10, Cell("not determined", None), None)
    verdict = f"{'turned' if state.moved else 'not significant'}, {'taken out' if state.removed else 'left in'}"
    limit = chi2_quantile(1 - result.settings.significance, len(TURNS))
    used = int((turn.weights > 0).any(axis=1).sum())
    turned = (*(turn.values * ARCSECONDS), *(turn.sigma * ARCSECONDS))
    return (*head, *turned, used, turn.dof, turn.statistic, limit, Cell(verdict, state.moved), state.removed)


def _columns(axes: Sequence[str]) -> tuple[Field, ...]:
    """Return the columns of displacements along the user's axes."""
    along = tuple(Field(f"d{axis}", "m +3", f"d {name}") for axis, name in zip("xyz", axes, strict=True))
    return (
        *along,
        *fields("sigma_x sigma_y sigma_z", "m 3", "± ± ±"),
        Field("length", "m 3"),
        *hidden("ellipse_major", "ellipse_minor", form="m 3"),
        Field("", "m 3", "ellipse", rank=1),
        Field("azimuth_deg", "deg 0", "azimuth", rank=1),
        *hidden(*(f"covariance_{pair}" for pair in COVARIANCES), form="m² g6"),
        Field("statistic", "ratio 1", "test"),
        Field("significant", head=""),
    )


def _step(result: Monitoring, step: Step, row: int, frame: ReportFrame) -> tuple[Any, ...] | None:
    """Return a displacement, or a rate, with its precision and its test; None where it is not determined."""
    if not np.isfinite(step.values[row, 0]):
        return None
    order, axes = list(frame.order), frame.axes
    covariance, values = step.covariance[row][np.ix_(order, order)], step.values[row][order]
    plan = [place for place, axis in enumerate(axes) if axis != "up"]
    plan.sort(key=lambda place: axes[place] in {"north", "ahead"})  # to the right or east first
    major, minor, azimuth = map(float, ellipses(covariance[np.ix_(plan, plan)], 1 - result.settings.significance))
    statistic = float(step.statistic[row])
    moved = bool(statistic > result.limit) if np.isfinite(statistic) else None
    stable = "stable" if result.series.stable[row] else ""
    return (
        *values,
        *np.sqrt(np.diag(covariance)),
        float(np.linalg.norm(values)),
        major,
        minor,
        f"{major:.3f} × {minor:.3f}" if np.isfinite(major) else DASH,
        float(np.degrees(azimuth)),
        *(covariance[place] for place in COVARIANCES.values()),
        statistic,
        Cell(", ".join(filter(None, (stable, VERDICTS[moved]))), moved),
    )


def _points(result: Monitoring) -> list[int]:
    return [int(row) for row in np.argsort(natural_rank(result.series.points))]


def _epochs(result: Monitoring, frame: ReportFrame) -> Iterator[Rows]:
    """Give the displacements of each epoch since the first, and since the one before."""
    epochs, columns = result.series.epochs, _columns(frame.axes)
    settings = result.settings
    note = (
        f"Test: d' C⁻¹ d, limit {result.limit:.2f}; ± standard deviations; ellipse in plan,"
        f" {100 * (1 - settings.significance):.4g} %, azimuth of its major axis."
    )
    head = (Field("point"), *hidden("epoch", "stable"), *hidden("x", "y", "z", form="m 3"))
    for number in range(1, len(epochs)):
        steps = {"displacements": (epochs[0], result.since_first[number - 1])}
        if number > 1:
            steps["since_previous"] = (epochs[number - 1], result.since_previous[number - 1])
        for key, (since, step) in steps.items():
            rows = []
            for row in _points(result):
                reason = REASONS.get(int(result.reason[number, row]), "")
                found = _step(result, step, row, frame) or (*[None] * (len(columns) - 1), Cell(reason, None))
                at = result.positions[number].values[row][list(frame.order)]
                who = (result.series.points[row], epochs[number], bool(result.series.stable[row]), *at)
                rows.append((*who, *found, reason))
            title = f"{since} to {epochs[number]}"
            yield Rows(key, title, (*head, *columns, Field("reason", shown=False)), rows, note=note)


def _positions(result: Monitoring, frame: ReportFrame) -> Rows:
    """Give the coordinates of all points in all epochs."""
    series, order, rows = result.series, list(frame.order), _points(result)
    values, sigmas = (
        np.stack([getattr(each, name)[rows][:, order] for each in result.positions], axis=1).reshape(-1, len(order))
        for name in ("values", "sigma")
    )
    columns = [
        *filled((Field("point"), Field("epoch")), list(product([series.points[row] for row in rows], series.epochs))),
        *filled([Field(axis, "m 3", name) for axis, name in zip("xyz", frame.axes, strict=True)], values),
        *filled(fields("sigma_x sigma_y sigma_z", "m 4", "± ± ±"), sigmas),
        (Field("parallax_um", "um 1", "p vertical"), (result.parallax[:, rows].T * MICROMETRES).ravel()),
    ]
    return table("positions", "Positions", columns)


def _rates(result: Monitoring, frame: ReportFrame) -> Rows:
    """Give uniform motions."""
    unit, rates = f"m/{frame.time_unit}", result.rates
    columns = (
        Field("point"),
        *(Field(f"d{axis}", f"{unit} +4", f"v {name}") for axis, name in zip("xyz", frame.axes, strict=True)),
        *fields("sigma_x sigma_y sigma_z", f"{unit} 4", "± ± ±"),
        Field("length", f"{unit} 4", "speed"),
        Field("statistic", "ratio 1", "test"),
        *fields("misfit misfit_limit", "ratio 1", "misfit limit"),
        Field("significant", head=""),
        Field("uniform", shown=False),
    )
    rows = []
    for row in _points(result) if rates is not None else ():
        step = _step(result, rates.step, row, frame) if rates is not None else None
        if step is None or rates is None:
            continue
        dof = int(rates.dof[row])
        limit = chi2_quantile(1 - result.settings.significance, dof) if dof else np.nan
        uniform = bool(rates.misfit[row] <= limit) if dof else None
        moved = step[-1].value
        words = ", ".join(filter(None, (VERDICTS[moved], "not uniform" if uniform is False else "")))
        name = result.series.points[row]
        rows.append((name, *step[:7], step[-2], rates.misfit[row], limit, Cell(words, moved), uniform))
    note = "Misfit: what a uniform motion leaves, chi-square; above its limit the motion is not uniform."
    return Rows("rates", "Rates", columns, rows, note=note)


def _notes(notes: Iterable[tuple[str, str, str]]) -> Rows:
    listed = list(notes)
    words = [Words(f"{severity}: {text}", "look" if severity == "warning" else "", "-") for _, severity, text in listed]
    return Rows("notes", "Notes", hidden("code", "severity", "message"), listed, below=words)


def one_station_sheet(
    measured: OneStation, result: OneStationResult, camera: Phototheodolite, attitude: Attitude, significance: float
) -> Sheet:
    """Return displacements from one station; axes are east, north, up, or right, ahead, up where alpha is 0."""
    facts = [*camera_facts(camera, attitude), Fact("significance", significance)]
    turn = result.turn
    if turn is not None:
        values, sigmas = (turn.values * ARCSECONDS).tolist(), (turn.sigma * ARCSECONDS).tolist()
        listed = list(zip(("right", "up", "ccw"), values, sigmas, strict=True))
        text = ", ".join(f"{value:z.1f} ± {sigma:.1f}″ {way}" for way, value, sigma in listed)
        found = {f"{name}_arcsec": plain(value, "arcsec 1") for name, value in zip(TURNS, values, strict=True)}
        found |= {f"sigma_{name}_arcsec": plain(value, "arcsec 1") for name, value in zip(TURNS, sigmas, strict=True)}
        statistic = {"statistic": plain(turn.statistic, "ratio 2")}
        facts.append(Fact("turn", found | statistic, text=f"{text}; taken out", label="camera turned"))
    moved, stable = result.statistic > result.limit, measured.stable.tolist()
    verdicts = ["stable" if each else VERDICTS[bool(gone)] for each, gone in zip(stable, moved, strict=True)]
    seen = {2: "across the ray", 3: "in space"}
    along = [Field(f"d{axis}", "m +3", f"d {name}") for axis, name in zip("xyz", ("east", "north", "up"), strict=True)]
    columns = [
        (Field("point"), list(measured.points)),
        *filled(along, result.values),
        *filled(fields("sigma_x sigma_y sigma_z", "m 3", "± ± ±"), result.sigma),
        (Field("length", "m 3"), np.linalg.norm(result.values, axis=1)),
        (Field("statistic", "ratio 1", "test"), result.statistic),
        (Field("limit", "ratio 1", rank=1), result.limit),
        (Field("significant", head=""), list(map(Cell, verdicts, moved.tolist()))),
        (Field("components", head="seen"), [Cell(seen[number], number) for number in result.components]),
        (Field("stable", shown=False), stable),
    ]
    note = "test: chi-square of what is seen; axes are right, ahead, up of the camera where alpha is 0"
    points = table("points", "Displacements", columns, note=note)
    return Sheet("one-station", "Displacements from one station", facts, [points])
