"""Panels of a chart: which strips have one, and what stands above it."""

from __future__ import annotations

import pytest

from photostrip.report.pictures.chart import MOST_STRIPS, multiples


@pytest.mark.parametrize(("count", "titled"), [(1, False), (2, True), (MOST_STRIPS + 1, True)])
def test_panels_are_named_where_there_are_several_strips(count: int, titled: bool) -> None:
    sizes = {f"S{number}": float(number) for number in range(count)}
    found = multiples(sizes, "largest errors")
    assert found.titled("S1") == ("strip S1" if titled else "")
    assert found.strips == list(sizes)[-MOST_STRIPS:]  # the worst, in their order
    assert (found.some == "") == (count <= MOST_STRIPS)
