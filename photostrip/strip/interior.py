"""Interior orientation: from measured fiducial marks to photo coordinates.

A plane transformation takes the marks of a photo to their calibrated coordinates, and all its points with them. What it
leaves is film deformation, where that is asked for: interpolated from the residuals of the marks by a thin plate
spline, the surface that bends least. It takes the scatter of the marks for deformation, too, so it helps only where
film is deformed by more than marks are measured well, and where there are marks enough to see it, best eight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import Fault, InputError
from photostrip.geometry import plane
from photostrip.notes import Note, named
from photostrip.points import PhotoPoints
from photostrip.strip.corrections import InteriorSettings
from photostrip.strip.fiducial_marks import QUARTER, Marks, enough, fault, gather, right_pattern

SHAPE = ("scale_x", "scale_y", "rotation", "shear")
TUPLES, ARRAYS = ("photo_ids", "transforms", "marks", "residuals"), ("sigma0", "redundancy", *SHAPE, "mirrored")
LEAST_STRENGTH = 0.01  # strength of a transformation below which marks count as lying on one line
LEAST_MARKS = 4  # three carry the plane that every transformation has already
FLAT = 0.01  # ratio of the extents of the marks below which they stand on one line
MICROMETRE = 1e-3  # mm
POOR_FIT = 0.05  # mm; film that was stored well fits to a third of this
ODD_SCALE = 0.02  # departure of the scale from 1: pixel size or unit is not what was stated
STRONG_AFFINITY = 0.01  # departure of the ratio of the two scales from 1; film shrinks by a tenth of this
STRONG_SHEAR = np.radians(0.5)
SHOWN = 5  # ids in a sentence


def orient(fiducials: PhotoPoints, cameras: Mapping[str, Camera], settings: InteriorSettings) -> InteriorOrientation:
    """Interior orientation of all photos.

    fiducials: measured marks; ``point_ids`` are their names. The sigma of a row counts as one weight for both
        coordinates.
    cameras: camera of each photo of the project. Photos of cameras without fiducial marks are left as they are.
    Returns transformations in the order of `cameras`. Photos that were scanned turned or, all of one camera alike,
        mirrored are put right by the transformation, and a note says so.
    Raises InputError with one fault for each photo whose marks do not determine its transformation.
    """
    faults: list[Fault] = []
    notes: list[Note] = []
    parts: list[InteriorOrientation] = []
    for camera in {camera.name: camera for camera in cameras.values() if camera.fiducials}.values():
        photos = tuple(photo for photo, used in cameras.items() if used.name == camera.name)
        marks, wrong = gather(fiducials, camera, photos)
        faults += wrong
        marks, wrong = enough(marks, settings.transform)
        faults += wrong
        marks, wrong = right_pattern(marks)
        faults += wrong
        part, wrong = fit_marks(marks, settings.transform)
        faults += wrong
        parts.append(part)
        notes += notes_on_marks(part, camera)
    digital = tuple(photo for photo, camera in cameras.items() if not camera.fiducials)
    faults += marks_without_camera(fiducials, cameras, digital)
    if faults:
        raise InputError(faults)
    notes += marks_of_no_strip(fiducials, cameras)
    joined = joined_cameras(parts, tuple(cameras), digital, tuple(notes))
    return joined if settings.residuals == "ignore" else _with_film(joined, cameras)


def transform(observations: PhotoPoints, interior: InteriorOrientation) -> PhotoPoints:
    """Photo coordinates, in the system of the fiducial marks, of points measured in the system of the measured marks.

    Standard deviations go through the derivatives of the transformation; the correlation that a turn by half a quarter
    gives to x and y is dropped, and so is the uncertainty of the interior orientation, which all points of a photo
    share, and that of the interpolation. An ``InputError`` when a photo has no interior orientation.
    """
    number = {photo: row for row, photo in enumerate(interior.photo_ids)}
    known = number.keys() | set(interior.without_marks)
    if missing := [photo for photo in observations.photo_ids if photo not in known]:
        raise InputError([fault("marks-missing", f"photo {photo}: no fiducial marks measured") for photo in missing])
    rows = np.array([number.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]
    film = rows >= 0
    if not film.any():
        return observations
    photo_from_measured = interior.photo_from_measured.take(rows[film])
    points = observations.xy[film][:, None, :]
    xy, variance = observations.xy.copy(), observations.sigma**2
    xy[film] = photo_from_measured(points)[:, 0]
    if interior.film is not None:
        xy[film] = interior.film.corrected(rows[film], xy[film])
    variance[film] = (photo_from_measured.jacobian(points)[:, 0] ** 2 @ variance[film][:, :, None])[:, :, 0]
    return replace(observations, xy=xy, sigma=np.sqrt(variance))


def _with_film(joined: InteriorOrientation, cameras: Mapping[str, Camera]) -> InteriorOrientation:
    """Add the deformation that the residuals of the marks show."""
    marks = [
        np.array([cameras[photo].fiducials[name] for name in names], float).reshape(-1, 2)
        for photo, names in zip(joined.photo_ids, joined.marks, strict=True)
    ]
    film = FilmDeformation.from_residuals(marks, joined.residuals)
    unseen = film.unseen()
    if not len(unseen):
        return replace(joined, film=film)
    photos = tuple(joined.photo_ids[row] for row in unseen)
    message = f"residuals of fiducial marks cannot be interpolated on {named('photo', photos, SHOWN)}: fewer than "
    message += "four marks, or all on one line; film deformation stays in the coordinates"
    return replace(joined, film=film, notes=(*joined.notes, Note("film-unseen", message, photos=photos)))


@dataclass(frozen=True, eq=False)
class InteriorOrientation:
    """Transformations of photos and how well the marks fit."""

    photo_ids: tuple[str, ...]
    transforms: tuple[str, ...]
    # the transformations, coefficients of shape (p, 3, 4): measured coordinates to photo coordinates, mm
    photo_from_measured: plane.PlaneTransform
    marks: tuple[tuple[str, ...], ...]
    # (m, 2): transformed minus calibrated coordinates of these marks in the photo system, mm
    residuals: tuple[Floats, ...]
    sigma0: Floats  # (p,): standard deviation of a mark's coordinate of mean weight, mm; NaN without redundancy
    redundancy: Numbers  # (p,): coordinates measured minus unknowns
    # scale_x, scale_y: (p,): scales along the measured axes at the mean of the marks, photo over measured, positive
    scale_x: Floats
    scale_y: Floats
    # rotation, shear: (p,): direction of the measured x axis in the photo system, and departure of the measured y axis
    # from the right angle to it, both counter-clockwise (shear of mirrored photos: clockwise), radians
    rotation: Floats
    shear: Floats
    mirrored: Flags  # (p,): whether the measured system is left-handed against that of the camera
    # photos of cameras without fiducial marks: their coordinates are taken as they are
    without_marks: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()  # what the marks show beside the numbers
    film: FilmDeformation | None = None  # deformation beyond the transformations, when it is interpolated


def fit_marks(marks: Marks, kind: str) -> tuple[InteriorOrientation, list[Fault]]:
    """Fit the transformations of the photos of one camera."""
    kinds, faults = _kinds(marks, kind)
    coefficients = np.zeros((len(marks.photos), 3, 4))
    for each in plane.KINDS:
        rows = np.flatnonzero(kinds == each)
        if len(rows) == 0:
            continue
        # only a conformal transformation has to be told that it shall mirror; the others find it themselves
        flip = np.array([1.0, -1.0 if each == "conformal" and marks.mirrored else 1.0])
        target = np.broadcast_to(marks.calibrated, (len(rows), *marks.calibrated.shape))
        fit = plane.KINDS[each].fit(marks.measured[rows] * flip, target, marks.weights[rows])
        coefficients[rows] = fit.coefficients
        coefficients[rows, :, 1] *= flip[1]
    good = kinds != ""
    photo_from_measured = plane.PlaneTransform(coefficients[good])
    return _described(marks.take(good), tuple(kinds[good].tolist()), photo_from_measured), faults


def _kinds(marks: Marks, kind: str) -> tuple[NDArray[np.str_], list[Fault]]:
    """Choose the kind of transformation of each photo; an empty one and a fault where it cannot be determined."""
    if kind == "auto":
        affine = (marks.count >= 4) & ~_weak("affine", marks)
        return np.where(affine, "affine", "conformal"), []
    weak = _weak(kind, marks)
    why = "on one line" if kind == "affine" else "so that not all of its coefficients can be told"
    faults = [
        fault(
            "marks-in-line",
            f"photo {marks.photos[row]}: marks {', '.join(marks.on_photo(row))} lie {why}: no {kind} transformation",
            fix=f"use processing.interior.transform: {'conformal' if kind == 'affine' else 'affine'}",
        )
        for row in np.flatnonzero(weak).tolist()
    ]
    return np.where(weak, "", kind), faults


def _weak(kind: str, marks: Marks) -> Flags:
    return plane.strength(kind, marks.measured, marks.weights) < LEAST_STRENGTH


def _described(marks: Marks, kinds: tuple[str, ...], photo_from_measured: plane.PlaneTransform) -> InteriorOrientation:
    """Residuals, precision and shape of fitted transformations."""
    used = marks.weights > 0
    residuals = photo_from_measured.residuals(marks.measured, marks.calibrated)
    redundancy = 2 * marks.count - np.array([plane.KINDS[kind].unknowns for kind in kinds], np.intp)
    squares = (marks.weights[..., None] * residuals**2).sum((1, 2))
    centers = (used[..., None] * marks.measured).sum(1) / np.maximum(used.sum(1), 1)[:, None]
    linear = linear_shape(photo_from_measured.jacobian(centers[:, None])[:, 0])
    return InteriorOrientation(
        photo_ids=marks.photos,
        transforms=kinds,
        photo_from_measured=photo_from_measured,
        marks=tuple(marks.on_photo(row) for row in range(len(marks.photos))),
        residuals=tuple(residuals[row, used[row]] for row in range(len(marks.photos))),
        sigma0=np.sqrt(np.where(redundancy > 0, squares / np.maximum(redundancy, 1), np.nan)),
        redundancy=redundancy,
        **linear._asdict(),
        mirrored=np.full(len(marks.photos), marks.mirrored),
    )


class LinearShape(NamedTuple):
    """Scales, rotation and shear of linear transformations, each of shape (...), angles in radians."""

    scale_x: Floats
    scale_y: Floats
    rotation: Floats
    shear: Floats


def linear_shape(jacobian: Floats) -> LinearShape:
    """Scales, rotation and shear of the linear part (..., 2, 2) of transformations.

    ``jacobian = R(rotation) M [[scale_x, -scale_y sin(shear)], [0, scale_y cos(shear)]]``, where M turns the sign of y
    when the determinant is negative. Source: derived.
    """
    first, second = jacobian[..., 0], jacobian[..., 1]
    hand = np.where(np.linalg.det(jacobian) < 0, -1.0, 1.0)
    rotation = np.arctan2(first[..., 1], first[..., 0])
    cos, sin = np.cos(rotation), np.sin(rotation)
    along = cos * second[..., 0] + sin * second[..., 1]
    across = hand * (cos * second[..., 1] - sin * second[..., 0])
    return LinearShape(
        scale_x=np.hypot(*np.moveaxis(first, -1, 0)),
        scale_y=np.hypot(along, across),
        rotation=rotation,
        shear=np.arctan2(-along, across),
    )


def joined_cameras(
    parts: Sequence[InteriorOrientation], order: tuple[str, ...], digital: tuple[str, ...], notes: tuple[Note, ...]
) -> InteriorOrientation:
    """Put the photos of all cameras into the order of the project."""
    photos = [photo for part in parts for photo in part.photo_ids]
    place = {photo: number for number, photo in enumerate(order)}
    rows = sorted(range(len(photos)), key=lambda row: place[photos[row]])
    columns: dict[str, Any] = {
        name: tuple(each for part in parts for each in getattr(part, name)) for name in TUPLES + ARRAYS
    }
    columns = {name: tuple(column[row] for row in rows) for name, column in columns.items()}
    columns |= {name: np.array(columns[name]) for name in ARRAYS}
    coefficients = [part.photo_from_measured.coefficients for part in parts]
    transforms = plane.PlaneTransform(np.concatenate([np.zeros((0, 3, 4)), *coefficients])[rows])
    return InteriorOrientation(photo_from_measured=transforms, without_marks=digital, notes=notes, **columns)


@dataclass(frozen=True, eq=False)
class FilmDeformation:
    # (m, 2): transformed coordinates of the marks of each photo, mm; none where they do not show a deformation
    nodes: tuple[Floats, ...]
    shifts: tuple[Floats, ...]  # (m, 2): corrections there, calibrated minus transformed, mm

    @classmethod
    def from_residuals(cls, calibrated: Sequence[Floats], residuals: Sequence[Floats]) -> FilmDeformation:
        """Interpret the residuals of the marks of each photo, transformed minus calibrated (m, 2), as deformation."""
        usable = [_spread(each) for each in calibrated]
        none = np.zeros((0, 2))
        nodes = [c + r if s else none for c, r, s in zip(calibrated, residuals, usable, strict=True)]
        return cls(tuple(nodes), tuple(-r if s else none for r, s in zip(residuals, usable, strict=True)))

    def unseen(self) -> Numbers:
        """Return the photos whose marks do not show a deformation."""
        return np.flatnonzero([len(each) == 0 for each in self.nodes])

    def corrected(self, photo: Numbers, xy: Floats) -> Floats:
        """Correct transformed coordinates (n, 2) of points, each on its photo.

        Source: [Kraus], interpolation of the residuals of fiducial marks; the spline is that of scipy.interpolate.
        """
        from scipy.interpolate import RBFInterpolator

        found = np.array(xy, float)
        order = np.argsort(photo, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(photo[order])) + 1):
            if len(rows) and len(nodes := self.nodes[photo[rows[0]]]):
                shift = RBFInterpolator(nodes, self.shifts[photo[rows[0]]], kernel="thin_plate_spline")
                found[rows] += shift(found[rows])
        return found


def _spread(marks: Floats) -> bool:
    """Whether marks are enough, and not on one line."""
    if len(marks) < LEAST_MARKS:
        return False
    extent = np.linalg.svd(marks - marks.mean(axis=0), compute_uv=False)
    return bool(extent[1] > FLAT * extent[0])


def notes_on_marks(part: InteriorOrientation, camera: Camera) -> list[Note]:
    """Say what the marks of one camera's photos show beside the numbers."""
    notes = [*_turned(part, camera), *_mirrored(part, camera), *_fewer(part, camera)]
    poor = np.nan_to_num(part.sigma0) > POOR_FIT
    if poor.any():
        notes.append(_poor_fit(part, poor))
    scale = np.sqrt(part.scale_x * part.scale_y)
    odd = np.abs(np.log(scale)) > ODD_SCALE
    if odd.any():
        text = f"a measured millimetre is {np.median(scale[odd]):.5g} mm on {_photos(part, odd)}: unit or pixel size "
        text += "of the measurements is not as stated; the transformation puts it right"
        notes.append(_note("measured-scale", text, part, odd, severity="note"))
    affinity = np.abs(np.log(part.scale_x / part.scale_y))
    strong = (affinity > STRONG_AFFINITY) | (np.abs(part.shear) > STRONG_SHEAR)
    if strong.any():
        worst = int(np.argmax(np.where(strong, affinity + np.abs(part.shear), 0)))
        text = f"{_photos(part, strong)}: the marks of camera {camera.name} need scales that differ by "
        text += f"{100 * affinity[worst]:.1f} % and a shear of {abs(np.degrees(part.shear[worst])):.2f} degrees (photo "
        text += f"{part.photo_ids[worst]}): check the calibrated coordinates and the shape of the pixels"
        notes.append(_note("strong-affinity", text, part, strong))
    return notes


