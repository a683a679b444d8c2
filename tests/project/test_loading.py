"""What comes out of a right project: numbers in the units and axes of the house, and notes on what was not used."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from photostrip.camera import Distortion
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.notes import Note
from photostrip.pipeline.inputs import Settings
from photostrip.project.loading import Project, load_project
from tests.project.samples import CONTROL, FIDUCIALS, OBSERVATIONS, PROJECT, C, P, Sample, Y, sample

NANOMETRE = 1e-6  # mm


def image_points(project: Project) -> dict[tuple[str, str], tuple[float, float]]:
    table = project.inputs.observations
    return {
        (table.photo_ids[photo], table.point_ids[point]): (float(xy[0]), float(xy[1]))
        for photo, point, xy in zip(table.photo, table.point, table.xy, strict=True)
    }


def notes(project: Project) -> dict[str, Note]:
    return {note.code: note for note in project.hints}


def test_the_sample(project: Sample) -> None:
    inputs = project.load().inputs
    camera, table, control = inputs.strips[0].camera, inputs.observations, inputs.control
    assert inputs.name == "sample"
    assert [(strip.id, strip.photos) for strip in inputs.strips] == [("A", ("1001", "1002")), ("B", ("2001", "2002"))]
    assert (camera.name, camera.principal_distance, camera.principal_point) == ("RC30", 153.217, (0.012, -0.004))
    assert camera.format == (230.0, 230.0)
    assert camera.distortion == Distortion("brown", "image_to_ideal", (1e-8, 0.0, 0.0), (0.0, 0.0))
    assert inputs.strips[1].camera is camera
    assert (table.photo_ids, table.point_ids) == (("1001", "1002", "2001", "2002"), ("P1", "P2", "G1"))
    assert (table.photo.tolist(), table.point.tolist()) == ([0, 0, 1, 1, 2, 2, 3, 3], [0, 1, 0, 1, 1, 2, 1, 2])
    assert table.xy[:2].tolist() == [[10.5, -20.25], [11.5, 20.25]]
    assert table.sigma.tolist() == [[0.005, 0.005]] * 8
    np.testing.assert_array_equal(control.enu, [[500100.12, 4649871.40, 212.31], [500200.12, 4649971.40, np.nan]])
    assert (control.ids, control.check.tolist()) == (("G1", "P2"), [False, True])
    assert control.use.tolist() == [[True, True, True], [True, True, False]]
    assert control.sigma[0].tolist() == [0.05, 0.06, 0.08]
    assert inputs.frames == (FrameSpec("EPSG:32633", ("east", "north", "up")),)
    assert (inputs.output, inputs.fiducials) == (None, None)


def test_settings_not_given_are_the_defaults_of_the_mathematics(project: Sample) -> None:
    project.change(Y, "output:\n  angles: {system: omega-phi-kappa, unit: gon}\n", "")
    project.change(Y, PROJECT[PROJECT.index("processing:") :], "")
    assert project.load().settings == Settings()


def test_every_setting_arrives(project: Sample) -> None:
    new = """\
processing:
  adjustment: similarity
  polynomial: {degree: 2}
  relative: {screening: tau, grubbs_alpha: 0.01, parallax_limit: 0.03}
  scale_transfer: distances
  earth_curvature: none
  earth_radius: 6.4e6
  refraction: yes
  flying_height: 1500
  ground_height: -3.5
  interior: {transform: affine}
