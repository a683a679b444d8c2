"""A result made again from the project that its certificate names, and compared with it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from os.path import normpath
from pathlib import Path

from photostrip.comparison import Tolerances, compare_results
from photostrip.errors import Fault, InputError
from photostrip.formats.files import Source, digest, from_disk, reading_from, seen_from
from photostrip.formats.result_json import read_result
from photostrip.library.project import loaded_from
from photostrip.notes import Document
from photostrip.project.reading import LARGEST_PROJECT
from photostrip.result.certificate import is_edited


def compare_again(result: Path, project: Path | None = None, tolerances: Tolerances | None = None) -> Document:
    """Adjust the project of a result again, and compare what comes out with the result.

    project: the project file; without one it is looked for beside the result and in the working folder, by its hash.

    Returns the document of a comparison whose block ``again`` says whether the result was edited, which files and grids
        are not those of the certificate (changed, not read, not named there), and which versions are others.
    Raises InputError when the result cannot be read, has no certificate, or its project is not found, and whatever the
        run raises.
    """
    file = str(result / "result.json" if result.is_dir() else result)
    document = read_result(file)
    certificate = document.get("certificate")
    if certificate is None:
        fix = "run the project again with this version of photostrip"
        raise InputError(Fault("has no certificate", "no-certificate", file, fix=fix))
    place = project or _project_beside(Path(file).parent, certificate)
    if place is None:
        raise InputError(Fault("its project is not found beside it", "no-project", file, fix="name it with --project"))
    with reading_from(Source()) as account:
        again = loaded_from(place, certificate["set"]).run().document
    now = again["certificate"]
    grids = {each["file"]: each["sha256"] for each in now["grids"]}
    files = [
        *_changed(certificate["inputs"], _read(account, place, certificate)),
        *_changed(certificate["grids"], grids),
    ]
    versions = [
        {"name": name, "certificate": certificate["versions"].get(name), "now": version}
        for name, version in now["versions"].items()
        if certificate["versions"].get(name) != version
    ]
    compared = compare_results(again, document, tolerances, ("the result made again", file))
    edited = is_edited(document)
    status = "different" if edited or files else compared["status"]
    return compared | {"status": status, "again": {"edited": edited, "files": files, "versions": versions}}


def _project_beside(folder: Path, certificate: Document) -> Path | None:
    """Return the project file that has the content which the certificate gives."""
    names = {each["sha256"]: each["file"] for each in certificate["inputs"]}
    above = [Path(normpath(folder / up)) for up in ("..", "../..")]  # methods side by side have folders of their own
    for place in (folder, *above, Path()):
        for path in sorted(place.glob("*.yaml")):
            with suppress(InputError):  # no project
                content = digest(from_disk(str(path), LARGEST_PROJECT))
                if "/" not in names.get(content, "/") and path.name in names.values():
                    return path
    return None


def _read(account: Source, project: Path, certificate: Document) -> dict[str, str]:
    """Return the hash of every file that was read, as the certificate names it; the project may have another name."""
    read = {seen_from(file, project.parent): content for file, content in account.digests.items()}
    named = {each["file"]: each["sha256"] for each in certificate["inputs"]}
    if project.name in read and project.name not in named:
        content = read.pop(project.name)
        read[next((name for name in named if named[name] == content and name not in read), project.name)] = content
    return read


def _changed(certificate: list[Document], now: Mapping[str, str]) -> list[Document]:
    """Compare the files that a certificate names with those that were read; being named there opens none."""
    named = {each["file"]: each["sha256"] for each in certificate}
    states = {
        name: "changed" if name in now else "not read" for name, content in named.items() if now.get(name) != content
    }
    states |= {name: "not in the certificate" for name in sorted(now) if name not in named}
    return [{"file": name, "state": state} for name, state in states.items()]
