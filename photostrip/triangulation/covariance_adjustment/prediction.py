"""Points, photos and tests read from the solved system by least-squares prediction.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from photostrip.arrays import Floats, Numbers, pieces
from photostrip.frozen import NamedTuple, dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.statistics import gamma_cdf, normal_quantile
from photostrip.triangulation.covariance_adjustment import reduced, relinearisation, system
from photostrip.triangulation.covariance_adjustment.conditions import CONTROL, DISTANCE
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import COMPONENTS, ErrorRows, PointRows
from photostrip.triangulation.covariance_adjustment.strip_rows.sums import NearImages, by_same_images

TIE = 6  # decimals of a test value that are not rounding
CHECKED = 1e-6  # part of a control coordinate's variance that the others must check; what is less may be rounding


@dataclass(frozen=True, eq=False)
class AdjustmentTest:
    """What the adjustment says about itself, in the order of the control coordinates."""

    squares: float  # weighted sum of squares of all misclosures
    redundancy: int
    # (w,): test value of each control coordinate, standard normal when it is right; NaN where nothing checks it
    normalised: Floats
    size: Floats  # (w,): error of the given coordinate, given minus true, that would explain it, metres
    distances: int  # distances of pass points that took part
    level: float  # probability that any control coordinate of a sound strip is called doubtful

    @property
    def probability(self) -> float:
        """Probability of a larger sum of squares by chance; NaN without redundancy."""
        return 1 - gamma_cdf(self.squares / 2, self.redundancy / 2) if self.redundancy > 0 else float("nan")

    @property
    def limit(self) -> float:
        """Test value that the largest of all control coordinates exceeds by chance with that probability."""
        return normal_quantile(1 - self.level / (2 * max(len(self.normalised), 1)))

    @property
    def doubtful(self) -> Numbers:
        """Control coordinates beyond the limit, the worst first; of equal ones, whatever the rounding, the first."""
        beyond = np.flatnonzero(np.abs(np.nan_to_num(self.normalised)) > self.limit)
        return beyond[np.argsort(-np.abs(self.normalised[beyond]).round(TIE), kind="stable")]


def errors(found: system.System, rows: PointRows, images: Floats) -> Floats:
    """Predict the errors (n, 3) of points, to be subtracted.

    e = b^T [lambda; y], with b as in ``covariances``: what the errors of the image coordinates displace, and the
    similarity of the first model.

    images: (k, 2), errors of the image coordinates of which the rows are not free yet, in their standard deviations.
    """
    components, result = relinearisation.component_errors(found.errors, images), np.empty((len(rows.first), 3))
    for piece in pieces(len(rows.first), system.AT_A_TIME):
        some = rows.take(np.arange(piece.start, piece.stop))
        result[piece] = relinearisation.displacements(components, some, images)
        result[piece] += (some.by_similarity @ found.unknowns[some.first, :, None])[:, :, 0]
    return result


def covariances(found: system.System, rows: ErrorRows | PointRows) -> Floats:
    """Covariances (n, d, d) of what is left of the errors of points, for a variance factor of 1.

    With b the column of a row, its covariances with the conditions and its coefficients of the unknowns, Cov = E E^T -
    b^T K^-1 b: E by its own image points, the error components being what the unknowns say.
    """
    size = rows.by_component.shape[2]
    result = np.empty((len(rows.first), size, size))
    for part, some, images in _reduced(found, rows):
        result[part] = images @ images.transpose(0, 2, 1) - reduced.squares(found, some)
    return result


class _Piece(NamedTuple):
    """Some of the rows, ordered by their first models."""

    part: Numbers  # (m,): which they are
    rows: reduced.Reduced
    images: Floats  # (m, d, k): by their own image points


def _reduced(found: system.System, rows: ErrorRows | PointRows) -> Iterator[_Piece]:
    """Reduce rows, in pieces of bounded memory."""
    order, of_images = np.argsort(rows.first, kind="stable"), found.of_images()
    for piece in pieces(len(order), max(system.AT_A_TIME // rows.by_component.shape[2], 1)):
        some = rows.take(order[piece])
        near = NearImages.of(found.errors, some)
        yield _Piece(order[piece], reduced.of_rows(found, some, near, of_images), near.by_image)


def photo_rows(found: system.System) -> ErrorRows:
    """Rows of the photos of a strip: centre and small rotation, d = 6.

    Each photo moves with the model on its right, the last with its own and the step behind it.
    """
    errors, models = found.errors, found.errors.models
    by_similarity = np.zeros((models + 1, 6, SIMILARITY_PARAMETERS))
    by_similarity[:, :3] = similarity_derivatives(errors.centers, np.zeros(3))
    by_similarity[:, 3:, 3:6] = np.eye(3)
    by_component = np.zeros((models + 1, 1, 6, COMPONENTS))
    by_component[-1, 0] = by_similarity[-1] @ errors.steps[-1]
    return ErrorRows.without_images(np.append(np.arange(models), models - 1), by_similarity, by_component)


def photo_errors(found: system.System) -> Floats:
    """Predict the errors (p + 1, 6) of the photos, centre and small rotation."""
    return np.asarray((photo_rows(found).by_similarity @ found.unknowns[:, :, None])[:, :, 0], float)


def influence(found: system.System, rows: ErrorRows, chosen: Numbers) -> Floats:
    """Differentiate predicted errors of points by the misclosures of conditions: b^T K^-1 e, shape (n, d, c).

    The system is solved for the columns of the n rows or for the unit vectors of the c conditions, whichever are fewer.
    """
    order, (count, size) = np.argsort(chosen, kind="stable"), rows.by_similarity.shape[:2]
    units = reduced.of_conditions(found, chosen[order])
    result = np.empty((count, size, len(chosen)))
    if count * size >= len(chosen):
        result[:, :, order] = with_columns(found, rows, reduced.solved(found, units))
        return result
    for piece in _reduced(found, rows):
        by_rows = reduced.products(found, units, reduced.solved(found, piece.rows.by_coordinate))[:, 0]
        result[piece.part[:, None, None], np.arange(size)[:, None], order] = by_rows.T.reshape(-1, size, len(order))
    return result


def with_columns(found: system.System, rows: ErrorRows, columns: reduced.Solved) -> Floats:
    """Give b^T K^-1 b' of rows with others, shape (n, d, c)."""
    result = np.zeros((*rows.by_similarity.shape[:2], columns.columns.shape[2]))
    for part, some, _ in _reduced(found, rows):
        result[part] = reduced.products(found, some, columns)
    return result


