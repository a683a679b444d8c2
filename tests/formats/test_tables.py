"""Tables by themselves: chunks, places of cells, memory; what counts as a number."""

from __future__ import annotations

import csv
import gzip
import io
import tracemalloc
import zlib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from photostrip.formats import tables
from photostrip.formats.faults import LARGEST_NUMBER, MOST_FAULTS_KEPT, Findings, NotANumber, number, shown, suggestion
from photostrip.formats.measured import OBSERVATIONS, read_measurements
from photostrip.formats.tables import floats, read_table
from photostrip.notes import counted, listed

if TYPE_CHECKING:
    from pathlib import Path

HEADER = "photo,point,x,y\n"


def faults(path: Path) -> list[str]:
    findings = Findings()
    read_measurements([str(path)], findings)
    return [str(fault).replace(str(path), path.name) for fault in findings.faults]


def write(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


# --------------------------------------------------------------------------------------------- clean tables


@pytest.mark.parametrize("chunk", [1, 2, 3, 1000])
def test_chunks_do_not_show_and_columns_that_are_not_there_are_nan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    monkeypatch.setattr(tables, "CHUNK", chunk)
    rows = [(f"p{i % 3}", f"Q{i}", i / 7, -i / 3) for i in range(10)]
    text = HEADER + "\n".join(",".join(map(str, row)) + "\n" * (i % 2) for i, row in enumerate(rows))
    findings = Findings()
    read = read_measurements([str(write(tmp_path / "o.csv", text))], findings)
    assert read is not None
    assert findings.faults == ()
    assert [read.photo_ids[code] for code in read.photo] == [row[0] for row in rows]
    assert [read.target_ids[code] for code in read.target] == [row[1] for row in rows]
    assert read.xy.tolist() == [[row[2], row[3]] for row in rows]
    lines = text.splitlines()
    assert [lines[line - 1].split(",")[1] for line in read.table.lines] == [row[1] for row in rows]
    table = read_table(str(write(tmp_path / "o.csv", HEADER + "1,P,2,3\n")), OBSERVATIONS, Findings())
    assert table is not None
    assert np.isnan(table.column("sx")).tolist() == [True]


# --------------------------------------------------------------------------------------------- places of cells


names = st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters=" "), min_size=1, max_size=8)


@given(st.lists(st.tuples(names, st.booleans()), min_size=3, max_size=3), st.integers(0, 3), st.integers(0, 4))
def test_a_fault_names_the_character_where_its_cell_begins(
    cells: list[tuple[str, bool]], wanted: int, blanks: int
) -> None:
    import tempfile
    from pathlib import Path

    columns = ["photo", "point", "x", "y"]
    stream = io.StringIO()
    begins = []
    texts = [text if not quoted else text + ',"' for text, quoted in cells]
    order = [column for column in columns if column != "y"]
    order.insert(wanted, "y")
    values = dict(zip(["photo", "point"], texts, strict=False)) | {"x": "1", "y": "bad"}
    for place, column in enumerate(order):
        stream.write("," if place else "")
        stream.write(" " * blanks)
        begins.append(len(stream.getvalue()) + 1)
        csv.writer(stream, lineterminator="").writerow([values[column]])
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / "o.csv", ",".join(order) + "\n" + stream.getvalue() + "\n")
        findings = Findings()
        read_measurements([str(path)], findings)
    told = [fault for fault in findings.faults if fault.key == "y"]
    assert [(fault.line, fault.column) for fault in told] == [(2, begins[wanted])]


@pytest.mark.parametrize(
    ("rows", "places"),
    [
        ('1,"P\nQ",1,2\n2,P,x,2\n\n3,P,1,y\n', "2:3 4:5 6:7"),
        ("1,P\n,Q,1,2\n1,R,a,b\n1,S,1,2,3\n1,T,1,2\n1,T,3,4\n", "2 3:1 4:5 4:7 5 7:3"),
    ],
)
def test_every_fault_is_told_and_lines_count_as_editors_do(tmp_path: Path, rows: str, places: str) -> None:
    told = [fault.partition(" ")[0] for fault in faults(write(tmp_path / "o.csv", HEADER + rows))]
    assert told == [f"o.csv:{place}:" for place in places.split()]


# --------------------------------------------------------------------------------------------- whole tables


