"""Every worked number of the sources, computed again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from photostrip.planning.camera_efficiency import PRINTED_TABLE, compare, source_cameras
from photostrip.planning.model_plan import source_example
from photostrip.terrestrial.accuracy import EXAMPLES, worked

# [004a]: errors that were put in, found by the residual parallax, found by Grubbs' test, missed; good points rejected
# and good points altogether
COUNTS = {"errors": 44, "parallax": 21, "Grubbs": 20, "missed": 3, "rejected": 8, "good": 500}


class Worked(NamedTuple):
    """A number that a source works out."""

    source: str
    what: str
    printed: float
    formula: float  # by the formula of the source, not rounded
    correct: float  # by what the formula should be
    unit: str = ""
    remark: str = ""


def _model() -> Iterator[Worked]:
    """Give the accuracy of a model, [003]; correct is the worse of the left and the right end of the base."""
    for row in source_example():
        wrong = abs(row.printed - row.formula) > 1 / 2
        yield Worked(
            source="[003]",
            what=f"{row.quantity}, {row.place} points",
            printed=row.printed,
            formula=row.formula,
            correct=max(row.left, row.right),
            unit="µm",
            remark="its own constant gives 21" if wrong else "six points do better",
        )


def _directions() -> Iterator[Worked]:
    """Give the required accuracy of directions, [002]."""
    for example in EXAMPLES:
        found = worked(example)
        far = abs(example.factor - found.factor) > 1 / 100
        yield Worked(
            source="[002]",
            what=f"m_lambda, {example.camera}",
            printed=example.horizontal,
            formula=found.horizontal,
            correct=found.horizontal,
            unit="″",
            remark="rounded to 0.5",
        )
        yield Worked(
            source="[002]",
            what=f"m_beta, {example.camera}",
            printed=example.vertical,
            formula=found.eq6,
            correct=found.vertical,
            unit="″",
            remark=f"with {example.factor:g} of the other" if far else "sec for cos in eq. 3",
        )
        yield Worked(
            source="[002]",
            what=f"1 + x²/f², {example.camera}",
            printed=example.factor,
            formula=found.factor,
            correct=found.factor,
            remark="belongs to the other camera" if far else "",
        )


def _cameras() -> Iterator[Worked]:
    """Give the table of cameras, [004b]."""
    cameras = source_cameras()
    for camera, row in zip(cameras, PRINTED_TABLE, strict=True):
        beside = compare(camera, cameras[-1])
        yield Worked(
            source="[004b]",
            what=f"K, {camera.name}",
            printed=row.coefficient,
            formula=camera.coefficient,
            correct=camera.coefficient,
            unit="mm²",
        )
        yield Worked(
            source="[004b]",
            what=f"H/m_h, {camera.name}",
            printed=row.height_ratio,
            formula=camera.height_ratio,
            correct=camera.height_ratio,
            remark="" if abs(row.height_ratio / camera.height_ratio - 1) < 1 / 50 else "needs a base of 55 mm",
        )
        yield Worked(
            source="[004b]",
            what=f"eta_S, {camera.name}",
            printed=row.area,
            formula=beside.printed_area,
            correct=beside.area,
            remark="" if camera is cameras[-1] else "a ratio of lengths",
        )


def _screening() -> Iterator[Worked]:
    """Give the percentages of the experiment, [004a]."""
    errors = COUNTS["errors"]
    for what, printed in (("parallax", 48.0), ("Grubbs", 45.0), ("missed", 7.0)):
        share = 100 * COUNTS[what] / errors
        yield Worked(source="[004a]", what=f"errors, {what}", printed=printed, formula=share, correct=share, unit="%")
    yield Worked(
        source="[004a]",
        what="good points rejected",
        printed=18.0,
        formula=100 * COUNTS["rejected"] / errors,
        correct=100 * COUNTS["rejected"] / COUNTS["good"],
        unit="%",
        remark="relative to the errors",
    )


def worked_numbers() -> list[Worked]:
    """Compute every worked number of every source again; [000], [001] and [004c] have none."""
    return [*_directions(), *_model(), *_screening(), *_cameras()]
