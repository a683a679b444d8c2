"""What is asked of the adjustment with a strip's own covariance."""

from __future__ import annotations

from photostrip.frozen import dataclass
from photostrip.statistics import TEST_LEVEL

# standard deviations over those of the polynomial: where the covariance does not do better than that, the polynomial
# of the textbook stays
BETTER = 0.90


@dataclass(frozen=True)
class CovarianceSettings:
    """Which misclosures an adjustment with the covariance of the strip distributes."""

    # whether distances of pass points from the common centres of their models count beside the control
    distances: bool = True
    # probability that a control coordinate of a sound strip is called doubtful; and that the strip as a whole is
    level: float = TEST_LEVEL / 2
