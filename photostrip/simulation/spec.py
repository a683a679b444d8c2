"""What is to be simulated: the camera, the flight, the ground, the measurements and what is wrong with them.

The fields of these classes are the keys of a specification file, under the same names. Quantities carry their unit
in the name or are metres, millimetres in the image or plain numbers.
"""

from __future__ import annotations

import math
from dataclasses import field

from photostrip.camera import Camera
from photostrip.frozen import dataclass

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

    # authority code, PROJ string, ``geocentric`` or ``local``. With ``local`` the world is flat
    crs: str = "EPSG:32633"
    axes: tuple[str, str, str] = ("east", "north", "up")  # order of the coordinates in the files
    height: str = "ellipsoidal"  # ``ellipsoidal`` or ``orthometric``: the heights in the files
    geoid_undulation: float | None = None  # height of the geoid above the ellipsoid, metres, for orthometric heights
    ellipsoid: tuple[float, float] | None = None  # semi-axes (a, b), metres, of another body with ``geocentric``
    # longitude and latitude of the middle of the strips on the datum of `crs`, degrees. Not used with ``local``, where
    # the middle is the origin
    center_deg: tuple[float, float] = (15.3, 49.2)


@dataclass(frozen=True)
class Flight:
    """Where the photos are taken and in which attitude."""

    photos: int = 10
    strips: int = 1  # parallel strips; each next one lies to the left of the one before
    # end_lap_percent, side_lap_percent: overlap of neighbouring photos and strips at the mean height of the terrain.
    # When the photos are turned (`photo_rotation_deg`), that of the largest upright rectangle of the same proportions
    # in them
    end_lap_percent: float = 60.0
    side_lap_percent: float = 30.0
    # scale number of the photos at the mean height of the terrain; 10 000 when neither it nor `flying_height` is given
    scale: float | None = None
    flying_height: float | None = None  # height above the mean height of the terrain, metres
    # azimuth of the flight in the middle of the strips, clockwise from north (from the second axis in ``local``)
    heading_deg: float = 90.0
    alternate: bool = False  # fly every second strip in the opposite direction
    # constant turn of the photo's x axis against the direction of flight, counter-clockwise seen from above
    photo_rotation_deg: float = 0.0
    attitude_sigma_deg: Triple = (1.0, 1.0, 1.0)  # scatter of alpha, omega and kappa, cut off at three times its size
    # scatter of the perspective centres along, across and in height, metres, cut off likewise; None: 2, 2 and 1 percent
    # of the base
    position_sigma: Triple | None = None


@dataclass(frozen=True)
class Terrain:
    """The shape of the ground."""

    height: float = 300.0  # mean height above the ellipsoid, metres
    relief: float = 60.0  # largest height above or below the sloping plane, metres; 0 is flat
    wavelength: float | None = None  # mean distance of hills, metres; None: three bases
    slope_percent: tuple[float, float] = (0.0, 0.0)  # rise along the first strip's direction of flight and to its left


@dataclass(frozen=True)
class Points:
    """Pass points."""

    rows: int = 3  # Gruber points of each photo, side by side across the flight at its nadir; each lies on three photos
    # distance of the outermost rows from the flight line, in percent of half the width of the photos
    reach_percent: float = 80.0
    # scatter of the Gruber points, in percent of half the width of the zone on three photos
    scatter_percent: float = 25.0
    extra_per_model: int = 4  # further points at random places of each model


