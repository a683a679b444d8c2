"""Forming a strip: printed examples, the way back to the truth, wrong and missing pass points, two rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import Flags, Floats
from photostrip.errors import EXIT_GEOMETRY, GeometryError
from photostrip.geometry.rotation import alpha_omega_kappa, from_alpha_omega_kappa
from photostrip.points import PhotoPoints
from photostrip.strip.formed_strip import (
    SCALE_TRANSFERS,
    FormedStrip,
    StripFormationSettings,
    _refuse_vertical_base,
    form_from_pairs,
    hand_on_rotations,
    intersect,
    mean_ratios,
    transfer_scale,
)
from photostrip.strip.relative_orientation import Orientation, collect_pairs, orient_pairs
from tests.loops import nonempty
from tests.strips import MICROMETRE, Flown, attitude, batch, fly, measured, photograph
from tests.vectors import Vector, cases

TRANSFERS = pytest.mark.parametrize("transfer", SCALE_TRANSFERS)
CLOSURE = 1e-12  # base lengths


def formed(flown: Flown, transfer: str = "least_squares") -> FormedStrip:
    return form_from_pairs(flown.oriented(), StripFormationSettings(transfer), flown.photos)


def truth_in_strip(flown: Flown, strip: FormedStrip) -> tuple[Floats, Floats, Floats]:
    """Centres, points and rotations of the truth in the frame and unit of the formed strip."""
    base = np.linalg.norm(flown.centers[1] - flown.centers[0])
    first = flown.rotations[0]
    centers = (flown.centers - flown.centers[0]) @ first / base
    points = (flown.xyz[strip.point] - flown.centers[0]) @ first / base
    return centers, points, first.T @ flown.rotations


def closure(flown: Flown, transfer: str = "least_squares") -> float:
    """Largest error of a centre, point or direction, in base lengths."""
    strip = formed(flown, transfer)
    found = (strip.centers, strip.xyz, strip.rotations)
    return max(float(np.abs(f - t).max()) for f, t in zip(found, truth_in_strip(flown, strip), strict=True))


def only(observations: PhotoPoints, keep: Flags) -> PhotoPoints:
    columns = (observations.photo[keep], observations.point[keep], observations.xy[keep], observations.sigma[keep])
    return PhotoPoints(observations.photo_ids, observations.point_ids, *columns)


def seen(flown: Flown, photo: int, name: str) -> Flags:
    """Rows in which a photo shows a point."""
    rows: Flags = (flown.observations.photo == photo) & (flown.observations.point == flown.at[name])
    return rows


@TRANSFERS
@pytest.mark.parametrize("example", cases("strip_local"))
def test_the_strip_of_the_formula_book(example: Vector, transfer: str) -> None:
    photos = {f"{number}": image for number, image in enumerate(example.input["photos"], start=1)}
    observations = measured(photos)
    names, tol = observations.photo_ids, example.tol
    oriented = orient_pairs(collect_pairs(observations, names, example.input["f"]), names)
    strip = form_from_pairs(oriented, StripFormationSettings(transfer), names)
    first, base = attitude(example.input["eo1_deg"])[0], example.input["base"]
    bases = np.diff(strip.centers, axis=0) @ first.T
    for number, model in nonempty(enumerate(example.expected["models"])):
        degrees = np.degrees(oriented.elements[number])
        assert np.allclose(degrees, model["elements_deg"], rtol=0, atol=tol["angles_deg"])
        assert strip.scale[number] == pytest.approx(model["k"], abs=tol["k"])
        bx, by, bz = bases[number]
        assert np.degrees(np.arctan2(by, bx)) == pytest.approx(model["tau_deg"], abs=tol["angles_deg"])
        assert np.degrees(np.arctan2(bz, np.hypot(bx, by))) == pytest.approx(model["nu_deg"], abs=tol["angles_deg"])
        assert np.linalg.norm(bases[number]) == pytest.approx(model["k"], abs=tol["k"])
    for number, camera in nonempty(enumerate(example.expected["cameras"])):
        degrees = np.degrees(alpha_omega_kappa(first @ strip.rotations[number]))
        assert np.allclose(degrees, camera["alpha_omega_kappa_deg"], rtol=0, atol=tol["angles_deg"])
        assert np.allclose(base * first @ strip.centers[number], camera["S"], rtol=0, atol=tol["coords"])
    found = {
        observations.point_ids[number]: base * first @ xyz for number, xyz in zip(strip.point, strip.xyz, strict=True)
    }
    assert found.keys() == example.expected["points"].keys()
    for name, xyz in nonempty(example.expected["points"].items()):
        assert np.allclose(found[name], xyz, rtol=0, atol=tol["coords"]), name


@pytest.mark.parametrize("example", cases("base_chain"))
def test_the_chain_of_the_formula_book(example: Vector) -> None:
    given_, expected, tol = example.input, example.expected, example.tol["abs"]
    elements = np.radians([[given_[f"{name}p_deg"] for name in ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")]])
    direction, rotation = oriented_as(elements).relative
    first = from_alpha_omega_kappa(*np.radians([given_[f"{name}1_deg"] for name in ("alpha", "omega", "kappa")]))
    assert np.allclose(first, expected["A1"], rtol=0, atol=tol)
    base_frame = from_alpha_omega_kappa(elements[0, 0], 0.0, elements[0, 1])
    assert np.allclose(base_frame, expected["A1p"], rtol=0, atol=tol)
    assert np.allclose(first @ base_frame.T, expected["A_tau_nu"], rtol=0, atol=tol)
    second = first @ hand_on_rotations(rotation)[1]
    assert np.allclose(second, expected["A2"], rtol=0, atol=tol)
    degrees = np.degrees(alpha_omega_kappa(second))
    assert np.allclose(degrees, expected["alpha2_omega2_kappa2_deg"], rtol=0, atol=tol * 10)
    dependent = expected["dependent_pair"]
    by_bx = [dependent["by_over_bx"], dependent["bz_over_bx"]]
    assert direction[0, 1:] / direction[0, 0] == pytest.approx(by_bx, abs=tol)
    degrees = np.degrees(alpha_omega_kappa(rotation[0]))
    assert np.allclose(degrees, dependent["alpha_omega_kappa_right_deg"], rtol=0, atol=tol)
    base = first @ direction[0] * given_["base"]
    assert np.allclose(base, expected["B_XYZ"], rtol=0, atol=tol * given_["base"])
    assert np.allclose(given_["S1"] + base, expected["S2"], rtol=0, atol=tol * given_["base"])
    assert np.degrees(np.arctan2(base[1], base[0])) == pytest.approx(expected["tau_deg"], abs=tol)
    assert np.degrees(np.arcsin(base[2] / given_["base"])) == pytest.approx(expected["nu_deg"], abs=tol)


def oriented_as(elements: Floats, points: int = 6) -> Orientation:
    """Pairs of given elements; what was measured is not looked at."""
    p = len(elements)
    nothing = np.zeros((p, points, 2))
    ones, numbers = np.ones(p), np.zeros(p, int)
    pairs = replace(batch(nothing, nothing, 100.0), point=np.tile(np.arange(points), p))
    by_row = np.zeros(p * points)
    return Orientation(
        pairs=pairs,
        elements=elements,
        sigmas=elements,
        sigma0=ones,
        condition=ones,
        iterations=numbers,
        parallax=by_row,
        redundancy=by_row,
        cofactors=np.zeros((p, 5, 5)),
    )


@pytest.mark.parametrize("example", cases("scale_transfer"))
def test_the_scale_factors_of_the_formula_book(example: Vector) -> None:
    given_, expected, rel = example.input, example.expected, example.tol["rel"]
    center = np.array(given_["S_common"])
    after = np.array(given_["tie_current_model_increments"])
    n = len(after)
    oriented = oriented_as(np.zeros((2, 5)), n)
    before = np.array(given_["tie_previous_model_strip_coords"]) - center + [1.0, 0, 0]  # from the left centre
    vectors = np.concatenate([before, after])
    joined = transfer_scale(oriented, vectors, StripFormationSettings("distances"), ("1", "2", "3"))
    assert np.allclose(joined.ratio, expected["k_each"], rtol=rel, atol=0)
    assert np.allclose(np.linalg.norm(after, axis=1) * joined.ratio, expected["D"], rtol=rel, atol=0)
    assert joined.factor[0] == pytest.approx(expected["k_mean"], rel=rel)
    assert joined.used.all()
    joint = np.zeros(n, int)
    weights = np.array(given_["weights"])
    mean, spread = mean_ratios(joined.ratio, weights, joint, 1)
    assert mean[0] == pytest.approx(expected["k_weighted"], rel=rel)
    assert spread[0] * mean[0] / np.sqrt(n) == pytest.approx(expected["sd_of_k_weighted"], rel=1e-9)
    squares = np.array(expected["D_prime"]) ** 2
    mean_of_squares, _ = mean_ratios(joined.ratio, squares, joint, 1)
    assert mean_of_squares[0] == pytest.approx(expected["k_least_squares"], rel=rel)
    assert np.allclose(center + mean * given_["base_components"], expected["S_next"], rtol=rel, atol=0)
    assert np.allclose(center + mean * given_["new_point_increment"], expected["new_point"], rtol=rel, atol=0)


@TRANSFERS
def test_strips_without_noise_close(transfer: str) -> None:
    """Twenty strips of 4 to 7 photos, any kappa, tilts, relief of 15 percent: 1.3e-14 base lengths were reached."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        photos, kappa = int(rng.integers(4, 8)), float(rng.uniform(-180, 180))
        flown = fly(seed, photos, tilt_deg=3, kappa_deg=kappa, relief=0.15, extra=10)
        assert closure(flown, transfer) < CLOSURE


