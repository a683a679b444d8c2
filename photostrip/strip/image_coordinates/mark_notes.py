"""What fiducial marks show beside the numbers of their fit: photos turned or mirrored, scales, weak or poor fits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from photostrip.arrays import Flags
from photostrip.camera import Camera
from photostrip.errors import Fault
from photostrip.notes import Note, named
from photostrip.points import PhotoPoints
from photostrip.strip.image_coordinates.fiducial_marks import QUARTER, fault
from photostrip.strip.image_coordinates.mark_fit import InteriorOrientation

MICROMETRE = 1e-3  # mm
POOR_FIT = 0.05  # mm; film that was stored well fits to a third of this
ODD_SCALE = 0.02  # departure of the scale from 1: pixel size or unit is not what was stated
STRONG_AFFINITY = 0.01  # departure of the ratio of the two scales from 1; film shrinks by a tenth of this
STRONG_SHEAR = np.radians(0.5)
SHOWN = 5  # ids in a sentence


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
