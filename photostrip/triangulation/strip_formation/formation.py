"""Forming the strip: orientation handed on from photo to photo, models brought to one scale.

Every photo takes its orientation from its left neighbour, so that all models are parallel to the frame of the
first photo; only their scales are free ("partially dependent models"). The ratio of the scales of two neighbouring
models does not depend on the chain before them, so all ratios are found in one batch, in the frame of the photo that
joins them.

Source: [001] eq. 125-141.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.triangulation.relative_orientation import relative
from photostrip.triangulation.strip_formation import scale_ratios
from photostrip.triangulation.strip_formation.intersection import intersect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.triangulation.relative_orientation.relative import Orientation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

SCALE_TRANSFERS = ("least_squares", "distances")
STEEPEST_BASE = 1e-6  # cosine of the base inclination


@dataclass(frozen=True)
class Settings:
    """How models are brought to one scale."""

    # ``"least_squares"``: all pass points with their precision; ``"distances"``: the textbook's mean of the ratios of
    # distances from the common centre
    scale_transfer: str = "least_squares"


@dataclass(frozen=True, eq=False)
class Junctions:
    """Pass points that join neighbouring models; joint i lies between models i and i+1, at photo i+1."""

    joint: Numbers  # (t,): joint of each row
    # before, after: (t,): rows of the point in the pairs' table, in the model before and after the joint
    before: Numbers
    after: Numbers
    point: Numbers  # (t,): point of each row
    ratio: Floats  # (t,): distance from the common centre in the model before, divided by that in the model after
    used: Flags  # (t,): whether the point took part in the scale transfer
    limit: Floats  # (t,): largest relative deviation of each ratio from its joint's factor that is not rejected
    factor: Floats  # (j,): ratio of the scales of the models, after over before
    spread: Floats  # (j,): relative standard deviation of a single ratio; NaN with one point
    weight: Floats  # (t,): weight of each ratio in the factor; 0 where it was not used


@dataclass(frozen=True, eq=False)
class FormedStrip:
    """A strip in the frame and scale of its first model."""

    centers: Floats  # (n, 3): perspective centres
    rotations: Floats  # (n, 3, 3): photo to strip
    scale: Floats  # (n-1,): scale factor k of each model
    # base_direction, base_inclination: (n-1,): tau and nu of each base in radians
    base_direction: Floats
    base_inclination: Floats
    # (m, 3): strip coordinates of every row of the pairs' table, from its own model; NaN where rays do not meet
    model_xyz: Floats
    vectors: Floats  # (m, 3): the same in the frame of the left photo of the model, from its centre, base length 1
    gap: Floats  # (m,): Y gap of the two rays at photo scale, mm
    point: Numbers  # (q,): numbers of the points of the strip, ascending
    xyz: Floats  # (q, 3): strip coordinates, mean over the models that hold the point
    models: Numbers  # (q,): number of those models
    junctions: Junctions
    # (b,): rows of the observations that place points without a model: of photos that are not neighbours
    bridging: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))
    # (q,): model with which such a point moves, -1 for all others; empty when there is none
    home: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))

    @property
    def model_count(self) -> Numbers:
        """Number of models of each point, shape (q,)."""
        return self.models

    @property
    def ends(self) -> Floats:
        """Centres of the first and the last photo, shape (2, 3)."""
        return self.centers[[0, -1]]


def hand_on(rotations: Floats) -> Floats:
    """Orientation chain: each photo from its left neighbour.

    Parameters
    ----------
    rotations : ndarray, shape (p, 3, 3)
        Right photo to left photo, of every pair.

    Returns
    -------
    ndarray, shape (p + 1, 3, 3)
        Photo to strip; the first photo is the frame.

    Notes
    -----
    Source: [001] eq. 131-134, ``A2 = A1 R`` with R = A1'^T A2'.
    """
    chain = np.empty((len(rotations) + 1, 3, 3))
    chain[0] = np.eye(3)
    for number, rotation in enumerate(rotations):
        chain[number + 1] = chain[number] @ rotation
    return chain


def model_points(orientation: Orientation) -> tuple[Floats, Floats, Flags]:
    """Points of every model in the frame of its left photo, base length 1.

    Returns
    -------
    vectors : ndarray, shape (m, 3)
        From the left perspective centre; NaN where rays do not meet in front.
    gap : ndarray, shape (m,)
        Y gap of the rays at photo scale in mm.
    sound : ndarray of bool, shape (m,)
        Whether the rays meet.
    """
    pairs = orientation.pairs
    left, right = relative.rays(orientation.elements, pairs)
    # In the base frame the x parallax is the whole parallax at any kappa; along the strip's X it may vanish.
    found = intersect(np.array([1.0, 0.0, 0.0]), left, right, pairs.focal)
    al1, ka1 = orientation.elements[:, 0], orientation.elements[:, 1]
    to_base = from_alpha_omega_kappa(al1, 0.0, ka1)
    vectors = np.einsum("mji,mj->mi", to_base[pairs.pair], found.xyz)
    return vectors, found.gap / found.ray_factor, found.sound


def _points_again(orientation: Orientation, earlier: tuple[FormedStrip, Flags] | None) -> tuple[Floats, Floats, Flags]:
    """Points of all models; of models that are what they were, those that are known."""
    if earlier is None:
        return model_points(orientation)
    formed, changed = earlier
    part, rows = relative.taken(orientation, np.flatnonzero(changed))
    vectors, gap = formed.vectors.copy(), formed.gap.copy()
    vectors[rows], gap[rows], _ = model_points(part)
    return vectors, gap, np.isfinite(vectors[:, 0])


def _junction_rows(
    orientation: Orientation, sound: Flags, aside: Flags | None = None, touched: Flags | None = None
) -> tuple[Numbers, Numbers, Numbers]:
    """Rows of points that stand in two neighbouring models: joint, row before, row after; of some joints or all."""
    usable = orientation.used & sound
    if touched is not None:
        usable &= (np.append(touched, False) | np.append(False, touched))[orientation.pairs.pair]
    rows = np.flatnonzero(usable)
    pair, point = orientation.pairs.pair[rows], orientation.point[rows]
    # the table is ordered by pair
    order = np.argsort(point, kind="stable")
    rows, pair, point = rows[order], pair[order], point[order]
    both = (point[1:] == point[:-1]) & (pair[1:] == pair[:-1] + 1)
    if touched is not None:
        both &= np.append(touched, False)[pair[:-1]]
    first = np.flatnonzero(both)
    before, after, joint = rows[first], rows[first + 1], pair[first]
    if aside is not None:
        good = ~(aside[before] | aside[after])
        # a joint with nothing better keeps what it has
        good |= (np.bincount(joint, good, orientation.pairs.size) == 0)[joint]
        before, after, joint = before[good], after[good], joint[good]
    order = np.argsort(joint, kind="stable")
    return joint[order], before[order], after[order]


def transfer_scale(
    orientation: Orientation,
    vectors: Floats,
    sound: Flags,
    settings: Settings,
    photos: Sequence[str],
    sigma: Floats | None = None,
    aside: Flags | None = None,
    touched: Flags | None = None,
) -> Junctions:
    """Scale of every model from the one before it, through the pass points at their common photo.

    Parameters
    ----------
    vectors : ndarray, shape (m, 3)
        Model points as ``model_points`` gives them.
    sound : ndarray of bool, shape (m,)
        Which of them exist.
    photos : sequence of str
        Photos of the strip, to name a broken joint.
    sigma : ndarray, shape (p,), optional
        Standard deviation of a y parallax of weight one in each pair, mm; by default from the pairs' own residuals.
    aside : ndarray of bool, shape (m,), optional
        Rows that must not join models, unless a joint has no other.
    touched : ndarray of bool, shape (p - 1,), optional
        Joints that are wanted; all by default. The others have no rows and the factor NaN.

    Returns
    -------
    Junctions
        Ratios, which of them were used, factors.

    Raises
    ------
    GeometryError
        When no point is common to three photos in a row.

    Notes
    -----
    Source: [001] eq. 139-141.
    """
    joints = orientation.pairs.size - 1
    wanted = np.ones(joints, bool) if touched is None else touched
    joint, before, after = _junction_rows(orientation, sound, aside, touched)
    _require_joints(joint, wanted, photos)
    base, _ = orientation.relative
    distance_before = np.linalg.norm(vectors[before] - base[joint], axis=1)
    distance_after = np.linalg.norm(vectors[after], axis=1)
    ratio = distance_before / distance_after
    weight = _weights(orientation, vectors, before, after, joint, settings)
    spreads = scale_ratios.spreads(orientation, vectors, (joint, before, after), sigma)
    count = int(wanted.sum())
    number = (np.cumsum(wanted) - 1)[joint]
    used, limit = scale_ratios.screen(ratio, weight, spreads, number, count)
    factor, spread = np.full((2, joints), np.nan)
    factor[wanted], spread[wanted] = _factors(ratio, weight * used, number, count, settings)
    return Junctions(joint, before, after, orientation.point[before], ratio, used, limit, factor, spread, weight * used)


def _joined(earlier: Junctions, fresh: Junctions, touched: Flags) -> Junctions:
    """Put joints made anew in the place of earlier ones."""
    kept = ~touched[earlier.joint]
    order = np.argsort(np.concatenate([earlier.joint[kept], fresh.joint]), kind="stable")
    rows = {
        name: np.concatenate([getattr(earlier, name)[kept], getattr(fresh, name)])[order]
        for name in ("joint", "before", "after", "point", "ratio", "used", "limit", "weight")
    }
    joints = {name: np.where(touched, getattr(fresh, name), getattr(earlier, name)) for name in ("factor", "spread")}
    return Junctions(**rows, **joints)


def _require_joints(joint: Numbers, wanted: Flags, photos: Sequence[str]) -> None:
    counts = np.bincount(joint, minlength=len(wanted))
    for number in np.flatnonzero((counts[: len(wanted)] == 0) & wanted).tolist():
        names = photos[number : number + 3]
        msg = (
            f"no point is common to photos {names[0]}, {names[1]} and {names[2]}: the models on either side of photo "
            f"{names[1]} cannot be brought to one scale; measure at least one pass point on all three (three or more "
            "are recommended)"
        )
        raise GeometryError(msg, photos=names, code="broken-joint")


def _weights(
    orientation: Orientation, vectors: Floats, before: Numbers, after: Numbers, joint: Numbers, settings: Settings
) -> Floats:
    """Weights of the ratios: 1 in the textbook form, otherwise by the parallaxes that made the distances."""
    if settings.scale_transfer == "distances":
        return np.ones(len(before))
    base, _ = orientation.relative
    # A distance from the centre is known to sigma_p / p of itself, and p is inverse to the depth along the base.
    depth_before = scale_ratios.depths(vectors[before], base[joint])
    depth_after = scale_ratios.depths(vectors[after], base[joint + 1])
    quality = np.minimum(orientation.pairs.weight[before], orientation.pairs.weight[after])
    weight: Floats = quality / (depth_before**2 + depth_after**2)
    return weight


def _factors(ratio: Floats, weight: Floats, joint: Numbers, joints: int, settings: Settings) -> tuple[Floats, Floats]:
    """Weighted mean ratio of each joint and the relative spread of a single one."""
    del settings
    total = np.bincount(joint, weight, joints)
    factor = np.bincount(joint, weight * ratio, joints) / total
    deviation = ratio / factor[joint] - 1
    count = np.bincount(joint, weight > 0, joints)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.sqrt(np.bincount(joint, weight * deviation**2, joints) / total * count / (count - 1))
    return factor, np.where(count > 1, spread, np.nan)


def form(
    orientation: Orientation,
    settings: Settings,
    photos: Sequence[str],
    sigma: Floats | None = None,
    aside: Flags | None = None,
    earlier: tuple[FormedStrip, Flags] | None = None,
) -> FormedStrip:
    """Form the strip from its oriented pairs.

    Parameters
    ----------
    orientation : Orientation
        Oriented pairs in flight order.
    sigma : ndarray, shape (p,), optional
        Standard deviation of a y parallax of weight one in each pair, mm; by default from the pairs' own residuals.
    aside : ndarray of bool, shape (m,), optional
        Rows whose points are in doubt: they join models only where a joint has no other.
    earlier : tuple of FormedStrip and ndarray of bool, shape (p,), optional
        The strip as it was formed before some of its pairs changed, and which: only joints on them are made anew.

    Returns
    -------
    FormedStrip
        Centres, rotations, scales and points in the frame of the first photo.

    Raises
    ------
    GeometryError
        When a joint is broken or a base is parallel to the strip's Z axis.
    """
    vectors, gap, sound = _points_again(orientation, earlier)
    touched = None if earlier is None else np.asarray(earlier[1][:-1] | earlier[1][1:], bool)
    junctions = transfer_scale(orientation, vectors, sound, settings, photos, sigma, aside, touched)
    if earlier is not None and touched is not None:
        junctions = _joined(earlier[0].junctions, junctions, touched)
    formed = placed(orientation, vectors, gap, junctions, orientation.used & sound)
    _refuse_vertical_base(np.diff(formed.centers, axis=0) / formed.scale[:, None], photos)
    return formed


def placed(orientation: Orientation, vectors: Floats, gap: Floats, junctions: Junctions, use: Flags) -> FormedStrip:
    """Put oriented models of known scales one behind the other.

    Parameters
    ----------
    orientation : Orientation
        Oriented pairs in flight order.
    vectors, gap : ndarray
        Model points as ``model_points`` gives them.
    use : ndarray of bool, shape (m,)
        Rows of the pairs' table whose points count.

    Returns
    -------
    FormedStrip
        Centres, rotations, scales and points in the frame of the first photo.
    """
    base, rotation = orientation.relative
    rotations = hand_on(rotation)
    scale = np.concatenate([[1.0], np.cumprod(junctions.factor)])
    bases = scale[:, None] * np.einsum("pij,pj->pi", rotations[:-1], base)
    centers = np.concatenate([np.zeros((1, 3)), np.cumsum(bases, axis=0)])
    pair = orientation.pairs.pair
    xyz = centers[pair] + scale[pair, None] * np.einsum("mij,mj->mi", rotations[pair], vectors)
    point, mean, models = mean_points(orientation.point, xyz, use)
    return FormedStrip(
        centers,
        rotations,
        scale,
        np.arctan2(bases[:, 1], bases[:, 0]),
        np.arcsin(np.clip(bases[:, 2] / scale, -1, 1)),
        xyz,
        vectors,
        gap,
        point,
        mean,
        models,
        junctions,
    )


def without(formed: FormedStrip, orientation: Orientation, left_out: Flags) -> FormedStrip:
    """Return a formed strip whose points are the means over fewer models.

    Parameters
    ----------
    left_out : ndarray of bool, shape (m,)
        Rows of the pairs' table that no longer count.

    Returns
    -------
    FormedStrip
        The same models; points without a row are gone, and rows left out have no model coordinates.
    """
    if not left_out.any():
        return formed
    model_xyz = np.where(left_out[:, None], np.nan, formed.model_xyz)
    use = orientation.used & np.isfinite(model_xyz).all(axis=1)
    point, mean, models = mean_points(orientation.point, model_xyz, use)
    return replace(formed, model_xyz=model_xyz, point=point, xyz=mean, models=models)


def _refuse_vertical_base(directions: Floats, photos: Sequence[str]) -> None:
    steep = np.flatnonzero(np.hypot(directions[:, 0], directions[:, 1]) < STEEPEST_BASE)
    for number in steep.tolist():
        names = photos[number : number + 2]
        msg = f"the base from photo {names[0]} to {names[1]} is parallel to the viewing direction"
        raise GeometryError(msg, photos=names, code="vertical-base")


def mean_points(point: Numbers, xyz: Floats, use: Flags) -> tuple[Numbers, Floats, Numbers]:
    """Mean coordinates of points that stand in several models.

    Parameters
    ----------
    point : ndarray of int, shape (m,)
        Point of each row.
    xyz : ndarray, shape (m, 3)
        Coordinates of each row.
    use : ndarray of bool, shape (m,)
        Rows that count.

    Returns
    -------
    numbers : ndarray of int, shape (q,)
        Points with at least one row, ascending.
    mean : ndarray, shape (q, 3)
        Their mean coordinates.
    count : ndarray of int, shape (q,)
        Rows that made each mean.
    """
    rows = np.flatnonzero(use)
    of_row = point[rows]
    count = np.bincount(of_row)
    numbers = np.flatnonzero(count).astype(np.intp)
    sums = np.column_stack([np.bincount(of_row, xyz[rows, axis]) for axis in range(3)])
    return numbers, sums[numbers] / count[numbers, None], count[numbers]
