"""Relative orientation: printed examples, other routes to the elements, refusals; zones, six points, weak pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.errors import EXIT_GEOMETRY, GeometryError
from photostrip.notes import counted
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.points import PhotoPoints
from photostrip.strip import relative_orientation
from photostrip.strip.fitted_strip import image_variance
from photostrip.strip.formed_strip import intersect
from photostrip.strip.relative_orientation import (
    ITERATIONS,
    MINIMUM_POINTS,
    Orientation,
    Pairs,
    assess_pairs,
    base_rays,
    collect_pairs,
    in_front_of_cameras,
    linearised_parallaxes,
    normal_matrices,
    orient_pairs,
    orient_unchecked,
    solve_elements,
    start_values,
    turns,
    y_parallaxes,
    zones,
)
from photostrip.strip.strip_errors import times_a_good_pair
from tests.loops import nonempty
from tests.strips import (
    MICROMETRE,
    Flown,
    attitude,
    batch,
    control_points,
    fly,
    measured,
    photograph,
    project,
    relative_geometry,
    true_pairs,
)
from tests.vectors import Vector, cases

SEEDS = st.integers(0, 2**32 - 1)
ARCSECOND = np.radians(1 / 3600)
ELEMENTS = st.tuples(*[st.floats(-0.5, 0.5)] * 5)
BOTH = ("1", "2")


def of_points(points: list[Mapping[str, float]]) -> PhotoPoints:
    """Image points of an example's pair."""
    left = {str(p["id"]): [p["x1"], p["y1"]] for p in points}
    return measured({"1": left, "2": {str(p["id"]): [p["x2"], p["y2"]] for p in points}})


def of_arrays(left: ArrayLike, right: ArrayLike) -> PhotoPoints:
    images = [{f"p{number}": xy for number, xy in enumerate(np.asarray(side, float))} for side in (left, right)]
    return measured(dict(zip(BOTH, images, strict=True)))


def orient(observations: PhotoPoints, focal: float) -> Orientation:
    return orient_pairs(collect_pairs(observations, observations.photo_ids, focal), observations.photo_ids)


def refusal(observations: PhotoPoints, focal: float = 100.0) -> GeometryError:
    with pytest.raises(GeometryError) as caught:
        orient(observations, focal)
    assert caught.value.exit_code == EXIT_GEOMETRY
    assert "photos 1 and 2" in str(caught.value)
    assert caught.value.photos == BOTH
    return caught.value


@pytest.mark.parametrize("example", cases("relative_orientation_exact"))
def test_the_exact_examples_of_the_formula_book(example: Vector) -> None:
    f, expected, tol = example.input["f"], example.expected, example.tol
    found = orient(of_points(example.input["points"]), f)
    assert np.allclose(np.degrees(found.elements[0]), expected["elements_deg"], rtol=0, atol=tol["elements_deg"])
    assert np.abs(found.parallax).max() <= expected["max_abs_q_mm"] + tol["q_mm"]
    start = np.degrees(start_values(found.pairs)[0])
    assert np.allclose(start[[1, 4]], expected["kappa_start_deg"], rtol=0, atol=tol["elements_deg"])
    assert np.all(start[[0, 2, 3]] == 0)
    trial = np.radians([example.input["trial_elements_deg"]])
    q, jacobian = linearised_parallaxes(trial, found.pairs)
    assert np.allclose(q, expected["q_at_trial"], rtol=0, atol=tol["q_mm"])
    assert np.allclose(y_parallaxes(trial, found.pairs), expected["q_at_trial"], rtol=0, atol=tol["q_mm"])
    theirs = np.array(expected["jacobian_at_trial"])
    assert np.allclose(jacobian.T, theirs, rtol=tol["jacobian_rel"], atol=tol["jacobian_rel"] * np.abs(theirs).max())
    left, right = base_rays(found.elements, found.pairs)
    model = intersect(np.array([1.0, 0, 0]), left, right, f)
    assert np.allclose(model.xyz, expected["model_points_unit_base"], rtol=0, atol=tol["model"])


