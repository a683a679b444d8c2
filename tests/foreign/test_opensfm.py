"""``photostrip convert`` of reconstructions of OpenSfM, as a user calls it."""

from __future__ import annotations

import json
import operator
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import pytest
from pyproj import Transformer

from photostrip.project.check import check_project
from tests.calls import Capture
from tests.foreign.colmap_models import simulated, small_model
from tests.foreign.converting import convert, refused, same_points, with_control
from tests.foreign.opensfm_models import ground_control, reconstruction, tracks, write


def small() -> tuple[dict[str, Any], str]:
    return reconstruction(small_model()), tracks(small_model())


@pytest.mark.parametrize(("version", "packed"), [(0, False), (1, True), (2, False)])
def test_a_block_comes_back_to_the_result_of_the_native_project(tmp_path: Path, version: int, packed: bool) -> None:
    given = simulated(tmp_path / "native")
    source = write(tmp_path / "opensfm", [reconstruction(given)], tracks(given, version), packed=packed)
    assert convert(source, tmp_path / "block", "-q") == 0
    same_points(with_control(tmp_path / "native", tmp_path / "block"), tmp_path / "native")


def test_ground_control_points_come_in_with_their_marks(tmp_path: Path, capsys: Capture) -> None:
    native = tmp_path / "native"
    given = simulated(native, ground={"crs": "EPSG:32633"})
    source = write(tmp_path / "opensfm", [reconstruction(given)], tracks(given))
    control = source / "ground_control_points.json"
    control.write_text(json.dumps(ground_control(native)), encoding="utf-8")
    assert convert(source, tmp_path / "without") == 0
    assert f"none; to take what lies beside: --control {control}" in capsys.readouterr().out
    options = ("--control", str(control), "--control-sigma", "0.01,0.01,0.015")
    assert convert(source, tmp_path / "block", *options) == 0
    assert ", 6 of them check points, 99 marks; EPSG:4979" in capsys.readouterr().out
    to_utm = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True)
    same_points(tmp_path / "block" / "project.yaml", native, to_map=to_utm.transform)


@pytest.mark.parametrize("kind", ["perspective", "simple_radial", "radial"])
def test_other_cameras_keep_their_numbers(tmp_path: Path, kind: str) -> None:
    whole, rays = small()
    focal = {"focal": 0.7} if kind == "perspective" else {"focal_x": 0.7, "focal_y": 0.71, "c_x": 0.01, "c_y": -0.02}
    k = {"k1": 0.01} if kind == "simple_radial" else {"k1": 0.01, "k2": -0.002}
    whole["cameras"]["v2 fc"] = {"projection_type": kind, "width": 5500, "height": 3667, **focal, **k}
    assert convert(write(tmp_path / "opensfm", [whole], rays), tmp_path / "block", "-q") == 0
    assert check_project(tmp_path / "block" / "project.yaml").faults == ()
    text = (tmp_path / "block" / "project.yaml").read_text(encoding="utf-8")
    assert "convention: opensfm" in text
    assert ("focal_length: 0.7\n" if kind == "perspective" else "focal_length: [0.7, 0.71]") in text
    assert ("k2: -0.002" in text) == (kind != "simple_radial")


CAMERA, SHOT = ("cameras", "v2 fc"), ("shots", "DJI 0.JPG")
WRONG: dict[
    str, tuple[tuple[str, ...], dict[str, Any], str]
] = {  # where, what is put there (None: taken out), what is told
    "fisheye": (
        CAMERA,
        {"projection_type": "fisheye"},
        "camera v2 fc: the camera type fisheye has no counterpart; expect",
    ),
    "no width": (CAMERA, {"width": None}, "camera v2 fc width: is missing, or no number"),
    "flat": (CAMERA, {"focal_x": 0}, "camera v2 fc: width, height and focal length are not above 0"),
    "camera": (SHOT, {"camera": "other"}, "shot DJI 0.JPG: there is no camera other"),
    "rotation": (SHOT, {"rotation": [1, 2]}, "shot DJI 0.JPG rotation: is missing, or no list of 3 numbers"),
    "nan": (SHOT, {"translation": [0, float("nan"), 0]}, "NaN in it is no number"),
    "points": ((), {"points": None}, "points: is missing, or no block of names"),
}


def changed(record: dict[str, Any], where: Sequence[str | int], values: dict[str, Any]) -> None:
    """Put values into a part of a document, or take them out."""
    part = reduce(operator.getitem, where, record)
    part.update(values)
    for key in [key for key, value in values.items() if value is None]:
        del part[key]


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_reconstruction_is_refused_with_its_record(tmp_path: Path, capsys: Capture, name: str) -> None:
    whole, rays = small()
    where, values, expected = WRONG[name]
    changed(whole, where, values)
    told = refused(capsys, write(tmp_path / "opensfm", [whole], rays), tmp_path / "block")
    assert (
        f"reconstruction.json: {expected}" in told or f"reconstruction.json: reconstruction 1 of 1 {expected}" in told
    )


def test_what_is_no_source_is_refused_with_what_is_read(tmp_path: Path, capsys: Capture) -> None:
    write(tmp_path / "site" / "opensfm", [small()[0]], small()[1])
    told = refused(capsys, tmp_path / "site", tmp_path / "block")
    assert "is nothing that is read here; expected a folder with cameras.bin or cameras.txt (COLMAP)" in told
    assert f"did you mean `{tmp_path / 'site' / 'opensfm'}`?" in told


POINT, RAY = ("points", 0), ("points", 0, "observations", 0)
SAME = {"id": "G", "position": {"latitude": 49.2, "longitude": 15.3, "altitude": 200.0}, "observations": []}
STRANGERS = [{"shot_id": f"{n}.jpg", "projection": [0.0, 0.0]} for n in range(2)]
CONTROL: dict[str, tuple[tuple[str | int, ...], dict[str, Any], str]] = {
    "twice": ((), {"points": [SAME, SAME]}, "point G is already given"),
    "outside": (
        RAY,
        {"projection": [0.6, 0]},
        "point 1 of 1 observation 1 of 2 projection: the mark lies outside the p",
    ),
    "two marks": (RAY, {"shot_id": "DJI 1.JPG"}, "photo DJI 1.JPG is already given"),
    "strangers": (POINT, {"observations": STRANGERS}, "none of its photos is in the block: 0.jpg, 1.jpg"),
    "no place": (POINT, {"position": None}, "no point has a position"),
    "no id": (POINT, {"id": None}, "point 1 of 1 id: is missing, or no text"),
    "no latitude": (
        (*POINT, "position"),
        {"latitude": None},
        "point 1 of 1 position latitude: is missing, or no number",
    ),
}


@pytest.mark.parametrize("name", CONTROL)
def test_wrong_control_is_refused_with_its_record(tmp_path: Path, capsys: Capture, name: str) -> None:
    source = write(tmp_path / "opensfm", [small()[0]], small()[1])
    rays = [{"shot_id": f"DJI {n}.JPG", "projection": [0.01 * n, 0.02]} for n in range(2)]
    place = {"latitude": 49.2, "longitude": 15.3, "altitude": 200.0}
    given: dict[str, Any] = {"points": [{"id": "G", "position": place, "observations": rays}]}
    where, values, expected = CONTROL[name]
    changed(given, where, values)
    (control := tmp_path / "gcp.json").write_text(json.dumps(given), encoding="utf-8")
    told = refused(capsys, source, tmp_path / "block", "--control", str(control), "--control-sigma", "0.1")
    assert "gcp.json: " in told
    assert expected in told
