"""Results in scripts: tables with units, covariances, reports and files as the command writes them."""

from __future__ import annotations

import csv
import json
import pickle
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pyproj import Transformer

import photostrip
from photostrip.cli.main import main
from photostrip.report.pictures.result import pictures_of
from photostrip.result.table import plain_of
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Capture

pytestmark = pytest.mark.usefixtures("_adjusted_once")

SAMPLE = ROOT / "sample_data/simulated-20/project.yaml"


@pytest.fixture(scope="module")
def result() -> photostrip.Result:
    return photostrip.run(SAMPLE, output={"angles": {"system": "omega-phi-kappa", "unit": "gon"}})


@pytest.fixture(scope="module")
def bundle() -> photostrip.Result:
    return photostrip.run(SAMPLE, processing={"adjustment": "bundle"})


def test_a_result_says_its_verdict(result: photostrip.Result) -> None:
    assert (result.name, result.status) == ("simulated-20", "good")
    assert repr(result).startswith("<Result simulated-20: GOOD, rms 0.104 m in plan")
    assert result.summary["check"]["plan"]["count"] == 30
    page = result._repr_html_()
    assert "<td>check</td><td>height</td><td>30</td><td>0.138</td>" in page


@pytest.mark.parametrize("name", ["points", "photos", "residuals", "rejected"])
def test_tables_are_those_of_the_files(result: photostrip.Result, name: str) -> None:
    head, *rows = csv.reader(result.files()[f"{name}.csv"].splitlines())
    table = getattr(result, name)
    assert len(table) == len(rows) > 0
    renamed = {"point": "id", "photo": "id"} if name in {"points", "photos"} else {}
    angles = dict(zip(("omega_gon", "phi_gon", "kappa_gon"), ("angle_1", "angle_2", "angle_3"), strict=True))
    renamed |= angles | {f"sigma_{key}": f"sigma_{angle}" for key, angle in angles.items()}
    assert [renamed.get(column, column) for column in head] == list(table.columns)
    for k, column in nonempty(enumerate(table.columns)):
        if table[column].dtype.kind == "f":
            cells = [float(row[k] or "nan") for row in rows]
            np.testing.assert_allclose(cells, table[column], atol=0.006)


@pytest.mark.slow
def test_columns_know_their_unit_and_kind(result: photostrip.Result) -> None:
    found = photostrip.run(SAMPLE, output={"crs": "EPSG:4326", "axes": ["north", "east", "up"]})
    assert [found.points.units[axis] for axis in "xyz"] == ["deg", "deg", "m"]
    units = result.points.units
    assert (units["x"], units["sigma_z"], units["cov_xy"], units["image_rms_um"]) == ("m", "m", "m^2", "um")
    assert (result.photos.units["angle_1"], result.photos.units["z"]) == ("gon", "m")
    assert result.pairs.units["sigmas_kappa1"] == "deg"
    assert result.points.meanings["rays"] == "photos whose ray was used"
    kinds = {name: result.points[name].dtype.kind for name in ("id", "x", "rays")}
    assert kinds == {"id": "O", "x": "f", "rays": "i"}
    assert result.residuals["used"].dtype == bool


def test_rows_are_taken_as_of_an_array(result: photostrip.Result) -> None:
    points = result.points
    assert points[1] == list(points)[1]
    assert points[-1] == list(points)[-1]
    assert list(points[2:5]["id"]) == list(points["id"][2:5])
    assert list(points[points["rays"] > 2]["id"]) == [row["id"] for row in points if row["rays"] > 2]
    assert list(points[[3, 1]]["id"]) == [points["id"][3], points["id"][1]]
    assert (len(points[[]]), points[:0].columns) == (0, points.columns)
    with pytest.raises(IndexError):
        _ = points[len(points)]
    with pytest.raises(KeyError, match="points has no column 'sigma_zz'; did you mean"):
        _ = points["sigma_zz"]
    counts = [len(points.where(role=role)) for role in ("check", ("check", "control"), "none")]
    assert counts == [30, 45, 0]
    assert set(points.where(role="check")["role"]) == {"check"}
    assert len(result.residuals.where(photo="1001", used=True)) == 16


