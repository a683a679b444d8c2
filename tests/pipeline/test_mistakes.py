"""Mistakes in whole projects: told in `check` and `run`, the cause first, and none where there is none."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

import photostrip
from benchmarks import causes, planted
from photostrip.cli.main import main
from photostrip.errors import PhotostripError
from photostrip.foreign.simulated import project_files
from photostrip.notes import LOST_SAY
from photostrip.pipeline import gate
from photostrip.pipeline.inputs import CameraPositions, Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.plausibility import KINDS
from photostrip.simulation import Control, Flight, Gnss, Ground, Image, Spec, Terrain, simulate
from tests.pipeline.blocks import moved, orientations, used_rows
from tests.simulated import inputs_of, settings_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Inputs
    from photostrip.simulation import Simulation

    Floats = NDArray[np.float64]


FOOT = 0.3048  # m
FRAMES = {
    "utm": Ground("EPSG:32633"),
    "south": Ground("EPSG:32719", ("north", "east", "up"), center_deg=(-68.0, -33.0)),
    "degrees": Ground("EPSG:4326"),
    "geocentric": Ground("geocentric", ("x", "y", "z")),
    "local": Ground("local"),
}


@cache
def simulation(frame: str = "utm") -> Simulation:
    """Simulate a strip over hills."""
    flight = Flight(photos=7, heading_deg=40.0, end_lap_percent=62.0)
    control, terrain = Control(bands=4, per_band=3, check=6), Terrain(relief=120.0)
    return simulate(Spec(seed=5, ground=FRAMES[frame], flight=flight, terrain=terrain, control=control))


def written(folder: Path, files: dict[str, str], more: str = "") -> Path:
    """Write the files of a project, with more lines at the end of it."""
    for path, text in files.items():
        (folder / path).write_text(text + (more if path == "project.yaml" else ""), encoding="utf-8")
    return folder / "project.yaml"


def findings_of(inputs: Inputs, settings: Settings | None = None) -> tuple[Finding, ...]:
    """Give what a run tells, whether it succeeds or not."""
    try:
        return triangulate(inputs, settings or Settings()).findings
    except PhotostripError as error:
        return error.findings


def planted_in(case: planted.Case, name: str) -> planted.Planted:
    """Give the inputs with a mistake of the benchmark, and the ids that it concerns."""
    wrong = planted.mistake(name).plant(case)
    assert wrong is not None
    return wrong


@pytest.mark.parametrize("frame", FRAMES)
def test_a_sound_project_has_no_finding(frame: str) -> None:
    made = simulation(frame)
    assert findings_of(inputs_of(made), settings_of(made)) == ()
    assert gate.of_inputs(inputs_of(made), settings_of(made)) == ()


def test_a_strip_given_in_the_next_zone_is_named(tmp_path: Path) -> None:
    """Over Bulgaria, at the border of two zones of 1942, for whose datum EPSG names countries farther north."""
    ground, flight = Ground("EPSG:28404", center_deg=(24.0, 42.5)), Flight(photos=8, heading_deg=90.0)
    files = project_files(simulate(Spec(seed=3, ground=ground, flight=flight, control=Control(every=2, check=6))))
    files["project.yaml"] = files["project.yaml"].replace("EPSG:28404", "EPSG:28405")
    project = written(tmp_path, files)
    (finding,) = photostrip.check(project).findings
    assert (finding.code, finding.key) == ("P402", "control[0].crs")
    assert finding.fix == "name the crs of zone 4, with which its eastings begin"
    document = photostrip.run(project).document
    assert document["status"] == "look"
    assert document["verdict"]["look_at"][0].startswith("P402 control[0] lies about 17.9 E")


@pytest.mark.parametrize("factor", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("frame", ["utm", "south"])
def test_control_in_kilometres_or_without_its_last_digits(frame: str, factor: float) -> None:
    """North of the equator such numbers lie beside their zone, near its origin: runs were called good."""
    inputs = inputs_of(simulation(frame))
    (finding,) = findings_of(moved(inputs, np.arange(len(inputs.control)), inputs.control.enu * (factor - 1.0)))
    assert finding.code == "P402"
    assert finding.evidence["factor"] == pytest.approx(1 / factor)


@pytest.mark.parametrize("role", ["control", "check"])
@pytest.mark.parametrize(("axis", "step"), [(0, 7000.0), (1, -20.0), (1, 5.0), (2, 30.0)])
def test_a_slip_of_a_digit_is_named_with_the_digit(axis: int, step: float, role: str) -> None:
    inputs = inputs_of(simulation("utm"))
    row = int(used_rows(inputs)[4] if role == "control" else np.flatnonzero(inputs.control.check)[1])
    name, text = inputs.control.ids[row], f"{inputs.control.enu[row, axis]:.3f}"
    place = text.index(".") - 1 - int(np.log10(abs(step)))
    if not 0 <= int(text[place]) + np.sign(step) * int(str(abs(step))[0]) <= 9:
        step = -step  # a digit that would carry over is no single wrong digit
    (finding,) = findings_of(moved(inputs, np.array([row]), step * np.eye(3)[axis]))
    assert (finding.code, finding.points, finding.severity) == ("P406", (name,), "warning")
    assert "typing error" in finding.message
    assert finding.evidence["would_fit"] == pytest.approx(inputs.control.enu[row, axis], abs=1e-6)


def four_faults(folder: Path, frame: str) -> tuple[Path, str]:
    """Write a project with a wrong unit, an exchanged pair, left-handed control and a slip of a digit."""
    made = simulation(frame)
    files, photos = project_files(made), made.strips[0][1]
    project = files["project.yaml"]
    assert "unit: mm" in project
    project = project.replace("unit: mm", "unit: um").replace("sigma: 0.005", "sigma: 5")
    listed = project.index(f'"{photos[2]}"'), project.index(f'"{photos[3]}"')
    project = project[: listed[0]] + f'"{photos[3]}", "{photos[2]}"' + project[listed[1] + len(photos[3]) + 2 :]
    files["project.yaml"] = project.replace("axes: [east, north, up]", "axes: [north, east, up]")
    rows = files["control.csv"].splitlines()
    name, x, *rest = rows[5].split(",")
    digit = x.index(".") - 3
    rows[5] = ",".join([name, f"{x[:digit]}{(int(x[digit]) + 4) % 10}{x[digit + 1 :]}", *rest])
    files["control.csv"] = "\n".join(rows) + "\n"
    return written(folder, files), name


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["local", "utm"])
def test_four_mistakes_at_once_are_all_told(frame: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project, name = four_faults(tmp_path, frame)
    assert main(["run", str(project), "--format", "json"]) in {2, 3}
    by_code = {each["code"]: each for each in json.loads(capsys.readouterr().out)["findings"]}
    assert {"P101", "P201", "P401", "P406"} <= set(by_code)
    assert set(by_code["P201"]["photos"]) == {"1003", "1004"}
    assert (by_code["P406"]["file"], by_code["P406"]["line"]) == (str(tmp_path / "control.csv"), 6)
    assert (by_code["P406"]["points"], by_code["P101"]["key"]) == ([name], "observations.unit")
    assert main(["check", str(project), "--format", "json"]) == 2
    checked = {each["code"] for each in json.loads(capsys.readouterr().out)["projects"][0]["findings"]}
    assert {"P101", "P201", "P401", "P406"} <= checked


@pytest.mark.slow
def test_what_is_accepted_is_told_and_no_longer_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = project_files(made := simulation("utm"))
    rows = files["control.csv"].splitlines(keepends=True)
    kept = [row for row in rows if not row.startswith("G") or made.control.ids.index(row.split(",")[0]) < 4]
    project = written(tmp_path, files | {"control.csv": "".join(kept)})
    assert main(["check", str(project), "--quiet"]) == 0
    assert re.search("warning: .*P501", capsys.readouterr().out)
    with project.open("a", encoding="utf-8") as file:
        file.write("accept: [P501/A, P502]\n")
    assert main(["check", str(project), "--quiet"]) == 0
    assert "P501 accepted: " in capsys.readouterr().out
    assert main(["run", str(project), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert (result["findings"]["code"], result["findings"]["accepted"]) == (["P501"], [True])
    assert not any("P501" in text for text in result["verdict"]["look_at"])


def test_a_finding_that_does_not_exist_cannot_be_accepted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = written(tmp_path, project_files(simulation("utm")), "accept: [P999]\n")
    assert main(["check", str(project), "--quiet"]) == 2
    assert "there is no finding `P999`" in capsys.readouterr().out


@pytest.mark.slow
def test_images_that_no_lens_makes_are_refused_until_they_are_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = project_files(simulation("local"))
    wrong = files["project.yaml"].replace("principal_distance: 153", "principal_distance: 1530")
    project = written(tmp_path, files | {"project.yaml": wrong})
    assert main(["run", str(project), "--quiet"]) == 2
    assert "nothing is adjusted, unless `accept: [P105]`" in "".join(capsys.readouterr())
    assert not (tmp_path / "results").exists()
    with project.open("a", encoding="utf-8") as file:
        file.write("accept: [P105]\nprocessing: {adjustment: similarity, precision: false}\n")
    assert main(["run", str(project), "--quiet"]) in {0, 1, 3}  # it is adjusted, as far as that goes


@pytest.mark.slow
def test_an_error_fails_a_run_that_is_done(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = project_files(simulation("local"))
    heights = re.compile(r"(?m)^(\w+,[^,]*,[^,]*),([\d.]+)")
    files["control.csv"] = heights.sub(lambda row: f"{row[1]},{float(row[2]) / FOOT}", files["control.csv"])
    project = written(tmp_path, files, "processing: {adjustment: polynomial}\n")
    assert main(["run", str(project), "--format", "json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert (document["status"], document["findings"]["code"]) == ("failed", ["P405"])
    assert re.match("P405 .*heights in feet", document["verdict"]["look_at"][0])


HANDS = {  # what mirrors a strip: a file, what is replaced in it, and what would have to be written then
    "control": ("project.yaml", "[east, north, up]", "[north, east, up]", "control[0].axes=[east, north, up]"),
    "y": ("project.yaml", "y_axis: up", "y_axis: down", "observations.y_axis=up"),
    "x and y": ("observations.csv", ",x,y", ",y,x", "observations.columns={x: y, y: x}"),
    "": ("project.yaml", "[east, north, up]", "[north, east, up]", ""),  # left-handed control, and said so
}


@pytest.mark.slow
@pytest.mark.parametrize("cause", HANDS)
@pytest.mark.parametrize(("frame", "crs"), [("local", ""), ("utm", ""), ("", "local"), ("", "EPSG:27561")])
def test_each_cure_of_a_mirrored_strip_is_told_and_cures_it(
    frame: str, crs: str, cause: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They fit alike: only the place of the control, and the oblong format of Strasbourg, tell them apart."""
    sample, names = ROOT / "sample_data" / "sxb-strasbourg", ("project.yaml", "control.csv", "observations.csv")
    files = project_files(simulation(frame)) if frame else {name: (sample / name).read_text() for name in names}
    name, right, wrong, cure = HANDS[cause]
    files[name] = files[name].replace(right, wrong, 1).replace("crs: local", f"crs: {crs or frame}")
    if not cause:
        files["control.csv"] = files["control.csv"].replace("point,x,y", "point,y,x", 1)
    run = ["run", str(project := written(tmp_path, files)), "--quiet"]
    assert (main(run) > 1) == bool(cause)
    assert capsys.readouterr().err.count("error: ") == bool(cause)
    fixes = " ".join(each.fix for each in photostrip.check(project).findings if each.is_error)
    cures = [each.replace(": ", "=", 1) for each in re.findall("`(.*?)`", re.sub("`axes", "`control[0].axes", fixes))]
    expected: tuple[str, ...] = ("y", "x and y") if frame else ("x and y",) if cause == "x and y" else ("y",)
    if cause == "control" and "local" not in {frame, crs}:
        expected = ("control",)
    elif "local" in {frame, crs} and "y" in expected:
        expected = ("control", *expected)
    told = [HANDS[each][3].partition("=")[0] for each in expected if cause]
    assert ([each.partition("=")[0] for each in cures], cure in cures) == (told, bool(cause))
    for each in cures:
        assert main([*run, "--set", each, "--set", "tolerances={check_rms_xy: 0.3, check_rms_z: 1.0}"]) == 0
    assert "P204" not in capsys.readouterr().out


