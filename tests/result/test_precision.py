"""Covariances in the result: turned to the axes of the output, written beside the coordinates, shown in the report."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache
from io import StringIO

import numpy as np
import pytest

from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import SYSTEMS, angle_rates, angles, from_angles, from_vector
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.results import Precision
from photostrip.result.derived import ellipses
from photostrip.result.document import document_of
from photostrip.result.given import normalised
from photostrip.result.precision import CORRELATIONS
from tests.loops import nonempty
from tests.results import FRAMES, Case, case, result_files, solved

SAMPLES = 200_000


def positive(rng: np.random.Generator, size: int, number: int, scale: float) -> np.ndarray:
    """Covariances that are anything but diagonal."""
    root = rng.normal(0, scale, (number, size, size))
    return root @ root.transpose(0, 2, 1)


@cache
def precise(frame: str) -> Case:
    """A small project with invented covariances."""
    known, rng = case(frame), np.random.default_rng(5)
    (strip,) = known.result.strips
    photos = positive(rng, 6, len(strip.strip.photos), 0.1)
    photos[:, 3:] *= 1e-3
    photos[:, :, 3:] *= 1e-3
    points = positive(rng, 3, len(known.result.points.number), 0.2)
    result = replace(known.result, precision=Precision(points, (photos,), (0.005,), ("a-priori",)))
    return Case(known.inputs, result, document_of(result))


@pytest.mark.parametrize("frame", FRAMES)
def test_point_covariances_are_those_of_displaced_points(frame: str) -> None:
    """Points moved in the Cartesian frame by the covariance's square root scatter as stated along the output's axes."""
    known = precise(frame)
    result, points = known.result, known.result.points
    rows = {row["id"]: row for row in known.document["points"]}
    for number in (0, len(points.number) - 1):
        root = np.linalg.cholesky(result.precision.points[number])  # type: ignore[union-attr]
        moved = result.output.ground_from_cartesian(points.cartesian[number] + root.T)
        steps = result.output.difference(moved, np.repeat(points.ground[[number]], 3, axis=0))
        covariance = steps.T @ steps
        order = list(result.output.order)
        expected = covariance[np.ix_(order, order)]
        row = rows[result.refined.observations.point_ids[points.number[number]]]
        # a map projection's scale and the bend of its axes over a decimetre stay far below a part in a thousand
        found = [row["sigma_x"] ** 2, row["sigma_y"] ** 2, row["sigma_z"] ** 2]
        assert found == pytest.approx(np.diag(expected), rel=3e-3)
        mixed = [row["cov_xy"], row["cov_xz"], row["cov_yz"]]
        assert mixed == pytest.approx(expected[[0, 0, 1], [1, 2, 2]], abs=2e-3 * float(np.trace(expected)))


def test_the_ellipse_is_that_of_the_eigenvectors() -> None:
    covariances = positive(np.random.default_rng(3), 3, 50, 1.0)
    axes, azimuth = ellipses(covariances)
    values, vectors = np.linalg.eigh(covariances[:, :2, :2])
    assert pytest.approx(np.sqrt(values[:, ::-1]), rel=1e-9) == axes.T
    direction = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    assert np.abs((direction * vectors[:, :, 1]).sum(axis=1)) == pytest.approx(1.0, abs=1e-9)
    assert (azimuth >= 0).all()
    assert (azimuth < np.pi).all()


@pytest.mark.parametrize("system", SYSTEMS)
def test_angle_rates_are_the_derivatives_of_the_rotation(system: str) -> None:
    values, step = np.array([0.3, -0.2, 2.1]), 1e-7
    rates = angle_rates(values, system)
    for number in range(3):
        change = np.zeros(3)
        change[number] = step
        plus, minus = from_angles(values + change, system), from_angles(values - change, system)
        skew = (plus - minus) @ from_angles(values, system).T / (2 * step)
        assert rates[:, number] == pytest.approx([skew[2, 1], skew[0, 2], skew[1, 0]], abs=1e-8)
    assert angle_rates(np.tile(values, (4, 1)), system)[2] == pytest.approx(rates)
    with pytest.raises(ValueError, match="unknown system"):
        angle_rates([0.0, 0.0, 0.0], "roll-pitch-yaw")


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["north first", "geocentric"])
def test_photo_covariances_are_those_of_turned_photos(frame: str) -> None:
    """Photos moved and turned by random amounts of the given covariance scatter as the file says."""
    known, rng = precise(frame), np.random.default_rng(11)
    result, number = known.result, 2
    (strip,) = result.strips
    covariance = result.precision.photos[0][number]  # type: ignore[union-attr]
    errors = rng.multivariate_normal(np.zeros(6), covariance, SAMPLES)
    place = strip.intermediate.cartesian_from_intermediate(strip.resection.centers)[[number]]
    axes = result.output.axes_at(place)[0]
    rotation = axes @ strip.intermediate.cartesian_rotations(strip.resection.rotations)[number]
    turned = axes @ from_vector(errors[:, 3:]) @ axes.T @ rotation
    moved = np.degrees(angles(turned, "alpha-omega-kappa") - angles(rotation, "alpha-omega-kappa"))
    moved = (moved + 180) % 360 - 180
    along = (errors[:, :3] @ axes.T)[:, list(result.output.order)]
    scatter = np.cov(np.column_stack([along, moved]).T)
    row = known.document["photos"][number]
    expected = [known.document["correlations"][number][name] for name in CORRELATIONS]
    spread = np.sqrt(np.diag(scatter))
    assert [row[f"sigma_{axis}"] for axis in "xyz"] == pytest.approx(spread[:3], rel=0.01)
    assert [row[f"sigma_angle_{k}"] for k in (1, 2, 3)] == pytest.approx(spread[3:], rel=0.01)
    assert expected == pytest.approx((scatter / np.outer(spread, spread))[np.triu_indices(6, 1)], abs=0.012)


def test_the_block_sums_up_and_follows_the_strip() -> None:
    known = precise("projected")
    block, points = known.document["precision"], known.document["points"]
    height = [point["sigma_z"] for point in points]
    assert block["points"]["height"]["max"] == pytest.approx(max(height), abs=6e-5)
    assert block["points"]["height"]["worst"] == points[int(np.argmax(height))]["id"]
    assert block["points"]["height"]["rms"] == pytest.approx(np.sqrt(np.mean(np.square(height))), abs=1e-4)
    assert sum(row["points"] for row in block["along"]) == len(points)
    assert [row["photo"] for row in block["along"]] == [photo["id"] for photo in known.document["photos"]]
    assert block["basis"] == [{"strip": known.result.strips[0].strip.id, "sigma_um": 5.0, "basis": "a-priori"}]


def test_check_points_are_measured_along_the_axes_in_which_they_are_given() -> None:
    """The frame in which the result is wanted does not matter, its east being another one."""
    known = precise("projected")
    elsewhere = FrameSpec("EPSG:4326", ("east", "north", "up"), height="ellipsoidal")
    _, output = tie_frames(known.inputs.frames, elsewhere)
    rows, values = normalised(known.result)
    again, found = normalised(replace(known.result, output=output))
    assert len(rows)
    assert rows.tolist() == again.tolist()
    np.testing.assert_allclose(found, values, rtol=1e-6)


def test_nothing_is_said_where_nothing_is_known() -> None:
    known = replace(case("projected").result, precision=None)
    document = document_of(known)
    assert "precision" not in document
    assert all(point["sigma_x"] is None and "cov_xy" not in point for point in nonempty(document["points"]))
    assert all(photo["sigma_x"] is None for photo in nonempty(document["photos"]))
    assert "correlations" not in document
    files = result_files(document)
    assert {row["sigma_x"] for row in csv.DictReader(StringIO(files["points.csv"]))} == {""}
    assert {row["sigma_kappa_deg"] for row in csv.DictReader(StringIO(files["photos.csv"]))} == {""}


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("adjustment", ["similarity", "polynomial"])
def test_check_points_go_with_their_standard_deviations(frame: str, adjustment: str) -> None:
    """Four check points of a simulated strip: neither far beyond what is stated nor without any error."""
    inputs = case(frame).inputs
    document = solved(inputs, Settings(adjustment=adjustment)).document
    check = document["precision"]["check"]
    (test,) = check["tests"]
    assert test["points"] == check["plan"]["count"] == check["height"]["count"] == 4
    assert test["coordinates"] == 12
    assert 1e-3 < test["p"] < 0.999
    assert check["plan"]["inside_95"] >= 3
    assert check["height"]["inside_95"] >= 3
    for name, rows in (("plan", 2), ("height", 1)):
        values = np.array([row[name] for row in check["points"]])
        assert check[name]["rms"] == pytest.approx(np.sqrt(np.mean(values**2) / rows), abs=0.01)
