"""The trace: what its numbers claim is so, and it ends where the run ended."""

from __future__ import annotations

import json
import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from photostrip.cli.main import main
from photostrip.pipeline.inputs import Settings
from photostrip.sheets.trace import CHOICES, MATRIX, SYMBOLS, departures_of, trace_sheet
from photostrip.simulation.spec import GrossError
from photostrip.strip.polynomial import PolynomialSettings
from tests.loops import nonempty
from tests.results import case, spec, write_project
from tests.results import solved as solve
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.calls import Capture
    from tests.results import Case

    Document = dict[str, Any]

ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")
CASES = ("projected", "two strips", "geocentric", "gross error")


@cache
def solved(name: str) -> Case:
    if name == "two strips":
        return case("north first", 2)
    if name == "gross error":
        return case("projected", 1, 5.0, GrossError("image", size_um=500.0, axis="y"))
    return case(name)


@cache
def trace(name: str) -> Document:
    return by_stage(json.loads(trace_sheet(solved(name).result).rendered("json")))


def values(row: Document, *names: str) -> list[Any]:
    return [row[name] for name in names]


def by_stage(tables: Document) -> Document:
    """Put the tables of a trace together by strip, pair and junction."""
    strips = []
    for absolute in tables["absolute"]:

        def of(key: str, strip: str = absolute["strip"]) -> list[Document]:
            return [row for row in tables.get(key, ()) if row["strip"] == strip]

        chain = [
            row | {"A": values(row, *MATRIX), "S": values(row, "Xs", "Ys", "Zs"), "B": values(row, "BX", "BY", "BZ")}
            for row in of("chain")
        ]
        junctions = [
            row | {"points": [each for each in of("junction_points") if each["photo"] == row["photo"]]}
            for row in of("junctions")
        ]
        *steps, end = of("similarity_steps")
        control = []
        for row in of("similarity_control"):
            given = values(row, "given_X", "given_Y", "given_Z")
            oriented = [at + left for at, left in zip(given, values(row, "vX", "vY", "vZ"), strict=True)]
            control.append(row | {"strip": values(row, "X", "Y", "Z"), "given": given, "oriented": oriented})
        (approximate,) = of("approximate")
        approximate["centroid"] = values(approximate, "centroid_x", "centroid_y", "centroid_z")
        found = absolute | {
            **{name: end[name] for name in ("s", "xi", "eta", "theta")},
            "shift": values(end, "X0", "Y0", "Z0"),
            "M": values(absolute, *(f"M_{place}" for place in MATRIX)),
            "steps": steps,
            "control": control,
            "approximate": approximate | {"pairs": of("control_distances")},
        }
        pairs = [_pair(row, of) for row in of("pairs")]
        strips.append({"pairs": pairs, "chain": chain, "scale_transfer": junctions, "absolute": found})
    return tables | {"strips": strips}


def _pair(row: Document, of: Callable[[str], list[Document]]) -> Document:
    def own(key: str) -> list[Document]:
        return [each for each in of(key) if values(each, "left", "right") == values(row, "left", "right")]

    rounds = []
    for number in sorted({each["round"] for each in own("pair_steps")}):
        states = [
            each | {"elements": {e: each[e] for e in ELEMENTS}, "d": {e: each[f"d_{e}"] for e in ELEMENTS}}
            for each in own("pair_steps")
            if each["round"] == number
        ]
        rounds.append({"points": states[0]["points"], "steps": states[:-1], "end": states[-1]["elements"]})
    whole = {"elements": {e: row[e] for e in ELEMENTS}, "photo_system": row, "rounds": rounds}
    return row | whole | {"rejected": own("pair_rejected"), "points": own("pair_points")}


def rotation(alpha: float, omega: float, kappa: float) -> Rotation:
    """Rotation of eq. 127 from three elementary ones of another library, degrees."""
    return Rotation.from_euler("YXZ", [-alpha, omega, kappa], degrees=True)


