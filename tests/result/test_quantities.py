"""The description of the result: every key of every result is in it, written as it says, and stands in the manual."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from photostrip.formats.result_json import checked, read_baseline, to_json
from photostrip.pipeline.inputs import Settings
from photostrip.result.description import LEFT_OUT, Block, Quantity, described
from photostrip.result.numbers import rounded_as
from photostrip.result.table import Table, plain_of
from photostrip.simulation import Models, simulate
from tests.renew_golden import SAMPLES, baseline
from tests.results import case, solved, spec
from tests.simulated import inputs_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator

    Document = dict[str, Any]

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


@pytest.mark.parametrize("name", SAMPLES)
def test_every_key_of_a_sample_is_described(name: str) -> None:
    assert faults(read_baseline(str(baseline(name)))) == set()


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_every_key_of_a_result_is_described(adjustment: str) -> None:
    assert faults(solved(case("projected", 2).inputs, Settings(adjustment=adjustment)).document) == set()


def test_every_key_of_independent_models_is_described() -> None:
    assert faults(solved(inputs_of(simulate(replace(spec(), models=Models())))).document) == set()


@pytest.mark.parametrize("frame", ["geographic", "geocentric", "local"])
def test_coordinates_are_described_in_every_frame(frame: str) -> None:
    assert faults(case(frame).document) == set()


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


# ------------------------------------------------------------------------------------------------------- tables


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