def test_nobody_changes_the_table_of_another(result: photostrip.Result) -> None:
    part = result.points[:4]
    for column in (result.points["x"], part["x"], result.points.where(role="check")["id"]):
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 0
    part.units["x"] = "ft"
    assert result.points.units["x"] == "m"
    again = pickle.loads(pickle.dumps(result))  # noqa: S301 (our own)
    assert (again.document, repr(again.points)) == (result.document, repr(result.points))


def test_columns_without_values_keep_their_kind() -> None:
    found = photostrip.run(SAMPLE, processing={"precision": False, "adjustment": "polynomial"})
    assert np.isnan(found.points["sigma_x"]).all()
    assert np.isnan(found.covariance_of("K07")).all()
    assert "nan" not in found.points._repr_html_()
    nothing = photostrip.Result(found.document).findings
    kinds = {name: nothing[name].dtype.kind for name in ("code", "line", "accepted", "points")}
    assert kinds == {"code": "O", "line": "i", "accepted": "b", "points": "O"}
    assert nothing._repr_html_().endswith("<tbody></tbody></table>")


def test_a_table_shows_itself(result: photostrip.Result) -> None:
    assert repr(result.residuals) == (
        "<residuals: 469 rows; photo, point, vx_um [um], vy_um [um], used, q_um [um], zone, redundancy_x, "
        "redundancy_y, test_x, test_y, detectable_x_um [um], detectable_y_um [um]>"
    )
    page = result.residuals._repr_html_()
    assert page.count("<tr>") == 11
    assert all(text in page for text in ("469 rows, the first 10 shown", "vx_um<br>um"))


def test_a_hostile_id_is_no_markup(result: photostrip.Result) -> None:
    document = plain_of(result.document)
    document["points"]["id"][0] = document["name"] = "<script>"
    edited = photostrip.Result(document)
    assert "<script>" not in edited.points._repr_html_() + edited._repr_html_()


def test_tables_become_data_frames(result: photostrip.Result) -> None:
    pytest.importorskip("pandas")
    frame = result.points.to_pandas()
    assert list(frame.columns) == list(result.points.columns)
    assert frame.attrs["units"]["x"] == "m"
    np.testing.assert_array_equal(frame["x"].to_numpy(), result.points["x"])
    frame.loc[0, "x"] = 0.0  # its own copy
    assert result.points["x"][0] > 0
    assert result.findings.to_pandas().shape == (0, len(result.findings.columns))


def test_points_and_photos_have_a_place_on_a_map(result: photostrip.Result) -> None:
    geopandas = pytest.importorskip("geopandas")
    assert result.crs == "EPSG:32633"
    frame = result.points.where(role="check").to_geopandas()
    assert isinstance(frame, geopandas.GeoDataFrame)
    assert (frame.crs.to_epsg(), frame.attrs["units"]["x"]) == (32633, "m")
    check = result.points.where(role="check")
    for axis in "xyz":
        np.testing.assert_array_equal(getattr(frame.geometry, axis), check[axis])
    assert result.photos.to_geopandas().geometry.has_z.all()
    with pytest.raises(photostrip.InputError, match=r"the table control has no coordinates; take result\.points"):
        result.control.to_geopandas()


