"""Mistakes in the control: single points, place and layout, what a list shares.

``given_points`` brings given points into one level frame, ``slips`` names exchanged points and, by ``digits``, slips of
the pen. ``shared_by_control`` tests what all control of a strip shares: another principal distance, the shift of a
list. ``wrong_place`` looks where on the Earth the control lies, ``layout`` where along the strip.
"""
