"""Precision of the strip method: covariances of points and photos from the image coordinates and the control.

The error of a point is that of the formed strip minus what the fit to the control takes away of it, which is made of
errors of the same image coordinates and of the control. Everything is a sum over rows that reach over a few models;
what runs through the whole strip comes from sums over all models before, in time and memory that grow with its length.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.distributions import gamma_cdf
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.statistics import chi2_quantile
from photostrip.triangulation.error_propagation.derivatives import REACH, SPAN, UNITS, Rows
from photostrip.triangulation.relative_orientation.relative import MINIMUM_POINTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.error_propagation.control_errors import Misclosures
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors
    from photostrip.triangulation.relative_orientation.relative import Orientation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

A_PRIORI, A_POSTERIORI = "a-priori", "a-posteriori"
LEVEL = 0.01  # of the test that keeps the stated standard deviation of the image coordinates
ENTRIES = 2000  # coefficients of image points worked on at a time: what fits into the processor's cache


@dataclass(frozen=True, eq=False)
class CheckTest:
    """Test of the check points of a strip together; their errors are correlated along the strip."""

    points: int
    coordinates: int  # their coordinates, the expectation of the sum of squares
    squares: float  # e^T C^-1 e with the joint covariance C of the differences, that of the given coordinates included

    @property
    def probability(self) -> float:
        """Probability of a larger sum by chance."""
        return 1 - gamma_cdf(self.squares / 2, self.coordinates / 2)


def image_variance(orientation: Orientation, sigma: float) -> tuple[float, str]:
    """Variance factor of the image coordinates: 1 unless the y parallaxes contradict what is stated.

    Parameters
    ----------
    sigma : float
        Stated standard deviation of an image coordinate of weight one, mm.

    Returns
    -------
    factor : float
        Variance found over variance stated, or 1.
    basis : str
        ``"a-posteriori"`` or ``"a-priori"``.
    """
    redundancy = int((orientation.points_used - MINIMUM_POINTS).sum())
    squares = float((orientation.pairs.weight * orientation.parallax**2)[orientation.used].sum()) / (2 * sigma**2)
    if redundancy < 1:
        return 1.0, A_PRIORI
    low, high = (chi2_quantile(p, redundancy) for p in (LEVEL / 2, 1 - LEVEL / 2))
    return (1.0, A_PRIORI) if low <= squares <= high else (squares / redundancy, A_POSTERIORI)


@dataclass(frozen=True, eq=False)
class Chain:
    """Covariances of the similarities of the models, relative to the first."""

    frames: Floats  # (p + 1, 7, 7): of each model, and last of the last photo
    ahead: Floats  # (p + 1, 2, 7, 6): of each with the units of its own model and of the next


@dataclass(frozen=True, eq=False)
class Fitted:
    """Covariances of the parameters fitted to the control."""

    frames: Floats  # (p + 1, 7, t): with the similarities of the models
    units: Floats  # (p, 6, t): with the units
    images: Floats  # (n, 2, t): with the image coordinates
    parameters: Floats  # (t, t): among themselves


def chain(errors: StripErrors) -> Chain:
    """Add up the steps from model to model.

    Parameters
    ----------
    errors : StripErrors
        Steps and covariances of the units.

    Returns
    -------
    Chain
        Covariances of the similarities.

    Notes
    -----
    P(m+1) = P(m) + Q(m,m) + c + c^T, c = Q(m-1,m) + Q(m-2,m): steps correlate over two models, not one.
    """
    steps, models = errors.steps, errors.models
    ahead = np.zeros((models + 1, 2, SIMILARITY_PARAMETERS, UNITS))
    for apart in range(1, SPAN):
        with_units = steps @ errors.covariances[:, apart]
        for slot in range(apart):  # of the steps before model m, those of m - 1 and m - 2 reach units from m on
            before = apart - slot
            ahead[before:, slot] += with_units[: models + 1 - before]
    added = np.zeros((models + 1, SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS))
    cross = ahead[:models, 0] @ steps.transpose(0, 2, 1)
    added[1:] = steps @ errors.covariances[:, 0] @ steps.transpose(0, 2, 1) + cross + cross.transpose(0, 2, 1)
    return Chain(np.cumsum(added, axis=0), ahead)


def fitted(errors: StripErrors, found: Misclosures, operator: Floats, factor: float = 1.0) -> Fitted:
    """Covariances of parameters that are fitted to the control.

    Parameters
    ----------
    operator : ndarray, shape (t, w)
        Parameters by misclosures.
    factor : float
        Variance factor of the image coordinates; that of the control is 1.

    Returns
    -------
    Fitted
        Covariances in units of the image coordinates' variance factor.
    """
    steps, images = errors.steps, errors.images
    core, units, near, own = _sums(errors, found.rows, operator)
    with_images = _by_photo(errors, core, np.arange(len(images.row)))
    with_images[near] += own
    frames = np.zeros((errors.models + 1, SIMILARITY_PARAMETERS, len(operator)))
    frames[1:] = np.cumsum(steps @ units, axis=0)
    parameters = np.einsum("kit,kis->ts", core, units) + np.einsum("nit,nis->ts", own, with_images[near])
    parameters += (operator * (found.variance / factor)) @ operator.T
    return Fitted(frames, units, with_images, (parameters + parameters.T) / 2)


def sums_of(errors: StripErrors, rows: Rows, operator: Floats) -> Floats:
    """Covariances of sums of rows among themselves.

    Parameters
    ----------
    operator : ndarray, shape (t, n)
        What is summed.

    Returns
    -------
    ndarray, shape (t, t)
        Covariances, for a variance factor of 1 of the image coordinates.
    """
    core, units, near, own = _sums(errors, rows, operator)
    with_images = own + _by_photo(errors, core, near)
    found = np.einsum("kit,kis->ts", core, units) + np.einsum("nit,nis->ts", own, with_images)
    return np.asarray((found + found.T) / 2, float)


def by_images(errors: StripErrors, rows: Rows, weights: Floats) -> Floats:
    """Coefficients of the image coordinates in a weighted sum of rows.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        Weights of the rows.

    Returns
    -------
    ndarray, shape (k, 2)
        In the order of ``errors.images``, for coordinates in units of their standard deviations.
    """
    core = _summed_units(errors, rows, weights[:, None])
    result = _by_photo(errors, core, np.arange(len(errors.images.row)))[:, :, 0]
    np.add.at(result, rows.image, rows.own[:, 0] * weights[rows.item][:, None])
    return result


def _sums(errors: StripErrors, rows: Rows, operator: Floats) -> tuple[Floats, Floats, Numbers, Floats]:
    """Sum rows: coefficients of units, covariances with units; image points of their own and coefficients."""
    images = errors.images
    core = _summed_units(errors, rows, operator.T)
    near, entry = np.unique(rows.image, return_inverse=True)
    own = np.zeros((len(near), 2, len(operator)))
    np.add.at(own, entry, rows.own[:, 0, :, None] * operator.T[rows.item][:, None, :])
    units = _times_covariances(errors, core)
    for slot in range(SPAN):
        model = images.photo[near] - REACH + slot
        inside = (model >= 0) & (model < errors.models)
        np.add.at(units, model[inside], images.units[near[inside], slot] @ own[inside])
    return core, units, near, own


def _summed_units(errors: StripErrors, rows: Rows, weights: Floats) -> Floats:
    """Coefficients of the units in weighted sums of rows with d = 1, shape (p, 6, t)."""
    models, count = errors.models, weights.shape[1]
    by_first = np.zeros((models + 1, SIMILARITY_PARAMETERS, count))
    np.add.at(by_first, rows.first, rows.frame[:, 0, :, None] * weights[:, None, :])
    after = np.cumsum(by_first[::-1], axis=0)[::-1][1:]  # rows whose first model comes after each model
    core: Floats = errors.steps.transpose(0, 2, 1) @ after
    for slot in range(rows.core.shape[1]):
        model = rows.first + slot
        inside = model < models
        values = rows.core[inside, slot, 0, :, None] * weights[inside, None, :]
        np.add.at(core, model[inside], values)
    return core


def _by_photo(errors: StripErrors, core: Floats, images: Numbers) -> Floats:
    """Image coordinates' coefficients in sums of units, shape (n, 2, t)."""
    padded = np.concatenate([np.zeros((REACH, *core.shape[1:])), core, np.zeros((1, *core.shape[1:]))])
    photo = errors.images.photo[images]
    result = np.zeros((len(photo), 2, core.shape[2]))
    for slot in range(SPAN):
        result += errors.images.units[images, slot].transpose(0, 2, 1) @ padded[photo + slot]
    return result


