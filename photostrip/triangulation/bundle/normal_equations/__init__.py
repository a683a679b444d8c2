"""Normal equations of a bundle, reduced to photos and common parameters.

``point_elimination`` takes the points out of the rays, ``reduced`` sums everything up where ``bundle.structure`` says,
``band`` (with ``lapack``) and ``sparse`` factor it, ``factored`` has its inverse; ``datum`` says where shift, rotation
and scale come from, ``defects`` names what is not determined. Source: [Granshaw 1980], [Takahashi 1973] for the
inverse.
"""
