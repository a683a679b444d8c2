"""Mistakes of the benchmark, one of a kind: the run names the cause first, and nothing sound loses its say for it.

Sound projects of all layouts, of which nothing must be told.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import causes, planted
from photostrip.notes import LOST_SAY
from photostrip.pipeline import gate
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Gnss, Image, Spec, Terrain, simulate
from tests.pipeline.blocks import orientations
from tests.simulated import inputs_of, settings_of

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


BLOCK = Spec(
    seed=4, flight=Flight(photos=6, strips=4, side_lap_percent=40.0), control=Control(per_band=1, check=4), gnss=Gnss()
)
HILLS = Terrain(relief=60.0)
BUNDLE = Settings(adjustment="bundle")


def told(inputs: Inputs, settings: Settings) -> list[str]:
    """Collect codes of `check` and of `run`."""
    findings = (*gate.of_inputs(inputs, settings), *triangulate(inputs, settings).findings)
    return sorted({each.code for each in findings})


SMALL = {  # layouts of the benchmark, and a seed that makes a small project
    "6-60 photos, bands every 3-20, polynomial": 3,
    "blocks held by GNSS": 1,
    "strips held by GNSS": 4,
    "independent models": 1,
    "oblique mounts": 2,
    "oblique blocks": 2,
    "convergent strips": 1,
    "systematic errors of 5 µm, blocks": 4,
    "film with fiducial marks": 4,
    "two lists in two zones": 1,
    "given orientations": 3,
    "narrow field of view, 305 mm": 1,
    "UAV corridor, 35 mm, long side across": 4,
    "UAV corridor, 1 inch, long side along": 4,
    "kite, photos in any order": 1,
}


@pytest.mark.parametrize("name", SMALL)
def test_a_sound_project_has_no_finding_however_it_is_laid_out(name: str) -> None:
    make, may_be_told = causes.LAYOUTS[name]
    case = make(SMALL[name])
    found = causes.told(case.inputs, case.settings)
    assert found.refusal == ""
    assert found.out == frozenset()
    assert {each.code for each in (*found.check, *found.run)} - may_be_told - set(LOST_SAY) == set()


@pytest.mark.slow
@pytest.mark.parametrize(("photos", "camera_height"), [(40, 1500.0), (110, 4000.0)])
def test_the_bend_of_a_long_strip_is_no_stretch_of_its_heights(photos: int, camera_height: float) -> None:
    """Level ground says nothing of the principal distance, however the strip bends."""
    spec = Spec(
        seed=80,
        flight=Flight(photos=photos, flying_height=camera_height),
        terrain=Terrain(relief=0.0),
        control=Control(every=6, per_band=2),
        image=Image(sigma_um=8.0),
    )
    made = simulate(spec)
    assert told(inputs_of(made), settings_of(made)) == []


@pytest.mark.slow
def test_a_start_may_be_far_off() -> None:
    """Orientations without influence are no observations: what they say of themselves matters where a run fails."""
    made = simulate(BLOCK)
    given = orientations(made, observed=False)
    rng = np.random.default_rng(5)
    far = replace(given, enu=given.enu + rng.normal(0.0, 500.0, given.enu.shape) - [0.0, 0.0, 1500.0])
    assert told(replace(inputs_of(made), orientations=far), BUNDLE) == []
    observed = replace(far, observed=True, sigma=np.full(far.enu.shape, 500.0), sigma_turns=np.full(far.enu.shape, 1.0))
    assert "P204" in told(replace(inputs_of(made), orientations=observed), BUNDLE)


@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_the_bend_of_a_long_strip_is_no_typing_error(adjustment: str) -> None:
    """A check point between two bands lies metres from where a low polynomial puts it."""
    made = simulate(Spec(seed=10, flight=Flight(photos=60), control=Control(every=15), terrain=HILLS))
    assert told(inputs_of(made), replace(settings_of(made), adjustment=adjustment)) == []
