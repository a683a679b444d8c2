"""Gross errors in the control: coordinates that the strip and all other control contradict.

In: a formed strip at its control. One adjustment of all misclosures with their covariance says what the sum of squares
loses without any set of coordinates, and tests points by it (``control_deletion``); where much is wrong at once,
variance components name the candidates. Out: the control that stays (``control_screening``), what was rejected, and why
(``control_rejections``). Source: derived, see docs/sources.md.
"""
