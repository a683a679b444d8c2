"""The description of the result: every key is in it, written and read as it says; its schema; rounding and order."""

from __future__ import annotations

import json
import re
from copy import deepcopy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from photostrip.cli.main import main
from photostrip.errors import InputError
from photostrip.formats.result_json import checked, read_baseline, to_json
from photostrip.pipeline.inputs import Settings
from photostrip.result.description import LEFT_OUT, Block, Quantity, described, result_page, result_schema
from photostrip.result.numbers import natural, natural_rank, order_of, rounded, rounded_as, significant
from photostrip.result.reading import read
from photostrip.result.table import Table, plain_of
from photostrip.simulation import Models, simulate
from tests.loops import nonempty
from tests.renew_golden import SAMPLES, baseline
from tests.results import case, solved, spec
from tests.simulated import inputs_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator

    Document = dict[str, Any]
    from pathlib import Path

ENDINGS = {"_um": "um", "_ppm": "ppm", "_deg": "deg", "_mm": "mm", "_arcsec": "arcsec"}


def leaves(value: object, path: str = "") -> Iterator[tuple[str, object, str]]:
    """Give the path of every key without parts, its value, and the unit that stands beside it."""
    if isinstance(value, Table):
        for row in value:
            for key, each in row.items():
                yield f"{path}.{key}", each, row.get("size_unit" if key == "size" else "unit", "")
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from leaves(each, f"{path}.{key}" if path else key)
    else:
        yield path, value, ""


def quantity_at(path: str) -> Quantity | None:
    """Find a key by the keys that lead to it; what stands below a key that is described as a whole belongs to it."""
    place: object = described()
    for key in path.split("."):
        place = place.get(key) if isinstance(place, Block) else place
    return place if isinstance(place, Quantity) else None


def faults(document: Document) -> set[str]:
    """Give the keys that are not described, and those that are not written as they are described."""
    found = set()
    for path, value, unit in leaves(checked(json.loads(to_json(document)), "result.json", LEFT_OUT)):
        quantity = quantity_at(path)
        if value in (None, [], {}):  # a part that is missing
            continue
        if quantity is None or not quantity.meaning:
            found.add(f"{path} is not described")
        elif quantity.kind == "number" and rounded_as(quantity, value, unit) != value:
            found.add(f"{path} has other decimals: {value}")
    return found


def result(name: str) -> Document:
    """Give a sample's baseline, a result in a frame, or one of another kind."""
    if name in SAMPLES:
        return read_baseline(str(baseline(name))) | {"version": ""}
    if name == "models":
        return solved(inputs_of(simulate(replace(spec(), models=Models())))).document
    if name == "bundle":
        return solved(case("projected", 2).inputs, Settings(adjustment="bundle")).document
    return case(name, 2).document


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SAMPLES, "projected", "geographic", "geocentric", "local", "bundle", "models"])
def test_every_key_of_every_result_is_described_and_keeps_the_schema(name: str) -> None:
    assert faults(result(name)) == set()
    assert against_schema(plain_of(result(name))) == []


def described_keys(block: Block, path: str = "") -> Iterator[tuple[str, Quantity]]:
    for key, entry in block.items():
        if isinstance(entry, Quantity):
            yield f"{path}{key}", entry
        else:
            yield from described_keys(entry, f"{path}{key}.")


KEYS = dict(described_keys(described()))


def test_a_unit_in_the_name_of_a_key_is_its_unit() -> None:
    named = {path: ENDINGS[end] for path in KEYS for end in ENDINGS if path.split(".")[-1].endswith(end)}
    assert {path: KEYS[path].unit for path in named} == named


def test_an_unknown_key_and_other_decimals_are_found() -> None:
    document = plain_of(read_baseline(str(baseline(SAMPLES[0]))))
    document["strips"]["colour"] = ["red"] * len(document["strips"]["id"])
    document["strips"]["base"][0] += 0.001
    assert {fault.split()[0] for fault in faults(document)} == {"strips.colour", "strips.base"}


def test_the_page_names_keys_that_there_are() -> None:
    page = (ROOT / "docs/files/result.md").read_text(encoding="utf-8")
    table = page.partition("| wanted |")[2].partition("\n\n")[0]
    named = set(re.findall(r"`(\w+)(?:\.\w+)?`", table))
    assert len(named) > 30
    assert named <= {name for path in KEYS for name in path.split(".")}


