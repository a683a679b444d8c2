"""What README.md, docs/ and the site show is what the program does."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

import pytest

import photostrip
from photostrip.cli.main import COMMANDS
from tests.loops import nonempty
from tests.pages import FRESH_CLONE, blocks, faults_of_page, pages, steps
from tests.reference import TABLES, command_page, for_the_site, python_page
from tests.renew_notebooks import NOTEBOOKS
from tests.source_tree import ROOT, modules

if TYPE_CHECKING:
    from pathlib import Path

WITHOUT_FORKS = {"README.md"}  # what a user types first, as whole processes
PAGES = [pytest.param(page, id=page.relative_to(ROOT).as_posix()) for page in pages()]
LINK = re.compile(r"\]\((?!https?:|mailto:|#)([^)#\s]+)")
ENTRY = re.compile(r"(?ms)^- (`[a-z0-9`, -]+)( \([^)]*\))?: (.*?)(?=^- |^#|\Z)")
ERRORS = (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")
ENTRIES = [
    (re.findall(r"`([^`]+)`", names), kind, " ".join(text.split())) for names, kind, text in ENTRY.findall(ERRORS)
]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_the_page_does_what_it_shows(page: Path, tmp_path: Path, forked: Path) -> None:
    assert "\n".join(faults_of_page(page, tmp_path, None if page.name in WITHOUT_FORKS else forked)) == ""


def test_the_first_commands_set_everything_up() -> None:
    first = next(block for block in blocks(ROOT / "README.md") if block.kind == "sh")
    assert [line.split("#")[0].strip() for line in first.lines] == ["make demo", "make test"]
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "install" not in text[: text.index("make demo")]


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: Path) -> None:
    targets = LINK.findall(page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []
    if page.name != "README.md":  # no page of the site links out of it
        assert all((page.parent / target).resolve().is_relative_to(ROOT / "docs") for target in targets)


def anchors(page: Path) -> set[str]:
    """Give what a link to a heading of a page may name."""
    headings = re.findall(r"(?m)^#+ (.+)$", page.read_text(encoding="utf-8"))
    return {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


def test_links_to_headings_lead_there() -> None:
    links = [
        (page, target, anchor)
        for page in pages()
        for target, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)#([^)\s]+)\)", page.read_text(encoding="utf-8"))
    ]
    wrong = [f"{page.name}: {target}#{anchor}" for page, target, anchor in nonempty(links)
             if anchor not in anchors((page.parent / target) if target else page)]  # fmt: skip
    assert wrong == []


@pytest.mark.parametrize("page", PAGES)
def test_console_blocks_are_run_or_say_why_not(page: Path) -> None:
    found = blocks(page)
    silent = [block for block in found if block.kind == "console" and not block.runs]
    commands = [step.command for block in found if block.runs for step in steps(block)]
    assert [block.place for block in found if not block.kind] == [], "say what the block is (text, console, yaml, ...)"
    assert [command for command in commands if FRESH_CLONE.search(command)] == [], "this belongs in a sh block"
    assert [block.place for block in silent if not block.above.startswith("<!--")] == [], "say above why it is not run"


@pytest.mark.parametrize("page", PAGES)
def test_formulas_stand_alone(page: Path) -> None:
    """A formula between lines of two dollars has empty lines around it; signs of others come in pairs."""
    inside = {number for block in blocks(page) for number in range(block.line - 2, block.line + len(block.lines) + 1)}
    lines = ["", *page.read_text(encoding="utf-8").splitlines(), ""]
    marks = [number for number, line in enumerate(lines) if line == "$$" and number not in inside]
    around = [number - 1 for number in marks[::2]] + [number + 1 for number in marks[1::2]]
    assert [number for number in around if lines[number]] == []
    within = {number for first, last in zip(marks[::2], marks[1::2], strict=True) for number in range(first, last + 1)}
    prose = "\n".join(line for number, line in enumerate(lines) if number not in inside | within)
    text = re.sub(r"`[^`]*`", "", prose)
    assert [each for each in text.split("\n\n") if each.count("$") % 2] == []
    assert not re.search(r"\$\s[^$]*\\|\\operatorname", text)


def test_the_site_has_every_page_in_its_menu() -> None:
    menu = re.findall(r'"([\w/-]+\.md)"', (ROOT / "zensical.toml").read_text(encoding="utf-8"))
    assert len(menu) == len(set(menu))
    made = [f"notebooks/{path.stem}.md" for path in NOTEBOOKS]
    made += [f"reference/{name}.md" for name in ("commands", "keys", "python", "result", "sources")]
    written = [page.relative_to(ROOT / "docs").as_posix() for page in pages() if page.name != "README.md"]
    assert sorted(menu) == sorted([*written, *made])


def test_headings_have_the_words_that_newcomers_search_for() -> None:
    table = (ROOT / "docs/tests.md").read_text(encoding="utf-8").partition("| search | page |")[2].partition("\n\n")[0]
    for words, page in nonempty(re.findall(r"\| ([\w ]+) \| ([\w/-]+\.md) \|", table)):
        headings = re.findall(r"(?m)^#+ .+$", (ROOT / "docs" / page).read_text(encoding="utf-8"))
        asked = set(words.lower().split())
        assert any(asked <= set(re.findall(r"\w+", heading.lower())) for heading in headings), words


def unlisted(source: str, listed: set[str]) -> bool:
    """Tell whether a ``Source:`` names nothing that docs/sources.md lists, or a number that is not listed."""
    named = {tag for tag in listed if re.search(rf"\b{re.escape(tag)}\b", source)}
    numbers = set(re.findall(r"\[(\d\w*)\]", source))
    return not (named or "derived" in source.lower()) or not numbers <= listed


def test_every_source_in_the_code_is_listed() -> None:
    page, paragraph = (ROOT / "docs/sources.md").read_text(encoding="utf-8"), r"Source: (.*?)(?:\n\s*\n|\"\"\")"
    listed = set(re.findall(r"(?m)^(?:\||-) \[([^\]]+)\] ", page))
    assert len(listed) > 7
    found = {
        name: [" ".join(each.split()) for each in re.findall(paragraph, path.read_text(encoding="utf-8"), re.DOTALL)]
        for name, path in modules().items()
    }
    assert sum(map(len, found.values())) > 100
    assert [(name, each) for name, sources in found.items() for each in sources if unlisted(each, listed)] == []


def test_every_code_on_the_page_is_told_and_stands_once_with_cause_and_cure() -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in modules().values())
    named = Counter(code for codes, _, _ in ENTRIES for code in codes)
    assert len(named) > 18
    assert len(ENTRIES) == ERRORS.count("\n- `")
    assert [code for code, times in named.items() if times > 1 or f'"{code}"' not in source] == []
    for codes, kind, text in nonempty(ENTRIES):
        cause, *cures = re.split(r"(?<=[.?]) (?=[A-Z])", text)
        assert len(cause) > 15, codes
        assert cures or kind.startswith(" (remark"), codes
        assert text.endswith((".", "?")), codes


def test_every_public_name_is_explained() -> None:
    page = python_page()
    parts = dict(re.findall(r"^### `(?:\w+\.)?(\w+)`\n\n(.+?)(?=^##|\Z)", page, re.MULTILINE | re.DOTALL))
    assert sorted(parts) == sorted([*(set(photostrip.__all__) - {"steps"}), *photostrip.steps.__all__])
    assert [name for name, text in nonempty(parts.items()) if not re.search(r"^[A-Z].*\w", text, re.MULTILINE)] == []
    assert "- `left`, `right`: (n, 2), the same points on both photos." in parts["relative"]
    assert "| `elements` | (5,): alpha1" in parts["Relative"]
    assert "| `ok` | Whether nothing" in parts["Check"]
    assert "| `faults` | All of them:" in parts["InputError"]
    assert "#### `Table.where`" in page
    assert "``" not in page.replace("```", "")


def test_every_command_is_there_with_its_options() -> None:
    page = command_page()
    assert re.findall(r"^## `photostrip (.+)`$", page, re.MULTILINE) == list(COMMANDS)
    assert "* `--trace FILE`: Write every iteration" in page
    assert "Exit codes: 0 done;" in page


def test_the_site_has_tables_and_fences_that_name_a_kind_alone() -> None:
    assert for_the_site("```console exit=2\n$ a\n```\n") == "```console\n$ a\n```\n"
    for name in TABLES:
        assert f"\n<!-- table: {name} -->\n" in "".join(page.read_text(encoding="utf-8") for page in pages())
    assert "| `grubbs_alpha` | 0.05 | Probability of" in for_the_site("<!-- table: project -->")
    assert "| P401 | **axes exchanged, or photos mirrored** |" in for_the_site("<!-- table: findings -->")
