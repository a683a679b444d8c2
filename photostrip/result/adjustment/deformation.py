"""Deformations of single models, where there is height control enough to see them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.result.adjustment.deformation_surface import model_deformations
from photostrip.result.numbers import GROUND, Document, rounded, significant

if TYPE_CHECKING:
    from photostrip.pipeline import Result
    from photostrip.result.adjustment.deformation_surface import ModelDeformation

LEVEL = 0.05  # of all tests together
ARCSECONDS = float(np.degrees(1.0)) * 3600.0
TERMS = ("twist", "bending")


def deformations_of(result: Result) -> Document:
    """Give ``{"deformations": [...]}``; empty when no model has height control enough.

    Returns
    -------
    dict
        Twist and bending of each such model, with t values and the limit that all of them together are held to.
    """
    if result.bundle is not None:  # its photos are not put together from models
        return {}
    found = [(strip, model) for strip in result.strips for model in model_deformations(strip, result.frames)]
    tests = 2 * len(found)
    rows = []
    for strip, model in found:
        photos = strip.strip.photos[model.model : model.model + 2]
        head = {"strip": strip.strip.id, "left": photos[0], "right": photos[1]}
        rows.append({**head, **_deformation(model, LEVEL / tests)})
    return {"deformations": rows} if rows else {}


def _deformation(model: ModelDeformation, level: float) -> Document:
    surface = model.surface
    limit = surface.critical(level)
    omega, alpha = (angle * ARCSECONDS for angle in model.elements)
    parts = {
        name: {
            "coefficient_m_per_mm2": significant(surface.coefficients[3 + k]),
            "sigma_m_per_mm2": significant(surface.sigmas[3 + k]),
            "t": rounded(surface.t_values[k], 2),
            "at_corner_m": rounded(model.at_corner[k], GROUND),
        }
        for k, name in enumerate(TERMS)
    }
    return {
        "points": list(model.points),
        "redundancy": surface.redundancy,
        "sigma0_m": None if surface.redundancy == 0 else rounded(_residual_sigma(model), GROUND),
        **parts,
        "omega2_arcsec": rounded(omega, 1),
        "alpha2_minus_alpha1_arcsec": rounded(alpha, 1),
        "t_limit": rounded(limit, 2),
        "significant": bool(np.abs(surface.t_values).max() > limit),
    }


def _residual_sigma(model: ModelDeformation) -> float:
    return float(model.surface.sigma0 * model.sigma)
