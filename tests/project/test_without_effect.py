"""Keys that do nothing as the others stand are told with what would make them count, and do nothing indeed."""

from pathlib import Path
from typing import Any

import pytest

import photostrip
from photostrip.cli.main import main
from photostrip.project.hints import CONDITIONS
from photostrip.project.resolved import OF_MODELS, OF_PHOTOS
from tests.loops import nonempty
from tests.results import spec, write_project
from tests.source_tree import ROOT

CODE = "without-effect"
# a key with a value that is not its default, and other keys that make it count, by what the program says of it
CASES: list[tuple[str, object, dict[str, Any]]] = [
    ("relative.grubbs_alpha", 0.2, {"relative.screening": "tau"}),
    ("relative.parallax_limit", 0.001, {"relative.screening": "parallax+grubbs"}),
    ("polynomial.degree", "1", {"adjustment": "polynomial"}),
    ("bundle.level", 0.5, {"adjustment": "bundle"}),
    ("self_calibration", ["k1"], {"adjustment": "bundle"}),
    ("earth_radius", 1e6, {"earth_curvature": "model"}),
    ("earth_latitude", 10.0, {"earth_curvature": "model"}),
    ("flying_height", 9000.0, {"refraction": True}),
    ("ground_height", -900.0, {"refraction": True}),
    ("interior.transform", "conformal", {}),
    ("links.alpha", 0.2, {}),
]


def processing(keys: dict[str, Any]) -> dict[str, Any]:
    """Give the block of a project from paths and values."""
    block: dict[str, Any] = {}
    for name, value in keys.items():
        *above, last = name.split(".")
        inner = block
        for each in above:
            inner = inner.setdefault(each, {})
        inner[last] = value
    return block


def told(project: Path, keys: dict[str, Any]) -> dict[str, str]:
    """Give what `check` says of keys without effect, by key."""
    notes = photostrip.check(project, processing=processing(keys)).notes
    return {note.key: note.message for note in notes if note.code == CODE}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_project(tmp_path_factory.mktemp("local"), spec("local"))


@pytest.mark.parametrize(("key", "value", "cure"), CASES, ids=lambda case: case if isinstance(case, str) else "")
def test_a_key_without_effect_is_told_with_what_would_make_it_count(
    key: str, value: object, cure: dict[str, Any], project: Path
) -> None:
    idle = {"adjustment": "similarity"}
    found = told(project, {**idle, key: value})
    assert list(found) == [f"processing.{key}"]
    message = found[f"processing.{key}"]
    assert message.startswith(f"`processing.{key}` has no effect here: it counts with ")
    assert [name for name, other in cure.items() if not (name in message and str(other).lower() in message)] == []
    assert not cure or told(project, {**idle, key: value, **cure}) == {}
    without, with_it = (
        photostrip.run(project, processing=processing(keys)).document for keys in (idle, {**idle, key: value})
    )
    same = ("points", "photos", "summary", "status")
    assert [with_it[name] for name in same] == [without[name] for name in same]
    assert CODE in [note["code"] for note in with_it["notes"]]


def test_every_condition_is_tried() -> None:
    tried = {name for name, _, _ in CASES}
    for condition in nonempty(CONDITIONS):
        if condition.keys != OF_PHOTOS:
            assert any(each.startswith(condition.keys) for each in tried)
    assert OF_MODELS == ("links",)


def test_it_is_told_where_it_stands_and_in_the_report(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = project.read_text(encoding="utf-8")
    other = project.with_name("other.yaml")
    more = "processing:\n  adjustment: polynomial\n  bundle: {level: 0.05}\n  earth_radius: 6378000\n"
    other.write_text(text + more, encoding="utf-8")
    line = text.count("\n") + 3
    assert main(["check", str(other)]) == 0
    printed = capsys.readouterr().out
    assert f"{other}:{line}:19: processing.bundle.level: " in printed
    assert f"{other}:{line + 1}:17: processing.earth_radius: " in printed
    assert main(["run", str(other)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "`processing.bundle.level` has no effect here: it counts with `processing.adjustment: bundle`" in printed
    assert "1 more like this, processing.earth_radius: --section notes" in printed


def test_presets_and_defaults_are_not_told(project: Path) -> None:
    text = project.read_text(encoding="utf-8")
    other = project.with_name("preset.yaml")
    preset = (ROOT / "configs" / "as-printed.yaml").as_posix()
    screening = "processing: {relative: {screening: auto}}"
    other.write_text(f"extends: {preset}\n{text}{screening}\n", encoding="utf-8")
    assert told(other, {}) == {}
    resolved = project.with_name("resolved.yaml")
    resolved.write_text(photostrip.load(project, processing={"earth_radius": 1e6}).resolved, encoding="utf-8")
    assert list(told(resolved, {})) == ["processing.earth_radius"]
    head, *rows = project.with_name("control.csv").read_text(encoding="utf-8").splitlines()
    lines = [f"{head},sx,sy,sz", *(f"{row},9,9,9" for row in rows)]
    project.with_name("own.csv").write_text("\n".join(lines), encoding="utf-8")
    other.write_text(text.replace("control.csv", "own.csv"), encoding="utf-8")
    assert list(told(other, {})) == ["control[0].sigma"]


@pytest.mark.parametrize("key", ["relative.grubbs_alpha", "scale_transfer"])
def test_models_have_no_use_for_keys_of_photos(key: str, tmp_path: Path) -> None:
    value = {"relative.grubbs_alpha": 0.01, "scale_transfer": "distances"}[key]
    specification = ROOT / "configs" / "simulate" / "independent-models.yaml"
    assert main(["simulate", str(specification), "-o", str(tmp_path), "--quiet"]) == 0
    found = told(tmp_path / "project.yaml", {key: value})
    assert found[f"processing.{key}"].endswith("it counts with `observations` in place of `models`")
