"""Mistakes of the benchmark, one of a kind: the run names the cause first, and nothing sound loses its say for it."""

from __future__ import annotations

import pytest

from benchmarks import causes, planted

BOTH = {  # named by `check` and `run`; the seed of a small project
    "image coordinates in another unit": 43003,
    "one photo in another unit": 43003,
    "y down read as y up": 43003,
    "negatives read as positives": 43003,
    "x and y of the images exchanged": 43003,
    "one photo mirrored": 43003,
    "fiducial marks in another unit": 43003,
    "principal distance off by 1 to 3 %": 43003,
    "two neighbours exchanged in the list": 43003,
    "no overlap from one photo on": 43003,
    "a photo twice": 43003,
    "camera positions below ground": 43003,
    "their heights in feet": 43003,
    "one height of them off by half": 43003,
    "two camera positions exchanged": 43003,
    "one id for two points": 43003,
    "two ids for one point": 43003,
    "ids of one photo in the next row": 43004,
    "axes of the control exchanged": 43003,
    "crs of another country": 43003,
    "control in feet (projected)": 43003,
    "one of two lists in another frame": 43004,
    "heights of two kinds in two lists": 43004,
    "all heights zero": 43003,
    "slip of a digit, control": 43004,
    "slip of a digit, polynomials": 43004,
    "a digit written twice": 43004,
    "slip of a digit, two others exchanged": 43004,
    "two control points exchanged": 43004,
    "ids of given points in the next row": 43004,
    "one given point in other columns": 43004,
    "standard deviation of images in micrometres": 43003,
    "control at one end": 43003,
    "control in one half": 43003,
    "angles in another unit": 43003,
    "angles in another system": 43001,
}
BY_RUN = {
    "pixels of an image of another width": 43004,
    "principal distance of another lens": 43001,
    "film 0.1 to 0.3 % short or long one way": 43003,
    "principal point off by 0.05 to 0.3 mm": 43004,
    "one id for two points nearby in two strips": 43003,
    "second list 0.6 m up or down, block": 43004,
    "slip of a digit, models": 43001,
    "all check points shifted": 43003,
    "all check points shifted, block": 43003,
    "all check points shifted, models": 43003,
    "k1 and k2 not stated": 43003,
}


@pytest.mark.parametrize("name", [*BOTH, *BY_RUN])
def test_a_mistake_is_what_is_named_first(name: str) -> None:
    mistake = planted.mistake(name)
    case = mistake.make((BOTH | BY_RUN)[name])
    wrong = mistake.plant(case)
    assert wrong is not None
    inputs, ids = wrong
    found = causes.told(inputs, mistake.settings(case))
    assert causes.names_it(found.run[0], mistake, ids)
    assert any(causes.names_it(each, mistake, ids) for each in found.check) == (name in BOTH)
    assert found.out <= causes.spoiled(case, inputs)
