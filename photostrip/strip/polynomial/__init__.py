"""Polynomial correction of the deformation that the similarity leaves in a strip.

Comes in: control points after absolute orientation, X along the strip, with targets and weights. Goes out: a
``Polynomial`` of each axis in X and Y. ``terms`` says which terms control can carry where it stands, ``least_squares``
fits them, ``correction`` decides by evidence how many are used and puts it together.

Source: [001] eq. 150-151, the free term of 151 corrected to X - X'.
"""
