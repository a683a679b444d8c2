"""What the sources print: worked numbers computed again, misprints, and for every equation a command that shows it.

A row of ``equations.csv`` is a place in a source with a command, the quantity that it prints, and its number: from an
example of the source, or computed apart from this program. What the commands read stands in ``inputs/``. Conclusions
and recommendations of the sources are rows, too, and say whether they hold.
"""

from __future__ import annotations

import csv
import io
import json
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from decimal import Decimal
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from photostrip.errors import Fault, InputError
from photostrip.notes import Document
from photostrip.planning.camera_efficiency import PRINTED_TABLE, compare, source_cameras
from photostrip.planning.model_plan import source_example
from photostrip.report.page.parts import Words
from photostrip.report.page.tables import Cell, Field, fields
from photostrip.sheets.sheet import Rows, Sheet
from photostrip.terrestrial.accuracy import EXAMPLES, worked

# [004a]: errors that were put in, found by the residual parallax, found by Grubbs' test, missed; good points rejected
# and good points altogether
PATH = re.compile(r"([^\[.]+)(?:\[(.*)\])?\.(.+)")  # of a quantity
CONDITION = re.compile(r"[^,=]+=[^=]+?(?=,[^,=]+=|$)")
COUNTS = {"errors": 44, "parallax": 21, "Grubbs": 20, "missed": 3, "rejected": 8, "good": 500}


class Worked(NamedTuple):
    """A number that a source works out."""

    source: str
    what: str
    printed: float
    formula: float  # by the formula of the source, not rounded
    correct: float  # by what the formula should be
    unit: str = ""
    remark: str = ""


class Place(NamedTuple):
    """A place in a source, and the command that shows what stands there."""

    place: str
    what: str
    command: str  # several: with && between
    function: str  # below ``photostrip``
    quantity: str  # a key of what the command prints as JSON, ``table[column=value,...].column``
    value: str  # its number, with the digits that are sure
    says: str  # of a conclusion or a recommendation: whether it holds, and why


class Shown(NamedTuple):
    """What the command of a place printed."""

    place: Place
    found: float

    @property
    def agrees(self) -> bool:
        """Whether the number is that of the row, to its last digit."""
        known = Decimal(self.place.value)
        last = known.as_tuple().exponent
        return abs(self.found - float(known)) <= 0.51 * 10.0 ** int(last)


def places() -> list[Place]:
    return [Place(**row) for row in read("equations")]


def found_places(asked: str) -> list[Place]:
    """Return the places that hold all words of what was asked, as ``001 eq. 140``; raise InputError where none does."""
    words = _words(asked)
    chosen = [each for each in places() if words <= _words(f"{each.place} {each.what}")]
    if not words or not chosen:
        tags = ", ".join(dict.fromkeys(each.place.partition("]")[0].lstrip("[") for each in places()))
        message = f"no source has the place `{asked}`"
        raise InputError(Fault(message, "no-place", expected=f"as `001 eq. 138`, of the sources {tags}"))
    return chosen


def _words(text: str) -> set[str]:
    """Return the words of a place in lower case, with every number of a range."""
    words = set(re.findall(r"\w+(?:\.\d+)?", text.lower()))
    for first, last in re.findall(r"(\d+)–(\d+)", text):
        words |= {str(number) for number in range(int(first), int(last) + 1)}
    return words


def quantity_of(document: Document, quantity: str) -> float:
    """Look a quantity up in what a command printed as JSON."""
    table, conditions, column = PATH.fullmatch(quantity).groups()  # type: ignore[union-attr] # a test holds the rows to it
    if conditions is None:
        return float(document[table][column])
    wanted = dict(each.split("=", 1) for each in CONDITION.findall(conditions))
    rows = [row for row in document[table] if all(_same(row[key], value) for key, value in wanted.items())]
    return float(rows[0][column])


def _same(cell: object, wanted: str) -> bool:
    return float(wanted) == cell if isinstance(cell, int | float) else str(cell) == wanted


