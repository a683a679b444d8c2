"""Designing a strip and its control: layouts compared, the number of bands that an accuracy needs, the best places."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.planning.strip.ideal_strip import ControlLayout, IdealStrip, Spot, StripGeometry, ideal_strip, spots_of
from photostrip.planning.strip.methods import BUNDLE, METHODS, Accuracy, accuracy
from photostrip.planning.strip.placement import BestPlaces, Demand, Placement, best_places, worst

ANYTHING = Demand()


@dataclass(frozen=True)
class DesignTask:
    geometry: StripGeometry
    layouts: tuple[ControlLayout, ...]
    methods: tuple[str, ...] = METHODS
    required: Demand = ANYTHING  # accuracy that is needed
    placement: Placement | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """One layout adjusted by one method."""

    layout: ControlLayout
    spots: tuple[Spot, ...]
    method: str
    accuracy: Accuracy | None  # expected precision; None where the control does not determine the strip
    reason: str = ""


@dataclass(frozen=True)
class Needed:
    """The least number of bands that reaches the required accuracy."""

    method: str
    # bands, points: bands and control points; None: not even a band at every photo does
    bands: int | None
    points: int | None
    # worst standard deviations in plan and height with them (with all bands where it is not reached), metres
    worst: tuple[float, float]


@dataclass(frozen=True, eq=False)
class DesignReport:
    """Everything about a design."""

    design: DesignTask
    strip: IdealStrip
    outcomes: tuple[Outcome, ...]
    needed: tuple[Needed, ...]  # bands that the required accuracy needs, by method; empty when none is required
    placed: BestPlaces | None


def plan_strip(design: DesignTask) -> DesignReport:
    """Work out a design: expected precision of every layout and method, bands needed and best places.

    Raises InputError, GeometryError when there can be no such strip, or a layout does not fit it.
    """
    strip = ideal_strip(design.geometry)
    _require_places(design)
    outcomes = tuple(
        outcome(strip, layout, method) for layout in design.layouts for method in methods_of(design, layout)
    )
    wanted = design.required != ANYTHING
    bands = next((layout for layout in design.layouts if layout.kind == "bands"), design.layouts[0])
    needed = tuple(bands_needed(strip, bands, each, design.required) for each in design.methods) if wanted else ()
    placed = None
    if design.placement is not None:
        into = next(layout for layout in design.layouts if layout.name == design.placement.into)
        placed = best_places(strip, into, design.placement, design.required)
    return DesignReport(design=design, strip=strip, outcomes=outcomes, needed=needed, placed=placed)


def _require_places(design: DesignTask) -> None:
    """Refuse all layouts that do not fit the strip."""
    faults: list[Fault] = []
    # the same layout may stand here twice, without and with perspective centres
    for layout in {replace(each, name="", gnss=None): each for each in reversed(design.layouts)}.values():
        try:
            spots_of(layout, design.geometry.photos, design.geometry.points.rows)
        except InputError as error:
            faults += [replace(fault, key=f'layouts."{layout.name}"') for fault in error.faults]
    if faults:
        raise InputError(reversed(faults))


def methods_of(design: DesignTask, layout: ControlLayout) -> tuple[str, ...]:
    """Return the methods that a layout is adjusted by: with perspective centres the bundle, which alone uses them."""
    return (BUNDLE,) if layout.gnss is not None and BUNDLE in design.methods else design.methods


def outcome(strip: IdealStrip, layout: ControlLayout, method: str) -> Outcome:
    """Adjust one layout by one method; where the control does not determine the strip, say why."""
    spots = spots_of(layout, strip.geometry.photos, strip.geometry.points.rows)
    try:
        return Outcome(layout=layout, spots=spots, method=method, accuracy=accuracy(strip, layout, spots, method))
    except GeometryError as error:
        return Outcome(layout=layout, spots=spots, method=method, accuracy=None, reason=str(error))


def along_the_strip(strip: IdealStrip, expected: Accuracy) -> Floats:
    """Worst standard deviations near each photo in plan and height, shape (m, 2), metres.

    Of the points whose nearest nadir is that of the photo, control included.
    """
    nearest = np.abs(strip.xyz[:, None, 0] - strip.centers[None, :, 0]).argmin(axis=1)
    sigmas = expected.plan_and_height
    return np.array([sigmas[nearest == photo].max(axis=0) for photo in range(len(strip.centers))])


def bands_needed(strip: IdealStrip, layout: ControlLayout, method: str, required: Demand) -> Needed:
    """Find the least number of evenly spread bands that reaches an accuracy.

    Up to 20 bands are tried one more at a time, more in steps of a tenth, to a band at every photo; when a step meets
    the requirement the numbers that it went over are tried too. The layout gives the points of a band and their
    precision.
    """
    last = (float("inf"), float("inf"))
    failed = 1
    for bands in _steps(strip.geometry.photos):
        tried = _with_bands(strip, layout, method, bands)
        if required.met(tried):
            between = ((each, _with_bands(strip, layout, method, each)) for each in range(failed + 1, bands))
            least, found = next(((n, found) for n, found in between if required.met(found)), (bands, tried))
            return Needed(method=method, bands=least, points=least * layout.per_band, worst=found)
        last = tried if np.isfinite(tried).all() else last
        failed = bands
    return Needed(method=method, bands=None, points=None, worst=last)


def _steps(photos: int) -> Iterator[int]:
    """Numbers of bands that are tried: all up to 20, then in steps of a tenth, and last a band at every photo."""
    bands = 2
    while bands < photos:
        yield bands
        bands += max(1, bands // 10)
    yield photos


def _with_bands(strip: IdealStrip, layout: ControlLayout, method: str, bands: int) -> tuple[float, float]:
    """Worst standard deviations with evenly spread bands; infinite where they do not determine the strip."""
    found = outcome(strip, replace(layout, kind="bands", bands=bands, every=None, spots=()), method).accuracy
    return worst(found) if found is not None and len(found.new) else (float("inf"), float("inf"))