def _times_covariances(errors: StripErrors, core: Floats) -> Floats:
    """Covariances of the units with sums of units, shape (p, 6, t)."""
    result: Floats = errors.covariances[:, 0] @ core
    for apart in range(1, min(SPAN, errors.models)):
        mixed = errors.covariances[:-apart, apart]
        result[:-apart] += mixed @ core[apart:]
        result[apart:] += mixed.transpose(0, 2, 1) @ core[:-apart]
    return result


# ---------------------------------------------------------------------------------------------------- covariances


def covariances(errors: StripErrors, rows: Rows, fit: Fitted, influence: Floats) -> Floats:
    """Covariances of corrected points, or of anything that has rows.

    Parameters
    ----------
    rows : Rows
        What is asked for, n things of d coordinates.
    influence : ndarray, shape (n, d, t)
        What each parameter subtracts.

    Returns
    -------
    ndarray, shape (n, d, d)
        Covariances, for a variance factor of 1 of the image coordinates.

    Notes
    -----
    Cov = S - C Phi^T - Phi C^T + Phi Sigma Phi^T with S of the formed strip, C with the parameters.
    """
    base = chain(errors)
    size = rows.frame.shape[1]
    result = np.empty((len(rows.first), size, size))
    for start, stop in _slices(rows):
        part, phi = rows.part(start, stop), influence[start:stop]
        formed = _formed(errors, part, base)
        mixed = _with_parameters(part, fit) @ phi.transpose(0, 2, 1)
        result[start:stop] = formed - mixed - mixed.transpose(0, 2, 1) + phi @ fit.parameters @ phi.transpose(0, 2, 1)
    return result


