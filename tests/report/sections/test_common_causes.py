"""What an adjustment took up as common to many observations is said in the default report, and what it estimated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geometry.rotation import angles
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations
from photostrip.pipeline.run import triangulate
from photostrip.report.html import to_html
from photostrip.report.page.layout import to_markdown
from photostrip.report.sections.accuracy_report import chosen_sections, title_of
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Spec
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Gnss
from tests.loops import nonempty
from tests.results import by_rows, in_tables
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from photostrip.notes import Document

TWICE_IN_RADIANS = np.pi / 180.0


@cache
def adjusted(
    *, east: float = 0.0, distance: float = 1.0, correction: str = "none", start_angles: float = 0.0
) -> Document:
    """Adjust a block whose camera positions are shifted, or whose principal distance is given wrong.

    start_angles: factor of the angles that are given as a start; 0: none are given.
    """
    made = simulate(Spec(seed=7, flight=Flight(photos=10, strips=2), control=Control(bands=2), gnss=Gnss()))
    truth, inputs = made.truth, inputs_of(made)
    assert made.gnss is not None
    count = len(truth.photo_ids)
    cameras = [each.camera for each in inputs.strips]
    inputs = replace(
        inputs,
        strips=tuple(
            replace(each, camera=replace(camera, principal_distance=camera.principal_distance * distance))
            for each, camera in zip(inputs.strips, cameras, strict=True)
        ),
        positions=CameraPositions(
            photos=truth.photo_ids,
            frame=inputs.frames[0],
            enu=made.gnss + np.array([east, 0.0, 0.0]),
            use=np.ones((count, 3), bool),
            sigma=np.tile((0.10, 0.10, 0.15), (count, 1)),
            time=np.full(count, np.nan),
            correction=correction,
        ),
    )
    if start_angles:
        given, unknown = angles(truth.rotations_local, "omega-phi-kappa") * start_angles, np.full((count, 3), np.nan)
        start = GivenOrientations(
            truth.photo_ids, inputs.frames[0], truth.centers_ground, given, "omega-phi-kappa", unknown, unknown, False
        )
        inputs = replace(inputs, orientations=start)
    return document_of(triangulate(inputs, replace(settings_of(made), adjustment="bundle")))


def said(document: Document, label: str) -> list[str]:
    """Return what the stages say under a label."""
    (stages,) = (each for each in chosen_sections(in_tables(document), width=400) if each.title == "Stages")
    (facts,) = stages.parts
    return [value for name, value in facts.rows if name == label]  # type: ignore[union-attr]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "cause", "value"),
    [
        ({"east": 10.0}, "offset of the camera positions of the block", "camera positions of the block: added -9.9"),
        ({"distance": 1.01}, "principal distance of camera film", "camera film: principal distance -1.5"),
    ],
)
def test_beside_an_error_it_is_said_all_the_same(wrong: dict[str, float], cause: str, value: str) -> None:
    """Start angles in another unit are an error; then no finding names what the adjustment went on with."""
    document = adjusted(**wrong, start_angles=TWICE_IN_RADIANS)
    assert [each["code"] for each in document["findings"]] == ["P601"]
    assert said(document, "taken up") == [cause]
    (estimated,) = said(document, "estimated")
    assert estimated.startswith(value)
    assert "(σ 0.0" in estimated
    sections = chosen_sections(document, width=100)
    assert cause in to_markdown(title_of(document), sections)
    assert cause in to_html(document)


@pytest.mark.slow
def test_what_the_project_asks_for_is_estimated_and_not_taken_up() -> None:
    document = adjusted(east=10.0, correction="offset")
    assert document["bundle"]["taken_up"] == []
    assert said(document, "taken up") == []
    first, second = said(document, "estimated")
    assert first.startswith("camera positions of strip A: added -9.")
    assert second.startswith("camera positions of strip B: added -")


@pytest.mark.slow
def test_a_drift_is_told_by_what_it_is_from_the_first_to_the_last() -> None:
    document = adjusted(correction="drift")
    for row in nonempty(document["bundle"]["corrections"]):
        times = 9.0 if row["kind"] == "drift" else 1.0  # from the first of ten photos to the last
        assert row["whole"] == pytest.approx(times * row["value"], abs=1e-4)
        assert row["whole_sigma"] == pytest.approx(times * row["sigma"], abs=1e-3)
    first, _ = said(document, "estimated")
    assert "; from the first to the last " in first


@pytest.mark.slow
def test_of_many_groups_the_most_significant_are_shown() -> None:
    """Fifty strips with an offset each do not fill the page."""
    document = by_rows(adjusted(east=10.0, correction="offset"))
    rows = [row for row in document["bundle"]["corrections"] if row["group"] == "strip A"]
    document["bundle"]["corrections"] = [
        {**row, "group": f"strip {n}", "whole": float(n % 31)} for n in range(50) for row in rows
    ]
    *shown, more = said(document, "estimated")
    assert [each.split(":")[0] for each in shown] == [f"camera positions of strip {n}" for n in (28, 29, 30)]
    assert more == "47 more cameras or groups of positions, less significant: --section bundle"


@pytest.mark.slow
def test_like_causes_share_a_line_and_name_what_explains_as_much() -> None:
    document = by_rows(adjusted(east=10.0, correction="offset"))
    of_photos = [{"cause": "shift of a photo", "of": f"{n}", "rivals": []} for n in range(9)]
    of_list: Document = {"cause": "control list", "of": "control[1]", "rivals": ["control list"]}
    of_list |= dict.fromkeys(f"{name}_{axis}" for name in ("shift", "sigma") for axis in ("east", "north"))
    of_list |= {"shift_up": 0.612, "sigma_up": 0.021}
    document["bundle"]["taken_up"] = [*of_photos, of_list]
    assert said(document, "taken up") == [
        "shift of photos 0, 1, 2 and 6 more",
        (
            "without control[1], which lies +0.612 m up (σ 0.021) beside all else; another control list would explain "
            "it nearly as well"
        ),
    ]
