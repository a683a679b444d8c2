"""What the layout of the photos says about a strip: order, overlap, photos that stand twice, are mirrored or scaled."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import MOST_NAMED, Finding, listed
from photostrip.plausibility import mosaic
from photostrip.plausibility.finding import found
from photostrip.plausibility.units import reading_of
from photostrip.points import PhotoPoints

Toward = Callable[[int, int], complex | None]
Against = Callable[[Sequence[int]], list[int]]
Closer = Callable[[str, str], tuple[complex, complex] | None]

TURNED_BACK = 0.3  # cosine between the directions to both neighbours; -1 in a straight flight
SURE_COUNT = 3  # common points of a link that may speak against the list
SURE_POINTS = 6  # common points of two photos that tell whether they show the same points
SURE_SHARE = 0.25  # of their spread, below which they do
SURE_MISFIT = 0.35  # of its base
SAME_PLACE_SHARE = 0.03  # of the median base between photos that share points: two photos from one place
SAME_PHOTO_SIGMAS = 5.0  # standard deviations of an image coordinate left by a link: a base that tilts hide leaves more
MOST_LOOKED_AT = 24  # photos that are looked at closer; a list that is wrong at more places needs no closer look
LEAST_PHOTOS = 3  # photos that have an order
OTHER_SCALE = 1.25  # ratio to both neighbours that tilts and relief do not make


@dataclass(frozen=True)
class PhotoOrder:
    """A strip as its photos lie, for the evidence that needs them in order."""

    photos: tuple[str, ...]  # photos in the order in which they lie, each place once
    # centre of the next photo on each of them, in the unit of its coordinates; NaN where it has no link
    steps: tuple[complex, ...]
    mirrored: frozenset[str]  # photos that are mirror images of the others
    size: dict[str, float]  # photos whose coordinates are larger than those of the others, and how many times


def find_wrong_order(
    observations: PhotoPoints, strip: str, photos: Sequence[str], closer: Closer = lambda _one, _other: None
) -> tuple[list[Finding], PhotoOrder]:
    """Compare the list of a strip's photos with what their common points say.

    observations: image points of the project, in any unit.
    closer: gives of two photos the direction of each from the other, tilts taken into account, or None; asked where the
        layout contradicts the list.
    Returns P102, P104, P201, P202, P203, P303.
    Returns the strip as its photos lie.
    """
    links = mosaic.link(observations, photos)
    odd = _unlike(links, len(photos))
    findings: list[Finding] = []
    mirrored: frozenset[str] = frozenset()
    size: dict[str, float] = {}
    if not links.alike:
        plane = mosaic.lay_out(links, len(photos))
        plane.size[odd] = 1.0  # nothing is known of their scale
        findings += [*_scaled(plane, strip, photos), *_mirrored(plane, strip, photos)]
        mirrored = frozenset(photos[number] for number in np.flatnonzero(plane.mirrored).tolist())
        size = {photos[number]: float(plane.size[number]) for number in _other_size(plane)}
    findings += _of_other_points(observations, odd, links, strip, photos)
    twice = _twice(links, observations.sigma)
    findings += [_twin(links, pair, strip, photos) for pair in twice]
    left = [number for number in range(len(photos)) if number not in {other for _, other in twice}]
    against = partial(turned_back, links, closer=_by_number(closer, photos))
    order = _order(links, left, against, len(photos))
    moved = _moved(order, left)
    if moved:
        findings.append(_out_of_order(links, order, moved, strip, photos, against))
    findings += _gaps(links, order, strip, photos)
    return findings, PhotoOrder(
        photos=tuple(photos[number] for number in order), steps=_steps(links, order), mirrored=mirrored, size=size
    )


def find_other_scale(observations: PhotoPoints, strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    """Look for photos at another scale than both their neighbours by the images alone, where a strip is not formed."""
    links = mosaic.link(observations, photos)
    for number in range(1, len(photos) - 1):
        rows = [links.index.get((number - 1, number)), links.index.get((number, number + 1))]
        if rows[0] is None or rows[1] is None:
            continue
        before, after = abs(links.turn[rows[0]]), abs(links.turn[rows[1]])
        ratio = np.array([before, 1.0 / max(after, mosaic.TINY)])  # of this photo to both
        if (ratio > OTHER_SCALE).all() or (ratio < 1 / OTHER_SCALE).all():
            size = float(np.sqrt(ratio.prod()))
            message = f"the scale of photo {photos[number]} is {size:.2f} times that of both its neighbours"
            fix = "does it have another principal distance, unit, or flight?"
            evidence = {"scale_over_neighbours": size}
            yield found("P205", message, fix, evidence, photos=(photos[number],), strips=(strip,))


def _steps(links: mosaic.PhotoLinks, order: Sequence[int]) -> tuple[complex, ...]:
    """Way to the next photo on each photo: slope of the line through the centres of all photos linked with it.

    A tilt moves single centres by as much as a base; those of photos farther on say more of it.
    """
    rank = np.full(max((*order, int(links.photo.max(initial=0)))) + 1, -1)
    rank[list(order)] = np.arange(len(order))
    photo, other = (np.concatenate([links.photo[:, k], links.photo[:, 1 - k]]) for k in (0, 1))
    way, count = np.concatenate(links.bases), np.tile(links.count, 2)
    lag = rank[other] - rank[photo]
    near = np.abs(lag) == 1  # a link of two points serves where there is no better one
    use = (rank[photo] >= 0) & (rank[other] >= 0) & np.isfinite(way) & (near | (count >= SURE_COUNT))
    at, lag, way = rank[photo[use]], lag[use], way[use]
    size = len(order)
    number = np.bincount(at, minlength=size) + 1.0  # with its own centre
    first, second = np.bincount(at, lag, size), np.bincount(at, lag.astype(float) ** 2, size)
    total = np.bincount(at, way.real, size) + 1j * np.bincount(at, way.imag, size)
    mixed = np.bincount(at, lag * way.real, size) + 1j * np.bincount(at, lag * way.imag, size)
    below = number * second - first**2
    slope = np.where(below > 0, (number * mixed - first * total) / np.where(below > 0, below, 1.0), np.nan)
    return tuple(slope.tolist())


def _other_size(plane: mosaic.Mosaic) -> list[int]:
    return [int(number) for number in np.flatnonzero(np.abs(np.log(plane.size)) > np.log(mosaic.SCALE_JUMP))]


def _scaled(plane: mosaic.Mosaic, strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    for number in _other_size(plane):
        size = float(plane.size[number])
        reading = reading_of(size, (0.5, 2.0))
        message = f"the coordinates on photo {photos[number]} are {size:.4g} times as large as on its neighbours"
        if reading.name:
            message += f": {reading.name}"
        fix = "bring its rows into the unit of the others"
        yield found("P102", message, fix, {"times": size}, photos=(photos[number],), strips=(strip,))


def _mirrored(plane: mosaic.Mosaic, strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    for number in np.flatnonzero(plane.mirrored).tolist():
        message = (
            f"photo {photos[number]} fits its neighbours only as a mirror image: a negative read as a positive, its x "
            "and y exchanged, or its y counted the other way"
        )
        fix = "turn the photo over in its rows, or measure it from the right side"
        yield found("P104", message, fix, {}, photos=(photos[number],), strips=(strip,))


def _of_other_points(
    observations: PhotoPoints, odd: Sequence[int], links: mosaic.PhotoLinks, strip: str, photos: Sequence[str]
) -> Iterator[Finding]:
    """Photos `odd` whose points lie on no other photo as they lie on them: their ids belong to other points."""
    names = [photos[number] for number in odd]
    if not names:
        return
    shown = "photo" if len(names) == 1 else "photos"
    message = f"strip {strip}: the points of {shown} {listed(names)} lie on no neighbour as they lie there"
    fix = "were their ids written in another row, or points numbered anew on each photo?"
    if len(names) == 1:
        moved = {rows: mosaic.link(_moved_by(observations, names[0], rows), photos) for rows in (1, -1)}
        left = {rows: _left(links, len(photos))[0][odd[0]] for rows, links in moved.items()}
        rows = min(left, key=lambda each: float(left[each]))
        if left[rows] < SURE_SHARE:
            message += f"; with its ids moved {'down' if rows > 0 else 'up'} by one row they do"
            fix = "put the ids into the rows of their points"
    evidence = {"photos": len(names), "misfit_over_spread": float(_left(links, len(photos))[0][odd].min())}
    yield found("P303", message, fix, evidence, photos=names, strips=(strip,), key="observations")


def _unlike(links: mosaic.PhotoLinks, photos: int) -> list[int]:
    """Photos that share enough points with others, and go with none of them."""
    mean, least = _left(links, photos)
    return [int(number) for number in np.flatnonzero((mean > mosaic.MOST_SHARE) & (least > SURE_SHARE))]


def _left(links: mosaic.PhotoLinks, photos: int) -> tuple[Floats, Floats]:
    """Give the mean and the least of what links of enough points leave on each photo, over the spread of the points."""
    sure = links.count >= SURE_POINTS
    photo, weight = links.photo[sure].ravel(), np.repeat(links.count[sure], 2).astype(float)
    share = np.repeat(links.share[sure], 2)
    least = np.full(photos, np.inf)
    np.minimum.at(least, photo, share)
    total = np.bincount(photo, weight, photos)
    return np.bincount(photo, weight * share, photos) / np.maximum(total, 1.0), least


def _moved_by(observations: PhotoPoints, photo: str, rows: int) -> PhotoPoints:
    """Image points whose ids on one photo are moved along its rows."""
    inside = observations.photo == observations.photo_ids.index(photo)
    point = observations.point.copy()
    point[inside] = np.roll(point[inside], rows)
    return replace(observations, point=point)


def _twice(links: mosaic.PhotoLinks, sigma: Floats) -> list[tuple[int, int]]:
    """Photos taken from one place: the same photo under two names."""
    base = np.abs(links.bases[1])
    if not len(base):  # as in each of the single photos of a block: the median of a million takes its time
        return []
    usual = np.median(base)
    like = np.abs(np.log(np.maximum(np.abs(links.turn), mosaic.TINY))) < np.log(mosaic.SCALE_JUMP)
    same = (
        like
        & (base < SAME_PLACE_SHARE * usual)
        & (links.misfit < SAME_PHOTO_SIGMAS * float(np.median(sigma)))
        & (links.count >= SURE_COUNT)
    )
    return [(int(a), int(b)) for a, b in links.photo[same]]


def _twin(links: mosaic.PhotoLinks, pair: tuple[int, int], strip: str, photos: Sequence[str]) -> Finding:
    row = links.index[pair]
    one, other = photos[pair[0]], photos[pair[1]]
    usual = np.median(np.abs(links.bases[1]))
    message = (
        f"photos {one} and {other} show their {links.count[row]} common points at the same places, within "
        f"{100 * float(links.misfit[row]) / usual:.2g} % of a base: the same photo twice"
    )
    fix = f"take {other} out of the strip, or give the rows of the photo that was meant"
    evidence = {
        "common_points": int(links.count[row]),
        "base_mm": float(np.abs(links.bases[1][row])),
        "usual_base_mm": usual,
        "misfit_mm": float(links.misfit[row]),
    }
    return found("P203", message, fix, evidence, photos=(one, other), strips=(strip,))


def _by_number(closer: Closer, photos: Sequence[str]) -> Toward:
    """Return the direction of one photo on another, both by number, as the closer look has it."""

    def toward(of: int, other: int) -> complex | None:
        directions = closer(photos[min(of, other)], photos[max(of, other)])
        return None if directions is None else directions[0 if of < other else 1]

    return toward


def turned_back(links: mosaic.PhotoLinks, order: Sequence[int], closer: Toward = lambda _of, _other: None) -> list[int]:
    """Find photos, listed in an order, whose two neighbours lie on the same side.

    None is named where a link is missing or doubtful, or where `closer`, which takes tilts into account, contradicts.
    """
    sure = (links.count >= SURE_COUNT) & (links.misfit < SURE_MISFIT * np.abs(links.bases[1]))
    certain, ways = sure.tolist(), [each.tolist() for each in links.bases]

    def toward(of: int, other: int) -> complex | None:
        row = links.index.get((min(of, other), max(of, other)))
        return ways[0 if of < other else 1][row] if row is not None and certain[row] else None

    found: list[int] = []
    looked_at = 0
    for before, photo, after in zip(order, order[1:], order[2:], strict=False):
        one, two = toward(photo, before), toward(photo, after)
        if one is None or two is None or not _same_side(one, two):
            continue
        looked_at += 1
        near = [closer(photo, other) for other in (before, after)] if looked_at <= MOST_LOOKED_AT else [None, None]
        if near[0] is None or near[1] is None or _same_side(near[0], near[1]):
            found.append(photo)
    return found


def _same_side(one: complex, two: complex) -> bool:
    return (one * two.conjugate()).real > TURNED_BACK * abs(one) * abs(two)


def _unlinked(links: mosaic.PhotoLinks, order: Sequence[int]) -> int:
    return sum((min(pair), max(pair)) not in links.index for pair in pairwise(order))


def _order(links: mosaic.PhotoLinks, listed: list[int], contradictions: Against, photos: int) -> list[int]:
    """Photos as they lie, where the list is contradicted; else as listed."""
    against = len(contradictions(listed)) + _unlinked(links, listed)
    if not against or len(listed) < LEAST_PHOTOS:
        return listed
    plane = mosaic.lay_out(links, photos)
    order: list[int] = []
    for part in dict.fromkeys(plane.part[listed].tolist()):  # as they are listed
        order += _along(plane, [number for number in listed if plane.part[number] == part])
    left = len(contradictions(order)) + _unlinked(links, order)
    return order if left < against else listed


def _along(plane: mosaic.Mosaic, inside: list[int]) -> list[int]:
    """Photos of one part along its longest direction, in the sense in which fewer are out of the list's order."""
    if len(inside) < LEAST_PHOTOS:
        return inside
    center = plane.offset[inside]
    d = center - center.mean()
    axis = np.sqrt((d**2).sum())  # direction of the largest extent
    along = (d * np.conj(axis)).real
    order = [inside[k] for k in np.argsort(along, kind="stable")]
    return min((order, order[::-1]), key=lambda each: len(_moved(each, inside)))


