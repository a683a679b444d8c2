"""What control and camera positions determine together: the program says what seven parameters with true places say."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.network.defects import GROWN, LOOSE
from photostrip.simulation import Control, Flight, Ground, Spec
from tests.loops import nonempty
from tests.pipeline.blocks import adjusted, errors, photos_of, positions, simulate, with_control
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Inputs
    from photostrip.simulation import Simulation

pytestmark = [pytest.mark.usefixtures("_no_findings"), pytest.mark.slow]

LOCAL = Ground(crs="local")
STRAIGHT = Spec(ground=LOCAL, flight=Flight(photos=6, position_sigma=(0, 0, 0)))
NETWORKS = {
    "straight strip": STRAIGHT,
    "strip": replace(STRAIGHT, flight=Flight(photos=6)),
    "block": Spec(ground=LOCAL, flight=Flight(photos=5, strips=2), control=Control(bands=2)),
}
COORDINATES = ("xyz", "xy", "z", "")
SIGMA = 0.1  # of camera positions, metres


def with_some(simulation: Simulation, control: str, cameras: str, correction: str = "none", group: str = "") -> Inputs:
    """Inputs in which some coordinates of control and cameras count, and no others are given."""
    inputs = inputs_of(simulation)
    points, given = inputs.control, np.array([axis in control for axis in "xyz"])
    use = points.use & (points.check[:, None] | given)
    points = replace(points, enu=np.where(use, points.enu, np.nan), use=use).take(use.any(axis=1))
    if not cameras:
        return replace(inputs, control=points)
    flown = np.repeat(np.arange(float(len(inputs.strips))), [len(strip.photos) for strip in inputs.strips])[:, None]
    wrong = 0.0 if correction == "none" else np.array([2.0, -1.0, 3.0]) + (0 if group else flown)
    noise = np.random.default_rng(1).normal(0.0, SIGMA, (len(photos_of(simulation)), 3))
    found = positions(simulation, SIGMA, shift=wrong, noise=noise, correction=correction)
    use = np.tile([axis in cameras for axis in "xyz"], (len(found.photos), 1))
    found = replace(found, enu=np.where(use, found.enu, np.nan), use=use, group=group or "strip")
    return replace(inputs, control=points, positions=found)


class Truth(NamedTuple):
    """What the given coordinates say of the least determined movement of the network where it truly is."""

    loose: float  # its standard deviation, in units of what is not determined
    grown: float  # rms movement of all points by it, in standard deviations of a given coordinate


def truth_of(simulation: Simulation, inputs: Inputs) -> Truth:
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
        moves = similarity_derivatives(simulation.truth.centers, middle) * units / SIGMA
        strips = np.repeat(np.arange(len(inputs.strips)), [len(strip.photos) for strip in inputs.strips])
        groups = strips if cameras.group == "strip" else np.zeros_like(strips)
        for group in np.unique(groups):
            of_group = moves[groups == group]
            time = np.arange(len(of_group))
            shared = {"none": 0, "offset": 1, "drift": 2}[cameras.correction]
            common = np.vander(time, shared, increasing=True)
            of_group = of_group - np.einsum("ij,jkl->ikl", common @ np.linalg.pinv(common), of_group)
            rows.append(of_group[:, cameras.use[0]].reshape(-1, 7))
        sigmas.append(np.full(cameras.use.sum(), SIGMA))
    design = np.concatenate(rows)
    normal = design.T @ design + 1e-3 * np.eye(7)  # what rounding leaves
    moved = similarity_derivatives(everything, middle).reshape(-1, 7) * units
    worst = np.linalg.eigvals(np.linalg.solve(normal, moved.T @ moved / len(everything))).real.max()
    loose = np.linalg.eigvalsh(normal * LOOSE[:, None] * LOOSE)[0] ** -0.5
    return Truth(loose, worst**0.5 / np.median(np.concatenate(sigmas)))


@pytest.mark.parametrize(("control", "cameras"), [pair for pair in product(COORDINATES, repeat=2) if any(pair)])
@pytest.mark.parametrize("network", NETWORKS)
def test_what_is_determined_is_adjusted_and_nothing_else(network: str, control: str, cameras: str) -> None:
    simulation = simulate(NETWORKS[network])
    judge(simulation, with_some(simulation, control, cameras))


def judge(simulation: Simulation, inputs: Inputs) -> None:
    truth = truth_of(simulation, inputs)
    if truth.loose > 1.0:
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
    assert bool(weak) == (truth.grown > GROWN)
    assert all("hardly determines roll about the flight line" in text for text in weak)


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
