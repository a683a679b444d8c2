"""A block of strips to the ground: by its control, by camera positions or orientations, or in a frame of its own.

Where the bundle adjustment starts: every strip and every photo of the block in the project's Cartesian frame.

Each strip is formed by the strip method. Strips with enough control of their own go to the ground with it; others are
tied to them by common points; what is still apart is joined to a block of its own, and the block goes to the ground
with its control, with camera positions or with given orientations, whatever there is. With nothing at all the first
strip gives frame and scale. Single photos are resected on what is known by then, one after the other.

Orientations in a frame of their own, as a structure-from-motion model has them, laid on what is known.

Their place, direction and scale may be any; they are only a start. Points of the control are intersected in their frame
from the rays, and a similarity takes these points, and the cameras where positions are known, to the ground.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.plane import conformal_from_points
from photostrip.geometry.rotation import cross_matrix, from_angles, from_vector, separable_angles
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.notes import Note
from photostrip.pipeline import block_problem
from photostrip.pipeline.block_problem import LEAST_FAR
from photostrip.pipeline.formed_models import LinkedModels
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.given_points import cartesian_of, measured_control
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.precision import compared_strips, mean_points
from photostrip.pipeline.results import BlockStart, StripResult
from photostrip.pipeline.strip_method import adjust_formed, middle_frame
from photostrip.plausibility.ids import odd_ties
from photostrip.points import ControlPoints, PhotoPoints, concatenated, locate
from photostrip.strip import absolute_orientation
from photostrip.strip.control_screening import majority
from photostrip.strip.resection import LEAST_POINTS, KnownPhotos, approximate, intersect_points, project, resect

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


MOST_TIES = 60  # points that hand the frame of a block to one of its strips


def start(
    inputs: Inputs,
    settings: Settings,
    stages: FormedStrips,
    observations: PhotoPoints,
    known: Known,
) -> BlockStart:
    """Bring all strips and photos of a block into the Cartesian frame.

    settings: their ``adjustment`` is how a strip with control of its own meets it.
    stages: strips of two photos or more, or of independent models.
    Raises GeometryError when a strip or photo hangs together with nothing, or the block cannot be brought to the
        ground.
    """
    block = _Block(settings, observations, known)
    waiting = [number for number in range(len(stages)) if not block.take(number, stages[number])]
    waiting = block.tie(stages, waiting)
    free = False
    while waiting:
        group = join_waiting(stages, waiting, len(observations.point_ids))
        free = block.place(stages, group) or free
        waiting = block.tie(stages, [number for number in waiting if number not in group.members])
    strips = tuple(block.done[number] for number in range(len(stages)))
    if inputs.models is not None:
        return block_problem.models_together(
            inputs.models, strips, _strangers(strips, observations.point_ids), free=free
        )
    return _together(inputs, strips, observations, known, free=free)


class _Block:
    """The strips that are on the ground so far."""

    def __init__(self, settings: Settings, observations: PhotoPoints, known: Known) -> None:
        self.settings = settings
        self.tied = replace(settings, adjustment="similarity", relative=replace(settings.relative, screening="none"))
        self.observations, self.known = observations, known
        self.done: dict[int, StripResult] = {}

    def take(self, number: int, stage: FormedPhotos | LinkedModels) -> bool:
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

    def tie(self, stages: FormedStrips, waiting: Sequence[int]) -> list[int]:
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

    def _hang(self, number: int, stage: FormedPhotos | LinkedModels, points: Floats) -> bool:
        """Bring one strip to the ground with points of the others; False when they do not determine it."""
        shared = stage.formed.point[np.isfinite(points[stage.formed.point, 0])]
        if collinearity(points[shared]) < ON_A_LINE:
            return False
        try:
            self.done[number] = self._on(stage, shared, points[shared])
        except GeometryError:
            return False
        return True

    def _on(self, stage: FormedPhotos | LinkedModels, numbers: Numbers, cartesian: Floats) -> StripResult:
        """Adjust a strip on points with Cartesian coordinates, beside its own control."""
        known = self.known
        chosen = np.unique(np.linspace(0, len(numbers) - 1, min(len(numbers), MOST_TIES)).astype(np.intp))
        ids = tuple(self.observations.point_ids[n] for n in numbers[chosen])
        ground = known.output.ground_from_cartesian(cartesian[chosen], ids=ids)
        given = set(ids)
        others = known.control.take(np.array([name not in given for name in known.control.ids], bool))
        scale = np.linalg.norm(np.ptp(cartesian, axis=0)) / np.linalg.norm(np.ptp(stage.formed.xyz, axis=0))
        sigma = max(1e-3, 1e-5 * float(scale * np.linalg.norm(np.ptp(stage.formed.xyz, axis=0))))
        of_ties = ControlPoints(
            ids=ids,
            enu=ground,
            use=np.ones(ground.shape, bool),
            check=np.zeros(len(ids), bool),
            sigma=np.full(ground.shape, sigma),
            frame=np.full(len(ids), len(known.frames), np.intp),
        )
        control = concatenated([others, of_ties])
        return adjust_formed(stage, control, (*known.frames, known.output), self.tied)

    def place(self, stages: FormedStrips, group: JoinedStrips) -> bool:
        """Bring a block of strips to the ground; True when nothing was known and its own frame was taken."""
        similarity, free = datum(stages, group, self.observations, self.known, alone=not self.done)
        for number in group.members:
            stage = stages[number]
            cartesian = similarity(group.joined[number](stage.formed.xyz))
            good = np.isfinite(cartesian).all(axis=1)
            self.done[number] = self._on(stage, stage.formed.point[good], cartesian[good])
        return free


def _together(
    inputs: Inputs, strips: tuple[StripResult, ...], observations: PhotoPoints, known: Known, *, free: bool
) -> BlockStart:
    """Orientations of all photos, single ones included, and all points."""
    strangers = _strangers(strips, observations.point_ids)
    points = _mean_points(strips, len(observations.point_ids), strangers)
    oriented: dict[str, tuple[Floats, Floats]] = {}
    for strip in strips:
        centers = strip.intermediate.cartesian_from_intermediate(strip.resection.centers)
        turned = strip.intermediate.cartesian_rotations(strip.resection.rotations)
        oriented |= {photo: (c, r) for photo, c, r in zip(strip.strip.photos, centers, turned, strict=True)}
    given = None if strips else points_as_given(inputs, observations, known.orientations)
    points = _with_control(points if given is None else given, observations, known)
    rough: set[str] = set()
    singles = {strip.photos[0]: strip.camera.principal_distance for strip in inputs.strips if len(strip.photos) == 1}
    if given is not None:
        oriented, singles = known.orientations, {}
    while singles:
        seen = np.bincount(
            observations.photo[np.isfinite(points[observations.point, 0])], minlength=len(observations.photo_ids)
        )
        photo = max(singles, key=lambda each: seen[observations.photo_index[each]])
        if rough and seen[observations.photo_index[photo]] < LEAST_POINTS and photo not in known.orientations:
            points = _rest(inputs, observations, oriented, points)  # nothing better is left
        center, rotation, solved = _single(photo, singles.pop(photo), points, observations, known)
        oriented[photo] = center, rotation
        if solved:  # its rays give the next photos their points
            points = _rest(
                inputs, observations, {each: at for each, at in oriented.items() if each not in rough}, points
            )
        else:
            rough.add(photo)
    names = tuple(photo for strip in inputs.strips for photo in strip.photos)
    centers = np.array([oriented[name][0] for name in names])
    rotations = np.array([oriented[name][1] for name in names])
    points = _rest(inputs, observations, oriented, points)
    if np.isnan(points[:, 0]).all():
        message = "no point stands on two photos or is given; do the ids of points in the tables agree?"
        raise GeometryError(message, code="bundle-rays")
    return BlockStart(
        strips=strips,
        photos=names,
        centers=centers,
        rotations=rotations,
        points=points,
        strangers=strangers,
        rough=np.array([name in rough for name in names], bool),
        scales=None,
        free=free,
    )


def points_as_given(
    inputs: Inputs, observations: PhotoPoints, given: Mapping[str, tuple[Floats, Floats]]
) -> Floats | None:
    """Points from the given orientations of all photos; None where some have none, or the points miss most rays.

    Orientations that agree with each other, as those of an earlier adjustment, are a better start than what single
    photos find on the control, of which some may be wrong.
    """
    if {photo for strip in inputs.strips for photo in strip.photos} - given.keys():
        return None
    points = _rest(inputs, observations, given, np.full((len(observations.point_ids), 3), np.nan))
    rows = np.flatnonzero(np.isfinite(points[observations.point, 0]))
    if not len(rows):
        return None
    photos, photo = _known_photos(inputs, given), observations.places(tuple(given))[rows]
    miss = np.abs(observations.xy[rows] - project(points[observations.point[rows]], photos, photo))
    return points if np.median(miss / observations.sigma[rows]) < LEAST_FAR else None


def _strangers(strips: Sequence[StripResult], point_ids: Sequence[str]) -> dict[str, set[int]]:
    """Points by strip whose ids stand for other points in a strip before: at a place between them no ray goes."""
    found: dict[str, set[int]] = {}
    for ties in compared_strips(strips, point_ids):
        odd, (one, other) = odd_ties(ties), ties.strips
        points: list[int] = [] if odd is None else ties.points[odd.rows].tolist()
        found.setdefault(other, set()).update(set(points) - found.get(one, set()))
    return found


def _mean_points(strips: Sequence[StripResult], count: int, strangers: Mapping[str, AbstractSet[int]]) -> Floats:
    """Mean of the points over the strips; NaN for points of none."""
    found = np.full((count, 3), np.nan)
    if strips:
        number, xyz = mean_points(strips, strangers)
        found[number] = xyz
    return found


def _with_control(points: Floats, observations: PhotoPoints, known: Known) -> Floats:
    """Put full control in where a point has no coordinates."""
    found = points.copy()
    full = known.control.take(np.asarray(known.control.use.all(axis=1), bool))
    rows = locate(full.ids, observations.point_ids)
    missing = np.isnan(found[rows, 0])
    found[rows[missing]] = cartesian_of(full.take(missing), known.frames)
    return found


class _SingleStart(NamedTuple):
    """Orientation of a photo that is a strip of its own."""

    center: Floats
    rotation: Floats
    solved: bool  # false where it is the given one, for want of points


def _single(photo: str, focal: float, points: Floats, observations: PhotoPoints, known: Known) -> _SingleStart:
    """Orient a photo that is a strip of its own on what is known, from its given orientation or in closed form."""
    number = observations.photo_ids.index(photo)
    rows = np.flatnonzero((observations.photo == number) & np.isfinite(points[observations.point, 0]))
    xy, xyz = observations.xy[rows], points[observations.point[rows]]
    if photo in known.orientations:
        given = known.orientations[photo]
        most = LEAST_FAR * float(observations.sigma[rows].max(initial=0.0))
        found = _resected(xy, xyz, focal, given, most)
        if found.solved:
            return found
        try:  # a given orientation that is too far off
            found = _resected(xy, xyz, focal, approximate(xy, xyz, focal), most)
        except GeometryError:
            return _SingleStart(*given, solved=False)
        return found if found.solved else _SingleStart(*given, solved=False)
    try:
        begin = approximate(xy, xyz, focal)
    except GeometryError as error:
        message = (
            f"photo {photo}, which is in no strip, cannot be oriented on points known from the other photos: {error}; "
            "list photos that overlap as one strip, or give its orientation roughly (orientations, role: approximate)"
        )
        raise GeometryError(message, photos=(photo,), code="strip-not-tied") from error
    return _resected(xy, xyz, focal, begin)._replace(solved=True)


def _resected(
    xy: Floats, points: Floats, focal: float, begin: tuple[Floats, Floats], most: float = np.inf
) -> _SingleStart:
    """Resect one photo; not solved either where it would look away from its points, or leave `most` mm rms of them."""
    one = np.zeros(len(xy), np.intp)
    with np.errstate(all="ignore"):  # a start far off sends the iteration anywhere
        found = resect(xy, points, one, KnownPhotos(begin[0][None], begin[1][None], np.array([focal])))
    center, rotation = found.centers[0], found.rotations[0]
    before = bool((((points - center) @ rotation)[:, 2] < 0).all())
    return _SingleStart(center, rotation, solved=bool(found.solved[0] and found.rms[0] < most) and before)


def _rest(
    inputs: Inputs, observations: PhotoPoints, oriented: Mapping[str, tuple[Floats, Floats]], points: Floats
) -> Floats:
    """Intersect the points that no strip has from the photos oriented so far, as those of two strips."""
    place = observations.places(tuple(oriented))
    missing = np.isnan(points[observations.point, 0]) & (place >= 0)
    rays = np.bincount(observations.point[missing], minlength=len(points))
    rows = np.flatnonzero(missing & (rays[observations.point] >= 2))
    if not len(rows):
        return points
    numbers, point = np.unique(observations.point[rows], return_inverse=True)
    photos = _known_photos(inputs, oriented)
    found = intersect_points(
        observations.xy[rows], observations.sigma[rows], (place[rows], point), photos, len(numbers)
    )
    points = points.copy()
    points[numbers] = found.xyz
    return points


def _known_photos(inputs: Inputs, oriented: Mapping[str, tuple[Floats, Floats]]) -> KnownPhotos:
    focal = {photo: camera.principal_distance for photo, camera in inputs.cameras.items()}
    return KnownPhotos(
        centers=np.array([center for center, _ in oriented.values()]),
        rotations=np.array([rotation for _, rotation in oriented.values()]),
        focal=np.array([focal[photo] for photo in oriented]),
    )


def laid_on_ground(
    inputs: Inputs, observations: PhotoPoints, ground: GroundFrames
) -> tuple[Inputs, GroundFrames, tuple[Note, ...]]:
    """Bring orientations in a frame of their own into that of the output, where anything else is known on the ground.

    Raises GeometryError where what is known does not say where they lie.
    """
    given = inputs.orientations
    if given is None or not given.has_own_frame or ground.orientations is not None:
        return inputs, ground, ()
    known = known_of(inputs, measured_control(inputs.control, observations), ground)
    block = Oriented(given.photos, given.enu, from_angles(given.angles, given.system))
    local, as_they_are = known.output.kind == "local", (inputs, replace(ground, orientations=ground.output), ())
    given_of = dict(zip(block.names, zip(block.centers, block.rotations, strict=True), strict=True))
    if local and points_as_given(inputs, observations, given_of) is None:
        return as_they_are  # angles in another unit agree with nothing, and are judged in the frame that is named
    try:
        similarity, what = _similarity(inputs, observations, known, block)
    except GeometryError:
        if local:
            return as_they_are
        raise
    centers = similarity(block.centers)
    turned = known.output.axes_at(centers) @ similarity.rotation @ block.rotations
    system, angles = separable_angles(turned)
    enu = known.output.ground_from_cartesian(centers, ids=given.photos)
    laid = replace(given, frame=known.output.spec, enu=enu, angles=angles, system=system)
    text = f"orientations are in a frame of their own and were laid on {what}: 1 unit of it is {similarity.scale:.6g} m"
    note = Note("orientations-laid", text, "note", key="orientations.crs")
    return replace(inputs, orientations=laid), replace(ground, orientations=ground.output), (note,)


def _similarity(inputs: Inputs, observations: PhotoPoints, known: Known, block: Oriented) -> tuple[Similarity, str]:
    """From the frame of the orientations to the Cartesian one, by control or else with the cameras; and by what."""
    cameras = known.cameras.take(np.isin(known.cameras.ids, [OF_PHOTO.format(name) for name in block.names]))
    xyz = _intersected(inputs, observations, known.control, block)
    there = np.isfinite(xyz[:, 0])
    control, xyz = known.control.take(there), xyz[there]
    full = np.flatnonzero(control.use.all(axis=1))
    fit = majority(xyz[full], cartesian_of(control.take(full), known.frames))  # wrong ones are found later
    kept = np.delete(np.arange(len(control)), full[~fit])
    control, xyz = control.take(kept), xyz[kept]
    try:
        return on_given(xyz, control, known, np.concatenate([xyz, block.centers])), "the control"
    except GeometryError as error:
        if not len(cameras):
            message = (
                f"nothing says where the given orientations lie, whose frame is `local`: of the control {len(there)} "
                f"are measured, {int(there.sum())} of them on two photos or more, {len(control)} of these agree; "
                "three that are not on a line are needed, or camera positions"
            )
            raise GeometryError(message, photos=block.names, code="strip-not-tied") from error
    return with_cameras(block, (xyz, control), cameras, known), "the camera positions"


def _intersected(inputs: Inputs, observations: PhotoPoints, control: ControlPoints, block: Oriented) -> Floats:
    """Control points in the frame of the orientations, (n, 3); NaN where fewer than two photos show them."""
    number = np.full(len(observations.point_ids), -1)
    number[locate(control.ids, observations.point_ids)] = np.arange(len(control))
    place = observations.places(tuple(block.names))
    rows = np.flatnonzero((number[observations.point] >= 0) & (place >= 0))
    focal = {photo: camera.principal_distance for photo, camera in inputs.cameras.items()}
    photos = KnownPhotos(
        centers=block.centers, rotations=block.rotations, focal=np.array([focal[each] for each in block.names])
    )
    where = place[rows], number[observations.point[rows]]
    return intersect_points(observations.xy[rows], observations.sigma[rows], where, photos, len(control)).xyz
