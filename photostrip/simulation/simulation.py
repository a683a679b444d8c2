"""The walk through a simulation: world, flight, points, image coordinates, control, errors; and what is true."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import counted
from photostrip.points import ControlPoints, ModelPoints, PhotoPoints, PointTable
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.flight import Photos, World, bent, fly, project, surface, world
from photostrip.simulation.measuring import (
    InjectedError,
    Sheets,
    TruePlaces,
    plotted,
    sheets,
    spoil_control,
    spoil_images,
)
from photostrip.simulation.placement import Placed, Roles, given_coordinates, place, roles, shown
from photostrip.simulation.spec import LARGEST_ARC, Spec, faults_of
from photostrip.strip.corrections import distort

STATED_SIGMA = 0.001  # mm: what is stated of image coordinates that have no errors
MOST_ROUND_TRIP = 1e-4  # metres
LEAST_COMMON = 5  # points common to two photos that relative orientation needs


@dataclass(frozen=True, eq=False)
class Truth:
    """What only a simulation knows."""

    # true coordinates of all points in the Cartesian frame, in the order of the observations' points
    points: PointTable
    ground: PointTable  # the same east, north, up in the output frame, in its units
    photo_ids: tuple[str, ...]  # photos, in the order of the observations' photos
    centers: Floats  # (m, 3): perspective centres in the Cartesian frame, metres
    centers_ground: Floats  # (m, 3): the same east, north, up in the output frame, in its units
    rotations: Floats  # (m, 3, 3): rotations that take image axes to the Cartesian frame
    # (m, 3, 3): rotations that take image axes to the output frame's east, north, up at the perspective centre
    rotations_local: Floats
    # (n, 2): what would be measured without any error of measurement, in the system and order of the observations, mm
    image: Floats
    errors: tuple[InjectedError, ...]


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated project: everything that would be given, and the truth."""

    spec: Spec
    strips: tuple[tuple[str, tuple[str, ...]], ...]  # id and photos, in flight order, of each strip
    camera: Camera
    # measured image points in mm, y up: in the comparator when there are fiducial measurements, otherwise in the
    # camera's image system (its principal point is not subtracted)
    observations: PhotoPoints
    control: ControlPoints  # control and check points; ``frame`` counts in `frames`
    frames: tuple[FrameSpec, ...]  # frame of each control list; the first is that of the output
    fiducials: PhotoPoints | None  # measured fiducial marks, mm
    gnss: Floats | None  # (m, 3): measured perspective centres east, north, up in the first frame, in its units
    truth: Truth
    # measured models, when they stand in place of image coordinates; the observations then only say what is seen
    models: ModelPoints | None = None


def simulate(spec: Spec) -> Simulation:
    """Simulate strips of photos; numbers are not rounded.

    Random numbers are drawn as ``draws`` says; each function below names its draws. Image noise (`Purpose.IMAGE`): for
    each row of the observations, by photo and point, x, y.

    Raises InputError with everything that cannot be simulated; also when neighbouring photos turn out to share too few
        points.
    """
    if faults := faults_of(spec):
        raise InputError(faults)
    frames, output = _tied(spec)
    space = world(spec, output.ellipsoid)
    _check_extent(spec, space)
    photos = fly(spec, space)
    placed = place(spec, space, surface(spec), photos)
    photo, point = shown(spec, photos, placed)
    _check_overlap(spec, photos, photo, point)
    _check_reach(spec, frames, placed, photos)
    chosen = roles(spec, placed, _rays(spec, placed, photo, point))
    names = _names(placed, chosen)
    named = _with_final_names(spec, placed, names)
    film = sheets(spec, len(photos.ids))
    image = _image(spec, photos, placed, film, photo, point)
    observations, keep = _observations(spec, photos, names, photo, point, image)
    observations, image_errors = spoil_images(named, observations)
    offset, control_errors = spoil_control(named, tuple(names[i] for i in chosen.control.tolist()), chosen.use)
    every = PointTable(names, placed.xyz)
    points = PointTable(observations.point_ids, placed.xyz[keep])
    truth = _truth(output, points, photos, image, image_errors + control_errors)
    places = TruePlaces(photo_ids=photos.ids, points=points.xyz, centers=photos.centers, rotations=truth.rotations)
    return Simulation(
        spec=spec,
        strips=photos.strips,
        camera=spec.camera,
        observations=observations,
        control=given_coordinates(spec, chosen, every, offset, frames),
        frames=tuple(frame.spec for frame in frames),
        fiducials=_fiducials(spec, photos, film),
        gnss=_gnss(spec, photos, output),
        truth=truth,
        models=plotted(spec, photos.strips, observations, places),
    )


