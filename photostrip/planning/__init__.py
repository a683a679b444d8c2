"""Planning before anything is measured: cameras compared, errors all over one model, control of a strip.

In come a camera, a scale, overlaps and layouts of control; out go expected standard deviations and detectable errors.
``model`` and ``strip`` are rooms; ``camera_efficiency`` compares cameras [004b]; ``screening`` tries the search
for gross errors [004a].
"""

from __future__ import annotations

from typing import Literal

PlanKind = Literal["model", "strip", "camera", "displacement", "screening"]
