"""``photostrip sources``: worked numbers against formulas written out, and every table in every form."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import pytest

from photostrip.sheets import sources
from tests.calls import Answer, Call, rows, words
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path


def test_worked_numbers_are_those_of_the_formulas(answer: Answer) -> None:
    document = json.loads(answer("sources", "--format", "json"))
    found = {(row["source"], row["what"]): row for row in document["worked"]}
    seconds = math.degrees(1) * 3600
    # [002]: m rho / sqrt(2 (f² + x²)) and m rho / sqrt(f² + x² + z²), m = 5 µm, x = 80, z = 60 mm
    for name, f in (("Photheo 19/1318", 190), ("UMK 10/1318", 100)):
        level, printed = found["[002]", f"m_lambda, {name}"], found["[002]", f"m_beta, {name}"]
        assert level["correct"] == pytest.approx(0.005 * seconds / math.sqrt(2 * (f**2 + 6400)), abs=6e-4)
        assert printed["correct"] == pytest.approx(0.005 * seconds / math.sqrt(f**2 + 6400 + 3600), abs=6e-4)
        eq6 = 0.005 * seconds / math.sqrt(f**2 + 3600 * (1 + 6400 / f**2))
        assert printed["formula"] == pytest.approx(eq6, abs=6e-4)
    # [003]: heights at the side, var(c) = 1/2 + 3/4 + 2/3 + 1 with six points
    assert found["[003]", "height, side points"]["correct"] == pytest.approx(10 * math.sqrt(35 / 12), abs=1e-3)
    assert found["[003]", "plan, central points"]["remark"].startswith("its own constant gives 21")
    # [004a]: 8 of 500 points
    assert found["[004a]", "good points rejected"]["correct"] == 1.6
    # [004b]: m_h = H m_p / b with b = 60 mm; an area goes with the square of the scale
    for f, m_p in ((70, 0.017), (100, 0.015), (140, 0.0125), (200, 0.011)):
        assert found["[004b]", f"H/m_h, f {f} mm"]["correct"] == pytest.approx(60 / m_p, abs=6e-4)
        lengths = 200 * 0.011 / (f * m_p)
        assert found["[004b]", f"eta_S, f {f} mm"]["formula"] == pytest.approx(lengths, abs=6e-4)
        assert found["[004b]", f"eta_S, f {f} mm"]["correct"] == pytest.approx(lengths**2, abs=6e-4)
    assert sum(bool(row["remark"]) and row["remark"] != "rounded to 0.5" for row in document["worked"]) == 12
    assert len(found) == len(document["worked"]) == 26


def test_every_form_has_every_table(answer: Answer) -> None:
    document = json.loads(answer("sources", "--format", "json"))
    markdown, text = answer("sources", "--format", "md").replace("\\", ""), words(answer("sources"))
    assert all(row["function"] in markdown and row["command"] in markdown for row in nonempty(document["equations"]))
    assert all(words(row["says"]) in text for row in nonempty(document["conclusions"]))
    assert all(words(f"{row['place']}: {row['printed']}") in text for row in nonempty(document["misprints"]))
    table = rows(answer("sources", "--format", "csv"))
    assert [row["what"] for row in table] == [row["what"] for row in document["worked"]]


def test_what_a_place_reads_can_be_written_and_no_other_place_is_done(call: Call, tmp_path: Path) -> None:
    assert call("sources", "-o", tmp_path / "inputs")[0] == 0
    assert "0.9196" in call("step", "scale", tmp_path / "inputs/scale.csv")[1]
    code, _, err = call("sources", "001 eq. 999")
    assert (code, "no source has the place `001 eq. 999`; expected as `001 eq. 138`" in err) == (2, True)


def test_a_number_that_differs_is_exit_1(monkeypatch: pytest.MonkeyPatch, call: Call) -> None:
    (place,) = sources.found_places("001 scale transfer")
    monkeypatch.setattr(sources, "places", lambda: [place._replace(value="0.9197")])
    code, out, _ = call("sources", "scale transfer")
    assert (code, "differs" in out) == (1, True)


@pytest.mark.parametrize(
    ("value", "found", "agrees"), [("6e-08", 6.4e-8, True), ("6e-08", 7e-8, False), ("12", 12.4, True)]
)
def test_a_number_agrees_to_its_last_digit(value: str, found: float, agrees: bool) -> None:
    place = sources.places()[0]._replace(value=value)
    assert sources.Shown(place, found).agrees is agrees
