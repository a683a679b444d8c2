"""Whether the control checks itself: how large an error of a given coordinate would be found at all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.arrays import Floats
from photostrip.network import reliability
from photostrip.notes import Note
from photostrip.pipeline.results import AdjustedStrips, Bundle, StripResult

HARDLY = 10.0  # standard deviations of a given coordinate in one model: errors of half of them must be that large
PARTS = (("plan", slice(0, 2)), ("height", slice(2, 3)))


def unchecked_control_notes(adjusted: AdjustedStrips, power: float) -> Iterator[Note]:
    """Say of which control errors would not be found; strip by strip, or of a whole block.

    An error that is found in four of five cases is 4 to 6 standard deviations where other control holds the strip
    beside it, and many times that where the strip would follow the error.

    power: probability with which the detectable errors of a bundle are found.
    """
    if adjusted.bundle is not None:
        yield from _of_bundle(adjusted.bundle, power)
        return
    for strip in adjusted.strips:
        screened = strip.screened_control
        ids = strip.control.ids
        yield from _note_of(ids, screened.detectable, strip.control.sigma, strip.precision, f"strip {strip.strip.id}")


def _of_bundle(bundle: Bundle, power: float) -> Iterator[Note]:
    problem, screened = bundle.screened.problem, bundle.screened
    shift = screened.limit.shifts(power)[reliability.CONTROL]
    for group in bundle.groups:
        if group.kind == reliability.CONTROL:
            ids = [problem.point_name(number) for number in problem.control.point.tolist()]
            precision = _largest(bundle.start.strips)
            yield from _note_of(ids, group.detectable(shift), group.sigma, precision, "the block")


def _largest(strips: Sequence[StripResult]) -> tuple[float, float]:
    plan, height = (max((each.precision[axis] for each in strips), default=0.0) for axis in (0, 1))
    return plan, height


def _note_of(
    ids: Sequence[str], detectable: Floats, sigma: Floats, precision: tuple[float, float], where: str
) -> Iterator[Note]:
    size = detectable / np.hypot(sigma, [precision[0], precision[0], precision[1]])
    parts = []
    for name, part in PARTS:
        known = np.isfinite(sigma[:, part]) & ~np.isnan(size[:, part])
        if known.any() and np.median(size[:, part][known]) > HARDLY:
            middle = np.median(detectable[:, part][known])
            parts.append(f"{middle:.2g} m in {name}" if np.isfinite(middle) else f"any size in {name}")
    if parts:
        text = (
            f"{where}: the control hardly checks itself: errors of {' and of '.join(parts)} at half of its points may "
            "stay unnoticed, and the result would follow them; add control, or check points, which would show it"
        )
        yield Note("unchecked-control", text, severity="note", points=tuple(ids))
