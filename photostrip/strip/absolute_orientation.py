"""Absolute orientation: the formed strip brought to the control, in the intermediate frame.

A control point gives up to three coordinates in its own ground frame. Each given coordinate is one observation: the
strip point must agree with it along that axis of the ground frame at that place. So plan-only and
height-only points, grids whose axes turn along the strip, and points given in several zones all come in by one rule:
the *target* of a strip point is the point itself with the given coordinates put in place of its own.

Source: [001] eq. 142-149; mixed control and its weights are derived.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import EARTH_RADIUS, IntermediateFrame
from photostrip.geometry.rotation import cross_matrix, from_vector
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS as PARAMETERS
from photostrip.geometry.similarity import Similarity, Spread, collinearity
from photostrip.notes import listed
from photostrip.points import ControlPoints

LARGEST_SCALE_STEP = 5.0  # of the logarithm of the scale, in one iteration
ITERATIONS = 50
CONVERGED = 1e-10  # of the strip's half length; the next step would be its square
LAST_AXES_UPDATE = 2  # iteration; afterwards the directions of the ground axes no longer change
# smallest over largest singular value: a motion of the strip of which the control sees a thousandth
LEAST_MOTION = 1e-3
WEAK_LIMIT = 1 / 8  # well spread control has about 1; at an eighth errors of the control grow eightfold somewhere
MOST_OFF = 0.2  # of half the strip's length, of half of the control: an error of ids or of the place
OFF_LINE = 0.1  # breadth of given coordinates on a line over that of the strip's points, as parts of their lengths
LEAST_WITH_ONE_FAR = 3  # control points: of three none is far from two others
ALONE = 5.0  # times as far from the middle as any other control point: a strip is no longer than its control
IDS_NAMED = 6  # in a message
PLAN, HEIGHT = slice(0, 2), 2


@dataclass(frozen=True)
class AbsoluteSettings:
    """How the Earth's shape enters, and what the control weighs."""

    # ``"auto"`` or ``"none"``: the frames carry it (``local`` is truly Cartesian); ``"model"``: eq. 153, for plane map
    # coordinates of unknown projection given as ``local``; ``"image"``: in image space
    earth_curvature: str = "auto"
    earth_radius: float = EARTH_RADIUS  # radius in metres for ``"model"``
    control_weights: str = "stated"  # by standard deviations, or ``"equal"``: each coordinate that counts alike


