"""Two results beside each other: what differs by more than is allowed, for regression checks.

- ``tolerances``: what is allowed for each kind of quantity;
- ``ground``: how far two ground points are apart, in plan and in height;
- ``quantities``: the numbers of a result, each with its kind, id and unit;
- ``comparison``: the comparison, as one plain document.
"""

from photostrip.compare.comparison import baseline_of, compare_results
from photostrip.compare.tolerances import SetTolerance, Tolerance, Tolerances

__all__ = ["SetTolerance", "Tolerance", "Tolerances", "baseline_of", "compare_results"]
