"""From inputs with ids and frames to the arrays of a bundle adjustment, in the Cartesian frame about a local origin.

Independent models in their network: start values, observations, and the result as the pipeline goes on with it.

A model's coordinates count from their mean: a plotter may have them start anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.rotation import from_angles
from photostrip.geometry.similarity import Similarity
from photostrip.network.adjustment import Selection, placeable
from photostrip.network.problem import (
    ASKED,
    AttitudeObservations,
    BundleCameras,
    BundleProblem,
    ControlObservations,
    ImageObservations,
    PositionObservations,
    StartValues,
)
from photostrip.network.reliability import sigmas
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.inputs import (
    CameraPositions,
    GivenOrientations,
    Inputs,
    MeasuredModels,
    Settings,
    rows_of,
    rows_of_models,
)
from photostrip.pipeline.precision import mean_points
from photostrip.pipeline.results import BlockProblem, BlockStart, StripResult
from photostrip.points import ControlPoints, ModelPoints, PhotoPoints, locate, located
from photostrip.strip.control_screening import majority
from photostrip.strip.resection import KnownPhotos, project

FAR_FROM_RAY = 5.0  # times the median: a ray of no pair that misses its point by more waits outside at first
LEAST_FAR = 50.0  # in standard deviations
NO_CORRECTION, DRIFT, BLOCK = "none", "drift", "block"


def build(
    inputs: Inputs,
    settings: Settings,
    observations: PhotoPoints,
    control: ControlPoints,
    ground: GroundFrames,
    start: BlockStart,
) -> BlockProblem:
    """Collect everything that is observed."""
    # whole numbers: nothing is lost when the origin is added back
    origin: Floats = np.round(np.nanmean(start.points, axis=0, dtype=np.float64), -1)
    photo = start.rows_of(observations.photo_ids)
    rows = np.flatnonzero(~_named(settings.relative.drop, observations))
    images = ImageObservations(
        photo=photo[observations.photo[rows]],
        point=observations.point[rows],
        xy=observations.xy[rows],
        sigma=observations.sigma[rows],
    )
    given, control_rows = control_observations(control, ground.control, observations, start, origin)
    positions, level = _positions(inputs, ground.positions, ground.orientations, start, origin)
    attitudes = _attitudes(inputs.orientations, ground.orientations, start)
    geocentric = ground.positions is not None and ground.positions.kind == "geocentric"
    problem = BundleProblem(
        images=images,
        cameras=_cameras(inputs, settings),
        start=StartValues(start.centers - origin, start.rotations, start.points - origin),
        control=given,
        positions=positions,
        attitudes=attitudes,
        photo_ids=start.photos,
        point_ids=observations.point_ids,
        camera_ids=tuple(dict.fromkeys(strip.camera.name for strip in inputs.strips)),
        group_ids=tuple(dict.fromkeys(_groups(inputs))),
        position_axes=CARTESIAN_AXES if geocentric else GROUND_AXES,
    )
    placing = placeable(problem, Selection.everything(problem))  # what one photo alone shows is told, and tests nothing
    rows, problem = rows[placing], replace(problem, images=images.take(placing))
    return BlockProblem(
        problem=problem,
        origin=origin,
        begin=_begin(problem, rows, control, control_rows, start),
        kept=_named(settings.relative.keep, observations)[rows],
        rows=rows,
        control=control_rows,
        level={"control": _level(ground.control, given.frame), "position": level},
    )


def _level(frames: Sequence[GroundFrame], numbers: Numbers) -> tuple[bool, ...]:
    """Whether the axes of each row are plan and height, by the numbers of the frames."""
    return tuple(frames[number].kind != "geocentric" for number in numbers.tolist())


def _named(entries: Sequence[str], observations: PhotoPoints) -> Flags:
    """Mark the measurements that a list of the user names."""
    flags = np.zeros(len(observations), bool)
    flags[[row for row in rows_of(entries, observations).values() if row >= 0]] = True
    return flags


def _cameras(inputs: Inputs, settings: Settings) -> BundleCameras:
    cameras = {strip.camera.name: strip for strip in inputs.strips}
    of_photo = locate([strip.camera.name for strip in inputs.strips for _ in strip.photos], cameras)
    focal = np.array([strip.camera.principal_distance for strip in cameras.values()])
    asked = [strip.calibrate for strip in cameras.values()]
    stated = settings.bundle.calibration_sigma
    taken_out = settings.refinement.distortion
    return BundleCameras(
        of_photo=of_photo,
        focal=focal,
        sigma=sigmas(asked, stated),
        prior=sigmas([ASKED] * len(focal), stated),
        distortion=tuple(strip.camera.distortion if taken_out else None for strip in cameras.values()),
    )


class GivenPositions(NamedTuple):
    """Given coordinates as ``ControlObservations`` has them."""

    xyz: Floats  # (n, 3)
    axes: Floats  # (n, 3, 3)
    sigma: Floats  # (n, 3)


def given_positions(
    enu: Floats, use: Flags, sigma: Floats, frame: GroundFrame, near: Floats, ids: Sequence[str]
) -> GivenPositions:
    """Given coordinates as observations in the Cartesian frame.

    enu, use, sigma: (n, 3), coordinates in the units of their frame, internal order; which count; their precision, m.
    near: (n, 3), present positions, Cartesian: they stand in for what does not count.
    """
    if not use.all():
        enu = np.where(use, enu, frame.ground_from_cartesian(near, ids=ids))
    xyz = frame.cartesian_from_ground(enu, ids=ids)
    return GivenPositions(xyz, frame.axes_at(xyz), np.where(use, sigma, np.inf))


def control_observations(
    control: ControlPoints, frames: Sequence[GroundFrame], observations: PhotoPoints, start: BlockStart, origin: Floats
) -> tuple[ControlObservations, Numbers]:
    """Control as observations; points without start coordinates, which no ray determines, are left out."""
    point = locate(control.ids, observations.point_ids)
    rows = np.flatnonzero(np.isfinite(start.points[point, 0]))
    xyz, axes, sigma = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
    for index, frame in enumerate(frames):
        inside = control.frame[rows] == index
        chosen = rows[inside]
        if len(chosen):
            ids = [control.ids[row] for row in chosen]
            xyz[inside], axes[inside], sigma[inside] = given_positions(
                control.enu[chosen], control.use[chosen], control.sigma[chosen], frame, start.points[point[chosen]], ids
            )
    given = ControlObservations(
        point=point[rows],
        xyz=xyz - origin,
        axes=axes,
        sigma=sigma,
        frame=control.frame[rows],
        height_only=np.asarray(~control.use[rows, :2].any(axis=1), bool),
    )
    return given, rows


def _positions(
    inputs: Inputs, frame: GroundFrame | None, of_orientations: GroundFrame | None, start: BlockStart, origin: Floats
) -> tuple[PositionObservations, tuple[bool, ...]]:
    """Camera positions and centres of observed orientations; and whether the axes of each row are plan and height."""
    parts: list[PositionObservations] = []
    level: list[bool] = []
    if inputs.positions is not None and frame is not None and len(inputs.positions.photos):
        parts.append(_measured(inputs, inputs.positions, frame, start, origin))
        level += [frame.kind != "geocentric"] * len(parts[-1])
    orientations = inputs.orientations
    if orientations is not None and of_orientations is not None and orientations.observed and orientations.photos:
        photo = start.rows_of(orientations.photos)
        use = np.ones((len(photo), 3), bool)
        xyz, axes, sigma = given_positions(
            orientations.enu, use, orientations.sigma, of_orientations, start.centers[photo], orientations.photos
        )
        none = np.zeros((len(photo), 3))
        parts.append(
            PositionObservations(
                photo=photo,
                xyz=xyz - origin,
                axes=axes,
                sigma=sigma,
                lever=none,
                group=np.full(len(photo), -1),
                time=np.zeros(len(photo)),
            )
        )
        level += [of_orientations.kind != "geocentric"] * len(photo)
    if len(parts) < 2:
        return parts[0] if parts else PositionObservations(), tuple(level)
    names = ("photo", "xyz", "axes", "sigma", "lever", "group", "time")
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return replace(parts[0], **joined), tuple(level)


def _measured(
    inputs: Inputs, positions: CameraPositions, frame: GroundFrame, start: BlockStart, origin: Floats
) -> PositionObservations:
    """Measured positions with lever arm, offset and drift of each strip."""
    photo = start.rows_of(positions.photos)
    lever = np.broadcast_to(np.array(positions.lever_arm, float), (len(photo), 3))
    near = start.centers[photo] + np.einsum("nij,nj->ni", start.rotations[photo], lever)
    ids = [f"of photo {name}" for name in positions.photos]
    xyz, axes, sigma = given_positions(positions.enu, positions.use, positions.sigma, frame, near, ids)
    names = _groups(inputs)
    of_photo = [name for name, strip in zip(names, inputs.strips, strict=True) for _ in strip.photos]
    group, count = locate(of_photo, tuple(dict.fromkeys(names)))[photo], len(set(names))
    time = positions.time if np.isfinite(positions.time).all() else photo.astype(float)
    # only a coordinate that is in use somewhere has an offset; a drift needs two of them
    members = np.zeros((count, 3), np.intp)
    np.add.at(members, group, positions.use)
    mean = np.bincount(group, time, count) / np.maximum(np.bincount(group, minlength=count), 1)
    wanted = np.where((members > 0) & (positions.correction != NO_CORRECTION), np.inf, 0.0)
    drift = np.where((members > 1) & (positions.correction == DRIFT), np.inf, 0.0)
    return PositionObservations(
        photo=photo,
        xyz=xyz - origin,
        axes=axes,
        sigma=sigma,
        lever=lever,
        group=group,
        time=time - mean[group],
        offset_sigma=wanted,
        drift_sigma=drift,
    )


def _groups(inputs: Inputs) -> list[str]:
    """Name the group of each strip, whose positions share offset and drift; photos listed in no order are one."""
    if inputs.positions is not None and inputs.positions.group == BLOCK:
        return ["of the block"] * len(inputs.strips)
    return [strip.id if strip.listed else "of the photos in no order" for strip in inputs.strips]


def _attitudes(given: GivenOrientations | None, frame: GroundFrame | None, start: BlockStart) -> AttitudeObservations:
    """Observed rotations, with standard deviations about the photo's own axes."""
    if given is None or frame is None or not given.observed or not given.photos:
        return AttitudeObservations()
    photo = start.rows_of(given.photos)
    centers = frame.cartesian_from_ground(given.enu, ids=[f"of photo {name}" for name in given.photos])
    rotations = from_angles(given.angles, given.system)
    return AttitudeObservations(photo, frame.axes_at(centers).transpose(0, 2, 1) @ rotations, given.sigma_turns)


