"""Projects in scripts: from files and from memory, with other values of some keys, with their faults."""

from __future__ import annotations

import csv
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml

import photostrip
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("_adjusted_once")

SAMPLE = ROOT / "sample_data/simulated-20/project.yaml"


@pytest.fixture(scope="module")
def simulation() -> photostrip.Simulation:
    return photostrip.simulate({}, flight={"photos": 5}, seed=4)


def columns(text: str) -> dict[str, list[Any]]:
    """Give a CSV table as columns, numbers as numbers."""
    head, *rows = csv.reader(text.splitlines())
    numbers = {"x", "y", "z"}
    return {
        name: [(float(row[k]) if row[k] else None) if name in numbers else row[k] for row in rows]
        for k, name in enumerate(head)
    }


@pytest.fixture
def project(simulation: photostrip.Simulation) -> dict[str, Any]:
    """Give a simulated project as a mapping with its tables."""
    images, given = (columns(simulation.files[f"{file}.csv"]) for file in ("observations", "control"))
    return {
        "name": "memory",
        "cameras": {"film": {"principal_distance": np.float64(153.0), "format": np.array([230.0, 230.0])}},
        "strips": [{"id": "A", "camera": "film", "photos": simulation.truth["photos"]["id"]}],
        "observations": {"file": images, "unit": "mm", "sigma": 0.005},
        "control": [{"file": given, "crs": "EPSG:32633", "axes": ["east", "north", "up"], "sigma": [0.05, 0.05, 0.08]}],
    }


def test_a_project_says_what_it_holds() -> None:
    project = photostrip.load(SAMPLE)
    assert repr(project) == "<Project simulated-20: 1 strip, 20 photos, 469 image points>"
    assert project.photos[:2] == ("1001", "1002")
    assert "degree: auto" in project.resolved
    assert project.files_read(photostrip.Result({}))[0] == SAMPLE


@pytest.mark.slow
def test_overrides_are_those_of_the_command(simulation: photostrip.Simulation) -> None:
    project = simulation.project
    plain = project.run()
    changed = photostrip.run(project, processing={"adjustment": "polynomial", "polynomial": {"degree": 1}})
    assert plain.document["adjustment"] == "bundle"
    assert changed.document["polynomials"][0]["degree"] == 1
    again = project.overridden(**{"processing.adjustment": "similarity"}).overridden(name="other")
    assert (again.run().document["adjustment"], again.name) == ("similarity", "other")


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"processing": {"adjustmnt": "bundle"}}, "override: processing.adjustmnt: the key `adjustmnt` is not known"),
        ({"strips[0].camera": "none"}, "override: strips[0].camera: there is no camera `none`"),
        ({"strips[7].camera": "film"}, "override: strips[7].camera: there is no element 7"),
        ({"strips[0.camera": "film"}, "override: `strips[0.camera` sets nothing; expected a path of keys"),
        ({"name": object()}, "override: name: holds a value that a project file cannot hold"),
    ],
)
def test_a_fault_of_an_override_names_it_as_it_was_written(overrides: dict[str, Any], message: str) -> None:
    with pytest.raises(photostrip.InputError) as refused:
        photostrip.load(SAMPLE, **overrides)
    assert str(refused.value).startswith(message)


def test_a_name_with_a_dot_is_one_key(project: dict[str, Any]) -> None:
    project["cameras"] = {"RC 30.1": project["cameras"]["film"]}
    project["strips"][0]["camera"] = "RC 30.1"
    found = photostrip.load(project, cameras={"RC 30.1": {"principal_distance": 152.9}})
    assert found.loaded.inputs.strips[0].camera.principal_distance == 152.9


