"""Deformation of single models of a strip, where the height control of a model is dense enough to see it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from photostrip.arrays import Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Document
from photostrip.pipeline.results import Result, StripResult
from photostrip.planning.deformation import LEAST_POINTS, Paraboloid, determines_paraboloid, fit_paraboloid
from photostrip.result.quantities import record
from photostrip.result.table import Table
from photostrip.statistics import t_p_value
from photostrip.strip.absolute_orientation import Targets
from photostrip.units import ARCSECONDS, MILLIMETRES

LEVEL = 0.05  # of all tests together
LEAST_MODELS = 3  # whose scatter says how far their mean may be from zero
TERMS = ("twist", "bending")


@dataclass(frozen=True, eq=False)
class ModelDeformation:
    """Twist and bending of one model."""

    model: int
    points: tuple[str, ...]
    surface: Paraboloid  # height residuals in metres as a function of x and y at photo scale, mm
    # base, width: photo base, and distance of the outermost of the points from the line of flight, mm at photo scale
    base: float
    width: float
    scale: float
    sigma: float  # mean stated standard deviation of a height residual, metres

    @property
    def at_corner(self) -> tuple[float, float]:
        """Height that twist and bending give a corner of the model against its middle, metres."""
        twist, bend = self.surface.coefficients[3:]
        return abs(float(twist)) * self.base / 2 * self.width, abs(float(bend)) * (self.base / 2) ** 2

    @property
    def elements(self) -> tuple[float, float]:
        """Errors of omega2' and of alpha2' - alpha1' that bend a model so, radians."""
        return self.surface.elements(self.scale / MILLIMETRES, self.base)


def model_deformations(strip: StripResult, frames: Sequence[GroundFrame]) -> tuple[ModelDeformation, ...]:
    """Estimate twist and bending of every model that has the height control for it.

    Returns in flight order; models with less than five height control points, or with points at fewer than three
        distances along the base, are left out.

    Each model counts as it was measured, carried to the ground by the similarity of the whole strip: its shift and
    its tilts are estimated too, and a polynomial would bend it. Check points take no part.

    Source: [003] eq. 10.12.
    """
    height = np.flatnonzero(strip.control.use[:, 2])
    oriented, formed = strip.of_photos.orientation, strip.of_photos.formed
    number = formed.point[strip.control_rows[height]]
    order = np.argsort(number)
    found = []
    usable = np.flatnonzero(oriented.used & np.isfinite(formed.model_xyz).all(axis=1) & np.isin(oriented.point, number))
    ends = np.searchsorted(oriented.pairs.pair[usable], np.arange(oriented.pairs.size + 1))
    for model, (start, stop) in enumerate(pairwise(ends.tolist())):
        if stop - start < LEAST_POINTS:
            continue
        rows = usable[start:stop]
        control = height[order[np.searchsorted(number[order], oriented.point[rows])]]
        deformed = _of_model(strip, frames, model, rows, control)
        if deformed is not None:
            found.append(deformed)
    return tuple(found)


def _of_model(
    strip: StripResult, frames: Sequence[GroundFrame], model: int, rows: Numbers, control: Numbers
) -> ModelDeformation | None:
    """Twist and bending of one model from its rows of the pairs' table and their control points."""
    similarity = strip.absolute.similarity
    ends = similarity(strip.formed.centers[model : model + 2])
    base = ends[1] - ends[0]
    length = float(np.hypot(base[0], base[1]))
    along = np.array([base[0], base[1]]) / length
    xyz = similarity(strip.of_photos.formed.model_xyz[rows])
    arm = xyz - ends[0]
    scale = float(-arm[:, 2].mean()) / (strip.of_photos.orientation.pairs.focal / MILLIMETRES)
    xy = np.column_stack([arm[:, :2] @ along, arm[:, :2] @ (-along[1], along[0])]) / scale * MILLIMETRES
    if not determines_paraboloid(xy):
        return None
    given = strip.control.take(control)
    targets = Targets(given, frames, strip.intermediate)
    residual = targets.misclosures(xyz, targets.axes(xyz))[:, 2]
    sigma = np.hypot(strip.precision.height, given.sigma[:, 2])
    width = float(np.abs(xy[:, 1]).max())
    surface = fit_paraboloid(xy, residual, sigma)
    return ModelDeformation(
        model=model,
        points=given.ids,
        surface=surface,
        base=length / scale * MILLIMETRES,
        width=width,
        scale=scale,
        sigma=float(sigma.mean()),
    )


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
        rows.append({"strip": strip.strip.id, "left": left, "right": right, **deformed})
    if not rows:
        return {}
    common = {name: _common([model for _, model in found], k) for k, name in enumerate(TERMS)}
    table = Table.of_rows("deformations", rows)
    return {"deformations": table, "common_deformation": record("common_deformation", common)}


def _common(models: Sequence[ModelDeformation], term: int) -> Document:
    """Test the mean of a term over all models by their scatter.

    A lens or a film deforms all models alike; errors of relative orientation, which are in no standard deviation of a
    single model, deform them one way and the other.
    """
    values = np.array([model.surface.coefficients[3 + term] for model in models])
    corner = np.array([model.at_corner[term] for model in models]) * np.sign(values)
    found: Document = {"models": len(models), "at_corner_m": corner.mean(), "t": None, "p": None}
    if len(models) < LEAST_MODELS:
        return found
    error = values.std(ddof=1) / np.sqrt(len(models))
    t = float(values.mean() / error) if error else 0.0
    return found | {"t": t, "p": t_p_value(t, len(models) - 1)}


def _deformation(model: ModelDeformation, level: float) -> Document:
    surface = model.surface
    limit = surface.critical(level)
    chance = min(surface.p_values) * LEVEL / level  # of all tests together
    omega, alpha = (angle * ARCSECONDS for angle in model.elements)
    terms: Document = {}
    for k, name in enumerate(TERMS):
        terms |= {
            f"{name}_coefficient_m_per_mm2": surface.coefficients[3 + k],
            f"{name}_sigma_m_per_mm2": surface.sigmas[3 + k],
            f"{name}_t": surface.t_values[k],
            f"{name}_at_corner_m": model.at_corner[k],
        }
    return {
        "points": list(model.points),
        "redundancy": surface.redundancy,
        "sigma0_m": None if surface.redundancy == 0 else float(surface.sigma0 * model.sigma),
        **terms,
        "omega2_arcsec": omega,
        "alpha2_minus_alpha1_arcsec": alpha,
        "t_limit": limit,
        "p": min(1.0, chance),
        "significant": bool(np.abs(surface.t_values).max() > limit),
    }