def _turned(part: InteriorOrientation, camera: Camera) -> list[Note]:
    """Name photos that were scanned turned by quarters; a warning where those of one camera differ."""
    quarters = np.round(part.rotation / QUARTER).astype(int) % 4
    severity = "note" if len(set(quarters.tolist())) == 1 else "warning"
    # the rotation brings the scan back, so the photo lay turned the other way round
    names = {1: "90 degrees clockwise", 2: "180 degrees", 3: "90 degrees counter-clockwise"}
    return [
        _note(
            "photos-turned",
            f"{_photos(part, quarters == quarter)}: measured turned by {name} against the marks of camera "
            f"{camera.name}; the transformation turns the coordinates back",
            part,
            quarters == quarter,
            severity=severity,
        )
        for quarter, name in names.items()
        if (quarters == quarter).any()
    ]


def _mirrored(part: InteriorOrientation, camera: Camera) -> list[Note]:
    if not part.mirrored.any():
        return []
    text = f"{_photos(part, part.mirrored)}: measured mirrored against the marks of camera {camera.name}; the "
    text += "transformation mirrors the coordinates back. Check y_axis, the side from which the film was scanned, and "
    text += "the signs of the calibrated coordinates: if these are wrong, the ground comes out mirrored"
    return [_note("photos-mirrored", text, part, part.mirrored)]


