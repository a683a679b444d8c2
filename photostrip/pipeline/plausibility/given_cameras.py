"""Given positions and orientations of cameras against the control and against the strips."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.errors import PhotostripError
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.triangulation.plausibility import found
from photostrip.triangulation.plausibility.photos import flight
from photostrip.triangulation.plausibility.photos import rotations as rotations_given

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.geodesy.frame_spec import FrameSpec
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Inputs, Strip
    from photostrip.pipeline.plausibility.evidence import Formed
    from photostrip.points import ControlPoints, PhotoPoints

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

LEAST = 3  # points that carry a similarity
ON_A_LINE = 0.05  # second over first extent of control, below which it says nothing of the roll
ROUNDS = 4  # of leaving out what does not fit
KEPT = 5.0  # middle misclosures within which a point goes with the others
HIGHER = 1.3  # flying height given over that of the photo scale, or the other way round, that is told
FEWEST_HEIGHTS = 3  # photos whose flying height is known from their scale
FIXES = {
    "P204": "are the positions heights above the ground, in another unit, or of another vertical datum than the "
    "control?",
    "P205": "is the height of that row right, and does it belong to that photo?",
    "P206": "are positions missing, or do some belong to other photos?",
    "P207": "do some positions belong to other photos, or does the strip bend there?",
}


class Placed(NamedTuple):
    """Given perspective centres, level."""

    key: str  # where they stand in the project file
    photos: tuple[str, ...]
    xyz: Floats  # (n, 3): east, north and height, metres


def centers(
    inputs: Inputs, observations: PhotoPoints, strips: Sequence[Strip], directory: Path | None = None
) -> Iterator[Finding]:
    """Look at given perspective centres: below the ground, at another height, with bases that jump.

    Parameters
    ----------
    observations : PhotoPoints
        Image points in the system of the photo, mm.
    strips : sequence of Strip
        The strips, their photos as they lie.
    """
    control = inputs.control
    for key, given, whole in _lists(inputs):
        spec, photos, enu = given
        if not len(whole):
            continue
        try:
            tied, target = tie_frames([spec, *inputs.frames], inputs.output or spec, directory=directory)
            rows = np.flatnonzero(control.use.all(axis=1) & ~control.check)
            placed = Placed(key, tuple(photos[row] for row in whole.tolist()), np.zeros((0, 3)))
            level, ground = _level(tied, target, enu[whole], control.take(rows))
        except (PhotostripError, ArithmeticError, ValueError):
            continue  # what is wrong with the frames is told elsewhere
        placed = placed._replace(xyz=level)
        for strip in strips:
            yield from _of_strip(strip, placed, control.take(rows).ids, ground, observations)


def _lists(inputs: Inputs) -> Iterator[tuple[str, tuple[FrameSpec, tuple[str, ...], Floats], Numbers]]:
    """Give lists of perspective centres with the rows that are given in full."""
    positions, orientations = inputs.positions, inputs.orientations
    if positions is not None:
        whole = np.flatnonzero(positions.use.all(axis=1))
        yield "camera_positions", (positions.frame, positions.photos, positions.enu), whole
    if orientations is not None:
        whole = np.flatnonzero(np.isfinite(orientations.enu).all(axis=1))
        yield "orientations", (orientations.frame, orientations.photos, orientations.enu), whole


def _level(
    tied: Sequence[GroundFrame], target: GroundFrame, enu: Floats, control: ControlPoints
) -> tuple[Floats, Floats]:
    """Bring perspective centres and control points to one level plane with heights above the ellipsoid."""
    cartesian = tied[0].cartesian_from_ground(enu)
    given = np.zeros((len(control), 3))
    for number, frame in enumerate(tied[1:]):
        rows = control.frame == number
        if rows.any():
            given[rows] = frame.cartesian_from_ground(control.enu[rows])
    together = np.concatenate([cartesian, given])
    if not len(together):
        return np.zeros((0, 3)), np.zeros((0, 3))
    middle = np.median(together, axis=0)
    level = (together - middle) @ target.level_axes_at(middle[None, :])[0].T
    if target.kind != "local":  # the Earth falls away from a plane
        level[:, 2] = target.geodetic(together)[:, 2]
    return level[: len(cartesian)], level[len(cartesian) :]


def _of_strip(
    strip: Strip, placed: Placed, ids: Sequence[str], ground: Floats, observations: PhotoPoints
) -> Iterator[Finding]:
    row_of = {photo: row for row, photo in enumerate(placed.photos)}
    photos = tuple(photo for photo in strip.photos if photo in row_of)
    if not photos:
        return
    xyz = placed.xyz[[row_of[photo] for photo in photos]]
    height, scale = _under(photos, ids, ground, observations)
    usual = float(np.ptp(xyz[:, :2], axis=0).max())
    depth = xyz[:, 2] - height if np.isfinite(height).all() else np.full(len(photos), max(usual, 1.0))
    told = list(flight.examine(xyz, depth, np.array([0.0, 0.0, 1.0]), photos, strip.id))
    below = {photo for each in told if each.code == "P204" for photo in each.photos}
    wanted = scale * strip.camera.principal_distance
    known = (wanted > 0) & (depth > 0) & np.isfinite(height)
    if not below and known.sum() >= FEWEST_HEIGHTS:
        ratio = float(np.median(depth[known] / wanted[known]))
        if not 1.0 / HIGHER < ratio < HIGHER:
            told = [_other_height(strip, placed, photos, depth[known], wanted[known])]
    for each in told:
        fix = FIXES[each.code] if each.code != "P205" or len(each.photos) == 1 else each.fix
        yield replace(each, message=f"{placed.key}: {each.message}", fix=fix, key=placed.key)


def _under(
    photos: Sequence[str], ids: Sequence[str], ground: Floats, observations: PhotoPoints
) -> tuple[Floats, Floats]:
    """Height of the ground under each photo, and metres on the ground in a millimetre of the photo."""
    height, scale = np.full(len(photos), np.nan), np.full(len(photos), np.nan)
    row_of = {name: row for row, name in enumerate(ids)}
    given = np.array([row_of.get(name, -1) for name in observations.point_ids], np.intp)
    number = {photo: place for place, photo in enumerate(observations.photo_ids)}
    for place, photo in enumerate(photos):
        rows = np.flatnonzero((observations.photo == number.get(photo, -1)) & (given[observations.point] >= 0))
        if not len(rows):
            continue
        here = ground[given[observations.point[rows]]]
        height[place] = np.median(here[:, 2])
        far = _spread(observations.xy[rows])
        scale[place] = _spread(here[:, :2]) / far if len(rows) > 1 and far > 0 else np.nan
    known = np.isfinite(height)
    if known.any():
        height = np.interp(np.arange(len(photos)), np.flatnonzero(known), height[known])
    return height, scale


def _spread(points: Floats) -> float:
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum()))


def _other_height(strip: Strip, placed: Placed, photos: Sequence[str], depth: Floats, wanted: Floats) -> Finding:
    message = (
        f"the perspective centres of strip {strip.id} are given {np.median(depth):.4g} m above the control, and the "
        f"scale of the photos asks for {np.median(wanted):.4g} m"
    )
    evidence = {"given_above_control_m": float(np.median(depth)), "by_photo_scale_m": float(np.median(wanted))}
    fix = "are their heights in another unit, or of another vertical datum? or is the principal distance wrong?"
    return found("P205", message, fix, evidence, photos=photos, strips=(strip.id,), key=placed.key)


# ------------------------------------------------------------------------------------------------- given angles


def angles(
    inputs: Inputs,
    formed: Sequence[Formed],
    observations: PhotoPoints,
    directory: Path | None = None,
) -> list[Finding]:
    """Compare given angles with those of strips that are laid on their control, whatever an adjustment made of them.

    Returns
    -------
    list of Finding
        P601, P602.
    """
    given = inputs.orientations
    if given is None:
        return []
    try:
        tied, _ = tie_frames([given.frame, *inputs.frames], inputs.output or given.frame, directory=directory)
        laid = [(each, _on_control(each, observations, inputs.control, tied[1:])) for each in formed]
        turned = {
            photo: rotation
            for each, similarity in laid
            if similarity is not None
            for photo, rotation in zip(each.strip.photos, _rotations(each, similarity, tied[0]), strict=True)
        }
    except (PhotostripError, ArithmeticError, ValueError):
        return []
    rows = [row for row, photo in enumerate(given.photos) if photo in turned]
    if not rows:
        return []
    photos = [given.photos[row] for row in rows]
    rotations = np.array([turned[photo] for photo in photos])
    return list(rotations_given.examine(given.angles[rows], given.system, rotations, photos))


def _rotations(formed: Formed, similarity: Similarity, frame: GroundFrame) -> Floats:
    axes = frame.axes_at(similarity(formed.formed.centers))
    return np.asarray(axes @ similarity.rotation @ formed.formed.rotations, float)


def _on_control(
    formed: Formed, observations: PhotoPoints, control: ControlPoints, frames: Sequence[GroundFrame]
) -> Similarity | None:
    """Similarity from the strip to its control; None where that does not hold all rotations."""
    strip = formed.formed
    number = {name: n for n, name in enumerate(observations.point_ids)}
    row_of = {int(n): row for row, n in enumerate(strip.point)}
    counts = control.use.all(axis=1) & ~control.check
    places = np.array([row_of.get(number.get(name, -1), -1) for name in control.ids], np.intp)
    rows = np.flatnonzero(counts & (places >= 0))
    source, target = strip.xyz[places[rows]], np.zeros((len(rows), 3))
    for each, frame in enumerate(frames):
        here = control.frame[rows] == each
        if here.any():
            target[here] = frame.cartesian_from_ground(control.enu[rows[here]])
    keep = np.ones(len(rows), bool)
    for _ in range(ROUNDS):
        if keep.sum() < LEAST or collinearity(target[keep]) < ON_A_LINE:
            return None
        similarity = Similarity.from_points(source[keep], target[keep])
        off = np.linalg.norm(similarity.residuals(source, target), axis=1)
        keep = off <= KEPT * max(float(np.median(off)), 1e-9)
    return similarity
