"""Results as files of other programs, each read by a program that knows the form, or by its documented layout."""

from __future__ import annotations

import csv
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import laspy
import numpy as np
import pycolmap
import pyogrio
import pytest
import yaml
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation

import photostrip
from photostrip.arrays import Floats
from photostrip.cli.main import main
from photostrip.formats.result_json import read_result
from tests.calls import Capture
from tests.foreign.colmap_models import SPEC
from tests.loops import nonempty
from tests.results import rotation

Document = dict[str, Any]


UTM = "EPSG:32633"
GROUNDS: dict[str, Document] = {
    "local": {"crs": "local"},
    "map": {"crs": UTM, "center_deg": [13.5, 49.2]},
    "north-first": {"crs": UTM, "axes": ["north", "east", "up"]},
}


class Ran(NamedTuple):
    """A run in a folder."""

    folder: Path
    document: Document

    def __str__(self) -> str:
        return str(self.folder)


def ran(folder: Path, *options: str, **changes: Any) -> Ran:  # noqa: ANN401 (values of a specification)
    """Simulate a block and run it, as a user does."""
    photostrip.simulate({**SPEC, **changes}).write(folder / "project")
    out = folder / "run"
    assert main(["run", str(folder / "project" / "project.yaml"), "-o", str(out), "-q", *options]) == 0
    return Ran(out, read_result(str(out / "result.json")))


