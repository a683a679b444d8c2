"""Blocks of the document about points, photos, given points and their precision.

Adjusted points and orientations in the Cartesian frame come in; coordinates, angles, residuals, differences at given
points, standard deviations and error ellipses in the axes of the output go out.
"""
