"""Errors of a strip as rows that reach over a few models, as the adjustment by the covariance of the strip needs them.

Nothing else does: points, photos and control take them from ``error_propagation``.

Source: derived; see docs/precision.md.
"""