def _moved(order: Sequence[int], listed: Sequence[int]) -> list[int]:
    """Fewest photos that must be moved in the list: those outside its longest part in order."""
    if list(order) == list(listed):
        return []
    rank = {number: place for place, number in enumerate(order)}
    ends: list[int] = []
    chain: list[int] = []
    before: dict[int, int | None] = {}
    for number in listed:
        place = bisect_left([rank[each] for each in ends], rank[number])
        before[number] = ends[place - 1] if place else None
        ends[place : place + 1] = [number]
    last: int | None = ends[-1]
    while last is not None:
        chain.append(last)
        last = before[last]
    return [number for number in listed if number not in set(chain)]


def _out_of_order(
    links: mosaic.PhotoLinks,
    order: Sequence[int],
    moved: Sequence[int],
    strip: str,
    photos: Sequence[str],
    contradictions: Against,
) -> Finding:
    names = [photos[number] for number in order]
    wrong = [photos[number] for number in moved]
    exchanged = _exchanged(order, moved, photos)
    if exchanged:
        wrong = list(exchanged)
        message = f"strip {strip}: photos {wrong[0]} and {wrong[1]} are listed in the wrong order"
    elif len(moved) == 1:
        place = order.index(moved[0])
        near = [photos[number] for number in (*order[max(place - 1, 0) : place], *order[place + 1 : place + 2])]
        where = f"between {near[0]} and {near[1]}" if len(near) > 1 else f"beside {near[0]}"
        message = f"strip {strip}: photo {wrong[0]} is not where it is listed; its points put it {where}"
    else:
        message = f"strip {strip}: photos {listed(wrong)} are not where they are listed"
    concerned = _window(names, wrong)
    message += f"; the photos lie in the order {', '.join(concerned)}"
    given = [number for number in range(len(photos)) if number in set(order)]
    evidence = {
        "photos_moved": len(moved),
        "turned_back_as_listed": len(contradictions(given)),
        "turned_back_as_found": len(contradictions(order)),
        "neighbours_without_link_as_listed": _unlinked(links, given),
    }
    fix = "list the photos in flight order, or correct the photo ids in the table"
    return found("P201", message, fix, evidence, photos=tuple(wrong), strips=(strip,))


