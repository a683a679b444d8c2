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

from typing import Literal

StepName = Literal[
    "interior",
    "refine",
    "relative",
    "intersection",
    "chain",
    "scale",
    "strip",
    "absolute",
    "polynomial",
    "resection",
    "bundle",
    "frame",
    "curvature",
    "pair-scales",
    "closed-form",
    "deformation",
]  # that can be taken alone
