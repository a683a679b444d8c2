"""The verdict: what verifies a result, what contradicts it, and the exit codes."""

from __future__ import annotations

import re
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from photostrip.foreign.adjusted import adjusted
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.report.page.layout import to_text
from photostrip.report.page.parts import Table
from photostrip.report.sections.accuracy_report import chosen_sections
from photostrip.result.document import document_of
from photostrip.result.given import stand_out
from photostrip.result.verdict import FAILED, GOOD, LOOK, UNVERIFIED, accuracy, exit_code, headline_rms, verdict_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Points, Spec
from tests.results import Document, a_finding, a_note, case, in_tables, solved, spec
from tests.simulated import inputs_of, settings_of


def with_checks(plan: int, height: int) -> Document:
    """Solve a sound project with the first so many check points in plan, and in height."""
    inputs = case("projected", 2).inputs
    control = inputs.control
    use, order = control.use.copy(), np.cumsum(control.check) - 1
    use[control.check & (order >= plan), :2] = False
    use[control.check & (order >= height), 2] = False
    enu = np.where(control.check[:, None] & ~use, np.nan, control.enu)
    return solved(replace(inputs, control=replace(control, use=use, enu=enu))).document


def quiet(document: Document) -> str:
    return " ".join(to_text("", chosen_sections(document, quiet=True), 200).split())


@pytest.mark.slow
def test_check_points_verify() -> None:
    document = with_checks(2, 1)
    assert (document["status"], document["verdict"]["verified"]) == (GOOD, True)
    assert document["verdict"]["verification"] == "2 check points in plan and 1 in height"


MISSING = [(0, 0, "the result"), (2, 0, "the heights"), (0, 2, "the plan coordinates")]


@pytest.mark.slow
@pytest.mark.parametrize(("plan", "height", "missing"), MISSING)
def test_what_nothing_verifies_is_not_good(plan: int, height: int, missing: str) -> None:
    document = with_checks(plan, height)
    assert (document["status"], document["verdict"]["look_at"]) == (UNVERIFIED, [])
    assert document["verdict"]["verified"] is False
    assert document["verdict"]["verification"].startswith(f"no point verifies {missing}: hold some given points back")
    text = quiet(document)
    assert text.startswith(f"UNVERIFIED: nothing calls for a second look, but no point verifies {missing}: hold some ")
    assert text.count("no point verifies") == 1


def moved(points: int, metres: float, axis: int = 0, adjustment: str = "polynomial") -> Document:
    """Displace the first so many of eight check points, in turn forth and back."""
    wanted = spec("projected", 2)
    inputs = inputs_of(simulate(replace(wanted, control=replace(wanted.control, check=8))))
    enu = inputs.control.enu.copy()
    enu[np.flatnonzero(inputs.control.check)[:points], axis] += metres * (-1.0) ** np.arange(points)
    return solved(replace(inputs, control=replace(inputs.control, enu=enu)), Settings(adjustment=adjustment)).document


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_check_points_beyond_their_standard_deviations_are_not_good(adjustment: str) -> None:
    sound = moved(0, 0.0, adjustment=adjustment)
    assert (sound["status"], sound["verdict"]["look_at"]) == (GOOD, [])
    document = moved(8, 1.0, axis=2, adjustment=adjustment)
    (text,) = (
        text for text in document["verdict"]["look_at"] if text.startswith("the differences at the check points")
    )
    check = document["precision"]["check"]
    assert (
        f"in height {check['height']['rms']:.1f} times as large as expected, {check['height']['inside_95']} of 8 inside"
        in text
    )
    assert text.endswith("; probability of that by chance below 0.1 %")
    assert document["status"] == LOOK
    # what follows from data that contradict themselves is not said
    error = a_finding("P406", "off by a digit", severity="error")
    assert verdict_of({**document, "findings": [error]})["look_at"] == ["P406 off by a digit"]


