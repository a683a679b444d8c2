"""Relative orientation: from the image points of a strip to the five elements of each stereopair.

Comes in: reduced image coordinates, photos in flight order. Goes out: an ``Orientation`` of all pairs, with standard
deviations, redundancy numbers and residual y parallaxes. ``pairs`` collects the measurements, ``solution`` finds the
elements by least squares, ``orientation`` says how good they are and refuses what cannot be used; ``standard_points``
has the closed form for six standard points, and finds which those are.

Source: [001] eq. 126-137 for elements and rays; [Hallert] for the standard points; the solution is derived.
"""
