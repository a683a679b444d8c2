"""The plausibility gate: mistakes in the data that residuals hide, found, named and explained, never repaired.

In come image coordinates, strips formed of them, and given points; out come findings. ``finding`` says what can be
found, and with which code, and what competes in an adjustment.
Nothing here raises for a mistake in the data: the gate must go on to report the others.
"""

from photostrip.plausibility.finding import KINDS, accepted, found

__all__ = ["KINDS", "accepted", "found"]
