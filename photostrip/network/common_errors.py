"""Errors that a whole group of observations shares, tested before single given coordinates are taken out.

Camera positions in another datum than the control, or of an antenna whose arm is not stated, contradict the control one
by one; so does control in photos of another principal distance. Taken out one by one, good control and good positions
go. A common error is one hypothesis of few parameters: it is taken up as unknowns when with it the sum of squares falls
by more, in units of what chance reaches, than it does without the worst given coordinate, and without the whole point
or position to which that belongs.

Source: derived, see docs/sources.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.network.calibration import AFFINE, PRINCIPAL_DISTANCE, values_of
from photostrip.network.cofactors import coordinates_of, joint_cofactors
from photostrip.network.problem import BundleCameras, BundleProblem
from photostrip.network.reliability import Limit
from photostrip.network.selection import Selection, selected, supported
from photostrip.network.settings import CALIBRATION
from photostrip.network.solution import BundleSolution
from photostrip.network.solve import solve
from photostrip.rejection import Rejection
from photostrip.statistics import chi2_quantile

OFFSET, DRIFT, LIST = "offset", "drift", "control list"
LENS, POINT, DISTANCE, FILM = "lens distortion", "principal point", "principal distance", "film"
OF_CAMERAS = {
    LENS: [list(CALIBRATION).index("k1")],
    POINT: [list(CALIBRATION).index("x0"), list(CALIBRATION).index("y0")],
    DISTANCE: [PRINCIPAL_DISTANCE],
    FILM: AFFINE,
}
"""What may be wrong with a camera, with the columns of its parameters."""
ALL = "all"  # positions of all groups share one error
EACH = "each"  # those of every group, or every camera, have one of their own
LEAST_SHARE = 1e-6  # of the weight of a list that other observations leave to its shift
SHOWN_SIGMAS = 4.0  # standard deviations from which a component is off
UP_AXIS = 2


@dataclass(frozen=True)
class CommonError:
    """What a group of observations shares beside the truth."""

    # ``OFFSET`` or ``DRIFT`` (which has an offset too) of camera positions, one of ``OF_CAMERAS``, or ``LIST``
    kind: str
    of: str  # ``ALL`` or ``EACH``
    rival: str = ""  # kind of another error that explains nearly as much
    number: int = -1  # of a control list, or of a camera; -1: of all cameras
    # shift, sigma: how it lies beside everything else, along its axes, metres; NaN where it gives nothing
    shift: tuple[float, ...] = ()
    sigma: tuple[float, ...] = ()


def taken_up(problem: BundleProblem, error: CommonError) -> BundleProblem:
    """Give a problem the unknowns of a common error; a control list that is shifted is left out as far as it is off."""
    positions, cameras = problem.positions, problem.cameras
    if error.kind == LIST:
        off = np.abs(error.shift) > SHOWN_SIGMAS * np.array(error.sigma)
        outside = (problem.control.frame == error.number)[:, None] & (off[:UP_AXIS].any() | (np.arange(3) == UP_AXIS))
        control = replace(problem.control, sigma=np.where(outside, np.inf, problem.control.sigma))
        return replace(problem, control=control)
    if error.kind in OF_CAMERAS:
        which = np.arange(len(cameras.focal)) if error.number < 0 else np.array([error.number])
        return replace(problem, cameras=cameras.with_unknown(which, OF_CAMERAS[error.kind]))
    group = np.where(positions.group >= 0, 0 if error.of == ALL else positions.group, -1)
    count = 1 if error.of == ALL else len(positions.offset_sigma)
    members = np.zeros((count, 3), np.intp)
    np.add.at(members, group[group >= 0], np.isfinite(positions.sigma[group >= 0]))
    drift = np.where((members > 1) & (error.kind == DRIFT), np.inf, 0.0)
    changed = replace(positions, group=group, offset_sigma=np.where(members > 0, np.inf, 0.0), drift_sigma=drift)
    return replace(problem, positions=changed, group_ids=("of the block",) if error.of == ALL else problem.group_ids)


def given_up(problem: BundleProblem, error: CommonError) -> BundleProblem:
    """Take the unknowns of an error of a camera back: the camera is as it is given."""
    sigma = np.array(problem.cameras.sigma, float)
    sigma[slice(None) if error.number < 0 else error.number, OF_CAMERAS[error.kind]] = 0.0
    return replace(problem, cameras=replace(problem.cameras, sigma=sigma if sigma.any() else None))


@dataclass(frozen=True)
class _Trial:
    """An adjustment with the unknowns of a common error."""

    error: CommonError
    unknowns: int
    chi_square: float
    sigma0: float


def find_common_error(
    problem: BundleProblem, selection: Selection, solution: BundleSolution, limit: Limit, worst: Rejection | None = None
) -> CommonError | None:
    """Find the common error that explains more than the worst given coordinate does; None when there is none.

    Of several, one with more unknowns, or of another kind, must explain more than chance adds to it.
    """
    trials = [*_trials(problem, selection), *_trials_of_lists(problem, selection, solution)]
    if not trials:
        return None
    least = min(each.sigma0 for each in trials)
    unit = 1.0 if limit.unit == 1.0 or not least > 1.0 else least  # the common error itself makes sigma0 large

    def by_chance(unknowns: int) -> float:
        return chi2_quantile(1 - limit.alpha, max(unknowns, 1)) * unit**2

    found: CommonError | None = None
    most, unknowns = 0.0, 0
    for each in trials:
        fall, error = solution.chi_square - each.chi_square, each.error
        if (
            found is not None
            and error.kind in {DISTANCE, LIST}
            and abs(fall - most) < by_chance(abs(each.unknowns - unknowns))
        ):
            found = replace(found, rival=error.kind)
        elif fall > most + by_chance(each.unknowns - unknowns):
            found, most, unknowns = error, fall, each.unknowns
    if found is None or worst is None:
        return found
    without = _whole_row(selection, worst)
    share = (worst.value * limit.unit / (limit.value * unit)) ** 2
    if (alone := _solved(problem, without)) is not None:
        fall = solution.chi_square - alone.chi_square
        share = max(share, fall / by_chance(_given(selection) - _given(without)))
    return found if most / by_chance(unknowns) > share else None


def _trials(problem: BundleProblem, selection: Selection) -> Iterator[_Trial]:
    known = len(problem.common_names())
    for error in _conceivable(problem):
        tried = taken_up(problem, error)
        after = _solved(tried, selection)
        if after is not None and not mirrors(tried.cameras, after.common):
            unknowns = len(tried.common_names()) - known
            yield _Trial(error=error, unknowns=unknowns, chi_square=after.chi_square, sigma0=after.sigma0)


def mirrors(cameras: BundleCameras, common: Floats) -> bool:
    """Whether a principal distance comes out negative: heights that count downwards are no lens."""
    return bool((cameras.focal + values_of(cameras, common)[:, PRINCIPAL_DISTANCE] < 0.0).any())


def _trials_of_lists(problem: BundleProblem, selection: Selection, solution: BundleSolution) -> Iterator[_Trial]:
    """Shift control lists, the shortest first, each as a whole; what is left without the list must hold the block."""
    control = solution.prepared.problem.control
    lists, sizes = np.unique(control.frame[np.isfinite(control.sigma).any(axis=1)], return_counts=True)
    for number in lists[np.argsort(sizes, kind="stable")].tolist() if len(lists) > 1 else ():
        first = _shift_of(number, solution)
        after = None if first is None else _solved(_moved(problem, number, first.value), selection)
        further = None if after is None else _shift_of(number, after)  # far from the truth the first is bent
        if first is None or after is None or further is None:
            continue
        error = CommonError(
            LIST, EACH, number=number, shift=tuple(first.value + further.value), sigma=tuple(further.sigma)
        )
        without = taken_up(problem, error)
        if _solved(without, supported(without, selection)) is not None:
            chi_square = max(after.chi_square - further.gain, 0.0)
            unknowns = int(np.isfinite(further.value).sum())
            redundancy = max(after.redundancy - unknowns, 1)
            sigma0 = float((chi_square / redundancy) ** 0.5)
            yield _Trial(error=error, unknowns=unknowns, chi_square=chi_square, sigma0=sigma0)


class _Shift(NamedTuple):
    """How a control list lies beside everything else, linearised at a solution."""

    # value, sigma: (3,): along the axes, metres; NaN where nothing is given
    value: Floats
    sigma: Floats
    gain: float  # what the sum of squares loses by it


def _shift_of(number: int, solution: BundleSolution) -> _Shift | None:
    """Estimate the shift of a list, with C the axes of its coordinates: N^-1 C' W v, N = C' W Qvv W C.

    None where nothing else is given that it could lie beside.
    """
    control = solution.prepared.problem.control
    used = np.isfinite(control.sigma)
    rows = np.flatnonzero((control.frame == number) & used.any(axis=1))
    axes = np.flatnonzero(used[rows].any(axis=0))
    weight = control.sigma[rows] ** -2.0
    point, at = np.unique(control.point[rows], return_inverse=True)
    factors = np.zeros((len(point), 3, 3))
    np.add.at(factors, at, (weight[:, :, None] * control.axes[rows]).swapaxes(1, 2))
    pull = (weight * solution.control_residuals[rows]).sum(axis=0)[axes]
    total = weight.sum(axis=0)
    sums = csr_array(factors.reshape(-1, 3).T) @ coordinates_of(solution, point)
    normal = (np.diag(total) - joint_cofactors(solution, sums))[np.ix_(axes, axes)]
    if np.linalg.eigvalsh(normal)[0] < LEAST_SHARE * total.max():
        return None
    inverse = np.linalg.inv(normal)
    value, sigma = np.full((2, 3), np.nan)
    sigma0 = max(1.0, solution.sigma0)
    value[axes], sigma[axes] = -inverse @ pull, np.sqrt(np.diag(inverse)) * sigma0
    return _Shift(value, sigma, float(pull @ inverse @ pull))


def _moved(problem: BundleProblem, number: int, shift: Floats) -> BundleProblem:
    """Move a control list back."""
    control, step = problem.control, np.nan_to_num(shift)
    back = np.where((control.frame == number)[:, None], np.einsum("nai,a->ni", control.axes, step), 0.0)
    return replace(problem, control=replace(control, xyz=control.xyz - back))


def _solved(problem: BundleProblem, selection: Selection) -> BundleSolution | None:
    try:
        return solve(selected(problem, selection), rough=True)
    except GeometryError:
        return None


def _conceivable(problem: BundleProblem) -> Iterator[CommonError]:
    """Errors that may be shared, those of fewest unknowns first."""
    positions = problem.positions
    several = len(np.unique(positions.group[positions.group >= 0])) > 1
    if (positions.group >= 0).any() and not positions.drift_sigma.any():
        if not positions.offset_sigma.any():
            if several:
                yield CommonError(OFFSET, ALL)
            yield CommonError(OFFSET, EACH)
        yield CommonError(DRIFT, EACH)
    given = len(problem.control) + len(problem.positions) > 0 and len(problem.cameras.focal) > 0
    if given and (problem.cameras.sigma is None or not problem.cameras.sigma[:, PRINCIPAL_DISTANCE].any()):
        yield CommonError(DISTANCE, EACH)


def _whole_row(selection: Selection, worst: Rejection) -> Selection:
    """Leave the whole point or position of a coordinate out."""
    for axis in range(3):
        selection = selection.without(worst.kind, worst.row, axis)
    return selection


def _given(selection: Selection) -> int:
    return int(selection.control.sum() + selection.positions.sum() + selection.attitudes.sum())
