"""A strip after its fit to the control: what image coordinates and control do to points and photos.

The fit is a linear operator: parameters of similarity and polynomials by misclosures. Every control coordinate that
counts gives one misclosure, along its own ground axis, so that points in plan only and in height only come in by the
same rule as full ones. The operator holds the weights of the fit and the terms of the polynomials as they were used.

The error of a point is that of the formed strip minus what the fit takes away of it, which is made of errors of the
same image coordinates and of the control: D' = D - Phi M D_c by the image coordinates, Phi M by the control (eq. 5),
and so D' D'^T and Phi M S M^T Phi^T make up every covariance (eq. 6). What precedes a point is as long as the strip,
and so the work grows by the square of its length. Photos are oriented on their adjusted points, and take their errors.

Source: derived; see docs/precision.md, eq. 3, 5 and 6; [001] eq. 145-151 for the fit.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.special import chdtrc

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.points import ControlPoints
from photostrip.statistics import chi2_quantile
from photostrip.strip.polynomial import term_columns
from photostrip.strip.relative_orientation import MINIMUM_POINTS, Orientation
from photostrip.strip.resection import KnownPhotos, Resection, derivatives
from photostrip.strip.strip_errors import StripErrors, blocks, entries_of

A_PRIORI, A_POSTERIORI = "a-priori", "a-posteriori"
SIGMA_LEVEL = 0.01  # of the test that keeps the stated standard deviation of the image coordinates


def image_variance(orientation: Orientation, sigma: float) -> tuple[float, str]:
    """Variance factor of the image coordinates, and its basis: 1 unless the y parallaxes contradict what is stated.

    A y parallax of weight one has twice the variance of an image coordinate (``sigma``, mm): f = q^T W q / (2 sigma^2
    r).
    """
    redundancy = int((orientation.points_used - MINIMUM_POINTS).sum())
    squares = float((orientation.pairs.weight * orientation.parallax**2)[orientation.used].sum()) / (2 * sigma**2)
    return variance_factor(squares, redundancy)


def variance_factor(squares: float, redundancy: int) -> tuple[float, str]:
    """Variance found over that stated, and its basis: 1 unless the weighted sum of squares contradicts it."""
    if redundancy < 1:
        return 1.0, A_PRIORI
    low, high = (chi2_quantile(p, redundancy) for p in (SIGMA_LEVEL / 2, 1 - SIGMA_LEVEL / 2))
    return (1.0, A_PRIORI) if low <= squares <= high else (squares / redundancy, A_POSTERIORI)


@dataclass(frozen=True, eq=False)
class Misclosures:
    """Control coordinates that count, one row each."""

    point: Numbers  # (w,): control point of each
    row: Numbers  # (w,): its row in the points of the strip
    axis: Numbers  # (w,): 0, 1, 2: along its first, second, third ground axis
    direction: Floats  # (w, 3): that axis as a unit vector in the intermediate frame
    variance: Floats  # (w,): variance of the given coordinate, metres^2

    def take(self, some: Numbers) -> Misclosures:
        return Misclosures(
            point=self.point[some],
            row=self.row[some],
            axis=self.axis[some],
            direction=self.direction[some],
            variance=self.variance[some],
        )


@dataclass(frozen=True, eq=False)
class FitOperator:
    """Subtracted from the strip (eq. 5): ``X - Phi theta``, ``theta = M w``, w the misclosures strip minus given."""

    operator: Floats  # (t, w): M: seven parameters of the similarity, then those of the polynomials
    terms: tuple[tuple[str, ...], ...]  # terms of the polynomials of X, Y, Z
    # reach, breadth: lengths by which X and Y are divided in the terms, metres
    reach: float
    breadth: float
    origin: Floats  # (3,): origin of the similarity

    def influence(self, xyz: Floats) -> Floats:
        """Phi: displacement of points (n, 3) after the similarity by the parameters, shape (n, 3, t)."""
        result = np.zeros((len(xyz), 3, len(self.operator)))
        result[:, :, :SIMILARITY_PARAMETERS] = similarity_derivatives(xyz, self.origin)
        start = SIMILARITY_PARAMETERS
        for axis, values in enumerate(self.polynomial_columns(xyz)):
            result[:, axis, start : start + values.shape[1]] = values
            start += values.shape[1]
        return result

    def polynomial_columns(self, xyz: Floats) -> list[Floats]:
        """Terms of the three polynomials at points, scaled to about one."""
        plan = xyz[:, :2] / (self.reach, self.breadth)
        found = {terms: term_columns(plan, terms) for terms in set(self.terms)}
        return [found[terms] for terms in self.terms]


def misclosures(control: ControlPoints, rows: Numbers, axes: Floats) -> Misclosures:
    """Control coordinates that count, in the order of the points.

    control: the control, with standard deviations along `axes`.
    rows: (c,), its rows in the points of the strip.
    axes: (c, 3, 3), directions along which it is compared, rows, in the intermediate frame.
    """
    point, axis = np.nonzero(control.use)
    return Misclosures(
        point=point,
        row=rows[point],
        axis=axis,
        direction=axes[point, axis],
        variance=control.sigma[point, axis] ** 2,
    )


def fit_operator(
    found: Misclosures, weight: Floats, xyz: Floats, terms: Sequence[tuple[str, ...]], origin: Floats
) -> FitOperator:
    """Operator of the similarity and the polynomials, M = [M_s; M_p (I - A M_s)], A the design of the similarity.

    weight: (c, 3), weights of the control coordinates in the fit, as ``absolute_orientation.weights`` gives them.
    xyz: (c, 3), control points after the similarity, intermediate frame, metres.
    terms: terms of the polynomials of X, Y, Z; all empty without.
    """
    design = np.einsum("wi,wij->wj", found.direction, similarity_derivatives(xyz[found.point], origin))
    share = np.sqrt(weight[found.point, found.axis])
    size = np.abs(design).max(axis=0)
    size = np.where(size > 0, size, 1.0)
    similarity = np.linalg.pinv(design / size * share[:, None]) * share / size[:, None]
    reach, breadth = (max(float(np.abs(xyz[:, k]).max()), 1e-6) for k in (0, 1))
    result = FitOperator(operator=similarity, terms=tuple(terms), reach=reach, breadth=breadth, origin=origin)
    if not any(terms):
        return result
    after = _polynomials(found, weight, xyz, result)  # by misclosures that the similarity has left
    operator = np.concatenate([similarity, after - after @ design @ similarity])
    return FitOperator(operator=operator, terms=result.terms, reach=reach, breadth=breadth, origin=origin)


def _polynomials(found: Misclosures, weight: Floats, xyz: Floats, fit: FitOperator) -> Floats:
    """Parameters of the polynomials by misclosures after the similarity.

    (C^T W P C) theta = C^T W n w with C the columns of the terms, n the ground axes, P = sum n n^T of one point: each
    axis of the intermediate frame has its own fit; a point that gives only some of its ground coordinates takes
    the others from the fit itself, so the residual that counts is its projection on the axes given.
    """
    by_term = fit.polynomial_columns(xyz)
    plan = weight[:, :2].mean(axis=1)
    by_axis = (plan, plan, weight[:, 2])
    given = np.zeros((len(xyz), 3, 3))
    np.add.at(given, found.point, found.direction[:, :, None] * found.direction[:, None, :])
    weighted = [c * w[:, None] for c, w in zip(by_term, by_axis, strict=True)]
    normal = np.block(
        [
            [weighted[a].T @ (given[:, a, b, None] * by_term[b]) for b in range(3)]
            for a in range(3)
        ]
    )  # fmt: skip
    right = np.concatenate([(weighted[a][found.point] * found.direction[:, [a]]).T for a in range(3)])
    return np.asarray(np.linalg.solve(normal, right), float)


NUMBERS = 6  # of a photo: shift of its centre, small rotation, in the frame of the ground


@dataclass(frozen=True, eq=False)
class PhotoErrors:
    """Errors of all m photos of a strip; rows of zeros where one could not be oriented."""

    by_point: csr_array  # (6 m, 3 q): by the adjusted points
    by_image: csr_array  # (6 m, ...): by the image coordinates, in the columns of the strip's sparse rows


def differentiate_photos(
    errors: StripErrors, resection: Resection, xyz: Floats, photo: Numbers, point: Numbers, image: Numbers
) -> PhotoErrors:
    """Differentiate the resections: do = N^-1 A^T (dl - B dX), N = A^T A of one photo.

    The points carry the photo with them, and its measurements move it once more.

    xyz: (q, 3), adjusted points of the strip, metres.
    photo, point, image: (e,), rays on which photos were oriented: photo, ascending, point, and row in the project.
    """
    some = resection.solved[photo]
    photo, point, image = photo[some], point[some], image[some]
    focal = np.full(len(resection.centers), errors.orientation.pairs.focal)
    by_photo, by_point = derivatives(xyz[point], KnownPhotos(resection.centers, resection.rotations, focal), photo)
    distance = float(np.linalg.norm(xyz[point] - resection.centers[photo], axis=1).mean())
    unit = np.array([distance] * 3 + [1.0] * 3)  # so that shifts and rotations are of one size
    scaled = (by_photo * unit).transpose(0, 2, 1)
    starts = np.flatnonzero(np.diff(photo, prepend=-1))
    cofactors = np.zeros((len(focal), NUMBERS, NUMBERS))
    normal = np.add.reduceat(scaled @ scaled.transpose(0, 2, 1), starts)
    cofactors[photo[starts]] = unit[:, None] * np.linalg.inv(normal)
    by_image = cofactors[photo] @ scaled
    rows, images = entries_of(photo, NUMBERS), errors.first_error + errors.image_columns(image)
    count = NUMBERS * len(focal)
    return PhotoErrors(
        blocks(rows, entries_of(point, 3), -by_image @ by_point, (count, xyz.size)),
        blocks(rows, images, by_image * errors.sigma[image][:, None, :], (count, errors.width)),
    )


AT_A_TIME = 50_000  # numbers of points or photos, times models, worked on together: 5 MB for each table of them


@dataclass(frozen=True, eq=False)
class FittedStrip:
    """A strip fitted to its control, with a variance factor of its image coordinates; that of the control is 1."""

    errors: StripErrors
    control: Misclosures
    fit: FitOperator
    xyz: Floats  # (q, 3): points after the similarity, where the fit takes away its influence, metres
    factor: float

    @cached_property
    def _parameters(self) -> csr_array:
        """The fitted parameters (t, ...) as sparse rows of the strip, M D_c."""
        return csr_array(self.fit.operator) @ self.errors.along(self.control.row, self.control.direction)

    @cached_property
    def _with_parameters(self) -> Floats:
        """Covariances (..., t) of whatever a column of sparse rows stands for with the parameters."""
        return self.errors.with_everything(self._parameters)

    @cached_property
    def _spread(self) -> Floats:
        """Covariances (t, t) of the parameters, by image coordinates and control."""
        by_control = self.fit.operator * np.sqrt(self.control.variance / self.factor)
        return np.asarray(self._parameters @ self._with_parameters + by_control @ by_control.T, float)

    def covariances_of_points(self, points: Numbers) -> Floats:
        """Covariances (n, 3, 3) of some points, metres^2."""
        result = np.empty((len(points), 3, 3))
        for some in self._pieces(np.argsort(self.xyz[points, 0], kind="stable"), 3):  # neighbours have frames in common
            rows, influence = self.errors.points(points[some]), self.fit.influence(self.xyz[points[some]])
            result[some] = self._covariances(rows, influence)
        return result

    def covariances_of_photos(self, oriented: PhotoErrors, photos: Numbers) -> Floats:
        """Covariances (n, 6, 6) of centres and small rotations of some photos, metres^2 and radians^2."""
        result = np.empty((len(photos), NUMBERS, NUMBERS))
        for some in self._pieces(np.arange(len(photos)), NUMBERS):
            numbers = entries_of(photos[some], NUMBERS).ravel()
            by_point = oriented.by_point[numbers]
            points = np.asarray(np.unique(by_point.indices // 3), np.intp)
            by_point = by_point[:, entries_of(points, 3).ravel()]  # type: ignore[index]
            rows = by_point @ self.errors.points(points) + oriented.by_image[numbers]
            influence = by_point @ self.fit.influence(self.xyz[points]).reshape(3 * len(points), -1)
            result[some] = self._covariances(rows, influence.reshape(len(some), NUMBERS, -1))
        return result

    def joint_covariance(self, points: Numbers, directions: Floats) -> Floats:
        """Covariances (n, n) of points along directions (n, 3), metres^2."""
        influence = np.einsum("ni,nit->nt", directions, self.fit.influence(self.xyz[points]))
        rows = self.errors.along(points, directions)
        return self._after_fit(self.errors.joint_covariance(rows), rows, influence)

    def _covariances(self, rows: csr_array, influence: Floats) -> Floats:
        """Covariances (n, d, d) of things of d neighbouring rows each; influence is (n, d, t)."""
        return self._after_fit(self.errors.covariances(rows, influence.shape[1]), rows, influence)

    def _after_fit(self, covariance: Floats, rows: csr_array, influence: Floats) -> Floats:
        """Add to covariances (..., d, d) of the formed strip what the fit takes away by its influence (..., d, t)."""
        back = np.swapaxes(influence, -1, -2)
        mixed = (rows @ self._with_parameters).reshape(influence.shape) @ back
        found = covariance - mixed - np.swapaxes(mixed, -1, -2) + influence @ self._spread @ back
        return np.asarray(found * self.factor, float)

    def _pieces(self, order: Numbers, size: int) -> Iterator[Numbers]:
        """Cut things of so many numbers each into pieces of bounded memory."""
        most = max(AT_A_TIME // (size * self.errors.models), 1)
        for start in range(0, len(order), most):
            yield order[start : start + most]


@dataclass(frozen=True, eq=False)
class CheckErrors:
    """What check coordinates show of an adjustment, and what they may show."""

    ids: tuple[str, ...]  # the check points
    point: Numbers  # (w,): check point of each coordinate
    axis: Numbers  # (w,): 0, 1, 2: along its first, second, third ground axis
    difference: Floats  # (w,): adjusted minus given, metres
    covariance: Floats  # (w, w): of the differences, the errors of the given coordinates included, metres^2

    def without(self, ids: Collection[str]) -> CheckErrors | None:
        """Leave points out; None when none is left."""
        rows = np.flatnonzero([self.ids[point] not in ids for point in self.point])
        return self.take(rows) if len(rows) else None

    def take(self, rows: Numbers) -> CheckErrors:
        """Give some of the coordinates."""
        return replace(
            self,
            point=self.point[rows],
            axis=self.axis[rows],
            difference=self.difference[rows],
            covariance=self.covariance[np.ix_(rows, rows)],
        )

    @property
    def points(self) -> int:
        return len(np.unique(self.point))

    @property
    def coordinates(self) -> int:
        """Number of coordinates, which is the expectation of the sum of squares."""
        return len(self.difference)

    @cached_property
    def squares(self) -> float:
        """e^T C^-1 e with the covariance C of the differences e."""
        return float(self.difference @ np.linalg.solve(self.covariance, self.difference))

    @property
    def probability(self) -> float:
        """Probability of a larger sum of squares by chance."""
        return float(chdtrc(self.coordinates, self.squares))

    @property
    def independent(self) -> float:
        """Number of independent coordinates whose squares would scatter as much in the mean as these do.

        The mean of n squares of standard normal variables with correlations r has the variance 2 sum(r^2) / n^2.
        """
        return self.coordinates**2 / float((self.correlation**2).sum())

    @property
    def correlation(self) -> Floats:
        sigma = np.sqrt(np.diag(self.covariance))
        return self.covariance / sigma / sigma[:, None]

    @property
    def own_squares(self) -> float:
        """Sum of the squares of the differences, each over its own standard deviation."""
        return float((self.difference**2 / np.diag(self.covariance)).sum())
