"""Tables from rows: a column's head and what it shows of a row stand together."""

from __future__ import annotations

from photostrip.report.page.parts import DASH, Column
from photostrip.report.page.tables import number, tabulated, words

ROWS = (
    {"id": "1", "base": 897.4912, "discrepancy": {"up": -0.0004}, "points": 7},
    {"id": "2", "base": None, "discrepancy": {"up": 0.25}, "points": 0},
)


def test_a_column_reads_keys_deeper_keys_and_functions() -> None:
    columns = (
        words("photo", "id", rank=1),
        number("base", "base", 2, "m"),
        number("up", "discrepancy.up", 3, "m"),
        number("points", "points"),
        words("", lambda row: "used" if row["points"] else "not used"),
    )
    table = tabulated(ROWS, columns, (("all", "", "", "7", ""),), "note")
    assert table.columns == (
        Column("photo", left=True, rank=1),
        Column("base", "m"),
        Column("up", "m"),
        Column("points"),
        Column("", left=True),
    )
    assert table.rows == (("1", "897.49", "0.000", "7", "used"), ("2", DASH, "0.250", "0", "not used"))
    assert (table.foot, table.note) == ((("all", "", "", "7", ""),), "note")


def test_a_function_may_write_the_number() -> None:
    assert tabulated(ROWS, (number("base", "base", lambda base: "none" if base is None else f"{base:.0f}"),)).rows == (
        ("897",),
        ("none",),
    )
