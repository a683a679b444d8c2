"""The experiment of screening as a plain document."""

from __future__ import annotations

from photostrip.notes import Document
from photostrip.planning.screening import ARC_MINUTES, MethodOutcome, ScreeningOutcome
from photostrip.result.numbers import micrometres, rounded
from photostrip.strip.relative_orientation.solution import ELEMENTS

PERCENT, COUNT, MINUTES = 1, 3, 2  # decimals


def screening_document(name: str, outcome: ScreeningOutcome) -> Document:
    """Return an experiment: detection by method, zone and size, and what undetected errors do, in minutes of arc."""
    spec, layout = outcome.spec, outcome.spec.layout
    sizes = sorted(set(spec.sizes))
    return {
        "kind": "screening",
        "name": name,
        "layout": {
            "principal_distance_mm": layout.focal,
            "base_mm": layout.base,
            "width_mm": layout.width,
            "zone_points": list(layout.counts),
            "zone_reach_mm": layout.scatter,
            "parallax_sigma_um": micrometres(layout.parallax_sigma),
        },
        "models": spec.models,
        "errors": spec.models + spec.second,
        "repetitions": spec.repetitions,
        "parallax_limit_um": micrometres(spec.parallax_limit),
        "grubbs_alpha": spec.grubbs_alpha,
        "methods": [_method(each) for each in outcome.methods],
        "detection": [
            {
                "method": each.method,
                "zone": found.zone,
                "size_um": micrometres(found.size),
                "errors": found.errors,
                "found": found.found,
                "found_percent": rounded(100 * found.found / found.errors, PERCENT) if found.errors else None,
            }
            for each in outcome.methods
            for found in each.detection
        ],
        "effects": [
            {
                "zone": effect.zone,
                "size_um": micrometres(size),
                **{
                    f"{element}_arcmin": rounded(value * size * ARC_MINUTES, MINUTES)
                    for element, value in zip(ELEMENTS, effect.elements, strict=True)
                },
                "largest_arcmin": rounded(effect.largest * size * ARC_MINUTES, MINUTES),
            }
            for effect in outcome.effects
            for size in sizes
        ],
    }


def _method(found: MethodOutcome) -> Document:
    return {
        "method": found.method,
        "parallax_percent": rounded(100 * found.parallax, PERCENT),
        "later_percent": rounded(100 * found.later, PERCENT),
        "missed_percent": rounded(100 * found.missed, PERCENT),
        "good_lost_per_error": rounded(found.lost, COUNT),
        "mean_change_arcmin": rounded(found.mean_change * ARC_MINUTES, MINUTES),
        "worst_change_arcmin": rounded(found.worst_change * ARC_MINUTES, MINUTES),
    }
