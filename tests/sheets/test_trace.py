"""The trace: what its numbers claim is so, and it ends where the run ended."""

from __future__ import annotations

import json
import math
from functools import cache
from itertools import pairwise
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
    from pathlib import Path

    from numpy.typing import NDArray

    from tests.results import Case

    Document = dict[str, Any]

ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")
CENTRE, GIVEN = ("Xs", "Ys", "Zs"), ("given_X", "given_Y", "given_Z")
CASES = ("projected", "two strips", "geocentric", "gross error")


@cache
def solved(name: str) -> Case:
    if name == "two strips":
        return case("north first", 2)
    if name == "gross error":
        return case("projected", 1, 5.0, GrossError("image", size_um=500.0, axis="y"))
    return case(name)


class Trace:
    """The tables of a trace."""

    def __init__(self, text: str) -> None:
        self.document: Document = json.loads(text)

    def rows(self, key: str, **where: Any) -> list[Document]:  # noqa: ANN401 (values of columns)
        """Give the rows of a table that have these values."""
        return [row for row in self.document.get(key, ()) if where.items() <= row.items()]

    def of_pair(self, key: str, pair: Document) -> list[Document]:
        return self.rows(key, left=pair["left"], right=pair["right"])

    def rounds(self, pair: Document) -> list[list[Document]]:
        """Give the states of a pair, round by round; the last of each is its end."""
        states = self.of_pair("pair_steps", pair)
        return [[each for each in states if each["round"] == n] for n in sorted({row["round"] for row in states})]


@cache
def trace(name: str) -> Trace:
    return Trace(trace_sheet(solved(name).result).rendered("json"))


def at(row: Document, *names: str) -> NDArray[np.float64]:
    return np.array([row[name] for name in names], float)


def matrix(row: Document) -> NDArray[np.float64]:
    return at(row, *MATRIX).reshape(3, 3)


def rotation(alpha: float, omega: float, kappa: float) -> Rotation:
    """Rotation of eq. 127 from three elementary ones of another library, degrees."""
    return Rotation.from_euler("YXZ", [-alpha, omega, kappa], degrees=True)


@pytest.mark.parametrize("name", CASES)
def test_pairs_end_where_the_run_ended(name: str) -> None:
    models, found = solved(name).document["models"], trace(name)
    pairs = found.rows("pairs")
    assert [(pair["left"], pair["right"]) for pair in pairs] == [(model["left"], model["right"]) for model in models]
    for pair, model in nonempty(zip(pairs, models, strict=True)):
        end = found.rounds(pair)[-1][-1]
        assert at(end, *ELEMENTS) == pytest.approx(at(pair, *ELEMENTS), abs=1e-8)
        assert at(end, *ELEMENTS) == pytest.approx(at(model, *(f"elements_{e}" for e in ELEMENTS)), abs=2e-6)
        assert end["points"] == model["points_used"]


@pytest.mark.parametrize("name", CASES)
def test_each_step_leads_to_the_next(name: str) -> None:
    found, added = trace(name), [f"d_{e}" for e in ELEMENTS]
    for states in nonempty(states for pair in found.rows("pairs") for states in found.rounds(pair)):
        for step, after in pairwise(states):
            change = (at(after, *ELEMENTS) - at(step, *ELEMENTS) + 180) % 360 - 180
            assert change == pytest.approx(at(step, *added), rel=1e-5, abs=3e-9)
        last = states[-2]
        assert np.abs(at(last, *added)).max() < math.degrees(1e-10)
        assert last["[wqq]"] <= states[0]["[wqq]"]


def test_the_sum_of_squares_gives_sigma0() -> None:
    found = trace("projected")
    for pair in nonempty(found.rows("pairs")):
        last = found.rounds(pair)[-1][-2]
        # a y parallax is the difference of two coordinates; n points determine five elements
        sigma0 = math.sqrt(last["[wqq]"] / 2 / (last["points"] - 5))
        assert pair["sigma0_um"] == pytest.approx(1000 * sigma0, rel=1e-3)
        used = [point["q"] for point in found.of_pair("pair_points", pair) if point["used"]]
        assert sum(q * q for q in used) == pytest.approx(last["[wqq]"], rel=0.02)


def test_rejected_points_make_a_second_round() -> None:
    found, wrong = trace("gross error"), list(solved("gross error").document["rejected"])
    of = {(row["photo"], row["other_photo"]): row["point"] for row in nonempty(wrong)}
    for pair in nonempty(found.rows("pairs")):
        rounds, point = found.rounds(pair), of.pop((pair["left"], pair["right"]), None)
        assert len(rounds) == (1 if point is None else 2)
        if point is not None:
            assert point in [each["point"] for each in found.of_pair("pair_rejected", pair)]
            count = len(found.of_pair("pair_points", pair))
            assert [states[0]["points"] for states in rounds] == [count, count - 1]
            assert rounds[1][-2]["[wqq]"] < rounds[0][-2]["[wqq]"] / 4
    assert of == {}


