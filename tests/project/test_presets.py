"""The presets in configs/: each completes a project that says nothing but what was measured."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest

from tests.project.samples import FILES, MARKED_FILES, PROJECT, Sample, sample
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

PRESETS = sorted((ROOT / "configs").glob("*.yaml"))
SCALE = {
    "film-archive": 1,
    "film-mapping": 1,
    "digital-frame": 0.01,
    "uav-corridor": 0.01,
    "teaching": 1,
    "as-printed": 1,
}
SIGMA = {"film-archive": 0.010, "film-mapping": 0.005, "digital-frame": 0.003, "uav-corridor": 0.005, "teaching": 0.010}
SIGMA["as-printed"] = SIGMA["teaching"]


def bare(folder: Path, preset: Path, files: dict[str, str]) -> Sample:
    """Write a project that takes everything else from a preset."""
    project = sample(folder, files)
    text = (folder / "project.yaml").read_text(encoding="utf-8")
    text = text.replace("photostrip: 1\n", f"photostrip: 1\nextends: presets/{preset.name}\n")
    text = text.replace("  unit: mm\n  y_axis: up\n  sigma: 0.005\n", "")
    text = text.replace("    format: [230, 230]\n", "    format: [230, 230]\n    pixel_size: 0.01\n")
    project.write("project.yaml", text[: text.index("output:")])
    (folder / "presets").mkdir()
    shutil.copy(preset, folder / "presets")
    return project


@pytest.mark.parametrize("preset", PRESETS, ids=lambda path: path.stem)
def test_a_preset_completes_a_project(tmp_path: Path, preset: Path) -> None:
    loaded = bare(tmp_path, preset, FILES).load()
    assert loaded.hints == ()
    assert loaded.inputs.observations.sigma[0, 0] == pytest.approx(SIGMA[preset.stem], rel=1e-12)
    left, right = loaded.inputs.observations.xy[[0, 2], 0]
    assert left - right == pytest.approx(91.0 * SCALE[preset.stem])


@pytest.mark.parametrize("preset", [p for p in PRESETS if "film" in p.stem], ids=lambda path: path.stem)
def test_film_presets_take_fiducial_marks(tmp_path: Path, preset: Path) -> None:
    assert bare(tmp_path, preset, MARKED_FILES).load().inputs.fiducials is not None


def test_a_standard_deviation_never_takes_its_unit_from_another_file(tmp_path: Path) -> None:
    preset = ROOT / "configs" / "film-mapping.yaml"
    project = bare(tmp_path, preset, FILES)
    project.change("project.yaml", "  file: observations.csv", "  file: observations.csv\n  unit: px\n  y_axis: down")
    message = "sigma stands in presets/film-mapping.yaml, its unit in project.yaml; write both in one file"
    assert project.lines() == [f"presets/film-mapping.yaml:9:10: observations.sigma: {message}"]
    assert project.load(["observations.sigma=0.3"]).inputs.observations.sigma[0, 0] == pytest.approx(0.003)
    assert PROJECT.count("unit: mm") == 1


def test_a_unit_on_the_command_line_needs_its_standard_deviation_there(tmp_path: Path) -> None:
    project = sample(tmp_path)
    assert len(project.lines(["observations.unit=um"])) == 1
    assert project.lines(["observations.unit=um", "observations.sigma=5"]) == []