@pytest.mark.parametrize(
    ("height", "said"), [(0.21, "do not contradict"), (0.004, "speak slightly against"), (0.0004, "")]
)
def test_what_the_check_points_say_is_told_with_its_probability(height: float, said: str) -> None:
    """Three tests share the level: the least probability counts three times, and one part is enough."""
    found = with_check_p(plan=0.7, height=height, together=0.5 if said else 0.03)
    told = f"the check points {said} the standard deviations of the points, p = {3 * height:.2g}"
    assert (found["status"], found["agreement"]) == ((GOOD, told) if said else (LOOK, ""))
    assert said or "by chance 0.1 %" in found["look_at"][0]


def with_check_p(*, plan: float, height: float, together: float) -> Document:
    """Return the verdict on a sound result whose check points have these probabilities by chance."""
    document = moved(0, 0.0)
    check = document["precision"]["check"]
    parts = {name: {**check[name], "p": p} for name, p in (("plan", plan), ("height", height))}
    changed = {**check, **parts, "tests": [{**check["tests"][0], "p": together}]}
    return verdict_of({**document, "precision": {**document["precision"], "check": changed}})


def test_a_cause_that_is_known_needs_less_evidence() -> None:
    """Heights at 2.5 % by chance: nothing by themselves, enough where the curvature is known to be left out."""
    document = moved(0, 0.0)
    check = document["precision"]["check"]
    low = {"count": 10, "inside_95": 5, "rms": 2.16, "p": 0.00827}
    changed = {**check, "height": low, "tests": [{**check["tests"][0], "p": 0.042}]}
    contradicted = {**document, "precision": {**document["precision"], "check": changed}}
    assert verdict_of(contradicted)["status"] == GOOD
    note = a_note("curvature-left-out", "", severity="note")
    found = verdict_of({**contradicted, "notes": [*document["notes"], note]})
    assert found["status"] == LOOK
    assert "in height 2.2 times as large as expected, 5 of 10 inside the 95 % interval" in found["look_at"][0]
    assert found["look_at"][0].endswith("try `earth_curvature: model`")


@pytest.mark.slow
def test_errors_are_told_without_their_size_in_images_whose_scale_is_lost() -> None:
    """A strip that its control tears apart has no photo scale: the sentence ended the run as an internal error."""
    document = deepcopy(case().document)
    told = accuracy(document)
    for part in (document["summary"]["check"][name] for name in ("plan", "height")):
        part["rms_um"] = None
    assert accuracy(document) == re.sub(r"[\d.]+ µm at photo scale, ", "", told) != told


def test_a_check_point_that_stands_out_is_taken_out_of_the_headline() -> None:
    document = moved(1, 447.0)
    rows = {row["id"]: row for row in document["control"]}
    assert [name for name, row in rows.items() if row["stands_out"]] == ["K01"]
    (text,) = document["verdict"]["look_at"]
    assert text.startswith("check point K01 (447.")
    assert "m in plan) stands out; the others have an rms of 0." in text
    with_it, without = document["summary"]["check"]["plan"]["rms"], headline_rms(document, "check", "plan")
    assert without["count"] == 7
    assert without["rms"] < without["max"] < 0.5
    assert without["worst"] != "K01"
    (table,) = (each for each in chosen_sections(document, names=["check"])[0].parts if isinstance(each, Table))
    assert all(abs(float(line[column])) < 0.5 for line in table.foot[:3] for column in (1, 2, 3))
    assert with_it > 150
    accuracy = document["verdict"]["accuracy"]
    assert accuracy.startswith(f"rms {without['rms']:.3f} m in plan")
    assert accuracy.endswith(f"; {with_it:.3f} m in plan with K01")
    assert document["precision"]["check"]["plan"]["count"] == 7  # named once, not tested again with the others
    both = moved(2, 447.0)["verdict"]
    assert [text.count("the others have an rms of") for text in both["look_at"]] == [1]
    assert both["accuracy"].endswith("m in plan with K01, K02")


