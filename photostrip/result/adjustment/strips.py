"""Strips of a result: scale and precision, absolute orientation, polynomial with its evidence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.result.adjustment.pairs import PPM, Parallaxes, discrepancies, sigma0
from photostrip.result.numbers import (
    DEGREES,
    EXACT,
    GROUND,
    ROTATION,
    Document,
    Plain,
    micrometres,
    rms,
    rounded,
    significant,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline import Result, StripResult
    from photostrip.triangulation.polynomial.correction import AxisFit, Evidence, Polynomial

    Floats = NDArray[np.float64]

AXES = ("x", "y", "z")


def strips_of(result: Result) -> list[Document]:
    """Return the list ``strips``: what each strip is like and how well it holds together."""
    return [_strip(result, strip) for strip in result.photo_strips]


def _strip(result: Result, strip: StripResult) -> Document:
    sums, formed, resection = Parallaxes.of(strip), strip.of_photos.formed, strip.of_photos.resection
    used = strip.of_photos.orientation.used
    gap = discrepancies(strip)[formed.junctions.used]  # rms() passes over points left out for their rays
    gap_rms = [rms(column) for column in gap.T]
    sigma = result.refined.observations.sigma[strip.of_photos.rows]
    return {
        "id": strip.strip.id,
        "camera": strip.of_photos.strip.camera.name,
        "photos": len(strip.strip.photos),
        "models": len(formed.scale),
        "points": len(formed.point),
        "photo_scale": rounded(strip.scale_number, 1),
        "flying_height": rounded(strip.depth, 2),
        "base": rounded(np.linalg.norm(np.diff(resection.centers, axis=0), axis=1).mean(), 2),
        "azimuth_deg": rounded(np.degrees(strip.intermediate.azimuth) % 360, DEGREES),
        "sigma_given_um": micrometres(np.sqrt(np.mean(sigma**2))),
        "sigma0_um": micrometres(sigma0(sums.squares, sums.redundancy)),
        "redundancy": int(sums.redundancy.sum()),
        "rms_parallax_um": micrometres(rms(strip.of_photos.orientation.parallax[used])),
        "image_rms_um": micrometres(rms(resection.residuals)),
        "precision": {"plan": rounded(strip.precision[0], GROUND), "height": rounded(strip.precision[1], GROUND)},
        "discrepancy": dict(zip(("along", "across", "up"), rounded(gap_rms, GROUND), strict=True)),
        "scale_drift": _drift(strip),
    }


def _drift(strip: StripResult) -> Document:
    """Change of scale along the strip: what the spread of the scale ratios lets expect, and what the polynomial found.

    The scale is handed from model to model, so its error grows as a sum of independent ones.
    """
    joined, correction = strip.of_photos.formed.junctions, strip.polynomial
    count = np.bincount(joined.junction, joined.used, len(joined.factor))
    with np.errstate(invalid="ignore"):
        expected = np.sqrt((joined.spread**2 / count).sum()) * PPM
    found = None
    if correction is not None and correction.axes[0].terms:
        ends = strip.of_photos.resection.centers[[0, -1], 0]
        start, end = (_scale_change(correction, x) for x in ends)
        found = rounded((end - start) * PPM, 1)
    return {"expected_ppm": rounded(expected, 1), "found_ppm": found}


def _scale_change(correction: Polynomial, x: float) -> float:
    """Change of scale along the strip that the polynomial makes at one place, relative."""
    step = 1.0  # m
    ends = correction.corrections(np.array([[x + step, 0.0, 0.0], [x - step, 0.0, 0.0]]))
    return float(ends[0, 0] - ends[1, 0]) / (2 * step)


def absolute_of(result: Result) -> list[Document]:
    """Return the list ``absolute``: the similarity of every strip to its control."""
    return [_absolute(strip) for strip in result.strips]


def _absolute(strip: StripResult) -> Document:
    found, use = strip.absolute, strip.control.use
    misclosures = rounded([rms(column) for column in np.where(use, found.misclosures, np.nan).T], GROUND)
    return {
        "strip": strip.strip.id,
        "control": {"points": len(strip.control), "plan": int(use[:, 0].sum()), "height": int(use[:, 2].sum())},
        "scale": significant(found.similarity.scale, EXACT),
        "rotation": rounded(found.similarity.rotation.ravel(), ROTATION),
        "angles_deg": _angles(found.similarity.rotation),
        "shift": rounded(found.similarity.shift, GROUND),
        "origin": rounded(strip.intermediate.origin, GROUND),
        "axes": rounded(strip.intermediate.axes.ravel(), ROTATION),
        "sigma0": significant(found.sigma0),
        "redundancy": found.redundancy,
        "condition": significant(found.condition),
        "iterations": found.iterations,
        "misclosure_rms": dict(zip(GROUND_AXES, misclosures, strict=True)),
    }


def _angles(rotation: Floats) -> Plain:
    try:
        values = alpha_omega_kappa(rotation)
    except GeometryError:
        return None
    return dict(zip(("alpha", "omega", "kappa"), rounded(np.degrees(values), DEGREES), strict=True))


def _by_axis(values: Sequence[Plain]) -> Document:
    return dict(zip(AXES, values, strict=True))


def polynomials_of(result: Result) -> Document:
    """Return the list ``polynomials`` under its key: the correction of every strip that has one; empty without any."""
    found = [_polynomial(strip.strip.id, strip.polynomial) for strip in result.strips if strip.polynomial is not None]
    return {"polynomials": found} if found else {}


def _polynomial(strip: str, found: Polynomial) -> Document:
    axes: tuple[AxisFit, ...] = found.axes
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = [axis.coefficients / axis.sigmas for axis in axes]
    return {
        "strip": strip,
        "degree": found.degree,
        "asked": found.asked,
        "terms": _by_axis([list(axis.terms) for axis in axes]),
        "coefficients": _by_axis([significant(axis.coefficients, EXACT) for axis in axes]),
        "sigmas": _by_axis([significant(axis.sigmas) for axis in axes]),
        "t": _by_axis([rounded(ratio, 2) for ratio in ratios]),
        "effects": _by_axis([rounded(axis.effects, GROUND) for axis in axes]),
        "sigma0": _by_axis([rounded(axis.sigma0, GROUND) for axis in axes]),
        "redundancy": _by_axis([axis.redundancy for axis in axes]),
        "condition": _by_axis([significant(axis.condition) for axis in axes]),
        "stations": {"plan": found.stations[0], "height": found.stations[1]},
        "reach": rounded(found.reach, 2),
        "evidence": [_evidence(step) for step in found.evidence],
    }


def _evidence(step: Evidence) -> Document:
    return {
        "group": step.group,
        "degree": step.degree,
        "terms": step.terms,
        "redundancy": step.redundancy,
        "rms": rounded(step.rms, GROUND),
        "left_out": rounded(step.left_out, GROUND),
        "left_out_by": step.left_out_by,
        "f": significant(step.f),
        "p": significant(step.p),
        "against": step.against,
        "accepted": step.accepted,
    }
