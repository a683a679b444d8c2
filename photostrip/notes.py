"""What a run has to say beside its numbers: warnings and remarks, each with a stable code."""

from __future__ import annotations

from dataclasses import dataclass


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
    photos, points : tuple of str
        Ids concerned.
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
        """Give the one-line form ``file:line:column: what``."""
        return before(self.file, self.line, self.column) + self.message


def before(file: str, line: int, column: int) -> str:
    """Give the place that stands before a message: ``file:line:column: ``; empty when there is none."""
    place = file + "".join(f":{number}" for number in (line, column) if file and number)
    return f"{place}: " if place else ""
