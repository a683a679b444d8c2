"""The whole method against known truth: free of errors it comes back exactly, with errors as theory says.

The photos are made by the collinearity equations (``simulation``, which has its own proof); nothing of the method is
used in making them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from pyproj import Proj
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import Similarity
from photostrip.network.problem import BundleSettings
from photostrip.pipeline.formed_photos import form_strip
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.points import ControlPoints, locate
from photostrip.result.document import document_of
from photostrip.simulation import (
    DIGITAL,
    FILM,
    Control,
    Film,
    Flight,
    Ground,
    Points,
    Simulation,
    Spec,
    Terrain,
    simulate,
)
from photostrip.strip import polynomial
from tests.loops import nonempty
from tests.results import rotation
from tests.simulated import inputs_of, settings_of

pytestmark = pytest.mark.usefixtures("_no_findings")

MICRON = 1e-6  # metres, and radians: what exact means; geocentric coordinates are stored to 1e-9 m
SIGMA = 5e-6 * 10_000  # metres: 5 micrometres at the photo scale 1:10 000
EXACT_CONTROL = (0.0, 0.0, 0.0)


def exact(spec: Spec, **control: str) -> Spec:
    """The same without any error of measurement."""
    given_exactly = replace(spec.control, noise=EXACT_CONTROL, second_crs=control.get("second_crs"))
    return replace(spec, image=replace(spec.image, sigma_um=0.0), control=given_exactly)


@dataclass(frozen=True, eq=False)
class Recovery:
    """How far a run stays from the truth."""

    simulation: Simulation
    result: Result

    @property
    def errors(self) -> Floats:
        """Of all adjusted points, Cartesian frame, metres."""
        return self.result.points.cartesian - self.simulation.truth.points.xyz[self.result.points.number]

    @property
    def points(self) -> float:
        """Largest error of a coordinate, metres."""
        return float(np.abs(self.errors).max())

    @property
    def centers(self) -> float:
        """Largest error of a coordinate of a perspective centre, metres."""
        return max(
            float(np.abs(strip.intermediate.cartesian_from_intermediate(strip.resection.centers) - true).max())
            for strip, true in zip(self.result.strips, self._of_photos(self.simulation.truth.centers), strict=True)
        )

    @property
    def rotations(self) -> float:
        """Largest angle between a photo's orientation and the true one, radians."""
        found = [strip.intermediate.cartesian_rotations(strip.resection.rotations)
                 for strip in self.result.strips]  # fmt: skip
        true = self._of_photos(self.simulation.truth.rotations)
        turns = [np.swapaxes(one, -1, -2) @ other for one, other in zip(found, true, strict=True)]
        return max(float(Rotation.from_matrix(turn).magnitude().max()) for turn in turns)

    def _of_photos(self, values: Floats) -> list[Floats]:
        """True values by strip."""
        place = {photo: n for n, photo in enumerate(self.simulation.truth.photo_ids)}
        return [values[[place[photo] for photo in strip.strip.photos]] for strip in self.result.strips]

    def along_across_up(self) -> Floats:
        """Mean square errors of the points that are not control, along, across and up, metres squared."""
        control = self.simulation.control
        fixed = {name for name, check in zip(control.ids, control.check, strict=True) if not check}
        ids = self.simulation.observations.point_ids
        free = np.array([ids[number] not in fixed for number in self.result.points.number])
        mean: Floats = ((self.errors[free] @ self.result.strips[0].intermediate.axes) ** 2).mean(axis=0)
        return mean


def recovered(spec: Spec, settings: Settings | None = None) -> Recovery:
    done = simulate(spec)
    return Recovery(done, triangulate(inputs_of(done), settings or settings_of(done)))


def assert_exact(found: Recovery) -> None:
    assert found.points < MICRON
    assert found.centers < MICRON
    assert found.rotations < MICRON
    assert found.result.not_determined == {}
    assert len(found.result.points.number) == len(found.simulation.observations.point_ids)
    assert not any(strip.of_photos.rejections for strip in found.result.strips)
    assert all(strip.resection.solved.all() for strip in nonempty(found.result.strips))
    given_differences = found.result.control_differences[found.simulation.control.use]
    assert np.abs(given_differences).max() < MICRON


