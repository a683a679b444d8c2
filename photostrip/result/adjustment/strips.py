"""Strips of a result: scale and precision, absolute orientation, polynomial with its evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.notes import Document
from photostrip.pipeline.results import Result, StripResult
from photostrip.result.adjustment import links, pairs
from photostrip.result.adjustment.junctions import DIRECTIONS, PPM, discrepancies
from photostrip.result.numbers import rms
from photostrip.result.quantities import record
from photostrip.strip.polynomial import Polynomial


def strip_of(result: Result, strip: StripResult) -> Document:
    """Return a record of ``strips``: what a strip is like and how well it holds together."""
    of_photos = strip.model_stages is None
    formed = strip.of_photos.formed.junctions if of_photos else strip.of_models.formed.links
    gap = discrepancies(strip)[formed.used]  # rms() passes over points left out for their rays
    base = np.linalg.norm(np.diff(strip.centers, axis=0), axis=1)
    base = base[np.isfinite(base)]
    values = {
        "id": strip.strip.id,
        "camera": strip.of_photos.strip.camera.name if of_photos else None,
        "photos": len(strip.strip.photos),
        "models": len(strip.strip.photos) - 1,
        "points": len(strip.formed.point),
        "photo_scale": strip.scale_number if of_photos else None,
        **({} if of_photos else {"model_scale": strip.scale_number}),
        "flying_height": strip.depth,
        "base": base.mean() if len(base) else np.nan,
        "azimuth_deg": np.degrees(strip.intermediate.azimuth) % 360,
        **(_fit_of_photos(result, strip) if of_photos else _fit_of_models(strip)),
        "precision": dict(zip(("plan", "height"), strip.precision, strict=True)),
        "discrepancy": {name: rms(column) for name, column in zip(DIRECTIONS, gap.T, strict=True)},
        "scale_drift": {
            "expected_ppm": (_expected_drift(strip) if of_photos else links.expected_drift(strip)) * PPM,
            "found_ppm": _found_drift(strip) * PPM if of_photos else None,
        },
    }
    return record("strips", values)


def _fit_of_photos(result: Result, strip: StripResult) -> Document:
    sums, stages = pairs.Parallaxes.of(strip), strip.of_photos
    return {
        "sigma_given_um": 1000.0 * rms(result.refined.observations.sigma[stages.rows]),
        "sigma0_um": 1000.0 * pairs.sigma0(sums.squares, sums.redundancy),
        "redundancy": int(sums.redundancy.sum()),
        "rms_parallax_um": 1000.0 * rms(stages.orientation.parallax[stages.orientation.used]),
        "image_rms_um": 1000.0 * rms(stages.resection.residuals),
    }


def _fit_of_models(strip: StripResult) -> Document:
    stated = links.stated_sigma(strip)
    return {
        "sigma_given_um": 1000.0 * stated,
        "sigma0_um": 1000.0 * (links.sigma0(strip) * stated),
        "redundancy": int(strip.of_models.formed.links.solved.redundancy.sum()),
        "rms_parallax_um": None,
        "image_rms_um": None,
    }


def _expected_drift(strip: StripResult) -> float:
    """Change of scale along a strip of photos that the spread of the scale ratios lets expect, as a ratio.

    The scale is handed from model to model, so its error grows as a sum of independent ones.
    """
    joined = strip.of_photos.formed.junctions
    count = np.bincount(joined.junction, joined.used, len(joined.factor))
    with np.errstate(invalid="ignore"):
        return float(np.sqrt((joined.spread**2 / count).sum()))


def _found_drift(strip: StripResult) -> float:
    """Change of scale along the strip that the polynomial takes out; NaN when there is none."""
    correction = strip.polynomial
    if correction is None or not correction.axes[0].terms:
        return np.nan
    start, end = (_scale_change(correction, x) for x in strip.centers[[0, -1], 0])
    return end - start


def _scale_change(correction: Polynomial, x: float) -> float:
    """Change of scale along the strip that the polynomial makes at one place, relative."""
    step = 1.0  # m
    ends = correction.corrections(np.array([[x + step, 0.0, 0.0], [x - step, 0.0, 0.0]]))
    return float(ends[0, 0] - ends[1, 0]) / (2 * step)


def absolute_of(strip: StripResult) -> Document:
    """Return a record of ``absolute``: the similarity of a strip to its control."""
    found, use = strip.absolute, strip.control.use
    misclosures = [rms(column) for column in np.where(use, found.misclosures, np.nan).T]
    values = {
        "strip": strip.strip.id,
        "control": {"points": len(strip.control), "plan": int(use[:, 0].sum()), "height": int(use[:, 2].sum())},
        "scale": found.similarity.scale,
        "rotation": found.similarity.rotation.ravel(),
        "angles_deg": _angles(found.similarity.rotation),
        "shift": found.similarity.shift,
        "origin": strip.intermediate.origin,
        "axes": strip.intermediate.axes.ravel(),
        "sigma0": found.sigma0,
        "redundancy": found.redundancy,
        "condition": found.condition,
        "iterations": found.iterations,
        "misclosure_rms": dict(zip(GROUND_AXES, misclosures, strict=True)),
    }
    return record("absolute", values)


def _angles(rotation: Floats) -> Document | None:
    try:
        values = alpha_omega_kappa(rotation)
    except GeometryError:
        return None
    return dict(zip(("alpha", "omega", "kappa"), np.degrees(values), strict=True))


def polynomials_of(result: Result) -> Document:
    """Return the list ``polynomials`` under its key: the correction of every strip that has one; empty without any."""
    found = [_polynomial(strip.strip.id, strip.polynomial) for strip in result.strips if strip.polynomial is not None]
    return {"polynomials": found} if found else {}


def _polynomial(strip: str, found: Polynomial) -> Document:
    axes = found.axes
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = [axis.coefficients / axis.sigmas for axis in axes]
    values = {
        "strip": strip,
        "degree": found.degree,
        "asked": found.asked,
        "terms": _by_axis([list(axis.terms) for axis in axes]),
        "coefficients": _by_axis([axis.coefficients for axis in axes]),
        "sigmas": _by_axis([axis.sigmas for axis in axes]),
        "t": _by_axis(ratios),
        "effects": _by_axis([axis.effects for axis in axes]),
        "sigma0": _by_axis([axis.sigma0 for axis in axes]),
        "redundancy": _by_axis([axis.redundancy for axis in axes]),
        "condition": _by_axis([axis.condition for axis in axes]),
        "stations": dict(zip(("plan", "height"), found.stations, strict=True)),
        "reach": np.array(found.reach),
        "evidence": [asdict(step) for step in found.evidence],
    }
    return record("polynomials", values)


def _by_axis(values: Sequence[Any]) -> Document:
    return dict(zip(CARTESIAN_AXES, values, strict=True))
