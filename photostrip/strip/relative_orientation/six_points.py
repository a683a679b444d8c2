"""Six standard points: the precision of their relative orientation, to the first order.

The points, in the left photo: 1 (0, 0), 2 (b, 0), 3 (0, a), 4 (b, a), 5 (0, -a), 6 (b, -a) with the photo base b.
Elements are those of ``relative``: alpha1', kappa1', alpha2', omega2', kappa2'.

Source: derived from the linear condition; the weight numbers of the dependent pair are those of [Hallert].
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats


def cofactors(focal: float, width: float, base: float) -> Floats:
    """Cofactors (5, 5) of the elements from six standard points, rad^2/mm^2 for a y parallax of unit variance."""
    f, a, b = focal, width, base
    alpha, omega = f**2 / (2 * a**2 * b**2), 3 * f**2 / (4 * a**4)
    kappa = (8 * a**4 + 12 * a**2 * f**2 + 9 * f**4) / (12 * a**4 * b**2)
    matrix = np.diag([alpha, kappa, alpha, omega, kappa])
    matrix[[1, 4], [4, 1]] = (a**4 / 3 + a**2 * f**2 + 3 * f**4 / 4) / (a**4 * b**2)
    matrix[[1, 4, 3, 3], [3, 3, 1, 4]] = f * (2 * a**2 + 3 * f**2) / (4 * a**4 * b)
    return matrix


def dependent_from_base(base: float) -> Floats:
    """First-order relation T (5, 5) of the dependent pair (left photo fixed) to the base-frame elements.

    (by, bz, dkappa, dalpha, domega) = T (alpha1', kappa1', alpha2', omega2', kappa2'), lengths in mm. The cofactors
    follow as T Q T^T for any points. dalpha = alpha2' + bz/b is the decorrelation that [000] uses.
    """
    matrix = np.zeros((5, 5))
    matrix[0, 1] = matrix[1, 0] = -base
    matrix[2, [1, 4]] = matrix[3, [0, 2]] = -1.0, 1.0
    matrix[4, 3] = 1.0
    return matrix
