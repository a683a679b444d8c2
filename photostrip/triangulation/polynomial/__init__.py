"""Correction of the strip deformation by polynomials, of a degree that the control can justify."""
