"""Measured camera positions, given orientations and rotations in every form: what is read, and what is refused."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from pyproj import Proj
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.geometry.rotation import from_angles
from photostrip.pipeline.inputs import GivenOrientations
from tests.project.samples import FILES, PROJECT, Sample, sample

GNSS = """\
photo,x,y,z,use,time,sx,sy,sz
1001,4650000.5,500000.25,2012.125,,10.5,0.1,0.2,0.3
1002,4650000.75,500900.5,2013.5,xy,12.5,,,
2001,4651500,500000,,xy,20,,,
2002,,,2014,z,22,,,
"""
POSITIONS = """\
camera_positions:
  file: gnss.csv
  crs: EPSG:32633
  axes: [north, east, up]
  sigma: [0.05, 0.06, 0.08]
  lever_arm: [0.1, -0.2, 1.5]
  correction: drift
"""
IMU = """\
photo,x,y,z,omega,phi,kappa,sx,sy,sz,s_omega
1001,500000.25,4650000.5,2012.125,1,-2,100,0.1,0.2,0.3,0.01
2002,500900,4651500,2014,0.5,0.25,-100,,,,
"""
ORIENTATIONS = """\
orientations:
  file: imu.csv
  crs: EPSG:32633
  axes: [east, north, up]
  angles: {system: omega-phi-kappa, unit: gon}
  sigma: [0.05, 0.06, 0.08]
  sigma_angles: [0.02, 0.02, 0.04]