def test_a_wrong_point_is_told_once_with_what_became_of_it() -> None:
    document = case("projected", 2).document
    control = [row | {"rejected": "z"} if row["id"] == "G02" else row for row in document["control"]]
    warned = (("control-rejected", "G02"), ("control-rejected", "G03"), ("weak", "G02"))
    notes = [a_note(code, f"{code} of {point}", points=[point], strip="A") for code, point in warned]
    finding = a_finding("P406", "off by a digit", points=["G02"])
    changed = {**document, "control": control, "notes": notes, "findings": [finding]}
    expected = ["P406 off by a digit; not used", "control-rejected of G03", "weak of G02"]
    assert verdict_of(in_tables(changed))["look_at"] == expected
    changed["findings"] = [finding | {"accepted": True}]
    expected = ["control-rejected of G02", "control-rejected of G03", "weak of G02"]
    assert verdict_of(in_tables(changed))["look_at"] == expected


def test_wrong_check_points_do_not_hide_each_other_and_one_known_badly_does_not_stand_out() -> None:
    values = np.array([0.1, 447.0, -0.05, 0.08, 447.2, 0.02, -0.07, 0.11])
    found = stand_out(values, 1, np.full(8, 1e-9))
    assert np.flatnonzero(found).tolist() == [1, 4]
    assert not stand_out(values, 1, np.full(8, 0.05)).any()  # nothing beyond its standard deviation
    assert not stand_out(np.array([np.nan, 5.0]), 1, np.full(2, 1e-9)).any()
    assert stand_out(np.array([447.0, 0.088]), 2, np.full(2, 1e-9)).tolist() == [True, False]
    # far off beside the others, and 1.3 times its own standard deviation: at the end of a long strip, say
    values = np.array([0.1, -0.05, 0.08, 0.02, -0.07, 1.04])
    expected = np.array([0.9, 0.9, 0.9, 0.9, 0.9, 0.19])
    assert not stand_out(values, 1, expected).any()
    assert stand_out(values, 1, np.where(values > 1, 1e-4, expected)).tolist() == [False] * 5 + [True]


@pytest.mark.slow
def test_sound_differences_hardly_ever_stand_out() -> None:
    rng = np.random.default_rng(20261122)
    wrong = [stand_out(rng.normal(size=n), 1, np.full(n, 1e-9)).any() for n in (2, 4, 9, 30) for _ in range(1500)]
    assert np.mean(wrong) < 0.002


@pytest.mark.parametrize(("noise", "status"), [(0.0, LOOK), (0.012, LOOK), (0.1, FAILED)])
def test_measurements_that_contradict_each_other_everywhere_are_no_result(noise: float, status: str) -> None:
    """Two strips on their common points alone, the images 2.6 and 20 times as far off as stated."""
    inputs = inputs_of(simulate(Spec(seed=5, flight=Flight(photos=6, strips=2), points=Points(extra_per_model=8))))
    seen = inputs.observations
    xy = seen.xy + np.random.default_rng(5).normal(0.0, noise, seen.xy.shape)
    nothing = inputs.control.take(np.zeros(0, np.intp))
    wrong = replace(inputs, control=nothing, observations=replace(seen, xy=xy))
    document = solved(wrong, Settings(adjustment="bundle")).document
    assert document["status"] == status
    assert any("times worse than stated" in text for text in document["verdict"]["look_at"]) == (noise > 0.0)
    assert exit_code(document["status"], strict=False) == (status == FAILED)
    if status == FAILED:
        assert quiet(document).startswith("FAILED: the measurements contradict their stated standard deviations.")


def with_pairs(sigma0: list[float], project: float, *, calibration: bool = False, given: float = 5.0) -> list[str]:
    """Give a sound result pairs with another sigma0, that of the project being what a bundle makes of it."""
    document = case("projected", 2).document
    pairs = [{**document["models"][0], "sigma0_um": each, "redundancy": 10} for each in sigma0]
    bundle = {"bundle": {"calibration": [{"parameter": "f"}]}} if calibration else {}
    summary = {**document["summary"], "sigma0_um": project, "sigma_given_um": given}
    found: list[str] = verdict_of(in_tables({**document, **bundle, "summary": summary, "models": pairs}))["look_at"]
    return found


