"""Two whole strips of the formula book on the ellipsoid of Krasovsky, one exact and one with 5 micrometres of noise."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from photostrip.arrays import Floats
from photostrip.camera import Camera
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.local_frame import geocentric_from_geodetic
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.strip import polynomial
from tests.strips import control_points, measured
from tests.vectors import vector

KRASOVSKY = (6378245.0, 6378245.0 * (1 - 1 / 298.3))
GEOGRAPHIC = FrameSpec("+proj=longlat +a=6378245 +rf=298.3 +no_defs +type=crs", ("east", "north", "up"), "ellipsoidal")
GEOCENTRIC = FrameSpec("geocentric", ("x", "y", "z"), ellipsoid=KRASOVSKY)
FRAMES = pytest.mark.parametrize("frame", ["geographic", "geocentric"])


def geocentric(latitude_deg: float, longitude_deg: float, height: float) -> Floats:
    geodetic = [[np.radians(longitude_deg), np.radians(latitude_deg), height]]
    xyz: Floats = geocentric_from_geodetic(geodetic, KRASOVSKY)[0]
    return xyz


@cache
def run(name: str, frame: str, adjustment: str, degree: str = "auto") -> Result:
    example = vector(name)
    photos = {f"{number}": image for number, image in enumerate(example.input["photos"], start=1)}
    observations = measured(photos)
    check = example.expected["check_points_true"]
    points = {**example.input["control"], **check}
    given = {point: np.array([lon, lat, height]) for point, (lat, lon, height) in points.items()}
    if frame == "geocentric":
        given = {point: geocentric(*position) for point, position in points.items()}
    control = control_points(given, check=list(check))
    strip = Strip("A", Camera("camera", example.input["f"]), observations.photo_ids)
    spec = GEOGRAPHIC if frame == "geographic" else GEOCENTRIC
    settings = Settings(adjustment=adjustment, polynomial=polynomial.PolynomialSettings(degree))
    return triangulate(Inputs(name, (strip,), observations, control, (spec,)), settings)


def errors(name: str, result: Result) -> Floats:
    """Errors of the check points in the intermediate frame, metres."""
    names = [result.inputs.observations.point_ids[number] for number in result.points.number]
    check = vector(name).expected["check_points_true"]
    rows = [names.index(point) for point in check]
    truth = np.array([geocentric(*position) for position in check.values()])
    return np.asarray((result.points.cartesian[rows] - truth) @ result.strips[0].intermediate.axes)


@FRAMES
@pytest.mark.parametrize(
    ("adjustment", "degree"), [("similarity", "auto"), ("polynomial", "3"), ("polynomial", "auto")]
)
def test_the_exact_strip(frame: str, adjustment: str, degree: str) -> None:
    result, example = run("strip-geodetic-1", frame, adjustment, degree), vector("strip-geodetic-1")
    assert np.abs(errors("strip-geodetic-1", result)).max() < example.tol["position_m"]
    azimuth = np.degrees(result.strips[0].intermediate.azimuth)
    assert azimuth == pytest.approx(example.expected["A0_deg"], abs=example.tol["A0_deg"])
    assert 0 < np.abs(result.strips[0].absolute.misclosures).max() < 1e-6  # from the images, not from the truth
    assert len(result.strips[0].control) == 8


@FRAMES
@pytest.mark.parametrize(
    ("adjustment", "degree", "reference"),
    [
        ("similarity", "auto", "reference_rms_m_XYZ_similarity_only"),
        ("polynomial", "3", "reference_rms_m_XYZ_with_polynomial"),
    ],
)
def test_the_strip_with_noise(frame: str, adjustment: str, degree: str, reference: str) -> None:
    result = run("strip-geodetic-2", frame, adjustment, degree)
    rms = np.sqrt((errors("strip-geodetic-2", result) ** 2).mean(axis=0))
    expected = np.array(vector("strip-geodetic-2").expected[reference])
    assert np.all(rms < 1.3 * expected)
    assert np.all(rms > 0.5 * expected)  # such noise cannot leave less
    azimuth = np.degrees(result.strips[0].intermediate.azimuth)
    assert azimuth == pytest.approx(vector("strip-geodetic-2").expected["A0_deg"], abs=0.001)
