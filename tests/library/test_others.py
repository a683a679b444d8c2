"""Comparisons, simulations and plans in scripts."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

import photostrip
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Answer

pytestmark = pytest.mark.usefixtures("_adjusted_once")

FOLDER = ROOT / "sample_data/simulated-20"


@pytest.mark.slow
def test_a_result_against_its_baseline() -> None:
    result = photostrip.run(FOLDER / "project.yaml")
    same = photostrip.compare(result, FOLDER / "baseline.json")
    assert same.same
    assert repr(same).startswith("<Comparison: SAME: ")
    other = photostrip.compare(photostrip.run(FOLDER / "project.yaml", processing={"adjustment": "polynomial"}), result)
    assert not other.same
    assert {each["kind"] for each in other.differences} >= {"plan", "height", "rotation"}
    assert "DIFFERENT" in other.report()
    loose = photostrip.compare(result, FOLDER / "baseline.json", tolerances=ROOT / "configs/tolerances/exact.yaml")
    assert loose.same


def test_results_are_compared_as_mappings() -> None:
    file = FOLDER / "baseline.json"
    result, baseline = photostrip.read_result(file), json.loads(file.read_text(encoding="utf-8"))
    said = repr(photostrip.compare(result, baseline))
    assert said.endswith("of simulated-20 and the baseline agree within the tolerances.>")
    assert photostrip.compare(baseline, result).same
    with pytest.raises(photostrip.InputError, match=r"^the baseline: has no key `photostrip_result`"):
        photostrip.compare(result, {"points": []})
    message = "compared with the baseline: the CRS is EPSG:32633; expected local"
    with pytest.raises(photostrip.InputError, match=message):
        photostrip.compare(result, {**baseline, "frame": {**baseline["frame"], "crs": "local"}})


@pytest.mark.slow
def test_a_simulation_needs_no_files(tmp_path: Path) -> None:
    simulation = photostrip.simulate(
        {}, flight={"photos": 6}, gross_errors=[{"kind": "control", "point": "G05", "axis": "z", "size_m": 3.0}]
    )
    result = simulation.project.run()
    against = photostrip.compare(result, simulation.truth)
    assert against.document["errors"]["planted"] == 1
    assert "1 of 1 gross error found" in repr(against)
    simulation.write(tmp_path)
    assert photostrip.run(tmp_path / "project.yaml").document == result.document
    assert photostrip.compare(result, tmp_path / "truth.json").document["points"] == against.document["points"]
    with pytest.raises(photostrip.InputError, match=r"^override: flight.photos"):
        photostrip.simulate({}, flight={"photos": -1})
    with pytest.raises(photostrip.InputError, match=r"^specification: flight.photos"):
        photostrip.simulate({"flight": {"photos": -1}})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "overrides", "keys"),
    [
        ("model", {"control": {"layout": "six"}}, ["control={layout: six}"]),
        ("strip", {"models": 8}, ["models=8"]),
        ("displacement", {"camera": "UMK 10/1318", "base": 30, "distances": [50]},
         ["camera=UMK 10/1318", "base=30", "distances=[50]"]),
        ("screening", {"repetitions": 1, "methods": ["auto"]}, ["repetitions=1", "methods=[auto]"]),
    ],
)  # fmt: skip
def test_plans_are_those_of_the_command(
    kind: photostrip.planning.PlanKind, overrides: dict[str, Any], keys: list[str], answer: Answer
) -> None:
    found = photostrip.plan(kind, **overrides)
    options = [f"--set={key}" for key in keys]
    assert json.loads(answer("plan", kind, *options, "--format", "json")) == found.document
    assert answer("plan", kind, *options, "--format", "md") == found.report("md")


def test_a_plan_of_cameras_from_a_mapping() -> None:
    cameras = {"wide": {"principal_distance": 152, "format": [230, 230], "image_sigma_um": 5}}
    plan = {"cameras": {**cameras, "normal": {**cameras["wide"], "principal_distance": 300}}}
    assert "wide" in repr(photostrip.plan("camera", plan))
    plan_of_model = photostrip.plan("model", {"end_lap_percent": 70})
    assert plan_of_model.document == photostrip.plan("model", end_lap_percent=70).document
    with pytest.raises(photostrip.InputError, match="no cameras are given"):
        photostrip.plan("camera")
    with pytest.raises(ValueError, match="there is no plan 'block'"):
        photostrip.plan("block")  # type: ignore[arg-type]
