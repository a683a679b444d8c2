"""Strip polynomials (being written)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Which polynomial takes out the strip deformation.

    Parameters
    ----------
    degree : str
        ``"auto"``, ``"1"``, ``"2"`` or ``"3"``.
    """

    degree: str = "auto"
