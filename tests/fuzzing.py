"""Slips, accidents and malice done to the files of a project, and what must hold whatever they are."""

from __future__ import annotations

import contextlib
import io
import json
import re
import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from photostrip.cli.main import main
from photostrip.formats import result_files
from photostrip.result.description import Columns, described
from photostrip.simulation.spec import Gnss
from tests.project.samples import FILES, MARKED_FILES
from tests.results import spec, write_project

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from random import Random

LONGEST = 10.0  # seconds of the processor that one case may take
CODES = {0, 1, 2, 3}
BESIDE_TABLES = {"result.json", "project.resolved.yaml", "refined.csv", "report.html"}
TABLES = {result_files.FILES.get(key, key) for key, each in described().items() if isinstance(each, Columns)}
# What means something to YAML, a table, Python or a schema; characters that are hardly seen; numbers at limits.
SIGNS = [" ", "\n", "\r\n", "\t", ": ", "- ", "&a ", "!a ", "<<: ", "---\n", "\u200b", "\x00", "\x85", "\ufeff"]
WORDS = """, ; : # ' " [ ] { } *a \\ | > % @ ? [[[[ - ~ . ../ /dev/null /dev/zero =1+1 1:20 é 🛩️ １ ９９ 1_0 0123
nan inf 1e999 -1e308 1e-320 0 -0 0.0 2 180 90 1e3 1e9 null NO true none auto off xy z check px um up down
local geocentric EPSG:4326 EPSG:99999 model orthometric similarity tau"""
TEXTS = ["", "A" * 300, "[north, east, up]", *SIGNS, *WORDS.split()]
OVERRIDES = """observations.unit=px observations.sigma=1e-9 observations.sigma=1e9 control[0].sigma=[1e-9,1,1e9]
control[0].axes=[up,north,east] control[0].crs=EPSG:4326 control[0].crs=geocentric output.crs=EPSG:3857
processing.adjustment=similarity processing.polynomial.degree=3 processing.earth_curvature=model
processing.refraction=true processing.relative.screening=tau processing.relative.grubbs_alpha=0.999999
processing.scale_transfer=distances tolerances.check_rms_xy=1e-9 strips=[] cameras={} = a.b.c=1
processing.interior.transform=projective output.angles.unit=rad extends=project.yaml [0]=1"""


@dataclass
class Case:
    """What is run: files of a project, options, and what was done to the files."""

    files: dict[str, bytes]
    options: list[str] = field(default_factory=list)
    done: list[str] = field(default_factory=list)


class Outcome(NamedTuple):
    """How a case ended."""

    code: int
    seconds: float
    faults: tuple[str, ...]  # what must not be


def projects(folder: Path) -> list[dict[str, bytes]]:
    """Give the files of right projects: two that are read, one of them with marks, and two that run."""
    found = [{name: text.encode() for name, text in each.items()} for each in (FILES, MARKED_FILES)]
    for frame in ("north first", "local"):
        files = _files_of(write_project(folder / frame, spec(frame)))
        found += [files, files]
    return found


def blocks(folder: Path) -> list[dict[str, bytes]]:
    """Give the files of right bundles: two strips, with camera positions, with given orientations, single photos."""
    two, one = spec("local", strips=2), spec("local")
    bundle = "processing: {adjustment: bundle}\n"
    strips = _files_of(write_project(folder / "strips", two, bundle))
    positions = _files_of(write_project(folder / "positions", replace(two, gnss=Gnss(use=True)), bundle))
    path = write_project(folder / "single", one, bundle)
    with contextlib.redirect_stdout(io.StringIO()):
        code = main(["run", str(path), "-o", str(folder / "found"), "--quiet"])
    if code:
        raise RuntimeError("the right block does not run")
    given = {"photos.csv": (folder / "found" / "photos.csv").read_bytes()}
    files = {name: data for name, data in _files_of(path).items() if name in {"observations.csv", "control.csv"}}
    project = path.read_text(encoding="utf-8")
    listed = re.search(r"- id: .*\n  camera: (.*)\n  photos: \[([^]]*)\]\n", project)
    if listed is None:
        raise RuntimeError("the project lists no photos")
    table = 'orientations:\n  file: photos.csv\n  crs: "local"\n  axes: [east, north, up]\n  role: '
    observed = f"{table}observed\n  sigma: [0.1, 0.1, 0.1]\n  sigma_angles: [0.01, 0.01, 0.01]\n"
    single = "".join(
        f"- {{id: S{number}, camera: {listed[1]}, photos: [{photo}]}}\n"
        for number, photo in enumerate(listed[2].split(", "))
    )
    alone = project.replace(listed[0], single) + f"{table}approximate\n"
    texts = (project + observed, alone)
    return [strips, positions, *({**files, **given, "project.yaml": text.encode()} for text in texts)]


