"""What the checks look at: strips formed for evidence, what images say, a strip on its control however that is read.

**Directions of bases**, where the photos laid side by side leave their order in doubt: on a photo, a tilt moves the
points of its neighbour as a base does; with an end lap of 80 % and a long lens a tilt of 5 degrees is as large as half
a base. The layout of the photos is a cheap screen; what it speaks against is looked at with the pair oriented, which
keeps base and tilt apart.

**A strip on its control**: the errors of a strip by those of its image coordinates are known, all of them together, so
that a strip which bends as they let it contradicts nothing. Under each reading the strip is laid on its control by a
similarity, and what no other control predicts is taken out, as a run with polynomials does (``control_screening``).
Points far away from all others are predicted and take no part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import GeometryError, InputError, PhotostripError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.similarity import Similarity
from photostrip.network.reliability import coordinates_of, joint_cofactors
from photostrip.notes import Finding
from photostrip.pipeline.formed_models import OVER, LinkedModels
from photostrip.pipeline.formed_photos import FormedPhotos, form_strip
from photostrip.pipeline.frames import PhotoCoordinates
from photostrip.pipeline.given_points import cartesian_of, rows_of_given
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.strip_method import OrientedStrip, orient_on_control, strip_at_control
from photostrip.plausibility import accepted, flight, units
from photostrip.plausibility.given_points import far_away
from photostrip.points import ControlPoints, PhotoPoints, take_rows
from photostrip.strip import corrections
from photostrip.strip.control_screening import (
    BENT,
    FoundErrors,
    JointAdjustment,
    StripAtControl,
    adjust,
    first_search,
    kept_of,
    majority,
    search,
)
from photostrip.strip.relative_orientation import collect_pairs, orient_unchecked, unusable_pairs


def form(strip: Strip, observations: PhotoPoints, settings: Settings) -> FormedPhotos | None:
    """Form a strip as a run does; None when a pair or a junction cannot be determined, or of a single photo."""
    if len(strip.photos) < 2:
        return None
    try:
        return form_strip(strip, observations, settings)
    except (GeometryError, InputError, np.linalg.LinAlgError):
        return None


def at_distance(strip: Strip, factor: float) -> Strip:
    """Return a strip whose camera has so many times its principal distance."""
    return replace(strip, camera=replace(strip.camera, principal_distance=strip.camera.principal_distance * factor))


def formed_at_distance(stage: FormedPhotos, factor: float, settings: Settings) -> FormedPhotos | None:
    """Form a strip again with so many times its principal distance, by the rays that it used; None where it cannot be.

    Nothing is searched for in it: that takes most of the time where the distance is wrong, and proves nothing.
    """
    strip = at_distance(stage.strip, factor)
    rays = take_rows(stage.observations, stage.rays_in_use, ("photo", "point", "xy", "sigma"))
    plain = replace(settings, relative=replace(settings.relative, screening="none"))
    try:
        oriented, converged = orient_unchecked(collect_pairs(rays, strip.photos, strip.camera.principal_distance))
        usable = not unusable_pairs(oriented, converged).any()
    except (GeometryError, np.linalg.LinAlgError):
        return None
    return form(strip, rays, plain) if usable else None


def up(stage: FormedPhotos) -> Floats:
    """Where the cameras look from, of length one."""
    mean = stage.formed.rotations[:, :, 2].mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12), float)


def depth(stage: FormedPhotos) -> Floats:
    """Height of every perspective centre above the points of its models, shape (n,)."""
    upwards, pair = up(stage), stage.orientation.pairs.pair
    height = stage.formed.model_xyz @ upwards
    good = np.isfinite(height) & stage.orientation.used
    count = np.maximum(np.bincount(pair[good], minlength=stage.orientation.pairs.size), 1)
    ground = np.bincount(pair[good], height[good], stage.orientation.pairs.size) / count
    centers = stage.formed.centers @ upwards
    return np.concatenate([centers[:1] - ground[:1], centers[1:] - ground])


def ideal(observations: PhotoPoints, cameras: Mapping[str, Camera], settings: Settings) -> PhotoPoints:
    """Image points free of distortion, without refraction, whose heights are not known; else as they are."""
    try:
        return corrections.refine(observations, cameras, replace(settings.refinement, refraction=False)).observations
    except InputError:
        return observations


LEAST_POINTS = 6  # one more than a pair has unknowns
PAIR_SIGMA0 = 0.01  # of a pair, over the principal distance: beyond it the base is no better known than by the layout


def closer_look(
    strip: Strip, observations: PhotoPoints, cameras: Mapping[str, Camera], settings: Settings
) -> Callable[[str, str], tuple[complex, complex] | None]:
    """Return a function that gives the directions in which two photos of a strip lie from each other.

    Returns of two photos, the direction towards the second on the first and towards the first on the second; None where
        the pair cannot be oriented well enough to say.
    """
    points: list[PhotoPoints] = []

    @cache
    def toward(one: str, other: str) -> tuple[complex, complex] | None:
        if not points:
            points.append(ideal(observations, cameras, settings))
        oriented = oriented_pair(points[0], (one, other), strip.camera.principal_distance)
        if oriented is None:
            return None
        base, turn = oriented
        back = -base @ turn
        return complex(base[0], base[1]), complex(back[0], back[1])

    return toward


def oriented_pair(points: PhotoPoints, photos: tuple[str, str], focal: float) -> tuple[Floats, Floats] | None:
    """Orient two photos: the base, and the rotation (3, 3) of the second in the first; None where that is too weak."""
    try:
        with np.errstate(all="ignore"):
            pairs = collect_pairs(points, photos, focal)
            if len(pairs.pair) < LEAST_POINTS:
                return None
            oriented, converged = orient_unchecked(pairs)
            doubtful = unusable_pairs(oriented, converged)
    except (GeometryError, np.linalg.LinAlgError):
        return None
    if doubtful[0] or not oriented.sigma0[0] < PAIR_SIGMA0 * focal:
        return None
    base, turn = (each[0] for each in oriented.relative)
    return base, turn


ALL_PHOTOS, ONE_PHOTO = "P101", "P102"  # image coordinates in another unit


@dataclass(frozen=True, eq=False)
class ImageEvidence:
    """What the image coordinates alone say."""

    findings: tuple[Finding, ...]
    observations: PhotoPoints  # image points with what was found put right, for further evidence only; mm, y up
    cameras: dict[str, Camera]  # camera of every photo
    strips: tuple[Strip, ...]  # the strips with their photos as they lie, each place once
    steps: dict[str, complex]  # centre of the next photo, as the photos lie, on each photo; mm, y up
    settings: Settings


def of_units(inputs: Inputs, settings: Settings, photo: PhotoCoordinates | None = None) -> tuple[Finding, ...]:
    """Look at how large image coordinates are, which no fault of other data hides.

    photo: image points in the system of the photo, where a run has them already.
    """
    return accepted(_photo_coordinates(inputs, settings, photo)[1], settings.accept)


def of_images(inputs: Inputs, settings: Settings, photo: PhotoCoordinates | None = None) -> ImageEvidence:
    """Look at image coordinates as far as that goes without adjusting anything.

    photo: image points in the system of the photo, where a run has them already.
    """
    cameras, (observations, findings, of_camera) = inputs.cameras, _photo_coordinates(inputs, settings, photo)
    factor = {name: of_camera[cameras[name].name] for name in observations.photo_ids}
    in_unit = _put_right(observations, factor, frozenset())
    orders = []
    for strip in inputs.strips:
        closer = closer_look(strip, in_unit, cameras, settings)
        of_order, order = flight.find_wrong_order(observations, strip.id, strip.photos, closer)
        findings += of_order
        orders.append(order)
    alone = {name for each in findings if each.code == ONE_PHOTO for name in each.photos}
    findings = [each for each in findings if each.code != ALL_PHOTOS or not alone.issuperset(each.photos)]
    for order in orders:
        factor |= {name: factor[name] / size for name, size in order.size.items()}
    mirrored = frozenset(name for order in orders for name in order.mirrored)
    steps = {
        name: factor.get(name, 1.0) * (step.conjugate() if name in mirrored else step)
        for order in orders
        for name, step in zip(order.photos, order.steps, strict=True)
    }
    return ImageEvidence(
        findings=tuple(findings),
        observations=_put_right(observations, factor, mirrored),
        cameras=cameras,
        strips=tuple(replace(strip, photos=order.photos) for strip, order in zip(inputs.strips, orders, strict=True)),
        steps=steps,
        settings=settings,
    )


def _photo_coordinates(
    inputs: Inputs, settings: Settings, photo: PhotoCoordinates | None
) -> tuple[PhotoPoints, list[Finding], dict[str, float]]:
    """Image points in the system of the photo, what marks and sizes say, and the factor that a camera's size asks for.

    Nothing is said where the marks give no such system: what is wrong with them stops the run.
    """
    cameras, oriented = inputs.cameras, None if photo is None else photo.interior
    observations = _on_listed_photos(inputs.observations, cameras) if photo is None else photo.observations
    if photo is None and inputs.fiducials is not None:
        from photostrip.strip import interior

        try:
            oriented = interior.orient(_on_listed_photos(inputs.fiducials, cameras), cameras, settings.interior)
            observations = interior.transform(observations, oriented)
        except (GeometryError, InputError):
            return observations, [], {camera.name: 1.0 for camera in cameras.values()}
    findings, factors = units.find_wrong_units(observations, cameras)
    if oriented is not None:
        findings += units.find_wrong_mark_units(oriented.scale_x, oriented.photo_ids)
    return observations, findings, factors


def _on_listed_photos(measured: PhotoPoints, cameras: dict[str, Camera]) -> PhotoPoints:
    """Leave out photos of no strip, whose camera nobody knows."""
    listed = [photo in cameras for photo in measured.photo_ids]
    if all(listed):
        return measured
    number, rows = np.cumsum(listed) - 1, np.flatnonzero(np.array(listed)[measured.photo])
    return replace(
        measured,
        photo_ids=tuple(photo for photo in measured.photo_ids if photo in cameras),
        photo=number[measured.photo[rows]],
        point=measured.point[rows],
        xy=measured.xy[rows],
        sigma=measured.sigma[rows],
    )


def _put_right(observations: PhotoPoints, factor: dict[str, float], mirrored: frozenset[str]) -> PhotoPoints:
    """Image points in millimetres and from the right side, as far as that is known."""
    by_photo = np.array([[factor[name], -factor[name] if name in mirrored else factor[name]] for name in factor])
    if not len(by_photo) or (by_photo == 1.0).all():
        return observations
    return replace(observations, xy=observations.xy * by_photo[observations.photo])


# cosine of what the mean axis of photos is off the vertical: oblique ones, too, look down upon the ground
LEAST_DOWN = 0.5
MIRROR = np.array([1.0, -1.0, 1.0])  # what y of the images counted the other way does to a strip
MOST_POINTS = 60  # control points that are looked at together: of more some are drawn, evenly along the strip
AS_FORMED = Similarity(1.0, np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class OnControl:
    """A strip on the control that it shows, under one reading of it."""

    points: ControlPoints  # as they are read, those far away among the others
    place: StripAtControl  # all of them at the strip, which was laid on those that count
    counted: StripAtControl  # those that are not far away
    kept: Flags  # (n, 3): coordinates that the others predict
    found: FoundErrors  # what they do not predict, far points aside
    oriented: OrientedStrip  # the strip as it was laid

    @cached_property
    def looks_down(self) -> bool | None:
        """Whether its photos look down upon the control; None of models without perspective centres."""
        stage = self.oriented.stage
        if isinstance(stage, LinkedModels) and not stage.formed.upright:
            return None
        axis = up(stage) if isinstance(stage, FormedPhotos) else np.array([0.0, 0.0, 1.0])
        return bool(self.oriented.absolute.similarity.rotation[2] @ axis > LEAST_DOWN)

    @property
    def centers(self) -> Floats:
        """Perspective centres (n, 3) of its photos, intermediate frame, metres."""
        return self.oriented.absolute.similarity(self.oriented.formed.centers)

    @cached_property
    def is_buried(self) -> bool:
        """Whether its photos do not look down, and their perspective centres lie below the control."""
        heights = self.centers[:, 2]
        return self.looks_down is False and bool(np.median(heights) < np.median(self.oriented.at_control[:, 2]))

    @cached_property
    def left(self) -> JointAdjustment:
        return self.found.left

    @property
    def variance(self) -> float:
        """Variance factor of what is left."""
        return self.left.squares / max(self.left.freedom, 1)

    @property
    def fits(self) -> bool:
        """Whether no more is wrong with the strip than some of its control, and never most of it."""
        most_stay = self.found.whole.allows(self.found.coordinates)
        return most_stay and self.left.freedom > 0 and self.variance <= BENT**2

    @cached_property
    def off(self) -> tuple[Floats, Floats]:
        """Given minus predicted by all others (n, 3), and standard deviations, metres; NaN where it took part."""
        place = self.place.coordinates
        gone = set(np.flatnonzero(~self.kept[place.point, place.axis]).tolist())
        off, sigma = np.full((2, len(self.points), 3), np.nan)
        if not gone:
            return off, sigma
        laid = self.place.laid_on(self.kept)
        whole = adjust(laid, laid.misclosures(), self.place.joint_covariance)
        for point in whole.points:
            part = [column for column in point if column in gone]
            if part:
                others = whole.without([column for column in gone if column not in part])
                where = place.point[part], place.axis[part]
                off[where] = -others.estimate(part)
                cofactor = others.cofactor(part).diagonal() * max(self.variance, 1.0)
                sigma[where] = np.sqrt(np.maximum(cofactor, 0.0)) / others.size[part]
        return off, sigma


@dataclass(frozen=True, eq=False)
class HeldStrip:
    """A formed strip, and the control points that it shows."""

    stage: FormedPhotos | LinkedModels
    given: Numbers  # (n,): rows of these in the table of given points
    rows: Numbers  # (n,): their rows in the strip's points
    settings: Settings
    of_other_hand: HeldStrip | None = None  # the strip whose mirror image it is

    @classmethod
    def of(cls, stage: FormedPhotos | LinkedModels, control: ControlPoints, settings: Settings) -> HeldStrip:
        rows = rows_of_given(control.ids, stage.formed.point, stage.point_ids)
        placed = np.asarray(np.isfinite(stage.formed.xyz).all(axis=1), bool)
        given = np.flatnonzero((rows >= 0) & placed[rows] & control.use.any(axis=1) & ~control.check)
        if len(given) > MOST_POINTS:
            xyz = stage.formed.xyz[rows[given]]
            along = np.argsort((xyz - xyz.mean(axis=0)) @ np.linalg.svd(xyz - xyz.mean(axis=0))[2][0], kind="stable")
            given = np.sort(given[along[np.linspace(0, len(given) - 1, MOST_POINTS).astype(np.intp)]])
        return cls(stage=stage, given=given, rows=rows[given], settings=settings)

    @cached_property
    def covariance(self) -> Floats:
        """Covariance (3 n, 3 n) of those points, in the unit of the strip, but for a similarity."""
        stage = self.stage
        if self.of_other_hand is not None:
            hand = np.tile(MIRROR, len(self.rows))
            return self.of_other_hand.covariance * np.outer(hand, hand)
        if isinstance(stage, FormedPhotos):
            errors = stage.errors(AS_FORMED)
            points = errors.points(self.rows)
            return errors.joint_covariance(points, errors.frames(points)[0]) * stage.excess
        joint = joint_cofactors(stage.network, coordinates_of(stage.network, stage.formed.point[self.rows]))
        return joint * stage.formed.links.factor

    @cached_property
    def mirrored(self) -> HeldStrip:
        """The strip that images of the other hand form: its mirror image, whichever axis of theirs was turned."""
        stage: FormedPhotos | LinkedModels = self.stage
        if isinstance(stage, FormedPhotos):
            formed = stage.formed
            turned = {name: getattr(formed, name) * MIRROR for name in ("xyz", "model_xyz", "centers")}
            rotations = formed.rotations * np.outer(MIRROR, MIRROR)
            stage = replace(stage, formed=replace(formed, rotations=rotations, **turned))
        else:
            turned = {name: getattr(stage.formed, name) * MIRROR for name in ("node_xyz", "model_xyz")}
            stage = replace(stage, formed=replace(stage.formed, **turned))
        return replace(self, stage=stage, of_other_hand=self)

    def at_distance(self, factor: float) -> HeldStrip | None:
        """Return the strip formed with so many times its principal distance; None of models, or where it cannot be."""
        if not isinstance(self.stage, FormedPhotos):
            return None
        stage = formed_at_distance(self.stage, factor, self.settings)
        if stage is None or not np.isin(self.stage.formed.point[self.rows], stage.formed.point).all():
            return None
        rows = np.searchsorted(stage.formed.point, self.stage.formed.point[self.rows])
        return HeldStrip(stage=stage, given=self.given, rows=rows, settings=self.settings)

    def read(
        self,
        control: ControlPoints,
        frames: Sequence[GroundFrame],
        aside: Flags | None = None,
        *,
        as_given: bool = False,
    ) -> OnControl | None:
        """Lay the strip on its control as it is read; None where that does not hold it, or no frame has such places.

        aside: (c, 3), coordinates of the table of given points that take no part.
        as_given: search as a run does, which finds much that is wrong, too.
        """
        points = control.take(self.given)
        moved = np.where(points.use, far_away(np.where(points.use, points.enu, np.nan), points.frame), 0.0)
        points = replace(points, enu=points.enu - moved)
        counts = points.use & (moved == 0.0).all(axis=1)[:, None]
        counts &= True if aside is None else ~aside[self.given]
        some = np.flatnonzero(counts.any(axis=1))
        counted = replace(points, use=counts).take(some)
        try:
            oriented = self._oriented(self._majority(counted, some, frames) if as_given else counted, frames)
            everything = np.arange(len(points))
            at_all, at_counted = self._at(oriented, points, everything), self._at(oriented, counted, some)
            found = search(at_counted) if as_given else first_search(at_counted)
            if found is None:
                return None
            kept = np.zeros_like(counts)
            kept[some] = kept_of(at_counted, found)
        except (PhotostripError, np.linalg.LinAlgError):
            return None
        return OnControl(points, at_all, at_counted, kept, found, oriented)

    def lies_on(self, control: ControlPoints, frames: Sequence[GroundFrame]) -> bool:
        """Whether the strip can be laid on its control at all, as that is read."""
        try:
            self._oriented(control.take(self.given), frames)
        except (PhotostripError, np.linalg.LinAlgError):
            return False
        return True

    def _majority(self, control: ControlPoints, some: Numbers, frames: Sequence[GroundFrame]) -> ControlPoints:
        """Control without the full points that go least with most of the others, to lay the strip on at first."""
        full = np.flatnonzero(control.use.all(axis=1))
        xyz = self.stage.formed.xyz[self.rows[some[full]]]
        kept = np.ones(len(control), bool)
        kept[full] = majority(xyz, cartesian_of(control.take(full), frames))
        return control.take(kept)

    def _oriented(self, control: ControlPoints, frames: Sequence[GroundFrame]) -> OrientedStrip:
        return orient_on_control(self.stage, control, frames, self.settings.absolute)

    def _at(self, oriented: OrientedStrip, points: ControlPoints, some: Numbers) -> StripAtControl:
        """Compare the strip with some of these points."""
        at = replace(oriented, control=points, control_rows=self.rows[some])
        at = replace(at, absolute=replace(oriented.absolute, axes=at.targets.axes(at.at_control)))
        found, similarity = at.misclosures, oriented.absolute.similarity
        turned = found.direction @ similarity.rotation * similarity.scale
        if isinstance(oriented.stage, LinkedModels) and oriented.stage.over:
            turned = turned * OVER
        place = some[found.point]
        block = self.covariance.reshape(len(self.rows), 3, len(self.rows), 3)[place][:, :, place]
        joint = np.einsum("wi,wivj,vj->wv", turned, block, turned) + np.diag(found.variance)
        return strip_at_control(at, (), lambda wanted: joint[np.ix_(wanted, wanted)])
