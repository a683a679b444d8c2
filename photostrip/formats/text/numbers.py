"""Numbers as users write them: what counts as one, and in words what is wrong with a text that does not."""

from __future__ import annotations

import re
import unicodedata

LARGEST_NUMBER = 1e15  # no coordinate in any unit is larger, and its square is still a number
SMALLEST_LENGTH = 1e-12  # no length, and no standard deviation in any unit, is smaller
NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+")
_GROUPED = re.compile(r"[+-]?[0-9]{1,3}(?:[ '’_\u00a0\u202f][0-9]{3})+(?:\.[0-9]*)?")
_WITH_UNIT = re.compile(rf"({NUMBER.pattern})\s*([^\W\d_]+|%|°)")
_SEXAGESIMAL = re.compile(r"[+-]?[0-9]+[°: ][0-9]+(?:['′: ].*)?")
_NOT_FINITE = {"nan", "inf", "infinity"}
_MINUS_SIGNS = "−–—"


class NotANumber(ValueError):  # noqa: N818 (the name of what it says)
    """A text that is not a number."""

    def __init__(self, message: str, fix: str = "") -> None:
        super().__init__(message)
        self.message, self.fix = message, fix


def number(text: str, decimal: str = ".") -> float:
    """Read a decimal number of at most 15 digits before the point; blanks around it do not count.

    decimal: what stands before the decimals, a point or a comma.

    Raises NotANumber for anything else, also for ``nan``, ``1_000``, full-width digits and the other decimal sign.
    """
    word = text.strip()
    if decimal != ".":
        if "." in word:
            raise NotANumber(f"`{shown(word)}` has a point in a table with decimal commas", "write a decimal comma")
        word = word.replace(decimal, ".")
    if NUMBER.fullmatch(word):
        value = float(word)
        if abs(value) <= LARGEST_NUMBER:
            return value
        raise NotANumber(f"`{shown(word)}` is too large")
    raise _reason(word)


def _reason(word: str) -> NotANumber:
    plain = "".join(map(_ascii, unicodedata.normalize("NFKC", word)))
    unit = _WITH_UNIT.fullmatch(word)
    what, fix = "is not a number", ""
    if not word:
        return NotANumber("no value is given")
    if word.lstrip("+-").casefold() in _NOT_FINITE:
        what = "is not a measured value"
    elif _GROUPED.fullmatch(word):
        what, fix = "has digits in groups", "write the digits without separators"
    elif DECIMAL_COMMA.fullmatch(word):
        what, fix = "has a decimal comma", f"write {word.replace(',', '.')}"
    elif plain != word and NUMBER.fullmatch(plain):
        what, fix = "is not written with ASCII characters", f"write {plain}"
    elif NUMBER.fullmatch(word.replace("_", "")):
        what, fix = "has an underscore in it", f"write {word.replace('_', '')}"
    elif _SEXAGESIMAL.fullmatch(word):
        what, fix = "is not one number", "write decimal degrees"
    elif unit:
        what, fix = "has a unit in it", f"write the number alone: {unit[1]}"
    return NotANumber(f"`{shown(word)}` {what}", fix)


def _ascii(character: str) -> str:
    """Return the ASCII form of a digit of any script, and of a minus sign."""
    digit = unicodedata.decimal(character, None)
    return str(digit) if digit is not None else "-" if character in _MINUS_SIGNS else character


def shown(text: str, limit: int = 40) -> str:
    """Return a text as it can stand in a message: on one line, not too long, what does not print as its escape."""
    visible = "".join(
        c if c.isprintable() or unicodedata.category(c) == "Cf" else repr(c)[1:-1] for c in text[: limit + 1]
    )
    return visible if len(text) <= limit else f"{visible[:limit]}…"
