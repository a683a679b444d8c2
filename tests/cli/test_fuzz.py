"""Whatever is done to a project: an exit code of the contract, no traceback, inputs untouched, a whole result or none.

``python benchmarks/fuzz.py`` does the same ten thousand times.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzzing import HARMS, Case, blocks, damaged, projects, tried
from tests.source_tree import ROOT


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, bytes]]:
    return projects(tmp_path_factory.mktemp("right"))


@pytest.mark.slow
@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 2**32), command=st.sampled_from(["check", "run"]))
def test_a_damaged_project_ends_well(right: list[dict[str, bytes]], seed: int, command: str) -> None:
    case = damaged(right, Random(seed))
    with tempfile.TemporaryDirectory() as folder:
        assert tried(case, Path(folder), command).faults == (), case.done


@pytest.fixture(scope="module")
def right_blocks(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, bytes]]:
    return blocks(tmp_path_factory.mktemp("blocks"))


@pytest.mark.slow
@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 2**32), command=st.sampled_from(["check", "run"]))
def test_a_damaged_block_ends_well(right_blocks: list[dict[str, bytes]], seed: int, command: str) -> None:
    case = damaged(right_blocks, Random(seed))
    with tempfile.TemporaryDirectory() as folder:
        assert tried(case, Path(folder), command).faults == (), case.done


@pytest.mark.parametrize(
    ("seed", "command"),
    [
        ("9911 913", "run"),  # a header that stands twice: a photo in no strip without a row
        ("9921 1312", "run"),  # suspected control was exchanged without end
        ("9921 2150", "run"),  # variances below zero
    ],
)
def test_projects_that_ended_badly_end_well(
    right: list[dict[str, bytes]], tmp_path: Path, seed: str, command: str
) -> None:
    """Cases of the benchmark."""
    case = damaged(right, Random(seed))
    assert tried(case, tmp_path, command).faults == (), case.done


@pytest.mark.parametrize("number", range(4))
def test_right_blocks_are_right(right_blocks: list[dict[str, bytes]], tmp_path: Path, number: int) -> None:
    outcome = tried(Case(right_blocks[number]), tmp_path, "run")
    assert outcome.code in {0, 1}
    assert outcome.faults == ()


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_the_benchmark_prints_its_table() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "fuzz.py"), "12", "7"]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert out.startswith("12 cases, seed 7")
    assert "wrong: 0" in out
    numbers = [int(word) for line in out.splitlines() if line.startswith(("run", "check")) for word in line.split()[1:]]
    assert sum(numbers) == 12


@pytest.mark.parametrize("command", ["check", "run"])
def test_right_projects_are_right(right: list[dict[str, bytes]], tmp_path: Path, command: str) -> None:
    outcome = tried(Case(right[-1]), tmp_path, command)
    assert (outcome.code, outcome.faults) == (0, ())


@pytest.mark.parametrize("harm", HARMS, ids=lambda harm: harm.__name__)
def test_every_harm_does_some(right: list[dict[str, bytes]], harm: object) -> None:
    assert callable(harm)
    project = right[-1]
    assert any(harm(data, Random(seed)) != data for seed in range(20) for data in project.values())
    assert isinstance(harm(b"", Random(1)), bytes)


def test_ids_that_no_table_shares_are_told(right_blocks: list[dict[str, bytes]], tmp_path: Path) -> None:
    files = dict(right_blocks[-1])  # of single photos
    rows = files["observations.csv"].splitlines()
    files["observations.csv"] = b"\n".join(
        [rows[0], *(row.replace(b",", b",%d-" % n, 1) for n, row in enumerate(rows[1:]))]
    )
    outcome = tried(Case(files), tmp_path, "run")
    assert (outcome.code, outcome.faults) == (3, ())


# ------------------------------------------------------------------------------------------ the judge can condemn


def test_a_changed_input_is_found(
    right: list[dict[str, bytes]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def careless(arguments: list[str]) -> int:
        Path(arguments[1]).write_text("mine now", encoding="utf-8")
        (Path(arguments[1]).parent / ".result.json.1.tmp").write_text("", encoding="utf-8")
        return 70

    monkeypatch.setattr("tests.fuzzing.main", careless)
    found = " ".join(tried(Case(right[0]), tmp_path, "run").faults)
    assert "exit code 70" in found
    assert "project.yaml was changed" in found
    assert ".result.json.1.tmp was left behind" in found
