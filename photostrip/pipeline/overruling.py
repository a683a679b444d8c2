"""What the user knows better: measurements that are kept or dropped whatever the tests say."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.notes import Note
from photostrip.triangulation.relative_orientation.orientation import RelativeSettings, orient_again

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.points import ModelPoints, PhotoPoints
    from photostrip.triangulation.gross_errors.pairs.screening import ScreenedPairs
    from photostrip.triangulation.independent_models.link_screening import LinkSettings


CENTER = "center of photo "  # before the name of a perspective centre in model coordinates


def require(settings: RelativeSettings, observations: PhotoPoints) -> None:
    """Refuse entries that name no measurement, and those that are to be kept and dropped.

    Raises InputError with a fault for each such entry.
    """
    faults = []
    for key in ("keep", "drop"):
        found = rows_of(getattr(settings, key), observations)
        faults += [
            Fault(
                f"`{entry}` names no measurement",
                code="no-such-measurement",
                key=f"processing.relative.{key}",
                expected="photo/point, as in the table of observations",
            )
            for entry, row in found.items()
            if row < 0
        ]
    faults += [
        Fault(f"`{entry}` is to be kept and dropped", code="kept-and-dropped", key="processing.relative.drop")
        for entry in settings.drop
        if entry in settings.keep
    ]
    if faults:
        raise InputError(faults)


def require_named(settings: LinkSettings, measured: ModelPoints) -> None:
    """Refuse entries of ``keep`` and ``drop`` that name nothing, and those in both.

    Raises InputError with a fault for each such entry.
    """
    if not (settings.keep or settings.drop):
        return
    nodes = [measured.name(node).removeprefix(CENTER) for node in measured.node.tolist()]
    known = {f"{measured.model_ids[k]}/{name}" for k, name in zip(measured.model.tolist(), nodes, strict=True)}
    faults = [
        Fault(
            f"`{entry}` names no measurement",
            code="no-such-measurement",
            key=f"processing.links.{key}",
            expected="model/point or model/photo, as in the table of models",
        )
        for key, entries in (("keep", settings.keep), ("drop", settings.drop))
        for entry in entries
        if entry not in known
    ]
    faults += [
        Fault(f"`{entry}` is to be kept and dropped", code="kept-and-dropped", key="processing.links.drop")
        for entry in settings.drop
        if entry in settings.keep
    ]
    if faults:
        raise InputError(faults)


def rows_of(entries: Sequence[str], observations: PhotoPoints) -> dict[str, int]:
    """Find the rows of the measurements of a list.

    entries: measurements, photo/point.
    Returns row of each; -1 for none.
    """
    if not entries:
        return {}
    wanted = dict.fromkeys(entries, -1)
    photos, points = observations.photo_ids, observations.point_ids
    for row, (photo, point) in enumerate(zip(observations.photo, observations.point, strict=True)):
        name = f"{photos[photo]}/{points[point]}"
        if name in wanted:
            wanted[name] = row
    return wanted


def rows(entries: Sequence[str], observations: PhotoPoints) -> Numbers:
    """Return the rows of the measurements of a list.

    entries: measurements, photo/point.
    Returns their rows, ascending.
    """
    return np.array(sorted(rows_of(entries, observations).values()), np.intp)


def touched(entries: Sequence[str], observations: PhotoPoints, rows: Numbers) -> Flags:
    """Find the rows of a pairs' table that use a measurement of a list.

    entries: measurements, photo/point.
    rows: (m, 2), rows of the two measurements in the observations.
    Returns (m,), true for those.
    """
    hits = np.isin(rows, list(rows_of(entries, observations).values()))
    found: Flags = hits[:, 0] | hits[:, 1]
    return found


def restored(screened: ScreenedPairs, weight: Floats, kept: Flags) -> ScreenedPairs:
    """Take rejected measurements back that the user keeps.

    weight: (m,), weights before the search.
    kept: (m,), rows that are kept.
    Returns the search with those rows in use; their rejections are marked as re-admitted.
    """
    oriented = screened.orientation
    back = kept & ~oriented.used
    if not back.any():
        return screened
    restored_weight = np.where(back, weight, oriented.pairs.weight)
    oriented = orient_again(oriented, restored_weight, np.unique(oriented.pairs.pair[back]))
    log = tuple(replace(each, readmitted=each.readmitted or bool(back[each.row])) for each in screened.rejections)
    return replace(screened, orientation=oriented, rejections=log)


def notes(settings: RelativeSettings, strip: str, photos: Sequence[str]) -> list[Note]:
    """Say what the user has decided.

    Returns one for each list that touches the strip.
    """
    kept, dropped = (
        ", ".join(entry for entry in entries if any(entry.startswith(f"{photo}/") for photo in photos))
        for entries in (settings.keep, settings.drop)
    )
    found = []
    if kept:
        text = f"strip {strip}: kept at the user's wish, whatever the tests say: {kept}"
        found.append(Note("user-keep", text, severity="note", strip=strip))
    if dropped:
        text = f"strip {strip}: left out at the user's wish: {dropped}"
        found.append(Note("user-drop", text, severity="note", strip=strip))
    return found
