"""What the sources print: worked numbers computed again, misprints, and the command and function for every equation."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from importlib import resources
from typing import NamedTuple

from photostrip.planning.camera_efficiency import PRINTED_TABLE, compare, source_cameras
from photostrip.planning.model_plan import source_example
from photostrip.report.page.parts import Words
from photostrip.report.page.tables import Field, fields
from photostrip.sheets.sheet import Rows, Sheet
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


def sources_sheet() -> Sheet:
    """Return worked numbers, misprints and equations."""
    number = fields("printed formula correct", "ratio g4")
    numbers = Rows(
        "worked",
        "Worked numbers, computed again",
        (Field("source"), Field("what", head="number"), *number, Field("unit", head=""), Field("remark")),
        worked_numbers(),
        note="formula: that of the source, not rounded; correct: without its misprints and assumptions",
    )
    misprints = read("misprints")
    names = tuple(Field(name, shown=False) for name in misprints[0])
    listed = [
        Rows(
            "misprints",
            f"Misprints of {tag}",
            names,
            [tuple(row.values()) for row in misprints if row["source"] == tag],
            below=[Words(_misprint(row), mark="-") for row in misprints if row["source"] == tag],
        )
        for tag in sorted({row["source"] for row in misprints})
    ]
    equations = Rows(
        "equations",
        "From an equation to a function",
        (Field("equation"), Field("what", rank=1), Field("command", rank=2), Field("function")),
        [tuple(row.values()) for row in read("equations")],
        note="with the commands in every form but text on a narrow page",
    )
    return Sheet("sources", "What the sources print", (), (numbers, *listed, equations))


def read(name: str) -> list[dict[str, str]]:
    """Read ``equations`` or ``misprints``."""
    text = resources.files("photostrip.sheets").joinpath(f"{name}.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text)))


def _misprint(row: dict[str, str]) -> str:
    shows = f" ({row['shows']})" if row["shows"] else ""
    return f"{row['place']}: {row['printed']}. Correct: {row['correct']}{shows}."


def worked_numbers() -> list[Worked]:
    """Compute every worked number of every source again; [000], [001] and [004c] have none."""
    return [*_directions(), *_model(), *_screening(), *_cameras()]


def _model() -> Iterator[Worked]:
    """Give the accuracy of a model, [003]; correct is the worse of the left and the right end of the base."""
    for row in source_example():
        wrong = abs(row.printed - row.formula) > 1 / 2
        remark = "its own constant gives 21" if wrong else "six points do better"
        ends = f"{row.left:.1f}, right {row.right:.1f}"
        remark += f": left {ends}; constant not rounded {row.assumed:.1f}"
        what = f"{row.quantity}, {row.place} points"
        yield Worked("[003]", what, row.printed, row.formula, max(row.left, row.right), "µm", remark)


def _directions() -> Iterator[Worked]:
    """Give the required accuracy of directions, [002]."""
    for example in EXAMPLES:
        found, camera = worked(example), example.camera
        far = abs(example.factor - found.factor) > 1 / 100
        level = found.horizontal
        yield Worked("[002]", f"m_lambda, {camera}", example.horizontal, level, level, "″", "rounded to 0.5")
        remark = f"with {example.factor:g} of the other {found.printed_factor:.2f}" if far else "sec for cos in eq. 3"
        remark += f"; by eq. 4 {found.eq4:.2f}, by eq. 5 {found.eq5:.2f}"
        yield Worked("[002]", f"m_beta, {camera}", example.vertical, found.eq6, found.vertical, "″", remark)
        remark = "belongs to the other camera" if far else ""
        yield Worked("[002]", f"1 + x²/f², {camera}", example.factor, found.factor, found.factor, "", remark)


def _cameras() -> Iterator[Worked]:
    """Give the table of cameras, [004b]."""
    cameras = source_cameras()
    for camera, row in zip(cameras, PRINTED_TABLE, strict=True):
        beside, coefficient, ratio = compare(camera, cameras[-1]), camera.coefficient, camera.height_ratio
        near = abs(row.height_ratio / ratio - 1) < 1 / 50
        yield Worked("[004b]", f"K, {camera.name}", row.coefficient, coefficient, coefficient, "mm²")
        remark = "" if near else "needs a base of 55 mm"
        yield Worked("[004b]", f"H/m_h, {camera.name}", row.height_ratio, ratio, ratio, "", remark)
        remark = "" if camera is cameras[-1] else f"a ratio of lengths; m_h at equal area {beside.height_error:.3f}"
        yield Worked("[004b]", f"eta_S, {camera.name}", row.area, beside.printed_area, beside.area, "", remark)


def _screening() -> Iterator[Worked]:
    """Give the percentages of the experiment, [004a]."""
    errors = COUNTS["errors"]
    for what, printed in (("parallax", 48.0), ("Grubbs", 45.0), ("missed", 7.0)):
        share = 100 * COUNTS[what] / errors
        yield Worked("[004a]", f"errors, {what}", printed, share, share, "%")
    of_errors, of_good = (100 * COUNTS["rejected"] / COUNTS[of] for of in ("errors", "good"))
    yield Worked("[004a]", "good points rejected", 18.0, of_errors, of_good, "%", "relative to the errors")
