"""Interior orientation: from measured fiducial marks to photo coordinates.

A plane transformation takes the marks of a photo to their calibrated coordinates, and all its points with them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from photostrip.camera import Camera
from photostrip.errors import Fault, InputError
from photostrip.notes import Note, named
from photostrip.points import PhotoPoints
from photostrip.strip.image_coordinates.fiducial_marks import enough, fault, gather, right_pattern
from photostrip.strip.image_coordinates.film_deformation import FilmDeformation
from photostrip.strip.image_coordinates.mark_fit import InteriorOrientation, fit_marks, joined_cameras
from photostrip.strip.image_coordinates.mark_notes import (
    SHOWN,
    marks_of_no_strip,
    marks_without_camera,
    notes_on_marks,
)
from photostrip.strip.image_coordinates.settings import InteriorSettings


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