@pytest.mark.parametrize("example", cases("relative_orientation_adjusted", "ro-adjusted"))
def test_the_adjusted_examples_of_the_formula_book(example: Vector) -> None:
    expected, rel = example.expected, example.tol["rel"]
    found = orient(of_points(example.input["points"]), example.input["f"])
    degrees = np.degrees(found.elements[0])
    assert np.allclose(degrees, expected["elements_deg"], rtol=0, atol=example.tol["elements_deg"])
    assert np.allclose(found.parallax, expected["q_mm"], rtol=0, atol=example.tol["q_mm"])
    assert found.points_used[0] - 5 == expected["dof"]
    if expected["dof"]:
        # the example's sigma0 is that of a y parallax, ours that of an image coordinate
        assert found.sigma0[0] * np.sqrt(2) == pytest.approx(expected["sigma0_mm"], rel=rel)
        assert np.allclose(found.sigmas[0] / ARCSECOND, expected["sd_elements_arcsec"], rtol=rel, atol=0)
    else:
        assert expected["sigma0_mm"] is expected["sd_elements_arcsec"] is None
        assert np.isnan(found.sigma0).all()
        assert np.isnan(found.sigmas).all()
    _, jacobian = linearised_parallaxes(found.elements, found.pairs)
    cofactors = np.linalg.inv(normal_matrices(jacobian, found.pairs)[0])
    largest = np.abs(expected["cofactor_rad2_per_mm2"]).max()
    assert np.allclose(cofactors, expected["cofactor_rad2_per_mm2"], rtol=0, atol=rel * largest)
    assert np.allclose(found.redundancy, expected["redundancy_numbers"], rtol=0, atol=rel)
    assert found.condition[0] == pytest.approx(expected["condition_number"], rel=rel)


@pytest.mark.parametrize("example", cases("relative_orientation_adjusted", "ro-degenerate"))
def test_the_degenerate_examples_are_refused(example: Vector) -> None:
    observations, f = of_points(example.input["points"]), example.input["f"]
    assert example.expected["error"]
    error = refusal(observations, f)
    n = len(example.input["points"])
    if n < MINIMUM_POINTS:
        assert error.code == "too-few-common-points"
        assert f"{counted(n, 'common point')}, at least 5 are necessary" in str(error)
    else:
        assert error.code == "points-on-a-line"
        assert "all common points lie on one line of the photo" in str(error)
    left, right = observations.xy[:n], observations.xy[n:]
    _, jacobian = linearised_parallaxes(np.zeros((1, 5)), batch(left[None], right[None], f))
    assert np.linalg.matrix_rank(jacobian) == example.expected["rank_at_zero_elements"]


def coplanar_parallax(unknowns: Floats, left: Floats, right: Floats, focal: float) -> Floats:
    """y parallaxes in the base frame, built from a base direction and a rotation without the five elements."""
    base = np.array([1.0, unknowns[0], unknowns[1]])
    x = base / np.linalg.norm(base)
    y = np.cross([0.0, 0.0, 1.0], x)  # across the base and the left principal ray
    y /= np.linalg.norm(y)
    frame = np.stack([x, y, np.cross(x, y)])
    first = np.column_stack([left, np.full(len(left), -focal)]) @ frame.T
    turn = Rotation.from_rotvec(unknowns[2:]).as_matrix()
    second = np.column_stack([right, np.full(len(right), -focal)]) @ (frame @ turn).T
    return np.asarray(-focal * (first[:, 1] / first[:, 2] - second[:, 1] / second[:, 2]))


@pytest.mark.parametrize("seed", range(5))
def test_an_optimiser_over_base_and_rotation_finds_the_same(seed: int) -> None:
    truth = true_pairs(np.random.default_rng(seed), sigma=5 * MICROMETRE, kappa_deg=20.0, focal=153.0)
    found = truth.orient()
    left, right = truth.pairs.left, truth.pairs.right
    theirs = least_squares(coplanar_parallax, np.zeros(5), args=(left, right, 153.0), x_scale="jac", xtol=1e-14)
    base, rotation = relative_geometry(found.elements)
    assert np.allclose(base[0, 1:] / base[0, 0], theirs.x[:2], rtol=0, atol=1e-8)
    assert np.allclose(rotation[0], Rotation.from_rotvec(theirs.x[2:]).as_matrix(), rtol=0, atol=1e-8)
    assert np.allclose(np.abs(found.parallax), np.abs(theirs.fun), rtol=0, atol=1e-8)
    own_base, own_rotation = found.relative
    assert np.allclose(own_base, base, rtol=0, atol=1e-14)
    assert np.allclose(own_rotation, rotation, rtol=0, atol=1e-14)


