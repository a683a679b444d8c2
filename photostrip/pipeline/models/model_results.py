"""What comes out of a strip of independent models: every stage, nothing thrown away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.notes import Note
    from photostrip.pipeline.inputs import ModelStrip
    from photostrip.points import ControlPoints
    from photostrip.triangulation import absolute_orientation as absolute
    from photostrip.triangulation.gross_errors.control import control_screening, control_significance
    from photostrip.triangulation.independent_models.formation import FormedModels
    from photostrip.triangulation.polynomial import correction as polynomial

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

MILLIMETRES = 1000.0  # in a metre


@dataclass(frozen=True, eq=False)
class LinkedStrip:
    """Every stage of one strip of independent models, in order.

    What it has in common with ``results.StripResult`` has the same name.
    """

    strip: ModelStrip
    formed: FormedModels  # its models in one system, and the links between them
    precision: tuple[float, float]  # a-priori standard deviation of a point of one model in plan and height, metres
    intermediate: IntermediateFrame
    control: ControlPoints  # control that took part
    control_rows: Numbers  # (n,): its rows in the strip's points
    absolute: absolute.AbsoluteOrientation
    # correction of the strip deformation; None with ``adjustment: similarity``
    polynomial: polynomial.Polynomial | None
    xyz: Floats  # (q, 3): adjusted points, intermediate frame, metres; points of ``formed.point``
    cartesian: Floats  # (q, 3): the same in the project's Cartesian frame
    # (f, 3): adjusted perspective centres in flight order, intermediate frame, metres; NaN where none was measured
    centers: Floats
    depth: float  # mean height of the centres above the points, metres; NaN without centres
    notes: tuple[Note, ...]  # what this strip's numbers say beside themselves
    # control coordinates that were not used; ``control`` says so in its ``use``
    wrong_control: tuple[control_screening.ControlRejection, ...]
    # what the covariance of the strip says of each coordinate of ``control``; None without
    judged_control: control_significance.Judged | None = None

    @property
    def model_scales(self) -> Floats:
        """Denominator of the scale of each model."""
        scales: Floats = self.absolute.similarity.scale * self.formed.places.scale * MILLIMETRES
        return scales

    @property
    def scale_number(self) -> float:
        """Denominator of the mean scale of the models."""
        return float(np.exp(np.log(self.model_scales).mean()))
