"""The method from measured coordinates to the result: no disk, no YAML, no printing.

What comes in are ``inputs.Inputs`` and ``inputs.Settings``, what goes out is ``results.Result`` with every stage.
``run`` is the table of contents; frames, image coordinates, given and common points have a module each, strips by
themselves stand in ``strips/``, strips together in ``block/``, covariances in ``precision/``, and what the data say
against themselves in ``plausibility/``. The equations are those of ``triangulation/``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.pipeline.inputs import ADJUSTMENTS, AUTO, METHODS, Inputs, MeasuredModels, ModelStrip, Settings, Strip
from photostrip.pipeline.results import CHECK, CONTROL, NEW, Adjusted, Precision, Result, StripResult, Ties

if TYPE_CHECKING:
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


def __getattr__(name: str) -> Any:  # noqa: ANN401 (whatever the module has)
    """Load the walk when it is asked for: what only reads a project does without."""
    if name == "triangulate":
        from photostrip.pipeline.run import triangulate

        return triangulate
    message = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(message)
