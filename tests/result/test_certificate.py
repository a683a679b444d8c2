"""The hash of a result: what it covers, and that the last digits of another machine do not change it."""

from __future__ import annotations

import json
import platform
from typing import Any

import pytest

from photostrip.formats.result_json import checked, to_json
from photostrip.result.certificate import LIBRARIES, result_hash, versions
from tests.results import FRAMES, by_rows, case, in_tables


def plain(frame: str = "projected") -> dict[str, Any]:
    """Give a document whose rows may be changed."""
    found: dict[str, Any] = by_rows(case(frame).document)
    return found


def hash_of(document: dict[str, Any]) -> str:
    return result_hash(in_tables(document))


@pytest.mark.parametrize("frame", FRAMES)
def test_a_result_that_is_read_again_has_the_same_hash(frame: str) -> None:
    again = checked(json.loads(to_json(case(frame).document)), "result.json")
    assert result_hash(case(frame).document) == result_hash(again)


def changed(path: str, step: float | str) -> dict[str, Any]:
    found = plain()
    *above, last = path.split(".")
    place: Any = found
    for key in above:
        place = place[int(key)] if key.isdecimal() else place[key]
    end: Any = int(last) if last.isdecimal() else last
    place[end] = step if isinstance(step, str) else place[end] + step
    return found


@pytest.mark.parametrize(
    ("path", "step"),
    [
        ("adjustment", "bundle"), ("frame.crs", "EPSG:32634"), ("points.3.x", 0.001), ("points.3.role", "check"),
        ("points.3.id", "other"), ("photos.1.z", 0.001), ("photos.1.angle_3", 0.0001), ("control.2.dz", 0.001),
        ("control.2.use", "xy"), ("status", "failed"), ("statement.plan.count", 30), ("statement.plan.rmse", -0.001),
        ("statement.axes.up.mean", 0.001), ("statement.status", "tested"),
    ],
)  # fmt: skip
def test_what_a_report_shows_of_places_is_covered(path: str, step: float | str) -> None:
    assert hash_of(changed(path, step)) != hash_of(plain())


def test_words_and_versions_are_left_out() -> None:
    for path in ("version", "verdict.accuracy", "name", "statement.sentences"):
        assert hash_of(changed(path, "other")) == hash_of(plain()), path


def test_versions_are_those_that_are_installed() -> None:
    from importlib.metadata import version

    found = versions(with_proj=True)
    assert found["python"] == platform.python_version()
    assert {name: found[name] for name in LIBRARIES} == {name: version(name) for name in LIBRARIES}
    assert found["proj"].count(".") == 2
    assert found["epsg"].startswith("v")
    assert versions(with_proj=False)["proj"] is None


def test_numbers_are_hashed_as_a_form_writes_them_and_zero_without_a_sign() -> None:
    def hashed(value: float | None) -> str:
        document = plain()
        document["control"][2]["dz"] = value
        return hash_of(document)

    assert len({hashed(value) for value in (-0.0004, -0.0, 0.0004)}) == 1
    assert hashed(0.0005) == hashed(0.001) != hashed(-0.001)  # 0.0005 is a little more than that, 0.0015 as well
    assert hashed(0.0015) == hashed(0.002)
    assert hashed(None) not in {hashed(0.0), hashed(1e9)}
