"""Coordinate reference systems as the user names them, and the frames of a project tied together.

A strip is adjusted in Cartesian space. Control lists come in map projections, longitudes and latitudes, geocentric
or local coordinates, each list in a frame of its own; results go out in one. ``tie_frames`` ties all of them to
the geocentric frame of the output's datum (or to the local frame). Frames of one datum are tied exactly, by the
formulas of the ellipsoid; between datums an operation of PROJ is used, never a guessed one ("ballpark") and never
one whose grid file is missing.

This is the only module that uses pyproj, and it loads it with the first CRS that needs it: ``local`` and
``geocentric`` alone do not. PROJ's network access stays off.
"""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.errors import Fault, InputError, PhotostripError
from photostrip.geodesy.frame_spec import FrameSpec, Kind, Refusal, contradictions
from photostrip.geodesy.ground_frame import WGS84, DatumShift, GroundFrame

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from pyproj import CRS, Transformer

    from photostrip.geodesy.curvature import Ellipsoid

    Array = NDArray[np.float64]

__all__ = ["FrameSpec", "GroundFrame", "tie_frames"]

_EARTH_RADIUS = 6378137.0  # m; a body whose radius is within half a percent of it is the Earth
_BODY_TOLERANCE = 0.005
_GRIDS = re.compile(r"(\b(?:geoid|nad)grids=)(\S+)")
_SAME_AXIS = 1e-10  # relative: two semi-axes are the same within 0.6 mm on the Earth


@cache
def _pyproj() -> Any:  # noqa: ANN401 (a module; pyproj does not say what it exports)
    """Load pyproj at first need, its network access off: a run must not depend on what a server sends."""
    import pyproj
    import pyproj.network

    network: Any = pyproj.network
    network.set_network_enabled(active=False)
    return pyproj


