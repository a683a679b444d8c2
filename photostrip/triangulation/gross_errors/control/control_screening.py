"""Wrong control: coordinates that the strip and all other control contradict.

A wrong coordinate pulls the similarity, and a polynomial bends towards it. It is therefore judged by what the others
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

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError, PhotostripError
from photostrip.statistics import SIGMA_FROM_MEDIAN, t_quantile
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.absolute_orientation import Targets
from photostrip.triangulation.gross_errors.control import control_significance, control_subsets
from photostrip.triangulation.polynomial import correction
from photostrip.triangulation.polynomial import terms as polynomial_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.points import ControlPoints

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

ALPHA = 0.01  # of rejecting anything in a strip without wrong control
LEAST_REDUNDANCY = 3  # of plan and of height, for a test
SEEN = 0.05  # redundancy number below which a coordinate cannot be judged
LARGEST_SHARE = 0.45  # of the control coordinates of plan or height that may be far off
LARGEST_TESTED = 0.34  # of the others that single tests may reject
CONSPICUOUS = 6.0  # largest over median misclosure that asks for a robust start
GROSS = 12.0  # standard deviations from the median, in the robust start
ROBUST_STEPS = 20
SETTLED = 0.1  # of the median misclosure: the robust start is to find large errors, not digits
ROUGH = 5.0  # standard deviations left by a polynomial beyond which there is more than a bend
ALIKE = 0.1  # spread of misclosures of a band over their mean, below which they are one bend
EXCHANGED = 0.2  # misclosures left by an exchange, over those before
AXES = ("east", "north", "up")
PLAN = slice(0, 2)


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


@dataclass(frozen=True, eq=False)
class StripAtControl:
    """Where a strip stands when its control is examined."""

    strip: Floats  # (n, 3): strip coordinates of the control points
    frames: Sequence[GroundFrame]
    intermediate: IntermediateFrame
    precision: tuple[float, float]  # a-priori standard deviation of a strip point in plan and height, metres
    # spacing, breadth: as in ``correction.FitProblem``
    spacing: float
    breadth: float
    # covariance of all misclosures; without it polynomials stand for the strip's deformation
    joint: control_significance.ControlCovariance | None = None
    # similarities found so far, by the coordinates that count
    found: dict[bytes, absolute_orientation.AbsoluteOrientation] = field(default_factory=dict, repr=False)

    def oriented(self, kept: ControlPoints) -> absolute_orientation.AbsoluteOrientation:
        """Return the similarity on what is kept, all coordinates with the same weight; each choice is fitted once."""
        key = kept.use.tobytes()
        if key not in self.found:
            targets = Targets(kept, self.frames, self.intermediate)
            self.found[key] = absolute_orientation.orient(self.strip, targets, kept.use.astype(float))
        return self.found[key]

    def problem(self, control: ControlPoints) -> correction.FitProblem:
        """Fit the similarity, and give what is left to a polynomial."""
        targets = Targets(control, self.frames, self.intermediate)
        weight = absolute_orientation.weights(targets.turned(self.placed(control)), self.precision)
        orientation = absolute_orientation.orient(self.strip, targets, weight)
        return correction.FitProblem(orientation.similarity(self.strip), targets, weight, self.spacing, self.breadth)

    def placed(self, kept: ControlPoints) -> Floats:
        """Return all control points after a similarity on what is kept, intermediate frame, metres."""
        return self.oriented(kept).similarity(self.strip)

    def misclosures(self, kept: ControlPoints, control: ControlPoints | None = None) -> Floats:
        """Misclosures of all control after a similarity on what is kept, metres along the ground axes."""
        return Targets(control or kept, self.frames, self.intermediate).misclosures(self.placed(kept))

    def judged(self, control: ControlPoints, kept: ControlPoints) -> control_significance.ControlTests | None:
        """Judge all control by what is kept with the covariance of the strip; None without one."""
        if self.joint is None or len(self.joint.point) != int(control.use.sum()):
            return None
        return control_significance.predict_control(self.joint, self.misclosures(kept, control), kept.use, ALPHA)


def screen_control(
    control: ControlPoints, setting: StripAtControl
) -> tuple[ControlPoints, tuple[ControlRejection, ...]]:
    """Take wrong coordinates out of the control.

    Parameters
    ----------
    control : ControlPoints
        Control of a strip, no check points.

    Returns
    -------
    ControlPoints
        The same points with ``use`` false where a coordinate was rejected.
    tuple of ControlRejection
        What was rejected, in order of the control.
    """
    try:
        start = _without(control, _gross(control, setting))
        setting, kept = _snooped(control, start, setting)
        if np.array_equal(kept.use, control.use):
            return control, ()
        kept = _taken_back(control, kept, setting)
        return kept, _log(control, kept, setting)
    except PhotostripError:
        # without the suspected coordinates the strip hangs free: nothing can be said against them
        return control, ()


def _without(control: ControlPoints, out: Flags) -> ControlPoints:
    return replace(control, use=control.use & ~out)


def _gross(control: ControlPoints, setting: StripAtControl) -> Flags:
    """Find coordinates far from a similarity of least absolute misclosures."""
    nothing = np.zeros(control.use.shape, bool)
    targets = Targets(control, setting.frames, setting.intermediate)
    weight = control.use.astype(float)
    result = setting.oriented(control)
    size = np.abs(result.misclosures)
    if size[control.use].max() < CONSPICUOUS * np.median(size[control.use]):
        return nothing
    for _ in range(ROBUST_STEPS):
        floor = max(float(np.median(size[control.use])), 1e-6)
        result = absolute_orientation.orient(
            setting.strip, targets, weight / np.maximum(size / floor, 1.0) * control.use
        )
        before, size = size, np.abs(result.misclosures)
        if np.abs(size - before).max() < SETTLED * floor:
            break
    scatter = SIGMA_FROM_MEDIAN * np.array(
        [np.median(size[:, axes][control.use[:, axes]]) for axes in ([0, 1], [0, 1], [2])]
    )
    far = np.array(control.use & (size > GROSS * scatter), bool)
    far[:, PLAN] = far[:, PLAN].any(axis=1, keepdims=True) & control.use[:, PLAN]
    far &= _witnessed(result.similarity(setting.strip)[:, 0], setting.spacing, control.use & ~far)
    return far if _enough(control, far) else nothing


def _witnessed(x: Floats, spacing: float, kept: Flags) -> Flags:
    """Whether another point of the same band gives the same coordinate and is kept."""
    group = polynomial_terms.bands(x, spacing)
    total = np.zeros((int(group.max()) + 1, 3), np.intp)
    np.add.at(total, group, kept)
    return np.array(total[group] - kept > 0, bool)


def _together(axis: int) -> list[int]:
    """Coordinates that go with a wrong one: a point with half of its plan position left would bend the fit."""
    return [0, 1] if axis < 2 else [axis]


def _enough(control: ControlPoints, out: Flags, share: float = LARGEST_SHARE) -> bool:
    """Whether few enough coordinates of plan and of height are suspected."""
    given, suspected = control.use, control.use & out
    return all(suspected[:, axes].sum() <= share * given[:, axes].sum() for axes in (PLAN, slice(2, 3)))


def _richest(problem: correction.FitProblem) -> correction.Polynomial | None:
    """Polynomial of the highest degree that leaves redundancy in every axis; None when there is none."""
    for degree in ("3", "2", "1"):
        fit = correction.fit(problem, correction.PolynomialSettings(degree))
        if all(axis.terms and axis.redundancy >= LEAST_REDUNDANCY for axis in fit.axes):
            return fit
    return None


def judged(problem: correction.FitProblem, fit: correction.Polynomial) -> tuple[Floats, Floats, Floats, Floats]:
    """Judge every control coordinate by what the others predict.

    Returns
    -------
    value, limit : ndarray, shape (n, 3)
        Test values and critical values along east, north, up; value 0 where nothing can be said.
    size : ndarray, shape (n, 3)
        Given minus predicted, metres.
    redundancy : ndarray, shape (n, 3)
        Redundancy numbers of the coordinates, 0 to 1.
    """
    use = problem.targets.control.use
    rest = np.column_stack([1 - axis.leverage for axis in fit.axes])
    residual = np.column_stack([axis.residuals for axis in fit.axes])
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = np.where(rest > SEEN, residual / rest, 0.0)
    expected = 1 / np.sqrt(np.where(problem.by_axis > 0, problem.by_axis, np.inf))
    groups = ((0, 1), (0, 1), (2,))
    spread, freedom = np.empty_like(residual), np.empty(3)
    for axis, group in enumerate(groups):
        counted = problem.by_axis[:, group] > 0
        total = sum(fit.axes[k].redundancy for k in group)
        squares = (residual[:, group] ** 2).sum()
        own = (residual[:, group] ** 2 / np.maximum(rest[:, group], SEEN) * counted).sum(axis=1)
        freedom[axis] = max(total - len(group), 1)
        spread[:, axis] = np.sqrt(np.maximum(squares - own, 0.0) / freedom[axis])
    deviation = np.maximum(spread, expected) / np.sqrt(np.maximum(rest, SEEN))
    axes = problem.targets.axes(problem.xyz)
    size = -np.einsum("nij,nj->ni", axes, predicted)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.abs(size) / np.sqrt(np.einsum("nij,nj->ni", axes**2, deviation**2))
    redundancy = np.einsum("nij,nj->ni", axes**2, np.clip(rest, 0.0, 1.0))
    tail = ALPHA / (2 * int(use.sum()))
    limit = np.array([t_quantile(1 - tail, dof) for dof in freedom])
    seen = use & (redundancy > SEEN) & np.isfinite(value)
    return np.where(seen, value, 0.0), np.broadcast_to(limit, value.shape), size, redundancy


def _snooped(
    control: ControlPoints, start: ControlPoints, setting: StripAtControl
) -> tuple[StripAtControl, ControlPoints]:
    """Take out what is wrong; by polynomials where the covariance does not explain the misclosures of most control.

    Where neither the covariance nor a polynomial explains what is left, more may be wrong than single tests can find:
    the better half of the control is looked for, and believed when the covariance explains it.
    """
    kept = _snoop(start, setting)
    if setting.joint is None or _fit(kept, setting) < control_significance.BENT:
        return setting, kept
    bent = replace(setting, joint=None)
    by_polynomial = _snoop(start, bent)
    if _smooth(by_polynomial, bent):
        return bent, by_polynomial
    half = _better_half(control, kept, setting)
    return (bent, by_polynomial) if half is None else (setting, half)


def _fit(kept: ControlPoints, setting: StripAtControl) -> float:
    """Return the standard deviation of unit weight of control by the covariance of the strip."""
    return control_significance.predict_control(_joint(setting), setting.misclosures(kept), kept.use, ALPHA).sigma0


def _smooth(kept: ControlPoints, setting: StripAtControl) -> bool:
    """Whether a polynomial explains the misclosures, or nobody can tell."""
    problem = setting.problem(kept)
    fit = _richest(problem)
    if fit is None:
        return True
    expected = 1 / np.sqrt(problem.weight.max(axis=0))
    return all(axis.sigma0 < ROUGH * float(expected[k]) for k, axis in enumerate(fit.axes))


def _better_half(control: ControlPoints, kept: ControlPoints, setting: StripAtControl) -> ControlPoints | None:
    """Control that agrees with the similarity that suits most of it; None when the covariance does not explain it."""
    targets = Targets(control, setting.frames, setting.intermediate)
    first = absolute_orientation.orient(setting.strip, targets, kept.use.astype(float))
    weight = absolute_orientation.weights(targets.turned(first.similarity(setting.strip)), setting.precision)
    try:
        out, _ = control_subsets.far(setting.strip, targets, weight, first.similarity)
        if not _enough(control, out):
            return None
        half = _snoop(_without(control, out), setting)
        believed = _fit(half, setting) < control_significance.BENT and not _bends(control, half, setting)
    except GeometryError:
        return None
    return half if believed else None


def _bends(control: ControlPoints, half: ControlPoints, setting: StripAtControl) -> bool:
    """Whether a whole band of two points or more is rejected, and its misclosures agree: a bend, not an error."""
    gap = setting.misclosures(half, control)
    band = polynomial_terms.bands(setting.placed(half)[:, 0], setting.spacing)
    for number in range(int(band.max()) + 1):
        for axis in range(3):
            rows = (band == number) & control.use[:, axis]
            size = gap[rows, axis]
            if len(size) > 1 and not half.use[rows, axis].any() and np.ptp(size) < ALIKE * abs(size.mean()):
                return True
    return False


def _snoop(control: ControlPoints, setting: StripAtControl) -> ControlPoints:
    """Take out the worst coordinate, fit again, until none is beyond its limit."""
    kept = control
    while True:
        ratio = _by_covariance(kept, setting) if setting.joint is not None else _by_polynomial(kept, setting)
        row = int(ratio.max(axis=1).argmax())
        out = np.zeros(kept.use.shape, bool)
        out[row, _together(int(ratio[row].argmax()))] = True
        if ratio.max() <= 1 or not _enough(control, ~kept.use | out, LARGEST_TESTED):
            return kept
        kept = _without(kept, out)


def _by_covariance(kept: ControlPoints, setting: StripAtControl) -> Floats:
    """Test values over limits by the covariance of the strip; 0 for coordinates that take no part."""
    found = control_significance.predict_control(_joint(setting), setting.misclosures(kept), kept.use, ALPHA)
    return np.where(kept.use, found.value / found.limit, 0.0)


def _joint(setting: StripAtControl) -> control_significance.ControlCovariance:
    if setting.joint is None:
        msg = "no covariance"
        raise ValueError(msg)
    return setting.joint


def _by_polynomial(kept: ControlPoints, setting: StripAtControl) -> Floats:
    """Test values over limits by the richest polynomial, of coordinates that have a witness."""
    problem = setting.problem(kept)
    fit = _richest(problem)
    if fit is None:
        return np.zeros(kept.use.shape)
    value, limit, _, _ = judged(problem, fit)
    return np.where(_witnessed(problem.xyz[:, 0], setting.spacing, kept.use), value / limit, 0.0)


def _predicted(
    control: ControlPoints, kept: ControlPoints, setting: StripAtControl
) -> tuple[Floats, Floats, Floats, Floats]:
    """Judge all given coordinates, the rejected ones too, by those that are kept."""
    if setting.joint is not None:
        found = control_significance.predict_control(setting.joint, setting.misclosures(kept, control), kept.use, ALPHA)
        return found.value, found.limit, found.size, found.redundancy
    problem = setting.problem(kept)
    fit = _richest(problem)
    if fit is None:
        nothing = np.zeros(control.use.shape)
        return nothing, nothing + 1, nothing, nothing
    value, limit, size, redundancy = judged(problem, fit)
    given = Targets(control, setting.frames, setting.intermediate)
    corrected = fit(problem.xyz)
    out = control.use & ~kept.use
    gap = -np.einsum("nij,nj->ni", given.axes(corrected), corrected - given.of(corrected))
    expected = 1 / np.sqrt(problem.weight.max(axis=0))
    sigma0 = np.array([max(fit.axes[k].sigma0, float(expected[k])) for k in range(3)])
    columns = [_leverages(problem, axis.terms, problem.by_axis[:, k]) for k, axis in enumerate(fit.axes)]
    spread = sigma0 * np.sqrt(1 + np.column_stack(columns))
    turned = np.sqrt(np.einsum("nij,nj->ni", given.axes(corrected) ** 2, spread**2))
    value = np.where(out, np.abs(gap) / turned, value)
    return value, limit, np.where(out, gap, size), np.where(out, 1.0, redundancy)


def _leverages(problem: correction.FitProblem, terms: Sequence[str], weight: Floats) -> Floats:
    """Variance of the fit at every point in units of that of a coordinate of mean weight, shape (n,)."""
    x, y = problem.xyz[:, 0] / problem.sizes.reach, problem.xyz[:, 1] / problem.breadth
    columns = np.column_stack([x**i * y**j for i, j in (polynomial_terms.POWERS[term] for term in terms)])
    used = weight > 0
    design = columns[used] * np.sqrt(weight[used] / weight[used].mean())[:, None]
    cofactors = np.linalg.pinv(design.T @ design, hermitian=True)
    return np.asarray(np.einsum("ni,ij,nj->n", columns, cofactors, columns), float)


def _taken_back(control: ControlPoints, kept: ControlPoints, setting: StripAtControl) -> ControlPoints:
    """Take back coordinates that the final fit predicts after all."""
    value, limit, _, _ = _predicted(control, kept, setting)
    good = np.array(value <= limit, bool)
    good[:, PLAN] = (good | ~control.use)[:, PLAN].all(axis=1, keepdims=True)
    return replace(kept, use=kept.use | (control.use & good))


def _log(control: ControlPoints, kept: ControlPoints, setting: StripAtControl) -> tuple[ControlRejection, ...]:
    out = control.use & ~kept.use
    if not out.any():
        return ()
    value, limit, size, redundancy = _predicted(control, kept, setting)
    partner = _exchanges(control, kept, setting, size)
    detectable = _detectable(control, kept, setting)
    rows = np.flatnonzero(out.any(axis=1)).tolist()
    found = []
    for row in rows:
        beyond = out[row] & (value[row] > limit[row])
        # what others that were taken back since then do not contradict any more is named as it was rejected
        axes = np.flatnonzero(beyond if beyond.any() else out[row])
        worst = axes[np.nan_to_num(value[row] / limit[row])[axes].argmax()]
        found.append(
            ControlRejection(
                control.ids[row],
                tuple(AXES[k] for k in axes),
                float(value[row, worst]),
                float(limit[row, worst]),
                (float(size[row, 0]), float(size[row, 1]), float(size[row, 2])),
                float(redundancy[row, axes].min()),
                partner.get(row, ""),
                float(detectable[row, worst]),
            )
        )
    return tuple(found)


def _detectable(control: ControlPoints, kept: ControlPoints, setting: StripAtControl) -> Floats:
    """Smallest errors that are found in 80 % of cases, metres; NaN without the strip's covariance."""
    found = setting.judged(control, kept)
    return np.full(control.use.shape, np.nan) if found is None else found.detectable


def _exchanges(control: ControlPoints, kept: ControlPoints, setting: StripAtControl, size: Floats) -> dict[int, str]:
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
                control, kept, setting, (one, other)
            ):
                found[one], found[other] = control.ids[other], control.ids[one]
    return found


def _fit_exchanged(control: ControlPoints, kept: ControlPoints, setting: StripAtControl, rows: tuple[int, int]) -> bool:
    """Whether two points agree with all others when each has the coordinates of the other."""
    order = np.arange(len(control))
    order[list(rows)] = rows[::-1]
    exchanged = replace(control, enu=control.enu[order], sigma=control.sigma[order])
    value, limit, _, _ = _predicted(exchanged, kept, setting)
    return bool((value[list(rows)] <= limit[list(rows)]).all())
