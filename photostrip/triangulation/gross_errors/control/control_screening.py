"""Wrong control: coordinates that the strip and all other control contradict.

A wrong coordinate pulls the similarity, and a polynomial bends towards it. It is therefore tested by what the others
predict: its residual against a polynomial of the highest degree that the control carries, divided by the share of it
that the fit leaves (its redundancy number), in units of the scatter of the others. Very large errors go first, by a
similarity that minimises absolute residuals. Two large ones that fit exchanged are named as an exchange.

A strip bends as a whole: control of one band that agrees in itself and contradicts the other bands shows the bend, not
an error. Where the covariance of the strip is known, and the strip is bent no more than it allows, that covariance says
what belongs to the bend (``control_significance``). Otherwise the deformation is a polynomial,
and a coordinate is rejected only against a witness, another point of its own band that stays.

Source: data snooping after a robust start; derived, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError, PhotostripError
from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.absolute_orientation import Targets
from photostrip.triangulation.gross_errors.control import control_significance, control_subsets
from photostrip.triangulation.gross_errors.control.control_rejections import control_rejections
from photostrip.triangulation.gross_errors.control.strip_at_control import (
    ALPHA,
    richest_polynomial,
    tests_by_kept,
    tests_by_polynomial,
)
from photostrip.triangulation.polynomial import terms as polynomial_terms

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats
    from photostrip.points import ControlPoints
    from photostrip.triangulation.gross_errors.control.control_rejections import ControlRejection
    from photostrip.triangulation.gross_errors.control.strip_at_control import StripAtControl


LARGEST_SHARE = 0.45  # of the control coordinates of plan or height that may be far off
LARGEST_TESTED = 0.34  # of the others that single tests may reject
CONSPICUOUS = 6.0  # largest over median misclosure that asks for a robust start
FAR_OFF_SIGMAS = 12.0  # standard deviations from the median, in the robust start
ROBUST_STEPS = 20
ROBUST_CHANGE = 0.1  # of the median misclosure: the robust start is to find large errors, not digits
ROUGH = 5.0  # standard deviations left by a polynomial beyond which there is more than a bend
ALIKE = 0.1  # spread of misclosures of a band over their mean, below which they are one bend
PLAN = slice(0, 2)


def screen_control(control: ControlPoints, strip: StripAtControl) -> tuple[ControlPoints, tuple[ControlRejection, ...]]:
    """Take wrong coordinates out of the control of a strip: ``use`` becomes false where a coordinate was rejected."""
    try:
        start = _without(control, _gross(control, strip))
        strip, kept = _snooped(control, start, strip)
        if np.array_equal(kept.use, control.use):
            return control, ()
        kept = _readmitted(control, kept, strip)
        return kept, control_rejections(control, kept, strip)
    except PhotostripError:
        # without the suspected coordinates the strip hangs free: nothing can be said against them
        return control, ()


def _without(control: ControlPoints, out: Flags) -> ControlPoints:
    return replace(control, use=control.use & ~out)


def _gross(control: ControlPoints, strip: StripAtControl) -> Flags:
    """Find coordinates far from a similarity of least absolute misclosures."""
    nothing = np.zeros(control.use.shape, bool)
    targets = Targets(control, strip.frames, strip.intermediate)
    weight = control.use.astype(float)
    result = strip.oriented(control)
    size = np.abs(result.misclosures)
    if size[control.use].max() < CONSPICUOUS * np.median(size[control.use]):
        return nothing
    for _ in range(ROBUST_STEPS):
        floor = max(float(np.median(size[control.use])), 1e-6)
        result = absolute_orientation.orient(strip.xyz, targets, weight / np.maximum(size / floor, 1.0) * control.use)
        before, size = size, np.abs(result.misclosures)
        if np.abs(size - before).max() < ROBUST_CHANGE * floor:
            break
    scatter = SIGMA_FROM_MEDIAN * np.array(
        [np.median(size[:, axes][control.use[:, axes]]) for axes in ([0, 1], [0, 1], [2])]
    )
    far = np.array(control.use & (size > FAR_OFF_SIGMAS * scatter), bool)
    far[:, PLAN] = far[:, PLAN].any(axis=1, keepdims=True) & control.use[:, PLAN]
    far &= _witnessed(result.similarity(strip.xyz)[:, 0], strip.spacing, control.use & ~far)
    return far if _enough(control, far) else nothing


def _witnessed(x: Floats, spacing: float, kept: Flags) -> Flags:
    """Whether another point of the same band gives the same coordinate and is kept."""
    group = polynomial_terms.bands(x, spacing)
    total = np.zeros((int(group.max()) + 1, 3), np.intp)
    np.add.at(total, group, kept)
    return np.array(total[group] - kept > 0, bool)


def _enough(control: ControlPoints, out: Flags, share: float = LARGEST_SHARE) -> bool:
    """Whether few enough coordinates of plan and of height are suspected."""
    given, suspected = control.use, control.use & out
    return all(suspected[:, axes].sum() <= share * given[:, axes].sum() for axes in (PLAN, slice(2, 3)))


def _snooped(
    control: ControlPoints, start: ControlPoints, strip: StripAtControl
) -> tuple[StripAtControl, ControlPoints]:
    """Take out what is wrong; by polynomials where the covariance does not explain the misclosures of most control.

    Where neither the covariance nor a polynomial explains what is left, more may be wrong than single tests can find:
    the better half of the control is looked for, and believed when the covariance explains it.
    """
    kept = _snoop(start, strip)
    if strip.covariance is None or _fit(kept, strip) < control_significance.BENT:
        return strip, kept
    bent = replace(strip, covariance=None)
    by_polynomial = _snoop(start, bent)
    if _smooth(by_polynomial, bent):
        return bent, by_polynomial
    half = _better_half(control, kept, strip)
    return (bent, by_polynomial) if half is None else (strip, half)


def _fit(kept: ControlPoints, strip: StripAtControl) -> float:
    """Return the standard deviation of unit weight of control by the covariance of the strip."""
    return control_significance.predict_control(_covariance(strip), strip.misclosures(kept), kept.use, ALPHA).sigma0


def _smooth(kept: ControlPoints, strip: StripAtControl) -> bool:
    """Whether a polynomial explains the misclosures, or nobody can tell."""
    problem = strip.problem(kept)
    fit = richest_polynomial(problem)
    if fit is None:
        return True
    expected = 1 / np.sqrt(problem.weight.max(axis=0))
    return all(axis.sigma0 < ROUGH * float(expected[k]) for k, axis in enumerate(fit.axes))


def _better_half(control: ControlPoints, kept: ControlPoints, strip: StripAtControl) -> ControlPoints | None:
    """Control that agrees with the similarity that suits most of it; None when the covariance does not explain it."""
    targets = Targets(control, strip.frames, strip.intermediate)
    first = absolute_orientation.orient(strip.xyz, targets, kept.use.astype(float))
    weight = absolute_orientation.weights(targets.turned(first.similarity(strip.xyz)), strip.precision)
    try:
        out, _ = control_subsets.far(strip.xyz, targets, weight, first.similarity)
        if not _enough(control, out):
            return None
        half = _snoop(_without(control, out), strip)
        believed = _fit(half, strip) < control_significance.BENT and not _bends(control, half, strip)
    except GeometryError:
        return None
    return half if believed else None


def _bends(control: ControlPoints, half: ControlPoints, strip: StripAtControl) -> bool:
    """Whether a whole band of two points or more is rejected, and its misclosures agree: a bend, not an error."""
    gap = strip.misclosures(half, control)
    band = polynomial_terms.bands(strip.placed(half)[:, 0], strip.spacing)
    for number in range(int(band.max()) + 1):
        for axis in range(3):
            rows = (band == number) & control.use[:, axis]
            size = gap[rows, axis]
            if len(size) > 1 and not half.use[rows, axis].any() and np.ptp(size) < ALIKE * abs(size.mean()):
                return True
    return False


def _snoop(control: ControlPoints, strip: StripAtControl) -> ControlPoints:
    """Take out the worst coordinate, fit again, until none is beyond its limit."""
    kept = control
    while True:
        ratio = _by_covariance(kept, strip) if strip.covariance is not None else _by_polynomial(kept, strip)
        row = int(ratio.max(axis=1).argmax())
        out = np.zeros(kept.use.shape, bool)
        axis = int(ratio[row].argmax())
        # a point with half of its plan position left would bend the fit
        out[row, PLAN if axis < 2 else axis] = True
        if ratio.max() <= 1 or not _enough(control, ~kept.use | out, LARGEST_TESTED):
            return kept
        kept = _without(kept, out)


def _by_covariance(kept: ControlPoints, strip: StripAtControl) -> Floats:
    """Test values over limits by the covariance of the strip; 0 for coordinates that take no part."""
    found = control_significance.predict_control(_covariance(strip), strip.misclosures(kept), kept.use, ALPHA)
    return np.where(kept.use, found.value / found.limit, 0.0)


def _covariance(strip: StripAtControl) -> control_significance.ControlCovariance:
    if strip.covariance is None:
        msg = "no covariance"
        raise ValueError(msg)
    return strip.covariance


def _by_polynomial(kept: ControlPoints, strip: StripAtControl) -> Floats:
    """Test values over limits by the richest polynomial, of coordinates that have a witness."""
    problem = strip.problem(kept)
    fit = richest_polynomial(problem)
    if fit is None:
        return np.zeros(kept.use.shape)
    tests = tests_by_polynomial(problem, fit)
    return np.where(_witnessed(problem.xyz[:, 0], strip.spacing, kept.use), tests.value / tests.limit, 0.0)


def _readmitted(control: ControlPoints, kept: ControlPoints, strip: StripAtControl) -> ControlPoints:
    """Take back coordinates that the final fit predicts after all."""
    tests = tests_by_kept(control, kept, strip)
    good = np.array(tests.value <= tests.limit, bool)
    good[:, PLAN] = (good | ~control.use)[:, PLAN].all(axis=1, keepdims=True)
    return replace(kept, use=kept.use | (control.use & good))