@pytest.fixture(scope="module", params=GROUNDS)
def block(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Ran:
    return ran(tmp_path_factory.mktemp("block"), ground=GROUNDS[request.param])


def east_first(document: Document, records: list[Document], names: str = "x y z") -> Floats:
    """Give coordinates as east, north, up."""
    order = [document["frame"]["axes"].index(axis) for axis in ("east", "north", "up")]
    return np.array([[each[name] for name in names.split()] for each in records], float)[:, order]


def refused(capsys: Capture, *arguments: str) -> str:
    """Give what is said of wrong usage."""
    capsys.readouterr()
    assert main(["convert", *arguments]) == 2
    return capsys.readouterr().err


def number_in(text: str, pattern: str) -> float:
    """Give the number that is said in a text."""
    found = re.search(pattern, text)
    assert found is not None, text
    return float(found[1])


def geocentric(crs: str, enu: Floats) -> Floats:
    """Give Cartesian coordinates of points of a map."""
    plane = CRS(crs).to_3d()
    across = Transformer.from_crs(plane, CRS("EPSG:4978"), always_xy=True)
    return np.stack(across.transform(*enu.T.tolist()), axis=-1)


def grid_axes(crs: str, enu: Floats) -> Floats:
    """Give grid east, grid north and the normal at points of a map, as rows, by small steps on the ellipsoid."""
    ground = enu * (1.0, 1.0, 0.0)
    found = []
    for step in ((10.0, 0.0, 0.0), (0.0, 10.0, 0.0)):
        along = geocentric(crs, ground + step) - geocentric(crs, ground - step)
        found.append(along / np.linalg.norm(along, axis=1)[:, None])
    east, north = found
    return np.stack([east, north, np.cross(east, north)], axis=1)


def distorted(x: Floats, y: Floats, k: Sequence[float], p: Sequence[float]) -> tuple[Floats, Floats]:
    """Give places with Brown's distortion as OpenCV writes it, of a principal distance of one."""
    square = x**2 + y**2
    radial = 1 + square * (k[0] + square * (k[1] + square * k[2]))
    right = x * radial + 2 * p[0] * x * y + p[1] * (square + 2 * x**2)
    return right, y * radial + 2 * p[1] * x * y + p[0] * (square + 2 * y**2)


def image(ray: Floats) -> Floats:
    """Give pixels of rays in image axes (x right, y up), by the camera of SPEC in millimetres."""
    camera: Document = dict(SPEC["camera"])
    x, y = (-camera["principal_distance"] * ray[:, :2] / ray[:, 2:]).T
    x, y = distorted(x, y, camera["distortion"]["k"], camera["distortion"]["p"][::-1])  # p1 and p2 as in a project
    (x0, y0), (width, height), size = (camera[each] for each in ("principal_point", "format", "pixel_size"))
    return np.stack([(x + x0 + width / 2) / size, (height / 2 - y - y0) / size], axis=-1)


def adjusted_image_points(document: Document) -> dict[tuple[str, str], Floats]:
    """Project the points of a result onto its photos, in pixels from the corner, y down: the rigorous way."""
    points, photos = document["points"], document["photos"]
    xyz, centers = (east_first(document, each) for each in (points, photos))
    turned = np.array([rotation(each) for each in photos])
    if document["frame"]["crs"] != "local":
        turned = grid_axes(document["frame"]["crs"], centers).transpose(0, 2, 1) @ turned
        xyz, centers = (geocentric(document["frame"]["crs"], each) for each in (xyz, centers))
    row_of = {each["id"]: row for row, each in enumerate(points)}
    found: dict[tuple[str, str], Floats] = {}
    for photo, center, turn in zip(photos, centers, turned, strict=True):
        names = [each for each in document["residuals"].where(photo=photo["id"])["point"] if each in row_of]
        places = image((xyz[[row_of[each] for each in names]] - center) @ turn)
        found |= {(photo["id"], name): place for name, place in zip(names, places, strict=True)}
    return found


def measured_image_points(folder: Path, project: str = "project") -> dict[tuple[str, str], Floats]:
    with (folder / project / "observations.csv").open(encoding="utf-8") as file:
        return {(row["photo"], row["point"]): np.array([row["x"], row["y"]], float) for row in csv.DictReader(file)}


def layer(file: Path, name: str) -> tuple[list[Document], list[Any], Document]:
    """Read a layer by GDAL: attributes, geometries as well-known binary, and what is said of it."""
    meta, _, geometry, columns = pyogrio.raw.read(file, layer=name)
    rows = [dict(zip(meta["fields"], row, strict=True)) for row in zip(*columns, strict=True)]
    return rows, list(geometry), meta | pyogrio.read_info(file, layer=name)


def places(geometry: bytes) -> Floats:
    """Give the coordinates of a geometry in space: they end its well-known binary, behind order, kind and counts."""
    kind = (int.from_bytes(geometry[1:5], "little") & 0xFFFF) % 1000
    return np.frombuffer(geometry[{1: 5, 2: 9, 3: 13}[kind] :], "<f8").reshape(-1, 3)


def on_map(geometry: list[bytes]) -> list[list[float]]:
    found: list[list[float]] = np.concatenate([places(each) for each in geometry]).tolist()
    return found


def test_gdal_reads_every_layer_of_a_geopackage(block: Ran, tmp_path: Path) -> None:
    file, document = tmp_path / "block.gpkg", block.document
    assert main(["convert", str(block), str(file), "-q"]) == 0
    control = [each for each in document["control"] if each["measured"]]
    counts = {
        "points": len(document["points"]),
        "control": sum(each["role"] == "control" for each in control),
        "check": sum(each["role"] == "check" for each in control),
        "photos": 12,
        "footprints": 12,
        "error_vectors": len(control),
        "error_ellipses": len(document["points"]),
    }
    names = [name for name, _ in pyogrio.list_layers(file)]
    assert {name: pyogrio.read_info(file, layer=name)["features"] for name in names} == counts
    rows, geometry, meta = layer(file, "points")
    assert meta["crs"] == UTM if document["frame"]["crs"] == UTM else "undefined cartesian" in meta["crs"].lower()
    assert on_map(geometry) == east_first(document, document["points"]).tolist()
    for row, point in nonempty(list(zip(rows, document["points"], strict=True))):
        assert [row[name] for name in ("id", "role", "rays")] == [point[name] for name in ("id", "role", "rays")]
        axes = document["frame"]["axes"]
        assert [row[f"sigma_{axis}"] for axis in axes] == [point[f"sigma_{name}"] for name in "xyz"]
    rows, _, _ = layer(file, "check")
    found = {row["id"]: (row[f"d_{document['frame']['axes'][0]}"], row["height"]) for row in rows}
    assert found == {each["id"]: (each["dx"], each["height"]) for each in control if each["role"] == "check"}
    rows, geometry, _ = layer(file, "photos")
    assert [row["kappa_deg"] for row in rows] == [each["angle_3"] for each in document["photos"]]
    assert on_map(geometry) == east_first(document, document["photos"]).tolist()


def test_footprints_are_the_corners_of_the_photos_on_the_ground(block: Ran, tmp_path: Path) -> None:
    file, document = tmp_path / "block.gpkg", block.document
    assert main(["convert", str(block), str(file), "-q"]) == 0
    _, geometry, meta = layer(file, "footprints")
    assert meta["geometry_type"] == "Polygon Z"
    heights = east_first(document, document["points"])[:, 2]
    for each, photo in nonempty(list(zip(geometry, document["photos"], strict=True))):
        corners = places(each)
        assert corners[0].tolist() == corners[-1].tolist()
        assert heights.min() - 10 < corners[:, 2].min() < corners[:, 2].max() < heights.max() + 10
        away = corners[:4] - east_first(document, [photo])
        ray = away @ rotation(photo)
        xy = -8.8 * ray[:, :2] / ray[:, 2:] + (0.024, -0.012)
        assert xy == pytest.approx(
            np.array([[-6.6, -4.4], [6.6, -4.4], [6.6, 4.4], [-6.6, 4.4]]), abs=4e-3
        )  # scale of the map


def table(file: Path) -> list[Document]:
    with file.open(encoding="utf-8") as text:
        return list(csv.DictReader(text))


def by_orthority(camera: Document, xyz: Floats, opk: Floats, points: Floats) -> Floats:
    """Project points as orthority does: pixels from the centre of the first one, y down.

    With the coordinates of the map taken for Cartesian, and a camera that is scaled by its side as in OpenSfM.
    """
    turned = Rotation.from_euler("XYZ", opk).as_matrix() * (1.0, -1.0, -1.0)
    x, y = ((points - xyz) @ turned)[:, :2].T / ((points - xyz) @ turned)[:, 2]
    k1, k2, k3, p1, p2 = (camera.get(name, 0.0) for name in ("k1", "k2", "k3", "p1", "p2"))
    xy = np.stack(distorted(x, y, (k1, k2, k3), (p1, p2)), axis=-1)
    size = np.array(camera["im_size"])
    focal = np.array(camera["focal_len"]) * size / camera["sensor_size"]
    return focal * xy + (size - 1) / 2 + size.max() * np.array([camera["cx"], camera["cy"]])


def test_orthority_has_every_orientation_and_the_departure_of_its_map_is_told(
    block: Ran, tmp_path: Path, capsys: Capture
) -> None:
    document = block.document
    capsys.readouterr()
    assert main(["convert", str(block), str(tmp_path / "ori.csv")]) == 0
    said = capsys.readouterr().out
    rows, cameras = table(tmp_path / "ori.csv"), yaml.safe_load((tmp_path / "ori_int_param.yaml").read_text())
    assert list(rows[0]) == ["filename", "x", "y", "z", "omega", "phi", "kappa", "camera"]
    true, xyz = adjusted_image_points(document), east_first(document, document["points"])
    row_of = {each["id"]: row for row, each in enumerate(document["points"])}
    away = []
    for row, photo in nonempty(list(zip(rows, document["photos"], strict=True))):
        assert row["filename"] == photo["id"]
        center, opk = (np.array([float(row[name]) for name in names]) for names in ("xyz", ("omega", "phi", "kappa")))
        mine = {point: place for (name, point), place in true.items() if name == photo["id"]}
        points = xyz[[row_of[each] for each in mine]]
        found = by_orthority(cameras[row["camera"]], center, np.radians(opk), points) + 0.5
        away.append(np.linalg.norm(found - list(mine.values()), axis=1).max())
    if document["frame"]["crs"] == "local":
        assert max(away) < 0.01
        assert not (tmp_path / "ori.prj").exists()
        assert "Cartesian" not in said
    else:
        told = number_in(said, r"by up to ([\d.]+) px")
        assert told == pytest.approx(max(away), abs=0.01)
        assert CRS.from_wkt((tmp_path / "ori.prj").read_text(encoding="utf-8")) == CRS(UTM)


def test_pycolmap_projects_the_points_of_a_model_onto_the_adjusted_image_points(block: Ran, tmp_path: Path) -> None:
    assert main(["convert", str(block), f"{tmp_path / 'model'}/", "-q"]) == 0
    model, document = pycolmap.Reconstruction(tmp_path / "model"), block.document
    true, measured = adjusted_image_points(document), measured_image_points(block.folder.parent)
    assert [each.name for _, each in sorted(model.images.items())] == [each["id"] for each in document["photos"]]
    assert model.num_points3D() == len(document["points"])
    names = {number: each["id"] for number, each in enumerate(document["points"], 1)}
    count = 0
    for each in nonempty(list(model.images.values())):
        for ray in (ray for ray in each.points2D if ray.has_point3D()):
            place = each.project_point(model.points3D[ray.point3D_id].xyz)
            key = each.name, names[ray.point3D_id]
            assert place == pytest.approx(true[key], abs=0.01)
            assert ray.xy == pytest.approx(measured[key], abs=0.01)
            count += 1
    assert count == document["counts"]["image_points_used"]


@pytest.mark.parametrize(
    ("ground", "option"),
    [
        ({"crs": "local"}, "processing.earth_curvature=model"),
        ({"crs": UTM, "height": "orthometric", "geoid_undulation": 4500}, "processing.adjustment=bundle"),
    ],
)
def test_heights_of_a_curved_ground_are_those_of_a_cartesian_frame(
    ground: Document, option: str, tmp_path: Path, capsys: Capture
) -> None:
    flight = {"photos": 5, "strips": 1, "flying_height": 3000}
    found = ran(tmp_path, "--set", option, ground=ground, flight=flight)
    assert main(["convert", str(found), f"{tmp_path / 'model'}/"]) == 0
    assert ("above its tangent plane" in capsys.readouterr().out) == (ground["crs"] == "local")
    assert off_the_measured(found, tmp_path / "model") < 0.01
    model = pycolmap.Reconstruction(tmp_path / "model")
    count = 0
    for each in nonempty(list(model.images.values())):
        residuals = found.document["residuals"].where(photo=each.name)
        for ray, vx, vy in zip(each.points2D, residuals["vx_um"], residuals["vy_um"], strict=True):
            if ray.has_point3D():
                away = ray.xy - each.project_point(model.points3D[ray.point3D_id].xyz)
                assert away == pytest.approx((vx / 2.4, -vy / 2.4), abs=0.06)  # without the change of the distortion
                count += 1
    assert count == found.document["counts"]["image_points_used"]


@pytest.mark.parametrize(
    "changes",
    [
        {"direction": "image_to_ideal", "k": [-2e-4, 1e-7, 0]},
        {"direction": "image_to_ideal", "b": [3e-4, 0]},
        {"model": "radial-table", "radius": [0, 2, 4, 6, 8, 9], "distortion": [0, -0.001, -0.005, -0.02, -0.05, -0.07]},
    ],
)
def test_a_distortion_that_colmap_does_not_know_is_fitted_and_its_departure_told(
    changes: Document, tmp_path: Path, capsys: Capture
) -> None:
    lens = {"model": "brown", "direction": "image_to_ideal", **changes}
    found = ran(tmp_path, camera={**SPEC["camera"], "distortion": lens})
    assert main(["convert", str(found), f"{tmp_path / 'model'}/"]) == 0
    told = number_in(capsys.readouterr().out, r"within ([\d.]+) px")
    assert told < 1.0
    assert off_the_measured(found, tmp_path / "model") < told + 0.01


def test_cameras_go_into_a_project_again_with_their_calibration(tmp_path: Path) -> None:
    photostrip.simulate(SPEC).write(tmp_path)
    project = tmp_path / "project.yaml"
    text = project.read_text(encoding="utf-8")
    wrong = text.replace("principal_point: [0.024, -0.012]", "principal_point: [0.031, -0.02]").replace("-0.0002", "0")
    project.write_text(wrong, encoding="utf-8")
    names = [f"c.{each}.yaml" for each in ("opencv", "colmap", "metashape", "opensfm", "pix4d")] + ["c.yaml"]
    asked = {"processing": {"self_calibration": ["principal_point", "k1"]}}
    calibrated = photostrip.run(project, export=names, **asked)
    calibrated.write(tmp_path / "run")
    block = re.search(r"cameras:\n(?: .*\n)+", wrong)
    assert block is not None
    xyz = np.stack([calibrated.points[axis] for axis in "xyz"], axis=-1)
    for name in nonempty(names):
        cameras = (tmp_path / "run" / name).read_text(encoding="utf-8")
        assert "# camera fc, k1: +0.0002" in cameras
        project.write_text(wrong.replace(block[0], cameras), encoding="utf-8")
        again = photostrip.run(project)
        assert np.stack([again.points[axis] for axis in "xyz"], axis=-1) == pytest.approx(xyz, abs=1e-3), name
        # a calibration leaves residuals in the measured image, a given distortion in the ideal one: 1 % apart here
        assert again.summary["image_rms_um"] == pytest.approx(calibrated.summary["image_rms_um"], abs=0.02)


def off_the_measured(found: Ran, model: Path) -> float:
    """Give the largest distance of the rays of a model from what was measured, in pixels."""
    measured, largest = measured_image_points(found.folder.parent), 0.0
    names = {number: each["id"] for number, each in enumerate(found.document["points"], 1)}
    for each in nonempty(list(pycolmap.Reconstruction(model).images.values())):
        rays = [ray for ray in each.points2D if ray.has_point3D()]
        away = [ray.xy - measured[each.name, names[ray.point3D_id]] for ray in rays]
        largest = max(largest, float(np.linalg.norm(away, axis=1).max()))
    return largest


def by_opensfm(camera: Document, shot: Document, points: Floats) -> Floats:
    """Project points as OpenSfM documents its brown camera, in pixels from the corner of the first one."""
    x, y, z = (Rotation.from_rotvec(shot["rotation"]).apply(points) + shot["translation"]).T
    x, y = x / z, y / z
    u, v = distorted(x, y, [camera[name] for name in ("k1", "k2", "k3")], [camera[name] for name in ("p1", "p2")])
    u, v = camera["focal_x"] * u + camera["c_x"], camera["focal_y"] * v + camera["c_y"]
    width, height = camera["width"], camera["height"]
    return np.stack([u, v], axis=-1) * max(width, height) + [width / 2, height / 2]


def test_opensfm_projects_the_points_of_a_reconstruction_onto_the_adjusted_image_points(
    block: Ran, tmp_path: Path
) -> None:
    document = block.document
    (tmp_path / "sfm").mkdir()
    assert main(["convert", str(block), str(tmp_path / "sfm" / "reconstruction.json"), "-q"]) == 0
    (found,) = json.loads((tmp_path / "sfm" / "reconstruction.json").read_text(encoding="utf-8"))
    true = adjusted_image_points(document)
    assert list(found["shots"]) == [each["id"] for each in document["photos"]]
    assert list(found["points"]) == [each["id"] for each in document["points"]]
    for name, shot in nonempty(found["shots"].items()):
        camera = found["cameras"][shot["camera"]]
        mine = {point: place for (photo, point), place in true.items() if photo == name}
        points = np.array([found["points"][each]["coordinates"] for each in mine])
        assert by_opensfm(camera, shot, points) == pytest.approx(np.array(list(mine.values())), abs=0.01)
    measured = measured_image_points(block.folder.parent)
    rays = [row.split("\t") for row in (tmp_path / "sfm" / "tracks.csv").read_text(encoding="utf-8").splitlines()[1:]]
    assert len(rays) == document["counts"]["image_points_used"]
    places = np.array([row[3:5] for row in rays], float) * 5500 + [2750, 3667 / 2]
    assert places == pytest.approx(np.array([measured[row[0], row[1]] for row in rays]), abs=0.01)
    xyz = east_first(document, document["points"])
    if document["frame"]["crs"] == "local":
        assert "reference_lla" not in found
    else:
        place = found["reference_lla"]
        at = f"+lat_0={place['latitude']} +lon_0={place['longitude']} +h_0={place['altitude']}"
        topocentric = Transformer.from_pipeline(f"+proj=topocentric +ellps=WGS84 {at}")
        xyz = np.stack(topocentric.transform(*geocentric(UTM, xyz).T), axis=-1)
    assert np.array([each["coordinates"] for each in found["points"].values()]) == pytest.approx(xyz, abs=1e-4)


def test_a_run_writes_what_its_project_asks_for_and_a_saved_result_gives_the_same_bytes(tmp_path: Path) -> None:
    asked = "export=[a.gpkg,maps/ori.csv,maps/ori.geojson,model/]"
    found = ran(tmp_path, "--set", asked, ground=GROUNDS["map"])
    written = {
        path.relative_to(found.folder).as_posix(): path.read_bytes()
        for path in found.folder.rglob("*")
        if path.is_file() and (path.parent != found.folder or path.suffix == ".gpkg")
    }
    assert {*written} == {
        "a.gpkg",
        *(f"maps/ori{ending}" for ending in (".csv", ".prj", ".geojson", "_int_param.yaml")),
        *(f"model/{name}.txt" for name in ("cameras", "images", "points3D")),
    }
    (tmp_path / "again" / "maps").mkdir(parents=True)
    for name in ("a.gpkg", "maps/ori.csv", "maps/ori.geojson", "model/"):
        assert main(["convert", str(found), f"{tmp_path / 'again' / name}{'/' if name[-1] == '/' else ''}", "-q"]) == 0
    assert {name: (tmp_path / "again" / name).read_bytes() for name in written} == written
    resolved = (found.folder / "project.resolved.yaml").read_text(encoding="utf-8")
    assert "model/" in resolved


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a.shp", "geopackage (.gpkg), historix (extrinsics.csv), orthority (.csv), orthority-geojson (.geojson), "),
        ("../a.gpkg", "does not lie in the folder of the run"),
        ("/a.gpkg", "does not lie in the folder of the run"),
        ("photos.csv", "is a file of the result itself; write other-photos.csv"),
    ],
)
def test_a_wrong_name_in_a_project_is_refused_before_anything_is_computed(
    name: str, said: str, tmp_path: Path, capsys: Capture
) -> None:
    photostrip.simulate(SPEC).write(tmp_path)
    assert main(["check", str(tmp_path / "project.yaml"), "--set", f"export=[{name}]"]) == 2
    printed = capsys.readouterr()
    assert said in printed.out + printed.err


