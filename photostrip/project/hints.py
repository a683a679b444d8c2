"""What is in the files and not used, and why: said once, before anything is computed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.formats.findings import counted, listed
from photostrip.notes import Note
from photostrip.project.tables import alike, rays

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from photostrip.formats.control import ControlTable
    from photostrip.formats.observations import Measurements
    from photostrip.project import schema

NEAR_NAMED = 3


def hints(
    project: schema.ProjectFile,
    observations: Measurements,
    fiducials: Measurements | None,
    control: Sequence[ControlTable],
) -> Iterator[Note]:
    """Explain every row and every definition that is not used.

    Parameters
    ----------
    project : ProjectFile
        The project.
    observations, fiducials : Measurements
        Measured points and marks.
    control : sequence of ControlTable
        Control lists.

    Yields
    ------
    Note
        One for each kind of thing in each file.
    """
    photos = {str(photo) for strip in project.strips for photo in strip.photos}
    yield from _unused_cameras(project)
    for measured in (observations, fiducials):
        if measured is not None:
            yield from _photos_in_no_strip(measured, photos)
    count = rays(observations, photos)
    given = {read.ids[row] for read in control for row in range(len(read.ids)) if read.used[row]}
    yield from _measured_once(observations, count, given)
    for read in control:
        yield from _switched_off(read)
        yield from _never_measured(read, count, given)


def _unused_cameras(project: schema.ProjectFile) -> Iterator[Note]:
    used = {strip.camera for strip in project.strips}
    unused = [name for name in project.cameras if name not in used]
    if unused:
        verb = "belongs" if len(unused) == 1 else "belong"
        number = counted(len(unused), "camera")
        yield Note("unused-camera", f"{number} {verb} to no strip: {listed(unused)}", "note")


def _photos_in_no_strip(read: Measurements, photos: set[str]) -> Iterator[Note]:
    """Name measured photos that no strip lists."""
    others = [name for name in read.photo_ids if name not in photos]
    if not others:
        return
    number = {name: code for code, name in enumerate(read.photo_ids)}
    rows = sum(int((read.photo == number[name]).sum()) for name in others)
    near = alike(others, photos)
    message = (
        f"{read.table.file}: {counted(rows, 'row')} of {counted(len(others), 'photo')} in no strip not used:"
        f" {listed(others)}{_twins(near)}"
    )
    yield Note("photo-in-no-strip", message, photos=tuple(others))


def _measured_once(read: Measurements, count: dict[str, int], given: set[str]) -> Iterator[Note]:
    """Name points that one photo alone sees, control apart."""
    once = [name for name, number in count.items() if number == 1]
    control = [name for name in once if name in given]
    new = [name for name in once if name not in given]
    if control:
        what = (
            f"{counted(len(control), 'control or check point is', 'control or check points are')} measured on one photo"
        )
        message = f"{read.table.file}: {what} only and cannot be used: {listed(control)}"
        yield Note("control-measured-once", message, points=tuple(control))
    if new:
        near = alike(new, given - set(once))
        what = f"{counted(len(new), 'point is', 'points are')} measured on one photo only and cannot be determined"
        note = Note(
            "measured-once", f"{read.table.file}: {what}: {listed(new)}{_twins(near)}", "note", points=tuple(new)
        )
        yield note


def _switched_off(read: ControlTable) -> Iterator[Note]:
    off = [name for name, used in zip(read.ids, read.used, strict=True) if not used]
    if off:
        number = counted(len(off), "point is", "points are")
        message = f"{read.table.file}: {number} switched off (use: off): {listed(off)}"
        yield Note("control-off", message, "note", points=tuple(off))


def _never_measured(read: ControlTable, count: dict[str, int], given: set[str]) -> Iterator[Note]:
    """Name control and check points that no photo shows, and measured points that may be them."""
    missing = [name for name, used in zip(read.ids, read.used, strict=True) if used and name not in count]
    if not missing:
        return
    near = alike(missing, [name for name in count if name not in given])
    verb = "is" if len(missing) == 1 else "are"
    number = counted(len(missing), "control or check point")
    message = f"{read.table.file}: {number} {verb} not measured on any photo: {listed(missing)}{_twins(near)}"
    yield Note("control-not-measured", message, "warning" if near else "note", points=tuple(missing))


def _twins(near: dict[str, str]) -> str:
    """Say which other names may be meant."""
    if not near:
        return ""
    pairs = [f"`{name}`, did you mean `{twin}`?" for name, twin in list(near.items())[:NEAR_NAMED]]
    return "; " + " ".join(pairs)
