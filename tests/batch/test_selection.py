"""Which projects are meant, and what their results are called."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.batch.selection import choose, output_names
from photostrip.errors import InputError
from tests.loops import nonempty

if TYPE_CHECKING:
    from collections.abc import Sequence


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a folder with projects at many places, none of which is ever read."""
    folders = ("north/s1", "north/s2", "south/s1", "south/s3/old", "south/.git")
    for name in (*(f"{each}/project.yaml" for each in folders), "flat/a.yaml", "flat/b.yml", "flat/notes.txt"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def chosen(*arguments: str) -> list[tuple[str, str]]:
    return [(each.project, each.output) for each in choose(arguments)]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["north/s1/project.yaml"], [("north/s1/project.yaml", "s1")]),
        (["./north/s1"], [("north/s1/project.yaml", "s1")]),
        (["north"], [("north/s1/project.yaml", "s1"), ("north/s2/project.yaml", "s2")]),
        (["north/*"], [("north/s1/project.yaml", "s1"), ("north/s2/project.yaml", "s2")]),
        (["south/**/project.yaml"], [("south/s1/project.yaml", "s1"), ("south/s3/old/project.yaml", "old")]),
        (["south"], [("south/s1/project.yaml", "s1"), ("south/s3/old/project.yaml", "old")]),
        (["flat/*"], [("flat/a.yaml", "a"), ("flat/b.yml", "b")]),
        (["flat/a.yaml", "gone/c.yaml"], [("flat/a.yaml", "a"), ("gone/c.yaml", "c")]),
        (["north/s1", "south/s1"], [("north/s1/project.yaml", "north/s1"), ("south/s1/project.yaml", "south/s1")]),
        (["north/s2", "north"], [("north/s2/project.yaml", "s2"), ("north/s1/project.yaml", "s1")]),
    ],
)
def test_what_is_meant(arguments: Sequence[str], found: list[tuple[str, str]]) -> None:
    assert chosen(*arguments) == found


def test_a_list_is_relative_to_itself(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (here / "lists").mkdir()
    (here / "lists" / "mine.txt").write_text("# two\n../north\n\n  ../flat/a.yaml  \r\n", encoding="utf-8")
    found = [project for project, _ in chosen("@lists/mine.txt")]
    expected = ["north/s1/project.yaml", "north/s2/project.yaml", "flat/a.yaml"]
    assert [os.path.normpath(each) for each in found] == expected
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"north/s2\n")))
    assert chosen("@-") == [("north/s2/project.yaml", "s2")]


def test_a_project_in_the_working_folder_has_the_name_of_that_folder(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(here / "north" / "s1")
    assert chosen("project.yaml") == chosen(".") == [("project.yaml", "s1")]


def test_a_link_to_a_project_is_that_project(here: Path) -> None:
    (here / "link").symlink_to(here / "north" / "s1", target_is_directory=True)
    assert chosen("link", "north/s1") == [("link/project.yaml", "link")]


def test_all_that_is_wrong_is_told_at_once(here: Path) -> None:
    (here / "bad.txt").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError) as told:
        choose(["nothing*", "@bad.txt", "@none.txt", "flat", "north"])
    assert [fault.code for fault in told.value.faults] == ["no-project", "encoding", "file-missing", "no-project"]
    (here / "empty.txt").write_text("# nothing\n", encoding="utf-8")
    with pytest.raises(InputError, match="no project is named"):
        choose(["@empty.txt"])


names = st.sampled_from(["a", "A", "b", "project", "s1"])
paths = st.builds(lambda folders, name: str(Path("/", *folders, f"{name}.yaml")), st.lists(names, max_size=4), names)


@pytest.mark.slow
@given(st.lists(paths, unique=True, min_size=1, max_size=12))
def test_no_two_results_share_a_folder(projects: list[str]) -> None:
    outputs = output_names(projects)
    assert len({each.casefold() for each in outputs}) == len(projects)
    for project, output in nonempty(zip(projects, outputs, strict=True)):
        assert output
        assert ".." not in output.split("/")
        assert output.split("/")[0] in Path(project).with_suffix("").parts


@given(st.lists(paths, unique=True, min_size=1, max_size=12))
def test_a_name_that_nobody_shares_stays_short(projects: list[str]) -> None:
    alone = [output_names([project])[0] for project in projects]
    for own, together in nonempty(zip(alone, output_names(projects), strict=True)):
        clash = sum(own.casefold() == other.casefold() for other in alone) > 1
        assert together == own or clash
