"""Image coordinates against the collinearity equations; corrections, all and each alone, against written formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pyproj import CRS, Proj, Transformer

from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.geometry.rotation import about
from photostrip.simulation import FILM, Control, Film, Flight, Ground, Image, Simulation, Spec, Terrain, simulate
from photostrip.simulation.measuring import sheets
from photostrip.strip import corrections, interior
from photostrip.strip.corrections import ImageCorrectionSettings, InteriorSettings, refraction_constant

NANOMETRE = 1e-6  # mm
FREE = Spec(image=Image(sigma_um=0.0), control=Control(noise=(0.0, 0.0, 0.0)))


def collinear(simulation: Simulation, points: np.ndarray, centers: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """x = -f (a1 dX + b1 dY + c1 dZ) / (a3 dX + b3 dY + c3 dZ), y likewise, written out, one point after the other."""
    f = simulation.camera.principal_distance
    observations = simulation.observations
    xy = np.empty((len(observations), 2))
    for row, (photo, point) in enumerate(zip(observations.photo, observations.point, strict=True)):
        (a1, a2, a3), (b1, b2, b3), (c1, c2, c3) = rotations[photo]
        dx, dy, dz = points[point] - centers[photo]
        down = a3 * dx + b3 * dy + c3 * dz
        xy[row] = -f * (a1 * dx + b1 * dy + c1 * dz) / down, -f * (a2 * dx + b2 * dy + c2 * dz) / down
    return xy


def grid_axes(crs: str, lonlat: np.ndarray) -> np.ndarray:
    """Rows grid east, grid north, normal in the geocentric frame, from PROJ's meridian convergence."""
    factors = Proj(CRS(crs)).get_factors(*lonlat.T)
    lon, lat, c = np.radians(lonlat[:, 0]), np.radians(lonlat[:, 1]), np.radians(factors.meridian_convergence)
    true = about(2, lon) @ about(1, np.pi / 2 - lat) @ about(2, np.full_like(lon, np.pi / 2))  # columns E, N, U
    return np.swapaxes(true @ about(2, -c), 1, 2)  # grid north lies east of north by the convergence


@pytest.mark.parametrize("rotation", [0.0, 90.0, 180.0, 270.0, 33.0])
def test_flat_world(rotation: float) -> None:
    spec = replace(
        FREE,
        ground=Ground(crs="local"),
        flight=Flight(heading_deg=200.0, photo_rotation_deg=rotation),
        terrain=Terrain(relief=300.0),
    )
    done = simulate(spec)
    truth = done.truth
    expected = collinear(done, truth.ground.xyz, truth.centers_ground, truth.rotations_local)
    assert np.abs(done.observations.xy - expected).max() < NANOMETRE
    assert np.array_equal(done.observations.xy, truth.image)


@pytest.mark.parametrize(
    ("crs", "place"),
    [
        ("EPSG:32633", (17.5, 49.2)),
        ("EPSG:32733", (13.0, -33.0)),
        ("EPSG:32601", (-179.9, 10.0)),
        ("EPSG:3035", (25.0, 60.0)),
    ],
)
def test_real_earth(crs: str, place: tuple[float, float]) -> None:
    done = simulate(replace(FREE, ground=Ground(crs=crs, center_deg=place), flight=Flight(photos=12, heading_deg=70.0)))
    truth = done.truth
    geocentric = Transformer.from_crs(CRS(crs).to_3d(), "EPSG:4978", always_xy=True)
    lonlat = Transformer.from_crs(crs, CRS(crs).geodetic_crs, always_xy=True)
    points, centers = (
        np.stack(geocentric.transform(*enu.T), axis=-1) for enu in (truth.ground.xyz, truth.centers_ground)
    )
    axes = grid_axes(crs, np.stack(lonlat.transform(*truth.centers_ground[:, :2].T), axis=-1))
    rotations = np.swapaxes(axes, 1, 2) @ truth.rotations_local
    if (
        crs != "EPSG:3035"
    ):  # its grid lines do not cross at right angles: PROJ's convergence is that of grid north alone
        assert (
            np.abs(collinear(done, points, centers, rotations) - done.observations.xy).max() < 1e-4
        )  # PROJ's 1e-6 deg
    assert np.abs(collinear(done, points, centers, truth.rotations) - done.observations.xy).max() < NANOMETRE


