"""Whatever surveyors call photos and points comes out as it went in; whatever is done to a project, faults are told."""

import csv
import io
import json
import re
import tempfile
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from photostrip.errors import InputError
from photostrip.project.loading import Project, load_project
from tests.project.samples import MARKED_FILES, Sample, sample

ODD = [
    "0123", "NO", "yes", "1:20", "1e3", "0x1F", "0o17", "~", "null", "-1", "+7", "1_000", "1.0", ".5", "=", "-", "--",
    "a,b", "#1", "[a]", "{a}", "*a", "&a", "!a", "%a", "@a", "`a", "2024-01-01", "nan", "inf",
    "Точка-7", "точка", "点12", "🛩️", "👨‍👩‍👧", "x" * 200, 'say "x"', "it's", "# 1", "P 1", "a: b",
    "1 000", "Ǆ", "e\u0301", "é", "a\u2028b", "\u200bz", "ﬁ",
]  # fmt: skip
ids = (
    st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=30)
    .map(str.strip)
    .filter(lambda text: text and not re.search(r"[\ufffe\uffff]", text))
)


def table(rows: list[list[str]]) -> str:
    """Write CSV as the standard library does."""
    stream = io.StringIO()
    csv.writer(stream).writerows(rows)
    return stream.getvalue()


def write(folder: Path, photos: list[str], points: list[str], names: list[str]) -> Path:
    """Write a project with any ids, by programs that are not ours."""
    project = {
        "photostrip": 1,
        "name": names[0],
        "cameras": {names[1]: {"principal_distance": 100}},
        "strips": [{"id": names[2], "camera": names[1], "photos": photos}],
        "observations": {"file": "o.csv", "unit": "mm", "sigma": 0.005},
        "control": [{"file": "c.csv", "crs": "local", "axes": ["east", "north", "up"], "sigma": [1, 1, 1]}],
    }
    rows = [[photo, point, "1", "2"] for photo in photos for point in points]
    folder.mkdir(exist_ok=True)
    (folder / "project.yaml").write_text(yaml.safe_dump(project, allow_unicode=True), encoding="utf-8")
    (folder / "o.csv").write_text(table([["photo", "point", "x", "y"], *rows]), encoding="utf-8", newline="")
    given_points = [[point, "1", "2", "3"] for point in points]
    (folder / "c.csv").write_text(table([["point", "x", "y", "z"], *given_points]), encoding="utf-8", newline="")
    return folder / "project.yaml"


def check(project: Project, photos: list[str], points: list[str], names: list[str]) -> None:
    inputs = project.inputs
    assert (inputs.name, inputs.strips[0].camera.name, inputs.strips[0].id) == tuple(names)
    assert inputs.strips[0].photos == tuple(photos)
    assert inputs.observations.photo_ids == tuple(photos)
    assert inputs.observations.point_ids == tuple(points)
    assert inputs.control.ids == tuple(points)


@pytest.mark.slow
@given(
    photos=st.lists(ids, min_size=2, max_size=5, unique=True),
    points=st.lists(ids, min_size=1, max_size=5, unique=True),
    names=st.lists(ids, min_size=3, max_size=3),
)
@example(photos=ODD, points=ODD[::-1], names=ODD[:3])
@example(photos=ODD[:2], points=ODD, names=ODD[5:8])
def test_ids_survive_reading_and_the_resolved_project(photos: list[str], points: list[str], names: list[str]) -> None:
    with tempfile.TemporaryDirectory() as place:
        path = write(Path(place), photos, points, names)
        first = load_project(path)
        check(first, photos, points, names)
        path.write_text(first.resolved, encoding="utf-8")
        again = load_project(path)
        check(again, photos, points, names)
        assert again.resolved == first.resolved


@pytest.mark.parametrize(
    "name", ["0123", "NO", "1:20", "1e3", "~", "null", "-7", "+7", "1_000", "Точка", "🛩️", "x" * 200]
)
def test_ids_need_no_quotation_marks_in_yaml(tmp_path: Path, name: str) -> None:
    path = write(tmp_path, [name, "other"], ["P"], ["n", "c", "s"])
    text = re.sub(r"(?ms)  photos:.*", f"  photos: [{name}, other]\n", path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    assert load_project(path).inputs.strips[0].photos == (name, "other")


pytestmark = pytest.mark.slow
words = st.sampled_from(["mm", "px", "A", "RC30", "1001", "0.5", "", "local", "east", "auto", "a.csv", "~", "-1"])
trees = st.recursive(
    words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words.filter(bool), inner, max_size=3),
    max_leaves=6,
)
PATHS = [
    "cameras", "cameras.RC30", "cameras.RC30.fiducials", "cameras.RC30.distortion", "cameras.RC30.distortion.k",
    "strips", "strips[0]", "strips[0].photos", "strips[1].camera", "observations", "observations.unit",
    "observations.file",
    "fiducial_measurements", "control", "control[0]", "control[0].axes", "control[0].crs", "control[0].sigma", "output",
    "output.crs", "output.axes", "processing", "processing.relative", "processing.polynomial", "tolerances", "name",
]  # fmt: skip


@settings(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from(PATHS), trees), min_size=1, max_size=3))
def test_any_tree_at_any_key(changes: list[tuple[str, object]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        project = sample(Path(folder), MARKED_FILES)
        faults = project.faults([f"{path}={json.dumps(value)}" for path, value in changes])
        assert "" not in [fault.message for fault in faults]


@pytest.mark.parametrize("assignment", ["", "=", ".", "[0]=1", "a=b=c", "cameras.=1", '"="=1', "strips[999999]=1"])
def test_odd_overrides(project: Sample, assignment: str) -> None:
    with pytest.raises(InputError):
        project.load([assignment])
