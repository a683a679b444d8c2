"""What the user knows better: measurements that are kept or dropped whatever the tests say."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.notes import Note
from photostrip.points import ModelPoints, PhotoPoints
from photostrip.strip.model_links import LinkSettings
from photostrip.strip.relative_orientation.orientation import RelativeSettings, orient_again
from photostrip.strip.scale_transfer import StripFormationSettings

if TYPE_CHECKING:
    from photostrip.strip.pair_screening import ScreenedPairs

CENTER = "center of photo "  # before the name of a perspective centre in model coordinates


def require_measured(settings: RelativeSettings, observations: PhotoPoints) -> None:
    """Refuse entries of `keep` and `drop` that name no measurement, and those in both, with a fault for each."""
    found = rows_of((*settings.keep, *settings.drop), observations)
    known = {entry for entry, row in found.items() if row >= 0}
    _require_known(settings, known, "relative", "photo/point, as in the table of observations")


def require_named(settings: LinkSettings, measured: ModelPoints) -> None:
    """Refuse the same in lists of model coordinates."""
    if not (settings.keep or settings.drop):
        return
    nodes = [measured.name(node).removeprefix(CENTER) for node in measured.node.tolist()]
    known = {f"{measured.model_ids[k]}/{name}" for k, name in zip(measured.model.tolist(), nodes, strict=True)}
    _require_known(settings, known, "links", "model/point or model/photo, as in the table of models")


def rows_of_models(entries: Sequence[str], measured: ModelPoints) -> Flags:
    """Mark the model coordinates that a list of the user names, ``model/point`` or ``model/photo``."""
    if not entries:
        return np.zeros(len(measured), bool)
    wanted, names = set(entries), [measured.name(node).removeprefix(CENTER) for node in measured.node.tolist()]
    models = [measured.model_ids[number] for number in measured.model.tolist()]
    return np.array([f"{model}/{name}" in wanted for model, name in zip(models, names, strict=True)], bool)


def require_weighted(settings: StripFormationSettings, observations: PhotoPoints) -> None:
    """Refuse weights of points that no photo shows, with a fault for each."""
    known = set(observations.point_ids)
    faults = [
        Fault(
            f"`{name}` is no point of the photos",
            code="no-such-measurement",
            key="processing.scale_weights",
            points=(name,),
            expected="points of the table of observations",
        )
        for name in settings.scale_weights
        if name not in known
    ]
    if faults:
        raise InputError(faults)


def _require_known(settings: RelativeSettings | LinkSettings, known: set[str], block: str, expected: str) -> None:
    faults = [
        Fault(
            f"`{entry}` names no measurement",
            code="no-such-measurement",
            key=f"processing.{block}.{key}",
            expected=expected,
        )
        for key, entries in (("keep", settings.keep), ("drop", settings.drop))
        for entry in dict.fromkeys(entries)
        if entry not in known
    ]
    faults += [
        Fault(f"`{entry}` is both kept and dropped", code="kept-and-dropped", key=f"processing.{block}.drop")
        for entry in settings.drop
        if entry in settings.keep
    ]
    if faults:
        raise InputError(faults)


def rows_of(entries: Sequence[str], observations: PhotoPoints) -> dict[str, int]:
    """Row of each measurement of a list, photo/point; -1 for none."""
    if not entries:
        return {}
    wanted = dict.fromkeys(entries, -1)
    photos, points = observations.photo_ids, observations.point_ids
    for row, (photo, point) in enumerate(zip(observations.photo, observations.point, strict=True)):
        name = f"{photos[photo]}/{points[point]}"
        if name in wanted:
            wanted[name] = row
    return wanted


def kept_rows(entries: Sequence[str], observations: PhotoPoints) -> Numbers:
    """Rows of the measurements of a list, ascending."""
    return np.array(sorted(rows_of(entries, observations).values()), np.intp)


def touched(entries: Sequence[str], observations: PhotoPoints, rows: Numbers) -> Flags:
    """Which rows (m,) of a table of pairs, with the rows (m, 2) of their measurements, use one of a list."""
    return np.asarray(np.isin(rows, list(rows_of(entries, observations).values())).any(axis=1), bool)


def restored(screened: ScreenedPairs, weight: Floats, kept: Flags) -> ScreenedPairs:
    """Take rejected measurements back that the user keeps; their rejections are marked as re-admitted.

    weight, kept: (m,), weights before the search, and rows that are kept.
    """
    oriented = screened.orientation
    back = kept & ~oriented.used
    if not back.any():
        return screened
    restored_weight = np.where(back, weight, oriented.pairs.weight)
    oriented = orient_again(oriented, restored_weight, np.unique(oriented.pairs.pair[back]))
    log = tuple(replace(each, readmitted=each.readmitted or bool(back[each.row])) for each in screened.rejections)
    return replace(screened, orientation=oriented, rejections=log)


def overruling_notes(settings: RelativeSettings, strip: str, photos: Sequence[str]) -> Iterator[Note]:
    """Say what the user has decided, one note for each list that touches the strip."""
    kept, dropped = (
        ", ".join(entry for entry in entries if any(entry.startswith(f"{photo}/") for photo in photos))
        for entries in (settings.keep, settings.drop)
    )
    if kept:
        text = f"strip {strip}: kept at the user's request, whatever the tests say: {kept}"
        yield Note("user-keep", text, severity="note", strip=strip)
    if dropped:
        text = f"strip {strip}: left out at the user's request: {dropped}"
        yield Note("user-drop", text, severity="note", strip=strip)
