"""Every command: the module in which it stands, what ``--help`` says of it, an example.

Nothing is imported here: ``photostrip --help`` answers from this table alone.
"""

from __future__ import annotations

from typing import NamedTuple

HELP_NAMES = {"help_option_names": ["--help", "-h"]}


class CommandEntry(NamedTuple):
    """Where a command stands and what ``--help`` says of it.

    ``module`` holds a function, or a ``typer.Typer`` with subcommands, of the command's own name.
    """

    module: str
    help: str
    example: str


_TEXTS = (
    ("init", "Write a commented project file and the headers of its tables.", "photostrip init strip-a"),
    (
        "convert",
        "Write a project from COLMAP's files, or a result for others.",
        "photostrip convert sparse/0 -o block --sigma 0.7",
    ),
    ("check", "Check projects without adjusting them, and name all faults.", "photostrip check project.yaml"),
    ("run", "Adjust the strips of a project and report the accuracy.", "photostrip run project.yaml -o result"),
    ("batch", "Adjust many projects, on all cores or many machines.", "photostrip batch strips/* -o results -j 4"),
    ("report", "Print the accuracy report of a saved result again.", "photostrip report result/result.json"),
    (
        "statement",
        "State the accuracy of a result by the norms, to be signed.",
        "photostrip statement result --class-plan 15 --class-height 20",
    ),
    (
        "compare",
        "Compare a result with a baseline, within tolerances.",
        "photostrip compare result baseline.json --tol exact.yaml",
    ),
    (
        "simulate",
        "Write a synthetic project with known truth, ready to run.",
        "photostrip simulate strip.yaml -o simulated",
    ),
    (
        "plan",
        "Expected accuracy and design, before any photo is taken.",
        "photostrip plan model --overlap 60 --control corners",
    ),
    (
        "step",
        "Single steps of the method, for teaching and checking.",
        "photostrip step relative pair.csv -f 153 --base 920 --unit m",
    ),
    (
        "terrestrial",
        "Directions of a phototheodolite, displacements between epochs.",
        "photostrip terrestrial displacement survey.yaml -o result",
    ),
    (
        "sources",
        "Compute the numbers of the sources again; misprints, equations.",
        "photostrip sources --format md",
    ),
    (
        "schema",
        "Print the JSON Schema of the project file, for editors.",
        "photostrip schema -o photostrip.schema.json",
    ),
    ("completion", "Print the script that makes a shell complete commands.", "photostrip completion bash >> ~/.bashrc"),
    ("info", "Print versions and formats, and how to get what is missing.", "photostrip info --format json"),
)
_MODULES = {
    "completion": "shell",
    "plan": "plan.plan",
    "sources": "info",
}  # where it is not that of the command's name
COMMANDS = {
    name: CommandEntry(f"photostrip.cli.commands.{_MODULES.get(name, name)}", text, example)
    for name, text, example in _TEXTS
}
COMPLETION = "_PHOTOSTRIP_COMPLETE"  # the variable in which the script of a shell asks what can stand at the cursor


def usage() -> str:
    """Return the text of ``photostrip --help``."""
    width = max(map(len, COMMANDS))
    commands = "\n".join(f"  {name:<{width}}  {entry.help}" for name, entry in COMMANDS.items())
    return f"""\
Usage: photostrip [--debug] COMMAND [ARGUMENTS]...

Analytical strip phototriangulation: from measured image coordinates to
adjusted ground coordinates.

Commands:
{commands}

Options:
  --version   Print the version and exit.
  --debug     Print the traceback of an error.
  -h, --help  Print this text and exit; after a command, its help.

Environment: PHOTOSTRIP_FORMAT, PHOTOSTRIP_WIDTH, PHOTOSTRIP_QUIET,
PHOTOSTRIP_VERBOSE and PHOTOSTRIP_DEBUG stand in for the options of these names;
NO_COLOR forbids colours.

Example:
  {COMMANDS["run"].example}

Exit codes: 0 done; 1 done, but a tolerance or a comparison failed; 2 wrong
usage, project file or data; 3 the geometry is too weak; 70 an internal error
(a bug).
"""