@pytest.mark.slow
def test_a_project_in_memory_is_that_of_the_files(simulation: photostrip.Simulation, project: dict[str, Any]) -> None:
    found = photostrip.run(project)
    by_files = photostrip.run(simulation.project)
    assert len(found.points) == len(by_files.points) > 20
    for axis in "xyz":
        np.testing.assert_array_equal(found.points[axis], by_files.points[axis])
    structured = np.array(
        list(zip(*project["observations"]["file"].values(), strict=True)),
        [("photo", "U8"), ("point", "U8"), ("x", float), ("y", float)],
    )
    again = photostrip.run(project, observations=structured)
    assert again.document == found.document


@pytest.mark.slow
def test_data_frames_are_tables(project: dict[str, Any]) -> None:
    pandas, pyarrow = pytest.importorskip("pandas"), pytest.importorskip("pyarrow")
    expected = photostrip.load(project).loaded.inputs.observations
    images = project["observations"].pop("file")
    for table in (pandas.DataFrame(images), pyarrow.table(images)):
        found = photostrip.load(project, observations=table).loaded.inputs.observations
        np.testing.assert_array_equal(found.xy, expected.xy)
        assert found.point_ids == expected.point_ids


@pytest.mark.slow
@pytest.mark.parametrize(
    "specification",
    [
        {"film": {"scale_ppm": 150}},
        {"models": {"scale": 5000}},
        {"flight": {"photos": 5, "strips": 2, "side_lap_percent": 35}, "gnss": {"use": True}},
        {"control": {"second_crs": "EPSG:32634"}, "image": {"unit": "px"}, "camera": {"pixel_size": 0.02}},
    ],
    ids=["fiducial marks", "models", "strips and positions", "two frames, pixels"],
)  # fmt: skip
def test_every_kind_of_input_may_come_from_memory(specification: dict[str, Any]) -> None:
    simulation = photostrip.simulate({"flight": {"photos": 5}} | specification)
    project = yaml.safe_load(simulation.files["project.yaml"])
    tables = {name: columns(text) for name, text in simulation.files.items() if name.endswith(".csv")}
    overrides = {"processing": {"adjustment": "bundle"}} if "gnss" in specification else {}
    found = photostrip.run(filled(project, tables), **overrides).document
    by_files = simulation.project.overridden(**overrides).run().document
    of_memory, of_files = found.pop("certificate"), by_files.pop("certificate")  # which has the bytes of the files
    assert found == by_files
    assert of_memory["result_sha256"] == of_files["result_sha256"]


def filled(value: Any, tables: dict[str, Any]) -> Any:  # noqa: ANN401 (values of a project file)
    """Put tables in place of the names of files."""
    if isinstance(value, dict):
        return {key: tables[each] if key == "file" else filled(each, tables) for key, each in value.items()}
    return [filled(each, tables) for each in value] if isinstance(value, list) else value


def spoilt(value: object) -> Callable[[list[Any]], Any]:
    return lambda column: [*column[:3], value, *column[4:]]


@pytest.mark.parametrize(
    ("column", "change", "message"),
    [
        ("x", spoilt(float("nan")), "observations:5:13: x: no value is given"),
        ("x", lambda column: np.array(spoilt(np.nan)(column)), "observations:5:13: x: no value is given"),
        ("x", lambda column: np.ma.masked_equal(column, column[3]), "observations:5:13: x: no value is given"),
        ("x", spoilt(float("inf")), "observations:5:13: x: `inf` is not a measured value"),
        ("point", spoilt(None), "observations:5:6: point: the point has no id"),
        ("point", spoilt(float("nan")), "observations:5:6: point: the point has no id"),
        ("point", spoilt("\udcff"), "observations: is not valid Unicode text"),
        ("point", lambda column: [*column[:4], column[3], *column[5:]], "is already measured on photo"),
        ("point", lambda column: column[:2], "columns of different shapes"),
    ],
)  # fmt: skip
def test_what_is_not_there_or_twice_is_found_as_in_files(
    project: dict[str, Any], column: str, change: Callable[[list[Any]], Any], message: str
) -> None:
    images = project["observations"]["file"]
    project["observations"]["file"] = images | {column: change(images[column])}
    with pytest.raises(photostrip.InputError, match=re.escape(message)):
        photostrip.load(project)


