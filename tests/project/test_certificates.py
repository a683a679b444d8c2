"""Cameras whose certificate gives distances between the fiducial marks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.project.samples import MARKED_FILES, Sample

if TYPE_CHECKING:
    from pathlib import Path

GIVEN = "    fiducials: {F1: [106, -106], F2: [-106, -106]}\n"
PLACES = "    fiducial_places: {F1: bottom-right, F2: bottom-left, F3: top-left, F4: top-right}\n"
SIDES = "[F1, F2, 211.98], [F2, F3, 212.01], [F3, F4, 211.99], [F4, F1, 212.02]"
DIAGONALS = "[F1, F3, 299.82], [F2, F4, 299.80]"


@pytest.fixture
def sample(tmp_path: Path) -> Sample:
    made = Sample(tmp_path)
    for name, text in MARKED_FILES.items():
        made.write(name, text)
    return made


def certified(sample: Sample, places: str, distances: str) -> list[str]:
    sample.change("project.yaml", GIVEN, f"{places}    fiducial_distances: [{distances}]\n")
    return [str(fault).replace(f"{sample.folder}/", "") for fault in sample.faults()]


def test_the_camera_gets_coordinates_and_their_quality_is_told(sample: Sample) -> None:
    assert certified(sample, PLACES, f"{SIDES}, {DIAGONALS}") == []
    project = sample.load()
    marks = project.inputs.strips[0].camera.fiducials
    assert marks["F1"] == pytest.approx((106.0, -106.0), abs=0.05)
    assert marks["F3"] == pytest.approx((-106.0, 106.0), abs=0.05)
    (note,) = [note for note in project.hints if note.code == "certificate"]
    assert note.message.startswith("camera RC30: 4 fiducial marks from 6 distances, standard deviation of one ")
    assert (note.severity, note.line) == ("note", 9)


def test_nominal_coordinates_may_stand_beside_distances(sample: Sample) -> None:
    nominal = "    fiducials: {F1: [106, -106], F2: [-106, -106], F3: [-106, 106], F4: [106, 106]}\n"
    assert certified(sample, nominal, f"{SIDES}, {DIAGONALS}") == []
    assert sample.load().inputs.strips[0].camera.fiducials["F4"] == pytest.approx((106.0, 106.0), abs=0.05)


@pytest.mark.parametrize(
    ("places", "distances", "words"),
    [
        (PLACES, SIDES, "cameras.RC30.fiducial_distances: 4 independent distances do not fix a figure of 4 marks"),
        (PLACES, f"{SIDES}, [F1, F9, 1.0]", "cameras.RC30.fiducial_distances[4]: the camera has no mark F9"),
        (PLACES.replace("top-left", "middle"), SIDES, "fiducial_places.F3: `middle` is not known"),
        (PLACES, SIDES.replace("211.98", "-2"), "fiducial_distances[0][2]: -2 is out of range"),
        (PLACES, SIDES.replace("211.98", "nan"), "fiducial_distances[0][2]"),
        (PLACES, "[F1, F2]", "fiducial_distances[0]"),
        ("", SIDES, "distances alone do not say which mark is where"),
        (GIVEN + PLACES, SIDES, "places of fiducial marks are for distances between them without coordinates"),
    ],
)
def test_certificates_that_are_wrong(sample: Sample, places: str, distances: str, words: str) -> None:
    lines = certified(sample, places, distances)
    assert any(words in line for line in lines), lines


def test_a_distance_that_does_not_fit_is_a_warning(sample: Sample) -> None:
    assert certified(sample, PLACES, f"{SIDES}, {DIAGONALS}".replace("299.80", "301.80")) == []
    (note,) = [note for note in sample.load().hints if note.code == "certificate"]
    assert note.severity == "warning"
