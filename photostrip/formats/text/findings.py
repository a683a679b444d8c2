"""What is found while files are read: faults that stop the run, notes that do not."""

from __future__ import annotations

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
    """Ask whether a similar known name was meant, ``did you mean `...`?``; empty when nothing is similar."""
    from difflib import get_close_matches  # takes a millisecond to load, and is needed where a name is not known

    names = list(known)
    folded = {_folded(each): each for each in reversed(names)}
    close = get_close_matches(_folded(name), list(folded), n=1, cutoff=0.65)
    return meant(name, folded[close[0]]) if close else ""


def meant(name: str, other: str) -> str:
    """Ask whether another name was meant; of names that look the same, say what they differ in."""
    return f"did you mean `{other}`?{_unseen(name, other)}"


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
