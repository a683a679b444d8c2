"""The projects in sample_data: what others found with the same measurements, and what this program found before.

Numbers of others come from the README of each sample. Relative orientation is quoted there in residuals shared by both
photos; a y parallax, left minus right, is larger by the square root of two.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import ROLES, Result, StripResult
from photostrip.pipeline.run import triangulate
from photostrip.points import ControlPoints
from photostrip.project.loading import Project, load_project
from photostrip.result import table as tables
from photostrip.result.document import document_of
from photostrip.result.table import plain_of
from tests.loops import nonempty
from tests.renew_golden import SAMPLES, baseline, kept, simulated
from tests.source_tree import ROOT

DATA = ROOT / "sample_data"
APOLLO, SXB, SIMULATED = "apollo15-metric-strip", "sxb-strasbourg", "simulated-20"
MICROMETRE = 1e-3  # mm
SHARED = np.sqrt(2.0)  # y parallax, left minus right, over the residual that each of the two photos takes
OUTLIER = "AS15_000055189"


@cache
def project(name: str) -> Project:
    return load_project(DATA / name / "project.yaml")


@cache
def result(name: str) -> Result:
    return triangulate(project(name).inputs, project(name).settings)


def rows_of(name: str, file: str) -> list[dict[str, str]]:
    with (DATA / name / file).open(encoding="utf-8", newline="") as opened:
        return list(csv.DictReader(opened))


def columns(rows: Iterable[dict[str, str]], names: str) -> Floats:
    return np.array([[float(row[name]) for name in names.split()] for row in rows])


def with_control(inputs: Inputs, wanted: Sequence[str]) -> Inputs:
    """Give the same project with other points as control, all others as check."""
    control = inputs.control
    check = np.array([name not in wanted for name in control.ids])
    return replace(inputs, control=replace(control, check=check))


def with_settings(
    name: str, *, adjustment: str = "similarity", degree: str = "auto", screening: str = "auto"
) -> Settings:
    given = project(name).settings
    return replace(
        given,
        adjustment=adjustment,
        relative=replace(given.relative, screening=screening),
        polynomial=replace(given.polynomial, degree=degree),
    )


def rms(values: Floats) -> Floats:
    found: Floats = np.sqrt(np.nanmean(np.asarray(values) ** 2, axis=0))
    return found


def parallax_rms(strip: StripResult) -> Floats:
    """Rms of the y parallaxes of each pair that were used, micrometres, shared by both photos."""
    orientation = strip.of_photos.orientation
    used = orientation.used
    by_pair = [orientation.parallax[used & (orientation.pairs.pair == n)] for n in range(orientation.pairs.size)]
    found: Floats = np.array([rms(each) for each in by_pair]) / SHARED / MICROMETRE
    return found


def largest_parallax(found: Result) -> tuple[str, float]:
    """Point with the largest y parallax of the first strip, and its residual shared by both photos, micrometres."""
    orientation = found.strips[0].of_photos.orientation
    row = int(np.argmax(np.abs(orientation.parallax)))
    name = found.refined.observations.point_ids[orientation.point[row]]
    return name, float(abs(orientation.parallax[row]) / SHARED / MICROMETRE)


def ratio_spread(strip: StripResult) -> Floats:
    """Relative standard deviation of the scale ratios of all common points of each joint, rejected ones too."""
    joints = strip.of_photos.formed.junctions
    ratios = [joints.ratio[joints.junction == n] for n in range(len(joints.factor))]
    return np.array([each.std(ddof=1) / each.mean() for each in ratios])


def differences(found: Result, *, check: bool) -> Floats:
    """Adjusted minus given in the given frame, of the control or of the check points that have coordinates."""
    chosen = (found.inputs.control.check == check) & (found.control_rows >= 0) & found.inputs.control.use.any(axis=1)
    chosen_rows: Floats = found.control_differences[chosen]
    return chosen_rows


# Largest change that goes unnoticed: of the last digits that are written, and far below what they are good for.
TOLERANCES = {"_um": 0.11, "_ppm": 0.11, "_deg": 2e-6, "value": 0.11}
ROTATION = re.compile(r"[ar][123][123]")
METRES = {"x", "y", "z", "dx", "dy", "dz", "plan", "height", "base", "flying_height", "along", "across", "up"}
METRE_TOLERANCE = 1e-3
ANGLES = ("alpha", "omega", "phi", "kappa", "alpha1", "kappa1", "alpha2", "omega2", "kappa2", "tau", "nu")
ANGLE_TOLERANCE = 2e-6  # degrees
RELATIVE_TOLERANCE = 1e-4  # of test values, coefficients, standard deviations
DECIMALS = re.compile(r"\d+\.\d+")


def tolerance(path: str, number: float) -> float:
    """Give what a number may change; `path` is where it stands, as in ``points.12.x``."""
    words = [word for word in path.split(".") if not word.isdecimal()]
    if "polynomial_terms" in words:
        return RELATIVE_TOLERANCE * abs(number) + 1e-14
    if ROTATION.fullmatch(words[-1]):
        return 1e-8
    if words[-1].endswith(ANGLES) or words[-1].startswith("angle_"):
        return ANGLE_TOLERANCE
    for ending, allowed in TOLERANCES.items():
        if words[-1].endswith(ending):
            return allowed
    return (
        METRE_TOLERANCE
        if METRES & {*words[-2:], words[-1].rpartition("_")[2]}
        else RELATIVE_TOLERANCE * abs(number) + 1e-9
    )


def same(before: Any, now: Any, path: str) -> bool:  # noqa: ANN401 (any JSON)
    """Tell whether a single value is still what it was, as far as its digits mean anything."""
    if isinstance(before, float) and isinstance(now, float):
        return abs(now - before) <= tolerance(path, before)
    if isinstance(before, str) and isinstance(now, str):
        return DECIMALS.sub("#", now) == DECIMALS.sub("#", before)  # the numbers in it stand elsewhere as numbers
    return bool(before == now)


def changes(before: Any, now: Any, path: str = "") -> Iterator[str]:  # noqa: ANN401 (any JSON)
    """Give what is different between two results, by the path to it."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in sorted(before.keys() | now.keys()):
            yield from changes(before.get(key, "nothing"), now.get(key, "nothing"), f"{path}.{key}")
    elif isinstance(before, list) and isinstance(now, list):
        if len(before) != len(now):
            yield f"{path}: {len(now)} elements, {len(before)} before"
        for number, pair in enumerate(zip(before, now, strict=False)):
            yield from changes(*pair, f"{path}.{number}")
    elif not same(before, now, path):
        yield f"{path}: {now!r}, {before!r} before"


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_gives_what_it_gave_before(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    before = json.loads(baseline(name).read_text(encoding="utf-8"))
    found = list(changes(before, plain_of(kept(name))))
    assert found == [], "when the change is meant: make golden, and review the diff"


@cache
def apollo(*, free: bool = True, **wanted: str) -> Result:
    """Adjust the lunar strip; `free`: on all of its 303 points, otherwise on the 20 of the project."""
    inputs = project(APOLLO).inputs
    if free:
        rows = rows_of(APOLLO, "control.csv")
        given, every = columns(rows, "x y z"), np.ones((len(rows), 3), bool)
        ids = tuple(row["point"] for row in rows)
        control = ControlPoints(ids, given, every, ~every[:, 0], np.full_like(given, 15.0))
        inputs = replace(inputs, control=control)
    return triangulate(inputs, with_settings(APOLLO, **wanted))


def level_axes(xyz: Floats) -> Floats:
    """East, north and up on a sphere, in the middle of points."""
    up = xyz.mean(axis=0) / np.linalg.norm(xyz.mean(axis=0))
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return np.array([east, np.cross(up, east), up])


def lunar_errors(found: Result, *, check: bool) -> Floats:
    """Adjusted minus published positions, east, north and up in the middle of the strip, metres."""
    published = {row["point"]: columns([row], "x y z")[0] for row in rows_of(APOLLO, "reference.csv")}
    ids = np.array(found.refined.observations.point_ids)[found.points.number]
    control = found.inputs.control
    chosen = {
        name
        for name, is_check, use in zip(control.ids, control.check, control.use, strict=True)
        if is_check == check and use.any()
    }
    rows = [row for row, name in enumerate(ids) if name in chosen]
    given = np.array([published[ids[row]] for row in rows])
    errors: Floats = (found.points.cartesian[rows] - given) @ level_axes(given).T
    return errors


def test_lunar_pairs_fit_and_models_are_joined_as_others_found() -> None:
    found = apollo(screening="none", free=False)
    strip = found.strips[0]
    assert parallax_rms(strip) == pytest.approx([14.8, 8.2, 6.9, 6.8], abs=0.06)
    name, size = largest_parallax(found)
    assert name == OUTLIER
    assert size == pytest.approx(128.0, abs=0.5)
    joints = strip.of_photos.formed.junctions
    assert np.bincount(joints.junction).tolist() == [31, 43, 64]
    assert ratio_spread(strip) == pytest.approx([2.1e-3, 8.5e-4, 5.9e-4], rel=0.08)
    assert [found.refined.observations.point_ids[point] for point in joints.point[~joints.used]] == [OUTLIER]


@pytest.mark.slow
@pytest.mark.parametrize("screening", ["auto", "parallax+grubbs", "tau", "deletion", "robust"])
def test_the_lunar_outlier_is_found_and_nothing_else(screening: str) -> None:
    document = document_of(apollo(screening=screening, free=False))
    rejected = [(row["photo"], row["other_photo"], row["point"]) for row in document["rejected"]]
    assert rejected == [("F1", "F2", OUTLIER)]


@pytest.mark.slow
def test_without_the_outlier_the_first_lunar_pair_fits_like_the_others() -> None:
    assert parallax_rms(result(APOLLO).strips[0]) == pytest.approx([5.6, 8.2, 6.9, 6.8], abs=0.06)


@pytest.mark.parametrize(
    ("adjustment", "degree", "left"),
    [("similarity", "auto", [19.5, 16.7, 47.8]), ("polynomial", "2", [17.1, 14.1, 38.5])],
)
def test_a_fit_to_all_lunar_points_leaves_what_others_found(adjustment: str, degree: str, left: list[float]) -> None:
    errors = lunar_errors(apollo(adjustment=adjustment, degree=degree, screening="none"), check=False)
    assert len(errors) == 303
    assert rms(errors) == pytest.approx(left, rel=0.2)


@pytest.mark.slow
def test_lunar_check_points_are_as_good_as_others_found() -> None:
    errors = lunar_errors(apollo(free=False), check=True)
    assert len(errors) == 282
    assert rms(errors) == pytest.approx([22, 19, 53], rel=0.2)


def test_the_polynomial_helps_the_lunar_strip() -> None:
    found = apollo(free=False, adjustment="polynomial")
    simple, better = lunar_errors(apollo(free=False), check=True), lunar_errors(found, check=True)
    strip = found.strips[0]
    assert strip.polynomial is not None
    assert strip.polynomial.degree == 2
    assert (rms(better) < 0.9 * rms(simple)).all()
    # No better than with all points as control: then check points would have leaked into the fit.
    limit = rms(lunar_errors(apollo(adjustment="polynomial", degree="2", screening="none"), check=False))
    assert (rms(better) > 0.9 * limit).all()


@cache
def strasbourg(control: tuple[str, ...] = (), adjustment: str = "similarity") -> Result:
    """Adjust the Strasbourg strip on some of its control points, by default on all."""
    inputs = project(SXB).inputs
    chosen = control or inputs.control.ids
    return triangulate(with_control(inputs, chosen), with_settings(SXB, adjustment=adjustment))


def in_order_of_ids() -> list[str]:
    return sorted(project(SXB).inputs.control.ids, key=int)


def test_strasbourg_pairs_fit_and_models_are_joined_as_others_found() -> None:
    found = strasbourg()
    strip = found.strips[0]
    assert strip.of_photos.orientation.points_used.tolist() == [233, 206]
    assert parallax_rms(strip) == pytest.approx([5.6, 5.0], abs=0.06)
    assert largest_parallax(found)[1] == pytest.approx(13.8, abs=0.4)
    assert strip.of_photos.rejections == ()
    assert np.bincount(strip.of_photos.formed.junctions.junction).tolist() == [95]
    assert ratio_spread(strip) == pytest.approx([8.7e-4], rel=0.03)


def test_a_similarity_on_all_strasbourg_control_leaves_what_others_found() -> None:
    assert rms(differences(strasbourg(), check=False)) == pytest.approx([0.10, 0.07, 0.36], abs=0.01)


@pytest.mark.parametrize("method", ["similarity", "bundle"])
def test_a_digit_of_a_thousand_metres_is_found_although_the_strasbourg_control_fits_badly(method: str) -> None:
    inputs = project(SXB).inputs
    wrong = inputs.control.enu + np.outer([name == "317" for name in inputs.control.ids], [1000.0, 0.0, 0.0])
    inputs = replace(inputs, control=replace(inputs.control, enu=wrong))
    found = triangulate(inputs, with_settings(SXB, adjustment=method)).strips[0].screened_control.rejections
    assert [inputs.control.ids[each.row] for each in found] == ["317"]


@pytest.mark.parametrize("first", [0, 1])
def test_strasbourg_check_points_are_as_weak_in_height_as_others_found(first: int) -> None:
    found = strasbourg(tuple(in_order_of_ids()[first::2]))
    east, north, up = rms(differences(found, check=True))
    assert 0.11 * 0.9 < east < 0.16 * 1.1
    assert 0.11 * 0.9 < north < 0.15 * 1.1
    assert 1.0 * 0.9 < up < 1.9 * 1.1


def published_orientations() -> tuple[Floats, Floats, Floats]:
    """Centres, rotations from image to ground and the standard deviations of both as published (metres, degrees).

    Angles are those of the matrix R3(kappa) R2(phi) R1(omega) from ground to image.
    """
    rows = rows_of(SXB, "reference.csv")
    angles = columns(rows, "omega_deg phi_deg kappa_deg")
    sigmas = columns(rows, "sigma_x sigma_y sigma_z sigma_omega_deg sigma_phi_deg sigma_kappa_deg")
    return columns(rows, "x y z"), Rotation.from_euler("XYZ", angles, degrees=True).as_matrix(), sigmas


def test_strasbourg_orientations_agree_with_the_published_bundle() -> None:
    found = strasbourg()
    strip = found.strips[0]
    centers, rotations, sigmas = published_orientations()
    shifts = strip.intermediate.cartesian_from_intermediate(strip.resection.centers) - centers
    turns = strip.intermediate.cartesian_rotations(strip.resection.rotations) @ rotations.transpose(0, 2, 1)
    angles = np.degrees(np.stack([turns[:, 2, 1], turns[:, 0, 2], turns[:, 1, 0]], axis=1))
    assert np.abs(shifts).max() < 1.2
    assert np.abs(angles).max() < 0.04
    # The bundle takes two more photos and all points at once: in its own standard deviations we are near, not on it.
    ratio = np.column_stack([shifts, angles]) / sigmas
    assert np.abs(ratio).max() < 3
    assert rms(ratio).min() > 0.01


def test_the_written_angles_are_those_of_the_published_convention() -> None:
    written = {row["id"]: [row[f"angle_{k}"] for k in (1, 2, 3)] for row in document_of(strasbourg())["photos"]}
    for row in nonempty(rows_of(SXB, "reference.csv")):
        omega, phi, kappa = columns([row], "omega_deg phi_deg kappa_deg")[0]
        assert written[row["photo"]] == pytest.approx([omega, phi, kappa], abs=0.05)


SIGMA_UM = 5.0
GROUND_SIGMA = 0.05  # m, 5 micrometres at 1:10 000
# Rms at points that are not control, in units of the above: 20 models, 9 points and more, 4 bands of 3 control points,
# third degree, mean of a hundred simulations. Five bands are a little better.
EXPECTED = np.array([2.9, 2.9, 5.9]) * GROUND_SIGMA


@cache
def truth() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((DATA / SIMULATED / "truth.json").read_text(encoding="utf-8"))
    return found


def true_errors(*roles: str) -> Floats:
    """Adjusted minus true coordinates of the simulated points of some roles, metres."""
    found = result(SIMULATED)
    ids = np.array(found.refined.observations.point_ids)[found.points.number]
    true = {row["id"]: [row["x"], row["y"], row["z"]] for row in tables.rows_of(truth()["points"])}
    rows = [row for row, role in enumerate(found.roles.tolist()) if ROLES[role] in roles]
    errors: Floats = found.points.ground[rows] - np.array([true[name] for name in ids[rows]])
    return errors


def test_the_simulated_sample_is_what_its_specification_gives() -> None:
    files = simulated(SIMULATED)
    assert set(files) == {"observations.csv", "control.csv", "truth.json", "project.yaml"}
    for file, text in nonempty(files.items()):
        assert (DATA / SIMULATED / file).read_text(encoding="utf-8") == text, "renew with make golden"


@pytest.mark.slow
def test_simulated_new_points_are_near_the_truth_and_not_on_it() -> None:
    errors = true_errors("new", "check")
    assert len(errors) == 159
    assert (rms(errors) < EXPECTED).all()
    assert (np.abs(errors) < 3 * EXPECTED).all()
    # The best conceivable adjustment is no better than half of what a single image coordinate is good for.
    assert (rms(errors) > 0.5 * GROUND_SIGMA).all()


def test_the_simulated_gross_errors_are_found_and_nothing_else_and_the_noise_as_well() -> None:
    put_in = {(row["photo"], row["point"]) for row in tables.rows_of(truth()["errors"])}
    assert len(put_in) == 2
    rejected = document_of(result(SIMULATED))["rejected"]
    assert {row["point"] for row in rejected} == {point for _, point in put_in}
    assert put_in <= {(photo, row["point"]) for row in rejected for photo in (row["photo"], row["other_photo"])}
    orientation = result(SIMULATED).strips[0].of_photos.orientation
    squares = float((orientation.pairs.weight * orientation.parallax**2).sum()) / 2
    redundancy = int(orientation.used.sum()) - 5 * orientation.pairs.size
    sigma0 = np.sqrt(squares / redundancy) / MICROMETRE
    assert sigma0 == pytest.approx(SIGMA_UM, rel=3 / np.sqrt(2 * redundancy))
