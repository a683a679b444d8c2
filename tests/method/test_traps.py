"""Traps of the method: what looks right and is wrong, shown to be a trap, and how the program keeps out of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import photostrip
from photostrip.errors import EXIT_INPUT, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.points import PhotoPoints
from photostrip.simulation import DIGITAL, FILM, Control, Flight, Ground, Image, Simulation, Spec, Terrain, simulate
from photostrip.strip import absolute_orientation, polynomial
from tests.results import write_project
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.pipeline.results import Result, StripResult

    Floats = NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("_no_findings")

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
    np.testing.assert_array_equal(before.strips[0].resection.rotations, after.strips[0].resection.rotations)


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
