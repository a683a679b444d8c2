"""What is said of points beyond the control of a strip."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from photostrip.pipeline.strip_notes import polynomial_notes

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Strip
    from photostrip.strip.polynomial import Polynomial


@pytest.mark.parametrize(
    ("begin", "end", "beyond"),
    [(-1000.0, 5000.0, None), (-1200.0, 5000.0, 700), (0.0, 5650.0, 650), (-1600.0, 5600.0, 1100)],
)
def test_points_beyond_the_control_are_told_with_how_far(begin: float, end: float, beyond: int | None) -> None:
    """The control reaches from -500 m to 5000 m; a tenth of that is 550 m: more is told, less is not."""
    correction = cast(
        "Polynomial",
        SimpleNamespace(asked="auto", degree=2, reach=(-500.0, 5000.0), axes=[SimpleNamespace(redundancy=9)]),
    )
    adjusted = np.array([[begin, 0.0, 0.0], [2000.0, 0.0, 0.0], [end, 0.0, 0.0]])
    notes = list(polynomial_notes(cast("Strip", SimpleNamespace(id="A")), correction, adjusted))
    assert [note.code for note in notes] == ([] if beyond is None else ["extrapolation"])
    points = "2 points lie" if begin < -500.0 and end > 5000.0 else "1 point lies"
    words = "" if beyond is None else f"{points} up to {beyond} m beyond the control"
    assert words in " ".join(note.message for note in notes)
