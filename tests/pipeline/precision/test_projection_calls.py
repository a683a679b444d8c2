"""The projection is asked for many points at a time: how often does not depend on how many points are given."""

from __future__ import annotations

from unittest.mock import Mock

import pytest

from photostrip.geodesy import proj_operation
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Points, Spec
from tests.simulated import inputs_of

ADJUSTMENTS = ("polynomial", "bundle")


def calls(monkeypatch: pytest.MonkeyPatch, adjustment: str, check: int) -> int:
    """Adjust a strip with so many check points, make its document, and count the calls of PROJ."""
    counted = Mock(wraps=proj_operation._run)
    monkeypatch.setattr(proj_operation, "_run", counted)
    spec = Spec(flight=Flight(photos=8), points=Points(extra_per_model=20), control=Control(check=check))
    document = document_of(triangulate(inputs_of(simulate(spec)), Settings(adjustment=adjustment)))
    assert len(document["precision"]["check"]["points"]) == check
    return counted.call_count


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ADJUSTMENTS)
def test_more_check_points_make_no_more_calls_of_the_projection(
    monkeypatch: pytest.MonkeyPatch, adjustment: str
) -> None:
    few = calls(monkeypatch, adjustment, 5)
    assert few > 0
    assert calls(monkeypatch, adjustment, 80) == few