def write_inputs(folder: Path) -> None:
    """Write into a folder what the commands read."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in resources.files("photostrip.sheets").joinpath("inputs").iterdir():
        if file.name.endswith((".csv", ".yaml")):
            (folder / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")


def shown_places(chosen: Sequence[Place], run: Callable[[Sequence[str], Path], str]) -> list[Shown]:
    """Run the commands of places in a folder with what they read, and look up what each prints.

    run: runs the words of a command after ``photostrip`` in a folder and returns what is printed.
    """
    documents: dict[str, Document] = {}
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_inputs(folder)
        for command in dict.fromkeys(each.command for each in chosen):
            documents[command] = document_of(command, folder, run)
    return [Shown(each, quantity_of(documents[each.command], each.quantity)) for each in chosen]


def document_of(command: str, folder: Path, run: Callable[[Sequence[str], Path], str]) -> Document:
    """Return as JSON what the last of commands with && between prints, or the trace that it writes."""
    *before, last = (shlex.split(each)[1:] for each in command.split("&&"))
    for each in before:
        run(each, folder)
    trace = next((each for each in last if each.endswith(".txt")), None)
    if trace is None:
        text = run([*last, "--format", "json"], folder)
    else:
        run([each.replace(".txt", ".json") for each in last], folder)
        text = (folder / trace).with_suffix(".json").read_text(encoding="utf-8")
    document: Document = json.loads(text)
    return document


def places_sheet(shown: Sequence[Shown]) -> Sheet:
    """Return places, what their commands print, and what these read."""
    rows = Rows(
        "places",
        "",
        (
            Field("place"),
            Field("what"),
            *(Field(name, shown=False) for name in ("command", "function", "quantity")),
            Field("found", "ratio g10"),
            Field("expected", head="known"),
            Field("agrees", head=""),
            Field("says", shown=False),
        ),
        [
            (
                *each.place[:5],
                each.found,
                each.place.value,
                Cell("" if each.agrees else "differs", each.agrees),
                each.place.says,
            )
            for each in shown
        ],
    )
    of_commands: dict[str, list[Shown]] = {}
    for each in shown:
        of_commands.setdefault(each.place.command, []).append(each)
    ways = [
        Rows(
            "",
            "",
            (),
            (),
            above=[
                Words(command),
                Words("; ".join(f"{each.place.quantity} by photostrip.{each.place.function}" for each in same), "note"),
                *(Words(f"{each.place.what}: {each.place.says}") for each in same if each.place.says),
            ],
        )
        for command, same in of_commands.items()
    ]
    return Sheet("sources", "What the sources print, done", (), (rows, *ways, *_inputs(of_commands)))


def _inputs(commands: Iterable[str]) -> Iterator[Rows]:
    """Give the tables that commands read."""
    folder = resources.files("photostrip.sheets").joinpath("inputs")
    for name in dict.fromkeys(re.findall(r"[\w-]+\.csv", " ".join(commands))):
        head, *rows = csv.reader(io.StringIO(folder.joinpath(name).read_text(encoding="utf-8")))
        yield Rows("", name, tuple(Field("", head=each, below="") for each in head), rows)


def sources_sheet() -> Sheet:
    """Return worked numbers, misprints and equations."""
    number = fields("printed formula correct", "ratio g4")
    numbers = Rows(
        "worked",
        "Worked numbers, computed again",
        (Field("source"), Field("what", head="number"), *number, Field("unit", head=""), Field("remark")),
        worked_numbers(),
        note="formula: that of the source, not rounded; correct: without its misprints and assumptions",
    )
    misprints = read("misprints")
    names = tuple(Field(name, shown=False) for name in misprints[0])
    listed = [
        Rows(
            "misprints",
            f"Misprints of {tag}",
            names,
            [tuple(row.values()) for row in misprints if row["source"] == tag],
            below=[Words(_misprint(row), mark="-") for row in misprints if row["source"] == tag],
        )
        for tag in sorted({row["source"] for row in misprints})
    ]
    listed_places = places()
    conclusions = Rows(
        "conclusions",
        "Conclusions and recommendations",
        tuple(Field(name, shown=False) for name in ("place", "what", "says", "command")),
        [(each.place, each.what, each.says, each.command) for each in listed_places if each.says],
        below=[Words(f"{each.place}: {each.what}. {each.says}", mark="-") for each in listed_places if each.says],
    )
    equations = Rows(
        "equations",
        "From an equation to a command and a function",
        (
            Field("place"),
            Field("what", rank=1),
            Field("value", head="number"),
            Field("command", rank=2),
            Field("function"),
        ),
        [(each.place, each.what, each.value, each.command, each.function) for each in listed_places],
        note="`photostrip sources '001 eq. 138'` runs the command of a place; it stands here on a page wide enough",
    )
    return Sheet("sources", "What the sources print", (), (numbers, *listed, conclusions, equations))


def read(name: str) -> list[dict[str, str]]:
    """Read ``equations`` or ``misprints``."""
    text = resources.files("photostrip.sheets").joinpath(f"{name}.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text)))


def _misprint(row: dict[str, str]) -> str:
    shows = f" ({row['shows']})" if row["shows"] else ""
    return f"{row['place']}: {row['printed']}. Correct: {row['correct']}{shows}."


def worked_numbers() -> list[Worked]:
    """Compute every worked number of every source again; [000], [001] and [004c] have none."""
    return [*_directions(), *_model(), *_screening(), *_cameras()]


def _model() -> Iterator[Worked]:
    """Give the accuracy of a model, [003]; correct is the worse of the left and the right end of the base."""
    for row in source_example():
        wrong = abs(row.printed - row.formula) > 1 / 2
        remark = "its own constant gives 21" if wrong else "six points do better"
        ends = f"{row.left:.1f}, right {row.right:.1f}"
        remark += f": left {ends}; constant not rounded {row.assumed:.1f}"
        what = f"{row.quantity}, {row.place} points"
        yield Worked("[003]", what, row.printed, row.formula, max(row.left, row.right), "µm", remark)


def _directions() -> Iterator[Worked]:
    """Give the required accuracy of directions, [002]."""
    for example in EXAMPLES:
        found, camera = worked(example), example.camera
        far = abs(example.factor - found.factor) > 1 / 100
        level = found.horizontal
        yield Worked("[002]", f"m_lambda, {camera}", example.horizontal, level, level, "″", "rounded to 0.5")
        remark = f"with {example.factor:g} of the other {found.printed_factor:.2f}" if far else "sec for cos in eq. 3"
        remark += f"; by eq. 4 {found.eq4:.2f}, by eq. 5 {found.eq5:.2f}"
        yield Worked("[002]", f"m_beta, {camera}", example.vertical, found.eq6, found.vertical, "″", remark)
        remark = "belongs to the other camera" if far else ""
        yield Worked("[002]", f"1 + x²/f², {camera}", example.factor, found.factor, found.factor, "", remark)


def _cameras() -> Iterator[Worked]:
    """Give the table of cameras, [004b]."""
    cameras = source_cameras()
    for camera, row in zip(cameras, PRINTED_TABLE, strict=True):
        beside, coefficient, ratio = compare(camera, cameras[-1]), camera.coefficient, camera.height_ratio
        near = abs(row.height_ratio / ratio - 1) < 1 / 50
        yield Worked("[004b]", f"K, {camera.name}", row.coefficient, coefficient, coefficient, "mm²")
        remark = "" if near else "needs a base of 55 mm"
        yield Worked("[004b]", f"H/m_h, {camera.name}", row.height_ratio, ratio, ratio, "", remark)
        remark = "" if camera is cameras[-1] else f"a ratio of lengths; m_h at equal area {beside.height_error:.3f}"
        yield Worked("[004b]", f"eta_S, {camera.name}", row.area, beside.printed_area, beside.area, "", remark)


def _screening() -> Iterator[Worked]:
    """Give the percentages of the experiment, [004a]."""
    errors = COUNTS["errors"]
    for what, printed in (("parallax", 48.0), ("Grubbs", 45.0), ("missed", 7.0)):
        share = 100 * COUNTS[what] / errors
        yield Worked("[004a]", f"errors, {what}", printed, share, share, "%")
    of_errors, of_good = (100 * COUNTS["rejected"] / COUNTS[of] for of in ("errors", "good"))
    yield Worked("[004a]", "good points rejected", 18.0, of_errors, of_good, "%", "relative to the errors")
