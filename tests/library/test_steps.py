"""The steps of the method one by one, against truth without noise and against what they are made of."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

import numpy as np
import pytest

import photostrip
from photostrip import steps
from photostrip.camera import Camera, Distortion
from photostrip.geometry.rotation import from_angles
from photostrip.result.numbers import MATRIX
from tests.library.alone import F153, ON_GROUND, PAIR, axes, traced, values

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tests.library.alone import Alone

F = 153.0
NOISE = {"image": {"sigma_um": 0}, "control": {"noise": [0, 0, 0]}}


class Truth:
    """Three photos of a strip without noise, in a local frame: what is true, and image coordinates to 0.1 nm."""

    def __init__(self) -> None:
        self.simulation = photostrip.simulate({}, flight={"photos": 3}, ground={"crs": "local"}, seed=3, **NOISE)
        truth = self.simulation.truth
        places, self.centers = (np.column_stack([truth[of][axis] for axis in "xyz"]) for of in ("points", "photos"))
        self.points = dict(zip(truth["points"]["id"], places, strict=True))
        self.rotations = np.column_stack([truth["photos"][name] for name in MATRIX]).reshape(-1, 3, 3)

    def image(self, photo: int, ids: list[str]) -> NDArray[np.float64]:
        """Project points by the collinearity equations."""
        seen = (np.array([self.points[name] for name in ids]) - self.centers[photo]) @ self.rotations[photo]
        found: NDArray[np.float64] = -F * seen[:, :2] / seen[:, 2:]
        return found

    def common(self, *photos: int) -> list[str]:
        """Give the points that lie within the format of all these photos."""
        ids = list(self.points)
        inside = np.all([np.abs(self.image(photo, ids)).max(axis=1) < 115 for photo in photos], axis=0)
        return [name for name, seen in zip(ids, inside, strict=True) if seen]

    def xyz(self, ids: list[str]) -> NDArray[np.float64]:
        return np.array([self.points[name] for name in ids])


@pytest.fixture(scope="module")
def truth() -> Truth:
    return Truth()


def test_a_pair_is_oriented_as_it_was_flown(truth: Truth) -> None:
    ids = truth.common(0, 1)
    found = steps.relative(truth.image(0, ids), truth.image(1, ids), F, base=2.0)
    base = truth.rotations[0].T @ (truth.centers[1] - truth.centers[0])
    np.testing.assert_allclose(found.base, base / np.linalg.norm(base), atol=1e-9)
    np.testing.assert_allclose(found.rotation, truth.rotations[0].T @ truth.rotations[1], atol=1e-9)
    assert np.abs(found.parallax).max() < 1e-7
    assert np.linalg.norm(found.base) == pytest.approx(1.0)
    ground = steps.absolute(found.model, truth.xyz(ids))
    assert np.abs(ground.residuals).max() < 1e-5
    assert ground.similarity.scale == pytest.approx(np.linalg.norm(base) / 2.0)
    weights = np.ones(len(ids))
    weights[0] = 0
    wrong = truth.image(0, ids)
    wrong[0] += 5
    again = steps.relative(wrong, truth.image(1, ids), F, weights=weights)
    np.testing.assert_allclose(again.elements, found.elements, atol=1e-9)


def test_rays_meet_where_the_points_are(truth: Truth) -> None:
    ids = truth.common(0, 1)
    base = truth.centers[1] - truth.centers[0]
    images, rotations = (truth.image(0, ids), truth.image(1, ids)), (truth.rotations[0], truth.rotations[1])
    found = steps.intersection(*images, F, base=base, rotations=rotations)
    np.testing.assert_allclose(found.xyz + truth.centers[0], truth.xyz(ids), atol=1e-6)
    assert np.abs(found.gap).max() < 1e-6
    images[1][:, 1] += 0.1
    of_left, mean = (
        steps.intersection(*images, F, base=base, rotations=rotations, left_ray=each) for each in (True, False)
    )
    np.testing.assert_allclose(of_left.xyz[:, 1] - mean.xyz[:, 1], of_left.gap / 2)
    assert np.abs(of_left.gap).min() > 0.5


def test_three_photos_make_a_strip(truth: Truth) -> None:
    pairs = []
    for first in (0, 1):
        ids = truth.common(first, first + 1)
        pairs.append(steps.relative(truth.image(first, ids), truth.image(first + 1, ids), F))
    rotations = steps.chain([each.rotation for each in pairs], truth.rotations[0])
    np.testing.assert_allclose(rotations, truth.rotations, atol=1e-9)
    ids = truth.common(0, 1, 2)
    models = []
    for first, pair in enumerate(pairs):
        images = truth.image(first, ids), truth.image(first + 1, ids)
        base = rotations[first] @ pair.base
        found = steps.intersection(*images, F, base=base, rotations=(rotations[first], rotations[first + 1]))
        models.append(found.xyz - (base if first == 0 else 0))
    factor, departures = steps.scale_transfer(models[0], models[1])
    bases = np.linalg.norm(np.diff(truth.centers, axis=0), axis=1)
    assert factor == pytest.approx(bases[1] / bases[0])
    assert np.abs(departures).max() < 1e-9


def test_a_strip_is_formed_at_once(truth: Truth, alone: Alone) -> None:
    seen = [(photo, name) for photo in range(3) for name in truth.common(photo)]
    ids = list(dict.fromkeys(name for _, name in seen))
    xy = np.array([truth.image(photo, [name])[0] for photo, name in seen])
    rays = np.array([photo for photo, _ in seen]), np.array([ids.index(name) for _, name in seen]), xy
    found = steps.strip(rays, F, base=92.0)
    bases = np.linalg.norm(np.diff(truth.centers, axis=0), axis=1)
    scale, turn = 92.0 / bases[0], truth.rotations[0]
    np.testing.assert_allclose(found.factors, bases / bases[0])
    np.testing.assert_allclose(found.centers, scale * (truth.centers - truth.centers[0]) @ turn, atol=1e-6)
    np.testing.assert_allclose(found.rotations, turn.T @ truth.rotations, atol=1e-9)
    placed = found.models > 0
    expected = scale * (truth.xyz(ids) - truth.centers[0]) @ turn
    np.testing.assert_allclose(found.points[placed], expected[placed], atol=1e-6)
    assert np.isnan(found.points[~placed]).all()
    assert found.models.max() == 2
    assert placed.sum() == len({*truth.common(0, 1), *truth.common(1, 2)})

    lines = [f"{photo},{name},{x!r},{y!r}" for (photo, name), (x, y) in zip(seen, xy.tolist(), strict=True)]
    images = alone.write(["photo,point,x,y", *lines])
    out = alone("strip", images, F153, "base=92")
    assert [row["point"] for row in out["points"]] == [name for name, here in zip(ids, placed, strict=True) if here]
    np.testing.assert_allclose(axes(out["photos"], "xyz"), found.centers, atol=6e-5)
    assert out["values"][1] == {"name": "k 1-2", "value": pytest.approx(found.factors[1]), "unit": "", "sigma": None}
    np.testing.assert_allclose(traced(out)["models"]["k"], found.factors)
    assert f"{found.factors[1]:.7f}" in alone.typed("strip", images, F153, "--trace")[1]
    code, _, err = alone.typed("strip", alone.write(["photo,point,x,y", *lines, lines[0]]), F153)
    assert (code, "is already measured on photo 0" in err) == (2, True)


def test_a_photo_is_found_on_known_points(truth: Truth) -> None:
    ids = truth.common(1)
    found = steps.resection(truth.image(1, ids), truth.xyz(ids), F)
    np.testing.assert_allclose(found.center, truth.centers[1], atol=1e-6)
    np.testing.assert_allclose(found.rotation, truth.rotations[1], atol=1e-9)
    half = steps.resection(truth.image(1, ids), truth.xyz(ids), F, sigma=0.0025)
    np.testing.assert_allclose(half.covariance, found.covariance / 4)


def test_all_photos_are_adjusted_at_once(truth: Truth) -> None:
    seen = [(photo, name) for photo in range(3) for name in truth.common(photo)]
    ids = sorted({name for _, name in seen if sum(name == other for _, other in seen) > 1})
    seen = [(photo, name) for photo, name in seen if name in ids]
    photo, point = np.array([each for each, _ in seen]), np.array([ids.index(name) for _, name in seen])
    xy = np.array([truth.image(each, [name])[0] for each, name in seen])
    rng = np.random.default_rng(5)
    ground = np.where(np.arange(len(ids))[:, None] % 4 == 0, truth.xyz(ids), np.nan)
    ground[4, :2] = np.nan  # known in height only
    rotations = [from_angles(rng.normal(0, 0.01, 3), "omega-phi-kappa") @ each for each in truth.rotations]
    start = truth.centers + rng.normal(0, 5, (3, 3)), rotations, truth.xyz(ids) + rng.normal(0, 5, (len(ids), 3))
    found = steps.bundle((photo, point, xy), F, start, ground=ground)
    np.testing.assert_allclose(found.points, truth.xyz(ids), atol=1e-5)
    np.testing.assert_allclose(found.centers, truth.centers, atol=1e-5)
    np.testing.assert_allclose(found.rotations, truth.rotations, atol=1e-8)
    assert found.redundancy == 2 * len(xy) + np.isfinite(ground).sum() - 3 * len(ids) - 18
    assert found.sigma0 < 1e-4
    half = steps.bundle((photo, point, xy), F, start, ground=ground, sigma=0.0025, ground_sigma=0.025)
    np.testing.assert_allclose(half.sigmas, found.sigmas / 2)
    free = steps.bundle((photo, point, xy), F, start)
    assert free.redundancy == 2 * len(xy) - 3 * len(ids) - 18 + 7
    assert np.abs(free.residuals).max() < 1e-6
    with pytest.raises(photostrip.InputError, match="a photo or a point that the start does not have"):
        steps.bundle((photo + 1, point, xy), F, start)


class Flown:
    """The images of all three photos with noise, and every third point given."""

    def __init__(self, truth: Truth) -> None:
        self.seen = [(photo, name) for photo in range(3) for name in truth.common(photo)]
        self.ids = list(dict.fromkeys(name for _, name in self.seen))
        self.point = np.array([self.ids.index(name) for _, name in self.seen])
        noise = np.random.default_rng(7).normal(0, 0.005, (len(self.seen), 2))
        self.xy = np.array([truth.image(photo, [name])[0] for photo, name in self.seen]) + noise
        self.rays = np.array([photo for photo, _ in self.seen]), self.point, self.xy
        self.given = np.where(np.arange(len(self.ids))[:, None] % 3 == 0, truth.xyz(self.ids), np.nan)
        self.placed = np.bincount(self.point) > 1

    def lines(self) -> list[str]:
        pairs = zip(self.seen, self.xy.tolist(), strict=True)
        return ["photo,point,x,y", *(f"{photo},{name},{x!r},{y!r}" for (photo, name), (x, y) in pairs)]

    def command(self, alone: Alone) -> tuple[str, str, str, str]:
        """Write images and control; give what adjusts them."""
        known = np.isfinite(self.given[:, 0])
        names = [name for name, here in zip(self.ids, known, strict=True) if here]
        ground = np.vstack([self.given[known], [9.0, 9.0, 9.0]])
        control = alone.table("point x_ground y_ground z_ground", [*names, "not seen"], ground, name="control.csv")
        return "bundle", alone.write(self.lines(), "images.csv"), F153, f"control={control}"


@pytest.fixture(scope="module")
def flown(truth: Truth) -> Flown:
    return Flown(truth)


def test_the_bundle_starts_from_the_strip(truth: Truth, flown: Flown) -> None:
    found = steps.bundle(flown.rays, F, ground=flown.given)
    np.testing.assert_array_equal(np.isfinite(found.points[:, 0]), flown.placed)
    np.testing.assert_array_equal(np.isfinite(found.residuals[:, 0]), flown.placed[flown.point])
    start = truth.centers, truth.rotations, np.where(flown.placed[:, None], truth.xyz(flown.ids), np.nan)
    again = steps.bundle(flown.rays, F, start, ground=flown.given)
    np.testing.assert_allclose(found.points, again.points, atol=1e-5)
    np.testing.assert_allclose(found.sigmas, again.sigmas, rtol=1e-5)
    np.testing.assert_allclose(found.centers, truth.centers, atol=1.0)
    two = np.where(np.arange(len(flown.ids))[:, None] < 2, truth.xyz(flown.ids), np.nan)
    with pytest.raises(photostrip.GeometryError, match="fewer than three points, or all on one line"):
        steps.bundle(flown.rays, F, ground=two)
    with pytest.raises(photostrip.InputError, match="2 rows: each point needs a row in both"):
        steps.bundle(flown.rays, F, ground=flown.given[:2])


def test_the_bundle_as_a_command(flown: Flown, alone: Alone) -> None:
    command, found = flown.command(alone), steps.bundle(flown.rays, F, ground=flown.given)
    out = alone(*command)
    rows = {row["point"]: np.array(list(row.values())[1:], float) for row in out["points"]}
    assert list(rows) == [name for name, here in zip(flown.ids, flown.placed, strict=True) if here]
    expected = np.hstack([found.points, found.sigmas, found.points - flown.given])[flown.placed]
    np.testing.assert_allclose(np.array(list(rows.values())), expected, atol=6e-5)
    named = {name: getattr(found, name) for name in ("sigma0", "redundancy", "iterations")}
    assert values(out) == pytest.approx(named)
    assert [row["photo"] for row in out["photos"]] == ["0", "1", "2"]
    tables, taken = traced(out), flown.placed[flown.point]
    left = np.column_stack([tables["rays"][axis] - tables["rays"][f"{axis}'"] for axis in "xy"])
    np.testing.assert_allclose(left, found.residuals[taken], atol=1e-9)
    squares = tables["steps_of_all_photos_and_points"]["[pvv]"]
    assert squares[-1] == pytest.approx(found.sigma0**2 * found.redundancy)
    half = alone(*command, "sigma_um=2.5", "control_sigma=0.025")
    assert values(half)["sigma0"] == pytest.approx(2 * found.sigma0)
    free, out = steps.bundle(flown.rays, F, base=92.0), alone(*command[:3], "base=92")
    assert values(out)["redundancy"] == free.redundancy
    np.testing.assert_allclose(axes(out["photos"], "xyz"), free.centers, atol=6e-5)


@pytest.mark.parametrize(
    ("file", "lines", "code", "message"),
    [
        ("control.csv", ["point,x,y,z", "1,2,3,4"], 2, "control.csv:1: x_ground: there is no column"),
        ("control.csv", ["point,x_ground,y_ground,z_ground", "1,2,3,4"], 3, "fewer than three points"),
        ("images.csv", ["photo,point,x", "1,2,3"], 2, "images.csv:1: y: there is no column"),
        ("images.csv", ["photo,point,x,y", "a,2,3,4", "b,2,3,4"], 3, "orientation of photos a and b: 1 common point"),
        ("images.csv", ["photo,point,x,y", "a,2,3,4"], 3, "a strip needs two photos"),
    ],
)
def test_a_bundle_that_cannot_be_is_refused(
    flown: Flown, alone: Alone, file: str, lines: list[str], code: int, message: str
) -> None:
    command = flown.command(alone)
    alone.write(lines, file)
    found, _, err = alone.typed(*command)
    assert (found, message in err) == (code, True)


@pytest.mark.parametrize(("kind", "redundancy"), [("affine", 2), ("conformal", 4)])
def test_marks_give_photo_coordinates(kind: Literal["affine", "conformal"], redundancy: int) -> None:
    measured = np.array([[10.0, 10.0], [210.0, 12.0], [208.0, 212.0], [8.0, 210.0]])
    turn = 1.0005 * np.array([[0.0, -1.0], [1.0, 0.0]])
    found = steps.interior(measured, measured @ turn.T + [3.0, -4.0], kind)
    assert np.abs(found.residuals).max() < 1e-10
    assert found.redundancy == redundancy
    np.testing.assert_allclose(found.transform([[1.0, 2.0]]), [[-2.001 + 3.0, 1.0005 - 4.0]])


def test_coordinates_are_refined() -> None:
    camera = Camera(
        name="c",
        principal_distance=F,
        principal_point=(0.2, -0.1),
        distortion=Distortion(model="brown", direction="image_to_ideal", k=(2e-8, 0.0, 0.0)),
    )
    x, y = 80.0 - 0.2, 60.0 + 0.1
    stretch = 1 + 2e-8 * (x * x + y * y)
    np.testing.assert_allclose(steps.refine([[80.0, 60.0]], camera), [[x * stretch, y * stretch]])
    plain = Camera(name="c", principal_distance=F)
    (bent,) = steps.refine([[80.0, 60.0]], plain, flying_height=3000.0)
    assert 99.99 < np.hypot(*bent) < 100.0  # refraction moves images outward
    assert bent[0] / bent[1] == pytest.approx(80 / 60)


def test_a_deformation_is_fitted() -> None:
    rng = np.random.default_rng(1)
    xyz = rng.uniform(-1000, 1000, (12, 3))
    bend = 0.3 - 2e-4 * xyz[:, 0] + 1e-7 * xyz[:, 0] ** 2 + 3e-7 * xyz[:, 0] * xyz[:, 1]
    coefficients, residuals = steps.polynomial(xyz, bend, ["1", "X", "X^2", "XY"])
    np.testing.assert_allclose(coefficients, [0.3, -2e-4, 1e-7, 3e-7], rtol=1e-9)
    assert np.abs(residuals).max() < 1e-12
    with pytest.raises(photostrip.GeometryError, match="3 points do not determine 4 terms"):
        steps.polynomial(xyz[:3], bend[:3], ["1", "X", "X^2", "XY"])
    for terms, message in ((["1", "x"], "there is no term 'x': 1, X, Y, XY"), ([], "there is no term ''")):
        with pytest.raises(photostrip.InputError, match=message):
            steps.polynomial(xyz, bend, terms)
    with pytest.raises(photostrip.InputError, match="12 and 3 rows"):
        steps.polynomial(xyz, bend[:3], ["1"])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: steps.relative(np.zeros((4, 2)), np.zeros((4, 2)), F), "4 common points cannot orient a pair"),
        (lambda: steps.relative(np.zeros((6, 3)), np.zeros((6, 2)), F), r"not one of shape \(6, 3\)"),
        (lambda: steps.relative(np.zeros((6, 2)), np.zeros((5, 2)), F), "6 and 5 rows: each point needs a row in both"),
        (lambda: steps.relative(np.full((6, 2), np.nan), np.zeros((6, 2)), F), "finite numbers"),
        (lambda: steps.relative(np.eye(6)[:, :2], np.eye(6)[:, :2], F), "photos left and right"),
        (lambda: steps.absolute(np.outer(np.arange(4), [1, 2, 3]), np.eye(4)[:, :3]), "all on one line"),
        (lambda: steps.resection(np.eye(3)[:, :2], np.eye(3), F), "3 known points cannot orient a photo"),
        (lambda: steps.interior(np.eye(2), np.eye(2), cast("Literal['affine']", "round")), "no transformation"),
    ],
)  # fmt: skip
def test_what_determines_nothing_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises((photostrip.InputError, photostrip.GeometryError), match=message):
        call()


class Noisy(NamedTuple):
    """Common points of two photos, with noise."""

    ids: list[str]
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    xyz: NDArray[np.float64]


@pytest.fixture
def noisy(truth: Truth) -> Noisy:
    ids, rng = truth.common(0, 1), np.random.default_rng(2)
    left, right = (truth.image(photo, ids) + rng.normal(0, 0.005, (len(ids), 2)) for photo in (0, 1))
    return Noisy(ids, left, right, truth.xyz(ids))


def test_relative_orientation_as_a_command(noisy: Noisy, alone: Alone) -> None:
    expected = steps.relative(noisy.left, noisy.right, F, base=920.0)
    out = alone("relative", alone.table(PAIR, noisy.ids, noisy.left, noisy.right), F153, "base=920", "unit=m")
    found, tables = values(out), traced(out)
    assert found["by"] == pytest.approx(920 * expected.base[1])
    turned = from_angles(np.radians([found[name] for name in ("omega", "phi", "kappa")]), "omega-phi-kappa")
    np.testing.assert_allclose(turned, expected.rotation, atol=1e-9)
    np.testing.assert_allclose(axes(out["points"], "xyz"), expected.model, atol=6e-5)
    before, added = tables["elements_before_each_step"], tables["what_the_step_adds"]
    for k, name in enumerate(("alpha1", "kappa1", "alpha2", "omega2", "kappa2")):
        assert found[name] == pytest.approx(np.degrees(expected.elements[k]), abs=1e-6)
        assert before[name][-1] + added[name][-1] == pytest.approx(np.degrees(expected.elements[k]), abs=1e-9)
        np.testing.assert_allclose(before[name][:-1] + added[name][:-1], before[name][1:], atol=1e-9)
    assert before["[qq]"][-1] == pytest.approx((expected.parallax**2).sum())
    (points,) = [each for title, each in tables.items() if title.startswith("points")]
    np.testing.assert_allclose(points["y1h"] - points["y2h"], expected.parallax, atol=1e-9)
    np.testing.assert_allclose(points["N"] * points["x1h"], expected.model[:, 0])
    np.testing.assert_allclose((points["Y1"] + points["Y2"]) / 2, expected.model[:, 1])


def test_intersection_as_a_command(noisy: Noisy, alone: Alone) -> None:
    left, right = noisy.left, noisy.right
    out = alone("intersection", alone.table(PAIR, noisy.ids, left, right), F153, "base=[900, 10, -20]",
                "right=[0.2, -0.1, 1.4]")  # fmt: skip
    points, turned = traced(out)["points"], from_angles(np.radians([0.2, -0.1, 1.4]), "omega-phi-kappa")
    met = steps.intersection(left, right, F, base=[900, 10, -20], rotations=(np.eye(3), turned))
    np.testing.assert_allclose(axes(out["points"], "xyz"), met.xyz, atol=6e-5)
    np.testing.assert_allclose(points["Y1"] - points["Y2"], met.gap, atol=1e-9)
    left, right = left[:, ::-1], right[:, ::-1]  # the base along Y
    out = alone("intersection", alone.table(PAIR, noisy.ids, left, right), F153, "base=[10, 900, -20]")
    points = traced(out)["points"]
    met = steps.intersection(left, right, F, base=[10, 900, -20], rotations=(np.eye(3), np.eye(3)), left_ray=True)
    np.testing.assert_allclose(points["X1"] - points["X2"], met.gap, atol=1e-9)
    np.testing.assert_allclose(points["N"] * points["y1h"], met.xyz[:, 1])


def test_resection_as_a_command(noisy: Noisy, alone: Alone) -> None:
    table = alone.table("point x y x_ground y_ground z_ground", noisy.ids, noisy.left, noisy.xyz)
    out = alone("resection", table, F153)
    tables, oriented = traced(out), steps.resection(noisy.left, noisy.xyz, F)
    assert [values(out)[axis] for axis in "xyz"] == pytest.approx(oriented.center.tolist(), abs=1e-4)
    before, added = tables["centre_before_each_step"], tables["what_the_step_adds"]
    assert before["X0"][-1] + added["dX0"][-1] == pytest.approx(oriented.center[0], abs=1e-7)
    assert before["[vv]"][-1] == pytest.approx((oriented.residuals**2).sum())
    np.testing.assert_allclose(tables["points"]["x"] - tables["points"]["x'"], oriented.residuals[:, 0], atol=1e-9)


def test_absolute_orientation_and_scale_transfer_as_commands(noisy: Noisy, alone: Alone) -> None:
    model = steps.relative(noisy.left, noisy.right, F, base=920.0).model
    fitted = steps.absolute(model, noisy.xyz)
    out = alone("absolute", alone.table(ON_GROUND, noisy.ids, model, noisy.xyz))
    assert values(out)["scale"] == pytest.approx(fitted.similarity.scale)
    rows = traced(out)["points"]
    np.testing.assert_allclose(rows["X'"] - rows["X-Xm"], fitted.residuals[:, 0], atol=1e-9)
    out = alone("scale", alone.table("point x y z x_next y_next z_next", noisy.ids, model, model / 1.25))
    assert values(out) == {"k": pytest.approx(1.25), "rms departure": pytest.approx(0, abs=1e-6)}
    np.testing.assert_allclose(traced(out)["points"]["k_t"], 1.25)


def test_marks_as_a_command(alone: Alone) -> None:
    measured = np.array([[100.012, -99.982], [-111.97, -100.01], [-112.0, 112.03], [100.03, 112.05]])
    calibrated = np.array([[106.0, -106.0], [-106.0, -106.0], [-106.0, 106.0], [106.0, 106.0]])
    marks = alone.table("mark x y x_photo y_photo", "1234", measured, calibrated)
    text = alone.typed("interior", marks, "--trace")[1]
    lines = [line.rsplit(None, 1) for line in text.splitlines() if line[:3] in {"x: ", "y: "}]
    printed = {name: float(value) for name, value in lines}  # with digits enough to be used
    terms = {"x": measured[:, 0], "y": measured[:, 1], "1": np.ones(4)}
    by_hand = np.array([sum(printed[f"{axis}: {term}"] * terms[term] for term in terms) for axis in "xy"]).T
    fitted = calibrated + steps.interior(measured, calibrated).residuals
    assert np.abs(by_hand - fitted).max() < 1e-6  # mm; of four decimals 0.004
    (line,) = re.findall(r"x' = (.*)\n", text)
    x = eval(line.replace(" x", " * 100.012").replace(" y", " * -99.982"))  # noqa: S307 (an equation with its numbers)
    assert x == pytest.approx(traced(alone("interior", marks))["marks"]["x'"][0], abs=1e-7)
    assert re.search(r"x' = \(.*\) / \(", alone.typed("interior", marks, "--trace", "transform=projective")[1])


def test_refined_coordinates_as_a_command(alone: Alone) -> None:
    lens = [F153, "principal_point=[0.2, -0.1]", "k=[2e-8, 0, 0]", "flying_height=3000"]
    out = alone("refine", alone.table("point x y", "12", [[80.0, 60.0], [-100.0, 20.0]]), *lens)
    rows, shift = traced(out)["corrections"], axes(out["points"], ["dx", "dy"])
    np.testing.assert_allclose(rows["lens_x"], 2e-8 * rows["r"] ** 2 * rows["x-x0"] * 1000, atol=1e-9)
    np.testing.assert_allclose(rows["x-x0"] + (rows["lens_x"] + rows["refr_x"]) / 1000, rows["x'"])
    assert (rows["refr_x"] * rows["x-x0"] < 0).all()
    np.testing.assert_allclose(shift[:, 0], (rows["x'"] - [80.0, -100.0]) * 1000, atol=1e-3)


def test_the_chain_as_a_command(alone: Alone) -> None:
    angles = [[1.0, 2.0, 30.0], [3.0, 2.0, 1.0]]
    out = alone("chain", alone.table("photo omega phi kappa", "12", angles))
    handed = np.radians(axes(out["points"], ["omega", "phi", "kappa"]))
    turns = [from_angles(np.radians(each), "omega-phi-kappa") for each in angles]
    np.testing.assert_allclose(from_angles(handed[1], "omega-phi-kappa"), turns[0] @ turns[1], atol=2e-8)
    given, found = (np.column_stack([each[n] for n in "123"]).reshape(-1, 3, 3) for each in traced(out).values())
    np.testing.assert_allclose(found[1], given[0] @ given[1])


def test_a_polynomial_as_a_command(alone: Alone) -> None:
    line = [[0.0, 0, 0, 1], [1, 0, 0, 3], [2, 0, 0, 6]]
    out = alone("polynomial", alone.table("point x y z misclosure", "123", line), "terms=[1, X]")
    assert [values(out)["1"], values(out)["X"]] == pytest.approx([5 / 6, 2.5])
    rows = traced(out)["points"]
    np.testing.assert_allclose(rows["polynomial"] + rows["v"], [1, 3, 6])
    np.testing.assert_allclose(rows["X"], [0, 1, 2])


HEAD = PAIR.replace(" ", ",")


@pytest.mark.parametrize(
    ("lines", "options", "code", "message"),
    [
        (["point,x_left,y_left", "1,2,3"], [], 2, "points.csv:1: x_right: there is no column `x_right`"),
        ([HEAD, "1,1,2,3,4", "1,1,2,3,4"], [], 2, "point 1 stands in line 2 already"),
        ([HEAD, "1,1,2,nan,4"], [], 2, "points.csv:2:7: x_right"),
        ([HEAD, "1,1,2,3,4"], [], 3, "1 common points cannot orient a pair"),
        ([], [], 2, "points.csv: is empty"),
        (["\0"], [], 2, "it has NUL bytes"),
        ([HEAD, "1,1,2,3,4"], ["-o", "model.xls"], 2, "nothing is written as '.xls'"),
        ([HEAD, "1,1,2,3,4"], ["base=0"], 2, "base: 0 is out of range"),
    ],
)
def test_what_is_wrong_is_told(lines: list[str], options: list[str], code: int, message: str, alone: Alone) -> None:
    found, _, err = alone.typed("relative", alone.write(lines), F153, *options)
    assert (found, message in err) == (code, True)


def test_a_missing_table_and_wrong_numbers_are_told(alone: Alone) -> None:
    assert "does not exist" in alone.typed("interior", "none.csv")[2]
    _, _, err = alone.typed("refine", alone.write(["point,x,y", "1,2,3"]), F153, "k=[1, nan, 0]")
    assert "--set: k[1]: `nan` is not a measured value" in err
