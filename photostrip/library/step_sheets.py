"""Single steps as sheets: values with their units, a table of points, and how the numbers come about.

A trace shows the equations, the iterations, and each point on its way through them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.camera import Camera
from photostrip.geometry.rotation import angles, from_alpha_omega_kappa
from photostrip.library.step_arguments import Rays, of_rays, sigma0_of
from photostrip.library.steps import Absolute, Bundle, Interior, Relative, Strip, one_pair
from photostrip.report.page.parts import DASH, Facts
from photostrip.sheets.replay import first_rounds
from photostrip.sheets.sheet import Field, Rows, Sheet, by_columns
from photostrip.strip.corrections import Bending, undistort
from photostrip.strip.intersection import Intersection, lies_across
from photostrip.strip.polynomial_terms import columns as design_columns
from photostrip.strip.relative_orientation.solution import ELEMENTS
from photostrip.strip.resection import KnownPhotos, OrientedPhoto, approximate, project, resect
from photostrip.units import MICROMETRES

Trace = list[Rows]
Column = tuple[Field, ArrayLike]
Value = tuple[str, float, str, float | None, bool]  # name, number, unit, standard deviation, all digits shown

MILLION = 1e6
DIGITS = 10  # of values: more than any measurement has
SYSTEM = "omega-phi-kappa"
TITLES = {
    "interior": "Interior orientation",
    "refine": "Refined image coordinates",
    "relative": "Relative orientation",
    "intersection": "Space intersection",
    "chain": "Orientation handed on along a strip",
    "scale": "Scale transfer",
    "strip": "Strip in model coordinates",
    "absolute": "Absolute orientation",
    "polynomial": "Polynomial",
    "resection": "Space resection",
    "bundle": "Bundle adjustment",
}

_COLLINEAR = "(u, v, w) = R' (X - X0); x' = -f u/w, y' = -f v/w; v = x - x'"
_EXCHANGED = str.maketrans("XxYy", "YyXx")  # where the base lies along Y
_TURNED = "(u, v, w) = R (x, y, -f); xh = -f u/w, yh = -f v/w; eq. 137"


def interior(ids: Sequence[str], found: Interior) -> Sheet:
    """Return an interior orientation: the coefficients of both axes, and the residuals of the marks."""
    names = ("x", "y", "x y", "1")
    rows = zip(("x", "y", "denominator"), found.transform.coefficients, strict=True)
    values = [
        _value(f"{axis}: {term}", c, whole=True) for axis, row in rows for term, c in zip(names, row, strict=True) if c
    ]
    values += _fit(found.sigma0 * MICROMETRES, "um", found.redundancy)
    return _sheet("interior", values, ids, _image_residuals(found.residuals), of="mark")


def refine(ids: Sequence[str], measured: Floats, refined: Floats) -> Sheet:
    """Return ideal image coordinates, and what was corrected; the principal point is part of it."""
    shift = (refined - measured) * MICROMETRES
    return _sheet("refine", [], ids, [*columns("x y", "mm 4", refined), *columns("dx dy", "um 1", shift)])


def relative(ids: Sequence[str], found: Relative, base: float, unit: str) -> Sheet:
    """Return a relative orientation: relative to the base; base and right photo in the left one; the model."""
    degrees = zip(ELEMENTS, np.degrees(found.elements), np.degrees(found.sigmas), strict=True)
    values = [_value(name, value, "deg", sigma) for name, value, sigma in degrees]
    values += [_value(name, base * each, unit) for name, each in zip(("bx", "by", "bz"), found.base, strict=True)]
    values += _angles(found.rotation)
    values += _fit(found.sigma0 * MICROMETRES, "um", len(ids) - len(ELEMENTS))
    listed: list[Column] = [(Field("q", "um 2"), found.parallax * MICROMETRES)]
    listed += columns("x y z", f"{unit} 4", found.model)
    return _sheet("relative", [*values, _value("iterations", found.iterations)], ids, listed)


def intersection(ids: Sequence[str], found: Intersection, unit: str) -> Sheet:
    """Return intersected points, and the gap between the rays."""
    listed: list[Column] = [*columns("x y z", f"{unit} 4", found.xyz), (Field("gap", f"{unit} 4"), found.gap)]
    return _sheet("intersection", [], ids, listed)


def strip(photos: Sequence[str], points: Sequence[str], found: Strip, unit: str) -> Sheet:
    """Return the photos of a strip, the scale factors of its models, and the points that have a place."""
    factors = zip(pairwise(photos), found.factors, strict=True)
    values = [_value(f"k {left}-{right}", factor) for (left, right), factor in factors]
    placed = np.flatnonzero(found.models)
    listed: list[Column] = [*columns("x y z", f"{unit} 4", found.points[placed])]
    listed.append((Field("models", "count"), found.models[placed]))
    return _sheet("strip", values, [points[n] for n in placed.tolist()], listed, _photos(photos, found, unit))


def bundle(photos: Sequence[str], points: Sequence[str], found: Bundle, ground: Floats | None, unit: str) -> Sheet:
    """Return adjusted photos, and points with their precision and what they differ from given coordinates."""
    values = [*_fit(found.sigma0, "", found.redundancy), _value("iterations", found.iterations)]
    placed = np.flatnonzero(np.isfinite(found.points[:, 0]))
    listed = columns("x y z", f"{unit} 4", found.points[placed])
    listed += columns("sigma_x sigma_y sigma_z", f"{unit} 4", found.sigmas[placed])
    if ground is not None:
        listed += columns("dx dy dz", f"{unit} 4", (found.points - ground)[placed])
    return _sheet("bundle", values, [points[n] for n in placed.tolist()], listed, _photos(photos, found, unit))


def absolute(ids: Sequence[str], found: Absolute, unit: str) -> Sheet:
    """Return an absolute orientation: seven parameters, and the residuals of the points."""
    similarity = found.similarity
    values = [_value("scale", similarity.scale)]
    values += [_value(f"shift {axis}", each, unit) for axis, each in zip("xyz", similarity.shift, strict=True)]
    values += _angles(similarity.rotation)
    values += _fit(found.sigma0, unit, found.redundancy)
    return _sheet("absolute", values, ids, columns("vx vy vz", f"{unit} 4", found.residuals))


def chain(ids: Sequence[str], rotations: Floats) -> Sheet:
    """Return the angles of the photos in the strip."""
    return _sheet("chain", [], ids, _turns(rotations), of="photo")


def scale(ids: Sequence[str], factor: float, departures: Floats) -> Sheet:
    """Return the factor of the second model, and what each point departs from it, in parts of a million."""
    rms = float(np.sqrt((departures**2).mean()))
    values = [_value("k", factor), _value("rms departure", rms * MILLION, "ppm")]
    return _sheet("scale", values, ids, [(Field("departure", "ppm 1"), departures * MILLION)])


def polynomial(ids: Sequence[str], terms: Sequence[str], coefficients: Floats, residuals: Floats, unit: str) -> Sheet:
    """Return the coefficients of a polynomial, and what it leaves."""
    values = [_value(term, coefficient, whole=True) for term, coefficient in zip(terms, coefficients, strict=True)]
    redundancy = len(ids) - len(values)
    values += _fit(sigma0_of(residuals, redundancy), unit, redundancy)
    return _sheet("polynomial", values, ids, [(Field("v", f"{unit} 4"), residuals)])


def resection(ids: Sequence[str], found: OrientedPhoto, unit: str) -> Sheet:
    """Return the orientation of a photo with its precision, and the image residuals."""
    sigma = np.sqrt(np.diag(found.covariance))
    values = [_value(axis, found.center[k], unit, sigma[k]) for k, axis in enumerate("xyz")]
    values += _angles(found.rotation)
    values += _fit(found.sigma0, "", found.redundancy)
    return _sheet("resection", values, ids, _image_residuals(found.residuals))


def _value(name: str, value: float, unit: str = "", sigma: float | None = None, *, whole: bool = False) -> Value:
    """Return a value; one that multiplies what is larger than the result is good for is shown as it stands."""
    return name, value, unit, sigma, whole


def _fit(sigma0: float, unit: str, redundancy: int) -> list[Value]:
    return [_value("sigma0", sigma0, unit), _value("redundancy", redundancy)]


def _angles(rotation: Floats) -> list[Value]:
    turned = np.degrees(angles(rotation, SYSTEM))
    return [_value(name, value, "deg") for name, value in zip(SYSTEM.split("-"), turned, strict=True)]


def _image_residuals(residuals: Floats) -> list[Column]:
    return columns("vx vy", "um 2", residuals * MICROMETRES)


def _turns(rotations: Floats) -> list[Column]:
    turned = np.degrees(np.array([angles(each, SYSTEM) for each in rotations]))
    return columns(SYSTEM.replace("-", " "), "deg 6", turned)


def _photos(photos: Sequence[str], found: Strip | Bundle, unit: str) -> Rows:
    return _rows(
        "photos", "", photos, [*columns("x y z", f"{unit} 4", found.centers), *_turns(found.rotations)], "photo"
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
    return Sheet(step, TITLES[step], (), [stated, *more, points], main="points")


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


def _rows(key: str, title: str, ids: Iterable[str], listed: Sequence[Column], of: str = "") -> Rows:
    first = Field(of or "id", head=of)
    return Rows(
        key, title, (first, *(field for field, _ in listed)), by_columns(ids, *(values for _, values in listed))
    )


# -------------------------------------------------------------------------------------------------------------- traces


def trace_interior(ids: Sequence[str], measured: Floats, calibrated: Floats, found: Interior) -> Trace:
    """Show the coordinates of the marks on their way from the comparator to the photo."""
    (x, y, below), photo = found.transform.coefficients.tolist(), found.transform(measured)
    equations = [f"x' = {_linear(x)}", f"y' = {_linear(y)}"]
    if below != [0.0, 0.0, 0.0, 1.0]:
        equations = [f"{each.replace('= ', '= (')}) / ({_linear(below)})" for each in equations]
    rows = [*columns("x y", " 4", measured), *columns("x' y'", "mm 4", photo)]
    return [
        _table("Marks", ids, [*rows, *columns("given_x given_y", "mm 4", calibrated)], "v = x' - given", *equations)
    ]


def trace_refine(ids: Sequence[str], measured: Floats, refined: Floats, camera: Camera) -> Trace:
    """Show what the principal point, the lens and refraction each do."""
    central = measured - np.asarray(camera.principal_point)
    lens = undistort(measured, camera, Bending()) - central
    bent = refined - central - lens
    rows = columns("x-x0 y-y0", "mm 4", central)
    rows += [(Field("r", "mm 3"), np.hypot(*central.T)), *columns("lens_x lens_y", "um 2", lens * MICROMETRES)]
    rows += [*columns("refr_x refr_y", "um 2", bent * MICROMETRES), *columns("x' y'", "mm 4", refined)]
    return [_table("Corrections, one after the other", ids, rows, "x' = x - x0 + lens + refraction")]


def trace_relative(
    ids: Sequence[str], left: Floats, right: Floats, focal: float, found: Relative, base: float
) -> Trace:
    """Show the iteration of the elements, and each point from the image to the model."""
    (rounds,) = first_rounds(one_pair(left, right, focal), found.elements[None])
    elements, added = (np.degrees([getattr(each, name) for each in rounds.steps]) for name in ("elements", "step"))
    squares: list[Column] = [(Field("[qq]", "mm^2 e4"), [each.squares for each in rounds.steps])]
    before, changes = columns(" ".join(ELEMENTS), "deg 6", elements), columns(" ".join(ELEMENTS), "deg e2", added)
    alpha1, kappa1, alpha2, omega2, kappa2 = found.elements
    rotations = from_alpha_omega_kappa(alpha1, 0.0, kappa1), from_alpha_omega_kappa(alpha2, omega2, kappa2)
    points = _table(
        "Points: photos turned into the base frame, and the model",
        ids,
        _rays(left, right, focal, np.array([base, 0.0, 0.0]), rotations),
        _TURNED,
        f"q = y1h - y2h; N = B / (x1h - x2h) with B = {base:g}; X = N x1h, Y = N (y1h + y2h)/2, Z = -N f",
    )
    return [
        _table("Elements before each step", _numbers(squares), [*squares, *before], "eq. 131-137"),
        _table("What the step adds", _numbers(squares), changes, "-(J'J)^-1 J'q, J the derivatives of q"),
        _matrices("Rotations to the base frame, by rows", ("left", "right"), np.stack(rotations)),
        points,
    ]


def trace_intersection(
    ids: Sequence[str], images: tuple[Floats, Floats], focal: float, base: Floats, rotations: tuple[Floats, Floats]
) -> Trace:
    """Show each point from the image to the model."""
    words = [
        f"N = (BX + x2h BZ/f) / (x1h - x2h), N2 = N + BZ/f, B = {', '.join(f'{each:g}' for each in base)}; eq. 138",
        "X = N x1h, Y1 = N y1h, Y2 = BY + N2 y2h, Z = -N f",
    ]
    if lies_across(base):
        words = [each.translate(_EXCHANGED) for each in words]
    found = _table("Points", ids, _rays(*images, focal, base, rotations), _TURNED, *words)
    return [_matrices("Rotations, by rows", ("left", "right"), np.stack(rotations)), found]


def trace_absolute(ids: Sequence[str], model: Floats, ground: Floats, found: Absolute, unit: str) -> Trace:
    """Show the points reduced to their centroids, and turned."""
    similarity, centre, place = found.similarity, model.mean(axis=0), ground.mean(axis=0)
    reduced, wanted = model - centre, ground - place
    turned = similarity.scale * reduced @ similarity.rotation.T
    rows = [*columns("x-xm y-ym z-zm", " 4", reduced), *columns("X-Xm Y-Ym Z-Zm", f"{unit} 4", wanted)]
    rows += columns("X' Y' Z'", f"{unit} 4", turned)
    words = f"X' = s R (x - xm) with s = {similarity.scale:.9g}; v = X' - (X - Xm); the shift is Xm - s R xm"
    means = np.stack([centre, place])
    return [
        _table("Centroids", ["model xm", "ground Xm"], columns("x y z", " 4", means)),
        _matrices("Rotation R, by rows", ("R",), similarity.rotation),
        _table("Points", ids, rows, words),
    ]


def trace_resection(
    ids: Sequence[str], xy: Floats, ground: Floats, focal: float, found: OrientedPhoto, unit: str
) -> Trace:
    """Show the start in closed form, the iteration, and each ray."""
    photo = np.zeros(len(xy), np.intp)
    seen: list[tuple[float, Floats, Floats]] = []

    def watch(before: KnownPhotos, step: Floats) -> None:
        seen.append((float(((xy - project(ground, before, photo)) ** 2).sum()), before.centers[0], step[0]))

    center, rotation = approximate(xy, ground, focal)
    resect(xy, ground, photo, KnownPhotos(center[None], rotation[None], np.array([focal])), watch)
    squares, centers, added = zip(*seen, strict=True)
    steps: list[Column] = [(Field("[vv]", "mm^2 e4"), squares), *columns("X0 Y0 Z0", f"{unit} 4", np.array(centers))]
    changes = columns("dX0 dY0 dZ0", f"{unit} e2", np.array(added)[:, :3])
    changes += columns("turn_X turn_Y turn_Z", "deg e2", np.degrees(added)[:, 3:])
    rays = _images(xy, ground - found.center, found.rotation, focal, unit)
    return [
        _table("Centre before each step", _numbers(steps), steps, "Step 1 starts from three points in closed form."),
        _table("What the step adds", _numbers(steps), changes, "(J'J)^-1 J'v, J the derivatives of x' and y'"),
        _matrices("Rotation R, photo to ground, by rows", ("R",), found.rotation),
        _table("Points", ids, rays, _COLLINEAR),
    ]


def trace_chain(ids: Sequence[str], given: Floats, handed: Floats) -> Trace:
    """Show the matrices that are multiplied."""
    return [
        _matrices("Given: each photo in the photo before it, by rows", ids, given),
        _matrices("In the strip, by rows", ids, handed, "A(i+1) = A(i) A(i, i+1); eq. 131-134"),
    ]


def trace_strip(photos: Sequence[str], found: Strip) -> Trace:
    """Show what each model adds to the strip."""
    pairs = [f"{left} - {right}" for left, right in pairwise(photos)]
    bases = np.diff(found.centers, axis=0)
    rows: list[Column] = [(Field("k", " 7"), found.factors), (Field("sigma0", "um 2"), found.sigma0 * MICROMETRES)]
    words = "B = k A (bx, by, bz) with A of the left photo; X = S + k (x, y, z); eq. 134-141"
    return [
        _table("Models", pairs, [*rows, *columns("BX BY BZ", " 4", bases)], words),
        _matrices("Rotations A, photo to strip, by rows", photos, found.rotations),
    ]


def trace_bundle(
    photos: Sequence[str], points: Sequence[str], rays: Rays, focal: float, found: Bundle, unit: str
) -> Trace:
    """Show the iteration, and each ray."""
    steps: list[Column] = [(Field("[pvv]", " e4"), [each.chi_square for each in found.steps])]
    steps += [(Field("length", "sigma e2"), [each.length for each in found.steps])]
    steps += [(Field("shift", f"{unit} e2"), [each.shift for each in found.steps])]
    steps += [(Field("turn", "deg e2"), np.degrees([each.turn for each in found.steps]))]
    taken = np.isfinite(found.residuals[:, 0])
    photo, point, xy = of_rays(rays)
    photo, point = photo[taken], point[taken]
    ids = [f"{photos[one]} {points[other]}" for one, other in zip(photo, point, strict=True)]
    arms = found.points[point] - found.centers[photo]
    words = "[pvv] before the step; its length in standard deviations; the largest shift and turn"
    return [
        _table("Steps of all photos and points", _numbers(steps), steps, words, "A'PA dx = A'Pv"),
        _matrices("Rotations R, photo to ground, by rows", photos, found.rotations),
        _table("Rays", ids, _images(xy[taken], arms, found.rotations[photo], focal, unit), _COLLINEAR),
    ]


def trace_scale(ids: Sequence[str], first: Floats, second: Floats, factor: float) -> Trace:
    """Show the distances and the ratio of each point."""
    before, after = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    rows: list[Column] = [(Field("D", " 6"), before), (Field("D'", " 6"), after), (Field("k_t", " 7"), before / after)]
    words = f"k_t = D / D' from the common perspective centre; k = {factor:.9g}, their mean; eq. 139-141"
    return [_table("Points", ids, rows, words)]


def trace_polynomial(
    ids: Sequence[str], xyz: Floats, misclosures: Floats, terms: Sequence[str], found: tuple[Floats, Floats]
) -> Trace:
    """Show the design, what the polynomial is at each point, and what is left."""
    design, (coefficients, left) = design_columns(xyz, terms), found
    rows: list[Column] = [(Field(term, " e5"), design[:, k]) for k, term in enumerate(terms)]
    rows += [
        (Field("misclosure", " 4"), misclosures),
        (Field("polynomial", " 4"), misclosures - left),
        (Field("v", " 4"), left),
    ]
    equation = " + ".join(f"{value:.8g} {term}" for value, term in zip(coefficients, terms, strict=True))
    return [_table("Points", ids, rows, f"polynomial = {equation}", "v = misclosure - polynomial; eq. 151")]


def _rays(left: Floats, right: Floats, focal: float, base: Floats, rotations: tuple[Floats, Floats]) -> list[Column]:
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


def _table(title: str, ids: Iterable[str], listed: Sequence[Column], *words: str) -> Rows:
    """Put columns together under a title and equations."""
    key = re.sub(r"[^a-z0-9]+", "_", re.split(r"[:,]", title.lower())[0])
    rows = _rows(f"trace_{key}", title, ids, listed)
    return Rows(rows.key, title, rows.fields, rows.rows, above=words, exact=True)
