"""A block of strips to the ground: by its control, by camera positions or orientations, or in a frame of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import GeometryError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.plane import conformal_from_points
from photostrip.geometry.rotation import cross_matrix, from_angles, from_vector
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.inputs import Inputs
from photostrip.pipeline.strips.absolute import middle_frame
from photostrip.pipeline.strips.models import LinkedModels
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.points import ControlPoints, PhotoPoints, concatenated, locate
from photostrip.strip import absolute_orientation

FormedStrips = Sequence[FormedPhotos] | Sequence[LinkedModels]

LEAST_TIES = 3
ON_A_LINE = 1e-6  # ratio of the squared spreads of points that hardly say how a strip is rolled about their line
FREE_BASE = 1000.0  # metres: mean length of the bases where nothing gives a scale
TURNED = 0.01  # radians: standard deviation of given rotations
START_STEPS, START_CONVERGED = 20, 1e-6  # of a start on all that is given; of its half length, the last step
OF_PHOTO = "of photo {}"  # names a camera among given points


@dataclass(frozen=True, eq=False)
class Known:
    """What is known on the ground; Cartesian coordinates are those of the project's Cartesian frame."""

    control: ControlPoints
    frames: tuple[GroundFrame, ...]  # of the control lists, of camera positions and of orientations
    output: GroundFrame  # frame of the result
    cameras: ControlPoints  # known antennas or perspective centres, as ``OF_PHOTO`` names them
    orientations: dict[str, tuple[Floats, Floats]]  # known centres and rotations, Cartesian, by photo
    # (3,): antenna from the perspective centre along the image axes, metres, for photos without a known rotation
    lever: Floats


def known_of(inputs: Inputs, control: ControlPoints, ground: GroundFrames) -> Known:
    """Collect what is known on the ground: control, orientations, camera positions."""
    orientations: dict[str, tuple[Floats, Floats]] = {}
    frames, cameras = list(ground.control), [control.take(np.zeros(0, np.intp))]
    if inputs.orientations is not None and ground.orientations is not None:
        given, frame = inputs.orientations, ground.orientations
        cameras.append(_as_control(given.photos, given.enu, np.ones((len(given.photos), 3), bool), len(frames)))
        frames.append(frame)
        centers = frame.cartesian_from_ground(given.enu, ids=cameras[-1].ids)
        turned = frame.axes_at(centers).transpose(0, 2, 1) @ from_angles(given.angles, given.system)
        orientations = dict(zip(given.photos, zip(centers, turned, strict=True), strict=True))
    positions = inputs.positions
    if positions is not None and ground.positions is not None:
        others = [row for row, photo in enumerate(positions.photos) if photo not in orientations]
        every = _as_control(positions.photos, positions.enu, positions.use, len(frames))
        cameras.append(every.take(np.array(others, np.intp)))
        frames.append(ground.positions)
    return Known(
        control=control,
        frames=tuple(frames),
        output=ground.output,
        cameras=concatenated(cameras),
        orientations=orientations,
        lever=np.zeros(3) if positions is None else np.array(positions.lever_arm),
    )


def _as_control(photos: Sequence[str], enu: Floats, use: Flags, frame: int) -> ControlPoints:
    n = len(photos)
    ids = tuple(OF_PHOTO.format(photo) for photo in photos)
    unused = np.zeros(n, bool)
    return ControlPoints(ids=ids, enu=enu, use=use, check=unused, sigma=np.ones((n, 3)), frame=np.full(n, frame))


class Level(NamedTuple):
    """What is taken to point up in a block, however little the control says of it."""

    up: Floats  # (3,): unit vector
    sigma: float  # radians; infinite where it only says where to start


@dataclass(frozen=True, eq=False)
class JoinedStrips:
    """Strips joined by their common points, in the frame of the first of them."""

    members: tuple[int, ...]
    joined: dict[int, Similarity]
    points: Floats


