"""Given angles read in another unit or system: the reading that goes with the rotations found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.rotation import SYSTEMS, about, from_angles
from photostrip.notes import Finding
from photostrip.plausibility.finding import found

LEAST_PHOTOS = 3  # photos
HARMLESS_DEG = 0.3  # rms difference: start values need not be better
BETTER_SHARE = 0.25  # of the rms difference that another reading may leave
Reading = tuple[Floats, str, str]  # rotations, how they are read in words, code
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
    stated = from_angles(angles, system)
    readings = [*_readings(angles, system), _transposed(stated)]
    if system == "yaw-pitch-roll":
        readings += _mounted(stated)
    yield from _misread(stated, readings, rotations, photos, convergence)


def find_wrong_rotations(
    stated: Floats, rotations: Floats, photos: Sequence[str], convergence: float = 0.0
) -> Iterator[Finding]:
    """Compare given rotations (n, 3, 3) that are no angles with those found, as ``find_wrong_angles`` does."""
    other_y = stated * np.array([1.0, -1.0, -1.0]), "with image axes of which y has the other direction", "P602"
    yield from _misread(stated, [_transposed(stated), other_y, *_mounted(stated)], rotations, photos, convergence)


def _misread(
    as_stated: Floats, readings: Sequence[Reading], rotations: Floats, photos: Sequence[str], convergence: float
) -> Iterator[Finding]:
    if len(photos) < LEAST_PHOTOS:
        return
    stated = _rms(as_stated, rotations)
    best, text, code = stated, "", ""
    for other, what, kind in (*readings, _turned(as_stated, rotations, convergence)):
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


def _transposed(stated: Floats) -> Reading:
    return stated.transpose(0, 2, 1), "as rotations from object to image", "P602"


def _mounted(stated: Floats) -> Iterator[Reading]:
    """Give the rotations of a camera that is mounted otherwise."""
    for turn, where in ((np.pi / 2.0, "ahead"), (-np.pi / 2.0, "down")):
        yield stated @ about(0, turn), f"of a camera that looks {where} where pitch and roll are zero", "P602"


def _readings(angles: Floats, system: str) -> Iterator[Reading]:
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
    about_view = "yaw" if system.startswith("yaw") else "kappa"
    for turn in (90.0, 180.0, 270.0):
        changed = angles + np.radians([turn if name == about_view else 0.0 for name in system.split("-")])
        yield from_angles(changed, system), f"with {about_view} larger by {turn:.0f} degrees", "P602"


def _turned(stated: Floats, rotations: Floats, convergence: float) -> Reading:
    """Turn all photos about the vertical by the angle that goes best with the rotations found."""
    together = np.einsum("nij,nkj->ik", rotations, stated)
    turn = float(np.arctan2(together[1, 0] - together[0, 1], together[0, 0] + together[1, 1]))
    text = f"turned about the vertical by {np.degrees(turn):+.2f} degrees"
    if convergence:
        text += f" (grid north lies {np.degrees(convergence):+.2f} degrees from true north there)"
    return about(2, turn) @ stated, text, "P602"
