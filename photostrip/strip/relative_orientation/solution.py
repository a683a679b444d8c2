"""Elements of relative orientation by least squares on the y parallaxes, all pairs in one batch.

The five elements are (alpha1', kappa1', alpha2', omega2', kappa2'), angles of the left and the right photo relative to
the base frame: x' along the base, omega1' = 0. The rays of a point meet when its y parallax in that frame vanishes;
Gauss-Newton steps from the mean direction of the parallaxes, with other azimuths where that leads astray.

Source: [001] for the elements; condition, derivatives, start values and retries are derived.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.strip.relative_orientation.pairs import Pairs

ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")
CONVERGED = 1e-10  # rad
ITERATIONS = 30
HOPELESS = (12, 0.01)  # steps after which a step in rad is too long: those that converge are below 0.002 by then
LARGEST_STEP = 0.5  # rad; a longer step is shortened, far starts swing otherwise
RIDGE = 1e-13  # relative; keeps a singular pair from stopping the batch, changes no digit of a regular one
RETRY_AZIMUTHS = np.radians([15, -15, 30, -30, 60, -60, 90, -90, 180])
RETRY_RMS = 1e-3  # of the principal distance: a larger rms y parallax is a false minimum or a gross error


class Solved(NamedTuple):
    """Elements of pairs, as the iteration found them."""

    elements: Floats  # (p, 5), rad
    converged: Flags  # (p,): whether the last step was below ``CONVERGED``
    iterations: Numbers  # (p,): steps made


class Linearised(NamedTuple):
    """The condition of relative orientation near given elements."""

    parallax: Floats  # (m,): residual y parallaxes q, mm
    jacobian: Floats  # (5, m): dq/de, mm per radian


def turns(elements: Floats) -> tuple[Floats, Floats]:
    """Rotations of the left and the right photo against the base frame, (p, 3, 3) each."""
    al1, ka1, al2, om2, ka2 = elements.T
    return from_alpha_omega_kappa(al1, 0.0, ka1), from_alpha_omega_kappa(al2, om2, ka2)


def base_rays(elements: Floats, pairs: Pairs) -> tuple[Floats, Floats]:
    """Image rays of the left and the right photo in the base frame, X, Y, Z in mm, shape (3, m) each.

    Source: [001] eq. 132-133, 137, relative to the base.
    """
    turned: list[Floats] = []
    for rotation, xy in zip(turns(elements), (pairs.left, pairs.right), strict=True):
        rays = np.empty((3, len(xy)))
        for row, (a, b, c) in enumerate(rotation.transpose(1, 2, 0)):
            along = a.take(pairs.pair) * xy[:, 0] + b.take(pairs.pair) * xy[:, 1]
            rays[row] = along - (c * pairs.focal).take(pairs.pair)  # eq. 137
        turned.append(rays)
    return turned[0], turned[1]


def y_parallaxes(elements: Floats, pairs: Pairs) -> Floats:
    """Residual y parallaxes q = y1 - y2 of the photos turned into the base frame, mm at photo scale, shape (m,)."""
    return _parallaxes(*base_rays(elements, pairs), pairs.focal)


def _parallaxes(left: Floats, right: Floats, focal: float) -> Floats:
    return np.asarray(-focal * (left[1] / left[2] - right[1] / right[2]), float)


def linearised_parallaxes(elements: Floats, pairs: Pairs) -> Linearised:
    """Residual y parallaxes and their exact derivatives by the five elements.

    With q = -f (Y1/Z1 - Y2/Z2) each derivative is that of a ratio: dq = -f (dY Z - Y dZ) / Z^2 for the left photo,
    with the other sign for the right one.
    """
    f = pairs.focal
    (lx, ly, lz), (rx, ry, rz) = base_rays(elements, pairs)
    sines, cosines = np.sin(elements), np.cos(elements)
    sa1, sk1, sa2, so2, sk2 = sines.T[:, pairs.pair]
    _, ck1, ca2, co2, ck2 = cosines.T[:, pairs.pair]
    u = ck2 * pairs.right[:, 0] - sk2 * pairs.right[:, 1]
    v = sk2 * pairs.right[:, 0] + ck2 * pairs.right[:, 1]
    left_scale, right_scale = -f / lz**2, f / rz**2
    jacobian = np.empty((5, len(lx)))
    jacobian[0] = -left_scale * ly * lx
    jacobian[1] = left_scale * ((ck1 * pairs.left[:, 0] - sk1 * pairs.left[:, 1]) * lz + ly * sa1 * ly)
    jacobian[2] = -right_scale * ry * rx
    jacobian[3] = right_scale * ((co2 * f - so2 * v) * rz - ry * ca2 * ry)
    jacobian[4] = right_scale * (co2 * u * rz - ry * (ca2 * so2 * u - sa2 * v))
    return Linearised(-f * (ly / lz - ry / rz), jacobian)


def normal_matrices(jacobian: Floats, pairs: Pairs) -> Floats:
    """Form the normal matrices J^T W J of all pairs, shape (p, 5, 5), from the derivatives, shape (5, m)."""
    normal = np.empty((pairs.size, 5, 5))
    for row, weighted in enumerate(jacobian * pairs.weight):
        normal[:, row, row:] = pairs.sums(weighted * jacobian[row:]).T
        normal[:, row:, row] = normal[:, row, row:]
    return normal


def gauss_newton_steps(line: Linearised, pairs: Pairs, ridge: float, longest: float) -> tuple[Floats, Floats]:
    """Compute changes of the elements, shape (p, 5), none longer than ``longest``, and their sizes before that, rad.

    The normal matrices are scaled to unit diagonals, on which ``ridge`` is added. A pair that has lost all meaning
    gets a step of zero and the size NaN.
    """
    diagonal = np.arange(5)
    normal = normal_matrices(line.jacobian, pairs)
    scale = 1 / np.sqrt(np.maximum(normal[:, diagonal, diagonal], 1e-300))
    normal *= scale[:, :, None] * scale[:, None, :]
    normal[:, diagonal, diagonal] += ridge
    right = pairs.sums(line.jacobian * (pairs.weight * line.parallax)).T * scale
    sound = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    normal[~sound], right[~sound] = np.eye(5), 0.0
    step = -np.linalg.solve(normal, right[:, :, None])[:, :, 0] * scale
    largest = np.abs(step).max(axis=1)
    step *= np.minimum(1.0, longest / np.maximum(largest, longest))[:, None]
    return step, np.where(sound, largest, np.nan)


def start_values(pairs: Pairs) -> Floats:
    """Elements (0, kappa0, 0, 0, kappa0) that turn both photos so that the mean parallax runs along x."""
    mean = pairs.sums(((pairs.left - pairs.right) * pairs.weight[:, None]).T)
    start = np.zeros((pairs.size, 5))
    start[:, 1] = start[:, 4] = -np.arctan2(mean[1], mean[0])
    return start


def iterate_elements(
    elements: Floats, pairs: Pairs, watch: Callable[[Numbers, Floats, Floats, Floats], None] | None = None
) -> Solved:
    """Gauss-Newton iteration of all pairs from given elements; converged pairs leave the batch.

    watch: called at every step with the numbers of the pairs that take part, their elements before it, their sums of
        weighted squares of the y parallaxes in mm^2, and what is added to the elements.
    """
    result = elements.copy()
    converged = np.zeros(pairs.size, bool)
    steps = np.zeros(pairs.size, np.intp)
    todo, part = np.arange(pairs.size), pairs
    for number in range(ITERATIONS):
        if not len(todo):
            break
        with np.errstate(all="ignore"):
            line = linearised_parallaxes(result[todo], part)
            step, size = gauss_newton_steps(line, part, RIDGE, LARGEST_STEP)
        if watch is not None:
            watch(todo, result[todo], part.sums(part.weight * line.parallax**2), step)
        result[todo] += step
        steps[todo] += 1
        converged[todo[size < CONVERGED]] = True
        going = (size >= CONVERGED) & ((number < HOPELESS[0]) | (size < HOPELESS[1]))
        if not going.all():
            part = part.take(np.flatnonzero(going))
            todo = todo[going]
    return Solved(reduced_angles(result), converged, steps)


def reduced_angles(elements: Floats) -> Floats:
    """Bring angles into -pi to pi."""
    return (elements + np.pi) % (2 * np.pi) - np.pi


def in_front_of_cameras(elements: Floats, pairs: Pairs) -> Flags:
    """Whether each point lies in front of both cameras: its rays meet on their way down, shape (m,)."""
    return rays_meet_in_front(*base_rays(elements, pairs))


def rays_meet_in_front(left: Floats, right: Floats) -> Flags:
    """Whether rays in the base frame, shape (3, m), meet in front of both cameras."""
    to_left, to_right = _distances(left, right)
    return np.asarray((to_left > 0) & (to_right > 0), bool)


def _distances(left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Distances along both rays to where they meet in the plane of x' and z', in units of the ray and the base."""
    (lx, _, lz), (rx, _, rz) = left, right
    determinant = lx * rz - rx * lz
    with np.errstate(all="ignore"):
        return rz / determinant, lz / determinant


