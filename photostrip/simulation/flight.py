"""The photos: where they are taken and in which attitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.ground import World
from photostrip.simulation.spec import Spec

CUT_SIGMAS = 3.0  # standard deviations beyond which no photo is displaced or tilted: a pilot would fly again
BASE_SCATTER = (0.02, 0.02, 0.01)  # of the base: along, across, height


@dataclass(frozen=True, eq=False)
class Photos:
    """The true exterior orientations, strip after strip, each in flight order."""

    ids: tuple[str, ...]
    strips: tuple[tuple[str, tuple[str, ...]], ...]  # each strip's id and its photos in flight order
    # along, across, height: (n,): places of the perspective centres from the middle of the strips and heights above the
    # ellipsoid, metres
    along: Floats
    across: Floats
    height: Floats
    centers: Floats  # (n, 3): perspective centres in the Cartesian frame, metres
    rotations: Floats  # (n, 3, 3): rotations that take image axes to the Cartesian frame
    up: Floats  # (n, 3): the vertical at the perspective centres, in the Cartesian frame


def strip_id(number: int) -> str:
    """Letter or letters of a strip, counted from 0: A to Z, then AA, AB and so on."""
    head, last = divmod(number, 26)
    return (strip_id(head - 1) if head else "") + chr(ord("A") + last)


def position_sigma(spec: Spec) -> tuple[float, float, float]:
    """Scatter of the perspective centres along, across and in height: standard deviations, metres."""
    if spec.flight.position_sigma is not None:
        return spec.flight.position_sigma
    along, across, height = (part * spec.base for part in BASE_SCATTER)
    return along, across, height


def fly(spec: Spec, space: World) -> Photos:
    """Take the photos of all strips; ids are the number of the strip and the number of the photo in flight order.

    Draws (`Purpose.FLIGHT`): for each photo along, across, height, alpha, omega, kappa.
    """
    flight = spec.flight
    n, strips = flight.photos, flight.strips
    scatter = np.clip(Draws(spec.seed, Purpose.FLIGHT).normal(strips, n, 6), -CUT_SIGMAS, CUT_SIGMAS)
    sigma = position_sigma(spec)
    back = np.arange(strips) % 2 == 1 if flight.alternate else np.zeros(strips, dtype=bool)
    sign = np.where(back, -1.0, 1.0)[:, None]
    along = sign * (np.arange(n) - (n - 1) / 2) * spec.base + sigma[0] * scatter[..., 0]
    across = (np.arange(strips)[:, None] - (strips - 1) / 2) * spec.strip_distance + sigma[1] * scatter[..., 1]
    height = spec.terrain.height + spec.flying_height + sigma[2] * scatter[..., 2]
    tilt = np.radians(flight.attitude_sigma_deg) * scatter[..., 3:]
    kappa = tilt[..., 2] + np.radians(flight.photo_rotation_deg) + np.pi * back[:, None]
    attitude = from_alpha_omega_kappa(sign * tilt[..., 0], sign * tilt[..., 1], kappa).reshape(-1, 3, 3)
    along, across, height = along.ravel(), across.ravel(), height.ravel()
    frames = space.frames(along, across)
    digits = max(3, len(str(n)))
    names = tuple((strip_id(j), tuple(f"{j + 1}{i + 1:0{digits}d}" for i in range(n))) for j in range(strips))
    return Photos(
        ids=tuple(photo for _, photos in names for photo in photos),
        strips=names,
        along=along,
        across=across,
        height=height,
        centers=space.cartesian(along, across, height),
        rotations=frames @ attitude,
        up=frames[:, :, 2],
    )