@dataclass(frozen=True, eq=False)
class Targets:
    """Control points and what an intermediate frame makes of them."""

    control: ControlPoints  # the points, none of them a check point
    frames: Sequence[GroundFrame]  # ground frames the points refer to
    intermediate: IntermediateFrame  # the frame in which the strip is oriented
    known: Floats | None = None  # (n, 3): ``of_full`` of these points, where they are some of others that have it

    def of(self, xyz: Floats) -> Floats:
        """Targets of the control points: their present positions, with all given coordinates put in."""
        result = self.of_full.copy()
        if len(partly := self._partly):
            result[partly] = self._put_in(partly, self.intermediate.cartesian_from_intermediate(xyz[partly]))
        return self.intermediate.intermediate_from_cartesian(result)

    @cached_property
    def _partly(self) -> Numbers:
        """Points of which some coordinates count only."""
        return np.flatnonzero(~self.control.use.all(axis=1))

    @cached_property
    def of_full(self) -> Floats:
        """Cartesian targets (n, 3) of the points whose three coordinates count, wherever the strip stands."""
        if self.known is not None:
            return self.known
        result = np.zeros((len(self.control), 3))
        full = np.flatnonzero(self.control.use.all(axis=1))
        result[full] = self._put_in(full, None)
        return result

    def _put_in(self, points: Numbers, cartesian: Floats | None) -> Floats:
        """Put the given coordinates of points into their present positions, which full points need not have."""
        result = np.empty((len(points), 3))
        for number, frame in enumerate(self.frames):
            inside = np.flatnonzero(self.control.frame[points] == number)
            rows = points[inside]
            if len(rows):
                ids, ground = [self.control.ids[row] for row in rows.tolist()], self.control.enu[rows]
                if cartesian is not None:
                    present = frame.ground_from_cartesian(cartesian[inside], ids=ids)
                    ground = np.where(self.control.use[rows], ground, present)
                result[inside] = frame.cartesian_from_ground(ground, ids=ids)
        return result

    def axes(self, xyz: Floats) -> Floats:
        """Directions (n, 3, 3) along which the control points at positions (n, 3) are compared with the strip.

        Rows are unit vectors in the intermediate frame: the point's ground axes; east, north and up for geocentric
        points, whose coordinates come three together.
        """
        cartesian = self.intermediate.cartesian_from_intermediate(xyz)
        return self._by_frame(cartesian, lambda frame, points: frame.level_axes_at(points)) @ self.intermediate.axes

    def turned(self, xyz: Floats) -> ControlPoints:
        """Return the control with its standard deviations along ``axes``; they differ for geocentric coordinates."""
        if not any(frame.kind == "geocentric" for frame in self.frames):
            return self.control
        cartesian = self.intermediate.cartesian_from_intermediate(xyz)
        turn = self.axes(xyz) @ self.intermediate.axes.T  # compared axes in the Cartesian frame
        given = self._by_frame(cartesian, lambda frame, points: frame.axes_at(points))
        share = np.einsum("nij,nkj->nik", turn, given) ** 2  # the identity but for geocentric points
        sigma = np.where(self.control.use, self.control.sigma, 0.0)
        return replace(self.control, sigma=np.sqrt(np.einsum("nik,nk->ni", share, sigma**2)))

    def _by_frame(self, cartesian: Floats, directions: Callable[[GroundFrame, Floats], Floats]) -> Floats:
        """Collect directions at points from the ground frame of each."""
        result = np.empty((len(cartesian), 3, 3))
        for number, frame in enumerate(self.frames):
            rows = self.control.frame == number
            if rows.any():
                result[rows] = directions(frame, cartesian[rows])
        return result

    def misclosures(self, xyz: Floats, axes: Floats) -> Floats:
        """Present minus given coordinates, along the ``axes`` there; 0 where a coordinate does not count."""
        return np.where(self.control.use, np.einsum("nij,nj->ni", axes, xyz - self.of(xyz)), 0.0)


@dataclass(frozen=True, eq=False)
class AbsoluteOrientation:
    """The similarity from the strip to the intermediate frame, and how well it fits."""

    similarity: Similarity  # strip to intermediate frame
    axes: Floats  # (n, 3, 3): those along which strip and control are compared (``Targets.axes``), after the similarity
    misclosures: Floats  # (n, 3): strip minus control along them in metres; 0 where a coordinate does not count
    # standard deviation of unit weight, without unit (1 when the strip fits within the sigmas of the control and the
    # a-priori precision of its points); NaN without redundancy
    sigma0: float
    redundancy: int
    condition: float  # largest over smallest singular value of the design for motions of the strip of the same size
    iterations: int


class PointPrecision(NamedTuple):
    """A-priori standard deviations of a point of one model, metres, or in the unit of a strip not yet on the ground."""

    plan: float
    height: float

    def at(self, scale: float) -> PointPrecision:
        return PointPrecision(self.plan * scale, self.height * scale)


def weights(control: ControlPoints, precision: PointPrecision, kind: str = "stated") -> Floats:
    """Weights 1/(sigma_control^2 + sigma_point^2) of the control coordinates against the strip, (n, 3), metres^-2.

    They are 0 where a coordinate does not count. The standard deviations of the control are those along the axes
    compared (``Targets.turned``); `precision` has those of a strip point in plan and in height, a priori.
    kind: ``"equal"``, as [001] eq. 149 has them: the mean of the variances in the place of each.
    """
    point = np.array([precision.plan, precision.plan, precision.height])
    variance = control.sigma**2 + point**2
    if kind == "equal":
        variance = np.where(control.use, variance[control.use].mean(), np.nan)
    return np.where(control.use, 1 / variance, 0.0)


class Laid(NamedTuple):
    """A strip on its control."""

    similarity: Similarity  # strip to intermediate frame
    values: Floats  # (7,): singular values of the design of the last step, for motions of unit size
    iterations: int