def test_what_cannot_be_written_is_refused_and_nothing_is_written(block: Ran, tmp_path: Path, capsys: Capture) -> None:
    source, model = str(block), f"{tmp_path / 'model'}/"
    assert "known" not in refused(capsys, source, str(tmp_path / "a.dxf"))
    assert "geopackage (.gpkg)" in refused(capsys, source, str(tmp_path / "a.dxf"))
    assert "`dxf`" in refused(capsys, source, str(tmp_path / "a"), "--to", "dxf")
    assert "points.gpkg" in refused(capsys, source)
    assert "points.gpkg" in refused(capsys, source, str(tmp_path / "a.gpkg"), "--sigma", "1")
    assert "-o DIR" in refused(capsys, str(tmp_path), str(tmp_path / "a.gpkg"))
    assert "-o DIR" in refused(capsys, str(tmp_path))
    assert list(tmp_path.iterdir()) == []
    assert main(["convert", source, model, "-q"]) == 0
    assert "already exists" in refused(capsys, source, model)
    before = (block.folder / "photos.csv").read_bytes()
    assert "would replace it" in refused(capsys, source, str(block.folder / "photos.csv"))
    assert (block.folder / "photos.csv").read_bytes() == before
    assert main(["convert", source, model, "-q", "--force"]) == 0
    assert main(["convert", source, str(tmp_path / "table.txt"), "--to", "orthority", "-q"]) == 0
    assert len(table(tmp_path / "table.txt")) == len(block.document["photos"])