tolerances: {check_rms_xy: 0.4, sigma0_um: 7}
"""
    project.change(Y, PROJECT[PROJECT.index("processing:") :], new)
    settings = project.load().settings
    assert (settings.adjustment, settings.polynomial.degree) == ("similarity", "2")
    assert (settings.relative.screening, settings.relative.grubbs_alpha) == ("tau", 0.01)
    assert settings.relative.parallax_limit == 0.03
    assert settings.formation.scale_transfer == "distances"
    assert (settings.absolute.earth_curvature, settings.absolute.earth_radius) == ("none", 6.4e6)
    assert (settings.refinement.refraction, settings.refinement.flying_height) == (True, 1500.0)
    assert settings.refinement.ground_height == -3.5
    assert settings.interior.transform == "affine"
    assert (settings.angle_system, settings.angle_unit) == ("omega-phi-kappa", "gon")
    assert settings.tolerances == {"check_rms_xy": 0.4, "sigma0_um": 7.0}


def test_a_section_with_everything_commented_out_is_empty(project: Sample) -> None:
    project.change(Y, PROJECT[PROJECT.index("processing:") :], "processing:\n  # refraction: true\n")
    project.change(Y, "processing:", "tolerances:\nprocessing:\n  relative:\n  polynomial:\n")
    settings = project.load().settings
    assert (settings.relative, settings.tolerances) == (Settings().relative, {})


def test_every_file_read_is_listed(marked: Sample) -> None:
    marked.write("presets/film.yaml", "extends: base.yaml\n")
    marked.write("presets/base.yaml", "processing: {refraction: true}\n")
    marked.change(Y, "name: sample", "extends: presets/film.yaml")
    loaded = marked.load()
    names = ["project.yaml", "presets/film.yaml", "presets/base.yaml"]
    names += ["observations.csv", "fiducials.csv", "control.csv"]
    assert loaded.files == tuple(marked.folder / name for name in names)
    assert loaded.directory == marked.folder
    assert loaded.inputs.name == "project"


def test_paths_are_shown_as_the_user_typed_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sample(tmp_path / "strip")
    monkeypatch.chdir(tmp_path)
    assert [str(file) for file in load_project(Path("strip/project.yaml")).files] == [
        "strip/project.yaml",
        "strip/observations.csv",
        "strip/control.csv",
    ]
    monkeypatch.chdir(tmp_path / "strip")
    assert [str(file) for file in load_project(Path("project.yaml")).files][1] == "observations.csv"


def test_paths_behind_a_link_lead_where_the_system_finds_them(tmp_path: Path) -> None:
    project = sample(tmp_path / "runs" / "july")
    (tmp_path / "latest").symlink_to(tmp_path / "runs" / "july")
    (tmp_path / "runs" / "july" / "observations.csv").rename(tmp_path / "runs" / "o.csv")
    project.change(Y, "observations.csv", "../o.csv")
    loaded = load_project(tmp_path / "latest" / "project.yaml")
    assert len(loaded.inputs.observations) == 8
    assert 'file: "../o.csv"' in loaded.resolved


def image_case(folder: Path, system: str, row: str) -> tuple[float, float]:
    """Load a project whose first point is `row` and give where it comes out, in mm."""
    project = sample(folder)
    project.change(Y, "    format: [230, 230]", "    format: [200, 100]\n    pixel_size: 0.01")
    project.change(Y, "  unit: mm\n  y_axis: up\n", system)
    project.change(P, "10.5,-20.25", row)
    return image_points(project.load())["1001", "P1"]


@pytest.mark.parametrize(
    ("system", "row", "expected"),
    [
        ("  unit: mm\n", "10.5,-20.25", (10.5, -20.25)),
        ("  unit: mm\n  y_axis: down\n", "10.5,-20.25", (10.5, 20.25)),
        ("  unit: um\n", "12345,-678", (12.345, -0.678)),
        ("  unit: um\n  y_axis: down\n", "12345,-678", (12.345, 0.678)),
        # a frame of 200 x 100 mm in pixels of 0.01 mm: its corners and its middle
        ("  unit: px\n  y_axis: down\n", "0,0", (-100.0, 50.0)),
        ("  unit: px\n  y_axis: down\n", "20000,10000", (100.0, -50.0)),
        ("  unit: px\n  y_axis: down\n", "10000,5000", (0.0, 0.0)),
        ("  unit: px\n  y_axis: down\n  origin: top-left\n", "10000,2500", (0.0, 25.0)),
        ("  unit: px\n  y_axis: down\n  origin: first-pixel\n", "0,0", (-99.995, 49.995)),
        ("  unit: px\n  y_axis: down\n  origin: first-pixel\n", "19999,9999", (99.995, -49.995)),
        ("  unit: px\n  y_axis: up\n  origin: first-pixel\n", "0,-9999", (-99.995, -49.995)),
        ("  unit: px\n  y_axis: up\n", "10000,-2500", (0.0, 25.0)),
        ("  unit: px\n  y_axis: down\n  origin: center\n", "100,-250", (1.0, 2.5)),
        ("  unit: mm\n  y_axis: down\n  origin: top-left\n", "100,25", (0.0, 25.0)),
        ("  unit: um\n  y_axis: up\n  origin: top-left\n", "100000,-25000", (0.0, 25.0)),
    ],
)
def test_image_coordinates_become_millimetres_with_y_up(
    tmp_path: Path, system: str, row: str, expected: tuple[float, float]
) -> None:
    assert image_case(tmp_path, system, row) == pytest.approx(expected, abs=NANOMETRE)


def test_micrometres_are_divided_so_that_nothing_is_lost(tmp_path: Path) -> None:
    assert image_case(tmp_path, "  unit: um\n", "12338,-678") == (12.338, -0.678)
    assert 12338 * 1e-3 != 12.338


@pytest.mark.parametrize(("unit", "factor"), [("unit: mm", 1.0), ("unit: um", 1e-3), ("unit: px\n  y_axis: up", 0.01)])
def test_standard_deviations_have_the_unit_of_the_coordinates(project: Sample, unit: str, factor: float) -> None:
    project.change(Y, "    format: [230, 230]", "    format: [200, 100]\n    pixel_size: 0.01")
    project.change(Y, "unit: mm\n  y_axis: up\n  sigma: 0.005", f"{unit}\n  sigma: 0.5")
    rows = OBSERVATIONS.splitlines()
    table = [rows[0] + ",sx,sy", rows[1] + ",0.25,0.75", *(row + ",," for row in rows[2:])]
    project.write(P, "\n".join(table))
    sigma = project.load().inputs.observations.sigma
    np.testing.assert_allclose(sigma[0], [0.25 * factor, 0.75 * factor], rtol=1e-12)
    np.testing.assert_allclose(sigma[1:], 0.5 * factor, rtol=1e-12)


def test_pixels_of_two_cameras(project: Sample) -> None:
    cameras = PROJECT[PROJECT.index("cameras:") : PROJECT.index("strips:")]
    new = (
        "cameras:\n  big: {principal_distance: 100, format: [80, 60], pixel_size: 0.004}\n"
        "  small: {principal_distance: 50, format: [40, 20], pixel_size: 0.008}\n"
    )
    project.change(Y, cameras, new, "camera: RC30", "camera: big", "camera: RC30", "camera: small")
    project.change(Y, "unit: mm\n  y_axis: up", "unit: px\n  y_axis: down")
    found = image_points(project.load())
    assert found["1001", "P1"] == pytest.approx((10.5 * 0.004 - 40, 30 + 20.25 * 0.004), abs=NANOMETRE)
    assert found["2001", "P2"] == pytest.approx((10 * 0.008 - 20, 10 - 20 * 0.008), abs=NANOMETRE)


def in_pixels(marked: Sample, *key: str) -> list[list[str]]:
    """Say that the sample is in pixels, with other lines for the format of the camera; and give the rows of marks."""
    marked.change(Y, "unit: mm\n  y_axis: up\n  sigma: 0.005", "unit: px\n  y_axis: down\n  sigma: 0.5")
    marked.change(Y, "    format: [230, 230]\n", *key or ("",))
    return [row.split(",") for row in FIDUCIALS.splitlines()[1:]]


def test_measured_marks_replace_the_origin(marked: Sample) -> None:
    in_pixels(marked, "    pixel_size: 0.02\n")
    inputs = marked.load().inputs
    assert inputs.fiducials is not None
    assert inputs.fiducials.point_ids == ("F1", "F2")
    np.testing.assert_allclose(inputs.fiducials.xy[0], [106.1 * 0.02, 106 * 0.02], rtol=1e-12)
    np.testing.assert_allclose(inputs.fiducials.sigma, 0.01, rtol=1e-12)
    assert image_points(marked.load())["1001", "P1"] == pytest.approx((0.21, 0.405), abs=NANOMETRE)


def test_marks_tell_the_size_of_a_pixel(marked: Sample) -> None:
    """A scanner's step: the marks lie 212 mm apart and 212 pixels."""
    rows = [f"{photo},{mark},{50 * float(x)},{50 * float(y)}" for photo, mark, x, y in in_pixels(marked)]
    marked.write("fiducials.csv", "\n".join(["photo,mark,x,y", *rows]))
    loaded = marked.load()
    note = notes(loaded)["pixel-size-derived"]
    size = "a pixel is 20 µm by the calibrated fiducial marks of 4 photos"
    assert note.message == f"camera RC30 has no pixel_size: {size}"
    assert (note.key, note.line) == ("cameras.RC30.pixel_size", 5)
    assert loaded.inputs.fiducials is not None
    np.testing.assert_allclose(loaded.inputs.fiducials.xy[0], [106.1, 106.0], rtol=1e-5)
    np.testing.assert_allclose(loaded.inputs.observations.sigma, 0.5 * 0.02, rtol=1e-5)


