"""The ground frames of a project, tied together in one Cartesian frame.

A strip is adjusted in Cartesian space. Control lists come in map projections, longitudes and latitudes, geocentric
or local coordinates, each list in a frame of its own; results go out in one. ``tie_frames`` ties all of them to
the geocentric frame of the output's datum (or to the local frame). Frames of one datum are tied exactly, by the
formulas of the ellipsoid; between datums an operation of PROJ is used, never a guessed one ("ballpark") and never
one whose grid file is missing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from photostrip.errors import Fault, InputError, PhotostripError
from photostrip.geodesy.crs import CrsParts, missing_named_grids, read_crs
from photostrip.geodesy.frame_spec import FrameSpec, Refusal, contradictions
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import Ellipsoid
from photostrip.geodesy.proj_operation import DatumShift, ProjOperation, missing_grids, trouble_with

_SAME_AXIS = 1e-10  # relative: two semi-axes are the same within 0.6 mm on the Earth


def tie_frames(
    specs: Sequence[FrameSpec],
    output: FrameSpec | None = None,
    *,
    directory: Path | None = None,
    keys: Sequence[str] = (),
) -> tuple[list[GroundFrame], GroundFrame]:
    """Tie the frames of all control lists and of the output to one Cartesian frame.

    specs, output: frame of each control list, and of the results; None: that of the first control list.
    directory: where grid files named in PROJ strings are looked for first: the project file's directory.
    keys: key of each frame in the project file.
    Returns the control lists' frames, in their order, and the output's.
    Raises InputError with every fault of every frame: unknown or unsuitable CRS, contradictory heights, missing geoid
        grid, no sound operation between two datums, local and geodetic frames in one project.
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


def _read_all(
    wanted: list[tuple[str, FrameSpec]], directory: Path | None, faults: list[Fault]
) -> dict[FrameSpec, CrsParts]:
    """Read each distinct frame once, collecting what is wrong with it."""
    parts: dict[FrameSpec, CrsParts] = {}
    places: dict[FrameSpec, str] = {}
    for path, spec in wanted:
        if spec in places:
            continue
        places[spec] = path
        try:
            crs = read_crs(spec, directory)
        except Refusal as refusal:
            faults.append(refusal.at(path))
            continue
        against = contradictions(spec, crs.kind, crs.vertical, three_dimensional=crs.three_dimensional)
        faults.extend(refusal.at(path) for refusal in against)
        parts[spec] = crs
    return parts


def _check_together(wanted: list[tuple[str, FrameSpec]], parts: dict[FrameSpec, CrsParts], faults: list[Fault]) -> None:
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
    dated = [(path, spec.epoch) for path, spec in wanted if spec.epoch is not None]
    for path, epoch in dated[1:]:
        if epoch != dated[0][1]:
            message = f"coordinates of {epoch:g} stand beside those of {dated[0][1]:g} of {dated[0][0]}"
            fix = "bring them to one epoch: photostrip moves no points from one to another"
            faults.append(Fault(message, code="epochs", key=f"{path}.epoch", fix=fix))


def _build_all(
    wanted: list[tuple[str, FrameSpec]], parts: dict[FrameSpec, CrsParts], target: FrameSpec, faults: list[Fault]
) -> dict[FrameSpec, GroundFrame]:
    """Make the frames; frames of one foreign datum share one shift, so that it is chosen once for all."""
    frames: dict[FrameSpec, GroundFrame] = {}
    shifts: list[tuple[CrsParts, DatumShift]] = []
    out = parts[target]
    epoch = next((spec.epoch for _, spec in wanted if spec.epoch is not None), None)
    for path, spec in wanted:
        crs, shift = parts[spec], None
        if spec in frames:
            continue
        try:
            vertical = _vertical_operation(spec, crs) if crs.vertical else None
            if crs.kind != "local" and crs is not out and not _same_datum(crs, out):
                shift = next((made for other, made in shifts if _same_datum(crs, other)), None)
                if shift is None:
                    shift = _datum_shift(spec, crs, target, out, epoch)
                    shifts.append((crs, shift))
        except Refusal as refusal:
            faults.append(refusal.at(path))
            continue
        frames[spec] = _frame(spec, crs, vertical, shift, out.ellipsoid)
    return frames


