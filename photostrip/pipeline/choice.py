"""What was chosen between the polynomial of a strip and its own covariance, and what spoke for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.frozen import dataclass
from photostrip.triangulation.covariance_adjustment.settings import BETTER
from photostrip.triangulation.polynomial.correction import Polynomial

if TYPE_CHECKING:
    from photostrip.triangulation.covariance_adjustment.adjust import CovarianceAdjustment

POLYNOMIAL, COVARIANCE = "polynomial", "covariance"


@dataclass(frozen=True)
class Witness:
    """Root mean squares of both methods, in plan (of one coordinate) and in height, metres; NaN where nothing tells."""

    polynomial: tuple[float, float]
    covariance: tuple[float, float]
    count: int  # points compared, or bands and points that were left out

    @property
    def ratio(self) -> float:
        """Covariance over polynomial, the geometric mean of plan and height."""
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log(np.divide(self.covariance, self.polynomial))
        known = logs[~np.isnan(logs)]
        return float(np.exp(known.mean())) if len(known) else float("nan")


@dataclass(frozen=True)
class Choice:
    """What was taken, and what speaks for it."""

    taken: str  # ``"polynomial"`` or ``"covariance"``
    predicted: Witness  # standard deviations of new points
    left_out: Witness | None  # errors at control left out; None where the rest determines none of it
    left_out_by: str  # ``"band"`` or ``"point"``: what was left out at a time
    excess: float  # those of the covariance over what it lets expect; NaN without any
    distances: int  # that the adjustment with the covariance used

    @property
    def contradicted(self) -> bool:
        """Whether the errors at left-out control decided against the standard deviations."""
        return self.taken != method_of(self.predicted.ratio)


@dataclass(frozen=True, eq=False)
class Deformation:
    """What the similarity leaves at the control, and who takes it out."""

    polynomial: Polynomial | None = None  # shown also where the covariance was taken
    covariance: CovarianceAdjustment | None = None  # where that was asked for or taken
    choice: Choice | None = None  # None where nothing was to be chosen

    @property
    def correction(self) -> Polynomial | None:
        """The polynomial, where it is what takes the deformation out."""
        return self.polynomial if self.covariance is None else None


def method_of(ratio: float) -> str:
    """Give the method that the ratio of its standard deviations or errors speaks for."""
    return COVARIANCE if ratio < BETTER else POLYNOMIAL
