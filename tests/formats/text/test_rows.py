"""Rows without quotes are split, and their numbers read, as ``csv`` and ``float`` do it."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from photostrip.formats.measured.observations import read_measurements
from photostrip.formats.text import table_text
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.rows import LONGEST_FIELD, SplitRows, plain_rows

if TYPE_CHECKING:
    from pathlib import Path

WIDTH = 3
signs = st.sampled_from(
    [",", "\n", "\r\n", "\r", "\n\n", '"', " ", "a", "1", "é", "中", "\u2028", "\x85", "\t", "-", "."]
)
ids = st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters=' ,"'), max_size=5)
decimals = st.one_of(
    st.decimals(-(10**9), 10**9, places=4).map(str),
    st.integers(-(10**15), 10**15).map(str),
    st.sampled_from(["+.5", "-5.", "-0", "-0.000", "007", "0.1", "2.675", "123456789.012345", "999999999999999"]),
)


def by_csv(block: bytes) -> list[list[str]]:
    stream = io.TextIOWrapper(io.BytesIO(block), encoding="utf-8", newline="")
    return list(csv.reader(stream, strict=True, skipinitialspace=True))


@given(st.lists(signs, min_size=1, max_size=40))
@example(["a", ",", "1", ",", "b", "\n"] * 2)
@example(["a", ",", "1", ",", "b", "\r\n", "a", ",", ",", "\n"])
def test_what_is_split_is_what_csv_reads(parts: list[str]) -> None:
    block = "".join(parts).encode()
    rows = plain_rows(block, WIDTH)
    if rows is not None:
        assert list(map(list, zip(*map(rows.texts, range(WIDTH)), strict=True))) == by_csv(block)
        assert len(rows) == len(by_csv(block))


@given(st.lists(st.tuples(ids, decimals, decimals), min_size=1, max_size=20), st.booleans())
def test_rows_of_ids_and_numbers_are_split(table: list[tuple[str, str, str]], last: bool) -> None:
    rows = plain_rows("\n".join(map(",".join, table)).encode() + b"\n" * last, WIDTH)
    assert rows is not None
    assert rows.texts(0) == [row[0] for row in table]
    for column in (1, 2):
        found, expected = rows.numbers(column), np.array([float(row[column]) for row in table])
        assert found is not None
        assert found.tobytes() == expected.tobytes()  # -0 is not 0


@pytest.mark.parametrize(
    "cell",
    [
        "",
        "-",
        ".",
        "-.",
        "+",
        "1.2.3",
        "1-2",
        "--1",
        "a",
        "1e",
        "nan",
        "1_0",
        "١",
        "１",
        "1/2",
        "1:2",
        "1" * 17,
        "2e16",
    ],
)
def test_what_is_no_number_of_the_table_is_left_to_others(cell: str) -> None:
    rows = plain_rows(f"a,{cell},1\nb,2.5,2\n".encode(), WIDTH)
    assert rows is not None
    assert rows.numbers(1) is None


@pytest.mark.parametrize("cell", ["1e3", "1E-2", "0.12345678901234567", "1234567890123.4567"])
def test_numbers_of_many_digits_are_read_one_by_one(cell: str) -> None:
    rows = plain_rows(f"a,{cell},1\nb,2.5,2\n".encode(), WIDTH)
    assert rows is not None
    found = rows.numbers(1)
    assert found is not None
    assert found.tolist() == [float(cell), 2.5]


@pytest.mark.parametrize(
    "block",
    [
        b"",
        b"a,1\nb,2,3\n",
        b"a,1,2,b,3,4\n",
        b"a,1\n2,b\n3,4\n",
        b'a,"1",2\n',
        b"a, 1,2\n",
        b"a,1,2\rb,3,4\n",
        b"a,1,2\n\n",
        b"x" * LONGEST_FIELD + b",1,2\n",
    ],
)
def test_other_rows_are_left_to_csv(block: bytes) -> None:
    assert plain_rows(block, WIDTH) is None


def test_rows_that_are_texts_are_read_in_the_same_way() -> None:
    rows = SplitRows([["a", "b"], ["1", "-2.5"]])
    assert rows.texts(0) == ["a", "b"]
    found = rows.numbers(1)
    assert found is not None
    assert found.tolist() == [1.0, -2.5]


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("block", [1, 20, 1000])
def test_plain_and_quoted_rows_make_one_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int, ending: str
) -> None:
    monkeypatch.setattr(table_text, "BLOCK", block)
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