GROUNDS = {
    "edge of a zone": Ground(crs="EPSG:32633", center_deg=(17.9, 70.0)),  # convergence 2.7 degrees
    "UTM at 180": Ground(crs="EPSG:32660", center_deg=(180.0, 52.0)),
    "two zones at 180": Ground(crs="EPSG:32760", center_deg=(180.0, -17.0)),
    "Gauss-Krueger": Ground(crs="EPSG:31467", axes=("north", "east", "up"), center_deg=(9.4, 48.0)),
    "latitude, longitude": Ground(crs="EPSG:4326", axes=("north", "east", "up")),
    "above the geoid": Ground(height="orthometric", geoid_undulation=44.7),
    "geocentric": Ground(crs="geocentric", axes=("x", "y", "z")),
    "local": Ground(crs="local"),
    "moon": Ground(crs="geocentric", axes=("x", "y", "z"), ellipsoid=(1_737_400.0, 1_737_400.0)),
    "near the pole": Ground(crs="EPSG:3413", center_deg=(-45.0, 88.0)),
    "feet": Ground(crs="EPSG:2263", center_deg=(-74.0, 40.7)),  # plan in US survey feet
}


@pytest.mark.parametrize("name", GROUNDS)
def test_any_ground_frame_comes_back(name: str) -> None:
    second = {"second_crs": "EPSG:32701"} if name == "two zones at 180" else {}
    found = recovered(exact(Spec(ground=GROUNDS[name], flight=Flight(photos=8)), **second))
    assert_exact(found)
    assert len(set(found.simulation.control.frame.tolist())) == 1 + len(second)
    ground_error = found.result.output.difference(
        found.result.points.ground, found.simulation.truth.ground.xyz[found.result.points.number]
    )
    assert np.abs(ground_error).max() < MICRON


@pytest.mark.parametrize(
    ("control", "crs"),
    [
        (Control(layout="corners"), "EPSG:32633"),
        (Control(layout="corners+centre"), "local"),
        (Control(bands=4, use={"xyz": 0.5, "xy": 0.25, "z": 0.25}), "local"),
        (Control(bands=4, use={"xy": 0.4, "z": 0.6}), "EPSG:32633"),
        (Control(bands=2, per_band=2), "EPSG:32633"),
    ],
)
def test_any_control_that_determines_the_strip_brings_it_back(control: Control, crs: str) -> None:
    assert_exact(recovered(exact(Spec(ground=Ground(crs=crs, center_deg=(16.5, 49.2)), control=control))))


@pytest.mark.parametrize("adjustment", ["similarity", "polynomial"])
@pytest.mark.parametrize("degree", ["1", "2", "3"])
def test_no_adjustment_spoils_what_is_exact(adjustment: str, degree: str) -> None:
    spec = exact(Spec(flight=Flight(photos=15), control=Control(bands=4)))
    asked = Settings(adjustment=adjustment, polynomial=polynomial.PolynomialSettings(degree))
    found = recovered(spec, asked)
    assert_exact(found)
    used = found.result.strips[0].polynomial
    assert (used is None) == (adjustment == "similarity")
    assert used is None or used.degree == int(degree)


def distorted(direction: str) -> Camera:
    return replace(FILM, distortion=Distortion("brown", direction, k=(4e-8, -2e-12, 0.0), p=(2e-7, -1e-7)))


@pytest.mark.parametrize(
    "spec",
    [
        Spec(camera=DIGITAL),
        Spec(camera=replace(FILM, principal_point=(0.35, -0.21))),
        Spec(camera=distorted("image_to_ideal")),
        Spec(camera=distorted("ideal_to_image")),
        Spec(film=Film()),
    ],
)
def test_any_camera_comes_back(spec: Spec) -> None:
    assert_exact(recovered(exact(spec)))


@pytest.mark.slow
@pytest.mark.parametrize(("tilt_deg", "left"), [(0.0, 0.02), (1.0, 0.5)])
def test_refraction_is_taken_out(tilt_deg: float, left: float) -> None:
    """The correction takes photos as level and all heights as their mean: with tilts of a degree it leaves a part.

    Most of the effect is taken up by the orientation whether it is corrected or not.
    """
    flight = Flight(scale=30_000.0, end_lap_percent=65.0, attitude_sigma_deg=(tilt_deg, tilt_deg, tilt_deg))
    spec = exact(Spec(flight=flight, terrain=Terrain(relief=0.0), refraction=True))
    as_stated = Settings(bundle=BundleSettings(search_cameras=False))  # a lens would be taken up in its place
    corrected, uncorrected = recovered(spec), recovered(spec, as_stated)
    assert uncorrected.points > 0.03
    assert uncorrected.centers > 0.2
    assert corrected.points < left * uncorrected.points
    assert corrected.centers < 0.05 * uncorrected.centers


