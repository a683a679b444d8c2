"""The text of a table: unpacked, known to be text, with the place of every cell."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO, TextIOWrapper
from itertools import islice
from pathlib import Path

from photostrip.errors import Fault
from photostrip.formats.text.files import BOM, GZIP, MEGABYTE, decode, read_bytes, refuse

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
