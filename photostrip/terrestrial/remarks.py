"""What a surveyor should know of displacements beside their numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from photostrip.notes import Note, named
from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.camera_motion import Turn
from photostrip.terrestrial.monitoring import MEASURED, REASONS, Monitoring
from photostrip.units import ARCSECONDS, MICROMETRES

SURE_PROBABILITY = 0.99  # probability below which a misfit may be chance


def remarks(result: Monitoring) -> Iterator[Note]:
    """Give warnings and remarks on displacements: what is missing, what moved that should not, what does not fit."""
    yield from _cameras(result)
    yield from _stable_points(result)
    yield from _parallaxes(result)
    yield from _missing(result)


def _cameras(result: Monitoring) -> Iterator[Note]:
    """Which cameras turned, and which nobody can know of."""
    if not result.series.stable.any():
        message = "no stable points are given: a camera that turned between the epochs shows as displacements"
        yield Note("no-stable-points", message)
        return
    for state in result.cameras:
        where = f"epoch {result.series.epochs[state.epoch]}: the {state.side} camera"
        if state.turn is None:
            message = f"{where} has too few stable points to see whether it turned: two with x and z are needed"
            yield Note("turn-not-determined", message, photos=(state.side,))
        elif state.moved:
            done = "its turn is taken out" if state.removed else "its turn is left in the displacements"
            severity = "note" if state.removed else "warning"
            yield Note(
                "camera-turned", f"{where} turned by {_turned_by(state.turn)}; {done}", severity, photos=(state.side,)
            )


def _turned_by(turn: Turn) -> str:
    words = ("to the right", "up", "counter-clockwise")
    return ", ".join(f"{value:+.0f}″ {word}" for value, word in zip(turn.values * ARCSECONDS, words, strict=True))


def _stable_points(result: Monitoring) -> Iterator[Note]:
    """Which stable points moved, and where they do not fit together."""
    for number, name in result.rejected:
        epoch = result.series.epochs[number]
        message = f"epoch {epoch}: point {name} is given as stable but does not fit the others; it was not used as such"
        yield Note("not-stable", message, points=(name,))
    for state in result.cameras:
        turn = state.turn
        if turn is None or turn.dof <= 0 or turn.weighted_sum <= chi2_quantile(SURE_PROBABILITY, turn.dof):
            continue
        ratio = float(np.sqrt(turn.weighted_sum / turn.dof))
        message = (
            f"epoch {result.series.epochs[state.epoch]}: the stable points of the {state.side} camera scatter"
            f" {ratio:.1f} times as much as the stated standard deviations say, after a turn of the camera is allowed"
            " for: the camera may have been moved from its place, or the standard deviations are too small"
        )
        yield Note("stable-scatter", message, photos=(state.side,))


def _parallaxes(result: Monitoring) -> Iterator[Note]:
    """Where rays of a point do not meet as they should."""
    yield from _misorientation(result)
    for number in range(1, len(result.series.epochs)):
        ratio = np.abs(result.parallax_change[number] / result.parallax_change_sigma[number])
        known = np.isfinite(ratio)
        if not known.any():
            continue
        limit = float(np.sqrt(chi2_quantile(1 - (1 - SURE_PROBABILITY) / known.sum(), 1)))
        for row in np.flatnonzero(known & (np.nan_to_num(ratio) > limit)):
            name = result.series.points[row]
            change = result.parallax_change[number, row] * MICROMETRES
            message = (
                f"epoch {result.series.epochs[number]}: the vertical parallax of point {name} changed by"
                f" {change:+.1f} µm, {ratio[row]:.1f} standard deviations (limit {limit:.1f}): it was measured"
                " wrongly, or another point was"
            )
            yield Note("parallax-change", message, points=(name,))


def _misorientation(result: Monitoring) -> Iterator[Note]:
    """Compare the vertical parallaxes of the first epoch with what the measurements explain."""
    ratio = result.parallax[0] / result.parallax_sigma[0]
    ratio = ratio[np.isfinite(ratio)]
    if len(ratio) and (ratio**2).sum() > chi2_quantile(SURE_PROBABILITY, len(ratio)):
        rms = float(np.sqrt(np.nanmean(result.parallax[0] ** 2))) * MICROMETRES
        message = (
            f"the vertical parallaxes of the first epoch have an rms of {rms:.1f} µm,"
            f" {np.sqrt((ratio**2).mean()):.1f} times what the stated standard deviations say: the orientation of the"
            " cameras is not exact; what it adds to both epochs alike cancels in the displacements"
        )
        yield Note("orientation", message)


def _missing(result: Monitoring) -> Iterator[Note]:
    """Name points without displacements, by epoch and reason."""
    for number, epoch in enumerate(result.series.epochs):
        for code in np.unique(result.reason[number]):
            if code == MEASURED:
                continue
            names = [result.series.points[row] for row in np.flatnonzero(result.reason[number] == code)]
            verb = "has" if len(names) == 1 else "have"
            what = "displacement" if number else "coordinates"
            message = f"epoch {epoch}: {named('point', names)} {verb} no {what}: {REASONS[int(code)]}"
            yield Note("not-determined", message, "note", points=tuple(names))
    untested = [
        result.series.points[row]
        for row in np.flatnonzero(result.series.stable)
        if any(np.isfinite(step.values[row, 0]) and not np.isfinite(step.statistic[row]) for step in result.since_first)
    ]
    if untested:
        message = f"not tested, because the turn of a camera depends on them: {named('point', untested)}"
        yield Note("not-tested", message, "note", points=tuple(untested))