def test_their_places_are_east_north_up_whatever_the_frame(result: photostrip.Result) -> None:
    geopandas = pytest.importorskip("geopandas")
    document = plain_of(result.document)
    places = document["points"]
    east, north = result.points["x"], result.points["y"]
    document["frame"]["axes"] = ["north", "east", "up"]
    places["x"], places["y"] = places["y"], places["x"]
    height, places["z"][3] = places["z"][3], None
    found = photostrip.Result(document).points.to_geopandas().geometry
    assert found.isna().tolist() == [row == 3 for row in range(len(found))]
    known = np.arange(len(found)) != 3
    np.testing.assert_array_equal(found[known].x, east[known])
    np.testing.assert_array_equal(found[known].y, north[known])
    places["z"][3] = height
    document["frame"] |= {"crs": "local", "axes": ["east", "north", "up"]}
    assert photostrip.Result(document).points.to_geopandas().crs is None
    there = geopandas.GeoSeries.from_xy(east, north, result.points["z"], crs="EPSG:32633").to_crs("EPSG:4979")
    to_earth = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    for axis, column in zip("xyz", to_earth.transform(there.x, there.y, there.z), strict=True):
        places[axis] = column.tolist()
    document["frame"] |= {"crs": "geocentric", "axes": ["x", "y", "z"], "ellipsoid": [6378137.0, 6356752.314245179]}
    found = photostrip.Result(document).points.to_geopandas()
    assert found.crs.to_epsg() == 4326
    np.testing.assert_allclose(np.array([found.geometry.x, found.geometry.y]), np.array([there.x, there.y]), atol=1e-9)
    np.testing.assert_allclose(found.geometry.z, there.z, atol=1e-4)


def test_a_package_that_is_missing_is_named(result: photostrip.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "geopandas", None)
    message = "needs the package geopandas, which is not installed: pip install geopandas"
    with pytest.raises(ImportError, match=message):
        result.points.to_geopandas()


def test_tables_become_arrow_tables(result: photostrip.Result) -> None:
    pytest.importorskip("pyarrow")
    table = result.points.to_arrow()
    assert table.num_rows == len(result.points)
    assert table.schema.field("x").metadata[b"unit"] == b"m"
    assert table.column("rays").to_pylist() == result.points["rays"].tolist()
    empty = result.points.where(id="none").to_arrow()
    assert empty.schema.types == table.schema.types
    assert str(result.notes.to_arrow().schema.field("message").type) == "string"


def test_covariances_are_those_of_the_table(result: photostrip.Result) -> None:
    ids = ["K07", "1001-4"]
    found = result.covariance_of(ids)
    assert found.shape == (2, 3, 3)
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))
    sigmas = [[row[f"sigma_{axis}"] for axis in "xyz"] for name in ids for row in result.points.where(id=name)]
    np.testing.assert_allclose(np.sqrt(found.diagonal(axis1=1, axis2=2)), sigmas)
    np.testing.assert_array_equal(result.covariance_of("1001-4"), found[1])
    assert (np.linalg.eigvalsh(found) > 0).all()
    with pytest.raises(photostrip.InputError, match="the result has no point X1"):
        result.covariance_of(["K07", "X1"])


@pytest.mark.slow
@pytest.mark.parametrize("crs", ["EPSG:32633", "geocentric"])
def test_joint_covariances_hold_those_of_the_points(crs: str) -> None:
    axes = ["x", "y", "z"] if crs == "geocentric" else ["north", "east", "up"]
    found = photostrip.run(SAMPLE, processing={"adjustment": "bundle"}, output={"crs": crs, "axes": axes})
    ids = ["K07", "1001-4", "K08", "1015-7", "K07"]
    joint = found.covariance_of(ids, joint=True)
    full = joint.reshape(15, 15)
    np.testing.assert_allclose(full, full.T, atol=1e-12)
    own = found.covariance_of(ids)
    for k in range(5):
        np.testing.assert_allclose(joint[k, :, k], own[k], atol=2e-5)
    np.testing.assert_allclose(joint[0], joint[4])
    assert (np.linalg.eigvalsh(full[:12, :12]) > 0).all()
    near = joint[0, :, 0] + joint[2, :, 2] - joint[0, :, 2] - joint[2, :, 0]
    assert np.trace(near) < np.trace(own[0] + own[2])  # neighbours err alike
    np.testing.assert_allclose(found.covariance_of("K08", joint=True), joint[2, :, 2], rtol=1e-9)
    assert found.covariance_of([], joint=True).shape == (0, 3, 0, 3)


