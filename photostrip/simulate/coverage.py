"""Which photo shows which point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.simulate.flight import CUT_SIGMAS, position_sigma
from photostrip.simulate.imaging import sees

if TYPE_CHECKING:
    from photostrip.arrays import Numbers
    from photostrip.simulate.flight import Photos
    from photostrip.simulate.placement import Placed
    from photostrip.simulate.spec import Spec


FLATTEST_RAY = np.radians(75.0)  # a ray flatter than this is not looked for


def shown(spec: Spec, photos: Photos, placed: Placed) -> tuple[Numbers, Numbers]:
    """All image points: which photo shows which point.

    Points are sought only around the place of each photo in its strip, so that the time grows with the photos, not with
    their square.

    Returns photo, point: (n,), numbers of photo and point of each image point, by photo, then by point.
    """
    n = spec.flight.photos
    reach = _reach(spec, placed)
    found_photo, found_point = [], []
    for j in range(spec.flight.strips):
        rows = np.arange(j * n, (j + 1) * n)
        backward = n > 1 and photos.along[rows[-1]] < photos.along[rows[0]]
        sign = -1.0 if backward else 1.0
        place = sign * placed.along / spec.base + (n - 1) / 2  # number in the strip, with a fraction
        first = np.maximum(np.ceil(place - reach / spec.base), 0).astype(np.intp)
        last = np.minimum(np.floor(place + reach / spec.base), n - 1).astype(np.intp)
        near = np.abs(placed.across - photos.across[rows].mean()) <= reach
        count = np.where(near, np.maximum(last - first + 1, 0), 0)
        point = np.repeat(np.arange(len(placed.along)), count)
        photo = rows[0] + np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        good = sees(spec, photos, photo, placed.xyz[point])
        found_photo.append(photo[good])
        found_point.append(point[good])
    photo, point = np.concatenate(found_photo), np.concatenate(found_point)
    order = np.lexsort((point, photo))
    return photo[order], point[order]


def _reach(spec: Spec, placed: Placed) -> float:
    """Largest distance on the ground, metres, from a photo's planned place to what it can show."""
    tilt = CUT_SIGMAS * np.radians(np.hypot(*spec.flight.attitude_sigma_deg[:2]))
    view = np.arctan(np.hypot(*spec.format) / 2.0 / spec.camera.principal_distance)
    moved = CUT_SIGMAS * np.asarray(position_sigma(spec))
    depth = spec.flying_height + spec.terrain.height - placed.height.min() + moved[2]
    return float(depth * np.tan(min(view + tilt, FLATTEST_RAY)) + np.hypot(moved[0], moved[1]))
