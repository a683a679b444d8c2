"""Published bundle adjustments come back to their printed digits, from the project file on."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.project.loading import load_project
from photostrip.result.document import document_of
from tests.loops import nonempty
from tests.source_tree import ROOT

DATA = ROOT / "tests" / "data" / "authorities" / "sxb-bundle"
SAMPLES = ROOT / "sample_data"
PROJECT = """\
photostrip: 1
cameras:
  sxb: {principal_distance: 123.9392, format: [53.148, 77.976], pixel_size: 0.006}
strips:
  - {id: middle, camera: sxb, photos: ["8936", "8937", "8938"]}
  - {id: west, camera: sxb, photos: ["8811"]}
  - {id: east, camera: sxb, photos: ["9111"]}
observations: {file: observations.csv, unit: mm, y_axis: up}
control: [{file: control.csv, crs: local, axes: [east, north, up]}]
output: {angles: {system: omega-phi-kappa, unit: deg}}
processing: {adjustment: bundle, bundle: {screening: none}}
"""


@pytest.fixture(scope="module")
def strasbourg(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return five_photos(tmp_path_factory.mktemp("sxb"), PROJECT)


def five_photos(folder: Path, project: str) -> Result:
    """The published run: five photos, 14 control points, everything measured takes part."""
    rows = (SAMPLES / "sxb-strasbourg" / "observations.csv").read_text(encoding="utf-8")
    more = (DATA / "observations.csv").read_text(encoding="utf-8").split("\n", 1)[1]
    (folder / "observations.csv").write_text(rows + more, encoding="utf-8")
    (folder / "control.csv").write_bytes((DATA / "control.csv").read_bytes())
    (folder / "project.yaml").write_text(project, encoding="utf-8")
    loaded = load_project(folder / "project.yaml")
    return triangulate(loaded.inputs, loaded.settings)


@pytest.mark.slow
def test_the_published_sigma0_and_counts(strasbourg: Result) -> None:
    bundle = document_of(strasbourg)["bundle"]
    assert bundle["sigma0"] == pytest.approx(1.1786, abs=0.0001)
    assert bundle["redundancy"] == 1261
    assert bundle["unknowns"]["points"] == 3 * 381
    assert bundle["observations"] == {"image": 2 * 1196, "control": 14 * 3}


def test_the_published_orientations_and_their_standard_deviations(strasbourg: Result) -> None:
    photos = {photo["id"]: photo for photo in document_of(strasbourg)["photos"]}
    with (DATA / "published.csv").open(encoding="utf-8", newline="") as file:
        published = list(csv.DictReader(file))
    assert len(published) == 5
    for row in nonempty(published):
        photo = photos[row["photo"]]
        assert [photo[axis] for axis in "xyz"] == pytest.approx([float(row[f"{a}_m"]) for a in "XYZ"], abs=0.001)
        expected = [float(row[f"{name}_deg"]) for name in ("omega", "phi", "kappa")]
        assert [photo[f"angle_{n}"] for n in (1, 2, 3)] == pytest.approx(expected, abs=0.0001)
    with (SAMPLES / "sxb-strasbourg" / "reference.csv").open(encoding="utf-8", newline="") as file:
        for row in nonempty(csv.DictReader(file)):  # published standard deviations, three digits
            photo = photos[row["photo"]]
            assert [photo[f"sigma_{a}"] for a in "xyz"] == pytest.approx(
                [float(row[f"sigma_{a}"]) for a in "xyz"], rel=0.01
            )
            angles = [float(row[f"sigma_{name}_deg"]) for name in ("omega", "phi", "kappa")]
            assert [photo[f"sigma_angle_{n}"] for n in (1, 2, 3)] == pytest.approx(angles, rel=0.01)


def test_the_published_orientations_without_strips(tmp_path: Path) -> None:
    """The photos of two flight lines in no order, flown to and fro."""
    strips = PROJECT[PROJECT.index("strips:") : PROJECT.index("observations:")]
    result = five_photos(tmp_path, PROJECT.replace(strips, "photos: {camera: sxb}\n"))
    assert [strip.id for strip in result.inputs.strips] == ["8811-9111", "8936-8938"]
    photos = {photo["id"]: photo for photo in document_of(result)["photos"]}
    with (DATA / "published.csv").open(encoding="utf-8", newline="") as file:
        for row in nonempty(csv.DictReader(file)):
            published = [float(row[f"{axis}_m"]) for axis in "XYZ"]
            assert [photos[row["photo"]][axis] for axis in "xyz"] == pytest.approx(published, abs=0.001)


def test_the_published_residuals_at_check_points(strasbourg: Result) -> None:
    document = document_of(strasbourg)
    found = {row["id"]: (row["dx"], row["dy"], row["dz"]) for row in document["control"] if row["role"] == "check"}
    assert found["351"] == pytest.approx((0.167, 0.008, -0.459), abs=0.001)
    assert found["410"] == pytest.approx((0.096, -0.296, 0.136), abs=0.001)
    pixels = document["summary"]["image_rms_um"] / 6 * np.sqrt(2)  # of the length of a point's residual
    assert pixels == pytest.approx(1.10, abs=0.005)


def test_the_strip_alone_with_every_other_point_as_control() -> None:
    """Another program's bundle of the sample's three photos: about 0.11, 0.08 and 0.6 m at the points held back."""
    settings = ["processing.adjustment=bundle", "processing.bundle.screening=none"]
    loaded = load_project(SAMPLES / "sxb-strasbourg" / "project.yaml", settings)
    rms = document_of(triangulate(loaded.inputs, loaded.settings))["summary"]["check_rms"]
    assert (rms["x"], rms["y"], rms["z"]) == pytest.approx((0.11, 0.08, 0.6), rel=0.2)


CALIBRATIONS = [
    (("principal_distance", "principal_point"), (74.905, -0.124, 0.031)),
    (("principal_distance", "principal_point", "k1"), (76.28, -0.073, 0.129)),
]


@pytest.mark.slow
@pytest.mark.parametrize(("wanted", "expected"), CALIBRATIONS)
def test_a_joint_fit_of_the_apollo_camera(wanted: tuple[str, ...], expected: tuple[float, ...]) -> None:
    """Principal distance and point that another program fitted to the published points of the strip."""
    settings = ["processing.adjustment=bundle", "processing.bundle.screening=none"]
    loaded = load_project(SAMPLES / "apollo15-metric-strip" / "project.yaml", settings)
    control = loaded.inputs.control
    every = replace(control, check=np.zeros(len(control), bool), sigma=np.full((len(control), 3), 0.1))
    strips = tuple(replace(strip, calibrate=wanted) for strip in loaded.inputs.strips)
    result = triangulate(replace(loaded.inputs, control=every, strips=strips), loaded.settings)
    assert result.bundle is not None
    found = result.bundle.parameters[:3]
    value = np.array([each.value for each in found]) + np.array([76.054, 0.0, 0.0])
    sigma = np.array([each.sigma for each in found])
    assert (np.abs(value - np.array(expected)) < sigma).all()
    assert (sigma < 0.12).all()
