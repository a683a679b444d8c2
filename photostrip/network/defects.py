"""Where shift, rotation and scale come from: control, positions, or inner constraints on the points.

A free network is solved with seven conditions at two photos, which keep the band, and its steps and cofactors are then
carried over to inner constraints: of all solutions of the same shape that with the smallest changes of the points,
and with the smallest trace of their cofactors.

What the observations do not determine, by name: points, the datum, photos, common parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from scipy.sparse.csgraph import connected_components

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.network.normal_equations import NormalEquations, factored, linearise
from photostrip.network.observations import LinearisedOrientations, attitudes_at, positions_at
from photostrip.network.problem import BundleProblem, Parameters, PreparedProblem
from photostrip.notes import counted, named

DEFECT = SIMILARITY_PARAMETERS
# photos, part: of 250, 500, 1000 and 1e-4, 1e-6, 1e-8 what comes nearest to all photos held by 1e-10, at 10 000 photos
STRETCH, HELD = 500, 1e-8


def is_free(problem: BundleProblem) -> bool:
    """Whether nothing says where the network is: no control coordinate, no camera position, no attitude."""
    sigmas = (problem.control.sigma, problem.positions.sigma, problem.attitudes.sigma)
    return not any(np.isfinite(sigma).any() for sigma in sigmas)


def anchor(blocks: Floats, rank: Numbers, state: Parameters) -> Floats:
    """Conditions that hold seven parameters: all of a model; all of a photo, and its distance from the farthest one.

    Returns what is added to the units' blocks (m, u, u); the conditions are made as strong as the rays, whose blocks
    are ``blocks``; the photo is that in the middle of the order ``rank``.
    """
    middle = int(np.argsort(rank)[len(rank) // 2])
    add = np.zeros_like(blocks)
    add[middle] = np.diag(np.diag(blocks[middle]))
    if len(add[middle]) == DEFECT:
        return add
    base = state.centers - state.centers[middle]
    far = int(np.argmax((base**2).sum(axis=1)))
    direction = state.rotations[far].T @ base[far] / np.linalg.norm(base[far])
    add[far, :3, :3] += np.trace(blocks[far, :3, :3]) / 3.0 * np.outer(direction, direction)
    return add


def anchors(blocks: Floats, rank: Numbers, state: Parameters) -> Floats:
    """Conditions of ``anchor``, and a trifle of its own information that holds one unit in ``STRETCH`` where it is.

    Residuals hardly feel it, but thousands of photos that two of them hold alone bend so far that the cofactors of
    the residuals are lost in rounding.
    """
    add = anchor(blocks, rank, state)
    beside = np.abs(rank - len(rank) // 2)
    held = (beside % STRETCH == 0) & (beside > 0)
    add[held] += HELD * blocks[held] * np.eye(blocks.shape[1])
    return add


def photo_generators(state: Parameters, origin: Floats, unknowns: int) -> Floats:
    """Move photos or models by a small similarity about an origin: (m, u, 7) in their own axes."""
    back = np.swapaxes(state.rotations, 1, 2)
    moves = np.zeros((len(back), unknowns, DEFECT))
    moves[:, :3] = back @ similarity_derivatives(state.centers, origin)
    moves[:, 3:6, 3:6] = back
    moves[:, 6:, 6:] = 1.0
    return moves


def point_generators(prepared: PreparedProblem, state: Parameters) -> tuple[Floats, Floats]:
    """Move points by a small similarity about their mean: the mean, (3,); (q, 3, 7), zero for points without rays."""
    origin = state.points[prepared.measured].mean(axis=0)
    return origin, similarity_derivatives(state.points, origin) * prepared.measured[:, None, None]


SQUARED_SINE = 1e-10  # square of the sine of the angle between rays
# standard deviations from which a shift, in sizes of the network, a turn, in radians, or the logarithm of the scale is
# not determined; errors of given positions on one line look like a turn about it that is known to some tenths
LOOSE = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 1.0])
ALIKE = 0.95  # part of a named movement that lies among the undetermined ones
COSINE_ALONG = 0.94  # cosine of 20 degrees: a line counts as the flight line
LEFT_OVER = 1e-11  # part of its information that the other parameters leave a common parameter
STRAIGHT_BREADTH = 1e-3  # breadth of control on one line, as part of its length
GROWN = 4.0  # times the standard deviation of a given coordinate, rms of the points, from which a movement is told
ODD_SIGMAS = 10.0  # standard deviations of a control coordinate, or of camera positions, that is told then
APART = 0.5  # of those of the worst control coordinate, beyond which all camera positions are off, not one point
ITERATIONS = 3
MOST_FAILED = 8  # adjustments of a search that may fail: each takes six times as long as one that converges
SHARE = 0.5  # of the largest element of a null vector: what is named with it
UNMOVED = 1e-9
OPEN = {"bundle-rank", "bundle-rays"}  # codes of what is not determined: the datum, photos, points
MOVES = (
    "shift along its x",
    "shift along its y",
    "shift along its z",
    "roll about x",
    "turn about y",
    "turn about z",
    "scale",
)


def refuse_repeated(problem: BundleProblem) -> None:
    """Refuse points that are measured twice on a photo (``bundle-repeated``)."""
    key = np.sort(problem.images.point * np.intp(problem.photos) + problem.images.photo)
    again = np.unique(key[1:][key[1:] == key[:-1]])
    if len(again):
        pairs = zip(*(part.tolist() for part in np.divmod(again, problem.photos)), strict=True)
        raise InputError(
            [
                Fault(
                    f"point {problem.point_name(point)} is measured twice on "
                    f"{problem.unit} {problem.photo_name(photo)}",
                    code="bundle-repeated",
                    fix="leave one of the measurements out",
                )
                for point, photo in pairs
            ]
        )


def refuse_weak_points(equations: NormalEquations) -> None:
    """Refuse points whose rays, with their control, do not meet at an angle (``bundle-rays``).

    The normal equations are those without damping.
    """
    problem = equations.prepared.problem
    weak = [problem.point_name(number) for number in np.flatnonzero(~(equations.strength > SQUARED_SINE)).tolist()]
    if weak:
        message = (
            f"rays and control do not determine {named('point', weak)}: "
            "a point needs two rays that meet at an angle, or one and its given height"
        )
        raise GeometryError(message, points=weak, code="bundle-rays")


@dataclass(frozen=True, eq=False)
class Held:
    """How a connected part of the network is held by what is given."""

    photos: Numbers  # its photos, in the order of the problem
    # (7, 7): information on shift (in units of its size), rotation about the mean of what is given and scale
    normal: Floats
    control: Floats  # (c, 3): positions that are given at all, of points and photos
    motion: Floats  # (7, 7): mean square motion of points and photos by the same parameters, square metres
    sigma: float  # median of the standard deviations of the given coordinates, metres

    @property
    def weakest(self) -> tuple[float, Floats]:
        """The movement that is held least: standard deviation of points and photos by it, rms, metres; and itself."""
        root = np.linalg.inv(np.linalg.cholesky(self.motion))
        values, vectors = np.linalg.eigh(root @ self.normal @ root.T)
        move = root.T @ vectors[:, 0]
        return float(max(values[0], UNMOVED) ** -0.5), move / np.linalg.norm(move)


def refuse_loose(prepared: PreparedProblem, state: Parameters) -> None:
    """Refuse parts of the network that what is given does not hold in place (``bundle-rank``).

    The information of what is given on the seven parameters of a similarity of each part, each in units of ``LOOSE``,
    is taken apart by its eigenvalues; what is below one is named: shift, rotation or scale.
    """
    parts = _parts(prepared)
    for photos in parts:
        held = _held(prepared, state, photos)
        values, vectors = np.linalg.eigh(held.normal * LOOSE[:, None] * LOOSE)
        loose = vectors[:, values < 1.0]
        if loose.shape[1]:
            names = [prepared.problem.photo_name(number) for number in photos.tolist()]
            reason = _reason(held, unknown_errors=bool(prepared.problem.positions.offset_sigma.any()))
            whole = "" if len(parts) == 1 else f" of {named(prepared.problem.unit, names)}"
            message = f"what is given does not determine {_moves(state, held, loose)}{whole}: {reason}"
            raise GeometryError(message, photos=() if len(parts) == 1 else names, code="bundle-rank")


def weak(prepared: PreparedProblem, state: Parameters) -> str:
    """Name the movement of the network that what is given hardly determines, with its size; nothing without one."""
    for held in (_held(prepared, state, photos) for photos in _parts(prepared)):
        metres, move = held.weakest
        if metres > GROWN * held.sigma:
            return (
                f"what is given hardly determines {_moves(state, held, move[:, None])} of the whole: by that alone the "
                f"points are uncertain by {metres:.2g} m (standard deviation, rms), where a given coordinate has "
                f"{held.sigma:.2g} m; more control, farther apart, holds it"
            )
    return ""


def diverged(prepared: PreparedProblem, state: Parameters, steps: int) -> GeometryError:
    """Say that an adjustment does not converge (``bundle-diverged``), and what speaks against it.

    That is a movement that is hardly determined; else camera positions that lie elsewhere than the control has the
    photos, at the start, because steps mix both; else the control that is farthest off.
    """
    message = f"the bundle adjustment did not converge in {counted(steps, 'step')}"
    control = prepared.problem.control
    loose = "" if is_free(prepared.problem) else weak(prepared, prepared.begun)
    with np.errstate(invalid="ignore"):
        off = np.nan_to_num(np.abs(linearise(prepared, state).control))
    begun = linearise(prepared, prepared.begun)
    residual, weight = begun.positions.residual, begun.positions.weight
    apart = float(np.median(np.linalg.norm(residual * weight, axis=1))) if len(residual) and len(control) else 0.0
    if loose:
        message += f": {loose}"
    elif apart > max(ODD_SIGMAS, APART * np.nan_to_num(np.abs(begun.control)).max(initial=0.0)):
        metres = float(np.median(np.linalg.norm(residual * (weight > 0.0), axis=1)))
        message += (
            f": camera positions and control contradict each other by {metres:.3g} m or more; is the crs, unit or kind "
            "of height of one of them wrong?"
        )
    elif off.max(initial=0.0) > ODD_SIGMAS:
        row, axis = np.unravel_index(int(off.argmax()), off.shape)
        point = prepared.problem.point_name(int(control.point[row]))
        metres = off[row, axis] * control.sigma[row, axis]
        message += (
            f": control point {point} is {metres:.3g} m off, {off[row, axis]:.3g} times its standard deviation; are "
            "its coordinates or its id wrong?"
        )
    return GeometryError(message, code="bundle-diverged")


def refuse_endless(problem: BundleProblem, rejected: Sequence[int], adjustments: int, failed: int) -> None:
    """End a search for gross errors whose adjustments fail (``search-ended``); say where most rays were rejected."""
    if failed < MOST_FAILED:
        return
    count = np.bincount(problem.images.photo[np.array(rejected, np.intp)], minlength=problem.photos)
    worst = [problem.photo_name(int(photo)) for photo in np.argsort(-count, kind="stable")[:3] if count[photo]]
    message = f"the search for gross errors ended after {counted(adjustments, 'adjustment')} and "
    message += f"{counted(len(rejected), 'rejected ray')}: without what contradicts the rest, it does not converge"
    if worst:
        message += f"; most were rejected on {named(problem.unit, worst)}: were points there named wrongly?"
    raise GeometryError(message, photos=worst, code="search-ended")


def _parts(prepared: PreparedProblem) -> list[Numbers]:
    """Photos of the parts of the network that share no points."""
    count, label = connected_components(prepared.joined, directed=False)
    return [np.flatnonzero(label == part) for part in range(count)]


def _held(prepared: PreparedProblem, state: Parameters, photos: Numbers) -> Held:
    """Find what control, given positions and attitudes say of the seven motions of a part of the network as a whole.

    ``normal`` is their information J^T P J, with offsets and drifts of the positions eliminated. Shifts count in radii
    of the part, rotations in radians, the scale as its logarithm, so that each moves the rim alike.
    """
    problem = prepared.problem
    inside = np.zeros(problem.photos, bool)
    inside[photos] = True
    with_rays = np.zeros(problem.points, bool)
    with_rays[problem.images.point[inside[problem.images.photo]]] = True
    control = problem.control
    given = with_rays[control.point] & np.isfinite(control.sigma).any(axis=1)
    with_common = prepared.calibrated
    positions = positions_at(problem.positions, state.centers, state.rotations, state.common, with_common)
    attitudes = attitudes_at(problem.attitudes, state.rotations, len(state.common))
    at = inside[positions.photo] & (positions.weight > 0.0).any(axis=1)
    places = np.concatenate([control.xyz[given], problem.positions.xyz[at]])
    around = state.centers[photos]
    origin = places.mean(axis=0) if len(places) else around.mean(axis=0)
    everything = problem.start.points[with_rays]
    if not problem.of_models:
        everything = np.concatenate([around, everything])
    radius = float(np.linalg.norm(everything - everything.mean(axis=0), axis=1).max())
    units = np.array([radius, radius, radius, 1.0, 1.0, 1.0, 1.0])
    rows = np.einsum("nij,njd->nid", control.axes[given], similarity_derivatives(control.xyz[given], origin)) * units
    rows /= control.sigma[given][:, :, None]
    normal = np.einsum("nad,nae->de", rows, rows)
    of_photos = photo_generators(state, origin, problem.unknowns) * units
    for linear in (each for each in (positions, attitudes) if len(each.photo)):  # of photos only
        normal += _information(linear, of_photos, inside, prepared)
    motions = similarity_derivatives(everything, origin).reshape(-1, DEFECT) * units
    sigmas = np.concatenate([control.sigma[given].ravel(), problem.positions.sigma[at].ravel()])
    sigmas = sigmas[np.isfinite(sigmas)]
    return Held(
        photos=photos,
        normal=normal,
        control=places,
        motion=motions.T @ motions / len(everything) + UNMOVED * radius**2 * np.eye(DEFECT),
        sigma=np.median(sigmas) if len(sigmas) else np.inf,
    )


def _information(linear: LinearisedOrientations, moves: Floats, inside: Flags, prepared: PreparedProblem) -> Floats:
    """Information (7, 7) of given orientations on the similarity, offsets and drifts eliminated from the normals."""
    rows = inside[linear.photo]
    of_photos = (linear.by_photo[rows] @ moves[linear.photo[rows]]) * linear.weight[rows][:, :, None]
    common = linear.by_common[rows] * linear.weight[rows][:, :, None]
    whole = np.concatenate([of_photos, common], axis=2).reshape(-1, DEFECT + common.shape[2])
    normal = whole.T @ whole
    seven = DEFECT
    corner = normal[seven:, seven:] + np.diag(prepared.prior**-2.0)
    return np.asarray(normal[:seven, :seven] - normal[:seven, seven:] @ np.linalg.pinv(corner) @ normal[seven:, :seven])


def _moves(state: Parameters, held: Held, loose: Floats) -> str:
    """Name undetermined motions ``loose`` (7, k), orthonormal columns.

    Named are the motions a surveyor knows of which nearly all lies among them; if there is none, the nearest.
    """
    flight, across, up = _flight_axes(state, held.photos)
    line = _line(held.control)
    zero = np.zeros(3)
    turns = {"roll about the flight line": flight, "pitch": across, "heading": up}
    candidates: list[tuple[str, Floats]] = []
    if line is not None:
        alike = [name for name, axis in turns.items() if abs(line @ axis) > COSINE_ALONG]
        name = alike[0] if alike else "the rotation about the line of control"
        candidates.append((name, np.concatenate([zero, line, [0.0]])))
    candidates += [
        ("shift along the flight", np.concatenate([flight, zero, [0.0]])),
        ("shift across the flight", np.concatenate([across, zero, [0.0]])),
        ("height", np.concatenate([up, zero, [0.0]])),
        *((name, np.concatenate([zero, axis, [0.0]])) for name, axis in turns.items()),
        ("scale", np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])),
    ]
    parts = [float(np.linalg.norm(loose.T @ move)) for _, move in candidates]
    found = [name for (name, _), part in zip(candidates, parts, strict=True) if part > ALIKE]
    return ", ".join(dict.fromkeys(found)) or candidates[int(np.argmax(parts))][0]


def _flight_axes(state: Parameters, photos: Numbers) -> Floats:
    """Find unit vectors along the flight, across it and up, shape (3, 3), by rows."""
    up = state.rotations[photos, :, 2].mean(axis=0)
    up /= np.linalg.norm(up)
    centers = state.centers[photos] - state.centers[photos].mean(axis=0)
    flight = np.linalg.svd(centers, full_matrices=False)[2][0] if len(photos) > 1 else state.rotations[photos[0], :, 0]
    flight = flight - up * (up @ flight)
    flight /= np.linalg.norm(flight)
    return np.array([flight, np.cross(up, flight), up])


def _line(control: Floats) -> Floats | None:
    """Direction of the line on which all that is given lies, or None."""
    if len(control) < 2:
        return None
    _, spread, axes = np.linalg.svd(control - control.mean(axis=0), full_matrices=False)
    straight = spread[0] > 0.0 and (len(spread) == 1 or spread[1] < STRAIGHT_BREADTH * spread[0])
    return axes[0] if straight else None


def _reason(held: Held, *, unknown_errors: bool) -> str:
    if not len(held.control):
        return "no control and no camera positions"
    if len(np.unique(held.control, axis=0)) == 1:
        return "one given position only"
    if _line(held.control) is not None:
        return "all of it lies on one line"
    return "too few coordinates are given" + (", and unknown errors stand for some of them" if unknown_errors else "")


def refuse_singular(equations: NormalEquations, extra: Floats | None) -> NoReturn:
    """Refuse normal equations that cannot be factored (``bundle-rank``), naming the photos that are not determined.

    They are those with large elements in the null vector, found by inverse iteration on the matrix made regular with a
    trifle of its diagonal. ``extra`` (m, u, u) is what was added to them as a datum.
    """
    problem = equations.prepared.problem
    blocks = equations.own + (0.0 if extra is None else extra)
    diagonal = np.maximum(np.einsum("nii->ni", blocks), 0.0)
    least = UNMOVED * np.where(diagonal > 0.0, diagonal, max(float(diagonal.max()), 1.0))
    add = np.zeros_like(blocks)
    add[:, range(problem.unknowns), range(problem.unknowns)] = least
    found = factored(equations, add if extra is None else add + extra)
    photos, names = [], []
    if found is not None:
        vector = np.sqrt(diagonal + least).reshape(-1, 1)
        for _ in range(ITERATIONS):
            vector = found.by_photos(vector * np.maximum(diagonal, least).reshape(-1, 1))
            vector /= np.abs(vector).max()
        size = np.abs(vector.reshape(-1, problem.unknowns)) * np.sqrt(np.maximum(diagonal, least))
        worst = size.max(axis=1)
        numbers = np.flatnonzero(worst > SHARE * worst.max())
        photos = [problem.photo_name(number) for number in numbers.tolist()]
        names = [MOVES[int(np.argmax(size[int(np.argmax(worst))]))]]
    what = f"; least of all the {names[0]}" if names else ""
    message = (
        f"the observations do not determine {named(problem.unit, photos) or f'the {problem.unit}s'}{what}: "
        "they need more points in common with the others, or control"
    )
    raise GeometryError(message, photos=photos, code="bundle-rank")


def refuse_common(prepared: PreparedProblem, before: Floats, left: Floats) -> None:
    """Refuse common parameters that the observations do not determine (``bundle-rank``), by name.

    ``before`` and ``left`` (p, p) are their normal matrices with all other parameters known, and unknown.
    """
    if not len(left):
        return
    scale = np.sqrt(np.maximum(np.diag(before), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(left / np.outer(scale, scale))
    bad = np.abs(vectors[:, values < LEFT_OVER])
    if bad.shape[1]:
        all_names = prepared.problem.common_names()
        names = [all_names[n] for n in np.flatnonzero((bad > SHARE * bad.max(axis=0)).any(axis=1)).tolist()]
        raise GeometryError(
            f"the observations do not determine {', '.join(names)}: hold one of them, or give it an a-priori sigma",
            code="bundle-rank",
        )
