"""What is read again: looked at together and one by one, the same is refused."""

from __future__ import annotations

import json
import pickle
import re
from copy import deepcopy
from random import Random

import pytest

from photostrip.errors import InputError
from photostrip.result.description import described
from photostrip.result.reading import _blocks_right, _wrong, located
from tests.edited_results import edited
from tests.reports import saved

EDITS = 120
MANY_DIGITS = "9" * 5000  # are refused when the file is read
DEEP = "[" * 60 + "]" * 60


def looks_right(text: str) -> bool:
    """Whether a document is right, looked at together; one by one it has to be the same."""
    document = json.loads(text)
    found = _blocks_right([document], described())
    assert found == (next(_wrong(document, described(), ""), None) is None), text[:200]
    return found


def test_columns_of_edited_results_are_right_where_their_values_are() -> None:
    texts = [edited(saved(), Random(number)).text for number in range(EDITS)]
    found = [looks_right(text) for text in texts if text.startswith("{") and MANY_DIGITS not in text]
    assert 0.1 * EDITS < sum(found) < 0.9 * len(found)


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ('{"points": [{"id": "a", "x": 1.0}, {"id": "b", "x": null}, {"x": 2, "id": "c"}, {}]}', True),
        ('{"points": [{"x": 1.0}, null]}', False),
        ('{"points": [{"x": 1.0}, [{"x": 1.0}]]}', False),
        ('{"points": [{"x": 1e200}, {"x": -1e200}]}', False),
        ('{"points": [{"x": 9e99}, {"x": 9e99}]}', True),
        ('{"points": [{"x": NaN}, {"x": 1.0}]}', False),
        ('{"points": [{"rays": 3}, {"rays": 0.0}]}', False),
        ('{"points": [{"rays": 0.0}, {"rays": 0.0}]}', False),
        ('{"points": [{"rays": 999999999999999}, {"rays": 999999999999999}]}', True),
        ('{"points": [{"rays": true}]}', False),
        ('{"points": [{"id": "\\ud83d\\ude00"}, {"id": "\\ud83d"}]}', False),
        ('{"points": [{"id": "\\ud83d\\ude00"}, {"id": ""}]}', True),
        ('{"points": [{"id": []}, {"id": null}]}', False),
        ('{"control": [{"measured": true}, {"measured": null}]}', True),
        ('{"control": [{"measured": true}, {"measured": 1}]}', False),
        ('{"control": [{"measured": true, "dx": 1.0}, {"dx": 1.0, "measured": true}]}', True),
        ('{"control": [{"measured": true, "dx": 1.0}, {"dx": true, "measured": 1.0}]}', False),
        ('{"control": [{"dx": 1.0, "dy": 1.0}, {"dx": 1.0}, {"dy": true}]}', False),
        ('{"control": [{"dx": 1.0}, {"dx": false}]}', False),
        ('{"points": [{"x": -Infinity}, {"x": NaN}, {"x": null}]}', False),
        ('{"points": [{"rays": 1000000000000001}, {"rays": 1}]}', False),
        ('{"points": [{}, {}]}', True),
        ('{"points": [[], [{"x": 1.0}]]}', False),
        ('{"photos": [{"rotation": []}, {"rotation": []}]}', True),
        ('{"photos": [{"rotation": []}, {"rotation": 1.0}]}', False),
        ('{"photos": [{"rotation": [1.0, null]}, {"rotation": []}]}', True),
        ('{"photos": [{"rotation": [[1.0], [2.0]]}]}', True),
        ('{"photos": [{"rotation": [[1.0], ["2"]]}]}', False),
        ('{"photos": [{"new": [1, 2.5, true, "a", {"b": [null]}]}]}', True),
        ('{"photos": [{"new": ["a", {"b": [Infinity]}]}]}', False),
        ('{"photos": [{"new": "a", "\\udc00": 1}]}', False),
        (f'{{"photos": [{{"new": {DEEP}}}]}}', False),
    ],
)
def test_columns_are_right_where_their_values_are(text: str, right: bool) -> None:
    assert looks_right(text) is right


def test_a_key_that_is_missing_is_told_after_a_copy_too() -> None:
    document = located(
        lambda block: json.loads('{"summary": {"check": {}}, "points": [{"x": 1.0}]}', object_hook=block), "one.json"
    )
    other = located(lambda block: json.loads('{"check": {}}', object_hook=block), "other.json")
    for found in (document, deepcopy(document), pickle.loads(pickle.dumps(document))):  # noqa: S301 (our own)
        assert found == document
        for block, path in ((found["summary"]["check"], "summary.check.rms"), (found["points"][0], "points[0].rms")):
            with pytest.raises(InputError, match=rf"one\.json: key '{re.escape(path)}' is missing"):
                block["rms"]
    with pytest.raises(InputError, match=r"other\.json: key 'check\.rms'"):  # each document has blocks of its own
        other["check"]["rms"]
    assert type(deepcopy(document["points"])[0]) is dict
