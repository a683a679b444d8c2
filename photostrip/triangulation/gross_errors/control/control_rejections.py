"""What was rejected of the control, and which points seem to have been exchanged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.triangulation.gross_errors.control.strip_at_control import tests_by_kept

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from photostrip.points import ControlPoints
    from photostrip.triangulation.gross_errors.control.strip_at_control import StripAtControl


EXCHANGED = 0.2  # misclosures left by an exchange, over those before


@dataclass(frozen=True, slots=True)
class ControlRejection:
    """Wrong coordinates of one control point. With one plan coordinate the other one is not used either."""

    id: str
    # which coordinates look wrong: ``"east"``, ``"north"``, ``"up"`` (of the point's ground frame)
    axes: tuple[str, ...]
    # value, limit: largest test value and its critical value
    value: float
    limit: float
    # estimated errors of the coordinates east, north, up, metres: given minus what the others predict
    size: tuple[float, float, float]
    redundancy: float  # smallest redundancy number of the coordinates rejected
    exchanged_with: str = ""  # the point with which it seems to have been exchanged; empty when there is none
    # smallest error of the worst coordinate that is found in 80 % of cases, metres; NaN when unknown
    detectable: float = float("nan")


def control_rejections(
    control: ControlPoints, kept: ControlPoints, strip: StripAtControl
) -> tuple[ControlRejection, ...]:
    """List the points with rejected coordinates, with errors as the others predict them and exchanges."""
    out = control.use & ~kept.use
    if not out.any():
        return ()
    tests = tests_by_kept(control, kept, strip)
    value, limit, size = tests.value, tests.limit, tests.size
    partner = _exchanges(control, kept, strip, size)
    by_covariance = strip.tests_by_covariance(control, kept)
    detectable = np.full(control.use.shape, np.nan) if by_covariance is None else by_covariance.detectable
    rows = np.flatnonzero(out.any(axis=1)).tolist()
    found = []
    for row in rows:
        beyond = out[row] & (value[row] > limit[row])
        # what others that were taken back since then do not contradict any more is named as it was rejected
        axes = np.flatnonzero(beyond if beyond.any() else out[row])
        worst = axes[np.nan_to_num(value[row] / limit[row])[axes].argmax()]
        found.append(
            ControlRejection(
                id=control.ids[row],
                axes=tuple(GROUND_AXES[k] for k in axes),
                value=float(value[row, worst]),
                limit=float(limit[row, worst]),
                size=(float(size[row, 0]), float(size[row, 1]), float(size[row, 2])),
                redundancy=float(tests.redundancy[row, axes].min()),
                exchanged_with=partner.get(row, ""),
                detectable=float(detectable[row, worst]),
            )
        )
    return tuple(found)


def _exchanges(control: ControlPoints, kept: ControlPoints, strip: StripAtControl, size: Floats) -> dict[int, str]:
    """Find pairs of rejected points that fit when their coordinates are exchanged, by trying the exchange."""
    out = control.use & ~kept.use
    rows = np.flatnonzero(out[:, :2].any(axis=1)).tolist()
    found: dict[int, str] = {}
    for number, one in enumerate(rows):
        for other in rows[number + 1 :]:
            if control.frame[one] != control.frame[other] or not (control.use[one] == control.use[other]).all():
                continue
            step = (control.enu[other] - control.enu[one])[:2]
            gaps = np.array([size[one, :2] + step, size[other, :2] - step])
            before = np.array([size[one, :2], size[other, :2]])
            # a try is worth while when the exchange takes away most of both errors
            if np.linalg.norm(gaps) < EXCHANGED * np.linalg.norm(before) and _fit_exchanged(
                control, kept, strip, (one, other)
            ):
                found[one], found[other] = control.ids[other], control.ids[one]
    return found


def _fit_exchanged(control: ControlPoints, kept: ControlPoints, strip: StripAtControl, rows: tuple[int, int]) -> bool:
    """Whether two points agree with all others when each has the coordinates of the other."""
    order = np.arange(len(control))
    order[list(rows)] = rows[::-1]
    exchanged = replace(control, enu=control.enu[order], sigma=control.sigma[order])
    tests = tests_by_kept(exchanged, kept, strip)
    return bool((tests.value[list(rows)] <= tests.limit[list(rows)]).all())