def refilled(
    block: BlockProblem, control: ControlPoints, frames: Sequence[GroundFrame], points: Floats
) -> tuple[BlockProblem, float]:
    """Put present positions (q, 3) in where a control point is given in plan or height only.

    What stands in for a coordinate that is not given moves the given ones a little on a curved Earth: the largest such
    change, metres, is returned too.
    """
    given = block.problem.control
    xyz = given.xyz.copy()
    partial = ~control.use[block.control].all(axis=1)
    for index, frame in enumerate(frames):
        rows = np.flatnonzero(partial & (control.frame[block.control] == index))
        if len(rows):
            chosen = block.control[rows]
            near = points[given.point[rows]] + block.origin
            ids = [control.ids[row] for row in chosen]
            made = given_positions(control.enu[chosen], control.use[chosen], control.sigma[chosen], frame, near, ids)
            xyz[rows] = made.xyz - block.origin
    moved = np.abs(np.einsum("nij,nj->ni", given.axes, xyz - given.xyz))[np.isfinite(given.sigma)]
    changed = replace(block.problem, control=replace(given, xyz=xyz))
    return replace(block, problem=changed), float(moved.max(initial=0.0))


def _begin(
    problem: BundleProblem, rows: Numbers, control: ControlPoints, control_rows: Numbers, start: BlockStart
) -> Selection:
    """Choose what takes part at first: what the strip method used, and what else fits its result."""
    images = problem.images
    used = np.zeros(int(rows.max(initial=-1)) + 1, bool)
    paired = np.zeros(len(used), bool)
    for strip in start.strips:
        used[strip.rows[strip.rows < len(used)]] = True
        in_pairs = np.unique(strip.of_photos.orientation.rows)
        paired[in_pairs[in_pairs < len(used)]] = True
    inside = used[rows]
    free = ~paired[rows]
    focal = problem.cameras.focal[problem.cameras.of_photo]
    with np.errstate(invalid="ignore"):
        photos = KnownPhotos(problem.start.centers, problem.start.rotations, focal)
        computed = project(problem.start.points[images.point], photos, images.photo)
        miss = (np.abs(images.xy - computed) / images.sigma).max(axis=1)
    known = miss[np.isfinite(miss)]
    far = np.full(len(miss), max(LEAST_FAR, FAR_FROM_RAY * np.median(known) if len(known) else 0.0))
    loose = np.isin(images.point, images.point[start.rough[images.photo]]) & np.isfinite(miss)
    if loose.any():  # what an orientation that is only given approximately misses says nothing of the rays
        far[loose] = np.maximum(far[loose], FAR_FROM_RAY * np.median(miss[loose]))
    for strip in start.strips:
        if strangers := start.strangers.get(strip.strip.id):
            of_strip = np.isin(images.photo, start.rows_of(strip.strip.photos))
            inside &= ~(of_strip & np.isin(images.point, list(strangers)))
    given = control_begun(problem, control, control_rows, start)
    return replace(Selection.everything(problem), images=inside | (free & (miss <= far)), control=given)