FRAMES = {"map": UTM, "geographic": "EPSG:4979", "geocentric": "geocentric"}
NAMES = ("extrinsics.csv", "intrinsics.csv", "sparse_pointcloud.laz")
ANGLES, PLACE = ("omega", "phi", "kappa"), ("lon", "lat", "alt")
FORMAT = (13.2, 8.8)  # mm


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Ran]:
    """One block, in three frames."""
    folder = tmp_path_factory.mktemp("runs")
    found = {"map": ran(folder, ground={"crs": UTM, "center_deg": [13.5, 49.2]})}
    for name in ("geographic", "geocentric"):
        asked = ("--set", f"output.crs={FRAMES[name]}")
        assert main(["run", str(folder / "project" / "project.yaml"), "-o", str(folder / name), "-q", *asked]) == 0
        document = read_result(str(folder / name / "result.json"))
        found[name] = Ran(folder / name, document)
    return found


def projected(camera: Document, opk: Floats, ray: Floats) -> Floats:
    """Give pixels from the corner, y down, by the camera of a submission; ray: in the axes of the angles."""
    x, y, z = (ray @ Rotation.from_euler("XYZ", opk, degrees=True).as_matrix()).T
    x, y = -x / z, y / z
    k1, k2, k3, p1, p2 = (float(camera[name]) for name in ("k1", "k2", "k3", "p1", "p2"))
    right, down = distorted(x, y, (k1, k2, k3), (p1, p2))
    focal, pixel, x0, y0 = (
        float(camera[each]) for each in ("focal_length", "pixel_pitch", "principal_point_x_mm", "principal_point_y_mm")
    )
    width, height = FORMAT
    return np.stack([width / 2 + focal * right + x0, height / 2 + focal * down - y0], axis=-1) / pixel


