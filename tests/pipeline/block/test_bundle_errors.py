"""Gross errors in a bundle adjustment: found, named, taken out; found as often as theory says; good ones come back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.network import reliability
from photostrip.network.adjustment import solve
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, GrossError, Ground, Image, Points, Spec, Terrain
from tests.loops import nonempty
from tests.pipeline.blocks import adjusted, errors, positions, simulate
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result
    from photostrip.simulation import Simulation

pytestmark = pytest.mark.usefixtures("_no_findings")

TRIALS = 200
BLOCK = Spec(flight=Flight(photos=8, strips=2), points=Points(extra_per_model=8))


def rays_of(result: Result) -> set[tuple[str, str]]:
    """Photo and point of every ray that takes part."""
    assert result.bundle is not None
    seen = result.inputs.observations
    rows = result.bundle.block.rows[result.bundle.screened.selection.images]
    return {(seen.photo_ids[seen.photo[r]], seen.point_ids[seen.point[r]]) for r in rows.tolist()}


@pytest.mark.slow
def test_gross_errors_are_found_and_named() -> None:
    spec = replace(BLOCK, gross_errors=(GrossError("image", count=12, size_um=150.0, axis="y"),))
    simulation = simulate(spec)
    wrong = {(each.photo, each.point) for each in simulation.truth.errors}
    result = adjusted(simulation)
    used = rays_of(result)
    assert not wrong & used
    told = {each["point"] for each in document_of(result)["rejected"] if not each["readmitted"]}
    assert {point for _, point in wrong} <= told
    assert len(told - {point for _, point in wrong}) <= 3
    clean = adjusted(simulate(BLOCK))
    assert np.sqrt((errors(simulation, result) ** 2).mean()) < 1.2 * np.sqrt(
        (errors(simulate(BLOCK), clean) ** 2).mean()
    )


@pytest.mark.slow
def test_wrong_control_is_named_and_left_out() -> None:
    simulation = simulate(BLOCK)
    inputs = inputs_of(simulation)
    enu = inputs.control.enu.copy()
    row = int(np.flatnonzero(~inputs.control.check)[4])
    enu[row, 2] += 1.5
    result = adjusted(simulation, replace(inputs, control=replace(inputs.control, enu=enu)))
    name = inputs.control.ids[row]
    told = [note for note in result.notes if note.code == "control-rejected"]
    (one,) = [note for note in told if note.points == (name,)]
    assert "up" in one.message
    assert len(told) <= 2  # one of a hundred coordinates may go by chance
    difference = result.control_differences[row]
    assert difference[2] == pytest.approx(-1.5, abs=0.3)
    assert np.abs(difference[:2]).max() < 0.2  # the plan still counts


@pytest.mark.slow
@pytest.mark.parametrize(("alpha", "share"), [(None, 0.0), (0.001, 0.006)])
def test_good_measurements_stay(alpha: float | None, share: float) -> None:
    """The level is that of the whole adjustment; with one for each, a point on two photos loses both rays."""
    out = total = 0
    for seed in range(6):
        result = adjusted(simulate(replace(BLOCK, seed=seed)), alpha=alpha)
        assert result.bundle is not None
        out += int((~result.bundle.screened.selection.images).sum())
        total += len(result.bundle.screened.selection.images)
    assert out <= share * total


# ---------------------------------------------------------------------------------------------- what theory says


def test_the_shift_of_the_test_and_its_limits() -> None:
    """Baarda's table: 4.13 for levels of 0.1 % and 80 %; 2.80 for 5 % and 80 %."""
    assert reliability.noncentrality(0.001, 0.80) == pytest.approx(4.13, abs=0.005)
    assert reliability.noncentrality(0.05, 0.80) == pytest.approx(2.80, abs=0.005)
    assert reliability.limit("baarda", 0.001, 100) == pytest.approx(3.291, abs=0.001)
    assert reliability.limit("tau", 0.001, 10**6) == pytest.approx(3.291, abs=0.001)
    assert reliability.limit("tau", 0.05, 10) == pytest.approx(1.904, abs=0.005)  # Pope 1976
    assert reliability.limit("tau", 0.05, 1) == np.inf