def _files_of(path: Path) -> dict[str, bytes]:
    return {each.name: each.read_bytes() for each in path.parent.iterdir() if each.name != "truth.json"}


def damaged(projects: list[dict[str, bytes]], random: Random) -> Case:
    """Choose a project and do one to four things to its files."""
    case = Case(dict(random.choice(projects)))
    for _ in range(random.choice([1, 1, 2, 4])):
        name = random.choice(sorted(case.files))
        harm = random.choice(HARMS)
        case.files[name] = harm(case.files[name], random)
        case.done.append(f"{harm.__name__} {name}")
    if random.random() < 0.2:
        case.options += ["--set", random.choice(OVERRIDES.split())]
    return case


def text_put_in(data: bytes, random: Random) -> bytes:
    """Replace some characters by a text that means something to someone."""
    place = random.randrange(len(data) + 1)
    return data[:place] + random.choice(TEXTS).encode(errors="replace") + data[place + random.choice([0, 0, 1, 5]) :]


def value_replaced(data: bytes, random: Random) -> bytes:
    """Replace what stands between two separators."""
    found = list(re.finditer(rb"[^\s,\[\]{}:]+", data))
    if not found:
        return data
    match = random.choice(found)
    return data[: match.start()] + random.choice(TEXTS).encode(errors="replace") + data[match.end() :]


def bytes_put_in(data: bytes, random: Random) -> bytes:
    """Put bytes of any kind somewhere."""
    place = random.randrange(len(data) + 1)
    return data[:place] + random.randbytes(random.choice([1, 3, 50])) + data[place:]


def cut_off(data: bytes, random: Random) -> bytes:
    """End the file too early."""
    return data[: random.randrange(len(data) + 1)]


def lines_changed(data: bytes, random: Random) -> bytes:
    """Take out a line, repeat it, once or very often, or exchange it with another."""
    lines = data.splitlines(keepends=True)
    if lines:
        one, two = random.randrange(len(lines)), random.randrange(len(lines))
        match random.choice(["out", "again", "exchanged"]):
            case "out":
                del lines[one]
            case "again":
                lines[one:one] = [lines[one]] * random.choice([1, 2, 1000])
            case _:
                lines[one], lines[two] = lines[two], lines[one]
    return b"".join(lines)


def columns_changed(data: bytes, random: Random) -> bytes:
    """Harm a column of a table: exchanged, scaled, dealt out anew; or bring its points onto one line."""
    lines = [line.split(b",") for line in data.splitlines()]
    width = min(map(len, lines), default=0)
    if width < 4:
        return data
    one, two = random.randrange(width), random.randrange(width)
    match random.choice(["exchanged", "scaled", "dealt", "on one line"]):
        case "exchanged":  # its header or not
            for line in lines[random.choice([0, 1]) :]:
                line[one], line[two] = line[two], line[one]
        case "scaled":  # kilometres, millimetres, nothing at all, an overflow
            factor = random.choice([0.0, 1e-3, 1e3, 1e-9, 1e9, -1.0, 1e150])
            for line in lines:
                with contextlib.suppress(ValueError):
                    line[one] = f"{float(line[one]) * factor:.6g}".encode()
        case "dealt":  # ids permuted, or points numbered anew
            values = random.sample([line[one] for line in lines[1:]], len(lines) - 1)
            for line, value in zip(lines[1:], values, strict=True):
                line[one] = value
        case _:  # or to one place, with noise
            noise, step = random.choice([0.0, 0.1, 20.0, 200.0]), random.choice([0.0, 1.0, 500.0])
            for number, line in enumerate(lines[1:]):
                line[1:4] = [f"{number * step * k + random.gauss(0.0, noise):.3f}".encode() for k in (1.0, 0.3, 0.1)]
    return b"\n".join(map(b",".join, lines)) + b"\n"


def written_otherwise(data: bytes, random: Random) -> bytes:
    """Save the file as another program does."""
    ways: list[Callable[[bytes], bytes]] = [
        lambda each: b"\xef\xbb\xbf" + each,
        lambda each: each.replace(b"\n", b"\r\n"),
        lambda each: each.replace(b"\n", b"\r"),
        lambda each: each.replace(b",", b";").replace(b".", b","),
        lambda each: each.replace(b",", b"\t"),
        lambda each: each.decode(errors="replace").encode("utf-16"),
        lambda each: re.sub(rb"([^,\n]+)", rb'"\1"', each),
        lambda each: each.replace(b",", b" , "),
        lambda each: each + b"\n\n,,,\n",
    ]
    return random.choice(ways)(data)


