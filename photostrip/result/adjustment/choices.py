"""What ``adjustment: auto`` took for each strip, and what spoke for it."""

from __future__ import annotations

from photostrip.notes import Document
from photostrip.pipeline.choice import Choice, Witness
from photostrip.pipeline.inputs import AUTO
from photostrip.pipeline.results import Result, StripResult
from photostrip.result.quantities import record


def adjustment_of(result: Result) -> str:
    """Name the adjustment that was made; with `auto` the covariance where it was taken for any strip."""
    asked = result.settings.adjustment
    if asked != AUTO:
        return asked
    taken = {strip.choice.taken for strip in result.strips if strip.choice is not None}
    return "covariance" if "covariance" in taken else "polynomial"


def choices_of(result: Result) -> Document:
    """Return the list ``choices`` under its key: a record for each strip with a choice; empty without any."""
    found = [_choice(strip, strip.choice) for strip in result.strips if strip.choice is not None]
    return {"choices": found} if found else {}


def _choice(strip: StripResult, choice: Choice) -> Document:
    values = {
        "strip": strip.strip.id,
        "taken": choice.taken,
        "predicted": _witness(choice.predicted),
        "difference": _difference(choice),
        "left_out": None if choice.left_out is None else _witness(choice.left_out),
        "left_out_by": choice.left_out_by,
        "excess": choice.excess,
        "apart": choice.apart,
        "contradicted": choice.contradicted,
    }
    return record("choices", values)


def _difference(choice: Choice) -> Document:
    plan, height = choice.difference
    return {"ratio": choice.expected.ratio, "plan": plan, "height": height}


def _witness(found: Witness) -> Document:
    return {
        "count": found.count,
        "ratio": found.ratio,
        **{
            name: {"plan": plan, "height": height}
            for name, (plan, height) in (("polynomial", found.polynomial), ("covariance", found.covariance))
        },
    }
