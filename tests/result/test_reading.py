"""What is read again: looked at together and one by one, the same is refused."""

from __future__ import annotations

import json
from random import Random

import pytest

from photostrip.result.description import described
from photostrip.result.reading import _blocks_right, _wrong
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