def join_waiting(stages: FormedStrips, waiting: Sequence[int], count: int) -> JoinedStrips:
    """Join the strip with the most points to all that share points with it, and so on."""
    first = max(waiting, key=lambda number: (len(stages[number].formed.point), -number))
    identity = Similarity(1.0, np.eye(3), np.zeros(3))
    joined = {first: identity}
    points = np.full((count, 3), np.nan)
    points[stages[first].formed.point] = stages[first].formed.xyz
    while True:
        shared = {
            number: stages[number].formed.point[np.isfinite(points[stages[number].formed.point, 0])]
            for number in waiting
            if number not in joined
        }
        for number in sorted(shared, key=lambda each: -len(shared[each])):
            formed = stages[number].formed
            if len(shared[number]) < LEAST_TIES or collinearity(points[shared[number]]) < ON_A_LINE:
                continue
            rows = np.searchsorted(formed.point, shared[number])
            joined[number] = Similarity.from_points(formed.xyz[rows], points[shared[number]])
            new = formed.point[~np.isfinite(points[formed.point, 0])]
            points[new] = joined[number](formed.xyz[np.searchsorted(formed.point, new)])
            break
        else:
            return JoinedStrips(tuple(joined), joined, points)


def datum(
    stages: FormedStrips, group: JoinedStrips, observations: PhotoPoints, known: Known, *, alone: bool
) -> tuple[Similarity, bool]:
    """Similarity from the frame of a block to the Cartesian frame; True with it when nothing gave it."""
    names = tuple(photo for number in group.members for photo in stages[number].strip.photos)
    rows = locate(known.control.ids, observations.point_ids)
    inside = (rows >= 0) & np.isfinite(group.points[rows, 0])
    control, xyz = known.control.take(inside), group.points[rows[inside]]
    cameras = known.cameras.take(np.isin(known.cameras.ids, [OF_PHOTO.format(name) for name in names]))
    refusal: GeometryError | None = None
    if len(control):
        try:
            return on_given(xyz, control, known, group.points), False
        except GeometryError as error:
            refusal = error
    if len(cameras):
        try:
            return with_cameras(_oriented(stages, group), (xyz, control), cameras, known), False
        except GeometryError as error:
            refusal = error
    if refusal is not None or not alone or len(known.cameras) or known.output.kind != "local":
        what = (
            f"strip {stages[group.members[0]].strip.id}" if len(group.members) == 1 else f"{len(group.members)} strips"
        )
        message = f"{what}: neither control nor camera positions nor tie points connect it to the ground"
        if refusal is not None:
            message += f" ({refusal})"
        raise GeometryError(message, photos=names, code="strip-not-tied") from refusal
    return _of_its_own(stages, group), True


def on_given(xyz: Floats, given: ControlPoints, known: Known, of_block: Floats | Level) -> Similarity:
    """Similarity of a block to what is given of it, plan and height points included.

    of_block: all its points, to judge whether they are determined; or what is level in it, and they are not judged.
    """
    frame = middle_frame(given, known.frames)
    targets = absolute_orientation.Targets(given, known.frames, frame)
    if isinstance(of_block, Level):
        inner = _levelled(xyz, targets, of_block)
    else:
        reach = of_block[np.isfinite(of_block[:, 0])]
        inner = absolute_orientation.lay(xyz, targets, given.use.astype(float), reach).similarity
    return Similarity(inner.scale, frame.axes @ inner.rotation, frame.cartesian_from_intermediate(inner.shift))


def _levelled(strip: Floats, targets: absolute_orientation.Targets, level: Level) -> Similarity:
    """Similarity of a strip to its targets, and level where they leave that open; what else they leave open stays.

    It starts with what is level, the plan of four parameters, and the mean of the heights.
    Raises GeometryError where the plan gives neither scale nor azimuth.
    """
    plan, height = targets.control.use[:, 0], targets.control.use[:, 2]
    upright = from_vector(np.cross(level.up, [0.0, 0.0, 1.0]))  # nearly: the sine in the place of the angle
    if np.count_nonzero(plan) < 2:
        message = "plan coordinates are given in one place only: scale and azimuth stay free"
        raise GeometryError(message, code="control-deficient")
    at_sea = targets.of(np.zeros_like(strip))
    plane = conformal_from_points((strip @ upright.T)[plan, :2], at_sea[plan, :2]).coefficients
    turn = complex(plane[0, 0], plane[1, 0])
    rotation = from_vector([0.0, 0.0, float(np.angle(turn))]) @ upright
    found = Similarity(abs(turn), rotation, np.array([*plane[:2, 3], 0.0]))
    rise = (targets.of(found(strip)) - found(strip))[height, 2]
    found = replace(found, shift=found.shift + np.array([0.0, 0.0, rise.mean() if len(rise) else 0.0]))
    half = float(np.ptp(found(strip), axis=0).max()) / 2
    for _ in range(START_STEPS):
        xyz = found(strip)
        rows, free = absolute_orientation.design(xyz, targets, targets.axes(xyz), half)
        up, weight = found.rotation @ level.up, float(np.sqrt((free**2).mean())) / (half * level.sigma)
        rows = np.concatenate([rows, weight * np.pad(-cross_matrix(up)[:2], ((0, 0), (3, 1)))])
        free = np.concatenate([free, -weight * half * up[:2]])
        step = np.asarray(np.linalg.lstsq(rows, free, rcond=absolute_orientation.LEAST_MOTION)[0], float)
        found = absolute_orientation.corrected(found, step, xyz.mean(axis=0), half)
        if np.abs(step).max() < START_CONVERGED * half:
            break
    return found


