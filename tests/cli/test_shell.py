"""Completion in real shells, and manual pages that say what ``--help`` says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from functools import cache
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.command_table import COMMANDS
from photostrip.cli.jobs.completion import keys
from photostrip.cli.jobs.manual import manual_pages
from photostrip.cli.main import main
from tests.cli.helps import FOLDER
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path

MACROS = {".TH", ".SH", ".B", ".PP", ".TP", ".nf", ".fi"}


@cache
def pages() -> dict[str, str]:
    return manual_pages()


# --------------------------------------------------------------------------------------------------- completion


def asked(photostrip: Path, shell: str, script: str) -> list[str]:
    """Run a script of a shell in which ``photostrip`` is this one; give the lines that it prints."""
    environment = os.environ | {"PATH": f"{photostrip.parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run([shell, "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return done.stdout.split()


BASH = """
eval "$(photostrip completion bash)"
COMP_WORDS=(photostrip {words}); COMP_CWORD={count}; _photostrip_completion photostrip
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("co", {"compare", "completion", "convert"}),
        ("run --verb", {"--verbose"}),
        ("compare a b --format j", {"json", "junit"}),
        ("terrestrial dis", {"displacement"}),
        ("run --set processing.polynomial.d", {"processing.polynomial.degree="}),
        ("completion f", {"fish"}),
        ("report r --section ch", {"check"}),
    ],
)
def test_bash_completes(forked: Path, words: str, expected: set[str]) -> None:
    assert set(asked(forked, "bash", BASH.format(words=words, count=len(words.split())))) == expected


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish")
def test_fish_completes(forked: Path) -> None:
    found = asked(forked, "fish", "photostrip completion fish | source; complete -C 'photostrip co'")
    assert {"compare", "completion", "convert"} <= set(found)


@pytest.mark.skipif(shutil.which("zsh") is None, reason="needs zsh")
def test_zsh_reads_the_script(forked: Path) -> None:
    script = 'autoload -U compinit; compinit -u -D; eval "$(photostrip completion zsh)"; echo $_comps[photostrip]'
    assert asked(forked, "zsh", script) == ["_photostrip_completion"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_every_shell_has_a_script(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert "PHOTOSTRIP_COMPLETE" in capsys.readouterr().out


def test_another_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "csh"]) == 2
    assert "csh" in capsys.readouterr().err


def test_the_keys_are_those_of_the_project_file() -> None:
    found = keys("processing.relative.")
    assert {"processing.relative.screening=", "processing.relative.grubbs_alpha="} <= set(found)
    assert {"output.crs=", "photos.camera="} <= set(keys(""))
    assert keys("nothing") == []


def test_completion_does_not_disturb_the_environment() -> None:
    main(["completion", "bash"])
    assert "_PHOTOSTRIP_COMPLETE" not in os.environ


# ------------------------------------------------------------------------------------------------------- manual


def plain(page: str) -> str:
    """Give a page as words, without the signs of roff."""
    text = re.sub(r"\\f[BIR]", "", page)
    for sign, meant in (("\\-", "-"), ("\\(ga", "`"), ("\\(ti", "~"), ("\\(ha", "^"), ("\\&", ""), ("\\e", "\\")):
        text = text.replace(sign, meant)
    return " ".join(text.split())


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_a_page_says_what_the_help_says(name: str) -> None:
    page = plain(pages()[f"photostrip-{name}.1"])
    text = (FOLDER / f"{name}.txt").read_text(encoding="utf-8")
    options = set(re.findall(r"(?m)^  (?:-\w, )?(--[a-z-]+)", text))
    assert options
    assert sorted(option for option in options if option not in page) == []
    description = text.split("\n\n")[1]
    assert " ".join(description.split()) in page
    assert COMMANDS[name].example in page


def test_every_command_has_a_page_and_the_first_names_them() -> None:
    first = plain(pages()["photostrip.1"])
    for name in COMMANDS:
        assert f"photostrip-{name}(1)" in first
    assert "photostrip-terrestrial-directions-orient.1" in pages()


@pytest.mark.parametrize("name", sorted(pages()))
def test_a_page_is_sound_roff(name: str) -> None:
    for line in nonempty(pages()[name].splitlines()):
        assert not line.startswith("'")
        assert not line.startswith(".") or line.split()[0] in MACROS, line
        assert line.isascii()
        assert not re.search(r"(?<!\\)-", line.removeprefix(".")), "a minus sign that may be broken or made a hyphen"
    sections = re.findall(r"(?m)^\.SH (.+)$", pages()[name])
    assert sections[:3] == ["NAME", "SYNOPSIS", "DESCRIPTION"]
    assert sections[-3:] == ["EXIT STATUS", "ENVIRONMENT", "SEE ALSO"]


@pytest.mark.skipif(shutil.which("mandoc") is None, reason="needs mandoc")
def test_mandoc_has_nothing_to_say_but_that_there_is_no_date(tmp_path: Path) -> None:
    assert main(["man", "-o", str(tmp_path), "--quiet"]) == 0
    files = sorted(map(str, tmp_path.glob("*.1")))
    assert len(files) == len(pages())
    done = subprocess.run(["mandoc", "-Tlint", "-Wwarning", *files], capture_output=True, text=True, check=False)
    assert [line for line in done.stdout.splitlines() if "missing date" not in line] == []


@pytest.mark.slow
def test_a_page_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["man", "rnu"]) == 2
    assert "there is no page of 'rnu'; there are batch" in capsys.readouterr().err
    assert main(["man", "terrestrial displacement"]) == 0
