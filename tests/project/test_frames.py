"""Ground frames of a project: zones joined by common points, datums tied once."""

from functools import cache
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.project.loading import adjust_project, load_project
from tests.geodesy.test_local_frame import in_both
from tests.project.samples import FILES, PROJECT, Sample, Y, sample

LISTS = """\
control:
  - file: west.csv
    crs: local
    axes: [east, north, up]
    sigma: [0.05, 0.06, 0.08]
  - file: east.csv
    crs: local
    axes: [north, east, up]
    sigma: [0.05, 0.06, 0.08]
    other_zone: true
"""


NORTH = "    axes: [east, north, up]\n"


def project(folder: Path, common: int = 5, role: str = "control") -> tuple[Sample, np.ndarray]:
    """Write a project whose point P2 is known in the other zone only; return its coordinates in the first zone."""
    west, east = in_both(common + 2, 10_000.0)
    head = "point,x,y,z,use,role\n"
    first = [f"P1,{west[0, 0]:.4f},{west[0, 1]:.4f},100,xyz,control\n"]
    second = [f"P2,{east[1, 1]:.4f},{east[1, 0]:.4f},120,xyz,control\n"]
    for number in range(2, common + 2):
        first.append(f"B{number},{west[number, 0]:.4f},{west[number, 1]:.4f},0,off,{role}\n")
        second.append(f"B{number},{east[number, 1]:.4f},{east[number, 0]:.4f},0,off,{role}\n")
    before, after = PROJECT.index("control:"), PROJECT.index("output:")
    text = PROJECT[:before] + LISTS + PROJECT[after:].replace("tolerances: {check_rms_xy: 0.40}\n", "")
    files = {**FILES, "project.yaml": text, "west.csv": head + "".join(first), "east.csv": head + "".join(second)}
    return sample(folder, files), west[1]


def test_points_of_the_other_zone_come_into_the_first(tmp_path: Path) -> None:
    given, expected = project(tmp_path)
    loaded = given.load()
    control = loaded.inputs.control
    assert control.ids == ("P1", "P2")
    assert control.enu[1] == pytest.approx([*expected, 120.0], abs=2e-3)
    (note,) = (note for note in loaded.hints if note.code == "zones-joined")
    assert "5 points of both" in note.message
    assert "powers up to 3: rms 0.00" in note.message


def test_two_points_join_without_a_check(tmp_path: Path) -> None:
    (note,) = (note for note in project(tmp_path, 2)[0].load().hints if note.code == "zones-joined")
    assert note.message.endswith("with powers up to 1: nothing checks them")


@pytest.mark.parametrize(
    ("common", "role", "old", "new", "place", "words"),
    [
        (5, "check", "", "", "project.yaml:30:17: control[1].other_zone:", "0 points of this list in the first one"),
        (1, "control", "", "", "project.yaml:30:17: ", "1 point of this list"),
        (5, "control", "crs: local", "crs: EPSG:32633", "", "zones of a known projection are tied by their formulas"),
        (5, "control", NORTH, f"{NORTH}    other_zone: true\n", "", "brought into the zone of the first one"),
    ],
)
def test_zones_that_cannot_be_joined(
    tmp_path: Path, common: int, role: str, old: str, new: str, place: str, words: str
) -> None:
    given, _ = project(tmp_path, common, role)
    text = (tmp_path / "project.yaml").read_text(encoding="utf-8")
    given.write(Y, text.replace(old, new, 1) if old == NORTH else text.replace(old, new))
    given.tells(place, "other_zone: ", words)


SAMPLE = Path("sample_data/simulated-20")
ED50 = ("control[0].crs=EPSG:23030", "output.crs=EPSG:32630")


@cache
def plain() -> Result:
    """Adjust the sample as it is."""
    return adjust_project(load_project(SAMPLE / "project.yaml"))


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
