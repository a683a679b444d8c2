"""Whatever is done to a project and its tables: it loads, or every fault is told; nothing else ever comes out."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photostrip.errors import InputError
from tests.fuzzing import TEXTS
from tests.project.samples import MARKED_FILES, sample

pytestmark = pytest.mark.slow
mutations = st.lists(
    st.tuples(
        st.sampled_from(sorted(MARKED_FILES)),
        st.floats(0, 1),
        st.integers(0, 12),
        st.one_of(st.sampled_from(TEXTS), st.text(max_size=4)),
    ),
    min_size=1,
    max_size=4,
)


def load(folder: str, files: dict[str, bytes]) -> None:
    project = sample(Path(folder), {})
    for name, content in files.items():
        project.write(name, content)
    before = {name: (Path(folder) / name).read_bytes() for name in files}
    assert all(fault.message and fault.file and fault.line >= 0 for fault in project.faults())
    assert before == {name: (Path(folder) / name).read_bytes() for name in files}


@settings(max_examples=60)
@given(mutations)
def test_mutated_text(changes: list[tuple[str, float, int, str]]) -> None:
    files = dict(MARKED_FILES)
    for name, where, length, text in changes:
        start = round(where * len(files[name]))
        files[name] = files[name][:start] + text + files[name][start + length :]
    with tempfile.TemporaryDirectory() as folder:
        load(folder, {name: text.encode(errors="replace") for name, text in files.items()})


@settings(max_examples=60)
@given(st.sampled_from(sorted(MARKED_FILES)), st.binary(max_size=200), st.floats(0, 1))
def test_mutated_bytes(name: str, data: bytes, where: float) -> None:
    files = {each: text.encode() for each, text in MARKED_FILES.items()}
    start = round(where * len(files[name]))
    files[name] = files[name][:start] + data + files[name][start:]
    with tempfile.TemporaryDirectory() as folder:
        load(folder, files)


words = st.sampled_from(["mm", "px", "A", "RC30", "1001", "0.5", "", "local", "east", "auto", "a.csv", "~", "-1"])
trees = st.recursive(
    words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words.filter(bool), inner, max_size=3),
    max_leaves=6,
)
PATHS = [
    "cameras",
    "cameras.RC30",
    "cameras.RC30.fiducials",
    "cameras.RC30.distortion",
    "cameras.RC30.distortion.k",
    "strips",
    "strips[0]",
    "strips[0].photos",
    "strips[1].camera",
    "observations",
    "observations.unit",
    "observations.file",
    "fiducial_measurements",
    "control",
    "control[0]",
    "control[0].axes",
    "control[0].crs",
    "control[0].sigma",
    "output",
    "output.crs",
    "output.axes",
    "processing",
    "processing.relative",
    "processing.polynomial",
    "tolerances",
    "name",
]


@settings(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from(PATHS), trees), min_size=1, max_size=3))
def test_any_tree_at_any_key(changes: list[tuple[str, object]]) -> None:
    import json

    with tempfile.TemporaryDirectory() as folder:
        project = sample(Path(folder), MARKED_FILES)
        faults = project.faults([f"{path}={json.dumps(value)}" for path, value in changes])
        assert "" not in [fault.message for fault in faults]


@pytest.mark.parametrize("assignment", ["", "=", ".", "[0]=1", "a=b=c", "cameras.=1", '"="=1', "strips[999999]=1"])
def test_odd_overrides(tmp_path: Path, assignment: str) -> None:
    project = sample(tmp_path)
    with pytest.raises(InputError):
        project.load([assignment])
