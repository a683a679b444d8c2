"""``photostrip convert`` of cameras and markers of Metashape, as a user calls it."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import photostrip
from photostrip.arrays import Floats
from photostrip.geometry.rotation import from_angles
from photostrip.notes import Document
from photostrip.project.check import check_project
from photostrip.result.table import rows_of
from tests.calls import Capture
from tests.foreign.colmap_models import F
from tests.foreign.converting import convert, refused
from tests.foreign.metashape_models import SCALE, UTM, cameras, document, label_of, markers, simulated
from tests.foreign.test_exports import geocentric, grid_axes
from tests.loops import nonempty
from tests.results import rotation

CONTROL = {"layout": "random", "count": 8, "sigma": [0.01, 0.01, 0.015], "check": 25}


def on_earth(truth: Document) -> tuple[Floats, Floats]:
    """Give grid axes and geocentric places of the photos of a simulation in UTM, by pyproj alone."""
    ground = np.array([[photo[axis] for axis in "xyz"] for photo in rows_of(truth["photos"])])
    return grid_axes("EPSG:32633", ground).transpose(0, 2, 1), geocentric("EPSG:32633", ground)


@pytest.fixture
def chunk(tmp_path: Path) -> Path:
    """Write a chunk on the Earth, beside its native project."""
    truth = simulated(tmp_path / "native", control=CONTROL)
    axes, origin = on_earth(truth)
    source = tmp_path / "cameras.xml"
    text = document(cameras(truth, axes, origin), markers(tmp_path / "native", truth), UTM, origin)
    source.write_text(text, encoding="utf-8")
    return source


def run(project: Path) -> dict[str, dict[str, Document]]:
    result = photostrip.run(project)
    return {table: {each["id"]: each for each in result.document[table]} for table in ("points", "photos")}


def test_markers_come_back_to_the_result_of_the_native_project(tmp_path: Path, chunk: Path, capsys: Capture) -> None:
    assert convert(chunk, tmp_path / "block", "--control", str(chunk)) == 0
    said = capsys.readouterr().out
    assert "Metashape cameras: 12 photos of 1 camera, 0 points, 0 rays" in said
    assert "precision of 7  f 0.2, cx 0.1" in re.sub(r" {3,}", "  ", said)
    assert "49 points, 25 of them check points, 354 marks; EPSG:32633, heights taken as ellipsoidal; " in said
    assert "1 photo that is not aligned" in said
    project = tmp_path / "block" / "project.yaml"
    assert check_project(project).faults == ()
    found = run(project)
    native = tmp_path / "native"
    rows = (native / "observations.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    text = "".join([rows[0], *(f"{row}" for row in rows[1:] if row.split(",")[1][0] in "GK")])
    (native / "observations.csv").write_text(text, encoding="utf-8")
    start = (tmp_path / "block" / "orientations.csv").read_text(encoding="utf-8")
    ids = {label_of(each): each for each in (row.partition(",")[0] for row in rows[1:])}
    (native / "orientations.csv").write_text(re.sub(r"flight \d/Фото & (\d+)", r"\1", start), encoding="utf-8")
    read = yaml.safe_load(project.read_text(encoding="utf-8"))
    with (native / "project.yaml").open("a", encoding="utf-8") as file:
        file.write(yaml.safe_dump({"orientations": read["orientations"]}))
    known = run(native / "project.yaml")
    assert len(known["points"]) == 49
    for name in ("x", "y", "z", "sigma_x", "sigma_z"):
        expected = {point: each[name] for point, each in known["points"].items()}
        assert {point: each[name] for point, each in found["points"].items()} == pytest.approx(expected, abs=3e-4)
    for photo in nonempty(found["photos"].values()):
        same = known["photos"][ids[photo["id"]]]
        assert [photo[axis] for axis in "xyz"] == pytest.approx([same[axis] for axis in "xyz"], abs=1e-3)


def test_orientations_are_those_of_the_chunk_on_the_earth(tmp_path: Path, chunk: Path) -> None:
    assert convert(chunk, tmp_path / "block", "-q", "--control", str(chunk)) == 0
    inputs = photostrip.load(tmp_path / "block" / "project.yaml").loaded.inputs
    given = inputs.orientations
    assert given is not None
    assert (given.frame.crs, given.observed) == ("geocentric", False)
    truth = simulated(tmp_path / "again", control=CONTROL)
    axes, places = on_earth(truth)
    order = [given.photos.index(label_of(each["id"])) for each in rows_of(truth["photos"])]
    np.testing.assert_allclose(given.enu[order], places, atol=1e-4)
    expected = axes @ np.array([rotation(each) for each in rows_of(truth["photos"])])
    np.testing.assert_allclose(from_angles(given.angles, given.system)[order], expected, atol=1e-6)
    with (tmp_path / "block" / "orientations.csv").open(encoding="utf-8") as file:
        sigma = {float(row[name]) for row in csv.DictReader(file) for name in ("sx", "sy", "sz")}
    assert sorted(sigma) == pytest.approx([2e-3 * SCALE] * len(sigma))


def small(*changes: tuple[str, str]) -> str:
    """Give two photos, three markers of which one has no reference, and marks."""
    pose = [f"1 0 0 {x} 0 -1 0 0 0 0 -1 0 0 0 0 1" for x in (0, 3)]
    photos = [
        f'<camera id="{n}" sensor_id="7" component_id="0" label="DJI_{n}"><transform>{each}</transform>\n'
        f'<reference x="15.3" y="49.2" z="41{n}" sx="1" sy="1" sz="2" enabled="true"/></camera>'
        for n, each in enumerate(pose)
    ]
    points = [
        '<marker id="0" label="G1"><reference x="15.3" y="49.2" z="312" enabled="true"/></marker>',
        '<marker id="1" label="G2"><reference x="15.301" y="49.2" z="313" sx="1" sy="1" sz="3" enabled="0"/></marker>',
        '<marker id="2" label="point 3"/>',
    ]
    marks = [
        f'<marker marker_id="{m}">\n'
        + "".join(f'<location camera_id="{n}" pinned="true" x="{900 + 100 * n}" y="{800 + m}"/>\n' for n in (0, 1))
        + "</marker>"
        for m in range(3)
    ]
    text = document(photos, (points, marks), 'GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]]', np.zeros((2, 3)))
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def test_what_markers_say_of_themselves(tmp_path: Path, capsys: Capture) -> None:
    loose = '<location camera_id="1" pinned="true" x="1000" y="802"/>'
    (source := tmp_path / "cameras.XML").write_text(small((loose, loose.replace("true", "false"))), encoding="utf-8")
    assert convert(source, tmp_path / "block", "--control", str(source), "--control-sigma", "0.1,0.1,0.2") == 0
    said = capsys.readouterr().out
    assert "1 mark that Metashape placed by itself (not pinned)" in said
    assert "1 point, 1 ray" in said
    assert (tmp_path / "block" / "control.csv").read_text(encoding="utf-8").splitlines() == [
        "point,x,y,z,use,role,sx,sy,sz",
        "G1,15.3,49.2,312.0,xyz,control,0.1,0.1,0.2",
        "G2,15.301,49.2,313.0,xyz,check,1.0,1.0,3.0",
    ]
    assert 'crs: "EPSG:4979"' in (tmp_path / "block" / "project.yaml").read_text(encoding="utf-8")
    rows = (tmp_path / "block" / "observations.csv").read_text(encoding="utf-8").splitlines()
    assert rows[1:4] == ["DJI_0,G1,900.0,800.0", "DJI_1,G1,1000.0,800.0", "DJI_0,G2,900.0,801.0"]


def test_references_of_cameras_are_their_positions(tmp_path: Path, capsys: Capture) -> None:
    source = tmp_path / "cameras.xml"
    off = 'z="411" sx="1" sy="1" sz="2" enabled="true"'
    source.write_text(small((off, off.replace("true", "false"))), encoding="utf-8")
    assert convert(source, tmp_path / "block", "--control", str(source), "--positions", str(source)) == 0
    assert "references of 1 photo in Metashape; EPSG:4979, heights" in capsys.readouterr().out
    assert (tmp_path / "block" / "positions.csv").read_text(encoding="utf-8").splitlines() == [
        "photo,x,y,z,sx,sy,sz",
        "DJI_0,15.3,49.2,410.0,1.0,1.0,2.0",
    ]


MARK = '<location camera_id="1" pinned="true" x="1000" y="800"/>'
CAMERA = 'camera id="1" sensor_id="7"'
WRONG = {
    "document type": (("<document", '<!DOCTYPE d [<!ENTITY e "x">]><document'), ":2: has a document type"),
    "entity": (('label="G1"', 'label="&e;"'), ": is no XML here: undefined entity"),
    "no chunk": (("<chunk", "<chunk></chunk><chunk"), ":2: document: holds 2 chunks"),
    "cut": (("</document>", ""), ": is no XML here: no element found"),
    "fisheye": (
        ('<calibration type="frame" class="adjusted"', '<calibration type="fisheye"'),
        "the camera type fisheye",
    ),
    "k4": (("<cx>10</cx>", "<cx>10</cx><k4>0.1</k4>"), "the coefficient k4 of metashape has no counterpart"),
    "no f": ((f"<f>{F!r}</f>", ""), "has no focal length f in pixels"),
    "f": ((f"<f>{F!r}</f>", "<f>-1</f>"), "width, height and focal length are not above 0"),
    "word": (("<cx>10</cx>", "<cx>ten</cx>"), "cx: cx: `ten` is not a number"),
    "no sensor": ((CAMERA, CAMERA.replace("7", "8")), "camera DJI_1: there is no sensor 8"),
    "camera twice": ((CAMERA, CAMERA.replace("1", "0", 1)), "camera 0 is already given"),
    "label twice": (('label="DJI_1"', 'label="DJI_0"'), "a photo called DJI_0 is already given"),
    "pose": (("1 0 0 3 0 -1", "1 0 0 3 0 -2"), "transform: holds no rotation"),
    "few": (("1 0 0 3 0 -1 0", "1 0 0 3 0 -1"), "holds 15 values; expected 16 numbers"),
    "scale": ((f"<scale>{SCALE}", "<scale>0"), "0 is no scale"),
    "marker": (('marker_id="0"', 'marker_id="9"'), "there is no marker 9"),
    "photo of a mark": ((MARK, MARK.replace('"1"', '"77"', 1)), "there is no camera 77"),
    "outside": ((MARK, MARK.replace("1000", "9000")), "the mark lies outside photo DJI_1, which has 5500 x 3667 px"),
    "twice": ((MARK, MARK + MARK), "the mark of G1 on photo DJI_1 is already given"),
    "pinned": ((MARK, MARK.replace("true", "maybe")), "pinned: `maybe` is neither true nor false"),
    "sigma": (('sx="1" sy="1" sz="3"', 'sx="1" sy="0" sz="3"'), "a standard deviation is not above 0"),
    "no frame": (('GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]]', ""), "nothing says in which frame the markers lie"),
    "no precision": (('name="accuracy_markers"', 'name="other"'), "nothing says how precise the control is"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_is_refused(tmp_path: Path, kind: str, capsys: Capture) -> None:
    change, words = WRONG[kind]
    (source := tmp_path / "cameras.xml").write_text(small(change), encoding="utf-8")
    said = refused(capsys, source, tmp_path / "block", "--control", str(source))
    assert words in said
    assert "cameras.xml" in said
