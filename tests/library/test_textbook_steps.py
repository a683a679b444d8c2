"""Steps in the language of the textbook: its angles, weights, frames, curvature, pair scales, closed form, surface."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj
import pytest

import photostrip
from photostrip import steps
from photostrip.cli.main import main
from photostrip.planning.single_model import influence
from tests.vectors import cases

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Capture
    from tests.vectors import Vector

Document = dict[str, Any]


def asked(capsys: Capture, file: Path, step: str, lines: list[str], *keys: str) -> Document:
    """Give what a step answers about a table."""
    file.write_text("\n".join(lines), encoding="utf-8")
    settings = [each for key in keys for each in ("--set", key)]
    assert main(["step", step, str(file), *settings, "--trace", "--format", "json"]) == 0
    document: Document = json.loads(capsys.readouterr().out)
    return document


def values(document: Document) -> dict[str, float]:
    return {row["name"]: row["value"] for row in document["values"]}


@pytest.mark.parametrize("vector", cases("base_chain"))
def test_a_chain_in_the_angles_of_the_textbook(vector: Vector, tmp_path: Path, capsys: Capture) -> None:
    given, expected = vector.input, vector.expected
    first = [given[f"{name}1_deg"] for name in ("alpha", "omega", "kappa")]
    turn = expected["dependent_pair"]["alpha_omega_kappa_right_deg"]
    lines = ["photo,alpha,omega,kappa", *(f"{n},{','.join(map(repr, each))}" for n, each in enumerate((first, turn)))]
    found = asked(capsys, tmp_path / "chain.csv", "chain", lines, "angles=alpha-omega-kappa")["points"][1]
    right = [found[name] for name in ("alpha", "omega", "kappa")]
    assert right == pytest.approx(expected["alpha2_omega2_kappa2_deg"], abs=1e-8)
    rotations = steps.from_angles(np.radians([first, turn]), "alpha-omega-kappa")
    again = np.degrees(steps.angles(steps.chain(rotations[1:], rotations[0])[1], "alpha-omega-kappa"))
    assert again == pytest.approx(expected["alpha2_omega2_kappa2_deg"], abs=1e-9)


def test_the_similarity_in_xi_eta_theta(tmp_path: Path, capsys: Capture) -> None:
    turn = np.radians([1.5, -2.0, 40.0])
    rng = np.random.default_rng(3)
    model = rng.normal(0, 50, (6, 3))
    ground = 9.5 * model @ steps.from_angles(turn, "alpha-omega-kappa").T + [1000.0, 2000.0, 300.0]
    wrong = ground.copy()
    wrong[5] += 30
    rows = np.hstack([model, wrong])
    lines = ["point,x,y,z,x_ground,y_ground,z_ground,weight"]
    lines += [f"{n},{','.join(map(repr, row.tolist()))},{'' if n < 5 else '1e-12'}" for n, row in enumerate(rows)]
    found = values(asked(capsys, tmp_path / "model.csv", "absolute", lines, "angles=alpha-omega-kappa"))
    assert [found[name] for name in ("xi", "eta", "theta")] == pytest.approx([1.5, -2.0, 40.0], abs=1e-5)
    assert found["scale"] == pytest.approx(9.5, rel=1e-6)


def test_rays_meet_in_the_angles_of_the_textbook(tmp_path: Path, capsys: Capture) -> None:
    left, right, base = [0.5, -1.0, 20.0], [-0.7, 0.4, 22.0], np.array([900.0, 30.0, -5.0])
    rotations = [steps.from_angles(np.radians(each), "alpha-omega-kappa") for each in (left, right)]
    point, images = np.array([400.0, 250.0, -1500.0]), []
    for rotation, centre in zip(rotations, (np.zeros(3), base), strict=True):
        u, v, w = rotation.T @ (point - centre)
        images += [-153.0 * u / w, -153.0 * v / w]
    lines = ["point,x_left,y_left,x_right,y_right", f"P,{','.join(map(str, images))}"]
    keys = (f"left={left}", f"right={right}", f"base={base.tolist()}", "principal_distance=153")
    found = asked(capsys, tmp_path / "pair.csv", "intersection", lines, "angles=alpha-omega-kappa", *keys)
    assert [found["points"][0][axis] for axis in "xyz"] == pytest.approx(point, abs=1e-6)


def test_weights_of_pass_points(tmp_path: Path, capsys: Capture) -> None:
    first = np.array([[1.0, 2.0, 2.0], [2.0, 3.0, 6.0], [4.0, 4.0, 7.0]])  # 3, 7 and 9 from the centre
    second = first / np.array([[1.5], [1.2], [3.0]])
    factor, departures = steps.scale_transfer(first, second, [1.0, 3.0, 0.0])
    assert factor == pytest.approx((1.5 + 3 * 1.2) / 4)
    assert departures == pytest.approx(np.array([1.5, 1.2, 3.0]) / factor - 1)
    lines = ["point,x,y,z,x_next,y_next,z_next,weight"]
    rows = np.hstack([first, second])[:2]
    lines += [f"{n},{','.join(map(repr, row.tolist()))},{n}" for n, row in zip((1, 3), rows, strict=True)]
    document = asked(capsys, tmp_path / "scale.csv", "scale", lines)
    assert values(document)["k"] == pytest.approx(factor)
    for weights in ([1.0, -1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 2.0], [1.0, np.nan, 1.0]):
        with pytest.raises(photostrip.InputError, match="3 weights are needed, 0 or more"):
            steps.scale_transfer(first, second, weights)
    (tmp_path / "scale.csv").write_text("\n".join([*lines[:2], lines[2][:-1] + "-3"]), encoding="utf-8")
    assert main(["step", "scale", str(tmp_path / "scale.csv")]) == 2
    assert "scale.csv:3:" in capsys.readouterr().err


def test_the_intermediate_frame_lies_in_its_azimuth(tmp_path: Path, capsys: Capture) -> None:
    """Geodesics of PROJ: a point ahead in the azimuth has X, one to the left Y; heights go into Z."""
    geod, lon, lat, azimuth = pyproj.Geod(ellps="WGS84"), 15.3, 49.2, 75.0
    places = [geod.fwd(lon, lat, azimuth + turn, 500.0)[:2] for turn in (0.0, 180.0, -90.0, 90.0)]
    lines = ["point,longitude,latitude,height"]
    lines += [f"{name},{x!r},{y!r},{z}" for name, (x, y), z in zip("abcd", places, (300, 300, 310, 310), strict=True)]
    document = asked(capsys, tmp_path / "frame.csv", "frame", lines, f"azimuth={azimuth}")
    found = np.array([[row[axis] for axis in "XYZ"] for row in document["points"]])
    expected = [[500.0, 0.0, -5.0], [-500.0, 0.0, -5.0], [0.0, 500.0, 5.0], [0.0, -500.0, 5.0]]
    assert found == pytest.approx(np.array(expected), abs=0.03)  # 500 m and 300 m up: 1 + 300/R
    geocentric = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978").transform(
        *np.array([(y, x, z) for (x, y), z in zip(places, (300, 300, 310, 310), strict=True)]).T
    )
    back = document["trace_points"]
    assert np.array([[row[f"{axis}_G"] for axis in "XYZ"] for row in back]) == pytest.approx(
        np.transpose(geocentric), abs=1e-4
    )
    assert np.array([[row["longitude"], row["latitude"]] for row in back]) == pytest.approx(np.array(places), abs=1e-9)


def test_the_earth_falls_away() -> None:
    radius, reach = 6_371_000.0, 10_000.0
    found = steps.curvature([[0.0, 0.0, 5.0], [6_000.0, 8_000.0, 0.0]], radius=radius, origin=[0.0, 0.0])
    assert found == pytest.approx([0.0, radius - np.sqrt(radius**2 - reach**2)], rel=1e-5)
    assert steps.curvature([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0]], radius=100.0) == pytest.approx([50.0, 50.0])


def test_scales_of_pairs(tmp_path: Path, capsys: Capture) -> None:
    model = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, 12.0]])
    ground = 7.0 * model
    ground[2, 2] += 1.3
    found = steps.pair_scales(model, ground)
    assert found.source == pytest.approx([5.0, 12.0, 13.0])
    assert found.mean == pytest.approx(found.target.sum() / 30.0)
    lines = ["point,x,y,z,x_ground,y_ground,z_ground"]
    lines += [f"{n},{','.join(map(repr, row.tolist()))}" for n, row in enumerate(np.hstack([model, ground]))]
    document = asked(capsys, tmp_path / "pairs.csv", "pair-scales", lines)
    assert values(document)["r"] == pytest.approx(found.mean)
    assert values(document)["r"] * values(document)["t"] == pytest.approx(
        steps.absolute(model, ground).similarity.scale
    )
    with pytest.raises(photostrip.InputError, match="two points are needed"):
        steps.pair_scales(model[:1], ground[:1])


def test_the_closed_form_is_what_a_fit_leaves(tmp_path: Path, capsys: Capture) -> None:
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
    (tmp_path / "control.csv").write_text(
        "\n".join(["point,x,y", *(f"{n},{x},{y}" for n, (x, y) in enumerate(control))]), encoding="utf-8"
    )
    lines = ["point,x,y", *(f"{n},{x},{y}" for n, (x, y) in enumerate(points))]
    keys = f"control={tmp_path / 'control.csv'}", f"base={base}", f"principal_distance={focal}"
    document = asked(capsys, tmp_path / "points.csv", "closed-form", lines, *keys)
    told = [[row[name] for name in ("dbz", "dkappa", "dalpha", "domega")] for row in document["points"]]
    assert np.array(told).reshape(expected.shape) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert values(document)["c1"] == pytest.approx(((control - control.mean(axis=0))[:, 0] ** 2).sum())
    with pytest.raises(photostrip.GeometryError, match="control on one line"):
        steps.closed_form(points, [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], focal, base)


def test_twist_and_bending_of_a_model(tmp_path: Path, capsys: Capture) -> None:
    xy = np.array([[x, y] for x in (0.0, 46.0, 92.0) for y in (-92.0, 0.0, 92.0)])
    x, y = xy.T
    surface = 0.05 - 1e-3 * x + 5e-4 * y - 6e-6 * x * y + 4e-6 * x**2
    noise = np.random.default_rng(5).normal(0, 0.01, 9)
    found = steps.deformation(xy, surface + noise)
    assert found.coefficients[3:] == pytest.approx([-6e-6, 4e-6], abs=4 * found.sigmas[3:].max())
    lines = ["point,x,y,dz", *(f"{n},{a},{b},{c}" for n, (a, b, c) in enumerate(zip(x, y, surface, strict=True)))]
    keys = "base=92", "scale=10000", "sigma=0.05"
    told = values(asked(capsys, tmp_path / "model.csv", "deformation", lines, *keys))
    assert told["C"] == pytest.approx(-6e-6)
    assert told["domega2'"] == pytest.approx(np.degrees(6e-6 * 1000 * 92 / 10000))
    assert told["dalpha2' - dalpha1'"] == pytest.approx(np.degrees(-4e-6 * 1000 * 92 / 10000))
    six = xy[x != 46.0]
    with pytest.raises(photostrip.GeometryError, match="do not determine twist and bending"):
        steps.deformation(six, np.zeros(6))
