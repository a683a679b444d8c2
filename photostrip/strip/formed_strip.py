"""Points where the rays of two photos meet.

Scale transfer: the scale of every model from the one before it, through the pass points of three photos.

Models i and i+1 have photo i+1 in common. The distances of a pass point from its perspective centre, in the model
before and in the model after, have the ratio of the scales of the two; the factor of the junction is the weighted mean
of the ratios of its points. It does not depend on the chain before it, so that all junctions are found in one batch.

Source: [001] eq. 139-141.

Forming the strip: orientation handed on from photo to photo, models of one scale put one behind the other.

Every photo takes its orientation from its left neighbour, so that all models are parallel to the frame of the
first photo; only their scales are free ("partially dependent models").

Source: [001] eq. 125-141.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.statistics import normal_quantile
from photostrip.strip.relative_orientation import Orientation
from photostrip.strip.robust import medians, scales

LEAST_X_PARALLAX = 1e-6  # of the principal distance: a smaller x parallax intersects nothing
EXCHANGED = [1, 0, 2]  # X and Y


@dataclass(frozen=True, eq=False)
class Intersection:
    """Model points from two photos."""

    xyz: Floats  # (m, 3): coordinates relative to the left perspective centre, in the unit of the base
    ray_factor: Floats  # (m,): ray factor N of the left ray (model unit per mm)
    # (m,): left minus right Y of the two rays, or X where the base lies along Y; in the unit of the base
    gap: Floats
    # (m,): false where the rays are parallel or meet behind a camera; the coordinates are NaN there
    sound: Flags


def intersect(base: Floats, left: Floats, right: Floats, focal: float, *, left_ray: bool = False) -> Intersection:
    """Forward intersection of the rays of two photos.

    base: (3,) or (3, m), base components BX, BY, BZ.
    left, right: (3, m), rays of the left and right photo, turned into the frame of the base, mm.
    left_ray: Y of the left ray, as [001] has it, instead of the mean of both, which the theory of errors of [000]
        assumes too.

    Source: [001] eq. 137 (second line corrected to y2) and 138; where the base is nearer to Y, X and Y change places.
    """
    across = lies_across(base)
    base, left, right = (_exchanged(vectors, across) for vectors in (base, left, right))
    bx, by, bz = base
    with np.errstate(divide="ignore", invalid="ignore"):
        x1, y1 = -focal * left[0] / left[2], -focal * left[1] / left[2]
        x2, y2 = -focal * right[0] / right[2], -focal * right[1] / right[2]
        parallax = x1 - x2
        n1 = (bx + x2 * bz / focal) / parallax  # eq. 138
        n2 = n1 + bz / focal
        y_left, y_right = n1 * y1, by + n2 * y2
        sound = (np.abs(parallax) > LEAST_X_PARALLAX * focal) & (n1 > 0) & (n2 > 0) & (left[2] < 0) & (right[2] < 0)
        y = y_left if left_ray else (y_left + y_right) / 2
        xyz = np.column_stack([*_exchanged(np.stack([n1 * x1, y, -n1 * focal]), across)])
    xyz[~sound] = np.nan
    return Intersection(xyz=xyz, ray_factor=n1, gap=y_left - y_right, sound=sound)


def lies_across(base: Floats) -> Flags:
    """Whether a base (3, ...) is nearer to Y than to X: there is no x parallax along Y, and eq. 138 divides by it."""
    return np.asarray(np.abs(base[1]) > np.abs(base[0]))


def _exchanged(vectors: Floats, where: Flags) -> Floats:
    """Exchange X and Y of vectors (3, m)."""
    return np.asarray(np.where(where, vectors[EXCHANGED], vectors), float)


SCALE_TRANSFERS = ("least_squares", "distances")
LEFT_RAY = "left"
INTERSECTIONS = ("mean", LEFT_RAY)
ALPHA = 0.01  # probability that a strip without gross errors loses a pass point
FEWEST_RATIOS = 3  # with two ratios nobody can tell which is wrong
SMALLEST_SIGMA = 1e-3  # mm, of a y parallax, when the pairs' own residuals have to say it


@dataclass(frozen=True)
class StripFormationSettings:
    """How model points are intersected, and models brought to one scale."""

    # ``"least_squares"``: all pass points with their precision; ``"distances"``: the textbook's mean of the ratios of
    # distances from the common centre
    scale_transfer: str = "least_squares"
    # ``"mean"``: Y is the mean of both rays; ``"left"``: points lie on the left ray, as in the source
    intersection: str = "mean"


@dataclass(frozen=True, eq=False)
class Junctions:
    """Pass points that join neighbouring models, and the ratios of their scales."""

    # junction, before, after: (t,): as in ``PassPoints``
    junction: Numbers
    before: Numbers
    after: Numbers
    point: Numbers  # (t,): point of each row
    ratio: Floats  # (t,): distance from the common centre in the model before, divided by that in the model after
    used: Flags  # (t,): whether the point took part in the scale transfer
    limit: Floats  # (t,): largest relative deviation of each ratio from its junction's factor that is not rejected
    weight: Floats  # (t,): weight of each ratio in the factor; 0 where it was not used
    factor: Floats  # (j,): ratio of the scales of the models, after over before
    spread: Floats  # (j,): relative standard deviation of a single ratio; NaN with one point
    # (j,): relative deviation of the farthest pass point where no majority agrees on the factor, else 0
    doubt: Floats


class PassPoints(NamedTuple):
    """Points that two neighbouring models have in common; junction i lies between models i and i+1, at photo i+1."""

    junction: Numbers  # (t,): junction of each row, ascending
    # before, after: (t,): rows of the point in the pairs' table, in the model before and after the junction
    before: Numbers
    after: Numbers


def transfer_scale(
    orientation: Orientation,
    vectors: Floats,
    settings: StripFormationSettings,
    photos: Sequence[str],
    sigma: Floats | None = None,
    doubtful: Flags | None = None,
    *,
    searched: bool = False,
) -> Junctions:
    """Scale of every model from the one before it, through the pass points at their common photo.

    vectors: (m, 3), model points in the frame of the left photo, base length 1; NaN where there is none.
    sigma: (p,), optional, standard deviation of a y parallax of weight one in each pair, mm; by default from the pairs'
        own residuals.
    doubtful: (m,), optional, rows that must not join models, unless a junction has no other.
    searched: whether the rays have been searched for gross errors: then all pass points count. Before that, those that
        lie far from the median of their junction are left out.
    Raises GeometryError when no point is common to three photos in a row.
    """
    junctions = orientation.pairs.size - 1
    every = _pass_points(orientation, vectors)
    _require_pass_points(np.bincount(every.junction, minlength=junctions), photos)
    base, _ = orientation.relative
    # eq. 139-141: distances from the common centre, before over after
    ratios = np.linalg.norm(vectors[every.before] - base[every.junction], axis=1)
    ratios /= np.linalg.norm(vectors[every.after], axis=1)
    joining = _joining(every, junctions, doubtful)
    (junction, before, after), ratio = (each[joining] for each in every), ratios[joining]
    depth = depths(vectors[before], base[junction]), depths(vectors[after], base[junction + 1])
    quality = np.minimum(orientation.pairs.weight[before], orientation.pairs.weight[after])
    weight = np.ones(len(junction))
    if settings.scale_transfer == "least_squares":
        # a distance from the centre is known to sigma_p / p of itself, and p is inverse to the depth along the base
        weight = quality / (depth[0] ** 2 + depth[1] ** 2)
    scatter = _scatter(orientation) if sigma is None else sigma
    # an image coordinate has half the variance of a parallax; that of the common photo acts on both distances
    coordinate = (scatter[junction] ** 2 + scatter[junction + 1] ** 2) / 4 / quality
    size = np.sqrt(coordinate * (sum(depth) ** 2 + depth[0] ** 2 + depth[1] ** 2)) / orientation.pairs.focal
    far, limit = contradictions(ratio, weight, size, junction, junctions)
    used = np.ones(len(ratio), bool) if searched else ~far
    factor, spread = mean_ratios(ratio, weight * used, junction, junctions)
    off = np.abs(np.log(ratios / factor[every.junction]))
    agrees = joining.copy()
    agrees[joining] = used & (off[joining] <= limit)
    return Junctions(
        junction=junction,
        before=before,
        after=after,
        point=orientation.point[before],
        ratio=ratio,
        used=used,
        limit=limit,
        weight=weight * used,
        factor=factor,
        spread=spread,
        doubt=_doubt(off, agrees, every.junction, junctions),
    )


def contradictions(
    ratio: Floats, weight: Floats, size: Floats, junction: Numbers, junctions: int
) -> tuple[Flags, Floats]:
    """Find the ratios far from the median of their junction, and the largest relative deviation of each that is not.

    The orientations of the two models deform them and make the ratios scatter more than the image coordinates of the
    points do: how much more, the median deviation in the whole strip tells. Of two ratios none is far, nobody can tell
    which.

    size: (t,), relative standard deviation of each ratio by its own image coordinates.
    junction: (t,), junction of each ratio, ascending.
    """
    value = np.log(ratio)
    many = (np.bincount(junction, minlength=junctions) >= FEWEST_RATIOS)[junction]
    off = np.abs(value - medians(value, weight, junction, junctions)[junction])
    counts = (many & (off > 0)).astype(float)  # the median itself says nothing
    scale = float(scales(off / size, counts, np.zeros(len(off), np.intp), 1)[0])
    limit = normal_quantile(1 - ALPHA / (2 * max(len(off), 1))) * max(1.0, np.nan_to_num(scale)) * size
    return (off > limit) & many, limit


def depths(vectors: Floats, base: Floats) -> Floats:
    """Distances of points from the base line, from vectors to them and unit vectors of the base (t, 3)."""
    (x, y, z), (u, v, w) = vectors.T, base.T
    return np.asarray(np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2), float)


def _scatter(orientation: Orientation) -> Floats:
    """Estimate the standard deviation of a y parallax from all pairs together."""
    known = orientation.sigma0[np.isfinite(orientation.sigma0)]
    value = np.sqrt(2.0) * np.median(known) if len(known) else 0.0
    return np.full(orientation.pairs.size, max(value, SMALLEST_SIGMA))


def _pass_points(orientation: Orientation, vectors: Floats) -> PassPoints:
    """Points that stand in both models of a junction."""
    rows = np.flatnonzero(orientation.used & np.isfinite(vectors[:, 0]))
    # the table is ordered by pair
    rows = rows[np.argsort(orientation.point[rows], kind="stable")]
    pair, point = orientation.pairs.pair[rows], orientation.point[rows]
    first = np.flatnonzero((point[1:] == point[:-1]) & (pair[1:] == pair[:-1] + 1))
    first = first[np.argsort(pair[first], kind="stable")]
    return PassPoints(pair[first], rows[first], rows[first + 1])


def _joining(points: PassPoints, junctions: int, doubtful: Flags | None) -> Flags:
    """Pass points that are not doubtful; a junction with nothing better keeps what it has."""
    if doubtful is None:
        return np.ones(len(points.junction), bool)
    good = ~(doubtful[points.before] | doubtful[points.after])
    good |= (np.bincount(points.junction, good, junctions) == 0)[points.junction]
    return np.asarray(good, bool)


def _doubt(off: Floats, agrees: Flags, junction: Numbers, junctions: int) -> Floats:
    """Largest deviation of a pass point where those that disagree are as many as those that agree."""
    doubtful = np.bincount(junction, agrees, junctions) <= np.bincount(junction, ~agrees, junctions)
    largest = np.zeros(junctions)
    np.maximum.at(largest, junction, np.where(agrees, 0.0, off))
    return np.where(doubtful, largest, 0.0)


def _require_pass_points(counts: Numbers, photos: Sequence[str]) -> None:
    for number in np.flatnonzero(counts == 0).tolist():
        names = photos[number : number + 3]
        msg = (
            f"no point is common to photos {names[0]}, {names[1]} and {names[2]}: the models on either side of photo "
            f"{names[1]} cannot be brought to one scale; measure at least one pass point on all three (three or more "
            "are recommended)"
        )
        raise GeometryError(msg, photos=names, code="broken-joint")


def mean_ratios(ratio: Floats, weight: Floats, junction: Numbers, junctions: int) -> tuple[Floats, Floats]:
    """Weighted mean ratio of each junction, and the relative standard deviation of a single one."""
    total = np.bincount(junction, weight, junctions)
    factor = np.bincount(junction, weight * ratio, junctions) / total  # eq. 139-141
    deviation = ratio / factor[junction] - 1
    count = np.bincount(junction, weight > 0, junctions)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.sqrt(np.bincount(junction, weight * deviation**2, junctions) / total * count / (count - 1))
    return factor, np.where(count > 1, spread, np.nan)


STEEPEST_BASE = 1e-6  # cosine of the base inclination


class FirstPhoto(NamedTuple):
    """What is given of the first photo of a strip, and of its first base: the frame and the scale of the strip."""

    rotation: Floats  # (3, 3): photo to strip
    base: float  # length of the first base in the strip


NOTHING_GIVEN = FirstPhoto(np.eye(3), 1.0)


class StereoModels(NamedTuple):
    """Points of every model, each in the frame of its left photo."""

    vectors: Floats  # (m, 3): from the left perspective centre, base length 1; NaN where rays do not meet in front
    gap: Floats  # (m,): Y gap of the two rays at photo scale, mm
    # whether points lie on the left ray, where the right one meets it seen along the strip's axis across the base
    left_ray: bool = False

    @property
    def sound(self) -> Flags:
        """Whether the rays of each row meet."""
        return np.isfinite(self.vectors[:, 0])


@dataclass(frozen=True, eq=False)
class FormedStrip:
    """A strip in the frame and scale of its first model."""

    centers: Floats  # (n, 3): perspective centres
    rotations: Floats  # (n, 3, 3): photo to strip
    scale: Floats  # (n-1,): length of each base
    # base_direction, base_inclination: (n-1,): tau and nu of each base in radians
    base_direction: Floats
    base_inclination: Floats
    # (m, 3): strip coordinates of every row of the pairs' table, from its own model; NaN where rays do not meet
    model_xyz: Floats
    gap: Floats  # (m,): as in ``StereoModels``
    point: Numbers  # (q,): numbers of the points of the strip, ascending
    xyz: Floats  # (q, 3): strip coordinates, mean over the models that hold the point
    model_count: Numbers  # (q,): number of those models
    junctions: Junctions
    left_ray: bool = False  # as in ``StereoModels``
    # (b,): rows of the observations that place points without a model: of photos that are not neighbours
    bridging: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))
    # (q,): model with which such a point moves, -1 for all others; empty when there is none
    home: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))

    @property
    def first(self) -> FirstPhoto:
        """The frame and the scale of the strip."""
        return FirstPhoto(self.rotations[0], float(self.scale[0]))

    @property
    def scale_factor(self) -> Floats:
        """Scale factor k of each model, which has a base as long as the first one; shape (n-1,)."""
        return np.asarray(self.scale / self.scale[0], float)

    @property
    def across(self) -> Floats:
        """Axis of the strip, Y or else X, that lies across each base, in the frame of its left photo; (n-1, 3)."""
        axis = np.where(lies_across(np.diff(self.centers, axis=0).T), 0, 1)
        return self.rotations[np.arange(len(axis)), axis]

    @property
    def ends(self) -> Floats:
        """Centres of the first and the last photo, shape (2, 3)."""
        return self.centers[[0, -1]]


def form_from_pairs(
    orientation: Orientation,
    settings: StripFormationSettings,
    photos: Sequence[str],
    sigma: Floats | None = None,
    doubtful: Flags | None = None,
    *,
    searched: bool = False,
    first: FirstPhoto = NOTHING_GIVEN,
) -> FormedStrip:
    """Form the strip from its oriented pairs, in the frame of the first photo unless its angles are given.

    sigma, doubtful, searched: as in ``transfer_scale``.
    Raises GeometryError when a junction is broken or a base is parallel to the strip's Z axis.
    """
    models = model_points(orientation, first, left_ray=settings.intersection == LEFT_RAY)
    junctions = transfer_scale(orientation, models.vectors, settings, photos, sigma, doubtful, searched=searched)
    formed = place_models(orientation, models, junctions, orientation.used & models.sound, first)
    _refuse_vertical_base(np.diff(formed.centers, axis=0) / formed.scale[:, None], photos)
    return without_rows(formed, orientation, _elsewhere(orientation, formed))


def _elsewhere(orientation: Orientation, formed: FormedStrip) -> Flags:
    """Rows (m,) of points that stand again farther away than a photo reaches on the ground: two under one id.

    Of such a point the longest run of models stays. The mean of both places would be nowhere, and its precision reach
    over all models between.
    """
    pairs, gone = orientation.pairs, np.zeros(len(orientation.point), bool)
    rows = np.flatnonzero(orientation.used & np.isfinite(formed.model_xyz).all(axis=1))
    rows = rows[np.argsort(orientation.point[rows], kind="stable")]  # the models of a point one after the other
    point, model, xyz = orientation.point[rows], pairs.pair[rows], formed.model_xyz[rows]
    other = point[1:] != point[:-1]
    apart = ~other & (np.diff(model) > 1)  # no photo is in both models
    if apart.any():
        depth = np.median(np.linalg.norm(xyz - formed.centers[model], axis=1))
        extent = np.linalg.norm(np.ptp(np.concatenate([pairs.left, pairs.right]), axis=0))
        apart &= np.linalg.norm(np.diff(xyz, axis=0), axis=1) > extent / pairs.focal * depth
        begins = np.flatnonzero(np.append(True, other | apart))  # of the runs
        length = np.diff(np.append(begins, len(rows)))
        longest = np.lexsort((-length, point[begins]))
        longest = longest[np.append(True, np.diff(point[begins][longest]) > 0)]
        stays = np.zeros(len(begins), bool)
        stays[longest] = True
        gone[rows] = np.repeat(~stays, length)
    return gone


def model_points(
    orientation: Orientation, first: FirstPhoto = NOTHING_GIVEN, *, left_ray: bool = False
) -> StereoModels:
    """Points of every model in the frame of its left photo, base length 1; `first` is of use on left rays only."""
    found, frames = intersect_models(orientation, first, left_ray=left_ray)
    vectors = np.einsum("mji,mj->mi", frames[orientation.pairs.pair], found.xyz)
    return StereoModels(vectors, found.gap / found.ray_factor, left_ray)


def intersect_models(orientation: Orientation, first: FirstPhoto, *, left_ray: bool) -> tuple[Intersection, Floats]:
    """Intersect the rays of all pairs, base length 1; return the rotations of the left photos to the frames, too.

    For the mean of both rays these are the base frames: there the x parallax is the whole parallax at any kappa; for
    the left ray it is the frame of the strip, as in [001], along whose nearer axis at least 0.7 of it is left.
    """
    pairs = orientation.pairs
    if not left_ray:
        al1, ka1 = orientation.elements[:, 0], orientation.elements[:, 1]
        frames = np.asarray(from_alpha_omega_kappa(al1, 0.0, ka1), float)
        return intersect(np.array([1.0, 0.0, 0.0]), *orientation.rays, pairs.focal), frames
    base, rotation = orientation.relative
    chain = hand_on_rotations(rotation, first.rotation)
    left, right = (
        np.einsum("mij,mj->im", turns[pairs.pair], np.column_stack([xy, np.full(len(xy), -pairs.focal)]))
        for turns, xy in ((chain[:-1], pairs.left), (chain[1:], pairs.right))
    )
    along = np.einsum("pij,pj->ip", chain[:-1], base)[:, pairs.pair]
    return intersect(along, left, right, pairs.focal, left_ray=True), chain[:-1]


def hand_on_rotations(rotations: Floats, first: Floats | None = None) -> Floats:
    """Rotations (p + 1, 3, 3) of all photos to the strip, each from its left neighbour: A2 = A1 R with R = A1'^T A2'.

    The first photo is the frame unless its rotation is given; R, (p, 3, 3), takes the right photo of every pair to the
    left one. Source: [001] eq. 131-134.
    """
    chain = np.empty((len(rotations) + 1, 3, 3))
    chain[0] = np.eye(3) if first is None else first
    for number, rotation in enumerate(rotations):
        chain[number + 1] = chain[number] @ rotation  # eq. 131
    return chain


def place_models(
    orientation: Orientation, models: StereoModels, junctions: Junctions, use: Flags, first: FirstPhoto = NOTHING_GIVEN
) -> FormedStrip:
    """Put oriented models of known scales one behind the other; `use`, shape (m,), says which rows make points."""
    base, rotation = orientation.relative
    rotations = hand_on_rotations(rotation, first.rotation)
    scale = first.base * np.concatenate([[1.0], np.cumprod(junctions.factor)])
    directions = np.einsum("pij,pj->pi", rotations[:-1], base)
    bases = scale[:, None] * directions
    centers = np.concatenate([np.zeros((1, 3)), np.cumsum(bases, axis=0)])  # eq. 136
    pair = orientation.pairs.pair
    xyz = centers[pair] + scale[pair, None] * np.einsum("mij,mj->mi", rotations[pair], models.vectors)
    mean = mean_points(orientation.point, xyz, use)
    tau, nu = base_angles(directions)
    return FormedStrip(
        centers=centers,
        rotations=rotations,
        scale=scale,
        base_direction=tau,
        base_inclination=nu,
        model_xyz=xyz,
        gap=models.gap,
        point=mean.point,
        xyz=mean.xyz,
        model_count=mean.model_count,
        junctions=junctions,
        left_ray=models.left_ray,
    )


def base_frames(rotations: Floats, elements: Floats) -> Floats:
    """Rotations A_taunu (p, 3, 3) from base frames to the strip: A1 A(alpha1', 0, kappa1')^T, first column the base.

    rotations, elements: (p, 3, 3) and (p, 5), of the left photos to the strip, and relative to their bases.

    Source: [001] eq. 128.
    """
    left = np.asarray(from_alpha_omega_kappa(elements[:, 0], 0.0, elements[:, 1]), float)
    return np.asarray(rotations @ np.swapaxes(left, 1, 2), float)


def base_angles(directions: Floats) -> tuple[Floats, Floats]:
    """Direction tau and inclination nu of unit vectors of bases (..., 3), radians; [001] eq. 128-130."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.asarray(np.arctan2(y, x), float), np.asarray(np.arcsin(np.clip(z, -1.0, 1.0)), float)


