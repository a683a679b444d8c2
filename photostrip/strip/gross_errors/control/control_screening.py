"""Wrong control: coordinates that the strip and all other control contradict.

The most significant hypothesis (a point in plan, in height, in both) is deleted and the rest tested again, until
nothing is significant (``control_deletion``). Where the covariance does not explain what is left, the smallest set is
looked for without which it does: wrong coordinates, and bends of the strip beyond it (``candidates``). Where
there is none, what the tests of single points found is all.

Source: derived; data snooping with correlated observations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import PhotostripError
from photostrip.points import ControlPoints
from photostrip.rejection import Rejection
from photostrip.strip.error_propagation.strip_at_control import StripAtControl
from photostrip.strip.gross_errors.control.control_deletion import (
    Columns,
    JointAdjustment,
    adjust,
    independent,
    projected,
)
from photostrip.strip.gross_errors.control.control_rejections import (
    FoundErrors,
    control_rejections,
    kept_of,
    reliability,
)

BENT = 2.5  # standard deviation of unit weight beyond which more is wrong with a strip than its control


@dataclass(frozen=True, eq=False)
class ScreenedControl:
    """The control of a strip with ``use`` false where a coordinate was rejected."""

    kept: ControlPoints
    rejections: tuple[Rejection, ...]  # rows of the control
    # how far the others check each coordinate (n, 3): redundancy number, and smallest error in metres that is found in
    # 80 % of cases, infinite where none is; NaN without a test
    redundancy: Floats
    detectable: Floats


def screen_control(strip: StripAtControl) -> ScreenedControl:
    """Take wrong coordinates out of the control of a strip."""
    use, rejections = strip.control.use.copy(), []
    redundancy, detectable = np.full((2, *use.shape), np.nan)
    for rows, section in strip.sections:
        try:
            found = _searched(section)
        except (PhotostripError, np.linalg.LinAlgError):
            # the control of the section leaves it free, or would without what is suspected: nothing is said against it
            continue
        if found is not None:
            use[rows] = kept_of(section, found)
            rejections += control_rejections(section, found, rows)
            redundancy[rows], detectable[rows] = reliability(section, found)
    rejections.sort(key=lambda each: each.row)
    return ScreenedControl(
        kept=replace(strip.control, use=use),
        rejections=tuple(rejections),
        redundancy=redundancy,
        detectable=detectable,
    )


def not_screened(control: ControlPoints) -> ScreenedControl:
    unknown = np.full(control.use.shape, np.nan)
    return ScreenedControl(kept=control, rejections=(), redundancy=unknown, detectable=unknown)


def _searched(strip: StripAtControl) -> FoundErrors | None:
    """Search for what is wrong in a section; None where its control does not check itself."""
    count = len(strip.coordinates.point)
    if count <= strip.design.shape[1]:
        return None
    found = [_laid(strip)]
    if not found[0].left.explained:  # much may be wrong
        found += [_laid(strip, much=True, bends=bends) for bends in (True, False)]
    told = [
        each
        for each in found
        if each.whole.allows(each.out) and each.left.squares <= BENT**2 * max(each.left.freedom, 1)
    ]
    # of two equally small explanations the one that blames less control, or explains more
    best = min(
        told,
        key=lambda each: (not each.left.explained, len(each.out), len(each.coordinates), each.left.squares),
        default=FoundErrors(found[0].whole, ()),
    )
    # where much is wrong, little is left to check the rest of wrong points, and to be lost
    return FoundErrors(best.whole, best.whole.completed(best.out)) if best is found[0] else best


def _laid(strip: StripAtControl, *, much: bool = False, bends: bool = False) -> FoundErrors:
    """Search, lay the strip on what is kept, and search from what was found, until the same is found."""
    kept, out = strip.control.use, None
    for _ in strip.coordinates.point:
        laid = strip.laid if kept is strip.control.use else strip.laid_on(kept)
        whole = adjust(laid, laid.misclosures(), strip.joint_covariance, bends=bends)
        if out is None:
            out = candidates(whole) if much else ()
        out = whole.shrunk(whole.grown(whole.shrunk(out)))
        if much:
            out = whole.shrunk(whole.grown(whole.exchanged(out)))
        found = FoundErrors(whole, out)
        before, kept = kept, kept_of(strip, found)
        if np.array_equal(before, kept):
            break
    return found


def candidates(whole: JointAdjustment) -> Columns:
    """Columns whose own variance exceeds that with which all others predict them; as many as leave a check.

    Errors that hide each other are found by no test of single points. So plan and height of every point, and every bend
    of the strip, get a variance of their own beside the covariance of the misclosures. All begin as large as the
    largest misclosure, and each is multiplied by its own test value, the root of (M w)_K^T (M w)_K / tr M_KK, as often
    as there are parts (by the square, as in the source, into worse sets). Source: [Förstner 1979].
    """
    part = np.concatenate([np.full(len(columns), number) for number, columns in enumerate(whole.parts)])
    columns = np.concatenate([np.array(columns) for columns in whole.parts])
    errors = whole.errors[:, columns]
    variance = np.full(len(whole.parts), float(np.abs(whole.w).max() ** 2 + whole.covariance.max()))
    for _ in whole.parts:
        covariance = whole.covariance + (errors * variance[part]) @ errors.T
        projector = projected(independent(covariance), whole.design)
        squares = np.bincount(part, (errors.T @ (projector @ whole.w)) ** 2)
        expected = np.bincount(part, np.einsum("ij,ij->j", errors, projector @ errors))
        # of what nothing checks, rounding leaves less than nothing
        variance *= np.sqrt(np.divide(squares, expected, out=np.ones_like(squares), where=expected > 0.0))
    predicted = np.bincount(part, (whole.matrix.diagonal() * whole.size**2)[columns]) / np.bincount(part)
    share = variance * predicted
    found: list[int] = []
    for number in np.argsort(-share, kind="stable").tolist():
        if share[number] <= 1 or len(found) + len(whole.parts[number]) >= whole.freedom:
            break
        found += whole.parts[number]
    return tuple(found)
