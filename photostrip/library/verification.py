"""A result made again from its certificate: whether the files, the versions and the numbers are still the same."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from math import isclose
from os.path import normpath
from pathlib import Path
from typing import Any

from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.output.result_json import read_result
from photostrip.formats.text.files import from_disk
from photostrip.formats.text.source import Source, digest, reading_from, seen_from
from photostrip.library.project import loaded_from
from photostrip.notes import Document
from photostrip.project.yaml.parsing import LARGEST_PROJECT
from photostrip.result.statement.edited import is_edited
from photostrip.result.table import plain_of

SCHEMA = 1
SAME, DIFFERENT = "same", "different"
CHANGED, MISSING, NOT_READ, NOT_NAMED = "changed", "missing", "not read", "not in the certificate"  # states of files
PROJECT = "project.yaml"
LEFT_OUT = {"version", "certificate"}  # what does not come from the project
# Differences that another machine makes: of a number in a block that `compare` does not look at.
RELATIVE, ABSOLUTE = 1e-3, 2e-4


def verify(result: Path, project: Path | None = None) -> Document:
    """Make a result again, and return the document of ``photostrip verify``.

    project: the project file; without one it is looked for beside the result and in the working folder, by its hash.
    Raises InputError when the result cannot be read, has no certificate, or its project is not found.
    """
    file = str(result / "result.json" if result.is_dir() else result)
    document = read_result(file)
    certificate = document.get("certificate")
    if certificate is None:
        fix = "run the project again with this version of photostrip"
        raise InputError(Fault("has no certificate", "no-certificate", file, fix=fix))
    place = project or _found(Path(file).parent, certificate)
    if place is None:
        fix = "name it with --project"
        raise InputError(Fault("its project is not found beside it", "no-project", file, fix=fix))
    found: Document = {
        "photostrip_verify": SCHEMA,
        "result": file,
        "project": str(place),
        "name": document["name"],
        "edited": is_edited(document),
        "inputs": [],
        "grids": [],
        "versions": [],
        "refused": "",
        "numbers": None,
        "words": [],
        "result_sha256": {"certificate": certificate["result_sha256"], "now": None},
    }
    with reading_from(Source()) as account:
        try:
            again = loaded_from(place, certificate["set"]).run().in_tables
        except (InputError, GeometryError) as error:
            found["refused"] = str(error)
        else:
            found |= _compared(document, again, file, place.parent)
    found["inputs"] = _states(certificate["inputs"], _read(account, place, certificate), place.parent)
    found["status"] = SAME if _same(found) else DIFFERENT
    return found


def _found(folder: Path, certificate: Document) -> Path | None:
    """Return the project file that has the content which the certificate gives."""
    wanted = {each["sha256"]: each["file"] for each in certificate["inputs"]}
    above = [Path(normpath(folder / up)) for up in ("..", "../..")]  # methods side by side have folders of their own
    for place in (folder, *above, Path()):
        for path in sorted(place.glob("*.yaml")):
            with suppress(InputError):  # no project
                content = digest(from_disk(str(path), LARGEST_PROJECT))
                if "/" not in wanted.get(content, "/") and path.name in wanted.values():
                    return path
    return None


def _read(account: Source, project: Path, certificate: Document) -> dict[str, str]:
    """Return the hash of every file that was read, as the certificate names it; the project may have another name."""
    read = {seen_from(file, project.parent): content for file, content in account.digests.items()}
    wanted = {each["file"]: each["sha256"] for each in certificate["inputs"]}
    if project.name in read and project.name not in wanted:
        content = read.pop(project.name)
        read[next((name for name in wanted if wanted[name] == content and name not in read), project.name)] = content
    return read


def _states(certificate: list[Document], now: Mapping[str, str], folder: Path) -> list[Document]:
    """Compare the files that a certificate names with those that were read; being named there opens none."""
    named = {each["file"]: each["sha256"] for each in certificate}
    states = {name: _state(folder / name, content, now.get(name)) for name, content in named.items()}
    states |= {name: NOT_NAMED for name in sorted(now) if name not in named}
    return [{"file": name, "state": state} for name, state in states.items()]


def _state(path: Path, content: str, now: str | None) -> str:
    if now is None:
        return NOT_READ if path.exists() else MISSING
    return SAME if now == content else CHANGED


def _compared(document: Document, again: Document, file: str, folder: Path) -> Document:
    """Return what is different between a result and the same made again."""
    from photostrip.comparison import compare_results

    before, now = document["certificate"], again["certificate"]
    versions = [
        {"name": name, "certificate": before["versions"].get(name), "now": version}
        for name, version in now["versions"].items()
        if before["versions"].get(name) != version
    ]
    grids = {each["file"]: each["sha256"] for each in now["grids"]}
    others = [key for key in again if key not in LEFT_OUT and _other(plain_of(document.get(key)), plain_of(again[key]))]
    return {
        "versions": versions,
        "grids": _states(before["grids"], grids, folder),
        "numbers": compare_results(again, document, None, ("the result made again", file)),
        "words": [] if versions else others,
        "result_sha256": {"certificate": before["result_sha256"], "now": now["result_sha256"]},
    }


def _other(one: Any, two: Any) -> bool:  # noqa: ANN401 (any part of a document)
    """Whether two parts differ by more than another processor makes them differ."""
    if isinstance(one, dict) and isinstance(two, dict):
        return one.keys() != two.keys() or any(_other(one[key], two[key]) for key in one)
    if isinstance(one, list) and isinstance(two, list | tuple):  # a tuple is read again as a list
        return len(one) != len(two) or any(map(_other, one, two))
    if isinstance(one, float) and isinstance(two, float | int) and not isinstance(two, bool):
        return not isclose(one, two, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
    return bool(one != two)


def _same(found: Document) -> bool:
    files = [*found["inputs"], *found["grids"]]
    return (
        not found["edited"]
        and not found["refused"]
        and all(each["state"] == SAME for each in files)
        and found["numbers"]["status"] == SAME
        and not found["words"]
    )
