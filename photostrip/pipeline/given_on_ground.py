"""Given coordinates: where they lie on the Earth, and how they go with each formed strip.

Given coordinates by the adjustment: what it predicts of them, and how well.

Check points, and what the search took out, are predicted by all that took part.

Given positions and orientations of cameras against the control and against the strips.

Where the control lies in what it has to hold: a strip of photos or models by itself, or a block of strips.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.crs import areas_of_use
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import from_angles
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.notes import Finding
from photostrip.pipeline import control_readings, evidence, shared_errors
from photostrip.pipeline.control_readings import Reading
from photostrip.pipeline.evidence import HeldStrip, ImageEvidence, OnControl
from photostrip.pipeline.formed_models import LinkedModels, link_strip
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.given_points import cartesian_of, rejected_control, rows_of_given
from photostrip.pipeline.inputs import (
    CameraPositions,
    GivenOrientations,
    Inputs,
    MeasuredModels,
    ModelStrip,
    Settings,
    Strip,
)
from photostrip.pipeline.results import Result
from photostrip.plausibility import flight, found, given_points, units
from photostrip.plausibility import flight as given_angles
from photostrip.plausibility.finding import Evidence
from photostrip.plausibility.given_points import LIMIT
from photostrip.points import ControlPoints, PhotoPoints, concatenated, locate
from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.strip.control_screening import HEIGHT
from photostrip.strip.linked_models import FormedModels

PLAIN = FrameSpec("local", GROUND_AXES)


@dataclass(frozen=True, eq=False)
class GivenControl:
    """Control and check points with their frames, and what their place on the Earth says of how to read them."""

    points: ControlPoints
    frames: Sequence[GroundFrame]
    findings: tuple[Finding, ...]  # P401, P402, P403, by the place alone
    as_written: bool  # whether the frames cannot be right, so that the numbers count as plain metres
    axes_are_right: bool | None  # None where the place does not say
    inputs: Inputs

    @classmethod
    def placed(cls, inputs: Inputs, frames: Sequence[GroundFrame], directory: Path | None) -> Self:
        """Find out where given points lie on the Earth, list by list."""
        control = inputs.control
        places = [
            units.find_wrong_place(
                frame,
                areas_of_use(inputs.frames[number], directory=directory),
                control.enu[(control.frame == number) & control.use[:, 0]],
                number,
            )
            for number, frame in enumerate(frames)
        ]
        sure = {place.sure for place in places}
        return cls(
            control,
            frames,
            findings=tuple(finding for place in places for finding in place.findings),
            as_written=not any(place.inside for place in places),
            axes_are_right=sure.pop() if len(sure) == 1 else None,
            inputs=inputs,
        )

    @cached_property
    def read_in(self) -> Sequence[GroundFrame]:
        """Frames in which strips are laid on the points: plain ones where their own cannot be right."""
        return tie_frames([PLAIN] * len(self.frames))[0] if self.as_written else self.frames


@dataclass(frozen=True)
class OfStrip:
    """What a formed strip says of the given points that it shows."""

    whole: list[Finding] = field(default_factory=list)  # of all of them, or of a list: P103, P105, P107, P401 to P410
    slips: list[Finding] = field(default_factory=list)  # of single ones: P406, P408
    mirrored: list[Finding] = field(default_factory=list)  # that it fits as its mirror image, without the cause
    confirmed: frozenset[int] = frozenset()  # control lists that it fits as they are given
    with_positions: bool | None = None  # of a mirrored one: whether camera positions go with the control, or exchanged


def of_strip(control: GivenControl, stage: FormedPhotos | LinkedModels, settings: Settings) -> OfStrip:
    """Compare the given points with a formed strip, as they are given and as they may be read."""
    strip, points = stage.strip.id, control.points
    held = HeldStrip.of(stage, points, settings)
    if not len(held.given):
        return OfStrip()
    as_given = held.read(points, control.read_in, as_given=True)
    whole = control_readings.of_heights(held, as_given)
    if whole:
        return OfStrip(whole)
    better = control_readings.find_reading(held, points, control.read_in, as_given)
    mirrored: list[Finding] = []
    with_positions: bool | None = None
    if better is not None:
        if better.reading.mirrored:
            with_positions = _with_positions(control, held, better.laid)
        into = mirrored if better.reading.mirrored else whole
        into.append(control_readings.named(better, as_given, held, control.frames))
    else:
        whole += control_readings.of_whole_control(held, as_given, points, control.read_in)
        whole += [] if whole or as_given is None else shared_errors.of_formed(as_given, stage)
    laid, reading = (as_given, control_readings.AS_GIVEN) if better is None else (better.laid, better.reading)
    fits = better is None and as_given is not None and as_given.fits
    confirmed = frozenset(points.frame[held.given].tolist()) if fits else frozenset()
    of_all = OfStrip(whole, mirrored=mirrored, confirmed=confirmed, with_positions=with_positions)
    if laid is None or not laid.fits or reading.rows or (whole and better is None):
        return of_all
    given = given_points.level(points.take(held.given), control.frames, as_written=control.as_written)
    if given is None:
        return of_all
    off, sigma = laid.off
    off = reading.as_written(off, signed=True) + given.moved * given.steps.unit
    named = [given.ids.index(name) for name in whole[0].points] if whole else []
    off[named] = np.nan  # of a list that lies beside the others
    of_all.slips.extend(given_points.find_slips(given, off, reading.as_written(sigma, signed=False), (strip,)))
    return of_all


def _with_positions(control: GivenControl, held: HeldStrip, mirrored: OnControl) -> bool | None:
    """Whether camera positions lie where a mirrored strip has its photos on the control as it is given.

    Returns False where they lie over the control with its plan axes exchanged, and None where nothing tells.
    """
    given, photos = control.inputs.positions, held.stage.strip.photos
    if given is None or control.as_written:
        return None
    rows = locate(photos, given.photos)
    shown = (rows >= 0) & given.use[rows].all(axis=1)
    exchanged = held.read(control_readings.PLAN_EXCHANGED(control.points), control.frames)
    try:
        tied, _ = tie_frames([given.frame, *control.inputs.frames], control.inputs.output or given.frame)
        positions = tied[0].cartesian_from_ground(given.enu[rows[shown]])
    except (GeometryError, InputError):
        return None
    off = []  # in bases
    for laid in (mirrored, exchanged):
        if laid is None or not shown.any():
            return None
        centers = laid.oriented.intermediate.cartesian_from_intermediate(laid.centers)
        base = np.median(np.linalg.norm(np.diff(centers, axis=0), axis=1))
        off.append(np.median(np.linalg.norm(centers[shown] - positions, axis=1)) / base)
    is_told = min(off) < NEAR_BY * min(max(off), 1.0)  # a flight along north-east lies where it lay
    return bool(off[0] < off[1]) if is_told else None


def of_strips(
    control: GivenControl, stages: Iterable[FormedPhotos | LinkedModels], settings: Settings
) -> tuple[list[Finding], list[Finding]]:
    """Compare the given points with all formed strips: what all of them show, and slips of single ones."""
    all_strips = [of_strip(control, each, settings) for each in stages]
    mirrored = [finding for each in all_strips for finding in each.mirrored if control.axes_are_right is not False]
    shown = locate([name for each in mirrored for name in each.points], control.points.ids)
    confirmed = frozenset[int]().union(*(each.confirmed for each in all_strips))
    whole = control_readings.of_mirrored(
        mirrored,
        control.inputs,
        control.frames,
        in_place=control.axes_are_right is True,
        others_fit=not confirmed.isdisjoint(control.points.frame[shown].tolist()),
        with_positions=next((each.with_positions for each in all_strips if each.with_positions is not None), None),
    )
    whole += [finding for each in all_strips for finding in each.whole]
    return whole, [finding for each in all_strips for finding in each.slips]


@dataclass(frozen=True, eq=False)
class Predicted:
    """Given coordinates as an adjustment in which they took no part predicts them, worked out when it is asked for.

    Check points and rejected control are predicted.
    """

    result: Result

    @cached_property
    def _used(self) -> Flags:
        """Control coordinates (c, 3) that took part."""
        result, control = self.result, self.result.inputs.control
        rejected = rejected_control(result)
        for strip in result.model_strips:
            rows = locate(strip.control.ids, control.ids)
            rejected[rows] |= control.use[rows] & ~strip.control.use
        used = control.use & ~control.check[:, None] & ~rejected & (result.control_rows >= 0)[:, None]
        return np.asarray(used, bool)

    @cached_property
    def off(self) -> Floats:
        """Given minus predicted (c, 3), metres along the axes of each point's frame; NaN where not known."""
        return np.where(self._used, np.nan, -self.result.control_differences)

    @cached_property
    def sigma(self) -> Floats:
        """Standard deviations (c, 3) of these differences; NaN without a precision."""
        result, control, precision = self.result, self.result.inputs.control, self.result.precision
        sigma = np.full(control.use.shape, np.nan)
        for number, frame in enumerate(result.frames):
            rows = np.flatnonzero((control.frame == number) & (result.control_rows >= 0))
            if len(rows) and precision is not None:
                at = result.control_rows[rows]
                axes = frame.axes_at(result.points.cartesian[at])
                with np.errstate(invalid="ignore"):  # a variance lost to rounding is not known
                    sigma[rows] = np.sqrt(np.einsum("nai,nij,naj->na", axes, precision.points[at], axes))
        return np.asarray(np.hypot(sigma, np.where(control.sigma > 0, control.sigma, 0.0)), float)

    @cached_property
    def sound(self) -> Flags:
        """Control coordinates (c, 3) that took part: the run tested them and found them right."""
        return self._used & _tested(self.result)

    def agree(self, use: Flags) -> Flags:
        """Given points (c,) whose coordinates `use` (c, 3) the adjustment predicts, or tested and kept."""
        near = np.abs(self.off) <= LIMIT * self.sigma
        return np.asarray((self.sound | near | ~use).all(axis=1))

    @cached_property
    def spread(self) -> Floats:
        """Standard deviations (c, 3), larger where the others are predicted worse than by theirs."""
        ratio, spread = np.abs(self.off / self.sigma), np.array(self.sigma)
        for columns in ([0, 1], [HEIGHT]):
            odd = ratio[:, columns] > LIMIT
            for row in np.flatnonzero(odd.any(axis=1)).tolist():
                others = np.delete(ratio, row, axis=0)[:, columns]
                others = others[np.isfinite(others)]
                spread[row, columns] *= max(SIGMA_FROM_MEDIAN * np.median(others), 1.0) if len(others) else 1.0
        return spread