def control_begun(problem: BundleProblem, control: ControlPoints, control_rows: Numbers, start: BlockStart) -> Flags:
    """Control coordinates (c, 3) that take part at first: those that the strips by themselves did not reject.

    Without strips those that most of the control agrees with, as the given orientations show it.
    """
    given = Selection.everything(problem).control
    if not start.strips:
        at = problem.start.points[problem.control.point]
        full = np.flatnonzero(control.use[control_rows].all(axis=1) & np.isfinite(at).all(axis=1))
        given[full] &= majority(at[full], problem.control.xyz[full])[:, None]
        return given
    wrong = {strip.control.ids[each.row]: list(each.axes) for strip in start.strips for each in strip.wrong_control}
    for row, number in enumerate(control_rows.tolist()):
        given[row, wrong.get(control.ids[number], [])] = False
    return given


def models_together(
    models: MeasuredModels, strips: tuple[StripResult, ...], strangers: Mapping[str, AbstractSet[int]], *, free: bool
) -> BlockStart:
    """Put the points and perspective centres of all strips together, and every model on its own of them."""
    measured, count = models.points, len(models.points.point_ids)
    nodes = np.full((count + len(measured.photo_ids), 3), np.nan)
    found = mean_points(strips, strangers)
    nodes[found.number] = found.xyz
    for strip in strips:
        places = count + locate(strip.strip.photos, measured.photo_ids)
        nodes[places] = strip.intermediate.cartesian_from_intermediate(strip.placed.centers)
    names, unit = units_of(models)
    centred = _centred(measured)
    placed = []
    for number in range(len(names)):
        rows = np.flatnonzero((unit == number) & np.isfinite(nodes[measured.node, 0]))
        placed.append(Similarity.from_points(centred[rows], nodes[measured.node[rows]]))
    rotations, scales = np.array([each.rotation for each in placed]), np.array([each.scale for each in placed])
    centers = np.array([each.shift for each in placed])
    lost = np.isnan(nodes[:, 0])
    rows = np.flatnonzero(lost[measured.node] & (unit >= 0))  # of points that the strips have no place for
    own = unit[rows]
    moved = scales[own, None] * np.einsum("nij,nj->ni", rotations[own], centred[rows]) + centers[own]
    times = np.bincount(measured.node[rows], minlength=len(nodes))[:, None]
    sums = np.zeros_like(nodes)
    np.add.at(sums, measured.node[rows], moved)
    return BlockStart(
        strips=strips,
        photos=names,
        centers=centers,
        rotations=rotations,
        scales=scales,
        points=np.where(lost[:, None] & (times > 0), sums / np.maximum(times, 1), nodes),
        strangers=strangers,
        rough=np.zeros(len(names), bool),
        free=free,
    )


