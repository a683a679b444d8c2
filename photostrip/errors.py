"""Everything photostrip can refuse, and with which exit code.

The tree::

    PhotostripError                exit 70  an internal error, a bug, unless a branch below says otherwise
    ├── InputError                 exit  2  wrong usage, project file or data; carries every fault found
    └── GeometryError              exit  3  too weak, singular or not converging; names photos and points

Readers collect faults and raise one ``InputError`` for all of them; mathematics raises ``GeometryError``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from photostrip.notes import before

if TYPE_CHECKING:
    from photostrip.notes import Finding

EXIT_DONE = 0
EXIT_TOLERANCE = 1
EXIT_INPUT = 2
EXIT_GEOMETRY = 3
EXIT_INTERNAL = 70


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with an input, and where."""

    message: str  # what is wrong, in the surveyor's words, with ids of photos and points
    code: str = "input"  # stable short name of the kind of fault, for example ``"unknown-key"``
    file: str = ""  # file as the user named it; empty when the fault is not in a file
    # line, column: position, counted from 1; 0 when unknown
    line: int = 0
    column: int = 0
    key: str = ""  # path of the key in the project file (``cameras.RC30.format``) or name of the table column
    expected: str = ""
    fix: str = ""
    points: tuple[str, ...] = ()  # points concerned

    def __str__(self) -> str:
        """Return the one-line form ``file:line:column: key: what, expected, fix``."""
        text = before(self.file, self.line, self.column) + (f"{self.key}: " if self.key else "") + self.message
        if self.expected:
            text += f"; expected {self.expected}"
        if self.fix:
            text += f"; {self.fix}"
        return text


class PhotostripError(Exception):
    """Root of all errors photostrip raises on purpose."""

    exit_code = EXIT_INTERNAL
    findings: tuple[Finding, ...] = ()
    """What the data say against themselves: mistakes that may be the cause."""


class InputError(PhotostripError):
    """Wrong usage, project file or data, with every fault found; a plain text becomes a fault without a place."""

    exit_code = EXIT_INPUT

    def __init__(self, faults: Fault | str | Iterable[Fault]) -> None:
        if isinstance(faults, str):
            faults = Fault(faults)
        self.faults: tuple[Fault, ...] = (faults,) if isinstance(faults, Fault) else tuple(faults)
        """All of them: message, code, file, line, column, key, expected, fix, points."""
        super().__init__("\n".join(map(str, self.faults)))


class GeometryError(PhotostripError):
    """The geometry is too weak, singular, or the solution did not converge; it names photos and points."""

    exit_code = EXIT_GEOMETRY

    def __init__(
        self,
        message: str,
        *,
        photos: Iterable[str] = (),
        points: Iterable[str] = (),
        code: str = "geometry",
    ) -> None:
        super().__init__(message)
        self.photos = tuple(photos)
        """Photos concerned."""
        self.points = tuple(points)
        """Points concerned."""
        self.code = code
        """Stable short name of the kind."""