class Oriented(NamedTuple):
    """Photos of a block in a frame of its own."""

    names: Sequence[str]
    centers: Floats
    rotations: Floats


def _oriented(stages: FormedStrips, group: JoinedStrips) -> Oriented:
    """All photos in the frame of the block; models have no rotations but stand upright."""
    centers, rotations = [], []
    for number in group.members:
        to_block, stage = group.joined[number], stages[number]
        centers.append(to_block(stage.formed.centers))
        upright = np.tile(np.eye(3), (len(centers[-1]), 1, 1))
        of_photos = stage.formed.rotations if isinstance(stage, FormedPhotos) else upright
        rotations.append(to_block.rotation @ of_photos)
    names = [name for number in group.members for name in stages[number].strip.photos]
    return Oriented(names, np.concatenate(centers), np.concatenate(rotations))


def with_cameras(
    block: Oriented,
    on_ground: tuple[Floats, ControlPoints],
    cameras: ControlPoints,
    known: Known,
) -> Similarity:
    """Similarity of a block to its control, to known positions and orientations of its cameras.

    Known rotations say what is level; without any it starts with its cameras looking down, and the adjustment decides
    what is determined.
    """
    names, centers, rotations = block
    rows = locate(cameras.ids, [OF_PHOTO.format(name) for name in names])
    turned = [row for row in rows.tolist() if names[row] in known.orientations]
    if turned:
        given = [known.orientations[names[row]] for row in turned]
        ups = known.output.level_axes_at(np.array([center for center, _ in given]))[:, 2]
        of_block = [rotations[row] @ turn.T @ above for row, (_, turn), above in zip(turned, given, ups, strict=True)]
        up = np.sum(of_block, axis=0)
    else:
        up = rotations[:, :, 2].sum(axis=0)
    up = np.asarray(up / np.linalg.norm(up), float)
    level = Level(up, TURNED if turned else np.inf)  # cameras may look aside
    xyz, control = on_ground
    given_of_all = concatenated([control, cameras])
    found = on_given(np.concatenate([xyz, centers[rows]]), given_of_all, known, level)
    if known.lever.any():  # the scale is known now: from perspective centres to antennas
        antenna = np.array([names[row] not in known.orientations for row in rows])
        arms = np.where(antenna[:, None], rotations[rows] @ (known.lever / found.scale), 0.0)
        found = on_given(np.concatenate([xyz, centers[rows] + arms]), given_of_all, known, level)
    return found


def _of_its_own(stages: FormedStrips, group: JoinedStrips) -> Similarity:
    """Frame and scale of a block that nothing ties to the ground: X along the first strip, Z against the view."""
    _, centers, rotations = _oriented(stages, group)
    first, last = stages[group.members[0]].formed.ends
    base = np.linalg.norm(last - first) / max(len(stages[group.members[0]].strip.photos) - 1, 1)
    up = rotations[:, :, 2].mean(axis=0)
    up /= np.linalg.norm(up)
    along = last - first
    along -= (along @ up) * up
    along /= np.linalg.norm(along)
    rotation = np.stack([along, np.cross(up, along), up])
    scale = FREE_BASE / float(base)
    middle = np.nanmean(centers if np.isfinite(centers).any() else group.points, axis=0)
    return Similarity(scale, rotation, -scale * rotation @ middle)