def test_marks_in_one_place_do_not_tell_it(marked: Sample) -> None:
    rows = [f"{photo},{mark},7,7" for photo, mark, *_ in in_pixels(marked)]
    marked.write("fiducials.csv", "\n".join(["photo,mark,x,y", *rows]))
    message = "cameras.RC30.pixel_size: the fiducial marks do not tell the size of a pixel"
    marked.tells("", message, alone=True)


def test_marks_may_have_a_unit_of_their_own(marked: Sample) -> None:
    old, new = "{file: fiducials.csv}", "{file: fiducials.csv, unit: um, y_axis: down, sigma: 3}"
    marked.change(Y, old, new)
    fiducials = marked.load().inputs.fiducials
    assert fiducials is not None
    np.testing.assert_allclose(fiducials.xy[0], [0.1061, 0.106], rtol=1e-12)
    np.testing.assert_allclose(fiducials.sigma, 0.003, rtol=1e-12)


@pytest.mark.parametrize(
    ("axes", "row", "expected"),
    [
        ("[east, north, up]", "1,2,3,xyz", [1, 2, 3]),
        ("[north, east, up]", "1,2,3,xyz", [2, 1, 3]),
        ("[up, north, east]", "1,2,3,xyz", [3, 2, 1]),
        ("[up, east, north]", "1,2,3,xyz", [2, 3, 1]),
        ("[north, east, up]", "1,2,,xy", [2, 1, np.nan]),
        ("[up, north, east]", ",2,1,xy", [1, 2, np.nan]),
        ("[up, north, east]", "3,,,z", [np.nan, np.nan, 3]),
        ("[north, east, up]", ",,3,z", [np.nan, np.nan, 3]),
    ],
)
def test_control_comes_in_the_order_of_its_axes(project: Sample, axes: str, row: str, expected: list[float]) -> None:
    project.change(Y, "EPSG:32633\n    axes: [east, north, up]", f"local\n    axes: {axes}")
    project.write(C, f"point,x,y,z,use\nG1,{row}\n")
    control = project.load().inputs.control
    np.testing.assert_array_equal(control.enu, [expected])
    np.testing.assert_array_equal(control.use, [~np.isnan(expected)])
    names = [name.strip() for name in axes[1:-1].split(",")]
    given = dict(zip(names, [0.05, 0.06, 0.08], strict=True))
    assert control.sigma[0].tolist() == [given["east"], given["north"], given["up"]]