def _frame(
    spec: FrameSpec, crs: CrsParts, vertical: ProjOperation | None, shift: DatumShift | None, cartesian: Ellipsoid
) -> GroundFrame:
    plane = ProjOperation(crs.core, crs.geographic) if crs.kind == "projected" and crs.core is not None else None
    return GroundFrame(
        spec=spec,
        kind=crs.kind,
        title=crs.title,
        plan_unit=crs.units[0],
        height_unit=crs.units[1],
        plan_factor=crs.factors[0],
        height_factor=crs.factors[1],
        ellipsoid=None if crs.kind == "local" else crs.ellipsoid,
        _angle=crs.angle if plane is not None else crs.factors[0],
        _plane=plane,
        _vertical=vertical,
        _geoid=crs.vertical,
        shift=shift,
        _cartesian=cartesian,
    )


def _same_datum(one: CrsParts, other: CrsParts) -> bool:
    """Tell whether two frames hang on the same datum, so that no shift lies between them."""
    pairs = zip(one.ellipsoid, other.ellipsoid, strict=True)
    if not all(math.isclose(p, q, rel_tol=_SAME_AXIS) for p, q in pairs):
        return False
    if one.core is None and other.core is None:
        return True  # the word `geocentric`, twice: PROJ is not needed to know
    if one.hub != other.hub:
        return False
    if one.datum_is_stated and other.datum_is_stated:
        # Of an ensemble such as WGS 84 PROJ needs 30 ms to find that it is the same.
        first, second = one.geographic.datum, other.geographic.datum
        return first is not None and second is not None and (first.to_wkt() == second.to_wkt() or first == second)
    # An ellipsoid alone is no datum: on the Earth, datums of one ellipsoid lie 100 m apart. Other bodies have one each.
    if one.datum_is_stated != other.datum_is_stated and one.is_earth:
        return False
    zero, other_zero = (crs.prime_meridian for crs in (one.geographic, other.geographic))
    return zero is not None and other_zero is not None and zero.longitude == other_zero.longitude


def _datum_shift(spec: FrameSpec, crs: CrsParts, target: FrameSpec, out: CrsParts, epoch: float | None) -> DatumShift:
    """Find the PROJ operation from one datum to that of the Cartesian frame; refused when there is no sound one."""
    operation = ProjOperation(crs.shift_end, out.shift_end, epoch)
    trouble, missing = trouble_with(operation), missing_named_grids(crs) or missing_named_grids(out)
    if not trouble and not missing:
        return DatumShift(operation, crs.angle, out.angle)
    message = f"there is no known way from the datum of {spec.name} to that of {target.name}"
    fix = "give both in one datum"
    if "celestial body" in trouble:
        message += ": they lie on different bodies"
    elif not (crs.datum_is_stated and out.datum_is_stated):
        which = target.name if crs.datum_is_stated else spec.name
        message += f": {which} states an ellipsoid but no datum"
        fix = "add +towgs84=... (or +datum=...) to it, or use an authority code"
    elif missing := missing or missing_grids(crs.shift_end, out.shift_end):
        message += f": the grid {missing} is not installed"
        fix = (
            "put the grid beside the project file or into PROJ's data directory (`projsync`), or give both in one datum"
        )
    raise Refusal(message, code="datum-shift", fix=fix)


def _vertical_operation(spec: FrameSpec, crs: CrsParts) -> ProjOperation:
    """Find the PROJ operation from heights above the geoid to heights above the ellipsoid of the same CRS."""
    if crs.whole is None or crs.plane is None:
        raise PhotostripError(f"{spec.name} has no vertical part")
    operation = ProjOperation(crs.whole, crs.plane.to_3d())
    trouble, missing = trouble_with(operation), missing_named_grids(crs)
    if not trouble and not missing:
        return operation
    message = f"the heights of {spec.name} ({crs.vertical}) cannot be brought to the ellipsoid"
    if missing := missing or missing_grids(crs.whole, crs.plane.to_3d()):
        message += f": the geoid grid {missing} is not installed"
    elif "invalid" in trouble:
        message += ": PROJ cannot read the grid"
    elif not crs.datum_is_stated:
        message += ": a geoid grid refers to WGS 84, and the datum of the plan is not stated (add +towgs84 or +datum)"
    else:
        message += ": PROJ knows no geoid for them"
    raise Refusal(
        message,
        code="geoid-grid",
        fix="put the grid beside the project file or into PROJ's data directory (`projsync`),"
        " or give the CRS without heights and a constant `geoid_undulation`",
    )
