"""Results as HISTORIX takes them, by the columns of its evaluation and by laspy."""

from __future__ import annotations

import json
import re
import sys
from typing import TYPE_CHECKING

import laspy
import numpy as np
import pytest
from pyproj import CRS
from scipy.spatial.transform import Rotation

from photostrip.cli.main import main
from photostrip.formats.result_json import read_result
from tests.foreign.test_exports import (
    UTM,
    Ran,
    adjusted_image_points,
    geocentric,
    number_in,
    ran,
    refused,
    table,
)
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path

    from photostrip.arrays import Floats
    from tests.foreign.test_exports import Document

FRAMES = {"map": UTM, "geographic": "EPSG:4979", "geocentric": "geocentric"}
NAMES = ("extrinsics.csv", "intrinsics.csv", "sparse_pointcloud.laz")
ANGLES, PLACE = ("omega", "phi", "kappa"), ("lon", "lat", "alt")
FORMAT = (13.2, 8.8)  # mm


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Ran]:
    """One block, in three frames."""
    folder = tmp_path_factory.mktemp("runs")
    found = {"map": ran(folder, ground={"crs": UTM, "center_deg": [13.5, 49.2]})}
    for name in ("geographic", "geocentric"):
        asked = ("--set", f"output.crs={FRAMES[name]}")
        assert main(["run", str(folder / "project" / "project.yaml"), "-o", str(folder / name), "-q", *asked]) == 0
        document = read_result(str(folder / name / "result.json"))
        found[name] = Ran(folder / name, document)
    return found


def projected(camera: Document, opk: Floats, ray: Floats) -> Floats:
    """Give pixels from the corner, y down, by the camera of a submission; ray: in the axes of the angles."""
    x, y, z = (ray @ Rotation.from_euler("XYZ", opk, degrees=True).as_matrix()).T
    x, y = -x / z, y / z
    k1, k2, k3, p1, p2 = (float(camera[name]) for name in ("k1", "k2", "k3", "p1", "p2"))
    square = x**2 + y**2
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    right = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x**2)
    down = y * radial + 2 * p2 * x * y + p1 * (square + 2 * y**2)
    focal, pixel, x0, y0 = (
        float(camera[each]) for each in ("focal_length", "pixel_pitch", "principal_point_x_mm", "principal_point_y_mm")
    )
    width, height = FORMAT
    return np.stack([width / 2 + focal * right + x0, height / 2 + focal * down - y0], axis=-1) / pixel


def level(lon: float, lat: float) -> Floats:
    """Give true east, north and the normal as rows."""
    (sl, sp), (cl, cp) = np.sin(np.radians([lon, lat])), np.cos(np.radians([lon, lat]))
    return np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])


@pytest.mark.parametrize("frame", FRAMES)
def test_a_submission_projects_its_point_cloud_onto_the_adjusted_image_points(
    runs: dict[str, Ran], frame: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By longitude, latitude, height; by a map as far as it is told."""
    capsys.readouterr()
    assert main(["convert", str(runs[frame]), str(tmp_path / NAMES[0])]) == 0
    said = capsys.readouterr().out
    rows, (camera,) = (table(tmp_path / each) for each in NAMES[:2])
    places = np.array(laspy.read(tmp_path / NAMES[2]).xyz)
    true = adjusted_image_points(runs["map"].document)
    row_of = {each["id"]: row for row, each in enumerate(runs["map"].document["points"])}
    away = []
    for row in nonempty(rows):
        mine = {point: place for (photo, point), place in true.items() if photo == row["image_file_name"]}
        some = places[[row_of[each] for each in mine]]
        opk, at = (np.array([float(row[each]) for each in names]) for names in (ANGLES, PLACE))
        if frame == "map":
            ray = some - [float(row[each]) for each in ("x_map", "y_map", "alt")]
        else:
            ray = (geocentric("EPSG:4979", some) - geocentric("EPSG:4979", at[None])) @ level(at[0], at[1]).T
        away.append(np.linalg.norm(projected(camera, opk, ray) - list(mine.values()), axis=1).max())
    assert len(rows) == 12
    if frame == "map":
        assert number_in(said, r"by up to ([\d.]+) px") == pytest.approx(max(away), abs=0.01)
    else:
        assert max(away) < 0.01
        assert "Cartesian" not in said


@pytest.mark.parametrize("frame", FRAMES)
def test_laspy_reads_the_points_and_their_reference_system(runs: dict[str, Ran], frame: str, tmp_path: Path) -> None:
    assert main(["convert", str(runs[frame]), str(tmp_path / NAMES[0]), "-q"]) == 0
    cloud = laspy.read(tmp_path / NAMES[2])
    found = np.array([[each[axis] for axis in "xyz"] for each in runs["map"].document["points"]])
    crs = UTM if frame == "map" else "EPSG:4979"
    assert geocentric(crs, np.array(cloud.xyz)) == pytest.approx(geocentric(UTM, found), abs=2e-3)
    assert cloud.header.parse_crs() == CRS(UTM if frame == "map" else "EPSG:4326")
    assert cloud.header.are_points_compressed
    before = (tmp_path / NAMES[2]).read_bytes()
    assert main(["convert", str(runs[frame]), str(tmp_path / "again_extrinsics.csv"), "-q"]) == 0
    assert (tmp_path / f"again_{NAMES[2]}").read_bytes() == before


def test_what_historix_cannot_take_is_refused(
    runs: dict[str, Ran], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = str(tmp_path / NAMES[0])
    assert "write NAME_extrinsics.csv" in refused(capsys, str(runs["map"]), f"{tmp_path}/a.csv", "--to", "historix")
    assert "longitude and latitude" in refused(capsys, str(ran(tmp_path / "local")), target)
    document = json.loads((runs["map"].folder / "result.json").read_text(encoding="utf-8"))
    for key, column in document["cameras"].items():
        column.append({"id": "other", "single_photos": [document["photos"]["id"][0]]}.get(key, column[0]))
    (tmp_path / "result.json").write_text(json.dumps(document), encoding="utf-8")
    assert "takes one camera, and the photos have" in refused(capsys, str(tmp_path / "result.json"), target)


def test_without_laspy_the_extra_is_named_before_anything_is_computed(
    runs: dict[str, Ran], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "lazrs", None)
    told = refused(capsys, str(runs["map"]), str(tmp_path / NAMES[0]))
    assert "a point cloud (LAZ) needs laspy with lazrs, which are not installed; pip install photostrip[laz]" in told
    project = str(runs["map"].folder.parent / "project" / "project.yaml")
    assert main(["check", project, "--set", "export=[T_extrinsics.csv]"]) == 2
    assert "pip install photostrip[laz]" in re.sub(r"\s+", " ", capsys.readouterr().out)
