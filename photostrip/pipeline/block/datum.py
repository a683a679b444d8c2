"""A block of strips to the ground: by its control, by camera positions or orientations, or in a frame of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.arrays import Floats, Numbers, median
from photostrip.errors import GeometryError
from photostrip.frozen import NamedTuple, dataclass
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.rotation import from_angles
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.given_points import cartesian_of
from photostrip.pipeline.inputs import Inputs
from photostrip.pipeline.strips.absolute import middle_frame
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.points import ControlPoints, PhotoPoints, locate
from photostrip.triangulation import absolute_orientation

LEAST_TIES = 3
ON_A_LINE = 1e-6  # ratio of the squared spreads of points that hardly say how a strip is rolled about their line
FREE_BASE = 1000.0  # metres: mean length of the bases where nothing gives a scale
ROLL_WEIGHT = 1e-4  # of the assumption that cameras look down, where nothing else fixes the roll


@dataclass(frozen=True, eq=False)
class Known:
    """What is known on the ground, all in the project's Cartesian frame."""

    control: ControlPoints
    frames: tuple[GroundFrame, ...]
    output: GroundFrame  # frame of the result
    centers: dict[str, Floats]  # known positions of antennas or perspective centres, by photo
    rotations: dict[str, Floats]  # known rotations, photo to Cartesian frame, by photo
    # (3,): antenna from the perspective centre along the image axes, metres, for photos without a known rotation
    lever: Floats


def known_of(inputs: Inputs, control: ControlPoints, ground: GroundFrames) -> Known:
    """Collect what is known on the ground: control, orientations, camera positions with all three coordinates."""
    centers: dict[str, Floats] = {}
    rotations: dict[str, Floats] = {}
    lever = np.zeros(3)
    positions, orientations = inputs.positions, inputs.orientations
    if positions is not None and ground.positions is not None:
        whole = np.asarray(positions.use.all(axis=1), bool)
        names = [photo for photo, yes in zip(positions.photos, whole, strict=True) if yes]
        found = ground.positions.cartesian_from_ground(positions.enu[whole], ids=[f"of photo {name}" for name in names])
        centers = dict(zip(names, found, strict=True))
        lever = np.array(positions.lever_arm)
    if orientations is not None and ground.orientations is not None:
        ids = [f"of photo {name}" for name in orientations.photos]
        found = ground.orientations.cartesian_from_ground(orientations.enu, ids=ids)
        turned = ground.orientations.axes_at(found).transpose(0, 2, 1) @ from_angles(
            orientations.angles, orientations.system
        )
        rotations = dict(zip(orientations.photos, turned, strict=True))
        centers |= dict(zip(orientations.photos, found, strict=True))
    return Known(
        control=control,
        frames=ground.control,
        output=ground.output,
        centers=centers,
        rotations=rotations,
        lever=lever,
    )


@dataclass(frozen=True, eq=False)
class JoinedStrips:
    """Strips joined by their common points, in the frame of the first of them."""

    members: tuple[int, ...]
    joined: dict[int, Similarity]
    points: Floats


def join_waiting(stages: Sequence[FormedPhotos], waiting: Sequence[int], count: int) -> JoinedStrips:
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
    stages: Sequence[FormedPhotos], group: JoinedStrips, observations: PhotoPoints, known: Known, *, alone: bool
) -> tuple[Similarity, bool]:
    """Similarity from the frame of a block to the Cartesian frame; True with it when nothing gave it."""
    names = tuple(photo for number in group.members for photo in stages[number].strip.photos)
    rows = locate(known.control.ids, observations.point_ids)
    inside = (rows >= 0) & np.isfinite(group.points[rows, 0])
    control, rows = known.control.take(inside), rows[inside]
    cameras = [name for name in names if name in known.centers]
    refusal: GeometryError | None = None
    if len(control):
        try:
            return _by_control(group.points[rows], group.points, control, known), False
        except GeometryError as error:
            refusal = error
    if len(cameras) >= 2:
        return _by_cameras(stages, group, (control, rows), known), False
    if refusal is not None or not alone or known.centers or known.output.kind != "local":
        what = (
            f"strip {stages[group.members[0]].strip.id}" if len(group.members) == 1 else f"{len(group.members)} strips"
        )
        message = f"{what}: neither control nor camera positions in x, y and z nor tie points connect it to the ground"
        if refusal is not None:
            message += f" ({refusal})"
        raise GeometryError(message, photos=names, code="strip-not-tied") from refusal
    return _of_its_own(stages, group), True


