"""A strip that lies on its control: set level, its bending taken out.

In plan the bending is taken out by a conformal polynomial, with as few terms as leave no more than makes sense.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from photostrip.triangulation.plausibility.control.control_fit import LEAST, SMALL, Bent, Laid, bend, lay, upright

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Flags = NDArray[np.bool_]
    Numbers = NDArray[np.intp]

FOOT, SURVEY_FOOT = 0.3048, 1200.0 / 3937.0  # metres; they differ by 2 ppm
FEET_NEAR = 0.04  # relative, of a ratio to that of foot and metre
SIMPLE = 2.5  # times what makes sense that a fit may leave before bending is taken out
SPARE = 2  # redundancy that must be left then
FRONT = 0.1  # of the distance of a point from a photo, along its axis: within 84 degrees of it
AXES = ("east", "north", "up")


@dataclass(frozen=True, eq=False)
class Given:
    """Given points that a strip shows."""

    ids: tuple[str, ...]
    # (n, 3): east, north, up in metres in a level frame in the middle of the control; NaN where not given
    level: Floats
    use: Flags  # (n, 3): which coordinates count
    check: Flags  # (n,): check points
    group: Numbers  # (n,): control list of each
    # (n, 3): the coordinates as they are written, east, north, up; NaN where slips of the pen cannot be sought in them
    written: Floats
    unit: Floats  # (n, 3): metres in a unit of the written coordinates
    axes: Floats  # (n, 3, 3): directions of the written axes in the level frame, as rows
    sigma: tuple[float, float]  # usual standard deviation of the given coordinates in plan and in height, metres

    @property
    def plan(self) -> Complex:
        """Given places E + iN, metres."""
        result: Complex = self.level[:, 0] + 1j * self.level[:, 1]
        return result


@dataclass(frozen=True, eq=False)
class Rays:
    """What the photos of a strip show of one point."""

    xy: Floats  # (r, 2): image coordinates, mm
    sigma: Floats  # (r,): their standard deviations, mm
    centers: Floats  # (r, 3): perspective centres in the strip
    rotations: Floats  # (r, 3, 3): photo to strip
    focal: float  # principal distance, mm

    @property
    def count(self) -> int:
        """Number of photos."""
        return len(self.xy)

    def shown(self, xyz: Floats) -> bool:
        """Whether a place in the strip lies in front of all photos, within 84 degrees of their axes.

        Parameters
        ----------
        xyz : ndarray, shape (3,)
            A place in the strip.

        Returns
        -------
        bool
            True where all photos could show it.
        """
        away = xyz - self.centers
        ahead = -np.einsum("rj,rj->r", self.rotations[:, :, 2], away)
        return bool((ahead > FRONT * np.linalg.norm(away, axis=1)).all())

    def residuals(self, xyz: Floats) -> tuple[Floats, Floats]:
        """Give image residuals of a place, and how a step of it moves its images.

        Parameters
        ----------
        xyz : ndarray, shape (3,)
            A place in the strip.

        Returns
        -------
        residual : ndarray, shape (r, 2)
            Where the place comes to lie on each photo, minus where the point was measured; mm.
        jacobian : ndarray, shape (r, 2, 3)
            Millimetres on each photo for a step in the strip.
        """
        back = self.rotations.transpose(0, 2, 1)
        seen = np.einsum("rij,rj->ri", back, xyz - self.centers)
        depth = np.minimum(seen[:, 2], -SMALL)[:, None]
        image = -self.focal * seen[:, :2] / depth
        jacobian = -(self.focal * back[:, :2] + image[:, :, None] * back[:, 2:]) / depth[:, :, None]
        return image - self.xy, jacobian


NO_RAYS = Rays(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)), 1.0)


@dataclass(frozen=True, eq=False)
class Seen:
    """The same points as a strip sees them."""

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
class Fitted:
    """A strip on its control, bending taken out."""

    laid: Laid
    # along, across: (n,): places of the points along and across the strip, metres
    along: Floats
    across: Floats
    height: Floats  # (n,): heights in the strip, metres
    floor: tuple[float, float]  # a-priori standard deviations in plan and height, metres
    plan: Bent
    strip_from_level: Floats  # (3, 3): steps in the strip from steps in the level frame, metres


def rotated(xyz: Floats, turn: Floats) -> Floats:
    """Turn coordinates of a mosaic, which are upright already, or of a strip with points that have none.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Strip coordinates; points of a mosaic have no third one.
    turn : ndarray, shape (3, 3)
        Rotation that sets the strip upright.

    Returns
    -------
    ndarray, shape (n, 3)
        Coordinates of the upright strip.
    """
    flat = np.isfinite(xyz[:, :2]).all(axis=1) & ~np.isfinite(xyz[:, 2])
    result = xyz @ turn.T
    result[flat] = xyz[flat]
    return result


class Level(NamedTuple):
    """A strip, turned level."""

    w: Complex  # (n,): places of its points
    z: Floats  # (n,): their heights, in the same unit
    laid: Laid  # the strip on its control in plan
    turn: Floats  # (3, 3): steps of the level strip from steps of the strip as it was formed
    depth: float  # distance from camera to ground, in the unit of `w`


def levelled(given: Given, level: Level, floor: float, took_part: Flags) -> Level:
    """Turn a strip by the tilt that the heights of its control show; the cameras look down within degrees only.

    Relief times that tilt is a displacement in plan. Where the heights do not help, all stays as it is.

    Parameters
    ----------
    level : Level
        The strip, set upright by its cameras.
    floor : float
        Smallest standard deviation of a height that makes sense, as a share of the distance from camera to ground.
    took_part : ndarray of bool, shape (n,)
        Points on which the strip is laid in plan.

    Returns
    -------
    Level
        The strip, level.
    """
    w, z, laid, turn, depth = level
    scale = abs(laid.turn)
    place, height = laid(w), scale * z
    usable = given.use[:, 2] & ~given.check & np.isfinite(given.level[:, 2]) & np.isfinite(height) & np.isfinite(place)
    if usable.sum() <= LEAST:
        return level
    mean = float(height[usable].mean())
    columns = [np.ones(len(w)), place.real, place.imag]
    columns += [height - mean] if usable.sum() >= LEAST + 2 * SPARE else []  # a wrong unit of the heights is no tilt
    design = np.where(usable[:, None], np.column_stack(columns), 0.0)
    value = np.where(usable, given.level[:, 2] - height, 0.0)
    least = max(floor * depth * scale, given.sigma[1], SMALL)
    tilt = bend(design, value, usable, least).coefficient[1:3]
    leaning = upright(np.array([[tilt[0], tilt[1], 1.0]]))
    turned = np.column_stack([place.real, place.imag, height]) @ leaning.T
    here = turned[:, 0] + 1j * turned[:, 1]
    again = lay(here[took_part], given.plan[took_part])
    if again is None or again.middle > laid.middle:
        return level
    return Level(here, turned[:, 2], again, leaning @ laid.matrix @ turn, depth * scale)


def straightened(given: Given, level: Level, floor: tuple[float, float], took_part: Flags) -> Fitted:
    """Take the bending out of the plan.

    Parameters
    ----------
    level : Level
        The strip, level and laid on them.
    floor : tuple of float
        Smallest standard deviations that make sense in plan and height, as shares of the distance from camera to
        ground.
    took_part : ndarray of bool, shape (n,)
        Points that may say how the strip bends.
    """
    w, z, laid, turn, depth = level
    scale = abs(laid.turn)
    distance = depth * scale
    least = (
        max(float(np.hypot(floor[0] * distance, given.sigma[0])), SMALL),
        max(float(np.hypot(floor[1] * distance, given.sigma[1])), SMALL),
    )
    place = laid(w)
    axis = _direction(place[took_part])
    middle = place[took_part].mean()
    local = (place - middle) / axis
    known = np.isfinite(given.plan)
    columns = [np.where(np.isfinite(local), local, 0.0) ** k for k in range(3)]
    bent = simplest(columns, 2, np.where(known, given.plan, 0.0), took_part, least[0])[1]
    residual = np.where(known & np.isfinite(w), bent.residual, np.nan)
    back = np.asarray(np.linalg.inv(laid.matrix @ turn), float)
    return Fitted(laid, local.real, local.imag, scale * z, least, replace(bent, residual=residual), back)


def simplest(
    columns: list[NDArray[Any]],
    least: int,
    values: NDArray[Any],
    took_part: Flags,
    floor: float,
) -> tuple[NDArray[Any], Bent]:
    """Fit as few columns as leave no more than makes sense, at least some of them.

    Parameters
    ----------
    columns : list of ndarray, shape (n,)
        Columns, the simplest first.
    least : int
        Number of them that are always taken.
    values : ndarray of float or complex, shape (n,)
        Values, metres.
    took_part : ndarray of bool, shape (n,)
        Points that may take part.
    floor : float
        Smallest standard deviation that makes sense, metres.

    Returns
    -------
    columns : ndarray, shape (n, c)
        Those taken.
    """
    number = least
    while True:
        chosen = np.column_stack(columns[:number])
        fit = bend(chosen, values, took_part, floor)
        spare = int(took_part.sum()) - number - 1
        if number == len(columns) or spare < SPARE or fit.sigma0 <= SIMPLE * floor:
            return chosen, fit
        number += 1


def _direction(place: Complex) -> complex:
    """Direction of the largest extent, of length one."""
    d = place - place.mean()
    axis = complex(np.sqrt((d**2).sum()))
    return axis / abs(axis) if abs(axis) > SMALL else 1.0 + 0.0j
