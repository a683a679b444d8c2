"""The strip method, its operations in order.

``image_coordinates`` measured to ideal image coordinates; ``relative_orientation`` of each pair; ``strip_formation`` of
its models; ``absolute_orientation`` on the control; ``polynomial`` correction of the deformation; ``resection`` of the
photos. Beside them ``strip_errors`` and, after the fit to the control, ``fitted_strip``; ``gross_errors`` of pairs and
of control, ``independent_models``, ``ray_intersection``; ``robust`` has the weights that several of them use.
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
]  # that can be taken alone
