"""A photo oriented by correction directions: least squares on the directions to distinct points.

Measured are the image coordinates of the points and, with a theodolite at the same station, their directions. Both have
errors: every point enters with the covariance of its directions plus that of its ray.

Where the front nodal point of the lens is not on the axes of the theodolite, but ahead of them on the optical axis, a
point is seen from two places; the distance of the point says how far apart its two directions are. Directions that were
computed from coordinates have no refraction in them, and the photo has: beta of the photo is larger by k D / 2R.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geodesy.local_frame import EARTH_RADIUS
from photostrip.notes import counted, listed
from photostrip.rejection import Rejection
from photostrip.statistics import chi2_quantile, f_p_value
from photostrip.terrestrial import normal_case

ANGLES = ("alpha", "omega", "kappa")
INTERIOR = ("f", "x0", "z0")
REFRACTION = "k"
UNKNOWNS = (*ANGLES, *INTERIOR, REFRACTION)
# what may be determined besides the angles
FREE = {"principal-distance": ("f",), "principal-point": ("x0", "z0"), "refraction": (REFRACTION,)}
SCREENINGS = ("deletion", "stated", "none")
MOST_ITERATIONS = 50
CONVERGED = 1e-11  # of the normalised unknowns: rad, and mm over the principal distance
WORST_CONDITION = 1e6  # condition number of the scaled equations from which a photo counts as not determined
SINGULAR = 1e-100  # eigenvalue that stands for zero
LEAST_POINTS = 2
NEGLIGIBLE_SQUARES = 1e-18  # weighted sum of squares of error-free data: rounding, nothing to be screened


@dataclass(frozen=True, eq=False)
class Sightings:
    """Points of one photo with their measured directions."""

    ids: tuple[str, ...]
    xz: Floats  # (n, 2): image coordinates in mm in the system of the principal point
    directions: Floats  # (n, 2): horizontal and vertical directions in radians; NaN where none was measured
    sigma_xz: Floats  # (n, 2): standard deviations of the image coordinates, mm
    sigma_directions: Floats  # (n, 2): standard deviations of the directions, radians
    # (n,): distances of the points from the theodolite, metres, for eccentricity and refraction; NaN where not given
    distances: Floats

    @cached_property
    def measured(self) -> Flags:
        """Which directions were measured, shape (n, 2)."""
        return np.asarray(~np.isnan(self.directions), bool)


@dataclass(frozen=True)
class OrientationSettings:
    free: tuple[str, ...] = ()  # what is determined besides the angles: keys of `FREE`
    # ``"deletion"`` tests each point against the scatter of the others, ``"stated"`` against the stated standard
    # deviations, ``"none"`` tests nothing
    screening: str = "deletion"
    # probability of rejecting any point of a photo without gross errors, and of a false global test
    significance: float = 0.05
    eccentricity: float = 0.0  # of the front nodal point, ahead of the axes of the theodolite, metres
    refraction: float = 0.0  # coefficient k that the directions lack; the start value when it is free


@dataclass(frozen=True, eq=False)
class PhotoOrientation:
    names: tuple[str, ...]  # unknowns: alpha, omega, kappa, then what else was determined: f, x0, z0, k
    values: Floats  # (u,): radians and mm; k is a ratio
    cofactors: Floats  # (u, u): their covariance for the stated standard deviations
    principal_distance: float  # f in mm
    principal_point: tuple[float, float]  # x0, z0 in mm
    refraction: float  # coefficient k
    # (n, 2): computed minus measured directions in radians; NaN where not measured. Of rejected points the misclosure
    residuals: Floats
    redundancy: Floats  # (n, 2): redundancy numbers of the directions; NaN where they were not used
    used: Flags  # (n,): points that were used
    weighted_sum: float  # weighted sum of squared residuals, chi-square with `dof` degrees of freedom
    dof: int
    condition: float  # condition number of the equations, columns scaled to equal length
    # points taken out, in order; the size is the misclosure of a point's directions against the orientation without it,
    # radians; the values of the test ``deletion`` are p values, of ``stated`` chi-square
    rejected: tuple[Rejection, ...] = ()

    @property
    def rotation(self) -> Floats:
        """Photo to ground, shape (3, 3)."""
        return normal_case.ground_from_photo(*self.values[:3])

    @property
    def sigma(self) -> Floats:
        """Standard deviations of the unknowns, in radians and mm."""
        return np.sqrt(np.diag(self.cofactors))

    @property
    def sigma0(self) -> float:
        """Scatter of the directions over what the stated standard deviations make expect; NaN without redundancy."""
        return float(np.sqrt(self.weighted_sum / self.dof)) if self.dof else float("nan")

    def sigma0_range(self, significance: float) -> tuple[float, float]:
        """Range of sigma0 when the stated standard deviations are right; NaN without redundancy.

        `significance` is the probability of lying outside by chance.
        """
        if not self.dof:
            return float("nan"), float("nan")
        tails = (significance / 2, 1 - significance / 2)
        lower, upper = (float(np.sqrt(chi2_quantile(tail, self.dof) / self.dof)) for tail in tails)
        return lower, upper


@dataclass(frozen=True, eq=False)
class _System:
    """Linearised equations of all points, whitened point by point."""

    design: Floats  # (n, 2, u)
    misclosure: Floats  # (n, 2), measured minus computed, radians
    weight: Floats  # (n, 2, 2)


def orient(
    sightings: Sightings,
    principal_distance: float,
    principal_point: tuple[float, float] = (0.0, 0.0),
    settings: OrientationSettings | None = None,
) -> PhotoOrientation:
    """Orient a photo by the directions of its points.

    principal_distance: f in mm; the start value when it is free.
    principal_point: x0, z0 in mm; the start values when they are free.
    Raises GeometryError when the points do not determine what is asked for, or the solution does not converge.

    Source: the condition is [002] eq. 1; its least-squares solution, eccentricity and refraction are derived.
    """
    chosen = settings or OrientationSettings()
    names = (*ANGLES, *(name for key, keys in FREE.items() if key in chosen.free for name in keys))
    interior = np.array([principal_distance, *principal_point, chosen.refraction])
    _refuse_without_distances(sightings, chosen)
    used = np.asarray(sightings.measured.any(axis=1), bool)
    _refuse_too_few(sightings, used, names)
    solution = _solve(sightings, used, names, interior, chosen.eccentricity)
    rejected: list[Rejection] = []
    while chosen.screening != "none":
        found = _worst(solution, sightings, chosen)
        if found is None:
            break
        used = used.copy()
        used[found.row] = False
        solution = _solve(sightings, used, names, interior, chosen.eccentricity)
        rejected.append(replace(found, size=tuple(solution.residuals[found.row].tolist())))
    return replace(solution, rejected=tuple(rejected))


def _refuse_without_distances(sightings: Sightings, settings: OrientationSettings) -> None:
    if not settings.eccentricity and not settings.refraction and "refraction" not in settings.free:
        return
    without = [name for name, each in zip(sightings.ids, sightings.distances, strict=True) if not each > 0]
    if without:
        what = "eccentricity" if settings.eccentricity else "refraction"
        msg = f"{what} acts according to the distance of a point, and that of {listed(without, 1)} is not given"
        raise GeometryError(msg, points=without, code="no-distance")
    nearest = float(sightings.distances.min())
    if abs(settings.eccentricity) >= nearest / 2:
        msg = f"an eccentricity of {settings.eccentricity:g} m with a point {nearest:g} m away: is it in metres?"
        raise GeometryError(msg, points=sightings.ids, code="eccentricity")


def _refuse_too_few(sightings: Sightings, used: Flags, names: Sequence[str]) -> None:
    number = int(sightings.measured[used].sum())
    points = int(used.sum())
    if points < LEAST_POINTS or number < len(names):
        msg = (
            f"{counted(points, 'point')} with {counted(number, 'direction')} cannot determine {', '.join(names)}: at "
            f"least {len(names)} directions to at least {LEAST_POINTS} points are needed"
        )
        raise GeometryError(msg, points=sightings.ids, code="too-few-directions")


def _solve(
    sightings: Sightings, used: Flags, names: tuple[str, ...], interior: Floats, eccentricity: float
) -> PhotoOrientation:
    """Gauss-Newton from a start that needs no approximate values."""
    values = np.concatenate([_start(sightings, used, interior), interior])
    active = np.flatnonzero([name in names for name in UNKNOWNS])
    scale = np.array([interior[0] if UNKNOWNS[each] in INTERIOR else 1.0 for each in active])
    for _ in range(MOST_ITERATIONS):
        system = _linearised(sightings, values, active, eccentricity)
        normal, right = _normal(system, used)
        condition = _condition(normal, names, sightings)
        step = np.linalg.solve(normal, right)
        values[active] += step
        if not np.isfinite(values).all() or values[3] <= 0:
            break
        if np.abs(step / scale).max() < CONVERGED:
            return _result(sightings, used, names, values, active, condition, eccentricity)
    msg = "the orientation of the photo does not converge: are the points the same in the photo and at the theodolite?"
    raise GeometryError(msg, points=sightings.ids, code="not-converged")


def _start(sightings: Sightings, used: Flags, interior: Floats) -> Floats:
    """Angles from the rotation that brings the rays closest to the directions; level where that is not determined."""
    ray = normal_case.rays(sightings.xz - interior[1:3], interior[0])
    both = used & sightings.measured.all(axis=1)
    if both.sum() >= LEAST_POINTS:
        unit = ray[both] / np.linalg.norm(ray[both], axis=1, keepdims=True)
        left, size, right = np.linalg.svd(normal_case.vectors_of(sightings.directions[both]).T @ unit)
        if size[1] > 1e-9 * size[0]:  # two different directions
            sign = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
            return normal_case.angles_of(left @ sign @ right)
    across = normal_case.directions_of(ray @ normal_case.GROUND_FROM_HOUSE.T)[:, 0]
    turned = (sightings.directions[:, 0] - across)[used & sightings.measured[:, 0]]
    if not len(turned):
        return np.zeros(3)
    return np.array([np.arctan2(np.sin(turned).mean(), np.cos(turned).mean()), 0.0, 0.0])


def _from_the_axes(ray: Floats, distances: Floats, eccentricity: float) -> Floats:
    """Rays (n, 3) as they are from the axes of the theodolite, with the front nodal point ahead of them.

    The point is `distances` from the axes and t from the node, on the ray r: e + t r / |r|, e along the optical axis;
    that is the ray with the principal distance f + e |r| / t.
    """
    length = np.linalg.norm(ray, axis=1)
    along = -eccentricity * ray[:, 2] / length  # e . r / |r|
    from_node = np.sqrt(distances**2 - eccentricity**2 + along**2) - along
    found = ray.copy()
    found[:, 2] -= eccentricity * length / from_node
    return found


def _linearised(sightings: Sightings, values: Floats, active: Numbers, eccentricity: float) -> _System:
    """Directions of all points under the present orientation, and their derivatives."""
    alpha, omega, kappa, f = values[:4]
    turn = normal_case.ground_from_photo(alpha, omega, kappa)
    ray = normal_case.rays(sightings.xz - values[4:6], f)
    if eccentricity:
        ray = _from_the_axes(ray, sightings.distances, eccentricity)
    ground = ray @ turn.T
    gradient = normal_case.direction_gradient(ground)
    # the roll turns the ray about the photo's third axis, the elevation about the ground's x axis before the azimuth
    about_vertical = (
        normal_case.ground_from_photo(alpha) @ normal_case.GROUND_FROM_HOUSE.T
    )  # adds alpha to every azimuth
    roll = np.cross([0.0, 0.0, 1.0], ray) @ turn.T
    tilt = np.cross([1.0, 0.0, 0.0], ray @ normal_case.ground_from_photo(0.0, omega, kappa).T) @ about_vertical.T
    by_photo = gradient @ turn
    design = np.empty((len(ray), 2, len(UNKNOWNS)))
    design[:, :, 0] = [1.0, 0.0]  # alpha is added to every azimuth
    design[:, :, 1] = np.einsum("nij,nj->ni", gradient, tilt)
    design[:, :, 2] = np.einsum("nij,nj->ni", gradient, roll)
    design[:, :, 3] = -by_photo[:, :, 2]
    design[:, :, 4:6] = -by_photo[:, :, :2]
    risen = np.column_stack([np.zeros(len(ray)), np.nan_to_num(sightings.distances) / (2 * EARTH_RADIUS)])
    design[:, :, 6] = -risen
    miss = sightings.directions - (normal_case.directions_of(ground) - values[6] * risen)
    miss[:, 0] = (miss[:, 0] + np.pi) % (2 * np.pi) - np.pi
    return _System(design[:, :, active], miss, _weights(sightings, by_photo[:, :, :2]))


def _weights(sightings: Sightings, by_xz: Floats) -> Floats:
    """Inverse covariance of the misclosures of each point; zero where a direction was not measured."""
    covariance = np.einsum("nij,nj,nkj->nik", by_xz, sightings.sigma_xz**2, by_xz)
    covariance[:, [0, 1], [0, 1]] += sightings.sigma_directions**2
    there = sightings.measured
    partial = ~there.all(axis=1)
    covariance[partial, 0, 1] = covariance[partial, 1, 0] = 0.0
    covariance[:, [0, 1], [0, 1]] = np.where(there, covariance[:, [0, 1], [0, 1]], 1.0)
    return np.asarray(np.linalg.inv(covariance) * (there[:, :, None] & there[:, None, :]), float)


def _normal(system: _System, used: Flags) -> tuple[Floats, Floats]:
    weighted = np.einsum("niu,nij->nuj", system.design[used], system.weight[used])
    miss = np.nan_to_num(system.misclosure[used])
    return np.einsum("nuj,njv->uv", weighted, system.design[used]), np.einsum("nuj,nj->u", weighted, miss)


def _condition(normal: Floats, names: Sequence[str], sightings: Sightings) -> float:
    """Condition number of the scaled equations; refuse what is not determined and say which unknowns."""
    length = np.sqrt(np.diag(normal))
    if not length.all():
        lost = [name for name, each in zip(names, length, strict=True) if not each]
        raise _undetermined(lost, sightings)
    values, vectors = np.linalg.eigh(normal / np.outer(length, length))
    condition = float(np.sqrt(values[-1] / max(values[0], SINGULAR)))
    if condition > WORST_CONDITION:
        share = np.abs(vectors[:, 0])
        raise _undetermined([n for n, each in zip(names, share, strict=True) if each > 0.3 * share.max()], sightings)
    return condition


def _undetermined(lost: Sequence[str], sightings: Sightings) -> GeometryError:
    separate = f"separate {', '.join(lost[:-1])} and {lost[-1]}"
    what = separate if len(lost) > 1 else f"determine {lost[0]}"
    msg = f"the points cannot {what}: measure points farther apart in the photo, or hold an element fixed"
    return GeometryError(msg, points=sightings.ids, code="undetermined")


def _result(
    sightings: Sightings,
    used: Flags,
    names: tuple[str, ...],
    values: Floats,
    active: Numbers,
    condition: float,
    eccentricity: float,
) -> PhotoOrientation:
    system = _linearised(sightings, values, active, eccentricity)
    normal, _ = _normal(system, used)
    cofactors = np.asarray(np.linalg.inv(normal), float)
    miss = np.nan_to_num(system.misclosure)
    squares = np.einsum("ni,nij,nj->n", miss, system.weight, miss)
    # redundancy number: diagonal of I - A Q A^T P
    hat = np.einsum("niu,uv,njv,njk->nik", system.design, cofactors, system.design, system.weight)
    redundancy = np.where(sightings.measured & used[:, None], 1.0 - hat[:, [0, 1], [0, 1]], np.nan)
    values = values.copy()
    values[:3] = normal_case.angles_of(normal_case.ground_from_photo(*values[:3]))
    return PhotoOrientation(
        names=names,
        values=values[active],
        cofactors=cofactors,
        principal_distance=float(values[3]),
        principal_point=(float(values[4]), float(values[5])),
        refraction=float(values[6]),
        residuals=-system.misclosure,
        redundancy=redundancy,
        used=used,
        weighted_sum=float(squares[used].sum()),
        dof=int(sightings.measured[used].sum()) - len(names),
        condition=condition,
    )


def _worst(solution: PhotoOrientation, sightings: Sightings, settings: OrientationSettings) -> Rejection | None:
    """Find the point that fits worst, if it should be taken out.

    The drop of the weighted sum of squares when a point is deleted is v^T (C - A Q A^T)^-1 v, exactly the sum of
    squares of its own predicted residuals.
    """
    if solution.dof < 2 or solution.weighted_sum < NEGLIGIBLE_SQUARES:
        return None
    rows = np.flatnonzero(solution.used)
    drop, parts = _drops(solution, sightings, rows, settings.eccentricity)
    left = solution.dof - parts
    testable = (left >= 1) & (sightings.measured[rows].sum(axis=1) == parts)
    if not testable.any():
        return None
    level = settings.significance / len(rows)
    if settings.screening == "stated":
        limits = np.array([chi2_quantile(1 - level, int(k)) if k else np.inf for k in parts])
        ratio = np.where(testable, drop / limits, 0.0)
        worst = int(np.argmax(ratio))
        if ratio[worst] <= 1:
            return None
        return Rejection(
            kind="direction",
            row=int(rows[worst]),
            test="stated",
            value=float(drop[worst]),
            limit=float(limits[worst]),
        )
    p_values = np.ones(len(rows))
    for number in np.flatnonzero(testable):
        rest = max((solution.weighted_sum - drop[number]) / left[number], np.finfo(float).tiny)
        p_values[number] = f_p_value(drop[number] / parts[number] / rest, int(parts[number]), int(left[number]))
    worst = int(np.lexsort([-drop, p_values])[0])  # of p values that are all zero the largest drop
    if p_values[worst] >= level:
        return None
    return Rejection(kind="direction", row=int(rows[worst]), test="deletion", value=float(p_values[worst]), limit=level)


def _drops(
    solution: PhotoOrientation, sightings: Sightings, rows: Numbers, eccentricity: float
) -> tuple[Floats, Numbers]:
    """By how much the sum of squares falls without each point, and with how many degrees of freedom."""
    values = [*solution.values[:3], solution.principal_distance, *solution.principal_point, solution.refraction]
    active = np.flatnonzero([name in solution.names for name in UNKNOWNS])
    system = _linearised(sightings, np.array(values), active, eccentricity)
    drop, parts = np.zeros(len(rows)), np.zeros(len(rows), np.intp)
    for number, row in enumerate(rows):
        measured = sightings.measured[row]
        weight = system.weight[row][np.ix_(measured, measured)]
        design, miss = system.design[row][measured], system.misclosure[row][measured]
        covariance = np.linalg.inv(weight) - design @ solution.cofactors @ design.T
        size, axes = np.linalg.eigh((covariance + covariance.T) / 2)
        controlled = size > 1e-9 * np.abs(np.linalg.inv(weight)).max()  # the rest is not controlled at all
        drop[number] = float((((axes.T @ miss)[controlled]) ** 2 / size[controlled]).sum())
        parts[number] = int(controlled.sum())
    return drop, parts