def units_of(models: MeasuredModels) -> tuple[tuple[str, ...], Numbers]:
    """Names of the models of all strips, and which of them each row of the model coordinates is of; -1: of none."""
    names = tuple(name for strip in models.strips for name in strip.models)
    return names, np.asarray(located(models.points.model_ids, names)[models.points.model], np.intp)


def _centred(measured: ModelPoints) -> Floats:
    """Model coordinates (n, 3) less their mean over the model, mm."""
    count = np.bincount(measured.model, minlength=len(measured.model_ids))
    sums = np.zeros((len(count), 3))
    np.add.at(sums, measured.model, measured.xyz)
    return np.asarray(measured.xyz - (sums / np.maximum(count, 1)[:, None])[measured.model], float)


def build_models(
    models: MeasuredModels,
    settings: Settings,
    observations: PhotoPoints,
    control: ControlPoints,
    ground: GroundFrames,
    start: BlockStart,
) -> BlockProblem:
    """Collect everything that is observed; at first without what the links between the models contradict."""
    measured = models.points
    origin: Floats = np.round(np.nanmean(start.points, axis=0, dtype=np.float64), -1)
    _, unit = units_of(models)
    rows = np.flatnonzero(~rows_of_models(settings.links.drop, measured) & (unit >= 0))
    given, control_rows = control_observations(control, ground.control, observations, start, origin)
    problem = BundleProblem(
        images=ImageObservations(
            photo=unit[rows],
            point=measured.node[rows],
            xy=_centred(measured)[rows],
            sigma=measured.sigma[rows],
            correlation=None if measured.correlation is None else measured.correlation[rows],
        ),
        cameras=BundleCameras(),
        start=StartValues(
            centers=start.centers - origin,
            rotations=start.rotations,
            points=start.points - origin,
            scales=start.scales,
        ),
        control=given,
        photo_ids=start.photos,
        point_ids=tuple(map(measured.name, range(len(start.points)))),
    )
    agree = np.zeros(len(measured), bool)
    for strip in start.strips:
        formed = strip.of_models.formed
        agree[formed.models.row[formed.used]] = True
    return BlockProblem(
        problem=problem,
        origin=origin,
        begin=replace(
            Selection.everything(problem),
            images=_begun(agree, rows, start, measured),
            control=control_begun(problem, control, control_rows, start),
        ),
        kept=rows_of_models(settings.links.keep, measured)[rows],
        rows=rows,
        control=control_rows,
        level={"control": _level(ground.control, given.frame), "position": ()},
    )


def _begun(agree: Flags, rows: Numbers, start: BlockStart, measured: ModelPoints) -> Flags:
    """Rows that take part at first: what agrees within its strip, but for points that are others in another strip."""
    begun = agree[rows]
    for strip in start.strips:
        if strange := start.strangers.get(strip.strip.id):
            of_strip = np.isin(rows, strip.of_models.formed.models.row)
            begun &= ~(of_strip & np.isin(measured.node[rows], list(strange)))
    return begun
