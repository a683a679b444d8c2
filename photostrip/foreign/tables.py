"""What the files of another program hold, in the words of a project."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.strip.pixel_cameras import PIXEL_SIZE, PixelCamera

WGS84 = "EPSG:4979"  # longitude, latitude, ellipsoidal height
NORTHERNMOST, ROUND = 90.0, 360.0  # degrees of latitude and longitude


@dataclass(frozen=True)
class Wanted:
    """What the files do not carry."""

    sigma: float  # standard deviation of an image coordinate in pixels
    pixel_size: float | None = None  # mm
    image_size: tuple[float, float] | None = None  # width and height in pixels
    positions_sigma: tuple[float, float, float] | None = None  # east, north, up in metres


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
    """Measured positions of the photos of a block."""

    xyz: Floats  # (m, 3): east, north, up; longitude, latitude in degrees; NaN of a photo without one
    sigma: Floats  # (m, 3): east, north, up in metres
    said: str  # which photo has which, and of what they are
    crs: str = WGS84


@dataclass(frozen=True, eq=False)
class ForeignBlock:
    """Photos in no order, measured in pixels from the corner of the first one, with rough orientations or without."""

    source: str  # what was read, as "COLMAP model (binary)"
    files: tuple[str, ...]
    frame: str  # where the centres are, in words
    cameras: Mapping[str, PixelCamera | Camera]  # in pixels, or in millimetres with format and size of a pixel
    photos: tuple[str, ...]  # ids
    camera_of: tuple[str, ...]  # of each photo
    points: tuple[str, ...]  # ids
    # rays, (n,): number of their photo and of their point; (n, 2): x to the right, y down
    photo: Numbers
    point: Numbers
    xy: Floats
    # (m, 3), (m, 3, 3): perspective centres, and rotations from image axes (x right, y up, z towards the viewer)
    centers: Floats | None = None
    rotations: Floats | None = None
    sigma: Floats | None = None  # (n,): standard deviation of each ray in pixels; NaN, or None: as for all
    control: GivenControl | None = None
    positions: GivenPositions | None = None
    crs: str = "local"  # of the centres: ``local`` of any place, direction and scale, or ``geocentric``
    center_sigma: Floats | None = None  # (m, 3): standard deviations of the centres; NaN where there is none
    calibrated: Mapping[str, str] = field(default_factory=dict)  # standard deviations of cameras, in words
    beside: tuple[str, ...] = ()  # files of control that lie beside the others
    left_out: tuple[str, ...] = ()  # sentences

    def image_size(self, photo: int) -> tuple[float, float]:
        """Width and height of a photo in pixels."""
        camera = self.cameras[self.camera_of[photo]]
        if isinstance(camera, PixelCamera):
            return camera.image_size
        size = camera.pixel_size or PIXEL_SIZE
        width, height = camera.format or (0.0, 0.0)
        return width / size, height / size