def lay(
    strip: Floats,
    targets: Targets,
    weight: Floats,
    reach: Floats | None = None,
    watch: Callable[[Similarity, Floats], None] | None = None,
    known: Floats | None = None,
    enough: float = CONVERGED,
) -> Laid:
    """Similarity of the strip on its control.

    strip: (n, 3), strip coordinates of the control points.
    weight: (n, 3), weights of their coordinates, metres^-2.
    reach: (q, 3), optional, all points of the strip, strip coordinates. What the control must determine is their
        position: control far along a narrow strip is enough when it spans the strip's width. Without them a square of
        the control's length counts.
    watch: called at every step with the similarity before it and the step (7,), metres at the end of the strip.
    known: (n, 3, 3), optional, axes along which strip and control are compared (``Targets.axes``).
    enough: of the strip's half length: the last step is smaller.
    Raises GeometryError when the control does not determine seven parameters; the free motion is named.
    Raises InputError when the strip comes out upside down: the control is left-handed.

    Source: [001] eq. 145-149; start from the closed form of the full points, or from plan and height apart.
    """
    _refuse_too_few(targets.control)
    similarity = _start(strip, targets, weight)
    xyz = similarity(strip)
    _refuse_given_on_line(strip, targets.of(xyz), targets.control)
    half = max(float(np.ptp(xyz, axis=0).max()) / 2, 1e-6)
    axes = targets.axes(xyz) if known is None else known
    spread = None if reach is None else Spread.of(reach)
    share = np.sqrt(weight[targets.control.use])
    before, step, squares = similarity, np.zeros(PARAMETERS), np.inf
    for iteration in range(1, ITERATIONS + 1):
        xyz = similarity(strip)
        if iteration == LAST_AXES_UPDATE and known is None:
            axes, squares = targets.axes(xyz), np.inf
        plain, free = design(xyz, targets, axes, half)
        found = float(np.square(free * share).sum())
        if found > squares + np.square(enough * half * share).sum():  # too long: control kilometres off bends the rest
            step = step / 2
        else:
            before, squares = similarity, found
            root = np.eye(PARAMETERS) if spread is None else spread.motion(similarity, xyz.mean(axis=0), half)
            values = _refuse_deficient(plain, root, xyz, targets, half)  # weights do not decide what is free
            step = np.asarray(np.linalg.lstsq(plain * share[:, None], free * share, rcond=None)[0], float)
            if watch is not None:
                watch(similarity, step)
        similarity = corrected(before, step, before(strip).mean(axis=0), half)
        if np.abs(step).max() < enough * half:
            break
    if similarity.rotation[2, 2] < 0:
        given = targets.of(similarity(strip))
        if collinearity(given) < WEAK_LIMIT**2:
            raise _on_line(given, targets.control)  # a line fits upside down as well as upright
        xyz = similarity(strip)
        off = np.median(np.linalg.norm(targets.misclosures(xyz, targets.axes(xyz)), axis=1))
        if off > MOST_OFF * half:
            message = (
                f"the strip does not fit its control: half of the points are more than {off:.4g} m off, and the strip "
                f"is {2 * half:.4g} m long; do ids and coordinates belong to the points that were measured?"
            )
            raise GeometryError(message, points=targets.control.ids, code="control-of-other-points")
        message = "the strip fits the control only upside down: control or image coordinates are left-handed"
        expected = "`axes: [north, east, up]` where x is north, else the y axis of the photos as it was measured"
        raise InputError(Fault(message, code="left-handed-control", key="control.axes", expected=expected))
    return Laid(similarity, values, iteration)


def orient(strip: Floats, targets: Targets, weight: Floats, reach: Floats | None = None) -> AbsoluteOrientation:
    """Lay the strip on its control, and say how well it fits."""
    laid = lay(strip, targets, weight, reach)
    xyz = laid.similarity(strip)
    axes = targets.axes(xyz)
    misclosures = targets.misclosures(xyz, axes)
    redundancy = int(targets.control.use.sum()) - PARAMETERS
    squares = float((weight * misclosures**2).sum())
    return AbsoluteOrientation(
        similarity=laid.similarity,
        axes=axes,
        misclosures=misclosures,
        sigma0=float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan"),
        redundancy=redundancy,
        condition=float(laid.values[0] / laid.values[-1]),
        iterations=laid.iterations,
    )


