"""Accuracy along a strip before it is flown.

``ideal_strip`` is simulated without errors and formed, ``methods`` adjusts it, ``control_layout``, ``design`` and
``placement`` compare layouts.
"""