def test_coordinates_and_angles_have_the_units_of_their_result() -> None:
    document = solved(case("geographic").inputs, Settings(angle_system="omega-phi-kappa", angle_unit="gon")).document
    assert [document["points"].units[axis] for axis in "xyz"] == ["deg", "deg", "m"]
    assert document["photos"].units["angle_1"] == document["photos"].units["sigma_angle_1"] == "gon"


ROWS = [
    {"strip": "1", "photo": None, "point": 'b"], [', "value": 1.234, "unit": "ppm", "zone": 2, "blamed": ["2", "x"]},
    {"strip": "1", "photo": "a", "point": "§\x85", "value": None, "unit": "", "zone": None, "blamed": []},
    {"strip": "2", "photo": "b", "point": "c", "value": 2.345, "unit": "", "zone": 1, "blamed": []},
]


def test_a_table_gives_columns_and_rows_and_comes_back_from_json() -> None:
    table = Table.of_rows("rejected", ROWS)
    assert table.values("value") == [1.2, None, 2.35]  # by the unit beside it
    assert table.values("zone") == [2, None, 1]
    assert np.isnan(table["value"][1])
    assert table[1] == list(table)[1] == ROWS[1]
    assert len(table) == 3
    assert table[1:] == list(table)[1:]
    assert table[[2, 0]] == [table[2], table[0]]
    assert table.where(strip="1", photo=["a", None]) == table[:2]
    assert Table.joined("rejected", [table, table[:1]]) == [*table, table[0]]
    assert json.loads(to_json({"a": table}))["a"] == plain_of(table)
    with pytest.raises(ValueError, match="read-only"):
        table["value"][0] = 1.0
    with pytest.raises(KeyError, match="did you mean 'photo'"):
        table["foto"]
    assert not Table.of_rows("rejected", ())
    assert Table.of_rows("rejected", ()).columns == Table.joined("rejected", ()).columns
    with pytest.raises(ValueError, match="JSON"):
        to_json({"a": float("nan")})


SCHEMA = result_schema()
VALIDATOR = Draft202012Validator(SCHEMA)


def against_schema(document: dict[str, Any]) -> list[str]:
    """Give what JSON Schema has against a document."""
    return [f"{error.json_path}: {error.message}" for error in VALIDATOR.iter_errors(document)]


@pytest.mark.parametrize(
    ("keys", "value", "block"),
    [
        (("points", "x", 0), "a", "$.points"),
        (("points", "rays", 0), 2.5, "$.points"),
        (("points",), [], "$.points"),
        (("control", "strips", 1), ["b", 2], "$.control"),
        (("summary", "sigma0_um"), [1.0], "$.summary"),
        (("verdict", "verified"), 1, "$.verdict"),
        (("photostrip_result",), 1, "$.photostrip_result: 2 was expected"),
    ],
)
def test_an_edited_result_does_not_keep_the_schema(keys: tuple[str | int, ...], value: object, block: str) -> None:
    document = deepcopy(plain_of(case().document))
    part = document
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    (found,) = against_schema(document)
    assert found.startswith(block)


def test_every_key_has_a_meaning_and_every_number_a_unit() -> None:
    found = [each for block in (SCHEMA, *SCHEMA["$defs"].values()) for each in block["properties"].values()]
    values = [each if "description" in each else each["items"] for each in found if not {"$ref", "anyOf"} & each.keys()]
    assert len(values) > 400
    assert [each for each in values if not each["description"]] == []
    rows = result_page().splitlines()[2:]
    assert "| `points.sigma_x` | m | standard deviation of the coordinate |" in rows
    assert "| `points.x` | that of the frame | coordinate of the point; of several strips the mean |" in rows
    assert [row for row in nonempty(rows) if row.count(" | ") < 2] == []


