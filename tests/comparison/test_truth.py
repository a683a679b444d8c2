"""A result against the truth of its simulation: true errors in every frame, and gross errors that were not found."""

from __future__ import annotations

import copy
import json
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj
import pytest
from scipy.stats import chi2

import photostrip
from photostrip.cli.main import main
from photostrip.result.numbers import MATRIX
from photostrip.result.table import rows_of
from tests.loops import nonempty
from tests.results import columns_of, rotation

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from photostrip.arrays import Floats

    Document = dict[str, Any]

pytestmark = pytest.mark.usefixtures("_adjusted_once")

FRAMES: dict[str, Document] = {
    "projected": {},
    "north first": {"crs": "EPSG:32633", "axes": ["north", "east", "up"]},
    "feet": {"crs": "EPSG:2263", "center_deg": [-74.0, 40.7]},
    "geographic": {"crs": "EPSG:4326"},
    "geocentric": {"crs": "EPSG:4978"},
    "local": {"crs": "local"},
}
FOOT = 1200.0 / 3937.0  # of the US survey


@cache
def simulated(frame: str) -> tuple[photostrip.Simulation, photostrip.Result]:
    simulation = photostrip.simulate({}, flight={"photos": 5}, seed=11, ground=FRAMES[frame])
    return simulation, simulation.project.run()


def errors_of(frame: str, now: Floats, true: Floats) -> Floats:
    """Give errors (n, 3) along east, north, up in metres; by way of geocentric coordinates where they are no map."""
    if frame in {"projected", "local"}:
        return now - true
    if frame == "north first":
        return (now - true)[:, [1, 0, 2]]
    if frame == "feet":  # heights of this system are metres
        return (now - true) * (FOOT, FOOT, 1.0)
    to_geodetic = pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
    if frame == "geographic":
        now, true = (
            np.column_stack(to_geodetic.transform(each[:, 0], each[:, 1], each[:, 2], direction="INVERSE"))
            for each in (now, true)
        )
    return (level_axes(true) @ (now - true)[:, :, None])[:, :, 0]


def level_axes(geocentric: Floats) -> Floats:
    """Give east, north, up at geocentric places as rows."""
    to_geodetic = pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
    longitude, latitude, _ = np.radians(to_geodetic.transform(*geocentric.T))
    east = np.column_stack([-np.sin(longitude), np.cos(longitude), 0.0 * longitude])
    up = np.column_stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    return np.stack([east, np.cross(up, east), up], axis=1)


@pytest.mark.parametrize("frame", FRAMES)
def test_true_errors_are_those_of_another_computation(frame: str) -> None:
    simulation, result = simulated(frame)
    found = photostrip.compare(result, simulation.truth).document
    assert [each["role"] for each in found["points"]] == ["new", "check", "control"]
    for table, rows, blocks in (
        (result.points, "points", found["points"]),
        (result.photos, "photos", [found["photos"]]),
    ):
        true = {each["id"]: [each[axis] for axis in "xyz"] for each in rows_of(simulation.truth[rows])}
        for block in blocks:
            part = table.where(role=block["role"]) if "role" in block else table
            now = np.column_stack([part[axis] for axis in "xyz"])
            e = errors_of(frame, now, np.array([true[name] for name in part["id"]]))
            assert block["count"] == len(part) > 0
            for name, sizes in (("plan", np.hypot(e[:, 0], e[:, 1])), ("height", np.abs(e[:, 2]))):
                # result.json has 0.1 mm; the ellipsoid between two points is curved
                assert block[name]["rms"] == pytest.approx(np.sqrt((sizes**2).mean()), abs=2e-4)
                assert block[name]["max"] == pytest.approx(sizes.max(), abs=2e-4)
                assert block[name]["worst"] == part["id"][sizes.argmax()]


def test_angles_between_true_and_found_orientation() -> None:
    simulation, result = simulated("projected")
    truth = copy.deepcopy(simulation.truth)
    by_id = {each["id"]: each for each in rows_of(truth["photos"])}
    turn = np.radians(0.3)
    about = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    for photo in nonempty(result.photos):
        by_id[photo["id"]].update(zip(MATRIX, (about @ rotation(photo)).ravel().tolist(), strict=True))
    truth["photos"] = columns_of(list(by_id.values()))
    found = photostrip.compare(result, truth).document["photos"]["rotation"]
    assert found["rms"] == pytest.approx(0.3, abs=1e-6)
    assert found["max"] == pytest.approx(0.3, abs=1e-6)


