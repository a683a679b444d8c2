"""A strip that lies on its control: set level, its bending taken out.

In plan the bending is taken out by a conformal polynomial, with as few terms as leave no more than makes sense.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.triangulation.plausibility.control_fit import LEAST, SMALL, Bent, Laid, bend, lay, upright

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Flags = NDArray[np.bool_]
    Numbers = NDArray[np.intp]

FOOT, SURVEY_FOOT = 0.3048, 1200.0 / 3937.0  # metres; they differ by 2 ppm
FEET_NEAR = 0.04  # relative, of a ratio to that of foot and metre
SIMPLE = 2.5  # times what makes sense that a fit may leave before bending is taken out
SPARE = 2  # redundancy that must be left then
AXES = ("east", "north", "up")


@dataclass(frozen=True, eq=False)
class Given:
    """Given points that a strip shows.

    Parameters
    ----------
    ids : tuple of str
        Their ids.
    level : ndarray, shape (n, 3)
        East, north, up in metres in a level frame in the middle of the control; NaN where not given.
    use : ndarray of bool, shape (n, 3)
        Which coordinates count.
    check : ndarray of bool, shape (n,)
        Check points.
    group : ndarray of int, shape (n,)
        Control list of each.
    written : ndarray, shape (n, 3)
        The coordinates as they are written, east, north, up; NaN where slips of the pen cannot be sought in them.
    unit : ndarray, shape (n, 3)
        Metres in a unit of the written coordinates.
    axes : ndarray, shape (n, 3, 3)
        Directions of the written axes in the level frame, as rows.
    sigma : tuple of float
        Usual standard deviation of the given coordinates in plan and in height, metres.
    """

    ids: tuple[str, ...]
    level: Floats
    use: Flags
    check: Flags
    group: Numbers
    written: Floats
    unit: Floats
    axes: Floats
    sigma: tuple[float, float]

    @property
    def plan(self) -> Complex:
        """Given places E + iN, metres."""
        result: Complex = self.level[:, 0] + 1j * self.level[:, 1]
        return result


@dataclass(frozen=True, eq=False)
class Seen:
    """The same points as a strip sees them.

    Parameters
    ----------
    strip : str
        Id of the strip.
    xyz : ndarray, shape (n, 3)
        Strip coordinates; the third may be NaN, when only a mosaic is known.
    axes : ndarray, shape (p, 3)
        Third axes of its photos, from the ground to the camera.
    centers : ndarray, shape (p, 3)
        Perspective centres.
    floor : tuple of float
        A-priori standard deviation of the difference between strip and given coordinates in plan and in height, as a
        share of the distance from camera to ground.
    depth : float
        Distance from camera to ground, in units of the strip.
    base_angle : float
        Direction of the bases on the photos, radians from the x axis; a mean.
    """

    strip: str
    xyz: Floats
    axes: Floats
    centers: Floats
    floor: tuple[float, float]
    depth: float
    base_angle: float = 0.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """A strip on its control, bending taken out.

    Parameters
    ----------
    laid : Laid
        Its similarity in plan.
    along, across : ndarray, shape (n,)
        Places of the points along and across the strip, metres.
    height : ndarray, shape (n,)
        Heights in the strip, metres.
    floor : tuple of float
        A-priori standard deviations in plan and height, metres.
    plan : Bent
        What is left in plan.
    """

    laid: Laid
    along: Floats
    across: Floats
    height: Floats
    floor: tuple[float, float]
    plan: Bent


def rotated(xyz: Floats, turn: Floats) -> Floats:
    """Turn coordinates of a mosaic, which are upright already, or of a strip with points that have none."""
    flat = np.isfinite(xyz[:, :2]).all(axis=1) & ~np.isfinite(xyz[:, 2])
    result = xyz @ turn.T
    result[flat] = xyz[flat]
    return result


def levelled(
    given: Given, seen: Seen, w: Complex, z: Floats, laid: Laid, took_part: Flags
) -> tuple[Seen, Complex, Floats, Laid]:
    """Turn a strip by the tilt that the heights of its control show; the cameras look down within degrees only.

    Relief times that tilt is a displacement in plan. Where the heights do not help, all stays as it is.
    """
    unchanged = seen, w, z, laid
    scale = abs(laid.turn)
    place, height = laid(w), scale * z
    usable = given.use[:, 2] & ~given.check & np.isfinite(given.level[:, 2]) & np.isfinite(height) & np.isfinite(place)
    if usable.sum() <= LEAST:
        return unchanged
    mean = float(height[usable].mean())
    columns = [np.ones(len(w)), place.real, place.imag]
    columns += [height - mean] if usable.sum() >= LEAST + 2 * SPARE else []  # a wrong unit of the heights is no tilt
    design = np.where(usable[:, None], np.column_stack(columns), 0.0)
    value = np.where(usable, given.level[:, 2] - height, 0.0)
    floor = max(seen.floor[1] * seen.depth * scale, given.sigma[1], SMALL)
    tilt = bend(design, value, usable, floor).coefficient[1:3]
    turned = np.column_stack([place.real, place.imag, height]) @ upright(np.array([[tilt[0], tilt[1], 1.0]])).T
    level = turned[:, 0] + 1j * turned[:, 1]
    again = lay(level[took_part], given.plan[took_part])
    if again is None or again.middle > laid.middle:
        return unchanged
    return replace(seen, depth=seen.depth * scale), level, turned[:, 2], again


def straightened(laid: Laid, w: Complex, z: Floats, given: Given, seen: Seen, took_part: Flags) -> Fitted:
    """Take the bending out of the plan."""
    scale = abs(laid.turn)
    distance = seen.depth * scale
    floor = (
        max(float(np.hypot(seen.floor[0] * distance, given.sigma[0])), SMALL),
        max(float(np.hypot(seen.floor[1] * distance, given.sigma[1])), SMALL),
    )
    place = laid(w)
    axis = _direction(place[took_part])
    middle = place[took_part].mean()
    local = (place - middle) / axis
    known = np.isfinite(given.plan)
    columns = [np.where(np.isfinite(local), local, 0.0) ** k for k in range(3)]
    bent = simplest(columns, 2, np.where(known, given.plan, 0.0), took_part, floor[0])[1]
    residual = np.where(known & np.isfinite(w), bent.residual, np.nan)
    return Fitted(laid, local.real, local.imag, scale * z, floor, replace(bent, residual=residual))


def simplest(
    columns: list[NDArray[Any]],
    least: int,
    values: NDArray[Any],
    took_part: Flags,
    floor: float,
) -> tuple[NDArray[Any], Bent]:
    """Fit as few columns as leave no more than makes sense, at least some of them."""
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
