"""What is to be simulated: the camera, the flight, the ground, the measurements and what is wrong with them.

The fields of these classes are the keys of a specification file, under the same names; what each is says ``photostrip
schema --simulation``, what that leaves open stands here. Quantities carry their unit in the name or are metres,
millimetres in the image or plain numbers.

What cannot be simulated, said in words before anything is computed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from photostrip.camera import Camera
from photostrip.errors import Fault
from photostrip.notes import counted
from photostrip.strip import corrections

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


LEAST_LAP, LARGEST_LAP = 50.0, 95.0  # percent; up to 50 % no point lies on three photos
LARGEST_SIDE_LAP = 90.0
MOST_PHOTOS = 20_000  # of all strips
MOST_POINTS = 1_000_000
LEAST_DEPTH = 0.2  # of the flying height: nearer to the camera no terrain may come
LARGEST_TILT_DEG = 25.0
LARGEST_LON, LARGEST_LAT = 360.0, 90.0  # degrees
LARGEST_ARC = 0.5  # radians of the body that strips may cover


def faults_of(spec: Spec) -> list[Fault]:
    """Everything in a specification that cannot be simulated, with the paths of the keys."""
    found = [fault for part in (_camera, _flight, _terrain, _points, _control, _image, _models) for fault in part(spec)]
    return [*found, *_errors(spec), *(() if found else _together(spec))]


def _fault(key: str, message: str, expected: str = "", fix: str = "") -> Fault:
    return Fault(message, code="simulation-spec", key=key, expected=expected, fix=fix)


def _range(key: str, value: float | None, low: float, high: float, unit: str = "") -> Iterator[Fault]:
    """Refuse a number outside [low, high], or one that is no number; None is sound."""
    if value is not None and not low <= value <= high:
        unit = f" {unit}" if unit else ""
        yield _fault(key, f"{value:g}{unit} is out of range", f"{low:g} to {high:g}{unit}")


def _each(key: str, values: tuple[float, ...] | None, low: float, high: float, unit: str) -> Iterator[Fault]:
    for value in values or ():
        yield from _range(key, value, low, high, unit)


def _models(spec: Spec) -> Iterator[Fault]:
    """Refuse models that no plotter measures, and what belongs to images."""
    models = spec.models
    if models is None:
        return
    yield from _each("models.sigma_um", models.sigma_um, 0.0, 10_000.0, "um")
    yield from _each("models.center_sigma_um", models.center_sigma_um, 0.0, 10_000.0, "um")
    yield from _range("models.scale", models.scale, 1.0, 1e7)
    for key, word, words in (("axes", models.axes, MODEL_AXES), ("hand", models.hand, HANDS)):
        if word not in words:
            yield _fault(f"models.{key}", f"`{word}` is not known", " or ".join(words))
    of_images = {"film": spec.film is not None, "refraction": spec.refraction}
    of_images["gross_errors"] = any(error.kind != "control" for error in spec.gross_errors)
    for key in (key for key, asked in of_images.items() if asked):
        yield _fault(key, "belongs to image coordinates, and models are measured", fix="remove it, or `models`")


def _camera(spec: Spec) -> Iterator[Fault]:
    camera = spec.camera
    yield from _range("camera.principal_distance", camera.principal_distance, 1.0, 10_000.0, "mm")
    if camera.format is None:
        yield _fault("camera.format", "the camera has no format", "width and height of the photo in mm")
    yield from _each("camera.format", camera.format, 1.0, 2_000.0, "mm")
    for fault in corrections.distortion_faults(camera):
        yield replace(fault, key="camera.distortion")
    yield from _range("camera.pixel_size", camera.pixel_size, 1e-5, 1.0, "mm")


def _flight(spec: Spec) -> Iterator[Fault]:
    flight = spec.flight
    if flight.photos < 2:
        yield _fault("flight.photos", f"{counted(flight.photos, 'photo')} cannot make a strip", "two or more")
    if flight.strips < 1:
        yield _fault("flight.strips", f"{counted(flight.strips, 'strip')} cannot be simulated", "one or more")
    if flight.photos * flight.strips > MOST_PHOTOS:
        number = flight.photos * flight.strips
        yield _fault("flight.photos", f"{number} photos are too many", f"at most {MOST_PHOTOS} in all strips")
    if not LEAST_LAP < flight.end_lap_percent <= LARGEST_LAP:
        low = "with it no point lies on three photos" if flight.end_lap_percent <= LEAST_LAP else "photos hardly move"
        yield _fault(
            "flight.end_lap_percent",
            f"an end lap of {flight.end_lap_percent:g} % cannot be simulated: {low}",
            f"more than {LEAST_LAP:g} and at most {LARGEST_LAP:g}",
        )
    yield from _range("flight.side_lap_percent", flight.side_lap_percent, 0.0, LARGEST_SIDE_LAP, "%")
    if flight.scale is not None and flight.flying_height is not None:
        yield _fault("flight.scale", "scale and flying_height are both given", "one of them")
    yield from _range("flight.scale", flight.scale, 1.0, 1e7)
    yield from _range("flight.flying_height", flight.flying_height, 0.1, 1e6, "m")
    yield from _range("flight.heading_deg", flight.heading_deg, -360.0, 360.0, "degrees")
    yield from _range("flight.photo_rotation_deg", flight.photo_rotation_deg, -360.0, 360.0, "degrees")
    yield from _each("flight.attitude_sigma_deg", flight.attitude_sigma_deg, 0.0, LARGEST_TILT_DEG, "degrees")
    yield from _each("flight.position_sigma", flight.position_sigma, 0.0, 1e6, "m")


def _terrain(spec: Spec) -> Iterator[Fault]:
    terrain = spec.terrain
    yield from _range("terrain.height", terrain.height, -1e5, 1e5, "m")
    yield from _range("terrain.relief", terrain.relief, 0.0, 1e5, "m")
    yield from _range("terrain.wavelength", terrain.wavelength, 1e-3, 1e9, "m")
    yield from _each("terrain.slope_percent", terrain.slope_percent, -50.0, 50.0, "%")


def _points(spec: Spec) -> Iterator[Fault]:
    points = spec.points
    yield from _range("points.rows", points.rows, 2, 50)
    yield from _range("points.reach_percent", points.reach_percent, 10.0, 97.0, "%")
    yield from _range("points.scatter_percent", points.scatter_percent, 0.0, 100.0, "%")
    yield from _range("points.extra_per_model", points.extra_per_model, 0, 10_000)
    number = spec.flight.photos * spec.flight.strips * (points.rows + points.extra_per_model)
    if number > MOST_POINTS:
        yield _fault("points.extra_per_model", f"{number} points are too many", f"at most {MOST_POINTS}")


def _control(spec: Spec) -> Iterator[Fault]:
    control, last = spec.control, spec.flight.photos - 1
    if control.layout not in LAYOUTS:
        yield _fault("control.layout", f"the layout {control.layout!r} is not known", " | ".join(LAYOUTS))
    if control.layout == "bands":
        yield from _range("control.bands", control.bands, 1, max(last + 1, 2))
        yield from _range("control.per_band", control.per_band, 1, spec.points.rows)
        yield from _range("control.every", control.every, 1, max(last, 1), "models")
    if control.layout == "random":
        yield from _range("control.count", control.count, 1, MOST_POINTS)
    yield from _range("control.check", control.check, 0, MOST_POINTS)
    for name, share in control.use.items():
        if name not in USES:
            yield _fault(f"control.use.{name}", f"{name!r} is no set of coordinates", " | ".join(USES))
        yield from _range(f"control.use.{name}", share, 0.0, 1e6)
    if not sum(control.use.values()) > 0.0:
        yield _fault("control.use", "no coordinates are given at all", "shares of xyz, xy, z")
    yield from _each("control.sigma", control.sigma, 1e-6, 1e4, "m")
    yield from _each("control.noise", control.noise, 0.0, 1e4, "m")
    yield from _boundary(spec)


def _boundary(spec: Spec) -> Iterator[Fault]:
    control = spec.control
    if control.boundary_longitude_deg is not None and control.second_crs is None:
        yield _fault("control.boundary_longitude_deg", "a boundary needs a second frame", fix="add second_crs")
    yield from _range("control.boundary_longitude_deg", control.boundary_longitude_deg, -360.0, 360.0, "degrees")
    if control.second_crs is not None and "local" in {control.second_crs, spec.ground.crs}:
        yield _fault("control.second_crs", "nobody knows where `local` lies", "two frames on the Earth")


def _image(spec: Spec) -> Iterator[Fault]:
    image = spec.image
    yield from _range("image.sigma_um", image.sigma_um, 0.0, 10_000.0, "um")
    if image.unit not in {"mm", "um", "0.1um", "px"}:
        yield _fault("image.unit", f"the unit {image.unit!r} is not known", "mm | um | 0.1um | px")
    if image.unit == "px" and spec.camera.pixel_size is None:
        yield _fault("image.unit", "pixels need a size", fix="add camera.pixel_size")
    if image.y_axis not in {"up", "down"}:
        yield _fault("image.y_axis", f"{image.y_axis!r} is not known", "up | down")
    if spec.film is not None:
        if len(spec.camera.fiducials) < 3:
            yield _fault("film", "the film is deformed, but the camera has no three fiducial marks to see it by")
        for name in ("scale_ppm", "shear_ppm", "irregular_um", "rotation_deg", "offset_mm"):
            yield from _range(f"film.{name}", getattr(spec.film, name), 0.0, 10_000.0)
    if spec.gnss is not None:
        yield from _each("gnss.sigma", spec.gnss.sigma, 1e-6, 1e4, "m")


def _errors(spec: Spec) -> Iterator[Fault]:
    for number, entry in enumerate(spec.gross_errors):
        key = f"gross_errors[{number}]"
        if entry.kind not in ERROR_KINDS:
            yield _fault(f"{key}.kind", f"gross errors of kind {entry.kind!r} are not known", " | ".join(ERROR_KINDS))
            continue
        yield from _range(f"{key}.count", entry.count, 1, MOST_POINTS)
        axes = {"image": "xy", "control": "xyz", "swap": ""}[entry.kind]
        if entry.axis is not None and (entry.axis not in axes or len(entry.axis) != 1):
            expected = " | ".join(axes) or "none"
            yield _fault(f"{key}.axis", f"an error of kind {entry.kind} has no axis {entry.axis!r}", expected)
        if entry.kind == "control" and entry.photo is not None:
            yield _fault(f"{key}.photo", "control is given on the ground, not on a photo", fix="drop it")
        for name in ("size_um", "size_m"):
            if not math.isfinite(getattr(entry, name)):
                yield _fault(f"{key}.{name}", "the size of the error is not a number")


def _together(spec: Spec) -> Iterator[Fault]:
    """Refuse what is only wrong together, the single values being sound."""
    flight, terrain = spec.flight, spec.terrain
    length, width = flight.photos * spec.base, flight.strips * spec.strip_distance
    rise = (abs(terrain.slope_percent[0]) * length + abs(terrain.slope_percent[1]) * width) / 200.0
    highest = terrain.relief + rise
    if highest > (1.0 - LEAST_DEPTH) * spec.flying_height:
        message = (
            f"the terrain rises to {highest:.0f} m above its mean height, the camera is at {spec.flying_height:.0f} m"
        )
        yield _fault("terrain.relief", message, fix="less relief or slope, a shorter strip or a higher flight")
    lon, lat = spec.ground.center_deg
    if not (abs(lon) <= LARGEST_LON and abs(lat) < LARGEST_LAT):
        yield _fault("ground.center_deg", f"{lon:g}, {lat:g} is no place", "longitude and latitude in degrees")