@pytest.mark.parametrize("name", CASES)
def test_pairs_end_where_the_run_ended(name: str) -> None:
    models = solved(name).document["models"]
    pairs = [pair for strip in trace(name)["strips"] for pair in strip["pairs"]]
    assert [(pair["left"], pair["right"]) for pair in pairs] == [(model["left"], model["right"]) for model in models]
    for pair, model in nonempty(zip(pairs, models, strict=True)):
        end = pair["rounds"][-1]["end"]
        assert [end[e] for e in ELEMENTS] == pytest.approx([pair["elements"][e] for e in ELEMENTS], abs=1e-8)
        assert [end[e] for e in ELEMENTS] == pytest.approx([model[f"elements_{e}"] for e in ELEMENTS], abs=2e-6)
        assert pair["rounds"][-1]["points"] == model["points_used"]


@pytest.mark.parametrize("name", CASES)
def test_each_step_leads_to_the_next(name: str) -> None:
    for strip in nonempty(trace(name)["strips"]):
        for pair in strip["pairs"]:
            for each in pair["rounds"]:
                states = [step["elements"] for step in each["steps"]] + [each["end"]]
                for step, after in zip(each["steps"], states[1:], strict=True):
                    for e in ELEMENTS:
                        change = (after[e] - step["elements"][e] + 180) % 360 - 180
                        assert change == pytest.approx(step["d"][e], rel=1e-5, abs=3e-9)
                assert max(abs(value) for value in each["steps"][-1]["d"].values()) < math.degrees(1e-10)
                sums = [step["[wqq]"] for step in each["steps"]]
                assert sums[-1] <= sums[0]


def test_the_sum_of_squares_gives_sigma0() -> None:
    for pair in nonempty(trace("projected")["strips"][0]["pairs"]):
        each = pair["rounds"][-1]
        # a y parallax is the difference of two coordinates; n points determine five elements
        sigma0 = math.sqrt(each["steps"][-1]["[wqq]"] / 2 / (each["points"] - 5))
        assert pair["sigma0_um"] == pytest.approx(1000 * sigma0, rel=1e-3)
        used = [point["q"] for point in pair["points"] if point["used"]]
        assert sum(q * q for q in used) == pytest.approx(each["steps"][-1]["[wqq]"], rel=0.02)


def test_rejected_points_make_a_second_round() -> None:
    found = solved("gross error")
    wrong = found.document["rejected"]
    assert wrong
    by_pair = {(pair["left"], pair["right"]): pair for pair in trace("gross error")["strips"][0]["pairs"]}
    for row in nonempty(wrong):
        pair = by_pair[row["photo"], row["other_photo"]]
        assert row["point"] in [each["point"] for each in pair["rejected"]]
        assert [each["points"] for each in pair["rounds"]] == [len(pair["points"]), len(pair["points"]) - 1]
        first, second = (each["steps"][-1]["[wqq]"] for each in pair["rounds"])
        assert second < first / 4
    assert all(len(pair["rounds"]) == 1 for key, pair in nonempty(by_pair.items()) if key not in
               {(row["photo"], row["other_photo"]) for row in wrong})  # fmt: skip


