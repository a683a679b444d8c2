"""Points without a model: those whose good rays come from photos that are no neighbours.

A point on three photos whose middle measurement is wrong stands in no pair, and is yet well determined: its two good
rays meet under twice the angle.

Source: derived; see docs/sources.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.points import PhotoPoints
from photostrip.strip.strip_formation.strip import FormedStrip

SMALLEST_ANGLE = 1e-4  # sine of the angle between the rays


def bridge(
    formed: FormedStrip, observations: PhotoPoints, photos: Sequence[str], focal: float, rows: Numbers
) -> FormedStrip:
    """Return a strip that also holds the points which some rays place without a model.

    Such a point lies in the middle between its first and its last ray.

    rows: rows of the observations: good rays of points that the strip does not hold.
    """
    place = {photo: number for number, photo in enumerate(photos)}
    position = np.array([place[observations.photo_ids[number]] for number in observations.photo[rows]], np.intp)
    order = np.lexsort((position, observations.point[rows]))
    rows, position = rows[order], position[order]
    point, begin, count = np.unique(observations.point[rows], return_index=True, return_counts=True)
    ends = np.column_stack([begin, begin + count - 1])[count > 1]
    if not len(ends):
        return formed
    at = position[ends]
    image = np.concatenate([observations.xy[rows[ends]], np.full((*ends.shape, 1), -focal)], axis=2)
    direction = np.einsum("nkij,nkj->nki", formed.rotations[at], image)
    xyz, sound = meeting(formed.centers[at], direction)
    found, numbers = np.flatnonzero(sound), np.asarray(point[count > 1], np.intp)
    every = np.concatenate([formed.point, numbers[found]])
    order = np.argsort(every, kind="stable")
    home = np.concatenate([np.full(len(formed.point), -1), at[found, 0]])
    return replace(
        formed,
        point=every[order],
        xyz=np.concatenate([formed.xyz, xyz[found]])[order],
        model_count=np.concatenate([formed.model_count, np.zeros(len(found), np.intp)])[order],
        home=home[order],
        bridging=np.sort(rows[np.isin(observations.point[rows], numbers[found])]),
    )


def meeting(centers: Floats, directions: Floats) -> tuple[Floats, Flags]:
    """Middle of two rays where they are nearest, and whether they meet, in front of both cameras and not too flat.

    Centres and directions are (n, 2, 3); the middle is NaN where the rays do not meet.
    """
    unit = directions / np.linalg.norm(directions, axis=2, keepdims=True)
    base = centers[:, 1] - centers[:, 0]
    cosine = np.einsum("ni,ni->n", unit[:, 0], unit[:, 1])
    first, second = (np.einsum("ni,ni->n", base, unit[:, side]) for side in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = 1 - cosine**2
        length = np.column_stack([first - cosine * second, cosine * first - second]) / sine[:, None]
        sound = (sine > SMALLEST_ANGLE**2) & (length > 0).all(axis=1)
        xyz = (centers + length[:, :, None] * unit).mean(axis=1)
    return np.where(sound[:, None], xyz, np.nan), sound