def test_the_chain_follows_the_formulas() -> None:
    found = trace("projected")
    chain = found.rows("chain")
    for row in nonempty(chain):
        assert matrix(row) == pytest.approx(rotation(row["alpha"], row["omega"], row["kappa"]).as_matrix(), abs=1e-9)
    for before, row, pair in nonempty(zip(chain, chain[1:], found.rows("pairs"), strict=False)):
        turn = rotation(before["alpha"], before["omega"], before["kappa"])
        base_frame = turn * rotation(pair["alpha1"], 0.0, pair["kappa1"]).inv()  # A_taunu, eq. 126
        right = base_frame * rotation(pair["alpha2"], pair["omega2"], pair["kappa2"])
        assert right.as_matrix() == pytest.approx(matrix(row), abs=1e-9)
        base, tau, nu = at(row, "BX", "BY", "BZ"), math.radians(row["tau"]), math.radians(row["nu"])
        length = float(np.linalg.norm(base))
        expected = [math.cos(nu) * math.cos(tau), math.cos(nu) * math.sin(tau), math.sin(nu)]  # eq. 135
        assert base / length == pytest.approx(expected, abs=1e-8)
        assert base / length == pytest.approx(base_frame.as_matrix()[:, 0], abs=1e-8)
        assert length == pytest.approx(row["k"], abs=1e-8)
        assert at(row, *CENTRE) == pytest.approx(at(before, *CENTRE) + base, abs=1e-8)


def test_points_lie_on_their_rays() -> None:
    found, f = trace("projected"), solved("projected").inputs.strips[0].camera.principal_distance
    for pair, left in nonempty(zip(found.rows("pairs"), found.rows("chain"), strict=False)):
        for point in found.of_pair("pair_points", pair):
            ray = matrix(left) @ [point["x1"], point["y1"], -f]
            arm = at(point, *"XYZ") - at(left, *CENTRE)
            sine = np.linalg.norm(np.cross(ray, arm)) / np.linalg.norm(ray) / np.linalg.norm(arm)
            assert sine < 1e-4  # half of a y parallax of 20 micrometres over 153 mm


def test_ratios_of_distances_are_the_scale_factors() -> None:
    found = trace("projected")
    for joint, after in nonempty(zip(found.rows("junctions"), found.rows("chain")[2:], strict=True)):
        points = found.rows("junction_points", photo=joint["photo"])
        ratios = [point["D"] / point["D'"] for point in points]
        assert [point["k_t"] for point in points] == pytest.approx(ratios, rel=1e-6)
        used = [point["k_t"] for point in points if point["used"]]
        assert min(used) < joint["k"] < max(used)
        assert joint["k"] == pytest.approx(after["k"], abs=1e-8)


@pytest.mark.parametrize("name", ["projected", "geocentric"])
def test_the_similarity_brings_the_strip_to_the_control(name: str) -> None:
    found, absolute = trace(name), solved(name).result.strips[0].absolute
    *_, last, end = found.rows("similarity_steps")
    turn, shift = rotation(end["xi"], end["eta"], end["theta"]).as_matrix(), at(end, "X0", "Y0", "Z0")
    for row in nonempty(found.rows("similarity_control")):
        moved = end["s"] * turn @ at(row, *"XYZ") + shift
        assert at(row, *GIVEN) + at(row, "vX", "vY", "vZ") == pytest.approx(moved, abs=2e-3)
    assert math.sqrt(last["[wvv]"] / absolute.redundancy) == pytest.approx(absolute.sigma0, rel=1e-3)
    assert last["s"] == pytest.approx(end["s"], rel=1e-9)
    m = at(found.rows("absolute")[0], *(f"M_{place}" for place in MATRIX)).reshape(3, 3)
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
@pytest.mark.parametrize("ending", ["txt", "md", "html", "json"])
def test_the_preset_for_teaching_gives_a_trace_in_gon(tmp_path: Path, ending: str) -> None:
    project = write_project(tmp_path, spec(), f"extends: {ROOT / 'configs/teaching.yaml'}\n")
    file = tmp_path / f"trace.{ending}"
    assert main(["run", str(project), "--quiet", "--trace", str(file)]) == 0
    text = file.read_text(encoding="utf-8")
    if ending == "json":
        found = Trace(text)
        assert found.document["angles"] == "gon"
        joint = found.rows("junctions")[0]
        used = [point["k_t"] for point in found.rows("junction_points", photo=joint["photo"], used=True)]
        assert joint["k"] == pytest.approx(sum(used) / len(used), abs=1e-8)  # the textbook's mean
    else:
        assert "Relative orientation of 1001 – 1002" in text
        assert "gon" in text


AS_PRINTED = f"extends: {ROOT / 'configs/as-printed.yaml'}\n"
FIRST = "strips[0].first_photo={angles: [2.0, -3.0, 12.0], unit: gon, base: 92.0}"


