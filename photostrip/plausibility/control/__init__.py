"""Mistakes in the control: readings, heights, lists, single points, place and layout.

``given_points`` brings given points into one level frame, ``plan_fit`` lays the strip on them in plan (least median
of squares), ``straightening`` sets it level and takes its bending out; ``wrong_readings`` walks through the tests:
whole readings, ``foreign_lists``, ``wrong_heights``, and single points by ``point_slips`` and ``digits``.
``shared_by_control`` tests what all control of a strip shares: another principal distance, the shift of a list.
``wrong_place`` looks where on the Earth the control lies, ``layout`` where along the strip.
"""