def test_the_chain_follows_the_formulas() -> None:
    strip = trace("projected")["strips"][0]
    previous = None
    for row, pair in nonempty(zip(strip["chain"], [None, *strip["pairs"]], strict=True)):
        a = rotation(row["alpha"], row["omega"], row["kappa"])
        assert np.array(row["A"]).reshape(3, 3) == pytest.approx(a.as_matrix(), abs=1e-9)
        if pair is not None and previous is not None:
            e = pair["elements"]
            base_frame = previous[0] * rotation(e["alpha1"], 0.0, e["kappa1"]).inv()  # A_taunu, eq. 126
            assert (base_frame * rotation(e["alpha2"], e["omega2"], e["kappa2"])).as_matrix() == pytest.approx(
                a.as_matrix(), abs=1e-9
            )
            b = np.array(row["B"])
            tau, nu = math.radians(row["tau"]), math.radians(row["nu"])
            length = float(np.linalg.norm(b))
            expected = [math.cos(nu) * math.cos(tau), math.cos(nu) * math.sin(tau), math.sin(nu)]  # eq. 135
            assert b / length == pytest.approx(expected, abs=1e-8)
            assert b / length == pytest.approx(base_frame.as_matrix()[:, 0], abs=1e-8)
            assert length == pytest.approx(row["k"], abs=1e-8)
            assert row["S"] == pytest.approx(previous[1] + b, abs=1e-8)
        previous = a, np.array(row["S"])


def test_points_lie_on_their_rays() -> None:
    found = solved("projected")
    f = found.inputs.strips[0].camera.principal_distance
    strip = trace("projected")["strips"][0]
    for pair, left in nonempty(zip(strip["pairs"], strip["chain"], strict=False)):
        for point in pair["points"]:
            ray = np.array(left["A"]).reshape(3, 3) @ [point["x1"], point["y1"], -f]
            arm = np.array([point[axis] for axis in "XYZ"]) - left["S"]
            sine = np.linalg.norm(np.cross(ray, arm)) / np.linalg.norm(ray) / np.linalg.norm(arm)
            assert sine < 1e-4  # half of a y parallax of 20 micrometres over 153 mm


def test_ratios_of_distances_are_the_scale_factors() -> None:
    strip = trace("projected")["strips"][0]
    scales = {row["photo"]: row.get("k") for row in strip["chain"]}
    photos = list(scales)
    for joint in nonempty(strip["scale_transfer"]):
        for point in joint["points"]:
            assert point["k_t"] == pytest.approx(point["D"] / point["D'"], rel=1e-6)
        used = [point["k_t"] for point in joint["points"] if point["used"]]
        assert min(used) < joint["k"] < max(used)
        assert joint["k"] == pytest.approx(scales[photos[photos.index(joint["photo"]) + 1]], abs=1e-8)


@pytest.mark.parametrize("name", ["projected", "geocentric"])
def test_the_similarity_brings_the_strip_to_the_control(name: str) -> None:
    found, strip = trace(name)["strips"][0]["absolute"], solved(name).result.strips[0]
    turn = rotation(found["xi"], found["eta"], found["theta"]).as_matrix()
    for row in nonempty(found["control"]):
        moved = found["s"] * turn @ np.array(row["strip"]) + found["shift"]
        assert row["oriented"] == pytest.approx(moved, abs=2e-3)
    redundancy = strip.absolute.redundancy
    assert math.sqrt(found["steps"][-1]["[wvv]"] / redundancy) == pytest.approx(strip.absolute.sigma0, rel=1e-3)
    assert found["steps"][-1]["s"] == pytest.approx(found["s"], rel=1e-9)
    m = np.array(found["M"]).reshape(3, 3)
    assert m @ m.T == pytest.approx(np.eye(3), abs=1e-9)


def test_polynomials_take_out_the_free_terms() -> None:
    settings = Settings("polynomial", polynomial=PolynomialSettings("2"))
    found = json.loads(trace_sheet(solve(case("projected").inputs, settings).result).rendered("json"))
    assert {row["found"] for row in found["polynomial_evidence"]} == {2}
    powers = {"1": (0, 0), "X": (1, 0), "Y": (0, 1), "XY": (1, 1), "X^2": (2, 0), "X^3": (3, 0)}
    for row in nonempty(found["polynomial_control"]):
        for axis in "XYZ":
            value = sum(
                each["coefficient"] * row["X"] ** powers[each["term"]][0] * row["Y"] ** powers[each["term"]][1]
                for each in found["polynomial_terms"]
                if each["axis"] == axis
            )
            assert row[f"v{axis}"] == pytest.approx(value - row[f"l{axis}"], abs=3e-4)  # eq. 151


