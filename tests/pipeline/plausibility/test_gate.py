"""Mistakes in whole projects: told in `check` and `run`, one and several at once, and none where there is none."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

import photostrip
from benchmarks import planted
from photostrip.cli.main import main
from photostrip.errors import PhotostripError
from photostrip.formats.output.simulation import project_files
from photostrip.geometry.rotation import angles
from photostrip.notes import LOST_SAY
from photostrip.pipeline.inputs import GivenOrientations, Settings
from photostrip.pipeline.plausibility import gate
from photostrip.pipeline.run import triangulate
from photostrip.plausibility import KINDS
from photostrip.simulation import (
    DIGITAL,
    Control,
    Film,
    Flight,
    GrossError,
    Ground,
    Image,
    Spec,
    Terrain,
    simulate,
)
from tests.pipeline.blocks import positions
from tests.results import write_project
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
BANDS = Control(bands=4, per_band=3, check=6)


def strip(frame: str = "utm") -> Spec:
    """Describe a strip over hills."""
    return Spec(
        seed=5,
        ground=FRAMES[frame],
        flight=Flight(photos=7, heading_deg=40.0, end_lap_percent=62.0),
        terrain=Terrain(relief=120.0),
        control=BANDS,
    )


@cache
def simulation(frame: str = "utm") -> Simulation:
    """Simulate a strip over hills."""
    return simulate(strip(frame))


def told(inputs: Inputs, settings: Settings | None = None) -> tuple[Finding, ...]:
    """Give what a run tells, whether it succeeds or not."""
    try:
        return triangulate(inputs, settings or Settings()).findings
    except PhotostripError as error:
        return error.findings


def codes(findings: tuple[Finding, ...]) -> list[str]:
    """Give the codes of findings."""
    return sorted({each.code for each in findings})


def planted_in(case: planted.Case, name: str) -> planted.Planted:
    """Give the inputs with a mistake of the benchmark, and the ids that it concerns."""
    wrong = planted.mistake(name).plant(case)
    assert wrong is not None
    return wrong


def with_control(inputs: Inputs, change: Callable[[Floats], Floats]) -> Inputs:
    """Change the given coordinates east, north, up."""
    return replace(inputs, control=replace(inputs.control, enu=change(inputs.control.enu.copy())))


def control_rows(inputs: Inputs) -> NDArray[np.intp]:
    """Give the rows of control points that are measured."""
    control = inputs.control
    return np.flatnonzero(~control.check & np.isin(control.ids, inputs.observations.point_ids))


# -------------------------------------------------------------------------------------------------- nothing wrong


@pytest.mark.parametrize("frame", FRAMES)
def test_a_sound_project_has_no_finding(frame: str) -> None:
    made = simulation(frame)
    assert told(inputs_of(made), settings_of(made)) == ()
    assert gate.of_inputs(inputs_of(made), settings_of(made)) == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "spec",
    [
        replace(strip(), camera=DIGITAL, image=Image(unit="px", y_axis="down")),
        replace(strip(), film=Film()),
        replace(strip(), gross_errors=(GrossError("image", count=4),)),
        replace(strip(), control=Control(bands=3, per_band=3, use={"xyz": 0.6, "xy": 0.2, "z": 0.2})),
        replace(strip(), control=replace(BANDS, second_crs="EPSG:32632", boundary_longitude_deg=15.3)),
        replace(
            strip(),
            ground=replace(FRAMES["utm"], center_deg=(18.0, 49.2)),
            control=replace(BANDS, second_crs="EPSG:32634", boundary_longitude_deg=18.0),
        ),
    ],
    ids=["pixels", "film", "gross errors of the image", "plan and height apart", "far beyond a zone", "two zones"],
)
def test_other_sound_projects_have_none_either(spec: Spec) -> None:
    made = simulate(spec)
    assert told(inputs_of(made), settings_of(made)) == ()
    assert gate.of_inputs(inputs_of(made), settings_of(made)) == ()


# ------------------------------------------------------------------------------------------------------- one mistake


def test_control_with_exchanged_axes_is_told_by_its_place() -> None:
    made = simulation("utm")
    wrong = with_control(inputs_of(made), lambda enu: enu[:, [1, 0, 2]])
    assert codes(gate.of_inputs(wrong, Settings())) == ["P401"]
    findings = told(wrong)
    assert codes(findings) == ["P401"]
    assert any("with east and north exchanged it would lie there" in each.message for each in findings)


@pytest.mark.parametrize("flip", [[1.0, -1.0], [-1.0, 1.0]])
def test_mirrored_images_are_told_apart_from_control_where_the_place_is_known(flip: list[float]) -> None:
    made = simulation("utm")
    inputs = inputs_of(made)
    wrong = replace(inputs, observations=replace(inputs.observations, xy=inputs.observations.xy * flip))
    (finding,) = told(wrong)
    assert finding.code == "P103"
    expected = "y counted the other way" if flip[1] < 0 else "negatives read as positives"
    assert expected in finding.message
    assert codes(gate.of_inputs(wrong, Settings())) == ["P103"]
    local = inputs_of(simulation("local"))
    both = replace(local, observations=replace(local.observations, xy=local.observations.xy * flip))
    (finding,) = told(both)
    assert finding.code == "P401"
    assert "or else the image coordinates are mirrored" in finding.message


def in_bulgaria(folder: Path, second: str | None = None) -> Path:
    """Write a strip over the border of two zones of 1942, for whose datum EPSG names countries farther north."""
    spec = Spec(
        seed=3,
        ground=Ground("EPSG:28404", center_deg=(24.0, 42.5)),
        flight=Flight(photos=8, heading_deg=90.0),
        control=Control(every=2, check=6, second_crs=second, boundary_longitude_deg=24.0 if second else None),
    )
    return write_project(folder, spec)


def test_a_strip_given_in_the_next_zone_is_named(tmp_path: Path) -> None:
    project = in_bulgaria(tmp_path)
    text = project.read_text(encoding="utf-8").replace("EPSG:28404", "EPSG:28405")
    project.write_text(text, encoding="utf-8")
    (finding,) = photostrip.check(project).findings
    assert (finding.code, finding.key) == ("P402", "control[0].crs")
    assert finding.fix == "name the crs of zone 4, with which its eastings begin"
    result = photostrip.run(project)
    assert result.status == "look"
    assert result.document["verdict"]["look_at"][0].startswith("P402 control[0] lies about 17.9 E")


@pytest.mark.parametrize("factor", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("frame", ["utm", "south"])
def test_control_in_kilometres_or_without_its_last_digits(frame: str, factor: float) -> None:
    """North of the equator such numbers lie beside their zone, near its origin: runs were called good."""
    (finding,) = told(with_control(inputs_of(simulation(frame)), lambda enu: enu * factor))
    assert finding.code == "P402"
    assert finding.evidence["factor"] == pytest.approx(1 / factor)


def second_list(inputs: Inputs, change: Callable[[Floats], Floats]) -> tuple[Inputs, tuple[str, ...]]:
    """Put every third control point into a list of its own and change it."""
    rows = control_rows(inputs)[::3]
    frame, enu = np.zeros(len(inputs.control), int), inputs.control.enu.copy()
    frame[rows] = 1
    enu[rows] = change(enu[rows])
    control = replace(inputs.control, frame=frame, enu=enu)
    names = tuple(inputs.control.ids[row] for row in rows)
    return replace(inputs, control=control, frames=inputs.frames * 2), names


@pytest.mark.slow
def test_heights_of_two_kinds() -> None:
    wrong, names = second_list(inputs_of(simulation("utm")), lambda enu: enu + np.array([0.0, 0.0, 47.3]))
    (finding,) = told(wrong)
    assert (finding.code, set(finding.points)) == ("P404", set(names))
    assert finding.evidence["offset_up_m"] == pytest.approx(47.3, abs=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("before", [False, True])
def test_one_of_two_lists_in_feet_or_elsewhere(before: bool) -> None:
    ask = (lambda wrong: gate.of_inputs(wrong, Settings())) if before else told
    feet, _ = second_list(inputs_of(simulation("local")), lambda enu: enu / FOOT)
    assert "P403" in codes(ask(feet))
    away, names = second_list(inputs_of(simulation("local")), lambda enu: enu + np.array([5000.0, -3000.0, 0.0]))
    (finding,) = [each for each in ask(away) if each.code == "P407"]
    assert set(finding.points) == set(names)
    assert finding.evidence["offset_east_m"] == pytest.approx(5000.0, abs=30.0 if before else 5.0)


@pytest.mark.parametrize(
    ("role", "axis", "step"),
    [
        ("control", 0, 7000.0),
        ("control", 2, 30.0),
        ("control", 1, 5.0),
        ("check", 0, 1000.0),
        ("check", 1, -20.0),
        ("check", 2, 30.0),
    ],
)
def test_a_slip_of_a_digit_is_named_with_the_digit(axis: int, step: float, role: str) -> None:
    inputs = inputs_of(simulation("utm"))
    row = int(control_rows(inputs)[4] if role == "control" else np.flatnonzero(inputs.control.check)[1])
    name = inputs.control.ids[row]
    text = f"{inputs.control.enu[row, axis]:.3f}"
    place = text.index(".") - 1 - int(np.log10(abs(step)))
    if not 0 <= int(text[place]) + np.sign(step) * int(str(abs(step))[0]) <= 9:
        step = -step  # a digit that would carry over is no single wrong digit

    def slip(enu: Floats) -> Floats:
        enu[row, axis] += step
        return enu

    (finding,) = told(with_control(inputs, slip))
    assert (finding.code, finding.points, finding.severity) == ("P406", (name,), "warning")
    assert "typing error" in finding.message
    assert finding.evidence["would_fit"] == pytest.approx(inputs.control.enu[row, axis], abs=1e-6)


@pytest.mark.slow
def test_two_control_points_exchanged() -> None:
    inputs = inputs_of(simulation("utm"))
    one, other = control_rows(inputs)[[1, 7]]

    def exchange(enu: Floats) -> Floats:
        enu[[one, other]] = enu[[other, one]]
        return enu

    findings = told(with_control(inputs, exchange))
    assert codes(findings) == ["P408"]
    assert set(findings[0].points) == {inputs.control.ids[one], inputs.control.ids[other]}


# ------------------------------------------------------------------------------------------------ several at once


def four_faults(folder: Path, frame: str) -> tuple[Path, str]:
    """Write a project with a wrong unit, an exchanged pair, left-handed control and a slip of a digit."""
    made = simulation(frame)
    files = project_files(made)
    project = files["project.yaml"]
    photos = made.strips[0][1]
    assert "unit: mm" in project
    project = project.replace("unit: mm", "unit: um").replace("sigma: 0.005", "sigma: 5")
    listed = project.index(f'"{photos[2]}"'), project.index(f'"{photos[3]}"')
    project = project[: listed[0]] + f'"{photos[3]}", "{photos[2]}"' + project[listed[1] + len(photos[3]) + 2 :]
    files["project.yaml"] = project.replace("axes: [east, north, up]", "axes: [north, east, up]")
    rows = files["control.csv"].splitlines()
    name, x, *rest = rows[5].split(",")
    digit = x.index(".") - 3
    wrong = f"{x[:digit]}{(int(x[digit]) + 4) % 10}{x[digit + 1 :]}"
    rows[5] = ",".join([name, wrong, *rest])
    files["control.csv"] = "\n".join(rows) + "\n"
    for path, text in files.items():
        (folder / path).write_text(text, encoding="utf-8")
    return folder / "project.yaml", name


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["local", "utm"])
def test_four_mistakes_at_once_are_all_told(frame: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project, name = four_faults(tmp_path, frame)
    assert main(["run", str(project), "--format", "json"]) in {2, 3}
    findings = json.loads(capsys.readouterr().out)["findings"]
    by_code = {each["code"]: each for each in findings}
    assert {"P101", "P201", "P401", "P406"} <= set(by_code)
    assert set(by_code["P201"]["photos"]) == {"1003", "1004"}
    assert by_code["P406"]["points"] == [name]
    assert (by_code["P406"]["file"], by_code["P406"]["line"]) == (str(tmp_path / "control.csv"), 6)
    assert by_code["P101"]["key"] == "observations.unit"
    assert main(["check", str(project), "--format", "json"]) == 2
    checked = {each["code"] for each in json.loads(capsys.readouterr().out)["projects"][0]["findings"]}
    assert {"P101", "P201", "P401", "P406"} <= checked


@pytest.mark.slow
def test_what_is_accepted_is_told_and_no_longer_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = simulation("utm")
    for path, text in project_files(made).items():
        (tmp_path / path).write_text(text, encoding="utf-8")
    rows = (tmp_path / "control.csv").read_text(encoding="utf-8").splitlines()
    gone = [row for row in rows if not row.startswith("G") or made.control.ids.index(row.split(",")[0]) < 4]
    (tmp_path / "control.csv").write_text("\n".join(gone) + "\n", encoding="utf-8")
    project = tmp_path / "project.yaml"
    assert main(["check", str(project), "--quiet"]) == 0
    first = capsys.readouterr().out
    assert "warning: " in first
    assert "P501" in first
    with project.open("a", encoding="utf-8") as file:
        file.write("accept: [P501/A, P502]\n")
    assert main(["check", str(project), "--quiet"]) == 0
    assert "P501 accepted: " in capsys.readouterr().out
    assert main(["run", str(project), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    (finding,) = result["findings"]
    assert (finding["code"], finding["accepted"]) == ("P501", True)
    assert not any("P501" in text for text in result["verdict"]["look_at"])


def test_a_finding_that_does_not_exist_cannot_be_accepted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path, text in project_files(simulation("utm")).items():
        (tmp_path / path).write_text(text, encoding="utf-8")
    with (tmp_path / "project.yaml").open("a", encoding="utf-8") as file:
        file.write("accept: [P999]\n")
    assert main(["check", str(tmp_path / "project.yaml"), "--quiet"]) == 2
    assert "there is no finding `P999`" in capsys.readouterr().out


@pytest.mark.slow
def test_images_that_no_lens_makes_are_refused_until_they_are_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = project_files(simulation("local"))
    wrong = files["project.yaml"].replace("principal_distance: 153", "principal_distance: 1530")
    for path, text in (files | {"project.yaml": wrong}).items():
        (tmp_path / path).write_text(text, encoding="utf-8")
    project = tmp_path / "project.yaml"
    assert main(["run", str(project), "--quiet"]) == 2
    printed = capsys.readouterr()
    assert "nothing is adjusted, unless `accept: [P105]`" in printed.out + printed.err
    assert not (tmp_path / "results").exists()
    with project.open("a", encoding="utf-8") as file:
        file.write("accept: [P105]\nprocessing: {adjustment: similarity, precision: false}\n")
    assert main(["run", str(project), "--quiet"]) in {0, 1, 3}  # it is adjusted, as far as that goes


@pytest.mark.slow
def test_an_error_fails_a_run_that_is_done(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = project_files(simulation("local"))
    head, *rows = files["control.csv"].splitlines()
    height = head.split(",").index("z")
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[height] = row[height] and str(float(row[height]) / FOOT)
    files["project.yaml"] += "processing: {adjustment: polynomial}\n"
    files["control.csv"] = "\n".join([head, *map(",".join, cells), ""])
    for path, text in files.items():
        (tmp_path / path).write_text(text, encoding="utf-8")
    assert main(["run", str(tmp_path / "project.yaml"), "--format", "json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["status"] == "failed"
    assert [each["code"] for each in document["findings"]] == ["P405"]
    text, *_ = document["verdict"]["look_at"]
    assert text.startswith("P405 ")
    assert "heights in feet" in text


# ---------------------------------------------------------------------------------- a closer look where it is needed


def test_ids_are_examined_before_a_run() -> None:
    inputs = inputs_of(simulation("utm"))
    o, photos = inputs.observations, inputs.strips[0].photos
    place = {name: number for number, name in enumerate(photos)}
    number = np.array([place[o.photo_ids[photo]] for photo in o.photo])
    seen = [set(number[o.point == point].tolist()) for point in range(len(o.point_ids))]
    first = next(point for point, on in enumerate(seen) if on == {0, 1})
    last = next(point for point, on in enumerate(seen) if on == {len(photos) - 2, len(photos) - 1})
    same = replace(inputs, observations=replace(o, point=np.where(o.point == last, first, o.point)))
    findings = gate.of_inputs(same, Settings())
    one = next(each for each in findings if each.code == "P301")
    assert (one.points, set(one.photos)) == ((o.point_ids[first],), {photos[0], photos[1], photos[-2], photos[-1]})
    rows = np.flatnonzero(o.point == first)
    copy = replace(
        o,
        point_ids=(*o.point_ids, "again"),
        photo=np.r_[o.photo, o.photo[rows]],
        point=np.r_[o.point, np.full(len(rows), len(o.point_ids))],
        xy=np.r_[o.xy, o.xy[rows] + 0.004],
        sigma=np.r_[o.sigma, o.sigma[rows]],
    )
    (finding,) = gate.of_inputs(replace(inputs, observations=copy), Settings())
    assert (finding.code, set(finding.points)) == ("P302", {o.point_ids[first], "again"})
    assert finding.evidence["distance_at_photo_scale_mm"] == pytest.approx(0.004 * np.sqrt(2.0), rel=0.2)
    apart = replace(copy, xy=np.r_[o.xy, o.xy[rows] + 0.1])
    assert gate.of_inputs(replace(inputs, observations=apart), Settings()) == ()


# ------------------------------------------------------------------------------------------------- given cameras


def with_positions(change: Callable[[Floats], Floats], frame: str = "utm") -> Inputs:
    """Give the true positions of the cameras, changed."""
    given = positions(simulation(frame))
    return replace(inputs_of(simulation(frame)), positions=replace(given, enu=change(given.enu.copy())))


@pytest.mark.parametrize("frame", FRAMES)
def test_given_positions_that_are_right_are_not_told(frame: str) -> None:
    assert gate.of_inputs(with_positions(lambda enu: enu, frame), Settings()) == ()


def test_given_positions_below_the_ground_and_in_feet() -> None:
    (below,) = gate.of_inputs(with_positions(lambda enu: enu - [0.0, 0.0, 2000.0]), Settings())
    assert (below.code, len(below.photos), below.key) == ("P204", 7, "camera_positions")
    (feet,) = gate.of_inputs(with_positions(lambda enu: enu / [1.0, 1.0, FOOT]), Settings())
    assert feet.code == "P205"
    ratio = float(feet.evidence["given_above_control_m"]) / float(feet.evidence["by_photo_scale_m"])
    assert ratio == pytest.approx(1 / FOOT, rel=0.25)  # the ground's own height counts in metres
    one = gate.of_inputs(with_positions(lambda enu: enu + np.outer(np.arange(7) == 3, [0, 0, 700.0])), Settings())
    assert [(each.code, each.photos) for each in one] == [("P205", ("1004",))]


def test_given_positions_of_other_photos() -> None:
    findings = gate.of_inputs(with_positions(lambda enu: enu[[0, 1, 3, 2, 4, 5, 6]]), Settings())
    assert ("P207", ("1003", "1004")) in [(each.code, each.photos) for each in findings]
    assert {each.key for each in findings} == {"camera_positions"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("observed", "read", "code"),
    [
        (False, [1, 1, 1], None),
        (True, [1, 1, 1], None),
        (True, [200 / 180] * 3, "P601"),
        (False, [np.pi / 180] * 3, "P601"),
        (True, [1, 1, -1], "P602"),
    ],
)
def test_angles_of_a_bundle_in_another_unit_or_sense(observed: bool, read: list[float], code: str | None) -> None:
    made = simulation("local")
    truth, inputs = made.truth, inputs_of(made)
    values = angles(truth.rotations_local, "omega-phi-kappa") * np.array(read)
    of_centers, of_angles = (np.full((len(values), 3), size if observed else np.nan) for size in (0.1, 1e-4))
    photos, frame, centers = truth.photo_ids, inputs.frames[0], truth.centers_ground
    given = GivenOrientations(
        photos, frame, centers, values, "omega-phi-kappa", of_centers, of_angles, observed=observed
    )
    findings = told(replace(inputs, orientations=given), replace(settings_of(made), adjustment="bundle"))
    assert codes(findings) == ([] if code is None else [code])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed"),
    [
        ("ids of given points in the next row", 43004),
        ("given points with coordinates of others", 43004),
        ("one given point in other columns", 43004),
        ("row of a given point copied", 43004),
        ("all heights zero", 43006),
        ("standard deviation of images in micrometres", 43001),
    ],
)
def test_mistakes_of_whole_columns_and_rows_are_told(name: str, seed: int) -> None:
    mistake = planted.mistake(name)
    case = mistake.make(seed)
    inputs, ids = planted_in(case, name)
    named = {each.code: each.names for each in told(inputs, case.settings)}
    assert not named.keys().isdisjoint(mistake.codes)
    assert not ids or any(ids & named.get(code, frozenset()) for code in mistake.codes)


@pytest.mark.parametrize(
    ("make", "seed", "search_cameras"), [(planted.sound, 43003, False), (planted.block, 43001, True)]
)
def test_a_shifted_photo_is_named_with_its_shift(
    make: Callable[[int], planted.Case], seed: int, *, search_cameras: bool
) -> None:
    """Whatever is said of the calibration of its camera (`self_calibration: never`)."""
    case = make(seed)
    inputs, ids = planted_in(case, "one photo shifted by 5 mm")
    shift = (inputs.observations.xy - case.inputs.observations.xy)[case.shows(*ids)][0]
    settings = replace(case.settings, bundle=replace(case.settings.bundle, search_cameras=search_cameras))
    (finding,) = (each for each in triangulate(inputs, settings).findings if each.code == "P109")
    assert set(finding.photos) == ids
    found = [float(finding.evidence[f"shift_{axis}_mm"]) for axis in "xy"]
    assert found == pytest.approx(shift, abs=0.8)


def test_a_reduced_photo_is_named_with_its_scale() -> None:
    case = planted.sound(43006)
    inputs, ids = planted_in(case, "a photo at another height")
    (finding,) = (each for each in triangulate(inputs, case.settings).findings if each.code == "P109")
    assert set(finding.photos) == ids
    assert finding.evidence["scale"] == pytest.approx(1.0 / 1.5, abs=0.01)


def test_every_kind_of_mistake_is_planted_in_the_benchmark() -> None:
    assert {code for mistake in planted.MISTAKES for code in mistake.codes} - set(LOST_SAY) == set(KINDS)


def test_a_bundle_that_fails_is_explained_by_strips_adjusted_each_by_itself() -> None:
    """Three ids that each stand for two points of two strips bend the start of the bundle until rays run parallel."""
    with pytest.raises(photostrip.GeometryError) as caught:
        photostrip.run(ROOT / "tests" / "data" / "shared-ids" / "project.yaml")
    assert {(each.code, *each.points) for each in caught.value.findings} == {
        ("P301", "T000009"),
        ("P301", "T000022"),
        ("P301", "T000024"),
    }
