"""From what the project says to what the house works with: cameras, image coordinates, control, settings.

Here the user's units, axes and directions end: inside there are millimetres with y up, and east, north, up.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from photostrip import camera
from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.measured import (
    QUATERNION,
    ROTATIONS,
    ControlTable,
    Measurements,
    OrientationTable,
    PositionTable,
)
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import WGS84, GroundFrame
from photostrip.geodesy.local_frame import mean_radius, radius_in_azimuth
from photostrip.geometry.rotation import about, angle_rates, angles, from_angles, separable_angles
from photostrip.notes import Note, counted
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations, Settings, Strip
from photostrip.points import ControlPoints, PhotoPoints, concatenated
from photostrip.project.keys import (
    AUTO,
    Camera,
    Control,
    Distortion,
    Ellipsoid,
    FiducialMeasurements,
    FirstPhoto,
    GivenAngles,
    GivenList,
    Observations,
    Orientations,
    Output,
    PixelCamera,
    Processing,
    ProjectFile,
)
from photostrip.project.keys import CameraPositions as PositionsBlock
from photostrip.project.reading import Node
from photostrip.strip import fiducial_marks, formed_strip
from photostrip.strip.fiducial_marks import Certificate

PER_MILLIMETRE = {"mm": 1.0, "um": 1e3, "0.1um": 1e4}
_NUMBERED = re.compile(r"([^0-9]*)([0-9]*)")
RADIANS = {"deg": np.pi / 180, "gon": np.pi / 200, "rad": 1.0}  # in a unit of angles
AHEAD = about(0, np.pi / 2.0)  # of image axes: a camera that looked down looks ahead
PIXELS = "px"


def cameras(project: ProjectFile) -> dict[str, camera.Camera]:
    return {name: _camera(name, each) for name, each in project.cameras.items()}


def certificate_of(given: Camera | PixelCamera) -> Certificate | None:
    """Solve the distances between the fiducial marks of a camera; None when no distances are given.

    Raises InputError when the distances give no figure; keys begin at the camera.
    """
    if isinstance(given, PixelCamera) or not given.fiducial_distances:
        return None
    nominal = dict(given.fiducials) if given.fiducials else None
    distances = [(str(first), str(second), length) for first, second, length in given.fiducial_distances]
    return fiducial_marks.solve(distances, nominal=nominal, places=given.fiducial_places)


def _camera(name: str, given: Camera | PixelCamera) -> camera.Camera:
    if isinstance(given, PixelCamera):
        return given.in_millimetres(name)
    solved = certificate_of(given)
    found = camera.Camera(
        name=name,
        principal_distance=given.principal_distance,
        principal_point=given.principal_point,
        format=given.format,
        fiducials=dict(given.fiducials) if solved is None else solved.marks,
        pixel_size=given.pixel_size,
        distortion=None if given.distortion is None else distortion_of(given.distortion),
    )
    return found if given.distortion is None else with_k0(found, given.distortion.k0)


def with_k0(given: camera.Camera, k0: float) -> camera.Camera:
    """Return a camera whose principal distance and coefficients hold what D = X k0 + ... does besides.

    The linear term scales the image. From image to ideal: X (1 + k0) + D(X) over f is X + D(X) / (1 + k0) over
    f / (1 + k0). From ideal to image: X (1 + k0) + D(X) of X = f u is X' + D(X' / (1 + k0)) of X' = f (1 + k0) u.
    """
    lens, scale = given.distortion, 1.0 + k0
    if lens is None or not k0:
        return given
    inverse = lens.direction == "image_to_ideal"

    def scaled(values: tuple[float, ...], *degrees: int) -> Any:  # noqa: ANN401 (as many as there are)
        return tuple(value / scale ** (1 if inverse else degree) for value, degree in zip(values, degrees, strict=True))

    return replace(
        given,
        principal_distance=given.principal_distance / scale if inverse else given.principal_distance * scale,
        distortion=replace(lens, k=scaled(lens.k, 3, 5, 7), p=scaled(lens.p, 2, 2), b=scaled(lens.b, 1, 1)),
    )


def distortion_of(given: Distortion) -> camera.Distortion:
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in given if name != "k0"
    }
    return camera.Distortion(**values)


def strips(project: ProjectFile, known: Mapping[str, camera.Camera]) -> tuple[Strip, ...]:
    """Return the strips, then every photo of `photos` by itself, by their ids, however they are listed."""
    found = [
        Strip(
            id=str(each.id),
            camera=known[each.camera],
            photos=tuple(map(str, each.photos)),
            first=_first_photo(each.first_photo),
            calibrate=_calibrated(project, each.camera),
        )
        for each in project.strips
        if each.camera is not None
    ]
    singles = [
        Strip(name, known[each.camera], (name,), calibrate=_calibrated(project, each.camera), listed=False)
        for each in project.photos
        for name in map(str, each.photos or [])
    ]
    return (*found, *sorted(singles, key=lambda each: _by_number(each.id)))


def _calibrated(project: ProjectFile, name: str) -> tuple[str, ...]:
    """Parameters of a camera that the project asks for."""
    asked, own = project.processing.self_calibration, project.cameras[name].self_calibration
    return tuple(dict.fromkeys(([] if isinstance(asked, str) else asked) if own is None else own))


def _by_number(name: str) -> tuple[list[tuple[str, int]], str]:
    """Order ids as people count: 9 before 10."""
    return [(text, int(digits or -1)) for text, digits in _NUMBERED.findall(name)], name


def _first_photo(given: FirstPhoto | None) -> formed_strip.FirstPhoto:
    """Return the frame and the scale of a strip."""
    if given is None:
        return formed_strip.NOTHING_GIVEN
    rotation = from_angles(np.array(given.angles) * RADIANS[given.unit], given.system)
    return formed_strip.FirstPhoto(rotation, given.base)


def photo_points(
    read: Measurements | None,
    given: Observations | FiducialMeasurements | None,
    photos: Mapping[str, camera.Camera],
) -> PhotoPoints | None:
    """Bring measured image coordinates into millimetres, x to the right, y up, the origin in the middle of the photo.

    That of measured fiducial marks is where it is. Rows of other photos than `photos` are left out.
    """
    if read is None or given is None:
        return None
    unit, origin = given.unit or "mm", (given.origin if isinstance(given, Observations) else None) or "center"
    known = np.array([name in photos for name in read.photo_ids], bool)
    rows = slice(None) if known.all() else np.flatnonzero(known[read.photo])
    owners = [photos.get(name) for name in read.photo_ids]
    scale = _per_photo([_millimetres(unit, each) for each in owners], read, rows)
    sigma = _filled(read.sigma[rows], given.sigma)
    xy = _scaled(read.xy[rows], scale)
    if given.y_axis == "down":
        xy[:, 1] = -xy[:, 1]
    if origin != "center":
        half = origin == "first-pixel"
        xy += _per_photo([_corner(each, half_pixel=half) for each in owners], read, rows)
    affinity = [(0.0, 0.0) if each is None else each.pixel_affinity for each in owners]
    if np.any(affinity):
        stretch, shear = _per_photo(affinity, read, rows).T
        xy[:, 0] = (xy[:, 0] - shear * xy[:, 1]) / (1.0 + stretch)
    photo_ids, photo = _renumbered(read.photo_ids, read.photo[rows])
    point_ids, point = _renumbered(read.target_ids, read.target[rows])
    return PhotoPoints(
        photo_ids=photo_ids, point_ids=point_ids, photo=photo, point=point, xy=xy, sigma=_scaled(sigma, scale)
    )


def other_hand(project: ProjectFile) -> str:
    """Return what would be written if image or model coordinates were of the other hand; empty where none can be."""
    if project.models is not None:
        return f"`models.axes: {'right' if project.models.axes == 'left-handed' else 'left'}-handed`"
    given = project.observations
    if given is None or given.origin not in {None, "center"}:
        return ""
    return f"`observations.y_axis: {'up' if given.y_axis == 'down' else 'down'}`"


def _millimetres(unit: str, owner: camera.Camera | None) -> tuple[float, float]:
    """Factor and divisor that make millimetres of a unit; a division keeps 12345 um exactly 12.345 mm."""
    if unit == "px":
        return (owner.pixel_size or np.nan) if owner is not None else np.nan, 1.0
    return 1.0, PER_MILLIMETRE[unit]


def _corner(owner: camera.Camera | None, *, half_pixel: bool) -> tuple[float, float]:
    """Where x = y = 0 lies, in mm from the middle of the photo."""
    if owner is None or owner.format is None:
        return np.nan, np.nan
    shift = (owner.pixel_size or np.nan) / 2 if half_pixel else 0.0
    return -owner.format[0] / 2 + shift, owner.format[1] / 2 - shift


def _per_photo(values: Sequence[tuple[float, float]], read: Measurements, rows: Numbers | slice) -> Floats:
    return np.array(values, float).reshape(-1, 2)[read.photo[rows]]


def _scaled(values: Floats, scale: Floats) -> Floats:
    return np.asarray(values * scale[:, :1] / scale[:, 1:])


def _renumbered(ids: Sequence[str], codes: Numbers) -> tuple[tuple[str, ...], Numbers]:
    """Return the ids that are left new numbers, in order of first appearance."""
    first = np.full(len(ids), len(codes))
    first[codes[::-1]] = np.arange(len(codes))[::-1]  # of the rows of an id the first is assigned last, and stays
    order = np.argsort(first, kind="stable")[: np.count_nonzero(first < len(codes))]
    if np.array_equal(order, np.arange(len(ids))):
        return tuple(ids), codes
    rank = np.empty(len(ids), np.intp)
    rank[order] = np.arange(len(order))
    return tuple(ids[code] for code in order.tolist()), rank[codes]


def frame_spec(given: GivenList) -> FrameSpec:
    return FrameSpec(**{"axes": CARTESIAN_AXES, **_frame(given)})


def _frame(given: GivenList | Output) -> dict[str, Any]:
    """Return what is said of a frame."""
    keys = ("crs", "axes", "height", "geoid_undulation", "epoch")
    said = {name: value for name in keys if (value := getattr(given, name)) is not None}
    return said if given.ellipsoid is None else said | {"ellipsoid": semi_axes(given.ellipsoid)}


def semi_axes(given: Ellipsoid | None) -> tuple[float, float] | None:
    return None if given is None else (given.a, given.b)


def first_frame(project: ProjectFile) -> FrameSpec:
    """Return the frame that stands in where the output says nothing.

    It is that of the first control list, the camera positions or the orientations; ``local`` when nothing is given.
    """
    for given in (*project.control, project.camera_positions, project.orientations):
        if given is not None:
            return frame_spec(given)
    return FrameSpec("local", GROUND_AXES)


def output_spec(output: Output, first: FrameSpec) -> FrameSpec | None:
    """Return the frame of the results, `first` standing in for what is not given; None when nothing is given."""
    said = _frame(output)
    if not said:
        return None
    if output.crs is not None:
        return FrameSpec(**{"axes": CARTESIAN_AXES if output.crs == "geocentric" else GROUND_AXES, **said})
    if output.height is not None:
        said = {"geoid_undulation": None, **said}
    return replace(first, **said)


def control_points(tables: Sequence[ControlTable], lists: Sequence[Control]) -> ControlPoints:
    """Put the used points of all control lists into one table; ``frame`` counts in `lists`."""
    parts = [_control_points(*each, number) for number, each in enumerate(zip(tables, lists, strict=True))]
    nothing, none = np.zeros((0, 3)), np.zeros((0, 3), bool)
    return concatenated(parts or [ControlPoints(ids=(), enu=nothing, use=none, check=none[:, 0], sigma=nothing)])


def _control_points(read: ControlTable, given: Control, number: int) -> ControlPoints:
    rows = np.flatnonzero(read.used)
    ids, enu, sigma = _placed(read, given, rows)
    use, check = read.use[rows][:, ground_columns(given)], read.check[rows]
    return ControlPoints(ids=ids, enu=enu, use=use, check=check, sigma=sigma, frame=np.full(len(rows), number, np.intp))


def ground_columns(given: GivenList) -> list[int]:
    """Which of the columns x, y, z of a list is east, which north, which up (or X, Y, Z)."""
    axes = frame_spec(given).axes
    return [axes.index(name) for name in (CARTESIAN_AXES if "x" in axes else GROUND_AXES)]


def _placed(
    read: ControlTable | PositionTable | OrientationTable,
    given: Control | PositionsBlock | Orientations,
    rows: Numbers,
) -> tuple[tuple[str, ...], Floats, Floats]:
    """Return ids, coordinates and standard deviations of some rows of a list, in the internal order of axes."""
    columns = ground_columns(given)
    sigma = _filled(read.sigma[rows], given.sigma)[:, columns]
    return tuple(read.ids[row] for row in rows), read.xyz[rows][:, columns], sigma


def camera_positions(
    read: PositionTable | None, given: PositionsBlock | None, photos: Mapping[str, camera.Camera]
) -> CameraPositions | None:
    """Return the measured positions of the cameras of `photos`, in the internal order of axes."""
    if read is None or given is None:
        return None
    rows = np.array([row for row, name in enumerate(read.ids) if name in photos and read.used[row]], np.intp)
    ids, enu, sigma = _placed(read, given, rows)
    return CameraPositions(
        photos=ids,
        frame=frame_spec(given),
        enu=enu,
        use=read.use[rows][:, ground_columns(given)],
        sigma=sigma,
        time=read.time[rows],
        lever_arm=given.lever_arm,
        correction=given.correction,
        group=given.group,
    )


def given_orientations(
    read: OrientationTable | None,
    given: Orientations | None,
    photos: Mapping[str, camera.Camera],
    frames: Mapping[FrameSpec, GroundFrame],
) -> GivenOrientations | None:
    """Return the given orientations of `photos`, in the internal order of axes, in radians and from grid north.

    frames: the ground frames, tied, by what the project says of them.
    """
    if read is None or given is None:
        return None
    rows = np.array([row for row, name in enumerate(read.ids) if name in photos], np.intp)
    spec, radians = frame_spec(given), RADIANS[given.angles.unit]
    ids, enu, sigma = _placed(read, given, rows)
    values = read.angles[rows] * (1.0 if given.angles.system in ROTATIONS else radians)
    north = norths(ids, enu, frames[spec]) if given.angles.north == "true" else None
    found = attitudes(values, _filled(read.sigma_angles[rows], given.sigma_angles) * radians, given.angles, north)
    return GivenOrientations(
        photos=ids,
        frame=spec,
        enu=enu,
        angles=found.angles,
        system=found.system,
        sigma=sigma,
        sigma_turns=found.sigma_turns,
        observed=given.role == "observed",
        stated=found.stated,
    )


def norths(photos: Sequence[str], enu: Floats, frame: GroundFrame) -> Floats:
    """Return the azimuth of grid north at each photo, radians."""
    return frame.convergence(frame.cartesian_from_ground(enu, ids=[f"of photo {name}" for name in photos]))


def _filled(sigma: Floats, default: Sequence[float] | float | None) -> Floats:
    """Put the default where a row has no standard deviation of its own."""
    return sigma if default is None else np.where(np.isnan(sigma), default, sigma)


def _earth_radius(wanted: Processing) -> float:
    """Radius of the Earth for eq. 153: as given, or of the ellipsoid at a latitude, in an azimuth."""
    if wanted.earth_latitude is None:
        return wanted.earth_radius
    latitude = np.radians(wanted.earth_latitude)
    if wanted.earth_azimuth is None:
        return float(mean_radius(latitude, WGS84))
    return float(radius_in_azimuth(latitude, np.radians(wanted.earth_azimuth), WGS84))


def settings(project: ProjectFile) -> Settings:
    """Return the settings of every operation; what the project does not give keeps the default that stands there.

    Those of an operation are the keys of the block with its name, or of the same names in `processing` itself.
    """
    wanted, usual, radius = project.processing, Settings(), _earth_radius(project.processing)
    keys = {**dict(wanted), "earth_radius": radius}
    parts = {name: part for name, part in vars(usual).items() if is_dataclass(part)}
    laid = {name: _laid_over(part, dict(keys[name]) if name in keys else keys) for name, part in parts.items()}
    laid["bundle"] = replace(laid["bundle"], search_cameras=wanted.self_calibration == AUTO)
    laid["refinement"] = replace(laid["refinement"], earth_radius=radius if wanted.earth_curvature == "image" else None)
    return replace(
        usual,
        adjustment=wanted.adjustment,
        precision=wanted.precision,
        cross_validation=wanted.cross_validation,
        angle_system=project.output.angles.system,
        angle_unit=project.output.angles.unit,
        tolerances={name: limit for name, limit in project.tolerances if limit is not None},
        accept=tuple(map(str, project.accept)),
        **laid,
    )


def _laid_over(usual: Any, given: Mapping[str, Any]) -> Any:  # noqa: ANN401 (settings of any operation)
    """Replace the fields of settings by the keys of the same names."""
    changed = {name: value for name, value in given.items() if hasattr(usual, name)}
    for name, value in changed.items():
        if isinstance(value, list):
            changed[name] = type(getattr(usual, name))(map(str, value))
    return replace(usual, **changed)


class Attitudes(NamedTuple):
    angles: Floats  # (n, 3): radians, in a system of ``geometry.rotation.SYSTEMS``
    system: str
    sigma_turns: Floats  # (n, 3): standard deviations of small turns about the axes of the photo, radians
    stated: bool  # whether angles and system are the user's own


def attitudes(values: Floats, sigma: Floats, given: GivenAngles, north: Floats | None) -> Attitudes:
    """Return rotations from image axes (x right, y up, z towards the viewer) to grid east, grid north, normal.

    values: (n, 3) angles in radians; (n, 4) quaternions w, x, y, z; (n, 9) matrices by rows.
    sigma: (n, 3) standard deviations of the angles, of others of small turns about the image axes, radians.
    north: azimuth of grid north at each photo, radians, where the rotations count from true north.
    """
    stated = given.system not in ROTATIONS
    if stated:
        rotations, rates = from_angles(values, given.system), angle_rates(values, given.system)
        if given.looks == "ahead":
            rotations, stated = rotations @ AHEAD, False
        sigma = np.sqrt(np.einsum("nij,nj->ni", (rotations.transpose(0, 2, 1) @ rates) ** 2, sigma**2))
    else:
        rotations = _rotations(values, given)
    if north is None and stated:
        return Attitudes(angles=values, system=given.system, sigma_turns=sigma, stated=stated)
    if north is not None:  # an azimuth from grid north is smaller by the convergence
        rotations = about(2, north) @ rotations
    if stated:
        try:
            return Attitudes(
                angles=angles(rotations, given.system), system=given.system, sigma_turns=sigma, stated=stated
            )
        except GeometryError:
            pass
    system, separable = separable_angles(rotations)
    return Attitudes(angles=separable, system=system, sigma_turns=sigma, stated=False)


def _rotations(values: Floats, given: GivenAngles) -> Floats:
    """Return the nearest rotations to quaternions, or to matrices as they are printed with few digits."""
    from scipy.spatial.transform import Rotation  # takes 30 ms to load, and angles do without

    if given.system == QUATERNION:
        found = Rotation.from_quat(values[:, [1, 2, 3, 0]]).as_matrix()
    else:
        found = Rotation.from_matrix(values.reshape(-1, 3, 3)).as_matrix()
    if given.rotates == "ground_to_image":
        found = found.transpose(0, 2, 1)
    turned = found if given.y_axis == "up" else found * (1.0, -1.0, -1.0)
    return np.asarray(turned, float)


def with_pixel_sizes(
    project: ProjectFile, marks: Measurements | None, known: Mapping[str, camera.Camera], root: Node
) -> tuple[dict[str, camera.Camera], list[Note]]:
    """Return the cameras with the sizes of pixels that the project does not state and its marks tell.

    The interior orientation of each photo finds its own scale: this one makes millimetres of the stated standard
    deviations and of whatever is said about measured coordinates.

    Raises InputError for a camera whose marks tell no scale.
    """
    found = dict(known)
    notes: list[Note] = []
    faults: list[Fault] = []
    given, observations = project.fiducial_measurements, project.observations
    if given is None or marks is None or observations is None:
        return found, notes
    if observations.unit != PIXELS or (given.unit or PIXELS) != PIXELS:
        return found, notes
    for name, owner in known.items():
        photos = {photo for photo, used in project.camera_of.items() if used == name}
        if owner.pixel_size is not None or not owner.fiducials or not photos:
            continue
        sizes = _sizes(marks, owner, photos)
        path = ("cameras", name, "pixel_size")
        if not len(sizes):
            message = "the fiducial marks do not tell the size of a pixel"
            faults.append(Fault(message, "missing-key", key=".".join(path), expected="the size of a pixel in mm"))
            continue
        size = float(f"{np.median(sizes):.6g}")
        found[name] = replace(owner, pixel_size=size)
        message = (
            f"camera {name} has no pixel_size: a pixel is {size * 1000:.4g} µm by the calibrated fiducial marks of "
            f"{counted(len(sizes), 'photo')}"
        )
        place = root.place_of(path[:2])
        note = Note("pixel-size-derived", message, "note", file=place.file, line=place.line, column=place.column)
        notes.append(replace(note, key=".".join(path)))
    if faults:
        raise InputError(faults)
    return found, notes


def _sizes(marks: Measurements, owner: camera.Camera, photos: set[str]) -> Floats:
    """Millimetres to a pixel of each photo with two marks or more, from how far its marks lie about their centroid."""
    names = {name: row for row, name in enumerate(owner.fiducials)}
    calibrated = np.array(list(owner.fiducials.values()), float)
    row_of = np.array([names.get(name, -1) for name in marks.target_ids], np.intp)[marks.target]
    found = []
    for number, photo in enumerate(marks.photo_ids):
        rows = np.flatnonzero((marks.photo == number) & (row_of >= 0))
        if photo not in photos or len(rows) < 2:
            continue
        spreads = [np.linalg.norm(xy - xy.mean(axis=0)) for xy in (calibrated[row_of[rows]], marks.xy[rows])]
        if min(spreads) > 0.0:
            found.append(float(spreads[0] / spreads[1]))
    return np.array(found)
