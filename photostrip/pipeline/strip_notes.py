"""What the numbers of a strip of photos, or of linked models, say that a surveyor should know."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.arrays import Floats
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geodesy.local_frame import EARTH_RADIUS, curvature_correction
from photostrip.notes import Note, counted
from photostrip.pipeline.inputs import ModelStrip, Strip
from photostrip.plausibility.given_points import Shared
from photostrip.points import ModelPoints, PhotoPoints
from photostrip.rejection import Rejection
from photostrip.strip.absolute_orientation import WEAK_LIMIT, AbsoluteOrientation
from photostrip.strip.control_screening import EITHER, EXCHANGED, ScreenedControl
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.linked_models import LEFT, FormedModels, far_ends
from photostrip.strip.pair_screening import ScreenedPairs
from photostrip.strip.polynomial import Polynomial
from photostrip.strip.relative_orientation import MINIMUM_POINTS, Orientation
from photostrip.strip.resection import Resection
from photostrip.strip.strip_errors import WEAK_PAIR, times_a_good_pair

# of the length that the control spans: how far points may lie beyond it. Of a polynomial they are extrapolated
BEYOND_POLYNOMIAL = 0.1
LONG_STRIP = 25  # models; beyond it polynomials fall far behind a rigorous adjustment
POLYNOMIAL_MODELS = 15  # models from which on, and
POLYNOMIAL_BANDS = 4  # bands of control below which the bundle adjustment is proposed


def pair_notes(strip: Strip, oriented: Orientation) -> Iterator[Note]:
    """Say which pairs check themselves too little."""
    times = times_a_good_pair(oriented)
    for number, count in enumerate(oriented.points_used):
        names = strip.photos[number : number + 2]
        if count == MINIMUM_POINTS:
            text = f"photos {names[0]} and {names[1]} are oriented on 5 points only: there is no check"
            yield Note("no-check", text, strip=strip.id, photos=names)
        if times[number] > WEAK_PAIR:
            text = (
                f"photos {names[0]} and {names[1]}: weak relative orientation: the standard deviations of model points "
                f"are {times[number]:.1f} times those of a good pair of the same base and height; the points lie in a "
                "narrow band, or on one side: measure some towards the corners of the overlap"
            )
            yield Note("weak-pair", text, strip=strip.id, photos=names)


def screening_notes(strip: Strip, screened: ScreenedPairs, sigma: float) -> Iterator[Note]:
    """Say what the search for gross errors could not decide."""
    scatter = screened.scatter
    if np.isfinite(scatter.found):
        text = (
            f"strip {strip.id}: the y parallaxes scatter as if image coordinates had a standard deviation of "
            f"{scatter.found / np.sqrt(2.0) * 1000:.1f} µm, not the {sigma * 1000:.1f} µm stated; the larger one "
            "is used in the search for gross errors"
        )
        yield Note("sigma-contradicted", text, severity="note", strip=strip.id)
    for number in np.flatnonzero(screened.masked):
        names = strip.photos[number : number + 2]
        text = (
            f"photos {names[0]} and {names[1]}: masked errors are suspected: the y parallaxes are larger than their "
            "standard deviation allows, and no further point can be rejected; measure the pair again or add points"
        )
        yield Note("masked-errors", text, strip=strip.id, photos=names)


def rays_not_tested(strip: Strip) -> Note:
    text = (
        f"strip {strip.id}: its rays could not be tested together, as those left do not hold its photos; points were "
        "rejected pair by pair only, where errors along the base do not show"
    )
    return Note("rays-not-tested", text, severity="note", strip=strip.id)


def wrong_control_notes(strip: Strip | ModelStrip, screened: ScreenedControl) -> Iterator[Note]:
    """Name control that was not used, and what seems to be wrong with it."""
    ids = screened.kept.ids
    for each in screened.rejections:
        point = ids[each.row]
        text = f"control point {point} {_contradiction(each)}; not used"
        if each.cause == EXCHANGED:
            text += f"; it fits when exchanged with {ids[each.other]}"
        yield Note("control-rejected", text, strip=strip.id, points=(point,))


def wrong_image_notes(strip: Strip, observations: PhotoPoints, wrong: Sequence[Rejection]) -> Iterator[Note]:
    """Name control points that their own rays place wrongly."""
    for each in wrong:
        if each.kind != "control":
            continue
        point, photo = observations.point_ids[observations.point[each.row]], strip.photos[each.other]
        text = f"control point {point} {_contradiction(each)}; not used"
        if each.cause == EITHER:
            text += f"; this or its image in photo {photo} is wrong, nothing tells which: both agree on its other ray"
        else:
            text += f"; its image in photo {photo} is wrong, not its coordinates: they agree along its other ray"
        yield Note("control-image", text, strip=strip.id, photos=(photo,), points=(point,))


def _contradiction(each: Rejection) -> str:
    parts = ", ".join(f"{GROUND_AXES[axis]} by about {each.size[axis]:+.2f} m" for axis in each.axes)
    return f"contradicts the strip and the other control: {parts} (test value {each.value:.1f}, limit {each.limit:.1f})"


def junction_notes(strip: Strip, formed: FormedStrip) -> Iterator[Note]:
    """Say which models are joined doubtfully or weakly."""
    junctions = formed.junctions
    count = np.bincount(junctions.junction, junctions.used, len(junctions.factor))
    for number in np.flatnonzero(junctions.doubt).tolist():
        photo = strip.photos[number + 1]
        text = (
            f"photo {photo}: its pass points contradict each other in the scale of the models by "
            f"{100 * junctions.doubt[number]:.2f} %, and it cannot be told which is wrong; measure another pass point"
        )
        yield Note("contradicting-joint", text, strip=strip.id, photos=(photo,))
    for number in np.flatnonzero(count == 1).tolist():
        photo = strip.photos[number + 1]
        text = (
            f"photo {photo}: the models on either side are joined by a single pass point: an error in it enters the "
            "scale unnoticed"
        )
        yield Note("weak-joint", text, strip=strip.id, photos=(photo,))


def control_notes(strip: Strip | ModelStrip, orientation: AbsoluteOrientation) -> Iterator[Note]:
    """Say where the control hardly checks itself, or hardly holds the strip."""
    if orientation.redundancy < 3:
        text = (
            f"strip {strip.id}: the absolute orientation has a redundancy of {orientation.redundancy}: errors of the "
            "control hardly show"
        )
        yield Note("little-control", text, strip=strip.id)
    if orientation.condition > 1 / WEAK_LIMIT:
        text = (
            f"strip {strip.id}: the control lies nearly on one line: it holds one movement of the strip, as the turn "
            f"about that line, {orientation.condition:.0f} times worse than the others; add control beside it"
        )
        yield Note("weak-control", text, strip=strip.id)


def curvature_note(strip: Strip | ModelStrip, bent: Shared, at_control: Floats) -> Note:
    """Say that a strip is bent as the Earth's curvature would have it, and how to take that into account.

    at_control: (n, 3), its points that are control, metres.
    """
    reach = float(np.ptp(at_control[:, 0])) / 2.0
    fall = float(curvature_correction(reach, EARTH_RADIUS))
    text = (
        f"strip {strip.id} bends over its control as the Earth does, by {fall:.2f} m over "
        f"{reach / 1000.0:.1f} km ({100 * bent.value[0]:.0f} % of the curvature, standard deviation "
        f"{100 * bent.sigma[0]:.1g} %): local coordinates are taken as they are. Are they map coordinates, name their "
        "crs, or write `earth_curvature: model`; is their plane a true one, `earth_curvature: none`"
    )
    return Note("curvature-left-out", text, strip=strip.id, key="processing.earth_curvature")


def polynomial_notes(strip: Strip | ModelStrip, correction: Polynomial | None, adjusted: Floats) -> Iterator[Note]:
    """Say which degree the control did not carry, and where the polynomial is extrapolated."""
    if correction is None:
        return
    asked = correction.asked
    if asked != "auto" and correction.degree < int(asked):
        text = (
            f"strip {strip.id}: degree {asked} was asked for; the control, "
            f"{counted(len(correction.axes[0].residuals), 'point')} at {counted(correction.stations[0], 'station')} in "
            f"plan and {correction.stations[1]} in height, supports degree {correction.degree}"
        )
        yield Note("degree-reduced", text, strip=strip.id)
    if correction.degree:
        low, high = correction.reach
        outside = int(((adjusted[:, 0] < low) | (adjusted[:, 0] > high)).sum())
        reach = max(low - float(adjusted[:, 0].min()), float(adjusted[:, 0].max()) - high)
        if outside and reach > BEYOND_POLYNOMIAL * (high - low):
            text = (
                f"strip {strip.id}: {counted(outside, 'point lies', 'points lie')} up to {reach:.0f} m beyond the "
                f"control along the strip, where the polynomial of degree {correction.degree} is extrapolated"
            )
            yield Note("extrapolation", text, strip=strip.id)
        if min(axis.redundancy for axis in correction.axes) < 3:
            text = f"strip {strip.id}: the polynomial has a redundancy below 3 in one axis: its residuals say little"
            yield Note("little-redundancy", text, strip=strip.id)


def photo_notes(strip: Strip, resection: Resection) -> Iterator[Note]:
    """Name the photos that could not be oriented."""
    for number in np.flatnonzero(~resection.solved):
        photo = strip.photos[number]
        text = f"photo {photo} could not be oriented on its adjusted points; it keeps its orientation in the strip"
        yield Note("not-resected", text, strip=strip.id, photos=(photo,))


def precision_of_long_strip(strip: Strip, most: int) -> Note:
    """Say that a strip that was fitted to its control is too long for standard deviations of all its points."""
    text = (
        f"strip {strip.id} has {len(strip.photos)} photos; standard deviations after a polynomial or a similarity are "
        f"computed up to {most} photos in a strip; `processing.adjustment: bundle` has them at any length"
    )
    return Note("no-precision", text, strip=strip.id)


def network_proposal(strip: Strip, correction: Polynomial) -> Iterator[Note]:
    """Propose the adjustment of all rays together where a polynomial does badly."""
    models = len(strip.photos) - 1
    if models > LONG_STRIP:
        text = (
            f"strip {strip.id}: {models} models; beyond about {LONG_STRIP} models a polynomial falls far behind a "
            "rigorous adjustment (errors 2.5 times larger at 30 models, 12 times at 100); `processing.adjustment: "
            "bundle` is one"
        )
        yield Note("long-strip", text, strip=strip.id)
        return
    few = min(correction.stations) < POLYNOMIAL_BANDS
    if models > 1 and (models > POLYNOMIAL_MODELS or few):
        bands = f"on {counted(min(correction.stations), 'band')} of control"
        why = f"over {models} models" if models > POLYNOMIAL_MODELS else bands
        what = "a polynomial" if correction.degree else "the similarity, which no polynomial improves,"
        text = f"strip {strip.id}: {what} {why} leaves larger errors than `processing.adjustment: bundle`"
        yield Note("bundle-proposed", text, severity="note", strip=strip.id)


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
