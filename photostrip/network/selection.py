"""Which observations of a problem take part: taking them out, putting them back, starting again from a solution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags
from photostrip.network.problem import BundleProblem, StartValues
from photostrip.network.solution import BundleSolution

FIELDS = {"image": "images", "control": "control", "position": "positions", "attitude": "attitudes"}


@dataclass(frozen=True, eq=False)
class Selection:
    """Which observations take part."""

    images: Flags  # (n,): rays
    # control, positions, attitudes: (c, 3), (g, 3), (a, 3): coordinates
    control: Flags
    positions: Flags
    attitudes: Flags

    @classmethod
    def everything(cls, problem: BundleProblem) -> Selection:
        return cls(
            images=np.ones(len(problem.images), bool),
            control=np.isfinite(problem.control.sigma),
            positions=np.isfinite(problem.positions.sigma),
            attitudes=np.isfinite(problem.attitudes.sigma),
        )

    @property
    def given(self) -> bytes:
        """Which given coordinates take part."""
        return b"".join(each.tobytes() for each in (self.control, self.positions, self.attitudes))

    def given_out(self, problem: BundleProblem) -> int:
        """Count the given coordinates that take no part, of control where it is seen."""
        shown = np.isin(problem.control.point, problem.images.point[self.images])[:, None]
        every = Selection.everything(problem)
        parts = (
            (every.control & shown, self.control),
            (every.positions, self.positions),
            (every.attitudes, self.attitudes),
        )
        return sum(int((given & ~used).sum()) for given, used in parts)

    def without(self, kind: str, row: int, axis: int) -> Selection:
        flags = getattr(self, FIELDS[kind]).copy()
        flags[row if kind == "image" else (row, axis)] = False
        return replace(self, **{FIELDS[kind]: flags})

    def holds(self, kind: str, row: int, axis: int) -> bool:
        flags = getattr(self, FIELDS[kind])
        return bool(flags[row] if kind == "image" else flags[row, axis])


def supported(problem: BundleProblem, selection: Selection) -> Selection:
    """Take out the rays of points that too few rays are left of.

    These are points with one ray that are not given in all three coordinates, and control that no ray is left of.
    """
    point = problem.images.point
    rays = np.bincount(point[selection.images], minlength=problem.points)
    control = selection.control & np.isfinite(problem.control.sigma)
    fixed = np.zeros(problem.points, bool)
    fixed[problem.control.point[control.all(axis=1)]] = True
    images = selection.images & ((rays >= problem.least) | fixed)[point]
    images &= np.isfinite(problem.start.points[point]).all(axis=1)
    shown = np.zeros(problem.points, bool)
    shown[point[images]] = True
    return replace(selection, images=images, control=control & shown[problem.control.point][:, None])


def selected(problem: BundleProblem, selection: Selection) -> BundleProblem:
    """Leave the observations that take part: other rays go, other coordinates get infinite standard deviations."""
    control, positions, attitudes = problem.control, problem.positions, problem.attitudes
    return replace(
        problem,
        images=problem.images.take(selection.images),
        start=replace(problem.start, points=np.nan_to_num(problem.start.points)),
        control=replace(control, sigma=np.where(selection.control, control.sigma, np.inf)),
        positions=replace(positions, sigma=np.where(selection.positions, positions.sigma, np.inf)),
        attitudes=replace(attitudes, sigma=np.where(selection.attitudes, attitudes.sigma, np.inf)),
    )


def restarted(problem: BundleProblem, solution: BundleSolution) -> BundleProblem:
    """Start where a solution of the problem, or of a selection, ended; a point that took no part keeps its start."""
    known = np.asarray(np.isfinite(problem.start.points).all(axis=1), bool)
    points = np.where(known[:, None], solution.points, problem.start.points)
    scales = None if problem.start.scales is None else solution.scales
    return replace(
        problem, start=StartValues(centers=solution.centers, rotations=solution.rotations, points=points, scales=scales)
    )