@pytest.mark.parametrize("frame", ["projected", "local", "north first", "geocentric"])
def test_errors_over_their_standard_deviations(frame: str) -> None:
    simulation, result = simulated(frame)
    found = photostrip.compare(result, simulation.truth).document
    true = {each["id"]: [each[axis] for axis in "xyz"] for each in rows_of(simulation.truth["points"])}
    order = [1, 0, 2] if frame == "north first" else [0, 1, 2]
    for block in nonempty(found["points"]):
        part = result.points.where(role=block["role"])
        now = np.column_stack([part[axis] for axis in "xyz"])
        then = np.array([true[name] for name in part["id"]])
        e = errors_of(frame, now, then)
        c = result.covariance_of(part["id"].tolist())[:, order][:, :, order]
        if frame == "geocentric":
            axes = level_axes(then)
            c = axes @ c @ axes.transpose(0, 2, 1)
        plan = np.array([one[:2] @ np.linalg.inv(cov[:2, :2]) @ one[:2] for one, cov in zip(e, c, strict=True)])
        height = e[:, 2] ** 2 / c[:, 2, 2]
        for name, squares, number in (("plan", plan, 2), ("height", height, 1)):
            assert block[name]["normalised"] == pytest.approx(np.sqrt(squares.mean() / number), rel=1e-6)
            assert block[name]["inside"] == (squares <= chi2.ppf(0.95, number)).sum()
            assert block[name]["known"] == block["count"]


IMAGE = {"kind": "image", "photo": "1003", "point": "1003-4", "axis": "y", "size_um": 300.0}
CONTROL = {"kind": "control", "point": "G05", "axis": "z", "size_m": 3.0}
SWAP = {"kind": "swap", "photo": "1005", "point": "1005-1"}


@pytest.mark.slow
def test_a_gross_error_is_missed_when_no_rejection_names_it() -> None:
    simulation = photostrip.simulate({}, flight={"photos": 6}, seed=3, gross_errors=[IMAGE, CONTROL, SWAP])
    result = simulation.project.run()
    whole = photostrip.compare(result, simulation.truth)
    assert whole.document["errors"] == {"planted": 3, "missed": [], "sound_rejected": 0}
    document = copy.deepcopy(result.document)
    assert document["rejected"]
    document["rejected"] = document["rejected"].where(photo="none")
    against = photostrip.compare(photostrip.Result(document), simulation.truth)
    assert [each["kind"] for each in against.document["errors"]["missed"]] == ["image", "swap", "control"]
    text = against.report()
    assert "0 of 3 gross errors found" in text
    for line in (
        "not found: image, photo 1003, point 1003-4 in y, 300.0 µm",
        "not found: control, point G05 in z, 3.000 m",
        f"not found: swap, photo 1005, points 1005-1 and {simulation.truth['errors']['other'][1]}",
    ):
        assert line in text
    # a rejection without an error is sound
    truth = copy.deepcopy(simulation.truth)
    truth["errors"] = {key: [] for key in truth["errors"]}
    found = photostrip.compare(result, truth)
    assert found.document["errors"] == {"planted": 0, "missed": [], "sound_rejected": len(result.rejected)}
    assert "no gross errors put in" in found.report()


EDITS: dict[str, tuple[Callable[[Document], object], str]] = {
    "a number without a square": (lambda truth: put(truth, "points", "y", 2, 1e300), "points.y[2]"),
    "no frame": (lambda truth: truth.pop("frame"), "frame"),
    "a list for the frame": (lambda truth: truth.update(frame=[{}]), "frame"),
    "no points": (lambda truth: truth.pop("points"), "points"),
    "no coordinates": (lambda truth: truth["points"].pop("x"), "points.x"),
    "no errors": (lambda truth: truth.update(errors=None), "errors"),
    "a text for a size": (
        lambda truth: truth.update(errors=columns_of([{**IMAGE, "size_um": "x"}])),
        "errors.size_um[0]",
    ),
    "another format": (lambda truth: truth.update(photostrip_truth=1), ""),
}


def put(truth: Document, table: str, column: str, row: int, value: object) -> None:
    truth[table][column][row] = value


@pytest.mark.parametrize("edit", EDITS)
def test_an_edited_truth_is_refused_at_its_key(edit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulation, result = simulated("projected")
    truth = copy.deepcopy(simulation.truth)
    change, key = EDITS[edit]
    change(truth)
    result.write(tmp_path)
    (file := tmp_path / "truth.json").write_text(json.dumps(truth), encoding="utf-8")
    assert main(["compare", str(tmp_path), str(file), "--format", "json"]) == 2
    finding = json.loads(capsys.readouterr().out)["findings"][0]
    assert (finding["file"], finding["key"]) == (str(file), key)
    with pytest.raises(photostrip.InputError):
        photostrip.compare(result, truth)


def test_the_truth_of_another_simulation_is_refused() -> None:
    _, result = simulated("projected")
    other, _ = simulated("geocentric")
    with pytest.raises(photostrip.InputError, match=r"frame\.crs"):
        photostrip.compare(result, other.truth)
    strange = copy.deepcopy(simulated("projected")[0].truth)
    strange["points"]["id"] = [f"{name}x" for name in strange["points"]["id"]]
    with pytest.raises(photostrip.InputError, match="no point is in both"):
        photostrip.compare(result, strange)
