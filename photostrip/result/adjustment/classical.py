"""What the strip method alone leaves where a bundle stands in its place: polynomials, strip by strip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from photostrip.errors import GeometryError, InputError
from photostrip.notes import Document
from photostrip.pipeline.given_points import compare_with_given
from photostrip.pipeline.precision import mean_points
from photostrip.pipeline.results import Adjusted, Result, StripResult
from photostrip.points import locate
from photostrip.result.numbers import rms
from photostrip.result.points.given import differences, of_used
from photostrip.result.quantities import record
from photostrip.result.table import Table
from photostrip.strip.polynomial import degree_of


def classical_of(result: Result) -> Document:
    """Return the block ``classical`` under its key; empty where not every strip has control enough of its own.

    The strips are those that the bundle started from: nothing is adjusted for it.
    """
    strips = () if result.bundle is None else result.bundle.start.strips
    if not strips or any(strip.polynomial is None for strip in strips):
        return {}
    try:
        alone = _strip_by_strip(result, strips)
    except (GeometryError, InputError):  # a polynomial that goes astray leaves the domain of a projection
        return {}
    control, found = result.inputs.control, of_used(alone, differences(alone))
    roles = {"control": ~control.check & control.use.any(axis=1), "check": control.check}
    left = {
        f"{role}_rms": {"plan": rms(found.plan[rows]), "height": rms(found.height[rows])}
        for role, rows in roles.items()
    }
    of_strips = Table.of_rows("classical.strips", map(_degrees, strips))
    return {"classical": record("classical", {"strips": of_strips, **left})}


def _degrees(strip: StripResult) -> Document:
    terms = [] if strip.polynomial is None else [axis.terms for axis in strip.polynomial.axes]
    plan, _, height = map(degree_of, terms)
    return {"strip": strip.strip.id, "degree_plan": plan, "degree_height": height}


def _strip_by_strip(result: Result, strips: Sequence[StripResult]) -> Result:
    """Give the result that the strips are by themselves, at given points alone."""
    observations, control = result.refined.observations, result.inputs.control
    number, cartesian = mean_points(strips)
    given = np.isin(number, locate(control.ids, observations.point_ids))
    points = Adjusted(
        number=number[given],
        cartesian=cartesian[given],
        ground=result.output.ground_from_cartesian(cartesian[given]),
        rays=np.zeros(int(given.sum()), np.intp),
    )
    rows, found = compare_with_given(control, result.frames, points, observations)
    return replace(
        result,
        strips=tuple(strips),
        points=points,
        control_rows=rows,
        control_differences=found,
        precision=None,
        bundle=None,
    )
