"""Normal equations of a bundle, reduced to photos and common parameters.

``equations`` takes the points out of the rays and sums everything up, ``band`` factors it and has elements of its
inverse; ``datum`` says where shift, rotation and scale come from, ``defects`` names what is not determined. Source:
[Granshaw 1980], [Takahashi 1973] for the inverse.
"""
