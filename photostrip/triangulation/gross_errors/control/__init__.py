"""Gross errors in the control: coordinates that the strip and all other control contradict.

In: a formed strip at its control (``strip_at_control``): misclosures w, their joint covariance D, the derivatives A by a
similarity. One adjustment with M = D^-1 - D^-1 A (A^T D^-1 A)^-1 A^T D^-1 says what the sum of squares w^T M w loses
without any set of coordinates, and tests points by it (``control_deletion``); where much is wrong at once, variance
components name the candidates (``control_components``). Out: the control that stays (``control_screening``), and what
was rejected, why, and what seems to have happened (``control_rejections``). Source: derived, see docs/sources.md.
"""
