"""Two zones of plane map coordinates joined through points that are known in both.

Conformal projections of one ellipsoid differ by a conformal transformation, a power series in E + iN. Between Gauss
zones of 6 degrees, within 20 km of a place at the boundary, a similarity leaves 6 m, the second power 1 cm, the third
0.01 mm.

Source: derived.

Coordinate reference systems as the user names them: read by PROJ, taken apart, checked for ground control.

``local`` and ``geocentric`` alone do not need PROJ; pyproj is loaded with the first CRS that does.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Floats
from photostrip.errors import PhotostripError
from photostrip.geodesy.frame_spec import FrameSpec, Kind, Refusal
from photostrip.geodesy.ground_frame import WGS84
from photostrip.geodesy.local_frame import Ellipsoid
from photostrip.geodesy.proj_operation import load_pyproj

if TYPE_CHECKING:
    from pyproj import CRS
    from pyproj._crs import AreaOfUse


HIGHEST_POWER = 3  # power
FEWEST_COMMON = 2  # points in both zones


@dataclass(frozen=True, eq=False)
class ZoneJoint:
    """A transformation from one zone to another."""

    center: complex  # E + iN of the middle of the common points, in the zone that is left
    size: float  # metres: powers are of (w - center) / size
    coefficients: NDArray[np.complex128]
    residuals: Floats  # (n, 2): transformed minus given, metres
    redundancy: int  # given coordinates that are not needed

    @property
    def degree(self) -> int:
        """Highest power."""
        return len(self.coefficients) - 1

    def __call__(self, plane: Floats) -> Floats:
        """Bring coordinates east, north (n, 2) into the other zone."""
        return _plane(
            np.vander((_complex(plane) - self.center) / self.size, self.degree + 1, increasing=True) @ self.coefficients
        )


def join_zones(source: Floats, target: Floats) -> ZoneJoint:
    """Find the transformation between zones from points given in both, (n, 2) each, at least two.

    The power is the highest, up to the third, that the points determine.
    """
    given = _complex(source)
    center, size = complex(given.mean()), float(np.abs(given - given.mean()).max()) or 1.0
    degree = min(HIGHEST_POWER, len(given) - 1)
    design = np.vander((given - center) / size, degree + 1, increasing=True)
    coefficients = np.asarray(np.linalg.lstsq(design, _complex(target), rcond=None)[0], np.complex128)
    return ZoneJoint(
        center=center,
        size=size,
        coefficients=coefficients,
        residuals=_plane(design @ coefficients) - target,
        redundancy=2 * (len(given) - degree - 1),
    )


def _complex(plane: Floats) -> NDArray[np.complex128]:
    return np.asarray(plane[:, 0] + 1j * plane[:, 1], np.complex128)


def _plane(w: NDArray[np.complex128]) -> Floats:
    return np.column_stack([w.real, w.imag])


Area = tuple[float, float, float, float]
_EARTH_RADIUS = 6378137.0  # m; a body whose radius is within half a percent of it is the Earth
_BODY_TOLERANCE = 0.005
_GRIDS = re.compile(r"(\b(?:geoid|nad)grids=)(\S+)")
_GRID_FILES = re.compile(r'PARAMETERFILE\["[^"]*","([^"]*)"')  # as WKT has them, whatever the text of the CRS


@dataclass(frozen=True, eq=False)
class CrsParts:
    """What the text of a CRS is made of."""

    kind: Kind
    title: str
    ellipsoid: Ellipsoid = WGS84
    units: tuple[str, str] = ("metre", "metre")
    factors: tuple[float, float] = (1.0, 1.0)
    whole: CRS | None = None
    plane: CRS | None = None  # the horizontal part, with its towgs84 or nadgrids when it has them
    core: CRS | None = None  # the same without
    vertical: str = ""  # what heights above a geoid refer to
    three_dimensional: bool = False

    @cached_property
    def geographic(self) -> CRS:
        """The geographic CRS of the datum, without towgs84 or nadgrids."""
        if self.core is not None:
            return _geographic_of(self.core)
        a, b = self.ellipsoid  # the word `geocentric`
        text = "EPSG:4979" if self.ellipsoid == WGS84 else f"+proj=longlat +a={a!r} +b={b!r} +no_defs +type=crs"
        made: CRS = load_pyproj().CRS.from_user_input(text)
        return made

    @cached_property
    def angle(self) -> float:
        """Radians per unit of the geographic CRS (degrees; grads in France)."""
        return float(self.geographic.axis_info[0].unit_conversion_factor)

    @cached_property
    def shift_end(self) -> CRS:
        """The three-dimensional geographic CRS a datum shift starts from or leads to."""
        crs = self.geographic
        if self.plane is None or not self.plane.is_bound:
            return crs.to_3d()
        bound = self.plane.to_json_dict()
        if self.kind == "geocentric" and self.plane.coordinate_operation is not None:
            # PROJ ties a geocentric CRS to the geocentric WGS 84; the same numbers serve for longitude and latitude.
            from pyproj.crs.coordinate_operation import ToWGS84Transformation

            shift = ToWGS84Transformation(crs, *self.plane.coordinate_operation.towgs84)
            bound["transformation"] = shift.to_json_dict()
            bound["target_crs"] = load_pyproj().CRS.from_user_input("EPSG:4326").to_json_dict()
        bound["source_crs"] = crs.to_json_dict()
        made: CRS = load_pyproj().CRS.from_json_dict(bound)
        return made.to_3d()

    @cached_property
    def hub(self) -> str:
        """The towgs84 or nadgrids that belong to the datum, as text."""
        if self.plane is None or not self.plane.is_bound or self.plane.coordinate_operation is None:
            return ""
        return self.plane.coordinate_operation.to_json()

    @property
    def datum_is_stated(self) -> bool:
        """False for a PROJ string with nothing but an ellipsoid."""
        datum = self.geographic.datum
        return bool(self.hub) or (datum is not None and not datum.name.lower().startswith("unknown"))

    @property
    def is_earth(self) -> bool:
        return abs(self.ellipsoid[0] / _EARTH_RADIUS - 1.0) < _BODY_TOLERANCE


def _geographic_of(core: CRS) -> CRS:
    """Geographic CRS of the datum of a projected, geographic or geocentric CRS."""
    crs = core.geodetic_crs
    if crs is None or crs.datum is None:
        raise PhotostripError(f"PROJ gives no datum for {core.name}")
    if crs.is_geographic:
        return crs.to_2d()  # the heights of a three-dimensional CRS may be in feet; those of `shift_end` are in metres
    datum = crs.datum.to_json_dict()
    datum.pop("$schema", None)
    axes = [
        {"name": "Longitude", "abbreviation": "lon", "direction": "east", "unit": "degree"},
        {"name": "Latitude", "abbreviation": "lat", "direction": "north", "unit": "degree"},
    ]
    key = "datum_ensemble" if datum["type"] == "DatumEnsemble" else "datum"
    system = {"subtype": "ellipsoidal", "axis": axes}
    made: CRS = load_pyproj().CRS.from_json_dict(
        {"type": "GeographicCRS", "name": crs.name, key: datum, "coordinate_system": system}
    )
    return made


def read_crs(spec: FrameSpec, directory: Path | None) -> CrsParts:
    """Take the CRS of a frame apart and check that it can carry ground control."""
    if spec.crs == "local":
        return CrsParts("local", "local")
    if spec.crs == "geocentric":
        return CrsParts("geocentric", "geocentric", spec.ellipsoid or WGS84)
    whole = parse_crs(spec, directory)
    components = whole.sub_crs_list if whole.is_compound else [whole]
    plane, vertical = components[0], components[1] if len(components) > 1 else None
    core = plane.source_crs if plane.is_bound and plane.source_crs else plane
    kind = _kind_of(spec, core, compound=vertical is not None)
    _check_directions(spec, core, kind)
    axes = core.axis_info
    three_dimensional = kind != "geocentric" and len(axes) > 2
    heights = vertical.axis_info[0] if vertical else axes[2] if three_dimensional else None
    if heights is not None and heights.direction != "up":
        message = f"the third axis of {spec.name} points {heights.direction}"
        raise Refusal(message, code="crs-axes", expected="heights, positive upwards")
    ellipsoid = core.ellipsoid
    if ellipsoid is None:
        raise PhotostripError(f"PROJ gives no ellipsoid for {spec.name}")
    third = axes[2] if kind == "geocentric" else heights
    return CrsParts(
        kind=kind,
        title=whole.name,
        ellipsoid=(float(ellipsoid.semi_major_metre), float(ellipsoid.semi_minor_metre)),
        units=(axes[0].unit_name, third.unit_name if third else "metre"),
        factors=(float(axes[0].unit_conversion_factor), float(third.unit_conversion_factor) if third else 1.0),
        whole=whole,
        plane=plane,
        core=core,
        vertical=_vertical_name(spec, vertical) if vertical else "",
        three_dimensional=three_dimensional,
    )


def parse_crs(spec: FrameSpec, directory: Path | None) -> CRS:
    """Let PROJ read the text of a CRS."""
    text = spec.crs.strip()
    expected = "an authority code (EPSG:32633), a PROJ string, WKT, `geocentric` or `local`"
    if not text:
        raise Refusal("no coordinate reference system is given", code="crs-unknown", expected=expected)
    if "+init=" in text:
        raise Refusal(f"{spec.name}: PROJ has given up `+init=`", code="crs-init", expected="a code such as EPSG:32633")
    if "grids=" in text:
        text = _with_grids(text, directory)
    try:
        parsed: CRS = load_pyproj().CRS.from_user_input(text)
    except load_pyproj().exceptions.CRSError as error:
        reason = re.sub(r".*Internal Proj Error: (proj_create: )?|\)$", "", " ".join(str(error).split()))
        message = f"PROJ does not know the coordinate reference system {spec.name!r} ({reason})"
        fix = "for a system of your own write `crs: local` (right-handed, metres)"
        raise Refusal(message, code="crs-unknown", expected=expected, fix=fix) from None
    _require_files(parsed)
    return parsed


def _require_files(crs: CRS) -> None:
    """Refuse grids that are no files, before PROJ opens them: at a pipe it would wait forever."""
    names = (name for names in _GRID_FILES.findall(crs.to_wkt()) for name in names.split(","))
    for name in names:
        place = Path(name.removeprefix("@"))
        if place.exists() and not place.is_file():
            what = "a folder" if place.is_dir() else "a device or a pipe"
            raise Refusal(f"the grid {name} is {what}", code="file-kind", expected="a file")


def _with_grids(text: str, directory: Path | None) -> str:
    """Make the grid files of a PROJ string obligatory, and those beside the project file known by their full path.

    PROJ takes ``@name`` as "if there is such a file" and would go on without a shift, silently.
    """

    def named(match: re.Match[str]) -> str:
        names = [name if name == "@null" else name.removeprefix("@") for name in match[2].split(",")]
        if directory is not None:
            names = [str((directory / name).resolve()) if (directory / name).is_file() else name for name in names]
        return match[1] + ",".join(names)

    return _GRIDS.sub(named, text)


def grid_names(crs: str) -> tuple[str, ...]:
    """Names of the grid files that a PROJ string asks for, without the mark of optional ones; none for a code."""
    names = [name.removeprefix("@") for match in _GRIDS.finditer(crs) for name in match[2].split(",")]
    return tuple(dict.fromkeys(name for name in names if name and name != "null"))


def _vertical_name(spec: FrameSpec, vertical: CRS) -> str:
    """Say what heights refer to; in a PROJ string that is a grid."""
    grids = re.search(r"\bgeoidgrids=(\S+)", spec.crs)
    if grids is None:
        return vertical.name
    if grids[1] == "@null":
        message = f"{spec.name} names no geoid grid"
        raise Refusal(message, code="height-geoid", fix="name one, or drop +geoidgrids and say `height: ellipsoidal`")
    return f"geoid grid {grids[1]}"


def _kind_of(spec: FrameSpec, core: CRS, *, compound: bool) -> Kind:
    """Kind of the horizontal part of a CRS; refused when it is none that can be used."""
    kinds: dict[str, Kind] = {"Projected": "projected", "Geographic": "geographic", "Geocentric": "geocentric"}
    kind = kinds.get(core.type_name.split()[0])
    what, fix = core.type_name, "for a system of your own write `crs: local` (right-handed, metres)"
    base = core.geodetic_crs
    if base is not None and base.coordinate_system is not None and base.coordinate_system.name == "spherical":
        kind, what = None, f"{core.type_name} with planetocentric latitudes"
        fix = "use geodetic latitudes (a PROJ string with +a and +b), or `geocentric` with `ellipsoid`"
    elif kind is None and base is not None:
        fix = "give the coordinates in the CRS it is derived from"
    elif compound and kind == "geocentric":
        kind = None
    if kind is None:
        message = f"{spec.name} cannot carry ground control: it is of the kind {what!r}"
        expected = "a projected, geographic or geocentric CRS, with heights or without"
        raise Refusal(message, code="crs-kind", expected=expected, fix=fix)
    return kind


def _check_directions(spec: FrameSpec, core: CRS, kind: Kind) -> None:
    """Refuse a grid that counts westwards or southwards."""
    directions = [axis.direction for axis in core.axis_info[:2]]
    # On a polar grid both axes point north, or both south: away from the south pole, or from the north pole.
    polar = kind == "projected" and directions in (["north", "north"], ["south", "south"])
    if kind != "geocentric" and set(directions) != {"east", "north"} and not polar:
        message = f"the axes of {spec.name} point {directions[0]} and {directions[1]}"
        expected = "axes that point east and north, in any order"
        fix = "use the east-north form of the grid, with the signs of the coordinates changed"
        raise Refusal(message, code="crs-axes", expected=expected, fix=fix)


class AreasOfUse(NamedTuple):
    """Areas that a CRS is made for: west, south, east, north in degrees, west larger than east across 180 degrees."""

    crs: Area | None  # ends where another datum is official
    projection: Area | None  # of its map projection, whatever the datum: a zone from pole to pole, or the same


def areas_of_use(spec: FrameSpec, *, directory: Path | None = None) -> AreasOfUse:
    """Areas that a CRS and its projection are made for; None where nobody has said it, as for PROJ strings."""
    parts = read_crs(spec, directory)
    if parts.whole is None or parts.core is None:
        return AreasOfUse(None, None)
    operation = parts.core.coordinate_operation
    return AreasOfUse(_bounds(parts.whole.area_of_use), None if operation is None else _bounds(operation.area_of_use))


def _bounds(area: AreaOfUse | None) -> Area | None:
    return None if area is None else (float(area.west), float(area.south), float(area.east), float(area.north))


def missing_named_grids(parts: CrsParts) -> str:
    """Name the grids of a PROJ string that are not there: not every version of PROJ notices before it computes."""
    whole = parts.whole
    crss = [] if whole is None else [whole, *whole.sub_crs_list]
    operations = [crs.coordinate_operation for crs in crss if crs.is_bound and crs.coordinate_operation is not None]
    grids = [grid for operation in operations for grid in operation.grids]
    return " and ".join(g.short_name for g in grids if not g.available and g.short_name.removeprefix("@") != "null")


class MapEntry(NamedTuple):
    """A plane or geographic CRS as files of other programs name it."""

    name: str
    epsg: int | None  # its number where it has one
    wkt: str  # as GDAL writes it; WKT 2 where that cannot say it


def map_entry(spec: FrameSpec) -> MapEntry:
    """Name the horizontal part of a CRS; that of ``geocentric`` coordinates are longitude and latitude of its datum."""
    parts = read_crs(spec, None)
    known = parts.geographic if parts.kind == "geocentric" else parts.core
    if known is None:
        raise PhotostripError("a local frame has no reference system")
    known = known.to_2d()
    try:
        wkt = known.to_wkt("WKT1_GDAL")
    except load_pyproj().exceptions.CRSError:
        wkt = known.to_wkt()
    return MapEntry(known.name, known.to_epsg(), wkt)
