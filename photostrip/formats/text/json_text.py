"""JSON that another program wrote: unpacked, and refused where it does not say one thing only."""

from __future__ import annotations

import json
from typing import Any, NoReturn

from photostrip.errors import Fault, InputError
from photostrip.formats.text.files import decode, refuse
from photostrip.formats.text.numbers import shown
from photostrip.formats.text.table_text import unpacked


class _NoJsonError(ValueError):
    pass


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise _NoJsonError(f"`{shown(twice)}` stands twice in a block")
    return found


def _no_constant(word: str) -> NoReturn:
    raise _NoJsonError(f"{word} in it is no number")


def read_json(file: str) -> Any:  # noqa: ANN401 (any JSON)
    """Read a file of JSON, which may be packed.

    Raises InputError for all that is none, for a name that stands twice in a block, and for what is no number.
    """
    text, _ = decode(file, unpacked(file))
    try:
        return json.loads(text, object_pairs_hook=_once, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        message = f"is not JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        fault = Fault(message, code="foreign", file=file, line=error.lineno, column=error.colno)
        raise InputError(fault) from None
    except RecursionError:
        refuse(file, "foreign", "is nested too deeply")
    except ValueError as error:  # Python reads 4300 digits
        refuse(
            file,
            "foreign",
            str(error) if isinstance(error, _NoJsonError) else "holds a number with thousands of digits",
        )
