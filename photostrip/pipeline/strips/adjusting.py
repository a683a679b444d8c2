"""What the similarity leaves at the control, taken out by polynomials.

Source: [001] eq. 150-152.
"""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.inputs import SIMILARITY, Settings
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.strips.absolute import Errors, OrientedStrip, ScreenedStrip, StripStage, on_control
from photostrip.points import ControlPoints
from photostrip.strip.polynomial import correction as polynomial


def adjust(screened: ScreenedStrip[Errors], settings: Settings) -> StripResult:
    """Correct the deformation of a strip and orient its photos on the corrected points."""
    oriented = screened.oriented
    correction = None if settings.adjustment == SIMILARITY else _polynomial(oriented, settings)
    return oriented.stage.adjusted(screened, correction, settings)


def adjust_formed(
    stage: StripStage[Errors], control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    return adjust(on_control(stage, control, frames, settings), settings)


def _polynomial(oriented: OrientedStrip[Errors], settings: Settings) -> polynomial.Polynomial:
    spacing, breadth = oriented.extent
    problem = polynomial.FitProblem(
        xyz=oriented.at_control, targets=oriented.targets, weight=oriented.weights, spacing=spacing, breadth=breadth
    )
    return polynomial.fit(problem, settings.polynomial)