def joint_covariance(found: system.System, rows: ErrorRows) -> Floats:
    """Covariances (n, n) of what is left of the errors of rows with d = 1: E E^T - b^T K^-1 b, as ``covariances``."""
    order = np.argsort(rows.first, kind="stable")
    rows = rows.take(order)
    near = NearImages.of(found.errors, rows)
    known = reduced.squares_and_products(found, reduced.of_rows(found, rows, near, found.of_images()))
    result = np.empty_like(known)
    result[np.ix_(order, order)] = by_same_images(rows) - known
    return result


def tested(found: system.System, level: float, factor: float) -> AdjustmentTest:
    """Test the adjustment as a whole, w^T lambda / f, and each control coordinate, lambda / sqrt(f q).

    level: probability of calling any of them doubtful in a sound strip.
    factor: f, the variance factor of the image coordinates with which the system was built: f Q is the covariance of w.
    Raises numpy.linalg.LinAlgError where rounding has left nothing of the solution: the redundancy number of an
        observation, q times its variance, lies between 0 and 1.
    """
    wanted = found.conditions
    rows = np.flatnonzero(wanted.kind == CONTROL)
    correlates, cofactors = found.correlates[rows], cofactors_of(found, rows)
    if not (np.abs(cofactors * wanted.noise[rows] / factor - 0.5) < 0.5 + CHECKED).all():
        msg = "Singular matrix"  # as numpy says it where a pivot is 0, not nearly so
        raise np.linalg.LinAlgError(msg)
    normalised, size = np.full((2, len(rows)), np.nan)
    checked = np.flatnonzero(cofactors * (wanted.noise[rows] + 1e-12) / factor > CHECKED)
    source = wanted.source[rows[checked]]
    normalised[source] = correlates[checked] / np.sqrt(factor * cofactors[checked])
    size[source] = -correlates[checked] / cofactors[checked]  # given minus true
    distances = int((wanted.kind == DISTANCE).sum())
    return AdjustmentTest(
        squares=found.squares / factor,
        redundancy=len(rows) - SIMILARITY_PARAMETERS + distances,
        normalised=normalised,
        size=size,
        distances=distances,
        level=level,
    )


def cofactors_of(found: system.System, conditions: Numbers) -> Floats:
    """Cofactors (c,) of the correlates of some conditions, in the order of all."""
    return reduced.squares(found, reduced.of_conditions(found, conditions))[:, 0, 0]


def conditions_with_columns(found: system.System, conditions: Numbers, columns: reduced.Solved) -> Floats:
    """Give e^T K^-1 b' of some conditions with others, shape (n, c)."""
    order = np.argsort(conditions, kind="stable")
    result = np.empty((len(order), columns.columns.shape[2]))
    result[order] = reduced.products(found, reduced.of_conditions(found, conditions[order]), columns)[:, 0]
    return result


def part_of_inverse(found: system.System, conditions: Numbers) -> Floats:
    """Entries (c, c) of K^-1 between conditions."""
    order = np.argsort(conditions, kind="stable")
    result = np.empty((len(order), len(order)))
    result[np.ix_(order, order)] = reduced.squares_and_products(found, reduced.of_conditions(found, conditions[order]))
    return result
