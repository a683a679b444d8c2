"""What is found while files are read: faults that stop the run, notes that do not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from photostrip.errors import Fault, InputError
from photostrip.notes import Note

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
    folded = {each.casefold(): each for each in reversed(names)}
    close = get_close_matches(name.casefold(), list(folded), n=1, cutoff=0.65)
    return f"did you mean `{folded[close[0]]}`?" if close else ""
