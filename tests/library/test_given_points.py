"""Nothing given disappears without a word: a verdict names given points, and images of them, that lost their say."""

from __future__ import annotations

import csv
import re
from typing import TYPE_CHECKING, Any

import pytest
import yaml

import photostrip
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    Columns = dict[str, list[Any]]
    Document = dict[str, Any]

SAMPLES = ROOT / "sample_data"
PUBLISHED = ROOT / "tests" / "data" / "authorities" / "sxb-bundle"
CODES = {"control-lost", "control-rejected", "control-image", "control-measured-once", "given-ray", "check-lost"}
MOVED = 0.1  # mm, twenty standard deviations
FOUND_IN_STRIP = 0.11  # mm; the rays of a strip alone leave 3.95 standard deviations of 0.1 mm, and 3.98 is the limit


def table(path: Path) -> Columns:
    """Read a table as columns, coordinates as numbers."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    words = {"photo", "point", "use", "role"}
    return {key: [row[key] if key in words else float(row[key]) for row in rows] for key in rows[0]}


class Sample:
    """A sample, whose measurements can be changed before it runs."""

    def __init__(self, name: str, control: Path | None = None, photos: Sequence[str] = ()) -> None:
        folder = SAMPLES / name
        self.project: Document = yaml.safe_load((folder / "project.yaml").read_text(encoding="utf-8"))
        self.observations = table(folder / "observations.csv")
        self.control = table(control or folder / "control.csv")
        if photos:
            self.project["strips"][0]["photos"] = list(photos)
            self.only([row for row, photo in enumerate(self.observations["photo"]) if photo in photos])
            point = self.observations["point"]
            self.only([row for row, name in enumerate(point) if point.count(name) == len(photos)])

    def only(self, rows: Sequence[int]) -> None:
        """Keep some measurements."""
        self.observations = {key: [column[row] for row in rows] for key, column in self.observations.items()}

    def given(self, role: str) -> list[str]:
        roles = zip(self.control["point"], self.control["role"], strict=True)
        return nonempty(name for name, each in roles if each == role and name in self.observations["point"])

    def images(self, point: str) -> list[int]:
        """Return the rows of the measurements of a point."""
        return nonempty(row for row, name in enumerate(self.observations["point"]) if name == point)

    def run(self, method: str, moved: Iterable[tuple[int, str]] = (), size: float = MOVED, **keys: Any) -> Document:  # noqa: ANN401 (values of a project file)
        """Adjust it, some measurements moved along one axis."""
        observations = {key: list(column) for key, column in self.observations.items()}
        for row, axis in moved:
            observations[axis][row] += size
        asked = {} if method == "auto" else {"adjustment": method}
        project = {**self.project, "processing": {**self.project.get("processing", {}), **asked, **keys}}
        project["observations"] = {**project["observations"], "file": observations}
        project["control"] = [{**project["control"][0], "file": self.control}]
        return photostrip.run(project).document


def named(point: str, text: str) -> bool:
    return re.search(rf"(?<![\w-]){re.escape(point)}(?![\w-])", text) is not None


def lost(document: Document) -> list[str]:
    """Return the measured given points without coordinates, or with coordinates that were not used."""
    without = {row["id"] for row in document["not_determined"]}
    return [row["id"] for row in document["control"] if row["rejected"] or row["id"] in without]


def rejected_at(document: Document, point: str) -> list[str]:
    """Return the photos of the images of a point that stay rejected."""
    rows = [each for each in document["rejected"] if each["point"] == point and not each["readmitted"]]
    return [photo for each in rows for photo in (each["photo"], each["other_photo"]) if photo is not None]


def require_told(document: Document, point: str, photo: str) -> bool:
    """Require that the verdict names a point that lost its say, or the image of it; return whether the point did."""
    told = [text for text in document["verdict"]["look_at"] if named(point, text)]
    assert document["status"] == "look"
    assert told, f"{point} is not named"
    assert any(point in note["points"] for note in document["notes"] if note["code"] in CODES)
    gone = point in lost(document)
    if not gone:
        assert photo in rejected_at(document, point)
        assert any(named(photo, text) for text in told), f"{point} is named without photo {photo}"
    return gone


@pytest.fixture(scope="module")
def simulated() -> Sample:
    return Sample("simulated-20")


def measured_thrice(sample: Sample) -> list[str]:
    """Give the check points on three photos: of two, an x parallax is a height, which stands out."""
    return [point for point in sample.given("check") if len(sample.images(point)) == 3]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("points", "image", "method", "axis", "size"),
    [
        (lambda sample: sample.given("control")[::2], 0, "polynomial", "x", FOUND_IN_STRIP),
        (lambda sample: sample.given("control")[::2], 0, "bundle", "y", MOVED),
        (lambda sample: measured_thrice(sample)[::3], 1, "polynomial", "x", MOVED),
        (lambda sample: measured_thrice(sample)[::3], 1, "bundle", "x", MOVED),
        (lambda _: ["G07", "K01"], 0, "auto", "x", MOVED),
        (lambda _: ["G07", "K01"], 0, "bundle", "x", MOVED),
    ],
)
def test_a_wrong_image_of_a_given_point_is_told(
    simulated: Sample, points: Callable[[Sample], list[str]], image: int, method: str, axis: str, size: float
) -> None:
    """One image of each in turn: many lost their coordinates, most under GOOD."""
    for point in nonempty(points(simulated)):
        row = simulated.images(point)[image]
        require_told(simulated.run(method, [(row, axis)], size), point, simulated.observations["photo"][row])


@pytest.mark.parametrize("method", ["polynomial", "bundle"])
def test_many_that_are_lost_are_all_named_on_the_first_page(simulated: Sample, method: str) -> None:
    """Never among so many more; what is lost of the control comes before all else."""
    points = ["G04", "G06", "G08", "G10", *measured_thrice(simulated)]
    document = simulated.run(method, [(simulated.images(point)[0], "x") for point in points])
    given = [row["id"] for row in document["control"]]
    concerned = [point for point in given if point in lost(document) or rejected_at(document, point)]
    page = " ".join(photostrip.Result(document).report("text").split())
    assert [point for point in nonempty(concerned) if not named(point, page)] == []
    first = " ".join(document["verdict"]["look_at"][:2])
    assert [point for point in nonempty(concerned) if point in points[:4] and not named(point, first)] == []


def test_check_points_on_one_photo_are_all_named(simulated: Sample) -> None:
    """More than a message usually names."""
    points = simulated.given("check")[:15]
    second = {row for point in points for row in simulated.images(point)[1:]}
    sample = Sample("simulated-20")
    sample.only([row for row in range(len(sample.observations["point"])) if row not in second])
    for method in ("polynomial", "bundle"):
        text, *_ = sample.run(method)["verdict"]["look_at"]
        assert "measured on one photo only" in text
        assert [point for point in points if not named(point, text)] == []


def test_an_image_of_control_that_a_real_pair_rejects_is_told() -> None:
    """0.07 mm at one of 2 x 11 images of control, whose other image and coordinates stay: the result was GOOD."""
    sample = Sample("sxb-strasbourg", PUBLISHED / "control.csv", ("8937", "8938"))
    row = next(row for row in sample.images("651") if sample.observations["photo"][row] == "8937")
    assert sample.run("bundle")["verdict"]["look_at"] == []
    document = sample.run("bundle", [(row, "y")], size=0.07)
    (size,) = document["residuals"].where(photo="8937", point="651")["vy_um"]
    assert size == pytest.approx(69.7, abs=0.1)
    assert not require_told(document, "651", "8937")
    assert document["verdict"]["look_at"] == [
        "images of given points are rejected: control point 651 (photo 8937); measure them again"
    ]


def test_an_image_of_control_that_is_used_and_far_off_is_told(simulated: Sample) -> None:
    """Without a search it takes part; no other check looks at single images."""
    row = simulated.images("G08")[0]
    document = simulated.run("bundle", [(row, "y")], bundle={"screening": "none"}, relative={"screening": "none"})
    (note,) = (note for note in document["notes"] if note["code"] == "given-residual")
    assert note["points"] == ["G08"]
    assert document["status"] == "look"
    photo = simulated.observations["photo"][row]
    text, *_ = document["verdict"]["look_at"]
    assert re.search(rf"control point G08 \(photo {photo}, \d+ µm", text)
    assert simulated.run("bundle")["verdict"]["look_at"] == []


def test_what_the_user_switches_off_is_no_loss(simulated: Sample) -> None:
    """``use: off`` is how a surveyor accepts that a point is not to be had."""
    row = simulated.images("G08")[0]
    off = Sample("simulated-20")
    off.control["use"][off.control["point"].index("G08")] = "off"
    assert off.run("auto", [(row, "x")])["verdict"]["look_at"] == []
