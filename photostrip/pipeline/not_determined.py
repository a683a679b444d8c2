"""Points that were measured and have no coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.pipeline.inputs import Inputs
from photostrip.pipeline.results import Adjusted, StripResult
from photostrip.points import PhotoPoints


def not_determined(
    observations: PhotoPoints, points: Adjusted, inputs: Inputs, strips: Sequence[StripResult]
) -> dict[str, str]:
    """Points that were measured and have no coordinates, with the reason."""
    done = np.zeros(len(observations.point_ids), bool)
    done[points.number] = True
    if inputs.models is not None:
        why = "coordinates in the models contradict each other, or were left out"
        return {observations.point_ids[number]: why for number in np.flatnonzero(~done).tolist()}
    placed = {photo: (n, k) for n, strip in enumerate(inputs.strips) for k, photo in enumerate(strip.photos)}
    wrong = [each for strip in strips for each in strip.of_photos.wrong_rays]
    contradicted = {int(observations.point[each.row]): each.kind == "control" for each in wrong}
    on_photos: dict[int, list[tuple[int, int]]] = {}
    for row in np.flatnonzero(~done[observations.point]):
        photo = observations.photo_ids[observations.photo[row]]
        if photo in placed:
            on_photos.setdefault(int(observations.point[row]), []).append(placed[photo])
    return {
        observations.point_ids[point]: _reason(places, by_control=contradicted.get(point))
        for point, places in sorted(on_photos.items())
    }


def _reason(places: list[tuple[int, int]], *, by_control: bool | None) -> str:
    """Put it in words; by_control: whether its given coordinates contradict a ray, None where nothing does."""
    if len(places) == 1:
        return "measured on one photo only"
    if by_control is not None:
        return "its given coordinates contradict one of its two rays" if by_control else "rays contradict each other"
    neighbours = any((n, k + 1) in places for n, k in places)
    return "rejected in every pair" if neighbours else "not on two neighbouring photos of one strip"