def _fewer(part: InteriorOrientation, camera: Camera) -> list[Note]:
    """Name photos where too few marks were measured to check them, or to fit what the others have."""
    count = np.array([len(marks) for marks in part.marks], np.intp)
    notes = []
    unchecked = count == 2
    if unchecked.any():
        text = f"{_photos(part, unchecked)}: with two marks neither wrong numbers nor a mirrored photo can be detected"
        notes.append(_note("marks-unchecked", text, part, unchecked))
    conformal = np.array([kind == "conformal" for kind in part.transforms], bool) & ~unchecked
    if conformal.any() and not conformal.all():
        text = f"{_photos(part, conformal)}: conformal instead of affine, because not all of the "
        text += f"{len(camera.fiducials)} marks of camera {camera.name} were measured: film deformation stays in the "
        text += "coordinates"
        notes.append(_note("fewer-marks", text, part, conformal))
    return notes


def _poor_fit(part: InteriorOrientation, poor: Flags) -> Note:
    worst = int(np.nanargmax(part.sigma0))
    lengths = np.linalg.norm(part.residuals[worst], axis=1)
    mark = part.marks[worst][int(np.argmax(lengths))]
    text = f"{_photos(part, poor)}: the marks fit worse than {POOR_FIT / MICROMETRE:.0f} um; worst photo "
    text += f"{part.photo_ids[worst]}, sigma0 {part.sigma0[worst] / MICROMETRE:.0f} um, "
    if part.redundancy[worst] > 2:
        text += f"largest residual {lengths.max() / MICROMETRE:.0f} um at mark {mark}"
    else:
        text += "with so few marks it cannot be told which is wrong"
    return _note("marks-fit-poorly", text, part, poor)