@given(SEEDS, ELEMENTS)
def test_derivatives_are_differences(seed: int, elements: tuple[float, ...]) -> None:
    pairs = true_pairs(np.random.default_rng(seed), tilt_deg=3.0, kappa_deg=5.0).pairs
    at, step = np.array([elements]), 1e-5
    q, jacobian = linearised_parallaxes(at, pairs)
    assert np.array_equal(q, y_parallaxes(at, pairs))
    for number in range(5):
        change = np.zeros(5)
        change[number] = step
        difference = (y_parallaxes(at + change, pairs) - y_parallaxes(at - change, pairs)) / (2 * step)
        assert np.allclose(jacobian[number], difference, rtol=1e-5, atol=1e-5 * np.abs(jacobian[number]).max() + 1e-4)


@pytest.mark.parametrize(
    ("tilt", "reach", "relief"), [(2.0, 0.6, 0.1), (5.0, 0.6, 0.1), (10.0, 0.6, 0.1), (4.0, 0.1, 0.02)]
)
def test_pairs_of_any_kappa_come_back_to_the_truth(tilt: float, reach: float, relief: float) -> None:
    """In a narrow field, too, where false minima leave small parallaxes."""
    truth = true_pairs(np.random.default_rng(1), 1000, tilt_deg=tilt, reach=reach, relief=relief)
    elements, converged, iterations = solve_elements(truth.pairs)
    assert converged.all()
    assert np.count_nonzero(truth.errors(elements) > 1e-10) == 0
    assert iterations.max() <= ITERATIONS
    assert in_front_of_cameras(elements, truth.pairs).all()
    assert np.all(np.abs(elements) <= np.pi)
    assert np.all(np.abs(elements[:, 3]) < np.pi / 2)


def test_sigma0_and_sigmas_are_those_of_the_errors() -> None:
    sigma, n = 5 * MICROMETRE, 400
    rng = np.random.default_rng(7)
    truth = true_pairs(rng, tilt_deg=3.0, counts=(3,) * 6)
    noise = rng.normal(0, sigma, (2, n, 18, 2))
    noisy = batch(truth.pairs.left[None] + noise[0], truth.pairs.right[None] + noise[1], truth.pairs.focal)
    exact = truth.orient().elements[0]
    elements, converged, steps = solve_elements(noisy)
    assert converged.all()
    found = assess_pairs(elements, noisy, steps)
    # a mean of 400 variances of 13 degrees of freedom is known to 2 percent; the points of a tilted pair are not all at
    # the scale of the photo, hence a little more
    assert np.mean(found.sigma0**2) / sigma**2 == pytest.approx(1, abs=0.08)
    standardised = ((elements - exact) ** 2).mean(axis=0) / (found.sigmas**2).mean(axis=0)
    assert np.all((standardised > 0.75) & (standardised < 1.33))  # a variance from 400 is known to 7 percent


@pytest.mark.parametrize("kappa", [0.0, 90.0, 180.0, 30.0])
@pytest.mark.parametrize("sigma", [(0.010, 0.003), (0.003, 0.010)])
def test_a_y_parallax_has_the_variance_across_the_base(sigma: tuple[float, float], kappa: float) -> None:
    """On photos turned by kappa, whose x and y are not measured equally well."""
    flown = fly(2, 4, extra=40)
    turn = Rotation.from_euler("z", kappa, degrees=True).as_matrix()[:2, :2]
    rng = np.random.default_rng(5)
    xy = flown.observations.xy @ turn.T
    noise = rng.normal(0.0, sigma, xy.shape)
    measured = replace(flown.observations, xy=xy + noise, sigma=np.tile(sigma, (len(xy), 1)))
    pairs = collect_pairs(measured, flown.photos, flown.focal)
    oriented, _ = orient_unchecked(pairs)
    factor, _ = image_variance(oriented, float(np.median(sigma)))
    assert factor == pytest.approx(1.0, abs=0.3)  # half of the mean variance of x and y: 0.2, or 2.3, at 0 degrees
    across = np.hypot(*(turn[:, 1] * sigma))  # but for the few degrees by which the photos are turned themselves
    assert pairs.weight == pytest.approx((np.median(sigma) / across) ** 2, rel=0.25)