def packed(data: bytes) -> bytes:
    return gzip.compress(data, mtime=0)


WHOLE = packed(HEADER.encode() * 50)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("o.csv", b"", "is empty"),
        ("o.csv", b"\n\n \n", "no header and no rows"),
        ("o.csv", HEADER.encode(), "a header but no rows"),
        ("o.csv", HEADER.encode() + b"\n,,,\n", "a header but no rows"),
        ("o.csv", b'"photo', "never closed"),
        ("o.csv", b"photo;point;x, mm;y\n1;P;2;3\n", "fields are separated by semicolons"),
        ("o.csv", packed(HEADER.encode()), "is compressed (gzip), but its name does not say so"),
        ("o.csv.gz", HEADER.encode(), "is not compressed"),
        ("o.csv.gz", WHOLE[:-9], "ends too early"),
        ("o.csv.gz", WHOLE[:10] + b"\xff" * 8 + WHOLE[18:], "is damaged"),
        ("o.csv.gz", WHOLE[:-8] + b"\0" * 8, "is damaged"),
        ("o.csv.gz", packed(b""), "is empty"),
        ("o.csv.gz", packed(b"a\0b"), "NUL"),
        ("o.csv", "photo,point,x,y\n".encode("utf-16"), "UTF-16"),
    ],
)
def test_what_is_no_table(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    told = faults(write(tmp_path / name, content))
    assert len(told) == 1
    assert words in told[0]
    assert told[0].startswith(name)


def test_a_compressed_table_that_unpacks_without_end_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "LARGEST_TABLE", 10_000)
    monkeypatch.setattr(tables, "BLOCK_BYTES", 1000)
    packer = zlib.compressobj(wbits=31)
    bomb = packer.compress(b"1," * 1_000_000) + packer.flush()
    assert len(bomb) < 10_000
    assert "unpacks to more than" in faults(write(tmp_path / "o.csv.gz", bomb))[0]