def _exchanged(order: Sequence[int], moved: Sequence[int], photos: Sequence[str]) -> tuple[str, str] | None:
    """Return the two neighbours whose exchange is all that is wrong."""
    if len(moved) != 1:
        return None
    place = order.index(moved[0])
    rest = sorted(order)
    for other in (*order[max(place - 1, 0) : place], *order[place + 1 : place + 2]):
        one, two = rest.index(moved[0]), rest.index(other)
        swapped = list(rest)
        swapped[one], swapped[two] = swapped[two], swapped[one]
        if swapped in (list(order), list(order)[::-1]):
            one, two = sorted((moved[0], other))
            return photos[one], photos[two]
    return None


def _window(names: Sequence[str], wrong: Sequence[str]) -> list[str]:
    """Return the part of the order that shows where wrong photos belong."""
    places = [names.index(each) for each in wrong]
    low, high = max(min(places) - 2, 0), min(max(places) + 3, len(names))
    return list(names[low:high]) if high - low <= 2 * MOST_NAMED else [*names[low : low + 2 * MOST_NAMED], "..."]


def _gaps(links: mosaic.PhotoLinks, order: Sequence[int], strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    """Neighbours, in the order in which the photos lie, without two common points."""
    for a, b in pairwise(order):
        if (min(a, b), max(a, b)) in links.index:
            continue
        message = f"photos {photos[a]} and {photos[b]} follow each other and have no two points in common"
        fix = "is a photo between them missing, or does one of them belong to another strip?"
        evidence = {"common_points_at_most": 1}
        yield found("P202", message, fix, evidence, photos=(photos[a], photos[b]), strips=(strip,))
