"""Sound projects of all layouts, of which nothing must be told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import causes
from photostrip.notes import LOST_SAY
from photostrip.pipeline import gate
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Gnss, Image, Spec, Terrain, simulate
from tests.pipeline.blocks import orientations
from tests.simulated import inputs_of, settings_of

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