@pytest.mark.parametrize(
    ("part", "count", "words"),
    [
        (b"1,1,1,1\n", 6_000_000, "has 6000001 lines; expected at most 5000000"),
        (b"1,", 20_000_000, "has a line of more than 20 kB, line 2"),
    ],
)
def test_a_small_packed_table_does_not_fill_the_memory(tmp_path: Path, part: bytes, count: int, words: str) -> None:
    """However well rows and fields pack, they are counted before they are made."""
    packer = zlib.compressobj(wbits=31)
    some = part * (count // 100)
    pieces = [packer.compress(each) for each in (HEADER.encode(), *[some] * 100)]
    path = write(tmp_path / "o.csv.gz", b"".join(pieces) + packer.flush())
    assert path.stat().st_size < 100_000
    tracemalloc.start()
    told = faults(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(told) == 1
    assert words in told[0]
    assert peak < 3 * len(part) * count


# ------------------------------------------------------------------------------------------------- findings


def test_long_lists_of_faults_are_cut_and_counted(tmp_path: Path) -> None:
    path = write(tmp_path / "o.csv", HEADER + "".join(f"1,P{i},x,y\n" for i in range(MOST_FAULTS_KEPT)))
    told = faults(path)
    assert len(told) == MOST_FAULTS_KEPT + 1
    assert told[-1] == f"o.csv: and {MOST_FAULTS_KEPT} more faults in this file"


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [("nmae", ["name", "unit"], "name"), ("RC-30", ["rc30"], "rc30"), ("zzz", ["name"], ""), ("x", [], ""),
     ("MAX_0142.JPG", ["DJI_0012.JPG"], ""), ("MAX_0142.JPG", ["DJI_0012.JPG", "DJI_0142.JPG"], "DJI_0142.JPG"),
     ("DJI_142.JPG", ["DJI_0142.JPG"], "DJI_0142.JPG"), ("IMG_1OO3", ["IMG_1003"], "IMG_1003")],
)  # fmt: skip
def test_suggestions(name: str, known: list[str], meant: str) -> None:
    assert suggestion(name, known) == (f"did you mean `{meant}`?" if meant else "")


def test_ids_and_counts_in_a_sentence() -> None:
    assert listed(["a", "b"]) == "a, b"
    assert listed(map(str, range(11))) == "0, 1, 2, 3, 4, 5, 6, 7 and 3 more"
    assert (counted(1, "row"), counted(2, "row"), counted(0, "is", "are")) == ("1 row", "2 rows", "0 are")


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_rows_of_all_line_ends_with_and_without_quotes_make_one_table(tmp_path: Path, ending: str) -> None:
    lines = ["photo,point,x,y", "1,A,1.5,2", "2,Ä,1,2e0", "3,中,-0.25,4", '"4","A,B", 1,2', "", "5,C,1,x", "6,D,1,2"]
    path = tmp_path / "o.csv"
    path.write_bytes(ending.join(lines).encode())
    findings = Findings()
    read = read_measurements([str(path)], findings)
    assert read is not None
    assert [read.photo_ids[code] for code in read.photo] == ["1", "2", "3", "4", "5", "6"]
    assert [read.target_ids[code] for code in read.target] == ["A", "Ä", "中", "A,B", "C", "D"]
    assert read.xy[:4].tolist() == [[1.5, 2.0], [1.0, 2.0], [-0.25, 4.0], [1.0, 2.0]]
    assert read.table.lines.tolist() == [2, 3, 4, 5, 7, 8]
    assert [(fault.line, fault.column) for fault in findings.faults] == [(7, 7)]


@given(st.floats(-LARGEST_NUMBER, LARGEST_NUMBER))
@example(-0.0)
@example(LARGEST_NUMBER)
@example(5e-324)
def test_every_number_python_writes_is_read_back(value: float) -> None:
    assert number(repr(value)) == value
    assert number(f" {value!r}\t") == value
    assert number(f"{value:.6f}") == float(f"{value:.6f}")


def test_forms_of_numbers() -> None:
    assert [*map(number, ("+1", "-.5", "5.", "1e3", "007", "1E-2"))] == [1.0, -0.5, 5.0, 1000.0, 7.0, 0.01]


@pytest.mark.parametrize(
    ("text", "message", "fix"),
    [
        ("", "no value is given", ""),
        ("nan", "not a measured value", ""),
        ("-Infinity", "not a measured value", ""),
        ("1e400", "too large", ""),
        ("-1.1e15", "too large", ""),
        ("1,5", "decimal comma", "1.5"),
        (",5", "decimal comma", ".5"),
        ("1_000", "digits in groups", "without separators"),
        ("4 649 871.40", "digits in groups", "without separators"),
        ("4\u00a0649", "digits in groups", "without separators"),
        ("12'345", "digits in groups", "without separators"),
        ("1_0.5", "underscore", "10.5"),
        ("１２", "ASCII", "12"),
        ("−5", "ASCII", "-5"),
        ("٣", "ASCII", "3"),
        ("12°30'15\"", "one number", "decimal degrees"),
        ("12:30", "one number", "decimal degrees"),
        ("12 30 15", "one number", "decimal degrees"),
        ("3.5 mm", "unit", "3.5"),
        ("3.5m", "unit", "3.5"),
        ("0x1F", "not a number", ""),
        ("1e", "unit", "1"),
        ("1.2.3", "not a number", ""),
        ("--1", "not a number", ""),
        ("x" * 99, "xxx…`", ""),
    ],
)
def test_what_is_no_number_is_explained(text: str, message: str, fix: str) -> None:
    with pytest.raises(NotANumber) as caught:
        number(text)
    assert message in caught.value.message
    assert fix in caught.value.fix


column_cells = st.one_of(
    st.floats().map(repr), st.text(max_size=6), st.text(alphabet="0123456789+-.eE_, naif\u0663１", max_size=6)
)


@pytest.mark.slow
@given(st.lists(column_cells, min_size=1, max_size=4))
@example(["1_0"])
@example(["\u0663"])
@example(["1", "infinity"])
def test_a_column_is_converted_at_once_only_if_every_cell_is_a_number(column: list[str]) -> None:
    def is_number(cell: str) -> bool:
        try:
            number(cell)
        except NotANumber:
            return False
        return True

    fast = floats(column)
    if fast is None:
        return
    assert all(map(is_number, column))
    assert fast.tolist() == [number(cell) for cell in column]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("a\tb", "a\\tb"), ("a\u200bb", "a\u200bb"), ("🛩️", "🛩️"), ("x" * 41, "x" * 40 + "…"), ("\x00", "\\x00")],
)
def test_a_text_in_a_message_stays_on_its_line(text: str, expected: str) -> None:
    assert shown(text) == expected
