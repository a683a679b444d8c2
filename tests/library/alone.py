"""Steps of the method as commands, and their answers as numbers."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.loops import nonempty

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from tests.calls import Call

    Document = dict[str, Any]

F153 = "principal_distance=153"
PAIR = "point x_left y_left x_right y_right"
ON_GROUND = "point x y z x_ground y_ground z_ground"


class Alone:
    """Steps as commands; what has an equals sign in it is a key that is set."""

    def __init__(self, call: Call, folder: Path) -> None:
        self.call, self.folder = call, folder

    def write(self, lines: list[str], name: str = "points.csv") -> str:
        """Write a table; give its path."""
        (self.folder / name).write_text("\n".join(lines), encoding="utf-8")
        return str(self.folder / name)

    def table(
        self,
        head: str,
        ids: Sequence[str],
        *columns: Sequence[Sequence[float]] | NDArray[np.float64],
        name: str = "points.csv",
    ) -> str:
        """Write a table of points with all digits; give its path."""
        rows = np.hstack([np.asarray(each, float) for each in columns]).tolist()
        lines = [",".join([first, *map(repr, row)]) for first, row in zip(ids, rows, strict=True)]
        return self.write([head.replace(" ", ","), *lines], name)

    def typed(self, *arguments: str) -> tuple[int, str, str]:
        return self.call("step", *(f"--set={each}" if "=" in each else each for each in arguments))

    def __call__(self, *arguments: str) -> Document:
        """Take a step that must succeed; give its answer with its trace."""
        code, out, err = self.typed(*arguments, "--trace", "--format", "json")
        assert (code, err) == (0, "")
        document: Document = json.loads(out)
        return document


def values(answer: Document) -> dict[str, float]:
    return {each["name"]: each["value"] for each in answer["values"]}


def axes(rows: list[Document], names: Sequence[str]) -> NDArray[np.float64]:
    return np.array([[row[axis] for axis in names] for row in rows])


def traced(answer: Document) -> dict[str, dict[str, NDArray[np.float64]]]:
    """Give the tables of a trace: columns by name."""
    return {
        key.removeprefix("trace_"): {
            name: np.array([row[name] for row in rows], float) for name in rows[0] if name != "id"
        }
        for key, rows in nonempty(answer.items())
        if key.startswith("trace_")
    }
