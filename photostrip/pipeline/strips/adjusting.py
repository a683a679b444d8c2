"""What the similarity leaves at the control: polynomials, the strip's own covariance, or the better of the two.

Source: [001] eq. 150-152 for the polynomials.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from photostrip.errors import GeometryError
from photostrip.frozen import replace
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.choice import COVARIANCE, NOT_COMPARED, POLYNOMIAL, Deformation
from photostrip.pipeline.inputs import AUTO, Settings
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.strips.absolute import Errors, OrientedStrip, ScreenedStrip, StripStage, on_control
from photostrip.pipeline.strips.stages import Stages
from photostrip.points import ControlPoints
from photostrip.triangulation.polynomial import correction as polynomial


def adjust(screened: ScreenedStrip[Errors], settings: Settings, stages: Stages | None = None) -> StripResult:
    """Correct the deformation of a strip and orient its photos on the corrected points."""
    oriented = screened.oriented
    found = _deformation(oriented, settings, stages or Stages())
    return oriented.stage.adjusted(screened, found, settings)


def adjust_without(whole: StripResult, screened: ScreenedStrip[Errors], settings: Settings) -> StripResult:
    """Adjust a strip as ``whole`` was, on the part of its control that ``screened`` holds.

    Raises numpy.linalg.LinAlgError where this part does not determine the rest.
    """
    covariance = None if whole.photo_stages is None else whole.photo_stages.solved
    if whole.photo_stages is None or covariance is None:
        asked = POLYNOMIAL if settings.adjustment == AUTO else settings.adjustment
        return adjust(screened, replace(settings, adjustment=asked))
    held = np.isin(whole.control.ids, screened.oriented.control.ids)
    gone = np.flatnonzero(~held[covariance.figures.control.point])
    if not len(gone):
        return whole
    left = covariance.without(gone)
    return replace(
        whole,
        xyz=left.xyz,
        cartesian=whole.intermediate.cartesian_from_intermediate(left.xyz),
        photo_stages=replace(whole.photo_stages, solved=left),
    )


def adjust_formed(
    stage: StripStage[Errors], control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    return adjust(on_control(stage, control, frames, settings), settings)


def _deformation(oriented: OrientedStrip[Errors], settings: Settings, stages: Stages) -> Deformation:
    """Find what the settings ask for; with `auto` both, and which of them is better."""
    asked = settings.adjustment
    fitted = _polynomial(oriented, settings) if asked in {POLYNOMIAL, AUTO} else None
    covariance = None
    if asked in {COVARIANCE, AUTO}:
        by_covariance = partial(oriented.stage.by_covariance, oriented, settings)
        try:
            covariance = stages.once("covariance", by_covariance, oriented, settings.covariance)
        except GeometryError:
            if fitted is None:
                raise
            return Deformation(fitted, choice=NOT_COMPARED)
    if fitted is None or covariance is None:
        return Deformation(fitted, covariance)
    from photostrip.pipeline.strips.choosing import choose

    choice = choose(oriented, fitted, covariance)
    return Deformation(fitted, covariance if choice.taken == COVARIANCE else None, choice)


def _polynomial(oriented: OrientedStrip[Errors], settings: Settings) -> polynomial.Polynomial:
    spacing, breadth = oriented.extent
    problem = polynomial.FitProblem(
        xyz=oriented.at_control, targets=oriented.targets, weight=oriented.weights, spacing=spacing, breadth=breadth
    )
    return polynomial.fit(problem, settings.polynomial)