@pytest.mark.parametrize("table", [None, 7, np.zeros((3, 4))])
def test_what_is_no_table_is_refused(project: dict[str, Any], table: object) -> None:
    project["observations"]["file"] = table
    message = r"observations: (is a \w+, no table|has no columns with names)"
    with pytest.raises(photostrip.InputError, match=message):
        photostrip.load(project)
    if isinstance(table, np.ndarray):
        with pytest.raises(photostrip.InputError, match=message):
            photostrip.load(project | {"observations": {"unit": "mm"}}, observations=table)


def test_texts_may_be_bytes(project: dict[str, Any]) -> None:
    images = project["observations"]["file"]
    expected = photostrip.load(project, observations=images).loaded.inputs.observations.point_ids
    project["observations"]["file"] = images | {"point": np.array(images["point"]).astype("S12")}
    assert photostrip.load(project).loaded.inputs.observations.point_ids == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("observations", "sigma", -1), "project: observations.sigma: -1 is out of range; expected a number larger"),
        (("observations", "file", "pictures"), "project: observations.file: pictures does not exist"),
        (("cameras", "film", object()), "PathLike"),
        (("control", None, None), "project: control:"),
        (("name", None, float("nan")), "a project file cannot hold"),
    ],
)
def test_a_fault_names_its_key(project: dict[str, Any], change: tuple[str, Any, Any], message: str) -> None:
    block, key, value = change
    if key is None:
        project[block] = value
    else:
        project[block][key] = value
    with pytest.raises(photostrip.InputError) as refused:
        photostrip.load(project)
    assert message in str(refused.value)
    assert {fault.line for fault in refused.value.faults} == {0}


def test_a_fault_of_a_table_names_its_row(project: dict[str, Any]) -> None:
    project["observations"]["file"]["x"][3] = "north"
    with pytest.raises(photostrip.InputError, match="observations:5"):
        photostrip.load(project)
    project["observations"]["file"]["x"] = [1.0]
    with pytest.raises(photostrip.InputError, match=r"columns of different shapes: photo \(\d+,\).*x \(1,\)"):
        photostrip.load(project)
    with pytest.raises(photostrip.InputError, match="no columns"):
        photostrip.load({**project, "observations": {"file": {}, "unit": "mm"}})


def test_a_check_raises_nothing(tmp_path: Path) -> None:
    good = photostrip.check(SAMPLE)
    assert good.ok
    assert good.document["counts"]["photos"] == 20
    assert repr(good) == "<Check ok>"
    bad = photostrip.check(tmp_path / "missing.yaml")
    assert not bad.ok
    assert "missing.yaml: does not exist" in repr(bad)
    assert photostrip.check(photostrip.load(SAMPLE), processing={"adjustment": "bundle"}).ok
    mapping = photostrip.check({"name": "x"})
    assert repr(mapping).splitlines()[1].startswith("error: project: strips: `strips` is missing")
    frame = np.array([("1", "2")], [("photo", "U1"), ("point", "U1")])
    with pytest.raises(photostrip.InputError, match="tables in memory go with a project that is a mapping"):
        photostrip.run(SAMPLE, observations=frame)
    with pytest.raises(photostrip.InputError, match="project: control: 2 tables are given for 1 of `control`"):
        photostrip.load({"control": [{"crs": "local"}]}, control=[frame, frame])


def test_a_refused_adjustment_carries_its_findings(project: dict[str, Any]) -> None:
    given = project["control"][0]["file"]
    given["x"] = [-value for value in given["x"]]
    with pytest.raises((photostrip.InputError, photostrip.GeometryError)) as refused:
        photostrip.run(project)
    assert [each.code for each in refused.value.findings] != []
