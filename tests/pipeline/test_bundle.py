"""The bundle adjustment through the whole pipeline: truth, gross errors, precision, and what is determined."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.network import reliability
from photostrip.network.adjustment import solve
from photostrip.network.defects import GROWN, LOOSE
from photostrip.pipeline.inputs import GivenOrientations, Strip
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, GrossError, Ground, Image, Points, Spec, Terrain, simulate
from tests.loops import nonempty
from tests.pipeline.blocks import (
    adjusted,
    calibrating,
    centers,
    corners,
    errors,
    exact,
    moved,
    orientations,
    photos_of,
    positions,
    rms,
    used_rows,
    with_camera,
    with_control,
)
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import CameraPositions, Inputs
    from photostrip.pipeline.results import Result
    from photostrip.simulation import Simulation

    Floats = NDArray[np.float64]


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
    assert np.abs(centers(result) - simulation.truth.centers).max() < MICROMETRE


def heights(given: CameraPositions) -> CameraPositions:
    """Positions of which the heights alone count; the plan is not given at all, as by a statoscope."""
    plan = np.array([True, True, False])
    return replace(given, enu=np.where(plan, np.nan, given.enu), use=np.tile(~plan, (len(given.photos), 1)))


SHIFT = np.array([3.0, 2.0, 1.0])  # metres
DRIFT = np.arange(18)[:, None] * np.array([0.1, -0.2, 0.05])
TIED: dict[str, tuple[int, Callable[[Simulation], CameraPositions | GivenOrientations | None]]] = {
    "corners only": (4, lambda _: None),
    "positions only": (0, positions),
    "positions and one point": (1, positions),
    "lever arm": (1, lambda s: positions(s, lever=(0.3, -0.5, 1.2))),
    "offset": (4, lambda s: positions(s, shift=SHIFT, correction="offset")),
    "drift": (4, lambda s: positions(s, shift=DRIFT, correction="drift")),
    "one offset of the block": (1, lambda s: replace(positions(s, shift=SHIFT, correction="offset"), group="block")),
    "one drift of the block": (4, lambda s: replace(positions(s, shift=DRIFT, correction="drift"), group="block")),
    "orientations": (0, lambda s: orientations(s, observed=True)),
    "orientations, alpha": (0, lambda s: orientations(s, observed=True, system="alpha-omega-kappa")),
    "heights with offset": (4, lambda s: heights(positions(s, shift=20.0, correction="offset"))),
    "heights with drift": (
        4,
        lambda s: heights(positions(s, shift=0.3 * np.arange(18.0)[:, None] - 7.0, correction="drift")),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("title", TIED)
def test_whatever_ties_the_photos_to_the_ground(title: str) -> None:
    simulation = simulate(BLOCK)
    points, given = TIED[title]
    inputs, of_cameras = with_control(simulation, corners(simulation)[:points]), given(simulation)
    key = "orientations" if isinstance(of_cameras, GivenOrientations) else "positions"
    result = adjusted(simulation, replace(inputs, **{key: of_cameras}))  # type: ignore[arg-type]
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


LEVEL = exact(flight=Flight(photos=6, position_sigma=(0, 0, 0)))
UNDETERMINED: dict[str, tuple[Spec, int, Callable[[Simulation], CameraPositions | None]]] = {
    "roll about the flight line": (LEVEL, 0, positions),
    "neither control nor camera positions": (BLOCK, 2, lambda _: None),
    "nothing that is given has a plan position": (BLOCK, 0, lambda s: heights(positions(s))),
    "shift along the flight": (BLOCK, 0, lambda s: positions(s, correction="offset")),
}


@pytest.mark.parametrize("words", UNDETERMINED)
def test_what_is_not_determined_is_named(words: str) -> None:
    spec, points, given = UNDETERMINED[words]
    simulation = simulate(spec)
    inputs = replace(with_control(simulation, corners(simulation)[:points]), positions=given(simulation))
    with pytest.raises(GeometryError, match=words):
        adjusted(simulation, inputs)


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


TRIALS = 200
NOISY = Spec(flight=Flight(photos=8, strips=2), points=Points(extra_per_model=8))


def rays_of(result: Result) -> set[tuple[str, str]]:
    """Photo and point of every ray that takes part."""
    assert result.bundle is not None
    seen = result.inputs.observations
    rows = result.bundle.block.rows[result.bundle.screened.selection.images]
    return {(seen.photo_ids[seen.photo[r]], seen.point_ids[seen.point[r]]) for r in rows.tolist()}


@pytest.mark.slow
def test_gross_errors_are_found_and_named() -> None:
    spec = replace(NOISY, gross_errors=(GrossError("image", count=12, size_um=150.0, axis="y"),))
    simulation = simulate(spec)
    wrong = {(each.photo, each.point) for each in simulation.truth.errors}
    result = adjusted(simulation)
    used = rays_of(result)
    assert not wrong & used
    told = {each["point"] for each in document_of(result)["rejected"] if not each["readmitted"]}
    assert {point for _, point in wrong} <= told
    assert len(told - {point for _, point in wrong}) <= 3
    clean = adjusted(simulate(NOISY))
    assert rms(simulation, result) < 1.2 * rms(simulate(NOISY), clean)


@pytest.mark.slow
def test_wrong_control_is_named_and_left_out() -> None:
    simulation = simulate(NOISY)
    inputs = inputs_of(simulation)
    (row,) = used_rows(inputs)[4:5].tolist()
    result = adjusted(simulation, moved(inputs, used_rows(inputs)[4:5], [0.0, 0.0, 1.5]))
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
        result = adjusted(simulate(replace(NOISY, seed=seed)), alpha=alpha)
        assert result.bundle is not None
        out += int((~result.bundle.screened.selection.images).sum())
        total += len(result.bundle.screened.selection.images)
    assert out <= share * total


def test_the_shift_of_the_test_and_its_limits() -> None:
    """Baarda's table: 4.13 for levels of 0.1 % and 80 %; 2.80 for 5 % and 80 %; tau of ten for 5 %: Pope 1976."""
    assert [reliability.noncentrality(alpha, 0.80) for alpha in (0.001, 0.05)] == pytest.approx([4.13, 2.80], abs=0.005)
    assert reliability.limit("baarda", 0.001, 100) == pytest.approx(3.291, abs=0.001)
    assert reliability.limit("tau", 0.001, 10**6) == pytest.approx(3.291, abs=0.001)
    assert [reliability.limit("tau", 0.05, r) for r in (10, 1)] == pytest.approx([1.904, np.inf], abs=0.005)