def test_the_camera_looks_down_and_photos_follow_the_heading() -> None:
    done = simulate(replace(FREE, flight=Flight(heading_deg=30.0, attitude_sigma_deg=(0.0, 0.0, 0.0))))
    local = done.truth.rotations_local
    assert local[:, :, 2] == pytest.approx(np.tile([0.0, 0.0, 1.0], (10, 1)), abs=1e-11)
    azimuth = np.degrees(np.arctan2(local[:, 0, 0], local[:, 1, 0]))
    assert azimuth == pytest.approx(30.0, abs=0.3)  # true, against the grid
    moved = np.diff(done.truth.centers_ground[:, :2], axis=0)
    assert np.degrees(np.arctan2(moved[:, 0], moved[:, 1])) == pytest.approx(30.0, abs=6.0)


def test_attitude_scatter_is_alpha_omega_kappa() -> None:
    spec = replace(
        FREE,
        ground=Ground(crs="local"),
        flight=Flight(photos=400, attitude_sigma_deg=(1.0, 2.0, 3.0), end_lap_percent=75.0),
    )
    rotations = simulate(spec).truth.rotations
    alpha = np.arctan2(-rotations[:, 0, 2], rotations[:, 2, 2])
    omega, kappa = np.arcsin(-rotations[:, 1, 2]), np.arctan2(rotations[:, 1, 0], rotations[:, 1, 1])
    built = about(1, -alpha) @ about(0, omega) @ about(2, kappa)
    assert np.abs(built - rotations).max() < 1e-12
    for angle, sigma in zip((alpha, omega, kappa), (1.0, 2.0, 3.0), strict=True):
        assert np.degrees(angle.std()) == pytest.approx(sigma, rel=4 / np.sqrt(2 * 400))
        assert np.abs(np.degrees(angle)).max() <= 3 * sigma + 1e-9


@pytest.mark.parametrize("crs", ["local", "EPSG:32633"])
def test_refraction_moves_images_away_from_the_nadir(crs: str) -> None:
    spec = replace(
        FREE,
        ground=Ground(crs=crs),
        flight=Flight(scale=40_000.0, attitude_sigma_deg=(0.0, 0.0, 0.0), position_sigma=(0.0, 0.0, 0.0)),
        terrain=Terrain(height=0.0, relief=0.0),
    )
    straight, bent = simulate(spec), simulate(replace(spec, refraction=True))
    shift = bent.truth.image - straight.truth.image
    r = np.hypot(*straight.truth.image.T)
    outward = np.einsum("ni,ni->n", shift, straight.truth.image) / np.maximum(r, 1.0)
    height = 6.12  # km; Bertram 1966, ARDC standard atmosphere, ground at sea level
    constant = 2410.0 * height / (height**2 - 6.0 * height + 250.0) * 1e-6
    assert outward == pytest.approx(constant * (r + r**3 / 153.0**2), rel=0.03, abs=1e-5)
    assert (
        np.linalg.norm(shift - outward[:, None] * straight.truth.image / np.maximum(r, 1.0)[:, None], axis=1).max()
        < 1e-5
    )
    assert outward.max() > 0.01


MICROMETRE = 1e-3  # mm
K, P, B = (4e-8, -2e-12, 1e-17), (2e-7, -1e-7), (3e-4, -2e-4)
LENS = replace(FILM, principal_point=(0.35, -0.21), distortion=Distortion("brown", "image_to_ideal", K, P, B))
SPEC = Spec(
    camera=LENS,
    flight=Flight(photos=5, scale=40_000.0, attitude_sigma_deg=(0.0, 0.0, 0.0), position_sigma=(0.0, 0.0, 0.0)),
    terrain=Terrain(relief=0.0),
    image=Image(sigma_um=0.0),
    film=Film(),
    refraction=True,
)


@pytest.fixture(scope="module")
def flown() -> Simulation:
    return simulate(SPEC)


def ideal(done: Simulation) -> Floats:
    return collinear(done, done.truth.points.xyz, done.truth.centers, done.truth.rotations)


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


def test_all_corrections_together_give_the_truth(flown: Simulation) -> None:
    assert largest(corrected(flown) - ideal(flown)) < 0.1 * MICROMETRE
    assert largest(flown.observations.xy - ideal(flown)) > 0.3  # what they have to take away


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
