"""A single step of the method: its table and keys read, computed, and told as a sheet with a trace.

A sheet has values with their units and a table of points. The trace shows how the numbers come about: the equations,
the iterations, and each point on its way through them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from math import radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from photostrip import steps
from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.formats.steps import read_rays, read_step
from photostrip.geodesy.ground_frame import WGS84
from photostrip.geodesy.local_frame import geodetic_from_geocentric
from photostrip.geometry.rotation import angles, from_alpha_omega_kappa, from_angles
from photostrip.planning.closed_form import ORDER
from photostrip.planning.deformation import DEFORMATION_TERMS, paraboloid_rows
from photostrip.project import plans as keys
from photostrip.project.conversion import semi_axes
from photostrip.project.reading import read_keys
from photostrip.project.sections import Section
from photostrip.report.page.parts import DASH, Facts
from photostrip.report.page.tables import Field
from photostrip.sheets.replay import first_rounds
from photostrip.sheets.sheet import Rows, Sheet, table
from photostrip.steps import Bundle, Rays, Strip, of_rays, one_pair, sigma0_of
from photostrip.strip import StepName
from photostrip.strip.corrections import Bending, undistort
from photostrip.strip.formed_strip import base_angles, base_frames, lies_across
from photostrip.strip.polynomial import term_columns as design_columns
from photostrip.strip.relative_orientation import ELEMENTS
from photostrip.strip.resection import KnownPhotos, approximate, project, resect
from photostrip.units import MICROMETRES

Column = tuple[Field, ArrayLike]
Value = tuple[str, float, str, float | None, bool]  # name, number, unit, standard deviation, all digits shown

MILLION = 1e6
TRACE = "trace_"  # before the keys of tables of a trace
DIGITS = 10  # of values: more than any measurement has
TEXTBOOK = "alpha-omega-kappa"  # system of the angles of [001]

_COLLINEAR = "(u, v, w) = R' (X - X0); x' = -f u/w, y' = -f v/w; v = x - x'"
_EXCHANGED = str.maketrans("XxYy", "YyXx")  # where the base lies along Y
_TURNED = "(u, v, w) = R (x, y, -f); xh = -f u/w, yh = -f v/w; eq. 137"


def step(name: StepName, file: str, assignments: Sequence[str], *, trace: bool = False) -> Sheet:
    """Compute a step from its table, with the equations and their numbers if a trace is wanted."""
    title, kind, computed = _STEPS[name]
    given: Any = read_keys(kind, None, assignments)[0]
    sheet = computed(file, given)
    shown = [each for each in sheet.tables if trace or not each.key.startswith(TRACE)]
    return replace(sheet, title=title, tables=shown)


def _interior(file: str, given: keys.InteriorKeys) -> Sheet:
    ids, (measured, calibrated) = read_step(file, "interior")
    found = steps.interior(measured, calibrated, given.transform)  # type: ignore[arg-type] # one of its words
    names = ("x", "y", "x y", "1")
    rows = zip(("x", "y", "denominator"), found.transform.coefficients, strict=True)
    values = [
        _value(f"{axis}: {term}", c, whole=True) for axis, row in rows for term, c in zip(names, row, strict=True) if c
    ]
    values += _fit(found.sigma0 * MICROMETRES, "um", found.redundancy)
    (x, y, below), photo = found.transform.coefficients.tolist(), found.transform(measured)
    equations = [f"x' = {_linear(x)}", f"y' = {_linear(y)}"]
    if below != [0.0, 0.0, 0.0, 1.0]:
        equations = [f"{each.replace('= ', '= (')}) / ({_linear(below)})" for each in equations]
    listed = [*columns("x y", " 4", measured), *columns("x' y'", "mm 4", photo)]
    listed += columns("given_x given_y", "mm 4", calibrated)
    marks = _table("Marks", ids, listed, "v = x' - given", *equations)
    return _sheet("interior", values, ids, _image_residuals(found.residuals), marks, of="mark")


def _refine(file: str, given: keys.RefineKeys) -> Sheet:
    ids, (xy,) = read_step(file, "refine")
    brown = Distortion(model="brown", direction="image_to_ideal", k=given.k) if any(given.k) else None
    focal, point = given.principal_distance, given.principal_point
    camera = Camera(name="camera", principal_distance=focal, principal_point=point, distortion=brown)
    refined = steps.refine(xy, camera, flying_height=given.flying_height, ground_height=given.ground_height)
    central = xy - np.asarray(point)
    lens = undistort(xy, camera, Bending()) - central
    bent = refined - central - lens
    rows = columns("x-x0 y-y0", "mm 4", central)
    rows += [(Field("r", "mm 3"), np.hypot(*central.T)), *columns("lens_x lens_y", "um 2", lens * MICROMETRES)]
    rows += [*columns("refr_x refr_y", "um 2", bent * MICROMETRES), *columns("x' y'", "mm 4", refined)]
    trace = _table("Corrections, one after the other", ids, rows, "x' = x - x0 + lens + refraction")
    shift = columns("dx dy", "um 1", (refined - xy) * MICROMETRES)
    return _sheet("refine", [], ids, [*columns("x y", "mm 4", refined), *shift], trace)


def _relative(file: str, given: keys.RelativeKeys) -> Sheet:
    """Return the elements relative to the base; base and right photo in the system of the left one; the model."""
    ids, (left, right) = read_step(file, "relative")
    focal, base, unit = given.principal_distance, given.base, given.unit
    found = steps.relative(left, right, focal, base=base)
    degrees = zip(ELEMENTS, np.degrees(found.elements), np.degrees(found.sigmas), strict=True)
    values = [_value(name, value, "deg", sigma) for name, value, sigma in degrees]
    values += [_value(name, base * each, unit) for name, each in zip(("bx", "by", "bz"), found.base, strict=True)]
    tau, nu = np.degrees(base_angles(found.base)).tolist()
    values += [_value("tau", tau, "deg"), _value("nu", nu, "deg"), *_angles(found.rotation, given.angles)]
    values += _fit(found.sigma0 * MICROMETRES, "um", len(ids) - len(ELEMENTS))
    listed: list[Column] = [(Field("q", "um 2"), found.parallax * MICROMETRES)]
    listed += columns("x y z", f"{unit} 4", found.model)
    (rounds,) = first_rounds(one_pair(left, right, focal), found.elements[None])
    elements, added = (np.degrees([getattr(each, name) for each in rounds.steps]) for name in ("elements", "step"))
    squares: list[Column] = [(Field("[qq]", "mm^2 e4"), [each.squares for each in rounds.steps])]
    before, changes = columns(" ".join(ELEMENTS), "deg 6", elements), columns(" ".join(ELEMENTS), "deg e2", added)
    alpha1, kappa1, alpha2, omega2, kappa2 = found.elements
    rotations = from_alpha_omega_kappa(alpha1, 0.0, kappa1), from_alpha_omega_kappa(alpha2, omega2, kappa2)
    words = f"q = y1h - y2h; N = B / (x1h - x2h) with B = {base:g}; X = N x1h, Y = N (y1h + y2h)/2, Z = -N f"
    rays = _turned_rays(left, right, focal, np.array([base, 0.0, 0.0]), rotations)
    return _sheet(
        "relative",
        [*values, _value("iterations", found.iterations)],
        ids,
        listed,
        _table("Elements before each step", _numbers(squares), [*squares, *before], "eq. 131-137"),
        _table("What the step adds", _numbers(squares), changes, "-(J'J)^-1 J'q, J the derivatives of q"),
        _matrices("Rotations to the base frame, by rows", ("left", "right"), np.stack(rotations)),
        _matrices(
            "A_taunu, base frame to left photo, by rows",
            ("A_taunu",),
            base_frames(np.eye(3)[None], found.elements[None]),
            "A_taunu = A(al1, om1, ka1) A(al1', 0, ka1')', the left photo not turned; eq. 128; first column: the base",
        ),
        _table("Points: photos turned into the base frame, and the model", ids, rays, _TURNED, words),
    )


def _intersection(file: str, given: keys.IntersectionKeys) -> Sheet:
    ids, images = read_step(file, "intersection")
    one, other = images
    focal, base, form = given.principal_distance, np.array(given.base), f"{given.unit} 4"
    turned = _turned(given.left, given.angles), _turned(given.right, given.angles)
    found = steps.intersection(one, other, focal, base=base, rotations=turned, left_ray=given.left_ray)
    words = [
        f"N = (BX + x2h BZ/f) / (x1h - x2h), N2 = N + BZ/f, B = {', '.join(f'{each:g}' for each in base)}; eq. 138",
        "X = N x1h, Y1 = N y1h, Y2 = BY + N2 y2h, Z = -N f",
    ]
    if lies_across(base):
        words = [each.translate(_EXCHANGED) for each in words]
    matrices = _matrices("Rotations, by rows", ("left", "right"), np.stack(turned))
    trace = _table("Points", ids, _turned_rays(one, other, focal, base, turned), _TURNED, *words)
    listed: list[Column] = [*columns("x y z", form, found.xyz), (Field("gap", form), found.gap)]
    return _sheet("intersection", [], ids, listed, matrices, trace)


def _chain(file: str, given: keys.TurnedKeys) -> Sheet:
    ids, (degrees,) = read_step(file, "chain", (tuple(given.angles.split("-")),))
    rotations = np.array([_turned(each, given.angles) for each in degrees.tolist()])
    handed = steps.chain(rotations[1:], rotations[0])
    taken = _matrices("Given: each photo in the photo before it, by rows", ids, rotations)
    found = _matrices("In the strip, by rows", ids, handed, "A(i+1) = A(i) A(i, i+1); eq. 131-134")
    return _sheet("chain", [], ids, _turns(handed, given.angles), taken, found, of="photo")


def _scale(file: str, _given: keys.StepKeys) -> Sheet:
    """Return the factor of the second model, and what each point departs from it, in parts of a million."""
    ids, (first, second, weights) = read_step(file, "scale")
    factor, departures = steps.scale_transfer(first, second, weights)
    values = [_value("k", factor), _value("rms departure", float(np.sqrt((departures**2).mean())) * MILLION, "ppm")]
    before, after = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    rows: list[Column] = [(Field("D", " 6"), before), (Field("D'", " 6"), after), (Field("k_t", " 7"), before / after)]
    if np.ptp(weights):
        rows.append((Field("weight", " g6"), weights))
    mean = "weighted mean" if np.ptp(weights) else "mean"
    words = f"k_t = D / D' from the common perspective centre; k = {factor:.9g}, their {mean}; eq. 139-141"
    listed: list[Column] = [(Field("departure", "ppm 1"), departures * MILLION)]
    return _sheet("scale", values, ids, listed, _table("Points", ids, rows, words))


def _strip(file: str, given: keys.StripKeys) -> Sheet:
    """Return the photos of a strip, the scale factors of its models, and the points that have a place."""
    photos, points, rays = _rays(file)
    transfer: Any = given.scale_transfer
    focal, base, names = given.principal_distance, given.base, (photos, points)
    found = steps.strip(rays, focal, base=base, scale_transfer=transfer, names=names)
    factors = zip(pairwise(photos), found.factors, strict=True)
    values = [_value(f"k {left}-{right}", factor) for (left, right), factor in factors]
    placed = np.flatnonzero(found.models)
    listed: list[Column] = [*columns("x y z", f"{given.unit} 4", found.points[placed])]
    listed.append((Field("models", "count"), found.models[placed]))
    rows: list[Column] = [(Field("k", " 7"), found.factors), (Field("sigma0", "um 2"), found.sigma0 * MICROMETRES)]
    rows += columns("BX BY BZ", " 4", np.diff(found.centers, axis=0))
    words = "B = k A (bx, by, bz) with A of the left photo; X = S + k (x, y, z); eq. 134-141"
    return _sheet(
        "strip",
        values,
        [points[n] for n in placed.tolist()],
        listed,
        _photos(photos, found, given.unit, given.angles),
        _table("Models", [f"{left} - {right}" for left, right in pairwise(photos)], rows, words),
        _matrices("Rotations A, photo to strip, by rows", photos, found.rotations),
    )


def _absolute(file: str, given: keys.AbsoluteKeys) -> Sheet:
    ids, (model, ground, weights) = read_step(file, "absolute")
    found, unit = steps.absolute(model, ground, weights), given.unit
    similarity = found.similarity
    centre, place = (np.average(each, axis=0, weights=weights) for each in (model, ground))
    values = [_value("scale", similarity.scale)]
    values += [_value(f"shift {axis}", each, unit) for axis, each in zip("xyz", similarity.shift, strict=True)]
    values += _angles(similarity.rotation, given.angles, ("xi", "eta", "theta"))
    values += _fit(found.sigma0, unit, found.redundancy)
    reduced, wanted = model - centre, ground - place
    turned = similarity.scale * reduced @ similarity.rotation.T
    rows = [*columns("x-xm y-ym z-zm", " 4", reduced), *columns("X-Xm Y-Ym Z-Zm", f"{unit} 4", wanted)]
    rows += columns("X' Y' Z'", f"{unit} 4", turned)
    words = f"X' = s R (x - xm) with s = {similarity.scale:.9g}; v = X' - (X - Xm); the shift is Xm - s R xm"
    return _sheet(
        "absolute",
        values,
        ids,
        columns("vx vy vz", f"{unit} 4", found.residuals),
        _table("Centroids", ["model xm", "ground Xm"], columns("x y z", " 4", np.stack([centre, place]))),
        _matrices("Rotation R, by rows", ("R",), similarity.rotation),
        _table("Points", ids, rows, words),
    )


def _polynomial(file: str, given: keys.PolynomialKeys) -> Sheet:
    ids, (xyz, misclosures) = read_step(file, "polynomial")
    terms, measured = list(map(str, given.terms)), misclosures[:, 0]
    coefficients, left = steps.polynomial(xyz, measured, terms)
    values = [_value(term, coefficient, whole=True) for term, coefficient in zip(terms, coefficients, strict=True)]
    redundancy = len(ids) - len(values)
    values += _fit(sigma0_of(left, redundancy), given.unit, redundancy)
    design = design_columns(xyz, terms)
    rows: list[Column] = [(Field(term, " e5"), design[:, k]) for k, term in enumerate(terms)]
    rows += columns("misclosure polynomial v", " 4", np.column_stack([measured, measured - left, left]))
    equation = " + ".join(f"{value:.8g} {term}" for value, term in zip(coefficients, terms, strict=True))
    trace = _table("Points", ids, rows, f"polynomial = {equation}", "v = misclosure - polynomial; eq. 151")
    return _sheet("polynomial", values, ids, [(Field("v", f"{given.unit} 4"), left)], trace)


def _resection(file: str, given: keys.ResectionKeys) -> Sheet:
    ids, (xy, ground) = read_step(file, "resection")
    focal, unit = given.principal_distance, given.unit
    found = steps.resection(xy, ground, focal, sigma=given.sigma_um / 1000.0)
    sigma = np.sqrt(np.diag(found.covariance))
    values = [_value(axis, found.center[k], unit, sigma[k]) for k, axis in enumerate("xyz")]
    values += _angles(found.rotation, given.angles)
    values += _fit(found.sigma0, "", found.redundancy)
    photo = np.zeros(len(xy), np.intp)
    seen: list[tuple[float, Floats, Floats]] = []

    def watch(before: KnownPhotos, step: Floats) -> None:
        seen.append((float(((xy - project(ground, before, photo)) ** 2).sum()), before.centers[0], step[0]))

    center, rotation = approximate(xy, ground, focal)
    resect(xy, ground, photo, KnownPhotos(center[None], rotation[None], np.array([focal])), watch)
    squares, centers, added = zip(*seen, strict=True)
    states: list[Column] = [(Field("[vv]", "mm^2 e4"), squares), *columns("X0 Y0 Z0", f"{unit} 4", np.array(centers))]
    changes = columns("dX0 dY0 dZ0", f"{unit} e2", np.array(added)[:, :3])
    changes += columns("turn_X turn_Y turn_Z", "deg e2", np.degrees(added)[:, 3:])
    rays = _images(xy, ground - found.center, found.rotation, focal, unit)
    return _sheet(
        "resection",
        values,
        ids,
        _image_residuals(found.residuals),
        _table("Centre before each step", _numbers(states), states, "Step 1 starts from three points in closed form."),
        _table("What the step adds", _numbers(states), changes, "(J'J)^-1 J'v, J the derivatives of x' and y'"),
        _matrices("Rotation R, photo to ground, by rows", ("R",), found.rotation),
        _table("Points", ids, rays, _COLLINEAR),
    )


def _bundle(file: str, given: keys.BundleKeys) -> Sheet:
    """Return adjusted photos, and points with their precision and what they differ from given coordinates."""
    photos, points, rays = _rays(file)
    focal, unit, ground = given.principal_distance, given.unit, None
    if given.control is not None:
        names, (known,) = read_step(str(given.control), "bundle")
        at = dict(zip(names, known, strict=True))
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
    placed = np.flatnonzero(np.isfinite(found.points[:, 0]))
    listed = columns("x y z", f"{unit} 4", found.points[placed])
    listed += columns("sigma_x sigma_y sigma_z", f"{unit} 4", found.sigmas[placed])
    if ground is not None:
        listed += columns("dx dy dz", f"{unit} 4", (found.points - ground)[placed])
    states: list[Column] = [(Field("[pvv]", " e4"), [each.chi_square for each in found.steps])]
    states += [(Field("length", "sigma e2"), [each.length for each in found.steps])]
    states += [(Field("shift", f"{unit} e2"), [each.shift for each in found.steps])]
    states += [(Field("turn", "deg e2"), np.degrees([each.turn for each in found.steps]))]
    taken = np.isfinite(found.residuals[:, 0])
    photo, point, xy = of_rays(rays)
    photo, point = photo[taken], point[taken]
    ids = [f"{photos[one]} {points[other]}" for one, other in zip(photo, point, strict=True)]
    images = _images(xy[taken], found.points[point] - found.centers[photo], found.rotations[photo], focal, unit)
    words = "[pvv] before the step; its length in standard deviations; the largest shift and turn"
    return _sheet(
        "bundle",
        [*_fit(found.sigma0, "", found.redundancy), _value("iterations", found.iterations)],
        [points[n] for n in placed.tolist()],
        listed,
        _photos(photos, found, unit, given.angles),
        _table("Steps of all photos and points", _numbers(states), states, words, "A'PA dx = A'Pv"),
        _matrices("Rotations R, photo to ground, by rows", photos, found.rotations),
        _table("Rays", ids, images, _COLLINEAR),
    )


def _frame(file: str, given: keys.FrameKeys) -> Sheet:
    """Return points in the intermediate frame, its origin, and in the trace its axes and the way back."""
    ids, (geodetic,) = read_step(file, "frame")
    turned = np.column_stack([np.radians(geodetic[:, :2]), geodetic[:, 2]])
    ellipsoid = semi_axes(given.ellipsoid) or WGS84
    found = steps.frame(turned, azimuth=radians(given.azimuth), ellipsoid=ellipsoid)
    frame = found.frame
    values = [_value(f"origin {axis}", each, "m", whole=True) for axis, each in zip("XYZ", frame.origin, strict=True)]
    values.append(_value("A0", given.azimuth, "deg"))
    back = geodetic_from_geocentric(frame.cartesian_from_intermediate(found.points), ellipsoid)
    rows = columns("X_G Y_G Z_G", "m 4", found.geocentric)
    rows += [*columns("longitude latitude", "deg 9", np.degrees(back[:, :2])), (Field("height", "m 4"), back[:, 2])]
    words = "X = M' (X_G - X_0), X_0 their mean; eq. 144; longitude, latitude, height: back by X_0 + M X, eq. 152"
    return _sheet(
        "frame",
        values,
        ids,
        columns("X Y Z", "m 4", found.points),
        _matrices("Axes M, geocentric, by rows", ("M",), frame.axes, "columns: X in the azimuth A0, Y, Z; eq. 143"),
        _table("Points: geocentric, and back", ids, rows, words),
    )


def _curvature(file: str, given: keys.CurvatureKeys) -> Sheet:
    ids, (xyz,) = read_step(file, "curvature")
    radius = given.radius_of_strip
    fall = steps.curvature(xyz, radius=radius)
    distance = np.hypot(*(xyz[:, :2] - xyz[:, :2].mean(axis=0)).T)
    listed: list[Column] = [(Field("D", "m 1"), distance), (Field("D2/2R", "m 4"), fall)]
    listed += [(Field("reduced", "m 4"), xyz[:, 2] - fall), (Field("raised", "m 4"), xyz[:, 2] + fall)]
    words = (
        "D from the middle of the points; reduced: z of control before the strip; raised: z of results after; eq. 153"
    )
    return _sheet("curvature", [_value("R", radius, "m")], ids, listed, _equations(words))


def _pair_scales(file: str, given: keys.PairScalesKeys) -> Sheet:
    """Return distances of all pairs in both systems, the scale r, and what is left of the scale s by it."""
    ids, (model, ground) = read_step(file, "pair-scales")
    found = steps.pair_scales(model, ground)
    values = [_value("r", found.mean)]
    if len(ids) > 2:
        values.append(_value("t", steps.absolute(model, ground).similarity.scale / found.mean))
    names = [f"{ids[one]} - {ids[other]}" for one, other in zip(found.first, found.second, strict=True)]
    listed: list[Column] = [(Field("D", " 4"), found.source), (Field("D_G", f"{given.unit} 4"), found.target)]
    listed.append((Field("r", " g9"), found.target / found.source))
    words = "r = sum of D_G over sum of D, eq. 147, 148; the scale of the absolute orientation is s = r t"
    return _sheet("pair-scales", values, names, listed, _equations(words), of="pair")


def _closed_form(file: str, given: keys.ClosedFormKeys) -> Sheet:
    ids, (points,) = read_step(file, "closed-form")
    _, (control,) = read_step(str(given.control), "closed-form")
    found = steps.closed_form(points, control, given.principal_distance, given.base, as_printed=given.as_printed)
    values = [_value(f"c{number}", each, whole=True) for number, each in enumerate(found.sums.tolist(), 1)]
    listed = columns(" ".join(ORDER), "ratio g7", found.coefficients.reshape(-1, len(ORDER)))
    names = [f"{point} {axis}" for point in ids for axis in "xyz"]
    words = "Error of a point per error of an element, less what the control takes back, mm/mm, mm/rad; eq. 9, 10, 11"
    return _sheet("closed-form", values, names, listed, _equations(words), of="error of")


def _deformation(file: str, given: keys.DeformationKeys) -> Sheet:
    """Return the coefficients of the surface, t of twist and bending, the elements behind them, and what is left."""
    ids, (xy, dz) = read_step(file, "deformation")
    heights = dz[:, 0]
    found = steps.deformation(xy, heights, sigma=given.sigma)
    named = zip(DEFORMATION_TERMS, found.coefficients, found.sigmas, strict=True)
    values = [_value(term, value, "", sigma, whole=True) for term, value, sigma in named]
    t = zip(("t of C", "t of D"), found.t_values.tolist(), strict=True)
    values += [*(_value(name, value) for name, value in t), _value("critical t, 5 %", found.critical())]
    values += _fit(found.sigma0 * given.sigma, "m", found.redundancy)
    turns = np.degrees(found.elements(given.scale / 1000, given.base)).tolist()  # dz in metres, the base in mm
    values += [_value(name, each, "deg") for name, each in zip(("domega2'", "dalpha2' - dalpha1'"), turns, strict=True)]
    surface = paraboloid_rows(xy) @ found.coefficients
    listed = columns("dz surface v", "m 4", np.column_stack([heights, surface, heights - surface]))
    words = "surface = E0 + A x + B y + C x y + D x^2; domega2' = -C b/m, dalpha2' - dalpha1' = -D b/m; eq. 10.12"
    return _sheet("deformation", values, ids, listed, _equations(words))


_STEPS: dict[StepName, tuple[str, type[Section], Callable[[str, Any], Sheet]]] = {
    "interior": ("Interior orientation", keys.InteriorKeys, _interior),
    "refine": ("Refined image coordinates", keys.RefineKeys, _refine),
    "relative": ("Relative orientation", keys.RelativeKeys, _relative),
    "intersection": ("Space intersection", keys.IntersectionKeys, _intersection),
    "chain": ("Orientation handed on along a strip", keys.ChainKeys, _chain),
    "scale": ("Scale transfer", keys.ScaleKeys, _scale),
    "strip": ("Strip in model coordinates", keys.StripKeys, _strip),
    "absolute": ("Absolute orientation", keys.AbsoluteKeys, _absolute),
    "polynomial": ("Polynomial", keys.PolynomialKeys, _polynomial),
    "resection": ("Space resection", keys.ResectionKeys, _resection),
    "bundle": ("Bundle adjustment", keys.BundleKeys, _bundle),
    "frame": ("Intermediate frame", keys.FrameKeys, _frame),
    "curvature": ("Earth curvature", keys.CurvatureKeys, _curvature),
    "pair-scales": ("Scales of pairs of points", keys.PairScalesKeys, _pair_scales),
    "closed-form": ("Errors of points in closed form", keys.ClosedFormKeys, _closed_form),
    "deformation": ("Deformation of a model", keys.DeformationKeys, _deformation),
}


def _turned(degrees: Sequence[float], system: str) -> Floats:
    return from_angles([radians(each) for each in degrees], system)


def _rays(file: str) -> tuple[tuple[str, ...], tuple[str, ...], Rays]:
    """Read image coordinates of all photos: ids of photos and points, and the rays."""
    read = read_rays(file)
    return read.photo_ids, read.target_ids, (read.photo, read.target, read.xy)


def _value(name: str, value: float, unit: str = "", sigma: float | None = None, *, whole: bool = False) -> Value:
    """Return a value; one that multiplies what is larger than the result is good for is shown as it stands."""
    return name, value, unit, sigma, whole


def _fit(sigma0: float, unit: str, redundancy: int) -> list[Value]:
    return [_value("sigma0", sigma0, unit), _value("redundancy", redundancy)]


def _angles(rotation: Floats, system: str, textbook: tuple[str, ...] = ()) -> list[Value]:
    """Return the angles of a rotation; `textbook`: their names in the system of the source."""
    names = textbook if textbook and system == TEXTBOOK else system.split("-")
    return [_value(name, value, "deg") for name, value in zip(names, np.degrees(angles(rotation, system)), strict=True)]


def _image_residuals(residuals: Floats) -> list[Column]:
    return columns("vx vy", "um 2", residuals * MICROMETRES)


def _turns(rotations: Floats, system: str) -> list[Column]:
    return columns(system.replace("-", " "), "deg 6", np.degrees(angles(rotations, system)))


def _photos(photos: Sequence[str], found: Strip | Bundle, unit: str, system: str) -> Rows:
    return _rows(
        "photos", "", photos, [*columns("x y z", f"{unit} 4", found.centers), *_turns(found.rotations, system)], "photo"
    )


def _sheet(
    step: str, values: list[Value], ids: Sequence[str], listed: Sequence[Column], *more: Rows, of: str = "point"
) -> Sheet:
    """Put values, tables and the points together; these are the CSV."""
    facts = Facts(tuple((value[0], _written(*value[1:])) for value in values))
    keys = (("name", ""), ("value", f"ratio g{DIGITS - 4}"), ("unit", ""), ("sigma", f"ratio g{DIGITS - 4}"))
    hidden = [Field(key, form, shown=False) for key, form in keys]
    stated = Rows("values", "", hidden, [value[:4] for value in values], above=[facts] if values else [])
    points = _rows("points", "", ids, listed, of)
    shown, traced = ([each for each in more if each.key.startswith(TRACE) is kept] for kept in (False, True))
    return Sheet(step, "", (), [stated, *shown, points, *traced], main="points")


def _written(value: float, unit: str, sigma: float | None, whole: bool) -> str:  # noqa: FBT001 (of a value)
    if not np.isfinite(value):
        return DASH
    if whole:
        return f"{value:.{DIGITS}g}"
    places = 6 if unit == "deg" else 4
    text = str(value) if isinstance(value, int) else _digits(value, places)
    deviation = "" if sigma is None else f" ± {_digits(sigma, places) if np.isfinite(sigma) else DASH}"
    return f"{text}{deviation} {unit}".rstrip()


def _digits(value: float, decimals: int) -> str:
    """Return a number with decimals, or with digits where decimals would show nothing of it."""
    return f"{value:z.{decimals}f}" if abs(value) >= 10.0 ** (2 - decimals) else f"{value:.4g}"


def columns(names: str, form: str, values: Floats) -> list[Column]:
    """Return the columns of an array, named one after the other."""
    return [(Field(name, form, name), values[:, k]) for k, name in enumerate(names.split())]


def _rows(key: str, title: str, ids: Iterable[str], listed: Sequence[Column], of: str = "", **more: Any) -> Rows:  # noqa: ANN401
    return table(key, title, [(Field(of or "id", head=of), list(ids)), *listed], **more)


def _turned_rays(
    left: Floats, right: Floats, focal: float, base: Floats, rotations: tuple[Floats, Floats]
) -> list[Column]:
    """Return images turned into the frame of the base, ray factors and the coordinate of both rays across the base."""
    along, across = (1, 0) if lies_across(base) else (0, 1)
    turned = []
    for xy, rotation in zip((left, right), rotations, strict=True):
        u, v, w = rotation @ np.vstack([xy.T, np.full(len(xy), -focal)])
        turned.append(np.stack([-focal * u / w, -focal * v / w]))
    one, two = turned
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = (base[along] + two[along] * base[2] / focal) / (one[along] - two[along])
    other = factor + base[2] / focal  # the same where the base is level
    rows = columns("x1h y1h x2h y2h", "mm 4", np.vstack(turned).T)
    rows += [(Field("N", " 6"), factor), *([(Field("N2", " 6"), other)] if base[2] else [])]
    name = "XY"[across]
    rows += [
        (Field(f"{name}1", " 4"), factor * one[across]),
        (Field(f"{name}2", " 4"), base[across] + other * two[across]),
    ]
    return rows


def _images(xy: Floats, arms: Floats, rotations: Floats, focal: float, unit: str) -> list[Column]:
    """Return points from the centre, turned into the photo, their images, and the measured ones."""
    seen = np.einsum("...ji,...j->...i", rotations, arms)
    computed = -focal * seen[:, :2] / seen[:, 2:]
    return [*columns("u v w", f"{unit} 4", seen), *columns("x' y'", "mm 4", computed), *columns("x y", "mm 4", xy)]


def _linear(coefficients: Iterable[float]) -> str:
    """Write a linear form of x, y, x y and 1."""
    terms = zip(coefficients, (" x", " y", " x y", ""), strict=True)
    return " + ".join(f"{value:.10g}{name}" for value, name in terms if value).replace("+ -", "- ") or "0"


def _matrices(title: str, ids: Sequence[str], rotations: Floats, *words: str) -> Rows:
    """Return rotation matrices, each as three rows."""
    names = [f"{name} {row}" for name in ids for row in "abc"]
    return _table(title, names, columns("1 2 3", "ratio 8", rotations.reshape(-1, 3)), *words)


def _numbers(steps: Sequence[Column]) -> list[str]:
    return [str(number) for number in range(1, len(np.asarray(steps[0][1])) + 1)]


def _equations(*words: str) -> Rows:
    return Rows(f"{TRACE}equations", "Equations", (), (), above=words)


def _table(title: str, ids: Iterable[str], listed: Sequence[Column], *words: str) -> Rows:
    """Put columns together under a title and equations."""
    key = re.sub(r"[^a-z0-9]+", "_", re.split(r"[:,]", title.lower())[0])
    return _rows(f"{TRACE}{key}", title, ids, listed, above=words, exact=True)
