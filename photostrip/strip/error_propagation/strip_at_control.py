"""A strip at its control: misclosures of all coordinates with their covariance, in sections of a long strip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geometry.similarity import Similarity
from photostrip.points import ControlPoints
from photostrip.strip import absolute_orientation
from photostrip.strip.absolute_orientation import Targets
from photostrip.strip.error_propagation.control_errors import Misclosures

ENOUGH = 1e-5  # of half the strip: the adjustment of the misclosures takes out what is left, but for its square
LARGEST_SECTION = 100  # control coordinates of a section: what one adjustment takes


class ControlRay(NamedTuple):
    """The ray of a control point on two photos along which the error of its image in the other photo moves it."""

    point: int
    photo: int  # place in the strip of the other photo, whose image would be wrong
    direction: Floats  # (3,): of the ray, unit vector in strip coordinates


@dataclass(frozen=True, eq=False)
class StripAtControl:
    """Where a strip, or a section of it, stands when its control is tested."""

    targets: Targets  # the control
    xyz: Floats  # (n, 3): strip coordinates of the control points
    similarity: Similarity  # into the intermediate frame, metres
    weight: Floats  # (n, 3): weights of their coordinates in the similarity
    rays: Sequence[ControlRay]
    coordinates: Misclosures  # the w coordinates that count
    design: Floats  # (w, 7): their derivatives by a similarity
    covariance: Callable[[Numbers], Floats]  # of some of them, strip and control together, (w, w), metres^2
    share: float  # of a section in the coordinates of the whole strip

    @property
    def control(self) -> ControlPoints:
        return self.targets.control

    @cached_property
    def placed(self) -> Floats:
        """The control points in the intermediate frame (n, 3), metres."""
        return self.similarity(self.xyz)

    @cached_property
    def joint_covariance(self) -> Floats:
        """Covariance of all misclosures (w, w), metres^2."""
        return self.covariance(np.arange(len(self.coordinates.point)))

    @cached_property
    def sections(self) -> list[tuple[Numbers, StripAtControl]]:
        """Cut the control along the strip into parts of equal size; rows of each, and the strip there."""
        order = np.argsort(self.placed[:, 0], kind="stable")
        before = np.cumsum(self.control.use[order].sum(axis=1)) - 1
        total = len(self.coordinates.point)
        part = before * -(-total // LARGEST_SECTION) // max(total, 1)
        parts = [np.sort(order[part == number]) for number in np.unique(part)]
        return [(rows, self.at(rows)) for rows in parts]  # none of them holds the whole, which holds them

    def at(self, rows: Numbers) -> StripAtControl:
        """Return the strip at some of its control points, numbered anew; covariances stay those of the whole strip."""
        place, targets, covariance = np.full(len(self.control), -1), self.targets, self.covariance
        place[rows] = np.arange(len(rows))
        inside = np.flatnonzero(place[self.coordinates.point] >= 0)
        return replace(
            self,
            targets=replace(targets, control=targets.control.take(rows), known=targets.of_full[rows]),
            xyz=self.xyz[rows],
            weight=self.weight[rows],
            rays=[ray._replace(point=int(place[ray.point])) for ray in self.rays if place[ray.point] >= 0],
            coordinates=replace(self.coordinates.take(inside), point=place[self.coordinates.point[inside]]),
            design=self.design[inside],
            covariance=lambda some: covariance(inside[some]),
            share=len(inside) / len(self.design),
        )

    @cached_property
    def laid(self) -> StripAtControl:
        return self.laid_on(self.control.use)

    def laid_on(self, kept: Flags) -> StripAtControl:
        """Lay the strip on what is kept: a wrong point of 200 m turns it, and its rays, by a hundredth."""
        found, axes = self.coordinates, np.zeros((*kept.shape, 3))
        axes[found.point, found.axis] = found.direction  # PROJ would take half of the time of the screening for them
        targets = self.targets
        if kept is not self.control.use:
            targets = replace(targets, control=replace(self.control, use=kept), known=None)
        laid = absolute_orientation.lay(self.xyz, targets, np.where(kept, self.weight, 0.0), known=axes, enough=ENOUGH)
        return replace(self, similarity=laid.similarity)

    def misclosures(self, control: ControlPoints | None = None) -> Floats:
        """Strip minus given (w,), metres along the ground axes; control: other coordinates than the given ones."""
        given = (replace(self.targets, control=control, known=None) if control else self.targets).of(self.placed)
        found = self.coordinates
        return np.asarray(np.einsum("wi,wi->w", found.direction, (self.placed - given)[found.point]), float)
