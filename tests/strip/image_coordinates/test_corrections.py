"""Refinement of image coordinates: rays through an atmosphere, formulas written out, round trips, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from photostrip.camera import Camera, Distortion
from photostrip.errors import InputError
from photostrip.points import PhotoPoints
from photostrip.strip import corrections
from photostrip.strip.corrections import (
    Bending,
    ImageCorrectionSettings,
    Refined,
    curvature_constant,
    refraction_constant,
)

Floats = NDArray[np.float64]

MICROMETRE = 1e-3  # mm
PICOMETRE = 1e-9
FOCAL = 153.0
FORWARD, BACKWARD = "image_to_ideal", "ideal_to_image"
directions = pytest.mark.parametrize("direction", [FORWARD, BACKWARD])
PLAIN = Camera("plain", FOCAL, format=(230.0, 230.0))
NODES = tuple(np.arange(0.0, 171.0, 10.0))


def table(direction: str, nodes: tuple[float, ...] = NODES) -> Distortion:
    values = 0.02 * np.sin(np.array(nodes) / 28)  # 20 micrometres, up and down and up again
    return Distortion("radial-table", direction, radius=nodes, distortion=tuple(values))


def brown(
    direction: str,
    k: tuple[float, float, float],
    p: tuple[float, float] = (0.0, 0.0),
    b: tuple[float, float] = (0.0, 0.0),
) -> Distortion:
    return Distortion("brown", direction, k=k, p=p, b=b)


def observed(xy: Floats, photos: tuple[str, ...] = ("1",)) -> PhotoPoints:
    n = len(xy)
    return PhotoPoints(
        photos,
        tuple(f"P{i}" for i in range(n)),
        np.repeat(np.arange(len(photos)), n),
        np.tile(np.arange(n), len(photos)),
        np.tile(xy, (len(photos), 1)),
        np.full((n * len(photos), 2), 0.005),
    )


def refine(xy: Floats, camera: Camera, settings: ImageCorrectionSettings | None = None) -> Refined:
    return corrections.refine(observed(xy), {"1": camera}, settings or ImageCorrectionSettings())


unit = st.floats(-1, 1)
# up to 7 % of pincushion or barrel in the corner, far more than any camera for photogrammetry has
browns = st.builds(
    lambda direction, a, b, c, d, e, f, g: brown(
        direction, (a * 1e-6, b * 3e-11, c * 1e-15), (d * 2e-6, e * 2e-6), (f * 1e-3, g * 1e-3)
    ),
    st.sampled_from([FORWARD, BACKWARD]),
    unit,
    unit,
    unit,
    unit,
    unit,
    unit,
    unit,
)
tables = st.builds(
    lambda direction, values: Distortion(
        "radial-table",
        direction,
        radius=tuple(np.arange(1, len(values) + 1) * 180 / len(values)),
        distortion=tuple(0.05 * v for v in values),
    ),
    st.sampled_from([FORWARD, BACKWARD]),
    st.lists(unit, min_size=1, max_size=12),
)
cameras = st.builds(
    lambda distortion, x0, y0: replace(PLAIN, principal_point=(x0, y0), distortion=distortion),
    st.one_of(browns, tables),
    unit,
    unit,
)
image_points = st.lists(st.tuples(st.floats(-115, 115), st.floats(-115, 115)), min_size=1, max_size=8).map(np.array)


# ------------------------------------------------------------------------------------------- order and inverse


bendings = st.builds(Bending, st.floats(-4e-4, 4e-4), st.floats(0, 1e-3))


@pytest.mark.slow
@given(cameras, image_points, bendings)
def test_every_correction_has_its_inverse(camera: Camera, image: Floats, constant: Bending) -> None:
    ideal = corrections.undistort(image, camera, constant)
    assert np.abs(corrections.distort(ideal, camera, constant) - image).max() < PICOMETRE
    again = corrections.undistort(corrections.distort(ideal, camera, constant), camera, constant)
    assert np.abs(again - ideal).max() < PICOMETRE


@given(st.sampled_from([FORWARD, BACKWARD]), st.tuples(*[unit] * 7), st.floats(-100, 100), st.floats(-100, 100))
def test_brown_is_the_formula_of_the_project_file(direction: str, c: tuple[float, ...], x: float, y: float) -> None:
    k1, k2, k3, p1, p2 = c[0] * 1e-6, c[1] * 1e-11, c[2] * 1e-16, c[3] * 1e-6, c[4] * 1e-6
    b1, b2 = c[5] * 1e-3, c[6] * 1e-3
    camera = replace(PLAIN, distortion=brown(direction, (k1, k2, k3), (p1, p2), (b1, b2)))
    r2 = x**2 + y**2
    dx = x * (k1 * r2 + k2 * r2**2 + k3 * r2**3) + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y + b1 * x + b2 * y
    dy = y * (k1 * r2 + k2 * r2**2 + k3 * r2**3) + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y
    given_points, shifted = np.array([[x, y]]), np.array([[x + dx, y + dy]])
    shift = corrections.undistort if direction == FORWARD else corrections.distort
    assert shift(given_points, camera) == pytest.approx(shifted, abs=1e-12)


@given(st.one_of(browns, tables), image_points)
def test_the_jacobian_agrees_with_differences(distortion: Distortion, points: Floats) -> None:
    points = points[np.hypot(*points.T) > 1]
    h = 1e-4
    ways = (
        [points + h * unit_vector for unit_vector in np.eye(2)],
        [points - h * unit_vector for unit_vector in np.eye(2)],
    )
    columns = [
        (a + corrections.distortion_shift(a, distortion) - b - corrections.distortion_shift(b, distortion)) / (2 * h)
        for a, b in zip(*ways, strict=True)
    ]
    assert np.allclose(corrections.distortion_jacobian(points, distortion), np.stack(columns, -1), rtol=0, atol=1e-7)


# ------------------------------------------------------------------------------------------- tables


def test_the_spline_is_that_of_scipy_with_the_table_mirrored() -> None:
    distortion = table(FORWARD)
    nodes, values = np.array(distortion.radius), np.array(distortion.distortion)
    other = CubicSpline(np.append(-nodes[:0:-1], nodes), np.append(-values[:0:-1], values), bc_type="not-a-knot")
    radius = np.linspace(0, 170, 1001)
    found = corrections.distortion_shift(np.stack([radius, np.zeros_like(radius)], -1), distortion)
    assert np.abs(found[:, 0] - other(radius)).max() < 1e-12
    assert not found[:, 1].any()


@directions
def test_points_beyond_the_table_are_refused_by_name(direction: str) -> None:
    camera = replace(PLAIN, principal_point=(1.0, 0.0), format=None, distortion=table(direction, (0.0, 50.0, 100.0)))
    image = np.array([[80.0, 0.0], [99.0, 50.0], [-60.0, 80.5]])
    with pytest.raises(InputError) as caught:
        refine(image, camera)
    places = [fault.message.partition(" mm from")[0] for fault in caught.value.faults]
    assert places == ["photo 1, point P1: 110.018", "photo 1, point P2: 101.001"]
    assert "the distortion table of camera plain ends at " in caught.value.faults[0].message
    assert caught.value.faults[0].key == "cameras.plain.distortion.radius"
    for convert in (corrections.distort, corrections.undistort):
        with pytest.raises(InputError, match="lies beyond the distortion table"):
            convert(image, camera)


# ------------------------------------------------------------------------------------------- no inverse


@pytest.mark.parametrize(
    ("direction", "k1", "folds"),
    [
        (FORWARD, -1.0e-5, False),  # turns back at 182.6 mm, the corner of the format is at 162.6
        (FORWARD, -1.3e-5, True),  # at 160.1
        (BACKWARD, -1.0e-5, True),  # at an ideal radius of 182.6, but the image there is at 121.7 only
        (BACKWARD, -5.0e-6, False),  # at 258.2, the image at 172.1
        (BACKWARD, -6.0e-6, True),  # at 235.7, the image at 157.1
        (FORWARD, 1e-5, False),
        (BACKWARD, 1e-5, False),
    ],
)
def test_distortion_that_folds_the_photo_is_refused(direction: str, k1: float, folds: bool) -> None:
    camera = replace(PLAIN, distortion=brown(direction, (k1, 0.0, 0.0)))
    found = corrections.distortion_faults(camera)
    assert bool(found) == folds
    if folds:
        # r (1 + k1 r^2) turns back where 1 + 3 k1 r^2 = 0; radii are tried in steps of at most 1 % of the corner's
        turn = 1 / np.sqrt(-3 * k1)
        radius = float(found[0].message.split("folds ")[1].split(" mm")[0])
        assert turn - 0.06 < radius < turn + 0.01 * 162.7 + 0.06
        with pytest.raises(InputError, match="the distortion has no inverse"):
            refine(np.array([[10.0, 10.0]]), camera)


# ------------------------------------------------------------------------------------------- refraction


def atmosphere(height: Floats) -> Floats:
    """Refractive index by heights in metres, by integrating the weight of the air: Gladstone and Dale, 0.226 cm3/g."""
    fine = np.arange(-1000.0, 40_001.0, 1.0)
    temperature = 288.15 - 0.0065 * np.minimum(fine, 11_000) + 0.001 * np.maximum(fine - 20_000, 0)
    weight = 9.80665 / (287.053 * temperature)  # dp / p per metre
    log_pressure = -np.concatenate([[0.0], np.cumsum((weight[1:] + weight[:-1]) / 2)])
    pressure = 101_325 * np.exp(log_pressure - log_pressure[1000])
    return np.asarray(1 + 2.26e-4 * np.interp(height, fine, pressure / (287.053 * temperature)))


def traced(radius: float, flying: float, ground: float, earth_radius: float = np.inf) -> tuple[float, float]:
    """Image radius without refraction of the ray that the camera sees at `radius`, and how far that ray goes, metres.

    The ray is followed down through 4000 layers by Snell's law, in spherical layers by Bouguer's. Only heights count
    on the way: the ideal direction is that of the straight line to the point where the ray meets the ground.
    """
    edges = np.linspace(flying, ground, 4001)
    middle, step = (edges[1:] + edges[:-1]) / 2, (flying - ground) / 4000
    level = 1 / (1 + middle / earth_radius) if np.isfinite(earth_radius) else np.ones_like(middle)
    top = 1 / (1 + flying / earth_radius)
    sine = atmosphere(np.array([flying]))[0] * np.sin(np.arctan(radius / FOCAL)) / atmosphere(middle) * level / top
    tangent = sine / np.sqrt(1 - sine**2)
    if not np.isfinite(earth_radius):
        away, down = (step * tangent).sum(), flying - ground
    else:
        turned = (step * tangent / (earth_radius + middle)).sum()
        away, down = (
            (earth_radius + ground) * np.sin(turned),
            earth_radius + flying - (earth_radius + ground) * np.cos(turned),
        )
    return FOCAL * away / down, away


HEIGHTS = pytest.mark.parametrize(
    ("flying", "ground"),
    [(1000.0, 0.0), (3000.0, 500.0), (5000.0, 0.0), (8000.0, 4000.0), (12_000.0, 1000.0), (20_000.0, 0.0)],
)


@HEIGHTS
@pytest.mark.parametrize("radius", [20.0, 90.0, 150.0])
def test_refraction_is_that_of_a_ray_through_the_standard_atmosphere(
    radius: float, flying: float, ground: float
) -> None:
    ideal, _ = traced(radius, flying, ground)
    assert ideal < radius  # the ray bends towards the denser air below: the image lies too far outside
    settings = ImageCorrectionSettings(refraction=True, flying_height=flying, ground_height=ground)
    found = refine(np.array([[0.6 * radius, -0.8 * radius]]), PLAIN, settings)
    corrected = np.hypot(*found.observations.xy[0])
    assert corrected < radius
    assert abs(corrected - ideal) < 0.03 * MICROMETRE
    assert found.largest_um == {"refraction": pytest.approx((radius - ideal) / MICROMETRE, rel=0.004)}


def test_the_constant_agrees_with_the_printed_formula() -> None:
    for flying, ground in ((1000.0, 0.0), (5000.0, 300.0), (11_000.0, 2000.0)):
        H, h = flying / 1000, ground / 1000
        printed = 2335 / (H - h) * ((1 - 0.02257 * h) ** 5.256 - (1 - 0.02257 * H) ** 5.256)
        printed = (printed - 277.0 * (1 - 0.02257 * H) ** 4.256) * 1e-6
        assert refraction_constant(flying, ground) == pytest.approx(printed, rel=0.006)


# ------------------------------------------------------------------------------------------- Earth curvature


@pytest.mark.parametrize("flying", [1500.0, 5000.0, 9000.0])
@pytest.mark.parametrize("angle_deg", [15.0, 40.0, 55.0])
def test_curvature_is_that_of_a_sphere_seen_from_above(flying: float, angle_deg: float) -> None:
    radius = 6371000.0
    tangent = np.tan(np.radians(angle_deg))
    arc = flying * tangent / radius  # as a plane map has it: distances along the sphere
    below = flying + radius * (1 - np.cos(arc))
    seen = FOCAL * radius * np.sin(arc) / below
    bending = Bending(curvature=curvature_constant(flying, 0.0, radius))
    found = corrections.undistort(np.array([[0.0, seen]]), PLAIN, bending)
    missing = FOCAL * tangent - seen
    assert missing > 0  # the ground falls away from the plane, so its images lie too far inside
    assert found[0, 0] == 0
    assert found[0, 1] == pytest.approx(seen + missing, abs=0.01 * missing)


# ------------------------------------------------------------------------------------------- tables of photos


def test_every_fault_of_every_camera_is_told_at_once() -> None:
    folding = replace(PLAIN, name="folding", distortion=brown(FORWARD, (-1e-4, 0.0, 0.0)))
    short = replace(PLAIN, name="short", distortion=table(FORWARD, (0.0, 50.0)))
    with pytest.raises(InputError) as caught:
        corrections.refine(
            observed(np.full((1, 2), 60.0), ("a", "b")), {"a": folding, "b": short}, ImageCorrectionSettings()
        )
    assert [fault.code for fault in caught.value.faults] == ["distortion-folds", "beyond-distortion-table"]


@pytest.mark.parametrize(("off", "effect"), [("principal_point", "principal point"), ("distortion", "distortion")])
def test_each_correction_has_its_switch(off: str, effect: str) -> None:
    camera = replace(PLAIN, principal_point=(0.012, -0.004), distortion=brown(FORWARD, (1.2e-8, 0.0, 0.0)))
    points = observed(np.array([[80.0, -60.0], [-90.0, 10.0]]), ("1",))
    both = corrections.refine(points, {"1": camera}, ImageCorrectionSettings())
    one = corrections.refine(points, {"1": camera}, replace(ImageCorrectionSettings(), **{off: False}))
    assert set(both.largest_um) - set(one.largest_um) == {effect}
    without = (
        replace(camera, principal_point=(0.0, 0.0)) if off == "principal_point" else replace(camera, distortion=None)
    )
    expected = corrections.refine(points, {"1": without}, ImageCorrectionSettings())
    assert np.array_equal(one.observations.xy, expected.observations.xy)
    assert both.largest_um[effect] == pytest.approx(12.6 if off == "principal_point" else 12.0, rel=0.03)
