"""Adjustment of windows, and what it says of each point when that point takes no part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.gross_errors.rays.window_points import projectors
from photostrip.triangulation.gross_errors.rays.windows import PHOTO_PARAMETERS

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats
    from photostrip.triangulation.gross_errors.rays.window_points import Group


RIDGE = 1e-11  # relative; holds the place and scale of a window, which no residual feels
INVERTIBLE = 1e-9  # keeps a point that holds its photos alone from stopping the others


@dataclass(frozen=True, eq=False)
class AdjustedWindows:
    """Windows adjusted."""

    estimate: Floats  # (w, 6 length): changes of the photos
    cofactors: Floats  # (w, 6 length, 6 length): their cofactors, place and scale of the window free

    def of(self, group: Group) -> tuple[Floats, Floats]:
        """Give changes and cofactors of the photos of each point, shapes (k, 6r) and (k, 6r, 6r)."""
        count, size = self.estimate.shape
        photos, (k, r) = size // PHOTO_PARAMETERS, group.column.shape
        blocks = self.cofactors.reshape(count, photos, PHOTO_PARAMETERS, photos, PHOTO_PARAMETERS).transpose(
            0, 1, 3, 2, 4
        )
        column = group.column
        window = group.window[:, None, None]
        chosen = np.ascontiguousarray(blocks)[window, column[:, :, None], column[:, None, :]]
        cofactors = chosen.transpose(0, 1, 3, 2, 4).reshape(k, PHOTO_PARAMETERS * r, PHOTO_PARAMETERS * r)
        return self.estimate[group.window[:, None], group.parameters], cofactors


@dataclass(frozen=True, eq=False)
class WindowConditions:
    """Conditions of points on the photos of their windows, padded with zeros to equal numbers."""

    design: Floats  # (w, c, 6 length): derivatives by the photos
    misfit: Floats  # (w, c): misclosures

    def take(self, windows: Flags) -> WindowConditions:
        """Give some of the windows."""
        return self if windows.all() else WindowConditions(self.design[windows], self.misfit[windows])

    def left(self, estimate: Floats) -> Floats:
        """Sizes of what changes of the photos leave of the misclosures, shape (w, c)."""
        return np.abs(self.misfit - (self.design @ estimate[:, :, None])[:, :, 0])

    def estimate(self, weight: Floats) -> Floats:
        """Adjust the windows with weights of the conditions, shape (w, c); without cofactors."""
        normal, right, scale = self._normal(weight)
        found: Floats = np.linalg.solve(normal, (right * scale)[:, :, None])[:, :, 0] * scale
        return found

    def solved(self, weight: Floats) -> AdjustedWindows:
        """Adjust the windows with weights of the conditions, shape (w, c)."""
        normal, right, scale = self._normal(weight)
        cofactors = np.linalg.inv(normal) * scale[:, :, None] * scale[:, None, :]
        return AdjustedWindows((cofactors @ right[:, :, None])[:, :, 0], cofactors)

    def _normal(self, weight: Floats) -> tuple[Floats, Floats, Floats]:
        """Scaled normal matrices, right sides, and the scale of the parameters."""
        weighted = self.design * weight[:, :, None]
        normal = weighted.transpose(0, 2, 1) @ self.design
        right = (self.misfit[:, None, :] @ weighted)[:, 0]
        size = np.arange(normal.shape[1])
        diagonal = normal[:, size, size]
        largest = diagonal.max(axis=1, keepdims=True)
        # a window without any condition moves nothing
        scale = 1 / np.sqrt(np.maximum(diagonal, np.where(largest > 0, 1e-12 * largest, 1.0)))
        normal *= scale[:, :, None]
        normal *= scale[:, None, :]
        normal[:, size, size] += RIDGE
        return normal, right, scale


def stacked(parts: list[tuple[Group, Floats, Floats]], count: int, length: int) -> WindowConditions:
    """Put conditions of groups into ``count`` windows of ``length`` photos.

    Of each group: derivatives (k, c, 6r) of its conditions by the photos, and misclosures (k, c).
    """
    window = np.concatenate([np.zeros(0, np.intp), *(np.repeat(g.window, closing.shape[1]) for g, _, closing in parts)])
    order = np.argsort(window, kind="stable")
    place = np.empty(len(window), np.intp)
    place[order] = np.arange(len(window)) - np.searchsorted(window[order], window[order])
    design = np.zeros((count, int(place.max(initial=-1)) + 1, PHOTO_PARAMETERS * length))
    misfit = np.zeros(design.shape[:2])
    done = 0
    for group, of_points, closing in parts:
        k, c = closing.shape
        at = place[done : done + k * c].reshape(k, c)
        design[group.window[:, None, None], at[:, :, None], group.parameters[:, None, :]] = of_points
        misfit[group.window[:, None], at] = closing
        done += k * c
    return WindowConditions(design, misfit)


def projected(group: Group, weight: Floats) -> tuple[Floats, Floats]:
    """Conditions of the rays that count (``weight`` 1, not 0), each as precise as a coordinate, none correlated.

    Derivatives by the photos (k, 2r, 6r), and misclosures (k, 2r).
    """
    matrix = projectors(group, weight)
    return matrix @ group.by_photo, (matrix @ group.misfit[:, :, None])[:, :, 0]


def expected(group: Group, solved: AdjustedWindows) -> tuple[Floats, Floats]:
    """Misclosures (k, 2r - 3), and variances, that an adjustment leaves which does not know the points."""
    gap, spread = _predicted(group, solved)
    return gap, group.gram + spread


def _predicted(group: Group, solved: AdjustedWindows) -> tuple[Floats, Floats]:
    """Misclosures after the adjustment, and the variances of what it says of them."""
    estimate, cofactors = solved.of(group)
    gap = group.closing - (group.design @ estimate[:, :, None])[:, :, 0]
    return gap, group.design @ cofactors @ group.design.transpose(0, 2, 1)


def without(group: Group, weight: Floats, solved: AdjustedWindows) -> tuple[Floats, Floats]:
    """Misclosures (k, 2r - 3) that an adjustment of all other points leaves of each point's conditions, and variances.

    With G the cofactors of the conditions and S those of their prediction: G (G - S)^-1 times the misclosures.
    """
    gap, spread = _predicted(group, solved)
    variance = group.gram + spread
    whole = np.flatnonzero(weight.all(axis=1))
    if len(whole):
        # with G the cofactors of the conditions and S those of their prediction: G (G - S)^-1 G
        gram = group.gram[whole]
        lever = gram @ np.linalg.inv(gram * (1 + INVERTIBLE) - spread[whole])
        gap[whole] = (lever @ gap[whole][:, :, None])[:, :, 0]
        variance[whole] = lever @ gram
    part = np.asarray(~weight.all(axis=1) & weight.any(axis=1), bool)
    if part.any():
        gap[part], variance[part] = _without_some(group.take(part), weight[part], solved)
    return gap, variance


def _without_some(group: Group, weight: Floats, solved: AdjustedWindows) -> tuple[Floats, Floats]:
    """Take points out of which some rays took part."""
    estimate, cofactors = solved.of(group)
    design, closing = projected(group, weight)
    pull = design @ cofactors
    rest = np.eye(design.shape[1]) * (1 + INVERTIBLE) - pull @ design.transpose(0, 2, 1)
    gain = pull.transpose(0, 2, 1) @ np.linalg.inv(rest)
    estimate = estimate - (gain @ (closing - (design @ estimate[:, :, None])[:, :, 0])[:, :, None])[:, :, 0]
    spread = group.design @ (cofactors + gain @ pull) @ group.design.transpose(0, 2, 1)
    return group.closing - (group.design @ estimate[:, :, None])[:, :, 0], group.gram + spread
