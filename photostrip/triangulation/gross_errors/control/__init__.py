"""Gross errors in the control: coordinates that the strip and all other control contradict.

``control_screening`` searches, ``strip_at_control`` predicts every coordinate by the others, with the covariance of the
strip (``control_significance``) or a polynomial; ``control_subsets`` finds the half that agrees, ``control_rejections``
says what was rejected. Source: derived, see docs/sources.md.
"""