def number_moved(data: bytes, random: Random) -> bytes:
    """Change a number as a slip does: a sign, a decimal point, two digits."""
    found = list(re.finditer(rb"-?\d+\.\d+", data))
    if not found:
        return data
    match = random.choice(found)
    word = match[0]
    ways = [b"-" + word.lstrip(b"-"), word.lstrip(b"-"), word.replace(b".", b""), word[::-1], word + b"e5", b"0"]
    return data[: match.start()] + random.choice(ways) + data[match.end() :]


def made_noise(data: bytes, random: Random) -> bytes:
    """Put noise in place of some numbers, or all of them, of a table, or add it."""
    share, size = random.choice([0.02, 0.3, 1.0]), 10.0 ** random.randint(-2, 6)
    keep = random.choice([0.0, 1.0])

    def noisy(match: re.Match[bytes]) -> bytes:
        if random.random() > share:
            return match[0]
        return f"{keep * float(match[0]) + random.uniform(-size, size):.4f}".encode()

    return re.sub(rb"-?\d+\.\d+", noisy, data)


def keys_permuted(data: bytes, random: Random) -> bytes:
    """Exchange the words before two colons."""
    found = list(re.finditer(rb"[\w]+(?=:)", data))
    if len(found) < 2:
        return data
    one, two = sorted(random.sample(found, 2), key=lambda each: each.start())
    return data[: one.start()] + two[0] + data[one.end() : two.start()] + one[0] + data[two.end() :]


HARMS = [
    text_put_in, text_put_in, value_replaced, value_replaced, bytes_put_in, cut_off, *[lines_changed] * 3,
    *[columns_changed] * 4, written_otherwise, number_moved, number_moved, made_noise, made_noise, keys_permuted,
]  # fmt: skip


def tried(case: Case, folder: Path, command: str) -> Outcome:
    """Run a command on a case in an empty folder and find what must not be.

    Must be: an exit code of the contract, no traceback, inputs as they were, all files of a result or none.
    """
    for name, data in case.files.items():
        (folder / name).write_bytes(data)
    result = folder / "result"
    arguments = [command, str(folder / "project.yaml"), *case.options]
    arguments += ["-o", str(result), "--quiet"] if command == "run" else ["--format", "json"]
    out, err = io.StringIO(), io.StringIO()
    begin = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments)
    seconds = time.process_time() - begin
    wrong = [*_words(command, code, out.getvalue(), err.getvalue()), *_files(case, folder, result, code)]
    if seconds > LONGEST:
        wrong.append(f"took {seconds:.1f} s")
    return Outcome(code, seconds, tuple(wrong))


def _words(command: str, code: int, out: str, err: str) -> list[str]:
    """Find what is wrong with the exit code and with what was said."""
    found = [] if code in CODES else [f"exit code {code}: {err[-300:]}"]
    if "Traceback" in out + err or "internal error" in err:
        found.append("a traceback")
    if command == "check" and code in CODES:
        faults = [each for each in json.loads(out)["projects"][0]["findings"] if each["severity"] == "error"]
        if bool(faults) != (code == 2):
            found.append(f"{len(faults)} faults and exit code {code}")
        found += [f"a fault without words: {each}" for each in faults if not (each["message"] and each["code"])]
    elif code in {2, 3} and not err.startswith("error: "):
        found.append("a failure without words")
    return found


def _files(case: Case, folder: Path, result: Path, code: int) -> list[str]:
    """Find inputs that were changed and results that are half written."""
    found = [f"{name} was changed" for name, data in case.files.items() if (folder / name).read_bytes() != data]
    strangers = {path.name for path in folder.iterdir()} - set(case.files) - {"result"}
    found += [f"{name} was left behind" for name in sorted(strangers)]
    known = BESIDE_TABLES | {f"{name}.csv" for name in TABLES}
    written = sorted(path.name for path in result.iterdir()) if result.exists() else []
    if any(name.endswith(".tmp") for name in written) or (written and code not in {0, 1}):
        found.append(f"exit code {code} and half a result: {written}")
    if written and ("result.json" not in written or not known.issuperset(written)):
        found.append(f"not the files of a result: {written}")
    if written:
        json.loads((result / "result.json").read_text(encoding="utf-8"))
    return found
