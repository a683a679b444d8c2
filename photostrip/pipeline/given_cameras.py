"""Given positions and orientations of cameras against the control and against the strips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import from_angles
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.notes import Finding
from photostrip.pipeline import control_readings, evidence
from photostrip.pipeline.control_readings import Reading
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.given_on_ground import GivenControl
from photostrip.pipeline.given_points import cartesian_of, rows_of_given
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations, Inputs, Strip
from photostrip.plausibility import flight, found
from photostrip.plausibility.finding import Evidence
from photostrip.points import ControlPoints, PhotoPoints, locate
from photostrip.strip.control_screening import HEIGHT

LEAST_POINTS = 3  # points that carry a similarity
LEAST_BREADTH = 0.05  # second over first extent of control, below which it says nothing of the roll
MOST_REFITS = 4  # of leaving out what does not fit
KEPT_SIGMAS = 5.0  # middle misclosures within which a point goes with the others
MOST_HEIGHT_RATIO = 1.3  # flying height given over that of the photo scale, or the other way round, that is reported
LEAST_HEIGHTS = 3  # photos whose flying height is known from their scale
ELSEWHERE = 0.23  # misfit of rays to control, in parts of their spread, of centres 30 % too high
AGREES = 0.03, 0.1  # misfit of centres that are where photos and control have them: by a lens, an antenna; at most
FLAT = 3.0  # heights beside the control that a photo shows, beyond which it would look along the ground
MOST_PAIRS = 24  # of photos that are oriented to each other
KILOMETRES = 1000.0
UP = np.array([0.0, 0.0, 1.0])  # of a level plane, and of a strip of models with perspective centres
FIXES = {
    "P204": "are the positions heights above the ground, in another unit, or of another vertical datum than the "
    "control?",
    "P205": "is the height of that row right, and does it belong to that photo?",
    "P206": "are positions missing, or do some belong to other photos?",
    "P207": "do some positions belong to other photos, or does the strip bend there?",
}


class GivenCenters(NamedTuple):
    """Perspective centres as they are given."""

    key: str  # where they stand in the project file
    frame: FrameSpec
    photos: tuple[str, ...]  # those whose centre is given in full
    enu: Floats  # (n, 3)
    sigma: Floats  # (n, 3): standard deviations, metres; NaN where none is stated

    @classmethod
    def of(cls, key: str, given: CameraPositions | GivenOrientations, whole: Numbers) -> Self:
        photos = tuple(given.photos[row] for row in whole.tolist())
        return cls(key=key, frame=given.frame, photos=photos, enu=given.enu[whole], sigma=given.sigma[whole])

    @classmethod
    def of_inputs(cls, inputs: Inputs, *, starts: bool) -> Iterator[Self]:
        """Give camera positions, and orientations; those that are only a start where ``starts`` count."""
        positions, orientations = inputs.positions, inputs.orientations
        if positions is not None:
            yield cls.of("camera_positions", positions, np.flatnonzero(positions.use.all(axis=1)))
        if orientations is not None and (orientations.observed or starts):
            yield cls.of("orientations", orientations, np.flatnonzero(np.isfinite(orientations.enu).all(axis=1)))

    def as_control(self, frame: int) -> ControlPoints:
        """Give them as if they were control of a list, by the number of its frame."""
        every, none = np.ones(self.enu.shape, bool), np.full(self.enu.shape, np.nan)
        number = np.full(len(self.photos), frame)
        return ControlPoints(self.photos, self.enu, every, check=~every[:, 0], sigma=none, frame=number)


class LevelPlan(NamedTuple):
    """Perspective centres and control points in one level plane: east, north and height, metres."""

    centers: Floats  # (n, 3)
    control: Floats  # (c, 3)

    @property
    def step(self) -> Floats:
        """From the middle of the control to that of the centres (3,)."""
        return np.asarray(np.median(self.centers, axis=0) - np.median(self.control, axis=0), float)

    @property
    def beside(self) -> str:
        """Say how high above the control and how far beside it the centres lie."""
        height, away = float(self.step[HEIGHT]), float(np.linalg.norm(self.step[:HEIGHT]))
        far = f"{away:.0f} m" if away < KILOMETRES else f"{away / KILOMETRES:.4g} km"
        return f"{abs(height):.4g} m {'above' if height >= 0 else 'below'} the control, {far} beside its middle"


class Rays(NamedTuple):
    """The control that one photo shows, or the photos that show one control point."""

    station: int  # number of the centre, or of the control point
    number: Numbers  # (k,): of the points, or of the centres
    measured: Floats  # (k, 3): directions to them, of length one, in the system of a photo
    from_photo: bool = True

    def arms(self, plan: LevelPlan) -> Floats:
        """From the station to its targets (k, 3)."""
        of, to = (plan.centers, plan.control) if self.from_photo else (plan.control, plan.centers)
        return np.asarray(to[self.number] - of[self.station], float)


def centers(
    inputs: Inputs,
    observations: PhotoPoints,
    strips: Sequence[Strip],
    directory: Path | None = None,
    *,
    starts: bool = False,
) -> Iterator[Finding]:
    """Look at given perspective centres: elsewhere, below the ground, at another height, with bases that jump.

    observations: image points in the system of the photo, mm.
    strips: the strips, their photos as they lie.
    starts: whether those that are only a start count as well: they may be far off, and matter where a run fails.
    """
    for at in over_control(inputs, observations, directory, starts=starts):
        common = at.misread or _other_height(at, np.arange(len(at.given.photos)))
        if common is not None:
            yield common
        elif at.plan is not None:
            for strip in strips:
                yield from _off_plan(strip, at, at.plan.centers)


def over_control(
    inputs: Inputs, observations: PhotoPoints, directory: Path | None, *, starts: bool = False
) -> Iterator[OverControl]:
    """Put given perspective centres beside the control that their photos show; the rest as in ``centers``."""
    control = inputs.control.take(inputs.control.use.all(axis=1) & ~inputs.control.check)
    number = locate(observations.point_ids, control.ids)[observations.point]
    rows = np.flatnonzero(number >= 0)
    rows = rows[np.argsort(observations.photo[rows], kind="stable")]
    for given in GivenCenters.of_inputs(inputs, starts=starts):
        shown = locate(given.photos, observations.photo_ids)
        of_photo = observations.photo[rows]
        first, last = np.searchsorted(of_photo, shown), np.searchsorted(of_photo, shown, "right")
        rays = []
        for place in np.flatnonzero((first < last) & (shown >= 0)).tolist():
            own, camera = rows[first[place] : last[place]], inputs.cameras.get(given.photos[place])
            if camera is not None:
                xyz = np.column_stack([observations.xy[own], np.full(len(own), -camera.principal_distance)])
                rays.append(Rays(place, number[own], _unit(xyz)))
        if given.photos:
            yield OverControl(given, inputs, control, rays, observations, directory)


def _usual(sigma: Floats) -> float:
    stated = sigma[np.isfinite(sigma)]
    return float(np.median(stated)) if len(stated) else 0.0


@dataclass(frozen=True, eq=False)
class OverControl:
    """Given centres beside the control that their photos show."""

    given: GivenCenters
    inputs: Inputs
    control: ControlPoints  # full points that are no check points
    rays: Sequence[Rays]  # from each photo that shows some of it
    observations: PhotoPoints
    directory: Path | None

    @cached_property
    def plan(self) -> LevelPlan | None:
        """As the centres are given."""
        return self._level(self.given.frame, self.given.enu)

    def _level(self, frame: FrameSpec, enu: Floats) -> LevelPlan | None:
        """Centres in a frame, and control, in one plane with heights above the ellipsoid; None of no such place."""
        frames = [frame, *self.inputs.frames]
        try:
            tied, target = tie_frames(frames, self.inputs.output or self.given.frame, directory=self.directory)
            placed = [tied[0].cartesian_from_ground(enu), cartesian_of(self.control, tied[1:])]
        except (GeometryError, InputError):
            return None  # what is wrong with the frames stops the run itself
        together = np.concatenate(placed)
        middle = np.median(together, axis=0)
        level = (together - middle) @ target.level_axes_at(middle[None, :])[0].T
        if target.kind != "local":  # the Earth falls away from a plane
            level[:, 2] = target.geodetic(together)[:, 2]
        return LevelPlan(level[: len(enu)], level[len(enu) :])

    @cached_property
    def above(self) -> tuple[Floats, Floats]:
        """Height (n,) of the control that each photo shows, and how many times too far from it its centre is given.

        The angles between rays say that, whichever way the camera looks. A centre so low that it would look along the
        ground says it by the scale of its photo, as that of a level one. NaN: not known, far beside the control.
        """
        height, times = np.full((2, len(self.given.photos)), np.nan)
        if self.plan is None:
            return height, times
        for each in self.rays:
            arm = each.arms(self.plan)
            height[each.station] = np.median(self.plan.control[each.number, HEIGHT])
            given, measured = _spread(_unit(arm)), _spread(each.measured)
            if given > 0 and measured > 0:
                beside, low = np.median(np.linalg.norm(arm[:, :2], axis=1)), abs(np.median(arm[:, 2]))
                by_scale = _spread(arm) / _spread(each.measured / np.abs(each.measured[:, 2:]))
                if beside < FLAT * low:
                    times[each.station] = measured / given
                elif beside < FLAT * by_scale:
                    times[each.station] = low / by_scale
        return height, times

    @cached_property
    def pairs(self) -> list[Rays]:
        """Of photos that show two control points or more; or from points to two photos, oriented to each other."""
        pairs = [each for each in self.rays if len(each.number) > 1]
        return pairs if len(pairs) >= LEAST_HEIGHTS else pairs + list(islice(self._to_photos(), MOST_PAIRS))

    def _to_photos(self) -> Iterator[Rays]:
        photos, cameras = self.given.photos, self.inputs.cameras
        last: dict[int, tuple[int, Floats]] = {}
        for each in self.rays:
            for point, ray in zip(each.number.tolist(), each.measured, strict=True):
                before, last[point] = last.get(point), (each.station, ray)
                if before is None or cameras[photos[before[0]]] != cameras[photos[each.station]]:
                    continue
                focal = cameras[photos[each.station]].principal_distance
                oriented = evidence.oriented_pair(self.observations, (photos[before[0]], photos[each.station]), focal)
                if oriented is not None:
                    measured = -np.stack([before[1], oriented[1] @ ray])
                    yield Rays(point, np.array([before[0], each.station]), measured, from_photo=False)

    def _misfit(self, plan: LevelPlan) -> float:
        """How far rays between photos and control miss those measured, turned as fits best, in parts of their spread.

        The median over the stations: whichever way photos look, and whatever is wrong with one.
        """
        off = []
        for each in self.pairs:
            u, size, vt = np.linalg.svd(each.measured.T @ _unit(each.arms(plan)))
            fitted = size.sum() - (2.0 * size[-1] if np.linalg.det(u @ vt) < 0 else 0.0)
            off.append(np.sqrt(max(2.0 * (len(each.number) - fitted), 0.0)) / max(_spread(each.measured), 1e-12))
        return float(np.median(off))

    @cached_property
    def misread(self) -> Finding | None:
        """Name the reading under which centres that lie elsewhere go with control and photos; None without one."""
        plan, sigma = self.plan, _usual(self.given.sigma)
        if len(self.pairs) < LEAST_HEIGHTS or (plan is not None and self._misfit(plan) <= ELSEWHERE):
            return None
        tried = []
        for each, frame, enu in self._readings():
            read = self._level(frame, enu)
            if read is not None and read.step[HEIGHT] > 0:  # from below two points look as from above
                most = float(np.clip(KEPT_SIGMAS * sigma / read.step[HEIGHT], *AGREES))
                tried += [(misfit, each, read)] if (misfit := self._misfit(read)) < most else []
        if not tried or self._control_lies_elsewhere():
            return None
        misfit, reading, there = min(tried, key=lambda each: each[0])
        key, share = self.given.key, 100.0 * misfit
        message = (
            f"the {key.replace('_', ' ')} go with the control and its image points, directions to {share:.2g} % of "
            f"their spread, if read so: {reading.text}. Then they lie {there.beside}; as they are given "
            f"{'nowhere on the Earth' if plan is None else plan.beside}"
        )
        numbers: Evidence = {"misfit_percent": share}
        place = f"{key}.axes" if reading.code == "P401" else f"{key}.crs"
        fix = reading.fix or f"put `{place}` into the order of the columns"
        if self.given.frame.crs == "local":  # whose place nobody knows
            fix += "; or is it the control that is in another unit, or order of axes?"
        return found(reading.code, message, fix, numbers, photos=self.given.photos, key=place)

    def _control_lies_elsewhere(self) -> bool:
        """Whether it is the control that lies where its coordinate reference system is not made for."""
        frames, _ = tie_frames(self.inputs.frames, self.inputs.output, directory=self.directory)
        return bool(GivenControl.placed(self.inputs, frames, self.directory).findings)

    def _readings(self) -> Iterator[tuple[Reading, FrameSpec, Floats]]:
        """Give the readings of given coordinates that mean something of centres, and the frames of the control."""
        enu, frame = self.given.enu, self.given.frame
        for reading in control_readings.READINGS:
            if not (reading.rows or reading.without or reading.mirrored or np.isnan(reading.distance)):
                yield reading, frame, enu[:, reading.order] * reading.factor
        for number, other in enumerate(self.inputs.frames):
            if other != frame:
                text = f"their frame is that of control[{number}], {other.name}"
                fix = "give both the crs, and the kind of height, that they are in: datum, zone, `height`"
                yield Reading("P402", text, fix), other, enu


def _off_plan(strip: Strip, at: OverControl, centers: Floats) -> Iterator[Finding]:
    """Look at the centres of one strip, which go with those of the others."""
    rows = locate(strip.photos, at.given.photos)
    rows = rows[rows >= 0]
    if not len(rows):
        return
    key, photos, xyz = at.given.key, [at.given.photos[row] for row in rows.tolist()], centers[rows]
    ground = at.above[0][rows]
    known = np.flatnonzero(np.isfinite(ground))
    usual = float(np.ptp(xyz[:, :2], axis=0).max())
    depth = np.full(len(rows), max(usual, 1.0))
    if len(known):
        depth = xyz[:, 2] - np.interp(np.arange(len(rows)), known, ground[known])
    findings = list(flight.find_odd_centers(xyz, depth, UP, photos, strip.id, _usual(at.given.sigma)))
    other = None if any(each.code == "P204" for each in findings) else _other_height(at, rows, strip)
    for each in findings if other is None else ():
        fix = FIXES[each.code] if each.code != "P205" or len(each.photos) == 1 else each.fix
        yield replace(each, message=f"{key}: {each.message}", fix=fix, key=key)
    if other is not None:
        yield other


def _unit(rays: Floats) -> Floats:
    return np.asarray(rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12), float)


def _spread(directions: Floats) -> float:
    return float(np.sqrt(((directions - directions.mean(axis=0)) ** 2).sum()))


def _other_height(at: OverControl, rows: Numbers, strip: Strip | None = None) -> Finding | None:
    """Compare the height of centres above the control with the scale of their photos: of a strip, or of all."""
    ground, ratio = (each[rows] for each in at.above)
    depth = np.full(len(rows), np.nan) if at.plan is None else at.plan.centers[rows, HEIGHT] - ground
    known = np.isfinite(ratio)
    if (
        known.sum() < LEAST_HEIGHTS
        or (depth <= 0).any()
        or 1.0 / MOST_HEIGHT_RATIO < np.median(ratio[known]) < MOST_HEIGHT_RATIO
    ):
        return None
    given, wanted = float(np.median(depth[known])), float(np.median(depth[known] / ratio[known]))
    message = (
        f"the {at.given.key.replace('_', ' ')}{f' of strip {strip.id}' if strip else ''} lie {given:.4g} m above the "
        f"control, and the scale of the photos requires {wanted:.4g} m"
    )
    numbers = {"given_above_control_m": given, "by_photo_scale_m": wanted}
    fix = "are their heights above the ground, in another unit or datum? or is the principal distance wrong?"
    photos, strips = [at.given.photos[row] for row in rows.tolist()], (strip.id,) if strip else ()
    return found("P205", message, fix, numbers, photos=photos, strips=strips, key=at.given.key)


def angles(
    inputs: Inputs,
    formed: Sequence[FormedPhotos],
    observations: PhotoPoints,
    directory: Path | None = None,
) -> list[Finding]:
    """Compare given angles with those of strips on their control, whatever an adjustment made of them (P601, P602)."""
    given = inputs.orientations
    if given is None:
        return []
    try:
        tied, _ = tie_frames([given.frame, *inputs.frames], inputs.output or given.frame, directory=directory)
        laid = [(each, _on_control(each, observations, inputs.control, tied[1:])) for each in formed]
        held = [(each, similarity) for each, similarity in laid if similarity is not None]
        turned = {
            photo: rotation
            for each, similarity in held
            for photo, rotation in zip(each.strip.photos, _rotations(each, similarity, tied[0]), strict=True)
        }
        norths = [tied[0].convergence(similarity(each.formed.centers)) for each, similarity in held]
    except (GeometryError, InputError):
        return []
    photos = [photo for photo in given.photos if photo in turned]
    if not photos:
        return []
    rotations = np.array([turned[photo] for photo in photos])
    north = float(np.median(np.concatenate(norths)))
    return wrong_angles(given, photos, rotations, north)


def wrong_angles(given: GivenOrientations, photos: Sequence[str], rotations: Floats, north: float) -> list[Finding]:
    """Compare the given angles of some photos with rotations found (n, 3, 3), in the readings that they can have."""
    angles = given.angles[locate(photos, given.photos)]
    if given.stated:
        return list(flight.find_wrong_angles(angles, given.system, rotations, photos, north))
    stated = from_angles(angles, given.system)
    return list(flight.find_wrong_rotations(stated, rotations, photos, north))


def _rotations(formed: FormedPhotos, similarity: Similarity, frame: GroundFrame) -> Floats:
    axes = frame.axes_at(similarity(formed.formed.centers))
    return np.asarray(axes @ similarity.rotation @ formed.formed.rotations, float)


def _on_control(
    formed: FormedPhotos, observations: PhotoPoints, control: ControlPoints, frames: Sequence[GroundFrame]
) -> Similarity | None:
    """Similarity from the strip to its control; None where that does not hold all rotations."""
    strip = formed.formed
    counts = control.use.all(axis=1) & ~control.check
    places = rows_of_given(control.ids, strip.point, observations.point_ids)
    rows = np.flatnonzero(counts & (places >= 0))
    source, target = strip.xyz[places[rows]], cartesian_of(control.take(rows), frames)
    keep = np.ones(len(rows), bool)
    for _ in range(MOST_REFITS):
        if keep.sum() < LEAST_POINTS or collinearity(target[keep]) < LEAST_BREADTH:
            return None
        similarity = Similarity.from_points(source[keep], target[keep])
        off = np.linalg.norm(similarity.residuals(source, target), axis=1)
        keep = off <= KEPT_SIGMAS * max(np.median(off), 1e-9)
    return similarity
