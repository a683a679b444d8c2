"""``photostrip terrestrial`` as a user calls it: answers in every form, files, pictures, and what is refused."""

# ruff: noqa: E501 (a message stands on one line, as the user reads it)
from __future__ import annotations

import gzip
import json
import math
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from photostrip.project import terrestrial as keys
from photostrip.terrestrial.monitoring import monitor
from tests.calls import rows, words
from tests.loops import nonempty
from tests.source_tree import ROOT
from tests.terrestrial.simulated import CENTERS, FOCAL, TRUTH, attitude, coordinates, photo, project, write
from tests.terrestrial.test_one_photo import CENTRE, PLACES, directions, from_the_theodolite

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.calls import Call

    Answer = Callable[..., Any]
    Said = Callable[..., str]

PAIRS, TURNED_PAIRS = ("xx", "xy", "xz", "zz"), ("yy", "xy", "yz", "zz")
PHOTHEO, UMK = "camera=Photheo 19/1318", "camera=UMK 10/1318"


@pytest.fixture
def told(call: Call) -> Call:
    """Give a function that runs a command; what has an equals sign in it and is no option is a key that is set."""

    def typed(*arguments: object) -> tuple[int, str, str]:
        keys = [f"--set={each}" if "=" in str(each) and str(each)[:1] not in "-/" else each for each in arguments]
        return call("terrestrial", *keys)

    return typed


@pytest.fixture
def said(told: Call) -> Said:
    """Give a function that gives what a command prints, which must succeed."""

    def typed(*arguments: object) -> str:
        code, out, err = told(*arguments)
        assert (code, err if "csv" not in arguments else "") == (0, "")  # CSV has no room for notes
        return out

    return typed


@pytest.fixture
def answer(said: Said) -> Answer:
    """Give a function that gives the JSON answer of a command."""
    return lambda *arguments: json.loads(said(*arguments, "--format", "json"))


# ------------------------------------------------------------------------------------------------------ directions


def test_directions_and_photo_are_inverse(tmp_path: Path, said: Said) -> None:
    (table := tmp_path / "points.csv").write_text("point,x,z\nA,80,60\nB,-70.5,12.25\nC,0,0\n", encoding="utf-8")
    camera = "camera={preset: Photheo 19/1318, principal_point: [0.1, -0.2]}"
    held = (camera, "alpha=350", "omega=12", "kappa=-3", "angles=gon")
    out = said("directions", f"table={table}", *held, "--format", "csv")
    (there := tmp_path / "directions.csv").write_text(out, encoding="utf-8")
    assert all(0 <= float(row["lambda"]) < 400 for row in nonempty(rows(out)))
    out = said("photo", f"table={there}", *held, "--format", "csv", "-q")
    assert [row["point"] for row in rows(out)] == ["A", "B", "C"]
    back = [[float(row["x"]), float(row["z"])] for row in rows(out)]
    np.testing.assert_allclose(np.array(back), np.array([[80.0, 60.0], [-70.5, 12.25], [0.0, 0.0]]), atol=1e-5)


def test_keys_and_file_and_units_say_the_same(tmp_path: Path, answer: Answer) -> None:
    found = answer("directions", PHOTHEO, "at=[[80, 60]]", "sigma_um=5")
    assert found["points"][0]["beta"] == pytest.approx(16.227254023233513, abs=1e-8)  # more digits than are shown
    assert found["orientation"] == {"unit": "deg", "alpha": 0.0, "omega": 0.0, "kappa": 0.0}
    assert answer("directions", PHOTHEO, "at=[[80000, 60000]]", "unit=um", "sigma_um=5") == found
    file = tmp_path / "keys.yaml"
    file.write_text("photostrip_terrestrial: 1\ncamera: Photheo 19/1318\nat: [[80, 60]]\nsigma_um: 5\n")
    assert answer("directions", file) == found


def test_azimuths_are_never_negative_nor_a_full_circle(answer: Answer) -> None:
    found = answer("directions", PHOTHEO, "at=[[-80, 0], [0, 0]]", "alpha=360")
    assert [point["lambda"] for point in found["points"]] == [pytest.approx(360 - 22.83365417791754), 0.0]