def _note(code: str, message: str, part: InteriorOrientation, rows: Flags, *, severity: str = "warning") -> Note:
    photos = tuple(photo for photo, row in zip(part.photo_ids, rows, strict=True) if row)
    return Note(code, message, severity=severity, photos=photos)


def _photos(part: InteriorOrientation, rows: Flags) -> str:
    return named("photo", [photo for photo, row in zip(part.photo_ids, rows, strict=True) if row], SHOWN)


def marks_without_camera(
    fiducials: PhotoPoints, cameras: Mapping[str, Camera], digital: tuple[str, ...]
) -> list[Fault]:
    """Find photos with marks whose camera has none."""
    measured = set(fiducials.photo_ids)
    return [
        fault(
            "camera-without-marks",
            f"photo {photo}: fiducial marks are measured, but camera {cameras[photo].name} has none",
            fix=f"give cameras.{cameras[photo].name}.fiducials",
        )
        for photo in digital
        if photo in measured
    ]


def marks_of_no_strip(fiducials: PhotoPoints, cameras: Mapping[str, Camera]) -> list[Note]:
    unused = tuple(photo for photo in fiducials.photo_ids if photo not in cameras)
    if not unused:
        return []
    message = f"fiducial marks of {named('photo', unused, SHOWN)} are not used: not in any strip"
    return [Note("marks-unused", message, severity="note", photos=unused)]