class _Operation:
    """One PROJ operation between two CRSs, chosen once and then kept for all points.

    PROJ often knows several operations between two datums, each for a country, and picks one for each point. Two
    points of one strip must not be shifted by different operations, so the one that PROJ picks for the middle row
    of the first points is kept.
    """

    def __init__(self, source: CRS, target: CRS) -> None:
        self._ends = (source, target)
        self._decided_by: tuple[Array, bool] | None = None  # the point, and whether it went the inverse way

    def __getstate__(self) -> dict[str, Any]:
        """Keep what the operation is made from: PROJ's own object cannot be sent to another process."""
        return {"_ends": self._ends, "_decided_by": self._decided_by}

    @cached_property
    def transformer(self) -> Transformer:
        """The PROJ object; making it takes 1 to 100 ms. Raises ProjError where no sound operation exists."""
        made: Transformer = _pyproj().Transformer.from_crs(*self._ends, always_xy=True, allow_ballpark=False)
        if self._decided_by is not None:  # in another process
            point, inverse = self._decided_by
            made = _used(made, point, inverse=inverse)
        return made

    @property
    def idle(self) -> bool:
        """Whether coordinates pass unchanged, as between ETRS89 and WGS 84."""
        return self.transformer.definition.startswith("proj=noop")

    def apply(self, columns: Array, *, inverse: bool = False) -> Array:
        """Transform rows of coordinates; what lies outside the domain becomes infinite."""
        if self._decided_by is None and len(columns):
            self._decided_by = columns[len(columns) // 2], inverse
            self.transformer = _used(self.transformer, columns[len(columns) // 2], inverse=inverse)
        rows = np.repeat(columns, 2, axis=0) if len(columns) == 1 else columns  # pyproj 3.6 takes one row for numbers
        return np.stack(_run(self.transformer, rows.T, inverse=inverse), axis=-1)[: len(columns)]

    @property
    def accuracy(self) -> float | None:
        """Accuracy that PROJ states, metres; None when it states none, or has not chosen yet."""
        stated = float(self.transformer.accuracy)
        return stated if stated >= 0.0 else None

    @property
    def grids(self) -> tuple[str, ...]:
        """Paths of the grid files that the operation reads."""
        steps = self.transformer.operations or ()
        named = re.findall(r"\bgrids=(\S+)", self.transformer.definition)
        paths = [name for names in named for name in names.split(",") if Path(name).is_file()]
        return tuple(
            dict.fromkeys([*paths, *(grid.full_name for step in steps for grid in step.grids if grid.available)])
        )

    def __str__(self) -> str:
        if not self.idle and self._decided_by is None:
            return "chosen by PROJ at the first point"
        steps = [step for step in self.transformer.description.split(" + ") if not step.startswith("axis order change")]
        return " + ".join(steps) + (
            ", accuracy not known" if self.accuracy is None else f", accuracy {self.accuracy:g} m"
        )


def _run(transformer: Transformer, columns: Array, *, inverse: bool) -> Any:  # noqa: ANN401 (arrays or numbers)
    """Hand columns to PROJ and get columns back."""
    transform: Any = transformer.transform
    return transform(*columns, direction="INVERSE" if inverse else "FORWARD", errcheck=False)


def _used(transformer: Transformer, point: Array, *, inverse: bool) -> Transformer:
    """Single out the operation that PROJ uses for one point."""
    _run(transformer, point, inverse=inverse)
    try:
        return transformer.get_last_used_operation()
    except _pyproj().exceptions.ProjError:
        return transformer  # nothing is valid at this point, or nothing is to be done


# ------------------------------------------------------------------------- reading a CRS of the user


@dataclass(frozen=True, eq=False)
class _Parts:
    """What the text of a CRS turned out to be made of.

    `plane` is the horizontal part (with its towgs84 or nadgrids when it has them), `core` the same without; `vertical`
    says what the heights refer to when the CRS brings heights above a geoid.
    """

    kind: Kind
    title: str
    ellipsoid: Ellipsoid = WGS84
    units: tuple[str, str] = ("metre", "metre")
    factors: tuple[float, float] = (1.0, 1.0)
    whole: CRS | None = None
    plane: CRS | None = None
    core: CRS | None = None
    vertical: str = ""
    three_dimensional: bool = False

    @cached_property
    def geographic(self) -> CRS:
        """The geographic CRS of the datum, without towgs84 or nadgrids."""
        if self.core is not None:
            return _geographic_of(self.core)
        a, b = self.ellipsoid  # the word `geocentric`
        text = "EPSG:4979" if self.ellipsoid == WGS84 else f"+proj=longlat +a={a!r} +b={b!r} +no_defs +type=crs"
        made: CRS = _pyproj().CRS.from_user_input(text)
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
            bound["target_crs"] = _pyproj().CRS.from_user_input("EPSG:4326").to_json_dict()
        bound["source_crs"] = crs.to_json_dict()
        made: CRS = _pyproj().CRS.from_json_dict(bound)
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
        """Whether the body is the Earth."""
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
    made: CRS = _pyproj().CRS.from_json_dict(
        {"type": "GeographicCRS", "name": crs.name, key: datum, "coordinate_system": system}
    )
    return made


def _read(spec: FrameSpec, directory: Path | None) -> _Parts:
    """Take the CRS of a frame apart and check that it can carry ground control."""
    if spec.crs == "local":
        return _Parts("local", "local")
    if spec.crs == "geocentric":
        return _Parts("geocentric", "geocentric", spec.ellipsoid or WGS84)
    whole = _parse(spec, directory)
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
    return _Parts(
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


def _parse(spec: FrameSpec, directory: Path | None) -> CRS:
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
        parsed: CRS = _pyproj().CRS.from_user_input(text)
    except _pyproj().exceptions.CRSError as error:
        reason = re.sub(r".*Internal Proj Error: (proj_create: )?|\)$", "", " ".join(str(error).split()))
        raise Refusal(
            f"PROJ does not know the coordinate reference system {spec.name!r} ({reason})",
            code="crs-unknown",
            expected=expected,
            fix="for a system of your own write `crs: local` (right-handed, metres)",
        ) from None
    return parsed


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
    """Return the names of the grid files that a PROJ string asks for.

    Parameters
    ----------
    crs : str
        A CRS as the user names it.

    Returns
    -------
    tuple of str
        Names as they stand there, without the mark of optional grids; none for an authority code.
    """
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
        raise Refusal(
            f"{spec.name} cannot carry ground control: it is of the kind {what!r}",
            code="crs-kind",
            expected="a projected, geographic or geocentric CRS, with heights or without",
            fix=fix,
        )
    return kind


def _check_directions(spec: FrameSpec, core: CRS, kind: Kind) -> None:
    """Refuse a grid that counts westwards or southwards."""
    directions = [axis.direction for axis in core.axis_info[:2]]
    # On a polar grid both axes point north, or both south: away from the south pole, or from the north pole.
    polar = kind == "projected" and directions in (["north", "north"], ["south", "south"])
    if kind != "geocentric" and set(directions) != {"east", "north"} and not polar:
        raise Refusal(
            f"the axes of {spec.name} point {directions[0]} and {directions[1]}",
            code="crs-axes",
            expected="axes that point east and north, in any order",
            fix="use the east-north form of the grid, with the signs of the coordinates changed",
        )


# -------------------------------------------------------------------------------- datums and geoids


def _same_datum(one: _Parts, other: _Parts) -> bool:
    """Tell whether two frames hang on the same datum, so that no shift lies between them."""
    pairs = zip(one.ellipsoid, other.ellipsoid, strict=True)
    if not all(math.isclose(p, q, rel_tol=_SAME_AXIS) for p, q in pairs):
        return False
    if one.core is None and other.core is None:
        return True  # the word `geocentric`, twice: PROJ is not needed to know
    if one.hub != other.hub:
        return False
    if one.datum_is_stated and other.datum_is_stated:
        return bool(one.geographic.datum == other.geographic.datum)
    # An ellipsoid alone is no datum: on the Earth, datums of one ellipsoid lie 100 m apart. Other bodies have one each.
    if one.datum_is_stated != other.datum_is_stated and one.is_earth:
        return False
    first, second = (crs.prime_meridian for crs in (one.geographic, other.geographic))
    return first is not None and second is not None and first.longitude == second.longitude


def _trouble(operation: _Operation) -> str:
    """Make an operation; give what PROJ says against it, nothing when it is sound."""
    try:
        operation.transformer  # noqa: B018 (made here, so that a refusal comes before any computing)
    except _pyproj().exceptions.ProjError as error:
        return str(error) or "no operation"
    return ""


def _datum_shift(spec: FrameSpec, own: _Parts, target: FrameSpec, out: _Parts) -> DatumShift:
    """Find the PROJ operation from one datum to that of the Cartesian frame; refused when there is no sound one."""
    operation = _Operation(own.shift_end, out.shift_end)
    trouble, missing = _trouble(operation), _own_grids_missing(own) or _own_grids_missing(out)
    if not trouble and not missing:
        return DatumShift(operation, own.angle, out.angle)
    message = f"there is no known way from the datum of {spec.name} to that of {target.name}"
    fix = "give both in one datum"
    if "celestial body" in trouble:
        message += ": they lie on different bodies"
    elif not (own.datum_is_stated and out.datum_is_stated):
        which = target.name if own.datum_is_stated else spec.name
        message += f": {which} states an ellipsoid but no datum"
        fix = "add +towgs84=... (or +datum=...) to it, or use an authority code"
    elif missing := missing or _grids_missing(own.shift_end, out.shift_end):
        message += f": the grid {missing} is not installed"
        fix = (
            "put the grid beside the project file or into PROJ's data directory (`projsync`), or give both in one datum"
        )
    raise Refusal(message, code="datum-shift", fix=fix)


def _vertical_operation(spec: FrameSpec, own: _Parts) -> _Operation:
    """Find the PROJ operation from heights above the geoid to heights above the ellipsoid of the same CRS."""
    if own.whole is None or own.plane is None:
        raise PhotostripError(f"{spec.name} has no vertical part")
    operation = _Operation(own.whole, own.plane.to_3d())
    trouble, missing = _trouble(operation), _own_grids_missing(own)
    if not trouble and not missing:
        return operation
    message = f"the heights of {spec.name} ({own.vertical}) cannot be brought to the ellipsoid"
    if missing := missing or _grids_missing(own.whole, own.plane.to_3d()):
        message += f": the geoid grid {missing} is not installed"
    elif "invalid" in trouble:
        message += ": PROJ cannot read the grid"
    elif not own.datum_is_stated:
        message += ": a geoid grid refers to WGS 84, and the datum of the plan is not stated (add +towgs84 or +datum)"
    else:
        message += ": PROJ knows no geoid for them"
    raise Refusal(
        message,
        code="geoid-grid",
        fix="put the grid beside the project file or into PROJ's data directory (`projsync`),"
        " or give the CRS without heights and a constant `geoid_undulation`",
    )


def _own_grids_missing(parts: _Parts) -> str:
    """Name the grids of a PROJ string that are not there: not every version of PROJ notices before it computes."""
    whole = parts.whole
    crss = [] if whole is None else [whole, *whole.sub_crs_list]
    operations = [crs.coordinate_operation for crs in crss if crs.is_bound and crs.coordinate_operation is not None]
    grids = [grid for operation in operations for grid in operation.grids]
    return " and ".join(g.short_name for g in grids if not g.available and g.short_name.removeprefix("@") != "null")


def _grids_missing(source: CRS, target: CRS) -> str:
    """Name the grids that PROJ would use between two CRSs if they were there."""
    from pyproj.transformer import TransformerGroup

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of what is asked here
        try:
            group = TransformerGroup(source, target, always_xy=True, allow_ballpark=False)
        except _pyproj().exceptions.ProjError:
            return ""
    missing = ([g.short_name for g in best.grids if not g.available] for best in group.unavailable_operations)
    return " and ".join(next(filter(None, missing), []))  # of the best operation: PROJ lists it first


# ------------------------------------------------------------------------------------- tying frames


def tie_frames(
    specs: Sequence[FrameSpec],
    output: FrameSpec | None = None,
    *,
    directory: Path | None = None,
    keys: Sequence[str] = (),
) -> tuple[list[GroundFrame], GroundFrame]:
    """Tie the frames of all control lists and of the output to one Cartesian frame.

    Parameters
    ----------
    specs : sequence of FrameSpec
        Frame of each control list.
    output : FrameSpec or None
        Frame of the results; None: that of the first control list.
    directory : Path, optional
        Where grid files named in PROJ strings are looked for first: the project file's directory.
    keys : sequence of str, optional
        Key of each frame in the project file; without it they are those of the control lists.

    Returns
    -------
    tuple
        The control lists' frames, in their order, and the output's. The Cartesian frame is the geocentric one of the
        output's datum, or the local frame.

    Raises
    ------
    InputError
        With every fault of every frame: unknown or unsuitable CRS, contradictory heights, missing geoid grid, no
        sound operation between two datums, local and geodetic frames in one project.
    """
    wanted = list(zip(keys or [f"control[{i}]" for i in range(len(specs))], specs, strict=True))
    if output is not None:
        wanted.append(("output", output))
    if not wanted:
        raise InputError(Fault("no ground frame is given", code="crs-missing", expected="a control list with its crs"))
    target = output if output is not None else specs[0]
    faults: list[Fault] = []
    parts = _read_all(wanted, directory, faults)
    if not faults:
        _check_together(wanted, parts, faults)
    frames = {} if faults else _build_all(wanted, parts, target, faults)
    if faults:
        raise InputError(faults)
    return [frames[spec] for spec in specs], frames[target]


def area_of_use(spec: FrameSpec, *, directory: Path | None = None) -> tuple[float, float, float, float] | None:
    """Return the area that a coordinate reference system is made for.

    Parameters
    ----------
    spec : FrameSpec
        Frame of a control list.

    Returns
    -------
    tuple of float or None
        West, south, east, north in degrees; west is larger than east across the meridian of 180 degrees. None where
        nobody has said it: for `local`, `geocentric` and PROJ strings.
    """
    if spec.crs in {"local", "geocentric"}:
        return None
    area = _parse(spec, directory).area_of_use
    return None if area is None else (float(area.west), float(area.south), float(area.east), float(area.north))


def _read_all(
    wanted: list[tuple[str, FrameSpec]], directory: Path | None, faults: list[Fault]
) -> dict[FrameSpec, _Parts]:
    """Read each distinct frame once, collecting what is wrong with it."""
    parts: dict[FrameSpec, _Parts] = {}
    places: dict[FrameSpec, str] = {}
    for path, spec in wanted:
        if spec in places:
            continue
        places[spec] = path
        try:
            own = _read(spec, directory)
        except Refusal as refusal:
            faults.append(refusal.at(path))
            continue
        against = contradictions(spec, own.kind, own.vertical, three_dimensional=own.three_dimensional)
        faults.extend(refusal.at(path) for refusal in against)
        parts[spec] = own
    return parts


def _check_together(wanted: list[tuple[str, FrameSpec]], parts: dict[FrameSpec, _Parts], faults: list[Fault]) -> None:
    """Find what can only be seen when the frames are put side by side."""
    first_path, first = wanted[0]
    for path, spec in wanted[1:]:
        if (parts[spec].kind == "local") != (parts[first].kind == "local"):
            message = f"{spec.name} cannot be tied to {first.name} of {first_path}: nobody knows where `local` lies"
            fix = "give all of them as `local`, or none"
            faults.append(Fault(message, code="local-mixed", key=f"{path}.crs", fix=fix))
        elif spec.curvature_radius != first.curvature_radius:
            message = (
                f"the curvature correction differs from that of {first_path}: it counts before and after, or never"
            )
            faults.append(Fault(message, code="curvature-once", key=f"{path}.crs"))


def _build_all(
    wanted: list[tuple[str, FrameSpec]], parts: dict[FrameSpec, _Parts], target: FrameSpec, faults: list[Fault]
) -> dict[FrameSpec, GroundFrame]:
    """Make the frames; frames of one foreign datum share one shift, so that it is chosen once for all."""
    frames: dict[FrameSpec, GroundFrame] = {}
    shifts: list[tuple[_Parts, DatumShift]] = []
    out = parts[target]
    for path, spec in wanted:
        own, shift = parts[spec], None
        if spec in frames:
            continue
        try:
            vertical = _vertical_operation(spec, own) if own.vertical else None
            if own.kind != "local" and own is not out and not _same_datum(own, out):
                shift = next((made for other, made in shifts if _same_datum(own, other)), None)
                if shift is None:
                    shift = _datum_shift(spec, own, target, out)
                    shifts.append((own, shift))
        except Refusal as refusal:
            faults.append(refusal.at(path))
            continue
        frames[spec] = _frame(spec, own, vertical, shift, out.ellipsoid)
    return frames


def _frame(
    spec: FrameSpec, own: _Parts, vertical: _Operation | None, shift: DatumShift | None, cartesian: Ellipsoid
) -> GroundFrame:
    """Put one frame together."""
    plane = _Operation(own.core, own.geographic) if own.kind == "projected" and own.core is not None else None
    return GroundFrame(
        spec=spec,
        kind=own.kind,
        title=own.title,
        plan_unit=own.units[0],
        height_unit=own.units[1],
        plan_factor=own.factors[0],
        height_factor=own.factors[1],
        ellipsoid=None if own.kind == "local" else own.ellipsoid,
        _angle=own.angle if plane is not None else own.factors[0],
        _plane=plane,
        _vertical=vertical,
        _geoid=own.vertical,
        _shift=shift,
        _cartesian=cartesian,
    )
