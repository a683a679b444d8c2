"""What the similarity leaves at the control: polynomials, or the strip's own covariance.

Source: [001] eq. 150-152 for the polynomials.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.pipeline.strips.absolute import orient_on_control, reject_wrong_control
from photostrip.triangulation.polynomial import correction as polynomial

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.inputs import Settings
    from photostrip.pipeline.results import StripResult
    from photostrip.pipeline.strips.absolute import Errors, OrientedStrip, ScreenedStrip, StripStage
    from photostrip.points import ControlPoints


def adjust(screened: ScreenedStrip[Errors], settings: Settings) -> StripResult:
    """Correct the deformation of a strip and orient its photos on the corrected points."""
    oriented = screened.oriented
    correction = _polynomial(oriented, settings) if settings.adjustment == "polynomial" else None
    return oriented.stage.adjusted(screened, correction, settings)


def adjust_formed(
    stage: StripStage[Errors], control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Take a formed strip to the ground with its own control."""
    return adjust(reject_wrong_control(orient_on_control(stage, control, frames), settings), settings)


def _polynomial(oriented: OrientedStrip[Errors], settings: Settings) -> polynomial.Polynomial:
    spacing, breadth = oriented.extent
    problem = polynomial.FitProblem(
        xyz=oriented.at_control, targets=oriented.targets, weight=oriented.weights, spacing=spacing, breadth=breadth
    )
    return polynomial.fit(problem, settings.polynomial)
