"""Planning before anything is measured: cameras compared, errors all over one model, control of a strip.

In come a camera, a scale, overlaps and layouts of control; out go expected standard deviations and detectable errors.
``single_model`` with ``element_errors``, ``model_adjustment`` and ``model_plan``: errors of one model [000];
``closed_form`` the same as sums; ``deformation`` simple formulas and the paraboloid [003]; ``camera_efficiency``
[004b]. ``ideal_strip`` is simulated without errors and formed, ``strip_methods`` adjusts it, ``control_layout``,
``strip_design`` and ``placement`` compare layouts.
"""