def level(lon: float, lat: float) -> Floats:
    """Give true east, north and the normal as rows."""
    (sl, sp), (cl, cp) = np.sin(np.radians([lon, lat])), np.cos(np.radians([lon, lat]))
    return np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])


@pytest.mark.parametrize("frame", FRAMES)
def test_a_submission_projects_its_point_cloud_onto_the_adjusted_image_points(
    runs: dict[str, Ran], frame: str, tmp_path: Path, capsys: Capture
) -> None:
    """By longitude, latitude, height; by a map as far as it is told."""
    capsys.readouterr()
    assert main(["convert", str(runs[frame]), str(tmp_path / NAMES[0])]) == 0
    said = capsys.readouterr().out
    rows, (camera,) = (table(tmp_path / each) for each in NAMES[:2])
    places = np.array(laspy.read(tmp_path / NAMES[2]).xyz)
    true = adjusted_image_points(runs["map"].document)
    row_of = {each["id"]: row for row, each in enumerate(runs["map"].document["points"])}
    away = []
    for row in nonempty(rows):
        mine = {point: place for (photo, point), place in true.items() if photo == row["image_file_name"]}
        some = places[[row_of[each] for each in mine]]
        opk, at = (np.array([float(row[each]) for each in names]) for names in (ANGLES, PLACE))
        if frame == "map":
            ray = some - [float(row[each]) for each in ("x_map", "y_map", "alt")]
        else:
            ray = (geocentric("EPSG:4979", some) - geocentric("EPSG:4979", at[None])) @ level(at[0], at[1]).T
        away.append(np.linalg.norm(projected(camera, opk, ray) - list(mine.values()), axis=1).max())
    assert len(rows) == 12
    if frame == "map":
        assert number_in(said, r"by up to ([\d.]+) px") == pytest.approx(max(away), abs=0.01)
    else:
        assert max(away) < 0.01
        assert "Cartesian" not in said