def _slices(rows: Rows) -> list[tuple[int, int]]:
    """Cut many things into parts of bounded memory."""
    count = len(rows.first)
    size = max(1, int(ENTRIES * 3 / rows.frame.shape[1] * count / max(len(rows.item), 1)))
    return [(start, min(start + size, count)) for start in range(0, count, size)]


def _formed(errors: StripErrors, rows: Rows, base: Chain) -> Floats:
    """Covariances in the formed strip, relative to the similarity of its first model."""
    slots = rows.core.shape[1]
    with_units = own_with_units(errors, rows)
    local = local_covariances(errors, rows, with_units)
    first, ahead = rows.first, base.ahead[rows.first]
    shared = ahead[:, 0] @ rows.core[:, 0].transpose(0, 2, 1)
    if slots > 1:
        shared += ahead[:, 1] @ rows.core[:, 1].transpose(0, 2, 1)
    for back in range(1, SPAN):
        inside = np.flatnonzero(first >= back)
        steps = errors.steps[first[inside] - back]
        shared[inside] += steps @ with_units[inside, REACH - back].transpose(0, 2, 1)
    moved = rows.frame @ shared
    return np.asarray(
        rows.frame @ base.frames[first] @ rows.frame.transpose(0, 2, 1) + moved + moved.transpose(0, 2, 1) + local,
        float,
    )


def own_with_units(errors: StripErrors, rows: Rows) -> Floats:
    """Covariances of the rows' own image coordinates with units.

    Parameters
    ----------
    rows : Rows
        n things of d coordinates, reaching over s models.

    Returns
    -------
    ndarray, shape (n, s + 2 + 2, d, 6)
        With the units of the models ``first - 2`` to ``first + s + 1``.
    """
    n, slots, size, _ = rows.core.shape
    result = np.zeros((n, slots + 2 * REACH, size, UNITS))
    if not len(rows.item):
        return result
    photo = errors.images.photo[rows.image]
    order = np.lexsort((photo, rows.item))
    item, photo = rows.item[order], photo[order]
    new = np.flatnonzero(np.concatenate([[True], (item[1:] != item[:-1]) | (photo[1:] != photo[:-1])]))
    units = errors.images.units[rows.image[order]].reshape(len(order), SPAN * UNITS, 2).transpose(0, 2, 1)
    by_photo = np.add.reduceat(rows.own[order] @ units, new, axis=0).reshape(len(new), size, SPAN, UNITS)
    thing, place = item[new], photo[new] - rows.first[item[new]]
    for slot in range(SPAN):
        inside = (place + slot >= 0) & (place + slot < slots + 2 * REACH)
        result[thing[inside], place[inside] + slot] += by_photo[inside, :, slot]
    return result


def local_covariances(errors: StripErrors, rows: Rows, with_units: Floats) -> Floats:
    """Covariances of the rows without the similarity of their first model."""
    n, slots, size, _ = rows.core.shape
    result = np.zeros((n, size, size))
    for slot in range(slots):
        mixed = with_units[:, slot + REACH] @ rows.core[:, slot].transpose(0, 2, 1)
        model = np.minimum(rows.first + slot, errors.models - 1)
        for apart in range(min(SPAN, slots - slot)):
            term = rows.core[:, slot] @ errors.covariances[model, apart] @ rows.core[:, slot + apart].transpose(0, 2, 1)
            mixed += term / 2 if apart == 0 else term
        result += mixed + mixed.transpose(0, 2, 1)
    if len(rows.item):
        present, starts = np.unique(rows.item, return_index=True)
        result[present] += np.add.reduceat(rows.own @ rows.own.transpose(0, 2, 1), starts, axis=0)
    return result


def _with_parameters(rows: Rows, fit: Fitted) -> Floats:
    """Covariances of the rows with the fitted parameters, shape (n, d, t)."""
    result: Floats = rows.frame @ fit.frames[rows.first]
    for slot in range(rows.core.shape[1]):
        model = rows.first + slot
        inside = np.flatnonzero(model < len(fit.units))
        result[inside] += rows.core[inside, slot] @ fit.units[model[inside]]
    if len(rows.item):
        present, starts = np.unique(rows.item, return_index=True)
        result[present] += np.add.reduceat(rows.own @ fit.images[rows.image], starts, axis=0)
    return result
