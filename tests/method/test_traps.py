"""Traps of the method: what looks right and is wrong, shown to be a trap, and how the program keeps out of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import photostrip
from photostrip.errors import EXIT_GEOMETRY, EXIT_INPUT, GeometryError, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.simulation import DIGITAL, FILM, Control, Flight, Ground, Image, Simulation, Spec, Terrain, simulate
from photostrip.strip import absolute_orientation, polynomial
from tests.loops import nonempty
from tests.results import write_project
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.pipeline.results import Result, StripResult

    Floats = NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("_no_findings")

CUBIC = ("1", "X", "Y", "XY", "X^2", "X^3")
SIMILARITY = Settings(adjustment="similarity")
LOCAL = FrameSpec("local", ("east", "north", "up"))
PLANE_MAP = replace(
    Settings(), absolute=absolute_orientation.AbsoluteSettings(earth_curvature="model")
)  # curvature by eq. 153


def degree(asked: str) -> Settings:
    return Settings(adjustment="polynomial", polynomial=polynomial.PolynomialSettings(asked))


def errors(simulation: Simulation, result: Result) -> Floats:
    """Of all adjusted points, Cartesian frame, metres."""
    found: Floats = result.points.cartesian - simulation.truth.points.xyz[result.points.number]
    return found


def rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))


def codes(result: Result) -> set[str]:
    return {note.code for note in result.notes}


def true_places(simulation: Simulation, strip: StripResult) -> Floats:
    """Where the points of a strip really are, in its intermediate frame."""
    return strip.intermediate.intermediate_from_cartesian(simulation.truth.points.xyz[strip.formed.point])


# --------------------------------------------------------------------------- six control points at three stations


def six_points(seed: int) -> tuple[Simulation, Inputs]:
    """Twenty models with two control points at the beginning, in the middle and at the end."""
    spec = Spec(
        seed=seed,
        flight=Flight(photos=21, end_lap_percent=62.0),
        control=Control(bands=3, per_band=2, sigma=(0.02, 0.02, 0.02)),
    )
    done = simulate(spec)
    return done, inputs_of(done)


def cubic_columns(xyz: Floats) -> Floats:
    """The six terms of eq. 150, written apart from the program; kilometres keep them of one size."""
    x, y = xyz[:, 0] / 1000, xyz[:, 1] / 1000
    return np.column_stack([np.ones(len(x)), x, y, x * y, x**2, x**3])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_six_points_fit_a_cubic_perfectly_and_say_nothing_between(seed: int) -> None:
    """The trap itself: six unknowns, six equations, no residual, metres to hundreds of metres of error between."""
    done, inputs = six_points(seed)
    strip = triangulate(inputs, SIMILARITY).strips[0]
    control = strip.xyz[strip.control_rows]
    wanted = (
        absolute_orientation.Targets(strip.control, tie_frames(inputs.frames)[0], strip.intermediate).of(control)
        - control
    )
    coefficients = np.linalg.solve(cubic_columns(control), wanted)
    assert np.abs(cubic_columns(control) @ coefficients - wanted).max() < 1e-9
    bent = strip.xyz + cubic_columns(strip.xyz) @ coefficients - true_places(done, strip)
    assert np.abs(bent).max() > 5.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_stations_count_not_points(seed: int) -> None:
    done, inputs = six_points(seed)
    result = triangulate(inputs, degree("3"))
    found = result.strips[0].polynomial
    assert found is not None
    assert found.stations == (3, 3)
    assert found.degree == 2
    assert all("X^3" not in axis.terms for axis in nonempty(found.axes))
    assert "degree-reduced" in codes(result)
    assert "3 stations" in next(note.message for note in result.notes if note.code == "degree-reduced")
    assert np.abs(errors(done, result)).max() < 1.5
    assert np.abs(errors(done, triangulate(inputs, degree("auto")))).max() < 2.0


@pytest.mark.slow
def test_four_stations_carry_a_cubic() -> None:
    done = simulate(Spec(flight=Flight(photos=21, end_lap_percent=62.0), control=Control(bands=4, per_band=2)))
    result = triangulate(inputs_of(done), degree("3"))
    found = result.strips[0].polynomial
    assert found is not None
    assert found.stations == (4, 4)
    assert found.axes[0].terms == CUBIC
    assert "degree-reduced" not in codes(result)


# --------------------------------------------------------- the X axis of the polynomials along the meridian


def east_west_strip() -> tuple[Simulation, StripResult, Result]:
    """Twenty models from west to east with a systematic error: a lens whose distortion nobody knows of."""
    spec = Spec(
        flight=Flight(photos=21, end_lap_percent=62.0, heading_deg=90.0),
        image=Image(sigma_um=0.0),
        control=Control(bands=4, noise=(0.0, 0.0, 0.0), sigma=(0.02, 0.02, 0.02)),
    )
    done = simulate(spec)
    inputs = inputs_of(done)
    xy = inputs.observations.xy
    radius = np.hypot(*xy.T)[:, None]
    bad = replace(inputs, observations=replace(inputs.observations, xy=xy * (1 + 2e-8 * radius**2)))  # 20 um at 100 mm
    result = triangulate(bad, replace(SIMILARITY, polynomial=polynomial.PolynomialSettings("3")))
    return done, result.strips[0], result


def corrected_in(azimuth: float, strip: StripResult, result: Result) -> tuple[Floats, polynomial.Polynomial]:
    """Fit a cubic in a frame with its X axis in some azimuth; points come back in the Cartesian frame."""
    frame = strip.intermediate.with_azimuth(azimuth)
    xyz = frame.intermediate_from_cartesian(strip.cartesian)
    targets = absolute_orientation.Targets(strip.control, result.frames, frame)
    weight = absolute_orientation.weights(strip.control, strip.precision)
    breadth = float(np.quantile(np.abs(xyz[:, 1]), 0.95))
    problem = polynomial.FitProblem(xyz[strip.control_rows], targets, weight, spacing=850.0, breadth=breadth)
    found = polynomial.fit(problem, polynomial.PolynomialSettings("3"))
    return frame.cartesian_from_intermediate(found(xyz)), found


@pytest.mark.slow
def test_an_x_axis_along_the_meridian_spoils_the_polynomial_of_an_east_west_strip() -> None:
    done, strip, result = east_west_strip()
    truth = done.truth.points.xyz[strip.formed.point]
    along, found = corrected_in(strip.intermediate.azimuth, strip, result)
    meridian, _ = corrected_in(0.0, strip, result)
    assert found.axes[0].terms == CUBIC
    assert rms(along - truth) < 0.1 * rms(strip.cartesian - truth)
    assert rms(meridian - truth) > 30 * rms(along - truth)


@pytest.mark.parametrize("heading", [0.0, 73.0, 90.0, 180.0, 271.0])
def test_the_program_lays_x_along_the_strip(heading: float) -> None:
    done = simulate(Spec(flight=Flight(photos=12, heading_deg=heading)))
    strip = triangulate(inputs_of(done), Settings()).strips[0]
    off = (np.degrees(strip.intermediate.azimuth) - heading + 180) % 360 - 180
    assert abs(off) < 1.0  # the ends of the strip are displaced at random
    centers = strip.of_photos.resection.centers
    assert np.ptp(centers[:, 0]) > 30 * np.ptp(centers[:, 1])
    assert (np.diff(centers[:, 0]) > 0).all()


# ----------------------------------------------------------------------------- curvature hidden by the X^2 term


@pytest.fixture(scope="module")
def plane_map() -> tuple[Simulation, Inputs, Floats]:
    """A strip of 20 km without errors, whose UTM coordinates and heights are taken for Cartesian ones."""
    done = simulate(
        Spec(
            ground=Ground(center_deg=(15.0, 42.5)),
            flight=Flight(photos=24, end_lap_percent=62.0),
            terrain=Terrain(height=0.0, relief=20.0),
            image=Image(sigma_um=0.0),
            control=Control(bands=3, noise=(0.0, 0.0, 0.0)),
        )
    )
    truth = done.truth.ground.xyz
    assert np.ptp(truth[:, 0]) == pytest.approx(20_000.0, rel=0.05)
    return done, replace(inputs_of(done), frames=(LOCAL,)), truth


def height_rms(case: tuple[Simulation, Inputs, Floats], settings: Settings) -> float:
    _, inputs, truth = case
    result = triangulate(inputs, settings)
    return rms(result.points.ground[:, 2] - truth[result.points.number, 2])


def test_flat_treatment_of_a_curved_earth_costs_metres(plane_map: tuple[Simulation, Inputs, Floats]) -> None:
    """Theory: 2.99 m for a strip of 20 km; an arc of that length bulges by L^2/8R = 7.85 m."""
    assert 2.0 < height_rms(plane_map, SIMILARITY) < 4.5


@pytest.mark.slow
def test_the_square_term_hides_most_of_the_curvature(plane_map: tuple[Simulation, Inputs, Floats]) -> None:
    """The trap: residuals at control look fine, what is left across the strip and between does not show."""
    _, inputs, _ = plane_map
    hidden = height_rms(plane_map, degree("2"))
    assert 0.01 < hidden < 0.5
    found = triangulate(inputs, degree("2")).strips[0].polynomial
    assert found is not None
    along = np.ptp(found.reach) / 2
    bulge = -found.axes[2].coefficients[found.axes[2].terms.index("X^2")] * along**2
    assert abs(bulge) == pytest.approx(along**2 / (2 * 6_371_000.0), rel=0.02)  # the coefficient is the Earth's radius


@pytest.mark.slow
def test_the_correction_before_and_after_leaves_a_centimetre(plane_map: tuple[Simulation, Inputs, Floats]) -> None:
    """Theory: 0.008 m, from the mean radius instead of that in the direction of the strip."""
    model = height_rms(plane_map, replace(PLANE_MAP, adjustment="similarity"))
    assert model < 0.02
    assert model < height_rms(plane_map, SIMILARITY) / 200
    assert model < height_rms(plane_map, degree("2"))


@pytest.mark.slow
def test_the_correction_in_the_images_does_the_same_photo_by_photo(
    plane_map: tuple[Simulation, Inputs, Floats],
) -> None:
    """The arc between neighbouring photos takes the place of the straight line, up to terms of higher order."""
    in_images = replace(SIMILARITY, refinement=replace(SIMILARITY.refinement, earth_radius=6_371_000.0))
    found = height_rms(plane_map, in_images)
    assert found < height_rms(plane_map, SIMILARITY) / 50


def test_the_geocentric_route_needs_no_correction(plane_map: tuple[Simulation, Inputs, Floats]) -> None:
    done, _, _ = plane_map
    result = triangulate(inputs_of(done), SIMILARITY)
    assert np.abs(errors(done, result)).max() < 1e-6


@pytest.mark.parametrize(
    ("crs", "axes"),
    [
        ("EPSG:32633", ("east", "north", "up")),
        ("EPSG:4979", ("east", "north", "up")),
        ("geocentric", ("x", "y", "z")),
    ],
)
def test_curvature_twice_is_refused(crs: str, axes: tuple[str, str, str]) -> None:
    done = simulate(Spec(ground=Ground(crs=crs, axes=axes)))
    with pytest.raises(InputError, match="carries the curvature already: it would count twice") as caught:
        triangulate(inputs_of(done), PLANE_MAP)
    assert {fault.code for fault in caught.value.faults} == {"curvature-twice"}
    assert caught.value.exit_code == EXIT_INPUT


def test_curvature_in_images_and_in_the_frame_is_refused() -> None:
    done = simulate(Spec())
    in_images = replace(SIMILARITY, refinement=replace(SIMILARITY.refinement, earth_radius=6_371_000.0))
    with pytest.raises(InputError, match="counted twice: in the images and in EPSG:32633, which carries it"):
        triangulate(inputs_of(done), in_images)


# ---------------------------------------------------------------------------------------------- points seen once


def with_rows(inputs: Inputs, rows: list[tuple[str, str, float, float]]) -> Inputs:
    """The same project with more measurements: photo, point, x, y."""
    seen = inputs.observations
    points = list(seen.point_ids)
    for _, name, _, _ in rows:
        if name not in points:
            points.append(name)
    more = [(seen.photo_ids.index(photo), points.index(name)) for photo, name, _, _ in rows]
    observations = PhotoPoints(
        seen.photo_ids,
        tuple(points),
        np.append(seen.photo, [photo for photo, _ in more]),
        np.append(seen.point, [point for _, point in more]),
        np.vstack([seen.xy, [row[2:] for row in rows]]),
        np.vstack([seen.sigma, np.tile(seen.sigma[:1], (len(rows), 1))]),
    )
    return replace(inputs, observations=observations)


@pytest.mark.slow
def test_points_seen_once_are_listed_and_change_nothing() -> None:
    done = simulate(Spec())
    inputs = inputs_of(done)
    photos = inputs.strips[0].photos
    more = with_rows(
        inputs,
        [
            (photos[2], "once", 3.0, -50.0),
            (photos[3], "apart", 60.0, 10.0),
            (photos[5], "apart", -60.0, 10.0),
        ],
    )
    settings = Settings(adjustment="polynomial")  # a bundle takes points of any two photos
    before, after = triangulate(inputs, settings), triangulate(more, settings)
    assert after.not_determined == {
        "once": "measured on one photo only",
        "apart": "not on two neighbouring photos of one strip",
    }
    np.testing.assert_array_equal(before.points.number, after.points.number)
    np.testing.assert_array_equal(before.points.cartesian, after.points.cartesian)
    np.testing.assert_array_equal(
        before.strips[0].of_photos.resection.rotations, after.strips[0].of_photos.resection.rotations
    )


@pytest.mark.slow
@pytest.mark.parametrize("seen_on", [(2,), (3, 5)], ids=["one photo", "two photos that are not neighbours"])
def test_control_without_coordinates_in_the_strip_does_not_take_part(seen_on: tuple[int, ...]) -> None:
    done = simulate(Spec())
    inputs = inputs_of(done)
    photos = inputs.strips[0].photos
    more = with_rows(inputs, [(photos[k], "lost", 3.0, -50.0) for k in seen_on])
    far = ControlPoints(
        (*inputs.control.ids, "lost"),
        np.vstack([inputs.control.enu, inputs.control.enu[:1] + 5000.0]),
        np.vstack([inputs.control.use, [[True, True, True]]]),
        np.append(inputs.control.check, False),
        np.vstack([inputs.control.sigma, inputs.control.sigma[:1]]),
        np.append(inputs.control.frame, 0),
    )
    before, after = triangulate(inputs, Settings()), triangulate(replace(more, control=far), Settings())
    assert list(after.not_determined) == ["lost"]
    assert "lost" not in after.strips[0].control.ids
    assert after.control_rows[-1] == -1
    assert np.isnan(after.control_differences[-1]).all()
    np.testing.assert_array_equal(before.points.cartesian, after.points.cartesian)


def test_a_strip_whose_only_control_is_seen_once_is_refused() -> None:
    done = simulate(Spec(control=Control(layout="corners")))
    inputs = inputs_of(done)
    seen = inputs.observations
    _, first = np.unique(seen.point, return_index=True)
    given = np.isin([seen.point_ids[n] for n in seen.point], done.control.ids)
    keep = ~given | np.isin(np.arange(len(seen)), first)  # of given points the first measurement only
    poor = replace(seen, photo=seen.photo[keep], point=seen.point[keep], xy=seen.xy[keep], sigma=seen.sigma[keep])
    with pytest.raises(
        GeometryError, match="strip A: neither control nor camera positions nor tie points connect"
    ) as caught:
        triangulate(replace(inputs, observations=poor), Settings())
    assert caught.value.exit_code == EXIT_GEOMETRY


# --------------------------------------------------------------------------------------- photos without control


@pytest.mark.slow
def test_photos_that_see_no_control_are_carried_by_the_strip() -> None:
    """Control at both ends only: the photos between are oriented, exactly without errors and worse with them."""
    spec = Spec(flight=Flight(photos=14), control=Control(layout="corners", noise=(0.0, 0.0, 0.0)))
    done = simulate(spec)
    control = {name for name, check in zip(done.control.ids, done.control.check, strict=True) if not check}
    seen = done.observations
    with_control = {
        int(photo) for photo, point in zip(seen.photo, seen.point, strict=True) if seen.point_ids[point] in control
    }
    without = sorted(set(range(14)) - with_control)
    assert len(without) >= 8
    for sigma_um, low, high in ((0.0, 0.0, 1e-6), (5.0, 0.05, 5.0)):
        noisy = simulate(replace(spec, image=Image(sigma_um=sigma_um)))
        strip = triangulate(inputs_of(noisy), settings_of(noisy)).strips[0]
        assert strip.of_photos.resection.solved.all()
        centers = strip.intermediate.cartesian_from_intermediate(strip.of_photos.resection.centers)
        error = np.linalg.norm(centers - noisy.truth.centers, axis=1)
        assert low <= error[without].max() < high


# -------------------------------------------------------------------------------- what polynomials are not made for


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_points_beyond_the_control_are_warned_of() -> None:
    """Control in the first three fifths only: a cubic runs away where it is not held, and the report says so."""
    squares: dict[str, list[float]] = {"similarity": [], "3": [], "inside": []}
    for seed in range(1, 9):
        done = simulate(Spec(seed=seed, flight=Flight(photos=21), control=Control(bands=6)))
        inputs = inputs_of(done)
        east = inputs.control.enu[:, 0]
        kept = ~inputs.control.check & (east < east.min() + 0.7 * np.ptp(east))
        short = replace(inputs, control=inputs.control.take(kept))
        for name, asked in (("similarity", SIMILARITY), ("3", degree("3"))):
            result = triangulate(short, asked)
            end = result.points.ground[:, 0] > east[kept].max()
            squares[name].append(rms(errors(done, result)[end]) ** 2)
        squares["inside"].append(rms(errors(done, result)[~end]) ** 2)
        assert "extrapolation" in codes(result)
    assert "extrapolation" not in codes(triangulate(inputs, degree("3")))
    assert np.mean(squares["3"]) > 1.5 * np.mean(squares["similarity"])
    assert np.mean(squares["3"]) > 30 * np.mean(squares["inside"])


@pytest.mark.parametrize(("photos", "warned"), [(26, False), (27, True)])
def test_long_strips_are_warned_of(photos: int, warned: bool) -> None:
    done = simulate(Spec(flight=Flight(photos=photos), control=Control(every=5)))
    assert ("long-strip" in codes(triangulate(inputs_of(done), Settings("polynomial")))) == warned


# ------------------------------------------------------------------------------------------ the base across the frame


@pytest.mark.parametrize(("kappa", "across"), [(0.0, False), (31.0, False), (90.0, False), (0.0, True)])
def test_the_printed_intersection_is_as_good_at_any_kappa(kappa: float, across: bool, tmp_path: Path) -> None:
    """Eq. 138 divides by x1 - x2: with the base along Y of the strip's frame points were 25 m off under GOOD.

    across: a camera of today whose x axis, along its short side, lies across the flight.
    """
    spec = Spec(
        seed=4,
        camera=DIGITAL if across else FILM,
        flight=Flight(photos=10, photo_rotation_deg=90.0 if across else kappa),
        control=Control(bands=4, check=15),
    )
    project = write_project(tmp_path, spec)
    both, left = (
        photostrip.run(project, processing={"adjustment": "polynomial", "intersection": each}).document["summary"]
        for each in ("mean", "left")
    )
    # a y parallax turns into an x parallax by the tangent of the angle to the nearer axis: at 31 degrees 0.6 of it
    for part in ("plan", "height"):
        assert left["check"][part]["rms"] < 1.2 * both["check"][part]["rms"]
    assert left["image_rms_um"] < 1.2 * both["image_rms_um"]
    assert left["check"]["normalised"] < 1.2 * both["check"]["normalised"]
