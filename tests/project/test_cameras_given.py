"""Measured camera positions and given orientations: what is read of them, and every way to get them wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.project.samples import FILES, PROJECT, Sample, sample

if TYPE_CHECKING:
    from pathlib import Path

GNSS = """\
photo,x,y,z,use,time,sx,sy,sz
1001,4650000.5,500000.25,2012.125,,10.5,0.1,0.2,0.3
1002,4650000.75,500900.5,2013.5,xy,12.5,,,
2001,4651500,500000,,xy,20,,,
2002,,,2014,z,22,,,
"""
POSITIONS = """\
camera_positions:
  file: gnss.csv
  crs: EPSG:32633
  axes: [north, east, up]
  sigma: [0.05, 0.06, 0.08]
  lever_arm: [0.1, -0.2, 1.5]
  correction: drift
"""
IMU = """\
photo,x,y,z,omega,phi,kappa,sx,sy,sz,s_omega
1001,500000.25,4650000.5,2012.125,1,-2,100,0.1,0.2,0.3,0.01
2002,500900,4651500,2014,0.5,0.25,-100,,,,
"""
ORIENTATIONS = """\
orientations:
  file: imu.csv
  crs: EPSG:32633
  axes: [east, north, up]
  angles: {system: omega-phi-kappa, unit: gon}
  sigma: [0.05, 0.06, 0.08]
  sigma_angles: [0.02, 0.02, 0.04]
