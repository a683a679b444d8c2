"""Points of two strips share the errors of control that both strips have: covariances against differences of runs."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline import precision
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Image, Points, Spec, simulate
from photostrip.strip import polynomial
from tests.derivatives import UNSCREENED, oriented_of
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Inputs

    Floats = NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("_no_findings")

STEP = 0.05  # m


def two_strips() -> Inputs:
    spec = Spec(
        flight=Flight(photos=3, strips=2, side_lap_percent=40.0),
        points=Points(rows=4, reach_percent=90.0, extra_per_model=4),
        control=Control(bands=2, check=0, sigma=(0.3, 0.3, 0.4)),
        image=Image(2.0),
    )
    return inputs_of(simulate(spec))


def by_strip(inputs: Inputs, wanted: Settings) -> list[Floats]:
    """All points as each strip has them, Cartesian; NaN for points of the other."""
    result = triangulate(inputs, wanted)
    found = [np.full((len(result.points.number), 3), np.nan) for _ in result.strips]
    for strip, place in zip(result.strips, found, strict=True):
        place[np.searchsorted(result.points.number, strip.formed.point)] = strip.cartesian
    return found


@pytest.mark.slow
def test_common_control_makes_common_errors() -> None:
    """Mean of two strips: a quarter of both covariances, and twice what their shared control does to both."""
    inputs = two_strips()
    wanted = Settings(adjustment="polynomial", relative=UNSCREENED, polynomial=polynomial.PolynomialSettings("1"))
    result = triangulate(inputs, wanted)
    observations, assured = result.refined.observations, result.precision
    assert assured is not None
    each = [
        precision.of_photos(strip, oriented_of(result, number), observations, inputs.control, of_checks=False)
        for number, strip in enumerate(result.strips)
    ]
    names = [set(strip.control.ids) for strip in result.strips]
    common = [n for n, name in enumerate(inputs.control.ids) if name in names[0] & names[1]]
    one, other = (np.searchsorted(result.points.number, strip.formed.point) for strip in result.strips)
    shared, first, second = np.intersect1d(one, other, return_indices=True)
    assert len(common) > 2
    assert len(shared) > 10
    mixed, before = np.zeros((len(shared), 3, 3)), by_strip(inputs, wanted)
    for point, axis in product(common, range(3)):
        enu = inputs.control.enu.copy()
        enu[point, axis] += STEP
        moved = by_strip(replace(inputs, control=replace(inputs.control, enu=enu)), replace(wanted, precision=False))
        a, b = ((moved[k] - before[k])[shared] / STEP for k in range(2))
        mixed += inputs.control.sigma[point, axis] ** 2 * a[:, :, None] * b[:, None, :]
    expected = (each[0].points[first] + each[1].points[second] + mixed + mixed.transpose(0, 2, 1)) / 4
    assert assured.points[shared] == pytest.approx(expected, abs=3e-3 * np.abs(expected).max())
    alone = (each[0].points[first] + each[1].points[second]) / 4
    assert np.trace(expected, axis1=1, axis2=2).mean() > 1.1 * np.trace(alone, axis1=1, axis2=2).mean()