@TRANSFERS
@pytest.mark.parametrize("extra", [10, 40, 150], ids=["4 points a joint", "7 points", "18 points"])
def test_a_wrong_pass_point_is_rejected_and_does_little_harm(transfer: str, extra: int) -> None:
    flown = fly(8, 5, sigma=2 * MICROMETRE, extra=extra, tilt_deg=0.2)
    strip = formed(flown, transfer)
    xy = flown.observations.xy.copy()
    wrong = np.flatnonzero(seen(flown, 3, "p2_1"))  # the third photo of the joint at photo 2
    xy[wrong, 0] += 1.0  # along the base: no y parallax tells
    found = formed(replace(flown, observations=replace(flown.observations, xy=xy)), transfer).junctions
    rejected = {(int(found.junction[row]), int(found.point[row])) for row in np.flatnonzero(~found.used)}
    number = flown.at["p2_1"]
    assert (1, number) in rejected
    assert rejected <= {(1, number), (2, number)}
    assert strip.junctions.used.all()
    harm = np.abs(found.factor / strip.junctions.factor - 1)
    share = 0.011 / np.bincount(found.junction, minlength=3)[1]  # of the scale, had it been left in the mean
    assert harm.max() < 0.25 * share


def test_a_broken_joint_names_its_three_photos() -> None:
    flown = fly(11, 6, extra=30)
    obs = flown.observations
    common = set(obs.point[obs.photo == 2]) & set(obs.point[obs.photo == 3]) & set(obs.point[obs.photo == 4])
    keep = ~(np.isin(obs.point, list(common)) & (obs.photo == 4))
    # photos 103 and 104, 104 and 105 still share points; no point lies on 103, 104 and 105
    with pytest.raises(GeometryError) as caught:
        formed(replace(flown, observations=only(obs, keep)))
    error = caught.value
    assert error.exit_code == EXIT_GEOMETRY
    assert (error.code, error.photos) == ("broken-joint", ("103", "104", "105"))
    assert "no point is common to photos 103, 104 and 105" in str(error)
    assert "at least one pass point" in str(error)


