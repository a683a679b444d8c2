"""``photostrip convert`` of COLMAP models, as a user calls it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import photostrip
from photostrip.cli.main import main
from tests.calls import Capture
from tests.foreign.colmap_models import simulated
from tests.foreign.converting import convert, refused, same_points, with_control
from tests.loops import nonempty

KINDS = ("text", "binary")


@pytest.mark.parametrize(("kind", "crs"), [("text", "local"), ("binary", "EPSG:32633")])
def test_a_block_comes_back_to_the_result_of_the_native_project(tmp_path: Path, kind: str, crs: str) -> None:
    model = simulated(tmp_path / "native", ground={"crs": crs})
    assert convert(model.write(tmp_path / "model", kind), tmp_path / "block", "-q") == 0
    found, known = same_points(with_control(tmp_path / "native", tmp_path / "block"), tmp_path / "native")
    assert found["verdict"]["look_at"] == known["verdict"]["look_at"] == []
    assert any("laid on the control: 1 unit of it is 27.0" in each["message"] for each in found["notes"])


@pytest.mark.parametrize(("kind", "rigs", "cameras"), [("text", 2, 1), ("binary", 1, 2)])
@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("SIMPLE_PINHOLE", [1280.0, 520.0, 380.0]),
        ("PINHOLE", [1280.0, 1275.0, 520.0, 380.0]),
        ("SIMPLE_RADIAL", [1280.0, 520.0, 380.0, 0.05]),
        ("RADIAL", [1280.0, 520.0, 380.0, 0.05, -0.02]),
        ("OPENCV", [1280.0, 1275.0, 520.0, 380.0, 0.05, -0.02, 0.001, -0.002]),
        ("FULL_OPENCV", [1280.0, 1275.0, 520.0, 380.0, 0.05, -0.02, 0.001, -0.002, 0.01, 0.0, 0.0, 0.0]),
    ],
)
def test_what_pycolmap_writes_fits_without_residuals(
    tmp_path: Path, kind: str, rigs: int, cameras: int, model: str, parameters: list[float]
) -> None:
    import pycolmap

    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig, options.num_frames_per_rig = rigs, cameras, 4
    options.num_points3D, options.num_points2D_without_point3D = 40, 5
    options.camera_model_id, options.camera_params = getattr(pycolmap.CameraModelId, model), parameters
    synthetic = pycolmap.synthesize_dataset(options)
    (tmp_path / "model").mkdir()
    (synthetic.write_text if kind == "text" else synthetic.write_binary)(tmp_path / "model")
    assert convert(tmp_path / "model", tmp_path / "block", "-q") == 0
    found = photostrip.run(tmp_path / "block" / "project.yaml").document
    assert found["bundle"]["sigma0"] < 1e-3  # of 0.5 px
    at = {each["id"]: [each[name] for name in "xyz"] for each in found["photos"]}
    for image in nonempty(synthetic.images.values()):
        assert at[image.name] == pytest.approx(image.projection_center(), abs=1e-3)
    assert len(found["points"]) == 40


def test_what_was_understood_is_printed(tmp_path: Path, capsys: Capture) -> None:
    model = simulated(tmp_path / "native")
    assert convert(model.write_text(tmp_path / "model"), tmp_path / "block") == 0
    captured = capsys.readouterr()
    assert "COLMAP model (text): 12 photos of 1 camera, " in captured.out
    assert "5500 x 3667 px, f 3666.67 px, principal point +10.00, -4.83 px from the middle, y up" in captured.out
    assert "standard deviation 0.5 px; a pixel is taken as 1 µm" in captured.out
    assert captured.err.startswith("wrote observations.csv, orientations.csv, project.yaml to")


def test_what_the_files_do_not_carry_is_asked_for_by_name(tmp_path: Path, capsys: Capture) -> None:
    source = simulated(tmp_path / "native").write_text(tmp_path / "model")
    assert main(["convert", str(source), "-o", str(tmp_path / "block")]) == 2
    assert "the files do not say how precise an image coordinate is; give --sigma PX" in capsys.readouterr().err
    assert "--sigma: 0 px is no length" in refused(capsys, source, tmp_path / "block", "--sigma", "0")
    assert "--pixel-size: nan mm is no length" in refused(capsys, source, tmp_path / "block", "--pixel-size", "nan")


def test_nothing_is_overwritten_without_force(tmp_path: Path, capsys: Capture) -> None:
    source = simulated(tmp_path / "native").write_text(tmp_path / "model")
    before = (tmp_path / "native" / "project.yaml").read_bytes()
    assert convert(source, tmp_path / "native") == 2
    assert "already exists and is not overwritten; choose another folder, or use --force" in capsys.readouterr().err
    assert (tmp_path / "native" / "project.yaml").read_bytes() == before
    assert convert(source, tmp_path / "native", "--force", "-q") == 0
    assert (tmp_path / "native" / "project.yaml").read_bytes() != before


IMAGE = "1 1 0 0 0 0 0 9 1 a.jpg"
TEXTS: dict[str, tuple[str, str, str]] = {  # cameras, images, what is told
    "model": ("1 OPENCV_FISHEYE 9 9 9 9 5 5 0 0 0 0", "", "cameras.txt:1: the model OPENCV_FISHEYE has no counterpart"),
    "unknown": ("1 LENS 9 9 9 9 5 5 0 0 0 0", "", "cameras.txt:1: the model LENS has no counterpart"),
    "rational": ("1 FULL_OPENCV 9 9 9 9 5 5 0 0 0 0 0 0.1 0 0", "", "cameras.txt:1: the coefficient k4 of"),
    "folded": ("1 RADIAL 99 99 9 50 50 -1 0.01", "", "cameras.txt:1: camera RADIAL: the distortion has no inverse"),
    "count": ("# c\n1 RADIAL 9 9 9 5 5 0", "", "cameras.txt:2: 4 parameters of the model RADIAL; expected 5: f, cx"),
    "short": ("1 RADIAL 9 9", "", "cameras.txt:1: 4 values in the line"),
    "number": ("1 PINHOLE 9 9 9 9 5 five", "", "cameras.txt:1: `five` is no number of camera 1"),
    "nan": ("1 PINHOLE 9 9 9 9 5 nan", "", "cameras.txt:1: `nan` is no number of camera 1"),
    "focal": ("1 PINHOLE 9 9 9 -9 5 5", "", "cameras.txt:1: width, height and focal length are not above 0"),
    "twice": ("1 PINHOLE 9 9 9 9 5 5\n1 PINHOLE 9 9 9 9 5 5", "", "cameras.txt:2: camera 1 is already given"),
    "id": ("x PINHOLE 9 9 9 9 5 5", "", "cameras.txt:1: `x` is no id of a camera"),
    "image": ("", "1 1 0 0 0 0 0 9 1", "images.txt:1: 9 values in the line"),
    "pose": ("", "1 1 0 0 0 0 inf 9 1 a.jpg\n", "images.txt:1: `inf` is no number of the pose of image 1"),
    "zero": ("", "1 0 0 0 0 0 0 9 1 a.jpg\n", "images.txt:1: the quaternion of its pose is 0"),
    "owner": ("", "1 1 0 0 0 0 0 9 2 a.jpg\n1 1 1\n", "images.txt:1: there is no camera 2"),
    "again": ("", f"{IMAGE}\n\n1{IMAGE[1:]}\n\n", "images.txt:3: image 1 is already given"),
    "names": ("", f"{IMAGE}\n\n2{IMAGE[1:]}\n\n", "images.txt:3: an image called a.jpg is already given"),
    "rays": ("", f"{IMAGE}\n1 2 3 4\n", "images.txt:2: 4 values in the points of image 1"),
    "point": ("", f"{IMAGE}\n1 2 3.5\n", "images.txt:2: an id of a point of image 1 is no id"),
    "far": ("", f"{IMAGE}\n1 1e300 3\n", "images.txt:2: `1e300` is no number of the points of image 1"),
    "nothing": ("", f"{IMAGE}\n1 2 3\n", "images.txt: no point stands on two photos"),
    "comments": ("", "# nothing\n", "images.txt: no point stands on two photos"),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_faults_of_a_text_have_their_line(tmp_path: Path, name: str, capsys: Capture) -> None:
    cameras, images, told = TEXTS[name]
    (tmp_path / "cameras.txt").write_text((cameras or "1 PINHOLE 9 9 9 9 5 5") + "\n", encoding="utf-8")
    (tmp_path / "images.txt").write_text(images or f"{IMAGE}\n\n", encoding="utf-8")
    assert told in refused(capsys, tmp_path, tmp_path / "block")


BYTES: dict[str, tuple[Any, str]] = {  # what is done to the bytes of images.bin, what is told
    "count": (lambda data: struct.pack("<Q", 10**18) + data[8:], f"the head: ends within its {10**18} records"),
    "points": (lambda data: data.replace(b"JPG\0", b"JPG\0" + struct.pack("<Q", 2**62), 1),
               f"image 1 of 12: ends within its {2**62} points"),
    "end": (lambda data: data[:-5], "image 12 of 12: ends within its"),
    "more": (lambda data: data + b"12345", "5 bytes follow the last of its 12 images"),
    "empty": (lambda _: b"", "is empty"),
    "text": (lambda _: b"# Image list\n1 0 0", "the head: ends within its"),
    "name": (lambda data: data.replace(b"JPG\0", b"\xff\xfe\xff\0", 1), "image 1 of 12: its name is not UTF-8 text"),
    "nan": (lambda data: data[:12] + struct.pack("<d", np.nan) + data[20:], "image 1 of 12: its pose holds what is no"),
}  # fmt: skip


@pytest.mark.parametrize("name", BYTES)
def test_faults_of_a_binary_model_have_their_record(tmp_path: Path, name: str, capsys: Capture) -> None:
    change, told = BYTES[name]
    path = simulated(tmp_path / "native").write_binary(tmp_path / "model") / "images.bin"
    path.write_bytes(change(path.read_bytes()))
    assert f"images.bin: {told}" in refused(capsys, tmp_path / "model", tmp_path / "block")
