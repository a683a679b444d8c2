"""Plane transformations of photos fitted to their fiducial marks, and how well the marks fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault
from photostrip.geometry import plane
from photostrip.notes import Note
from photostrip.strip.image_coordinates.fiducial_marks import Marks, fault
from photostrip.strip.image_coordinates.film_deformation import FilmDeformation

SHAPE = ("scale_x", "scale_y", "rotation", "shear")
TUPLES, ARRAYS = ("photo_ids", "transforms", "marks", "residuals"), ("sigma0", "redundancy", *SHAPE, "mirrored")
LEAST_STRENGTH = 0.01  # strength of a transformation below which marks count as lying on one line


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
