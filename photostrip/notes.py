"""What a run has to say beside its numbers: warnings and remarks, each with a stable code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

Document = dict[str, Any]  # of a result, a plan, a comparison: plain values, as JSON has them

MOST_NAMED = 8  # ids in one message
LOST_SAY = (  # codes of warnings on what was given and lost its say, in the order of importance
    "control-lost",
    "control-rejected",
    "control-image",
    "control-measured-once",
    "given-ray",
    "given-residual",
    "check-lost",
    "position-rejected",
)


@dataclass(frozen=True)
class Note:
    """One thing the surveyor should know."""

    code: str  # stable short name of the kind of note
    message: str  # the whole sentence, with ids, numbers and units
    severity: str = "warning"  # ``"warning"`` or ``"note"``
    strip: str = ""  # strip concerned; empty for the whole project
    photos: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    file: str = ""  # file in which the cause stands; empty when there is none
    # line, column: where it stands, counted from 1; 0 when unknown
    line: int = 0
    column: int = 0
    key: str = ""  # path of the key in the project file, or name of the table column

    def __str__(self) -> str:
        """Return the one-line form ``file:line:column: what``."""
        return before(self.file, self.line, self.column) + self.message


def before(file: str, line: int, column: int) -> str:
    """Return the place that stands before a message: ``file:line:column: ``; empty when there is none."""
    place = file + "".join(f":{number}" for number in (line, column) if file and number)
    return f"{place}: " if place else ""


def listed(names: Iterable[str], most: int = MOST_NAMED) -> str:
    """Name the first of many, and say how many more there are: ``A1, A2 and 7 more``."""
    every = list(names)
    head = ", ".join(every[:most])
    return head if len(every) <= most else f"{head} and {len(every) - most} more"


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun: ``1 photo``, ``2 photos``."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def named(noun: str, names: Sequence[str], most: int = MOST_NAMED) -> str:
    """Name the first of many by what they are: ``points 1, 2 and 7 more``."""
    return f"{noun}{'s' if len(names) > 1 else ''} {listed(names, most)}"


def given_in_pixels(document: Document) -> dict[str, float]:
    """Return the sizes (mm) that pixels have in a result, of the cameras that the project gives in pixels."""
    return {each["id"]: each["pixel_size_mm"] for each in document["cameras"] if each.get("unit") == "px"}


def in_pixels(parameter: Document, pixel: float) -> Document:
    """Return a parameter of a calibration, which is in a power of millimetres, in that of pixels of a size (mm)."""
    unit = parameter["unit"]
    power = 0 if unit == "1" else int(unit.partition("^")[2] or 1)
    known = {key: parameter.get(key) for key in ("given", "adjusted", "value", "sigma")}
    scaled = {key: value / pixel**power for key, value in known.items() if value is not None}
    return {**parameter, **scaled, "unit": unit.replace("mm", "px")}


@dataclass(frozen=True)
class Finding:
    """One mistake that the data seem to have; see ``plausibility``."""

    code: str  # its kind, for example ``"P101"``
    title: str  # what kind of mistake that is, in a few words
    severity: str  # ``"error"``: a result made from such data is wrong as a whole; ``"warning"``: some of it may be
    message: str  # what was found, with ids, numbers and units
    fix: str
    # the numbers behind it; names end with the unit
    evidence: Mapping[str, float | int | str] = field(default_factory=dict)
    photos: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    strips: tuple[str, ...] = ()
    key: str = ""  # path of the key in the project file that would be changed; empty when the mistake is in a table
    accepted: bool = False  # whether the user has accepted it
    file: str = ""  # file in which it would be put right; empty when it is not known
    # line, column: where in it, counted from 1; 0 when unknown
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
