"""Traps of the method: what looks right and is wrong, shown to be a trap, and how the program keeps out of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import photostrip
from photostrip.arrays import Floats
from photostrip.errors import EXIT_INPUT, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.points import PhotoPoints
from photostrip.result.document import document_of
from photostrip.simulation import DIGITAL, FILM, Control, Flight, GrossError, Ground, Image, Spec, Terrain, simulate
from photostrip.strip import absolute_orientation
from photostrip.strip.polynomial import PolynomialSettings
from tests.results import write_project
from tests.simulated import inputs_of

pytestmark = pytest.mark.usefixtures("_no_findings")

SIMILARITY = Settings(adjustment="similarity")
LOCAL = FrameSpec("local", ("east", "north", "up"))
PLANE_MAP = replace(
    Settings(), absolute=absolute_orientation.AbsoluteSettings(earth_curvature="model")
)  # curvature by eq. 153


def rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))


@pytest.mark.slow
def test_flat_treatment_of_a_curved_earth_costs_metres_and_either_correction_takes_them_away() -> None:
    """A strip of 20 km without errors, whose UTM coordinates and heights are taken for Cartesian ones.

    Theory: 2.99 m, for an arc of that length bulges by L^2/8R = 7.85 m; corrected before and after 0.008 m, from the
    mean radius instead of that in the direction of the strip. In the images the arc between neighbouring photos takes
    the place of the straight line.
    """
    done = simulate(
        Spec(
            ground=Ground(center_deg=(15.0, 42.5)),
            flight=Flight(photos=24, end_lap_percent=62.0),
            terrain=Terrain(height=0.0, relief=20.0),
            image=Image(sigma_um=0.0),
            control=Control(bands=3, noise=(0.0, 0.0, 0.0)),
        )
    )
    truth, inputs = done.truth.ground.xyz, replace(inputs_of(done), frames=(LOCAL,))
    assert np.ptp(truth[:, 0]) == pytest.approx(20_000.0, rel=0.05)

    def height_rms(settings: Settings) -> float:
        points = triangulate(inputs, settings).points
        return rms(points.ground[:, 2] - truth[points.number, 2])

    flat, before_and_after = height_rms(SIMILARITY), height_rms(replace(PLANE_MAP, adjustment="similarity"))
    assert 2.0 < flat < 4.5
    assert before_and_after < min(0.02, flat / 200)
    assert before_and_after < height_rms(Settings(adjustment="polynomial", polynomial=PolynomialSettings("2")))
    in_images = replace(SIMILARITY, refinement=replace(SIMILARITY.refinement, earth_radius=6_371_000.0))
    assert height_rms(in_images) < flat / 50


def test_curvature_twice_is_refused() -> None:
    cure = "drop `earth_curvature: model`, or give plane coordinates of an unknown projection as `crs: local`"
    with pytest.raises(InputError, match=f"carries the curvature already: it would count twice; {cure}") as caught:
        triangulate(inputs_of(simulate(Spec(ground=Ground()))), PLANE_MAP)
    assert {fault.code for fault in caught.value.faults} == {"curvature-twice"}
    assert caught.value.exit_code == EXIT_INPUT


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
@pytest.mark.parametrize(
    ("adjustment", "apart"),
    [("polynomial", "not on two neighbouring photos of one strip"), ("bundle", "rays contradict each other")],
)
def test_points_seen_once_are_listed_and_change_nothing(adjustment: str, apart: str) -> None:
    """As many as would loosen the test of gross errors, if they counted as found wrong."""
    inputs = inputs_of(simulate(Spec(seed=3, gross_errors=(GrossError("image", count=3, size_um=70.0),))))
    photos, random = inputs.strips[0].photos, np.random.default_rng(1)
    inputs = with_rows(inputs, [(photos[3], "apart", 60.0, 10.0), (photos[5], "apart", -60.0, -30.0)])
    once = [(photo, f"S{n}", *random.uniform(-90.0, 90.0, 2).tolist()) for n, photo in enumerate(photos * 10)]
    before, after = (triangulate(each, Settings(adjustment=adjustment)) for each in (inputs, with_rows(inputs, once)))
    assert before.not_determined["apart"] == apart
    reasons = {point: "measured on one photo only" for _, point, _, _ in once}
    assert after.not_determined == before.not_determined | reasons
    np.testing.assert_array_equal(before.points.number, after.points.number)
    a, b = (document_of(result) for result in (before, after))
    assert {key for key in a if a[key] != b[key]} == {"counts", "not_determined", "residuals"}
    assert a["counts"] | {key: b["counts"][key] for key in ("image_points", "not_determined")} == b["counts"]
    (ray,) = b["residuals"].where(point="S7")
    assert (ray["vx_um"], ray["vy_um"], ray["used"]) == (None, None, False)


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
