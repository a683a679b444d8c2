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
    """

    code: str
    message: str
    severity: str = "warning"
    strip: str = ""
    photos: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
