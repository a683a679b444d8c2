"""Presets and overrides: whose value counts, and where a fault of it is told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.project.samples import PROJECT, sample

if TYPE_CHECKING:
    from pathlib import Path

PRESET = """\
photostrip: 1
observations: {unit: um, y_axis: down, sigma: 7}
processing:
  refraction: true
  relative: {screening: tau, grubbs_alpha: 0.01}
"""


def test_own_values_win_and_mappings_are_merged(tmp_path: Path) -> None:
    project = sample(tmp_path)
    project.write("preset.yaml", PRESET)
    project.change("project.yaml", "name: sample", "extends: preset.yaml")
    settings = project.load().settings
    assert settings.relative.grubbs_alpha == 0.05
    assert settings.relative.screening == "tau"
    assert settings.refinement.refraction
    assert project.load().inputs.observations.xy[0].tolist() == [10.5, -20.25]


def test_lists_are_replaced(tmp_path: Path) -> None:
    project = sample(tmp_path)
    project.write("base.yaml", "strips:\n  - {id: Z, camera: Z, photos: [7, 8]}\n")
    project.change("project.yaml", "name: sample", "extends: base.yaml")
    assert [strip.id for strip in project.load().inputs.strips] == ["A", "B"]


def test_paths_of_a_preset_are_relative_to_it(tmp_path: Path) -> None:
    project = sample(tmp_path)
    old = PROJECT[PROJECT.index("observations:") : PROJECT.index("control:")]
    project.change("project.yaml", old, "")
    project.change("project.yaml", "name: sample", "extends: shared/base.yaml")
    project.write("shared/base.yaml", old)
    (tmp_path / "observations.csv").rename(tmp_path / "shared" / "observations.csv")
    loaded = project.load()
    assert tmp_path / "shared" / "observations.csv" in loaded.files
    assert 'file: "shared/observations.csv"' in loaded.resolved


def test_faults_of_a_preset_are_told_there(tmp_path: Path) -> None:
    project = sample(tmp_path)
    project.write("shared/base.yaml", "photostrip: 1\nprocessing:\n  refracton: true\n  earth_radius: 0\n")
    project.change("project.yaml", "name: sample", "extends: shared/base.yaml\nnmae: x")
    assert project.lines() == [
        "project.yaml:3:1: nmae: the key `nmae` is not known; did you mean `name`?",
        "shared/base.yaml:3:3: processing.refracton: the key `refracton` is not known; did you mean `refraction`?",
        "shared/base.yaml:4:17: processing.earth_radius: 0 is out of range; expected a number larger than 0",
    ]


def test_syntax_of_a_preset_is_told_there(tmp_path: Path) -> None:
    project = sample(tmp_path)
    project.write("base.yaml", "photostrip: 1\nname: a: b\n")
    project.change("project.yaml", "name: sample", "extends: base.yaml")
    assert [line.partition(" ")[0] for line in project.lines()] == ["base.yaml:2:8:"]


def test_an_empty_preset_is_told_where_it_is_named(tmp_path: Path) -> None:
    project = sample(tmp_path)
    project.write("base.yaml", "")
    project.change("project.yaml", "name: sample", "extends: base.yaml")
    assert project.lines() == ["project.yaml:2:10: extends: base.yaml is empty"]


def test_a_circle_of_presets_is_refused_where_it_closes(tmp_path: Path) -> None:
    project = sample(tmp_path)
    project.write("a.yaml", "extends: b.yaml\n")
    project.write("b.yaml", "photostrip: 1\nextends: ./a.yaml\n")
    project.change("project.yaml", "name: sample", "extends: a.yaml")
    assert project.lines() == ["b.yaml:2:10: extends: a.yaml extends itself; remove one `extends`"]


def test_a_long_chain_of_presets_is_refused(tmp_path: Path) -> None:
    project = sample(tmp_path)
    for number in range(20):
        project.write(f"p{number}.yaml", f"extends: p{number + 1}.yaml\n")
    project.change("project.yaml", "name: sample", "extends: p0.yaml")
    assert "more than 8 files extend each other" in project.lines()[0]


# -------------------------------------------------------------------------------------------------- the command line


@pytest.mark.parametrize(
    ("assignment", "value"),
    [
        ("processing.relative.grubbs_alpha=0.01", 0.01),
        ("processing.relative={grubbs_alpha: 0.02}", 0.02),
        (" processing.relative.grubbs_alpha = 0.03 ", 0.03),
        ('processing."relative".grubbs_alpha=0.04', 0.04),
    ],
)
def test_an_override_counts_before_the_file(tmp_path: Path, assignment: str, value: float) -> None:
    assert sample(tmp_path).load([assignment]).settings.relative.grubbs_alpha == value


def test_the_last_override_counts(tmp_path: Path) -> None:
    loaded = sample(tmp_path).load(["processing.adjustment=similarity", "processing.adjustment=polynomial"])
    assert loaded.settings.adjustment == "polynomial"


def test_overrides_reach_lists_and_names_with_signs(tmp_path: Path) -> None:
    project = sample(tmp_path)
    text = (tmp_path / "project.yaml").read_text(encoding="utf-8").replace("RC30", "RC.30")
    project.write("project.yaml", text)
    changes = ["strips[0].id=0123", "strips.1.id='~'", 'cameras."RC.30".principal_point[1]=0.5', "control[0].crs=local"]
    inputs = project.load(changes).inputs
    assert [strip.id for strip in inputs.strips] == ["0123", "~"]
    assert inputs.strips[0].camera.principal_point == (0.012, 0.5)
    assert inputs.frames[0].crs == "local"


def test_paths_of_overrides_are_relative_to_the_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project = sample(tmp_path / "strip")
    project.write("other.csv", "photo,point,x,y\n1001,Q,1,2\n1002,Q,1,2\n2001,Q,1,2\n2002,Q,1,2\n")
    monkeypatch.chdir(tmp_path)
    assert project.load(["observations.file=other.csv"]).inputs.observations.point_ids == ("Q",)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        (
            "processing.relativ.grubbs_alpha=1",
            "--set: processing.relativ: the key `relativ` is not known; did you mean",
        ),
        ("processing.relative.grubbs_alpha=5", "--set: processing.relative.grubbs_alpha: 5 is out of range"),
        ("processing.relative.grubbs_alpha=", "--set: processing.relative.grubbs_alpha: no value is given"),
        ("processing.adjustment=[a", "--set:1:1: a bracket is not closed"),
        ("processing.adjustment=*x", "--set:1:1: the alias *x"),
        ("nothing", "--set: `nothing` sets nothing; expected key.path=value"),
        ("=5", "--set: `=5` sets nothing"),
        ("a..b=5", "--set: `a..b=5` sets nothing"),
        ("strips[7].id=X", "--set: strips[7].id: there is no element 7 in a list of 2"),
        ("strips[x].id=X", "--set: `strips[x].id=X` sets nothing"),
        ("name.deeper=X", "--set: name.deeper: there is nothing below the value `sample`"),
        ("extends=other.yaml", "--set: `extends` cannot be set"),
        ("observations.file=no.csv", "--set: observations.file: no.csv does not exist"),
        ("name=\udcff", "--set: is not valid Unicode text"),
    ],
)
def test_a_wrong_override_is_told_at_set(tmp_path: Path, assignment: str, words: str) -> None:
    lines = sample(tmp_path).lines([assignment])
    assert len(lines) == 1
    assert lines[0].startswith(words)
