"""The block on control that was left out in turn: differences there, and whether they are what was predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.pipeline.results import Result
from photostrip.points import take_rows
from photostrip.result.numbers import natural, rms
from photostrip.result.points.given import PARTS, differences, size_columns
from photostrip.result.points.own_precision import chances
from photostrip.result.points.precision import INSIDE, point_columns
from photostrip.result.points.standing_out import stand_out
from photostrip.result.quantities import record
from photostrip.result.table import Table

LEAST = 1e-300  # probability below which it is all the same
Columns = dict[str, list[object]]


def cross_validation_of(result: Result) -> Document:
    """Return the block ``cross_validation`` under its key; nothing when no control was left out.

    The errors of different folds come from nearly the same measurements. The probability of all of them together is
    the harmonic mean of those of the folds, which holds for tests that are not independent.

    Source: [Wilson 2019].
    """
    if not result.folds:
        return {}
    folds: list[Document] = []
    columns = Columns()
    for number, fold in enumerate(result.folds, 1):
        chance = None
        if fold.result is not None:
            chance = _joint(fold.result)
            for name, values in _left_out(fold.result, number).items():
                columns.setdefault(name, []).extend(values)
        folds.append({"left_out": list(fold.left_out), "p": chance, "reason": fold.reason})
    known = [fold["p"] for fold in folds if fold["p"] is not None]
    summed = {} if not columns else _summed(columns)
    block = {
        "folds": Table.of_rows("cross_validation.folds", folds),
        "p": len(known) / sum(1 / max(chance, LEAST) for chance in known) if known else None,
        **{part: summed.get(part, dict.fromkeys(("count", "rms", "rms_um", "inside_95", "ratio"))) for part in PARTS},
    }
    points = Table.of("cross_validation.points", columns) if columns else Table.of_rows("cross_validation.points", ())
    order = sorted(range(len(points)), key=lambda row: natural(points["id"][row]))
    return {"cross_validation": record("cross_validation", block | {"points": points[order]})}


def _joint(result: Result) -> float | None:
    """Probability of larger errors at the points of a fold, of its strips together; None when nothing is predicted."""
    tests = [] if result.precision is None else [each for each in result.precision.checks if each is not None]
    return min(1.0, len(tests) * min(each.probability for each in tests)) if tests else None


def _left_out(result: Result, fold: int) -> dict[str, Sequence[object]]:
    """Return the columns of the points that were left out in a fold."""
    found = differences(result)
    rows, over = found.checks
    at = result.control_rows[rows]
    there = replace(
        result,
        points=take_rows(result.points, at, ("number", "cartesian", "ground", "rays")),
        precision=None if result.precision is None else take_rows(result.precision, at, ("points",)),
    )
    sigma = {key: column for key, column in point_columns(there).items() if key.startswith("sigma")}
    differ = size_columns(found.axes[rows], found.plan[rows], found.height[rows], found.scale[rows])
    columns = {
        **differ,
        **{key: np.full(len(rows), np.nan) if column is None else column for key, column in sigma.items()},
        "chance_plan": found.chance[rows, 0],
        "chance_height": found.chance[rows, 1],
        "z_plan": over[:, 0],
        "z_height": over[:, 1],
        **chances(over),
    }
    ids = [result.inputs.control.ids[row] for row in rows]
    return {"id": ids, "fold": [fold] * len(rows), **{key: column.tolist() for key, column in columns.items()}}


def _summed(columns: Columns) -> Document:
    """Sum up the differences in plan and height; say in the columns which of them stand out."""
    values: dict[str, Floats] = {
        name: np.array(column, float) for name, column in columns.items() if name not in {"id", "fold"}
    }
    likely = {part: np.array(columns.pop(f"chance_{part}"), float) for part in PARTS}
    odd = {part: stand_out(values[part], 2 if part == "plan" else 1, likely[part]) for part in PARTS}
    columns["stands_out"] = [[part for part in PARTS if odd[part][row]] for row in range(len(columns["id"]))]
    return {
        part: {
            "count": int(np.isfinite(values[part]).sum()),
            "rms": rms(values[part]),
            "rms_um": rms(values[f"{part}_um"]),
            "inside_95": int((np.abs(values[f"z_{part}"]) <= INSIDE[part]).sum()),
            "ratio": rms(values[f"z_{part}"]) / (2.0 if part == "plan" else 1.0) ** 0.5,
        }
        for part in PARTS
    }