@pytest.mark.slow
def test_errors_of_the_detectable_size_are_found_as_often_as_said() -> None:
    """Monte Carlo over the noise: the first test of an observation with an error of its detectable size."""
    noisy = replace(BLOCK, flight=Flight(photos=5))
    simulation = simulate(replace(noisy, image=Image(sigma_um=0.0), control=Control(noise=(0, 0, 0))))
    sigma = simulate(noisy).observations.sigma
    true = inputs_of(simulation)
    base = replace(true, observations=replace(true.observations, sigma=sigma))
    clean = adjusted(simulation, base, screening="none", test="baarda")
    assert clean.bundle is not None
    image, problem = clean.bundle.groups[0], clean.bundle.screened.problem
    detectable = image.detectable(reliability.noncentrality(0.001, 0.80))
    limit, random, found, alarms = reliability.limit("baarda", 0.001, 10), np.random.default_rng(3), 0, 0
    checked = np.argwhere(image.redundancy > 0.1)
    given = problem.control
    for _ in range(TRIALS):
        xy = problem.images.xy + random.normal(size=sigma.shape) * problem.images.sigma
        noise = np.einsum("nji,nj->ni", given.axes, random.normal(size=given.sigma.shape) * given.sigma)
        row, axis = checked[random.integers(len(checked))]
        xy[row, axis] += detectable[row, axis]
        spoilt = replace(problem, images=replace(problem.images, xy=xy), control=replace(given, xyz=given.xyz + noise))
        test = solve(spoilt).image_residuals / (image.sigma * np.sqrt(image.redundancy))
        found += int(abs(test[row, axis]) > limit)
        other = checked[random.integers(len(checked), size=20)]
        other = other[spoilt.images.point[other[:, 0]] != spoilt.images.point[row]]
        alarms += int((np.abs(test[other[:, 0], other[:, 1]]) > limit).sum())
    assert found / TRIALS == pytest.approx(0.80, abs=3 * np.sqrt(0.16 / TRIALS))
    assert alarms < 0.01 * 20 * TRIALS  # an error of one also moves its neighbours a little


# --------------------------------------------------------------------------------------------- variance components


TRUE = {"image": 2.0, "control plan": 3.0, "control height": 1.0, "positions plan": 4.0, "positions height": 4.0}