def test_accuracy_over_the_photo_in_every_form(said: Said, answer: Answer) -> None:
    command = ("accuracy", UMK, "step=40")
    found = answer(*command)
    assert [(row["x"], row["z"]) for row in found["points"]] == [(x, z) for z in (0, 40, 60) for x in (0, 40, 80)]
    assert {key: float(value) for key, value in rows(said(*command, "--format", "csv"))[-1].items()} == found["points"][
        -1
    ]
    assert re.search(r"^ +60 +8\.84 +8\.37 +7\.29$", said(*command), re.MULTILINE)
    assert "| 60 | 8.84 | 8.37 | 7.29 |" in said(*command, "--format", "md")
    corner = answer(*command, "as_printed=true")["points"][-1]
    sizes = [corner[f"{name}_arcsec"] for name in ("horizontal", "vertical", "vertical_eq5", "vertical_exact")]
    assert sizes == pytest.approx([5.6945, 8.1779, 9.6846, 7.2926], abs=1e-4)
    assert "inherit sec(lambda') from eq. 3, where cos(lambda') is right" in words(said(*command, "as_printed=true"))


def test_a_tilted_camera_has_a_table_of_the_whole_photo(answer: Answer) -> None:
    found = answer("accuracy", UMK, "step=60", "omega=15")
    assert sorted({row["x"] for row in found["points"]}) == [-80, -60, 0, 60, 80]
    value = {(row["x"], row["z"]): row for row in found["points"]}
    assert value[0, 60]["horizontal_arcsec"] > value[0, -60]["horizontal_arcsec"]
    assert value[0, 60]["vertical_arcsec"] == value[0, -60]["vertical_arcsec"]


def test_rounds_of_every_theodolite_for_the_stricter_end_of_the_base(answer: Answer) -> None:
    command = ("accuracy", UMK, "sigma_um=1.3")
    one, other, both = answer(*command), answer(*command, "omega=25"), answer(*command, "right.omega=25")
    assert both["needed_arcsec"] == [
        min(pair) for pair in zip(one["needed_arcsec"], other["needed_arcsec"], strict=True)
    ]
    assert both["needed_arcsec"][0] < one["needed_arcsec"][0]
    for row in nonempty(both["rounds"]):
        sizes = row["sigma_horizontal_arcsec"], row["sigma_vertical_arcsec"]
        counts = [math.ceil((size / need) ** 2) for size, need in zip(sizes, both["needed_arcsec"], strict=True)]
        assert [row["horizontal"], row["vertical"]] == counts
    assert {row["theodolite"]: row["rounds"] for row in one["rounds"]}["T2"] == 2  # (2 / 1.896)^2 = 1.1


def test_a_theodolite_may_be_worse_in_height(said: Said, answer: Answer) -> None:
    command = ("theodolite", UMK, "sigma_arcsec=2", "rounds=4")
    found = answer(*command, "sigma_um=0.5")
    supported = {"by_horizontal": 0.878, "by_vertical": 0.6856, "by_both": 0.878}
    assert found["supported_um"] == pytest.approx(supported, abs=1e-3)
    assert (found["wanted"]["rounds_horizontal"], found["wanted"]["rounds_vertical"]) == (13, 8)
    text = said(*command, "vertical_arcsec=6")
    assert "supports in the photo  2.06 µm everywhere (horizontal 0.88, vertical 2.06)" in text


def test_a_theodolite_has_its_standard_error_in_its_name(answer: Answer) -> None:
    found = answer("theodolite", UMK, "theodolite=Theo 020")
    assert found == answer("theodolite", UMK, f"sigma_arcsec={20e-6 * 206264.80624709636}")


def test_cameras_are_listed(tmp_path: Path, said: Said, answer: Answer) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("photostrip_cameras: 1\ncameras: {P32: {principal_distance: 64.12}}\n", encoding="utf-8")
    out = said("cameras", f"presets={mine}")
    assert re.search(r"^P32 +64\.12 +0 +0 +–$", out, re.MULTILINE)
    found = answer("accuracy", f"presets={mine}", "camera={preset: P32, format: [80, 60]}")
    assert found["camera"]["principal_distance_mm"] == 64.12


