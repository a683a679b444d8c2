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

    @property
    def for_polynomial(self) -> bool:
        """Whether the covariance does not do better, so that the polynomial of the textbook may stay."""
        return not self.ratio < BETTER


@dataclass(frozen=True)
class Choice:
    """What was taken, and what speaks for it."""

    taken: str  # ``"polynomial"`` or ``"covariance"``
    predicted: Witness  # standard deviations of new points
    # difference: of both results at these points, rms in plan (of one coordinate) and in height, metres
    difference: tuple[float, float]
    left_out: Witness | None  # errors at control left out; None where the rest determines none of it
    left_out_by: str  # ``"band"`` or ``"point"``: what was left out at a time
    excess: float  # those of the covariance over what it lets expect; NaN without any

    @property
    def expected(self) -> Witness:
        """Errors to be expected of new points, both results being known."""
        return expected_of(self.predicted, self.difference)

    @property
    def apart(self) -> bool:
        """Whether the results differ by more than standard deviations that agree let expect."""
        return self.predicted.for_polynomial and not self.expected.for_polynomial

    @property
    def contradicted(self) -> bool:
        """Whether the errors at left-out control decided against the standard deviations."""
        return self.taken != method_of(self.predicted, self.expected)


_NOTHING = (float("nan"), float("nan"))
# the polynomial, where a strip's own covariance does not determine it
NOT_COMPARED = Choice(
    taken=POLYNOMIAL,
    predicted=Witness(_NOTHING, _NOTHING, 0),
    difference=_NOTHING,
    left_out=None,
    left_out_by="point",
    excess=float("nan"),
)


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


def expected_of(predicted: Witness, difference: tuple[float, float]) -> Witness:
    """Give the errors to be expected of both methods once their results are known.

    The covariance gives the best linear unbiased estimate: by how much any other differs from it is independent of its
    error. So what is to be expected of the polynomial is that error and the difference as it is.

    difference: of the results, rms in plan (of one coordinate) and in height, metres.

    Source: derived; docs/method.md.
    """
    plan, height = np.hypot(predicted.covariance, difference).tolist()
    return Witness((plan, height), predicted.covariance, predicted.count)


def method_of(predicted: Witness, expected: Witness) -> str:
    """Give the polynomial where the methods agree before their results are known, and with them."""
    return POLYNOMIAL if predicted.for_polynomial and expected.for_polynomial else COVARIANCE
