"""Refinement of image coordinates: an atmosphere, formulas written out, round trips, refusals; cameras in pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.errors import InputError
from photostrip.points import PhotoPoints
from photostrip.strip import corrections
from photostrip.strip.corrections import Bending, ImageCorrectionSettings, Refined, curvature_constant, image_from_ideal
from photostrip.strip.pixel_cameras import CONVENTIONS, PixelCamera, in_millimetres
from tests.strips import measured

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
    return measured({photo: {f"P{n}": each for n, each in enumerate(xy)} for photo in photos})


def refine(xy: Floats, camera: Camera, settings: ImageCorrectionSettings | None = None) -> Refined:
    return corrections.refine(observed(xy), {"1": camera}, settings or ImageCorrectionSettings())


unit = st.floats(-1, 1)
# up to 7 % of pincushion or barrel in the corner, far more than any camera for photogrammetry has
browns = st.builds(
    lambda direction, c: brown(
        direction, (c[0] * 1e-6, c[1] * 3e-11, c[2] * 1e-15), (c[3] * 2e-6, c[4] * 2e-6), (c[5] * 1e-3, c[6] * 1e-3)
    ),
    st.sampled_from([FORWARD, BACKWARD]),
    st.tuples(*[unit] * 7),
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


def atmosphere(height: Floats) -> Floats:
    """Refractive index by heights in metres, by integrating the weight of the air: Gladstone and Dale, 0.226 cm3/g."""
    fine = np.arange(-1000.0, 40_001.0, 1.0)
    temperature = 288.15 - 0.0065 * np.minimum(fine, 11_000) + 0.001 * np.maximum(fine - 20_000, 0)
    weight = 9.80665 / (287.053 * temperature)  # dp / p per metre
    log_pressure = -np.concatenate([[0.0], np.cumsum((weight[1:] + weight[:-1]) / 2)])
    pressure = 101_325 * np.exp(log_pressure - log_pressure[1000])
    return np.asarray(1 + 2.26e-4 * np.interp(height, fine, pressure / (287.053 * temperature)))


def traced(radius: float, flying: float, ground: float) -> float:
    """Image radius without refraction of the ray that the camera sees at `radius`.

    The ray is followed down through 4000 layers by Snell's law; the ideal direction is that of the straight line to the
    point where it meets the ground.
    """
    edges = np.linspace(flying, ground, 4001)
    sine = (
        atmosphere(np.array([flying]))[0] * np.sin(np.arctan(radius / FOCAL)) / atmosphere((edges[1:] + edges[:-1]) / 2)
    )
    return FOCAL * float((sine / np.sqrt(1 - sine**2)).mean())


HEIGHTS = pytest.mark.parametrize(
    ("flying", "ground"),
    [(1000.0, 0.0), (3000.0, 500.0), (5000.0, 0.0), (8000.0, 4000.0), (12_000.0, 1000.0), (20_000.0, 0.0)],
)


@HEIGHTS
@pytest.mark.parametrize("radius", [20.0, 90.0, 150.0])
def test_refraction_is_that_of_a_ray_through_the_standard_atmosphere(
    radius: float, flying: float, ground: float
) -> None:
    ideal = traced(radius, flying, ground)
    assert ideal < radius  # the ray bends towards the denser air below: the image lies too far outside
    settings = ImageCorrectionSettings(refraction=True, flying_height=flying, ground_height=ground)
    found = refine(np.array([[0.6 * radius, -0.8 * radius]]), PLAIN, settings)
    corrected = np.hypot(*found.observations.xy[0])
    assert corrected < radius
    assert abs(corrected - ideal) < 0.03 * MICROMETRE
    assert found.largest_um == {"refraction": pytest.approx((radius - ideal) / MICROMETRE, rel=0.004)}


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


SIZE = (4000.0, 3000.0)
RADIAL, DECENTRING = (-0.11, 0.023, 0.0013), (1.3e-3, -2.1e-3)
PLACES = np.random.default_rng(7).uniform(-0.6, 0.6, (200, 2))  # x to the right, y down, at depth one


def pixel_camera(convention: str) -> PixelCamera:
    """Give a camera with everything that a convention has."""
    way = CONVENTIONS[convention]
    names = (*way.radial, *way.decentring)
    coefficients = dict(zip(names, (*RADIAL, *DECENTRING), strict=True)) | dict.fromkeys(way.others, 0.0)
    if convention == "metashape":
        coefficients |= {"b1": 1.7, "b2": -0.9}
    focal = {"metashape": (3100.0, 3100.0), "opensfm": (0.77, 0.76)}.get(convention, (3100.0, 3085.0))
    point = {"metashape": (12.5, -7.5), "opensfm": (0.003, -0.002)}.get(convention, (2011.0, 1488.0))
    return PixelCamera(convention, SIZE, focal_length=focal, principal_point=point, distortion=coefficients)


def by_documentation(camera: PixelCamera) -> Floats:
    """Pixels from the corner of the first one, as the documentation of each program writes them."""
    x, y = PLACES.T
    r2 = x * x + y * y
    p1, p2 = DECENTRING
    radial = 1.0 + RADIAL[0] * r2 + RADIAL[1] * r2**2 + RADIAL[2] * r2**3
    (fx, fy), (cx, cy) = camera.focal_length, camera.principal_point
    if camera.convention == "metashape":
        u = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
        v = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
        return np.stack([SIZE[0] * 0.5 + cx + u * fx + u * 1.7 + v * -0.9, SIZE[1] * 0.5 + cy + v * fy], axis=-1)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    if camera.convention == "opensfm":
        side = max(SIZE)
        return np.stack([(u * fx + cx) * side + SIZE[0] / 2, (v * fy + cy) * side + SIZE[1] / 2], axis=-1)
    half = 0.5 if camera.convention == "opencv" else 0.0
    return np.stack([u * fx + cx + half, v * fy + cy + half], axis=-1)


def by_us(camera: Camera) -> Floats:
    """Pixels from the corner of the first one, by the camera in millimetres."""
    ideal = PLACES * (camera.principal_distance, -camera.principal_distance)
    x, y = (image_from_ideal(ideal, camera.distortion or Distortion("brown", "ideal_to_image"))).T
    x, y = x + camera.principal_point[0], y + camera.principal_point[1]
    b1, b2 = camera.pixel_affinity
    assert camera.pixel_size
    return np.stack([((1 + b1) * x + b2 * y) / camera.pixel_size + SIZE[0] / 2, SIZE[1] / 2 - y / camera.pixel_size]).T


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_pixels_are_those_of_the_documentation(convention: str) -> None:
    camera = pixel_camera(convention)
    assert by_us(in_millimetres("c", camera, 0.004)) == pytest.approx(by_documentation(camera), abs=1e-9)


@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("OPENCV", [3100.0, 3085.0, 2011.0, 1488.0, RADIAL[0], RADIAL[1], *DECENTRING]),
        ("FULL_OPENCV", [3100.0, 3085.0, 2011.0, 1488.0, RADIAL[0], RADIAL[1], *DECENTRING, RADIAL[2], 0.0, 0.0, 0.0]),
    ],
)
def test_pixels_are_those_of_colmap(model: str, parameters: list[float]) -> None:
    import pycolmap

    peer = pycolmap.Camera(model=model, width=4000, height=3000, params=parameters)
    camera = pixel_camera("colmap")
    if model == "OPENCV":
        camera.distortion["k3"] = 0.0  # type: ignore[index]
    expected = peer.img_from_cam(np.column_stack([PLACES, np.ones(len(PLACES))]))
    assert by_us(in_millimetres("c", camera)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("convention", "name"), [("opencv", "k4"), ("colmap", "k6"), ("metashape", "p3")])
def test_what_has_no_counterpart_is_refused_by_name(convention: str, name: str) -> None:
    camera = PixelCamera(convention, SIZE, (3100.0, 3100.0), principal_point=(0.0, 0.0), distortion={name: 0.01})
    with pytest.raises(InputError, match=f"the coefficient {name} of {convention} has no counterpart"):
        in_millimetres("c", camera)