def test_a_base_along_the_view_is_refused() -> None:
    """A camera that climbs straight up has no base to speak of."""
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-60, 60, (20, 2)), rng.uniform(-20, 0, 20)])
    images = {}
    for name, height in (("1", 150.0), ("2", 170.0), ("3", 190.0)):
        xy = photograph(points, np.array([0.0, 0.0, height]), np.eye(3), 100.0)
        images[name] = {f"p{number}": image for number, image in enumerate(xy)}
    pairs = collect_pairs(measured(images), ("1", "2", "3"), 100.0)
    with pytest.raises(GeometryError) as caught:
        orient_pairs(pairs, ("1", "2", "3"))
    assert caught.value.photos == ("1", "2")
    assert caught.value.code in {"not-converged", "degenerate-pair"}


def test_the_steep_base_is_named() -> None:
    upright = np.array([[0.3, 0.0, 0.1], [1e-9, 0.0, 1.0]])
    with pytest.raises(
        GeometryError, match="the base from photo 2 to 3 is parallel to the viewing direction"
    ) as caught:
        _refuse_vertical_base(upright, ("1", "2", "3"))
    assert (caught.value.code, caught.value.photos) == ("vertical-base", ("2", "3"))


SEEDS = st.integers(0, 2**32 - 1)
FOCAL = 100.0


