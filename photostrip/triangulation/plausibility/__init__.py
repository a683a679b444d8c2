"""The plausibility gate: mistakes in the data that residuals hide, found, named and explained, never repaired.

`finding` says what can be found, and with which code. One module for each kind of evidence: `units` the size of image
coordinates, `mosaic` photos laid out side by side by their common points, `flight_order` what the layout says about
the strips, `control_fit` the strip laid on its control under rival readings of the control, `control_strip` the strip
level on it and unbent, `control_reading` what the readings say, `control_lists` of whole lists, `control_heights` of
heights, `control_slips` of single points, `digits` slips of the pen in one coordinate, `identity` ids of points,
`flight` the perspective centres, `layout` where the control lies, `rotations` the reading of given angles.

Nothing here raises for a mistake in the data: the gate must go on to tell the others.
"""

from photostrip.triangulation.plausibility.finding import KINDS, accepted, found

__all__ = ["KINDS", "accepted", "found"]