@pytest.mark.parametrize(("order", "both"), [([1, 0, 2], False), ([0, 1, 2], True)], ids=["control", "photos"])
def test_camera_positions_tell_exchanged_control_from_mirrored_photos(order: list[int], *, both: bool) -> None:
    made, one = simulate(replace(simulation("local").spec, gnss=Gnss())), np.ones((7, 3))
    inputs, xy = inputs_of(made), made.observations.xy * ([1, -1] if both else [1, 1])
    positions = CameraPositions(made.truth.photo_ids, made.frames[0], np.asarray(made.gnss), one > 0, one, one[:, 0])
    inputs = replace(inputs, observations=replace(inputs.observations, xy=xy), positions=positions)
    (finding,) = findings_of(replace(inputs, control=replace(inputs.control, enu=inputs.control.enu[:, order])))
    assert ("`control[0].axes: [north, east, up]` and `camera_positions.axes" in finding.fix) == both
    assert ("observations" in finding.fix) == both


@pytest.mark.parametrize(
    ("make", "seed", "search_cameras", "free"),
    [(planted.sound, 43003, False, False), (planted.block, 43001, True, False), (planted.sound, 43003, False, True)],
)
def test_a_shifted_photo_is_named_with_its_shift(
    make: Callable[[int], planted.Case], seed: int, *, search_cameras: bool, free: bool
) -> None:
    """Whatever is said of the calibration of its camera (`self_calibration: never`), and where nothing is given."""
    case = make(seed)
    inputs, ids = planted_in(case, "one photo shifted by 5 mm")
    inputs = replace(inputs, control=inputs.control.take(np.zeros(0, np.intp))) if free else inputs
    shift = (inputs.observations.xy - case.inputs.observations.xy)[case.shows(*ids)][0]
    bundle = replace(case.settings.bundle, search_cameras=search_cameras)
    settings = replace(case.settings, adjustment="bundle", bundle=bundle)
    (finding,) = (each for each in triangulate(inputs, settings).findings if each.code == "P109")
    assert set(finding.photos) == ids
    assert [float(finding.evidence[f"shift_{axis}_mm"]) for axis in "xy"] == pytest.approx(shift, abs=0.8)


