"""Accuracy along a strip before it is flown.

``ideal_strip`` is simulated without errors and formed, with places for its control; ``methods`` adjusts it, ``design``
and ``placement`` compare layouts.
"""
