"""Given angles read in another unit or system: the reading that goes with the rotations found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.rotation import SYSTEMS, from_angles
from photostrip.notes import Finding
from photostrip.plausibility.finding import found

LEAST_PHOTOS = 3  # photos
HARMLESS_DEG = 0.3  # rms difference: start values need not be better
BETTER_SHARE = 0.25  # of the rms difference that another reading may leave
DEGREES, GONS = 180.0 / np.pi, 200.0 / np.pi
UNITS = (
    (DEGREES / GONS, "gons read as degrees"),
    (GONS / DEGREES, "degrees read as gons"),
    (DEGREES, "radians read as degrees"),
    (GONS, "radians read as gons"),
    (1 / DEGREES, "degrees read as radians"),
    (1 / GONS, "gons read as radians"),
)


def find_wrong_angles(
    angles: Floats, system: str, rotations: Floats, photos: Sequence[str], convergence: float = 0.0
) -> Iterator[Finding]:
    """Compare given angles with the rotations that the photos turned out to have.

    angles: (n, 3), given angles as they were read, radians, of the stated `system` (``geometry.rotation.SYSTEMS``).
    rotations: (n, 3, 3), rotations found, image axes to east, north, up.
    convergence: azimuth of grid north there, radians.
    Yields P601 or P602, at most one.
    """
    if len(photos) < LEAST_PHOTOS:
        return
    stated = _rms(from_angles(angles, system), rotations)
    best, text, code = stated, "", ""
    for other, what, kind in (*_readings(angles, system), _turned(angles, system, rotations, convergence)):
        left = _rms(other, rotations)
        if left < best:
            best, text, code = left, what, kind
    nothing = _rms(np.broadcast_to(np.eye(3), rotations.shape), rotations)
    # angles that are only scattered fit the better the smaller a unit makes them, and best as no angles at all
    expected = min(stated, nothing) if code == "P601" else stated
    if stated < HARMLESS_DEG or best > BETTER_SHARE * expected:
        return
    message = (
        f"the given angles of {len(photos)} photos differ from those found by {stated:.2f} degrees (rms); {text} they "
        f"differ by {best:.2f} degrees"
    )
    fix = "correct `orientations.angles`: unit, system, and the north that they count from"
    evidence = {"rms_as_stated_deg": stated, "rms_as_read_otherwise_deg": best, "photos": len(photos)}
    yield found(code, message, fix, evidence, photos=photos, key="orientations.angles")


def _rms(one: Floats, other: Floats) -> float:
    """Rms angle between rotations, degrees."""
    cosine = (np.einsum("nij,nij->n", one, other) - 1.0) / 2.0
    return float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1.0, 1.0)) ** 2))))


def _readings(angles: Floats, system: str) -> Iterator[tuple[Floats, str, str]]:
    """Give rotations under other readings, in words, with the code: other units first, then systems, senses, turns."""
    for factor, text in UNITS:
        yield from_angles(angles * factor, system), f"as {text.split(' read as ')[0]}", "P601"
    for other in SYSTEMS:
        if other != system:
            yield from_angles(angles, other), f"as {other}", "P602"
    for signs in product((1.0, -1.0), repeat=3):
        if signs != (1.0, 1.0, 1.0):
            names = [name for name, sign in zip(system.split("-"), signs, strict=True) if sign < 0]
            yield from_angles(angles * signs, system), f"with {' and '.join(names)} of the other sign", "P602"
    for turn in (90.0, 180.0, 270.0):
        changed = angles + np.radians([0.0, 0.0, turn])
        yield from_angles(changed, system), f"with kappa larger by {turn:.0f} degrees", "P602"
    yield from_angles(angles, system).transpose(0, 2, 1), "as rotations from object to image", "P602"


def _turned(angles: Floats, system: str, rotations: Floats, convergence: float) -> tuple[Floats, str, str]:
    """Turn all photos about the vertical by the angle that goes best with the rotations found."""
    stated = from_angles(angles, system)
    together = np.einsum("nij,nkj->ik", rotations, stated)
    turn = float(np.arctan2(together[1, 0] - together[0, 1], together[0, 0] + together[1, 1]))
    text = f"turned about the vertical by {np.degrees(turn):+.2f} degrees"
    if convergence:
        text += f" (grid north lies {np.degrees(convergence):+.2f} degrees from true north there)"
    return from_angles(np.array([[0.0, 0.0, turn]]), system) @ stated, text, "P602"