# ---------------------------------------------------------------------------------------------------------- orient


def sightings_csv(unit: float = 1.0, per_radian: float = 180 / np.pi) -> str:
    """Points of a photo with alpha 35, omega 4, kappa -1 degrees, free of errors but for rounding."""
    given = directions(PLACES, (np.radians(35), np.radians(4), np.radians(-1)))
    lines = ["point,x,z,lambda,beta"]
    lines += [
        f"P{number},{x * unit:.6f},{z * unit:.6f},{lam * per_radian:.8f},{beta * per_radian:.8f}"
        for number, ((x, z), (lam, beta)) in enumerate(zip(PLACES, given, strict=True))
    ]
    return "\n".join(lines) + "\n"


INTERIOR = ("camera.principal_distance=100", "free=[principal-distance, principal-point]")


@pytest.mark.parametrize("unit", ["deg", "gon"])
def test_orient_gives_back_the_photo(unit: str, tmp_path: Path, answer: Answer) -> None:
    table = tmp_path / "s.csv"
    full = 180 if unit == "deg" else 200
    table.write_text(sightings_csv(per_radian=full / np.pi), encoding="utf-8")
    found = answer("orientation", f"table={table}", *INTERIOR, f"angles={unit}")
    value = {row["name"]: row["value"] for row in found["elements"]}
    turned = [35 * full / 180, 4 * full / 180, -1 * full / 180]
    assert [value[name] for name in ("alpha", "omega", "kappa")] == pytest.approx(turned, abs=1e-6)
    assert [value[name] for name in ("f", "x0", "z0")] == pytest.approx([100.25, *CENTRE], abs=2e-5)
    assert (found["redundancy"], found["rejected"]) == (2 * len(PLACES) - 6, [])


def test_orient_reports_a_gross_error(tmp_path: Path, told: Call, said: Said) -> None:
    table = tmp_path / "s.csv"
    lines = sightings_csv(1000).splitlines()
    point, x, *rest = lines[5].split(",")
    lines[5] = ",".join([point, f"{float(x) + 150:.3f}", *rest])  # micrometres
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    camera = "camera={principal_distance: 100.25, principal_point: [0.12, -0.21]}"
    held = ("orientation", f"table={table}", camera, "unit=um", "rounds=4")
    for method in ("deletion", "stated"):
        code, text, err = told(*held, f"screening={method}")
        assert (code, err) == (0, "")
        assert re.search(r"^P4 .* rejected$", text, re.MULTILINE)
    text = said(*held, "screening=none")
    assert "The scatter of the directions does not agree with the stated standard deviations." in text
    out = said(*held, "--format", "csv")
    assert [row["point"] for row in rows(out) if row["used"] == "0"] == ["P4"]


def test_standard_deviations_of_the_rows_count(tmp_path: Path, answer: Answer) -> None:
    table = tmp_path / "s.csv"
    head, *lines = sightings_csv().splitlines()
    table.write_text("\n".join([head, *lines]), encoding="utf-8")
    first = answer("orientation", f"table={table}", *INTERIOR)
    own = [f"{head},sx,sz,s_lambda,s_beta", *(f"{line},0.01,0.01,4,4" for line in lines)]
    table.write_text("\n".join(own), encoding="utf-8")
    second = answer("orientation", f"table={table}", *INTERIOR)
    for one, two in nonempty(zip(first["elements"], second["elements"], strict=True)):
        assert two["sigma"] == pytest.approx(2 * one["sigma"], rel=1e-3)