def test_a_critical_cylinder_is_refused() -> None:
    """Terrain on a cylinder through both centres, its axis along the base, leaves the elements undetermined."""
    around = np.radians(np.linspace(-27, 27, 7))
    valley = [[x, 100 * np.sin(2 * t), -100 - 100 * np.cos(2 * t)] for x in (0.0, 35.0, 70.0) for t in around]
    ground, right = np.array(valley), np.array([70.0, 0, 0])
    level = np.eye(3)
    error = refusal(of_arrays(photograph(ground, np.zeros(3), level, 100.0), photograph(ground, right, level, 100.0)))
    assert error.code == "degenerate-pair"
    assert "critical surface" in str(error)


def notes_of_a_pair(plan: list[list[float]], adjustment: str = "similarity") -> dict[str, str]:
    """Notes of a run over two photos 700 m apart, 1000 m above points of which four are control."""
    rng = np.random.default_rng(1)
    xyz = np.column_stack([np.array(plan), rng.uniform(-60, 60, len(plan))])
    centers, rotations = np.array([[0.0, 0, 1000], [700, 0, 1000]]), attitude(rng.normal(0, 1, (2, 3)))
    images = [
        {f"p{n}": xy for n, xy in enumerate(photograph(xyz, center, rotation, 100.0))}
        for center, rotation in zip(centers, rotations, strict=True)
    ]
    observations = measured(dict(zip(BOTH, images, strict=True)))
    at = {name: n for n, name in enumerate(observations.point_ids)}
    flown = Flown(observations, xyz, centers, rotations, 100.0, 700.0, 1000.0, at)
    control = control_points({f"p{n}": xyz[n] for n in range(4)})
    return {note.code: note.message for note in triangulate(project(flown, control), Settings(adjustment)).notes}


STANDARD = [[0.0, 0.0], [700.0, 0.0], [0.0, 650.0], [700.0, 650.0], [0.0, -650.0], [700.0, -650.0]]


def test_a_pair_on_five_points_is_warned_of() -> None:
    said = notes_of_a_pair(STANDARD[:5])
    assert "photos 1 and 2 are oriented on 5 points only: there is no check" in said["no-check"]
    assert "no-check" not in notes_of_a_pair(STANDARD)


def test_a_pair_on_a_narrow_band_is_warned_of() -> None:
    band = [[x, y / 8] for x, y in STANDARD]
    said = notes_of_a_pair(band)
    assert "photos 1 and 2: weak relative orientation" in said["weak-pair"]
    assert "are 10.1 times those of a good pair of the same base and height" in said["weak-pair"]
    assert "weak-pair" not in notes_of_a_pair(STANDARD)
    assert "weak-pair" not in notes_of_a_pair(band, "bundle")  # which holds it by everything else


@pytest.mark.parametrize("mirror", [[-1, 1], [1, -1]], ids=["x", "y"])
def test_a_mirrored_photo(mirror: list[int]) -> None:
    pairs = true_pairs(np.random.default_rng(1)).pairs
    error = refusal(of_arrays(pairs.left, pairs.right * mirror), 153.0)
    assert error.code == "behind-cameras"
    assert "behind the cameras" in str(error)
    assert "mirrored" in str(error)


def test_the_same_photo_measured_twice() -> None:
    """Noise makes a pair of it that converges; it has no base all the same."""
    rng = np.random.default_rng(1)
    left = true_pairs(rng).pairs.left
    error = refusal(of_arrays(left, left + rng.normal(0, 5 * MICROMETRE, left.shape)), 153.0)
    assert error.code == "no-base"
    assert "the same photo twice" in str(error)


