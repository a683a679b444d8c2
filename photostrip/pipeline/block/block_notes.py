"""What a bundle adjustment says beside its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.notes import Note
from photostrip.triangulation.bundle.quality import reliability

if TYPE_CHECKING:
    from photostrip.pipeline.results import BlockStart, Bundle

OF_THE_STRIP_METHOD = {
    "control-doubtful",
    "control-rejected",
    "covariance-proposed",
    "degree-reduced",
    "extrapolation",
    "little-control",
    "little-redundancy",
    "long-strip",
    "not-resected",
    "strip-contradicted",
    "weak-control",
}
"""Notes on strips that say nothing of a bundle adjustment."""


def notes(bundle: Bundle) -> tuple[Note, ...]:
    """Collect the notes on the strips that still mean something, and on the adjustment."""
    return (*_strip_notes(bundle.start), *_of_adjustment(bundle))


def _strip_notes(start: BlockStart) -> tuple[Note, ...]:
    """Return the notes of the strips that still mean something."""
    return tuple(note for strip in start.strips for note in strip.notes if note.code not in OF_THE_STRIP_METHOD)


def _of_adjustment(bundle: Bundle) -> list[Note]:
    """Say what the surveyor should know of the adjustment."""
    notes = []
    solution = bundle.screened.solution
    if solution.free:
        what = (
            "frame and scale are those of the first strip" if bundle.start.free else "frame and scale are the start's"
        )
        text = f"neither control nor camera positions: a free network, {what}; its accuracy is relative only"
        notes.append(Note("free-network", text))
    test = bundle.sigma0
    if np.isfinite(test.lower) and not test.passed:
        text = (
            f"sigma0 is {test.sigma0:.3f}; with the stated standard deviations it would lie between {test.lower:.3f} "
            f"and {test.upper:.3f}: they are too {'small' if test.sigma0 > 1 else 'large'}"
        )
        notes.append(Note("unit-weight", text, severity="note"))
    notes += _given_notes(bundle)
    for parameter in bundle.parameters:
        if not parameter.significant:
            text = (
                f"camera {parameter.camera}: {parameter.name} is {parameter.value:.3g} {parameter.unit} with a "
                f"standard deviation of {parameter.sigma:.3g}: it does not differ from "
                "zero; leave it out of self_calibration"
            )
            notes.append(Note("calibration-insignificant", text))
    common = set(bundle.screened.problem.common_names())
    for correlation in bundle.correlations:
        if not {correlation.first, correlation.second} & common:
            continue  # within a photo: shift and rotation replace each other in every aerial photo
        text = f"{correlation.first} and {correlation.second} are correlated by {correlation.value:+.3f}"
        notes.append(Note("correlated", text, severity="note"))
    return notes


def _given_notes(bundle: Bundle) -> list[Note]:
    """Name control and camera positions that were taken out."""
    notes = []
    problem = bundle.block.problem
    for each in bundle.screened.rejections:
        if each.readmitted or each.kind == reliability.IMAGE:
            continue
        axis = ("east (X)", "north (Y)", "up (Z)")[each.axis]
        reached = (
            f"test value {each.value:.1f}, limit {each.limit:.1f}" if np.isfinite(each.value) else "found in its strip"
        )
        if each.kind == reliability.CONTROL:
            name = problem.point_name(int(problem.control.point[each.row]))
            text = (
                f"control point {name} contradicts the photos and the other control: {axis} by about {each.size:+.2f} m"
            )
            notes.append(Note("control-rejected", f"{text} ({reached}); not used", points=(name,)))
            continue
        part = problem.positions if each.kind == reliability.POSITION else problem.attitudes
        photo = problem.photo_name(int(part.photo[each.row]))
        if each.kind == reliability.POSITION:
            text = f"the given position of photo {photo} does not fit: {axis} by about {each.size:+.2f} m"
        else:
            turn = f"{np.degrees(each.size):+.3f} deg"
            text = f"the given angles of photo {photo} do not fit: about image axis {each.axis + 1} by {turn}"
        notes.append(Note("position-rejected", f"{text} ({reached}); not used", photos=(photo,)))
    return notes