def solve_elements(pairs: Pairs) -> Solved:
    """Elements of all pairs from nothing: start values, iteration, retries from other azimuths.

    A pair is tried again with its start azimuth turned by 15 to 180 degrees when it does not converge, a point comes
    out behind a camera, or the y parallaxes stay large: with tilts beyond 10 degrees there are false minima with all
    points in front. Of the solutions found, the one with most points in front and then the smallest sum of squares is
    taken.
    """
    start = start_values(pairs)
    best, converged, steps = iterate_elements(start, pairs)
    best, rays = facing(best, pairs)
    share, squares = _score(rays, converged, pairs)
    tolerable = (RETRY_RMS * pairs.focal) ** 2 * pairs.sums(pairs.weight)
    for turn in RETRY_AZIMUTHS:
        todo = np.flatnonzero((share < 1) | (squares > tolerable))
        if not len(todo):
            break
        part = pairs.take(todo)
        turned = start[todo]
        turned[:, [1, 4]] += turn
        elements, success, count = iterate_elements(turned, part)
        elements, rays = facing(elements, part)
        new_share, new_squares = _score(rays, success, part)
        more = new_share > share[todo] + 1e-9
        as_many = new_share > share[todo] - 1e-9
        better = more | (as_many & (new_squares < squares[todo]))
        chosen = todo[better]
        best[chosen], converged[chosen], steps[chosen] = elements[better], success[better], count[better]
        share[chosen], squares[chosen] = new_share[better], new_squares[better]
    return Solved(best, converged, steps)


