"""The bundle adjustment through the whole pipeline: exact without noise, whatever ties the photos to the ground."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.pipeline.inputs import Strip
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Ground, Spec, Terrain
from tests.pipeline.blocks import adjusted, corners, errors, exact, orientations, positions, simulate, with_control
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.pipeline.inputs import CameraPositions, Inputs
    from photostrip.simulation import Simulation

pytestmark = pytest.mark.usefixtures("_no_findings")

MICROMETRE = 1e-6  # metres
BLOCK = exact(flight=Flight(photos=6, strips=3))

EXACT_BLOCKS = {
    "a strip": exact(flight=Flight(photos=6)),
    "strips flown both ways": exact(flight=Flight(photos=6, strips=3, alternate=True)),
    "5 x 20 photos": exact(flight=Flight(photos=20, strips=5)),
    "plan and height points": exact(
        flight=Flight(photos=8, strips=2),
        control=Control(noise=(0, 0, 0), use={"xyz": 0.4, "xy": 0.3, "z": 0.3}, bands=4),
    ),
    "two zones": exact(
        ground=Ground(center_deg=(18.0, 49.2)),
        flight=Flight(photos=8, strips=2),
        control=Control(noise=(0, 0, 0), second_crs="EPSG:32634"),
    ),
    "geocentric": exact(ground=Ground(crs="geocentric"), flight=Flight(photos=5, strips=2)),
    "local": exact(ground=Ground(crs="local"), flight=Flight(photos=5, strips=2)),
    "southern, X north": exact(
        ground=Ground(crs="EPSG:32733", axes=("north", "east", "up"), center_deg=(15.0, -20.0)),
        flight=Flight(photos=5, strips=2, heading_deg=200.0),
    ),
    "tilted photos": exact(flight=Flight(photos=6, strips=2, end_lap_percent=70, attitude_sigma_deg=(4.0, 4.0, 4.0))),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("title", EXACT_BLOCKS)
def test_without_noise_the_truth_comes_back(title: str) -> None:
    simulation = simulate(EXACT_BLOCKS[title])
    result = adjusted(simulation)
    assert np.abs(errors(simulation, result)).max() < MICROMETRE
    assert len(result.points.number) == len(simulation.truth.points.ids)
    check = result.control_differences[simulation.control.check & (result.control_rows >= 0)]
    assert np.nanmax(np.abs(check)) < MICROMETRE
    assert result.bundle is not None
    assert result.bundle.screened.rejections == ()
    centers = np.concatenate([s.intermediate.cartesian_from_intermediate(s.resection.centers) for s in result.strips])
    assert np.abs(centers - simulation.truth.centers).max() < MICROMETRE


def heights(given: CameraPositions) -> CameraPositions:
    """Positions of which the heights alone count; the plan is not given at all, as by a statoscope."""
    plan = np.array([True, True, False])
    return replace(given, enu=np.where(plan, np.nan, given.enu), use=np.tile(~plan, (len(given.photos), 1)))


TIED: dict[str, Callable[[Simulation], Inputs]] = {
    "corners only": lambda s: with_control(s, corners(s)),
    "positions only": lambda s: replace(with_control(s, []), positions=positions(s)),
    "positions and one point": lambda s: replace(with_control(s, corners(s)[:1]), positions=positions(s)),
    "lever arm": lambda s: replace(with_control(s, corners(s)[:1]), positions=positions(s, lever=(0.3, -0.5, 1.2))),
    "offset": lambda s: replace(
        with_control(s, corners(s)), positions=positions(s, shift=np.array([3.0, 2.0, 1.0]), correction="offset")
    ),
    "drift": lambda s: replace(
        with_control(s, corners(s)),
        positions=positions(s, shift=np.arange(18)[:, None] * np.array([0.1, -0.2, 0.05]), correction="drift"),
    ),
    "orientations": lambda s: replace(with_control(s, []), orientations=orientations(s, observed=True)),
    "orientations, alpha": lambda s: replace(
        with_control(s, []), orientations=orientations(s, observed=True, system="alpha-omega-kappa")
    ),
    "one offset of the block": lambda s: replace(
        with_control(s, corners(s)[:1]),
        positions=replace(positions(s, shift=np.array([3.0, 2.0, 1.0]), correction="offset"), group="block"),
    ),
    "one drift of the block": lambda s: replace(
        with_control(s, corners(s)),
        positions=replace(
            positions(s, shift=np.arange(18)[:, None] * np.array([0.1, -0.2, 0.05]), correction="drift"), group="block"
        ),
    ),
    "heights of the cameras with offset": lambda s: replace(
        with_control(s, corners(s)), positions=heights(positions(s, shift=20.0, correction="offset"))
    ),
    "heights of the cameras with drift": lambda s: replace(
        with_control(s, corners(s)),
        positions=heights(positions(s, shift=0.3 * np.arange(18.0)[:, None] - 7.0, correction="drift")),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("title", TIED)
def test_whatever_ties_the_photos_to_the_ground(title: str) -> None:
    simulation = simulate(BLOCK)
    result = adjusted(simulation, TIED[title](simulation))
    # three metres of the grid are not three metres everywhere: its scale changes by 1e-6 over the block
    allowed = 10 if title in {"offset", "drift"} else 20 if "of the block" in title else 1
    assert np.abs(errors(simulation, result)).max() < allowed * MICROMETRE
    assert not any(note.code == "free-network" for note in result.notes)


@pytest.mark.slow
def test_offset_and_drift_are_found_as_they_are() -> None:
    simulation = simulate(BLOCK)
    step = np.array([0.1, -0.2, 0.05])
    shift = np.concatenate([np.arange(6)[:, None] * step + [1, 2, 3], np.zeros((12, 3))])
    inputs = replace(
        with_control(simulation, corners(simulation)), positions=positions(simulation, shift=shift, correction="drift")
    )
    document = document_of(adjusted(simulation, inputs))
    found = {each["name"]: each["value"] for each in document["bundle"]["corrections"]}
    for axis, name in enumerate(("east", "north", "up")):
        # what is added to the given positions, the offset in mid-strip; metres of the ground, not of the grid
        assert found[f"positions A: drift {name}"] == pytest.approx(-step[axis], rel=1e-3)
        assert found[f"positions A: offset {name}"] == pytest.approx(-(axis + 1 + 2.5 * step[axis]), rel=1e-3)
        assert abs(found[f"positions B: offset {name}"]) < 1e-4


@pytest.mark.slow
def test_single_photos_join_a_strip() -> None:
    """Every strip but the first is cut into photos of their own."""
    simulation = simulate(exact(flight=Flight(photos=6, strips=2, side_lap_percent=60.0)))
    inputs = inputs_of(simulation)
    first, second = inputs.strips
    singles = tuple(Strip(photo, second.camera, (photo,)) for photo in second.photos)
    result = adjusted(simulation, replace(inputs, strips=(first, *singles)))
    assert np.abs(errors(simulation, result)).max() < MICROMETRE
    document = document_of(result)
    assert [photo["id"] for photo in document["photos"]] == [*first.photos, *second.photos]
    assert {each["photo"] for each in document["residuals"]} == {*first.photos, *second.photos}
    found = {photo["id"]: (photo["x"], photo["y"], photo["z"]) for photo in document["photos"]}
    place = [found[photo] for photo in second.photos]
    np.testing.assert_allclose(place, simulation.truth.centers_ground[6:], atol=1e-4)
    assert document["counts"]["photos"] == 12


UNDETERMINED: dict[str, tuple[Spec, Callable[[Simulation], Inputs]]] = {
    "roll about the flight line": (
        exact(flight=Flight(photos=6, position_sigma=(0, 0, 0))),
        lambda s: replace(with_control(s, []), positions=positions(s)),
    ),
    "neither control nor camera positions": (BLOCK, lambda s: with_control(s, corners(s)[:2])),
    "nothing that is given has a plan position": (
        BLOCK,
        lambda s: replace(with_control(s, []), positions=heights(positions(s))),
    ),
    "shift along the flight": (
        BLOCK,
        lambda s: replace(with_control(s, []), positions=positions(s, correction="offset")),
    ),
}


@pytest.mark.parametrize("words", UNDETERMINED)
def test_what_is_not_determined_is_named(words: str) -> None:
    spec, given = UNDETERMINED[words]
    simulation = simulate(spec)
    with pytest.raises(GeometryError, match=words):
        adjusted(simulation, given(simulation))


@pytest.mark.slow
def test_sigma0_and_precision_are_those_of_the_noise() -> None:
    """Errors in units of the stated precision, over blocks of 200 points; limits on both sides."""
    ratios, sigma0, squares = [], [], []
    for seed in range(4):
        simulation = simulate(Spec(seed=seed, flight=Flight(photos=10, strips=3), terrain=Terrain(relief=80.0)))
        result = adjusted(simulation, screening="none", test="baarda")
        assert result.precision is not None
        assert result.bundle is not None
        error = errors(simulation, result)
        scale = np.einsum("ni,nij,nj->n", error, np.linalg.inv(result.precision.points), error)
        ratios.append(scale.mean() / 3)
        sigma0.append(result.bundle.screened.solution.sigma0)
        squares.append(len(scale))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)  # errors of neighbouring points go together
    assert np.mean(sigma0) == pytest.approx(1.0, abs=0.03)
    assert min(squares) > 150