def is_doubtful(stage: FormedPhotos, result: Result, predicted: Predicted) -> bool:
    """Whether the given points of a strip may be wrong: no bundle has seen them, or some do not agree with it."""
    if result.bundle is None:
        return True
    control = result.inputs.control
    shown = rows_of_given(control.ids, stage.formed.point, result.refined.observations.point_ids) >= 0
    return bool((shown & ~predicted.agree(control.use)).any())


def _tested(result: Result) -> Flags:
    """Given coordinates (c, 3) that the run could test for gross errors, and of which it doubts none."""
    settings, control = result.settings, result.inputs.control
    tested = np.full(control.use.shape, result.bundle is not None and settings.bundle.screening != "none")
    if result.bundle is None and (settings.links if result.model_strips else settings.relative).screening != "none":
        for strip in result.strips:
            rows = locate(strip.control.ids, control.ids)
            tested[rows] |= np.isfinite(strip.screened_control.redundancy)
    doubtful = {name for note in result.notes if note.code == "control-doubtful" for name in note.points}
    tested[[name in doubtful for name in control.ids]] = False
    return tested


def of_result(result: Result, predicted: Predicted, control: GivenControl) -> Iterator[Finding]:
    """Name slips of given coordinates that the adjustment predicts, and that took no part or were not tested."""
    given = given_points.level(control.points, control.frames, as_written=control.as_written)
    if given is None or result.precision is None:
        return
    asked = np.isfinite(predicted.off) & ~predicted.sound
    if not (asked & (np.abs(predicted.off) > LIMIT * predicted.sigma)).any() and not given.moved.any():
        return  # what the axes are where they are written takes long to say
    unit = np.array([[frame.plan_factor, frame.plan_factor, frame.height_factor] for frame in control.frames])
    projected = np.array([frame.kind == "projected" for frame in control.frames])[control.points.frame]
    # differences count by map coordinates: a map has a scale of its own
    scale = np.where(projected[:, None], given.steps.unit / unit[control.points.frame], 1.0)
    scale[:, HEIGHT] = 1.0
    yield from given_points.find_slips(given, predicted.off * scale, predicted.spread, asked=asked)


