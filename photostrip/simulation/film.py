"""Film in a comparator: every photo has its own deformation and lies in its own place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.rotation import about
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.spec import Spec

LENGTHS = (1.0, 0.7, 0.5)  # wavelengths of the irregular deformation, parts of the larger side of the photo


@dataclass(frozen=True, eq=False)
class Sheets:
    """What happens to the film of each photo."""

    matrix: Floats  # (m, 2, 2): affine part: comparator axes from photo axes, with the turn of the film
    offset: Floats  # (m, 2): place of the photo's origin in the comparator, mm
    wave: Floats  # (m, 2, w, 2): wave numbers of the irregular part of each coordinate, radians per mm
    phase: Floats  # (m, 2, w): their phases, radians
    amplitude: float  # their amplitude, mm

    def comparator_from_photo(self, photo: Numbers, xy: Floats) -> Floats:
        """Give comparator coordinates of points (n, 2) in the system of the fiducial marks, mm."""
        angle = np.einsum("ncwk,nk->ncw", self.wave[photo], xy) + self.phase[photo]
        moved = xy + self.amplitude * np.sin(angle).sum(axis=2)
        return np.asarray(np.einsum("nij,nj->ni", self.matrix[photo], moved) + self.offset[photo])


def sheets(spec: Spec, count: int) -> Sheets | None:
    """Deform the film of all photos; None when the specification has no film.

    Draws (`Purpose.FILM`): for each photo the normal numbers scale x, scale y, shear, turn, offset x, offset y; then
    for each photo, coordinate and wave a direction and a phase.
    """
    film = spec.film
    if film is None:
        return None
    draws = Draws(spec.seed, Purpose.FILM)
    normal, uniform = draws.normal(count, 6), 2.0 * np.pi * draws.uniform(count, 2, len(LENGTHS), 2)
    stretch = np.zeros((count, 2, 2))
    stretch[:, 0, 0], stretch[:, 1, 1] = 1.0 + film.scale_ppm * 1e-6 * normal[:, :2].T
    stretch[:, 0, 1] = film.shear_ppm * 1e-6 * normal[:, 2]
    turn = about(2, np.radians(film.rotation_deg) * normal[:, 3])[:, :2, :2]
    number = 2.0 * np.pi / (max(spec.format) * np.asarray(LENGTHS))
    direction = np.stack([np.cos(uniform[..., 0]), np.sin(uniform[..., 0])], axis=-1)
    return Sheets(
        matrix=turn @ stretch,
        offset=film.offset_mm * normal[:, 4:],
        wave=number[:, None] * direction,
        phase=uniform[..., 1],
        # sine waves of this amplitude add up to the rms
        amplitude=film.irregular_um / 1000.0 * np.sqrt(2.0 / len(LENGTHS)),
    )
