"""A problem made ready: its structure, the values of all parameters, and a step of them."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import dataclass
from photostrip.triangulation.bundle.observations import calibration
from photostrip.triangulation.bundle.observations.calibration import Calibrated
from photostrip.triangulation.bundle.observations.collinearity import Rays, view
from photostrip.triangulation.bundle.observations.problem import BundleProblem
from photostrip.triangulation.bundle.observations.ray_batches import RayBatch
from photostrip.triangulation.bundle.structure import BandStructure, band_structure


@dataclass(frozen=True, eq=False)
class Parameters:
    centers: Floats  # (m, 3): perspective centres in the order of the problem, metres
    rotations: Floats  # (m, 3, 3): rotations in that order, photo to Cartesian frame
    xyz: tuple[Floats, ...]  # (3, S): points of each batch
    common: Floats  # (p,): calibration parameters, offsets, drifts


@dataclass(frozen=True, eq=False)
class PreparedProblem:
    """A problem with everything about it that does not change during the adjustment."""

    problem: BundleProblem
    structure: BandStructure
    calibrated: Calibrated
    prior: Floats  # (p,): a-priori sigmas of all common parameters

    def table(self, state: Parameters) -> Floats:
        """Columns of ``view`` for all photos in the order of the band, shape (13, m)."""
        cameras, order = self.problem.cameras, self.structure.order
        focal = cameras.focal.astype(float)
        distance = self.calibrated.kind == calibration.PRINCIPAL_DISTANCE
        np.add.at(focal, self.calibrated.camera[distance], state.common[: len(distance)][distance])
        turn = state.rotations[order].transpose(2, 1, 0).reshape(9, -1)
        return np.concatenate([turn, state.centers[order].T, focal[cameras.of_photo[order]][None]])

    def rays(self, batch: RayBatch, xyz: Floats, table: Floats, common: Floats) -> tuple[Rays, Floats | None]:
        """View a batch; its partials by calibration parameters in units of sigma, or None."""
        rays = view(batch, xyz, table)
        if not len(self.calibrated):
            return rays, None
        camera = self.problem.cameras.of_photo[self.structure.order][batch.photo]
        partials = calibration.partials(self.calibrated, batch.xy, rays.ratio, camera)
        partials *= batch.weight
        bends = self.calibrated.kind != calibration.PRINCIPAL_DISTANCE
        bent = np.einsum("p,pakr->akr", common[: len(bends)][bends], partials[bends])
        np.subtract(rays.misfit, bent, out=rays.misfit)
        return rays, partials


@dataclass(frozen=True, eq=False)
class ParameterStep:
    photos: Floats  # (m, 6): steps of the photos in the order of the band, in their own axes
    common: Floats  # (p,): steps of the common parameters
    points: tuple[Floats, ...]  # (3, S): steps of the points of each batch, metres
    length: float  # length in standard deviations


def prepare(problem: BundleProblem) -> PreparedProblem:
    """Find what does not change during the adjustment: structure, calibrated parameters, a-priori sigmas."""
    calibrated = calibration.parameters(problem.cameras)
    drifts = (problem.positions.offset_sigma, problem.positions.drift_sigma)
    sigmas = [calibrated.sigma, *(sigma[sigma > 0.0] for sigma in drifts)]
    return PreparedProblem(
        problem=problem, structure=band_structure(problem), calibrated=calibrated, prior=np.concatenate(sigmas)
    )


def parameters_from(
    prepared: PreparedProblem, centers: Floats, rotations: Floats, points: Floats, common: Floats
) -> Parameters:
    """Lay values of all parameters out for a prepared problem."""
    xyz = tuple(np.ascontiguousarray(points[batch.point].T) for batch in prepared.structure.batches)
    return Parameters(
        centers=np.asarray(centers, float), rotations=np.asarray(rotations, float), xyz=xyz, common=common
    )
