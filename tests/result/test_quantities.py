"""The description of the result: every key of every result is in it, written as it says, and stands in the manual."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from photostrip.formats.output.result_json import to_json
from photostrip.pipeline.inputs import Settings
from photostrip.result.columns import photos_csv, points_csv, rejected_csv, reliability_csv
from photostrip.result.description import Quantity, described, quantity_at
from photostrip.result.numbers import RoundedColumn
from photostrip.result.quantities import rounded_as
from photostrip.result.reading import faults_of
from photostrip.result.records import Grouped, Named, Records
from photostrip.simulation import Models, simulate
from tests.loops import nonempty
from tests.renew_golden import SAMPLES, baseline
from tests.results import case, solved, spec
from tests.simulated import inputs_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from photostrip.result.description import Table

    Document = dict[str, Any]

ENDINGS = {"_um": "um", "_ppm": "ppm", "_deg": "deg", "_mm": "mm", "_arcsec": "arcsec"}


def leaves(value: object, path: str = "") -> Iterator[tuple[str, object, str]]:
    """Give the path of every key without parts, its value, and the unit that stands beside it."""
    if isinstance(value, dict):
        for key, each in value.items():
            unit = value.get("size_unit" if key == "size" else "unit", "")
            yield from ((p, v, u or unit) for p, v, u in leaves(each, f"{path}.{key}" if path else key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for each in value:
            yield from leaves(each, path)
    else:
        yield path, value, ""


def faults(document: Document) -> set[str]:
    """Give the keys that are not described, and those that are not written as they are described."""
    again = json.loads(to_json(document))
    found = {f"{fault.key} could not be read again: {fault}" for fault in faults_of(again, "result.json")}
    for path, value, unit in leaves(again):
        quantity = quantity_at(path)
        if value in (None, [], {}):  # a part that is missing
            continue
        if quantity is None or not quantity.meaning:
            found.add(f"{path} is not described")
        elif quantity.kind == "number" and rounded_as(quantity, value, unit) != value:  # type: ignore[arg-type]
            found.add(f"{path} has other decimals: {value}")
        elif quantity.kind in {"text", "word", "flag", "count"} and re.search(r"\d\.\d", json.dumps(value)):
            found |= set() if isinstance(value, str | list) and quantity.kind == "text" else {f"{path} is a number"}
    return found


@pytest.mark.parametrize("name", SAMPLES)
def test_every_key_of_a_sample_is_described(name: str) -> None:
    assert faults(json.loads(baseline(name).read_text(encoding="utf-8"))) == set()


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_every_key_of_a_result_is_described(adjustment: str) -> None:
    assert faults(solved(case("projected", 2).inputs, Settings(adjustment=adjustment)).document) == set()


def test_every_key_of_independent_models_is_described() -> None:
    assert faults(solved(inputs_of(simulate(replace(spec(), models=Models())))).document) == set()


@pytest.mark.parametrize("frame", ["geographic", "geocentric", "local"])
def test_coordinates_are_described_in_every_frame(frame: str) -> None:
    assert faults(case(frame).document) == set()


def described_keys(table: Table, path: str = "") -> Iterator[tuple[str, Quantity]]:
    for key, entry in table.items():
        if isinstance(entry, Quantity):
            yield f"{path}{key}", entry
        else:
            yield from described_keys(entry, f"{path}{key}.")


KEYS = dict(described_keys(described()))


def test_a_unit_in_the_name_of_a_key_is_its_unit() -> None:
    named = {path: ENDINGS[end] for path in KEYS for end in ENDINGS if path.split(".")[-1].endswith(end)}
    assert {path: KEYS[path].unit for path in named} == named


def test_an_unknown_key_and_other_decimals_are_found() -> None:
    document = json.loads(baseline(SAMPLES[0]).read_text(encoding="utf-8"))
    document["strips"][0]["colour"] = "red"
    document["strips"][0]["base"] += 0.001
    assert {fault.split()[0] for fault in faults(document)} == {"strips.colour", "strips.base"}


def test_the_page_names_every_block_and_no_other() -> None:
    page = (ROOT / "docs/files/result.md").read_text(encoding="utf-8")
    table = page.partition("| block |")[2].partition("\n\n")[0]
    named = {name for row in table.splitlines() for name in re.findall(r"`(\w+)`", row.split(" | ")[0])}
    assert named == {path.partition(".")[0] for path in KEYS} - {"refined"}


def test_columns_of_tables_have_a_unit_and_a_meaning() -> None:
    angles = {"system": "omega-phi-kappa", "unit": "gon"}
    for columns in (points_csv("gon"), photos_csv(angles), rejected_csv(), reliability_csv()):
        assert all(column.quantity.meaning for column in columns)
    by_name = {column.name: column.quantity for column in photos_csv(angles)}
    assert by_name["omega_gon"] == replace(by_name["sigma_omega_gon"], meaning=by_name["omega_gon"].meaning)
    assert by_name["omega_gon"].unit == "gon"
    assert (points_csv("gon")[-1].name, points_csv("gon")[-1].quantity.unit) == ("ellipse_azimuth_gon", "gon")


def test_ratios_of_given_points_have_two_decimals() -> None:
    """That of one point, those of the summary that are compared with a limit of 5."""
    document = case("local").document
    ratios = [row["normalised"] for row in document["control"] if row["normalised"] is not None]
    summary = [document["summary"][role]["normalised"] for role in ("control", "check")]
    for values in (ratios, [each for each in summary if each is not None]):
        assert [round(value, 2) for value in nonempty(values)] == values


# -------------------------------------------------------------------------------------------- records as columns


COLUMNS: dict[str, list[Any]] = {
    "id": ["a", 'b"], [', "§\x85"],
    "x": [1.5, None, -2.0],
    "rays": [1, 2, 3],
    "used": [True, False, True],
    "strips": [["1"], [], ["2", '"], ["']],
    "sigma": [[0.1, None], [], [3.0]],
    "parts": [{"x": 1}, {}, {"x": [None, "}, {"]}],
}


def test_records_are_written_as_a_list_of_them() -> None:
    records = Records(COLUMNS)
    for document in ({"a": records}, {"a": {"b": records, "c": "d" * 200}}, {"a": {"b": records[:1]}}):
        plain = json.loads(json.dumps(document, default=list))
        assert to_json(document) == to_json(plain)
        assert json.loads(to_json(document)) == plain
    with pytest.raises(ValueError, match="JSON"):
        to_json({"a": Records({"x": [1.0, float("nan")]})})


def test_columns_kept_as_arrays_are_written_as_their_records() -> None:
    """With few records, which are written one by one, and with many, whose columns are written together."""
    for count in (3, 900):
        number = np.arange(count)
        names = Named(("a", 'b"], [', "§\x85", "Höhe"), number % 4)
        square = np.where(number % 3 == 1, np.nan, number - 2.5)
        columns = {
            "id": names,
            "ids": Grouped(names, [0, *range(2, count + 1), count]),
            "parts": Records({"x": RoundedColumn(square), "ids": names, "none": [[]] * count}),
            "square": RoundedColumn(np.column_stack([square, -square])),
            "count": RoundedColumn(number - 1),
            "flag": RoundedColumn(number % 2 == 0),
            "flags": Grouped(RoundedColumn(number % 2 == 0), [0] * count + [count]),
        }
        records = Records(columns)
        plain = json.loads(json.dumps(list(records), default=list))
        assert json.loads(to_json({"a": records})) == {"a": plain}
        assert to_json({"a": records}) == to_json({"a": plain})
        assert Records({"id": names}).taken(number[::-1]) == [{"id": row["id"]} for row in plain[::-1]]


def test_records_are_a_list_of_what_stands_beside_each_other() -> None:
    records = Records(COLUMNS)
    assert records[1] == list(records)[1] == {key: column[1] for key, column in COLUMNS.items()}
    assert len(records) == 3
    assert records == list(records)
    assert records[1:] == list(records)[1:]
    assert records.rows() == list(records)
    assert Records({"x": RoundedColumn(np.array([1.5, np.nan]))}).rows() == [{"x": 1.5}, {"x": None}]
    assert records.taken(np.array([2, 0])) == [records[2], records[0]]
    assert Records.joined([records, records[:1]]) == [*records, records[0]]
    assert not Records.joined([])