def test_a_trace_is_the_same_every_time_and_explains_its_symbols() -> None:
    pages = [trace_sheet(solved("gross error").result).rendered("text", 200) for _ in range(2)]
    assert pages[0] == pages[1]
    for symbol in ("[wqq]", "[wvv]", "A0", "k_t", "α1′", "τ"):
        assert symbol in pages[0]
    assert {"q", "N", "k", "[wqq]", "[wvv]"} <= {name.split(",")[0] for name in SYMBOLS}


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["txt", "md", "json"])
def test_the_preset_for_teaching_gives_a_trace_in_gon(tmp_path: Path, ending: str) -> None:
    project = write_project(tmp_path, spec(), f"extends: {ROOT / 'configs/teaching.yaml'}\n")
    file = tmp_path / f"trace.{ending}"
    assert main(["run", str(project), "--quiet", "--trace", str(file)]) == 0
    text = file.read_text(encoding="utf-8")
    if ending == "json":
        document = json.loads(text)
        assert document["angles"] == "gon"
        joint = by_stage(document)["strips"][0]["scale_transfer"][0]
        used = [point["k_t"] for point in joint["points"] if point["used"]]
        assert joint["k"] == pytest.approx(sum(used) / len(used), abs=1e-8)  # the textbook's mean
    else:
        assert "Relative orientation of 1001 – 1002" in text
        assert "gon" in text


AS_PRINTED = f"extends: {ROOT / 'configs/as-printed.yaml'}\n"
FIRST = "    first_photo: {angles: [2.0, -3.0, 12.0], unit: gon, base: 92.0}\n"


def as_printed(folder: Path, *options: str) -> Document:
    project = write_project(folder, spec(bands=4), AS_PRINTED)
    text = project.read_text(encoding="utf-8")
    project.write_text(text.replace("observations:", FIRST + "observations:", 1), encoding="utf-8")
    file = folder / "trace.json"
    assert main(["run", str(project), "--quiet", "--trace", str(file), *options]) in {0, 1}
    return by_stage(json.loads(file.read_text(encoding="utf-8")))


@pytest.mark.slow
def test_the_preset_as_printed_departs_in_nothing(tmp_path: Path, capsys: Capture) -> None:
    capsys.readouterr()
    document = as_printed(tmp_path)
    assert document["departures"] == []
    usual = departures_of(case("projected").result)
    assert [subject for subject, *_ in usual] == [choice.subject for choice in CHOICES if choice.key != "adjustment"]
    assert "processing.intersection: left" in [key for *_, key in usual]
    strip = document["strips"][0]
    first = strip["chain"][0]
    angles = [first[name] for name in ("alpha", "omega", "kappa")]
    assert angles == pytest.approx([1.8, -2.7, 10.8], abs=1e-8)  # 2, -3 and 12 gon
    assert np.linalg.norm(strip["chain"][1]["B"]) == pytest.approx(92.0, abs=1e-7)
    assert strip["chain"][1]["k"] == 1.0
    for pair, left, right in nonempty(zip(strip["pairs"], strip["chain"], strip["chain"][1:], strict=False)):
        base = np.array(right["B"])
        for point in nonempty(pair["points"][::5]):
            (x1, y1), (x2, _) = (
                -153.0
                * (ray := np.array(at["A"]).reshape(3, 3) @ [point[f"x{n}"], point[f"y{n}"], -153.0])[:2]
                / ray[2]
                for n, at in ((1, left), (2, right))
            )
            n = (base[0] + x2 * base[2] / 153.0) / (x1 - x2)  # eq. 138
            found = [point[axis] for axis in "XYZ"]
            assert found == pytest.approx(left["S"] + np.array([n * x1, n * y1, -n * 153.0]), abs=2e-4)
            assert point["N"] * right["k"] == pytest.approx(n, rel=2e-6)


