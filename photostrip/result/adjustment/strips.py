"""Strips of a result: scale and precision, absolute orientation, polynomial with its evidence."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.notes import Document
from photostrip.pipeline.results import Result, StripResult
from photostrip.result.adjustment import links, pairs
from photostrip.result.adjustment.junctions import PPM, along_the_strip, discrepancies
from photostrip.result.numbers import rms
from photostrip.result.quantities import MATRIX
from photostrip.result.table import Table
from photostrip.strip.polynomial import Polynomial, degree_of


def strip_of(result: Result, strip: StripResult) -> Document:
    """Return a row of ``strips``: what a strip is like and how well it holds together."""
    of_photos = strip.model_stages is None
    formed = strip.of_photos.formed.junctions if of_photos else strip.of_models.formed.links
    gap = discrepancies(strip)[formed.used]  # rms() passes over points left out for their rays
    base = np.linalg.norm(np.diff(strip.centers, axis=0), axis=1)
    base = base[np.isfinite(base)]
    return {
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
        "precision_plan": strip.precision.plan,
        "precision_height": strip.precision.height,
        **along_the_strip("discrepancy", np.array([rms(column) for column in gap.T])),
        "scale_drift_expected_ppm": (_expected_drift(strip) if of_photos else links.expected_drift(strip)) * PPM,
        "scale_drift_found_ppm": _found_drift(strip) * PPM if of_photos else None,
    }


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
    """Return a row of ``absolute``: the similarity of a strip to its control."""
    found, use = strip.absolute, strip.control.use
    misclosures = [rms(column) for column in np.where(use, found.misclosures, np.nan).T]
    return {
        "strip": strip.strip.id,
        "control_points": len(strip.control),
        "control_plan": int(use[:, 0].sum()),
        "control_height": int(use[:, 2].sum()),
        "scale": found.similarity.scale,
        **dict(zip(MATRIX, found.similarity.rotation.ravel(), strict=True)),
        **_angles(found.similarity.rotation),
        **{f"shift_{axis}": value for axis, value in zip(CARTESIAN_AXES, found.similarity.shift, strict=True)},
        **{f"origin_{axis}": value for axis, value in zip(CARTESIAN_AXES, strip.intermediate.origin, strict=True)},
        **{name.replace("r", "a"): value for name, value in zip(MATRIX, strip.intermediate.axes.ravel(), strict=True)},
        "sigma0": found.sigma0,
        "redundancy": found.redundancy,
        "condition": found.condition,
        "iterations": found.iterations,
        **{f"misclosure_rms_{axis}": value for axis, value in zip(GROUND_AXES, misclosures, strict=True)},
    }


def _angles(rotation: Floats) -> Document:
    names = ("angles_deg_alpha", "angles_deg_omega", "angles_deg_kappa")
    try:
        return dict(zip(names, np.degrees(alpha_omega_kappa(rotation)), strict=True))
    except GeometryError:
        return dict.fromkeys(names)


def polynomials_of(result: Result) -> Document:
    """Return what the correction of every strip is that has one, its terms and the evidence for its degree."""
    strips = [(strip.strip.id, strip.polynomial) for strip in result.strips if strip.polynomial is not None]
    if not strips:
        return {}
    return {
        "polynomials": Table.of_rows("polynomials", (_polynomial(strip, found) for strip, found in strips)),
        "polynomial_terms": Table.joined("polynomial_terms", (_terms(strip, found) for strip, found in strips)),
        "polynomial_evidence": Table.of_rows(
            "polynomial_evidence",
            ({"strip": strip, **asdict(step)} for strip, found in strips for step in found.evidence),
        ),
    }


def _polynomial(strip: str, found: Polynomial) -> Document:
    plan, _, height = (degree_of(axis.terms) for axis in found.axes)
    values: Document = {
        "strip": strip,
        "degree": found.degree,
        "asked": found.asked,
        "reach_from": found.reach[0],
        "reach_to": found.reach[1],
        "degree_plan": plan,
        "degree_height": height,
        "stations_plan": found.stations[0],
        "stations_height": found.stations[1],
    }
    for name, axis in zip(CARTESIAN_AXES, found.axes, strict=True):
        values |= {
            f"sigma0_{name}": axis.sigma0,
            f"redundancy_{name}": axis.redundancy,
            f"condition_{name}": axis.condition,
        }
    return values


def _terms(strip: str, found: Polynomial) -> Table:
    parts = []
    for name, axis in zip(CARTESIAN_AXES, found.axes, strict=True):
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = axis.coefficients / axis.sigmas
        columns = {
            "strip": strip,
            "axis": name,
            "term": list(axis.terms),
            "coefficient": axis.coefficients,
            "sigma": axis.sigmas,
            "t": ratio,
            "effect": axis.effects,
        }
        parts.append(Table.of("polynomial_terms", columns))
    return Table.joined("polynomial_terms", parts)
