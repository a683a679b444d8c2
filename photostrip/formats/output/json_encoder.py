"""How values are written in JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from json.encoder import encode_basestring, encode_basestring_ascii
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from photostrip.result.numbers import Plain


class Encoder(NamedTuple):
    """How values are written, and texts in a tenth of that time."""

    value: Callable[[Plain], str]
    text: Callable[[str], str]


UNICODE = Encoder(json.JSONEncoder(ensure_ascii=False, allow_nan=False, default=list).encode, encode_basestring)
ASCII = Encoder(json.JSONEncoder(ensure_ascii=True, allow_nan=False, default=list).encode, encode_basestring_ascii)
