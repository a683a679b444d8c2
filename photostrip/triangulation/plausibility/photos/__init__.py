"""Mistakes in photos: units, order of flight, identity of points, given positions and angles."""
