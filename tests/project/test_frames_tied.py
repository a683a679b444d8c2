"""Ground frames are tied when a project is loaded, and its run works with these."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from shutil import copytree
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.run import triangulate
from photostrip.project.loading import adjust_project, load_project

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result

SAMPLE = Path("sample_data/simulated-20")
# modules that tie frames of a project
PLACES = ("project.loading", "pipeline.frames", "pipeline.gate", "pipeline.given_on_ground")
ED50 = ("control[0].crs=EPSG:23030", "output.crs=EPSG:32630")


@cache
def plain() -> Result:
    """Adjust the sample as it is."""
    return adjust_project(load_project(SAMPLE / "project.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("overrides", [(), ED50, ("processing.adjustment=similarity",)])
def test_a_run_ties_its_frames_once(overrides: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[object] = []

    def counted(*given: object, **named: object) -> object:
        calls.append(given)
        return tie_frames(*given, **named)  # type: ignore[arg-type]

    for place in PLACES:
        monkeypatch.setattr(f"photostrip.{place}.tie_frames", counted)
    adjust_project(load_project(SAMPLE / "project.yaml", overrides))
    assert len(calls) == 1


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
@pytest.mark.parametrize(
    "overrides", [ED50, ("output.crs=EPSG:32634",), ("control[0].crs=local", "processing.earth_curvature=model")]
)
def test_what_is_overridden_counts(overrides: tuple[str, ...]) -> None:
    project = load_project(SAMPLE / "project.yaml", overrides)
    found, anew = adjust_project(project), triangulate(project.inputs, project.settings)
    assert [frame.describe() for frame in found.frames] == [frame.describe() for frame in anew.frames]
    assert np.array_equal(found.points.ground, anew.points.ground)
    assert found.output.describe() != plain().output.describe()
    assert np.abs(found.points.ground - plain().points.ground).max() > 1e-3


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_each_project_has_its_own_datum_shift(tmp_path: Path) -> None:
    """PROJ goes from ED50 to WGS 84 by one operation in Germany and by another in Spain."""
    south = tmp_path / "south"
    copytree(SAMPLE, south)
    control = (south / "control.csv").read_text()
    assert control.count(",55") > 10
    (south / "control.csv").write_text(control.replace(",55", ",45"))  # north, by 1000 km
    both = [adjust_project(load_project(each / "project.yaml", ED50)) for each in (SAMPLE, south)]
    alone = [triangulate(each.inputs, each.settings) for each in both]
    shifts = [each.frames[0].datum_shift for each in both]
    assert shifts == [each.frames[0].datum_shift for each in alone]
    assert shifts[0] != shifts[1]
