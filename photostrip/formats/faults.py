"""What is found while files are read: faults that stop the run, notes that do not; texts that are no numbers."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Literal
from unicodedata import is_normalized, normalize
from unicodedata import name as unicode_name

from photostrip.errors import Fault, InputError
from photostrip.notes import Note

# of Unicode: a letter with its accent, or both after each other
FORMS: tuple[Literal["NFC"], Literal["NFD"]] = ("NFC", "NFD")
MOST_FAULTS_KEPT = 200  # faults kept of one file; a wrong export has one in every row


@dataclass
class Findings:
    """Faults of all files of a project, and notes about them."""

    notes: list[Note] = field(default_factory=list)
    _faults: list[Fault] = field(default_factory=list)
    _count: Counter[str] = field(default_factory=Counter)

    def meet(self, file: str) -> None:
        """Remember that a file is read now: faults are reported in the order in which files were read."""
        self._count[file] += 0

    def add(self, *faults: Fault) -> None:
        """Keep faults; of a file that has too many they are only counted."""
        for fault in faults:
            if not self.full(fault.file):
                self._faults.append(fault)
            self._count[fault.file] += 1

    def full(self, file: str) -> bool:
        """Whether further faults of a file are only counted, so that their texts need not be made."""
        return self._count[file] >= MOST_FAULTS_KEPT

    def number(self, file: str) -> int:
        return self._count[file]

    def count(self, file: str, number: int) -> None:
        """Count faults of a full file without making them."""
        self._count[file] += number

    def absorb(self, other: Findings, place: Callable[[Fault], Fault]) -> None:
        """Take over the faults of another collection, each with the place that `place` gives it."""
        kept = Counter(fault.file for fault in other._faults)
        self.add(*map(place, other._faults))
        for file, number in other._count.items():
            self._count[file] += number - kept[file]

    @property
    def faults(self) -> tuple[Fault, ...]:
        """All faults, file by file in the order the files were met, each by line; what was only counted comes last."""
        order = {file: number for number, file in enumerate(self._count)}
        found = sorted(self._faults, key=lambda fault: (order[fault.file], fault.line, fault.column))
        rest = [
            Fault(f"and {count - MOST_FAULTS_KEPT} more faults in this file", code="more", file=file)
            for file, count in self._count.items()
            if count > MOST_FAULTS_KEPT
        ]
        return (*found, *rest)

    def stop(self) -> None:
        """Raise one error for all faults, if there are any."""
        if self._faults:
            raise InputError(self.faults)


def suggestion(name: str, known: Iterable[str]) -> str:
    """Ask whether a similar known name was meant, ``did you mean `...`?``; empty when nothing is similar.

    Names with other letters and another number, as photos of two flights, are not similar but for a single character.
    """
    from difflib import get_close_matches  # takes a millisecond to load, and is needed where a name is not known

    names = list(known)
    wanted, folded = _folded(name), {_folded(each): each for each in reversed(names)}
    close = get_close_matches(wanted, [each for each in folded if _alike(wanted, each)], n=1, cutoff=0.65)
    return meant(name, folded[close[0]]) if close else ""


def meant(name: str, other: str) -> str:
    """Ask whether another name was meant; of names that look the same, say what they differ in."""
    return f"did you mean `{other}`?{_unseen(name, other)}"


def _alike(one: str, other: str) -> bool:
    """Whether names have the same number, O read as 0, or letters, differ in a character, or are part of each other."""
    numbers, letters = ([re.sub(part, "", each) for each in (one, other)] for part in (r"\D", r"\d"))
    read = [re.sub(r"\D", "", each.replace("o", "0")) for each in (one, other)]
    slip = len(one) == len(other) and sum(a != b for a, b in zip(one, other, strict=True)) == 1
    alike = any(first == second for first, second in (numbers, letters, read))
    return alike or slip or not all(numbers) or one in other or other in one


def _folded(name: str) -> str:
    return normalize("NFC", name).casefold()


def _unseen(one: str, other: str) -> str:
    """Return in which Unicode forms a name is written, or which letters are of different alphabets."""
    if normalize("NFC", one) == normalize("NFC", other):
        here, there = (
            next((form for form in FORMS if is_normalized(form, each)), "of both forms") for each in (one, other)
        )
        return f" it looks the same, but is {there} in Unicode, and here {here}"
    if len(one) == len(other):
        for here, there in zip(one, other, strict=True):
            alphabets = _alphabet(here), _alphabet(there)
            if all(alphabets) and alphabets[0] != alphabets[1]:
                return f" its `{there}` is {alphabets[1]}, and here `{here}` is {alphabets[0]}"
    return ""


def _alphabet(letter: str) -> str:
    """Return the alphabet of a letter, as Latin or Cyrillic."""
    return unicode_name(letter, "").partition(" ")[0].capitalize() if letter.isalpha() else ""


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
