"""How the numbers of a single step come about: its equations, its iterations, each point on its way through them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats
from photostrip.camera import Camera
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.library.step_arguments import Rays, of_rays
from photostrip.library.step_documents import Column, columns, table
from photostrip.library.steps import Absolute, Bundle, Interior, Relative, Strip, one_pair
from photostrip.notes import Document
from photostrip.result.trace.replay import first_rounds
from photostrip.strip.image_coordinates.corrections import Bending, undistort
from photostrip.strip.polynomial_terms import columns as design_columns
from photostrip.strip.relative_orientation.solution import ELEMENTS
from photostrip.strip.resection import KnownPhotos, OrientedPhoto, approximate, project, resect
from photostrip.strip.strip_formation.intersection import lies_across
from photostrip.units import MICROMETRES

Trace = list[Document]

_COLLINEAR = "(u, v, w) = R' (X - X0); x' = -f u/w, y' = -f v/w; v = x - x'"
_EXCHANGED = str.maketrans("XxYy", "YyXx")  # where the base lies along Y
_TURNED = "(u, v, w) = R (x, y, -f); xh = -f u/w, yh = -f v/w; eq. 137"


def interior(ids: Sequence[str], measured: Floats, calibrated: Floats, found: Interior) -> Trace:
    """Show the coordinates of the marks on their way from the comparator to the photo."""
    (x, y, below), photo = found.transform.coefficients.tolist(), found.transform(measured)
    equations = [f"x' = {_linear(x)}", f"y' = {_linear(y)}"]
    if below != [0.0, 0.0, 0.0, 1.0]:
        equations = [f"{each.replace('= ', '= (')}) / ({_linear(below)})" for each in equations]
    rows = [*columns("x y", "", 4, measured), *columns("x' y'", "mm", 4, photo)]
    return [
        _table("Marks", ids, [*rows, *columns("given_x given_y", "mm", 4, calibrated)], "v = x' - given", *equations)
    ]


def refine(ids: Sequence[str], measured: Floats, refined: Floats, camera: Camera) -> Trace:
    """Show what the principal point, the lens and refraction each do."""
    central = measured - np.asarray(camera.principal_point)
    lens = undistort(measured, camera, Bending()) - central
    bent = refined - central - lens
    rows = columns("x-x0 y-y0", "mm", 4, central)
    rows += [("r", "mm", 3, np.hypot(*central.T)), *columns("lens_x lens_y", "um", 2, lens * MICROMETRES)]
    rows += [*columns("refr_x refr_y", "um", 2, bent * MICROMETRES), *columns("x' y'", "mm", 4, refined)]
    return [_table("Corrections, one after the other", ids, rows, "x' = x - x0 + lens + refraction")]


def relative(ids: Sequence[str], left: Floats, right: Floats, focal: float, found: Relative, base: float) -> Trace:
    """Show the iteration of the elements, and each point from the image to the model."""
    (rounds,) = first_rounds(one_pair(left, right, focal), found.elements[None])
    elements, added = (np.degrees([getattr(each, name) for each in rounds.steps]) for name in ("elements", "step"))
    squares: list[Column] = [("[qq]", "mm^2", -5, [each.squares for each in rounds.steps])]
    before, changes = columns(" ".join(ELEMENTS), "deg", 6, elements), columns(" ".join(ELEMENTS), "deg", -3, added)
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


def intersection(
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


def absolute(ids: Sequence[str], model: Floats, ground: Floats, found: Absolute, unit: str) -> Trace:
    """Show the points reduced to their centroids, and turned."""
    similarity, centre, place = found.similarity, model.mean(axis=0), ground.mean(axis=0)
    reduced, wanted = model - centre, ground - place
    turned = similarity.scale * reduced @ similarity.rotation.T
    rows = [*columns("x-xm y-ym z-zm", "", 4, reduced), *columns("X-Xm Y-Ym Z-Zm", unit, 4, wanted)]
    rows += columns("X' Y' Z'", unit, 4, turned)
    words = f"X' = s R (x - xm) with s = {similarity.scale:.9g}; v = X' - (X - Xm); the shift is Xm - s R xm"
    means = np.stack([centre, place])
    return [
        _table("Centroids", ["model xm", "ground Xm"], columns("x y z", "", 4, means)),
        _matrices("Rotation R, by rows", ("R",), similarity.rotation),
        _table("Points", ids, rows, words),
    ]


def resection(ids: Sequence[str], xy: Floats, ground: Floats, focal: float, found: OrientedPhoto, unit: str) -> Trace:
    """Show the start in closed form, the iteration, and each ray."""
    photo = np.zeros(len(xy), np.intp)
    seen: list[tuple[float, Floats, Floats]] = []

    def watch(before: KnownPhotos, step: Floats) -> None:
        seen.append((float(((xy - project(ground, before, photo)) ** 2).sum()), before.centers[0], step[0]))

    center, rotation = approximate(xy, ground, focal)
    resect(xy, ground, photo, KnownPhotos(center[None], rotation[None], np.array([focal])), watch)
    squares, centers, added = zip(*seen, strict=True)
    steps: list[Column] = [("[vv]", "mm^2", -5, squares), *columns("X0 Y0 Z0", unit, 4, np.array(centers))]
    changes = columns("dX0 dY0 dZ0", unit, -3, np.array(added)[:, :3])
    changes += columns("turn_X turn_Y turn_Z", "deg", -3, np.degrees(added)[:, 3:])
    rays = _images(xy, ground - found.center, found.rotation, focal, unit)
    return [
        _table("Centre before each step", _numbers(steps), steps, "Step 1 starts from three points in closed form."),
        _table("What the step adds", _numbers(steps), changes, "(J'J)^-1 J'v, J the derivatives of x' and y'"),
        _matrices("Rotation R, photo to ground, by rows", ("R",), found.rotation),
        _table("Points", ids, rays, _COLLINEAR),
    ]


def chain(ids: Sequence[str], given: Floats, handed: Floats) -> Trace:
    """Show the matrices that are multiplied."""
    return [
        _matrices("Given: each photo in the photo before it, by rows", ids, given),
        _matrices("In the strip, by rows", ids, handed, "A(i+1) = A(i) A(i, i+1); eq. 131-134"),
    ]


def strip(photos: Sequence[str], found: Strip) -> Trace:
    """Show what each model adds to the strip."""
    pairs = [f"{left} - {right}" for left, right in pairwise(photos)]
    bases = np.diff(found.centers, axis=0)
    rows: list[Column] = [("k", "", 7, found.factors), ("sigma0", "um", 2, found.sigma0 * MICROMETRES)]
    words = "B = k A (bx, by, bz) with A of the left photo; X = S + k (x, y, z); eq. 134-141"
    return [
        _table("Models", pairs, [*rows, *columns("BX BY BZ", "", 4, bases)], words),
        _matrices("Rotations A, photo to strip, by rows", photos, found.rotations),
    ]


def bundle(photos: Sequence[str], points: Sequence[str], rays: Rays, focal: float, found: Bundle, unit: str) -> Trace:
    """Show the iteration, and each ray."""
    steps: list[Column] = [("[pvv]", "", -5, [each.chi_square for each in found.steps])]
    steps += [("length", "sigma", -3, [each.length for each in found.steps])]
    steps += [("shift", unit, -3, [each.shift for each in found.steps])]
    steps += [("turn", "deg", -3, np.degrees([each.turn for each in found.steps]))]
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


def scale(ids: Sequence[str], first: Floats, second: Floats, factor: float) -> Trace:
    """Show the distances and the ratio of each point."""
    before, after = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    rows: list[Column] = [("D", "", 6, before), ("D'", "", 6, after), ("k_t", "", 7, before / after)]
    words = f"k_t = D / D' from the common perspective centre; k = {factor:.9g}, their mean; eq. 139-141"
    return [_table("Points", ids, rows, words)]


def polynomial(
    ids: Sequence[str], xyz: Floats, misclosures: Floats, terms: Sequence[str], found: tuple[Floats, Floats]
) -> Trace:
    """Show the design, what the polynomial is at each point, and what is left."""
    design, (coefficients, left) = design_columns(xyz, terms), found
    rows: list[Column] = [(term, "", -6, design[:, k]) for k, term in enumerate(terms)]
    rows += [("misclosure", "", 4, misclosures), ("polynomial", "", 4, misclosures - left), ("v", "", 4, left)]
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
    rows = columns("x1h y1h x2h y2h", "mm", 4, np.vstack(turned).T)
    rows += [("N", "", 6, factor), *([("N2", "", 6, other)] if base[2] else [])]
    name = "XY"[across]
    rows += [(f"{name}1", "", 4, factor * one[across]), (f"{name}2", "", 4, base[across] + other * two[across])]
    return rows


def _images(xy: Floats, arms: Floats, rotations: Floats, focal: float, unit: str) -> list[Column]:
    """Return points from the centre, turned into the photo, their images, and the measured ones."""
    seen = np.einsum("...ji,...j->...i", rotations, arms)
    computed = -focal * seen[:, :2] / seen[:, 2:]
    return [*columns("u v w", unit, 4, seen), *columns("x' y'", "mm", 4, computed), *columns("x y", "mm", 4, xy)]


def _linear(coefficients: Iterable[float]) -> str:
    """Write a linear form of x, y, x y and 1."""
    terms = zip(coefficients, (" x", " y", " x y", ""), strict=True)
    return " + ".join(f"{value:.10g}{name}" for value, name in terms if value).replace("+ -", "- ") or "0"


def _matrices(title: str, ids: Sequence[str], rotations: Floats, *words: str) -> Document:
    """Return rotation matrices, each as three rows."""
    names = [f"{name} {row}" for name in ids for row in "abc"]
    return _table(title, names, columns("1 2 3", "", 8, rotations.reshape(-1, 3)), *words)


def _numbers(steps: Sequence[Column]) -> list[str]:
    return [str(number) for number in range(1, len(np.asarray(steps[0][3])) + 1)]


def _table(title: str, ids: Sequence[str], listed: Sequence[Column], *words: str) -> Document:
    """Put columns together under a title, equations below it."""
    return {"title": title, "equations": list(words), **table(ids, listed)}