def frame_specs(spec: Spec) -> list[FrameSpec]:
    """Frames of the control lists: one, or two when there is a second CRS."""
    g = spec.ground
    frames = [
        FrameSpec(crs=g.crs, axes=g.axes, height=g.height, geoid_undulation=g.geoid_undulation, ellipsoid=g.ellipsoid)
    ]
    if spec.control.second_crs is not None:
        frames.append(
            FrameSpec(crs=spec.control.second_crs, axes=g.axes, height=g.height, geoid_undulation=g.geoid_undulation)
        )
    return frames


def _tied(spec: Spec) -> tuple[list[GroundFrame], GroundFrame]:
    """Make the frames; what is wrong with them is reported at the keys of the specification."""
    try:
        return tie_frames(frame_specs(spec))
    except InputError as error:
        faults = []
        for fault in error.faults:
            path, _, name = fault.key.rpartition(".")
            second = path == "control[1]"
            faults.append(replace(fault, key="control.second_crs" if second and name == "crs" else f"ground.{name}"))
        raise InputError(faults) from None


def _check_reach(spec: Spec, frames: list[GroundFrame], placed: Placed, photos: Photos) -> None:
    """Refuse strips that lie where a map projection or a grid does not reach."""
    for number, frame in enumerate(frames):
        reason = ""
        try:
            ground = frame.ground_from_cartesian(placed.xyz, ids=placed.ids)
            returned = frame.cartesian_from_ground(ground, ids=placed.ids)
            frame.ground_from_cartesian(photos.centers, ids=photos.ids)
            frame.axes_at(photos.centers)
        except (GeometryError, InputError) as error:
            reason = str(error)
        else:
            if np.abs(returned - placed.xyz).max() > MOST_ROUND_TRIP:
                reason = "coordinates do not lead back to where they came from"
        if reason:
            key = "control.second_crs" if number else "ground.center_deg"
            where = ", ".join(f"{angle:g}" for angle in spec.ground.center_deg)
            message = f"strips around longitude, latitude {where} cannot be given in {frame.spec.name}: {reason}"
            raise InputError(Fault(message, code="simulation-place", key=key, fix="choose a CRS made for that place"))


def _check_extent(spec: Spec, space: World) -> None:
    """Refuse strips that would go round the body."""
    length = np.hypot(spec.flight.photos * spec.base, spec.flight.strips * spec.strip_distance)
    if length > LARGEST_ARC * space.radius:
        message = f"strips of {length / 1000.0:.0f} km are too long for a body of {space.radius / 1000.0:.0f} km radius"
        raise InputError(Fault(message, code="simulation-extent", key="flight.photos", fix="fewer photos"))


def _check_overlap(spec: Spec, photos: Photos, photo: Numbers, point: Numbers) -> None:
    """Refuse a strip that could not be formed, naming the photos."""
    n = spec.flight.photos
    starts = np.searchsorted(photo, np.arange(len(photos.ids) + 1))
    on = [point[a:b] for a, b in pairwise(starts.tolist())]
    faults = []
    for k in range(len(photos.ids) - 1):
        if k % n == n - 1:
            continue
        common = np.intersect1d(on[k], on[k + 1], assume_unique=True)
        names = f"{photos.ids[k]} and {photos.ids[k + 1]}"
        if len(common) < LEAST_COMMON:
            faults.append(f"photos {names} show only {counted(len(common), 'common point')}; {LEAST_COMMON} are needed")
        elif k % n < n - 2 and not np.isin(common, on[k + 2], assume_unique=True).any():
            faults.append(f"no point lies on photos {photos.ids[k]}, {photos.ids[k + 1]} and {photos.ids[k + 2]}")
    if faults:
        fix = "raise end_lap_percent or extra_per_model, or lower attitude_sigma_deg, photo_rotation_deg or relief"
        raise InputError([Fault(text, code="simulation-overlap", key="flight", fix=fix) for text in faults])


