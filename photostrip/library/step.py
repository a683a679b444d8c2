"""A single step of the method: its table and keys read, computed, and told as a sheet with a trace.

A sheet has values with their units and a table of points. The trace shows how the numbers come about: the equations,
the iterations, and each point on its way through them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from math import isfinite, radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from photostrip import steps
from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.formats.steps import read_step
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
from photostrip.report.page.tables import Field, written
from photostrip.sheets.replay import first_rounds
from photostrip.sheets.sheet import Rows, Sheet, table
from photostrip.steps import Bundle, Rays, Strip, of_rays, one_pair, sigma0_of
from photostrip.strip import CONTROL_OF_BUNDLE, STEPS, StepName
from photostrip.strip.corrections import Bending, undistort
from photostrip.strip.formed_strip import base_angles, base_frames, lies_across
from photostrip.strip.polynomial import term_columns
from photostrip.strip.relative_orientation import ELEMENTS
from photostrip.strip.resection import KnownPhotos, approximate, project, resect
from photostrip.units import MICROMETRES

Columns = tuple[str, str, ArrayLike]  # names, form, values (n,) or (n, k)

MILLION = 1e6
TRACE = "trace_"  # before the keys of tables of a trace
WHOLE = "g10"  # more digits than any measurement has, of what multiplies larger numbers
VALUE = ("name", ""), ("value", "ratio g6"), ("unit", ""), ("sigma", "ratio g6")  # columns of values
TEXTBOOK = "alpha-omega-kappa"  # system of the angles of [001]

_COLLINEAR = "(u, v, w) = R' (X - X0); x' = -f u/w, y' = -f v/w; v = x - x'"
_EXCHANGED = str.maketrans("XxYy", "YyXx")  # where the base lies along Y
_TURNED = "(u, v, w) = R (x, y, -f); xh = -f u/w, yh = -f v/w; eq. 137"


def step(name: StepName, file: str, assignments: Sequence[str], *, trace: bool = False) -> Sheet:
    """Compute a step from its table, with the equations and their numbers if a trace is wanted.

    The step ``pair-scales`` has its keys in ``plans.PairScalesKeys`` and is computed by ``_pair_scales``.
    """
    title, head = STEPS[name]
    kind: type[Section] = getattr(keys, f"{name.title().replace('-', '')}Keys")
    computed: Callable[..., Iterator[Rows]] = globals()[f"_{name.replace('-', '_')}"]
    given: Any = read_keys(kind, None, assignments)[0]
    if name == "chain":
        head = f"photo; {given.angles.replace('-', ', ')}"
    tables = [each for each in computed(given, *read_step(file, head)) if trace or not each.key.startswith(TRACE)]
    return Sheet(name, title, (), tables, main="points")


def _interior(given: keys.InteriorKeys, ids: list[str], measured: Floats, calibrated: Floats) -> Iterator[Rows]:
    found = steps.interior(measured, calibrated, given.transform)  # type: ignore[arg-type] # one of its words
    (x, y, below), photo = found.transform.coefficients.tolist(), found.transform(measured)
    terms = [
        (f"{axis}: {term}", f" {WHOLE}", value)
        for axis, row in (("x", x), ("y", y), ("denominator", below))
        for term, value in zip(("x", "y", "x y", "1"), row, strict=True)
        if value
    ]
    yield _values(*terms, *_fit(found.sigma0 * MICROMETRES, "um", found.redundancy))
    yield _points(ids, ("vx vy", "um 2", found.residuals * MICROMETRES), of="mark")
    equations = [f"x' = {_linear(x)}", f"y' = {_linear(y)}"]
    if below != [0.0, 0.0, 0.0, 1.0]:
        equations = [f"{each.replace('= ', '= (')}) / ({_linear(below)})" for each in equations]
    rows = ("x y", " 4", measured), ("x' y'", "mm 4", photo), ("given_x given_y", "mm 4", calibrated)
    yield _traced("Marks", ("v = x' - given", *equations), ids, *rows)


def _refine(given: keys.RefineKeys, ids: list[str], xy: Floats) -> Iterator[Rows]:
    brown = Distortion(model="brown", direction="image_to_ideal", k=given.k) if any(given.k) else None
    focal, point = given.principal_distance, given.principal_point
    camera = Camera(name="camera", principal_distance=focal, principal_point=point, distortion=brown)
    refined = steps.refine(xy, camera, flying_height=given.flying_height, ground_height=given.ground_height)
    central = xy - np.asarray(point)
    lens = undistort(xy, camera, Bending()) - central
    moved = np.hstack([lens, refined - central - lens]) * MICROMETRES
    yield _values()
    yield _points(ids, ("x y", "mm 4", refined), ("dx dy", "um 1", (refined - xy) * MICROMETRES))
    rows: list[Columns] = [("x-x0 y-y0", "mm 4", central), ("r", "mm 3", np.hypot(*central.T))]
    rows += [("lens_x lens_y refr_x refr_y", "um 2", moved), ("x' y'", "mm 4", refined)]
    yield _traced("Corrections, one after the other", ("x' = x - x0 + lens + refraction",), ids, *rows)


def _relative(given: keys.RelativeKeys, ids: list[str], left: Floats, right: Floats) -> Iterator[Rows]:
    """Give the elements relative to the base; base and right photo in the system of the left one; the model."""
    focal, base, unit = given.principal_distance, given.base, given.unit
    found = steps.relative(left, right, focal, base=base)
    yield _values(
        ("; ".join(ELEMENTS), "deg", np.degrees(found.elements), np.degrees(found.sigmas)),
        ("bx; by; bz", unit, base * found.base),
        ("tau; nu", "deg", np.degrees(base_angles(found.base))),
        _angles(found.rotation, given.angles),
        *_fit(found.sigma0 * MICROMETRES, "um", len(ids) - len(ELEMENTS)),
        ("iterations", "", found.iterations),
    )
    yield _points(ids, ("q", "um 2", found.parallax * MICROMETRES), ("x y z", f"{unit} 4", found.model))
    (rounds,) = first_rounds(one_pair(left, right, focal), found.elements[None])
    squares, named = ("[qq]", "mm^2 e4", rounds.squares), " ".join(ELEMENTS)
    before, added = np.degrees(rounds.elements[:-1]), np.degrees(rounds.added)
    yield _iterations("Elements before each step", "eq. 131-137", squares, (named, "deg 6", before))
    yield _iterations("What the step adds", "-(J'J)^-1 J'q, J the derivatives of q", (named, "deg e2", added))
    alpha1, kappa1, alpha2, omega2, kappa2 = found.elements
    rotations = from_alpha_omega_kappa(alpha1, 0.0, kappa1), from_alpha_omega_kappa(alpha2, omega2, kappa2)
    yield _matrices("Rotations to the base frame, by rows", ("left", "right"), np.stack(rotations))
    words = "A_taunu = A(al1, om1, ka1) A(al1', 0, ka1')', the left photo not turned; eq. 128; first column: the base"
    frames = base_frames(np.eye(3)[None], found.elements[None])
    yield _matrices("A_taunu, base frame to left photo, by rows", ("A_taunu",), frames, words)
    words = f"q = y1h - y2h; N = B / (x1h - x2h) with B = {base:g}; X = N x1h, Y = N (y1h + y2h)/2, Z = -N f"
    rays = _turned_rays(left, right, focal, np.array([base, 0.0, 0.0]), rotations)
    yield _traced("Points: photos turned into the base frame, and the model", (_TURNED, words), ids, *rays)


def _intersection(given: keys.IntersectionKeys, ids: list[str], one: Floats, other: Floats) -> Iterator[Rows]:
    focal, base, form = given.principal_distance, np.array(given.base), f"{given.unit} 4"
    left, right = (from_angles(np.radians(each), given.angles) for each in (given.left, given.right))
    turned = left, right
    found = steps.intersection(one, other, focal, base=base, rotations=turned, left_ray=given.left_ray)
    words = [
        f"N = (BX + x2h BZ/f) / (x1h - x2h), N2 = N + BZ/f, B = {', '.join(f'{each:g}' for each in base)}; eq. 138",
        "X = N x1h, Y1 = N y1h, Y2 = BY + N2 y2h, Z = -N f",
    ]
    if lies_across(base):
        words = [each.translate(_EXCHANGED) for each in words]
    yield _values()
    yield _points(ids, ("x y z", form, found.xyz), ("gap", form, found.gap))
    yield _matrices("Rotations, by rows", ("left", "right"), np.stack(turned))
    yield _traced("Points", (_TURNED, *words), ids, *_turned_rays(one, other, focal, base, turned))


def _chain(given: keys.TurnedKeys, ids: list[str], degrees: Floats) -> Iterator[Rows]:
    rotations = np.array([from_angles(each, given.angles) for each in np.radians(degrees)])
    handed = steps.chain(rotations[1:], rotations[0])
    yield _values()
    yield _points(ids, _turns(handed, given.angles), of="photo")
    yield _matrices("Given: each photo in the photo before it, by rows", ids, rotations)
    yield _matrices("In the strip, by rows", ids, handed, "A(i+1) = A(i) A(i, i+1); eq. 131-134")


def _scale(_given: keys.StepKeys, ids: list[str], first: Floats, second: Floats, weights: Floats) -> Iterator[Rows]:
    """Give the factor of the second model, and what each point departs from it, in parts of a million."""
    factor, departures = steps.scale_transfer(first, second, weights[:, 0])
    yield _values(("k", "", factor), ("rms departure", "ppm", np.sqrt((departures**2).mean()) * MILLION))
    yield _points(ids, ("departure", "ppm 1", departures * MILLION))
    before, after = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    mean, weight = ("weighted mean", [("weight", " g6", weights)]) if np.ptp(weights) else ("mean", [])
    words = f"k_t = D / D' from the common perspective centre; k = {factor:.9g}, their {mean}; eq. 139-141"
    distances = ("D", " 6", before), ("D'", " 6", after), ("k_t", " 7", before / after)
    yield _traced("Points", (words,), ids, *distances, *weight)


def _strip(given: keys.StripKeys, photos: Sequence[str], points: Sequence[str], rays: Rays) -> Iterator[Rows]:
    """Give the photos of a strip, the scale factors of its models, and the points that have a place."""
    transfer: Any = given.scale_transfer
    focal, base, names = given.principal_distance, given.base, (photos, points)
    found = steps.strip(rays, focal, base=base, scale_transfer=transfer, names=names)
    yield _values(("; ".join(f"k {left}-{right}" for left, right in pairwise(photos)), "", found.factors))
    yield _photos(photos, found, given.unit, given.angles)
    placed = np.flatnonzero(found.models)
    xyz = ("x y z", f"{given.unit} 4", found.points[placed])
    yield _points([points[n] for n in placed.tolist()], xyz, ("models", "count", found.models[placed]))
    words = "B = k A (bx, by, bz) with A of the left photo; X = S + k (x, y, z); eq. 134-141"
    rows: list[Columns] = [("k", " 7", found.factors), ("sigma0", "um 2", found.sigma0 * MICROMETRES)]
    rows.append(("BX BY BZ", " 4", np.diff(found.centers, axis=0)))
    yield _traced("Models", (words,), [f"{left} - {right}" for left, right in pairwise(photos)], *rows)
    yield _matrices("Rotations A, photo to strip, by rows", photos, found.rotations)


def _absolute(
    given: keys.AbsoluteKeys, ids: list[str], model: Floats, ground: Floats, weights: Floats
) -> Iterator[Rows]:
    found, unit = steps.absolute(model, ground, weights[:, 0]), given.unit
    scale, rotation, shift = found.similarity.scale, found.similarity.rotation, found.similarity.shift
    turns = _angles(rotation, given.angles, "xi; eta; theta")
    shifts = ("shift x; shift y; shift z", unit, shift)
    yield _values(("scale", "", scale), shifts, turns, *_fit(found.sigma0, unit, found.redundancy))
    yield _points(ids, ("vx vy vz", f"{unit} 4", found.residuals))
    centre, place = (np.average(each, axis=0, weights=weights[:, 0]) for each in (model, ground))
    yield _traced("Centroids", (), ["model xm", "ground Xm"], ("x y z", " 4", np.stack([centre, place])))
    yield _matrices("Rotation R, by rows", ("R",), rotation)
    words = f"X' = s R (x - xm) with s = {scale:.9g}; v = X' - (X - Xm); the shift is Xm - s R xm"
    moved = np.hstack([ground - place, scale * (model - centre) @ rotation.T])
    rows = ("x-xm y-ym z-zm", " 4", model - centre), ("X-Xm Y-Ym Z-Zm X' Y' Z'", f"{unit} 4", moved)
    yield _traced("Points", (words,), ids, *rows)


def _polynomial(given: keys.PolynomialKeys, ids: list[str], xyz: Floats, misclosures: Floats) -> Iterator[Rows]:
    terms, measured = list(map(str, given.terms)), misclosures[:, 0]
    coefficients, left = steps.polynomial(xyz, measured, terms)
    redundancy = len(ids) - len(terms)
    fit = _fit(sigma0_of(left, redundancy), given.unit, redundancy)
    yield _values(("; ".join(terms), f" {WHOLE}", coefficients), *fit)
    yield _points(ids, ("v", f"{given.unit} 4", left))
    equation = " + ".join(f"{value:.8g} {term}" for value, term in zip(coefficients, terms, strict=True))
    parts = ("misclosure polynomial v", " 4", np.column_stack([measured, measured - left, left]))
    words = f"polynomial = {equation}", "v = misclosure - polynomial; eq. 151"
    yield _traced("Points", words, ids, (" ".join(terms), " e5", term_columns(xyz, terms)), parts)


def _resection(given: keys.ResectionKeys, ids: list[str], xy: Floats, ground: Floats) -> Iterator[Rows]:
    focal, unit = given.principal_distance, given.unit
    found = steps.resection(xy, ground, focal, sigma=given.sigma_um / 1000.0)
    place = ("x; y; z", unit, found.center, np.sqrt(np.diag(found.covariance)[:3]))
    yield _values(place, _angles(found.rotation, given.angles), *_fit(found.sigma0, "", found.redundancy))
    yield _points(ids, ("vx vy", "um 2", found.residuals * MICROMETRES))
    photo = np.zeros(len(xy), np.intp)
    seen: list[tuple[float, Floats, Floats]] = []

    def watch(before: KnownPhotos, step: Floats) -> None:
        seen.append((float(((xy - project(ground, before, photo)) ** 2).sum()), before.centers[0], step[0]))

    center, rotation = approximate(xy, ground, focal)
    resect(xy, ground, photo, KnownPhotos(center[None], rotation[None], np.array([focal])), watch)
    squares, centers, added = map(np.array, zip(*seen, strict=True))
    words, states = "Step 1 starts from three points in closed form.", ("[vv]", "mm^2 e4", squares)
    yield _iterations("Centre before each step", words, states, ("X0 Y0 Z0", f"{unit} 4", centers))
    shift = ("dX0 dY0 dZ0", f"{unit} e2", added[:, :3])
    turn = ("turn_X turn_Y turn_Z", "deg e2", np.degrees(added[:, 3:]))
    yield _iterations("What the step adds", "(J'J)^-1 J'v, J the derivatives of x' and y'", shift, turn)
    yield _matrices("Rotation R, photo to ground, by rows", ("R",), found.rotation)
    rays = _images(xy, ground - found.center, found.rotation, focal, unit)
    yield _traced("Points", (_COLLINEAR,), ids, *rays)


def _bundle(given: keys.BundleKeys, photos: Sequence[str], points: Sequence[str], rays: Rays) -> Iterator[Rows]:
    """Give adjusted photos, and points with their precision and what they differ from given coordinates."""
    focal, unit, ground = given.principal_distance, given.unit, None
    if given.control is not None:
        ids, known = read_step(str(given.control), CONTROL_OF_BUNDLE)
        at = dict(zip(ids, known, strict=True))
        ground = np.array([at.get(point, np.full(3, np.nan)) for point in points])
    sigma, names = given.sigma_um / 1000.0, (photos, points)
    found = steps.bundle(
        rays, focal, ground=ground, base=given.base, sigma=sigma, ground_sigma=given.control_sigma, names=names
    )
    yield _values(*_fit(found.sigma0, "", found.redundancy), ("iterations", "", found.iterations))
    yield _photos(photos, found, unit, given.angles)
    placed, form = np.flatnonzero(np.isfinite(found.points[:, 0])), f"{unit} 4"
    rows = [("x y z", form, found.points[placed]), ("sigma_x sigma_y sigma_z", form, found.sigmas[placed])]
    if ground is not None:
        rows.append(("dx dy dz", form, (found.points - ground)[placed]))
    yield _points([points[n] for n in placed.tolist()], *rows)
    named = {"[pvv]": " e4", "length": "sigma e2", "shift": f"{unit} e2", "turn": "deg e2"}
    taken = np.array([(each.chi_square, each.length, each.shift, np.degrees(each.turn)) for each in found.steps])
    states = [(name, form, column) for (name, form), column in zip(named.items(), taken.T, strict=True)]
    words = "[pvv] before the step; its length in standard deviations; the largest shift and turn\nA'PA dx = A'Pv"
    yield _iterations("Steps of all photos and points", words, *states)
    yield _matrices("Rotations R, photo to ground, by rows", photos, found.rotations)
    photo, point, xy = (each[np.isfinite(found.residuals[:, 0])] for each in of_rays(rays))
    images = _images(xy, found.points[point] - found.centers[photo], found.rotations[photo], focal, unit)
    ids = [f"{photos[one]} {points[other]}" for one, other in zip(photo, point, strict=True)]
    yield _traced("Rays", (_COLLINEAR,), ids, *images)


def _frame(given: keys.FrameKeys, ids: list[str], geodetic: Floats) -> Iterator[Rows]:
    """Give points in the intermediate frame, its origin, and in the trace its axes and the way back."""
    turned = np.column_stack([np.radians(geodetic[:, :2]), geodetic[:, 2]])
    ellipsoid = semi_axes(given.ellipsoid) or WGS84
    found = steps.frame(turned, azimuth=radians(given.azimuth), ellipsoid=ellipsoid)
    origin = ("origin X; origin Y; origin Z", f"m {WHOLE}", found.frame.origin)
    yield _values(origin, ("A0", "deg", given.azimuth))
    yield _points(ids, ("X Y Z", "m 4", found.points))
    words = "columns: X in the azimuth A0, Y, Z; eq. 143"
    yield _matrices("Axes M, geocentric, by rows", ("M",), found.frame.axes, words)
    back = geodetic_from_geocentric(found.frame.cartesian_from_intermediate(found.points), ellipsoid)
    words = "X = M' (X_G - X_0), X_0 their mean; eq. 144; longitude, latitude, height: back by X_0 + M X, eq. 152"
    rows: list[Columns] = [("X_G Y_G Z_G", "m 4", found.geocentric)]
    rows += [("longitude latitude", "deg 9", np.degrees(back[:, :2])), ("height", "m 4", back[:, 2])]
    yield _traced("Points: geocentric, and back", (words,), ids, *rows)


def _curvature(given: keys.CurvatureKeys, ids: list[str], xyz: Floats) -> Iterator[Rows]:
    radius, height = given.radius_of_strip, xyz[:, 2]
    fall = steps.curvature(xyz, radius=radius)
    distance = np.hypot(*(xyz[:, :2] - xyz[:, :2].mean(axis=0)).T)
    yield _values(("R", "m", radius))
    falls = ("D2/2R reduced raised", "m 4", np.column_stack([fall, height - fall, height + fall]))
    yield _points(ids, ("D", "m 1", distance), falls)
    words = "reduced: z of control before the strip; raised: z of results after; eq. 153"
    yield _equations(f"D from the middle of the points; {words}")


def _pair_scales(given: keys.PairScalesKeys, ids: list[str], model: Floats, ground: Floats) -> Iterator[Rows]:
    """Give distances of all pairs in both systems, the scale r, and what is left of the scale s by it."""
    found = steps.pair_scales(model, ground)
    left = [("t", "", steps.absolute(model, ground).similarity.scale / found.mean)] if len(ids) > 2 else []
    yield _values(("r", "", found.mean), *left)
    names = [f"{ids[one]} - {ids[other]}" for one, other in zip(found.first, found.second, strict=True)]
    distances = ("D", " 4", found.source), ("D_G", f"{given.unit} 4", found.target)
    yield _points(names, *distances, ("r", " g9", found.target / found.source), of="pair")
    yield _equations("r = sum of D_G over sum of D, eq. 147, 148; the scale of the absolute orientation is s = r t")


def _closed_form(given: keys.ClosedFormKeys, ids: list[str], points: Floats) -> Iterator[Rows]:
    _, control = read_step(str(given.control), STEPS["closed-form"][1])
    found = steps.closed_form(points, control, given.principal_distance, given.base, as_printed=given.as_printed)
    yield _values(("; ".join(f"c{number}" for number in range(1, len(found.sums) + 1)), f" {WHOLE}", found.sums))
    errors = (" ".join(ORDER), "ratio g7", found.coefficients.reshape(-1, len(ORDER)))
    yield _points([f"{point} {axis}" for point in ids for axis in "xyz"], errors, of="error of")
    words = "less what the control takes back, mm/mm, mm/rad; eq. 9, 10, 11"
    yield _equations(f"Error of a point per error of an element, {words}")


def _deformation(given: keys.DeformationKeys, ids: list[str], xy: Floats, dz: Floats) -> Iterator[Rows]:
    """Give the coefficients of the surface, t of twist and bending, the elements behind them, and what is left."""
    heights = dz[:, 0]
    found = steps.deformation(xy, heights, sigma=given.sigma)
    turns = np.degrees(found.elements(given.scale / 1000, given.base))  # dz in metres, the base in mm
    yield _values(
        ("; ".join(DEFORMATION_TERMS), f" {WHOLE}", found.coefficients, found.sigmas),
        ("t of C; t of D", "", found.t_values),
        ("critical t, 5 %", "", found.critical()),
        *_fit(found.sigma0 * given.sigma, "m", found.redundancy),
        ("domega2'; dalpha2' - dalpha1'", "deg", turns),
    )
    fitted = paraboloid_rows(xy) @ found.coefficients
    yield _points(ids, ("dz surface v", "m 4", np.column_stack([heights, fitted, heights - fitted])))
    words = "domega2' = -C b/m, dalpha2' - dalpha1' = -D b/m; eq. 10.12"
    yield _equations(f"surface = E0 + A x + B y + C x y + D x^2; {words}")


def _values(*groups: tuple[Any, ...]) -> Rows:
    """Return numbers under their names: names with semicolons, unit and if need be form, numbers, deviations."""
    values, facts = [], []
    for names, form, numbers, *sigmas in groups:
        unit, _, digits = form.partition(" ")
        deviations = sigmas[0].tolist() if sigmas else [None] * len(names.split("; "))
        for name, value, sigma in zip(names.split("; "), np.atleast_1d(numbers).tolist(), deviations, strict=True):
            deviation = "" if sigma is None else f" ± {_digits(sigma, unit, digits and 'g4')}"
            text = f"{_digits(value, unit, digits)}{deviation} {unit}".rstrip() if isfinite(value) else DASH
            values.append((name, value, unit, sigma))
            facts.append((name, text))
    columns = [Field(key, form, shown=False) for key, form in VALUE]
    return Rows("values", "", columns, values, above=[Facts(tuple(facts))] if facts else [])


def _digits(value: float, unit: str, digits: str) -> str:
    """Return a number in its form, else with decimals, or with digits where decimals would show nothing of it."""
    if digits or isinstance(value, int) or not isfinite(value):
        return written(value, f" {digits}")
    decimals = 6 if unit == "deg" else 4
    return f"{value:z.{decimals}f}" if abs(value) >= 10.0 ** (2 - decimals) else f"{value:.4g}"


def _rows(key: str, title: str, ids: Iterable[str], columns: Sequence[Columns], of: str = "", **more: Any) -> Rows:  # noqa: ANN401
    """Put columns together; those of several names are one array."""
    filled = [
        (Field(name, form, name), column)
        for names, form, values in columns
        for name, column in zip(names.split(), np.atleast_2d(np.asarray(values).T), strict=True)
    ]
    return table(key, title, [(Field(of or "id", head=of), list(ids)), *filled], **more)


def _points(ids: Iterable[str], *columns: Columns, of: str = "point") -> Rows:
    """Return the table that is the CSV."""
    return _rows("points", "", ids, columns, of)


def _traced(title: str, words: Sequence[str], ids: Iterable[str], *columns: Columns) -> Rows:
    """Put columns together under a title and equations, for the trace."""
    key = re.sub(r"[^a-z0-9]+", "_", re.split(r"[:,]", title.lower())[0])
    return _rows(f"{TRACE}{key}", title, ids, columns, above=words, exact=True)


def _iterations(title: str, words: str, *columns: Columns) -> Rows:
    return _traced(title, words.splitlines(), [str(n + 1) for n in range(len(np.asarray(columns[0][2])))], *columns)


def _matrices(title: str, ids: Sequence[str], rotations: Floats, *words: str) -> Rows:
    """Return rotation matrices, each as three rows."""
    names = [f"{name} {row}" for name in ids for row in "abc"]
    return _traced(title, words, names, ("1 2 3", "ratio 8", rotations.reshape(-1, 3)))


def _equations(words: str) -> Rows:
    return Rows(f"{TRACE}equations", "Equations", (), (), above=[words])


def _fit(sigma0: float, unit: str, redundancy: int) -> list[tuple[Any, ...]]:
    return [("sigma0", unit, sigma0), ("redundancy", "", redundancy)]


def _angles(rotation: Floats, system: str, textbook: str = "") -> tuple[Any, ...]:
    """Return the angles of a rotation; `textbook`: their names in the system of the source."""
    names = textbook if textbook and system == TEXTBOOK else system.replace("-", "; ")
    return names, "deg", np.degrees(angles(rotation, system))


def _turns(rotations: Floats, system: str) -> Columns:
    return system.replace("-", " "), "deg 6", np.degrees(angles(rotations, system))


def _photos(photos: Sequence[str], found: Strip | Bundle, unit: str, system: str) -> Rows:
    columns = ("x y z", f"{unit} 4", found.centers), _turns(found.rotations, system)
    return _rows("photos", "", photos, columns, "photo")


def _turned_rays(
    left: Floats, right: Floats, focal: float, base: Floats, rotations: tuple[Floats, Floats]
) -> list[Columns]:
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
    meeting = np.column_stack([factor * one[across], base[across] + other * two[across]])
    return [
        ("x1h y1h x2h y2h", "mm 4", np.vstack(turned).T),
        ("N", " 6", factor),
        *([("N2", " 6", other)] if base[2] else []),
        ("X1 X2" if across == 0 else "Y1 Y2", " 4", meeting),
    ]


def _images(xy: Floats, arms: Floats, rotations: Floats, focal: float, unit: str) -> list[Columns]:
    """Return points from the centre, turned into the photo, their images, and the measured ones."""
    seen = np.einsum("...ji,...j->...i", rotations, arms)
    computed = -focal * seen[:, :2] / seen[:, 2:]
    return [("u v w", f"{unit} 4", seen), ("x' y'", "mm 4", computed), ("x y", "mm 4", xy)]


def _linear(coefficients: Iterable[float]) -> str:
    """Write a linear form of x, y, x y and 1."""
    terms = zip(coefficients, (" x", " y", " x y", ""), strict=True)
    return " + ".join(f"{value:.10g}{name}" for value, name in terms if value).replace("+ -", "- ") or "0"
