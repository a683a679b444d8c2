"""YAML as texts with places: nothing is guessed, and every place is right with either parser."""

import pytest
import yaml

from photostrip.formats.faults import Findings
from photostrip.project import reading
from photostrip.project.reading import Node, Place, fault_at, key_path, parse
from tests.project.samples import Sample
from tests.project.test_faults import YAML_MANNERS, YAML_SYNTAX

LOADERS = [pytest.param(yaml.BaseLoader, id="python"), pytest.param(reading.LOADER, id="c")]
TEXT = """\
# a comment
ключ: Значение
list:
  - a
  - "b c": 1:20
    second: [0123, NO, ~, 1e3, '']
empty:
emoji: 🛩️
after: {x: 🛩️, y: yes}
"""


@pytest.fixture(autouse=True, params=LOADERS)
def _loader(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "LOADER", request.param)


def read(text: str) -> tuple[Node | None, Findings]:
    findings = Findings()
    return parse(text, "f.yaml", findings), findings


def tree(text: str = TEXT) -> Node:
    root, findings = read(text)
    assert root is not None
    assert findings.faults == ()
    return root


def test_every_scalar_stays_text() -> None:
    assert tree().plain == {
        "ключ": "Значение",
        "list": ["a", {"b c": "1:20", "second": ["0123", "NO", "~", "1e3", ""]}],
        "empty": "",
        "emoji": "🛩️",
        "after": {"x": "🛩️", "y": "yes"},
    }


@pytest.mark.parametrize(
    ("path", "line", "column"),
    [
        ((), 2, 1),
        (("ключ",), 2, 7),
        (("list",), 4, 3),
        (("list", 0), 4, 5),
        (("list", 1), 5, 5),
        (("list", 1, "b c"), 5, 12),
        (("list", 1, "second", 3), 6, 27),
        (("list", 1, "third"), 5, 5),
        (("emoji",), 8, 8),
    ],
)
def test_values_know_their_place(path: tuple[str | int, ...], line: int, column: int) -> None:
    assert tree().place_of(path) == Place("f.yaml", line, column)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("a:\n  b: 1\n\tc: 1", 3, "tab"),
        ("x: 1\na: [1,\nb: 2\n", 2, "bracket"),
        ("a: 1\n b: 2", 2, "colon"),
        ("- a\nb: 1", 2, "does not fit"),
        (" a: 1\nb: 2", 2, "does not fit"),
        ("a: &b\n  c: *b", 1, "stands for the value itself"),
        ("a: 1\n' a ': 2", 2, "second time"),
        ("a: 1\n...\n---\nb: 1", 3, "second document"),
        ("a: {b: {c: [" + "[" * 30 + "]" * 31 + "}}", 1, "nested"),
        ("x: 1\ny:\n  [", 3, ""),
        ("[", 1, ""),
        ("a: " + "[" * 2000 + "]" * 2000, 1, "nested"),
        ("a: &x 1\nb: &x 2", 2, "the same &"),
        ("a: \ufffe", 1, "U+FFFE"),
    ],
)
def test_what_is_refused_is_told_with_its_line(text: str, line: int, words: str) -> None:
    _, findings = read(text)
    told = [fault for fault in findings.faults if words in fault.message]
    assert [(fault.file, fault.line) for fault in told] == [("f.yaml", line)]


@pytest.mark.parametrize("case", [case for case in (*YAML_SYNTAX, *YAML_MANNERS) if "backslash" not in case])
def test_what_is_wrong_with_a_project_is_explained(project: Sample, case: tuple[str, ...]) -> None:
    project.refuses(*case)


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "%YAML 1.2\n---\n"])
def test_nothing_is_an_empty_text(text: str) -> None:
    assert tree(text).plain == ""


@pytest.mark.parametrize("_loader", LOADERS[1:], indirect=True)
def test_escapes_that_make_no_character_are_refused() -> None:
    root, findings = read('a: "\\ud800"')
    assert root is None
    assert findings.faults[0].line == 1


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        (("a", "b"), "a.b"),
        (("a", 0, "b", 12), "a[0].b[12]"),
        (("a", "RC.30"), 'a."RC.30"'),
        (("a", "Ю-1"), "a.Ю-1"),
        ((), ""),
    ],
)
def test_paths_are_written_as_they_are_read(path: tuple[str | int, ...], expected: str) -> None:
    assert key_path(path) == expected


def test_a_fault_below_what_exists_stands_at_what_exists() -> None:
    fault = fault_at(tree(), ("list", 1, "second", 9), "no such photo", "code", expected="ten", fix="add it")
    assert str(fault) == "f.yaml:6:13: list[1].second[9]: no such photo; expected ten; add it"


def test_an_alias_is_what_its_anchor_names() -> None:
    root = tree("a: &photos [x, {k: v}]\nb: *photos\nc: {d: *photos}")
    shared = ["x", {"k": "v"}]
    assert root.plain == {"a": shared, "b": shared, "c": {"d": shared}}
    assert root.place_of(("b",)).line == 1  # where it would be put right
