"""Profiles of accuracy classes: the shipped ones against their rules, faults with their places."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import pytest

from photostrip.errors import InputError
from photostrip.project.profiles.classes import HeightLimits, PlanLimits, load_classes
from photostrip.result.statement.classes import MEASURES, classified
from tests.loops import nonempty
from tests.result.statement.test_evidence import block
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

INCH = 0.0254
HEAD = "photostrip_statement: 1\nname: ours\nsource: a contract\n"


def limits(name: str, part: str, measure: str) -> dict[float, float]:
    """Give the limits of a shipped profile by the number in the name of each class."""
    profile, _ = load_classes(ROOT / "configs" / f"{name}.yaml")
    assert profile.check_points == 20
    assert len(profile.source) > 50
    return {
        float(each.name.removesuffix(" m").removeprefix("1:").replace(" ", "")): each.limits[part][measure]
        for each in nonempty(profile.classes)
        if list(each.limits) == [part]
    }


def test_limits_by_contour_interval_follow_their_rules() -> None:
    for interval, limit in nonempty(limits("tolerances/contour-interval", "height", "rmse").items()):
        assert limit == pytest.approx(float(Fraction(1, 3)) * interval, abs=5e-5)
    for interval, limit in nonempty(limits("statements/nmas-contour-interval", "height", "p90").items()):
        assert limit == interval / 2


def test_limits_by_map_scale_follow_their_rules() -> None:
    for scale, limit in nonempty(limits("tolerances/map-scale", "plan", "rmse_axis").items()):
        assert limit == pytest.approx(0.00025 * scale)
    found = limits("statements/nmas-map-scale", "plan", "p90")
    for scale, limit in nonempty(found.items()):
        assert limit == pytest.approx(scale * INCH / (30 if scale < 20_000 else 50), abs=5e-4)
    assert f"{found[24_000]:.1f}" == "12.2"  # 40 feet, as the survey prints it
    assert round(found[24_000] / 0.3048) == 40


def test_the_measures_of_a_profile_are_those_that_are_found() -> None:
    for part, kind in (("plan", PlanLimits), ("height", HeightLimits)):
        assert list(kind.keys) == list(MEASURES[part])


def profile(folder: Path, text: str) -> Path:
    path = folder / "own.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_narrowest_class_that_is_kept_is_found(tmp_path: Path) -> None:
    rows = "".join(
        f"  - {{name: c{n}, plan: {{rmse: 0.{n}}}, height: {{largest: 9, le90: 0.{n}}}}}\n" for n in (1, 2, 3)
    )
    found, _ = load_classes(profile(tmp_path, f"{HEAD}classes:\n{rows}"))
    given = block(height=block()["height"] | {"largest": 0.4})
    answer = classified(given, found)
    # plan 0.106 keeps 0.2, but LE90 0.2276 keeps 0.3 only
    assert [row["kept"] for row in answer["classes"]] == [False, False, True]
    assert answer["best"] == "c3"
    missing = classified(block(line={"le90": None, "le95": None}, height=given["height"]), found)
    assert missing["best"] is None


def test_a_class_needs_its_check_points(tmp_path: Path) -> None:
    text = f"{HEAD}check_points: 31\nclasses: [{{name: wide, plan: {{rmse: 10}}}}]\n"
    assert classified(block(), load_classes(profile(tmp_path, text))[0])["best"] is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("classes: []\n", "classes: names no class"),
        ("classes: [{name: a}]\n", "classes[0]: the class `a` has no limit"),
        (
            "classes: [{name: a, plan: {rmse: 1}}, {name: a, plan: {rmse: 2}}]\n",
            "classes[1].name: the class `a` stands twice",
        ),
        (
            "classes: [{name: a, plan: {rmse: 2}}, {name: b, plan: {rmse: 1}}]\n",
            "classes[1]: the class `b` is narrower than `a` before it; expected the narrowest class first",
        ),
        ("classes: [{name: a, plan: {rmse: -1}}]\n", "larger than 0"),
        ("classes: [{name: a, plan: {rmse: .nan}}]\n", "`.nan`"),
        ("classes: [{name: a, plan: {le90: 1}}]\n", "`le90` is not known"),
        ("check_points: 0\nclasses: [{name: a, plan: {rmse: 1}}]\n", "check_points: is out of range"),
        ("", "`classes` is missing"),
    ],
)
def test_faults_have_their_places(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError) as refused:
        load_classes(profile(tmp_path, HEAD + text))
    assert said in str(refused.value)
    assert "own.yaml:" in str(refused.value)
