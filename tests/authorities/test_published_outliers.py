"""Published critical values and examples of tests for outliers."""

from __future__ import annotations

import numpy as np
import pytest

from photostrip.statistics import grubbs_limit

# F. E. Grubbs: Procedures for detecting outlying observations in samples, Technometrics 11 (1969), table 1:
# one-sided critical values by number of observations, at 5 %, 2.5 % and 1 %.
PRINTED = {
    3: (1.15, 1.15, 1.15),
    4: (1.46, 1.48, 1.49),
    5: (1.67, 1.71, 1.75),
    6: (1.82, 1.89, 1.94),
    7: (1.94, 2.02, 2.10),
    8: (2.03, 2.13, 2.22),
    10: (2.18, 2.29, 2.41),
    12: (2.29, 2.41, 2.55),
    15: (2.41, 2.55, 2.71),
    16: (2.44, 2.59, 2.75),
    18: (2.50, 2.65, 2.82),
    20: (2.56, 2.71, 2.88),
}


@pytest.mark.parametrize("n", PRINTED)
def test_the_table_of_grubbs(n: int) -> None:
    found = [grubbs_limit(n, 2 * alpha) for alpha in (0.05, 0.025, 0.01)]
    assert found == pytest.approx(PRINTED[n], abs=0.0071)  # the last printed digit is not always rounded
    assert grubbs_limit(n, 0.05) == pytest.approx(PRINTED[n][1], abs=0.0071)


def test_the_mass_spectrometer_of_the_nist_handbook() -> None:
    """NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.5.17.1: G = 2.469, critical value 2.032 (one-sided, 5 %)."""
    sample = np.array([199.31, 199.53, 200.19, 200.82, 201.92, 201.95, 202.18, 245.57])
    value = (sample.max() - sample.mean()) / sample.std(ddof=1)
    limit = grubbs_limit(8, 2 * 0.05)
    assert value == pytest.approx(2.469, abs=0.0005)
    assert limit == pytest.approx(2.032, abs=0.0005)
    rest = sample[:-1]
    assert (rest.max() - rest.mean()) / rest.std(ddof=1) < grubbs_limit(7, 2 * 0.05)
