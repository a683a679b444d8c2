"""``photostrip plan``: files, options, forms and pictures."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from photostrip.cli.main import main
from photostrip.planning.model_plan import ModelSpec, control_layout, given_errors, plan_model
from photostrip.project.plans import ModelPlanFile
from photostrip.project.reading import read_keys
from tests.calls import rows, words
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Answer, Call

CAMERAS = """\
photostrip_plan_cameras: 1
cameras:
  wide: {principal_distance: 153, sigma_um: 7, format: [230, 230]}
  digital: {principal_distance: 100.5, sigma_um: 2, format: [67.86, 103.86]}
"""


def planned(answer: Answer, kind: str, *arguments: object) -> Any:  # noqa: ANN401 (JSON)
    """Give a plan as JSON; what has an equals sign in it is a key that is set."""
    given = (f"--set={each}" if "=" in str(each) and str(each)[0] != "/" else each for each in arguments)
    return json.loads(answer("plan", kind, *given, "--format", "json"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "keys", "text"),
    [
        (
            "model",
            ["camera={principal_distance: 100, format: [180, 160]}", "end_lap_percent=65", "control.layout=six"],
            "camera: {principal_distance: 100, format: [180, 160]}\nend_lap_percent: 65\ncontrol: {layout: six}\n",
        ),
        (
            "strip",
            ["models=5", "layouts=[bands=2, corners]", "methods=[similarity, degree 2]"],
            "models: 5\nlayouts: {2 bands: bands=2, corners: {layout: corners}}\nmethods: [similarity, degree 2]\n",
        ),
        (
            "displacement",
            ["camera=UMK 10/1318", "base=30", "distances=[50, 120]", "sigma_um=4"],
            "camera: UMK 10/1318\nbase: 30\ndistances: [50, 120]\nsigma_d_um: 5.656854249492381\n",
        ),
        ("screening", ["methods=[tau, auto]", "repetitions=1"], "methods: [tau, auto]\nrepetitions: 1\n"),
    ],
)
def test_keys_that_are_set_and_a_file_say_the_same(
    kind: str, keys: list[str], text: str, answer: Answer, tmp_path: Path
) -> None:
    (file := tmp_path / "plan.yaml").write_text(f"photostrip_plan_{kind}: 1\n{text}")
    assert planned(answer, kind, file) == planned(answer, kind, *keys)


def test_a_model_has_the_numbers_of_the_function(answer: Answer) -> None:
    keys = ["camera={principal_distance: 100, format: [180, 160]}", "end_lap_percent=65", "flying_height=800"]
    keys += ["image_sigma_um=3", "control={layout: six, sigma: [0.02, 0.03, 0.04]}"]
    found, b, a = planned(answer, "model", *keys), 63.0, 64.0
    spec = ModelSpec(100, b, a, 8000, 0.003, control=control_layout("six", b, a), control_sigma=(0.02, 0.03, 0.04))
    expected = plan_model(spec)
    assert [point["sigma_z_m"] for point in found["points"]] == pytest.approx(expected.sigmas[:, 2], abs=1e-5)
    assert found["worst"]["sigma_z_m"] == pytest.approx(expected.sigmas[:, 2].max(), abs=1e-5)


def test_sources_add_up_and_the_table_is_the_document(answer: Answer) -> None:
    document = planned(answer, "model")
    share = {row["source"]: row for row in document["sources"]}
    parts = ("measuring of the point", "orientation, together", "control, measured", "control, given")
    for name in ("plan_rms_m", "z_rms_m"):
        assert np.sqrt(sum(share[part][name] ** 2 for part in parts)) == pytest.approx(share["all"][name], abs=3e-4)
    table = rows(answer("plan", "model", "--format", "csv"))
    assert [float(row["sigma_z_m"]) for row in table] == [point["sigma_z_m"] for point in document["points"]]
    assert share["all, elements adjusted"]["z_max_m"] < share["all"]["z_max_m"]


def test_more_points_in_a_zone_lower_what_the_elements_do(answer: Answer) -> None:
    six = "orientation.points=[[0,0],[92,0],[0,92],[92,92],[0,-92],[92,-92]]"
    one, four, same = (
        list(planned(answer, "model", *keys)["orientation"].values())[1:]
        for keys in ((), ("orientation.zone_points=4",), (six,))
    )
    assert np.array(four) / one == pytest.approx(np.full(4, 0.5), abs=2e-3)
    assert same == one


TWO = CAMERAS.partition("cameras:\n")[2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("  a: {principal_distance: 153, sigma_um: 7}\n", "nothing says how long the photo base is"),
        (TWO + "  c: {principal_distance: 9, sigma_um: 7, base: 3}\n", "no format"),
        (TWO + "reference: wild\n", "there is no camera `wild`"),
        ("  a: {principal_distance: 153, base: 60}\n", "nothing says how well an x parallax is known"),
        ("  a: {principal_distance: 153, base: 60, sigma_um: 3, image_sigma_um: 3}\n", "two keys say how well"),
        ("  a: {principal_distance: 153, base: 60, sigma_um: 3, mean_distortion_um: 3}\n", "has all errors in it"),
        (TWO + "relief: 300\n", "depends on how it is flown"),
        (TWO + "scale: 3\nflying_height: 300\n", "`flying_height` are both given"),
        ("  a: {principal_distance: 153, base: 60, sigma_um: 3}\nscale: 3\nrelief: 9\n", "follows from their format"),
    ],
)  # fmt: skip
def test_a_wrong_list_of_cameras_is_refused(text: str, message: str, call: Call, tmp_path: Path) -> None:
    (file := tmp_path / "c.yaml").write_text(f"photostrip_plan_cameras: 1\ncameras:\n{text}")
    found, _, err = call("plan", "camera", str(file))
    assert (found, message in err) == (2, True)


def test_cameras_over_ground(answer: Answer, call: Call, tmp_path: Path) -> None:
    file = tmp_path / "c.yaml"
    file.write_text(CAMERAS + "side_lap_percent: 30\nheight_sigma: 0.2\nrelief: 400\nslope_deg: 60\n")
    document = planned(answer, "camera", file)
    first = ("reference", "fewest_photos", "smallest_coefficient")
    assert [document[name] for name in first] == ["digital", "wide", "digital"]
    wide, digital = document["cameras"]
    assert [wide["base_mm"], wide["coefficient_mm2"], digital["eta_area"]] == pytest.approx([92.0, 153 * 0.007, 1])
    assert [row["useful_width_mm"] for row in document["cameras"]] == pytest.approx([161, 72.702])
    assert document["models"][0]["base_ratio"] == pytest.approx(153 / 92, abs=1e-4)
    for row in nonempty(document["survey"]):
        assert row["sigma_z_m"] == 0.2
        assert row["sigma_z_per_area_m_km2"] == pytest.approx(0.2 / row["area_km2"], rel=1e-3)
        assert row["photos_per_100_km2"] == pytest.approx(100 / row["area_km2"], rel=3e-3)
    assert [row["suits"] for row in document["terrain_limits"]] == [False, True]
    assert document["recommended"] == "digital"
    text = answer("plan", "camera", str(file), "--set", "slope_deg=80")
    assert "recommended    none of these cameras" in text
    left = "{model: radial-table, direction: image_to_ideal, radius: [0, 50], distortion: [0, 0.003]}"
    camera = f"cameras.b={{principal_distance: 88, image_sigma_um: 4, format: [230, 230], distortion: {left}}}"
    found, _, err = call("plan", "camera", str(file), "--set", camera)
    assert (found, "cameras.b.distortion: a point" in err) == (2, True)


GIVEN = """\
photostrip_plan_model: 1
camera: {principal_distance: 150}
base: 90
control:
  points:
    - {at: [2, 80], height: 60, measured_error: [0.02, -0.03, 0.05]}
    - {name: P, at: [88, 78], height: -40, given_error: [0, 0.04, 0]}
    - {at: [-3, -82]}
    - {at: [91, -75]}
