"""What the files of another program hold, in the words of a project."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from photostrip.arrays import Floats, Numbers
from photostrip.strip.image_coordinates.pixel_cameras import PixelCamera

WGS84 = "EPSG:4979"  # longitude, latitude, ellipsoidal height


@dataclass(frozen=True, eq=False)
class GivenControl:
    """Ground coordinates of points, which are rays of the block, too."""

    source: str  # what was read
    ids: tuple[str, ...]
    crs: str
    # (m, 3): east, north, up; heights that are not known are NaN
    xyz: Floats
    sigma: Floats  # metres
    check: tuple[bool, ...]
    marks: int  # how many were taken


@dataclass(frozen=True, eq=False)
class GivenPositions:
    """Measured positions of all photos of a block, WGS 84 with ellipsoidal heights."""

    xyz: Floats  # (m, 3): longitude, latitude in degrees, height in metres
    sigma: Floats  # (m, 3): east, north, up in metres
    said: str  # which photo has which, and of what they are


@dataclass(frozen=True, eq=False)
class ForeignBlock:
    """Photos in no order, measured in pixels from the corner of the first one, with rough orientations."""

    source: str  # what was read, as "COLMAP model (binary)"
    files: tuple[str, ...]
    frame: str  # where the centres are, in words
    cameras: Mapping[str, PixelCamera]
    photos: tuple[str, ...]  # ids
    camera_of: tuple[str, ...]  # of each photo
    points: tuple[str, ...]  # ids
    # rays, (n,): number of their photo and of their point; (n, 2): x to the right, y down
    photo: Numbers
    point: Numbers
    xy: Floats
    # (m, 3), (m, 3, 3): perspective centres, and rotations from image axes (x right, y up, z towards the viewer)
    centers: Floats
    rotations: Floats
    sigma: Floats | None = None  # (n,): standard deviation of each ray in pixels; NaN, or None: as for all
    control: GivenControl | None = None
    positions: GivenPositions | None = None
    beside: tuple[str, ...] = ()  # files of control that lie beside the others
    left_out: tuple[str, ...] = ()  # sentences
