"""Pairs whose photos are exchanged, and lists in another unit, are told once, by their cause.

Neither they nor any other fault of a project hide image coordinates in another unit.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.formats.faults import Findings
from photostrip.formats.measured import Manner, read_measurements
from photostrip.project.check import check_project
from photostrip.simulation import Flight, Spec
from photostrip.simulation.simulation import simulate
from tests.loops import nonempty
from tests.project.samples import OBSERVATIONS, P, Sample, Y
from tests.simulated import inputs_of

SIGMA = 0.005  # mm
PAIRS = 5


def listed(exchanged: set[int], *, factor: float = 1.0, noise: float = SIGMA) -> tuple[str, frozenset[str]]:
    """Write a strip as a list of pairs, the photos of some pairs exchanged; and give its photos."""
    inputs = inputs_of(simulate(Spec(seed=2, flight=Flight(photos=PAIRS + 1))))
    o, photos, rng = inputs.observations, inputs.strips[0].photos, np.random.default_rng(1)
    place = {(o.photo_ids[p], o.point_ids[q]): xy for p, q, xy in zip(o.photo, o.point, o.xy, strict=True)}
    lines = ["left,right,point,xl,yl,xr,yr"]
    for number, names in enumerate(pairwise(photos)):
        for point in o.point_ids:
            if not {(name, point) for name in names} <= set(place):
                continue
            found = [factor * (np.asarray(place[name, point]) + rng.normal(0.0, noise, 2)) for name in names]
            one, other = found[::-1] if number in exchanged else found
            lines.append(f"{','.join(names)},{point},{one[0]:.4f},{one[1]:.4f},{other[0]:.4f},{other[1]:.4f}")
    return "\n".join(nonempty(lines)) + "\n", frozenset(photos)


def faults(tmp_path: Path, listing: tuple[str, frozenset[str]]) -> list[tuple[str, str]]:
    """Give code and message of what is refused."""
    (path := tmp_path / "pairs.csv").write_text(listing[0], encoding="utf-8")
    findings = Findings()
    read_measurements([str(path)], findings, Manner(sigma=SIGMA, photos=listing[1]))
    return [(each.code, each.message) for each in findings.faults]


@pytest.mark.parametrize(
    ("exchanged", "factor", "noise", "code", "words"),
    [
        *(({n}, 1.0, SIGMA, "pair-exchanged", f"photos 100{n + 1} and 100{n + 2} are exchanged") for n in (0, 2, 4)),
        (set(range(PAIRS)), 1.0, SIGMA, "pair-exchanged", "in every pair"),
        (set(), 1000.0, SIGMA, "measurements-disagree", "the unit or the standard deviation is wrong"),
        # coordinates of photos laid in anew scatter by a millimetre: they are in no common system
        (set(), 1.0, 1.0, "measurements-disagree", ""),
    ],
)
def test_what_is_the_matter_is_told_once(
    tmp_path: Path, exchanged: set[int], factor: float, noise: float, code: str, words: str
) -> None:
    ((found, message),) = faults(tmp_path, listed(exchanged, factor=factor, noise=noise))
    assert found == code
    assert words in message
    assert noise == SIGMA or "agree as measurements do" not in message


def test_sound_pairs_are_read(tmp_path: Path) -> None:
    assert faults(tmp_path, listed(set())) == []


def told(project: Sample) -> tuple[list[str], list[str]]:
    """Give the codes of faults and findings, and see that a run that is refused tells the same."""
    checked = check_project(project.folder / "project.yaml")
    with pytest.raises(InputError) as refused:
        project.load()
    assert (refused.value.faults, refused.value.findings) == (checked.faults, checked.findings)
    return [each.code for each in checked.faults], [each.code for each in checked.findings]


@pytest.mark.parametrize(("factor", "unit"), [(1.0, []), (10.0, ["P101"]), (0.1, ["P101"])])
def test_an_exchanged_pair_does_not_hide_the_unit(project: Sample, factor: float, unit: list[str]) -> None:
    """It ended the reading before the unit was looked at."""
    listing, photos = listed({2}, factor=factor)
    project.write(P, listing)
    project.change(Y, "[1001, 1002]", f"[{', '.join(sorted(photos))}]")
    project.change(Y, "  - id: B\n    camera: RC30\n    photos: [2001, 2002]\n", "")
    assert told(project) == (["pair-exchanged"], unit)


FAULTS = [
    ("observations.csv", "1001,P2", "1001,P1", "measured-twice"),
    ("project.yaml", "[1001, 1002]", "[1001, 1003]", "not-measured"),
    ("observations.csv", "\n2001,P2,1", "\n2001,P2,l", "number"),
    ("control.csv", "212.31", "212,31", "row-length"),
    ("control.csv", "P2,", "G1,", "given-twice"),
    ("project.yaml", "    sigma: [0.05, 0.06, 0.08]\n", "", "no-sigma"),
    ("project.yaml", "grubbs_alpha", "grubs_alpha", "unknown-key"),
    ("project.yaml", "EPSG:32633", "EPSG:1", "crs-unknown"),
]


@pytest.mark.parametrize(("file", "old", "new", "code"), FAULTS)
@pytest.mark.parametrize(("unit", "expected"), [("mm", []), ("um", ["P101"])])
def test_no_fault_hides_the_unit(
    project: Sample, file: str, old: str, new: str, code: str, unit: str, expected: list[str]
) -> None:
    """Every fault did, and was told alone."""
    project.change(Y, "unit: mm", f"unit: {unit}")
    project.change(file, old, new)
    assert told(project) == ([code], expected)


def test_marks_that_orient_no_photo_say_nothing_of_the_unit(marked: Sample) -> None:
    """Coordinates of a comparator have their origin anywhere, and were told to reach too far."""
    rows = [row.split(",") for row in OBSERVATIONS.split()[1:]]
    lines = ["photo,point,x,y", *(f"{a},{b},{float(x) + 300},{float(y) + 300}" for a, b, x, y in nonempty(rows))]
    marked.write(P, "\n".join(lines))
    marked.change("fiducials.csv", "2002,F1,106.1,-106\n", "")
    checked = check_project(marked.folder / "project.yaml")
    assert "too-few-marks" in {each.code for each in checked.faults}
    assert checked.findings == ()


def test_a_header_that_is_there_twice_is_a_fault_of_its_row(project: Sample) -> None:
    """Its photo is in no strip, and has no row that is left."""
    project.change(P, "photo,point,x,y\n", "photo,point,x,y\nphoto,point,x,y\n")
    assert told(project) == (["number", "number"], [])