def _rays(spec: Spec, placed: Placed, photo: Numbers, point: Numbers) -> Numbers:
    """On how many photos of its own strip each point lies."""
    n = spec.flight.photos
    in_strip = photo // n == placed.home[point] // n
    return np.bincount(point[in_strip], minlength=len(placed.ids))


def _names(placed: Placed, chosen: Roles) -> tuple[str, ...]:
    """Ids of all points: control points G, check points K, the others as they were placed."""
    names = list(placed.ids)
    for letter, rows in (("G", chosen.control.tolist()), ("K", chosen.check.tolist())):
        digits = max(2, len(str(len(rows))))
        for number, row in enumerate(rows):
            names[row] = f"{letter}{number + 1:0{digits}d}"
    return tuple(names)


def _with_final_names(spec: Spec, placed: Placed, names: tuple[str, ...]) -> Spec:
    """Let gross errors name a point also as it was called before it became a control or check point."""
    final = dict(zip(placed.ids, names, strict=True))
    entries = tuple(replace(each, point=final.get(each.point or "", each.point)) for each in spec.gross_errors)
    return replace(spec, gross_errors=entries)


def _image(spec: Spec, photos: Photos, placed: Placed, film: Sheets | None, photo: Numbers, point: Numbers) -> Floats:
    """Image coordinates without errors of measurement, mm."""
    camera = spec.camera
    ray = placed.xyz[point] - photos.centers[photo]
    if spec.refraction:
        ray = bent(photos, photo, ray, spec.terrain.height)
    xy = distort(project(photos, photo, ray, camera.principal_distance)[0], camera)
    return xy if film is None else film.comparator_from_photo(photo, xy)


def _observations(
    spec: Spec, photos: Photos, names: tuple[str, ...], photo: Numbers, point: Numbers, image: Floats
) -> tuple[PhotoPoints, Numbers]:
    """Measure: add the noise. Gives also the numbers of the points that are measured at all."""
    _, first, inverse = np.unique(point, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))  # points are numbered as they appear
    keep = point[np.sort(first)]
    sigma = spec.image.sigma_um / 1000.0
    noise = Draws(spec.seed, Purpose.IMAGE).normal(len(point), 2)
    observations = PhotoPoints(
        photo_ids=photos.ids,
        point_ids=tuple(names[i] for i in keep.tolist()),
        photo=photo,
        point=rank[inverse.ravel()],
        xy=image + sigma * noise,
        sigma=np.full(image.shape, sigma or STATED_SIGMA),
    )
    return observations, keep


def _fiducials(spec: Spec, photos: Photos, film: Sheets | None) -> PhotoPoints | None:
    """Measure the fiducial marks of every photo. Draws (`Purpose.FIDUCIALS`): for each photo and mark x, y."""
    if film is None:
        return None
    marks, n = spec.camera.fiducials, len(photos.ids)
    photo, mark = np.repeat(np.arange(n), len(marks)), np.tile(np.arange(len(marks)), n)
    true = film.comparator_from_photo(photo, np.array(list(marks.values()))[mark])
    sigma = spec.image.sigma_um / 1000.0
    noise = Draws(spec.seed, Purpose.FIDUCIALS).normal(len(mark), 2)
    return PhotoPoints(
        photo_ids=photos.ids,
        point_ids=tuple(marks),
        photo=photo,
        point=mark,
        xy=true + sigma * noise,
        sigma=np.full(true.shape, sigma or STATED_SIGMA),
    )


def _gnss(spec: Spec, photos: Photos, output: GroundFrame) -> Floats | None:
    """Measure the perspective centres. Draws (`Purpose.GNSS`): for each photo east, north, up."""
    if spec.gnss is None:
        return None
    error = Draws(spec.seed, Purpose.GNSS).normal(len(photos.ids), 3) * spec.gnss.sigma
    moved = photos.centers + np.einsum("ni,nij->nj", error, output.axes_at(photos.centers))
    return output.ground_from_cartesian(moved)


def _truth(
    output: GroundFrame, points: PointTable, photos: Photos, image: Floats, errors: tuple[InjectedError, ...]
) -> Truth:
    return Truth(
        points=points,
        ground=PointTable(points.ids, output.ground_from_cartesian(points.xyz)),
        photo_ids=photos.ids,
        centers=photos.centers,
        centers_ground=output.ground_from_cartesian(photos.centers),
        rotations=photos.rotations,
        rotations_local=output.axes_at(photos.centers) @ photos.rotations,
        image=image,
        errors=errors,
    )
