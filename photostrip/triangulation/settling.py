"""The strip formed, judged and formed again, until what is left out no longer changes.

Source: derived; see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.triangulation import bridging, formation, relative, strip_screening
from photostrip.triangulation.strip_screening import SEVERAL, Scene, Verdict
from photostrip.triangulation.zones import MINIMUM_LEFT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.points import PhotoPoints
    from photostrip.triangulation.formation import FormedStrip
    from photostrip.triangulation.relative import Orientation
    from photostrip.triangulation.screening import Rejection

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

PASSES = 4  # most of the strips settle in the second


@dataclass(frozen=True, eq=False)
class Measured:
    """What a strip is formed from, beside its oriented pairs.

    Parameters
    ----------
    observations : PhotoPoints
        Image points.
    photos : sequence of str
        Photos of the strip in flight order.
    weight : ndarray, shape (m,)
        Weights of the pairs' rows before anything was rejected.
    sigma : ndarray, shape (p,)
        Standard deviations of a y parallax of weight one in each pair, mm.
    stated : float
        Stated standard deviation of an image coordinate, mm.
    kept : ndarray of int
        Rows of the observations that the user keeps.
    """

    observations: PhotoPoints
    photos: Sequence[str]
    weight: Floats
    sigma: Floats
    stated: float
    kept: Numbers


def settle(
    oriented: Orientation, measured: Measured, settings: formation.Settings, *, readmit: bool
) -> tuple[Orientation, FormedStrip, Verdict]:
    """Form a strip, leave out what its points contradict, take back what they confirm, and form it again.

    Parameters
    ----------
    oriented : Orientation
        Pairs as their own search for gross errors leaves them.
    measured : Measured
        Measurements.
    settings : formation.Settings
        Form of the scale transfer.
    readmit : bool
        Whether points that a pair rejected may be taken back.

    Returns
    -------
    Orientation
        The pairs with what the strip decided.
    FormedStrip
        The strip; points without a ray left are gone.
    Verdict
        What was left out.

    Raises
    ------
    GeometryError
        When a joint is broken.
    """
    of_pairs = oriented
    suspected = np.zeros(0, np.intp)
    verdict: Verdict | None = None
    aside = np.zeros(len(oriented.point), bool)
    formed = formation.form(oriented, settings, measured.photos, measured.sigma)
    for _ in range(PASSES):
        scene = Scene(oriented, formed, measured.observations, measured.photos, measured.sigma, measured.stated)
        suspected = np.union1d(suspected, strip_screening.suspects(scene)).astype(np.intp)
        verdict = strip_screening.examine(scene, suspected, measured.kept, verdict)
        used, outside = _uses(of_pairs, verdict, readmit=readmit)
        if (used == oriented.used).all() and (outside == aside).all():
            break
        try:
            oriented, formed = _formed_again(oriented, used, outside, measured, settings)
        except GeometryError:
            break  # nothing would join two models: what joined them before stays
        aside = outside
    formed, verdict = formation.without(formed, oriented, aside), verdict or Verdict()
    return oriented, _bridged(formed, oriented, measured, verdict), verdict


def _formed_again(
    oriented: Orientation, used: Flags, aside: Flags, measured: Measured, settings: formation.Settings
) -> tuple[Orientation, FormedStrip]:
    """Orient the pairs whose points changed, and form the strip."""
    changed = np.unique(oriented.pairs.pair[used != oriented.used])
    if len(changed):
        oriented = relative.refine(oriented, np.where(used, measured.weight, 0.0), changed)
    return oriented, formation.form(oriented, settings, measured.photos, measured.sigma, aside)


def _bridged(formed: FormedStrip, oriented: Orientation, measured: Measured, verdict: Verdict) -> FormedStrip:
    """Add the points whose good rays come from photos that are no neighbours."""
    missing = np.isin(oriented.point, np.setdiff1d(verdict.judged, formed.point))
    good = np.setdiff1d(oriented.rows[missing], verdict.wrong)
    return bridging.bridge(formed, measured.observations, measured.photos, oriented.pairs.focal, good)


def _uses(of_pairs: Orientation, verdict: Verdict, *, readmit: bool) -> tuple[Flags, Flags]:
    """Rows of the pairs' table that orient their pair, and those of them that must not place their point.

    Where it cannot be told which of several rays is wrong, those pairs that found nothing wrong keep the point: its
    y parallaxes are good, its place is not.
    """
    judged = np.isin(of_pairs.point, verdict.judged)
    gone = np.isin(of_pairs.rows, verdict.wrong).any(axis=1)
    unclear = [kind == SEVERAL and bool(across) for kind, across in zip(verdict.kind, verdict.across, strict=True)]
    aside: Flags = np.isin(of_pairs.rows, verdict.wrong[np.array(unclear, bool)]).any(axis=1).astype(bool)
    used = np.where(judged, np.where(aside, of_pairs.used, ~gone), of_pairs.used)
    if not readmit:
        used &= of_pairs.used
    return _supported(of_pairs, used), aside


def _supported(of_pairs: Orientation, used: Flags) -> Flags:
    """Let pairs that would lose too many points keep those of their own search."""
    pairs = of_pairs.pairs
    left = pairs.sums(used.astype(float))
    had = pairs.sums(of_pairs.used.astype(float))
    poor = (left < np.minimum(MINIMUM_LEFT, had))[pairs.pair]
    result: Flags = np.where(poor, of_pairs.used, used)
    return result


def taken_back(rejections: Sequence[Rejection], used: Flags) -> tuple[Rejection, ...]:
    """Mark the rejections of pairs that the strip took back.

    Parameters
    ----------
    rejections : sequence of Rejection
        Log of the pairs.
    used : ndarray of bool, shape (m,)
        Rows of the pairs' table that are used in the end.

    Returns
    -------
    tuple of Rejection
        The same, re-admitted ones marked.
    """
    return tuple(replace(each, readmitted=bool(used[each.row])) for each in rejections)