@pytest.mark.parametrize(
    ("old", "new", "table", "expected"),
    [
        ("[east, north, up]", "[north, east, up]", "point,x,y,z,sx,sy,sz\nG1,1,2,3,0.1,,0.3\n", [0.06, 0.1, 0.3]),
        (
            "    sigma: [0.05, 0.06, 0.08]\n",
            "",  # only coordinates that are used need one
            "point,x,y,z,use,sx,sy,sz\nG1,1,2,3,xy,0.1,0.2,\n",
            [0.1, 0.2, np.nan],
        ),
    ],
)
def test_sigma_of_a_row_counts_before_that_of_the_list(
    project: Sample, old: str, new: str, table: str, expected: list[float]
) -> None:
    project.change(Y, old, new)
    project.write(C, table)
    np.testing.assert_array_equal(project.load().inputs.control.sigma, [expected])


def test_each_control_list_has_its_frame(project: Sample) -> None:
    second = "  - {file: b.csv, crs: 'EPSG:32634', axes: [north, east, up], sigma: [1, 2, 3]}\noutput:"
    project.change(Y, "output:", second)
    project.write("b.csv", "point,x,y,z\nN1,4649871,100,5\n")
    inputs = project.load().inputs
    assert [frame.crs for frame in inputs.frames] == ["EPSG:32633", "EPSG:32634"]
    assert inputs.control.frame.tolist() == [0, 0, 1]
    assert inputs.control.enu[2].tolist() == [100, 4649871, 5]
    assert inputs.control.sigma[2].tolist() == [2, 1, 3]


