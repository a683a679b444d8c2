"""What runs of one project by several methods have in common is made once, and comes out as if each had made it."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.pipeline.inputs import METHODS, Settings
from photostrip.pipeline.run import triangulate
from photostrip.pipeline.strips import absolute, forming
from photostrip.pipeline.strips.stages import Stages, alike
from photostrip.result.document import document_of
from photostrip.simulation.simulation import simulate
from photostrip.strip.gross_errors.pairs import screening
from tests.loops import nonempty
from tests.results import spec
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Inputs


def all_stages() -> Stages:
    return Stages("pairs", "strip", "control", "shifted", "failure")


@pytest.fixture
def count(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often pairs were searched, strips formed and laid on control."""
    found: Counter[str] = Counter()

    def counted(place: Any, name: str) -> None:  # noqa: ANN401 (a module)
        function = getattr(place, name)

        def noted(*given: object) -> object:
            found[name] += 1
            return function(*given)

        monkeypatch.setattr(place, name, noted)

    counted(screening, "screen_pairs")
    counted(forming, "form_strip")
    counted(absolute, "reject_wrong_control")
    return found


def inputs(bands: int = 3) -> Inputs:
    return inputs_of(simulate(spec(strips=2, bands=bands)))


@pytest.mark.slow
def test_several_methods_form_the_strips_once(count: Counter[str]) -> None:
    given, stages, alone = inputs(), all_stages(), {}
    for method in METHODS:
        settings = Settings(adjustment=method, cross_validation=method != "bundle")
        alone[method] = document_of(triangulate(given, settings))
    count.clear()
    for method in nonempty(METHODS):
        settings = Settings(adjustment=method, cross_validation=method != "bundle")
        again = replace(given, observations=replace(given.observations, xy=given.observations.xy.copy()))
        assert document_of(triangulate(again, settings, stages=stages)) == alone[method]
    # two strips; in a bundle the start lays each on its control
    assert count == {"screen_pairs": 2, "form_strip": 2, "reject_wrong_control": 2 + 2}


@pytest.mark.slow
def test_other_image_coordinates_or_settings_are_another_strip(count: Counter[str]) -> None:
    given, stages = inputs(), all_stages()
    triangulate(given, Settings(), stages=stages)
    moved = replace(given, observations=replace(given.observations, xy=given.observations.xy + 0.001))
    triangulate(moved, Settings(), stages=stages)
    assert count["form_strip"] == 4
    triangulate(given, replace(Settings(), relative=replace(Settings().relative, screening="none")), stages=stages)
    assert count["form_strip"] == 6
    triangulate(
        replace(given, control=given.control.take(np.arange(len(given.control)) > 0)), Settings(), stages=stages
    )
    assert (count["form_strip"], count["reject_wrong_control"]) == (6, 8)


@pytest.mark.slow
def test_a_failure_is_looked_into_once_with_the_pairs_that_failed(count: Counter[str]) -> None:
    given, stages = inputs(), all_stages()
    o, rng = given.observations, np.random.default_rng(3)
    noise = np.where((o.photo % 5 == 2)[:, None], rng.uniform(-100.0, 100.0, o.xy.shape), o.xy)
    given, searched, findings = replace(given, observations=replace(o, xy=noise)), list[int](), []
    for method in METHODS:
        with pytest.raises(GeometryError) as refused:
            triangulate(given, Settings(adjustment=method), stages=stages)
        searched.append(count["screen_pairs"])
        findings.append(refused.value.findings)
    with pytest.raises(GeometryError) as refused:
        triangulate(given, Settings())
    assert nonempty(findings) == [refused.value.findings] * len(METHODS)
    # the first strip, which fails, and the second for what it says of that: once, and once more alone
    assert searched == [2] * len(METHODS)
    assert count["screen_pairs"] == 4


def test_values_are_alike_when_they_say_the_same() -> None:
    one = inputs()
    assert alike(one, replace(one, observations=replace(one.observations, xy=one.observations.xy.copy())))
    assert not alike(one, replace(one, name="another"))
    assert not alike((1, "a"), (1, "b"))
    assert not alike(1, 1.5)
    assert alike(np.array([1.0, np.nan]), np.array([1.0, np.nan]))
    assert not alike(np.arange(3), np.arange(4))


def test_a_stage_that_found_nothing_is_not_made_again() -> None:
    made: list[int] = []
    stages = Stages("shifted")
    for _ in range(2):
        assert stages.once("shifted", lambda: made.append(1), 5) is None
    assert made == [1]
