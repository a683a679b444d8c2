"""Gross errors of rays: measurements that the strip as a whole contradicts.

``screened_formation`` forms the strip again until nothing changes; ``strip_screening`` adjusts ``windows`` of a few
photos (``window_points``, ``window_adjustment``) and predicts every point by all others; ``ray_decisions`` says which
of its rays is wrong. Source: derived, see docs/sources.md.
"""