@pytest.mark.slow
def test_the_schema_is_one_and_the_command_prints_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    VALIDATOR.check_schema(SCHEMA)
    assert main(["schema", "--result"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA
    assert main(["schema", "--result", "-o", str(tmp_path / "keys.md")]) == 0
    assert (tmp_path / "keys.md").read_text(encoding="utf-8") == result_page()


DEEP = "[" * 60 + "]" * 60


def refused(text: str) -> list[str]:
    """Give the keys for which a part of a result is refused."""
    try:
        read(json.loads(text), "result.json", lacking=described().keys())
    except InputError as error:
        return [fault.key for fault in error.faults]
    return []


@pytest.mark.parametrize(
    ("columns", "wrong"),
    [
        ('"id": ["lonely", "b"], "reason": ["c", null]', ""),
        ('"id": ["a", "b"], "reason": ["c"]', "reason"),
        ('"id": ["a"]', "reason"),
        ('"id": "a", "reason": []', "-"),
        ('"id": ["a", 7], "reason": ["c", "d"]', "id[1]"),
        ('"id": [["a"]], "reason": ["c"]', "id[0]"),
        ('"id": ["\\ud83d\\ude00"], "reason": ["\\ud83d"]', "reason[0]"),
        ('"id": ["a"], "reason": ["c"], "new": [[1, 2.5, true, "a", {"b": [null]}]]', ""),
        ('"id": ["a"], "reason": ["c"], "new": [["a", {"b": [Infinity]}]]', "new[0][1].b[0]"),
        ('"id": ["a"], "reason": ["c"], "\\udc00": [1]', "-"),
        (f'"id": ["a"], "reason": ["c"], "new": [{DEEP}]', "new[0]" + "[0]" * 51),
    ],
)
def test_columns_are_there_and_of_one_length(columns: str, wrong: str) -> None:
    found = refused(f'{{"not_determined": {{{columns}}}}}')
    assert found == ([f"not_determined.{wrong}".removesuffix(".-")] if wrong else [])


@pytest.mark.parametrize(
    ("column", "values", "right"),
    [
        ("value", "[9e99, 9e99, null, 3]", True),
        ("value", "[1e200]", False),
        ("value", "[1.0, NaN]", False),
        ("value", "[-Infinity, null]", False),
        ("passed", "[true, null]", True),
        ("passed", "[1, 0, null]", True),
        ("passed", "[1, 2]", False),
        ("name", "[1.0]", False),
    ],
)
def test_values_are_of_their_kind(column: str, values: str, right: bool) -> None:
    columns = dict.fromkeys(
        ("name", "value", "limit", "unit", "passed"), "[" + ", ".join(["null"] * len(json.loads(values))) + "]"
    )
    text = ", ".join(f'"{key}": {each}' for key, each in (columns | {column: values}).items())
    assert (refused(f'{{"tolerances": {{{text}}}}}') == []) is right


def test_counts_are_whole_numbers() -> None:
    for count, right in (("999999999999999", True), ("1000000000000001", False), ("2.0", False)):
        assert ("counts.photos" not in refused(f'{{"counts": {{"photos": {count}}}}}')) is right, count


@given(st.lists(st.text("ab-_. 0019\n\0é", max_size=6)))
@example(["P10", "P2", "p2", "7", "07", "a-1", "a1", "a", ""])
@example(["1" * 5000, "9", "line\nbreak", "P2"])
def test_the_rank_of_many_ids_is_the_order_of_the_keys_of_single_ones(names: list[str]) -> None:
    rank = natural_rank(tuple(names))
    assert sorted(names, key=natural) == [names[row] for row in rank.argsort()]


def test_rows_stand_by_number_then_by_rank() -> None:
    number, rank = np.random.default_rng(3).integers(0, 7, (2, 90))
    assert order_of(number, rank).tolist() == np.lexsort((rank, number)).tolist()
    assert order_of(number[:0], rank[:0]).tolist() == []


@given(st.floats(), st.integers(0, 12))
@example(-0.0, 2)
@example(-1e-9, 4)
@example(0.285, 2)
@example(1e308, 4)
def test_a_single_number_is_rounded_as_one_of_many(value: float, decimals: int) -> None:
    with np.errstate(over="ignore"):
        assert repr(rounded(value, decimals)) == repr(rounded([value], decimals)[0])


@given(st.lists(st.floats(), max_size=9), st.integers(1, 12))
@example([0.0, -0.0, 1e300, 5e-324, 999.96, 0.00012345, 2.5, -3.5, 1e23, float("nan"), -float("inf")], 4)
@example([2.5, -3.5, 0.25, 12345.0], 1)
def test_many_numbers_have_the_significant_digits_that_python_writes(values: list[float], digits: int) -> None:
    written = [float(f"{value:.{digits}g}") + 0.0 for value in values]  # 1.5e308 overflows
    expected = [value if np.isfinite(value) else None for value in written]
    assert repr(significant(values, digits)) == repr(expected)
