"""What goes to a worker and what comes back: plain values that travel between processes and machines."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from photostrip.notes import Document

if TYPE_CHECKING:
    from photostrip.batch.parcel import Parcel


@dataclass(frozen=True)
class Task:
    """One project to be computed."""

    number: int
    project: str  # path of the project file as the user knows it
    overrides: tuple[str, ...] = ()
    html: bool = False  # whether its report is wanted as a page, too
    parcel: Parcel | None = None  # its files, when it goes to another machine; None: they are read from the disk


@dataclass(frozen=True)
class Answer:
    """What became of a project."""

    number: int
    outcome: Document  # its line in the summary, see ``outcomes``
    files: dict[str, str | bytes] = field(
        default_factory=dict
    )  # content of its result files by name; none after a failure
    # SHA-256 of every file read, by path; None for a file that would have been read if it were there
    inputs: dict[str, str | None] = field(default_factory=dict)
    trace: str = ""


@dataclass(frozen=True)
class Limits:
    """What one project may use."""

    seconds: float | None = None  # time; None: any
    megabytes: float | None = None  # memory of the worker that computes it; None: an even share of the machine's memory