def test_a_cubic_that_the_control_does_not_carry_is_a_departure(tmp_path: Path) -> None:
    """The settings ask for degree 3, three bands of control carry 2: told is what was done."""
    project = write_project(tmp_path, spec(bands=3), AS_PRINTED)
    file = tmp_path / "trace.json"
    assert main(["run", str(project), "--quiet", "--trace", str(file)]) == 0
    document = json.loads(file.read_text(encoding="utf-8"))
    (departure,) = document["departures"]
    assert departure["subject"] == "degree"
    assert departure["here"] == "2 in plan, 2 in height (3 asked for)"
    assert departure["key"] == "control at four distances along the strip"


def test_base_frames_turn_what_relative_orientation_found() -> None:
    """A = A_taunu A(alpha2', omega2', kappa2'), and the first column of A_taunu is the base."""
    for name in CASES:
        document = trace(name)
        frames, pairs, chain = (document[key] for key in ("base_frames", "pairs", "chain"))
        photos = {row["photo"]: row for row in chain}
        for frame, pair in nonempty(zip(frames, pairs, strict=True)):
            turn, right = (np.array(values(row, *MATRIX)).reshape(3, 3) for row in (frame, photos[frame["right"]]))
            assert turn @ rotation(pair["alpha2"], pair["omega2"], pair["kappa2"]).as_matrix() == pytest.approx(
                right, abs=1e-8
            )
            base = np.array(values(photos[frame["right"]], "BX", "BY", "BZ"))
            assert turn[:, 0] == pytest.approx(base / np.linalg.norm(base), abs=1e-7)


def test_a_pair_in_the_system_of_its_left_photo() -> None:
    for strip in nonempty(trace("projected")["strips"]):
        for pair in strip["pairs"]:
            e, own = pair["elements"], pair["photo_system"]
            left = rotation(e["alpha1"], 0.0, e["kappa1"])
            right = rotation(e["alpha2"], e["omega2"], e["kappa2"])
            base = left.inv().apply([1.0, 0.0, 0.0])
            assert [own[name] for name in ("bx", "by", "bz")] == pytest.approx(base, abs=1e-8)
            assert math.tan(math.radians(own["tau"])) == pytest.approx(base[1] / base[0], abs=1e-9)
            assert math.sin(math.radians(own["nu"])) == pytest.approx(base[2], abs=1e-9)
            # first order: by = -b kappa1', bz = -b alpha1', dalpha = alpha2' - alpha1'
            small = np.radians([e["kappa1"], e["alpha1"]]) ** 2
            assert own["by"] == pytest.approx(-math.radians(e["kappa1"]), abs=small.sum() + 1e-8)
            assert own["bz"] == pytest.approx(-math.radians(e["alpha1"]), abs=small.sum() + 1e-8)
            turn = rotation(own["alpha"], own["omega"], own["kappa"]).as_matrix()
            assert turn == pytest.approx((left.inv() * right).as_matrix(), abs=1e-9)


@pytest.mark.parametrize("name", ["projected", "geocentric"])
def test_scales_of_pairs_of_control_points(name: str) -> None:
    found = trace(name)["strips"][0]["absolute"]
    approximate, control = found["approximate"], {row["point"]: row for row in found["control"]}
    strip, ground = (pdist([control[point][key] for point in control]) for key in ("strip", "given"))
    assert approximate["r"] == pytest.approx(ground.sum() / strip.sum(), rel=1e-7)
    assert approximate["r"] * approximate["t"] == pytest.approx(found["s"], rel=1e-9)
    assert [row["r"] for row in approximate["pairs"]] == pytest.approx((ground / strip).tolist(), rel=1e-6)
    assert abs(approximate["t"] - 1) < 1e-4
    assert approximate["centroid"] == pytest.approx(
        np.mean([row["strip"] for row in control.values()], axis=0), abs=1e-8
    )