def _refuse_too_few(control: ControlPoints) -> None:
    plan, height = int(control.use[:, 0].sum()), int(control.use[:, HEIGHT].sum())
    if plan >= 2 and height >= 3:
        return
    msg = (
        "absolute orientation needs at least 2 control points in plan and 3 in height on the strip, not on one line; "
        f"there are {plan} in plan and {height} in height"
    )
    heights = [name for name, used in zip(control.ids, control.use[:, HEIGHT], strict=True) if used]
    if plan >= 2 and height == 2:
        msg += f": the rotation about the line of control points {heights[0]} and {heights[1]} stays free"
    raise GeometryError(msg, points=control.ids, code="too-little-control")


def _refuse_given_on_line(strip: Floats, given: Floats, control: ControlPoints) -> None:
    """Refuse control whose given coordinates lie on one line, although the strip has its points beside it.

    strip, given: (n, 3), strip coordinates and targets of the control points. Where the points of the strip lie on a
    line as well, the rank of the design decides.
    """
    spread = collinearity(given)
    if spread < LEAST_MOTION**2 < collinearity(strip) and spread < OFF_LINE**2 * collinearity(strip):
        raise _on_line(given, control)


def _on_line(given: Floats, control: ControlPoints) -> GeometryError:
    """Say that control lies on a line, or which point lies so far off that all others are one place beside it."""
    away = np.linalg.norm(given - np.median(given, axis=0), axis=1)
    far, others = int(away.argmax()), float(np.delete(away, away.argmax()).max(initial=0.0))
    if len(away) > LEAST_WITH_ONE_FAR and away[far] > ALONE * others:
        times = away[far] / max(others, 1e-6)
        message = (
            f"absolute orientation: control point {control.ids[far]} lies {away[far] / 1000:.4g} km from the middle of "
            f"the control, {times:.0f} times as far as any other: one of its coordinates is wrong"
        )
        return GeometryError(message, points=(control.ids[far],), code="control-deficient")
    message = (
        "absolute orientation: the control does not determine the rotation about the line of control points "
        f"{listed(control.ids, IDS_NAMED)}: their given coordinates lie on it"
    )
    return GeometryError(message, points=control.ids, code="control-deficient")


def _start(strip: Floats, targets: Targets, weight: Floats) -> Similarity:
    """Similarity to start from: closed form of the full points, else plan and height apart."""
    full = targets.control.use.all(axis=1)
    if full.sum() >= 3 and collinearity(strip[full]) > LEAST_MOTION**2:
        return Similarity.from_points(strip[full], targets.of(strip)[full], weight[full].mean(axis=1))
    return _start_apart(strip, targets)


def _start_apart(strip: Floats, targets: Targets) -> Similarity:
    """Four parameters from the plan, then three from the heights, for a strip that is nearly level."""
    plan, height = targets.control.use[:, 0], targets.control.use[:, HEIGHT]
    target = targets.of(np.zeros_like(strip))[plan]  # at sea
    z = strip[plan, 0] + 1j * strip[plan, 1]
    t = target[:, 0] + 1j * target[:, 1]
    dz = z - z.mean()
    if np.abs(dz).max() <= 1e-6 * np.ptp(strip, axis=0).max():
        names = ", ".join(name for name, used in zip(targets.control.ids, plan, strict=True) if used)
        msg = f"absolute orientation: control points {names} lie at one place in plan: scale and azimuth stay free"
        raise GeometryError(msg, points=targets.control.ids, code="control-deficient")
    turn = (dz.conj() @ (t - t.mean())) / (dz.conj() @ dz).real
    scale, angle = abs(turn), np.angle(turn)
    shift = t.mean() - turn * z.mean()
    level = Similarity(scale, from_vector([0.0, 0.0, angle]), np.array([shift.real, shift.imag, 0.0]))
    xyz = level(strip)
    rise = targets.of(xyz)[height, 2] - xyz[height, 2]
    x, y = (xyz[height, axis] - xyz[height, axis].mean() for axis in (0, 1))
    (up, along, across), *_ = np.linalg.lstsq(np.column_stack([np.ones(len(x)), x, y]), rise, rcond=1e-6)
    tilt = from_vector([np.arctan(across), -np.arctan(along), 0.0])
    center = np.array([xyz[height, 0].mean(), xyz[height, 1].mean(), 0.0])
    rotation = tilt @ level.rotation
    middle = level.inverse(center[None, :])[0]
    return Similarity(scale, rotation, center + np.array([0.0, 0.0, up]) - scale * rotation @ middle)


