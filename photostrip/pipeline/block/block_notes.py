"""What a bundle adjustment says beside its numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from photostrip.network import defects, hypotheses, reliability
from photostrip.network.problem import BundleProblem
from photostrip.network.settings import CALIBRATION
from photostrip.notes import Note
from photostrip.pipeline.results import Bundle
from photostrip.rejection import Rejection

OF_THE_STRIP_METHOD = {  # notes on strips that say nothing of a bundle, which tests and holds all rays itself
    "bundle-proposed",
    "contradicting-joint",
    "control-image",
    "control-rejected",
    "degree-reduced",
    "extrapolation",
    "little-control",
    "little-redundancy",
    "long-strip",
    "masked-errors",
    "no-check",
    "not-resected",
    "rays-not-tested",
    "weak-control",
    "weak-joint",
    "weak-pair",
}


def notes(bundle: Bundle) -> tuple[Note, ...]:
    """Collect the notes on the strips that still mean something, and on the adjustment.

    A strip that was found among photos in no order is a start, and no pair of it the user's.
    """
    of_strips = (note for strip in bundle.start.strips if strip.strip.listed for note in strip.notes)
    return (*(note for note in of_strips if note.code not in OF_THE_STRIP_METHOD), *_of_adjustment(bundle))


def _of_adjustment(bundle: Bundle) -> Iterator[Note]:
    """Say what the surveyor should know of the adjustment."""
    solution = bundle.screened.solution
    if solution.free:
        whose = "are those of the first strip" if bundle.start.free else "come from the start values"
        text = (
            f"neither control nor camera positions are given: a free network, its frame and scale {whose}; its "
            "accuracy is relative only"
        )
        yield Note("free-network", text)
    elif loose := defects.weak(solution.prepared, solution.state):
        yield Note("weak-datum", loose)
    test = bundle.sigma0
    if np.isfinite(test.lower) and not test.passed:
        text = (
            f"sigma0 is {test.sigma0:.3f}; with the stated standard deviations it would lie between {test.lower:.3f} "
            f"and {test.upper:.3f}: they are too {'small' if test.sigma0 > 1 else 'large'}"
        )
        yield Note("unit-weight", text, severity="note")
    yield from _given_notes(bundle)
    kinds, problem = list(CALIBRATION.values()), bundle.screened.problem
    places = [hypotheses.place(problem, each) for each in bundle.screened.common if hypotheses.of_images(each)]
    taken_up = {(problem.camera_ids[camera], kinds[k].title) for camera, columns in places for k in columns}
    for parameter in bundle.parameters:
        if not parameter.significant and (parameter.camera, parameter.name) not in taken_up:
            text = (
                f"camera {parameter.camera}: {parameter.name} is {parameter.value:.3g} {parameter.unit} with a "
                f"standard deviation of {parameter.sigma:.3g}: it does not differ significantly from "
                "zero; leave it out of self_calibration"
            )
            yield Note("calibration-insignificant", text)
    common = set(bundle.screened.problem.common_names())
    for correlation in bundle.correlations:
        if not {correlation.first, correlation.second} & common:
            continue  # within a photo: shift and rotation replace each other in every aerial photo
        text = f"{correlation.first} and {correlation.second} are correlated by {correlation.value:+.3f}"
        yield Note("correlated", text, severity="note")


def _given_notes(bundle: Bundle) -> Iterator[Note]:
    """Name control and camera positions that contradict the rest, whether they were taken out or had to stay."""
    problem = bundle.block.problem
    early = "found in its strip" if bundle.start.strips else "found before the adjustment"
    for each in bundle.screened.rejections:
        if not each.readmitted and each.kind != reliability.IMAGE:
            text, photos, points = _contradiction(problem, each, early)
            text += "; not used"
            yield Note("control-rejected" if points else "position-rejected", text, photos=photos, points=points)
    for each in bundle.screened.held:
        text, photos, points = _contradiction(problem, each, early)
        text += "; it was used: without it the adjustment fails, or half of the control would be out"
        yield Note("control-doubtful" if points else "position-doubtful", text, photos=photos, points=points)


def _contradiction(problem: BundleProblem, each: Rejection, early: str) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Say how far a given coordinate is off; of which photo or point it is. ``early``: where no test found it."""
    axis = ("east (X)", "north (Y)", "up (Z)")[each.axes[0]]
    reached = early
    if np.isfinite(each.value):
        reached = f"test value {each.value:.2f}, limit {each.limit:.2f}"
    if each.kind == reliability.CONTROL:
        name = problem.point_name(int(problem.control.point[each.row]))
        size = f"{axis} by about {each.worst:+.2f} m"
        text = f"control point {name} contradicts the {problem.unit}s and the other control: {size}"
        return f"{text} ({reached})", (), (name,)
    part = problem.positions if each.kind == reliability.POSITION else problem.attitudes
    photo = problem.photo_name(int(part.photo[each.row]))
    if each.kind == reliability.POSITION:
        text = f"the given position of photo {photo} does not fit: {axis} by about {each.worst:+.2f} m"
    else:
        turn = f"{np.degrees(each.worst):+.3f} deg"
        text = f"the given angles of photo {photo} do not fit: about image axis {each.axes[0] + 1} by {turn}"
    return f"{text} ({reached})", (photo,), ()