def test_a_pair_is_compared_with_the_other_pairs_and_with_what_is_stated() -> None:
    (text,) = with_pairs([5.0, 5.2, 675.0], 5.1)
    assert "sigma0 675.0 µm, stated 5.0 µm, the other pairs have 5.1 µm" in text
    # two wrong pairs of three hide each other behind their mean
    assert len(with_pairs([5.0, 675.0, 670.0], 5.1)) == 2
    assert len(with_pairs([675.0], 5.1)) == 1
    # pairs are not worse because the bundle is better
    assert with_pairs([5.5, 5.2, 5.4, 5.0], 3.0) == []
    # a lens that the bundle takes up bends every pair
    assert with_pairs([20.0, 21.0, 19.0], 5.0, calibration=True) == []
    # what is said of the whole project is not said again of each pair
    (text,) = with_pairs([20.0, 21.0, 19.0], 20.0)
    assert text.startswith("the image coordinates are 4.0 times worse than stated")
    # a nanometre is rounded to no micrometres
    assert with_pairs([5.0], 5.0, given=0.0)[0].startswith("the image coordinates are")


@pytest.mark.parametrize(("rms_um", "status"), [(5.0, GOOD), (57.3, LOOK)])
def test_image_residuals_are_weighed_against_what_is_stated(rms_um: float, status: str) -> None:
    """The pairs may be at peace where the points of the strip are metres off."""
    document = case("projected", 2).document
    verdict = verdict_of({**document, "summary": {**document["summary"], "image_rms_um": rms_um}})
    assert verdict["status"] == status
    text = "the image residuals under the final orientation are 11.5 times as large as stated: rms 57.3 µm"
    assert verdict["look_at"] == ([f"{text}, stated 5.0 µm"] if status == LOOK else [])


@pytest.mark.parametrize(("status", "code", "strict"), [(GOOD, 0, 0), (UNVERIFIED, 0, 1), (LOOK, 0, 1), (FAILED, 1, 1)])
def test_exit_codes(status: str, code: int, strict: int) -> None:
    assert exit_code(status, strict=False) == code
    assert exit_code(status, strict=True) == strict


@pytest.mark.parametrize("shift", [(0.0, 5.0), (5.0, 0.0)])
def test_a_photo_that_is_shifted_as_a_whole_is_named_and_loses_no_points(shift: tuple[float, float]) -> None:
    """A fifth of its points and more were rejected."""
    simulation = simulate(Spec(flight=Flight(photos=10), control=Control(bands=4)))
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    seen = inputs.observations
    xy = seen.xy + np.where(seen.photo[:, None] == seen.photo_ids.index("1005"), shift, 0.0)
    document = document_of(triangulate(replace(inputs, observations=replace(seen, xy=xy)), settings))
    verdict = verdict_of(document)
    assert verdict["status"] == LOOK
    assert [text[:40] for text in verdict["look_at"]] == ["P109 all image coordinates of photo 1005"]
    assert [each for each in document["rejected"] if not each["readmitted"]] == []
    assert [*adjusted(document).cameras] == ["film", "film of photo 1005"]  # exported with a camera of its own


def test_photos_with_large_residuals_come_before_those_that_lost_points_worst_first() -> None:
    document = case("projected", 2).document
    head = document["photos"][0]
    photos = [{**head, "id": str(name), "points": 10, "image_rms_um": 1.0} for name in range(9)]
    for name, rms in ((1, 4.0), (2, 9.0), (3, 5.0), (4, 6.0)):
        photos[name]["image_rms_um"] = rms
    photos_of_lost = ["5"] * 5 + ["6"] * 20 + ["7"]
    lost = [{"photo": name, "point": f"p{n}", "readmitted": False} for n, name in enumerate(photos_of_lost)]
    summary = {**document["summary"], "image_rms_um": 1.0}
    found = verdict_of(in_tables({**document, "summary": summary, "photos": photos, "rejected": lost}))["look_at"]
    told = [text.partition(":")[0] for text in found if "photo" in text]
    more = "1 more photo with large residuals, like the last one"
    assert told == ["photo 2", "photo 4", "photo 3", more, "photo 6", "photo 5"]