@dataclass(frozen=True)
class Control:
    """Which points are given on the ground, and how well."""

    # ``bands`` across the strip, ``corners``, ``corners+centre`` or ``random``; always in each strip
    layout: str = "bands"
    bands: int = 3  # number of bands, spread evenly from the first to the last photo
    every: int | None = None  # models from one band to the next, instead of `bands`; the last photo always has a band
    per_band: int = 3  # points of a band: 1 in the middle, 2 at the edges, and so on; at most ``points.rows``
    count: int = 8  # control points of each strip in the layout ``random``
    # shares of the points given in full (``xyz``), in plan only (``xy``), in height only (``z``)
    use: dict[str, float] = field(default_factory=lambda: {"xyz": 1.0})
    # check points, anywhere; None: ten, or half of the points that are left when that is fewer
    check: int | None = None
    sigma: Triple = (0.05, 0.05, 0.08)  # stated standard deviations east, north, up (X, Y, Z), metres
    noise: Triple | None = None  # errors really added, standard deviations, metres; None: as stated
    second_crs: str | None = None  # frame of a second control file, for the points east of `boundary_longitude_deg`
    # where the second file begins, degrees; None: in the middle of the strips
    boundary_longitude_deg: float | None = None


@dataclass(frozen=True)
class Image:
    sigma_um: float = 5.0  # standard deviation of each coordinate, micrometres; 0 is free of errors
    unit: str = "mm"  # ``mm``, ``um`` or ``px`` in the files
    y_axis: str = "up"  # ``up`` or ``down`` in the files


@dataclass(frozen=True)
class Film:
    """Deformation of the film and its place in the comparator, different on each photo."""

    # scale_ppm, shear_ppm: scatter of the change of scale of each axis, and of the angle between the axes, parts per
    # million
    scale_ppm: float = 150.0
    shear_ppm: float = 50.0
    irregular_um: float = 0.0  # rms of a smooth deformation that is not affine, micrometres
    rotation_deg: float = 1.0  # scatter of the turn of the film in the comparator
    offset_mm: float = 3.0


@dataclass(frozen=True)
class GrossError:
    # ``image``: an image coordinate; ``control``: a given coordinate; ``swap``: two points exchanged on a photo
    kind: str
    count: int = 1
    size_um: float = 200.0  # size of an error of an image coordinate, micrometres
    size_m: float = 5.0  # size of an error of a given coordinate, metres
    # photo, point: where; None: anywhere. A swap takes a second point at random. Control and check points answer to
    # their own names (G01, K01) and to those of the pass points that they are
    photo: str | None = None
    point: str | None = None
    # ``x`` or ``y`` (image, y up), ``x``, ``y`` or ``z`` (east, north, up at control); None: any
    axis: str | None = None


@dataclass(frozen=True)
class Gnss:
    """Measured positions of the perspective centres."""

    sigma: Triple = (0.10, 0.10, 0.15)  # standard deviations east, north, up (X, Y, Z), metres
    use: bool = False  # name the file in the project


@dataclass(frozen=True)
class Models:
    """Independent models measured on a plotter, in place of image coordinates."""

    # sigma_um, center_sigma_um: standard deviations of x, y, z of points and of perspective centres at model scale,
    # micrometres; 0 without errors
    sigma_um: Triple = (10.0, 10.0, 15.0)
    center_sigma_um: Triple = (20.0, 20.0, 20.0)
    scale: float | None = None  # mean scale number of the models; None: that of the photos
    # ``level``: the axes of a model are nearly level, turned about the vertical; ``any``: they lie in any way
    axes: str = "level"
    hand: str = "right-handed"  # ``right-handed`` or ``left-handed``
    centers: bool = True


@dataclass(frozen=True)
class Spec:
    """A whole simulation; the defaults give a film strip of ten photos, 1:10 000, on the real Earth."""

    name: str = "simulated"
    seed: int = 1  # number that all random numbers come from
    camera: Camera = FILM
    ground: Ground = field(default_factory=Ground)
    flight: Flight = field(default_factory=Flight)
    terrain: Terrain = field(default_factory=Terrain)
    points: Points = field(default_factory=Points)
    control: Control = field(default_factory=Control)
    image: Image = field(default_factory=Image)
    film: Film | None = None  # film deformation; fiducial marks are measured when it is given
    refraction: bool = False  # bend the rays as the standard atmosphere does
    gross_errors: tuple[GrossError, ...] = ()
    gnss: Gnss | None = None  # measured positions of the perspective centres
    models: Models | None = None  # models measured on a plotter, in place of image coordinates

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
