"""What is installed: versions, threads, formats, extras."""

from __future__ import annotations

import os
import platform
import re
import sys
from importlib import metadata
from typing import Any

from photostrip import __version__
from photostrip.threads import THREAD_VARIABLES

# What can be read and written, by the command that does it.
FORMATS = {
    "read": [
        "project file (YAML): photostrip check, run, batch",
        "image coordinates, fiducial marks, control (.csv, .csv.gz): photostrip check, run, batch",
        "simulation (YAML): photostrip simulate",
        "models of COLMAP and OpenSfM, cameras of Metashape, projects of HISTORIX: photostrip convert",
        "control with marks, GNSS events: photostrip convert",
        "result.json, baseline.json: photostrip report, compare, convert",
        "tolerance profile (YAML): photostrip compare",
        "plans of a model, a strip, cameras (YAML): photostrip plan",
        "phototheodolite projects and tables (YAML, .csv): photostrip terrestrial",
    ],
    "written": [
        "result.json and points, photos, residuals, parallaxes, rejected, refined (CSV): photostrip run -o, batch -o",
        "summary of a batch (text, CSV, JSON, JUnit, Markdown, annotations): photostrip batch",
        "accuracy report (text, Markdown, JSON, annotations; HTML with pictures): photostrip run, report",
        "comparison (text, Markdown, JSON, JUnit, annotations), baseline.json: photostrip compare",
        "project with tables and truth.json: photostrip simulate -o",
        "GeoPackage, orthority (CSV, GeoJSON), HISTORIX, COLMAP, OpenSfM: photostrip convert RESULT FILE, `export`",
        "trace of every iteration (text, Markdown, JSON): photostrip run --trace",
        "rule for make: photostrip run --depfile",
        "JSON Schema: photostrip schema",
        "completion of shells: photostrip --install-completion",
    ],
}
FOR_DEVELOPMENT = ("test", "dev", "peer")  # extras for those who work on photostrip itself


def installation() -> dict[str, Any]:
    """Return what is installed: libraries with versions, threads, formats, extras with what is missing."""
    required, extras = _requirements()
    return {
        "photostrip": __version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "libraries": {name: _version(name) for name in required},
        "threads": {name: os.environ.get(name, "") for name in THREAD_VARIABLES},
        "formats": FORMATS,
        "extras": {name: _extra(name, libraries) for name, libraries in extras.items() if name not in FOR_DEVELOPMENT},
    }


def _requirements() -> tuple[list[str], dict[str, list[str]]]:
    """Return the libraries that are needed, and those of each extra, from the installed package itself."""
    try:
        lines = metadata.requires("photostrip") or []
    except metadata.PackageNotFoundError:  # run from a folder, not installed
        lines = ["numpy", "pyproj", "pyyaml", "rich", "scipy", "typer"]
    required: list[str] = []
    extras: dict[str, list[str]] = {}
    for line in lines:
        found = re.match(r"[A-Za-z0-9._-]+", line)
        name = found[0].lower() if found else line
        extra = re.search(r"extra == ['\"]([^'\"]+)['\"]", line)
        extras.setdefault(extra[1], []).append(name) if extra else required.append(name)
    return sorted(set(required)), {name: sorted(set(each)) for name, each in sorted(extras.items())}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _extra(name: str, libraries: list[str]) -> dict[str, Any]:
    missing = [each for each in libraries if not _version(each)]
    command = f"{sys.executable} -m pip install 'photostrip[{name}]'" if missing else ""
    return {"libraries": libraries, "missing": missing, "command": command}


def as_text(found: dict[str, Any]) -> str:
    """Return what is installed as text, one fact a line."""
    lines = [
        f"photostrip  {found['photostrip']}",
        f"python      {found['python']}",
        f"system      {found['system']}",
        "libraries   " + ", ".join(f"{name} {version or 'MISSING'}" for name, version in found["libraries"].items()),
        "threads     " + ", ".join(f"{name}={value or 'not set'}" for name, value in found["threads"].items()),
        *(f"reads       {each}" for each in found["formats"]["read"]),
        *(f"writes      {each}" for each in found["formats"]["written"]),
    ]
    for name, extra in found["extras"].items():
        state = f"missing: {', '.join(extra['missing'])}; {extra['command']}" if extra["missing"] else "there"
        lines.append(f"extra       {name}: {state}")
    if not found["extras"]:
        lines.append("extras      none are defined in this version")
    return "".join(f"{line}\n" for line in lines)
