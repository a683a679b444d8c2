"""Strips among photos that are listed in no order.

Photos are laid side by side by their common points, two and two. A strip begins with the two photos that have most
points in common and goes on at both ends, from photo to photo, with the one that has most points in common, times the
cosine of its direction to straight on, of those that lie nearer to ahead than to aside, within 45 degrees. It is cut
where it cannot be formed. Neither the order of the tables nor the photos' kappa has a say in it; ids decide between
equals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.errors import GeometryError
from photostrip.notes import Note, counted, listed
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.strips.photos import form_strip
from photostrip.plausibility import mosaic
from photostrip.points import PhotoPoints
from photostrip.strip import corrections
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS

AHEAD = float(np.cos(np.pi / 4))

Run = tuple[int, ...]  # photos by number, one behind the other


class Start(NamedTuple):
    """Photos that are listed in no order, brought into strips or left to themselves."""

    inputs: Inputs
    note: Note


def starts(inputs: Inputs, measured: PhotoPoints, settings: Settings) -> Iterator[Start]:
    """Give the ways in which photos that are listed in no order may start, the likeliest first.

    With all their orientations given they start from these, whatever their arrangement; otherwise from strips that are
    found among them. Where some are given, the other way is the second.
    """
    oriented = _oriented(inputs)
    as_given = Start(inputs, _of_given(sum(oriented), len(oriented)))
    if all(oriented):
        yield as_given
    yield _with_strips_found(inputs, measured, settings)
    if any(oriented) and not all(oriented):
        yield as_given


def notes(start: Start, refused: Sequence[GeometryError]) -> Iterator[Note]:
    """Say how the photos started, and which start led nowhere."""
    yield start.note
    for error in refused:
        yield Note("start-refused", f"another start of the photos in no given order led nowhere: {error}", "note")


def refusal(inputs: Inputs, refused: GeometryError) -> GeometryError:
    """Say what to give where photos that are listed in no order cannot be oriented."""
    if all(_oriented(inputs)) or (refused.code == "strip-not-tied" and len(refused.photos) == 1):
        return refused
    message = (
        f"{refused}; where photos in no given order are too much for a start, give their orientations roughly "
        "(orientations, role: approximate), as a COLMAP model has them, or list them in flight order in `strips`"
    )
    return GeometryError(message, photos=refused.photos, points=refused.points, code=refused.code)


def _oriented(inputs: Inputs) -> list[bool]:
    """Whether the orientation of each photo that is listed in no order is given."""
    known = frozenset(() if inputs.orientations is None else inputs.orientations.photos)
    return [strip.id in known for strip in inputs.strips if not strip.listed]


def _of_given(oriented: int, photos: int) -> Note:
    of_all = "their given orientations" if oriented == photos else f"the given orientations of {oriented} of them"
    return Note("photos-in-no-order", f"{counted(photos, 'photo')} in no given order start from {of_all}", "note")


def _with_strips_found(inputs: Inputs, measured: PhotoPoints, settings: Settings) -> Start:
    """Put strips in the place of photos that are listed in no order, as far as some are found among them.

    A strip has one camera. Photos that join none stay what they are, strips of their own.
    """
    singles = [strip for strip in inputs.strips if not strip.listed]
    # refraction and curvature need heights, and bend rays by less than a tilt does
    plain = replace(settings.refinement, refraction=False, earth_radius=None)
    observations = corrections.refine(measured, inputs.cameras, plain).observations
    taken = {strip.id for strip in inputs.strips}
    found: list[Strip] = []
    for camera in dict.fromkeys(strip.camera.name for strip in singles):
        of_camera = [strip for strip in singles if strip.camera.name == camera]
        for strip in _of_camera(of_camera, observations, settings):
            name = strip.id
            while name in taken:
                name += "'"
            taken.add(name)
            found.append(replace(strip, id=name))
    member = {name for strip in found for name in strip.photos}
    left = [strip for strip in singles if strip.id not in member]
    place = {strip.id: number for number, strip in enumerate(singles)}
    found.sort(key=lambda each: place[each.photos[0]])
    ordered = sorted([*found, *left], key=lambda each: place[each.photos[0]])
    strips = (*(strip for strip in inputs.strips if strip.listed), *ordered)
    return Start(replace(inputs, strips=strips), _of_found(len(singles), found, left))


def _of_found(number: int, found: Sequence[Strip], left: Sequence[Strip]) -> Note:
    strips = [f"{strip.id} ({counted(len(strip.photos), 'photo')})" for strip in found]
    among = f"{counted(len(found), 'strip')} found among them, {listed(strips)}" if found else "no strip among them"
    text = f"{counted(number, 'photo')} in no given order: {among}"
    if left:
        alone = counted(len(left), "photo is", "photos are")
        text += f"; {alone} oriented one by one, {listed(strip.id for strip in left)}"
    return Note("photos-in-no-order", text, "note")


def _of_camera(singles: Sequence[Strip], observations: PhotoPoints, settings: Settings) -> Iterator[Strip]:
    """Find the strips among photos of one camera."""
    names = [strip.id for strip in singles]

    def made(run: Run) -> Strip:
        photos = tuple(names[number] for number in run)
        return replace(singles[run[0]], id=f"{photos[0]}-{photos[-1]}", photos=photos)

    def place_of_refusal(run: Run) -> int:
        try:
            form_strip(made(run), observations, settings)
        except GeometryError as error:
            named = [place for place, number in enumerate(run) if names[number] in error.photos]
            return named[-1] if named else len(run) - 1
        return 0

    for run in _runs(mosaic.link(observations, names), place_of_refusal):
        yield made(run if run[0] < run[-1] else run[::-1])


def _runs(links: mosaic.PhotoLinks, place_of_refusal: Callable[[Run], int]) -> list[Run]:
    """Find runs of photos.

    place_of_refusal: gives the place in a run before which it must be cut to be formed; 0 where it can be.
    """
    known = np.flatnonzero(links.fits & (links.count >= MINIMUM_POINTS))
    order = known[np.lexsort((*links.photo[known].T[::-1], -links.count[known]))].tolist()
    ways: dict[int, dict[int, Way]] = {}  # of each photo to others
    for row in order:
        one, other = links.photo[row].tolist()
        count, (to_other, to_one) = int(links.count[row]), (complex(base[row]) for base in links.bases)
        ways.setdefault(one, {})[other] = Way(count, to_other / max(abs(to_other), mosaic.TINY))
        ways.setdefault(other, {})[one] = Way(count, to_one / max(abs(to_one), mosaic.TINY))
    found: list[Run] = []
    free = set(ways)
    for row in order:
        one, other = links.photo[row].tolist()
        if one not in free or other not in free:
            continue
        ahead = _continued((one, other), ways, free)
        for run in _cut(_continued(ahead[::-1], ways, free), place_of_refusal):
            found.append(run)
            free -= set(run)
    return found


class Way(NamedTuple):
    """Where another photo lies on a photo."""

    points: int  # in common
    direction: complex  # of its centre, length 1


def _continued(run: Run, ways: Mapping[int, Mapping[int, Way]], free: AbstractSet[int]) -> Run:
    """Go on at the end of a run as long as a photo lies ahead."""
    left = free - set(run)
    while True:
        before, last = run[-2:]
        forward = -ways[last][before].direction
        ahead: list[tuple[float, int]] = []
        for other, way in ways[last].items():
            cosine = (way.direction * forward.conjugate()).real
            if cosine > AHEAD and other in left:
                ahead.append((way.points * cosine, -other))
        if not ahead:
            return run
        run = (*run, -max(ahead)[1])
        left -= {run[-1]}


def _cut(run: Run, place_of_refusal: Callable[[Run], int]) -> Iterator[Run]:
    """Cut a run into parts of two photos or more that can be formed."""
    if len(run) < 2:
        return
    place = place_of_refusal(run)
    if not place:
        yield run
        return
    yield from _cut(run[:place], place_of_refusal)
    yield from _cut(run[place:], place_of_refusal)