def design(xyz: Floats, targets: Targets, axes: Floats, half: float) -> tuple[Floats, Floats]:
    """Design and free terms of one step: shifts, rotations, scale, all in metres at the strip's end."""
    arm = (xyz - xyz.mean(axis=0)) / half
    columns = np.empty((len(xyz), 3, PARAMETERS))
    columns[:, :, :3] = axes
    columns[:, :, 3:6] = axes @ -cross_matrix(arm)  # axes . (theta x arm)
    columns[:, :, 6] = np.einsum("nij,nj->ni", axes, arm)
    free = -np.einsum("nij,nj->ni", axes, xyz - targets.of(xyz))
    used = targets.control.use
    return columns[used], free[used]


def corrected(similarity: Similarity, step: Floats, center: Floats, half: float) -> Similarity:
    """Compose the similarity with a small one about a centre."""
    turn = from_vector(step[3:6] / half)
    # control that is wrong beyond measure asks for steps that no number holds
    growth = float(np.exp(np.clip(step[6] / half, -LARGEST_SCALE_STEP, LARGEST_SCALE_STEP)))
    shift = center + step[:3] + growth * turn @ (similarity.shift - center)
    u, _, vt = np.linalg.svd(turn @ similarity.rotation)  # without the rounding that many small rotations leave
    return Similarity(similarity.scale * growth, u @ vt, shift)


def _refuse_deficient(design: Floats, root: Floats, xyz: Floats, targets: Targets, half: float) -> Floats:
    """Raise when the control leaves a motion free, and name that motion.

    Returns the singular values (7,) of the design for motions of unit size: how much of each the control sees.
    """
    scaled = np.linalg.solve(root, design.T).T
    values = np.linalg.svd(scaled, compute_uv=False)
    if len(values) == PARAMETERS and values[-1] > LEAST_MOTION * values[0]:
        return np.asarray(values, float)
    # the triangular factor has the same directions, however many control points there are
    _, _, vt = np.linalg.svd(np.linalg.qr(scaled, mode="r") if len(scaled) > PARAMETERS else scaled)
    free = free_motion(np.linalg.solve(root.T, vt[-1]), xyz, targets.control, half)
    msg = f"absolute orientation: the control does not determine {free}"
    raise GeometryError(msg, points=targets.control.ids, code="control-deficient")


def free_motion(direction: Floats, xyz: Floats, control: ControlPoints, half: float) -> str:
    """Name a motion of the strip that the control leaves free.

    For example ``"the rotation about the line of control points A1, A4"``.

    direction: (7,), shifts, rotations and scale of the motion, as in the design of the orientation.
    half: half length of the strip in metres.
    """
    shift, turn, growth = direction[:3], direction[3:6], direction[6]
    sizes = np.array([np.linalg.norm(shift), np.linalg.norm(turn), abs(growth)])
    if sizes[2] > 0.7 * np.linalg.norm(sizes):
        return "the scale"
    if sizes[1] < 0.3 * np.linalg.norm(sizes):
        return "the height" if abs(shift[2]) > np.hypot(shift[0], shift[1]) else "the plan position"
    axis = turn / sizes[1]
    foot = np.cross(turn, shift) / sizes[1] ** 2  # a point of the axis, from the centre, in half lengths
    offset = np.linalg.norm(np.cross((xyz - xyz.mean(axis=0)) / half - foot, axis), axis=1)
    near = [name for name, distance in zip(control.ids, offset, strict=True) if distance < 0.02]  # noqa: PLR2004
    if len(near) >= 2:
        return f"the rotation about the line of control points {listed(near, IDS_NAMED)}"
    if abs(axis[2]) > 0.7:  # noqa: PLR2004
        return "the azimuth (rotation about the vertical)"
    return "the rotation about the flight line" if abs(axis[0]) > abs(axis[1]) else "the tilt along the flight line"
