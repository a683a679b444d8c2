"""Given points that lost their say, and images of given points that did: nothing given disappears without a word."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from photostrip.notes import Note, named
from photostrip.pipeline.results import Result
from photostrip.result.numbers import natural_rank
from photostrip.result.points.photos import ImageResiduals
from photostrip.result.table import Table
from photostrip.units import MICROMETRES

FAR = 5.0  # stated standard deviations; a sound coordinate is as far off once in two million
NAMED_BY = {"control-image", "control-measured-once"}  # notes that say more of a lost point
ROLES = {"control": False, "check": True}  # whether it is a check point; control comes first: it holds the others

Images = dict[str, dict[str, tuple[str, ...]]]  # of points: what is said of their images, with the photos concerned


def lost_say_notes(
    result: Result, residuals: Sequence[ImageResiduals], rejected: Table, said: Iterable[Note]
) -> Iterator[Note]:
    """Name given points without coordinates, rejected images of the others, then images in use that do not fit.

    What ``use: off`` switches off, and what no photo shows, never had a say.

    rejected: the table ``rejected`` of the document.
    said: the notes of the run.
    """
    control = result.inputs.control
    told = {name for note in said if note.code in NAMED_BY for name in note.points}
    order = np.argsort(natural_rank(control.ids))
    counting = order[control.use[order].any(axis=1)]
    points: dict[str, list[str]] = {}
    for role, check in ROLES.items():
        names = [(control.ids[row], result.control_rows[row] >= 0) for row in counting if control.check[row] == check]
        points[role] = [name for name, there in names if there]
        lost = [name for name, there in names if not there and name in result.not_determined and name not in told]
        yield from _lost(role, {name: result.not_determined[name] for name in lost})
    out, far = _rejected(rejected, in_bundle=result.bundle is not None), _far_off(result, residuals)
    yield from _of_images("given-ray", "rejected: {}; measure them again", points, out)
    yield from _of_images("given-residual", f"used and more than {FAR:g} standard deviations off: {{}}", points, far)


def _lost(role: str, lost: dict[str, str]) -> Iterator[Note]:
    reasons: dict[str, list[str]] = {}
    for name, why in lost.items():
        reasons.setdefault(why, []).append(name)
    if reasons:
        texts = [f"{named(f'{role} point', names, len(names))} took no part: {why}" for why, names in reasons.items()]
        yield Note("check-lost" if ROLES[role] else "control-lost", "; ".join(texts), points=tuple(lost))


def _rejected(rejected: Table, *, in_bundle: bool) -> Images:
    """Return the images that stay rejected; a bundle decides on each of them again."""
    found: Images = {}
    for each in rejected:
        if each["photo"] is None or each["readmitted"] or (in_bundle and each["stage"] != "bundle"):
            continue
        photos = each.get("blamed") or [photo for photo in (each["photo"], each["other_photo"]) if photo is not None]
        where = f"models {' and '.join(each['models'])}" if each.get("models") else f"photo {' or '.join(photos)}"
        found.setdefault(each["point"], {})[where] = tuple(photos)
    return found


def _far_off(result: Result, residuals: Iterable[ImageResiduals]) -> Images:
    """Return the images that took part and have residuals beyond ``FAR``, with the size of these.

    What a similarity leaves or a polynomial bends of a strip is in residuals too: these say nothing of single images.
    """
    observations, found = result.refined.observations, Images()
    for each in residuals if result.bundle is not None else ():
        ratio = np.abs(each.residuals) / observations.sigma[each.rows]
        for place in np.flatnonzero(each.used & (ratio > FAR).any(axis=1)).tolist():
            row, photo = each.rows[place], each.strip.photos[each.photo[place]]
            size = f"photo {photo}, {np.hypot(*each.residuals[place]) * MICROMETRES:.0f} µm"
            found.setdefault(observations.point_ids[observations.point[row]], {})[size] = (photo,)
    return found


def _of_images(code: str, text: str, points: dict[str, list[str]], images: Images) -> Iterator[Note]:
    concerned = {role: [name for name in names if name in images] for role, names in points.items()}
    every = [name for names in concerned.values() for name in names]
    if every:
        texts = [
            named(f"{role} point", [f"{name} ({'; '.join(images[name])})" for name in names], len(names))
            for role, names in concerned.items()
            if names
        ]
        photos = dict.fromkeys(photo for name in every for some in images[name].values() for photo in some)
        message = f"images of given points are {text.format(' and '.join(texts))}"
        yield Note(code, message, photos=tuple(photos), points=tuple(every))
