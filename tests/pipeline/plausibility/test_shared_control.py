"""A control list that lies beside the others as a whole is named as such, and none of its points alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, GrossError, Spec
from photostrip.simulation.simulation import simulate
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.pipeline.results import Result


def two_lists(shift: Sequence[float], *errors: GrossError, adjustment: str = "auto") -> Result:
    """Adjust a strip of which every third control point stands in a second list, shifted as a whole."""
    spec = Spec(seed=3, flight=Flight(photos=10), control=Control(bands=4), gross_errors=errors)
    simulation = simulate(spec)
    inputs = inputs_of(simulation)
    control = inputs.control
    second = np.arange(len(control)) % 3 == 0
    control = replace(control, frame=second.astype(np.intp), enu=control.enu + np.outer(second, shift))
    frames = (inputs.frames[0], replace(inputs.frames[0]))
    settings = replace(settings_of(simulation), adjustment=adjustment)
    return triangulate(replace(inputs, control=control, frames=frames), settings)


@pytest.mark.parametrize(("shift", "code"), [((2.0, 1.0, 0.0), "P407"), ((0.0, 0.0, 2.0), "P404")])
def test_a_list_that_lies_beside_the_others_is_named(shift: tuple[float, float, float], code: str) -> None:
    """All its points were rejected one by one, and nothing said that they share one error."""
    result = two_lists(shift)
    (finding,) = result.findings
    assert finding.code == code
    assert finding.key == "control[1]"
    assert [finding.evidence[f"offset_{axis}_m"] for axis in ("east", "north", "up")] == pytest.approx(shift, abs=0.3)
    assert result.strips[0].wrong_control == ()


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "code", "axes"), [((2.0, 1.0, 0.0), "P407", 3), ((0.0, 0.0, 2.0), "P404", 1)])
def test_a_bundle_leaves_the_list_out_as_a_whole(shift: tuple[float, float, float], code: str, axes: int) -> None:
    """Good control of the other list went with it, one point after the other."""
    result = two_lists(shift, adjustment="bundle")
    (finding,) = result.findings
    assert (finding.code, finding.key) == (code, "control[1]")
    assert [finding.evidence[f"offset_{axis}_m"] for axis in ("east", "north", "up")] == pytest.approx(shift, abs=0.3)
    assert finding.message.endswith("cannot be told")  # of two lists
    assert result.bundle is not None
    screened = result.bundle.screened
    assert screened.rejections == ()
    given = np.isfinite(screened.problem.control.sigma).sum(axis=1)
    assert set(given[screened.problem.control.frame == 1].tolist()) == {3 - axes}
    assert set(given[screened.problem.control.frame == 0].tolist()) == {3}


def with_moved_checks(shift: Sequence[float], count: int, adjustment: str) -> Result:
    """Adjust a strip of which so many of ten check points are shifted."""
    simulation = simulate(Spec(seed=3, flight=Flight(photos=10), control=Control(bands=4)))
    inputs = inputs_of(simulation)
    enu = inputs.control.enu.copy()
    enu[np.flatnonzero(inputs.control.check)[:count]] += shift
    settings = replace(settings_of(simulation), adjustment=adjustment)
    return triangulate(replace(inputs, control=replace(inputs.control, enu=enu)), settings)


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "adjustment"), [((2.0, 1.0, 0.0), "polynomial"), ((0.0, 0.0, 2.0), "bundle")])
def test_check_points_that_lie_beside_the_result_are_named_together(
    shift: tuple[float, float, float], adjustment: str
) -> None:
    """Each looked as bad as the others, so none stood out; a single one is no shift of all."""
    result = with_moved_checks(shift, 10, adjustment)
    (finding,) = result.findings
    assert (finding.code, finding.key) == ("P411", "control[0]")
    assert set(finding.points) == {name for name in result.inputs.control.ids if name.startswith("K")}
    assert [finding.evidence[f"offset_{axis}_m"] for axis in ("east", "north", "up")] == pytest.approx(shift, abs=0.3)
    (line,) = document_of(result)["verdict"]["look_at"]
    assert line.startswith("P411 the check points of control[0] all lie")
    for count in (1, 2):
        assert "P411" not in {each.code for each in with_moved_checks(shift, count, adjustment).findings}
