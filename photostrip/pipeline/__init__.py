"""The method from measured coordinates to the result: no disk, no YAML, no printing.

What comes in are ``inputs.Inputs`` and ``inputs.Settings``, what goes out is ``results.Result`` with every stage.
``run`` is the table of contents; frames, image coordinates, given and common points have a module each, strips by
themselves stand in ``strips/``, strips together in ``block/``, covariances in ``precision/``, and what the data say
against themselves in ``plausibility/``. The equations are those of ``triangulation/``.
"""

from photostrip.pipeline.inputs import ADJUSTMENTS, AUTO, METHODS, Inputs, MeasuredModels, ModelStrip, Settings, Strip
from photostrip.pipeline.results import CHECK, CONTROL, NEW, Adjusted, Precision, Result, StripResult, Ties
from photostrip.pipeline.run import triangulate

__all__ = [
    "ADJUSTMENTS",
    "AUTO",
    "CHECK",
    "CONTROL",
    "METHODS",
    "NEW",
    "Adjusted",
    "Inputs",
    "MeasuredModels",
    "ModelStrip",
    "Precision",
    "Result",
    "Settings",
    "Strip",
    "StripResult",
    "Ties",
    "triangulate",
]
