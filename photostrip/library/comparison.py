"""A result against a baseline, against the truth of its simulation, or against itself, made again; whole folders."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from os import PathLike
from os.path import normpath
from pathlib import Path
from typing import Any

from photostrip.comparison import Tolerances, compare_results
from photostrip.errors import Fault, InputError
from photostrip.formats.files import Source, digest, from_disk, reading_from, seen_from
from photostrip.formats.result_json import checked, parsed, read_baseline, read_result
from photostrip.library.project import loaded_from
from photostrip.library.result import RESULT, Result
from photostrip.notes import Document, counted
from photostrip.project.reading import LARGEST_PROJECT
from photostrip.result.certificate import is_edited
from photostrip.result.description import LEFT_OUT
from photostrip.result.table import plain_of

BASELINE = "baseline.json"
TRUTH = "photostrip_truth"  # the key by which truth.json is known


class Comparison:
    """What differs between a result and a baseline by more than is allowed; against the truth, the true errors."""

    def __init__(self, document: Document) -> None:
        self.document = document
        """What ``photostrip compare --format json`` prints."""

    @property
    def same(self) -> bool:
        """Whether nothing differs by more than is allowed; against the truth nothing is allowed or forbidden."""
        return bool(self.document.get("status", "same") == "same")

    @property
    def differences(self) -> list[Document]:
        """What differs by more than is allowed, worst first; empty against the truth."""
        return list(self.document.get("differences", ()))

    def report(self, *, everything: bool = False) -> str:
        """Return the comparison as text."""
        from photostrip.report.commands.compare import comparison_report
        from photostrip.report.page.layout import to_text

        return to_text(*comparison_report(self.document, everything=everything))

    def __repr__(self) -> str:
        """Say in a sentence what was found."""
        from photostrip.report.commands.compare import headline

        return f"<Comparison: {headline(self.document)}>"


def compare(
    result: Result | str | PathLike[str] | Mapping[str, Any],
    baseline: Result | str | PathLike[str] | Mapping[str, Any],
    *,
    tolerances: str | PathLike[str] | Tolerances | None = None,
) -> Comparison:
    """Compare a result with a baseline or another result, with the truth, or all results of a folder with their own.

    result: a result, also as a mapping (``Result.document``); a result.json, the folder that holds one, or a folder
        with many such folders.
    baseline: the same; ``baseline.json``; or ``truth.json``, also as a mapping.
    tolerances: a tolerance profile (YAML); without one only the last digits may differ.
    Raises InputError when they cannot be compared: other frames, another format, no result. Of folders, what cannot be
    compared stands under ``refused`` in the document, beside what can.
    """
    from photostrip.comparison.truth import compare_with_truth

    if tolerances is None or isinstance(tolerances, Tolerances):
        allowed = tolerances or Tolerances()
    else:
        from photostrip.project.tolerances import load_tolerances

        allowed = load_tolerances(Path(tolerances))[0]
    if not isinstance(result, Result | Mapping) and not isinstance(baseline, Result | Mapping):
        one, other = Path(result), Path(baseline)
        if results := results_below(one):
            return Comparison(_folders(one, results, other, allowed))
        if one.is_dir() and not place_of(one).exists():
            fix = "name the folder into which `photostrip run -o` or `photostrip batch -o` wrote"
            raise InputError(Fault("holds no result.json, nor does a folder in it", "file-missing", str(one), fix=fix))
    now, named = _opened(result, "the result")
    before, other_name = _opened(baseline, "the baseline")
    if TRUTH in before:
        return Comparison(compare_with_truth(now, before, (named, other_name)))
    return Comparison(compare_results(now, before, allowed, (named, other_name)))


def place_of(baseline: Path, *, update: bool = False) -> Path:
    """Return the file of a baseline; in a folder it is baseline.json, or else, to be read, result.json."""
    if not baseline.is_dir():
        return baseline
    whole = baseline / RESULT
    return whole if whole.exists() and not update and not (baseline / BASELINE).exists() else baseline / BASELINE


def _opened(given: Result | str | PathLike[str] | Mapping[str, Any], name: str) -> tuple[Document, str]:
    """Return a document with what it is called in messages; a mapping has the name that is given."""
    if isinstance(given, Result):
        return given.document, given.name
    if isinstance(given, Mapping):
        return (dict(given), "the truth") if TRUTH in given else (checked(plain_of(dict(given)), name, LEFT_OUT), name)
    file = str(place_of(Path(given)))
    document = parsed(file)
    return (document if TRUTH in document else checked(document, file, LEFT_OUT)), file


def results_below(folder: Path) -> dict[str, Path]:
    """Return the results in the folders below a folder by name; none where it is a result or a baseline itself."""
    if not folder.is_dir() or any((folder / name).exists() for name in (RESULT, BASELINE)):
        return {}
    return {_name(file, folder): file for file in sorted(folder.rglob(RESULT))}


def _folders(above: Path, now: Mapping[str, Path], baselines: Path, allowed: Tolerances) -> Document:
    """Compare every result below a folder with the baseline of the same name below another."""
    if not baselines.is_dir():
        message = f"is no folder, and {above} is one of {counted(len(now), 'result')}"
        raise InputError(Fault(message, "file-missing", str(baselines), expected="a folder of baselines"))
    before = {_name(file, baselines): file for name in (RESULT, BASELINE) for file in sorted(baselines.rglob(name))}
    found, refused = [], []
    for name in sorted(now.keys() & before.keys()):
        files = (str(now[name]), str(before[name]))
        try:
            document, other = read_baseline(files[0]), read_baseline(files[1])
            found.append({"folder": name} | compare_results(document, other, allowed, files))
        except InputError as error:
            refused += [
                {"folder": name, "file": each.file, "line": each.line, "code": each.code, "message": str(each)}
                for each in error.faults
            ]
    missing, new = sorted(before.keys() - now.keys()), sorted(now.keys() - before.keys())
    same = found and not missing and not new and all(each["status"] == "same" for each in found)
    return {
        "photostrip_compare_folders": 1,
        "result": str(above),
        "baseline": str(baselines),
        "status": "refused" if refused else "same" if same else "different",
        "results": found,
        "refused": refused,
        "missing": missing,
        "new": new,
    }


def _name(file: Path, above: Path) -> str:
    """Return the folder of a file as seen from a folder above it, with slashes on every system."""
    return file.parent.relative_to(above).as_posix()


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
