"""Errors of a formed strip: one sparse operator on the errors of the image coordinates.

Inside a pair they are derivatives of elements, base and points by the image coordinates (eq. 1). The error of a model
is an infinitesimal similarity of its frame (shift, rotation, scale) plus its deformation. From frame to frame the
similarities differ by *steps*, each a sum over the image coordinates of three photos (eq. 2). A point is moved by the
frames of its models, by the elements of their pairs, and by its own image coordinates: a sparse row of few derivatives
(eq. 3). Steps are made of the elements, and of the scale that a model hands on: six components. A frame being the sum
of the steps before it, rows become D = B Z + E, Z the errors of the components (eq. 4), and give every covariance,
D D^T; nothing is said of correlations anywhere.

All coordinates refer to the frame of the ground after the plain similarity, all frames to that of the first model;
image coordinates count in their stated standard deviations.

Source: derived; see docs/precision.md, eq. 1-4; [001] eq. 126-141 for the operations.

How much worse the points of a pair are than those of a good pair of the same base and height.

A good pair has six standard points: two rows of three, one base apart each way, about the middle of the pair's own
points. Its elements, in the place of those found, give the same points a covariance to compare with; errors of the
points' own image coordinates are in both.

Source: [001] for the six points; the comparison is derived.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from photostrip.arrays import Floats, Numbers, pieces
from photostrip.geometry.rotation import angle_rates, cross_matrix, from_alpha_omega_kappa
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, Similarity, similarity_derivatives
from photostrip.points import take_rows
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.relative_orientation import (
    BY_ROW,
    Orientation,
    Pairs,
    in_front_of_cameras,
    linearised_parallaxes,
    normal_matrices,
    turns,
)

ELEMENTS = 5  # of a pair
SCALE, COMPONENTS = 5, 6  # of a model: the elements of its pair, then the logarithm of the scale handed on
SYSTEM = "alpha-omega-kappa"
ROWS = 2048  # worked on together: what fits into the processor's cache
LEFT, RIGHT = slice(0, 2), slice(2, 5)  # elements that turn the left and the right photo


@dataclass(frozen=True, eq=False)
class StripErrors:
    """Errors of a strip of p pairs by c errors: of image coordinates, and doubts about p scales handed on.

    The columns of a sparse row stand for the similarities of the p + 1 frames, the elements of the p pairs, and the c
    errors themselves, one after the other.
    """

    orientation: Orientation
    formed: FormedStrip
    pairs: PairErrors
    origin: Floats  # (3,): common origin of all similarities, the mean of the perspective centres
    # xyz, centers, rotations: (q, 3), (p + 1, 3), (p + 1, 3, 3): points and photos, from that origin
    xyz: Floats
    centers: Floats
    rotations: Floats
    sigma: Floats  # (k, 2): stated standard deviations of all image points of the project, mm
    column: Numbers  # (k,): the first of the two errors of each of them; without meaning where it takes no part
    components: csr_array  # (6 p, c): of each model the elements of its pair, and the logarithm of the scale handed on
    steps: (
        Floats  # (p, 7, 6): by these, from the frame of a model to the next, after the last to that of the last photo
    )

    @property
    def models(self) -> int:
        return len(self.centers) - 1

    @property
    def first_element(self) -> int:
        """The column of a sparse row at which the elements begin."""
        return SIMILARITY_PARAMETERS * (self.models + 1)

    @property
    def first_error(self) -> int:
        return self.first_element + ELEMENTS * self.models

    @property
    def width(self) -> int:
        return self.first_error + self.components.shape[1]

    @cached_property
    def _products(self) -> csr_array:
        """Covariances (6 p, 6 p) of the components: those of models more than two apart have nothing in common."""
        return self.components @ self.components.T

    def with_doubt(self, scale: Floats) -> StripErrors:
        """Give the logarithms of the scales handed on standard deviations (j,) beside those of image coordinates."""
        junction = np.flatnonzero(scale)
        column = self.components.shape[1] - self.models + junction
        rows, shape = COMPONENTS * junction + SCALE, self.components.shape
        added = blocks(rows[:, None], column[:, None], scale[junction, None, None], shape)
        return replace(self, components=self.components + added)

    def points(self, points: Numbers) -> csr_array:
        """Sparse rows (3 n, ...) of some points of the strip, each at most once: means over the models that hold it."""
        formed, orientation = self.formed, self.orientation
        place = np.full(len(formed.point), -1)
        place[points] = np.arange(len(points))
        rows = np.flatnonzero(orientation.used & np.isfinite(formed.model_xyz[:, 0]))
        point = np.searchsorted(formed.point, orientation.point[rows])
        rows, point = rows[place[point] >= 0], point[place[point] >= 0]
        model, image = orientation.pairs.pair[rows], orientation.rows[rows]
        values = np.concatenate(
            [
                similarity_derivatives(self.xyz[point], np.zeros(3)),
                self.pairs.point_by_elements[rows],
                self.pairs.point_by_image[rows] * self.sigma[image].reshape(-1, 1, 4),
            ],
            axis=2,
        )
        columns = [
            entries_of(model, SIMILARITY_PARAMETERS),
            self.first_element + entries_of(model, ELEMENTS),
            self.first_error + self.image_columns(image).reshape(-1, 4),
        ]
        share = 1 / formed.model_count[point, None, None]
        shape = 3 * len(points), self.width
        found = blocks(entries_of(place[point], 3), np.concatenate(columns, axis=1), share * values, shape)
        if len(formed.bridging) and (formed.model_count[points] == 0).any():
            found = found + _points_between(self, place, shape)
        return found

    def along(self, points: Numbers, directions: Floats) -> csr_array:
        """Sparse rows (n, ...) of errors of points along directions (n, 3)."""
        some, place = np.unique(points, return_inverse=True)
        turn = blocks(
            np.arange(len(points))[:, None], entries_of(place, 3), directions[:, None], (len(points), 3 * len(some))
        )
        return turn @ self.points(some)

    def image_columns(self, images: Numbers) -> Numbers:
        """Errors (..., 2) of image points, given by their rows in the project."""
        return self.column[images][..., None] + np.arange(2)

    def covariances(self, rows: csr_array, size: int) -> Floats:
        """Covariances (n, d, d) of rows (n d, ...), of ``size`` d neighbours each."""
        half, by_component, own = self._halves(rows, 0)
        shape = -1, size, half.shape[1]
        found = half.reshape(shape) @ by_component.reshape(shape).transpose(0, 2, 1)
        result = np.asarray(found + found.transpose(0, 2, 1), float)
        same = (own @ own.T).tocoo()
        one, other = np.divmod(same.row, size), np.divmod(same.col, size)
        near = one[0] == other[0]
        result[one[0][near], one[1][near], other[1][near]] += same.data[near]
        return result

    def joint_covariance(self, rows: csr_array, first: int = 0) -> Floats:
        """Covariances (n, n) of rows, relative to the frame ``first``, from which on frames move them.

        Errors before it move all of them by one similarity, and need no work.
        """
        half, by_component, own = self._halves(rows, first)
        found = half @ by_component.T
        return np.asarray(found + found.T + (own @ own.T).toarray(), float)

    def with_everything(self, rows: csr_array) -> Floats:
        """Covariances (..., n) of whatever a column stands for with rows (n, ...)."""
        by_component, own = self._by_component(rows, 0, self.models), rows[:, self.first_error :]
        found = self._products @ by_component.T + (self.components @ own.T).toarray()
        found = found.reshape(self.models, COMPONENTS, -1)
        frames = np.zeros((self.models + 1, SIMILARITY_PARAMETERS, len(by_component)))
        np.cumsum(self.steps @ found, axis=0, out=frames[1:])
        errors = self.components.T @ by_component.T + own.T.toarray()
        count = len(by_component)
        return np.concatenate([frames.reshape(-1, count), found[:, :SCALE].reshape(-1, count), errors])

    def frames(self, rows: csr_array) -> tuple[int, int]:
        """Give the first and the last frame that moves some rows."""
        numbers = rows.indices[rows.indices < self.first_element] // SIMILARITY_PARAMETERS
        return int(numbers.min()), int(numbers.max())

    def _halves(self, rows: csr_array, first: int) -> tuple[Floats, Floats, csr_array]:
        """Write the covariance of rows as G H^T + H G^T + E E^T: G, H (n, ...) of components, E (n, c) of errors."""
        last = min(self.frames(rows)[1] + 1, self.models)
        part, own = slice(COMPONENTS * first, COMPONENTS * last), rows[:, self.first_error :]
        by_component = self._by_component(rows, first, last)
        half = by_component @ self._products[part, part] / 2 + (own @ self.components[part].T).toarray()
        return half, by_component, own

    def _by_component(self, rows: csr_array, first: int, last: int) -> Floats:
        """Give rows (n, 6 m) by the components of some models: a step moves all frames behind it (eq. 4)."""
        frames, elements = (
            rows[:, start + first * size : start + end * size].toarray().reshape(rows.shape[0], -1, size)
            for start, size, end in ((0, SIMILARITY_PARAMETERS, last + 1), (self.first_element, ELEMENTS, last))
        )
        behind = np.cumsum(frames[:, :0:-1], axis=1)[:, ::-1]
        result = (behind.transpose(1, 0, 2) @ self.steps[first:last]).transpose(1, 0, 2)
        result[:, :, :SCALE] += elements
        return result.reshape(rows.shape[0], -1)


def differentiate_strip(
    orientation: Orientation, formed: FormedStrip, similarity: Similarity, sigma: Floats
) -> StripErrors:
    """Differentiate a formed strip.

    similarity: from the strip to the frame of the ground.
    sigma: (k, 2), standard deviations of all image points of the project, mm.
    """
    rotations, models = similarity.rotation @ formed.rotations, len(formed.scale)
    across = formed.across if formed.left_ray else None
    pairs = differentiate_pairs(orientation, rotations[:-1], similarity.scale * formed.scale, across)
    centers = similarity(formed.centers)
    origin = centers.mean(axis=0)
    images = np.unique(orientation.rows)
    column = np.zeros(len(sigma), np.intp)
    column[images] = 2 * np.arange(len(images))
    columns = (column[orientation.rows][..., None] + np.arange(2)).reshape(-1, 4)
    stated = sigma[orientation.rows].reshape(-1, 4)
    width = 2 * len(images) + models
    used, row = np.flatnonzero(orientation.used), np.arange(len(columns))[:, None]
    by_parallax = elements_by_parallax(orientation)[used, :, None]
    by_image = (pairs.parallax_by_image * stated)[used, None]
    places = entries_of(orientation.pairs.pair[used], COMPONENTS)[:, :SCALE]
    elements = blocks(places, row[used], by_parallax, (COMPONENTS * models, len(row)))
    elements = elements @ blocks(row[used], columns[used], by_image, (len(row), width))
    return StripErrors(
        orientation=orientation,
        formed=formed,
        pairs=pairs,
        origin=origin,
        xyz=similarity(formed.xyz) - origin,
        centers=centers - origin,
        rotations=rotations,
        sigma=sigma,
        column=column,
        components=elements + _scales(formed, pairs, columns, stated, elements),
        steps=_steps(pairs, centers[1:] - origin),
    )


def _scales(formed: FormedStrip, pairs: PairErrors, columns: Numbers, stated: Floats, elements: csr_array) -> csr_array:
    """Differentiate the logarithms of the scales handed on by the pass points, among the elements (6 p, c).

    Seen from the common centre the scale k is the weighted mean of the ratios r = |b| / |a| of the vectors before and
    after: d ln k = sum p r (b . db / |b|^2 - a . da / |a|^2) / sum p r.  # eq. 139-141
    """
    joined, count = formed.junctions, elements.shape[0]
    used = np.flatnonzero(joined.used)
    junction, before, after = joined.junction[used], joined.before[used], joined.after[used]
    share = joined.weight[used] * joined.ratio[used]
    share /= np.bincount(junction, share)[junction]
    vectors = np.concatenate([pairs.point[before] - pairs.base[junction], -pairs.point[after]])
    by_vector = (np.tile(share, 2)[:, None] * vectors / (vectors**2).sum(axis=1)[:, None])[:, None]
    rows, some = COMPONENTS * np.tile(junction, 2)[:, None] + SCALE, np.concatenate([before, after])
    by_elements = by_vector @ pairs.point_by_elements[some]
    by_elements[: len(used)] -= by_vector[: len(used)] @ pairs.base_by_elements[junction]
    places = entries_of(np.concatenate([junction, junction + 1]), COMPONENTS)[:, :SCALE]
    by_images = by_vector @ pairs.point_by_image[some] * stated[some, None]
    of_elements = blocks(rows, places, by_elements, (count, count))
    return of_elements @ elements + blocks(rows, columns[some], by_images, elements.shape)


def _steps(pairs: PairErrors, centers: Floats) -> Floats:
    """Derive steps: t = dB - theta x (S - O) - mu (S - O), theta, mu; S the centre (p, 3) behind each model."""
    steps = np.zeros((len(centers), SIMILARITY_PARAMETERS, COMPONENTS))
    steps[:, :3, :SCALE] = pairs.base_by_elements + cross_matrix(centers) @ pairs.rotation_by_elements
    steps[:, 3:6, :SCALE] = pairs.rotation_by_elements
    steps[:, :3, SCALE], steps[:, 6, SCALE] = -centers, 1.0
    return steps


def blocks(rows: Numbers, columns: Numbers, values: Floats, shape: tuple[int, int]) -> csr_array:
    """Sum small matrices (n, a, b) into a sparse one, at rows (n, a) and columns (n, b) of it."""
    at = np.broadcast_arrays(rows[:, :, None].astype(np.int32), columns[:, None, :].astype(np.int32))
    return coo_array((values.ravel(), (at[0].ravel(), at[1].ravel())), shape=shape).tocsr()


def entries_of(numbers: Numbers, size: int) -> Numbers:
    """Rows or columns (n, size) of things that have so many each."""
    return size * numbers[:, None] + np.arange(size)


def _points_between(errors: StripErrors, place: Numbers, shape: tuple[int, int]) -> csr_array:
    """Sparse rows of points without a model, each in the middle between the first and the last of its rays.

    place: (q,), the place of each point of the strip among those asked for, -1 for all others.

    Such a point moves with the frame of the first photo, and by what moves the last one more than that.
    """
    item, image, photo, xy = _ends(errors, place)
    rays = np.concatenate([xy, np.full((*photo.shape, 1), -errors.orientation.pairs.focal)], axis=2)
    turns, centers = errors.rotations[photo], errors.centers[photo]
    ahead, by_turn, by_image = _middle(centers, np.einsum("nkij,nkj->nki", turns, rays), turns)
    by_last = ahead @ similarity_derivatives(centers[:, 1], np.zeros(3))
    by_last[:, :, 3:6] += by_turn
    by_first = similarity_derivatives(errors.xyz[item], np.zeros(3)) - by_last
    by_image *= errors.sigma[image][:, :, None, :]
    columns = [
        entries_of(photo[:, 0], SIMILARITY_PARAMETERS),
        entries_of(photo[:, 1], SIMILARITY_PARAMETERS),
        errors.first_error + errors.image_columns(image).reshape(-1, 4),
    ]
    values = np.concatenate([by_first, by_last, by_image[:, 0], by_image[:, 1]], axis=2)
    return blocks(entries_of(place[item], 3), np.concatenate(columns, axis=1), values, shape)


def _ends(errors: StripErrors, place: Numbers) -> tuple[Numbers, Numbers, Numbers, Floats]:
    """Points (n,) as rows of the strip; image points (n, 2), photos (n, 2) and coordinates (n, 2, 2) of both rays."""
    orientation, formed = errors.orientation, errors.formed
    pairs = orientation.pairs
    image = orientation.rows.ravel()
    item = np.searchsorted(formed.point, np.repeat(orientation.point, 2))
    photo = (pairs.pair[:, None] + np.arange(2)).ravel()
    xy = np.stack([pairs.left, pairs.right], axis=1).reshape(-1, 2)
    some = np.flatnonzero(np.isin(image, formed.bridging))
    some = some[place[item[some]] >= 0]
    some = some[np.lexsort((photo[some], item[some]))]
    points, begin, count = np.unique(item[some], return_index=True, return_counts=True)
    ends = some[np.column_stack([begin, begin + count - 1])]
    return points, image[ends], photo[ends], xy[ends]


def _middle(centers: Floats, rays: Floats, rotations: Floats) -> tuple[Floats, Floats, Floats]:
    """Differentiate (l1 r1 + b + l2 r2) / 2 with the factors (l1, l2) = G b, G the left inverse of [r1, -r2].

    Returns the derivatives by the second centre (n, 3, 3), by a small turn of the second photo (n, 3, 3), and by the
    image coordinates on both photos (n, 2, 3, 2).
    """
    first, second = rays[:, 0], rays[:, 1]
    inverse = np.linalg.pinv(np.stack([first, -second], axis=2))
    factors = np.einsum("nij,nj->ni", inverse, centers[:, 1] - centers[:, 0])
    half = np.stack([first, second], axis=2) @ inverse / 2
    ahead, back = np.eye(3) / 2 + half, np.eye(3) / 2 - half
    by_second, by_first = factors[:, 1, None, None] * ahead, factors[:, 0, None, None] * back
    by_image = np.stack([by_first @ rotations[:, 0, :, :2], by_second @ rotations[:, 1, :, :2]], axis=1)
    return ahead, -by_second @ cross_matrix(second), by_image


@dataclass(frozen=True, eq=False)
class PairErrors:
    """Derivatives of p pairs with m points, in the frame of the ground, the left photo of each pair held fast.

    Image coordinates are x and y of the left, then of the right image point.
    """

    base_by_elements: Floats  # (p, 3, 5): metres per radian
    rotation_by_elements: Floats  # (p, 3, 5): small rotation of the right photo
    point_by_elements: Floats  # (m, 3, 5): metres per radian
    point_by_image: Floats  # (m, 3, 4): the elements held fast, metres per mm
    parallax_by_image: Floats  # (m, 4): y parallax in the base frame, without unit
    point: Floats  # (m, 3): model point from the left perspective centre, metres
    base: Floats  # (p, 3): right from left perspective centre, metres


def differentiate_pairs(
    orientation: Orientation, rotations: Floats, scale: Floats, across: Floats | None = None
) -> PairErrors:
    """Differentiate all pairs of a strip.

    ``rotations`` (p, 3, 3) bring the left photo of each pair to the frame of the ground, ``scale`` (p,) is the length
    of each base in metres; ``across`` (p, 3), for points on left rays, is as in ``FormedStrip``.
    Rows whose rays do not meet hold numbers without meaning; they take part in nothing.
    """
    pairs = orientation.pairs
    left, right = _turns(orientation.elements)
    to_ground = rotations @ left.rotation.transpose(0, 2, 1) * scale[:, None, None]
    turn = np.concatenate([-left.rates, right.rates], axis=2)
    held, count = to_ground @ left.rates / scale[:, None, None], len(pairs.pair)
    point, by_elements, by_image = np.empty((count, 3)), np.empty((count, 3, 5)), np.empty((count, 3, 4))
    parallax_by_image = np.empty((count, 4))
    for rows in pieces(count, ROWS):
        pair = pairs.pair[rows]
        of_row = _by_row(to_ground, pair)
        with np.errstate(all="ignore"):
            levels = [
                _levelled(ray[:, rows], photo, pair, pairs.focal)
                for ray, photo in zip(orientation.rays, (left, right), strict=True)
            ]
            if across is None:
                met, by_levels = _on_both_rays(levels[0].xy, levels[1].xy, pairs.focal)
            else:
                seen_along = (left.rotation @ across[:, :, None])[pair, :, 0]
                met, by_levels = _on_left_rays(levels[0].xy, levels[1].xy, pairs.focal, seen_along)
            for level, by_level, elements, image, sign in zip(
                levels, by_levels, (LEFT, RIGHT), (slice(0, 2), slice(2, 4)), (1.0, -1.0), strict=True
            ):
                in_ground = _product(of_row, by_level)
                by_elements[rows, :, elements] = _product(in_ground, level.by_elements).transpose(2, 0, 1)
                by_image[rows, :, image] = _product(in_ground, level.by_image).transpose(2, 0, 1)
                parallax_by_image[rows, image] = sign * level.by_image[1].T
            # in the frame of the left photo, which is held: (p x) turned to the ground
            point[rows] = (of_row * met).sum(axis=1).T
            by_elements[rows, :, LEFT] += cross_matrix(point[rows]) @ held[pair]
    base = np.zeros((pairs.size, 3, 5))
    base[:, :, LEFT] = cross_matrix(np.array([1.0, 0.0, 0.0])) @ left.rates  # the left photo is held, the base turns
    return PairErrors(
        base_by_elements=to_ground @ base,
        rotation_by_elements=to_ground @ turn / scale[:, None, None],
        point_by_elements=by_elements,
        point_by_image=by_image,
        parallax_by_image=parallax_by_image,
        point=point,
        base=to_ground[:, :, 0],
    )


class _Turns(NamedTuple):
    """One photo of every pair against its base."""

    rotation: Floats  # (p, 3, 3)
    rates: Floats  # (p, 3, k): small rotation by the photo's angles among the elements


def _turns(elements: Floats) -> tuple[_Turns, _Turns]:
    """Rotations of left and right photos to the base, and their rates by alpha1, kappa1; alpha2, omega2, kappa2."""
    al1, ka1, al2, om2, ka2 = elements.T
    zero = np.zeros_like(al1)
    left = _Turns(
        from_alpha_omega_kappa(al1, 0.0, ka1),
        angle_rates(np.column_stack([al1, zero, ka1]), SYSTEM)[:, :, [0, 2]],  # omega1 is 0 by definition
    )
    right = _Turns(
        from_alpha_omega_kappa(al2, om2, ka2),
        angle_rates(np.column_stack([al2, om2, ka2]), SYSTEM),
    )
    return left, right


class _Level(NamedTuple):
    """Image points of one photo of every pair, brought to a level photo in the base frame, and their derivatives."""

    xy: Floats  # (2, m): image coordinates, mm
    by_elements: Floats  # (2, k, m): by the photo's angles among the elements
    by_image: Floats  # (2, 2, m)


def elements_by_parallax(orientation: Orientation) -> Floats:
    """Elements by the y parallax of each row, (m, 5), radians per mm, 0 if not used: -(J^T W J)^-1 J^T W (eq. 1)."""
    pairs, found = orientation.pairs, np.zeros((len(orientation.point), ELEMENTS))
    with np.errstate(all="ignore"):
        jacobian = linearised_parallaxes(orientation.elements, pairs).jacobian
        for row, weighted in zip(orientation.cofactors.transpose(1, 0, 2), jacobian * pairs.weight, strict=True):
            found -= row[pairs.pair] * weighted[:, None]
    found[~orientation.used] = 0.0
    return found


def _by_row(of_pairs: Floats, pair: Numbers) -> Floats:
    """Bring matrices of pairs (p, i, j) to the rows, (i, j, m), as all below has them: products run along the rows."""
    return of_pairs.transpose(1, 2, 0).take(pair, axis=2)


def _product(first: Floats, second: Floats) -> Floats:
    """Multiply matrices of rows, (i, j, m) and (j, k, m)."""
    return np.asarray(np.einsum("ijm,jkm->ikm", first, second), float)


def _levelled(ray: Floats, photo: _Turns, pair: Numbers, focal: float) -> _Level:
    """Bring rays (3, m) to a level photo: x = -f X/Z, y = -f Y/Z, by small turns of the photo and by its images."""
    x, y = xy = -focal * ray[:2] / ray[2]
    by_turn = np.stack([x * y, -(focal**2) - x * x, -y * focal, focal**2 + y * y, -x * y, x * focal]) / focal
    by_ray = np.zeros((2, 3, len(x)))
    by_ray[0, 0] = by_ray[1, 1] = -focal / ray[2]
    by_ray[:, 2] = -xy / ray[2]
    by_elements = _product(by_turn.reshape(2, 3, -1), _by_row(photo.rates, pair))
    return _Level(xy, by_elements, _product(by_ray, _by_row(photo.rotation[:, :, :2], pair)))


def _on_both_rays(left: Floats, right: Floats, focal: float) -> tuple[Floats, Floats]:
    """Intersect level image points (2, m): N = 1 / (x1 - x2), X = N x1, Y = N (y1 + y2) / 2, Z = -N f.

    Returns points (3, m), the base being 1, and their derivatives (2, 3, 2, m) by both image points.
    """
    factor = 1 / (left[0] - right[0])  # eq. 138 with the base along x
    point = np.stack([factor * left[0], factor * (left[1] + right[1]) / 2, -factor * focal])
    by_level = np.zeros((2, 3, 2, len(factor)))
    by_level[1, :, 0] = factor * point
    by_level[0, :, 0] = -by_level[1, :, 0]
    by_level[0, 0, 0] += factor
    by_level[:, 1, 1] = factor / 2
    return point, by_level


def _on_left_rays(left: Floats, right: Floats, focal: float, across: Floats) -> tuple[Floats, Floats]:
    """Intersect along the left rays: P = N l, N = w . (b x r) / w . (l x r) with b = (1, 0, 0); see ``_on_both_rays``.

    The rays l and r meet, seen along w, ``across`` (m, 3). Where a y parallax is left over, w matters to the point; how
    the elements turn it is of second order.
    """
    first, second = (np.column_stack([*each, np.full(len(across), -focal)]) for each in (left, right))
    base = np.cross(across, np.array([1.0, 0.0, 0.0]))
    size = np.einsum("mi,mi->m", across, np.cross(first, second))[:, None]
    factor = np.einsum("mi,mi->m", base, second)[:, None] / size
    by_first = -factor * np.cross(second, across) / size
    by_second = (base - factor * np.cross(across, first)) / size
    by_level = np.stack([first.T[:, None] * each.T[:2] for each in (by_first, by_second)])
    by_level[0, [0, 1], [0, 1]] += factor[:, 0]
    return (factor * first).T, by_level


WEAK_PAIR = 3.0  # times a good pair: six points in a band a third as wide as the base is long
MOST_POINTS = 60  # of a pair that are looked at
STANDARD = np.array([[x, y] for y in (0.0, 1.0, -1.0) for x in (-0.5, 0.5)])  # from the middle, in bases


def times_a_good_pair(oriented: Orientation) -> Floats:
    """Find the standard deviation of the points of each pair, rms, over that in a good pair, shape (p,).

    Sums over the points of tr(A A') / 2 + tr(B Q B') with their derivatives A by the image coordinates, B by the
    elements; Q their cofactors, as found or of the good pair. The left photo is held, the base is one.
    """
    oriented = _some_points(oriented)
    pairs = oriented.pairs
    level = np.tile(np.eye(3), (pairs.size, 1, 1))
    with np.errstate(all="ignore"):
        errors = differentiate_pairs(oriented, level, np.ones(pairs.size))
        used = in_front_of_cameras(oriented.elements, pairs)
        own = pairs.sums(np.where(used, (errors.point_by_image**2).sum(axis=(1, 2)) / 2.0, 0.0))
        by = np.where(used[:, None, None], errors.point_by_elements, 0.0)
        squares = pairs.sums(np.einsum("mci,mcj->ijm", by, by))
        standard = _standard_points(oriented)
        good = np.linalg.inv(normal_matrices(linearised_parallaxes(oriented.elements, standard).jacobian, standard))
        found, wanted = (own + np.einsum("pij,ijp->p", each, squares) for each in (oriented.cofactors, good))
        return np.asarray(np.sqrt(found / wanted), float)


def _some_points(oriented: Orientation) -> Orientation:
    """Take the points that were used, of dense pairs some: the others would say the same."""
    used = oriented.used
    wanted = np.isin(oriented.point, oriented.pairs.without(~used).some_points(MOST_POINTS)) & used
    return replace(take_rows(oriented, wanted, BY_ROW), pairs=oriented.pairs.without(~wanted))


def _standard_points(oriented: Orientation) -> Pairs:
    """Measure the six points of a good pair in every pair: level in the base frame, then by the photos as they are."""
    pairs = oriented.pairs
    (lx, ly, lz), (rx, _, rz) = oriented.rays
    count = pairs.sums(np.ones(len(pairs.pair)))
    x1, y1, x2 = (pairs.sums(-pairs.focal * across / depth) / count for across, depth in ((lx, lz), (ly, lz), (rx, rz)))
    base = x1 - x2
    number = np.repeat(np.arange(pairs.size), len(STANDARD))
    xy = np.tile(STANDARD, (pairs.size, 1)) * base[number, None]
    photos = []
    for x, rotation in zip((x1, x2), turns(oriented.elements), strict=True):
        level = np.column_stack([x[number] + xy[:, 0], y1[number] + xy[:, 1], np.full(len(xy), -pairs.focal)])
        seen = np.einsum("mi,mij->mj", level, rotation[number])
        photos.append(-pairs.focal * seen[:, :2] / seen[:, 2:])
    none = np.zeros(len(number), np.intp)
    return replace(
        pairs,
        starts=np.arange(pairs.size) * len(STANDARD),
        pair=number,
        left=photos[0],
        right=photos[1],
        weight=np.ones(len(number)),
        point=none,
        rows=np.column_stack([none, none]),
    )
