"""The method from measured coordinates to the result: no disk, no YAML, no printing."""

from photostrip.pipeline.inputs import ADJUSTMENTS, Inputs, MeasuredModels, ModelStrip, Settings, Strip
from photostrip.pipeline.results import CHECK, CONTROL, NEW, Adjusted, Precision, Result, StripResult, Ties
from photostrip.pipeline.run import triangulate

__all__ = [
    "ADJUSTMENTS",
    "CHECK",
    "CONTROL",
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