NEAR_BY = 0.3  # of a base, or of how far off it is elsewhere, within which a camera position is that of its photo
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
    for given in _given_centers(inputs, starts=starts):
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


def _given_centers(inputs: Inputs, *, starts: bool) -> Iterator[GivenCenters]:
    positions, orientations = inputs.positions, inputs.orientations
    if positions is not None:
        yield GivenCenters.of("camera_positions", positions, np.flatnonzero(positions.use.all(axis=1)))
    if orientations is not None and (orientations.observed or starts):
        yield GivenCenters.of("orientations", orientations, np.flatnonzero(np.isfinite(orientations.enu).all(axis=1)))


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
                before = last.get(point)
                last[point] = each.station, ray
                if before is None or cameras[photos[before[0]]] != cameras[photos[each.station]]:
                    continue
                names, focal = (
                    (photos[before[0]], photos[each.station]),
                    cameras[photos[each.station]].principal_distance,
                )
                oriented = evidence.oriented_pair(self.observations, names, focal)
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
        return list(given_angles.find_wrong_angles(angles, given.system, rotations, photos, north))
    stated = from_angles(angles, given.system)
    return list(given_angles.find_wrong_rotations(stated, rotations, photos, north))


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


@dataclass(frozen=True, eq=False)
class ModelStripEvidence:
    """A strip of models with centres, and the given points in it."""

    strip: ModelStrip
    centers: Floats  # (f, 3): perspective centres of the photos that have one, in strip coordinates
    photos: tuple[str, ...]
    depth: Floats  # (f,): height of each above the points of its models
    rows: Numbers  # rows of the given points that the strip holds
    place: Floats  # place of each of them along the strip in bases, from 0 at the first photo
    breadth: float  # half breadth of the strip over its length


