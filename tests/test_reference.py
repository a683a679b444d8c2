"""The reference of the site: every public name and every command, with what is said of it."""

from __future__ import annotations

import re

import photostrip
from photostrip.cli.main import COMMANDS
from tests.loops import nonempty
from tests.pages import pages
from tests.reference import TABLES, command_page, every_command, for_the_site, python_page


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
    named = re.findall(r"^## `photostrip (.+)`$", page, re.MULTILINE)
    assert named == list(COMMANDS)
    for name, command in nonempty(list(every_command())):
        part = page.partition(f"## `photostrip {name}`")[2].partition("\n## ")[0]
        assert [option for each in command.params for option in each.opts[:1] if option.startswith("--")
                and not each.hidden and option not in part] == [], name  # fmt: skip


def test_the_site_has_tables_and_fences_that_name_a_kind_alone() -> None:
    assert for_the_site("```console exit=2\n$ a\n```\n") == "```console\n$ a\n```\n"
    for name in TABLES:
        assert f"\n<!-- table: {name} -->\n" in "".join(page.read_text(encoding="utf-8") for page in pages())
    assert "| `grubbs_alpha` | 0.05 | Probability of" in for_the_site("<!-- table: project -->")
    assert "| P401 | **control axes exchanged or left-handed** |" in for_the_site("<!-- table: findings -->")
