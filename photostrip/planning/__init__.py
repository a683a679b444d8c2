"""Planning before anything is measured: cameras compared, errors all over one model, control of a strip.

In come a camera, a scale, overlaps and layouts of control; out go expected standard deviations and detectable errors.
``model_plan`` puts together the theory of one model: ``single_model`` [000], ``closed_form`` the same as sums,
``deformation`` by simple formulas [003]. ``ideal_strip`` is formed and adjusted without errors, ``strip_design``
compares layouts of its control. ``camera_efficiency`` compares cameras [004b]; ``screening`` tries the search for gross
errors [004a].
"""

from __future__ import annotations

from typing import Literal

PlanKind = Literal["model", "strip", "camera", "displacement", "screening"]