@pytest.mark.slow
def test_errors_of_the_detectable_size_are_found_as_often_as_said() -> None:
    """Monte Carlo over the noise: the first test of an observation with an error of its detectable size."""
    noisy = replace(NOISY, flight=Flight(photos=5))
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


# group: factor of its standard deviations, and how well two blocks know it
TRUE = {
    "image": (2.0, 0.03),
    "control plan": (3.0, 0.12),
    "control height": (1.0, 0.25),
    "positions plan": (4.0, 0.15),
    "positions height": (4.0, 0.20),
}


def scattered(random: np.random.Generator, number: int) -> Floats:
    """Draw errors in three coordinates whose mean squares are 1."""
    drawn = random.normal(size=(number, 3))
    return np.asarray(drawn / np.sqrt((drawn**2).mean(axis=0)))


def factors(seed: int) -> tuple[dict[str, float], float]:
    """Give the factors that one block finds by group, without those that are not estimated, and its sigma0."""
    control, flight = Control(bands=5, noise=(0.0, 0.0, 0.0)), Flight(photos=8, strips=3)
    spec = replace(NOISY, seed=seed, flight=flight, image=Image(sigma_um=10.0), control=control)
    simulation, random = simulate(spec), np.random.default_rng(seed)
    inputs = inputs_of(simulation)
    used = used_rows(inputs)
    inputs = replace(
        moved(inputs, used, scattered(random, len(used)) * (0.15, 0.15, 0.08)),
        observations=replace(inputs.observations, sigma=np.full_like(inputs.observations.sigma, 0.005)),
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
    for name, (factor, share) in TRUE.items():
        assert np.sqrt(np.mean([each[name] ** 2 for each, _ in found])) == pytest.approx(factor, rel=share), name


def calibrated(camera: dict[str, object], *parameters: str, **settings: object) -> tuple[Simulation, Result]:
    """Adjust with a camera that is stated wrongly."""
    simulation = simulate(CROSSED)
    noise = np.random.default_rng(5).normal(size=(len(simulation.truth.centers), 3)) * 0.02
    given = positions(simulation, sigma=0.02, noise=noise)
    inputs = calibrating(with_camera(inputs_of(simulation), **camera), *parameters)
    return simulation, adjusted(simulation, replace(inputs, positions=given), **settings)


CROSSED = Spec(
    flight=Flight(photos=8, strips=3, alternate=True, side_lap_percent=50.0), points=Points(extra_per_model=12)
)


@pytest.mark.slow
def test_a_wrong_calibration_is_found() -> None:
    wrong = {"principal_distance": 153.0 + 0.08, "principal_point": (0.03, -0.02)}
    simulation, result = calibrated(wrong, "principal_distance", "principal_point")
    assert result.bundle is not None
    found = {each.name: each for each in result.bundle.parameters}
    expected = {"principal_distance": -0.08, "principal_point x": -0.03, "principal_point y": 0.02}
    for name, value in nonempty(expected.items()):
        assert abs(found[name].value - value) < 3.5 * found[name].sigma, name
        assert found[name].sigma < 0.01
        assert found[name].significant
    assert rms(simulation, result) < 0.08 * 3**0.5
    _, without = calibrated(wrong, search_cameras=False)
    assert rms(simulation, without) > rms(simulation, result)


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
    with pytest.raises(GeometryError, match=r"camera film: principal (distance|point)"):
        adjusted(simulation, calibrating(inputs_of(simulation), wanted))


LOCAL = Ground(crs="local")
STRAIGHT = Spec(ground=LOCAL, flight=Flight(photos=6, position_sigma=(0, 0, 0)))
NETWORKS = {
    "straight strip": STRAIGHT,
    "strip": replace(STRAIGHT, flight=Flight(photos=6)),
    "block": Spec(ground=LOCAL, flight=Flight(photos=5, strips=2), control=Control(bands=2)),
}
COORDINATES = ("xyz", "xy", "z", "")
OF_POSITIONS = 0.1  # of camera positions, metres


def with_some(simulation: Simulation, control: str, cameras: str) -> Inputs:
    """Inputs in which some coordinates of control and cameras count, and no others are given."""
    inputs = inputs_of(simulation)
    points, given = inputs.control, np.array([axis in control for axis in "xyz"])
    use = points.use & (points.check[:, None] | given)
    points = replace(points, enu=np.where(use, points.enu, np.nan), use=use).take(use.any(axis=1))
    if not cameras:
        return replace(inputs, control=points)
    noise = np.random.default_rng(1).normal(0.0, OF_POSITIONS, (len(photos_of(simulation)), 3))
    found = positions(simulation, OF_POSITIONS, noise=noise)
    use = np.tile([axis in cameras for axis in "xyz"], (len(found.photos), 1))
    found = replace(found, enu=np.where(use, found.enu, np.nan), use=use)
    return replace(inputs, control=points, positions=found)


def least_determined(simulation: Simulation, inputs: Inputs) -> tuple[float, float]:
    """What the given coordinates say of the least determined movement of the network where it truly is.

    Its standard deviation, in units of what is not determined, and the rms movement of all points by it, in standard
    deviations of a given coordinate.
    """
    place = dict(zip(simulation.truth.points.ids, simulation.truth.points.xyz, strict=True))
    control, cameras = inputs.control.take(~inputs.control.check), inputs.positions
    everything = np.concatenate([simulation.truth.points.xyz, simulation.truth.centers])
    middle = everything.mean(axis=0)
    size = np.linalg.norm(everything - middle, axis=1).max()
    units = np.array([size, size, size, 1, 1, 1, 1])
    rows, sigmas = [np.zeros((1, 7))], [np.zeros(0)]
    if len(control):
        moves = similarity_derivatives(np.array([place[name] for name in control.ids]), middle) * units
        rows.append((moves / control.sigma[:, :, None])[control.use])
        sigmas.append(control.sigma[control.use])
    if cameras is not None:
        moves = similarity_derivatives(simulation.truth.centers, middle) * units / OF_POSITIONS
        rows.append(moves[:, cameras.use[0]].reshape(-1, 7))
        sigmas.append(np.full(cameras.use.sum(), OF_POSITIONS))
    design = np.concatenate(rows)
    normal = design.T @ design + 1e-3 * np.eye(7)  # what rounding leaves
    moved = similarity_derivatives(everything, middle).reshape(-1, 7) * units
    worst = np.linalg.eigvals(np.linalg.solve(normal, moved.T @ moved / len(everything))).real.max()
    loose = np.linalg.eigvalsh(normal * LOOSE[:, None] * LOOSE)[0] ** -0.5
    return float(loose), float(worst**0.5 / np.median(np.concatenate(sigmas)))


@pytest.mark.slow
@pytest.mark.parametrize(("control", "cameras"), [pair for pair in product(COORDINATES, repeat=2) if any(pair)])
@pytest.mark.parametrize("network", NETWORKS)
def test_what_is_determined_is_adjusted_and_nothing_else(network: str, control: str, cameras: str) -> None:
    simulation = simulate(NETWORKS[network])
    inputs = with_some(simulation, control, cameras)
    loose, grown = least_determined(simulation, inputs)
    if loose > 1.0:
        with pytest.raises(GeometryError, match=r"does not determine|connect it to the ground") as caught:
            adjusted(simulation, inputs)
        assert caught.value.code in {"bundle-rank", "strip-not-tied"}
        return
    result = adjusted(simulation, inputs)
    assert result.precision is not None
    assert result.bundle is not None
    assert result.bundle.screened.rejections == ()
    error = errors(simulation, result)
    square = np.einsum("ni,nij,nj->n", error, np.linalg.inv(result.precision.points), error)
    assert square.mean() / 3 < 2.0  # in units of what the result says of itself
    weak = [note.message for note in result.notes if note.code == "weak-datum"]
    assert bool(weak) == (grown > GROWN)
    assert all("hardly determines roll about the flight line" in text for text in weak)


@pytest.mark.slow
def test_heights_without_which_roll_is_open_stay_and_are_named() -> None:
    """Two heights near the flight line say how the strip is rolled, one of them is 103 m off: which, nothing tells."""
    simulation = simulate(STRAIGHT)
    control = with_control(simulation, ["G02", "G08"]).control
    sigma = np.where(control.check[:, None], control.sigma, 6.4)
    use = control.use & (control.check[:, None] | np.array([False, False, True]))
    enu = np.where(use, control.enu + np.where(np.array(control.ids)[:, None] == "G02", 103.0, 0.0), np.nan)
    noise = np.random.default_rng(1).normal(0.0, 0.05, (6, 3))
    given = replace(control, enu=enu, use=use, sigma=sigma)
    inputs = replace(inputs_of(simulation), control=given, positions=positions(simulation, noise=noise))
    told = [note for note in adjusted(simulation, inputs).notes if note.code == "control-doubtful"]
    assert sorted(point for note in told for point in note.points) == ["G02", "G08"]
    assert all("it was used: without it the adjustment fails" in note.message for note in nonempty(told))
