"""Terrestrial photogrammetry: directions of a phototheodolite [002], displacements by pseudo-parallaxes [004c].

In come image coordinates (x, z) and directions to points; out go the orientation of a photo (``orientation``), the
accuracy that directions must have (``accuracy``, also of displacements, beforehand), and displacements between epochs
with their tests: ``normal_case`` holds the geometry, brings two photos of any orientation to the normal case and
compares two epochs, ``camera_motion`` finds cameras that turned, also with photos of one station, ``monitoring`` walks
through all of it to a time series.
"""

from __future__ import annotations

from typing import Literal

TerrestrialKind = Literal[
    "directions", "photo", "accuracy", "theodolite", "orientation", "displacement", "one-station", "cameras"
]
