"""What archives hold: lists of pairs, points measured again, other names of columns, tenths of micrometres."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.foreign.simulated import project_files
from photostrip.formats.files import write_files
from photostrip.pipeline.run import triangulate
from photostrip.project.loading import load_project
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight, Spec
from tests.loops import nonempty
from tests.project.samples import FILES, Sample

if TYPE_CHECKING:
    from pathlib import Path

    from photostrip.points import PhotoPoints
    from photostrip.project.loading import Project

PAIRS = """\
pair,point,x,y,p,q
1001-1002,P1,10.5,-20.25,91.0,0.25
1001-1002,P2,11.5,20.25,91.0,0.25
2001-2002,P2,10,20,90,0
2001-2002,G1,30,40,90,0
"""
BOTH = """\
left,right,point,xl,yl,xr,yr
1001,1002,P1,10.5,-20.25,-80.5,-20.5
1001,1002,P2,11.5,20.25,-79.5,20.0
2001,2002,P2,10,20,-80,20
2001,2002,G1,30,40,-60,40
"""
AGAIN = FILES["observations.csv"] + "1001,P1,10.504,-20.254\n1001,P1,10.508,-20.252\n"


@pytest.fixture
def sample(tmp_path: Path) -> Sample:
    made = Sample(tmp_path)
    for name, text in FILES.items():
        made.write(name, text)
    return made


def measured(project: Project) -> dict[tuple[str, str], tuple[float, ...]]:
    points: PhotoPoints = project.inputs.observations
    return {
        (points.photo_ids[photo], points.point_ids[point]): (*xy, *sigma)
        for photo, point, xy, sigma in zip(points.photo, points.point, points.xy, points.sigma, strict=True)
    }


def told(sample: Sample) -> list[str]:
    return [str(fault).replace(f"{sample.folder}/", "") for fault in sample.faults()]


# ---------------------------------------------------------------------------------------------------- pairs


@pytest.mark.parametrize("text", [PAIRS, BOTH, PAIRS.replace("-100", "/100"), PAIRS.replace("pair,", "Model,")])
def test_a_list_of_pairs_is_the_table_of_its_photos(sample: Sample, text: str) -> None:
    usual = measured(sample.load())
    sample.write("observations.csv", text)
    assert measured(sample.load()) == usual


def test_the_photos_of_a_pair_may_have_dashes(sample: Sample) -> None:
    usual = measured(sample.load())
    for name in ("project.yaml", "observations.csv"):
        sample.change(name, "1001", "10-01") if name == "project.yaml" else sample.write(name, PAIRS)
    sample.write("observations.csv", PAIRS.replace("1001-1002", "10-01-1002"))
    found = measured(sample.load())
    assert {(photo.replace("10-01", "1001"), point) for photo, point in found} == set(usual)


def test_a_pair_that_is_none_is_refused(sample: Sample) -> None:
    sample.write("observations.csv", PAIRS.replace("2001-2002,P2", "2001_2003,P2"))
    (line,) = told(sample)
    assert line == (
        "observations.csv:4:1: pair: pair 2001_2003 does not name two photos of the strips; expected a pair such as "
        "1001-1002; write it as LEFT-RIGHT with ids of the strips' photos, or use two columns left and right"
    )


def test_a_pair_that_may_be_two_is_refused(sample: Sample) -> None:
    sample.change("project.yaml", "[1001, 1002]", "[1, 1-1, 1-1-1]")
    sample.write("observations.csv", PAIRS.replace("1001-1002", "1-1-1-1"))
    assert "pair 1-1-1-1 may be photos 1 and 1-1-1 or 1-1 and 1-1 or 1-1-1 and 1" in told(sample)[0]


def test_a_list_of_pairs_without_a_parallax_is_told_what_it_lacks(sample: Sample) -> None:
    sample.write("observations.csv", PAIRS.replace("p,q", "p"))
    assert told(sample)[0].startswith(
        "observations.csv:1: q: there is no column `q`; expected a header `pair,point,x,y,p,q`"
    )


@pytest.mark.slow
def test_a_strip_from_a_stereocomparator_is_that_of_its_photos(tmp_path: Path) -> None:
    """Every photo but the first and the last is measured in two pairs; the means are what was measured."""
    simulation = simulate(Spec(flight=Flight(photos=6)))
    write_files(tmp_path, project_files(simulation))
    first = load_project(tmp_path / "project.yaml")
    points, place = first.inputs.observations, {name: n for n, name in enumerate(first.inputs.strips[0].photos)}
    seen: dict[int, dict[int, tuple[float, float]]] = {}
    for photo, point, xy in zip(points.photo, points.point, points.xy.tolist(), strict=True):
        seen.setdefault(place[points.photo_ids[photo]], {})[int(point)] = tuple(xy)
    names = list(place)
    rows = ["left,right,point,x,y,p,q"] + [
        f"{names[n]},{names[n + 1]},{points.point_ids[point]},{x!r},{y!r},{x - seen[n + 1][point][0]!r},"
        f"{y - seen[n + 1][point][1]!r}"
        for n in range(len(names) - 1)
        for point, (x, y) in seen[n].items()
        if point in seen[n + 1]
    ]
    (tmp_path / "observations.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    second = load_project(tmp_path / "project.yaml")
    assert [note.code for note in second.hints].count("measurements-averaged") == 1
    results = [triangulate(each.inputs, each.settings) for each in (first, second)]
    ids = [[r.inputs.observations.point_ids[n] for n in r.points.number] for r in results]
    order = [np.argsort(each) for each in ids]
    assert [ids[0][n] for n in order[0]] == [ids[1][n] for n in order[1]]
    # a mean of two has half the variance and counts more, so that the results agree within the noise only
    apart = results[0].points.cartesian[order[0]] - results[1].points.cartesian[order[1]]
    assert np.abs(apart).max() < 0.1


# ------------------------------------------------------------------------------------------ measured again


def test_points_measured_again_are_averaged_and_their_spread_told(sample: Sample) -> None:
    sample.write("observations.csv", AGAIN)
    sample.change("project.yaml", "  unit: mm\n", "  unit: mm\n  repeated: average\n")
    project = sample.load()
    x, y, sx, sy = measured(project)["1001", "P1"]
    assert [x, y] == pytest.approx([10.504, -20.252])
    assert [sx, sy] == pytest.approx([0.005 / np.sqrt(3)] * 2)
    assert measured(project)["1001", "P2"] == (11.5, 20.25, 0.005, 0.005)
    note = next(note for note in project.hints if note.code == "measurements-averaged")
    assert "1 point measured up to 3 times" in note.message
    assert "scatters by 0.004 in x and 0.002 in y" in note.message
    assert "worst is point P1 on photo 1001, 0.004 off its mean" in note.message


def test_the_mean_is_weighted(sample: Sample) -> None:
    text = "photo,point,x,y,sx,sy\n" + "".join(f"{row},,\n" for row in FILES["observations.csv"].splitlines()[1:])
    sample.write("observations.csv", text + "1001,P1,10.51,-20.25,0.01,0.01\n")
    sample.change("project.yaml", "  unit: mm\n", "  unit: mm\n  repeated: average\n")
    x, _, sx, _ = measured(sample.load())["1001", "P1"]
    weights = np.array([1 / 0.005**2, 1 / 0.01**2])
    assert x == pytest.approx(weights @ [10.5, 10.51] / weights.sum())
    assert sx == pytest.approx(weights.sum() ** -0.5)


def test_measurements_that_are_not_of_one_point_are_refused(sample: Sample) -> None:
    sample.write("observations.csv", FILES["observations.csv"] + "1001,P1,10.5,-20.05\n")
    sample.change("project.yaml", "  unit: mm\n", "  unit: mm\n  repeated: average\n")
    (line,) = told(sample)
    assert line == (
        "observations.csv:10:6: point: point P1 is measured 2 times on photo 1001 (lines 2, 10), up to 0.2 in y apart: "
        "20 standard deviations from the mean; remove the wrong one, or give the other point an id of its own"
    )


# ----------------------------------------------------------------------------------------- names and units


def test_columns_may_have_other_names(sample: Sample) -> None:
    usual = measured(sample.load())
    text = FILES["observations.csv"].replace("photo,point,x,y", "Bild,Punkt,xs,ys")
    sample.write("observations.csv", text)
    sample.change("project.yaml", "  unit: mm\n", "  unit: mm\n  columns: {photo: Bild, point: PUNKT, x: xs, y: ys}\n")
    assert measured(sample.load()) == usual


def test_a_declared_column_goes_before_its_usual_name(sample: Sample) -> None:
    usual = measured(sample.load())
    rows = FILES["observations.csv"].splitlines()
    text = "\n".join(
        [
            "photo,point,x,y,x refined",
            *(f"{row.rsplit(',', 2)[0]},0,{row.rsplit(',', 1)[1]},{row.split(',')[2]}" for row in rows[1:]),
        ]
    )
    sample.write("observations.csv", text + "\n")
    sample.change("project.yaml", "  unit: mm\n", "  unit: mm\n  columns: {x: x refined}\n")
    assert measured(sample.load()) == usual


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ("{photo: Bild}", ("observations.csv:1", "there is no column `bild`")),
        ("{foto: Bild}", ("project.yaml:19", "`foto` is no column of this table", "did you mean `photo`?")),
        ("[photo]", ("project.yaml:19", "columns")),
        ("{photo: }", ("project.yaml:19", "photo")),
    ],
)
def test_declared_columns_that_are_wrong(sample: Sample, columns: str, words: tuple[str, ...]) -> None:
    sample.change("project.yaml", "  unit: mm\n", f"  unit: mm\n  columns: {columns}\n")
    assert any(all(word in line for word in nonempty(words)) for line in told(sample)), told(sample)


def test_tenths_of_micrometres(sample: Sample) -> None:
    usual = measured(sample.load())
    rows = [row.split(",") for row in FILES["observations.csv"].splitlines()[1:]]
    text = "photo,point,x,y\n" + "".join(f"{a},{b},{float(x) * 1e4:.0f},{float(y) * 1e4:.0f}\n" for a, b, x, y in rows)
    sample.write("observations.csv", text)
    sample.change("project.yaml", "  unit: mm\n", "  unit: 0.1um\n")
    sample.change("project.yaml", "sigma: 0.005", "sigma: 50")
    found = measured(sample.load())
    assert {key: pytest.approx(value) for key, value in usual.items()} == found