def _by_control(xyz: Floats, every: Floats, control: ControlPoints, known: Known) -> Similarity:
    """Similarity of a block to its control, plan and height points included."""
    frame = middle_frame(control, known.frames)
    targets = absolute_orientation.Targets(control, known.frames, frame)
    found = absolute_orientation.lay(xyz, targets, control.use.astype(float), every[np.isfinite(every[:, 0])])
    inner = found.similarity
    return Similarity(inner.scale, frame.axes @ inner.rotation, frame.cartesian_from_intermediate(inner.shift))


class _OrientedPhotos(NamedTuple):
    names: tuple[str, ...]
    centers: Floats
    rotations: Floats


def _oriented(stages: Sequence[FormedPhotos], group: JoinedStrips) -> _OrientedPhotos:
    names: list[str] = []
    centers, rotations = [], []
    for number in group.members:
        names += stages[number].strip.photos
        centers.append(group.joined[number](stages[number].formed.centers))
        rotations.append(group.joined[number].rotation @ stages[number].formed.rotations)
    return _OrientedPhotos(tuple(names), np.concatenate(centers), np.concatenate(rotations))


def _by_cameras(
    stages: Sequence[FormedPhotos], group: JoinedStrips, given: tuple[ControlPoints, Numbers], known: Known
) -> Similarity:
    """Similarity of a block to known positions and orientations of its cameras, and to full control points.

    Where all of them lie on one line, cameras are taken to look down: that is a start, the adjustment decides.
    """
    names, centers, rotations = _oriented(stages, group)
    rows = np.flatnonzero([name in known.centers for name in names])
    source, target = centers[rows], np.array([known.centers[names[row]] for row in rows])
    control, numbers = given
    full = np.asarray(control.use.all(axis=1), bool)
    source = np.concatenate([source, group.points[numbers[full]]])
    target = np.concatenate([target, cartesian_of(control.take(full), known.frames)])
    weight = np.ones(len(source))
    scale = np.linalg.norm(target - target.mean(axis=0)) / np.linalg.norm(source - source.mean(axis=0))
    arm = _depth(stages, group)
    turned = [(row, known.rotations[names[row]]) for row in rows if names[row] in known.rotations]
    for axis in range(3):
        if turned:
            index = np.array([row for row, _ in turned], np.intp)
            ends = np.array([known.centers[names[row]] + scale * arm * turn[:, axis] for row, turn in turned])
            source = np.concatenate([source, centers[index] + arm * rotations[index][:, :, axis]])
            target = np.concatenate([target, ends])
            weight = np.concatenate([weight, np.ones(len(index))])
    if collinearity(target, weight) < ON_A_LINE or len(target) < LEAST_TIES:
        up = known.output.level_axes_at(target[: len(rows)])[:, 2]
        source = np.concatenate([source, centers[rows] - arm * rotations[rows][:, :, 2]])
        target = np.concatenate([target, target[: len(rows)] - scale * arm * up])
        weight = np.concatenate([weight, np.full(len(rows), ROLL_WEIGHT)])
    found = Similarity.from_points(source, target, weight)
    if known.lever.any():  # the rotations are known now: from antennas to perspective centres
        antenna = np.array([names[row] not in known.rotations for row in rows])
        target[: len(rows)] -= np.where(antenna[:, None], (found.rotation @ rotations[rows]) @ known.lever, 0.0)
        found = Similarity.from_points(source, target, weight)
    return found


def _depth(stages: Sequence[FormedPhotos], group: JoinedStrips) -> float:
    """Distance from a camera to the ground, in the unit of the block."""
    formed = stages[group.members[0]].formed
    return median(np.linalg.norm(formed.xyz - formed.xyz.mean(axis=0), axis=1))


def _of_its_own(stages: Sequence[FormedPhotos], group: JoinedStrips) -> Similarity:
    """Frame and scale of a block that nothing ties to the ground: X along the first strip, Z against the view."""
    _, centers, rotations = _oriented(stages, group)
    first = stages[group.members[0]].formed.centers
    base = np.linalg.norm(np.diff(first, axis=0), axis=1).mean()
    up = rotations[:, :, 2].mean(axis=0)
    up /= np.linalg.norm(up)
    along = first[-1] - first[0]
    along -= (along @ up) * up
    along /= np.linalg.norm(along)
    rotation = np.stack([along, np.cross(up, along), up])
    scale = FREE_BASE / float(base)
    return Similarity(scale, rotation, -scale * rotation @ centers.mean(axis=0))
