"""Film, principal point, lens and air: a correction that is off leaves what its formula, written out here, says.

Photos are level and the ground is flat, as the formula of refraction takes them to be.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.simulation.measuring import sheets
from photostrip.simulation.simulation import simulate
from photostrip.strip import corrections, interior
from photostrip.strip.corrections import ImageCorrectionSettings, InteriorSettings, refraction_constant
from tests.simulation.test_images import LENS, MICROMETRE, SPEC, B, K, P

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.camera import Camera
    from photostrip.simulation.simulation import Simulation

    Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def flown() -> Simulation:
    return simulate(SPEC)


def ideal(done: Simulation) -> Floats:
    """Central projection of the true points, written out."""
    truth, seen = done.truth, done.observations
    ray = truth.points.xyz[seen.point] - truth.centers[seen.photo]
    camera = np.einsum("nji,nj->ni", truth.rotations[seen.photo], ray)
    return np.asarray(-done.camera.principal_distance * camera[:, :2] / camera[:, 2:])


def corrected(done: Simulation, *, transform: str = "affine", camera: Camera = LENS, refraction: bool = True) -> Floats:
    cameras = dict.fromkeys(done.truth.photo_ids, camera)
    assert done.fiducials is not None
    oriented = interior.orient(done.fiducials, cameras, InteriorSettings(transform))
    photo = interior.transform(done.observations, oriented)
    flying, ground = (float(xyz[:, 2].mean()) for xyz in (done.truth.centers_ground, done.truth.ground.xyz))
    settings = ImageCorrectionSettings(refraction=refraction, flying_height=flying, ground_height=ground)
    return corrections.refine(photo, cameras, settings).observations.xy


def largest(shift: Floats) -> float:
    return float(np.hypot(*shift.T).max())


def shift_of_the_lens(xy: Floats) -> Floats:
    """Brown's formula in the image points that the ideal ones have."""
    found = xy
    for _ in range(20):
        (k1, k2, k3), (p1, p2), (b1, b2), (x, y) = K, P, B, found.T
        r2 = x**2 + y**2
        radial = k1 * r2 + k2 * r2**2 + k3 * r2**3
        dx = x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y + b1 * x + b2 * y
        dy = y * radial + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y
        found = xy - np.stack([dx, dy], -1)
    return found - xy


def shift_of_the_air(done: Simulation, xy: Floats) -> Floats:
    """Saastamoinen's dr, outwards."""
    flying, ground = (float(each[:, 2].mean()) for each in (done.truth.centers_ground, done.truth.ground.xyz))
    constant = refraction_constant(flying, ground)
    return np.asarray(constant * xy * (1 + (xy**2).sum(1, keepdims=True) / done.camera.principal_distance**2))


def shift_of_the_film(done: Simulation) -> Floats:
    """What a conformal transformation of the four marks leaves of the affine film, by complex numbers."""
    film = sheets(done.spec, len(done.truth.photo_ids))
    assert film is not None
    marks = np.array(list(done.camera.fiducials.values()))
    points, found = ideal(done) + np.array(LENS.principal_point), np.zeros((len(done.observations), 2))
    for photo, matrix in enumerate(film.matrix):
        seen = (marks @ matrix.T) @ [1, 1j]
        a, b = np.linalg.lstsq(np.stack([seen, np.ones(len(seen))], -1), marks @ [1, 1j], rcond=None)[0]
        rows = done.observations.photo == photo
        left = a * ((points[rows] @ matrix.T) @ [1, 1j]) + b - points[rows] @ [1, 1j]
        found[rows] = np.stack([left.real, left.imag], -1)
    return found


@pytest.mark.parametrize("effect", ["principal point", "distortion", "refraction", "film"])
def test_a_correction_that_is_off_leaves_what_theory_says(flown: Simulation, effect: str) -> None:
    truth = ideal(flown)
    if effect == "principal point":
        left, expected = corrected(flown, camera=replace(LENS, principal_point=(0.0, 0.0))), np.array([[0.35, -0.21]])
    elif effect == "distortion":
        left, expected = corrected(flown, camera=replace(LENS, distortion=None)), shift_of_the_lens(truth)
    elif effect == "refraction":
        left, expected = corrected(flown, refraction=False), shift_of_the_air(flown, truth)
    else:
        left, expected = corrected(flown, transform="conformal"), shift_of_the_film(flown)
    size = largest(np.broadcast_to(expected, truth.shape))
    assert size > 5 * MICROMETRE
    assert largest(left - truth - expected) < 0.03 * size
