"""Covariances of every strip of a run, and the test of its check points.

What comes in are adjusted strips and the same strips as they lay on their control, with their derivatives; what goes
out is a ``results.Precision`` in the project's Cartesian frame. Each strip is differentiated by itself
(``photo_precision``); points of several strips share the errors of common control
(``strip_precision``). ``check_points`` tests differences there, ``joint_points`` has covariances between points. The
equations are derived in docs/precision.md.
"""
