"""What README.md and docs/ show is what the program does."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

import pytest

from tests.loops import nonempty
from tests.pages import FRESH_CLONE, blocks, faults_of_page, pages, steps
from tests.source_tree import ROOT, modules

if TYPE_CHECKING:
    from pathlib import Path

WITHOUT_FORKS = {"README.md"}  # what a user types first, as whole processes
PAGES = [pytest.param(page, id=page.relative_to(ROOT).as_posix()) for page in pages()]
LINK = re.compile(r"\]\((?!https?:|mailto:|#)([^)#\s]+)")


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
    made = [f"reference/{name}.md" for name in ("commands", "keys", "python", "result", "sources")]
    written = [page.relative_to(ROOT / "docs").as_posix() for page in pages() if page.name != "README.md"]
    assert sorted(menu) == sorted([*written, *made])


def test_headings_have_the_words_that_newcomers_search_for() -> None:
    table = (ROOT / "docs/tests.md").read_text(encoding="utf-8").partition("| search | page |")[2].partition("\n\n")[0]
    for words, page in nonempty(re.findall(r"\| ([\w ]+) \| ([\w/-]+\.md) \|", table)):
        headings = re.findall(r"(?m)^#+ .+$", (ROOT / "docs" / page).read_text(encoding="utf-8"))
        asked = set(words.lower().split())
        assert any(asked <= set(re.findall(r"\w+", heading.lower())) for heading in headings), words


def test_no_page_of_the_site_links_out_of_it() -> None:
    for page in nonempty(pages()[1:]):
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            assert (page.parent / target).resolve().is_relative_to(ROOT / "docs"), f"{page.name}: {target}"


@cache
def tags_listed() -> set[str]:
    return set(re.findall(r"^\| \[([^\]]+)\] \|", (ROOT / "docs/sources.md").read_text(encoding="utf-8"), re.MULTILINE))


def source_lines(text: str) -> list[str]:
    """Give the paragraphs of a module that begin with ``Source:``."""
    return [" ".join(found.split()) for found in re.findall(r"Source: (.*?)(?:\n\s*\n|\"\"\")", text, re.DOTALL)]


def unlisted(source: str, listed: set[str]) -> bool:
    """Tell whether a ``Source:`` names nothing that docs/sources.md lists, or a number that is not listed."""
    named = {tag for tag in listed if re.search(rf"\b{re.escape(tag)}\b", source)}
    numbers = set(re.findall(r"\[(\d\w*)\]", source))
    return not (named or "derived" in source.lower()) or not numbers <= listed


def test_every_source_in_the_code_is_listed() -> None:
    listed = tags_listed()
    assert len(listed) > 7
    found = {name: source_lines(path.read_text(encoding="utf-8")) for name, path in modules().items()}
    assert sum(map(len, found.values())) > 100
    assert [(name, each) for name, sources in found.items() for each in sources if unlisted(each, listed)] == []
