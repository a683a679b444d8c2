"""Where the strips of a project lie on their body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.notes import Document

if TYPE_CHECKING:
    from photostrip.library.result import Result

DECIMALS = 5  # of degrees: a metre


def place_of(result: Result) -> Document:
    """Return longitude and latitude of the first and the last photo of each strip, degrees, and the body's radius.

    None where the frame is local: only the project knows where it lies.
    """
    found = result.computed
    if found is None or found.output.kind == "local":
        return {"body": None, "track": None}
    frame, photos = found.output, result.document["photos"]
    strips: dict[str, list[Document]] = {}
    for photo in photos:
        strips.setdefault(photo["strip"], []).append(photo)
    ends = [end for group in strips.values() for end in (group[0], group[-1])]
    given = np.array([[end["x"], end["y"], end["z"]] for end in ends], float)
    internal = np.empty_like(given)
    internal[:, list(frame.order)] = given
    degrees = np.degrees(frame.geodetic(frame.cartesian_from_ground(internal))[:, :2]).round(DECIMALS).tolist()
    radius = frame.ellipsoid[0] if frame.ellipsoid else 6378137.0
    return {"body": radius, "track": [degrees[n : n + 2] for n in range(0, len(degrees), 2)]}
