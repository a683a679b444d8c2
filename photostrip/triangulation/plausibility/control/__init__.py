"""Mistakes in the control: readings, heights, lists, single points, place and layout.

``given_points`` brings given points into one level frame, ``control_fit`` lays the strip on them in plan (least median
of squares), ``control_strip`` sets it level and takes its bending out; ``control_reading`` walks through the tests:
whole readings, ``control_lists``, ``control_heights``, and single points by ``control_slips`` and ``digits``.
``shared_by_control`` tests what all control of a strip shares: another principal distance, the shift of a list.
``control_place`` looks where on the Earth the control lies, ``layout`` where along the strip.
"""
