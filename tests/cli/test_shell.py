"""Completion in real shells."""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.jobs.completion import keys
from photostrip.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

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