def without_rows(formed: FormedStrip, orientation: Orientation, left_out: Flags) -> FormedStrip:
    """Leave out rows of the pairs' table: points become the means over fewer models, or are gone."""
    if not left_out.any():
        return formed
    model_xyz = np.where(left_out[:, None], np.nan, formed.model_xyz)
    use = orientation.used & np.isfinite(model_xyz).all(axis=1)
    mean = mean_points(orientation.point, model_xyz, use)
    return replace(formed, model_xyz=model_xyz, point=mean.point, xyz=mean.xyz, model_count=mean.model_count)


def without_points(formed: FormedStrip, orientation: Orientation, points: Numbers) -> FormedStrip:
    """Leave out points: nothing places them any more."""
    stay, gone = ~np.isin(formed.point, points), np.isin(orientation.point, points)
    return replace(
        formed,
        model_xyz=np.where(gone[:, None], np.nan, formed.model_xyz),
        point=formed.point[stay],
        xyz=formed.xyz[stay],
        model_count=formed.model_count[stay],
        bridging=formed.bridging[~np.isin(formed.bridging, orientation.rows[gone])],
        home=formed.home[stay] if len(formed.home) else formed.home,
    )


def _refuse_vertical_base(directions: Floats, photos: Sequence[str]) -> None:
    steep = np.flatnonzero(np.hypot(directions[:, 0], directions[:, 1]) < STEEPEST_BASE)
    for number in steep.tolist():
        names = photos[number : number + 2]
        msg = f"the base from photo {names[0]} to {names[1]} is parallel to the viewing direction"
        raise GeometryError(msg, photos=names, code="vertical-base")


class MeanPoints(NamedTuple):
    """Points that stand in several models."""

    point: Numbers  # (q,): points with at least one row, ascending
    xyz: Floats  # (q, 3): their mean coordinates
    model_count: Numbers  # (q,): rows that made each mean


def mean_points(point: Numbers, xyz: Floats, use: Flags) -> MeanPoints:
    """Mean coordinates of points out of the rows that count; `point` and `xyz` are those of each row."""
    rows = np.flatnonzero(use)
    of_row = point[rows]
    count = np.bincount(of_row)
    numbers = np.flatnonzero(count).astype(np.intp)
    sums = np.column_stack([np.bincount(of_row, xyz[rows, axis]) for axis in range(3)])
    return MeanPoints(numbers, sums[numbers] / count[numbers, None], count[numbers])
