"""Steps in the language of the textbook: its angles, weights, frames, curvature, pair scales, closed form, surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj
import pytest

import photostrip
from photostrip import steps
from photostrip.planning.single_model import influence
from tests.library.alone import ON_GROUND, values
from tests.vectors import cases

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

    from tests.library.alone import Alone
    from tests.vectors import Vector


def asked(alone: Alone, step: str, lines: list[str], *keys: str) -> dict[str, Any]:
    """Give what a step answers about a table."""
    return alone(step, alone.write(lines), *keys)


def listed(head: str, rows: ArrayLike, ids: Iterable[object] | None = None) -> list[str]:
    """Give the lines of a table, all digits of every number."""
    numbers = np.asarray(rows, float).tolist()
    names = range(len(numbers)) if ids is None else ids
    return [head.replace(" ", ","), *(f"{n},{','.join(map(repr, row))}" for n, row in zip(names, numbers, strict=True))]


@pytest.mark.parametrize("vector", cases("base_chain"))
def test_a_chain_in_the_angles_of_the_textbook(vector: Vector, alone: Alone) -> None:
    given, expected = vector.input, vector.expected
    first = [given[f"{name}1_deg"] for name in ("alpha", "omega", "kappa")]
    turn = expected["dependent_pair"]["alpha_omega_kappa_right_deg"]
    lines = listed("photo alpha omega kappa", [first, turn])
    found = asked(alone, "chain", lines, "angles=alpha-omega-kappa")["points"][1]
    right = [found[name] for name in ("alpha", "omega", "kappa")]
    assert right == pytest.approx(expected["alpha2_omega2_kappa2_deg"], abs=1e-8)
    rotations = steps.from_angles(np.radians([first, turn]), "alpha-omega-kappa")
    again = np.degrees(steps.angles(steps.chain(rotations[1:], rotations[0])[1], "alpha-omega-kappa"))
    assert again == pytest.approx(expected["alpha2_omega2_kappa2_deg"], abs=1e-9)


def test_the_similarity_in_xi_eta_theta(alone: Alone) -> None:
    turn = np.radians([1.5, -2.0, 40.0])
    rng = np.random.default_rng(3)
    model = rng.normal(0, 50, (6, 3))
    ground = 9.5 * model @ steps.from_angles(turn, "alpha-omega-kappa").T + [1000.0, 2000.0, 300.0]
    wrong = ground.copy()
    wrong[5] += 30
    head, *lines = listed(ON_GROUND, np.hstack([model, wrong]))
    lines = [f"{head},weight", *(f"{line}," for line in lines[:5]), f"{lines[5]},1e-12"]
    found = values(asked(alone, "absolute", lines, "angles=alpha-omega-kappa"))
    assert [found[name] for name in ("xi", "eta", "theta")] == pytest.approx([1.5, -2.0, 40.0], abs=1e-5)
    assert found["scale"] == pytest.approx(9.5, rel=1e-6)


def test_rays_meet_in_the_angles_of_the_textbook(alone: Alone) -> None:
    left, right, base = [0.5, -1.0, 20.0], [-0.7, 0.4, 22.0], np.array([900.0, 30.0, -5.0])
    rotations = [steps.from_angles(np.radians(each), "alpha-omega-kappa") for each in (left, right)]
    point, images = np.array([400.0, 250.0, -1500.0]), []
    for rotation, centre in zip(rotations, (np.zeros(3), base), strict=True):
        u, v, w = rotation.T @ (point - centre)
        images += [-153.0 * u / w, -153.0 * v / w]
    lines = ["point,x_left,y_left,x_right,y_right", f"P,{','.join(map(str, images))}"]
    keys = (f"left={left}", f"right={right}", f"base={base.tolist()}", "principal_distance=153")
    found = asked(alone, "intersection", lines, "angles=alpha-omega-kappa", *keys)
    assert [found["points"][0][axis] for axis in "xyz"] == pytest.approx(point, abs=1e-6)


def test_weights_of_pass_points(alone: Alone) -> None:
    first = np.array([[1.0, 2.0, 2.0], [2.0, 3.0, 6.0], [4.0, 4.0, 7.0]])  # 3, 7 and 9 from the centre
    second = first / np.array([[1.5], [1.2], [3.0]])
    factor, departures = steps.scale_transfer(first, second, [1.0, 3.0, 0.0])
    assert factor == pytest.approx((1.5 + 3 * 1.2) / 4)
    assert departures == pytest.approx(np.array([1.5, 1.2, 3.0]) / factor - 1)
    rows = np.hstack([first, second, [[1.0], [3.0], [0.0]]])[:2]
    lines = listed("point x y z x_next y_next z_next weight", rows)
    document = asked(alone, "scale", lines)
    assert values(document)["k"] == pytest.approx(factor)
    for weights in ([1.0, -1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 2.0], [1.0, np.nan, 1.0]):
        with pytest.raises(photostrip.InputError, match="3 weights are needed, 0 or more"):
            steps.scale_transfer(first, second, weights)
    code, _, err = alone.typed("scale", alone.write([*lines[:2], lines[2].replace(",3.0", ",-3.0")], "scale.csv"))
    assert (code, "scale.csv:3:43: weight: -3 is out of range" in err) == (2, True)


def test_the_intermediate_frame_lies_in_its_azimuth(alone: Alone) -> None:
    """Geodesics of PROJ: a point ahead in the azimuth has X, one to the left Y; heights go into Z."""
    geod, lon, lat, azimuth = pyproj.Geod(ellps="WGS84"), 15.3, 49.2, 75.0
    places = [geod.fwd(lon, lat, azimuth + turn, 500.0)[:2] for turn in (0.0, 180.0, -90.0, 90.0)]
    heights = (300, 300, 310, 310)
    lines = listed("point longitude latitude height", np.column_stack([places, heights]))
    document = asked(alone, "frame", lines, f"azimuth={azimuth}")
    found = np.array([[row[axis] for axis in "XYZ"] for row in document["points"]])
    expected = [[500.0, 0.0, -5.0], [-500.0, 0.0, -5.0], [0.0, 500.0, 5.0], [0.0, -500.0, 5.0]]
    assert found == pytest.approx(np.array(expected), abs=0.03)  # 500 m and 300 m up: 1 + 300/R
    to_earth = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    geocentric = to_earth.transform([x for x, _ in places], [y for _, y in places], heights)
    back = document["trace_points"]
    assert np.array([[row[f"{axis}_G"] for axis in "XYZ"] for row in back]) == pytest.approx(
        np.transpose(geocentric), abs=1e-4
    )
    assert np.array([[row["longitude"], row["latitude"]] for row in back]) == pytest.approx(np.array(places), abs=1e-9)


def test_what_has_no_ratio_and_no_place_is_refused() -> None:
    at_one_place, apart = np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    with pytest.raises(photostrip.InputError, match="lies in the perspective centre"):
        steps.scale_transfer(apart + 1, at_one_place)
    with pytest.raises(photostrip.InputError, match="two points lie at one place"):
        steps.pair_scales(at_one_place, apart)
    with pytest.raises(photostrip.InputError, match="are they exchanged"):
        steps.frame(np.radians([[49.0, 115.0, 0.0]]))


def test_the_earth_falls_away() -> None:
    radius, reach = 6_371_000.0, 10_000.0
    found = steps.curvature([[0.0, 0.0, 5.0], [6_000.0, 8_000.0, 0.0]], radius=radius, origin=[0.0, 0.0])
    assert found == pytest.approx([0.0, radius - np.sqrt(radius**2 - reach**2)], rel=1e-5)
    assert steps.curvature([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0]], radius=100.0) == pytest.approx([50.0, 50.0])


def test_scales_of_pairs(alone: Alone) -> None:
    model = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, 12.0]])
    ground = 7.0 * model
    ground[2, 2] += 1.3
    found = steps.pair_scales(model, ground)
    assert found.source == pytest.approx([5.0, 12.0, 13.0])
    assert found.mean == pytest.approx(found.target.sum() / 30.0)
    document = asked(alone, "pair-scales", listed(ON_GROUND, np.hstack([model, ground])))
    assert [row["r"] for row in document["points"]] == pytest.approx((found.target / found.source).tolist())
    assert values(document)["r"] == pytest.approx(found.mean)
    assert values(document)["r"] * values(document)["t"] == pytest.approx(
        steps.absolute(model, ground).similarity.scale
    )
    with pytest.raises(photostrip.InputError, match="two points are needed"):
        steps.pair_scales(model[:1], ground[:1])


def test_the_closed_form_is_what_a_fit_leaves(alone: Alone) -> None:
    """Influence of the elements less a four parameter fit in plan and a plane in height to the control."""
    base, focal = 92.0, 153.0
    control = np.array([[0.0, 92.0], [92.0, 80.0], [10.0, -92.0], [92.0, -92.0], [50.0, 3.0]])
    points = np.array([[23.0, 46.0], [70.0, -30.0]])

    def rows(xy: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        x, y, one, zero = xy[:, 0], xy[:, 1], np.ones(len(xy)), np.zeros(len(xy))
        plan = [np.stack([one, zero, x, -y], axis=1), np.stack([zero, one, y, x], axis=1)]
        return np.concatenate(
            [np.hstack([each, np.zeros((len(xy), 3))]) for each in plan]
            + [np.hstack([np.zeros((len(xy), 4)), np.stack([one, x, y], axis=1)])]
        )

    def felt(xy: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        by_point = influence(np.column_stack([xy, np.full(len(xy), focal)]), base)[:, :, 1:]  # dbz, dkappa, ...
        return np.concatenate([by_point[:, axis] for axis in range(3)])

    fitted, *_ = np.linalg.lstsq(rows(control), felt(control), rcond=None)
    expected = (felt(points) - rows(points) @ fitted).reshape(3, len(points), -1).transpose(1, 0, 2)
    found = steps.closed_form(points, control, focal, base)
    assert found.coefficients == pytest.approx(expected, abs=1e-9)
    printed = steps.closed_form(points, control, focal, base, as_printed=True)
    assert np.abs(printed.coefficients - expected).max() > 1.0
    given = alone.write(listed("point x y", control), "control.csv")
    keys = f"control={given}", f"base={base}", f"principal_distance={focal}"
    document = asked(alone, "closed-form", listed("point x y", points), *keys)
    told = [[row[name] for name in ("dbz", "dkappa", "dalpha", "domega")] for row in document["points"]]
    assert np.array(told).reshape(expected.shape) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert values(document)["c1"] == pytest.approx(((control - control.mean(axis=0))[:, 0] ** 2).sum())
    with pytest.raises(photostrip.GeometryError, match="control on one line"):
        steps.closed_form(points, [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], focal, base)


def test_twist_and_bending_of_a_model(alone: Alone) -> None:
    xy = np.array([[x, y] for x in (0.0, 46.0, 92.0) for y in (-92.0, 0.0, 92.0)])
    x, y = xy.T
    surface = 0.05 - 1e-3 * x + 5e-4 * y - 6e-6 * x * y + 4e-6 * x**2
    noise = np.random.default_rng(5).normal(0, 0.01, 9)
    found = steps.deformation(xy, surface + noise)
    assert found.coefficients[3:] == pytest.approx([-6e-6, 4e-6], abs=4 * found.sigmas[3:].max())
    lines, keys = listed("point x y dz", np.column_stack([xy, surface])), ("base=92", "scale=10000", "sigma=0.05")
    told = values(asked(alone, "deformation", lines, *keys))
    assert told["C"] == pytest.approx(-6e-6)
    assert told["domega2'"] == pytest.approx(np.degrees(6e-6 * 1000 * 92 / 10000))
    assert told["dalpha2' - dalpha1'"] == pytest.approx(np.degrees(-4e-6 * 1000 * 92 / 10000))
    six = xy[x != 46.0]
    with pytest.raises(photostrip.GeometryError, match="do not determine twist and bending"):
        steps.deformation(six, np.zeros(6))