def test_a_reduced_photo_is_named_with_its_scale() -> None:
    case = planted.sound(43006)
    inputs, ids = planted_in(case, "a photo at another height")
    (finding,) = (each for each in triangulate(inputs, case.settings).findings if each.code == "P109")
    assert set(finding.photos) == ids
    assert finding.evidence["scale"] == pytest.approx(1.0 / 1.5, abs=0.01)


@pytest.mark.parametrize("off", [[3.0, 2.0, 0.0], [0.0, 0.0, 3.6]])
def test_a_wrong_camera_position_is_laid_on_no_photo(off: list[float]) -> None:
    made, one = simulate(Spec(seed=20, flight=Flight(photos=6), gnss=Gnss())), np.ones((6, 3))
    given = np.asarray(made.gnss) + np.eye(6)[2][:, None] * off
    positions = CameraPositions(made.truth.photo_ids, made.frames[0], given, one > 0, 0.1 * one, one[:, 0])
    result = triangulate(replace(inputs_of(made), positions=positions), Settings())
    assert result.bundle is not None
    assert (result.findings, {(each.kind, each.row) for each in result.bundle.screened.out}) == ((), {("position", 2)})


def test_every_kind_of_mistake_is_planted_in_the_benchmark() -> None:
    assert {code for mistake in planted.MISTAKES for code in mistake.codes} - set(LOST_SAY) == set(KINDS)