points: [{name: A, at: [20, 30], height: 120}]
element_errors: {dby_um: 4, dbz_um: -3, dkappa_arcsec: 6, dalpha_arcsec: -4, domega_arcsec: 8}
"""


def test_given_errors_come_out_as_errors_of_points(answer: Answer, tmp_path: Path) -> None:
    (file := tmp_path / "m.yaml").write_text(GIVEN)
    document = planned(answer, "model", file)
    parts: dict[str, dict[str, list[float]]] = {}
    for row in nonempty(document["errors"]):
        parts.setdefault(row["point"], {})[row["part"]] = [row[f"error_{axis}_m"] for axis in "xyz"]
    assert list(parts) == ["A", "C1", "P", "C3", "C4"]
    for part in parts.values():
        total = np.array(part["measuring"]) + part["orientation"] - part["absolute"]
        assert part["total"] == pytest.approx(total, abs=2e-5)
        causes = np.sum([part[f"from_{cause}"] for cause in ("measuring", "elements", "control")], axis=0)
        assert causes == pytest.approx(total, abs=3e-5)
    found = given_errors(read_keys(ModelPlanFile, file, [])[0].spec)
    assert found is not None
    assert found.parts is not None
    assert [part["total"][2] for part in parts.values()] == pytest.approx(found.parts.total[:, 2] * 10, abs=1e-5)
    assert document["named"][0]["height_m"] == 120
    assert list(document["element_errors"].values()) == [4, -3, 6, -4, 8]
    text = answer("plan", "model", str(file))
    for title in ("relative orientation, dx2", "Corrections from the misclosures", "before levelling", "At the points"):
        assert title in text
    assert planned(answer, "model", file, "element_errors=[4,-3,6,-4,8]") == document


def test_misclosures_come_out_as_corrections(answer: Answer, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    points = "".join(f"    - {{at: [{x}, {y}], misclosure: [0.1, -0.2, 0.3]}}\n" for x in (0, 90) for y in (-80, 80))
    file.write_text(f"photostrip_plan_model: 1\ncontrol:\n  points:\n{points}points: [{{name: A, at: [20, 30]}}]\n")
    given = planned(answer, "model", file)
    assert "errors" not in given
    # a shift of the whole control is a shift of the model, and no sign of wrong elements
    for kind in ("plain", "adjusted"):
        found = [given["corrections"][0][f"{kind}_{axis}_m"] for axis in "xyz"]
        assert found == pytest.approx([0.1, -0.2, 0.3], abs=1e-4)
    assert list(given["adjusted_elements"].values()) == pytest.approx([0, 0, 0, 0], abs=0.01)


def test_both_forms_side_by_side(answer: Answer) -> None:
    points = "points=[{name: A, at: [20, 30]}]"
    forms = planned(answer, "model", points, "closed_form=yes")
    assert [len(forms[name]) for name in ("sums", "coefficients", "weights")] == [15, 3 * 4, 4 * 5]
    for row in nonempty(forms["coefficients"] + forms["weights"]):
        assert row["closed"] == pytest.approx(row["operators"], rel=1e-6, abs=1e-8)
        assert "printed" not in row
    text = answer("plan", "model", f"--set={points}", "--set=closed_form=printed")
    assert text.count("misprint") > 5
    assert "c15" in text


MEASURED = "control.points=[{at: [1, 2], misclosure: [0, 0, 1]}]"


@pytest.mark.parametrize(
    ("kind", "keys", "code", "message"),
    [
        ("model", ["scael=3"], 2, "did you mean `scale`"),
        ("model", ["scale=3000", "flying_height=400"], 2, "are both given"),
        ("model", ["control.sigma=[0, 0, 0]"], 2, "all zero"),
        ("model", ["grid.rows=1"], 2, "1 is out of range"),
        ("screening", ["seed=-1"], 2, "seed: -1 is out of range"),
        ("model", ["element_errors=[1, 2, 3]"], 2, "element_errors: 3 values are given; expected five"),
        ("model", ["element_errors=[1, 2, x, 4, 5]"], 2, "element_errors.dkappa_arcsec: `x` is not a number"),
        ("model", ["closed_form=yes", "points=[{name: A, at: [1, 2], height: 3}]"], 2, "level ground, and A lie"),
        ("model", ["points=[{name: A, at: [1, 2], height: 1500}]"], 2, "not seen from 1530 m; expected at most 1377 m"),
        ("model", ["control.points=[{at: [1, 2], misclosure: [0, 0, 1]}, [3, 4]]"], 2, "others have none"),
        ("model", ["element_errors=[1, 2, 3, 4, 5]", MEASURED], 2, "are both given; remove the one"),
        ("model", ["control.points=[[0, 0], [40, 40], [80, 80]]"], 3, "on one line"),
        ("model", ["orientation.points=[[0, 0], [40, 40]]"], 3, ""),
        ("strip", ["layouts.a=bunds=3"], 2, "did you mean `bands`"),
        ("strip", ["layouts.a=bands=30"], 2, "30 bands cannot be placed on 11 photos"),
        ("strip", ["layouts.a={layout: points, points: [[12, 1]]}"], 2, "no row 1 at photo 12"),
        ("strip", ["place={points: 2, into: nowhere}"], 2, "no layout `nowhere`"),
        ("strip", ["end_lap_percent=30"], 2, "end_lap_percent: an end lap of 30 %"),
        ("strip", ["layouts=[bands=12]"], 2, "12 bands cannot be placed on 11 photos"),
        ("strip", ["required=[a, 0.1]"], 2, "required.plan: `a` is not a number"),
        ("strip", ["layouts.a={bands: 3, every: 4}"], 2, "layouts.a.every: the number of bands and their distance"),
        ("strip", ["layouts.a={gnss: [1, 1, 1]}", "models=3"], 0, ""),
        ("displacement", ["camera=UMK"], 2, "`UMK`"),
        ("displacement", ["stations=3"], 2, "stations: `3` is not known; expected one of 2, 1"),
        ("displacement", ["stations=1", "convergence_deg=3"], 2, "one camera has no other to be turned towards"),
        ("displacement", ["sigma_um=3", "sigma_d_um=3"], 2, "are both given; remove one"),
        ("camera", [], 2, "no cameras are given; name a YAML file"),
        ("screening", ["zone_points=[3, 3, 3]"], 2, "zone_points"),
        ("screening", ["zone_points=[1, 1, 1, 1, 1, 0]"], 2, "5 points orient a pair and check nothing"),
        ("screening", ["zone_points=[9, 9, 0, 0, 0, 0]", "zone_reach=0", "tilt=0"], 3, "do not orient a pair"),
        ("screening", ["second_errors=40"], 2, "do not go into 34 pairs"),
    ],
)  # fmt: skip
def test_a_wrong_plan_is_refused(kind: str, keys: list[str], code: int, message: str, call: Call) -> None:
    found, _, err = call("plan", kind, *(f"--set={key}" for key in keys))
    assert (found, message in words(err)) == (code, True)


@pytest.mark.parametrize("ending", [".json", ".csv", ".md", ".txt"])
def test_files_are_what_is_printed(ending: str, answer: Answer, tmp_path: Path) -> None:
    target = tmp_path / f"plan{ending}"
    form = "text" if ending == ".txt" else ending[1:]
    shown = answer("plan", "model", "--format", form, "-o", str(target))
    assert target.read_text(encoding="utf-8") == shown
    assert answer("plan", "model", "-q", "-o", str(target)) == ""
    assert main(["plan", "model", "-o", str(tmp_path / "plan.docx")]) == 2


# --------------------------------------------------------------------------------------------------------- strips


STRIP = """\
photostrip_plan_strip: 1
models: 5
points: {rows: 3, extra_per_model: 0}
layouts:
  ends: bands=2
  signals: {layout: points, points: [[1, 1], [1, 3], {at: [6, 1]}, {at: [3, 2], use: xy}], sigma: [0.02, 0.02, 0.03]}
  gnss: {layout: corners, gnss: [0.05, 0.05, 0.08]}
