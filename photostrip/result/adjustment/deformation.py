"""Deformations of single models, where there is height control enough to see them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.result.adjustment.deformation_surface import model_deformations
from photostrip.result.quantities import record

if TYPE_CHECKING:
    from photostrip.pipeline import Result
    from photostrip.result.adjustment.deformation_surface import ModelDeformation
    from photostrip.result.numbers import Document

LEVEL = 0.05  # of all tests together
ARCSECONDS = float(np.degrees(1.0)) * 3600.0
TERMS = ("twist", "bending")


def deformations_of(result: Result) -> Document:
    """Return twist and bending of each model with height control enough, under the key ``deformations``.

    The limit of their t values is one that all models together are held to. Nothing when there is no such model, nor
    with a bundle adjustment, whose photos are not put together from models.
    """
    if result.bundle is not None:
        return {}
    found = [(strip, model) for strip in result.photo_strips for model in model_deformations(strip, result.frames)]
    rows = []
    for strip, model in found:
        left, right = strip.strip.photos[model.model : model.model + 2]
        deformed = _deformation(model, LEVEL / (2 * len(found)))
        rows.append(record("deformations", {"strip": strip.strip.id, "left": left, "right": right, **deformed}))
    return {"deformations": rows} if rows else {}


def _deformation(model: ModelDeformation, level: float) -> Document:
    surface = model.surface
    limit = surface.critical(level)
    omega, alpha = (angle * ARCSECONDS for angle in model.elements)
    terms = {
        name: {
            "coefficient_m_per_mm2": surface.coefficients[3 + k],
            "sigma_m_per_mm2": surface.sigmas[3 + k],
            "t": surface.t_values[k],
            "at_corner_m": model.at_corner[k],
        }
        for k, name in enumerate(TERMS)
    }
    return {
        "points": list(model.points),
        "redundancy": surface.redundancy,
        "sigma0_m": None if surface.redundancy == 0 else float(surface.sigma0 * model.sigma),
        **terms,
        "omega2_arcsec": omega,
        "alpha2_minus_alpha1_arcsec": alpha,
        "t_limit": limit,
        "significant": bool(np.abs(surface.t_values).max() > limit),
    }