def test_a_bundle_that_fails_is_explained_by_strips_adjusted_each_by_itself() -> None:
    """Three ids that each stand for two points of two strips bend the start of the bundle until rays run parallel."""
    with pytest.raises(photostrip.GeometryError) as caught:
        photostrip.run(ROOT / "tests" / "data" / "shared-ids" / "project.yaml")
    told = {(each.code, *each.points) for each in caught.value.findings}
    assert told == {("P301", name) for name in ("T000009", "T000022", "T000024")}


BOTH = {  # named by `check` and `run`; by the seed of a small project
    43003: (
        "image coordinates in another unit", "one photo in another unit", "one photo mirrored",
        "fiducial marks in another unit", "principal distance off by 1 to 3 %",
        "two neighbours exchanged in the list", "no overlap from one photo on", "a photo twice",
        "camera positions below ground", "their heights in feet", "one height of them off by half",
        "two camera positions exchanged", "one id for two points", "two ids for one point", "crs of another country",
        "control in feet (projected)", "all heights zero", "standard deviation of images in micrometres",
        "control at one end", "control in one half", "angles in another unit",
    ),
    43004: (
        "ids of one photo in the next row", "one of two lists in another frame", "heights of two kinds in two lists",
        "slip of a digit, control", "slip of a digit, polynomials", "a digit written twice",
        "slip of a digit, two others exchanged", "two control points exchanged",
        "ids of given points in the next row", "one given point in other columns",
    ),
    43001: ("angles in another system",),
}  # fmt: skip
BY_RUN = {
    43004: (
        "pixels of an image of another width", "principal point off by 0.05 to 0.3 mm",
        "second list 0.6 m up or down, block",
    ),
    43001: ("principal distance of another lens", "slip of a digit, models"),
    43003: (
        "film 0.1 to 0.3 % short or long one way", "one id for two points nearby in two strips",
        "all check points shifted", "all check points shifted, block", "all check points shifted, models",
        "k1 and k2 not stated",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "seed", "by_check"),
    [(name, seed, kinds is BOTH) for kinds in (BOTH, BY_RUN) for seed, names in kinds.items() for name in names],
)
def test_a_mistake_is_what_is_named_first(name: str, seed: int, *, by_check: bool) -> None:
    case = (mistake := planted.mistake(name)).make(seed)
    inputs, ids = planted_in(case, name)
    found = causes.told(inputs, mistake.settings(case))
    assert causes.names_it(found.run[0], mistake, ids)
    assert any(causes.names_it(each, mistake, ids) for each in found.check) == by_check
    assert found.out <= causes.spoiled(case, inputs)


