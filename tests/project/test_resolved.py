"""The resolved project: nothing left unsaid, the same project, the same text everywhere."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.project.samples import FILES, MARKED_FILES, P, Sample, Y, sample

EXPECTED = """\
# A project of photostrip with all defaults filled in. Paths are relative to the folder of the project file.
photostrip: 1
name: "sample"
cameras:
  "RC30":
    principal_distance: 153.217
    principal_point: [0.012, -0.004]
    format: [230.0, 230.0]
    distortion:
      model: brown
      direction: image_to_ideal
      k: [1.0e-08, 0.0, 0.0]
      p: [0.0, 0.0]
      b: [0.0, 0.0]
      k0: 0.0
strips:
- id: "A"
  camera: "RC30"
  photos: ["1001", "1002"]
- id: "B"
  camera: "RC30"
  photos: ["2001", "2002"]
observations:
  file: "observations.csv"
  separator: comma
  decimal: point
  skip: 0
  unit: mm
  y_axis: up
  origin: center
  sigma: 0.005
control:
- file: "control.csv"
  separator: comma
  decimal: point
  skip: 0
  crs: "EPSG:32633"
  axes: [east, north, up]
  height: ellipsoidal
  sigma: [0.05, 0.06, 0.08]
output:
  crs: "EPSG:32633"
  axes: [east, north, up]
  height: ellipsoidal
  angles:
    system: omega-phi-kappa
    unit: gon
processing:
  adjustment: auto
  polynomial:
    degree: auto
  self_calibration: auto
  bundle:
    screening: snooping
    test: tau
    level: 0.01
    power: 0.8
    variance_components: false
  relative:
    screening: auto
    grubbs_alpha: 0.05
    parallax_limit: auto
  scale_transfer: least_squares
  intersection: mean
  control_weights: stated
  earth_curvature: auto
  earth_radius: 6371000.0
  precision: true
  cross_validation: false
  principal_point: true
  distortion: true
  refraction: false
  flying_height: auto
  ground_height: auto
  interior:
    transform: auto
    residuals: ignore
tolerances:
  check_rms_xy: 0.4
"""

VARIANTS: dict[str, list[tuple[str, str]]] = {
    "plain": [],
    "radial table": [
        ("model: brown, k: [1e-8, 0, 0]", "model: radial-table, radius: [0, 50, 100], distortion: [0, 1e-3, -2e-3]")
    ],
    "geocentric": [
        ("EPSG:32633\n    axes: [east, north, up]", "geocentric"),
        ("height: ellipsoidal", "ellipsoid: {a: 1737400, b: 1737400}"),
    ],
    "pixels": [
        ("format: [230, 230]", "format: [230, 230]\n    pixel_size: 0.006"),
        ("unit: mm\n  y_axis: up", "unit: px\n  y_axis: down"),
    ],
    "orthometric": [("height: ellipsoidal", "height: orthometric\n    geoid_undulation: 44")],
    "output": [("output:", "output:\n  crs: EPSG:4326\n  axes: [north, east, up]")],
    "marks": [],
    "marks of their own": [("{file: fiducials.csv}", "{file: fiducials.csv, unit: um, sigma: 3, y_axis: down}")],
    "no tolerances": [("tolerances: {check_rms_xy: 0.40}", "tolerances: {}")],
}


def test_the_text(tmp_path: Path) -> None:
    assert sample(tmp_path).load().resolved == EXPECTED


@pytest.mark.parametrize("variant", VARIANTS)
def test_it_is_the_same_project(tmp_path: Path, variant: str) -> None:
    files = MARKED_FILES if variant.startswith("marks") else FILES
    first, second = sample(tmp_path / "a", files), sample(tmp_path / "b", files)
    for old, new in VARIANTS[variant]:
        first.change(Y, old, new)
    second.write(Y, first.load().resolved)
    one, two = first.load(), second.load()
    assert (one.settings, one.resolved) == (two.settings, two.resolved)
    for name in ("name", "strips", "frames", "output"):
        assert getattr(one.inputs, name) == getattr(two.inputs, name)
    np.testing.assert_array_equal(one.inputs.control.enu, two.inputs.control.enu)
    for table in ("observations", "fiducials"):
        a, b = getattr(one.inputs, table), getattr(two.inputs, table)
        if a is not None:
            np.testing.assert_array_equal(a.xy, b.xy)
            np.testing.assert_array_equal(a.sigma, b.sigma)


def test_presets_and_overrides_are_in_it(project: Sample) -> None:
    project.write("preset.yaml", "processing: {refraction: true}\n")
    project.change(Y, "name: sample", "extends: preset.yaml")
    resolved = project.load(["processing.relative.grubbs_alpha=1e-7"]).resolved
    assert "extends" not in resolved
    assert "  refraction: true\n" in resolved
    assert "    grubbs_alpha: 1.0e-07\n" in resolved
    assert 'name: "project"\n' in resolved


def test_it_does_not_depend_on_the_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = set()
    for name in ("a", "b"):
        project = sample(tmp_path / name)
        project.change(Y, "file: observations.csv", f"file: {tmp_path / name / 'observations.csv'}")
        texts.add(project.load().resolved)
        monkeypatch.chdir(tmp_path / name)
        texts.add(project.load().resolved)
    assert texts == {EXPECTED}


def test_other_programs_read_the_same_from_it(project: Sample) -> None:
    text = (
        (project.folder / "project.yaml").read_text(encoding="utf-8").replace("RC30", "0123").replace("id: B", "id: NO")
    )
    project.write(Y, text)
    read = yaml.safe_load(project.load().resolved)
    assert list(read["cameras"]) == ["0123"]
    assert [strip["id"] for strip in read["strips"]] == ["A", "NO"]
    assert read["strips"][0]["photos"] == ["1001", "1002"]
    assert read["cameras"]["0123"]["distortion"]["k"] == [1e-8, 0.0, 0.0]
    assert read["processing"]["refraction"] is False


def test_long_lists_of_photos_are_broken_into_lines(project: Sample) -> None:
    names = [f"photo-{number:04d}" for number in range(200)]
    rows = "".join(f"{name},P,1,2\n" for name in names)
    project.change(Y, "[1001, 1002]", f"[{', '.join(names)}]")
    text = (project.folder / "observations.csv").read_text(encoding="utf-8")
    project.write(P, text + rows)
    resolved = project.load().resolved
    assert max(map(len, resolved.splitlines())) <= 110
    assert yaml.safe_load(resolved)["strips"][0]["photos"] == names
