"""A terrestrial project, or a table of the normal case alone, read and checked: plain input for the mathematics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.project.terrestrial.terrestrial_file import Camera, Measurements, Station, TerrestrialFile
from photostrip.project.terrestrial.terrestrial_presets import PresetFile, own_presets
from photostrip.project.terrestrial.terrestrial_series import Table, Wanted, read_series
from photostrip.project.yaml.document import fault_at
from photostrip.project.yaml.merging import override, path_of, read_named, read_tree, steps, told_where_named
from photostrip.project.yaml.validation import checked, valid_section
from photostrip.terrestrial.directions import Phototheodolite
from photostrip.terrestrial.frame import ground_from_photo
from photostrip.terrestrial.monitoring import Series, Settings
from photostrip.terrestrial.normal_case import SIDES, StereoPair, normal_pair

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.notes import Note
    from photostrip.project.yaml.document import Node

    Floats = NDArray[np.float64]

NORMAL_AXES = ("right", "ahead", "up")
RADIANS = {"deg": np.pi / 180, "gon": np.pi / 200}
MICROMETRES = 1000.0


@dataclass(frozen=True, eq=False)
class Survey:
    """What displacements are computed from."""

    name: str
    series: Series
    pair: StereoPair  # stations; ground axes are east, north, up, or right, ahead, up in the normal case
    settings: Settings
    cameras: tuple[Phototheodolite, Phototheodolite]
    axes: tuple[str, str, str]  # names of the ground axes in the order in which the user wants them
    order: tuple[int, int, int]
    time_unit: str
    files: tuple[str, ...]
    notes: tuple[Note, ...]


def load_survey(path: Path, overrides: Sequence[str] = ()) -> Survey:
    """Read a terrestrial project and its table.

    Raises
    ------
    InputError
        With every fault of every file.
    """
    findings, files, name = Findings(), list[str](), str(path)
    root = read_tree(name, findings, files)
    if root is None:
        raise InputError(findings.faults)
    root = override(root, overrides, findings)
    given = checked(TerrestrialFile, root, findings)
    cameras = _cameras(given, root, name, findings, files) if given is not None else []
    series = _series(given, root, name, cameras, findings, files)
    findings.stop()
    if given is None or series is None or len(cameras) != len(SIDES):  # cannot be: stop() told the reason
        raise InputError(f"{name} is not a valid terrestrial project")
    pair = _pair(given, cameras)
    free = given.axes is not None
    axes = given.axes or NORMAL_AXES
    east, north, up = (GROUND_AXES.index(each) if free else number for number, each in enumerate(axes))
    settings = Settings(given.processing.significance, str(given.processing.moved_camera))
    both = (cameras[0], cameras[1])
    return Survey(
        str(given.name),
        series,
        pair,
        settings,
        both,
        axes,
        (east, north, up),
        str(given.time_unit),
        tuple(files),
        tuple(findings.notes),
    )


def load_normal_case(
    file: str,
    camera: Phototheodolite,
    base: float,
    table: Table,
    stable: Sequence[str],
    settings: Settings,
) -> Survey:
    """Read a table of pseudo-parallaxes or coordinates of the normal case, without a project file.

    Parameters
    ----------
    base : float
        Base in metres.
    table : Table
        What the numbers of the table mean; its kind may be empty.

    Raises
    ------
    InputError
        With every fault of the table.
    """
    findings = Findings()
    centre = np.array([camera.principal_point] * 2)
    series = read_series(file, table, centre, Wanted(stable=tuple(stable)), findings)
    findings.stop()
    if series is None:  # cannot be: stop() told the reason
        raise InputError(f"{file} cannot be read")
    pair = normal_pair(camera.principal_distance, base)
    notes = tuple(findings.notes)
    return Survey(
        "displacements", series, pair, settings, (camera, camera), NORMAL_AXES, (0, 1, 2), "year", (file,), notes
    )


# ------------------------------------------------------------------------------------------------------- cameras


def _cameras(
    given: TerrestrialFile, root: Node, project: str, findings: Findings, files: list[str]
) -> list[Phototheodolite]:
    """Return the cameras of both stations."""
    known = own_presets()
    if given.presets is not None:
        node = root.find("presets")
        path = path_of(node, project) if node is not None else ""
        tree = read_named(path, root, ("presets",), findings)
        files.append(path)
        lists = checked(PresetFile, tree, findings) if tree is not None else None
        for name, each in lists.cameras.items() if lists is not None else ():
            known[str(name)] = Phototheodolite(str(name), each.principal_distance, each.principal_point, each.format)
    found = {str(name): _camera(str(name), each, known, root, findings) for name, each in given.cameras.items()}
    result = []
    for side, station in zip(SIDES, (given.stations.left, given.stations.right), strict=True):
        if station.camera in found:
            result += [camera for camera in [found[station.camera]] if camera is not None]
            continue
        key = ("stations", side, "camera")
        message = f"there is no camera `{station.camera}`"
        expected = f"one of {', '.join(found)}"
        findings.add(
            fault_at(root, key, message, "unknown-camera", expected=expected, fix=suggestion(station.camera, found))
        )
    return result


def _camera(
    name: str, given: Camera, known: dict[str, Phototheodolite], root: Node, findings: Findings
) -> Phototheodolite | None:
    """Return a camera: its preset with what is different."""
    if given.preset is not None and given.preset not in known:
        message = f"there is no preset `{given.preset}`"
        expected, fix = f"one of {', '.join(known)}", suggestion(given.preset, known)
        key = ("cameras", name, "preset")
        findings.add(fault_at(root, key, message, "unknown-camera", expected=expected, fix=fix))
        return None
    base = known[given.preset] if given.preset is not None else Phototheodolite(name, given.principal_distance or 0.0)
    return Phototheodolite(
        name,
        given.principal_distance or base.principal_distance,
        given.principal_point or base.principal_point,
        given.format or base.format,
    )


def _pair(given: TerrestrialFile, cameras: Sequence[Phototheodolite]) -> StereoPair:
    """Return the two stations."""
    focal = (cameras[0].principal_distance, cameras[1].principal_distance)
    if given.axes is None:
        normal = normal_pair(focal[0], given.base or 0.0)
        return StereoPair(focal, normal.centers, normal.rotations)
    order = [given.axes.index(axis) for axis in GROUND_AXES]
    scale = RADIANS[given.angle_unit]
    both = (given.stations.left, given.stations.right)
    centers = np.array([each.position for each in both], float)[:, order]
    return StereoPair(focal, centers, np.array([_rotation(each, scale) for each in both]))


def _rotation(station: Station, scale: float) -> Floats:
    angles = np.array([station.alpha or 0.0, station.omega or 0.0, station.kappa or 0.0]) * scale
    return ground_from_photo(*angles)


# -------------------------------------------------------------------------------------------------- measurements


def _series(
    given: TerrestrialFile | None,
    root: Node,
    project: str,
    cameras: Sequence[Phototheodolite],
    findings: Findings,
    files: list[str],
) -> Series | None:
    """Read the table of measurements, whether or not the rest of the project is right."""
    node = root.find("measurements")
    measured = valid_section(Measurements, node) if node is not None else None
    if measured is None:
        return None
    kind = "coordinates" if measured.coordinates is not None else "pseudo_parallaxes"
    key = ("measurements", kind)
    named = root.find(*key)
    path = path_of(named, project) if named is not None else ""
    files.append(path)
    inner = Findings(findings.notes)
    centre = np.array([each.principal_point for each in cameras] if len(cameras) == len(SIDES) else np.zeros((2, 2)))
    table = Table(kind, str(measured.unit), measured.z_axis, measured.sigma, measured.sigma_d)
    wanted = Wanted()
    if given is not None:
        epochs = tuple(str(each.id) for each in given.epochs or ())
        wanted = Wanted(epochs, _times(given, root, findings), tuple(map(str, given.stable)))
    series = read_series(path, table, centre, wanted, inner)
    findings.absorb(inner, lambda fault: _placed(fault, root, key))
    return series


def _placed(fault: Fault, root: Node, key: tuple[str, str]) -> Fault:
    """Return a fault of the project's own lists its place there, one of the table as a whole where it is named."""
    if not fault.file:
        return fault_at(root, steps(fault.key), fault.message, fault.code, expected=fault.expected, fix=fault.fix)
    return told_where_named(fault, root, key)


def _times(given: TerrestrialFile, root: Node, findings: Findings) -> tuple[float, ...] | None:
    """Return the times of the epochs, when they have any."""
    times = [each.time for each in given.epochs or ()]
    if not any(time is not None for time in times):
        return None
    for number, (before, time) in enumerate(zip([None, *times], times, strict=False)):
        if time is None:
            message = "the epoch has no time, others have"
            findings.add(
                fault_at(root, ("epochs", number), message, "missing-key", fix="give all epochs a time, or none")
            )
        elif before is not None and time <= before:
            message = f"the time {time:g} is not later than that of the epoch before, {before:g}"
            findings.add(fault_at(root, ("epochs", number, "time"), message, "order", expected="ascending times"))
    return tuple(time for time in times if time is not None)
