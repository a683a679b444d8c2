"""Completion in real shells."""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.options import _keys

if TYPE_CHECKING:
    from pathlib import Path


def asked(photostrip: Path, shell: str, script: str) -> list[str]:
    """Run a script of a shell in which ``photostrip`` is this one; give the lines that it prints."""
    environment = os.environ | {"PATH": f"{photostrip.parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run([shell, "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return done.stdout.split()


BASH = """
eval "$(_PHOTOSTRIP_COMPLETE=source_bash photostrip)"
COMP_WORDS=(photostrip {words}); COMP_CWORD={count}; _photostrip_completion photostrip
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("co", {"compare", "convert"}),
        ("run --verb", {"--verbose"}),
        ("compare a b --format j", {"json", "junit"}),
        ("terrestrial dis", {"displacement"}),
        ("run --set processing.polynomial.d", {"processing.polynomial.degree="}),
        ("report r --section ch", {"check"}),
    ],
)
def test_bash_completes(forked: Path, words: str, expected: set[str]) -> None:
    assert set(asked(forked, "bash", BASH.format(words=words, count=len(words.split())))) == expected


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish")
def test_fish_completes(forked: Path) -> None:
    found = asked(forked, "fish", "_PHOTOSTRIP_COMPLETE=source_fish photostrip | source; complete -C 'photostrip co'")
    assert {"compare", "convert"} <= set(found)


@pytest.mark.skipif(shutil.which("zsh") is None, reason="needs zsh")
def test_zsh_reads_the_script(forked: Path) -> None:
    script = 'autoload -U compinit; compinit -u -D; eval "$(_PHOTOSTRIP_COMPLETE=source_zsh photostrip)"'
    script += "; echo $_comps[photostrip]"
    assert asked(forked, "zsh", script) == ["_photostrip_completion"]


def test_the_keys_are_those_of_the_project_file() -> None:
    found = _keys("processing.relative.")
    assert {"processing.relative.screening=", "processing.relative.grubbs_alpha="} <= set(found)
    assert {"output.crs=", "observations.unit="} <= set(_keys(""))
    assert _keys("nothing") == []
