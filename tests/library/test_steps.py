"""The steps of the method one by one, against truth without noise and against what they are made of."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
import pytest

import photostrip
from photostrip import steps
from photostrip.camera import Camera, Distortion
from photostrip.cli.main import main
from photostrip.geometry.rotation import from_angles

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

F = 153.0
NOISE = {"image": {"sigma_um": 0}, "control": {"noise": [0, 0, 0]}}


class Truth:
    """Three photos of a strip without noise, in a local frame: what is true, and image coordinates to 0.1 nm."""

    def __init__(self) -> None:
        self.simulation = photostrip.simulate({}, flight={"photos": 3}, ground={"crs": "local"}, seed=3, **NOISE)
        truth = self.simulation.truth
        self.points = {each["id"]: np.array([each[axis] for axis in "xyz"]) for each in truth["points"]}
        self.centers = np.array([[each[axis] for axis in "xyz"] for each in truth["photos"]])
        self.rotations = np.array([each["rotation"] for each in truth["photos"]]).reshape(-1, 3, 3)

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
    images = truth.image(0, ids), truth.image(1, ids)
    found = steps.intersection(*images, F, base=base, rotations=(truth.rotations[0], truth.rotations[1]))
    np.testing.assert_allclose(found.xyz + truth.centers[0], truth.xyz(ids), atol=1e-6)
    assert np.abs(found.gap).max() < 1e-6
    images[1][:, 1] += 0.1
    of_left, mean = (
        steps.intersection(*images, F, base=base, rotations=(truth.rotations[0], truth.rotations[1]), left_ray=left_ray)
        for left_ray in (True, False)
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


def test_a_photo_is_found_on_known_points(truth: Truth) -> None:
    ids = truth.common(1)
    found = steps.resection(truth.image(1, ids), truth.xyz(ids), F)
    np.testing.assert_allclose(found.center, truth.centers[1], atol=1e-6)
    np.testing.assert_allclose(found.rotation, truth.rotations[1], atol=1e-9)
    half = steps.resection(truth.image(1, ids), truth.xyz(ids), F, sigma=0.0025)
    np.testing.assert_allclose(half.covariance, found.covariance / 4)


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


# --------------------------------------------------------------------------------------------------- as commands


def table(path: Path, head: str, ids: list[str], *columns: NDArray[np.float64]) -> str:
    """Write a table of points; give its path."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(head.split())
        writer.writerows([name, *row] for name, row in zip(ids, np.column_stack(columns).tolist(), strict=True))
    return str(path)


def values(out: str) -> dict[str, float]:
    return {each["name"]: each["value"] for each in json.loads(out)["values"]}


def test_the_commands_are_the_functions(truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ids = truth.common(0, 1)
    images = truth.image(0, ids), truth.image(1, ids)
    pair = table(tmp_path / "pair.csv", "point x_left y_left x_right y_right", ids, *images)
    assert main(["step", "relative", pair, "-f", "153", "--base", "900", "--unit", "m", "--format", "json"]) == 0
    out = capsys.readouterr().out
    found, expected = values(out), steps.relative(*images, F, base=900.0)
    assert found["kappa2"] == pytest.approx(np.degrees(expected.elements[4]), abs=1e-6)
    assert found["by"] == pytest.approx(900 * expected.base[1])
    turned = from_angles(np.radians([found[name] for name in ("omega", "phi", "kappa")]), "omega-phi-kappa")
    np.testing.assert_allclose(turned, expected.rotation, atol=1e-9)
    np.testing.assert_allclose([row[2:] for row in json.loads(out)["points"]], expected.model, atol=6e-5)

    model = table(
        tmp_path / "control.csv", "point x y z x_ground y_ground z_ground", ids, expected.model, truth.xyz(ids)
    )
    assert main(["step", "absolute", model, "--format", "json"]) == 0
    assert values(capsys.readouterr().out)["scale"] == pytest.approx(
        steps.absolute(expected.model, truth.xyz(ids)).similarity.scale
    )

    photo = table(tmp_path / "photo.csv", "point x y x_ground y_ground z_ground", ids, images[0], truth.xyz(ids))
    assert main(["step", "resection", photo, "-f", "153", "--format", "json"]) == 0
    oriented = values(capsys.readouterr().out)
    assert [oriented[axis] for axis in "xyz"] == pytest.approx(truth.centers[0].tolist(), abs=1e-4)

    marks = table(
        tmp_path / "marks.csv",
        "mark x y x_photo y_photo",
        ["1", "2", "3", "4"],
        np.eye(4)[:, :2] * 100,
        np.eye(4)[:, :2] * 100 + 1,
    )
    assert main(["step", "interior", marks, "--transform", "conformal", "--format", "json"]) == 0
    assert values(capsys.readouterr().out)["x: 1"] == pytest.approx(1.0)

    points = table(tmp_path / "points.csv", "point x y", ids, images[0])
    assert main(["step", "refine", points, "-f", "153", "--principal-point", "0.5,-0.25", "--format", "csv"]) == 0
    rows = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert [float(row["dx"]) for row in rows] == [-500.0] * len(ids)

    base = ",".join(str(each) for each in truth.rotations[0].T @ (truth.centers[1] - truth.centers[0]))
    angles = ",".join(str(found[name]) for name in ("omega", "phi", "kappa"))
    assert (
        main(["step", "intersection", pair, "-f", "153", f"--base={base}", f"--right={angles}", "--format", "json"])
        == 0
    )
    places = np.array([row[1:4] for row in json.loads(capsys.readouterr().out)["points"]])
    np.testing.assert_allclose(places @ truth.rotations[0].T + truth.centers[0], truth.xyz(ids), atol=2e-4)


@pytest.mark.parametrize(
    ("lines", "options", "code", "message"),
    [
        (["point,x_left,y_left", "1,2,3"], [], 2, "pair.csv:1: x_right: there is no column `x_right`"),
        (["point,x_left,y_left,x_right,y_right", "1,1,2,3,4", "1,1,2,3,4"], [], 2, "point 1 stands in line 2 already"),
        (["point,x_left,y_left,x_right,y_right", "1,1,2,nan,4"], [], 2, "pair.csv:2:7: x_right"),
        (["point,x_left,y_left,x_right,y_right", "1,1,2,3,4"], [], 3, "1 common points cannot orient a pair"),
        ([], [], 2, "pair.csv: is empty"),
        (["\0"], [], 2, "it has NUL bytes"),
        (["point,x_left,y_left,x_right,y_right", "1,1,2,3,4"], ["-o", "model.xls"], 2, "no step is written as '.xls'"),
        (["point,x_left,y_left,x_right,y_right", "1,1,2,3,4"], ["--base", "0"], 2, "0"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lines: list[str], options: list[str], code: int, message: str
) -> None:
    (tmp_path / "pair.csv").write_text("\n".join(lines), encoding="utf-8")
    assert main(["step", "relative", str(tmp_path / "pair.csv"), "-f", "153", *options]) == code
    assert message in capsys.readouterr().err


def test_a_missing_table_and_wrong_numbers_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["step", "interior", str(tmp_path / "none.csv")]) == 2
    assert "does not exist" in capsys.readouterr().err
    (tmp_path / "points.csv").write_text("point,x,y\n1,2,3\n", encoding="utf-8")
    assert main(["step", "refine", str(tmp_path / "points.csv"), "-f", "153", "--k", "1,nan,0"]) == 2
    assert "'1,nan,0' is not 3 numbers with commas between them" in capsys.readouterr().err