def test_eccentricity_and_refraction_of_a_photo(tmp_path: Path, told: Call, said: Said, answer: Answer) -> None:
    angles = (0.4, 0.08, -0.02)
    given = from_the_theodolite(angles, 0.12, refraction=0.3)
    table = tmp_path / "s.csv"
    lines = ["point,x,z,lambda,beta,distance"]
    values = np.column_stack([given.xz, np.degrees(given.directions), given.distances]).tolist()
    lines += [f"P{number}," + ",".join(f"{value:.10f}" for value in row) for number, row in enumerate(values)]
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    camera = "camera={principal_distance: 100.25, principal_point: [0.12, -0.21]}"
    held = ("orientation", f"table={table}", camera, "eccentricity=0.12")
    found = answer(*held, "free=[refraction]")
    element = {row["name"]: row for row in found["elements"]}
    assert element["k"]["value"] == pytest.approx(0.3, abs=1e-5)
    assert element["alpha"]["value"] == pytest.approx(np.degrees(0.4), abs=1e-7)
    assert found["eccentricity_m"] == 0.12
    text = said(*held, "refraction=0.3")
    assert "front node 0.12 m ahead of the theodolite's axes" in words(text)
    assert "refraction k 0.3 of the photo's rays" in words(text)
    code, _, err = told(*held, "refraction=30")
    assert (code, "refraction: 30 is out of range" in err) == (2, True)
    table.write_text(sightings_csv(), encoding="utf-8")
    code, _, err = told(*held)
    assert (code, "that of P0 and 10 more is not given" in words(err)) == (3, True)


# ---------------------------------------------------------------------------------------------------- displacement


def station_sightings(side: int, eccentricity: float) -> tuple[str, str]:
    """Give the table of directions from a theodolite behind the camera of a station, and the position of its axes."""
    turn, center = attitude(*TRUTH.attitudes[side]), CENTERS[side]
    axes = center - eccentricity * turn[:, 1]
    image = photo(TRUTH.points, center, turn, FOCAL[side])
    seen = TRUTH.points - axes
    distance = np.linalg.norm(seen, axis=1)
    horizontal = np.degrees(np.arctan2(seen[:, 0], seen[:, 1]))
    vertical = np.degrees(np.arcsin(seen[:, 2] / distance))
    lines = ["point,x,z,lambda,beta,distance"]
    for number, row in enumerate(np.column_stack([image, horizontal, vertical, distance]).tolist()):
        lines.append(f"P{number}," + ",".join(f"{value:.10f}" for value in row))
    return "\n".join(lines) + "\n", str(axes.tolist())


def test_correction_directions_from_both_ends_of_the_base_feed_the_displacements(
    tmp_path: Path, told: Call, answer: Answer
) -> None:
    survey = write(tmp_path)
    by_angles = answer("displacement", survey)
    text = re.sub(r", alpha: .*", "}", project())
    for side, name in enumerate(("left", "right")):
        table, axes = station_sightings(side, 0.15)
        (tmp_path / f"{name}.csv").write_text(table, encoding="utf-8")
        place = str(CENTERS[side].tolist())
        assert place in text
        text = text.replace(f"position: {place}", f"position: {axes}, eccentricity: 0.15, directions: {name}.csv")
    (tmp_path / "survey.yaml").write_text(text, encoding="utf-8")
    by_directions = answer("displacement", survey)
    first, second = (
        np.array([[row[name] for name in ("dx", "dy", "dz")] for row in found["displacements"]], float)
        for found in (by_angles, by_directions)
    )
    assert len(first) == 24
    np.testing.assert_allclose(second, first, atol=2e-6)
    (tmp_path / "survey.yaml").write_text(text.replace("left.csv", "left.csv, omega: 2"), encoding="utf-8")
    code, _, err = told("displacement", survey)
    assert (code, "`directions` gives the orientation of the photo, and `omega` another one" in words(err)) == (2, True)