BLOCK = Spec(
    seed=4, flight=Flight(photos=6, strips=4, side_lap_percent=40.0), control=Control(per_band=1, check=4), gnss=Gnss()
)
BUNDLE = Settings(adjustment="bundle")


def codes_of(inputs: Inputs, settings: Settings) -> set[str]:
    """Collect codes of `check` and of `run`."""
    return {each.code for each in (*gate.of_inputs(inputs, settings), *triangulate(inputs, settings).findings)}


SMALL = {  # layouts of the benchmark, and a seed that makes a small project
    "6-60 photos, bands every 3-20, polynomial": 3, "blocks held by GNSS": 1, "strips held by GNSS": 4,
    "independent models": 1, "oblique mounts": 2, "oblique blocks": 2, "convergent strips": 1,
    "systematic errors of 5 µm, blocks": 4, "film with fiducial marks": 4, "two lists in two zones": 1,
    "given orientations": 3, "narrow field of view, 305 mm": 1, "UAV corridor, 35 mm, long side across": 4,
    "UAV corridor, 1 inch, long side along": 4, "kite, photos in any order": 1,
}  # fmt: skip


@pytest.mark.parametrize("name", SMALL)
def test_a_sound_project_has_no_finding_however_it_is_laid_out(name: str) -> None:
    make, may_be_told = causes.LAYOUTS[name]
    case = make(SMALL[name])
    found = causes.told(case.inputs, case.settings)
    assert (found.refusal, found.out) == ("", frozenset())
    assert {each.code for each in (*found.check, *found.run)} - may_be_told - set(LOST_SAY) == set()


@pytest.mark.slow
@pytest.mark.parametrize(("photos", "camera_height"), [(40, 1500.0), (110, 4000.0)])
def test_the_bend_of_a_long_strip_is_no_stretch_of_its_heights(photos: int, camera_height: float) -> None:
    """Level ground says nothing of the principal distance, however the strip bends."""
    flight, terrain = Flight(photos=photos, flying_height=camera_height), Terrain(relief=0.0)
    control, image = Control(every=6, per_band=2), Image(sigma_um=8.0)
    made = simulate(Spec(seed=80, flight=flight, terrain=terrain, control=control, image=image))
    assert codes_of(inputs_of(made), settings_of(made)) == set()


def test_photos_out_of_order_say_nothing_of_bases() -> None:
    inputs = inputs_of(simulate(replace(BLOCK, flight=replace(BLOCK.flight, end_lap_percent=72.0))))
    strips = [replace(each, photos=tuple(each.photos[row] for row in (0, 1, 3, 2, 4, 5))) for each in inputs.strips]
    assert codes_of(replace(inputs, strips=(strips[0], *inputs.strips[1:])), BUNDLE) == {"P201"}


@pytest.mark.slow
def test_a_start_may_be_far_off() -> None:
    """Orientations without influence are no observations: what they say of themselves matters where a run fails."""
    made = simulate(BLOCK)
    given, rng = orientations(made, observed=False), np.random.default_rng(5)
    far = replace(given, enu=given.enu + rng.normal(0.0, 500.0, given.enu.shape) - [0.0, 0.0, 1500.0])
    assert codes_of(replace(inputs_of(made), orientations=far), BUNDLE) == set()
    observed = replace(far, observed=True, sigma=np.full(far.enu.shape, 500.0), sigma_turns=np.full(far.enu.shape, 1.0))
    assert "P204" in codes_of(replace(inputs_of(made), orientations=observed), BUNDLE)


@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_the_bend_of_a_long_strip_is_no_typing_error(adjustment: str) -> None:
    """A check point between two bands lies metres from where a low polynomial puts it."""
    made = simulate(Spec(seed=10, flight=Flight(photos=60), control=Control(every=15), terrain=Terrain(relief=60.0)))
    assert codes_of(inputs_of(made), replace(settings_of(made), adjustment=adjustment)) == set()
