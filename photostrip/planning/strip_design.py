"""Best places for further control points: a search over the pass points of a planned strip.

Nothing but the expected precision of whole layouts is used, so it works for every method of adjustment.

Designing a strip and its control: layouts compared, the number of bands that an accuracy needs, the best places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.planning.ideal_strip import (
    BUNDLE,
    METHODS,
    Accuracy,
    ControlLayout,
    IdealStrip,
    Spot,
    StripGeometry,
    accuracy,
    across,
    ideal_strip,
    spots_of,
)

WORTH = 0.01  # part of the score that a place must gain to be called better
MOST_TRIED = 2000  # layouts that a search looks at
SHORT = 20  # photos; in longer strips only edges and middle are tried
EDGES_AND_MIDDLE = 3
DECIMALS = 9  # of the score: strips are symmetric, and of equal places the first is taken
TIE = 1e-3  # weight of the smaller of plan and height
MOST_PHOTOS_MOVED = 3  # photos that a point is moved by in one step


@dataclass(frozen=True)
class Demand:
    """Standard deviations that every point must reach."""

    # plan, height: both coordinates of the plan together, and height, metres; None: anything will do
    plan: float | None = None
    height: float | None = None

    def met(self, worst: tuple[float, float]) -> bool:
        """Whether the worst standard deviations in plan and height are good enough."""
        limits = (self.plan, self.height)
        return all(limit is None or value <= limit for value, limit in zip(worst, limits, strict=True))


@dataclass(frozen=True)
class Placement:
    """Further control points to be placed as well as possible."""

    points: int
    into: str  # name of the layout that they are added to
    method: str = "bundle"  # method of adjustment whose worst point counts
    use: str = "xyz"  # ``xyz``, ``xy`` or ``z``


@dataclass(frozen=True)
class BestPlaces:
    placement: Placement
    spots: tuple[Spot, ...]  # where the further points go
    # before, equal, found: worst standard deviations in plan and height, metres: of the layout alone, with the points
    # equally spaced, and at the places found
    before: tuple[float, float]
    equal: tuple[float, float]
    equal_spots: tuple[Spot, ...]  # the best of the equally spaced ways
    found: tuple[float, float]
    # part by which the search lowers what equal spacing gives: with a required accuracy the worse of plan and height,
    # each relative to what is required, else the root mean square of both worst standard deviations, each relative to
    # that of equal spacing. 0 where it does not beat equal spacing
    gain: float
    tried: int


def worst(expected: Accuracy) -> tuple[float, float]:
    """Largest standard deviations in plan and height of the points that are not control, metres."""
    plan, height = expected.plan_and_height[expected.new].max(axis=0)
    return float(plan), float(height)


@dataclass
class _Search:
    """Looks at layouts, each once, and counts them."""

    # gives the worst standard deviations of a set of further points, metres
    look: Callable[[frozenset[Spot]], tuple[float, float]]
    scale: tuple[float, float]
    required: bool  # whether the scale is what is required: then the larger of plan and height counts
    # whether plan and height count otherwise: a point in height only can do nothing for the plan
    counts: tuple[bool, bool]
    tried: dict[frozenset[Spot], tuple[float, float]]

    def worst(self, spots: frozenset[Spot]) -> tuple[float, float]:
        if spots not in self.tried:
            self.tried[spots] = self.look(spots)
        return self.tried[spots]

    def score(self, spots: frozenset[Spot]) -> float:
        """Worst standard deviations relative to the scale: the larger of plan and height, or their mean square."""
        parts = [value / unit for value, unit in zip(self.worst(spots), self.scale, strict=True)]
        if self.required:
            return round(max(parts) + TIE * min(parts), DECIMALS)
        counts = [part for part, counted in zip(parts, self.counts, strict=True) if counted]
        return round(float(np.sqrt(np.mean(np.square(counts)))), DECIMALS)

    def is_spent(self) -> bool:
        return len(self.tried) >= MOST_TRIED


def best_places(strip: IdealStrip, layout: ControlLayout, placement: Placement, required: Demand) -> BestPlaces:
    """Search the best places for further control points.

    Places are the pass points at the nadirs, in long strips those at the edges and in the middle. The search starts
    from equal spacing and from points added one by one where each helps most, then moves one point at a time to a place
    not far away where it helps most, until no move helps. It may miss the very best layout; it never ends behind equal
    spacing.

    layout: the control that is there in any case.
    required: weighs plan against height; without it both count alike, relative to what equal spacing gives.
    """
    photos, rows = strip.geometry.photos, strip.geometry.points.rows
    fixed = spots_of(layout, photos, rows)

    def look(spots: frozenset[Spot]) -> tuple[float, float]:
        try:
            found = accuracy(strip, layout, _in_order((*fixed, *spots)), placement.method)
        except GeometryError:
            return float("inf"), float("inf")
        return worst(found)

    fixed_places = {(spot.photo, spot.row) for spot in fixed}
    free = [
        Spot(photo, row, placement.use)
        for photo in range(1, photos + 1)
        for row in (1 + each for each in across(rows if photos <= SHORT else min(EDGES_AND_MIDDLE, rows), rows))
        if (photo, row) not in fixed_places
    ]
    asked = required.plan is not None or required.height is not None
    search = _Search(
        look=look, scale=(1.0, 1.0), required=asked, counts=("xy" in placement.use, "z" in placement.use), tried={}
    )
    ways = [way for way in equal_ways(placement, photos, rows) if not {(s.photo, s.row) for s in way} & fixed_places]
    ways = ways or [frozenset(free[: placement.points])]
    reference = search.worst(min(ways, key=lambda way: max(search.worst(way))))
    search.scale = (required.plan or reference[0], required.height or reference[1])
    spaced = min(ways, key=search.score)
    starts = [spaced, _greedy(search, free, placement.points)]
    best = min((_exchanged(search, start, free) for start in starts), key=search.score)
    gain = 1 - search.score(best) / search.score(spaced)
    if gain < WORTH:
        best, gain = spaced, 0.0
    return BestPlaces(
        placement,
        spots=_in_order(best),
        before=search.worst(frozenset()),
        equal=search.worst(spaced),
        equal_spots=_in_order(spaced),
        found=search.worst(best),
        gain=gain,
        tried=len(search.tried),
    )


def _in_order(spots: Iterable[Spot]) -> tuple[Spot, ...]:
    return tuple(sorted(spots, key=lambda spot: (spot.photo, spot.row)))


def equal_ways(placement: Placement, photos: int, rows: int) -> Iterator[frozenset[Spot]]:
    """Ways of spacing exactly so many points equally: on alternating edges, in the middle, by twos or threes."""
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
    while helped and not search.is_spent():
        helped = False
        for spot in _in_order(chosen):
            rest = chosen - {spot}
            near = [each for each in free if each not in rest and abs(each.photo - spot.photo) <= MOST_PHOTOS_MOVED]
            best = min((rest | {other} for other in near), key=search.score)
            if search.score(best) < search.score(chosen) * (1 - 1e-9):
                chosen, helped = best, True
            if search.is_spent():
                break
    return chosen


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
