"""Geometry without photogrammetry: arrays in, arrays out.

``rotation``: rotations from angles in the systems of the field, from vectors, and back. ``similarity``: the seven
parameters between two frames, fitted in closed form, and their derivatives. ``plane``: conformal, affine, bilinear and
projective transformations of the plane, many at once.

Source: [001] eq. 127-133 for the angles, eq. 145-149 for the similarity.
"""