def form_strips(models: MeasuredModels, settings: Settings) -> Iterator[LinkedModels]:
    """Form the strips that can be formed, for evidence alone."""
    for strip in models.strips:
        try:
            yield link_strip(strip, models.points, settings)
        except (GeometryError, np.linalg.LinAlgError):
            continue


def model_strips(
    strips: Iterable[LinkedModels], point_ids: tuple[str, ...], control: ControlPoints
) -> Iterator[ModelStripEvidence]:
    """Collect what the gate looks at in strips that have two perspective centres."""
    for linked in strips:
        if np.isfinite(linked.formed.centers[:, 0]).sum() > 1:
            yield _evidence(linked.strip, linked.formed, control, point_ids)


def _evidence(
    strip: ModelStrip, formed: FormedModels, control: ControlPoints, point_ids: tuple[str, ...]
) -> ModelStripEvidence:
    known = np.flatnonzero(np.isfinite(formed.centers[:, 0]))
    centers, depth = formed.centers[known], _depths(formed)[known]
    places = rows_of_given(control.ids, formed.point, point_ids)
    rows = np.flatnonzero(places >= 0)
    xyz = formed.xyz[places[rows]]
    along = np.interp(xyz[:, 0], centers[:, 0], known.astype(float))
    length = max(float(np.ptp(centers[:, 0])), 1e-9)
    breadth = np.quantile(np.abs(formed.xyz[:, 1] - np.median(formed.xyz[:, 1])), 0.95) / length
    return ModelStripEvidence(
        strip=strip,
        centers=centers,
        photos=tuple(strip.photos[k] for k in known.tolist()),
        depth=depth,
        rows=rows,
        place=along,
        breadth=breadth,
    )


def _depths(formed: FormedModels) -> Floats:
    """Heights of the centres above the points of their models, strip coordinates; NaN without a centre."""
    models = formed.models
    point = (models.node < models.points) & formed.used
    count = np.bincount(models.model[point], minlength=models.count)
    ground = np.bincount(models.model[point], formed.model_xyz[point, 2], models.count) / np.maximum(count, 1)
    both = np.concatenate([ground[:1], (ground[1:] + ground[:-1]) / 2, ground[-1:]])
    return np.asarray(formed.centers[:, 2] - both)