@pytest.mark.slow
@hypothesis_settings(max_examples=12)
@given(
    seed=st.integers(0, 10_000),
    photos=st.integers(3, 14),
    lap=st.floats(60.0, 80.0),
    heading=st.floats(0.0, 360.0),
    rotation=st.floats(-180.0, 180.0),
    relief=st.floats(0.0, 200.0),
    latitude=st.floats(-80.0, 80.0),
    longitude=st.floats(-180.0, 180.0),
)
def test_whatever_is_flown_comes_back(
    seed: int,
    photos: int,
    lap: float,
    heading: float,
    rotation: float,
    relief: float,
    latitude: float,
    longitude: float,
) -> None:
    spec = Spec(
        seed=seed,
        ground=Ground(crs="EPSG:4979", center_deg=(longitude, latitude)),
        flight=Flight(photos=photos, end_lap_percent=lap, heading_deg=heading, photo_rotation_deg=rotation),
        terrain=Terrain(relief=relief),
    )
    assert_exact(recovered(exact(spec)))


def test_rotation_rows_are_east_north_up_at_the_perspective_centre() -> None:
    """True axes from longitude and latitude of each centre by their textbook formulas."""
    spec = exact(
        Spec(ground=Ground(crs="EPSG:4979", center_deg=(15.3, 49.2)), flight=Flight(photos=40, heading_deg=60))
    )
    found = recovered(spec)
    photos = document_of(found.result)["photos"]
    assert [photo["id"] for photo in photos] == list(found.simulation.truth.photo_ids)
    lon, lat = np.radians([[photo["x"], photo["y"]] for photo in photos]).T
    east = np.column_stack([-np.sin(lon), np.cos(lon), 0 * lon])
    up = np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    expected = np.stack([east, np.cross(up, east), up], axis=1) @ found.simulation.truth.rotations
    written = np.array([rotation(photo) for photo in photos])
    np.testing.assert_allclose(written, expected, rtol=0, atol=2e-9)
    assert np.degrees(np.arccos(up[0] @ up[-1])) > 0.25  # so that the place where the axes stand matters


def test_rotations_refer_to_the_grid_of_a_projection() -> None:
    """A level photo flown in a true azimuth: its x axis runs along it, less the meridian convergence."""
    level = Flight(photos=3, heading_deg=70.0, attitude_sigma_deg=(0.0, 0.0, 0.0), position_sigma=(0.0, 0.0, 0.0))
    place = (17.9, 70.0)
    found = recovered(exact(Spec(ground=Ground(center_deg=place), flight=level)))
    middle = document_of(found.result)["photos"][1]
    convergence = Proj("EPSG:32633").get_factors(*place).meridian_convergence
    assert convergence > 2.5
    azimuth = np.radians(70.0 - convergence)
    sin, cos = np.sin(azimuth), np.cos(azimuth)
    np.testing.assert_allclose(rotation(middle).ravel(), [sin, -cos, 0, cos, sin, 0, 0, 0, 1], rtol=0, atol=2e-9)


def rms(spec: Spec, seeds: int, *choices: str) -> dict[str, Floats]:
    """Root mean square errors X, Y, Z of points that are not control over seeds 1, 2, ..., in units of sigma."""
    squares: dict[str, list[Floats]] = {choice: [] for choice in choices}
    for seed in range(1, seeds + 1):
        done = simulate(replace(spec, seed=seed))
        inputs = inputs_of(done)
        for choice in choices:
            simple = choice == "similarity"
            asked = Settings(
                adjustment="similarity" if simple else "polynomial",
                polynomial=polynomial.PolynomialSettings("auto" if simple else choice),
                precision=False,
            )
            squares[choice].append(Recovery(done, triangulate(inputs, asked)).along_across_up())
    return {choice: np.sqrt(np.mean(found, axis=0)) / SIGMA for choice, found in squares.items()}


def strip_of(models: int, bands: int) -> Spec:
    """A film strip 1:10 000 with 5 micrometres, bands of three control points; a dozen points or more in each model."""
    return Spec(
        flight=Flight(photos=models + 1, end_lap_percent=64.0),
        points=Points(reach_percent=75.0, extra_per_model=6),
        control=Control(bands=bands, sigma=(0.02, 0.02, 0.02)),
    )


def test_image_noise_becomes_errors_of_its_size_no_more_and_no_less() -> None:
    found = recovered(strip_of(10, 3))
    strip = found.result.strips[0]
    error = np.sqrt((found.errors**2).mean(axis=1))
    assert np.median(error) > 0.3 * SIGMA  # an error of zero would mean that the truth leaked
    assert np.median(error) < 6.0 * SIGMA
    assert found.centers > 0.3 * SIGMA
    assert found.rotations > 1e-6
    assert float(np.median(strip.of_photos.orientation.sigma0)) == pytest.approx(0.005, rel=0.15)
    assert 0.003 < float(np.sqrt((strip.resection.residuals**2).mean())) < 0.008  # mm


