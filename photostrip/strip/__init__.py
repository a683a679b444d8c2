"""The strip method, its operations in order.

Measured to ideal image coordinates: ``interior`` (its marks checked in ``fiducial_marks``) brings points into the
system of the marks, ``corrections`` removes lens distortion, refraction and, where asked for, Earth curvature;
``pixel_cameras`` makes millimetres of cameras that other programs give in pixels. Pairs: ``relative_orientation``.
Their models: ``formed_strip`` makes model points, brings neighbouring models to one scale on their pass points and
hands the orientation on. ``absolute_orientation`` on the control; ``polynomial`` correction of the deformation;
``resection`` of the photos, and points where their rays meet.

Beside them ``pair_screening`` and ``control_screening`` seek the fewest observations without which an adjustment passes
its test; ``strip_errors`` and, after the fit to the control, ``fitted_strip`` carry errors; ``linked_models`` links
independent models and chains them, the start of their network; ``robust`` has the weights of all.

Source: [001] eq. 125-152; [004a] for the search in pairs; [Brown 1966], [Fraser 1997], [Kraus], [Saastamoinen 1972] for
corrections; the rest is derived, docs/sources.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

STEPS = {  # that can be taken alone: title, and columns of the table, those of one array together
    "interior": ("Interior orientation", "mark; x, y; x_photo, y_photo"),
    "refine": ("Refined image coordinates", "point; x, y"),
    "relative": ("Relative orientation", "point; x_left, y_left; x_right, y_right"),
    "intersection": ("Space intersection", "point; x_left, y_left; x_right, y_right"),
    "chain": ("Orientation handed on along a strip", "photo; omega, phi, kappa"),
    "scale": ("Scale transfer", "point; x, y, z; x_next, y_next, z_next; weight"),
    "strip": ("Strip in model coordinates", "photo; point; x, y"),
    "absolute": ("Absolute orientation", "point; x, y, z; x_ground, y_ground, z_ground; weight"),
    "polynomial": ("Polynomial", "point; x, y, z; misclosure"),
    "resection": ("Space resection", "point; x, y; x_ground, y_ground, z_ground"),
    "bundle": ("Bundle adjustment", "photo; point; x, y"),
    "frame": ("Intermediate frame", "point; longitude, latitude, height"),
    "curvature": ("Earth curvature", "point; x, y, z"),
    "pair-scales": ("Scales of pairs of points", "point; x, y, z; x_ground, y_ground, z_ground"),
    "closed-form": ("Errors of points in closed form", "point; x, y"),
    "deformation": ("Deformation of a model", "point; x, y; dz"),
}
CONTROL_OF_BUNDLE = "point; x_ground, y_ground, z_ground"  # columns of the second table of ``bundle``
if TYPE_CHECKING:
    StepName = str
else:
    StepName = Literal[tuple(STEPS)]  # what the command line offers
