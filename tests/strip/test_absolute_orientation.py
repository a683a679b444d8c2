"""Absolute orientation: an optimiser that is not ours, every mixture of control, what each layout leaves free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.errors import EXIT_GEOMETRY, EXIT_INPUT, GeometryError, InputError
from photostrip.geometry.similarity import Similarity
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.points import ControlPoints
from photostrip.strip.absolute_orientation import AbsoluteOrientation, PointPrecision, Targets, orient, weights
from tests.strips import attitude, control_points, fly, project, targets

PRECISION = PointPrecision(0.05, 0.10)  # of a strip point in plan and height, metres
# Control along 8 km, two rows across, relief: A to H, and three points on the axis: I, J, K.
GROUND = {
    "A": (0.0, 700.0, 30.0),
    "B": (50.0, -690.0, 12.0),
    "C": (2700.0, 640.0, -35.0),
    "D": (2650.0, -720.0, 55.0),
    "E": (5300.0, 710.0, 20.0),
    "F": (5400.0, -650.0, -15.0),
    "G": (8000.0, 730.0, 40.0),
    "H": (8050.0, -700.0, 5.0),
    "I": (100.0, 0.0, 10.0),
    "J": (4000.0, 0.0, 10.0),
    "K": (8000.0, 0.0, 10.0),
}
FULL = dict.fromkeys("ABCDEFGH", "xyz")


@dataclass(frozen=True, eq=False)
class Case:
    """Control in the ground frame and the same points in a strip that is turned, tilted and small."""

    strip: Floats
    targets: Targets
    truth: Similarity  # strip to ground

    @property
    def control(self) -> ControlPoints:
        return self.targets.control

    def orient(self, weight: Floats | None = None) -> AbsoluteOrientation:
        return orient(self.strip, self.targets, weights(self.control, PRECISION) if weight is None else weight)

    def errors(self, found: AbsoluteOrientation) -> Floats:
        """Errors of all points of GROUND, metres."""
        ground = np.array(list(GROUND.values()))
        moved = found.similarity(self.truth.inverse(ground))
        result: Floats = self.targets.intermediate.cartesian_from_intermediate(moved) - ground
        return result


def case(
    use: Mapping[str, str],
    *,
    sigma: ArrayLike = 0.05,
    ground: Mapping[str, Sequence[float]] = GROUND,
    noise: Floats | None = None,
) -> Case:
    given_ = {name: np.array(ground[name]) for name in use}
    xyz = np.array(list(given_.values())).reshape(-1, 3)
    truth = Similarity(0.01, attitude((1.0, -2.0, 33.0))[0], np.array([5.0, 6, 7])).inverse
    measured = truth.inverse(xyz)
    if noise is not None:
        xyz = xyz + noise
    control = control_points(dict(zip(given_, xyz, strict=True)), use, sigma)
    middle = xyz.mean(axis=0) if len(xyz) else np.zeros(3)
    return Case(measured, targets(control, origin=middle), truth)


def refusal(use: Mapping[str, str], ground: Mapping[str, Sequence[float]] = GROUND) -> GeometryError:
    one = case(use, ground=ground)
    with pytest.raises(GeometryError) as caught:
        one.orient()
    assert caught.value.exit_code == EXIT_GEOMETRY
    assert set(caught.value.points) == set(use)
    return caught.value


def optimised(one: Case, weight: Floats) -> Similarity:
    """Seven parameters by scipy over all given coordinates, from the truth, about the middle of the control."""
    use, given_, middle = one.control.use, np.nan_to_num(one.control.enu), one.strip.mean(axis=0)

    def transform(p: Floats) -> Similarity:
        scale = one.truth.scale * float(np.exp(p[3]))
        turn = Rotation.from_rotvec(p[:3]).as_matrix() @ one.truth.rotation
        return Similarity(scale, turn, one.truth(middle[None])[0] + 1e3 * p[4:] - scale * turn @ middle)

    def residuals(p: Floats) -> Floats:
        return (np.sqrt(weight) * (transform(p)(one.strip) - given_))[use]

    start = np.full(7, 1e-4)
    best = least_squares(residuals, start, jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac").x
    return transform(best)


MIXTURES = {
    "full": FULL,
    "plan and height apart": {"A": "xy", "B": "z", "D": "xy", "E": "z", "G": "xy", "H": "z", "C": "z"},
    "two full, heights": {"A": "xyz", "H": "xyz", "C": "z", "F": "z"},
    "one full, the rest in parts": {"A": "xyz", "B": "xy", "C": "z", "F": "xy", "G": "z", "H": "z"},
    "many heights": {"A": "xy", "H": "xy", "D": "xy", **dict.fromkeys("BCEFG", "z")},
}
mixtures = pytest.mark.parametrize("use", MIXTURES.values(), ids=list(MIXTURES))


@mixtures
def test_an_optimiser_finds_the_same_for_any_mixture_and_any_weights(use: dict[str, str]) -> None:
    rng = np.random.default_rng(len(use))
    sigma = rng.uniform(0.02, 0.5, (len(use), 3))
    one = case(use, sigma=sigma, noise=rng.normal(0, 1, (len(use), 3)) * sigma)
    weight = weights(one.control, PRECISION)
    found, theirs = one.orient(), optimised(one, weight)
    ours = one.targets.intermediate.cartesian_from_intermediate(found.similarity(one.strip))
    assert np.allclose(ours, theirs(one.strip), rtol=0, atol=1e-5)
    assert found.similarity.scale == pytest.approx(theirs.scale, rel=1e-8)
    misclosure = (theirs(one.strip) - np.nan_to_num(one.control.enu)) * one.control.use
    assert np.allclose(found.misclosures, misclosure, rtol=0, atol=1e-5)
    redundancy = int(one.control.use.sum()) - 7
    assert found.redundancy == redundancy
    if redundancy:
        assert found.sigma0 == pytest.approx(np.sqrt((weight * misclosure**2).sum() / redundancy), rel=1e-6)


def test_weights_add_the_strip_to_the_control() -> None:
    control = control_points(GROUND, {"A": "xy", "B": "z"}, sigma=np.array([0.03, 0.04, 0.12]))
    weight = weights(control, PointPrecision(0.04, 0.05))
    assert np.allclose(weight[2], [1 / 0.0025, 1 / 0.0032, 1 / 0.0169])
    assert np.array_equal(weight[0] > 0, [True, True, False])
    assert np.array_equal(weight[1] > 0, [False, False, True])


@pytest.mark.slow
def test_with_noise_sigma0_is_one() -> None:
    rng, squares = np.random.default_rng(1), []
    for _ in range(150):
        sigma = np.full((8, 3), [0.2, 0.2, 0.4])
        one = case(FULL, sigma=sigma, noise=rng.normal(0, 1, (8, 3)) * sigma)
        squares.append(one.orient(weights(one.control, PointPrecision(0.0, 0.0))).sigma0 ** 2)
    assert np.mean(squares) == pytest.approx(1, abs=0.11)  # 150 times 17 degrees of freedom: 4 standard deviations


@pytest.mark.parametrize(
    ("use", "counts"),
    [
        ({}, "0 in plan and 0 in height"),
        ({"A": "xyz", "B": "z", "C": "z"}, "1 in plan and 3 in height"),
        (dict.fromkeys("ABCDEF", "xy"), "6 in plan and 0 in height"),
        (dict.fromkeys("ABCDEF", "z"), "0 in plan and 6 in height"),
        ({"A": "xy", "B": "xy", "C": "xy", "D": "z", "E": "z"}, "3 in plan and 2 in height"),
    ],
    ids=["none", "1 plan", "plan only", "height only", "2 height"],
)
def test_too_little_control_is_counted(use: dict[str, str], counts: str) -> None:
    error = refusal(use)
    assert error.code == "too-little-control"
    assert counts in str(error)
    assert "at least 2 control points in plan and 3 in height" in str(error)


@pytest.mark.parametrize(
    ("use", "line"),
    [
        ({"A": "xy", "D": "xy", "H": "xy", "I": "z", "J": "z", "K": "z"}, "I, J, K"),
        ({"C": "xy", "H": "xy", "D": "xy", "A": "z", "B": "z", "I": "z"}, "A, B, I"),
    ],
    ids=["along the strip", "across the strip"],
)
def test_heights_on_a_line_over_level_ground_name_their_line(use: dict[str, str], line: str) -> None:
    level = {name: (x, y, 10.0) for name, (x, y, _) in GROUND.items()}
    level |= {"B": (0.0, -690.0, 10.0), "I": (0.0, 0.0, 10.0)}
    error = refusal(use, level)
    assert error.code == "control-deficient"
    assert f"the rotation about the line of control points {line}" in str(error)


def swapped(use: Mapping[str, str], flatness: float = 1.0) -> Case:
    """The same control with east and north exchanged, as of a grid whose x points north."""
    one = case(use)
    ground = np.array([GROUND[name] for name in use]) * [1, 1, flatness]
    control = control_points(dict(zip(use, ground[:, [1, 0, 2]], strict=True)), use)
    strip = one.truth.inverse(ground)
    return Case(strip, targets(control, origin=ground.mean(axis=0)[[1, 0, 2]]), one.truth)


@pytest.mark.parametrize("flatness", [1.0, 0.001, 5.0])
@pytest.mark.parametrize(
    "use", [FULL, {"A": "xyz", "H": "xyz", "B": "xy", "C": "xy", "E": "z", "D": "z"}], ids=["full", "mixed"]
)
def test_left_handed_control_is_refused_with_the_way_out(use: dict[str, str], flatness: float) -> None:
    one = swapped(use, flatness)
    with pytest.raises(InputError) as caught:
        one.orient()
    (fault,) = caught.value.faults
    assert (caught.value.exit_code, fault.code, fault.key) == (EXIT_INPUT, "left-handed-control", "control.axes")
    assert "upside down: control or image coordinates are left-handed" in fault.message
    assert "[north, east, up]" in fault.expected


def lined(seed: int, noise: float, use: Sequence[str] = "ABE") -> Case:
    """Coordinates that lie on one line, given for points that do not."""
    one = case(dict.fromkeys(use, "xyz"))
    along = np.linspace(-3000.0, 4000.0, len(use))[:, None] * np.array([0.8, 0.6, 0.001]) + np.array([0.0, 0.0, 50.0])
    enu = along + noise * np.random.default_rng(seed).normal(size=along.shape)
    control = control_points(dict(zip(use, enu, strict=True)), dict.fromkeys(use, "xyz"))
    return Case(one.strip, targets(control, origin=enu.mean(axis=0)), one.truth)


@pytest.mark.parametrize("noise", [0.0, 0.05, 1.0])
@pytest.mark.parametrize("seed", range(6))
def test_control_given_on_one_line_is_weak_geometry_and_not_left_handed(seed: int, noise: float) -> None:
    """Strips fitted it upside down as often as upright; nothing said that the third rotation was anybody's guess."""
    with pytest.raises(GeometryError, match="rotation about the line of control points A, B, E: their given") as caught:
        lined(seed, noise).orient()
    assert (caught.value.code, caught.value.points) == ("control-deficient", ("A", "B", "E"))
    assert caught.value.exit_code == EXIT_GEOMETRY


def test_a_strip_without_control_is_named() -> None:
    for names in ((), ("not measured",)):
        flown = fly(1, 4, extra=10)
        control = control_points(dict.fromkeys(names, (0.0, 0.0, 0.0)))
        inputs = project(flown, control)
        with pytest.raises(GeometryError, match="strip A: none of its points is a control point") as caught:
            triangulate(inputs, Settings(adjustment="polynomial"))
        assert caught.value.code == "no-control"
        with pytest.raises(GeometryError, match="nothing ties the photos to the ground") as caught:
            triangulate(inputs, Settings())
        assert caught.value.code == "no-control"


@pytest.mark.parametrize(("names", "few"), [("p0_1 p2_-1 p4_1", True), ("p0_1 p0_-1 p4_1 p4_-1", False)])
def test_three_points_are_warned_of(names: str, few: bool) -> None:
    flown = fly(1, 5, extra=10)
    control = control_points({name: flown.xyz[flown.at[name]] for name in names.split()})
    result = triangulate(project(flown, control), Settings(adjustment="similarity"))
    assert few == ("little-control" in [note.code for note in result.notes])
