"""Markers of Agisoft Metashape beside any block, as "Export Markers" writes them, and references of its cameras.

A marker has its place in the reference system of the chunk, x to the east whatever the system says, and its marks on
the photos in pixels from the corner of the first one, in the first frame. Not enabled, it is a check point. Marks that
are not pinned were placed by Metashape, and are left out; no public source says more of them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.foreign.control import Asked, Marks, joined, no_precision
from photostrip.foreign.elements import Element
from photostrip.foreign.metashape import Chunk, label_of, read_chunk
from photostrip.foreign.places import unique
from photostrip.foreign.tables import ForeignBlock, GivenControl, GivenPositions
from photostrip.formats.faults import SMALLEST_LENGTH, shown
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import counted, listed


def with_markers(block: ForeignBlock, asked: Asked) -> ForeignBlock:
    """Put the markers of a chunk into a block: those with a reference are control, the others points to be found.

    Raises InputError with file and line for all that is none, and where it does not say what is needed.
    """
    chunk = read_chunk(asked.file)
    given = chunk.element.find("markers")
    if given is None:
        fix = "place markers on the photos, and export them (Export Markers), or the cameras with markers"
        raise chunk.element.wrong("has no markers", "no-points", fix=fix)
    markers = dict(unique("marker", ((each.place, each.attribute("id"), each) for each in given.within("marker"))))
    dict(unique("a marker called", ((each.place, label_of(each), each) for each in markers.values())))
    tied = [id_ for id_, each in markers.items() if _has_place(each)]
    ids = [*(id_ for id_ in markers if id_ not in set(tied)), *tied]
    names = {id_: label_of(markers[id_]) for id_ in ids}
    marks, left_out = _marks(chunk, block, names, asked)
    if not tied:
        return joined(block, None, marks, asked, left_out)
    crs = asked.crs or chunk.reference
    if not crs:
        fix = "give --crs CRS, as EPSG:32633; EPSG:4979 is longitude and latitude of WGS 84"
        message = "nothing says in which frame the markers lie"
        raise InputError(Fault(message, "option", asked.file, key="--crs", fix=fix))
    tie_frames([FrameSpec(crs, GROUND_AXES)], keys=["--crs"])
    references = [markers[id_].at("reference") for id_ in tied]
    control = GivenControl(
        source=f"markers of Metashape, {asked.file}",
        ids=tuple(names[id_] for id_ in tied),
        crs=crs,
        xyz=np.array([[each.number(axis) for axis in "xyz"] for each in references]),
        sigma=np.array(
            [_sigma(each, asked.sigma, chunk.accuracy("accuracy_markers"), asked.file) for each in references]
        ),
        check=tuple(not each.flag("enabled") for each in references),
        marks=int((marks.point >= len(ids) - len(tied)).sum()),
    )
    return joined(block, control, marks, asked, left_out)


def _has_place(owner: Element) -> bool:
    found = owner.find("reference")
    return found is not None and {"x", "y", "z"} <= found.attributes.keys()


def _sigma(
    given: Element, asked: tuple[float, float, float] | None, usual: float | None, file: str
) -> tuple[float, float, float]:
    """Give the standard deviations of a reference: its own, what an option says, or those of the settings."""
    if {"sx", "sy", "sz"} <= given.attributes.keys():
        found = given.number("sx"), given.number("sy"), given.number("sz")
    elif asked is not None or usual is not None:
        found = asked or (usual or 0.0,) * 3
    else:
        raise InputError(no_precision(file))
    if not min(found) > SMALLEST_LENGTH:
        raise given.wrong("a standard deviation is not above 0", "range")
    return found


class Location(NamedTuple):
    """A mark, the name of its photo in the chunk, and its marker."""

    element: Element
    photo: str
    marker: str


def _locations(chunk: Chunk, frame: Element, markers: Collection[str]) -> Iterator[Location]:
    labels = {id_: label_of(each) for id_, each in chunk.cameras().items()}
    for marker in frame.within("marker"):
        id_ = marker.attribute("marker_id")
        if id_ not in markers:
            raise marker.wrong(f"there is no marker {shown(id_)}", "unknown-point")
        for mark in marker.within("location"):
            label = labels.get(mark.attribute("camera_id"))
            if label is None:
                raise mark.wrong(f"there is no camera {shown(mark.attribute('camera_id'))}", "unknown-photo")
            yield Location(mark, label, id_)


def _marks(chunk: Chunk, block: ForeignBlock, names: Mapping[str, str], asked: Asked) -> tuple[Marks, list[str]]:
    """Give the pinned marks of the first frame, and what was left out; `names` has the markers by their ids."""
    frames = chunk.element.find("frames")
    every = [] if frames is None else [each for each in frames.children if each.name == "frame"]
    found = list(_locations(chunk, every[0], names)) if every else []
    pinned = [each for each in found if each.element.flag("pinned")]
    photos = _matched(list(dict.fromkeys(each.photo for each in pinned)), block.photos)
    kept = [each for each in pinned if each.photo in photos]
    strange = list(dict.fromkeys(each.photo for each in pinned if each.photo not in photos))
    if not kept:
        message = "no marker is pinned on a photo of the block"
        if strange:
            message += f": its photos are {listed(strange, 4)}, those of the block {listed(block.photos, 4)}"
        fix = "place the markers on the photos, and export the markers, too"
        raise chunk.element.wrong(message, "no-points", fix=fix)
    on = ((each.element.place, f"{names[each.marker]} on photo {each.photo}", each) for each in kept)
    dict(unique("the mark of", on))
    left_out = []
    if len(pinned) < len(found):
        left_out.append(f"{counted(len(found) - len(pinned), 'mark')} that Metashape placed by itself (not pinned)")
    if strange:
        number = len(pinned) - len(kept)
        left_out.append(f"{counted(number, 'mark')} on photos that the block does not have: {listed(strange, 4)}")
    if len(every) > 1:
        left_out.append(f"{counted(len(every) - 1, 'frame')} after the first")
    place = {id_: number for number, id_ in enumerate(names)}
    marks = Marks(
        ids=tuple(names.values()),
        photo=np.array([photos[each.photo] for each in kept]),
        point=np.array([place[each.marker] for each in kept]),
        xy=np.array([_pixels(each.element, block, photos[each.photo], asked) for each in kept]),
    )
    return marks, left_out


def _pixels(mark: Element, block: ForeignBlock, photo: int, asked: Asked) -> list[float]:
    width, height = block.image_size(photo)
    factor = 1.0 if asked.width is None else width / asked.width
    x, y = factor * mark.number("x"), factor * mark.number("y")
    if not (0.0 <= x <= width and 0.0 <= y <= height):
        message = f"the mark lies outside photo {shown(block.photos[photo])}, which has {width:g} x {height:g} px"
        raise mark.wrong(message, "range", fix="if photos of another width were marked, give that: --mark-width PX")
    return [x, y]


def _matched(labels: list[str], photos: tuple[str, ...]) -> dict[str, int]:
    """Find the photo of each label by its name, or by the last part of it without an ending where only one has it."""
    whole = {name: place for place, name in enumerate(photos)}
    by_stem: dict[str, list[int]] = {}
    for place, name in enumerate(photos):
        by_stem.setdefault(_stem(name), []).append(place)
    found = {label: whole.get(label, -1) for label in labels}
    for label, place in found.items():
        near = by_stem.get(_stem(label), [])
        if place < 0 and len(near) == 1:
            found[label] = near[0]
    return {label: place for label, place in found.items() if place >= 0}


def _stem(name: str) -> str:
    return Path(name.replace("\\", "/").rpartition("/")[2]).stem.casefold()


def with_references(block: ForeignBlock, file: str) -> ForeignBlock:
    """Give the photos of a block the positions that are their references in a chunk.

    Raises InputError with file and line for all that is none, and where nothing says how precise they are.
    """
    chunk = read_chunk(file)
    cameras = {label_of(each): each for each in chunk.cameras().values()}
    photos = {place: label for label, place in _matched(list(cameras), block.photos).items()}
    given: dict[int, Element] = {}
    for place, label in photos.items():
        if _has_place(cameras[label]) and cameras[label].at("reference").flag("enabled"):
            given[place] = cameras[label].at("reference")
    if not given:
        raise chunk.element.wrong("no photo of the block has a reference that is enabled", "no-points")
    if not chunk.reference:
        raise chunk.element.wrong(
            "has no reference system", fix="choose one in Metashape, and export the cameras again"
        )
    tie_frames([FrameSpec(chunk.reference, GROUND_AXES)], keys=["--positions"])
    xyz, sigma = np.full((len(block.photos), 3), np.nan), np.full((len(block.photos), 3), np.nan)
    usual = chunk.accuracy("accuracy_cameras")
    for place, each in given.items():
        xyz[place] = [each.number(axis) for axis in "xyz"]
        sigma[place] = _sigma(each, None, usual, file)
    said = (
        f"references of {counted(len(given), 'photo')} in Metashape; {chunk.reference}, heights taken as ellipsoidal; "
        "of the antenna: give its lever_arm in the project"
    )
    return replace(
        block,
        files=(*block.files, file),
        positions=GivenPositions(xyz=xyz, sigma=sigma, said=said, crs=chunk.reference),
    )
