"""Interior orientation: published and known deformations, every way to mix up marks; marks from distances; film."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import InputError
from photostrip.points import PhotoPoints
from photostrip.strip import interior
from photostrip.strip.corrections import InteriorSettings
from photostrip.strip.fiducial_marks import PLACES, solve
from photostrip.strip.interior import FilmDeformation, InteriorOrientation
from tests.loops import nonempty
from tests.strips import measured

Marks = Mapping[str, Floats]


DATA = Path(__file__).parents[1] / "data" / "interior"
PICOMETRE = 1e-9
CORNERS = Camera(
    "RC30",
    153.0,
    fiducials={"F1": (106.0, -106.0), "F2": (-106.0, -106.0), "F3": (-106.0, 106.0), "F4": (106.0, 106.0)},
)
SIDES = Camera(
    "RMK", 153.0, fiducials={"L": (-113.0, 0.02), "B": (0.01, -113.0), "R": (113.0, -0.01), "T": (-0.03, 113.0)}
)
EIGHT = Camera("RMK TOP", 153.0, fiducials=CORNERS.fiducials | SIDES.fiducials)
OBLONG = Camera(
    "MKF", 125.0, fiducials={"1": (110.0, -80.0), "2": (-110.0, -80.0), "3": (-110.0, 80.0), "4": (110.0, 80.0)}
)
CAMERAS = [pytest.param(camera, id=camera.name) for camera in (CORNERS, SIDES, EIGHT, OBLONG)]
SEEDS = st.integers(0, 2**32 - 1)


def calibrated(camera: Camera) -> dict[str, Floats]:
    return {name: np.array(xy) for name, xy in camera.fiducials.items()}


def points(photos: tuple[str, ...], xy: Floats) -> PhotoPoints:
    """Points P0, P1, ... at the same places of every photo."""
    return measured({photo: {f"P{n}": each for n, each in enumerate(xy)} for photo in photos})


def orient(
    photos: Mapping[str, Marks], camera: Camera = CORNERS, transform: str = "auto", **more: Camera
) -> InteriorOrientation:
    return interior.orient(measured(photos), dict.fromkeys(photos, camera) | more, InteriorSettings(transform))


def messages(photos: Mapping[str, Marks], camera: Camera = CORNERS, transform: str = "auto") -> list[str]:
    with pytest.raises(InputError) as caught:
        orient(photos, camera, transform)
    assert all(fault.key == "fiducial_measurements" for fault in nonempty(caught.value.faults))
    return [fault.message for fault in caught.value.faults]


def codes(found: InteriorOrientation) -> list[str]:
    return [note.code for note in found.notes]


def moved(marks: Marks, matrix: Floats, shift: tuple[float, float] = (0.0, 0.0)) -> dict[str, Floats]:
    return {name: matrix @ xy + np.array(shift) for name, xy in marks.items()}


def quarter_turns(times: int, *, mirrored: bool = False) -> Floats:
    turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), times)
    return np.asarray(turn @ np.diag([1.0, -1.0 if mirrored else 1.0]))


def film(camera: Camera, rng: np.random.Generator, deformation: float = 2e-3, noise: float = 0.01) -> dict[str, Floats]:
    """Marks of one photo on film: any small turn, shift, differential shrinkage of 0.2 %, 10 micrometres of noise."""
    angle = rng.uniform(-0.05, 0.05)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix = turn @ (np.eye(2) + rng.uniform(-deformation, deformation, (2, 2)))
    shift = rng.uniform(-200, 200, 2)
    return {name: matrix @ xy + shift + rng.normal(0, noise, 2) for name, xy in calibrated(camera).items()}


def exchanged(marks: Marks, a: str, b: str) -> dict[str, Floats]:
    return {**marks, a: marks[b], b: marks[a]}


def test_the_published_affine_transformation() -> None:
    rows = np.loadtxt(DATA / "fiducials.csv", delimiter=",", skiprows=1)
    camera = Camera("Noobeed", 152.058, fiducials={f"{int(row[0])}": (row[1], row[2]) for row in rows})
    found = orient({"95": {f"{int(row[0])}": row[3:] for row in rows}}, camera, "affine")
    published = np.loadtxt(DATA / "published_affine.csv", delimiter=",", skiprows=1, usecols=(1, 2, 3))
    coefficients = found.photo_from_measured.coefficients[0]
    assert coefficients[:2, :2] == pytest.approx(published[:, :2], abs=5e-16)  # all 15 printed decimals
    assert coefficients[:2, 3] == pytest.approx(published[:, 2], abs=5e-4)
    # one redundant mark for each axis: the four residuals of an axis have one size, 12.8 and 15.0 micrometres
    assert np.abs(found.residuals[0]) == pytest.approx(np.tile([0.0128, 0.0150], (4, 1)), abs=5e-5)
    assert found.redundancy.tolist() == [2]
    assert found.sigma0[0] == pytest.approx(np.sqrt((4 * 0.012778**2 + 4 * 0.014975**2) / 2), abs=1e-5)
    assert found.scale_x[0] == pytest.approx(0.0599885, abs=1e-7)
    assert codes(found) == ["measured-scale"]


@pytest.mark.parametrize("camera", CAMERAS)
@given(seed=SEEDS)
def test_film_deformation_is_taken_out(camera: Camera, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle, shift = rng.uniform(-0.7, 0.7), rng.uniform(-500, 500, 2)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    measured_from_photo = turn @ (np.eye(2) + rng.uniform(-2e-3, 2e-3, (2, 2)))
    found = orient({"1": moved(calibrated(camera), measured_from_photo, tuple(shift))}, camera)
    truth = rng.uniform(-110, 110, (30, 2))
    image = interior.transform(points(("1",), truth @ measured_from_photo.T + shift), found)
    assert np.abs(image.xy - truth).max() < PICOMETRE
    assert found.sigma0[0] < PICOMETRE
    assert found.transforms == ("affine",)
    assert not found.notes


def test_sigma0_is_the_precision_of_the_marks() -> None:
    rng = np.random.default_rng(7)
    photos = {f"{i}": film(EIGHT, rng) for i in range(400)}
    found = orient(photos, EIGHT)
    assert found.redundancy.tolist() == [10] * 400
    # 4000 redundant coordinates of 10 micrometres: sigma0 known to 1.1 %; film shrinks, so the scale counts little
    assert np.sqrt((found.sigma0**2).mean()) == pytest.approx(0.010, rel=0.04)
    assert not found.notes


def test_the_number_of_marks_decides() -> None:
    marks = calibrated(CORNERS)
    photos = {
        "1": marks,
        "2": {name: marks[name] for name in ("F1", "F3", "F4")},
        "3": {n: marks[n] for n in ("F2", "F4")},
    }
    found = orient(photos)
    assert found.transforms == ("affine", "conformal", "conformal")
    assert found.marks == (("F1", "F2", "F3", "F4"), ("F1", "F3", "F4"), ("F2", "F4"))
    assert found.redundancy.tolist() == [2, 2, 0]
    assert [(note.code, note.photos) for note in found.notes] == [("marks-unchecked", ("3",)), ("fewer-marks", ("2",))]


@pytest.mark.parametrize(
    ("transform", "names", "message"),
    [
        ("auto", "F1", r"photo 1: an interior orientation needs 2 fiducial marks, measured: 1 \(F1\)"),
        ("affine", "F1 F2", r"photo 1: the affine transformation needs 3 fiducial marks, measured: 2 \(F1, F2\)"),
        ("bilinear", "F1 F2 F3", "photo 1: the bilinear transformation needs 4 .* measured: 3"),
        ("projective", "F1 F2 F3", "photo 1: the projective transformation needs 4 .* measured: 3"),
        ("conformal", "", "photo 1: the conformal transformation needs 2 .* measured: none"),
    ],
)
def test_too_few_marks_are_refused(transform: str, names: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        orient({"1": {name: calibrated(CORNERS)[name] for name in names.split()}}, transform=transform)


def test_every_fault_of_every_photo_is_told_at_once() -> None:
    marks = calibrated(CORNERS)
    photos: dict[str, Marks] = {
        "1": marks,
        "2": {"F1": marks["F1"], "F2": marks["F1"]},
        "3": {},
        "4": {**marks, "F9": marks["F1"]},
        "5": exchanged(marks, "F1", "F2"),
        "6": {"F1": marks["F1"]},
    }
    found = messages(photos)
    assert [message.partition(":")[0] for message in found] == [f"photo {i}" for i in (4, 3, 6, 2, 5)]
    assert found[0] == "photo 4: camera RC30 has no mark F9"
    assert "all fiducial marks have the same coordinates" in found[3]


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize(
    ("turns", "name"), [(1, "90 degrees counter-clockwise"), (2, "180 degrees"), (3, "90 degrees clockwise")]
)
def test_photos_that_were_scanned_turned_are_turned_back_and_named(camera: Camera, turns: int, name: str) -> None:
    marks = calibrated(camera)
    photos = {"1": marks, "2": moved(marks, quarter_turns(turns), (300.0, 10.0)), "3": marks}
    found = orient(photos, camera)
    (note,) = found.notes
    assert (note.code, note.photos, note.severity) == ("photos-turned", ("2",), "warning")
    assert f"measured turned by {name} against the marks" in note.message
    truth = np.array([[50.0, 20.0], [-30.0, 80.0]])
    measured = points(("2",), truth @ quarter_turns(turns).T + [300.0, 10.0])
    assert np.abs(interior.transform(measured, found).xy - truth).max() < PICOMETRE
    everyone = orient(dict.fromkeys("123", photos["2"]), camera)
    assert [(each.code, each.photos, each.severity) for each in everyone.notes] == [
        ("photos-turned", ("1", "2", "3"), "note")
    ]


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("transform", ["auto", "conformal", "projective"])
def test_a_strip_measured_mirrored_is_mirrored_back_and_named(camera: Camera, transform: str) -> None:
    flip = quarter_turns(0, mirrored=True)
    marks = moved(calibrated(camera), flip, (0.0, 4000.0))
    two = {name: marks[name] for name in list(marks)[:2]}
    found = orient({"1": marks, "2": marks} | ({} if transform == "projective" else {"3": two}), camera, transform)
    assert found.mirrored.all()
    assert "photos-mirrored" in codes(found)
    truth = np.array([[50.0, 20.0], [-30.0, 80.0]])
    measured = points(found.photo_ids, truth @ flip.T + [0.0, 4000.0])
    # two marks show no hand: they follow the other photos of their camera
    assert np.abs(interior.transform(measured, found).xy - np.tile(truth, (len(found.photo_ids), 1))).max() < PICOMETRE


@pytest.mark.slow
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("mirrored", [False, True])
@given(seed=SEEDS)
def test_two_exchanged_marks_are_found_and_named(camera: Camera, mirrored: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scan = quarter_turns(int(rng.integers(4)), mirrored=mirrored)
    photos = {f"{i}": moved(film(camera, rng), scan) for i in range(3)}
    a, b = rng.choice(list(camera.fiducials), 2, replace=False)
    photos["1"] = exchanged(photos["1"], a, b)
    (message,) = messages(photos, camera)
    named = [f"with {x} and {y} exchanged" in message for x, y in ((a, b), (b, a))]
    assert message.startswith("photo 1: ")
    assert any(named), message


def test_a_photo_of_another_camera_is_refused_without_a_guess() -> None:
    rng = np.random.default_rng(5)
    photos = {"1": film(EIGHT, rng), "2": {name: rng.uniform(-100, 100, 2) for name in EIGHT.fiducials}}
    (message,) = messages(photos, EIGHT)
    assert message.startswith("photo 2: the fiducial marks do not form the pattern of camera RMK TOP: up to")
    assert "exchanged" not in message


@pytest.mark.parametrize("camera", CAMERAS)
def test_no_false_alarm_on_old_film_and_paper(camera: Camera) -> None:
    """1000 photos with 1 % of differential shrinkage, ten times that of film, and marks of 50 micrometres."""
    rng = np.random.default_rng(11)
    photos = {f"{i}": film(camera, rng, deformation=5e-3, noise=0.05) for i in range(1000)}
    found = orient(photos, camera)
    assert len(found.photo_ids) == 1000
    assert not {"photos-turned", "photos-mirrored"} & set(codes(found))


def test_a_poor_fit_names_photo_and_mark() -> None:
    rng = np.random.default_rng(2)
    photos = {f"{i}": film(EIGHT, rng) for i in range(10)}
    photos["4"]["T"] = photos["4"]["T"] + [0.6, 0.0]
    photos["7"]["B"] = photos["7"]["B"] + [0.0, 0.9]
    (note,) = orient(photos, EIGHT).notes
    assert (note.code, note.photos) == ("marks-fit-poorly", ("4", "7"))
    assert "worst photo 7, sigma0" in note.message
    assert "at mark B" in note.message
    (alike,) = orient({"1": {**calibrated(CORNERS), "F2": np.array([-106.0, -105.0])}}).notes
    assert alike.message.endswith("with so few marks it cannot be told which is wrong")


AT_CORNERS = {"F1": "bottom-right", "F2": "bottom-left", "F3": "top-left", "F4": "top-right"}
AT_SIDES = {"L": "left", "R": "right", "T": "top", "B": "bottom"}
ANGSTROM = 1e-7  # mm


def figure(places: dict[str, str], rng: np.random.Generator, irregular: float = 0.3) -> dict[str, Floats]:
    return {name: 106.0 * np.array(PLACES[place]) + rng.normal(0, irregular, 2) for name, place in places.items()}


def distances(marks: dict[str, Floats]) -> list[tuple[str, str, float]]:
    return [(a, b, float(np.linalg.norm(marks[a] - marks[b]))) for a, b in combinations(marks, 2)]


@given(st.integers(0, 2**32 - 1), st.sampled_from([AT_CORNERS, AT_SIDES, AT_CORNERS | AT_SIDES]))
def test_the_figure_comes_back(seed: int, places: dict[str, str]) -> None:
    truth = figure(places, np.random.default_rng(seed))
    found = solve(distances(truth), places=places)
    assert np.abs(found.residuals).max() < ANGSTROM
    assert found.redundancy == len(places) * (len(places) - 1) // 2 - (2 * len(places) - 3)
    solved = {name: np.array(xy) for name, xy in found.marks.items()}
    assert [each[2] for each in distances(solved)] == pytest.approx(
        [each[2] for each in distances(truth)], abs=ANGSTROM
    )
    for name, place in nonempty(places.items()):  # not mirrored, not turned: every mark is where its word says
        assert np.linalg.norm(solved[name] - 106.0 * np.array(PLACES[place])) < 3


def test_five_distances_fix_four_marks_and_six_check_them() -> None:
    truth = figure(AT_CORNERS, np.random.default_rng(6))
    every = distances(truth)
    assert solve(every[:-1], places=AT_CORNERS).redundancy == 0
    a, b, length = every[0]
    wrong = solve([(a, b, length + 0.1), *every[1:]], places=AT_CORNERS)
    assert wrong.redundancy == 1
    assert 0.02 < wrong.sigma0 < 0.1


def refusals(rows: list[tuple[str, str, float]], places: dict[str, str] = AT_CORNERS) -> list[str]:
    with pytest.raises(InputError) as caught:
        solve(rows, places=places)
    return [str(fault) for fault in caught.value.faults]


def test_every_wrong_distance_is_named() -> None:
    lines = refusals([("F1", "F2", 212.0), ("F1", "F9", 212.0), ("F2", "F2", 1.0)])
    assert lines[0].startswith("fiducial_distances[1]: the camera has no mark F9; expected one of F1, F2, F3, F4")
    assert lines[1].startswith("fiducial_distances[2]: a distance from mark F2 to itself")
    assert len(lines) == 2


MICROMETRE = 1e-3
EDGE = 106.0
FOUR_MARKS = {"1": (EDGE, -EDGE), "2": (-EDGE, -EDGE), "3": (-EDGE, EDGE), "4": (EDGE, EDGE)}
EIGHT_MARKS = FOUR_MARKS | {"5": (EDGE, 0.0), "6": (-EDGE, 0.0), "7": (0.0, EDGE), "8": (0.0, -EDGE)}
RESEAU = {f"{x}/{y}": (53.0 * x, 53.0 * y) for x in range(-2, 3) for y in range(-2, 3)}
PHOTOS = tuple(str(n) for n in range(60))


def bent(photo: Numbers, xy: Floats, shape: Floats) -> Floats:
    """Film with a bend of its own on each photo: terms of second and third order, shrunk by 0.1 % in x."""
    u = xy / EDGE
    terms = np.stack([u[:, 0] ** 2, u[:, 0] * u[:, 1], u[:, 1] ** 2, (u**3).sum(1)], -1)
    return np.asarray(xy * [1.001, 1.0] + np.einsum("nck,nk->nc", shape[photo], terms))


def surveyed(
    marks: dict[str, tuple[float, float]], noise: float = 3e-3
) -> tuple[dict[str, Camera], PhotoPoints, PhotoPoints, Floats]:
    rng = np.random.default_rng(7)
    shape = rng.normal(0, 10e-3, (len(PHOTOS), 2, 4))
    n, m = len(PHOTOS), len(marks)
    photo, mark = np.repeat(np.arange(n), m), np.tile(np.arange(m), n)
    calibrated = np.array(list(marks.values()))[mark]
    seen = bent(photo, calibrated, shape) + rng.normal(0, noise, calibrated.shape)
    fiducials = PhotoPoints(PHOTOS, tuple(marks), photo, mark, seen, np.full((n * m, 2), 0.003))
    truth, owner = rng.uniform(-100, 100, (40 * n, 2)), np.repeat(np.arange(n), 40)
    ids = tuple(f"P{i}" for i in range(len(truth)))
    xy = bent(owner, truth, shape)
    points = PhotoPoints(PHOTOS, ids, owner, np.arange(len(truth)), xy, np.full((len(truth), 2), 0.005))
    camera = Camera("RC10", 153.0, fiducials=marks)
    return dict.fromkeys(PHOTOS, camera), fiducials, points, truth


def rms_um(marks: dict[str, tuple[float, float]], residuals: str) -> float:
    cameras, fiducials, points, truth = surveyed(marks)
    found = interior.orient(fiducials, cameras, InteriorSettings("affine", residuals))
    return float(np.sqrt(((interior.transform(points, found).xy - truth) ** 2).mean()) / MICROMETRE)


@given(st.integers(0, 2**32 - 1))
def test_the_spline_goes_through_the_marks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    marks = rng.uniform(-110, 110, (9, 2))
    film = FilmDeformation.from_residuals([marks], [rng.normal(0, 0.02, (9, 2))])
    assert np.abs(film.corrected(np.zeros(9, np.intp), film.nodes[0]) - marks).max() < PICOMETRE


@pytest.mark.parametrize(
    ("marks", "least", "most"),
    [(FOUR_MARKS, 0.9, 1.1), (EIGHT_MARKS, 0.5, 0.7), (RESEAU, 0.3, 0.5)],
    ids=["four corners", "eight", "reseau"],
)
def test_interpolation_helps_as_far_as_the_marks_see_the_bend(
    marks: dict[str, tuple[float, float]], least: float, most: float
) -> None:
    assert least < rms_um(marks, "interpolate") / rms_um(marks, "ignore") < most


def test_photos_whose_marks_cannot_tell_are_named() -> None:
    cameras, fiducials, points, _ = surveyed(FOUR_MARKS)
    rows = ~((fiducials.photo == 3) & (fiducials.point == 2))
    fewer = PhotoPoints(
        PHOTOS,
        fiducials.point_ids,
        fiducials.photo[rows],
        fiducials.point[rows],
        fiducials.xy[rows],
        fiducials.sigma[rows],
    )
    ways = [interior.orient(fewer, cameras, InteriorSettings("affine", way)) for way in ("ignore", "interpolate")]
    (note,) = [note for note in ways[1].notes if note.code == "film-unseen"]
    assert note.photos == ("3",)
    one = points.photo == 3
    left, right = (interior.transform(points, found).xy[one] for found in ways)
    assert np.array_equal(left, right)