@pytest.mark.slow
def test_twenty_models_stay_within_their_limits() -> None:
    """With four bands: 12 strips know their rms to 9 to 14 %; benchmarks/accuracy.py takes more."""
    found = rms(strip_of(20, 4), 12, "similarity", "3", "auto")
    assert (found["3"] < 1.1 * np.array([2.9, 2.9, 5.9])).all()
    assert (found["3"] > 0.5 * np.array([2.9, 2.9, 5.9])).all()
    assert (found["similarity"] > 1.5 * found["3"]).all()
    assert np.linalg.norm(found["auto"]) < 1.1 * np.linalg.norm(found["3"])


def numbers(result: Result) -> dict[str, Floats]:
    """Every number of a result that is not a difference at a given point."""
    found = {"points": result.points.cartesian, "ground": result.points.ground, "ties": result.ties.difference}
    for strip in result.strips:
        name = strip.strip.id
        found |= {
            f"{name} elements": strip.of_photos.orientation.elements,
            f"{name} weights": strip.of_photos.orientation.pairs.weight,
            f"{name} scale": strip.of_photos.formed.scale,
            f"{name} strip": strip.formed.xyz,
            f"{name} frame": np.vstack([strip.intermediate.origin, strip.intermediate.axes]),
            f"{name} similarity": np.append(strip.absolute.similarity.shift, strip.absolute.similarity.scale),
            f"{name} misclosures": strip.absolute.misclosures,
            f"{name} rejected": np.array([[r.row, r.value, r.limit] for r in strip.of_photos.rejections]),
            f"{name} centers": strip.resection.centers,
            f"{name} rotations": strip.resection.rotations,
            f"{name} residuals": strip.resection.residuals,
        }
        if strip.polynomial is not None:
            found[f"{name} degree"] = np.array([strip.polynomial.degree])
            for axis in strip.polynomial.axes:
                found[f"{name} {len(found)}"] = np.concatenate([axis.coefficients, axis.residuals, axis.leverage])
            weighed = [[e.degree, e.rms, e.left_out, e.f, e.p] for e in strip.polynomial.evidence]
            found[f"{name} evidence"] = np.array(weighed)
    return found


@cache
def noisy_project(crs: str = "EPSG:32633") -> tuple[Simulation, Inputs]:
    spec = Spec(
        ground=Ground(crs=crs),
        flight=Flight(photos=12, strips=2, side_lap_percent=35.0),
        control=Control(bands=4, check=12),
    )
    done = simulate(spec)
    return done, inputs_of(done)


@cache
def noisy_result(crs: str = "EPSG:32633", curvature: str = "auto") -> Result:
    _, inputs = noisy_project(crs)
    return triangulate(inputs, replace(Settings(), absolute=replace(Settings().absolute, earth_curvature=curvature)))


def moved(control: ControlPoints, shift: Floats) -> ControlPoints:
    """The same control list with its check points elsewhere."""
    return replace(control, enu=control.enu + np.where(control.check[:, None], shift, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "curvature"),
    [
        ("wild", "auto"),
        ("wild", "model"),
        ("slightly", "model"),
        ("removed", "auto"),
        ("first", "model"),
        ("plan only", "auto"),
        ("sure", "auto"),
    ],
)
def test_a_check_point_never_influences_anything(change: str, curvature: str) -> None:
    crs = "local" if curvature == "model" else "EPSG:32633"
    done, inputs = noisy_project(crs)
    control = done.control
    assert control.check.sum() == 12
    others = {
        "wild": moved(control, np.array([1e5, -3e5, 4e3])),
        "slightly": moved(control, np.array([0.1, 0.2, -0.3])),
        "removed": control.take(~control.check),
        "first": control.take(np.argsort(~control.check, kind="stable")),
        "plan only": replace(control, use=control.use & ~(control.check[:, None] & np.array([False, False, True]))),
        "sure": replace(control, sigma=np.where(control.check[:, None], 1e-6, control.sigma)),
    }
    alone = noisy_result(crs, curvature)
    before = numbers(alone)
    result = triangulate(replace(inputs, control=others[change]), alone.settings)
    after = numbers(result)
    assert before.keys() == after.keys()
    for name, values in before.items():
        np.testing.assert_array_equal(values, after[name], err_msg=name)
    if change == "wild":  # and it is looked at all the same
        at_check = result.control_differences[result.inputs.control.check]
        assert np.abs(np.abs(at_check) - [1e5, 3e5, 4e3]).max() < 10.0