def test_geocentric_needs_no_axes(project: Sample) -> None:
    project.change(Y, "EPSG:32633\n    axes: [east, north, up]", "geocentric")
    project.change(Y, "height: ellipsoidal", "ellipsoid: {a: 1737400, b: 1737400}")
    project.write(C, "point,x,y,z\nG1,1500000,200000,700000\n")
    inputs = project.load().inputs
    assert inputs.frames[0] == FrameSpec("geocentric", ("x", "y", "z"), ellipsoid=(1737400.0, 1737400.0))
    assert inputs.control.enu.tolist() == [[1500000, 200000, 700000]]


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("axes: [north, east, up]", FrameSpec("EPSG:32633", ("north", "east", "up"), "orthometric", 44.0)),
        ("crs: EPSG:4326", FrameSpec("EPSG:4326", ("east", "north", "up"))),
        ("crs: geocentric", FrameSpec("geocentric", ("x", "y", "z"))),
        ("height: ellipsoidal", FrameSpec("EPSG:32633", ("east", "north", "up"))),
        ("geoid_undulation: 43", FrameSpec("EPSG:32633", ("east", "north", "up"), "orthometric", 43.0)),
        ("crs: EPSG:32634\n  axes: [up, east, north]", FrameSpec("EPSG:32634", ("up", "east", "north"))),
        ("axes: [east, north, up]", None),
    ],
)
def test_the_frame_of_the_results(project: Sample, said: str, expected: FrameSpec | None) -> None:
    project.change(Y, "height: ellipsoidal", "height: orthometric\n    geoid_undulation: 44")
    project.change(Y, "output:", f"output:\n  {said}")
    assert project.load().inputs.output == expected


@pytest.mark.parametrize(
    ("keys", "radius"),
    [
        ("earth_radius: 6380000", 6_380_000),
        # at a place: R = M N / (N cos² A + M sin² A), M and N of WGS 84 at 42.5 degrees
        ("earth_latitude: 42.5\n  earth_azimuth: 90", 6_387_903.5),
        ("earth_latitude: 42.5\n  earth_azimuth: 0", 6_364_587.2),
        ("earth_latitude: 42.5", (6_387_903.5 * 6_364_587.2) ** 0.5),
        ("earth_latitude: 425", "earth_latitude: 425 is out of range; expected -90 to 90 deg"),
        ("earth_azimuth: 30", "at a latitude only; give `earth_latitude` as well"),
    ],
)
def test_curvature_of_eq_153_is_for_local_coordinates(project: Sample, keys: str, radius: float | str) -> None:
    project.change(Y, "EPSG:32633", "local", "processing:", f"processing:\n  earth_curvature: model\n  {keys}")
    if isinstance(radius, str):
        project.tells("", radius)
    else:
        assert project.load().settings.absolute.earth_radius == pytest.approx(radius, abs=0.1)


def test_photos_in_no_strip(project: Sample) -> None:
    project.write(P, OBSERVATIONS + "3001,P9,1,2\n3001,P1,1,2\n1001.tif,P1,1,2\n")
    loaded = project.load()
    note = notes(loaded)["photo-in-no-strip"]
    assert note.photos == ("3001", "1001.tif")
    assert "3 rows of 2 photos" in note.message
    assert "`1001.tif`, did you mean `1001`?" in note.message
    assert len(loaded.inputs.observations) == 8
    assert "P9" not in loaded.inputs.observations.point_ids


def test_points_measured_once(project: Sample) -> None:
    project.write(P, OBSERVATIONS + "1001,P7,1,2\n1002,G7,1,2\n")
    project.write(C, CONTROL + "G7,500100,4649871,212,xyz,\n")
    assert set(notes(project.load())) == {"measured-once"}  # control on one photo helps to orient it
    project.change(Y, "processing:\n", "processing:\n  adjustment: polynomial\n")
    found = notes(project.load())
    assert found["measured-once"].points == ("P7",)
    assert found["control-measured-once"].points == ("G7",)
    assert found["control-measured-once"].severity == "warning"


@pytest.mark.parametrize(
    ("given", "measured", "alike"),
    [
        ("GCP-7", "GCP7", True),
        ("gcp 07", "GCP-7", True),
        ("Р100", "P100", True),
        ("QO1", "Q01", True),
        ("qо1", "Q01", True),
        ("GCP7.", "GCP7", True),
        ("007", "7", True),
        ("1006", "1005", False),
    ],
)
def test_control_never_measured_and_a_point_of_nearly_that_name(
    project: Sample, given: str, measured: str, alike: bool
) -> None:
    project.write(P, OBSERVATIONS + f"1001,{measured},1,2\n1002,{measured},3,4\n")
    project.write(C, CONTROL + f"{given},500100,4649871,212,xyz,\n")
    note = notes(project.load())["control-not-measured"]
    assert note.points == (given,)
    assert (f"`{given}`, did you mean `{measured}`?" in note.message) is alike
    assert ("did you mean" in note.message) is alike
    assert note.severity == ("warning" if alike else "note")