@pytest.mark.slow
def test_displacement_in_every_form(tmp_path: Path, told: Call, said: Said, answer: Answer) -> None:
    survey = write(tmp_path)
    document = answer("displacement", survey)
    result = monitor(TRUTH.measure(1), TRUTH.pair)
    assert document["axes"] == ["east", "north", "up"]
    last = [row for row in document["displacements"] if row["epoch"] == "epoch 2"]
    for row, step in nonempty(enumerate(last)):
        assert step["point"] == f"P{row}"
        found = [step[name] for name in ("dx", "dy", "dz")]
        assert found == pytest.approx(result.since_first[1].values[row], abs=2e-3)  # coordinates have four decimals
        assert [step[f"sigma_{axis}"] for axis in "xyz"] == pytest.approx(result.since_first[1].sigma[row], rel=1e-2)
    turned = [(row["epoch"], row["side"]) for row in document["cameras"] if row["turned"]]
    assert turned == [("epoch 2", "left")]
    _, out, err = told("displacement", survey, "--format", "csv")
    assert "note: epoch epoch 2: the left camera turned by" in err
    table = rows(out)
    assert [(row["point"], row["epoch"]) for row in table[::12]] == [("P0", "epoch 1"), ("P0", "epoch 2")]
    assert float(table[12]["dx"]) == last[0]["dx"]
    for title in ("Cameras", "epoch 0 to epoch 1", "epoch 1 to epoch 2", "Rates", "Notes"):
        assert f"## {title}" in said("displacement", survey, "--format", "md")


def test_results_stand_in_the_order_of_the_axes(tmp_path: Path, answer: Answer) -> None:
    (tmp_path / "north").mkdir()
    text = project().replace("[east, north, up]", "[north, east, up]")
    text = text.replace("[1000.0, 2000.0, 150.0]", "[2000.0, 1000.0, 150.0]")
    text = text.replace("[1040.0, 2005.0, 152.0]", "[2005.0, 1040.0, 152.0]")
    east = answer("displacement", write(tmp_path))
    north = answer("displacement", write(tmp_path / "north", text))
    assert north["axes"] == ["north", "east", "up"]
    for a, b in nonempty(zip(east["positions"], north["positions"], strict=True)):
        assert (a["x"], a["y"], a["z"]) == (b["y"], b["x"], b["z"])
    for c, d in nonempty(zip(east["displacements"], north["displacements"], strict=True)):
        turned = {"dx": "dy", "sigma_y": "sigma_x", "statistic": "statistic", "ellipse_minor": "ellipse_minor"}
        turned |= {f"covariance_{one}": f"covariance_{two}" for one, two in zip(PAIRS, TURNED_PAIRS, strict=True)}
        assert [c[name] for name in turned] == [d[name] for name in turned.values()]


@pytest.mark.slow
def test_files_are_written_and_the_same_in_every_process(tmp_path: Path, told: Call) -> None:
    survey, depfile = write(tmp_path), tmp_path / "deps"
    for ending in ("json", "csv", "svg"):
        seen = []
        for name in ("there", "here"):
            out = tmp_path / f"{name}.{ending}"
            options = ["displacement", survey, "-q", "-o", out, "--depfile", depfile]
            if name == "there":
                command = [sys.executable, "-m", "photostrip", "terrestrial", *map(str, options)]
                environment = os.environ | {"PYTHONHASHSEED": "1", "PYTHONPATH": str(ROOT)}
                assert subprocess.check_output(command, env=environment, stderr=subprocess.STDOUT) == b""
            else:
                assert told(*options) == (0, "", "")
            assert depfile.read_text().startswith(f"{out}: {survey} ")
            seen.append(out.read_bytes())
        assert seen[0] == seen[1]
        assert str(tmp_path).encode() not in seen[0]
        assert ending != "csv" or not re.search(rb"\de[+-]?\d", seen[0])  # no exponents


def normal_case(table: Path, *more: str) -> tuple[object, ...]:
    kind = f"measurements={{pseudo_parallaxes: {table}, unit: mm, sigma: 0.005}}"
    return ("displacement", "base=50", "cameras.K.principal_distance=1000", kind, *more)


def test_keys_alone_are_enough_for_the_normal_case(tmp_path: Path, answer: Answer) -> None:
    table = tmp_path / "pseudo.csv"
    table.write_text("point,x,z,p,dx,dz,dx_right\n1,30,-12,80,0.35,-0.2,0.1\n", encoding="utf-8")
    document = answer(*normal_case(table))
    (step,) = document["displacements"]
    assert [step[f"d{axis}"] for axis in "xyz"] == [0.159657, -1.94704, -0.101246]
    assert [step[f"sigma_{axis}"] for axis in "xyz"] == pytest.approx([0.002267, 0.054899, 0.003186], rel=2e-3)
    assert document["axes"] == ["right", "ahead", "up"]
    packed = tmp_path / "pseudo.csv.gz"
    packed.write_bytes(gzip.compress(table.read_bytes()))
    assert answer(*normal_case(packed)) == document


