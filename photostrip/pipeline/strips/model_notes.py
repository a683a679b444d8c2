"""What links of independent models say beside their numbers: weakness, contradictions, units."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from photostrip.notes import Note
from photostrip.pipeline.inputs import ModelStrip
from photostrip.points import ModelPoints
from photostrip.strip.independent_models.formation import FormedModels, far_ends
from photostrip.strip.independent_models.link_screening import LEFT

ODD_SCALE = 30.0  # ratio of the scale of a model to that of the others
# ratio of residuals to what is stated; below the second there are no errors at all
ANOTHER_UNIT, NO_ERRORS = 100.0, 1e-5
WEAK_LINK = 12.0  # standard deviations of a coordinate by which a link moves the far end of its model


def link_notes(strip: ModelStrip, measured: ModelPoints, formed: FormedModels) -> Iterator[Note]:
    """Say which links are weak, or contradict themselves, and what seems to stand in another unit."""
    links, shared, models = formed.links, formed.links.shared, formed.models
    yield from _unit_notes(strip, formed)
    if links.factor > 1:
        text = (
            f"strip {strip.id}: the common points of the models differ {np.sqrt(links.factor):.1f} times as much as "
            "the standard deviations of the model coordinates allow; larger ones are used in the search for gross "
            "errors"
        )
        yield Note("sigma-contradicted", text, severity="note", strip=strip.id)
    center = np.bincount(
        shared.link[links.used & (models.node[shared.before] >= models.points)], minlength=shared.count
    )
    far = far_ends(formed)
    for link in range(shared.count):
        names = strip.models[link : link + 2]
        photo = strip.photos[link + 1]
        if far[link] > WEAK_LINK:
            why = "" if center[link] else f"; the perspective centre of photo {photo} is missing in one of them"
            text = (
                f"strip {strip.id}: models {names[0]} and {names[1]} are linked weakly: the far end of the second is "
                f"uncertain by {far[link]:.0f} times the standard deviation of a model coordinate{why}"
            )
            yield Note("weak-link", text, strip=strip.id, photos=(photo,))
        elif not center[link]:
            text = (
                f"strip {strip.id}: models {names[0]} and {names[1]} are linked without the perspective centre of "
                f"photo {photo}, which is not measured in both"
            )
            yield Note("link-without-center", text, severity="note", strip=strip.id, photos=(photo,))
    for rows in links.doubtful:
        link = int(shared.link[rows[0]])
        names = strip.models[link : link + 2]
        points = [measured.name(int(models.node[shared.before[row]])) for row in rows]
        what = f"one of {', '.join(points)}" if len(points) > 1 else points[0]
        text = (
            f"strip {strip.id}: the common points of models {names[0]} and {names[1]} contradict each other: {what} is "
            "wrong, but it is still used; measure more common points"
        )
        yield Note("contradicting-link", text, strip=strip.id, points=tuple(points))
    left = np.bincount(shared.link, links.used, shared.count)
    for link in np.unique(shared.link[[each.row for each in links.rejections]]).tolist():
        if left[link] < LEFT:  # two conditions check nine coordinates
            names, out = strip.models[link : link + 2], shared.before[(shared.link == link) & ~links.used]
            points = [measured.name(node) for node in models.node[out].tolist()]
            text = (
                f"strip {strip.id}: models {names[0]} and {names[1]} are linked by {left[link]:.0f} points alone, "
                f"which hardly check each other: {', '.join(points)} contradict them; measure more common points"
            )
            yield Note("contradicting-link", text, strip=strip.id, points=tuple(points))


def _unit_notes(strip: ModelStrip, formed: FormedModels) -> Iterator[Note]:
    """Say where a model, or the standard deviations, seem to stand in another unit than they should."""
    scale = formed.places.scale / np.median(formed.places.scale)
    for number in np.flatnonzero(np.abs(np.log(scale)) > np.log(ODD_SCALE)).tolist():
        times = f"{1 / scale[number]:.3g} times smaller" if scale[number] < 1 else f"{scale[number]:.3g} times larger"
        text = (
            f"strip {strip.id}: the scale number of model {strip.models[number]} is {times} than that of the others: "
            "are its coordinates in another unit?"
        )
        yield Note("odd-scale", text, strip=strip.id, photos=strip.photos[number : number + 2])
    solved = formed.links.solved
    redundancy = int(solved.redundancy.sum())
    ratio = float(np.sqrt(solved.squares.sum() / redundancy)) if redundancy else 1.0
    if ratio > ANOTHER_UNIT or NO_ERRORS < ratio < 1 / ANOTHER_UNIT:
        text = (
            f"strip {strip.id}: the misfits between the models are {ratio:.3g} times their stated standard deviations: "
            "are these in another unit?"
        )
        yield Note("sigma-unit", text, strip=strip.id, key="models.sigma")
