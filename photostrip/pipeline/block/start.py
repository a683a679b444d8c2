"""Where the bundle adjustment starts: every strip and every photo of the block in the project's Cartesian frame.

Each strip is formed by the strip method. Strips with enough control of their own go to the ground with it; others are
tied to them by common points; what is still apart is joined to a block of its own, and the block goes to the ground
with its control, with camera positions or with given orientations, whatever there is. With nothing at all the first
strip gives frame and scale. Single photos are resected on what is known by then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_angles
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.pipeline.results import BlockStart
from photostrip.pipeline.strips.absolute import middle_frame
from photostrip.pipeline.strips.adjusting import adjust_formed
from photostrip.points import ControlPoints
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.resection.closed_form import approximate
from photostrip.triangulation.resection.collinearity import KnownPhotos
from photostrip.triangulation.resection.ray_intersection import intersect_points
from photostrip.triangulation.resection.resection import resect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.frames import GroundFrames
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.pipeline.results import StripResult
    from photostrip.pipeline.strips.photos import FormedPhotos
    from photostrip.points import PhotoPoints

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

LEAST_TIES = 3
ON_A_LINE = 1e-6  # ratio of the squared spreads of points that hardly say how a strip is rolled about their line
MOST_TIES = 60  # points that hand the frame of a block to one of its strips
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
    return Known(control, ground.control, ground.output, centers, rotations, lever)


def start(
    inputs: Inputs, settings: Settings, stages: Sequence[FormedPhotos], observations: PhotoPoints, known: Known
) -> BlockStart:
    """Bring all strips and photos of a block into the Cartesian frame.

    Parameters
    ----------
    stages : sequence of FormedPhotos
        Strips of two photos or more.

    Raises
    ------
    GeometryError
        When a strip or photo hangs together with nothing, or the block cannot be brought to the ground.
    """
    block = _Block(settings, observations, known)
    waiting = [number for number, stage in enumerate(stages) if not block.take(number, stage)]
    waiting = block.tie(stages, waiting)
    free = False
    while waiting:
        group = _joined(stages, waiting, len(observations.point_ids))
        free = block.place(stages, group) or free
        waiting = block.tie(stages, [number for number in waiting if number not in group.members])
    strips = tuple(block.done[number] for number in range(len(stages)))
    centers, rotations, points = _together(inputs, strips, observations, known)
    photos = tuple(photo for strip in inputs.strips for photo in strip.photos)
    return BlockStart(strips, photos, centers, rotations, points, free)


class _Block:
    """The strips that are on the ground so far."""

    def __init__(self, settings: Settings, observations: PhotoPoints, known: Known) -> None:
        self.settings = replace(settings, adjustment="polynomial")
        self.tied = replace(settings, adjustment="similarity", relative=replace(settings.relative, screening="none"))
        self.observations, self.known = observations, known
        self.done: dict[int, StripResult] = {}

    def take(self, number: int, stage: FormedPhotos) -> bool:
        """Bring a strip to the ground with its own control; False when that is too little."""
        known = self.known
        if not len(known.control):
            return False
        try:
            self.done[number] = adjust_formed(stage, known.control, known.frames, self.settings)
        except GeometryError:
            return False
        return True

    @property
    def points(self) -> Floats:
        """Points of the strips on the ground, Cartesian, by number; NaN for others."""
        found = np.full((len(self.observations.point_ids), 3), np.nan)
        for strip in self.done.values():
            found[strip.formed.point] = strip.cartesian
        return found

    def tie(self, stages: Sequence[FormedPhotos], waiting: Sequence[int]) -> list[int]:
        """Tie strips to those on the ground, the best tied first; give those that are left."""
        left = list(waiting)
        while left and self.done:
            points = self.points
            ties = {number: int(np.isfinite(points[stages[number].formed.point, 0]).sum()) for number in left}
            for number in sorted(left, key=lambda each: -ties[each]):
                if ties[number] >= LEAST_TIES and self._hang(number, stages[number], points):
                    left.remove(number)
                    break
            else:
                return left
        return left

    def _hang(self, number: int, stage: FormedPhotos, points: Floats) -> bool:
        """Bring one strip to the ground with points of the others; False when they do not determine it."""
        shared = stage.formed.point[np.isfinite(points[stage.formed.point, 0])]
        if collinearity(points[shared]) < ON_A_LINE:
            return False
        try:
            self.done[number] = self._on(stage, shared, points[shared])
        except GeometryError:
            return False
        return True

    def _on(self, stage: FormedPhotos, numbers: Numbers, cartesian: Floats) -> StripResult:
        """Adjust a strip on points with Cartesian coordinates, beside its own control."""
        known = self.known
        chosen = np.unique(np.linspace(0, len(numbers) - 1, min(len(numbers), MOST_TIES)).astype(np.intp))
        ids = tuple(self.observations.point_ids[n] for n in numbers[chosen])
        ground = known.output.ground_from_cartesian(cartesian[chosen], ids=ids)
        given = set(ids)
        own = known.control.take(np.array([name not in given for name in known.control.ids], bool))
        scale = np.linalg.norm(np.ptp(cartesian, axis=0)) / np.linalg.norm(np.ptp(stage.formed.xyz, axis=0))
        sigma = max(1e-3, 1e-5 * float(scale * np.linalg.norm(np.ptp(stage.formed.xyz, axis=0))))
        count = len(chosen)
        control = ControlPoints(
            (*own.ids, *ids),
            np.concatenate([own.enu, ground]),
            np.concatenate([own.use, np.ones((count, 3), bool)]),
            np.concatenate([own.check, np.zeros(count, bool)]),
            np.concatenate([own.sigma, np.full((count, 3), sigma)]),
            np.concatenate([own.frame, np.full(count, len(known.frames), np.intp)]),
        )
        return adjust_formed(stage, control, (*known.frames, known.output), self.tied)

    def place(self, stages: Sequence[FormedPhotos], group: _Group) -> bool:
        """Bring a block of strips to the ground; True when nothing was known and its own frame was taken."""
        similarity, free = _datum(stages, group, self.observations, self.known, alone=not self.done)
        for number in group.members:
            stage = stages[number]
            cartesian = similarity(group.joined[number](stage.formed.xyz))
            good = np.isfinite(cartesian).all(axis=1)
            self.done[number] = self._on(stage, stage.formed.point[good], cartesian[good])
        return free


@dataclass(frozen=True, eq=False)
class _Group:
    """Strips joined by their common points, in the frame of the first of them."""

    members: tuple[int, ...]
    joined: dict[int, Similarity]
    points: Floats


def _joined(stages: Sequence[FormedPhotos], waiting: Sequence[int], count: int) -> _Group:
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
            return _Group(tuple(joined), joined, points)


# ------------------------------------------------------------------------------------- a block to the ground


def _datum(
    stages: Sequence[FormedPhotos], group: _Group, observations: PhotoPoints, known: Known, *, alone: bool
) -> tuple[Similarity, bool]:
    """Similarity from the frame of a block to the Cartesian frame; True with it when nothing gave it."""
    names = tuple(photo for number in group.members for photo in stages[number].strip.photos)
    number_of = {name: number for number, name in enumerate(observations.point_ids)}
    rows = np.array([number_of.get(name, -1) for name in known.control.ids], np.intp)
    here = (rows >= 0) & np.isfinite(group.points[rows, 0]) if len(rows) else np.zeros(0, bool)
    control = known.control.take(here)
    cameras = [name for name in names if name in known.centers]
    refusal: GeometryError | None = None
    if len(control):
        try:
            return _by_control(group.points[rows[here]], group.points, control, known), False
        except GeometryError as error:
            refusal = error
    if len(cameras) >= 2:
        return _by_cameras(stages, group, (control, rows[here]), known), False
    if refusal is not None or not alone or known.centers:
        what = (
            f"strip {stages[group.members[0]].strip.id}" if len(group.members) == 1 else f"{len(group.members)} strips"
        )
        message = f"{what}: neither control nor camera positions nor tie points bring it to the ground"
        if refusal is not None:
            message += f" ({refusal})"
        raise GeometryError(message, photos=names, code="strip-not-tied") from refusal
    return _of_its_own(stages, group), True


def _by_control(xyz: Floats, every: Floats, control: ControlPoints, known: Known) -> Similarity:
    """Similarity of a block to its control, plan and height points included."""
    frame = middle_frame(control, known.frames)
    targets = absolute_orientation.Targets(control, known.frames, frame)
    found = absolute_orientation.orient(xyz, targets, control.use.astype(float), every[np.isfinite(every[:, 0])])
    inner = found.similarity
    return Similarity(inner.scale, frame.axes @ inner.rotation, frame.cartesian_from_intermediate(inner.shift))


def _oriented(stages: Sequence[FormedPhotos], group: _Group) -> tuple[tuple[str, ...], Floats, Floats]:
    """Photos of a block with their orientations in its frame."""
    names: list[str] = []
    centers, rotations = [], []
    for number in group.members:
        names += stages[number].strip.photos
        centers.append(group.joined[number](stages[number].formed.centers))
        rotations.append(group.joined[number].rotation @ stages[number].formed.rotations)
    return tuple(names), np.concatenate(centers), np.concatenate(rotations)


def _by_cameras(
    stages: Sequence[FormedPhotos], group: _Group, given: tuple[ControlPoints, Numbers], known: Known
) -> Similarity:
    """Similarity of a block to known positions and orientations of its cameras, and to full control points.

    Where all of them lie on one line, cameras are taken to look down: that is a start, the adjustment decides.
    """
    names, centers, rotations = _oriented(stages, group)
    rows = np.array([row for row, name in enumerate(names) if name in known.centers], np.intp)
    source, target = centers[rows], np.array([known.centers[names[row]] for row in rows])
    control, numbers = given
    full = np.asarray(control.use.all(axis=1), bool)
    source = np.concatenate([source, group.points[numbers[full]]])
    target = np.concatenate([target, _cartesian_of(control.take(full), known)])
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


def _cartesian_of(control: ControlPoints, known: Known) -> Floats:
    """Cartesian coordinates of full control points."""
    found = np.empty((len(control), 3))
    for number, frame in enumerate(known.frames):
        rows = control.frame == number
        if rows.any():
            found[rows] = frame.cartesian_from_ground(control.enu[rows])
    return found


def _depth(stages: Sequence[FormedPhotos], group: _Group) -> float:
    """Distance from a camera to the ground, in the unit of the block."""
    formed = stages[group.members[0]].formed
    return float(np.median(np.linalg.norm(formed.xyz - formed.xyz.mean(axis=0), axis=1)))


def _of_its_own(stages: Sequence[FormedPhotos], group: _Group) -> Similarity:
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


# ------------------------------------------------------------------------------------------- all photos and points


def _together(
    inputs: Inputs, strips: Sequence[StripResult], observations: PhotoPoints, known: Known
) -> tuple[Floats, Floats, Floats]:
    """Orientations of all photos, single ones included, and all points."""
    points = _mean_points(strips, len(observations.point_ids))
    oriented: dict[str, tuple[Floats, Floats]] = {}
    for strip in strips:
        centers = strip.intermediate.cartesian_from_intermediate(strip.of_photos.resection.centers)
        turned = strip.intermediate.cartesian_rotations(strip.of_photos.resection.rotations)
        oriented |= {photo: (c, r) for photo, c, r in zip(strip.strip.photos, centers, turned, strict=True)}
    singles = {strip.photos[0]: strip.camera.principal_distance for strip in inputs.strips if len(strip.photos) == 1}
    if singles:
        with_control = _with_control(points, observations, known)
        for photo, focal in singles.items():
            oriented[photo] = _single(photo, focal, with_control, observations, known)
    names = [photo for strip in inputs.strips for photo in strip.photos]
    centers = np.array([oriented[name][0] for name in names])
    rotations = np.array([oriented[name][1] for name in names])
    return (
        centers,
        rotations,
        _rest(inputs, observations, (centers, rotations), _with_control(points, observations, known)),
    )


def _mean_points(strips: Sequence[StripResult], count: int) -> Floats:
    """Mean of the points over the strips; NaN for points of none."""
    number = np.concatenate([strip.formed.point for strip in strips] or [np.zeros(0, np.intp)])
    xyz = np.concatenate([strip.cartesian for strip in strips] or [np.zeros((0, 3))])
    times = np.bincount(number, minlength=count)
    sums = np.column_stack([np.bincount(number, column, count) for column in xyz.T])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(times[:, None] > 0, sums / times[:, None], np.nan)


def _with_control(points: Floats, observations: PhotoPoints, known: Known) -> Floats:
    """Put full control in where a point has no coordinates."""
    found = points.copy()
    number = {name: n for n, name in enumerate(observations.point_ids)}
    full = known.control.take(np.asarray(known.control.use.all(axis=1), bool))
    rows = np.array([number[name] for name in full.ids], np.intp)
    missing = np.isnan(found[rows, 0]) if len(rows) else np.zeros(0, bool)
    if missing.any():
        found[rows[missing]] = _cartesian_of(full.take(missing), known)
    return found


def _single(photo: str, focal: float, points: Floats, observations: PhotoPoints, known: Known) -> tuple[Floats, Floats]:
    """Orientation of a photo that is a strip of its own."""
    number = observations.photo_ids.index(photo)
    rows = np.flatnonzero((observations.photo == number) & np.isfinite(points[observations.point, 0]))
    xy, xyz = observations.xy[rows], points[observations.point[rows]]
    given = photo in known.centers and photo in known.rotations
    try:
        begin = (known.centers[photo], known.rotations[photo]) if given else approximate(xy, xyz, focal)
    except GeometryError as error:
        message = (
            f"photo {photo}, a strip of its own, cannot be oriented on points known from the other photos: {error}"
        )
        raise GeometryError(message, photos=(photo,), code="strip-not-tied") from error
    f, one = np.array([focal]), np.zeros(len(rows), np.intp)
    found = resect(xy, xyz, one, f, (begin[0][None], begin[1][None]))
    return found.centers[0], found.rotations[0]


def _rest(inputs: Inputs, observations: PhotoPoints, oriented: tuple[Floats, Floats], points: Floats) -> Floats:
    """Intersect the points that no strip has, as those seen on one photo of each of two strips."""
    place = {photo: row for row, photo in enumerate(photo for strip in inputs.strips for photo in strip.photos)}
    focal = np.array([strip.camera.principal_distance for strip in inputs.strips for _ in strip.photos])
    rows = np.flatnonzero(np.isnan(points[observations.point, 0]))
    if not len(rows):
        return points
    numbers, point = np.unique(observations.point[rows], return_inverse=True)
    photo = np.array([place[name] for name in observations.photo_ids], np.intp)[observations.photo[rows]]
    found = intersect_points(
        observations.xy[rows], observations.sigma[rows], (photo, point), KnownPhotos(*oriented, focal), len(numbers)
    )
    points = points.copy()
    points[numbers] = found.xyz
    return points