def turned(xy: Floats, rotation: Floats, focal: float = FOCAL) -> Floats:
    """Rays of a photo in the frame of the base, shape (3, n)."""
    rays: Floats = rotation @ np.column_stack([xy, np.full(len(xy), -focal)]).T
    return rays


def scene(seed: int, n: int = 8) -> tuple[Floats, Floats, Floats, Floats]:
    """Points below two photos, the base between them, the rays of both."""
    rng = np.random.default_rng(seed)
    first, second = attitude(rng.uniform(-8, 8, (2, 3)))
    base = np.array([65.0, *rng.uniform(-6, 6, 2)])
    plan = rng.uniform(-40, 110, (n, 2)) - [0, 35]
    points = np.column_stack([plan, -rng.uniform(85, 115, n)])
    left = photograph(points, np.zeros(3), first, FOCAL)
    right = photograph(points, base, second, FOCAL)
    return points, base, turned(left, first), turned(right, second)


@pytest.mark.parametrize("example", cases("intersection"))
def test_the_intersection_of_the_formula_book(example: Vector) -> None:
    given_, expected, rel = example.input, example.expected, example.tol["rel"]
    f, base = given_["f"], np.array(given_["B_XYZ"])
    left, right = (
        turned(np.array(given_[side]), attitude(given_[eo])[0], f)
        for side, eo in (("left", "eo1_deg"), ("right", "eo2_deg"))
    )
    found = intersect(base, left, right, f)
    assert found.sound.all()
    assert np.allclose(found.ray_factor, expected["N"], rtol=rel, atol=0)
    assert np.allclose(found.ray_factor + base[2] / f, expected["N2"], rtol=rel, atol=0)
    assert np.allclose(found.xyz[:, 0], expected["dX"], rtol=1e-11, atol=0)  # from rays rounded twice
    assert np.allclose(found.xyz[:, 1], expected["dY_mean"], rtol=1e-11, atol=0)
    assert np.allclose(found.xyz[:, 2], expected["dZ"], rtol=rel, atol=0)
    assert np.allclose(found.gap, expected["dY_discrepancy"], rtol=1e-11, atol=0)
    assert np.allclose(found.xyz[:, 1] + found.gap / 2, expected["dY_left"], rtol=1e-11, atol=0)
    assert np.allclose(found.xyz[:, 1] - found.gap / 2, expected["dY_right"], rtol=1e-11, atol=0)
    assert np.allclose(found.gap / found.ray_factor, expected["q_photo_scale"], rtol=1e-11, atol=0)
    level_left = np.column_stack([found.xyz[:, 0], found.xyz[:, 1] + found.gap / 2]) / found.ray_factor[:, None]
    assert np.allclose(level_left, expected["x1h_y1h"], rtol=1e-11, atol=0)
    n2 = (found.ray_factor + base[2] / f)[:, None]
    level_right = (np.column_stack([found.xyz[:, 0], found.xyz[:, 1] - found.gap / 2]) - base[:2]) / n2
    assert np.allclose(level_right, expected["x2h_y2h"], rtol=1e-11, atol=0)


@given(SEEDS)
def test_with_errors_x_and_z_solve_the_two_equations(seed: int) -> None:
    _, base, left, right = scene(seed)
    rng = np.random.default_rng(seed)
    left = left + rng.normal(0, 0.05, left.shape)
    found = intersect(base, left, right, FOCAL)
    for n in nonempty(range(left.shape[1])):
        matrix = np.column_stack([left[[0, 2], n], -right[[0, 2], n]])
        s, t = np.linalg.solve(matrix, base[[0, 2]])
        assert np.allclose(found.xyz[n, [0, 2]], s * left[[0, 2], n], rtol=0, atol=1e-9)
        heights = s * left[1, n], base[1] + t * right[1, n]
        assert found.xyz[n, 1] == pytest.approx(np.mean(heights), abs=1e-9)
        assert found.gap[n] == pytest.approx(heights[0] - heights[1], abs=1e-9)
