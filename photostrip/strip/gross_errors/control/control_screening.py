"""Wrong control: coordinates that the strip and all other control contradict.

The most significant hypothesis (a point in plan, in height, in both) is deleted and the rest tested again, until
nothing is significant (``control_deletion``). Where the covariance does not explain what is left, the smallest set is
looked for without which it does: wrong coordinates, and bends of the strip beyond it (``candidates``). Where
there is none, what the tests of single points found is all.

Source: derived; data snooping with correlated observations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain
from random import Random

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import PhotostripError
from photostrip.geometry.similarity import similar
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

DRAWN, DRAWS = 3, 200  # points of a similarity, and similarities: of half good points, one in eight is of these alone
KEPT = 5.0  # median residuals within which a point goes with the others
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
        found = search(section)
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


def search(strip: StripAtControl) -> FoundErrors | None:
    """Search for what is wrong in a section; None where its control does not check itself."""
    count = len(strip.coordinates.point)
    if count <= strip.design.shape[1]:
        return None
    first = found = _found(strip)
    if not first or not first[0].left.explained:  # much may be wrong
        kept, full = strip.control.use.copy(), np.flatnonzero(strip.control.use.all(axis=1))
        kept[full] = majority(strip.xyz[full], strip.targets.of_full[full])[:, None]
        much = (_found(strip, much=True, bends=bends) for bends in (True, False))
        found = [*first, *chain.from_iterable(much), *_found(strip, kept)]
    told = [
        each
        for each in found
        if each.whole.allows(each.out) and each.left.squares <= BENT**2 * max(each.left.freedom, 1)
    ]
    if not told:
        return FoundErrors(first[0].whole, ()) if first else None
    # of two equally small explanations the one that blames less control, or explains more
    best = min(
        told, key=lambda each: (not each.left.explained, len(each.out), len(each.coordinates), each.left.squares)
    )
    # where much is wrong, little is left to check the rest of wrong points, and to be lost
    return FoundErrors(best.whole, best.whole.completed(best.out)) if first and best is first[0] else best


def _found(
    strip: StripAtControl, start: Flags | None = None, *, much: bool = False, bends: bool = False
) -> list[FoundErrors]:
    """Search; nothing where the control leaves the strip free, or would without what is suspected."""
    try:
        return [first_search(strip, start, much=much, bends=bends)]
    except (PhotostripError, np.linalg.LinAlgError):
        return []


def first_search(
    strip: StripAtControl, start: Flags | None = None, *, much: bool = False, bends: bool = False
) -> FoundErrors:
    """Take out one after the other, lay the strip on what is kept, and search from there, until the same is found.

    start: (n, 3), coordinates that are kept at first; all, if not said.
    """
    kept, out = strip.control.use if start is None else start, None
    for _ in strip.coordinates.point:
        laid = strip.laid if kept is strip.control.use else strip.laid_on(kept)
        whole = adjust(laid, laid.misclosures(), strip.joint_covariance, bends=bends)
        if out is None:
            place = strip.coordinates
            out = candidates(whole) if much else tuple(np.flatnonzero(~kept[place.point, place.axis]).tolist())
        out = whole.shrunk(whole.grown(whole.shrunk(out)))
        if much:
            out = whole.shrunk(whole.grown(whole.exchanged(out)))
        found = FoundErrors(whole, out)
        before, kept = kept, kept_of(strip, found)
        if np.array_equal(before, kept):
            break
    return found


def majority(strip: Floats, given: Floats) -> Flags:
    """Points (n,) without those that the similarity which fits half of them best leaves farthest.

    Similarities through three points are drawn, that whose median residual is least is taken. Errors of many points
    turn a similarity of all of them so far that the least sum of squares lies elsewhere.

    strip, given: (n, 3), strip and Cartesian coordinates.
    Source: [Rousseeuw 1984].
    """
    if len(strip) <= DRAWN:
        return np.ones(len(strip), bool)
    draw = Random(len(strip))  # noqa: S311 (the same for the same number)
    triples = np.array([draw.sample(range(len(strip)), DRAWN) for _ in range(DRAWS)])
    off = np.linalg.norm(given - similar(strip[triples], given[triples], strip), axis=2)
    half = np.partition(off, len(strip) // 2, axis=1)[:, len(strip) // 2]
    best = int(half.argmin())
    return np.asarray(off[best] <= KEPT * half[best], bool)


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
