"""Absolute orientation (being written)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """How the strip is brought to the ground.

    Parameters
    ----------
    earth_curvature : str
        ``"auto"`` or ``"none"``: the frames carry it; ``"model"``: eq. 153, for plane map coordinates of unknown
        projection given as ``local``; ``"image"``: in image space.
    earth_radius : float
        Radius in metres for ``"model"``.
    """

    earth_curvature: str = "auto"
    earth_radius: float = 6_371_000.0