def scattered(random: np.random.Generator, number: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Draw errors in three coordinates whose mean squares are 1."""
    drawn = random.normal(size=(number, 3))
    return np.asarray(drawn / np.sqrt((drawn**2).mean(axis=0)))


def factors(seed: int) -> tuple[dict[str, float], float]:
    """Give the factors that one block finds by group, without those that are not estimated, and its sigma0."""
    spec = Spec(
        seed=seed,
        flight=Flight(photos=8, strips=3),
        points=Points(extra_per_model=8),
        image=Image(sigma_um=10.0),
        control=Control(bands=5, noise=(0.0, 0.0, 0.0)),
    )
    simulation, random = simulate(spec), np.random.default_rng(seed)
    inputs = inputs_of(simulation)
    used, enu = ~inputs.control.check, inputs.control.enu.copy()
    enu[used] += scattered(random, int(used.sum())) * (0.15, 0.15, 0.08)
    inputs = replace(
        inputs,
        observations=replace(inputs.observations, sigma=np.full_like(inputs.observations.sigma, 0.005)),
        control=replace(inputs.control, enu=enu),
        positions=positions(simulation, noise=0.2 * scattered(random, 24)),
    )
    result = adjusted(simulation, inputs, variance_components=True)
    found = document_of(result)["bundle"]["variance_components"]
    estimated = {each["group"]: float(each["factor"]) for each in found if each["estimated"]}
    return estimated, np.nan if result.bundle is None else result.bundle.screened.solution.sigma0


@pytest.mark.slow
def test_variance_components_find_what_was_misstated() -> None:
    """Two blocks, which know each factor to 2 to 6 %, that of control heights to 15 %."""
    found = [factors(seed) for seed in range(2)]
    assert [sigma0 for _, sigma0 in found] == pytest.approx([1.0, 1.0], abs=0.01)
    assert all(each.keys() == TRUE.keys() for each, _ in nonempty(found))
    mean = {name: float(np.sqrt(np.mean([each[name] ** 2 for each, _ in found]))) for name in TRUE}
    assert mean["image"] == pytest.approx(2.0, rel=0.03)
    assert mean["control plan"] == pytest.approx(3.0, rel=0.12)
    assert mean["control height"] == pytest.approx(1.0, rel=0.25)
    assert mean["positions plan"] == pytest.approx(4.0, rel=0.15)
    assert mean["positions height"] == pytest.approx(4.0, rel=0.20)


# ------------------------------------------------------------------------------------------------ self-calibration


def calibrated(
    spec: Spec, camera: dict[str, object], wanted: tuple[str, ...], **settings: object
) -> tuple[Simulation, Result]:
    """Adjust with a camera that is stated wrongly."""
    simulation = simulate(spec)
    inputs = inputs_of(simulation)
    noise = np.random.default_rng(5).normal(size=(len(simulation.truth.centers), 3)) * 0.02
    strips = tuple(
        replace(strip, camera=replace(strip.camera, **camera), calibrate=wanted)  # type: ignore[arg-type]
        for strip in inputs.strips
    )
    given = positions(simulation, sigma=0.02, noise=noise)
    return simulation, adjusted(simulation, replace(inputs, strips=strips, positions=given), **settings)


CROSSED = Spec(
    flight=Flight(photos=8, strips=3, alternate=True, side_lap_percent=50.0), points=Points(extra_per_model=12)
)


@pytest.mark.slow
def test_a_wrong_calibration_is_found() -> None:
    wrong = {"principal_distance": 153.0 + 0.08, "principal_point": (0.03, -0.02)}
    simulation, result = calibrated(CROSSED, wrong, ("principal_distance", "principal_point"))
    assert result.bundle is not None
    found = {each.name: each for each in result.bundle.parameters}
    expected = {"principal_distance": -0.08, "principal_point x": -0.03, "principal_point y": 0.02}
    for name, value in nonempty(expected.items()):
        assert abs(found[name].value - value) < 3.5 * found[name].sigma, name
        assert found[name].sigma < 0.01
        assert found[name].significant
    assert np.sqrt((errors(simulation, result) ** 2).mean()) < 0.08
    _, without = calibrated(CROSSED, wrong, (), search_cameras=False)
    assert np.sqrt((errors(simulation, without) ** 2).mean()) > np.sqrt((errors(simulation, result) ** 2).mean())


@pytest.mark.slow
@pytest.mark.parametrize("wanted", ["principal_distance", "principal_point"])
def test_what_cannot_be_told_apart_is_refused_by_name(wanted: str) -> None:
    """Vertical photos over a plane: the principal distance goes with the flying height, the point with the shift."""
    flat = Spec(
        flight=Flight(photos=6, attitude_sigma_deg=(0.0, 0.0, 0.0), position_sigma=(0.0, 0.0, 0.0)),
        terrain=Terrain(relief=0.0),
        ground=Ground(crs="local"),
    )
    simulation = simulate(flat)
    inputs = inputs_of(simulation)
    strips = tuple(replace(strip, calibrate=(wanted,)) for strip in inputs.strips)
    with pytest.raises(GeometryError, match=r"camera film: (c|x0|y0)"):
        adjusted(simulation, replace(inputs, strips=strips))
