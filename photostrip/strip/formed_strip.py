"""Forming the strip: orientation handed on from photo to photo, models of one scale put one behind the other.

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
from photostrip.strip.intersection import Intersection, intersect, lies_across
from photostrip.strip.relative_orientation.orientation import Orientation
from photostrip.strip.scale_transfer import LEFT_RAY, Junctions, StripFormationSettings, transfer_scale

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
    point_weight: Floats | None = None,
) -> FormedStrip:
    """Form the strip from its oriented pairs, in the frame of the first photo unless its angles are given.

    sigma, doubtful, searched, point_weight: as in ``transfer_scale``.
    Raises GeometryError when a junction is broken or a base is parallel to the strip's Z axis.
    """
    models = model_points(orientation, first, left_ray=settings.intersection == LEFT_RAY)
    junctions = transfer_scale(
        orientation, models.vectors, settings, photos, sigma, doubtful, searched=searched, point_weight=point_weight
    )
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
