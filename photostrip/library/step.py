"""A single step of the method: its table and keys read, computed, and told as a sheet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import radians
from typing import Any, TypeVar, cast

import numpy as np

from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.formats.measured.steps import read_rays, read_step
from photostrip.geometry.rotation import from_angles
from photostrip.library import step_sheets as sheets
from photostrip.library import steps
from photostrip.library.step_arguments import Rays
from photostrip.project import steps as keys
from photostrip.project.schema.sections import Section
from photostrip.project.yaml.reading import read_keys
from photostrip.sheets.sheet import Rows, Sheet
from photostrip.strip import StepName

K = TypeVar("K", bound=Section)
Step = tuple[Sheet, Callable[[], list[Rows]]]  # what it found; what traces it


def step(name: StepName, file: str, assignments: Sequence[str], *, trace: bool = False) -> Sheet:
    """Compute a step from its table, with the equations and their numbers if a trace is wanted."""
    sheet, traced = _STEPS[name](file, assignments)
    return replace(sheet, tables=[*sheet.tables, *traced()]) if trace else sheet


def _given(kind: type[K], assignments: Sequence[str]) -> K:
    return read_keys(kind, None, assignments)[0]


def _turned(degrees: Sequence[float]) -> Floats:
    return from_angles([radians(each) for each in degrees], "omega-phi-kappa")


def _interior(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.InteriorKeys, assignments)
    ids, (measured, calibrated) = read_step(file, "interior")
    found = steps.interior(measured, calibrated, cast("Any", given.transform))
    return sheets.interior(ids, found), lambda: sheets.trace_interior(ids, measured, calibrated, found)


def _refine(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.RefineKeys, assignments)
    ids, (xy,) = read_step(file, "refine")
    lens = Distortion(model="brown", direction="image_to_ideal", k=given.k) if any(given.k) else None
    camera = Camera(
        name="camera",
        principal_distance=given.principal_distance,
        principal_point=given.principal_point,
        distortion=lens,
    )
    refined = steps.refine(xy, camera, flying_height=given.flying_height, ground_height=given.ground_height)
    return sheets.refine(ids, xy, refined), lambda: sheets.trace_refine(ids, xy, refined, camera)


def _relative(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.RelativeKeys, assignments)
    ids, (left, right) = read_step(file, "relative")
    focal, base = given.principal_distance, given.base
    found = steps.relative(left, right, focal, base=base)
    sheet = sheets.relative(ids, found, base, given.unit)
    return sheet, lambda: sheets.trace_relative(ids, left, right, focal, found, base)


def _intersection(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.IntersectionKeys, assignments)
    ids, (one, other) = read_step(file, "intersection")
    focal, base, turned = given.principal_distance, np.array(given.base), (_turned(given.left), _turned(given.right))
    found = steps.intersection(one, other, focal, base=base, rotations=turned, left_ray=given.left_ray)
    sheet = sheets.intersection(ids, found, given.unit)
    return sheet, lambda: sheets.trace_intersection(ids, (one, other), focal, base, turned)


def _chain(file: str, assignments: Sequence[str]) -> Step:
    _given(keys.StepKeys, assignments)
    ids, (angles,) = read_step(file, "chain")
    rotations = np.array([_turned(each) for each in angles.tolist()])
    handed = steps.chain(rotations[1:], rotations[0])
    return sheets.chain(ids, handed), lambda: sheets.trace_chain(ids, rotations, handed)


def _scale(file: str, assignments: Sequence[str]) -> Step:
    _given(keys.StepKeys, assignments)
    ids, (first, second) = read_step(file, "scale")
    factor, departures = steps.scale_transfer(first, second)
    return sheets.scale(ids, factor, departures), lambda: sheets.trace_scale(ids, first, second, factor)


def _strip(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.StripKeys, assignments)
    photos, points, rays = _rays(file)
    transfer, names = cast("Any", given.scale_transfer), (photos, points)
    found = steps.strip(rays, given.principal_distance, base=given.base, scale_transfer=transfer, names=names)
    return sheets.strip(photos, points, found, given.unit), lambda: sheets.trace_strip(photos, found)


def _absolute(file: str, assignments: Sequence[str]) -> Step:
    unit = _given(keys.AbsoluteKeys, assignments).unit
    ids, (model, ground) = read_step(file, "absolute")
    found = steps.absolute(model, ground)
    return sheets.absolute(ids, found, unit), lambda: sheets.trace_absolute(ids, model, ground, found, unit)


def _polynomial(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.PolynomialKeys, assignments)
    ids, (xyz, misclosures) = read_step(file, "polynomial")
    terms, values = list(map(str, given.terms)), misclosures[:, 0]
    found = steps.polynomial(xyz, values, terms)
    sheet = sheets.polynomial(ids, terms, *found, given.unit)
    return sheet, lambda: sheets.trace_polynomial(ids, xyz, values, terms, found)


def _resection(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.ResectionKeys, assignments)
    ids, (xy, ground) = read_step(file, "resection")
    focal, unit = given.principal_distance, given.unit
    found = steps.resection(xy, ground, focal, sigma=given.sigma_um / 1000.0)
    return sheets.resection(ids, found, unit), lambda: sheets.trace_resection(ids, xy, ground, focal, found, unit)


def _bundle(file: str, assignments: Sequence[str]) -> Step:
    given = _given(keys.BundleKeys, assignments)
    photos, points, rays = _rays(file)
    focal, unit, ground = given.principal_distance, given.unit, None
    if given.control is not None:
        ids, (known,) = read_step(str(given.control), "bundle")
        at = dict(zip(ids, known, strict=True))
        ground = np.array([at.get(point, np.full(3, np.nan)) for point in points])
    found = steps.bundle(
        rays,
        focal,
        ground=ground,
        base=given.base,
        sigma=given.sigma_um / 1000.0,
        ground_sigma=given.control_sigma,
        names=(photos, points),
    )
    sheet = sheets.bundle(photos, points, found, ground, unit)
    return sheet, lambda: sheets.trace_bundle(photos, points, rays, focal, found, unit)


def _rays(file: str) -> tuple[tuple[str, ...], tuple[str, ...], Rays]:
    """Read image coordinates of all photos: ids of photos and points, and the rays."""
    read = read_rays(file)
    return read.photo_ids, read.target_ids, (read.photo, read.target, read.xy)


_STEPS: dict[StepName, Callable[[str, Sequence[str]], Step]] = {
    "interior": _interior,
    "refine": _refine,
    "relative": _relative,
    "intersection": _intersection,
    "chain": _chain,
    "scale": _scale,
    "strip": _strip,
    "absolute": _absolute,
    "polynomial": _polynomial,
    "resection": _resection,
    "bundle": _bundle,
}
