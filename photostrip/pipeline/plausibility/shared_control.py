"""What all control of a strip shares, that of one list, or its check points: a principal distance, another frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.network.hypotheses import HEIGHTS_ONLY
from photostrip.notes import Finding
from photostrip.pipeline.inputs import Strip
from photostrip.pipeline.plausibility.on_control import OnControl
from photostrip.pipeline.results import Result, StripResult
from photostrip.pipeline.strips.models import LinkedModels
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.plausibility import found
from photostrip.plausibility.control.shared_by_control import (
    Shared,
    ShiftedList,
    StretchedHeights,
    find_shared,
    significant,
)
from photostrip.plausibility.finding import ERROR, Evidence
from photostrip.points import ControlPoints

if TYPE_CHECKING:
    from photostrip.strip.error_propagation.check_errors import CheckErrors

Common = StretchedHeights | ShiftedList
FIX = "take it from the certificate"
LEAST_WRONG = 0.03  # of a principal distance, from which it is wrong and not only another one
OTHER_PLACE = "is its crs the right one: zone, datum, false easting?"
OTHER_HEIGHTS = "are its heights of the same kind as those of the others: `height`, `geoid_undulation`, datum?"


def find_shared_errors(
    strips: Sequence[StripResult], findings: Sequence[Finding], *, joined: bool = False
) -> Iterator[Finding]:
    """Name what the control of strips shares (P105, P107, P404, P407).

    findings: what was found before: a strip whose distance is named already, or whose control is misread, is not named.
    joined: whether a bundle has adjusted the strips, and tested control point by point after all.
    """
    then = "" if joined else "; no control was tested by itself"
    if any(each.severity == ERROR and each.key.startswith("control[") for each in findings):
        return  # a list that is misread
    misread = {name for each in findings if each.severity == ERROR for name in each.strips}
    for each in strips:
        if each.shared is not None and each.strip.id not in misread:
            photos = each.of_photos.strip if each.photo_stages else None
            yield from _named(each.shared, each.control, each.strip.id, photos, then)


def of_formed(laid: OnControl, stage: FormedPhotos | LinkedModels) -> list[Finding]:
    """Name what the control of a strip shares that is formed, and not adjusted."""
    shared = find_shared(laid.counted)
    photos = stage.strip if isinstance(stage, FormedPhotos) else None
    return [] if shared is None else list(_named(shared, laid.counted.control, stage.strip.id, photos, ""))


def _named(shared: Common, control: ControlPoints, strip: str, photos: Strip | None, then: str) -> Iterator[Finding]:
    """Name what the control of a strip shares; photos: the strip where it is one of photos, which have a camera."""
    if isinstance(shared, ShiftedList):
        yield shifted_list(shared, control, f"strip {strip}", (strip,), then)
    elif photos is not None:
        yield _stretched(photos, shared, then)


def shifted_list(shared: ShiftedList, control: ControlPoints, whose: str, strips: Sequence[str], then: str) -> Finding:
    """Name a control list that lies beside the other control, or beside all else that is given (P404, P407).

    shared: its number may be ``HEIGHTS_ONLY``, whatever the list.
    control: control that counts, of all lists.
    """
    plan, steps, evidence = _described(shared.shift, shared.sigma)
    inside = np.flatnonzero(control.frame == shared.number)
    key, what = f"control[{shared.number}]", f"control[{shared.number}] lies"
    if shared.number == HEIGHTS_ONLY:
        inside = np.flatnonzero(~control.use[:, :2].any(axis=1))
        key, what = "control", "what is given in height only lies"
    message = f"{what} beside the other control of {whose}, all of it by {steps}{then}"
    fix = OTHER_PLACE if plan else OTHER_HEIGHTS
    points = [control.ids[row] for row in inside.tolist()]
    return found("P407" if plan else "P404", message, fix, evidence, points=points, strips=strips, key=key)


def _described(shift: Floats, sigma: Floats) -> tuple[bool, str, Evidence]:
    """Say whether a shift (3,) is most significant in plan, and what it is; NaN where nothing is given."""
    plan = GROUND_AXES[int(np.nanargmax(np.abs(shift) / sigma))] != "up"
    known = [each for each in zip(GROUND_AXES, shift.tolist(), sigma.tolist(), strict=True) if np.isfinite(each[1])]
    steps = ", ".join(f"{step:+.2f} m {axis} (standard deviation {own:.2g} m)" for axis, step, own in known)
    return plan, steps, {f"offset_{axis}_m": step for axis, step, _ in known}


def find_shifted_checks(result: Result) -> Iterator[Finding]:
    """Find lists whose check points all lie beside the result by one shift (P411): they must not look wrong one by one.

    Strips that are adjusted one by one are tested together.
    """
    control = result.inputs.control
    lists = dict(zip(control.ids, control.frame.tolist(), strict=True))
    known = [each for each in (() if result.precision is None else result.precision.checks) if each is not None]
    rows = [np.array([lists[each.ids[point]] for point in each.point]) for each in known]
    for number in np.unique(control.frame[control.check]).tolist():
        of_list = [each.take(np.flatnonzero(own == number)) for each, own in zip(known, rows, strict=True)]
        axes, shared = _common_shift([each for each in of_list if each.coordinates])
        if shared is None:
            continue
        shift, sigma = np.full((2, 3), np.nan)
        shift[axes], sigma[axes] = -shared.value, shared.sigma
        plan, steps, evidence = _described(shift, sigma)
        points = [control.ids[row] for row in np.flatnonzero(control.check & (control.frame == number)).tolist()]
        key = f"control[{number}]"
        message = f"the check points of {key} all lie {steps} from where the adjustment puts them"
        fix = f"{OTHER_PLACE if plan else OTHER_HEIGHTS} The control may be off in place of them"
        yield found("P411", message, fix, evidence, points=points, key=key)


def _common_shift(checks: Sequence[CheckErrors]) -> tuple[Numbers, Shared | None]:
    """Test one shift of all check points against none, and against one wrong point; along the axes that are given."""
    axes = np.unique(np.array([axis for each in checks for axis in each.axis], np.intp))
    normal, pull, squares, alone = np.zeros((len(axes), len(axes))), np.zeros(len(axes)), 0.0, 0.0
    for each in checks:
        weight = np.linalg.inv(each.covariance)
        columns, pulled = (each.axis[:, None] == axes).astype(float), weight @ each.difference
        normal, pull = normal + columns.T @ weight @ columns, pull + columns.T @ pulled
        squares += float(each.difference @ pulled)
        for point in np.unique(each.point):
            rows = np.flatnonzero(each.point == point)
            alone = max(alone, float(pulled[rows] @ np.linalg.solve(weight[np.ix_(rows, rows)], pulled[rows])))
    count = sum(each.coordinates for each in checks)
    return axes, significant(normal, pull, squares, count - len(axes), alone)


def other_distance(
    camera: Camera, would_fit: float, message: str, fix: str, numbers: Evidence, strips: Sequence[str]
) -> Finding:
    """Name the principal distance that would fit: a small difference (P107) or a wrong one (P105)."""
    given = camera.principal_distance
    code = "P107" if abs(would_fit / given - 1.0) < LEAST_WRONG else "P105"
    evidence = numbers | {"principal_distance_mm": given, "would_fit_mm": would_fit}
    return found(code, message, fix, evidence, strips=strips, key=f"cameras.{camera.name}.principal_distance")


def _stretched(strip: Strip, stretch: StretchedHeights, then: str) -> Finding:
    given, factor = strip.camera.principal_distance, 1.0 / (1.0 + stretch.share)
    sigma = given * stretch.sigma * factor**2
    message = (
        f"the heights of strip {strip.id} are stretched by {100 * stretch.share:+.2f} % against its control, as by a "
        f"wrong principal distance: {given * factor:.2f} mm would fit (standard deviation {sigma:.2g} mm), "
        f"{given:g} mm is given{then}"
    )
    numbers: Evidence = {"heights_stretched": stretch.share, "standard_deviation_mm": sigma}
    return other_distance(strip.camera, given * factor, message, FIX, numbers, (strip.id,))
