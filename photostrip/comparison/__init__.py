"""Two results beside each other: what differs by more than is allowed, for regression checks.

Two documents of results and ``Tolerances`` come in, one plain document goes out (``comparison``); ``truth`` compares a
result with what it was simulated from.
"""

from photostrip.comparison.comparison import SetTolerance, Tolerance, Tolerances, baseline_of, compare_results

__all__ = ["SetTolerance", "Tolerance", "Tolerances", "baseline_of", "compare_results"]