def test_a_table_of_coordinates_and_stable_points(tmp_path: Path, answer: Answer) -> None:
    table = tmp_path / "c.csv"
    lines = ["epoch,photo,point,x,z"]
    for number, (x, z) in enumerate([(-60, 30), (50, 40), (-40, -50), (60, -30), (0, 0)]):
        for epoch in ("a", "b"):
            moved = 0.4 if (epoch, number) == ("b", 4) else 0.0
            lines += [f"{epoch},left,{number},{x + moved},{z}", f"{epoch},right,{number},{x - 40 + moved},{z}"]
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    measured = f"measurements={{coordinates: {table}, unit: mm, sigma: 0.005}}"
    camera = "cameras.U=UMK 10/1318"
    document = answer("displacement", "stable=[0, 1, 2, 3]", "base=20", camera, measured)
    assert document["significant"] == 1
    (moved,) = [row for row in document["displacements"] if row["point"] == "4"]
    assert moved["dx"] == pytest.approx(20 * 0.4 / 40, abs=1e-6)


def test_a_point_without_a_displacement_has_a_reason_in_every_form(tmp_path: Path, said: Said, answer: Answer) -> None:
    table = "\n".join(line for line in coordinates().splitlines() if not line.startswith("epoch 1,left,P7,")) + "\n"
    survey = write(tmp_path, table=table)
    document = answer("displacement", survey)
    assert "P7" in [row["point"] for row in document["rates"]]
    out = said("displacement", survey, "--format", "csv", "-q")
    (row,) = [each for each in rows(out) if (each["point"], each["epoch"]) == ("P7", "epoch 1")]
    assert (row["dx"], row["reason"]) == ("", "not measured")
    text = said("displacement", survey)
    assert re.search(r"^P7 +– .* not measured$", text, re.MULTILINE)


def texts(svg: bytes) -> str:
    root = ET.fromstring(svg)  # noqa: S314 (our own file)
    return " ".join(" ".join(each.itertext()) for each in root.iter("{http://www.w3.org/2000/svg}text"))


@pytest.mark.slow
def test_displacements_are_drawn(tmp_path: Path, told: Call, answer: Answer) -> None:
    plot, survey = tmp_path / "p.svg", write(tmp_path)
    assert told("displacement", survey, "-o", plot)[0] == 0
    shown = texts(plot.read_bytes())
    assert "quarry: displacements from epoch 0 to epoch 2" in shown
    assert all(f"P{number}" in shown for number in range(12))
    moved = answer("displacement", survey)["displacements"][-1]
    assert f">{moved['point']}: {moved['length']:.4g} m<" in plot.read_text(encoding="utf-8")


# --------------------------------------------------------------------------------------------------------- refusals