def test_points_switched_off(project: Sample) -> None:
    project.write(C, CONTROL + "Q1,,,,off,\n")
    loaded = project.load()
    assert notes(loaded)["control-off"].points == ("Q1",)
    assert "Q1" not in loaded.inputs.control.ids


def test_unused_cameras_and_columns(project: Sample) -> None:
    project.change(Y, "strips:", "  old: {principal_distance: 100}\nstrips:")
    project.write(C, "point,x,y,z,remark\nG1,500100,4649871,212,post\n")
    found = notes(project.load())
    assert found["unused-camera"].message == "1 camera belongs to no strip: old"
    assert found["unused-column"].message == "1 column not used: remark; used: point, x, y, z"
    told = [found[code] for code in ("unused-camera", "unused-column")]
    assert [(note.file, note.line, note.key) for note in told] == [
        (f"{project.folder}/project.yaml", 9, "cameras.old"),
        (f"{project.folder}/control.csv", 1, ""),
    ]


def test_blanks_around_ids_and_a_byte_order_mark(project: Sample) -> None:
    project.write(P, "\ufeff" + OBSERVATIONS.replace("1001,P1", "1001,P1 ").replace("\n", "\r\n"))
    project.change(Y, "[2001, 2002]", "['2001 ', 2002]")
    project.write(Y, "\ufeff" + (project.folder / "project.yaml").read_text(encoding="utf-8"))
    loaded = project.load()
    assert image_points(loaded)["1001", "P1"] == (10.5, -20.25)
    assert loaded.inputs.strips[1].photos == ("2001", "2002")
    told = [str(note).replace(f"{project.folder}/", "") for note in loaded.hints]
    assert told == [
        "project.yaml:1: begins with a byte order mark; it was skipped",
        "project.yaml:15:14: blanks around `2001 ` removed",
        "observations.csv:1: begins with a byte order mark; it was skipped",
        "observations.csv:2: blanks around the id of a point removed in 1 row, here `P1 `",
    ]


@pytest.mark.parametrize(
    "text",
    [
        OBSERVATIONS.replace("\n", "\r\n"),
        OBSERVATIONS.replace("\n", "\r"),
        OBSERVATIONS.rstrip("\n"),
        OBSERVATIONS.replace("\n", "\n\n"),
        OBSERVATIONS.replace(",", " , "),
        OBSERVATIONS.replace("\n", ",,\n"),
        OBSERVATIONS + ",,,\n , , ,\n",
        "\n".join(",".join(f'"{cell}"' for cell in row.split(",")) for row in OBSERVATIONS.splitlines()),
        OBSERVATIONS.replace("photo,point,x,y", "Photo,POINT,X,Y"),
        OBSERVATIONS.replace("photo,point,x,y", "image,point_id,x,y"),
        OBSERVATIONS.replace("10.5,", "+1.05e1,"),
        "\n".join(",".join(reversed(row.split(","))) for row in OBSERVATIONS.splitlines()),
    ],
)
def test_the_same_table_written_otherwise(tmp_path: Path, text: str) -> None:
    expected = image_points(sample(tmp_path / "plain").load())
    project = sample(tmp_path / "other")
    project.write(P, text)
    assert image_points(project.load()) == expected


def test_packed_tables(project: Sample) -> None:
    for name, text in [("observations.csv", OBSERVATIONS), ("control.csv", CONTROL)]:
        project.write(name + ".gz", gzip.compress(text.encode()))
        project.change(Y, name, name + ".gz")
        (project.folder / name).unlink()
    assert len(project.load().inputs.observations) == 8


def test_words_of_control_in_any_case_and_empty(project: Sample) -> None:
    project.write(C, "point,x,y,z,use,role\nG1,500100,4649871,212,XY,Check\nP2,500200,4649971,212,,\n")
    control = project.load().inputs.control
    assert control.use.tolist() == [[True, True, False], [True, True, True]]
    assert control.check.tolist() == [True, False]


def test_a_project_may_be_json(tmp_path: Path) -> None:
    import json

    import yaml

    project = Sample(tmp_path)
    sample(tmp_path)
    project.write(Y, json.dumps(yaml.safe_load(PROJECT.replace("EPSG:32633", "'EPSG:32633'"))))
    assert project.load().inputs.strips[0].photos == ("1001", "1002")
