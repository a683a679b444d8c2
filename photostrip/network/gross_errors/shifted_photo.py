"""One photo of a strip with its principal point unknown: whether a shift of its image coordinates explains them.

The photo and its neighbours are a free network. At its solution the pull on the principal point of every photo says how
much that would explain; the photo that asks for it most is adjusted with it, all its points put back, and so is the one
that made the run suspicious. The better of the two is screened for gross errors, and must explain more than the rays
without it, each condition that the search gave up counting as much as its limit.

Source: derived, see docs/sources.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.network import datum
from photostrip.network.gross_errors.strip_network import STRIP_LEVEL, free_network
from photostrip.network.normal_equations import equations_at, factored
from photostrip.network.parameters import prepare
from photostrip.network.problem import BundleCameras, BundleProblem
from photostrip.network.reliability import limit_of
from photostrip.network.selection import Selection, restarted, selected, supported
from photostrip.network.settings import CALIBRATION, BundleSettings
from photostrip.network.solution import BundleSolution
from photostrip.network.solve import solve
from photostrip.points import PhotoPoints
from photostrip.strip.relative_orientation.orientation import Orientation
from photostrip.strip.strip_formation.strip import FormedStrip

NEAR_PHOTOS = 4  # photos on either side of one that are adjusted with it
SEARCH = BundleSettings(level=STRIP_LEVEL)
PRINCIPAL_POINT = np.flatnonzero([each.asked == "principal_point" for each in CALIBRATION.values()])


@dataclass(frozen=True, eq=False)
class ShiftedPhoto:
    """A photo that agrees with its neighbours once its image coordinates are shifted."""

    photo: int  # place in the strip
    # shift, sigma: (2,): by which its image coordinates are too large, with standard deviation, mm
    shift: Floats
    sigma: Floats
    gain: float  # sum of squares that this explains beyond the limit
    # measured, agreeing: points of the photo, and those of them that agree with its neighbours then
    measured: int
    agreeing: int
    sigma0: float  # of the photo and its neighbours then, over what is stated


def shifted_photo(
    oriented: Orientation, formed: FormedStrip, observations: PhotoPoints, position: Numbers, about: int
) -> ShiftedPhoto | None:
    """Find the photo of a strip whose image coordinates are all shifted, `about` or one near it; None without one.

    about: place in the strip of a photo that looks wrong.
    position: (n,): place in the strip of the photo of every image point; -1 for photos of other strips.
    """
    first, last = max(about - NEAR_PHOTOS, 0), min(about + NEAR_PHOTOS, oriented.pairs.size)
    numbers = np.arange(first, last)
    part, inside = oriented.take(numbers), slice(first, last + 1)
    near = replace(
        formed,
        centers=formed.centers[inside],
        rotations=formed.rotations[inside],
        model_xyz=formed.model_xyz[oriented.pairs.rows_of(numbers)],
    )
    rows = np.unique(part.rows)
    problem = free_network(part, near, observations, position - first, rows, observations.sigma[rows])
    used = np.isin(rows, part.rows[part.used & np.isfinite(near.model_xyz[:, 0])])
    try:
        found = _Network(problem, part, rows, used).shifted(about - first)
    except (GeometryError, np.linalg.LinAlgError):
        return None
    return None if found is None else replace(found, photo=found.photo + first)


class _Network:
    """A photo and its neighbours, adjusted as the run left them."""

    def __init__(self, problem: BundleProblem, oriented: Orientation, rows: Numbers, used: Flags) -> None:
        self.problem, self.oriented, self.rows, self.used = problem, oriented, rows, used
        self.plain = self.selection(used)
        self.solution = solve(selected(problem, self.plain), rough=True)
        self.problem = restarted(problem, self.solution)

    def selection(self, rays: Flags) -> Selection:
        return supported(self.problem, replace(Selection.everything(self.problem), images=rays))

    def shifted(self, about: int) -> ShiftedPhoto | None:
        """Adjust both photos that may be shifted with their principal points, and screen the better one."""
        asking = int(self._asking().argmax())
        best, most = asking, 0.0
        for photo in {about, asking}:
            rays, plain = self._put_back(photo), self.solution
            if (rays.images != self.plain.images).any():
                plain = solve(selected(self.problem, rays), rough=True)
            elif photo != asking:
                continue  # it would explain less
            freed = solve(selected(self._freed([photo]), rays), rough=True)
            explained = (plain.chi_square - freed.chi_square) / _unit(freed) ** 2
            size = np.abs(self.problem.images.xy[self.problem.images.photo == photo]).max()
            if explained > most and np.abs(freed.common).max() < size:  # no photo lies beside all that it shows
                best, most = photo, explained
        limit = limit_of(self.solution, SEARCH, 0).value
        return self._screened(best) if most > len(PRINCIPAL_POINT) * limit**2 else None

    def _asking(self) -> Floats:
        """Sum of squares that the principal point of each photo would explain, at the solution, (m,)."""
        photos = np.arange(self.problem.photos)
        freed = restarted(self._freed(photos), self.solution)
        prepared = prepare(selected(freed, self.plain))
        state = prepared.begun
        equations = equations_at(prepared, state)
        found = factored(equations, datum.anchor(equations.unreduced, prepared.rank, state))
        if found is None:
            return np.zeros(len(photos))
        normal = found.left.reshape(len(photos), 2, len(photos), 2)[photos, :, photos]
        pull = equations.right_common - found.cross.T @ equations.right_photos
        pull = pull.reshape(len(photos), 2, 1)
        return np.asarray((pull * np.linalg.solve(normal, pull)).sum(axis=(1, 2)), float)

    def _freed(self, photos: Sequence[int] | Numbers) -> BundleProblem:
        """Give some photos an unknown principal point, each its own."""
        camera = np.zeros(self.problem.photos, np.intp)
        camera[photos] = np.arange(len(photos)) + 1
        sigma = np.zeros((len(photos) + 1, len(CALIBRATION)))
        sigma[1:, PRINCIPAL_POINT] = np.inf
        focal = np.repeat(self.problem.cameras.focal, len(photos) + 1)
        return replace(self.problem, cameras=BundleCameras(camera, focal, sigma))

    def _put_back(self, photo: int) -> Selection:
        """Take all points of a photo in again."""
        pair = self.oriented.pairs.pair
        return self.selection(self.used | np.isin(self.rows, self.oriented.rows[(pair == photo) | (pair == photo - 1)]))

    def _screened(self, photo: int) -> ShiftedPhoto | None:
        from photostrip.network.gross_errors.snooping import screen_bundle  # with 10 modules more

        rays = self._put_back(photo)
        after = screen_bundle(self._freed([photo]), rays, SEARCH, rough=True)
        unit = _unit(after.solution)
        given_up = self.solution.redundancy - after.solution.redundancy
        fall = (self.solution.chi_square - after.solution.chi_square) / unit**2
        gain = fall - given_up * after.limit.value**2
        if not gain > 0:
            return None
        return ShiftedPhoto(
            photo=photo,
            shift=after.solution.common,
            sigma=np.sqrt(np.diag(after.precision.common)) * unit,
            gain=gain,
            measured=int((self.problem.images.photo[rays.images] == photo).sum()),
            agreeing=int((after.problem.images.photo == photo).sum()),
            sigma0=after.solution.sigma0,
        )


def _unit(solution: BundleSolution) -> float:
    return max(solution.sigma0, 1.0) if solution.redundancy > 0 else 1.0
