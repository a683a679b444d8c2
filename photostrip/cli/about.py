"""What is installed and what is missing; what may stand in the files that users write."""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from photostrip import __version__
from photostrip.cli.options import Shape
from photostrip.planning import PlanKind
from photostrip.strip import StepName
from photostrip.terrestrial import TerrestrialKind
from photostrip.threads import THREAD_VARIABLES

# What can be read and written, by the command that does it.
FORMATS = {
    "read": [
        "project file (YAML): photostrip check, run, batch",
        "image coordinates, fiducial marks, control (.csv, .csv.gz): photostrip check, run, batch",
        "simulation (YAML): photostrip simulate",
        "models of COLMAP and OpenSfM, cameras of Metashape, projects of HISTORIX: photostrip convert",
        "control with marks, GNSS events: photostrip convert",
        "result.json, baseline.json: photostrip report, statement, compare, convert",
        "tolerance profile (YAML): photostrip compare",
        "plans (YAML): photostrip plan; tables of single steps (.csv): photostrip step",
        "phototheodolite projects and tables (YAML, .csv): photostrip terrestrial",
    ],
    "written": [
        "result.json and its tables, refined.csv, export to other programs: photostrip run -o, batch -o",
        "summary of a batch (text, CSV, JSON, JUnit, Markdown, annotations): photostrip batch",
        "accuracy report (text, Markdown, JSON, annotations; HTML with pictures): photostrip run, report",
        "comparison (text, Markdown, JSON, JUnit, annotations), baseline.json: photostrip compare",
        "project with tables and truth.json: photostrip simulate -o",
        "GeoPackage, orthority (CSV, GeoJSON), HISTORIX, COLMAP, OpenSfM: photostrip convert RESULT FILE, `export`",
        "trace of every iteration (text, Markdown, HTML, JSON): photostrip run --trace",
        "rule for make: photostrip run, batch, simulate, plan, terrestrial --depfile",
        "JSON Schema: photostrip schema",
        "completion of shells: photostrip --install-completion",
    ],
}
FOR_DEVELOPMENT = ("test", "dev", "peer")  # extras for those who work on photostrip itself


def info(form: Shape = "text") -> None:
    """Print versions and formats, as text or JSON, and how to get what is missing.

    Include it in every report of a problem.
    """
    installed = installation()
    sys.stdout.write(f"{json.dumps(installed, indent=1)}\n" if form == "json" else "".join(_lines(installed)))


def installation() -> dict[str, Any]:
    """Return what is installed: libraries with versions, threads, formats, extras with what is missing."""
    try:
        lines = metadata.requires("photostrip") or []
    except metadata.PackageNotFoundError:  # run from a folder, not installed
        lines = ["numpy", "pyproj", "pyyaml", "rich", "scipy", "typer"]
    libraries: dict[str, list[str]] = {"": []}  # by extra; none for those that are always needed
    for line in sorted(set(lines)):
        name, extra = re.match(r"[A-Za-z0-9._-]+", line), re.search(r"extra == ['\"]([^'\"]+)['\"]", line)
        libraries.setdefault(extra[1] if extra else "", []).append(name[0].lower() if name else line)
    required = libraries.pop("")
    return {
        "photostrip": __version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "libraries": {name: _version(name) for name in required},
        "threads": {name: os.environ.get(name, "") for name in THREAD_VARIABLES},
        "formats": FORMATS,
        "extras": {name: _extra(name, libraries[name]) for name in sorted({*libraries} - {*FOR_DEVELOPMENT})},
    }


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _extra(name: str, libraries: list[str]) -> dict[str, Any]:
    missing = [each for each in libraries if not _version(each)]
    command = f"{sys.executable} -m pip install 'photostrip[{name}]'" if missing else ""
    return {"libraries": libraries, "missing": missing, "command": command}


def _lines(installed: dict[str, Any]) -> Iterator[str]:
    libraries = (f"{name} {version or 'MISSING'}" for name, version in installed["libraries"].items())
    threads = (f"{name}={value or 'not set'}" for name, value in installed["threads"].items())
    lines = [(key, installed[key]) for key in ("photostrip", "python", "system")]
    lines += [("libraries", ", ".join(libraries)), ("threads", ", ".join(threads))]
    lines += [("reads", each) for each in FORMATS["read"]] + [("writes", each) for each in FORMATS["written"]]
    for name, extra in installed["extras"].items():
        state = f"missing: {', '.join(extra['missing'])}; {extra['command']}" if extra["missing"] else "there"
        lines.append(("extra", f"{name}: {state}"))
    if not installed["extras"]:
        lines.append(("extras", "none are defined in this version"))
    return (f"{head:<11} {text}\n" for head, text in lines)


def schema(
    simulation: Annotated[
        bool, typer.Option("--simulation", help="The specification of `photostrip simulate` instead.")
    ] = False,
    plan: Annotated[
        PlanKind | None, typer.Option(help="The file of this command of `photostrip plan` instead.")
    ] = None,
    terrestrial: Annotated[
        TerrestrialKind | None, typer.Option(help="The file of this computation of `photostrip terrestrial` instead.")
    ] = None,
    step: Annotated[StepName | None, typer.Option(help="The keys of this step of `photostrip step` instead.")] = None,
    tolerances: Annotated[
        bool, typer.Option("--tolerances", help="The tolerance profile of `photostrip compare` instead.")
    ] = False,
    result: Annotated[bool, typer.Option("--result", help="What result.json may hold instead.")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="File to write, FILE.md as a table of keys; default: stdout."
        ),
    ] = None,
) -> None:
    """Print the JSON Schema of the project file, for editors.

    An editor that knows JSON Schema completes keys and explains them: write the schema to a file and begin the
    project file with `# yaml-language-server: $schema=photostrip.schema.json`.
    """
    from photostrip.formats.files import write_text
    from photostrip.project.editors import keys_page, schema_of
    from photostrip.result.description import result_page, result_schema

    asked: dict[str, object] = {"tolerances": tolerances, "simulation": simulation, plan or "": plan}
    asked |= {f"terrestrial {terrestrial}": terrestrial, f"step {step}": step}
    kind = next((name for name, chosen in asked.items() if chosen), "project")
    if output is not None and output.suffix == ".md":
        write_text(output, result_page() if result else keys_page(kind))
        return
    text = json.dumps(result_schema() if result else schema_of(kind), indent=2) + "\n"
    if output is None:
        sys.stdout.write(text)
    else:
        write_text(output, text)
