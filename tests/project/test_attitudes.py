"""Given rotations in every form: what comes of them is the rotation that scipy makes of the same words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest
from pyproj import Proj
from scipy.spatial.transform import Rotation

from photostrip.geometry.rotation import from_angles
from tests.project.samples import FILES, PROJECT, sample
from tests.project.test_cameras_given import BUNDLE

if TYPE_CHECKING:
    from pathlib import Path

    from photostrip.arrays import Floats
    from photostrip.pipeline.inputs import GivenOrientations

PHOTOS = ("1001", "1002", "2001", "2002")
PLACES = np.array([[650000.0 + 900.0 * n, 4650000.0, 2000.0] for n in range(len(PHOTOS))])  # far from the meridian
TRUE = Rotation.from_euler("XYZ", [[3, -4, 100], [-2, 5, 80], [1, 2, -175], [-85, 3, 20]], degrees=True)
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # east, north, up of north, east, down
DOWN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # ahead, right, down of image axes
AHEAD = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # right is right, up is up, against the view


START = "  role: approximate\n"


def given(
    folder: Path, columns: str, values: Floats, angles: str, more: str = "  role: approximate\n"
) -> GivenOrientations:
    frame = 'crs: "EPSG:32633"\n  axes: [east, north, up]'
    text = f"orientations:\n  file: imu.csv\n  {frame}\n  angles: {{{angles}}}\n{more}"
    rows = (
        f"{photo},{','.join(repr(float(each)) for each in (*place, *row))}\n"
        for photo, place, row in zip(PHOTOS, PLACES, values, strict=True)
    )
    project = PROJECT.replace("processing:\n", BUNDLE).replace("output:\n", f"{text}output:\n")
    files = {**FILES, "project.yaml": project, "imu.csv": f"photo,x,y,z,{columns}\n" + "".join(rows)}
    found = sample(folder, files).load().inputs.orientations
    assert found is not None
    return found


def euler(order: Literal["XYZ", "YXZ"], *signs: float) -> Floats:
    return np.asarray(TRUE.as_euler(order, degrees=True) * np.array(signs or (1.0, 1.0, 1.0)))


def of_vehicle(camera: Floats) -> Floats:
    """Yaw, pitch, roll of the axes ahead, right, down, by an independent library."""
    return Rotation.from_matrix(NED.T @ TRUE.as_matrix() @ camera.T).as_euler("ZYX", degrees=True)


FORMS = {
    "omega-phi-kappa": ("omega,phi,kappa", euler("XYZ"), "system: omega-phi-kappa"),
    "phi-omega-kappa": ("phi,omega,kappa", euler("YXZ"), "system: phi-omega-kappa"),
    "alpha-omega-kappa": ("alpha,omega,kappa", euler("YXZ", -1, 1, 1), "system: alpha-omega-kappa"),
    "gon": ("omega,phi,kappa", euler("XYZ") / 0.9, "system: omega-phi-kappa, unit: gon"),
    "yaw-pitch-roll": ("yaw,pitch,roll", of_vehicle(DOWN), "system: yaw-pitch-roll, looks: down"),
    "gimbal": ("yaw,pitch,roll", of_vehicle(AHEAD), "system: yaw-pitch-roll, looks: ahead"),
    "quaternion": (
        "qw,qx,qy,qz",
        TRUE.as_quat()[:, [3, 0, 1, 2]],
        "system: quaternion, rotates: image_to_ground, y_axis: up",
    ),
    "quaternion of COLMAP": (
        "qx,qy,qz,qw",
        (Rotation.from_matrix(np.diag([1.0, -1.0, -1.0])) * TRUE.inv()).as_quat(),
        "system: quaternion, rotates: ground_to_image, y_axis: down",
    ),
    "matrix": (
        ",".join(f"r{i}{j}" for i in "123" for j in "123"),
        TRUE.as_matrix().reshape(-1, 9),
        "system: matrix, rotates: image_to_ground, y_axis: up",
    ),
    "matrix to the image": (
        ",".join(f"r{i}{j}" for i in "123" for j in "123"),
        TRUE.inv().as_matrix().reshape(-1, 9).round(7),
        "system: matrix, rotates: ground_to_image, y_axis: up",
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_is_the_same_rotation(tmp_path: Path, form: str) -> None:
    found = given(tmp_path, *FORMS[form])
    np.testing.assert_allclose(from_angles(found.angles, found.system), TRUE.as_matrix(), rtol=0.0, atol=2e-7)


@pytest.mark.parametrize("form", FORMS)
def test_azimuths_from_true_north_are_larger_by_the_convergence(tmp_path: Path, form: str) -> None:
    columns, values, said = FORMS[form]
    found = given(tmp_path, columns, values, f"{said}, north: true")
    utm = Proj("EPSG:32633")
    convergence = [utm.get_factors(*utm(east, north, inverse=True)).meridian_convergence for east, north, _ in PLACES]
    assert min(convergence) > 1.2
    into_grid = Rotation.from_euler("z", np.reshape(convergence, (-1, 1)), degrees=True)
    expected = (into_grid * TRUE).as_matrix()
    np.testing.assert_allclose(from_angles(found.angles, found.system), expected, rtol=0.0, atol=2e-7)


def test_yaw_is_an_azimuth_pitch_lifts_the_nose_and_roll_drops_the_right_wing(tmp_path: Path) -> None:
    values = np.array([[0, 0, 0], [90, 0, 0], [0, 10, 0], [0, 0, 10]], float)
    found = given(tmp_path, "yaw,pitch,roll", values, "system: yaw-pitch-roll, looks: down")
    rotations = from_angles(found.angles, found.system)
    np.testing.assert_allclose(rotations[0], np.eye(3), atol=1e-15)  # the top of the photo lies north
    np.testing.assert_allclose(rotations[1] @ [0, 1, 0], [1, 0, 0], atol=1e-15)  # east
    assert (rotations[2] @ [0, 0, -1])[1] > 0.1  # the camera looks ahead
    assert (rotations[3] @ [0, 0, -1])[0] < -0.1  # it looks to the left


def test_a_gimbal_at_minus_ninety_degrees_looks_down(tmp_path: Path) -> None:
    values = np.array([[30.0, -90.0, 0.0]] * 4)
    found = given(tmp_path, "yaw,pitch,roll", values, "system: yaw-pitch-roll, looks: ahead")
    expected = Rotation.from_euler("z", -30.0, degrees=True).as_matrix()
    np.testing.assert_allclose(from_angles(found.angles, found.system)[0], expected, atol=1e-12)


@pytest.mark.parametrize("form", ["omega-phi-kappa", "yaw-pitch-roll", "gimbal"])
def test_standard_deviations_are_those_of_drawn_angles(tmp_path: Path, form: str) -> None:
    columns, values, said = FORMS[form]
    sigma = np.array([0.05, 0.02, 0.09])
    of_rows = f"  sigma: [1, 1, 1]\n  sigma_angles: {sigma.tolist()}\n"
    found = given(tmp_path, columns, values, said, of_rows)
    steps = 1e-4 * np.eye(3)
    turned = [from_angles(*_as_read(tmp_path, form, values + step)) for step in steps]
    rates = [Rotation.from_matrix(TRUE.inv().as_matrix() @ each).as_rotvec(degrees=True) / 1e-4 for each in turned]
    expected = np.sqrt(sum((rate * size) ** 2 for rate, size in zip(rates, sigma, strict=True)))
    np.testing.assert_allclose(np.degrees(found.sigma_turns), expected, rtol=1e-4)


def _as_read(folder: Path, form: str, values: Floats) -> tuple[Floats, str]:
    found = given(folder, FORMS[form][0], values, FORMS[form][2])
    return found.angles, found.system


def test_those_of_a_matrix_are_about_the_axes_of_the_photo(tmp_path: Path) -> None:
    columns, values, said = FORMS["matrix"]
    more = "  sigma: [1, 1, 1]\n  sigma_angles: [0.01, 0.02, 0.04]\n"
    found = given(tmp_path, columns, values, f"{said}, unit: gon", more)
    np.testing.assert_allclose(found.sigma_turns * 200 / np.pi, [[0.01, 0.02, 0.04]] * 4, rtol=1e-12)


MATRIX = "system: matrix, rotates: image_to_ground, y_axis: up"


@pytest.mark.parametrize(
    ("crs", "angles", "row", "place", "words"),
    [
        ("EPSG:32633", "system: yaw-pitch-roll", "", ":31:", "`looks` is missing"),
        ("EPSG:32633", "system: matrix, y_axis: up", "", ":31:", "`rotates` is missing"),
        ("EPSG:32633", "system: quaternion, rotates: ground_to_image", "", ":31:", "`y_axis` is missing"),
        ("EPSG:32633", "system: omega-phi-kappa, looks: down", "", ":31:", "`looks` says nothing of omega-phi-kappa"),
        ("local", "system: omega-phi-kappa, north: true", "", ":31:", "nothing says where true north is"),
        ("EPSG:32633", MATRIX, "1,0,0,0,1,0,0,0,-1", "imu.csv:2:12: r11:", "the matrix of photo 1001 is no rotation"),
        ("EPSG:32633", MATRIX, "2,0,0,0,2,0,0,0,2", "imu.csv:2:12: r11:", "without a scale"),
        ("EPSG:32633", MATRIX, "1,0,0,0,1,0,0,0", "imu.csv:1:", "no column `r33`"),
        (
            "EPSG:32633",
            "system: quaternion, rotates: ground_to_image, y_axis: down",
            "1,1,0,0",
            "imu.csv:2:12: qw:",
            "the length of the quaternion of photo 1001 is 0.4142 off 1",
        ),
    ],
)
def test_what_is_not_said_or_no_rotation_is_refused(
    tmp_path: Path, crs: str, angles: str, row: str, place: str, words: str
) -> None:
    matrix = [f"r{i}{j}" for i in "123" for j in "123"]
    columns = "qw,qx,qy,qz" if row.count(",") == 3 else ",".join(matrix[: row.count(",") + 1])
    table = f"photo,x,y,z,{columns}\n1001,1,2,3,{row}\n" if row else "photo,x,y,z,a\n"
    text = (
        f'orientations:\n  file: imu.csv\n  crs: "{crs}"\n  axes: [east, north, up]\n  angles: {{{angles}}}\n'
        "  role: approximate\n"
    )
    project = PROJECT.replace("processing:\n", BUNDLE).replace("output:\n", f"{text}output:\n")
    lines = sample(tmp_path, {**FILES, "project.yaml": project, "imu.csv": table}).lines()
    assert any(words in line and place in line for line in lines), lines