@pytest.mark.slow
def test_the_preset_as_printed_departs_in_nothing(tmp_path: Path) -> None:
    project = write_project(tmp_path, spec(bands=4), AS_PRINTED)
    assert main(["run", str(project), "--quiet", "--trace", str(tmp_path / "trace.json"), "--set", FIRST]) in {0, 1}
    found = Trace((tmp_path / "trace.json").read_text(encoding="utf-8"))
    assert found.document["departures"] == []
    usual = departures_of(case("projected").result)
    assert [subject for subject, *_ in usual] == [subject for subject, *_ in CHOICES if subject != "adjustment"]
    assert "processing.intersection: left" in [key for *_, key in usual]
    chain = found.rows("chain")
    assert at(chain[0], "alpha", "omega", "kappa") == pytest.approx([1.8, -2.7, 10.8], abs=1e-8)  # 2, -3 and 12 gon
    assert np.linalg.norm(at(chain[1], "BX", "BY", "BZ")) == pytest.approx(92.0, abs=1e-7)
    assert chain[1]["k"] == 1.0
    for pair, left, right in nonempty(zip(found.rows("pairs"), chain, chain[1:], strict=False)):
        base = at(right, "BX", "BY", "BZ")
        for point in nonempty(found.of_pair("pair_points", pair)[::5]):
            rays = (matrix(photo) @ [point[f"x{n}"], point[f"y{n}"], -153.0] for n, photo in ((1, left), (2, right)))
            (x1, y1), (x2, _) = (-153.0 * ray[:2] / ray[2] for ray in rays)
            n = (base[0] + x2 * base[2] / 153.0) / (x1 - x2)  # eq. 138
            expected = at(left, *CENTRE) + np.array([n * x1, n * y1, -n * 153.0])
            assert at(point, *"XYZ") == pytest.approx(expected, abs=2e-4)
            assert point["N"] * right["k"] == pytest.approx(n, rel=2e-6)


def test_a_cubic_that_the_control_does_not_carry_is_a_departure(tmp_path: Path) -> None:
    """The settings ask for degree 3, three bands of control carry 2: told is what was done."""
    project = write_project(tmp_path, spec(bands=3), AS_PRINTED)
    file = tmp_path / "trace.json"
    assert main(["run", str(project), "--quiet", "--trace", str(file)]) == 0
    document = json.loads(file.read_text(encoding="utf-8"))
    (departure,) = document["departures"]
    told = ["degree", "2 in plan, 2 in height (3 asked for)", "control at four distances along the strip"]
    assert [departure[name] for name in ("subject", "here", "key")] == told


def test_base_frames_turn_what_relative_orientation_found() -> None:
    """A = A_taunu A(alpha2', omega2', kappa2'), and the first column of A_taunu is the base."""
    for found in map(trace, CASES):
        photos = {row["photo"]: row for row in found.rows("chain")}
        for frame, pair in nonempty(zip(found.rows("base_frames"), found.rows("pairs"), strict=True)):
            turn, right = matrix(frame), photos[frame["right"]]
            turned = turn @ rotation(pair["alpha2"], pair["omega2"], pair["kappa2"]).as_matrix()
            assert turned == pytest.approx(matrix(right), abs=1e-8)
            base = at(right, "BX", "BY", "BZ")
            assert turn[:, 0] == pytest.approx(base / np.linalg.norm(base), abs=1e-7)


def test_a_pair_in_the_system_of_its_left_photo() -> None:
    for pair in nonempty(trace("projected").rows("pairs")):
        left = rotation(pair["alpha1"], 0.0, pair["kappa1"])
        right = rotation(pair["alpha2"], pair["omega2"], pair["kappa2"])
        base = left.inv().apply([1.0, 0.0, 0.0])
        assert at(pair, "bx", "by", "bz") == pytest.approx(base, abs=1e-8)
        assert math.tan(math.radians(pair["tau"])) == pytest.approx(base[1] / base[0], abs=1e-9)
        assert math.sin(math.radians(pair["nu"])) == pytest.approx(base[2], abs=1e-9)
        turn = rotation(pair["alpha"], pair["omega"], pair["kappa"]).as_matrix()
        assert turn == pytest.approx((left.inv() * right).as_matrix(), abs=1e-9)


@pytest.mark.parametrize("name", ["projected", "geocentric"])
def test_scales_of_pairs_of_control_points(name: str) -> None:
    found = trace(name)
    (approximate,), control = found.rows("approximate"), found.rows("similarity_control")
    strip, ground = (pdist([at(row, *names) for row in control]) for names in ("XYZ", GIVEN))
    assert approximate["r"] == pytest.approx(ground.sum() / strip.sum(), rel=1e-7)
    assert approximate["r"] * approximate["t"] == pytest.approx(found.rows("similarity_steps")[-1]["s"], rel=1e-9)
    assert [row["r"] for row in found.rows("control_distances")] == pytest.approx((ground / strip).tolist(), rel=1e-6)
    assert abs(approximate["t"] - 1) < 1e-4
    centroid = at(approximate, "centroid_x", "centroid_y", "centroid_z")
    assert centroid == pytest.approx(np.mean([at(row, *"XYZ") for row in control], axis=0), abs=1e-8)
