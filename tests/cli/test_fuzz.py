"""Whatever is done to a project: an exit code of the contract, no traceback, inputs untouched, a whole result or none.

``python benchmarks/fuzz.py`` does the same ten thousand times.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzzing import Case, blocks, damaged, projects, tried


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, bytes]]:
    return projects(tmp_path_factory.mktemp("right"))


@pytest.fixture(scope="module")
def right_blocks(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, bytes]]:
    return blocks(tmp_path_factory.mktemp("blocks"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["right", "right_blocks"])
@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32), command=st.sampled_from(["check", "run"]))
def test_what_is_damaged_ends_well(kind: str, request: pytest.FixtureRequest, seed: int, command: str) -> None:
    case = damaged(request.getfixturevalue(kind), Random(seed))
    with tempfile.TemporaryDirectory() as folder:
        assert tried(case, Path(folder), command).faults == (), case.done


@pytest.mark.parametrize(
    "seed",
    [
        "9911 913",  # a header that stands twice: a photo in no strip without a row
        "9921 1312",  # suspected control was exchanged without end
        "9921 2150",  # variances below zero
    ],
)
def test_projects_that_ended_badly_end_well(right: list[dict[str, bytes]], tmp_path: Path, seed: str) -> None:
    """Cases of the benchmark."""
    case = damaged(right, Random(seed))
    assert tried(case, tmp_path, "run").faults == (), case.done


@pytest.mark.parametrize("command", ["check", "run"])
def test_right_projects_are_right(right: list[dict[str, bytes]], tmp_path: Path, command: str) -> None:
    outcome = tried(Case(right[-1]), tmp_path, command)
    assert (outcome.code, outcome.faults) == (0, ())


def test_ids_that_no_table_shares_are_told(right_blocks: list[dict[str, bytes]], tmp_path: Path) -> None:
    files = dict(right_blocks[-1])  # of single photos
    rows = files["observations.csv"].splitlines()
    files["observations.csv"] = b"\n".join(
        [rows[0], *(row.replace(b",", b",%d-" % n, 1) for n, row in enumerate(rows[1:]))]
    )
    outcome = tried(Case(files), tmp_path, "run")
    assert (outcome.code, outcome.faults) == (3, ())