STEP = 1e-5  # mm, of an image coordinate
PLAIN = Settings()
PLAIN = replace(
    PLAIN,
    adjustment="bundle",
    relative=replace(PLAIN.relative, screening="none"),
    bundle=replace(PLAIN.bundle, screening="none", test="baarda"),
)


def formed(inputs: Inputs, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Form the strip: its points (q, 3), and what must vanish in it, y parallaxes and differences between models."""
    strip = form_strip(inputs.strips[0], replace(inputs.observations, xy=xy), PLAIN)
    pairs = strip.orientation.pairs
    mean = strip.formed.xyz[np.searchsorted(strip.formed.point, inputs.observations.point[pairs.rows[:, 0]])]
    return strip.formed.xyz, strip.orientation.parallax, (strip.formed.model_xyz - mean).ravel()


def test_misclosures_distributed_by_the_covariance_of_the_strip_give_the_network() -> None:
    flight = Flight(photos=5, end_lap_percent=62.0)
    control = Control(bands=2, per_band=2, check=0)
    spec = Spec(
        flight=flight, ground=Ground("local"), terrain=Terrain(relief=80.0), points=Points(rows=3), control=control
    )
    inputs = inputs_of(simulate(spec))
    o, given = inputs.observations, inputs.control
    expected = triangulate(inputs, PLAIN)
    assert expected.precision is not None

    # the strip, its misclosures and the derivatives of both by the image coordinates, by central differences
    strip, parallax, differences = formed(inputs, o.xy)
    misclosures = np.concatenate([parallax, differences])
    points, closed = [], []
    for place in np.ndindex(*o.xy.shape):
        step = np.zeros_like(o.xy)
        step[place] = STEP
        ahead, behind = formed(inputs, o.xy + step), formed(inputs, o.xy - step)
        points.append((ahead[0] - behind[0]).ravel() / (2 * STEP))
        closed.append(np.concatenate([ahead[1] - behind[1], ahead[2] - behind[2]]) / (2 * STEP))
    rows = locate(given.ids, o.point_ids)
    to_ground = Similarity.from_points(strip[rows], given.enu)
    xyz = to_ground(strip)
    turned = to_ground.scale * to_ground.rotation
    by_points = np.einsum("ij,nqj->qin", turned, np.reshape(points, (len(points), -1, 3)))
    free = xyz - xyz.mean(axis=0)
    moves = np.concatenate(
        [np.broadcast_to(np.eye(3), (len(xyz), 3, 3)), -cross_matrix(free), free[:, :, None]], axis=2
    )

    # 0 = w - A p - H v - g: control with the similarity p that nothing gives, and what must vanish anyway
    of_control = by_points[rows].reshape(-1, len(points))
    h = np.concatenate([of_control, np.transpose(closed)])
    a = np.concatenate([moves[rows].reshape(-1, 7), np.zeros((len(misclosures), 7))])
    w = np.concatenate([(xyz[rows] - given.enu).ravel(), misclosures])
    noise = np.concatenate([given.sigma.ravel() ** 2, np.zeros(len(misclosures))])
    variance = o.sigma.ravel() ** 2
    kind = np.repeat(range(3), [len(of_control), len(parallax), len(misclosures) - len(parallax)])
    spread = (h**2 * variance).sum(axis=1) + noise
    scale = 1.0 / np.sqrt([spread[kind == each].max() for each in kind])  # their units differ
    # three times as many as are independent: of each redundant observation one
    inverse = np.linalg.pinv(
        ((h * variance) @ h.T + np.diag(noise)) * scale * scale[:, None], rcond=1e-5, hermitian=True
    )
    inverse *= scale * scale[:, None]
    normal = np.linalg.inv(a.T @ inverse @ a)
    similarity = normal @ a.T @ inverse @ w
    predicted = by_points * variance @ h.T @ inverse
    adjusted = xyz - moves @ similarity - predicted @ (w - a @ similarity)
    left = moves - predicted @ a
    by_images = by_points * variance
    covariance = (
        by_images @ by_points.transpose(0, 2, 1)
        - predicted @ h @ by_images.transpose(0, 2, 1)
        + left @ normal @ left.transpose(0, 2, 1)
    )

    sigma = np.sqrt(np.diagonal(expected.precision.points, axis1=1, axis2=2))
    assert (np.abs(adjusted - expected.points.cartesian) / sigma).max() < 0.03  # squares of the errors
    assert np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)) == pytest.approx(sigma, rel=2e-3)