D100 = "camera={principal_distance: 100}"
WHOLE = "camera={principal_distance: 100, format: [100, 80]}"


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (("directions", "at=[[1, 2]]"), "--set: camera: `camera` is missing; expected camera: its name in a list, or preset"),
        (("directions", "camera=UMK", "at=[[1, 2]]"), "--set: camera.preset: there is no preset `UMK`; expected one of Photheo 19/1318, UMK 10/1318"),
        (("directions", D100), "--set: no points are given; expected `table` or `at`"),
        (("directions", D100, "table=far.csv", "at=[[1, 2]]"), "--set: points are given twice"),
        (("directions", D100, "at=[[1, 20000]]"), "--set: at[0][1]: 20000 is out of range; expected -10000 to 10000 mm"),
        (("directions", D100, "table=far.csv"), "far.csv:2:5: z: 2e+09 is out of range; expected -10000 to 10000 mm"),
        (("directions", D100, "table=far.csv", "unit=um"), "far.csv:2:5: z: 2e+09 is out of range; expected -1e+07 to 1e+07 um"),
        (("photo", D100, "at=[[1001, 2]]"), "--set: at[0][0]: 1001 is out of range; expected -1000 to 1000 deg"),
        (("orientation", D100, "table=sigma.csv"), "sigma.csv:2:11: sx: 50 is out of range; expected 1e-06 to 10 mm"),
        (("displacement", "survey.yaml", "measurements.sigma=50"), "--set: measurements.sigma: 50 mm is out of range; expected 1e-06 to 10 mm: is the unit right?"),
        (("directions", D100, "at=[[1, 2]]", "omega=90"), "--set: omega: with 90 deg the camera looks straight up or down"),
        (("directions", D100, "table=missing.csv"), "--set: table: missing.csv does not exist"),
        (("directions", D100, "table=wrong.csv"), "wrong.csv:2:3: x: `a` is not a number; expected a number"),
        (("directions", D100, "table=twice.csv"), "twice.csv:3:1: point: point A stands in line 2 already; keep one of the two"),
        (("photo", D100, "at=[[100, 2]]"), "--set: at[0]: the direction to point 1 is 90 degrees or more from the optical axis; expected a direction into the photo"),
        (("photo", D100, "table=behind.csv"), "behind.csv:3:3: lambda: the direction to point B is 90 degrees or more from the optical axis"),
        (("photo", D100, "table=behind.csv"), "behind.csv:4:5: beta: the direction to point C is not below the zenith; expected an elevation between -90 and 90 degrees"),
        (("accuracy", D100), "--set: camera.format: the camera camera has no format; expected [width, height] in mm"),
        (("theodolite", WHOLE), "--set: nothing says how well directions are measured; expected `sigma_arcsec` or `theodolite`"),
        (("theodolite", WHOLE, "theodolite=T3"), "--set: theodolite: `T3` is not known; expected one of Theo 010, Theo 020, Theo 080, T2"),
        (("theodolite", WHOLE, "theodolite=Theo 010", "sigma_arcsec=1"), "--set: sigma_arcsec: the theodolite and its standard deviation are both given"),
        (("accuracy", WHOLE, "right.omega=90"), "--set: right.omega: with 90 deg the camera looks straight up or down, and has no azimuth"),
        (("accuracy", WHOLE, "as_printed=true", "right.omega=3"), "--set: as_printed: the printed formulas hold for a level camera"),
        (("accuracy", WHOLE, "step=0.1"), "--set: step: a step of 0.1 mm gives more than 20000 points; expected a larger step"),
        (("accuracy", WHOLE, "as_printed=true", "omega=3"), "--set: as_printed: the printed formulas hold for a level camera; leave out `omega` and `kappa`"),
        (("orientation", D100, "table=sights.csv", "free=[f]"), "--set: free[0]: `f` is not known; expected one of principal-distance, principal-point, refraction"),
        (("orientation", D100, "table=sights.csv"), "sights.csv:3:7: lambda: neither direction to point B is given; expected lambda, beta or both"),
        (("orientation", D100, "table=zenith.csv"), "zenith.csv:2:8: beta: 95 deg is not below the zenith; expected an elevation between -90 and 90 degrees, not a zenith distance"),
        (("displacement", "survey.yaml", "processing.signif=1"), "--set: processing.signif: the key `signif` is not known; did you mean `significance`?"),
        (("displacement", "nothing.yaml"), "nothing.yaml: does not exist"),
    ],
)  # fmt: skip
def test_wrong_keys_and_data_are_told_with_exit_2(
    command: tuple[str, ...], expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: Call
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path)
    for name, text in {
        "wrong.csv": "point,x,z\nA,a,2\n",
        "twice.csv": "point,x,z\nA,1,2\nA,3,2\n",
        "behind.csv": "point,lambda,beta\nA,10,2\nB,100,2\nC,0,90\n",
        "sights.csv": "point,x,z,lambda,beta\nA,1,2,3,4\nB,1,3,,\n",
        "far.csv": "point,x,z\nA,1,2e9\n",
        "sigma.csv": "point,x,z,lambda,beta,sx,sz\nA,1,2,3,4,50,1\n",
        "zenith.csv": "point,x,z,lambda,beta\nA,1,2,,95\n",
    }.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    code, out, err = told(*command)
    assert (code, out) == (2, "")
    lines = err.splitlines()
    assert all(line.startswith("error: ") for line in nonempty(lines))
    assert any(line.removeprefix("error: ").startswith(expected) for line in lines), err


