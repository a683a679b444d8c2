"""What is to be simulated: the camera, the flight, the ground, the measurements and what is wrong with them.

The fields of these classes are the keys of a specification file, under the same names; what each is says ``photostrip
schema --simulation``, what that leaves open stands here. Quantities carry their unit in the name or are metres,
millimetres in the image or plain numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from photostrip.camera import Camera

FILM = Camera(
    "film",
    principal_distance=153.0,
    format=(230.0, 230.0),
    fiducials={
        "F1": (106.0, -106.0),
        "F2": (-106.0, -106.0),
        "F3": (-106.0, 106.0),
        "F4": (106.0, 106.0),
        "F5": (0.0, -110.0),
        "F6": (-110.0, 0.0),
        "F7": (0.0, 110.0),
        "F8": (110.0, 0.0),
    },
)
DIGITAL = Camera("digital", principal_distance=100.5, format=(67.86, 103.86), pixel_size=0.006)
PRESETS = {"film": FILM, "digital": DIGITAL}

DEFAULT_SCALE = 10_000.0
LAYOUTS = ("bands", "corners", "corners+centre", "random")
USES = ("xyz", "xy", "z")
MODEL_AXES, HANDS = ("level", "any"), ("right-handed", "left-handed")
ERROR_KINDS = ("image", "control", "swap")

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Ground:
    """The frame of the ground coordinates, and where in it the strips lie."""

    crs: str = "EPSG:32633"
    axes: tuple[str, str, str] = ("east", "north", "up")
    height: str = "ellipsoidal"  # or ``orthometric``
    geoid_undulation: float | None = None
    ellipsoid: tuple[float, float] | None = None  # semi-axes (a, b), metres, of another body with ``geocentric``
    # on the datum of `crs`; not used with ``local``, where the middle is the origin
    center_deg: tuple[float, float] = (15.3, 49.2)


@dataclass(frozen=True)
class Flight:
    """Where the photos are taken and in which attitude."""

    photos: int = 10
    strips: int = 1
    # end_lap_percent, side_lap_percent: overlap of neighbouring photos and strips at the mean height of the terrain.
    # When the photos are turned (`photo_rotation_deg`), that of the largest upright rectangle of the same proportions
    # in them
    end_lap_percent: float = 60.0
    side_lap_percent: float = 30.0
    scale: float | None = None
    flying_height: float | None = None
    heading_deg: float = 90.0  # in the middle of the strips; in ``local`` from the second axis
    alternate: bool = False
    photo_rotation_deg: float = 0.0
    attitude_sigma_deg: Triple = (1.0, 1.0, 1.0)  # cut off at three times its size, as the next
    position_sigma: Triple | None = None


@dataclass(frozen=True)
class Terrain:
    """The shape of the ground."""

    height: float = 300.0
    relief: float = 60.0  # above or below the sloping plane
    wavelength: float | None = None
    slope_percent: tuple[float, float] = (0.0, 0.0)  # along the first strip


@dataclass(frozen=True)
class Points:
    """Pass points."""

    rows: int = 3  # each lies on three photos
    reach_percent: float = 80.0
    scatter_percent: float = 25.0
    extra_per_model: int = 4


@dataclass(frozen=True)
class Control:
    """Which points are given on the ground, and how well."""

    layout: str = "bands"
    bands: int = 3
    every: int | None = None  # the last photo always has a band
    per_band: int = 3  # points of a band: 1 in the middle, 2 at the edges, and so on; at most ``points.rows``
    count: int = 8
    use: dict[str, float] = field(default_factory=lambda: {"xyz": 1.0})
    check: int | None = None
    sigma: Triple = (0.05, 0.05, 0.08)
    noise: Triple | None = None
    second_crs: str | None = None
    boundary_longitude_deg: float | None = None


@dataclass(frozen=True)
class Image:
    sigma_um: float = 5.0
    unit: str = "mm"
    y_axis: str = "up"


@dataclass(frozen=True)
class Film:
    """Deformation of the film and its place in the comparator, different on each photo."""

    scale_ppm: float = 150.0
    shear_ppm: float = 50.0
    irregular_um: float = 0.0
    rotation_deg: float = 1.0
    offset_mm: float = 3.0


@dataclass(frozen=True)
class GrossError:
    kind: str
    count: int = 1
    size_um: float = 200.0
    size_m: float = 5.0
    # photo, point: a swap takes a second point at random. Control and check points answer to their own names (G01, K01)
    # and to those of the pass points that they are
    photo: str | None = None
    point: str | None = None
    axis: str | None = None


@dataclass(frozen=True)
class Gnss:
    """Measured positions of the perspective centres."""

    sigma: Triple = (0.10, 0.10, 0.15)
    use: bool = False


@dataclass(frozen=True)
class Models:
    """Independent models measured on a plotter, in place of image coordinates."""

    sigma_um: Triple = (10.0, 10.0, 15.0)
    center_sigma_um: Triple = (20.0, 20.0, 20.0)
    scale: float | None = None
    axes: str = "level"
    hand: str = "right-handed"
    centers: bool = True


@dataclass(frozen=True)
class Spec:
    """A whole simulation; the defaults give a film strip of ten photos, 1:10 000, on the real Earth."""

    name: str = "simulated"
    seed: int = 1
    camera: Camera = FILM
    ground: Ground = field(default_factory=Ground)
    flight: Flight = field(default_factory=Flight)
    terrain: Terrain = field(default_factory=Terrain)
    points: Points = field(default_factory=Points)
    control: Control = field(default_factory=Control)
    image: Image = field(default_factory=Image)
    film: Film | None = None
    refraction: bool = False
    gross_errors: tuple[GrossError, ...] = ()
    gnss: Gnss | None = None
    models: Models | None = None

    @property
    def format(self) -> tuple[float, float]:
        """Width and height of the photo, mm."""
        return self.camera.format or (230.0, 230.0)

    @property
    def flying_height(self) -> float:
        """Height above the mean height of the terrain, metres."""
        if self.flight.flying_height is not None:
            return self.flight.flying_height
        return (self.flight.scale or DEFAULT_SCALE) * self.camera.principal_distance / 1000.0

    @property
    def scale(self) -> float:
        """Scale number of the photos at the mean height of the terrain."""
        return self.flying_height / (self.camera.principal_distance / 1000.0)

    @property
    def footprint(self) -> tuple[float, float]:
        """Length along and width across the flight of what a photo covers, metres.

        That of the largest rectangle of the photo's proportions whose sides are parallel to the flight: for photos
        turned by multiples of 90 degrees the whole photo.
        """
        quarter, rest = divmod(self.flight.photo_rotation_deg + 45.0, 90.0)
        along, across = self.format if quarter % 2 == 0 else self.format[::-1]
        turn = abs(math.radians(rest - 45.0))
        sin, cos = math.sin(turn), math.cos(turn)
        part = min(along / (along * cos + across * sin), across / (along * sin + across * cos))
        metres = part * self.scale / 1000.0
        return along * metres, across * metres

    @property
    def base(self) -> float:
        """Distance of neighbouring perspective centres, metres on the ground."""
        return self.footprint[0] * (1.0 - self.flight.end_lap_percent / 100.0)

    @property
    def strip_distance(self) -> float:
        """Distance of neighbouring strips, metres on the ground."""
        return self.footprint[1] * (1.0 - self.flight.side_lap_percent / 100.0)