def test_the_check_test_of_the_run_is_made_of_the_same_joint_covariances(bundle: photostrip.Result) -> None:
    assert bundle.computed is not None
    assert bundle.computed.precision is not None
    (tested,) = [each for each in bundle.computed.precision.checks if each is not None]
    joint = bundle.covariance_of(tested.ids, joint=True)
    rows = [[n for n, point in enumerate(tested.point) if point == k] for k in range(2)]
    np.testing.assert_allclose(
        tested.covariance[np.ix_(rows[0], rows[1])], joint[0, :, 1][: len(rows[0]), : len(rows[1])], atol=1e-9
    )


def test_where_there_are_no_joint_covariances_it_is_said(result: photostrip.Result, tmp_path: Path) -> None:
    polynomial = photostrip.run(SAMPLE, processing={"adjustment": "polynomial"})
    with pytest.raises(photostrip.InputError, match="only a bundle adjustment keeps joint covariances"):
        polynomial.covariance_of(["K07", "K08"], joint=True)
    result.write(tmp_path)
    with pytest.raises(photostrip.InputError, match="a saved result holds no covariances between points"):
        photostrip.read_result(tmp_path).covariance_of(["K07", "K08"], joint=True)


@pytest.mark.slow
def test_reports_are_those_of_the_command(result: photostrip.Result, tmp_path: Path, capsys: Capture) -> None:
    result.write(tmp_path)
    assert main(["report", str(tmp_path), "--verbose"]) == 0
    assert capsys.readouterr().out == result.report()
    assert result.report("md").startswith("# ")
    assert json.loads(result.report("json")) == plain_of(result.document)
    assert result.report("html").startswith("<!DOCTYPE html>")
    assert "pairs" not in result.report(sections=["verdict"])
    for function in (result.report, result.trace):
        with pytest.raises(ValueError, match="there is no form 'pdf': text, md, "):
            function("pdf")  # type: ignore[arg-type]
    with pytest.raises(photostrip.InputError, match="the report has no section accuracies; expected one of verdict"):
        result.report(sections=["accuracies"])


@pytest.mark.slow
def test_files_are_those_of_the_command(tmp_path: Path) -> None:
    result = photostrip.run(SAMPLE)
    result.write(tmp_path / "library", html=True)
    options = ["-o", str(tmp_path / "command"), "--html", "-q", "--trace", str(tmp_path / "trace.md")]
    assert main(["run", str(SAMPLE), *options]) == 0
    assert result.trace("md") == (tmp_path / "trace.md").read_text(encoding="utf-8")
    names = sorted(path.name for path in (tmp_path / "command").iterdir())
    assert "result.json" in names
    for name in nonempty(names):
        assert (tmp_path / "library" / name).read_bytes() == (tmp_path / "command" / name).read_bytes(), name


def test_a_saved_result_is_read_again(result: photostrip.Result, tmp_path: Path) -> None:
    result.write(tmp_path)
    for path in (tmp_path, tmp_path / "result.json"):
        found = photostrip.read_result(path)
        assert found.document == result.document
        assert found.computed is None
    with pytest.raises(photostrip.InputError, match="a saved result holds no iterations; run the project again"):
        found.trace()
    with pytest.raises(photostrip.InputError, match="does not exist"):
        photostrip.read_result(tmp_path / "none.json")


def test_pictures_are_those_of_the_report(result: photostrip.Result) -> None:
    picture = result.plot.residuals()
    assert picture.file() in {each.file() for each in pictures_of(result.document)}
    assert picture._repr_svg_().startswith("<svg")
    assert {"plan", "precision_height", "check"} <= set(dir(result.plot))
    with pytest.raises(AttributeError, match=r"has no picture 'resdiuals': plan, .*residuals"):
        result.plot.resdiuals()
