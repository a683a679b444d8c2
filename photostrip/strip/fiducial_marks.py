"""Measured fiducial marks as arrays, and whether they form the pattern of their camera.

Residuals cannot show everything that goes wrong with marks: four at the corners of a square fit just as well when
two opposite ones are exchanged. So the pattern is looked at before anything is fitted, with a conformal
transformation in both hands.

Coordinates of fiducial marks from the distances between them, where an old certificate has nothing else.

Distances fix the figure of the marks, not where it lies. Its place comes from nominal coordinates, or from the words
that say where on the photo a mark is: then the lines between opposite marks meet in the origin, as on the camera, and
the figure is turned as little as possible against the words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import Fault, InputError
from photostrip.geometry import plane
from photostrip.points import PhotoPoints, take_rows

WRONG_PATTERN = 0.05  # largest misfit over radius of the marks: film and paper stay far below, wrong numbers far above
QUARTER = np.pi / 2
KEY = "fiducial_measurements"


@dataclass(frozen=True, eq=False)
class Marks:
    """Marks of the photos of one camera; a mark that was not measured has weight zero."""

    camera: Camera
    # photos, names: photos (p) and marks (m)
    photos: tuple[str, ...]
    names: tuple[str, ...]
    calibrated: Floats  # (m, 2): calibrated coordinates, mm
    measured: Floats  # (p, m, 2): measured coordinates
    weights: Floats  # (p, m): weights, of mean 1 over the marks of each photo
    mirrored: bool = False  # whether the measured system is left-handed against that of the camera

    @property
    def count(self) -> Numbers:
        return np.asarray((self.weights > 0).sum(1), np.intp)

    def take(self, rows: Flags) -> Marks:
        return take_rows(self, rows, ("photos", "measured", "weights"))

    def on_photo(self, row: int) -> tuple[str, ...]:
        return tuple(name for name, weight in zip(self.names, self.weights[row], strict=True) if weight > 0)


@dataclass(frozen=True, eq=False)
class Pattern:
    """How marks lie against the calibrated ones, by a conformal transformation in one hand."""

    misfit: Floats  # (p,): largest residual over the root mean square distance of the marks from their mean
    largest: Floats  # (p,): largest residual, mm
    rotation: Floats  # (p,): direction of the measured x axis in the photo system, radians


def gather(fiducials: PhotoPoints, camera: Camera, photos: tuple[str, ...]) -> tuple[Marks, list[Fault]]:
    """Put the marks of the photos of one camera into arrays; faults for unknown marks and marks measured twice."""
    names = tuple(camera.fiducials)
    row_of = {photo: row for row, photo in enumerate(photos)}
    column_of = {name: column for column, name in enumerate(names)}
    rows = np.array([row_of.get(photo, -1) for photo in fiducials.photo_ids], np.intp)[fiducials.photo]
    columns = np.array([column_of.get(name, -1) for name in fiducials.point_ids], np.intp)[fiducials.point]
    faults = [
        fault(
            "unknown-mark",
            f"photo {photos[rows[i]]}: camera {camera.name} has no mark {fiducials.point_ids[fiducials.point[i]]}",
            expected=f"one of {', '.join(names)}",
        )
        for i in np.flatnonzero((rows >= 0) & (columns < 0))
    ]
    good = (rows >= 0) & (columns >= 0)
    place = rows[good], columns[good]
    times = np.zeros((len(photos), len(names)), np.intp)
    np.add.at(times, place, 1)
    faults += [
        fault("mark-twice", f"photo {photos[i]}: mark {names[j]} is measured {times[i, j]} times", fix="keep one row")
        for i, j in np.argwhere(times > 1)
    ]
    measured, weights = np.zeros((*times.shape, 2)), np.zeros(times.shape)
    measured[place] = fiducials.xy[good]
    weights[place] = 1 / (fiducials.sigma[good] ** 2).mean(1)
    weights *= (times.sum(1) / np.where(times.any(1), weights.sum(1), 1.0))[:, None]
    calibrated = np.array(list(camera.fiducials.values()), float).reshape(-1, 2)
    return Marks(
        camera=camera, photos=photos, names=names, calibrated=calibrated, measured=measured, weights=weights
    ), faults


def enough(marks: Marks, kind: str) -> tuple[Marks, list[Fault]]:
    """Keep the photos with enough marks in different places for a kind of transformation; faults for the others."""
    needed = plane.KINDS["conformal" if kind == "auto" else kind].least_points
    name = "an interior orientation" if kind == "auto" else f"the {kind} transformation"
    faults = []
    for row in np.flatnonzero(marks.count < needed).tolist():
        found = marks.on_photo(row)
        text = f"{len(found)} ({', '.join(found)})" if found else "none"
        message = f"photo {marks.photos[row]}: {name} needs {needed} fiducial marks, measured: {text}"
        faults.append(
            fault("too-few-marks", message, fix=f"marks of camera {marks.camera.name}: {', '.join(marks.names)}")
        )
    kept = marks.take(marks.count >= needed)
    apart = plane.strength("conformal", kept.measured, kept.weights) > 0
    faults += [
        fault("marks-in-one-place", f"photo {kept.photos[row]}: all fiducial marks have the same coordinates")
        for row in np.flatnonzero(~apart).tolist()
    ]
    return kept.take(apart), faults


def right_pattern(marks: Marks) -> tuple[Marks, list[Fault]]:
    """Find the hand of the measured system, and the photos whose marks are not where their numbers say.

    The hand is that of most photos of the camera. A photo of the other hand is refused: it may have been scanned from
    the other side or have two marks exchanged, and the residuals are equally small in both cases.

    Returns the marks of the photos in which they lie as calibrated, at least two on each, and one fault for each of the
    other photos, with the mark that seems wrongly numbered.
    """
    if not marks.photos:
        return marks, []
    direct, turned = (_pattern(marks.measured, marks.weights, marks.calibrated, mirrored=m) for m in (False, True))
    distinct = np.maximum(direct.misfit, turned.misfit) > WRONG_PATTERN  # else the marks fit in both hands
    hand = distinct & (turned.misfit < direct.misfit)
    fits = np.minimum(direct.misfit, turned.misfit) <= WRONG_PATTERN
    votes = hand[distinct & fits]
    camera_hand = bool(2 * votes.sum() > len(votes))
    right = fits & ((hand == camera_hand) | ~distinct)
    pattern = turned if camera_hand else direct
    quarters = np.round(pattern.rotation[right] / QUARTER).astype(int) % 4
    usual = int(np.bincount(quarters, minlength=4).argmax()) * QUARTER
    faults = [
        _wrong_numbers(marks, row, usual, mirrored=camera_hand, off=pattern.largest[row], alone=bool(fits[row]))
        for row in np.flatnonzero(~right).tolist()
    ]
    return replace(marks.take(right), mirrored=camera_hand), faults


def _pattern(measured: Floats, weights: Floats, calibrated: Floats, *, mirrored: bool) -> Pattern:
    """Compare measured marks (..., m, 2) with the calibrated ones of their numbers."""
    flip = np.array([1.0, -1.0 if mirrored else 1.0])
    fit = plane.conformal_from_points(measured * flip, calibrated, weights)
    distances = np.linalg.norm(fit.residuals(measured * flip, calibrated), axis=-1)
    used = weights > 0
    count = used.sum(-1)
    target = np.broadcast_to(calibrated, (*weights.shape, 2))
    center = (used[..., None] * target).sum(-2) / count[..., None]
    square = (used * ((target - center[..., None, :]) ** 2).sum(-1)).sum(-1) / count
    rotation = np.arctan2(fit.coefficients[..., 1, 0], fit.coefficients[..., 0, 0])
    largest = np.where(used, distances, 0.0).max(-1)
    return Pattern(largest / np.sqrt(square), largest, rotation)


def _wrong_numbers(marks: Marks, row: int, usual: float, *, mirrored: bool, off: float, alone: bool) -> Fault:
    photo, camera = marks.photos[row], marks.camera.name
    begin = f"photo {photo}: the fiducial marks "
    if alone:
        begin += f"are mirrored against the other photos of camera {camera}"
    else:
        begin += f"do not form the pattern of camera {camera}: up to {off:.1f} mm off"
    change = _renumbering(marks, row, usual, mirrored=mirrored) or _stranger(marks, row, mirrored=mirrored)
    if change:
        text, left = change
        return fault("wrong-mark", f"{begin}; {text} the largest residual is {left:.3f} mm", fix="check the marks")
    fix = "scan the photo from the same side as the others" if alone else "check numbers and coordinates of the marks"
    return fault("wrong-mark", begin, fix=fix)


def _renumbering(marks: Marks, row: int, usual: float, *, mirrored: bool) -> tuple[str, float] | None:
    """Find two marks that fit when exchanged, or one that fits with the number of a mark not measured."""
    present = np.flatnonzero(marks.weights[row] > 0)
    absent = np.flatnonzero(marks.weights[row] == 0)
    if len(present) < 3:
        return None
    trials, texts = [], []
    for i, j in combinations(range(len(present)), 2):
        trial = present.copy()
        trial[[i, j]] = trial[[j, i]]
        trials.append(trial)
        texts.append(f"with {marks.names[present[i]]} and {marks.names[present[j]]} exchanged")
    for i in range(len(present)):
        for other in absent:
            trial = present.copy()
            trial[i] = other
            trials.append(trial)
            texts.append(f"with {marks.names[present[i]]} called {marks.names[other]}")
    shape = (len(trials), len(present))
    measured = np.broadcast_to(marks.measured[row, present], (*shape, 2))
    found = _pattern(measured, np.ones(shape), marks.calibrated[np.array(trials)], mirrored=mirrored)
    if found.misfit.min() > WRONG_PATTERN:
        return None
    # Several exchanges can restore the square, turned by a quarter: the photo most likely lies as the others do.
    away = np.abs(np.angle(np.exp(1j * (found.rotation - usual))))
    best = int(np.argmin(np.where(found.misfit <= WRONG_PATTERN, away, np.inf)))
    return texts[best], float(found.largest[best])


def _stranger(marks: Marks, row: int, *, mirrored: bool) -> tuple[str, float] | None:
    """Find one mark without which the others fit."""
    present = np.flatnonzero(marks.weights[row] > 0)
    if len(present) < 4:
        return None
    shape = (len(present), len(present))
    measured = np.broadcast_to(marks.measured[row, present], (*shape, 2))
    found = _pattern(measured, 1 - np.eye(len(present)), marks.calibrated[present], mirrored=mirrored)
    best = int(np.argmin(found.misfit))
    if found.misfit[best] > WRONG_PATTERN:
        return None
    return f"without {marks.names[present[best]]}", float(found.largest[best])


def fault(code: str, message: str, *, expected: str = "", fix: str = "") -> Fault:
    """Return a fault with the key of the measured marks in the project file."""
    return Fault(message, code=code, key=KEY, expected=expected, fix=fix)


PLACES = {
    f"{vertical}-{horizontal}".strip("-"): (x, y)
    for vertical, y in (("bottom", -1.0), ("", 0.0), ("top", 1.0))
    for horizontal, x in (("left", -1.0), ("", 0.0), ("right", 1.0))
    if (x, y) != (0.0, 0.0)
}
POOR_FIT = 0.03  # mm; distances were measured to a hundredth
LOOSE_FIGURE = 1e-4  # relative size of a singular value below which the figure can change without changing a distance
CONVERGED = 1e-10  # mm
ITERATIONS = 50


@dataclass(frozen=True, eq=False)
class Certificate:
    """Marks solved from distances."""

    marks: dict[str, tuple[float, float]]  # coordinates by mark, mm
    residuals: Floats  # (d,): computed minus given distances, mm
    sigma0: float  # standard deviation of a distance, mm; NaN without redundancy
    redundancy: int  # distances more than the figure needs


def solve(
    distances: Sequence[tuple[str, str, float]],
    *,
    nominal: Mapping[str, tuple[float, float]] | None = None,
    places: Mapping[str, str] | None = None,
) -> Certificate:
    """Coordinates of fiducial marks, mm, from measured distances: least squares with all distances of equal weight.

    distances: two marks and the distance between them, mm.
    nominal: nominal coordinates of the marks, mm: a start, and the place of the figure.
    places: instead, where on the photo each mark is: a key of ``PLACES``.
    Raises InputError with a fault for each distance between marks that are not known or not two, and when the distances
        do not fix the figure, or contradict each other so much that there is none.

    Source: derived; trilateration with inner constraints.
    """
    start = {name: PLACES[place] for name, place in (places or {}).items()} if nominal is None else dict(nominal)
    names = list(start)
    ends, given = _distances(distances, names)
    xy = np.array(list(start.values()), float)
    unit = xy
    if nominal is None:
        lengths = np.linalg.norm(np.subtract(*np.moveaxis(xy[ends], 1, 0)), axis=1)
        xy = xy * float(given.sum() / lengths.sum())
        xy = _turned(_adjusted(xy, ends, given), unit)
    else:  # shifted and turned to lie on the nominal coordinates
        mean = xy.mean(axis=0)
        figure = _adjusted(xy, ends, given)
        xy = _turned(figure, unit - mean, figure.mean(axis=0)) + mean
    residuals = _lengths(xy, ends)[0] - given
    redundancy = len(given) - (2 * len(names) - 3)
    sigma0 = float(np.sqrt((residuals**2).sum() / redundancy)) if redundancy else float("nan")
    marks = {name: (float(x), float(y)) for name, (x, y) in zip(names, xy, strict=True)}
    return Certificate(marks=marks, residuals=residuals, sigma0=sigma0, redundancy=redundancy)


def _distances(distances: Sequence[tuple[str, str, float]], names: list[str]) -> tuple[Numbers, Floats]:
    """Return the marks at both ends of each distance, (d, 2), and the distances; unknown marks are refused."""
    faults = []
    for number, (first, second, _) in enumerate(distances):
        unknown = [name for name in (first, second) if name not in names]
        if unknown:
            message, expected = f"the camera has no mark {unknown[0]}", f"one of {', '.join(names)}"
            faults.append(Fault(message, code="unknown-mark", key=f"fiducial_distances[{number}]", expected=expected))
        elif first == second:
            message = f"a distance from mark {first} to itself"
            faults.append(Fault(message, code="certificate", key=f"fiducial_distances[{number}]"))
    if faults:
        raise InputError(faults)
    ends = np.array([[names.index(first), names.index(second)] for first, second, _ in distances], np.intp)
    return ends.reshape(-1, 2), np.array([length for *_, length in distances], float)


def _lengths(xy: Floats, ends: Numbers) -> tuple[Floats, Floats]:
    """Distances, and their derivatives by all coordinates, shape (d, 2 n)."""
    arms = xy[ends[:, 1]] - xy[ends[:, 0]]
    lengths = np.linalg.norm(arms, axis=1)
    design = np.zeros((len(ends), len(xy), 2))
    rows = np.arange(len(ends))
    design[rows, ends[:, 1]] = arms / lengths[:, None]
    design[rows, ends[:, 0]] = -arms / lengths[:, None]
    return lengths, design.reshape(len(ends), -1)


def _adjusted(xy: Floats, ends: Numbers, given: Floats) -> Floats:
    """Least squares with inner constraints: the figure moves as little as possible from where it started."""
    unknowns = 2 * len(xy) - 3
    for _ in range(ITERATIONS):
        lengths, design = _lengths(xy, ends)
        values = np.linalg.svd(design, compute_uv=False)
        rank = int((values > LOOSE_FIGURE * values[:1]).sum())
        if rank < unknowns:
            message = f"{rank} independent distances do not fix a figure of {len(xy)} marks; it takes {unknowns}"
            fix = "give a diagonal, or distances of the loose mark to two others"
            raise InputError(Fault(message, code="certificate", key="fiducial_distances", fix=fix))
        step = np.linalg.lstsq(design, given - lengths, rcond=LOOSE_FIGURE)[0]
        xy = xy + step.reshape(-1, 2)
        if np.abs(step).max() <= CONVERGED:
            return xy
    message = "the distances between the fiducial marks contradict each other: no figure has them"
    fix = "check which marks each distance joins, and its digits"
    raise InputError(Fault(message, code="certificate", key="fiducial_distances", fix=fix))


def _turned(xy: Floats, unit: Floats, centre: Floats | None = None) -> Floats:
    """Turn the figure about its centre as its marks should lie."""
    xy = xy - (_centre(xy, unit) if centre is None else centre)
    along, across = (xy * unit).sum(), (xy[:, 0] * unit[:, 1] - xy[:, 1] * unit[:, 0]).sum()
    cos, sin = np.array([along, across]) / np.hypot(along, across)
    return np.asarray(xy @ np.array([[cos, sin], [-sin, cos]]), np.float64)


def _centre(xy: Floats, unit: Floats) -> Floats:
    """Where the lines between opposite marks meet; the mean of the marks when no two pairs are opposite."""
    pairs = [(i, j) for i, j in combinations(range(len(xy)), 2) if (unit[i] == -unit[j]).all()]
    if len(pairs) < 2:
        return np.asarray(xy.mean(axis=0), np.float64)
    first, second = xy[[i for i, _ in pairs]], xy[[j for _, j in pairs]]
    along = (second - first) / np.linalg.norm(second - first, axis=1, keepdims=True)
    across = np.eye(2) - along[:, :, None] * along[:, None, :]
    return np.asarray(np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, first)), np.float64)