@pytest.mark.parametrize("frame", FRAMES)
def test_laspy_reads_the_points_and_their_reference_system(runs: dict[str, Ran], frame: str, tmp_path: Path) -> None:
    assert main(["convert", str(runs[frame]), str(tmp_path / NAMES[0]), "-q"]) == 0
    cloud = laspy.read(tmp_path / NAMES[2])
    found = np.array([[each[axis] for axis in "xyz"] for each in runs["map"].document["points"]])
    crs = UTM if frame == "map" else "EPSG:4979"
    assert geocentric(crs, np.array(cloud.xyz)) == pytest.approx(geocentric(UTM, found), abs=2e-3)
    assert cloud.header.parse_crs() == CRS(UTM if frame == "map" else "EPSG:4326")
    assert cloud.header.are_points_compressed
    before = (tmp_path / NAMES[2]).read_bytes()
    assert main(["convert", str(runs[frame]), str(tmp_path / "again_extrinsics.csv"), "-q"]) == 0
    assert (tmp_path / f"again_{NAMES[2]}").read_bytes() == before


def test_what_historix_cannot_take_is_refused(runs: dict[str, Ran], tmp_path: Path, capsys: Capture) -> None:
    target = str(tmp_path / NAMES[0])
    assert "write NAME_extrinsics.csv" in refused(capsys, str(runs["map"]), f"{tmp_path}/a.csv", "--to", "historix")
    assert "longitude and latitude" in refused(capsys, str(ran(tmp_path / "local")), target)
    document = json.loads((runs["map"].folder / "result.json").read_text(encoding="utf-8"))
    for key, column in document["cameras"].items():
        column.append({"id": "other", "single_photos": [document["photos"]["id"][0]]}.get(key, column[0]))
    (tmp_path / "result.json").write_text(json.dumps(document), encoding="utf-8")
    assert "takes one camera, and the photos have" in refused(capsys, str(tmp_path / "result.json"), target)


def test_without_laspy_the_extra_is_named_before_anything_is_computed(
    runs: dict[str, Ran], tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "lazrs", None)
    told = refused(capsys, str(runs["map"]), str(tmp_path / NAMES[0]))
    assert "a point cloud (LAZ) needs laspy with lazrs, which are not installed; pip install photostrip[laz]" in told
    project = str(runs["map"].folder.parent / "project" / "project.yaml")
    assert main(["check", project, "--set", "export=[T_extrinsics.csv]"]) == 2
    assert "pip install photostrip[laz]" in re.sub(r"\s+", " ", capsys.readouterr().out)
