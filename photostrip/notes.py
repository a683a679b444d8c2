"""What a run has to say beside its numbers: warnings and remarks, each with a stable code.

A ``Note`` says what was noticed. A ``Finding`` says that the data themselves seem to be wrong, with the
numbers that say so.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True)
class Note:
    """One thing the surveyor should know.

    Parameters
    ----------
    code : str
        Stable short name of the kind of note.
    message : str
        The whole sentence, with ids, numbers and units.
    severity : str
        ``"warning"`` or ``"note"``.
    strip : str
        Strip concerned; empty for the whole project.
    file : str
        File in which the cause stands; empty when there is none.
    line, column : int
        Where it stands, counted from 1; 0 when unknown.
    key : str
        Path of the key in the project file, or name of the table column.
    """

    code: str
    message: str
    severity: str = "warning"
    strip: str = ""
    photos: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    file: str = ""
    line: int = 0
    column: int = 0
    key: str = ""

    def __str__(self) -> str:
        """Return the one-line form ``file:line:column: what``."""
        return before(self.file, self.line, self.column) + self.message


def before(file: str, line: int, column: int) -> str:
    """Return the place that stands before a message: ``file:line:column: ``; empty when there is none."""
    place = file + "".join(f":{number}" for number in (line, column) if file and number)
    return f"{place}: " if place else ""


@dataclass(frozen=True)
class Finding:
    """One mistake that the data seem to have; see ``plausibility``.

    Parameters
    ----------
    code : str
        Its kind, for example ``"P101"``.
    title : str
        What kind of mistake that is, in a few words.
    severity : str
        ``"error"``: a result made from such data is wrong as a whole; ``"warning"``: some of it may be.
    message : str
        What was found, with ids, numbers and units.
    evidence : mapping of str to float, int or str
        The numbers behind it; names end with the unit.
    key : str
        Path of the key in the project file that would be changed; empty when the mistake is in a table.
    accepted : bool
        Whether the user has accepted it.
    file : str
        File in which it would be put right; empty when it is not known.
    line, column : int
        Where in it, counted from 1; 0 when unknown.
    """

    code: str
    title: str
    severity: str
    message: str
    fix: str
    evidence: Mapping[str, float | int | str] = field(default_factory=dict)
    photos: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    strips: tuple[str, ...] = ()
    key: str = ""
    accepted: bool = False
    file: str = ""
    line: int = 0
    column: int = 0

    @property
    def is_error(self) -> bool:
        """Whether it stands against the whole result and is not accepted."""
        return self.severity == "error" and not self.accepted

    @property
    def names(self) -> frozenset[str]:
        """Ids under which it can be accepted: its photos, points and strips."""
        return frozenset((*self.photos, *self.points, *self.strips))