def weak_layout(
    inputs: Inputs, settings: Settings, images: ImageEvidence, control: GivenControl | None, directory: Path | None
) -> Iterator[Finding]:
    """Look where the control lies: along each strip and across, or in the block that a bundle makes of all strips."""
    if control is None:
        return
    in_bundle = settings.together
    cameras = _cameras(inputs) if in_bundle else None
    strips = [strip for strip in images.strips if len(strip.photos) > 1]
    if in_bundle and (cameras is not None or len(images.strips) > 1):
        yield from _of_block(inputs, strips, images, control, cameras, directory)
        return
    for strip in strips:
        held = _of_photos(strip, images, control)
        yield from _of_strip(strip, held, _half_breadth(strip, images, held))


def weak_layout_of_models(held: ModelStripEvidence, control: GivenControl) -> Iterator[Finding]:
    """Look where the control of a strip of models lies along it and across."""
    in_plan = _in_plan(control, held.rows, held.place)
    breadth = float(held.breadth * np.linalg.norm(np.ptp(in_plan.plan, axis=0))) if in_plan.names else 0.0
    yield from _of_strip(held.strip, in_plan, breadth)


class HeldInPlan(NamedTuple):
    """Given points that hold the plan of a strip."""

    names: list[str]
    place: Floats  # along the strip
    plan: Floats  # (n, 2), metres


def _of_strip(strip: Strip | ModelStrip, held: HeldInPlan, breadth: float) -> Iterator[Finding]:
    yield from given_points.find_line(held.plan, breadth, held.names, f"strip {strip.id}", (strip.id,))
    yield from given_points.find_weak_ends(held.place, strip.photos, strip.id, held.names)


def _of_photos(strip: Strip, images: ImageEvidence, control: GivenControl) -> HeldInPlan:
    return _in_plan(control, *evidence.places_along_strip(strip, images.observations, control.points, images.steps))


def _in_plan(control: GivenControl, rows: Numbers, place: Floats) -> HeldInPlan:
    """Those of some given points that hold the plan."""
    counts = control.points.use[rows, 0] & ~control.points.check[rows]
    points = control.points.take(rows[counts])
    given = given_points.level(points, control.frames)
    if given is None:
        return HeldInPlan([], place[:0], np.zeros((0, 2)))
    return HeldInPlan(list(points.ids), place[counts], given.xyz[:, :2])


class HeldCameras(NamedTuple):
    """Cameras whose position takes part in a bundle."""

    points: ControlPoints  # as if they were control
    frame: FrameSpec


def _cameras(inputs: Inputs) -> HeldCameras | None:
    """Cameras whose position is given in full and takes part in a bundle; None without any."""
    given = next(_given_centers(inputs, starts=False), None)
    if given is None or not given.photos:
        return None
    count = len(given.photos)
    points = ControlPoints(
        ids=given.photos,
        enu=given.enu,
        use=np.ones((count, 3), bool),
        check=np.zeros(count, bool),
        sigma=np.full((count, 3), np.nan),
        frame=np.full(count, len(inputs.frames)),
    )
    return HeldCameras(points, given.frame)


def _of_block(
    inputs: Inputs,
    strips: list[Strip],
    images: ImageEvidence,
    control: GivenControl,
    cameras: HeldCameras | None,
    directory: Path | None,
) -> Iterator[Finding]:
    """Look whether all that is known on the ground stands on one line; cameras hold a block as control does."""
    shown = np.isin(control.points.ids, images.observations.point_ids)
    rows = np.flatnonzero(shown & control.points.use[:, 0] & ~control.points.check)
    points, frames = control.points.take(rows), list(control.frames)
    names = points.ids
    if cameras is not None:
        try:
            frames, _ = tie_frames([*inputs.frames, cameras.frame], inputs.output, directory=directory)
        except (GeometryError, InputError):
            return
        points = concatenated([points, cameras.points])
    given = given_points.level(points, frames)
    if given is None:
        return
    plan = given.xyz[:, :2]
    halves = (_half_breadth(strip, images, _of_photos(strip, images, control)) for strip in strips)
    breadth = next((half for half in halves if half > 0), 0.0)
    what = f"strip {strips[0].id}" if len(strips) == 1 else "the block"
    yield from given_points.find_line(plan, breadth, names, what, [strip.id for strip in strips])


def _half_breadth(strip: Strip, images: ImageEvidence, held: HeldInPlan) -> float:
    return evidence.half_breadth(strip, images.observations, held.names, held.plan, held.place, images.steps)