def facing(elements: Floats, pairs: Pairs) -> tuple[Floats, tuple[Floats, Floats]]:
    """Turn the base of pairs round whose points lie behind both cameras: the same planes, the other side; and rays."""
    rays = base_rays(elements, pairs)
    to_left, to_right = _distances(*rays)
    behind = (to_left < 0) & (to_right < 0) & (pairs.weight > 0)
    away = 2 * pairs.sums(behind.astype(float)) > pairs.sums((pairs.weight > 0).astype(float))
    if not away.any():
        return elements, rays
    result = elements.copy()
    result[away] *= [-1.0, 1.0, -1.0, -1.0, 1.0]
    result[away, 1] += np.pi
    result[away, 4] += np.pi
    result = reduced_angles(result)
    return result, base_rays(result, pairs)


def _score(rays: tuple[Floats, Floats], converged: Flags, pairs: Pairs) -> tuple[Floats, Floats]:
    """Share of the points in front (-1 where not converged) and weighted sum of squares, by pair."""
    used = pairs.weight > 0
    with np.errstate(all="ignore"):
        front = pairs.sums((rays_meet_in_front(*rays) & used).astype(float))
        share = front / np.maximum(pairs.sums(used.astype(float)), 1)
        squares = pairs.sums(pairs.weight * _parallaxes(*rays, pairs.focal) ** 2)
    return np.where(converged, share, -1.0), np.where(np.isfinite(squares), squares, np.inf)