"""
BUNDLE = "processing:\n  adjustment: bundle\n"
Y, G, I = "project.yaml", "gnss.csv", "imu.csv"  # noqa: E741


def given(folder: Path) -> Sample:
    text = PROJECT.replace("processing:\n", BUNDLE).replace("output:\n", f"{POSITIONS}{ORIENTATIONS}output:\n")
    return sample(folder, {**FILES, Y: text, G: GNSS, I: IMU})


def test_positions_come_in_the_internal_order(tmp_path: Path) -> None:
    found = given(tmp_path).load().inputs.positions
    assert found is not None
    assert found.photos == ("1001", "1002", "2001", "2002")
    assert found.enu[0].tolist() == [500000.25, 4650000.5, 2012.125]  # the list has north first
    assert found.sigma[0].tolist() == [0.2, 0.1, 0.3]
    assert found.sigma[1].tolist() == [0.06, 0.05, 0.08]
    assert found.use.tolist() == [[True] * 3, [True, True, False], [True, True, False], [False, False, True]]
    assert found.time.tolist() == [10.5, 12.5, 20, 22]
    assert (found.lever_arm, found.correction) == ((0.1, -0.2, 1.5), "drift")


def test_orientations_come_in_radians(tmp_path: Path) -> None:
    found = given(tmp_path).load().inputs.orientations
    assert found is not None
    assert (found.photos, found.system, found.observed) == (("1001", "2002"), "omega-phi-kappa", True)
    assert found.angles.shape == (2, 3)
    np.testing.assert_allclose(found.angles * 200 / np.pi, np.array([[1, -2, 100], [0.5, 0.25, -100]]), rtol=1e-12)
    assert found.sigma_turns.shape == (2, 3)
    np.testing.assert_allclose(found.sigma, [[0.1, 0.2, 0.3], [0.05, 0.06, 0.08]], rtol=1e-12)


def test_the_resolved_project_reads_as_the_same(tmp_path: Path) -> None:
    first = given(tmp_path).load()
    (tmp_path / Y).write_text(first.resolved, encoding="utf-8")
    again = Sample(tmp_path).load()
    assert again.resolved == first.resolved
    assert again.settings == first.settings


def test_approximate_orientations_need_no_standard_deviations(tmp_path: Path) -> None:
    project = given(tmp_path)
    project.change(Y, "  sigma: [0.05, 0.06, 0.08]\n  sigma_angles: [0.02, 0.02, 0.04]\n", "  role: approximate\n")
    found = project.load().inputs.orientations
    assert found is not None
    assert not found.observed


def test_the_strip_method_says_that_it_uses_none(tmp_path: Path) -> None:
    project = given(tmp_path)
    project.change(Y, "adjustment: bundle", "adjustment: polynomial")
    told = [note for note in project.load().hints if note.code == "cameras-not-used"]
    assert [note.key for note in told] == ["camera_positions", "orientations"]


def test_a_bundle_does_without_control_and_takes_single_photos(tmp_path: Path) -> None:
    project = given(tmp_path)
    text = (tmp_path / Y).read_text(encoding="utf-8")
    start, end = text.index("control:"), text.index("camera_positions:")
    project.write(Y, text[:start] + text[end:].replace("[2001, 2002]", "[2001]"))
    project.change(Y, "    photos: [2001, 2002]", "    photos: [2001]")
    loaded = project.load()
    assert (len(loaded.inputs.control), loaded.inputs.frames) == (0, ())
    assert loaded.inputs.output is not None
    assert loaded.inputs.output.axes == ("north", "east", "up")


def test_self_calibration_of_each_camera(tmp_path: Path) -> None:
    project = given(tmp_path)
    project.change(Y, "  adjustment: bundle\n", "  adjustment: bundle\n  self_calibration: [k1, p1]\n")
    assert [strip.calibrate for strip in project.load().inputs.strips] == [("k1", "p1")] * 2
    project.change(Y, "    format:", "    self_calibration: [principal_distance]\n    format:")
    assert [strip.calibrate for strip in project.load().inputs.strips] == [("principal_distance",)] * 2


WRONG = [
    (G, "1002,4650000.75", "1001,4650000.75", "gnss.csv:3:1: photo:", "photo 1001 is already given, in line 2"),
    (G, "4650000.75,500900.5", ",500900.5", "gnss.csv:3:6: x:", "photo 1002 has no x, but its use is xy"),
    (G, "0.1,0.2,0.3", "0.1,0,0.3", "gnss.csv:2:45: sy:", "larger than 0"),
    (G, "photo,x", "photo,X_m", "gnss.csv:1", "x"),
    (G, ",xy,12.5", ",yx,12.5", "gnss.csv:3", "xyz, xy, z, off"),
    (Y, "  sigma: [0.05, 0.06, 0.08]\n  lever", "  lever", "gnss.csv:3", "camera_positions.sigma"),
    (Y, "file: gnss.csv", "file: gns.csv", "project.yaml:28:9: camera_positions.file:", "gns.csv"),
    (Y, "correction: drift", "correction: drfit", "project.yaml:33:15:", "did you mean `drift`?"),
    (Y, "lever_arm: [0.1, -0.2, 1.5]", "lever_arm: [0.1, -0.2]", "project.yaml:32:14:", "3 values"),
    (Y, "axes: [north, east, up]", "axes: [north, up]", "project.yaml:30:9:", "permutation"),
    (Y, "  axes: [north, east, up]\n", "", "project.yaml:28:3: camera_positions.axes:", "which of the columns"),
    (Y, "lever_arm:", "lever_am:", "project.yaml:32:3:", "did you mean `lever_arm`?"),
    (Y, "crs: EPSG:32633\n  axes: [north", "crs: local\n  axes: [north", "project.yaml:29:8:", "nobody knows where"),
    (I, "omega,phi,kappa,sx", "alpha,phi,kappa,sx", "imu.csv:1", "omega"),
    (I, "1001,500000.25", "2002,500000.25", "imu.csv:3:1: photo:", "already given"),
    (I, ",-100,", ",,", "imu.csv:3", "kappa"),
    (Y, "  sigma_angles: [0.02, 0.02, 0.04]\n", "", "imu.csv:2", "orientations.sigma_angles"),
    (Y, "system: omega-phi-kappa, unit: gon}\n  s", "system: opk, unit: gon}\n  s", "project.yaml:38:20:", "opk"),
    (Y, "adjustment: bundle", "self_calibration: [k4]", "project.yaml:44:", "`k4` is not known"),
    (Y, "adjustment: bundle", "self_calibration: nevr", "project.yaml:44:", "did you mean `never`?"),
    (Y, "adjustment: bundle", "bundle: {self_calibration: [k1]}", "project.yaml:44:", "`processing.self_calibration`"),
    (Y, "adjustment: bundle", "bundle: {calibration_sigma: {k4: 1}}", "project.yaml:44:", "no parameter"),
    (Y, "adjustment: bundle", "bundle: {test: t}", "project.yaml:44:", "tau"),
    (Y, "adjustment: bundle", "bundle: {alpha: 5}", "project.yaml:44:", "between 0 and 1"),
    (Y, "adjustment: bundle", "bundle: {screening: yes}", "project.yaml:44:", "snooping"),
]  # fmt: skip


@pytest.mark.parametrize(("file", "old", "new", "place", "words"), WRONG)
def test_what_is_wrong_is_explained(tmp_path: Path, file: str, old: str, new: str, place: str, words: str) -> None:
    project = given(tmp_path)
    project.change(file, old, new)
    told = [line for line in project.lines() if line.startswith(place) and words in line]
    assert len(told) == 1, "\n".join(project.lines()) or "no fault"


def test_a_table_without_any_photo_of_the_strips(tmp_path: Path) -> None:
    project = given(tmp_path)
    project.write(G, "photo,x,y,z\nDSC_1001,1,2,3\nDSC_1002,1,2,3\n")
    (told,) = project.lines()
    assert "has none of the photos of the strips; its photos are DSC_1001, DSC_1002" in told


def test_single_photos_are_for_bundles_only(tmp_path: Path) -> None:
    project = given(tmp_path)
    project.change(Y, "adjustment: bundle", "adjustment: polynomial")
    project.change(Y, "[2001, 2002]", "[2001]")
    assert any("only one photo" in line and "adjustment: bundle" in line for line in project.lines())
