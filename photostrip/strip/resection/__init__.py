"""Photos from known points and points from known photos, many at once.

Comes in: image coordinates, points or photos in one frame. Goes out: orientations of photos (``resection`` by least
squares from start values, ``closed_form`` without any) or points with their precision (``ray_intersection``).
``collinearity`` has the image coordinates of points and their derivatives.

Source: [Grunert 1841], [Haralick 1994]; the rest is derived.
"""
