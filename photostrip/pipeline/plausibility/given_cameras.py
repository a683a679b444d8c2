"""Given positions and orientations of cameras against the control and against the strips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import from_angles
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.notes import Finding
from photostrip.pipeline.given_points import cartesian_of, rows_of_given
from photostrip.pipeline.inputs import GivenOrientations, Inputs, Strip
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.plausibility import flight, found
from photostrip.plausibility import flight as given_angles
from photostrip.points import ControlPoints, PhotoPoints, locate

LEAST_POINTS = 3  # points that carry a similarity
LEAST_BREADTH = 0.05  # second over first extent of control, below which it says nothing of the roll
MOST_REFITS = 4  # of leaving out what does not fit
KEPT_SIGMAS = 5.0  # middle misclosures within which a point goes with the others
MOST_HEIGHT_RATIO = 1.3  # flying height given over that of the photo scale, or the other way round, that is reported
LEAST_HEIGHTS = 3  # photos whose flying height is known from their scale
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
    sigma: float  # usual standard deviation of a coordinate, metres; 0 where none is stated


class LevelPlan(NamedTuple):
    """Perspective centres and control points in one level plane: east, north and height, metres."""

    key: str
    photos: tuple[str, ...]
    centers: Floats  # (n, 3)
    sigma: float
    ids: tuple[str, ...]
    control: Floats  # (c, 3)


class Shown(NamedTuple):
    """Image points of control."""

    photo: Numbers
    number: Numbers  # of the control point, in the level plane
    xy: Floats


def centers(
    inputs: Inputs,
    observations: PhotoPoints,
    strips: Sequence[Strip],
    directory: Path | None = None,
    *,
    starts: bool = False,
) -> Iterator[Finding]:
    """Look at given perspective centres: below the ground, at another height, with bases that jump.

    observations: image points in the system of the photo, mm.
    strips: the strips, their photos as they lie.
    starts: whether those that are only a start count as well: they may be far off, and matter where a run fails.
    """
    control = inputs.control.take(inputs.control.use.all(axis=1) & ~inputs.control.check)
    for given in _given_centers(inputs, starts=starts):
        if not given.photos:
            continue
        try:
            tied, target = tie_frames([given.frame, *inputs.frames], inputs.output or given.frame, directory=directory)
            plan = _level_plan(given, control, tied, target)
        except (GeometryError, InputError):
            continue  # what is wrong with the frames stops the run itself
        number = locate(observations.point_ids, plan.ids)[observations.point]
        rows = np.flatnonzero(number >= 0)
        shown = Shown(photo=observations.photo[rows], number=number[rows], xy=observations.xy[rows])
        for strip in strips:
            yield from _of_strip(strip, plan, shown, observations.photo_ids)


def _given_centers(inputs: Inputs, *, starts: bool) -> Iterator[GivenCenters]:
    positions, orientations = inputs.positions, inputs.orientations
    if positions is not None:
        whole = np.flatnonzero(positions.use.all(axis=1))
        photos = tuple(positions.photos[row] for row in whole)
        yield GivenCenters(
            key="camera_positions",
            frame=positions.frame,
            photos=photos,
            enu=positions.enu[whole],
            sigma=_usual(positions.sigma[whole]),
        )
    if orientations is not None and (orientations.observed or starts):
        whole = np.flatnonzero(np.isfinite(orientations.enu).all(axis=1))
        photos = tuple(orientations.photos[row] for row in whole)
        yield GivenCenters(
            key="orientations",
            frame=orientations.frame,
            photos=photos,
            enu=orientations.enu[whole],
            sigma=_usual(orientations.sigma[whole]),
        )


def _usual(sigma: Floats) -> float:
    stated = sigma[np.isfinite(sigma)]
    return float(np.median(stated)) if len(stated) else 0.0


def _level_plan(
    given: GivenCenters, control: ControlPoints, tied: Sequence[GroundFrame], target: GroundFrame
) -> LevelPlan:
    """Bring perspective centres and control points to one level plane with heights above the ellipsoid."""
    together = np.concatenate([tied[0].cartesian_from_ground(given.enu), cartesian_of(control, tied[1:])])
    middle = np.median(together, axis=0)
    level = (together - middle) @ target.level_axes_at(middle[None, :])[0].T
    if target.kind != "local":  # the Earth falls away from a plane
        level[:, 2] = target.geodetic(together)[:, 2]
    count = len(given.photos)
    return LevelPlan(
        key=given.key,
        photos=given.photos,
        centers=level[:count],
        sigma=given.sigma,
        ids=control.ids,
        control=level[count:],
    )


def _of_strip(strip: Strip, plan: LevelPlan, shown: Shown, photo_ids: Sequence[str]) -> Iterator[Finding]:
    rows = locate(strip.photos, plan.photos)
    photos = tuple(photo for photo, row in zip(strip.photos, rows, strict=True) if row >= 0)
    if not photos:
        return
    xyz = plan.centers[rows[rows >= 0]]
    height, ratio = _ground_below(locate(photos, photo_ids), xyz, plan, shown, strip.camera.principal_distance)
    usual = float(np.ptp(xyz[:, :2], axis=0).max())
    depth = xyz[:, 2] - height if np.isfinite(height).all() else np.full(len(photos), max(usual, 1.0))
    findings = list(flight.find_odd_centers(xyz, depth, np.array([0.0, 0.0, 1.0]), photos, strip.id, plan.sigma))
    below = {photo for each in findings if each.code == "P204" for photo in each.photos}
    known = np.isfinite(ratio) & (depth > 0)
    times = np.median(ratio[known]) if known.sum() >= LEAST_HEIGHTS else 1.0
    if not below and not 1.0 / MOST_HEIGHT_RATIO < times < MOST_HEIGHT_RATIO:
        findings = [_other_height(strip, plan, photos, depth[known], depth[known] / ratio[known])]
    for each in findings:
        fix = FIXES[each.code] if each.code != "P205" or len(each.photos) == 1 else each.fix
        yield replace(each, message=f"{plan.key}: {each.message}", fix=fix, key=plan.key)


def _ground_below(
    photos: Numbers, centers: Floats, plan: LevelPlan, shown: Shown, focal: float
) -> tuple[Floats, Floats]:
    """Height of the ground under each photo, and how many times too far its centre is given from the control it shows.

    The angles between rays say that, whichever way the camera looks.
    """
    height, ratio = np.full(len(photos), np.nan), np.full(len(photos), np.nan)
    order = np.argsort(shown.photo, kind="stable")
    first, last = np.searchsorted(shown.photo[order], photos), np.searchsorted(shown.photo[order], photos, "right")
    for place in np.flatnonzero(first < last).tolist():
        rows = order[first[place] : last[place]]
        ground = plan.control[shown.number[rows]]
        height[place] = np.median(ground[:, 2])
        given = _spread(ground - centers[place])
        measured = _spread(np.column_stack([shown.xy[rows], np.full(len(rows), -focal)]))
        ratio[place] = measured / given if len(rows) > 1 and given > 0 and measured > 0 else np.nan
    known = np.isfinite(height)
    if known.any():
        height = np.interp(np.arange(len(photos)), np.flatnonzero(known), height[known])
    return height, ratio


def _spread(rays: Floats) -> float:
    """Spread of directions."""
    unit = rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
    return float(np.sqrt(((unit - unit.mean(axis=0)) ** 2).sum()))


def _other_height(strip: Strip, plan: LevelPlan, photos: Sequence[str], depth: Floats, wanted: Floats) -> Finding:
    message = (
        f"the perspective centres of strip {strip.id} are given {np.median(depth):.4g} m above the control, and the "
        f"scale of the photos requires {np.median(wanted):.4g} m"
    )
    numbers = {"given_above_control_m": np.median(depth), "by_photo_scale_m": np.median(wanted)}
    fix = "are their heights in another unit, or of another vertical datum? or is the principal distance wrong?"
    return found("P205", message, fix, numbers, photos=photos, strips=(strip.id,), key=plan.key)


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
