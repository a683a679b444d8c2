"""Designing a strip and its control: layouts compared, the number of bands that an accuracy needs, the best places."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.planning.control_layout import Layout, Spot, across, spots_of
from photostrip.planning.ideal_strip import IdealStrip, StripGeometry, ideal_strip
from photostrip.planning.strip_methods import METHODS, Accuracy, accuracy

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

WORTH = 0.01  # part of the score that a place must gain to be called better
MOST_TRIED = 4000  # layouts that a search looks at


@dataclass(frozen=True)
class Required:
    """Standard deviations that every point must reach.

    Parameters
    ----------
    plan, height : float or None
        Both coordinates of the plan together, and height, metres; None: anything will do.
    """

    plan: float | None = None
    height: float | None = None

    def met(self, worst: tuple[float, float]) -> bool:
        """Whether the worst standard deviations in plan and height are good enough."""
        limits = (self.plan, self.height)
        return all(limit is None or value <= limit for value, limit in zip(worst, limits, strict=True))


@dataclass(frozen=True)
class Placement:
    """Further control points to be placed as well as possible.

    Parameters
    ----------
    points : int
        How many.
    into : str
        Name of the layout that they are added to.
    method : str
        Method of adjustment whose worst point counts.
    use : str
        ``xyz``, ``xy`` or ``z``.
    """

    points: int
    into: str
    method: str = "bundle"
    use: str = "xyz"


@dataclass(frozen=True)
class Design:
    """What is to be designed.

    Parameters
    ----------
    geometry : StripGeometry
        The strip.
    layouts : tuple of Layout
        Layouts of control to compare.
    methods : tuple of str
        Methods of adjustment to compare.
    required : Required
        Accuracy that is needed.
    placement : Placement or None
        Points to be placed.
    """

    geometry: StripGeometry
    layouts: tuple[Layout, ...]
    methods: tuple[str, ...] = METHODS
    required: Required = Required()
    placement: Placement | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """One layout adjusted by one method.

    Parameters
    ----------
    layout : Layout
        The layout.
    spots : tuple of Spot
        Its control points.
    method : str
        The method.
    accuracy : Accuracy or None
        Expected precision; None where the control does not determine the strip.
    reason : str
        Why there is none.
    """

    layout: Layout
    spots: tuple[Spot, ...]
    method: str
    accuracy: Accuracy | None
    reason: str = ""


@dataclass(frozen=True)
class Needed:
    """The least number of bands that reaches the required accuracy.

    Parameters
    ----------
    method : str
        Method of adjustment.
    bands, points : int or None
        Bands and control points; None: not even a band at every photo does.
    worst : tuple of float
        Worst standard deviations in plan and height with them (with all bands where it is not reached), metres.
    """

    method: str
    bands: int | None
    points: int | None
    worst: tuple[float, float]


@dataclass(frozen=True)
class Placed:
    """The best places found.

    Parameters
    ----------
    placement : Placement
        What was asked for.
    spots : tuple of Spot
        Where the further points go.
    before, equal, found : tuple of float
        Worst standard deviations in plan and height, metres: of the layout alone, with the points equally spaced, and
        at the places found.
    equal_spots : tuple of Spot
        The best of the equally spaced ways.
    gain : float
        Part by which the search lowers the worst standard deviation, in plan or height, whichever is worse, each
        relative to the required one or else to what equal spacing gives; 0 where it does not beat equal spacing.
    tried : int
        Layouts looked at.
    """

    placement: Placement
    spots: tuple[Spot, ...]
    before: tuple[float, float]
    equal: tuple[float, float]
    equal_spots: tuple[Spot, ...]
    found: tuple[float, float]
    gain: float
    tried: int


@dataclass(frozen=True, eq=False)
class Report:
    """Everything about a design.

    Parameters
    ----------
    design : Design
        What was asked for.
    strip : IdealStrip
        The strip.
    outcomes : tuple of Outcome
        Every layout by every method.
    needed : tuple of Needed
        Bands that the required accuracy needs, by method; empty when none is required.
    placed : Placed or None
        The best places.
    """

    design: Design
    strip: IdealStrip
    outcomes: tuple[Outcome, ...]
    needed: tuple[Needed, ...]
    placed: Placed | None


def plan_strip(design: Design) -> Report:
    """Work out a design.

    Parameters
    ----------
    design : Design
        What is to be designed.

    Returns
    -------
    Report
        Expected precision of every layout and method, bands needed and best places.

    Raises
    ------
    InputError, GeometryError
        When there can be no such strip, or a layout does not fit it.
    """
    strip = ideal_strip(design.geometry)
    outcomes = tuple(
        outcome(strip, layout, method) for layout in design.layouts for method in design.methods
    )
    wanted = design.required != Required()
    bands = next((layout for layout in design.layouts if layout.kind == "bands"), design.layouts[0])
    needed = tuple(bands_needed(strip, bands, each, design.required) for each in design.methods) if wanted else ()
    placed = None
    if design.placement is not None:
        into = next(layout for layout in design.layouts if layout.name == design.placement.into)
        placed = best_places(strip, into, design.placement, design.required)
    return Report(design, strip, outcomes, needed, placed)


def outcome(strip: IdealStrip, layout: Layout, method: str) -> Outcome:
    """Adjust one layout by one method.

    Parameters
    ----------
    strip : IdealStrip
        The strip.
    layout : Layout
        The control.
    method : str
        One of `METHODS`.

    Returns
    -------
    Outcome
        Its precision, or why there is none.
    """
    spots = spots_of(layout, strip.geometry.photos, strip.geometry.points.rows)
    try:
        return Outcome(layout, spots, method, accuracy(strip, layout, spots, method))
    except GeometryError as error:
        return Outcome(layout, spots, method, None, str(error))


def worst(expected: Accuracy) -> tuple[float, float]:
    """Largest standard deviations in plan and height of the points that are not control, metres."""
    plan, height = expected.plan_and_height[expected.new].max(axis=0)
    return float(plan), float(height)


def along_the_strip(strip: IdealStrip, expected: Accuracy) -> Floats:
    """Give the worst standard deviations near each photo.

    Parameters
    ----------
    strip : IdealStrip
        The strip.
    expected : Accuracy
        Its precision.

    Returns
    -------
    ndarray, shape (m, 2)
        In plan and height, metres, of the points whose nearest nadir is that of the photo, control included.
    """
    nearest = np.abs(strip.xyz[:, None, 0] - strip.centers[None, :, 0]).argmin(axis=1)
    sigmas = expected.plan_and_height
    return np.array([sigmas[nearest == photo].max(axis=0) for photo in range(len(strip.centers))])


def bands_needed(strip: IdealStrip, layout: Layout, method: str, required: Required) -> Needed:
    """Find the least number of evenly spread bands that reaches an accuracy.

    Parameters
    ----------
    strip : IdealStrip
        The strip.
    layout : Layout
        Points of a band, and their precision.
    method : str
        One of `METHODS`.
    required : Required
        What is needed.

    Returns
    -------
    Needed
        The number; bands are tried one more at a time, to a band at every photo.
    """
    photos, rows = strip.geometry.photos, strip.geometry.points.rows
    last = (float("inf"), float("inf"))
    for bands in range(2, photos + 1):
        tried = replace(layout, kind="bands", bands=bands, every=None, spots=())
        spots = spots_of(tried, photos, rows)
        found = outcome(strip, tried, method).accuracy
        if found is None or not len(found.new):
            continue
        last = worst(found)
        if required.met(last):
            return Needed(method, bands, len(spots), last)
    return Needed(method, None, None, last)


# --------------------------------------------------------------------------------------------------- best places


@dataclass
class _Search:
    """Looks at layouts, each once, and counts them."""

    look: Callable[[frozenset[Spot]], tuple[float, float]]
    scale: tuple[float, float]
    seen: dict[frozenset[Spot], tuple[float, float]]

    def worst(self, spots: frozenset[Spot]) -> tuple[float, float]:
        if spots not in self.seen:
            self.seen[spots] = self.look(spots)
        return self.seen[spots]

    def score(self, spots: frozenset[Spot]) -> float:
        """Worst of plan and height relative to the scale; the smaller one decides between equals."""
        parts = sorted(value / unit for value, unit in zip(self.worst(spots), self.scale, strict=True))
        return parts[1] + 1e-3 * parts[0]

    @property
    def spent(self) -> bool:
        return len(self.seen) >= MOST_TRIED


def best_places(strip: IdealStrip, layout: Layout, placement: Placement, required: Required) -> Placed:
    """Search the best places for further control points.

    Parameters
    ----------
    strip : IdealStrip
        The strip.
    layout : Layout
        The control that is there in any case.
    placement : Placement
        How many points, for which method.
    required : Required
        Weighs plan against height; what is not required counts relative to what equal spacing gives.

    Returns
    -------
    Placed
        The places; those of equal spacing when the search finds nothing better.

    Notes
    -----
    The search starts from equal spacing and from points added one by one where each helps most, then moves one
    point at a time to the place where it helps most, until no move helps. It may miss the very best layout; it never
    ends behind equal spacing.
    """
    photos, rows = strip.geometry.photos, strip.geometry.points.rows
    fixed = spots_of(layout, photos, rows)

    def look(spots: frozenset[Spot]) -> tuple[float, float]:
        given = tuple(sorted((*fixed, *spots), key=lambda spot: (spot.photo, spot.row)))
        try:
            found = accuracy(strip, layout, given, placement.method)
        except GeometryError:
            return float("inf"), float("inf")
        return worst(found)

    taken = {(spot.photo, spot.row) for spot in fixed}
    free = [
        Spot(photo, row, placement.use)
        for photo in range(1, photos + 1)
        for row in range(1, rows + 1)
        if (photo, row) not in taken
    ]
    search = _Search(look, (1.0, 1.0), {})
    ways = [way for way in equal_ways(placement, photos, rows) if not {(s.photo, s.row) for s in way} & taken]
    spaced = min(ways, key=lambda way: max(search.worst(way))) if ways else frozenset(free[: placement.points])
    reference = search.worst(spaced)
    search.scale = tuple(
        limit or value for limit, value in zip((required.plan, required.height), reference, strict=True)
    )  # type: ignore[assignment]
    spaced = min(ways or [spaced], key=search.score)
    starts = [spaced, _greedy(search, free, placement.points)]
    best = min((_exchanged(search, start, free) for start in starts), key=search.score)
    gain = 1 - search.score(best) / search.score(spaced)
    if gain < WORTH:
        best, gain = spaced, 0.0
    order = sorted(best, key=lambda spot: (spot.photo, spot.row))
    return Placed(
        placement,
        tuple(order),
        search.worst(frozenset()),
        search.worst(spaced),
        tuple(sorted(spaced, key=lambda spot: (spot.photo, spot.row))),
        search.worst(best),
        gain,
        len(search.seen),
    )


def equal_ways(placement: Placement, photos: int, rows: int) -> Iterator[frozenset[Spot]]:
    """Give the ways of spacing points equally: on alternating edges, in the middle, by pairs, by bands of three.

    Parameters
    ----------
    placement : Placement
        How many.
    photos, rows : int
        Of the strip.

    Yields
    ------
    frozenset of Spot
        One way; only those that have exactly so many points.
    """
    count = placement.points
    edges = across(2, rows)
    for sides in (edges, edges[::-1], across(1, rows)):
        places = [(photo, sides[k % len(sides)]) for k, photo in enumerate(_equal(count, photos))]
        yield from _way(places, placement)
    for size in (2, 3):
        if count % size == 0 and size <= rows:
            stations = _equal(count // size, photos)
            yield from _way([(photo, row) for photo in stations for row in across(size, rows)], placement)


def _equal(count: int, photos: int) -> list[int]:
    """Photos, from 0, that divide the strip into equal parts."""
    return [round(place) for place in np.linspace(0, photos - 1, count + 2)[1:-1].tolist()]


def _way(places: Iterable[tuple[int, int]], placement: Placement) -> Iterator[frozenset[Spot]]:
    spots = frozenset(Spot(photo + 1, row + 1, placement.use) for photo, row in places)
    if len(spots) == placement.points:
        yield spots


def _greedy(search: _Search, free: list[Spot], count: int) -> frozenset[Spot]:
    """Add points one by one where each helps most."""
    chosen: frozenset[Spot] = frozenset()
    for _ in range(count):
        chosen = min((chosen | {spot} for spot in free if spot not in chosen), key=search.score)
    return chosen


def _exchanged(search: _Search, chosen: frozenset[Spot], free: list[Spot]) -> frozenset[Spot]:
    """Move one point at a time to where it helps most, until no move helps."""
    helped = True
    while helped and not search.spent:
        helped = False
        for spot in sorted(chosen, key=lambda each: (each.photo, each.row)):
            rest = chosen - {spot}
            best = min((rest | {other} for other in free if other not in rest), key=search.score)
            if search.score(best) < search.score(chosen) * (1 - 1e-9):
                chosen, helped = best, True
            if search.spent:
                break
    return chosen
