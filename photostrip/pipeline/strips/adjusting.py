"""What the similarity leaves at the control, taken out by polynomials.

Source: [001] eq. 150-152.
"""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.inputs import SIMILARITY, Settings
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.strips import models, photos_on_control
from photostrip.pipeline.strips.absolute import OrientedStrip
from photostrip.pipeline.strips.models import LinkedModels
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.pipeline.strips.photos_on_control import ScreenedPhotos
from photostrip.points import ControlPoints
from photostrip.strip.polynomial import correction as polynomial


def adjust_photos(screened: ScreenedPhotos, settings: Settings) -> StripResult:
    """Correct the deformation of a strip and orient its photos on the corrected points."""
    return photos_on_control.adjusted(screened, _correction(screened.photos.oriented, settings), settings)


def adjust_formed(
    stage: FormedPhotos | LinkedModels, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Lay a formed strip on its control and correct its deformation."""
    if isinstance(stage, FormedPhotos):
        return adjust_photos(photos_on_control.on_control(stage, control, frames, settings), settings)
    found = models.on_control(stage, control, frames, settings)
    return models.adjusted(found, _correction(found.models.oriented, settings))


def _correction(oriented: OrientedStrip, settings: Settings) -> polynomial.Polynomial | None:
    if settings.adjustment == SIMILARITY:
        return None
    spacing, breadth = oriented.extent
    problem = polynomial.FitProblem(
        xyz=oriented.at_control, targets=oriented.targets, weight=oriented.weights, spacing=spacing, breadth=breadth
    )
    return polynomial.fit(problem, settings.polynomial)