methods: [similarity, bundle]
required: {height: 0.5}
place: {points: 1, into: ends, method: similarity}
"""


@pytest.mark.slow
def test_the_report_of_a_strip(answer: Answer, tmp_path: Path) -> None:
    (file := tmp_path / "s.yaml").write_text(STRIP)
    text = answer("plan", "strip", str(file))
    for told in ("0.050 0.050 0.080, offset free", "3/2 xy", "0.500 m in height", "Best places", "never"):
        assert told in text
    document = planned(answer, "strip", file)
    by = {(row["layout"], row["method"]): row for row in document["accuracy"]}
    assert ("gnss", "similarity") not in by  # only the bundle uses perspective centres
    assert by["gnss", "bundle"]["worst_z_m"] < by["ends", "bundle"]["worst_z_m"]
    for who, row in nonempty(by.items()):
        along = [each for each in document["along"] if (each["layout"], each["method"]) == who]
        assert max(each["z_m"] for each in along) == pytest.approx(row["worst_z_m"], abs=0.05)
        assert row["meets"] == (row["worst_z_m"] <= 0.5)
    table = rows(answer("plan", "strip", str(file), "--format", "csv"))
    assert len(table) == 5 * 6
    assert list(table[0]) == ["layout", "method", "photo", "plan_m", "z_m"]


def test_all_faults_of_a_strip_are_told_where_they_stand(call: Call, tmp_path: Path) -> None:
    plan = tmp_path / "strip.yaml"
    layouts = "  a: bands=20\n  b: {per_band: 9}\n  c: {layout: points, points: [[99, 1]]}\n"
    plan.write_text(f"photostrip_plan_strip: 1\ngnss: [0.1, 0.1, 0.1]\nlayouts:\n{layouts}", encoding="utf-8")
    _, _, err = call("plan", "strip", plan)
    assert [line.split(": ")[1].rsplit(":", 2)[1] for line in err.splitlines()] == ["4", "5", "6"]
    found, _, err = call("plan", "strip", str(plan), "--set", "methods=[similarity]")
    assert (found, "of use to the bundle alone" in err) == (2, True)
    found, _, err = call("plan", "model", plan)
    assert (found, err.endswith("this is a plan for `photostrip plan strip`\n")) == (2, True)


def test_every_layout_with_and_without_perspective_centres(answer: Answer) -> None:
    keys = ("models=8", "layouts=[corners]", "methods=[similarity, bundle]", "gnss=[0.05, 0.05, 0.08]")
    document = planned(answer, "strip", *keys)
    rows = {(row["layout"], row["method"]): row["worst_z_m"] for row in document["accuracy"]}
    assert list(rows) == [("corners", "similarity"), ("corners", "bundle"), ("corners + GNSS", "bundle")]
    assert rows["corners + GNSS", "bundle"] < 0.5 * rows["corners", "bundle"]


def test_the_worst_place_lies_at_the_photo_farthest_from_control(answer: Answer) -> None:
    layout = "layouts.near={layout: points, points: [[1, 1], [1, 5], [2, 3]]}"
    one = "layouts.one={layout: points, points: [[1, 1]]}"
    keys = ("models=4", layout, one, "methods=[similarity]")
    document = planned(answer, "strip", *keys)
    (row,) = (each for each in document["accuracy"] if each["layout"] == "near")
    assert row["worst_z_at"]["photo"] == row["worst_plan_at"]["photo"] == 5
    along = [each for each in document["along"] if each["layout"] == "near"]
    assert f"{along[-1]['z_m']:.2f}" == f"{row['worst_z_m']:.2f}"
    text = answer("plan", "strip", *(f"--set={key}" for key in keys))
    assert ["1", "2", "3", "4", "5"] in [line.split()[2:] for line in text.splitlines() if "method  " in line]
    assert "cannot orient a strip" in text


def test_a_rule_for_make(answer: Answer, call: Call, tmp_path: Path) -> None:
    file, target, rule = tmp_path / "s.yaml", tmp_path / "s.json", tmp_path / "s.d"
    file.write_text(STRIP)
    assert answer("plan", "strip", str(file), "-q", "-o", str(target), "--depfile", str(rule)) == ""
    assert rule.read_text() == f"{target}: {file}\n\n{file}:\n"
    found, _, err = call("plan", "model", "--depfile", str(rule))
    assert (found, "needs a target" in err) == (2, True)


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["svg", "html"])
def test_the_picture_of_a_strip(answer: Answer, call: Call, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f"strip.{ending}"
    keys = ("models=3", "methods=[similarity]")
    assert answer("plan", "strip", *(f"--set={key}" for key in keys), "-q", "-o", str(target)) == ""
    drawn = target.read_text(encoding="utf-8")
    for layout in nonempty(planned(answer, "strip", *keys)["layouts"]):
        assert drawn.count(f">{layout['name']}, similarity<") == 1  # in one legend
        assert f">{layout['name']}<" in drawn
    found, _, err = call("plan", "model", "-o", str(tmp_path / "model.svg"))
    assert (found, "nothing is written as '.svg'" in err) == (2, True)


def test_displacements_from_one_station(answer: Answer) -> None:
    assert "one, distances known" in answer("plan", "displacement", "--set=camera=UMK 10/1318", "--set=stations=1")


@pytest.mark.slow
def test_screening_counts_what_is_put_in(answer: Answer) -> None:
    keys = ("zone_points=[3, 3, 3, 3, 3, 3]", "error_sizes_um=[50, 100]", "methods=[tau, auto]", "repetitions=1")
    document = planned(answer, "screening", *keys)
    assert [each["method"] for each in document["methods"]] == ["tau", "auto"]
    assert len(document["detection"]) == 2 * 6 * 2
    assert sum(row["errors"] for row in document["detection"]) == 2 * 44
    first = document["effects"][0]
    assert first["largest_100_um_arcmin"] == pytest.approx(2 * first["largest_50_um_arcmin"], abs=0.02)