def test_weak_geometry_has_exit_3(tmp_path: Path, told: Call) -> None:
    text = project().replace("[1040.0, 2005.0, 152.0]", "[1000.0, 2000.0, 150.0]")
    code, out, err = told("displacement", write(tmp_path, text))
    assert (code, out) == (3, "")
    assert err == "error: the left and the right station are at the same place: there is no base\n"
    (table := tmp_path / "s.csv").write_text("point,x,z,lambda,beta\nA,1,2,3,4\n", encoding="utf-8")
    code, _, err = told("orientation", f"table={table}", UMK)
    assert code == 3
    assert "1 point with 2 directions cannot determine alpha, omega, kappa" in err


@pytest.mark.parametrize(("most", "code"), [(20, 0), (19, 2)])
def test_a_table_over_the_photo_has_a_largest_size(
    monkeypatch: pytest.MonkeyPatch, most: int, code: int, told: Call
) -> None:
    monkeypatch.setattr(keys, "MOST_POINTS", most)
    found, _, err = told("accuracy", WHOLE, "step=20")
    assert (found, "gives more than 19 points" in err) == (code, code == 2)


# ------------------------------------------------------------------------------------------------------ one station


CHANGES = """\
point,x,z,dx,dz,distance,distance_later
A,-60,30,0.0241,0.0105,80,
B,55,35,0.0230,-0.0121,120,
C,-50,-40,0.0190,0.0112,60,
D,62,-30,0.0188,-0.0130,150,
1,5,10,0.0900,0.0310,95.0,94.92
2,20,-5,0.0602,-0.0400,110,
"""


def test_displacements_from_one_station(tmp_path: Path, answer: Answer) -> None:
    (table := tmp_path / "changes.csv").write_text(CHANGES, encoding="utf-8")
    arguments = ("one-station", UMK, "stable=[A, B, C, D]", "sigma_um=3")
    found = answer(*arguments, f"table={table}")
    point = {each["point"]: each for each in found["points"]}
    assert [each["components"] for each in found["points"]] == [2, 2, 2, 2, 3, 2]
    assert point["1"]["significant"]
    # 0.042 mm more than the turned camera moves it, at 110 m and f = 100 mm
    assert point["2"]["dx"] == pytest.approx(0.046, abs=0.002)
    micro = tmp_path / "micro.csv"
    lines = [line.split(",") for line in CHANGES.splitlines()]
    scaled = [[row[0], *(f"{float(cell) * 1000:.6f}" for cell in row[1:5]), *row[5:]] for row in lines[1:]]
    micro.write_text("\n".join(",".join(row) for row in (lines[0], *scaled)) + "\n", encoding="utf-8")
    again = answer(*arguments, f"table={micro}", "unit=um")
    assert again["points"] == found["points"]


@pytest.mark.parametrize(
    ("change", "arguments", "code", "message"),
    [
        (("", ""), ("stable=[A, E]",), 2, "has no point E"),
        (("", ""), ("stable=[A]",), 3, "three are needed"),
        (("80,", "-80,"), (), 2, "distance"),
        (("distance,", "depth,"), (), 2, "distance"),
        (("", ""), ("sigma_distance=-1",), 2, "sigma_distance: -1 is out of range"),
    ],
)
def test_what_one_station_cannot_tell_is_refused(
    change: tuple[str, str], arguments: tuple[str, ...], code: int, message: str, tmp_path: Path, told: Call
) -> None:
    table = tmp_path / "changes.csv"
    table.write_text(CHANGES.replace(*change, 1) if change[0] else CHANGES, encoding="utf-8")
    found, _, err = told("one-station", f"table={table}", UMK, *arguments)
    assert (found, message in words(err)) == (code, True)
