"""The gate around a run: what the data say against themselves, before the adjustment, after it, and when it fails.

A run is examined whether it succeeds or not. When it fails, mistakes found in the image coordinates are corrected in a
copy that serves the evidence alone, so that one mistake does not hide the next; what is adjusted is never touched.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import PhotostripError
from photostrip.triangulation import interior
from photostrip.triangulation.plausibility import accepted, flight_order, units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.pipeline.results import Result
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.plausibility.flight_order import Arranged

    Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Examined:
    """What the image coordinates alone say.

    Parameters
    ----------
    findings : tuple of Finding
        What was found.
    observations : PhotoPoints
        Image points with what was found put right, for further evidence only; mm, y up.
    arranged : tuple of Arranged
        Each strip as its photos lie.
    """

    findings: tuple[Finding, ...]
    observations: PhotoPoints
    arranged: tuple[Arranged, ...]


def before(inputs: Inputs, settings: Settings) -> Examined:
    """Examine what is given, as far as that goes without adjusting anything.

    Parameters
    ----------
    inputs : Inputs
        What is given.
    settings : Settings
        What is to be done.

    Returns
    -------
    Examined
        What was found; what the user has accepted is not marked yet.
    """
    cameras = {photo: strip.camera for strip in inputs.strips for photo in strip.photos}
    observations = _photo_coordinates(inputs, settings)
    told, factors = units.examine(observations, cameras)
    arranged = []
    for strip in inputs.strips:
        findings, order = flight_order.examine(observations, strip.id, strip.photos)
        told += findings
        arranged.append(order)
    size = {name: each.size[name] for each in arranged for name in each.size}
    name_of = {photo: camera.name for photo, camera in cameras.items()}
    factor = {
        photo: factors.get(name_of.get(photo, ""), 1.0) / size.get(photo, 1.0) for photo in observations.photo_ids
    }
    mirrored = frozenset(name for each in arranged for name in each.mirrored)
    return Examined(tuple(told), _put_right(observations, factor, mirrored), tuple(arranged))


def _photo_coordinates(inputs: Inputs, settings: Settings) -> PhotoPoints:
    """Image points in the system of the photo, of photos that belong to a strip."""
    cameras = {photo: strip.camera for strip in inputs.strips for photo in strip.photos}
    if inputs.fiducials is None:
        return inputs.observations
    try:
        return interior.transform(inputs.observations, interior.orient(inputs.fiducials, cameras, settings.interior))
    except PhotostripError:
        return inputs.observations  # what is wrong with the marks is told elsewhere


def _put_right(observations: PhotoPoints, factor: dict[str, float], mirrored: frozenset[str]) -> PhotoPoints:
    """Image points in millimetres and seen from the right side, as far as that is known."""
    by_photo = np.array([[factor[name], -factor[name] if name in mirrored else factor[name]] for name in factor])
    if not len(by_photo) or (by_photo == 1.0).all():
        return observations
    return replace(observations, xy=observations.xy * by_photo[observations.photo])


def of_inputs(inputs: Inputs, settings: Settings) -> tuple[Finding, ...]:
    """Tell what the data say against themselves before anything is adjusted.

    Parameters
    ----------
    inputs : Inputs
        What is given.
    settings : Settings
        What is to be done, and what is accepted.

    Returns
    -------
    tuple of Finding
        By code.
    """
    return accepted(before(inputs, settings).findings, settings.accept)


def of_result(result: Result) -> tuple[Finding, ...]:
    """Tell what the data say against themselves, the adjustment being done.

    Parameters
    ----------
    result : Result
        What a run found.

    Returns
    -------
    tuple of Finding
        By code.
    """
    return of_inputs(result.inputs, result.settings)


def of_failure(inputs: Inputs, settings: Settings) -> tuple[Finding, ...]:
    """Tell what the data say against themselves, the adjustment having failed.

    Parameters
    ----------
    inputs : Inputs
        What is given.
    settings : Settings
        What was to be done.

    Returns
    -------
    tuple of Finding
        By code; empty when the evidence cannot be put together either.
    """
    try:
        return of_inputs(inputs, settings)
    except (PhotostripError, ArithmeticError, ValueError):
        return ()  # the failure itself is what must be told
