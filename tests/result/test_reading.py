"""What is read again: every value of its kind, every table with its columns of one length."""

from __future__ import annotations

import json

import pytest

from photostrip.errors import InputError
from photostrip.result.description import described
from photostrip.result.reading import read

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


@pytest.mark.parametrize(("count", "right"), [("999999999999999", True), ("1000000000000001", False), ("2.0", False)])
def test_counts_are_whole_numbers(count: str, right: bool) -> None:
    assert ("counts.photos" not in refused(f'{{"counts": {{"photos": {count}}}}}')) is right


def test_a_whole_result_has_every_block() -> None:
    with pytest.raises(InputError) as caught:
        read({"name": "a"}, "result.json")
    assert {"version", "status", "verdict"} <= {fault.key for fault in caught.value.faults}