"""
BUNDLE = "processing:\n  adjustment: bundle\n"
Y, G, I = "project.yaml", "gnss.csv", "imu.csv"  # noqa: E741


@pytest.fixture
def given(tmp_path: Path) -> Sample:
    text = PROJECT.replace("processing:\n", BUNDLE).replace("output:\n", f"{POSITIONS}{ORIENTATIONS}output:\n")
    return sample(tmp_path, {**FILES, Y: text, G: GNSS, I: IMU})


def test_positions_come_in_the_internal_order(given: Sample) -> None:
    found = given.load().inputs.positions
    assert found is not None
    assert found.photos == ("1001", "1002", "2001", "2002")
    assert found.enu[0].tolist() == [500000.25, 4650000.5, 2012.125]  # the list has north first
    assert found.sigma[0].tolist() == [0.2, 0.1, 0.3]
    assert found.sigma[1].tolist() == [0.06, 0.05, 0.08]
    assert found.use.tolist() == [[True] * 3, [True, True, False], [True, True, False], [False, False, True]]
    assert found.time.tolist() == [10.5, 12.5, 20, 22]
    assert (found.lever_arm, found.correction) == ((0.1, -0.2, 1.5), "drift")


def test_orientations_come_in_radians(given: Sample) -> None:
    found = given.load().inputs.orientations
    assert found is not None
    assert (found.photos, found.system, found.observed) == (("1001", "2002"), "omega-phi-kappa", True)
    assert found.angles.shape == (2, 3)
    np.testing.assert_allclose(found.angles * 200 / np.pi, np.array([[1, -2, 100], [0.5, 0.25, -100]]), rtol=1e-12)
    assert found.sigma_turns.shape == (2, 3)
    np.testing.assert_allclose(found.sigma, [[0.1, 0.2, 0.3], [0.05, 0.06, 0.08]], rtol=1e-12)


def test_the_resolved_project_reads_as_the_same(given: Sample) -> None:
    assert "lever_arm" in given.reads_as_the_same()


def test_approximate_orientations_need_no_standard_deviations(given: Sample) -> None:
    given.change(Y, "  sigma: [0.05, 0.06, 0.08]\n  sigma_angles: [0.02, 0.02, 0.04]\n", "  role: approximate\n")
    found = given.load().inputs.orientations
    assert found is not None
    assert not found.observed


def test_the_strip_method_says_that_it_uses_none(given: Sample) -> None:
    given.change(Y, "adjustment: bundle", "adjustment: polynomial")
    told = [note for note in given.load().hints if note.code == "cameras-not-used"]
    assert [note.key for note in told] == ["camera_positions", "orientations"]


def test_a_bundle_does_without_control_and_takes_single_photos(given: Sample) -> None:
    text = (given.folder / Y).read_text(encoding="utf-8")
    start, end = text.index("control:"), text.index("camera_positions:")
    given.write(Y, text[:start] + text[end:].replace("[2001, 2002]", "[2001]"))
    given.change(Y, "    photos: [2001, 2002]", "    photos: [2001]")
    loaded = given.load()
    assert (len(loaded.inputs.control), loaded.inputs.frames) == (0, ())
    assert loaded.inputs.output is not None
    assert loaded.inputs.output.axes == ("north", "east", "up")


def test_self_calibration_of_each_camera(given: Sample) -> None:
    given.change(Y, "  adjustment: bundle\n", "  adjustment: bundle\n  self_calibration: [k1, p1]\n")
    assert [strip.calibrate for strip in given.load().inputs.strips] == [("k1", "p1")] * 2
    given.change(Y, "    format:", "    self_calibration: [principal_distance]\n    format:")
    assert [strip.calibrate for strip in given.load().inputs.strips] == [("principal_distance",)] * 2


WRONG = [
    (G, "1002,4650000.75", "1001,4650000.75", "gnss.csv:3:1: photo:", "photo 1001 is already given, in line 2"),
    (G, "4650000.75,500900.5", ",500900.5", "gnss.csv:3:6: x:", "photo 1002 has no x, but its use is xy"),
    (G, "0.1,0.2,0.3", "0.1,0,0.3", "gnss.csv:2:45: sy:", "larger than 0"),
    (G, "photo,x", "photo,X_m", "gnss.csv:1", "x"),
    (G, ",xy,12.5", ",yx,12.5", "gnss.csv:3", "xyz, xy, z, off"),
    (Y, "  sigma: [0.05, 0.06, 0.08]\n  lever", "  lever", "gnss.csv:3", "camera_positions.sigma"),
    (Y, "file: gnss.csv", "file: gns.csv", "project.yaml:28:9: camera_positions.file:", "gns.csv"),
    (Y, "correction: drift", "correction: drfit", "project.yaml:33:15:", "did you mean `drift`?"),
    (Y, "lever_arm: [0.1, -0.2, 1.5]", "lever_arm: [0.1, -0.2]", "project.yaml:32:14:", "3 values"),
    (Y, "axes: [north, east, up]", "axes: [north, up]", "project.yaml:30:9:", "permutation"),
    (Y, "  axes: [north, east, up]\n", "", "project.yaml:28:3: camera_positions.axes:", "which of the columns"),
    (Y, "lever_arm:", "lever_am:", "project.yaml:32:3:", "did you mean `lever_arm`?"),
    (Y, "crs: EPSG:32633\n  axes: [north", "crs: local\n  axes: [north", "project.yaml:29:8:", "nobody knows where"),
    (I, "omega,phi,kappa,sx", "alpha,phi,kappa,sx", "imu.csv:1", "omega"),
    (I, "1001,500000.25", "2002,500000.25", "imu.csv:3:1: photo:", "already given"),
    (I, ",-100,", ",,", "imu.csv:3", "kappa"),
    (Y, "  sigma_angles: [0.02, 0.02, 0.04]\n", "", "imu.csv:2", "orientations.sigma_angles"),
    (Y, "system: omega-phi-kappa, unit: gon}\n  s", "system: opk, unit: gon}\n  s", "project.yaml:38:20:", "opk"),
    (Y, "adjustment: bundle", "self_calibration: [k4]", "project.yaml:44:", "`k4` is not known"),
    (Y, "adjustment: bundle", "self_calibration: nevr", "project.yaml:44:", "did you mean `never`?"),
    (Y, "adjustment: bundle", "bundle: {self_calibration: [k1]}", "project.yaml:44:", "`processing.self_calibration`"),
    (Y, "adjustment: bundle", "bundle: {calibration_sigma: {k4: 1}}", "project.yaml:44:", "no parameter"),
    (Y, "adjustment: bundle", "bundle: {test: t}", "project.yaml:44:", "tau"),
    (Y, "adjustment: bundle", "bundle: {alpha: 5}", "project.yaml:44:", "between 0 and 1"),
    (Y, "adjustment: bundle", "bundle: {screening: yes}", "project.yaml:44:", "snooping"),
]  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_explained(given: Sample, case: tuple[str, ...]) -> None:
    given.refuses(*case)


def test_a_table_without_any_photo_of_the_strips(given: Sample) -> None:
    given.write(G, "photo,x,y,z\nDSC_1001,1,2,3\nDSC_1002,1,2,3\n")
    given.tells("", "has none of the photos of the strips; its photos are DSC_1001, DSC_1002", alone=True)


def test_single_photos_are_for_bundles_only(given: Sample) -> None:
    given.change(Y, "adjustment: bundle", "adjustment: polynomial", "[2001, 2002]", "[2001]")
    given.tells("", "only one photo", "adjustment: bundle")


PHOTOS = ("1001", "1002", "2001", "2002")
PLACES = np.array([[650000.0 + 900.0 * n, 4650000.0, 2000.0] for n in range(len(PHOTOS))])  # far from the meridian
TRUE = Rotation.from_euler("XYZ", [[3, -4, 100], [-2, 5, 80], [1, 2, -175], [-85, 3, 20]], degrees=True)
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # east, north, up of north, east, down
DOWN = NED  # ahead, right, down of image axes
AHEAD = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # right is right, up is up, against the view

START = "  role: approximate\n"


def of_table(folder: Path, table: str, angles: str, more: str = START, crs: str = "EPSG:32633") -> Sample:
    """Write a project with a table of orientations."""
    frame = f'crs: "{crs}"\n  axes: [east, north, up]'
    text = f"orientations:\n  file: imu.csv\n  {frame}\n  angles: {{{angles}}}\n{more}"
    project = PROJECT.replace("processing:\n", BUNDLE).replace("output:\n", f"{text}output:\n")
    return sample(folder, {**FILES, Y: project, I: table})


def oriented(folder: Path, columns: str, values: Floats, angles: str, more: str = START) -> GivenOrientations:
    rows = (
        f"{photo},{','.join(repr(float(each)) for each in (*place, *row))}\n"
        for photo, place, row in zip(PHOTOS, PLACES, values, strict=True)
    )
    table = f"photo,x,y,z,{columns}\n" + "".join(rows)
    found = of_table(folder, table, angles, more).load().inputs.orientations
    assert found is not None
    return found


def euler(order: Literal["XYZ", "YXZ"], *signs: float) -> Floats:
    return np.asarray(TRUE.as_euler(order, degrees=True) * np.array(signs or (1.0, 1.0, 1.0)))


def of_vehicle(camera: Floats) -> Floats:
    """Yaw, pitch, roll of the axes ahead, right, down, by an independent library."""
    return Rotation.from_matrix(NED.T @ TRUE.as_matrix() @ camera.T).as_euler("ZYX", degrees=True)


ELEMENTS = ",".join(f"r{i}{j}" for i in "123" for j in "123")
MATRIX = "system: matrix, rotates: image_to_ground, y_axis: up"
QUATERNION = "system: quaternion, rotates: ground_to_image, y_axis: down"
TO_GROUND = "rotates: image_to_ground, y_axis: up"
FLIPPED = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
FORMS = {
    "omega-phi-kappa": ("omega,phi,kappa", euler("XYZ"), "system: omega-phi-kappa"),
    "phi-omega-kappa": ("phi,omega,kappa", euler("YXZ"), "system: phi-omega-kappa"),
    "alpha-omega-kappa": ("alpha,omega,kappa", euler("YXZ", -1, 1, 1), "system: alpha-omega-kappa"),
    "gon": ("omega,phi,kappa", euler("XYZ") / 0.9, "system: omega-phi-kappa, unit: gon"),
    "yaw-pitch-roll": ("yaw,pitch,roll", of_vehicle(DOWN), "system: yaw-pitch-roll, looks: down"),
    "gimbal": ("yaw,pitch,roll", of_vehicle(AHEAD), "system: yaw-pitch-roll, looks: ahead"),
    "quaternion": ("qw,qx,qy,qz", TRUE.as_quat()[:, [3, 0, 1, 2]], f"system: quaternion, {TO_GROUND}"),
    "quaternion of COLMAP": ("qx,qy,qz,qw", (FLIPPED * TRUE.inv()).as_quat(), QUATERNION),
    "matrix": (ELEMENTS, TRUE.as_matrix().reshape(-1, 9), MATRIX),
    "matrix to the image": (
        ELEMENTS,
        TRUE.inv().as_matrix().reshape(-1, 9).round(7),
        "system: matrix, rotates: ground_to_image, y_axis: up",
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_is_the_same_rotation(tmp_path: Path, form: str) -> None:
    found = oriented(tmp_path, *FORMS[form])
    np.testing.assert_allclose(from_angles(found.angles, found.system), TRUE.as_matrix(), rtol=0.0, atol=2e-7)


@pytest.mark.parametrize("form", FORMS)
def test_azimuths_from_true_north_are_larger_by_the_convergence(tmp_path: Path, form: str) -> None:
    columns, values, said = FORMS[form]
    found = oriented(tmp_path, columns, values, f"{said}, north: true")
    utm = Proj("EPSG:32633")
    convergence = [utm.get_factors(*utm(east, north, inverse=True)).meridian_convergence for east, north, _ in PLACES]
    assert min(convergence) > 1.2
    into_grid = Rotation.from_euler("z", np.reshape(convergence, (-1, 1)), degrees=True)
    expected = (into_grid * TRUE).as_matrix()
    np.testing.assert_allclose(from_angles(found.angles, found.system), expected, rtol=0.0, atol=2e-7)


def test_yaw_is_an_azimuth_pitch_lifts_the_nose_and_roll_drops_the_right_wing(tmp_path: Path) -> None:
    values = np.array([[0, 0, 0], [90, 0, 0], [0, 10, 0], [0, 0, 10]], float)
    found = oriented(tmp_path, "yaw,pitch,roll", values, "system: yaw-pitch-roll, looks: down")
    rotations = from_angles(found.angles, found.system)
    np.testing.assert_allclose(rotations[0], np.eye(3), atol=1e-15)  # the top of the photo lies north
    np.testing.assert_allclose(rotations[1] @ [0, 1, 0], [1, 0, 0], atol=1e-15)  # east
    assert (rotations[2] @ [0, 0, -1])[1] > 0.1  # the camera looks ahead
    assert (rotations[3] @ [0, 0, -1])[0] < -0.1  # it looks to the left


def test_a_gimbal_at_minus_ninety_degrees_looks_down(tmp_path: Path) -> None:
    values = np.array([[30.0, -90.0, 0.0]] * 4)
    found = oriented(tmp_path, "yaw,pitch,roll", values, "system: yaw-pitch-roll, looks: ahead")
    expected = Rotation.from_euler("z", -30.0, degrees=True).as_matrix()
    np.testing.assert_allclose(from_angles(found.angles, found.system)[0], expected, atol=1e-12)


@pytest.mark.parametrize("form", ["omega-phi-kappa", "yaw-pitch-roll", "gimbal"])
def test_standard_deviations_are_those_of_drawn_angles(tmp_path: Path, form: str) -> None:
    columns, values, said = FORMS[form]
    sigma = np.array([0.05, 0.02, 0.09])
    of_rows = f"  sigma: [1, 1, 1]\n  sigma_angles: {sigma.tolist()}\n"
    found = oriented(tmp_path, columns, values, said, of_rows)
    steps = 1e-4 * np.eye(3)
    read = [oriented(tmp_path, columns, values + step, said) for step in steps]
    turned = [from_angles(each.angles, each.system) for each in read]
    rates = [Rotation.from_matrix(TRUE.inv().as_matrix() @ each).as_rotvec(degrees=True) / 1e-4 for each in turned]
    expected = np.sqrt(sum((rate * size) ** 2 for rate, size in zip(rates, sigma, strict=True)))
    np.testing.assert_allclose(np.degrees(found.sigma_turns), expected, rtol=1e-4)


def test_those_of_a_matrix_are_about_the_axes_of_the_photo(tmp_path: Path) -> None:
    columns, values, said = FORMS["matrix"]
    more = "  sigma: [1, 1, 1]\n  sigma_angles: [0.01, 0.02, 0.04]\n"
    found = oriented(tmp_path, columns, values, f"{said}, unit: gon", more)
    np.testing.assert_allclose(found.sigma_turns * 200 / np.pi, [[0.01, 0.02, 0.04]] * 4, rtol=1e-12)


@pytest.mark.parametrize(
    ("crs", "angles", "row", "place", "words"),
    [
        ("EPSG:32633", "system: yaw-pitch-roll", "", "project.yaml:31:", "`looks` is missing"),
        ("EPSG:32633", "system: matrix, y_axis: up", "", "project.yaml:31:", "`rotates` is missing"),
        ("EPSG:32633", "system: quaternion, rotates: ground_to_image", "", "project.yaml:31:", "`y_axis` is missing"),
        (
            "EPSG:32633",
            "system: omega-phi-kappa, looks: down",
            "",
            "project.yaml:31:",
            "`looks` says nothing of omega-phi-kappa",
        ),
        ("local", "system: omega-phi-kappa, north: true", "", "project.yaml:31:", "nothing says where true north is"),
        ("EPSG:32633", MATRIX, "1,0,0,0,1,0,0,0,-1", "imu.csv:2:12: r11:", "the matrix of photo 1001 is no rotation"),
        ("EPSG:32633", MATRIX, "2,0,0,0,2,0,0,0,2", "imu.csv:2:12: r11:", "without a scale"),
        ("EPSG:32633", MATRIX, "1,0,0,0,1,0,0,0", "imu.csv:1:", "no column `r33`"),
        ("EPSG:32633", QUATERNION, "1,1,0,0", "imu.csv:2:12: qw:", "quaternion of photo 1001 is 0.4142 off 1"),
    ],
)
def test_what_is_not_said_or_no_rotation_is_refused(
    tmp_path: Path, crs: str, angles: str, row: str, place: str, words: str
) -> None:
    columns = "qw,qx,qy,qz" if row.count(",") == 3 else ELEMENTS[: 4 * row.count(",") + 3]
    table = f"photo,x,y,z,{columns}\n1001,1,2,3,{row}\n" if row else "photo,x,y,z,a\n"
    of_table(tmp_path, table, angles, crs=crs).tells(place, words)
