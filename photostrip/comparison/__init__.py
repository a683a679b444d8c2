"""Two results beside each other: what differs by more than is allowed, for regression checks.

Two documents of results and ``tolerances`` come in, one plain document goes out (``comparison``). ``quantities`` finds
the numbers, each with its kind, id and unit; ``ground`` says how far two points are apart in plan and in height;
``members`` compares ids, choices, rejections and findings as sets; ``truth`` compares a result with what it was
simulated from.
"""

from photostrip.comparison.comparison import baseline_of, compare_results
from photostrip.comparison.tolerances import SetTolerance, Tolerance, Tolerances

__all__ = ["SetTolerance", "Tolerance", "Tolerances", "baseline_of", "compare_results"]
