"""result.json and the tables: the same numbers in both, read back as they were; other files are refused."""

from __future__ import annotations

import csv
import json
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.formats.result_json import line_finder, read_result, to_json
from photostrip.result.table import plain_of, stored
from tests.loops import nonempty
from tests.results import FRAMES, case, result_files

if TYPE_CHECKING:
    from pathlib import Path

    from tests.results import Document

pytestmark = pytest.mark.usefixtures("_adjusted_once")


ODD_IDS = [
    "0123", "NO", "1:20", "1e3", "~", 'say "no"', "a,b", "a}, {", "точка", "点", "x\u0301", "\\", "=1+1", " ", "nan",
]  # fmt: skip


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(text)))


def with_odd_ids() -> Document:
    """Give the first points of a result ids that other programs stumble over."""
    document = case("local").document
    ids = [*ODD_IDS, *document["points"].values("id")[len(ODD_IDS) :]]
    return document | {"points": document["points"].with_columns(id=np.array(ids, object))}


def test_every_column_stands_on_a_line_of_its_own() -> None:
    document = case("projected", 2).document
    text = to_json(document)
    lines, line_of = text.splitlines(), line_finder(text)
    for table in ("points", "photos", "models", "control", "residuals"):
        assert lines[line_of(table, "") - 1] == f'"{table}": {{'
        for name, column in stored(document[table]).items():
            line = lines[line_of(table, name) - 1].rstrip("},")
            assert json.loads(f"{{{line}}}")[name] == column
    assert line_of("points", "no such column") == line_of("points", "")
    assert line_of("no such table", "x") == 0


def test_result_json_comes_last() -> None:
    names = list(result_files(case("local").document, "text: 1\n"))
    assert names[-1] == "result.json"
    tables = {f"{name}.csv" for name in ("points", "photos", "given_points", "residuals", "rejected", "strips")}
    assert set(names) >= tables | {"project.resolved.yaml", "result.json"}
    assert "project.resolved.yaml" not in result_files(case("local").document)


# ------------------------------------------------------------------------------------------------------- tables


def number(text: str) -> float | None:
    return float(text) if text else None


@pytest.mark.parametrize("frame", FRAMES)
def test_tables_say_what_result_json_says(frame: str) -> None:
    """Check points, too."""
    document = with_odd_ids() if frame == "local" else case(frame).document
    files = result_files(document)
    for name, head in (("points", "point"), ("photos", "photo"), ("control", "point"), ("residuals", "photo")):
        table = rows(files["given_points.csv" if name == "control" else f"{name}.csv"])
        columns = dict(zip(table[0], document[name].columns, strict=True))
        assert next(iter(columns)) == head
        for row, expected in nonempty(zip(table, document[name], strict=True)):
            for key, column in columns.items():
                value, unit = expected[column], document[name].quantities[column].kind
                if unit in {"number", "count"}:
                    assert number(row[key]) == value or column == "normalised"
                elif unit == "flag":
                    assert row[key] == ("" if value is None else str(int(value)))
                else:
                    assert row[key] == (";".join(value) if isinstance(value, list) else value or "")
    assert {row["role"] for row in rows(files["given_points.csv"])} == {"control", "check"}


def test_angles_are_named_by_system_and_unit() -> None:
    head = result_files(case("north first").document)["photos.csv"].splitlines()[0].split(",")
    assert {"alpha_deg", "omega_deg", "kappa_deg", "sigma_kappa_deg"} < set(head)


# ------------------------------------------------------------------------------------------------------ reading


@pytest.mark.slow
def test_a_result_is_read_back(tmp_path: Path) -> None:
    (file := tmp_path / "result.json").write_text(to_json(with_odd_ids()), encoding="utf-8")
    assert plain_of(read_result(str(file))) == plain_of(with_odd_ids())
    ascii_only = to_json(with_odd_ids(), ascii_only=True)
    assert ascii_only.isascii()
    assert json.loads(ascii_only) == plain_of(with_odd_ids())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", ":1:2: is not JSON"),
        ('{"photostrip_result": 1}', "has the result format 1; expected 2"),
        ('{"photostrip_result": "1"}', "has the result format '1'; expected 2"),
        ("[" * 100_000, "nested too deeply"),
    ],
)
def test_what_is_no_result_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (file := tmp_path / "result.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_result(str(file))
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(file))
