"""Reading a CSV table with a header, known to be text, with the place of every cell; JSON of other programs.

Whole columns are converted at once. Only where that fails is a column read cell by cell, to say which cell it was;
so a clean table costs next to nothing and a wrong one is explained.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BytesIO, TextIOWrapper
from itertools import count, islice
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.formats.faults import (
    DECIMAL_COMMA,
    LARGEST_NUMBER,
    SMALLEST_LENGTH,
    Findings,
    NotANumber,
    number,
    shown,
    suggestion,
)
from photostrip.formats.files import BOM, BYTE_ORDER_MARK, GZIP, MEGABYTE, decode, read_bytes, refuse
from photostrip.notes import Note, counted, listed
from photostrip.points import locate

LARGEST_TABLE = 200 * MEGABYTE  # unpacked; a million points are 50 MB
MOST_LINES = 5_000_000  # of a table; a row takes 0.2 to 0.4 kB once it is read, however few bytes it has
LONGEST_LINE = 20_000  # bytes; each of its fields takes 60 bytes and more
BLOCK_BYTES = 4 * MEGABYTE
LINE_END = re.compile(rb"\r\n|\r|\n")


@dataclass(frozen=True)
class Form:
    """How a table is written, as far as a project says it."""

    separator: str = ","  # between the fields; a blank: any number of blanks and tabs
    decimal: str = "."
    skipped: int = 0  # lines above the table that are passed over
    # names that the user has for columns: those of the header or, where there is none, numbers of fields from 1 on
    columns: Mapping[str, str] = field(default_factory=dict)
    declared: bool = True  # whether a project can say so

    @property
    def numbered(self) -> bool:
        """Whether the columns go by number, so that the table has no header."""
        return any(name.strip().isdecimal() for name in self.columns.values())


UNDECLARED = Form(declared=False)


@dataclass(eq=False)
class TableText:
    """The text of a table and where its columns stand: what positions are made from."""

    file: str
    data: bytes  # UTF-8; as a text, one long id in another script would make it four times as large
    form: Form = UNDECLARED
    where: dict[str, int] = field(default_factory=dict)  # number of the field in a row, by column
    header: dict[str, str] = field(default_factory=dict)

    def stream(self, start: int = 0) -> TextIOWrapper:
        """Return the lines of the table from a byte on; ends of lines of all systems count."""
        return TextIOWrapper(BytesIO(self.data[start:] if start else self.data), encoding="utf-8", newline="")

    def start_of(self, line: int) -> int:
        """Return the byte at which a line begins, counted from 1."""
        before = [end.end() for end in islice(LINE_END.finditer(self.data), line - 1)]
        return 0 if line == 1 else before[-1] if len(before) == line - 1 else len(self.data)

    @cached_property
    def _lines(self) -> list[str]:
        return self.stream().readlines()

    def placed_as(self, column: str, where: str) -> TableText:
        """Return the text with a column placed where another one stands."""
        places, header = dict(self.where), dict(self.header)
        if where in places:
            places[column], header[column] = places[where], header[where]
        return TableText(file=self.file, data=self.data, form=self.form, where=places, header=header)

    def fault(self, line: int, column: str, message: str, code: str, *, expected: str = "", fix: str = "") -> Fault:
        """Make a fault at the character where a cell begins; without a column at the line."""
        position = self._position(line, self.where[column]) if column in self.where else 0
        name = self.header.get(column, column)
        return Fault(
            message=message, code=code, file=self.file, line=line, column=position, key=name, expected=expected, fix=fix
        )

    def _position(self, line: int, wanted: int) -> int:
        """Character, counted from 1, at which a field of a line begins; 0 when the line has not so many."""
        text, separator = self._lines[line - 1], self.form.separator
        start, quoted, number_of_field = 0, False, 0
        for position, character in enumerate(text):
            if number_of_field == wanted:
                break
            if character == '"':
                quoted = not quoted
            elif character == separator and not quoted:
                # one more blank ends no field
                number_of_field += separator != " " or position > start
                start = position + 1
        if number_of_field != wanted:
            return 0
        blanks = len(text[start:]) - len(text[start:].lstrip(" " if separator == "\t" else " \t"))
        return start + blanks + 1


def content(file: str) -> tuple[bytes, bool]:
    """Read and unpack a file, refuse it when it is no text, and take a byte order mark off."""
    data = unpacked(file)
    _countable(file, data)
    _, marked = decode(file, data)
    return data[len(BOM) :] if marked else data, marked


def unpacked(file: str) -> bytes:
    """Read a file, and unpack it where its name ends in .gz; refuse one whose name says another thing."""
    data = read_bytes(file, LARGEST_TABLE)
    packed = file.casefold().endswith(".gz")
    if packed != data.startswith(GZIP):
        what = "is compressed (gzip), but its name does not say so" if not packed else "is not compressed (gzip)"
        name = Path(file).name
        refuse(file, "gzip", what, fix=f"name it {name}.gz" if not packed else f"name it {name[:-3]}")
    return _unpack(file, data) if packed else data


def _unpack(file: str, data: bytes) -> bytes:
    import gzip  # few tables are packed
    import zlib

    try:
        with gzip.GzipFile(fileobj=BytesIO(data)) as stream:
            unpacked = b""
            while len(unpacked) <= LARGEST_TABLE and (part := stream.read(BLOCK_BYTES)):
                unpacked += part
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        how = "ends too early" if isinstance(error, EOFError) else "is damaged"
        refuse(file, "gzip", f"the compressed file {how}", fix="copy or pack it again")
    if len(unpacked) > LARGEST_TABLE:
        refuse(file, "file-size", f"unpacks to more than {LARGEST_TABLE // MEGABYTE} MB", expected="a table")
    if not unpacked:
        refuse(file, "file-empty", "is empty")
    return unpacked


def _countable(file: str, data: bytes) -> None:
    """Refuse rows and lines that would fill the memory once they are numbers and texts."""
    lines = max(data.count(b"\n"), data.count(b"\r"))
    if lines > MOST_LINES:
        expected = f"at most {MOST_LINES}, whose rows take 1 to 2 GB of memory"
        fix = "is it the right file? keep the points that join the photos best, or cut the project into strips"
        refuse(file, "file-size", f"has {lines} lines", expected=expected, fix=fix)
    start = 0
    while len(data) - start > LONGEST_LINE:
        end = max(data.rfind(sign, start, start + LONGEST_LINE) for sign in (b"\n", b"\r"))
        if end < 0:
            line = data.count(b"\n", 0, start) + 1
            message = f"has a line of more than {LONGEST_LINE // 1000} kB, line {line}"
            refuse(file, "file-size", message, expected="a table with commas between a few fields, each row on a line")
        start = end + 1


Cells = Sequence[str]
CHUNK = 16_384  # rows turned into columns at a time, so that a big table never stands in memory cell by cell
STANDARD_DEVIATIONS = {"s", "sd", "std", "sigma", "stdev", "accuracy", "precision"}  # one column for all coordinates
WORDS = {",": "comma", ";": "semicolon", "\t": "tab", " ": "blank"}  # that a project has for separators
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "vertical bars", " ": "blanks"}


def read_table(
    file: str,
    layout: Sequence[Column],
    findings: Findings,
    *,
    others: Sequence[Sequence[Column]] = (),
    form: Form = UNDECLARED,
    rewritten: Callable[[bytes], bytes] | None = None,
) -> Table | None:
    """Read a table; None when not even the header can be read.

    others: other layouts of the same kind of table; that of which the header has most is taken, the first when in
        doubt.
    form: how the table is written.
    rewritten: makes a table, line for line, of the text of another layout; gives a table as it is.
    """
    findings.meet(file)
    try:
        data, marked = content(file)
    except InputError as error:
        findings.add(*error.faults)
        return None
    if marked:
        findings.notes.append(Note("byte-order-mark", BYTE_ORDER_MARK, "note", file=file, line=1))
    data = data if rewritten is None else rewritten(data)
    if form.separator == " ":
        data = data.replace(b"\t", b" ")
    layouts = [_renamed(each, form.columns) for each in (layout, *others)]
    return _Reader(TableText(file, data, form), layouts, findings).read()


def _renamed(layout: Sequence[Column], columns: Mapping[str, str]) -> tuple[Column, ...]:
    """Return a layout the names that the user has for its columns; nothing else is read for those."""
    return tuple(
        replace(column, header=columns[column.name].strip().casefold(), required=True)
        if column.name in columns
        else column
        for column in layout
    )


def _add_new(names: Iterable[str], index: dict[str, int]) -> None:
    """Give numbers to the names that have none yet, in order of first appearance."""
    new = [name for name in dict.fromkeys(names) if name not in index]
    index.update(zip(new, count(len(index)), strict=False))


def floats(cells: Cells, decimal: str = ".") -> Floats | None:
    """Return the numbers that stand in a column; None when a cell needs a closer look."""
    joined = "".join(cells)
    if decimal != ".":
        if "." in joined:
            return None
        cells = [cell.replace(decimal, ".") for cell in cells]
    if not joined.isascii() or "_" in joined:  # float() takes digits of every script, and 1_000
        return None
    try:
        values = np.fromiter(map(float, cells), float, len(cells))
    except ValueError:
        return None
    return values if (np.abs(values) <= LARGEST_NUMBER).all() else None


class _Reader:
    """One pass over one table."""

    def __init__(self, source: TableText, layouts: Sequence[Sequence[Column]], findings: Findings) -> None:
        self.source, self.layouts, self.findings = source, layouts, findings
        self.layout, self.form = layouts[0], source.form
        self.above = self.form.skipped  # lines that are no rows
        self.width = 0
        self.columns: list[Column] = []
        self.lines: list[Numbers] = []
        self.numbers: dict[str, list[Floats]] = {}
        self.codes: dict[str, list[Numbers]] = {}
        self.index: dict[str, dict[str, int]] = {}

    def read(self) -> Table | None:
        if not self._header():
            return None
        for columns, lines in self._chunks():
            self._take(columns, lines)
        places = np.concatenate([np.zeros(0, np.intp), *self.lines])
        if not len(places) and not self.findings.number(self.source.file):
            self.findings.add(Fault("has a header but no rows", code="no-rows", file=self.source.file, line=1))
        numbers = {name: np.concatenate([np.zeros(0), *parts]) for name, parts in self.numbers.items()}
        codes, ids = {}, {}
        for column in self.columns:
            if not column.number:
                parts = [np.zeros(0, np.intp), *self.codes[column.name]]
                codes[column.name], ids[column.name] = self._clean(column, np.concatenate(parts), places)
        return Table(file=self.source.file, lines=places, numbers=numbers, codes=codes, ids=ids, texts=(self.source,))

    def _add(self, line: int, column: str, message: str, code: str, *, expected: str = "", fix: str = "") -> None:
        if self.findings.full(self.source.file):
            self.findings.count(self.source.file, 1)
        else:
            self.findings.add(self.source.fault(line, column, message, code, expected=expected, fix=fix))

    def _header(self) -> bool:
        """Read the header; False when the table cannot be read without it."""
        rows = self._reader(self.source.start_of(self.above + 1))
        try:
            cells: list[str] = next((row for row in rows if any(map(str.strip, row))), [])
        except csv.Error as error:
            self._unreadable(error, self.above + 1)
            return False
        line = self.above + rows.line_num
        names = [cell.strip() for cell in cells]
        while names and not names[-1] and not (self.form.numbered and self.form.separator != " "):
            names.pop()
        self.width = len(names)
        before = self.findings.number(self.source.file)
        if self.form.numbered:
            names = [str(number) for number in range(1, self.width + 1)]
        else:
            self.above = line
        self.layout = self._fitting({name.casefold() for name in names})
        if self._looks_like_a_header(names, line):
            self._assign(names, line)
        return self.findings.number(self.source.file) == before

    def _reader(self, start: int) -> Any:  # noqa: ANN401 (a reader of csv, whose type has no name)
        stream = self.source.stream(start)
        return csv.reader(stream, delimiter=self.form.separator, strict=True, skipinitialspace=True)

    def _fitting(self, names: set[str]) -> Sequence[Column]:
        """Layout that misses the fewest of its columns, of those the one that has most; the first when in doubt."""

        def unlike(layout: Sequence[Column]) -> tuple[int, int]:
            found = [bool(names & set(column.accepted)) for column in layout if column.required]
            return len(found) - sum(found), -sum(found)

        return min(self.layouts, key=unlike)

    def _looks_like_a_header(self, names: list[str], line: int) -> bool:
        """Refuse a first line that is not a header, and say what it is instead."""
        wanted = self._wanted()
        if not names:
            self._add(1, "", "has no header and no rows", "no-header", expected=f"a header `{wanted}`")
            return False
        if self.form.numbered:
            return True
        known = {alias for column in self.layout for alias in column.accepted}
        other = next((mark for mark in SEPARATORS if mark in names[0]), "") if len(names) <= 2 else ""
        if other and (other != " " or len(known.intersection(names[0].casefold().split())) > 1):
            message = f"fields are separated by {SEPARATORS[other]}"
            fix = "save as CSV with commas between the fields and points in the numbers"
            if self.form.declared and other in WORDS:
                fix = f"write `separator: {WORDS[other]}` for this table in the project file"
            self._add(line, "", message, "separator", expected=SEPARATORS[self.form.separator], fix=fix)
            return False
        if not {name.casefold() for name in names} & known:
            message = f"the first line `{shown(','.join(names))}` is not a header"
            self._add(line, "", message, "no-header", expected=f"column names such as `{wanted}`")
            return False
        return True

    def _wanted(self) -> str:
        return self.form.separator.join(column.name for column in self.layout if column.required)

    def _assign(self, names: list[str], line: int) -> None:
        """Find the columns of the format among the names of the header."""
        unused = dict(enumerate(names))
        for column in self.layout:
            places = [place for place, name in unused.items() if name.casefold() in column.accepted]
            if places:
                self.columns.append(column)
                self.source.where[column.name] = places[0]
                self.source.header[column.name] = column.name if self.form.numbered else names[places[0]]
            for place in places:
                del unused[place]
            for place in places[1:]:
                message = (
                    f"column `{names[place]}` appears twice in the header (fields {places[0] + 1} and {place + 1})"
                )
                self._add(line, column.name, message, "duplicate-column", fix="remove or rename one")
        self._missing(unused, line)
        self._extra(unused, line)
        for column in self.columns:
            if column.number:
                self.numbers[column.name] = []
            else:
                self.codes[column.name], self.index[column.name] = [], {}

    def _missing(self, unused: dict[int, str], line: int) -> None:
        for column in self.layout:
            if column.required and column not in self.columns:
                if self.form.numbered:
                    self._not_numbered(column, line)
                    continue
                expected = self._wanted()
                message = f"there is no column `{column.header or column.name}`"
                near = suggestion(column.name, unused.values()) if len(column.name) > 1 else ""
                fix = near or f"found: {', '.join(shown(name) or '(no name)' for name in self._names(unused))}"
                self._add(line, column.name, message, "missing-column", expected=f"a header `{expected}`", fix=fix)

    def _not_numbered(self, column: Column, line: int) -> None:
        number = column.header
        message = f"`columns` gives no number for `{column.name}`"
        fix = f"add `{column.name}`, the number of its field, from 1 on"
        if number:
            message = f"there is no field {number} for `{column.name}` that is not another column's"
            fix = f"the first row has {counted(self.width, 'field')}; is `separator` right?"
        self._add(line, "", message, "missing-column", fix=fix)

    def _names(self, unused: dict[int, str]) -> list[str]:
        found = {self.source.where[column.name]: self.source.header[column.name] for column in self.columns}
        return [name for _, name in sorted((found | unused).items())]

    def _extra(self, unused: dict[int, str], line: int) -> None:
        """Refuse columns that look like a slip of the pen, and name the others that are not used."""
        free = [column.name for column in self.layout if column not in self.columns and not column.required]
        others = []
        for place, name in unused.items():
            near = suggestion(name, [each for each in free if len(each) > 2])
            loose = re.sub(r"[\W_]", "", name.casefold())
            twin = next((each for each in free if each == loose), "")
            if near or twin or loose in STANDARD_DEVIATIONS:
                self.source.where[name] = place
                fix = near or (f"did you mean `{twin}`?" if twin else f"use the columns {', '.join(free)}")
                self._add(line, name, f"column `{shown(name)}` is not known", "unknown-column", fix=fix)
            else:
                others.append(shown(name) or "(no name)")
        if others:
            used = ", ".join(column.name for column in self.columns)
            message = f"{counted(len(others), 'column')} not used: {listed(others)}; used: {used}"
            self.findings.notes.append(Note("unused-column", message, "note", file=self.source.file, line=line))

    def _chunks(self) -> Iterator[tuple[list[Cells], Numbers]]:
        """Give columns of texts with the numbers of their lines, some thousands of rows at a time."""
        for read, numbers in self._rows(self.source.start_of(self.above + 1), self.above):
            even, lines = self._even(read, numbers)
            if even:
                yield list(zip(*even, strict=True)), np.array(lines, np.intp)

    def _rows(self, start: int, before: int) -> Iterator[tuple[list[list[str]], list[int]]]:
        """Give rows from a byte of the text on with their line numbers; `before` is that of the line before them."""
        reader = self._reader(start)
        last = before
        while True:
            rows, lines = [], []
            try:
                for row in islice(reader, CHUNK):
                    rows.append(row)
                    lines.append(last + 1)
                    last = before + reader.line_num
            except csv.Error as error:
                yield rows, lines
                self._unreadable(error, last + 1)
                return
            if not rows:
                return
            yield rows, lines

    def _unreadable(self, error: csv.Error, line: int) -> None:
        fix = ""
        if any(word in str(error) for word in ("unexpected end", "field limit")):
            message, fix = "a quotation mark is never closed", 'close it, or write `""` for one in a field'
        elif "expected after" in str(error):
            message, fix = "something appears between a closing quotation mark and the comma", "remove it"
        else:
            message = f"cannot be read as CSV ({error})"
        self._add(line, "", message, "csv", fix=fix)

    def _take(self, cells: list[Cells], lines: Numbers) -> None:
        """Turn a chunk of rows into columns."""
        for column in self.columns:
            name, texts = column.name, cells[self.source.where[column.name]]
            if column.number:
                fast = floats(texts, self.form.decimal)
                self.numbers[name].append(self._floats(column, texts, lines) if fast is None else fast)
                if column.positive:
                    self._positive(column, lines)
            else:
                index = self.index[name]
                _add_new(texts, index)
                self.codes[name].append(np.fromiter(map(index.__getitem__, texts), np.intp, len(texts)))
        self.lines.append(lines)

    def _even(self, rows: list[list[str]], lines: list[int]) -> tuple[list[list[str]], list[int]]:
        """Drop blank rows and refuse rows with too few or too many fields."""
        kept, places = [], []
        for row, line in zip(rows, lines, strict=True):
            extra = row[self.width :]
            if not any(map(str.strip, row)):
                continue
            if len(row) < self.width or any(map(str.strip, extra)):
                self._uneven(row, line)
                continue
            kept.append(row[: self.width])
            places.append(line)
        return kept, places

    def _uneven(self, row: list[str], line: int) -> None:
        head = "first row" if self.form.numbered else "header"
        fix, separator = "", self.form.separator
        fields = len(row) - (separator == " " and not row[-1])  # blanks at the end of a line end no field
        message = f"the row has {counted(fields, 'field')}, the {head} {self.width}"
        if len(row) == 1 and any(mark in row[0] for mark in SEPARATORS if mark != " "):
            fix = f"separate the fields by {SEPARATORS[separator]}"
        elif len(row) > self.width and separator == ",":
            fix = "write decimal points, not commas; put an id that has a comma between quotation marks"
        elif len(row) > self.width:
            fix = f"put an id that has a {WORDS[separator]} between quotation marks"
        self._add(line, "", message, "row-length", fix=fix)

    def _floats(self, column: Column, cells: Cells, lines: Numbers) -> Floats:
        """Convert cell by cell and refuse those that are no numbers."""
        values = np.full(len(cells), np.nan)
        for row, cell in enumerate(cells):
            if not cell.strip() and not column.filled:
                continue
            try:
                values[row] = number(cell, self.form.decimal)
            except NotANumber as why:
                fix = why.fix
                if DECIMAL_COMMA.fullmatch(cell.strip()) and self.form.declared:
                    fix += ", or `decimal: comma` for this table in the project file"
                elif self.form.numbered and row == 0 and lines[0] == self.above + 1:
                    fix = f"if line {lines[0]} is a header, write `skip: {lines[0]}`"
                self._add(int(lines[row]), column.name, why.message, "number", expected="a number", fix=fix)
        return values

    def _positive(self, column: Column, lines: Numbers) -> None:
        values = self.numbers[column.name][-1]
        for row in np.flatnonzero(values < SMALLEST_LENGTH):
            message = f"{values[row]:g} is out of range"
            self._add(int(lines[row]), column.name, message, "range", expected="a number larger than 0")

    def _clean(self, column: Column, codes: Numbers, lines: Numbers) -> tuple[Numbers, tuple[str, ...]]:
        """Take blanks off ids and refuse ids that cannot be."""
        written = list(self.index[column.name])
        stripped = list(map(str.strip, written))
        if column.words:
            stripped = self._words(column, stripped, codes, lines)
        elif stripped != written:
            self._note_blanks(column, written, codes, lines)
        if stripped != written:
            index: dict[str, int] = {}
            _add_new(stripped, index)
            codes = np.fromiter(map(index.__getitem__, stripped), np.intp, len(stripped))[codes]
            stripped = list(index)
        names = tuple(stripped)
        if not column.words and ("" in names or CONTROL_CHARACTER.search("".join(names))):  # first all of them together
            wrong = np.array([not name or bool(CONTROL_CHARACTER.search(name)) for name in names], bool)
            for row in np.flatnonzero(wrong[codes]):
                name = names[codes[row]]
                what = (
                    f"the id `{shown(name)}` has a control character in it" if name else f"the {column.name} has no id"
                )
                self._add(int(lines[row]), column.name, what, "id", expected="an id on one line")
        return codes, names

    def _words(self, column: Column, cells: list[str], codes: Numbers, lines: Numbers) -> list[str]:
        """Read words of a fixed list, whatever their case; an empty cell is the first of them."""
        words = [cell.casefold() or column.words[0] for cell in cells]
        wrong = np.array([word not in column.words for word in words], bool)
        for row in np.flatnonzero(wrong[codes]):
            word = cells[codes[row]]
            fix = "" if self.findings.full(self.source.file) else suggestion(word, column.words)
            expected = f"one of {', '.join(column.words)}"
            self._add(int(lines[row]), column.name, f"`{shown(word)}` is not known", "word", expected=expected, fix=fix)
        return words

    def _note_blanks(self, column: Column, written: list[str], codes: Numbers, lines: Numbers) -> None:
        padded = np.array([name != name.strip() for name in written])
        rows: list[int] = np.flatnonzero(padded[codes]).tolist()
        example = shown(written[int(codes[rows[0]])])
        message = f"blanks around the id of a {column.name} removed in {counted(len(rows), 'row')}, here `{example}`"
        name = self.source.header.get(column.name, column.name)
        note = Note("stray-blanks", message, "note", file=self.source.file, line=int(lines[rows[0]]), key=name)
        self.findings.notes.append(note)


CONTROL_CHARACTER = re.compile(r"[\x00-\x1f\x7f]")


@dataclass(frozen=True)
class Column:
    name: str
    number: bool = False  # whether its cells are numbers; otherwise they are ids
    required: bool = True
    filled: bool = True
    positive: bool = False
    words: tuple[str, ...] = ()  # the only values allowed, the first being that of an empty cell
    aliases: tuple[str, ...] = ()
    header: str = ""  # the only name for it in this table, in lower case; empty: its name and its aliases

    @property
    def accepted(self) -> tuple[str, ...]:
        """Names in the header that mean this column, in lower case."""
        return (self.header,) if self.header else (self.name, *self.aliases)


@dataclass(frozen=True, eq=False)
class Table:
    """What a CSV file holds, or several below each other."""

    file: str  # several: their names with commas between
    lines: Numbers  # (n,): line of each row in its file, counted from 1
    numbers: dict[str, Floats]  # (n,): columns of numbers; NaN where a cell is empty or wrong
    codes: dict[str, Numbers]  # (n,): columns of ids, as numbers that count in ``ids``
    ids: dict[str, tuple[str, ...]]  # the different ids of a column in order of first appearance
    texts: tuple[TableText, ...] = field(repr=False)
    _source: Numbers | None = field(default=None, repr=False)  # (n,): number of the file of each row; None: the first

    def __len__(self) -> int:
        return len(self.lines)

    def column(self, name: str) -> Floats:
        """Return a column of numbers; NaN in every row when the table has no such column."""
        return self.numbers[name] if name in self.numbers else np.full(len(self), np.nan)

    def columns(self, *names: str) -> Floats:
        """Return columns of numbers side by side, shape (n, number of names); not to be written into."""
        if self.numbers.keys().isdisjoint(names):
            return np.broadcast_to(np.nan, (len(self), len(names)))
        return np.column_stack([self.column(name) for name in names])

    def cells(self, name: str) -> list[str]:
        """Return a column of ids, or of words, row by row."""
        ids = self.ids[name]
        return [ids[code] for code in self.codes[name].tolist()]

    def without_numbers(self) -> Table:
        """Return the table without its numbers, where they are kept elsewhere."""
        return replace(self, numbers={})

    def take(self, rows: Numbers) -> Table:
        numbers = {name: each[rows] for name, each in self.numbers.items()}
        codes = {name: each[rows] for name, each in self.codes.items()}
        source = None if self._source is None else self._source[rows]
        return replace(self, lines=self.lines[rows], numbers=numbers, codes=codes, _source=source)

    def placed_as(self, column: str, where: str) -> Table:
        """Return the table with the faults of a column that it does not have placed at one that it has."""
        return replace(self, texts=tuple(each.placed_as(column, where) for each in self.texts))

    @property
    def files(self) -> tuple[tuple[str, Flags], ...]:
        """The files, each with its rows."""
        number = np.zeros(len(self), np.intp) if self._source is None else self._source
        return tuple((each.file, number == place) for place, each in enumerate(self.texts))

    def _text_of(self, row: int) -> TableText:
        return self.texts[0 if self._source is None else int(self._source[row])]

    def file_of(self, row: int) -> str:
        return self._text_of(row).file

    def lines_of(self, *rows: int) -> str:
        """Say in which lines rows stand, as ``lines 7, 9``, or ``line 7 of a.csv, line 9 of b.csv``."""
        if self._source is None:
            return f"line{'s' * (len(rows) > 1)} {', '.join(str(self.lines[row]) for row in rows)}"
        return ", ".join(f"line {self.lines[row]} of {self.file_of(row)}" for row in rows)

    def note(
        self, row: int, code: str, message: str, severity: str = "warning", *, key: str, points: Sequence[str] = ()
    ) -> Note:
        line, file = int(self.lines[row]), self.file_of(row)
        return Note(code, message, severity, points=tuple(points), file=file, line=line, key=key)

    def fault(self, row: int, column: str, message: str, code: str, *, expected: str = "", fix: str = "") -> Fault:
        """Make a fault with the place of a cell."""
        return self._text_of(row).fault(int(self.lines[row]), column, message, code, expected=expected, fix=fix)


def joined(tables: Sequence[Table]) -> Table:
    """Put tables with the same columns of ids below each other; numbers that one lacks are NaN in its rows."""
    if len(tables) == 1:
        return tables[0]
    numbers = dict.fromkeys(name for each in tables for name in each.numbers)
    codes, ids = {}, {}
    for name in tables[0].ids:
        ids[name] = tuple(dict.fromkeys(each for table in tables for each in table.ids[name]))
        codes[name] = np.concatenate([locate(table.ids[name], ids[name])[table.codes[name]] for table in tables])
    return Table(
        file=", ".join(each.file for each in tables),
        lines=np.concatenate([each.lines for each in tables]),
        numbers={name: np.concatenate([each.column(name) for each in tables]) for name in numbers},
        codes=codes,
        ids=ids,
        texts=tuple(text for each in tables for text in each.texts),
        _source=np.repeat(np.arange(len(tables)), [len(each) for each in tables]),
    )


class _NoJsonError(ValueError):
    pass


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise _NoJsonError(f"`{shown(twice)}` stands twice in a block")
    return found


def _no_constant(word: str) -> NoReturn:
    raise _NoJsonError(f"{word} in it is no number")


def read_json(file: str) -> Any:  # noqa: ANN401 (any JSON)
    """Read a file of JSON, which may be packed.

    Raises InputError for all that is none, for a name that stands twice in a block, and for what is no number.
    """
    return parsed_json(decode(file, unpacked(file))[0], file, "foreign", once=True)


def parsed_json(text: str, file: str, code: str, *, expected: str = "", fix: str = "", once: bool = False) -> Any:  # noqa: ANN401
    """Parse JSON, or raise what keeps a text from being it.

    once: whether a name may stand in a block only once, and numbers are numbers.
    """
    try:
        return json.loads(
            text, object_pairs_hook=_once if once else None, parse_constant=_no_constant if once else None
        )
    except json.JSONDecodeError as error:
        message = f"is not JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        raise InputError(Fault(message, code, file, line=error.lineno, column=error.colno, fix=fix)) from None
    except RecursionError:
        refuse(file, code, "is nested too deeply", expected=expected)
    except ValueError as error:  # Python reads 4300 digits
        own = isinstance(error, _NoJsonError)
        refuse(file, code, str(error) if own else "holds a number with thousands of digits", expected=expected)