@pytest.mark.parametrize("counts", [(1,) * 6, (2, 2, 3, 3, 3, 3), (5,) * 6])
def test_points_around_the_standard_positions_have_their_zones(counts: Sequence[int]) -> None:
    # 50 pairs with tilts up to 5 degrees, any azimuth: the zones are those of the base frame, not of the photo
    flown = true_pairs(np.random.default_rng(1), 50, counts=counts)
    oriented = flown.orient()
    found = zones(oriented.elements, oriented.pairs).reshape(50, -1)
    assert (found == np.repeat(np.arange(1, 7), counts)).mean() > 0.995


@pytest.mark.parametrize("example", cases("gruber_six_points"))
def test_the_six_points_of_the_formula_book(example: Vector) -> None:
    f, a, b = (example.input[name] for name in "fab")
    expected, rel = example.expected, example.tol["rel"]
    q = relative_orientation.cofactors(f, a, b)
    assert np.allclose(q, expected["cofactor"], rtol=rel, atol=1e-18)
    t = relative_orientation.dependent_from_base(b)
    dependent = t @ q @ t.T
    formulas = expected["cofactor_formulas"]
    values = {
        "alpha": q[0, 0],
        "omega": q[3, 3],
        "kappa": q[1, 1],
        "kappa2_minus_kappa1": dependent[2, 2],
        "bz": dependent[1, 1],
        "dependent_alpha": dependent[3, 3],
        "dependent_by": dependent[0, 0],
        "cov_bz_dependent_alpha": dependent[1, 3],
    }
    assert values.keys() == formulas.keys()
    for name, value in nonempty(values.items()):
        assert value == pytest.approx(formulas[name], rel=rel), name


FOCAL, BASE = 100.0, 70.0
DRAWS = 2000
NOISE = 0.001  # mm


def band(spread: float, kappa: float = 0.0) -> tuple[Floats, Floats]:
    """Six points of two level photos, in rows as far apart as `spread`, the camera turned by `kappa`."""
    left = np.array([[x, y] for x in (0.0, BASE) for y in (-spread, 0.0, spread)])
    turn = np.array([[np.cos(kappa), -np.sin(kappa)], [np.sin(kappa), np.cos(kappa)]])
    return left @ turn, (left - [BASE, 0.0]) @ turn


def repeated(left: Floats, right: Floats, times: int = 1, noise: float = 0.0) -> Pairs:
    """Pairs of the same points, each measured anew."""
    rng, shape = np.random.default_rng(3), (times, *left.shape)
    return batch(left + rng.normal(0.0, noise, shape), right + rng.normal(0.0, noise, shape), FOCAL)


def of(left: Floats, right: Floats) -> float:
    (found,) = times_a_good_pair(orient_pairs(repeated(left, right), ("1", "2")))
    return float(found)


def scatter(elements: Floats, pairs: Pairs) -> float:
    """Rms scatter of points intersected with given elements, as the left photo sees them."""
    (x1, y1, z1), (x2, y2, z2) = base_rays(elements, pairs)
    x1, y1, x2, y2 = -x1 / z1, -y1 / z1, -x2 / z2, -y2 / z2
    in_base = np.column_stack([x1, (y1 + y2) / 2, -np.ones(len(x1))]) / (x1 - x2)[:, None]
    rotations = turns(elements)[0][pairs.pair]
    points = np.einsum("mi,mij->mj", in_base, rotations).reshape(pairs.size, -1, 3)
    return float(np.sqrt(points.var(axis=0).sum(axis=1).mean()))


@pytest.mark.parametrize(("spread", "kappa"), [(BASE / 8, 0.0), (BASE / 3, 2.0), (1.3 * BASE, 1.0)])
def test_points_scatter_as_many_times_as_in_a_good_pair(spread: float, kappa: float) -> None:
    """Pairs measured anew, their points intersected with their own elements and with those of good pairs."""
    measured = repeated(*band(spread, kappa), DRAWS, NOISE)
    good = repeated(*band(BASE, kappa), DRAWS, NOISE)
    by_itself, by_good = (scatter(solve_elements(pairs).elements, measured) for pairs in (measured, good))
    assert of(*band(spread, kappa)) == pytest.approx(by_itself / by_good, rel=0.05)
