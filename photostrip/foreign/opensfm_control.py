"""Control of OpenSfM, ``ground_control_points.json``: places on the ground, and rays in parts of the photo.

Longitude and latitude of WGS 84; heights are taken as ellipsoidal where nothing else is said. Points without a position
are tie points that were measured by hand; those with the role ``metrics_only`` are check points.

OpenSfM documents the file in opensfm.org/docs/gcp.html.
"""

from __future__ import annotations

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.foreign.control import Asked, Marks, joined, no_precision
from photostrip.foreign.nodes import Node, read_nodes
from photostrip.foreign.opensfm import pixels
from photostrip.foreign.places import unique
from photostrip.foreign.tables import WGS84, ForeignBlock, GivenControl
from photostrip.formats.faults import shown
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import counted, listed


def with_ground_control(block: ForeignBlock, asked: Asked) -> ForeignBlock:
    """Put control into a block whose photos have the names of the file.

    Raises InputError with file and record for all that is no such file, and where it does not say what is needed.
    """
    if asked.width is not None:
        message = "the marks are parts of the photo, whatever its width"
        raise InputError(Fault(message, "option", asked.file, key="--mark-width", fix="leave it out"))
    entries = read_nodes(asked.file).at("points").items("point")
    given = dict(unique("point", ((each.place, _name(each), each) for each in entries)))
    tied = [name for name, each in given.items() if each.at("position").value is not None]
    if not tied:
        raise InputError(Fault("no point has a position", "no-points", asked.file))
    if asked.sigma is None:
        raise InputError(no_precision(asked.file))
    crs = asked.crs or WGS84
    tie_frames([FrameSpec(crs, GROUND_AXES)], keys=["--crs"])
    ids = (*[name for name in given if name not in set(tied)], *tied)
    photos = {name: number for number, name in enumerate(block.photos)}
    photo, point, xy, strange = [], [], [], []
    for number, name in enumerate(ids):
        for shot, where in _rays(given[name]):
            if shot not in photos:
                strange.append(shot)
                continue
            size = block.image_size(photos[shot])
            place = pixels(where.numbers(2), size)
            if (place < 0.0).any() or (place > size).any():
                raise where.wrong("the mark lies outside the photo", "range", expected="parts of its larger side")
            photo.append(photos[shot])
            point.append(number)
            xy.append(place)
    if not xy:
        message = f"none of its photos is in the block: {listed(strange, 4)}; the block has {listed(block.photos, 4)}"
        raise InputError(Fault(message, "unknown-photo", asked.file))
    control = GivenControl(
        source=f"control of OpenSfM, {asked.file}",
        ids=tuple(tied),
        crs=crs,
        xyz=np.array([_position(given[name].at("position")) for name in tied]),
        sigma=np.tile(asked.sigma, (len(tied), 1)),
        check=tuple(given[name].at("role").value == "metrics_only" for name in tied),
        marks=sum(each >= len(ids) - len(tied) for each in point),
    )
    said = f"{counted(len(strange), 'mark')} on photos that the block does not have: {listed(strange, 4)}"
    marks = Marks(ids=ids, photo=np.array(photo), point=np.array(point), xy=np.array(xy))
    return joined(block, control, marks, asked, [said] if strange else [])


def _name(point: Node) -> str:
    name = point.at("id").text().strip()
    if not name or not name.isprintable():
        raise point.wrong(f"`{shown(name)}` is no id of a point", expected="a text on one line")
    return name


def _position(given: Node) -> list[float]:
    """Read east, north, up; a height that is not known is NaN."""
    height = given.at("altitude")
    place = [given.at("longitude").number(), given.at("latitude").number()]
    return [*place, np.nan if height.value is None else height.number()]


def _rays(point: Node) -> list[tuple[str, Node]]:
    """Give photo and image coordinates of each observation; refuse a photo that stands twice."""
    rows = list(point.at("observations").items(f"{point.place.record} observation"))
    named = ((each.place, each.at("shot_id").text(), each.at("projection")) for each in rows)
    return list(unique("photo", named))
