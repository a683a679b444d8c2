"""A strip that lies on its control: set level, its bending taken out.

In plan the bending is taken out by a conformal polynomial, with as few terms as leave no more than makes sense.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.plausibility.control.plan_fit import (
    LEAST_POINTS,
    TINY,
    PlanSimilarity,
    RobustFit,
    fit_robustly,
    fit_similarity,
    upright,
)

Complex = NDArray[np.complex128]

FOOT = 0.3048  # metres
KINDS_OF_FEET = "international feet (0.3048 m) and US survey feet (1200/3937 m) differ by 2 ppm, 1.2 m at 600 km"
FEET_TOLERANCE = 0.04  # relative, of a ratio to that of foot and metre
SIMPLE_SIGMAS = 2.5  # times what makes sense that a fit may leave before bending is taken out
LEAST_REDUNDANCY = 2  # redundancy that must be left then
LEAST_AHEAD = 0.1  # of the distance of a point from a photo, along its axis: within 84 degrees of it


class WrittenAxes(NamedTuple):
    """What a step of a written coordinate is in the level frame."""

    unit: Floats  # (n, 3): metres in a unit of the written coordinates
    axes: Floats  # (n, 3, 3): directions of the written axes, as rows


@dataclass(frozen=True, eq=False)
class GivenPoints:
    """Given points that a strip shows."""

    ids: tuple[str, ...]
    # (n, 3): east, north, up in metres in a level frame in the middle of the control; NaN where not given
    xyz: Floats
    use: Flags  # (n, 3): which coordinates count
    check: Flags  # (n,): check points
    group: Numbers  # (n,): control list of each
    # (n, 3): the coordinates as they are written, east, north, up; NaN where slips of the pen cannot be sought in them
    written: Floats
    moved: Floats  # (n, 3): what was taken from them, so that a point far from all others comes among them
    written_axes: Callable[[], WrittenAxes]  # what a step of them is; worked out for points that stand out only
    sigma: tuple[float, float]  # usual standard deviation of the given coordinates in plan and in height, metres

    @property
    def plan(self) -> Complex:
        """Given places E + iN, metres."""
        return np.asarray(self.xyz[:, 0] + 1j * self.xyz[:, 1])

    @cached_property
    def steps(self) -> WrittenAxes:
        """What a step of the written coordinates is."""
        return self.written_axes()


@dataclass(frozen=True, eq=False)
class Rays:
    """What the photos of a strip show of one point."""

    xy: Floats  # (r, 2): image coordinates, mm
    sigma: Floats  # (r,): their standard deviations, mm
    centers: Floats  # (r, 3): perspective centres in the strip
    rotations: Floats  # (r, 3, 3): photo to strip
    focal: float  # principal distance, mm

    def __len__(self) -> int:
        return len(self.xy)

    def shown(self, xyz: Floats) -> bool:
        """Whether a place (3,) in the strip lies in front of all photos, within 84 degrees of their axes."""
        away = xyz - self.centers
        ahead = -np.einsum("rj,rj->r", self.rotations[:, :, 2], away)
        return bool((ahead > LEAST_AHEAD * np.linalg.norm(away, axis=1)).all())

    def residuals(self, xyz: Floats) -> tuple[Floats, Floats]:
        """Image residuals of a place (3,) in the strip, and how a step of it moves its images.

        Returns residual: (r, 2), where the place comes to lie on each photo, minus where the point was measured; mm.
        Returns jacobian: (r, 2, 3), millimetres on each photo for a step in the strip.
        """
        back = self.rotations.transpose(0, 2, 1)
        on_strip = np.einsum("rij,rj->ri", back, xyz - self.centers)
        depth = np.minimum(on_strip[:, 2], -TINY)[:, None]
        image = -self.focal * on_strip[:, :2] / depth
        jacobian = -(self.focal * back[:, :2] + image[:, :, None] * back[:, 2:]) / depth[:, :, None]
        return image - self.xy, jacobian


NO_RAYS = Rays(
    xy=np.zeros((0, 2)), sigma=np.zeros(0), centers=np.zeros((0, 3)), rotations=np.zeros((0, 3, 3)), focal=1.0
)


@dataclass(frozen=True, eq=False)
class StripPoints:
    """The same points in the coordinates of a strip."""

    strip: str
    xyz: Floats  # (n, 3): strip coordinates; the third may be NaN, when only a mosaic is known
    axes: Floats  # (p, 3): third axes of its photos, from the ground to the camera
    centers: Floats  # (p, 3): perspective centres
    # a-priori standard deviation of the difference between strip and given coordinates in plan and in height, as a
    # share of the distance from camera to ground
    floor: tuple[float, float]
    depth: float  # distance from camera to ground, in units of the strip
    base_angle: float = 0.0  # direction of the bases on the photos, radians from the x axis; a mean
    rays_of: Callable[[str], Rays] = lambda _name: NO_RAYS  # gives the rays of a point by its id; a mosaic knows none


@dataclass(frozen=True, eq=False)
class StraightenedStrip:
    """A strip on its control, bending taken out."""

    # along, across: (n,): places of the points along and across the strip, metres
    along: Floats
    across: Floats
    height: Floats  # (n,): heights in the strip, metres
    floor: tuple[float, float]  # a-priori standard deviations in plan and height, metres
    plan: RobustFit
    strip_from_level: Floats  # (3, 3): steps in the strip from steps in the level frame, metres


def upright_coordinates(xyz: Floats, turn: Floats) -> Floats:
    """Turn strip coordinates (n, 3) upright; points of a mosaic have no third one and are upright already."""
    flat = np.isfinite(xyz[:, :2]).all(axis=1) & ~np.isfinite(xyz[:, 2])
    result = xyz @ turn.T
    result[flat] = xyz[flat]
    return result


@dataclass(frozen=True, eq=False)
class LevelStrip:
    w: Complex  # (n,): places of its points
    z: Floats  # (n,): their heights, in the same unit
    similarity: PlanSimilarity  # the strip on its control in plan
    turn: Floats  # (3, 3): steps of the level strip from steps of the strip as it was formed
    depth: float  # distance from camera to ground, in the unit of `w`

    @property
    def scale(self) -> float:
        """Metres in a unit of `w`."""
        return abs(self.similarity.turn)


def turn_level(given: GivenPoints, level: LevelStrip, floor: float, in_fit: Flags) -> LevelStrip:
    """Turn a strip by the tilt that the heights of its control show; the cameras look down within degrees only.

    Relief times that tilt is a displacement in plan. Where the heights do not help, all stays as it is.

    floor: smallest standard deviation of a height that makes sense, as a share of the distance from camera to ground.
    """
    similarity = level.similarity
    place, height = similarity(level.w), level.scale * level.z
    usable = given.use[:, 2] & ~given.check & np.isfinite(given.xyz[:, 2]) & np.isfinite(height) & np.isfinite(place)
    if usable.sum() <= LEAST_POINTS:
        return level
    mean = float(height[usable].mean())
    columns = [np.ones(len(place)), place.real, place.imag]
    if usable.sum() >= LEAST_POINTS + 2 * LEAST_REDUNDANCY:
        columns.append(height - mean)  # a wrong unit of the heights is no tilt
    design = np.where(usable[:, None], np.column_stack(columns), 0.0)
    value = np.where(usable, given.xyz[:, 2] - height, 0.0)
    depth = level.depth * level.scale
    least = max(floor * depth, given.sigma[1], TINY)
    tilt = fit_robustly(design, value, usable, least).coefficient[1:3]
    leaning = upright(np.array([[tilt[0], tilt[1], 1.0]]))
    turned = np.column_stack([place.real, place.imag, height]) @ leaning.T
    w = turned[:, 0] + 1j * turned[:, 1]
    again = fit_similarity(w[in_fit], given.plan[in_fit])
    if again is None or again.median > similarity.median:
        return level
    return LevelStrip(w, turned[:, 2], again, turn=leaning @ similarity.matrix @ level.turn, depth=depth)


def straighten(given: GivenPoints, level: LevelStrip, floor: tuple[float, float], in_fit: Flags) -> StraightenedStrip:
    """Take the bending out of the plan: a conformal polynomial of degree 0 to 2 along the strip.

    floor: smallest standard deviations that make sense in plan and height, as shares of the distance of camera and
        ground.
    in_fit: (n,), points that may say how the strip bends.
    """
    distance = level.depth * level.scale
    least = (
        max(float(np.hypot(floor[0] * distance, given.sigma[0])), TINY),
        max(float(np.hypot(floor[1] * distance, given.sigma[1])), TINY),
    )
    place = level.similarity(level.w)
    axis = _direction(place[in_fit])
    middle = place[in_fit].mean()
    local = (place - middle) / axis
    known = np.isfinite(given.plan)
    columns = [np.where(np.isfinite(local), local, 0.0) ** k for k in range(3)]
    bent = fit_simplest(columns, 2, np.where(known, given.plan, 0.0), in_fit, least[0])[1]
    residual = np.where(known & np.isfinite(level.w), bent.residual, np.nan)
    return StraightenedStrip(
        along=local.real,
        across=local.imag,
        height=level.scale * level.z,
        floor=least,
        plan=replace(bent, residual=residual),
        strip_from_level=np.asarray(np.linalg.inv(level.similarity.matrix @ level.turn), float),
    )


def fit_simplest(
    columns: list[NDArray[Any]],
    least: int,
    values: NDArray[Any],
    in_fit: Flags,
    floor: float,
) -> tuple[NDArray[Any], RobustFit]:
    """Fit as few columns, the simplest first, as leave no more than makes sense, or least; `least` are always taken.

    More columns leave more where too many of the points are wrong for them.

    Returns columns: (n, c), those that were fitted.
    """
    fits: list[tuple[NDArray[Any], RobustFit]] = []
    for number in range(least, len(columns) + 1):
        chosen = np.column_stack(columns[:number])
        fits.append((chosen, fit_robustly(chosen, values, in_fit, floor)))
        spare = int(in_fit.sum()) - number - 1
        if spare < LEAST_REDUNDANCY or fits[-1][1].sigma0 <= SIMPLE_SIGMAS * floor:
            break
    return min(fits, key=lambda each: each[1].sigma0)


def _direction(place: Complex) -> complex:
    """Direction of the largest extent, of length one."""
    d = place - place.mean()
    axis = complex(np.sqrt((d**2).sum()))
    return axis / abs(axis) if abs(axis) > TINY else 1.0 + 0.0j
