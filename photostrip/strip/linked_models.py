"""What is asked of the links between independent models.

Links of neighbouring models: a similarity in space over their common points and their common perspective centre.

Every model has a system of its own. A link takes the coordinates of the second model into the system of the first. Both
were measured, so a difference has the variance of both; plan and height of a model have different ones, in the axes of
its own system. The estimate starts from the closed form, which needs no approximation whatever the rotation. All links
of a strip are solved together, in one batch.

Source: [001] eq. 145-149 for the similarity; weights and iteration derived, see docs/independent-models.md.

Gross errors in links: common points that contradict the others, and models of the other hand.

A point is tested as a whole, plan and height of both models together, by the squares that go when it is left out. One
point of a link goes at a time, the worst first. Where two points explain the same contradiction equally well, none goes
and both are named: with three points and a centre that happens.

Source: [Baarda 1968]; order and limits derived, see docs/independent-models.md.

Forming a strip of independent models: each takes its place from the one before it.

The links stand one behind the other, as scale transfers do in the strip of partially dependent models; a point of
several models is the mean of its positions. The strip is turned so that its first axis runs from the first model to
the last and its third one from the points to the perspective centres, whatever the axes of the plotter were.

Source: [001] for the chain; seven parameters in place of one derived, see docs/independent-models.md.

Perspective centres under a polynomial: they follow the ground below them as a stiff body would.

A strip polynomial says how the ground of a strip moves. A perspective centre stands high above it and moves with the
model around it: the shift of the ground below, a tilt by the slope of the height correction, and a change of the flying
height with the scale.

Source: derived; see docs/independent-models.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_vector
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.notes import counted
from photostrip.rejection import Rejection
from photostrip.statistics import chi2_quantile
from photostrip.strip.polynomial import POWERS

METHODS = ("auto", "none")


@dataclass(frozen=True)
class LinkSettings:
    """How models are joined by similarities."""

    screening: str = "auto"  # ``"auto"`` or ``"none"``
    alpha: float = 0.01  # probability of rejecting anything in the links of a strip without gross errors
    # keep, drop: coordinates, ``model/point`` or ``model/photo``, that take part whatever the test says, or not at all
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()


LEAST_COMMON = 3
ITERATIONS, CONVERGED = 20, 1e-12
THIN = 1e-3  # second over first extent of common points below which they stand on one line
HELD = 1e-6  # redundancy of a direction below which nothing checks it
LARGEST_STEP = 2.0  # of an iteration, in rotation (radians) and logarithm of the scale


@dataclass(frozen=True, eq=False)
class StripModels:
    """Models of one strip, in flight order."""

    count: int
    points: int  # nodes below this number are points, the others perspective centres
    row: Numbers  # (n,): rows of the project's ``points.ModelPoints``
    # model, node: (n,): place of the model in the strip, and point or centre, of each row
    model: Numbers
    node: Numbers
    # xyz, sigma: (n, 3): model coordinates and their standard deviations, mm
    xyz: Floats
    sigma: Floats


@dataclass(frozen=True, eq=False)
class CommonPoints:
    """Points and centres that neighbouring models have in common; link i takes model i + 1 into model i."""

    link: Numbers  # (t,): link of each row, ascending
    # before, after: (t,): rows of ``StripModels`` in the model before and in the one after
    before: Numbers
    after: Numbers
    count: int

    def sums(self, values: Floats) -> Floats:
        """Add up values of rows, shape (t, ...), for each link."""
        total = np.zeros((self.count, *values.shape[1:]))
        np.add.at(total, self.link, values)
        return total


@dataclass(frozen=True, eq=False)
class Similarities:
    """One similarity ``target = scale rotation source + shift`` for each link."""

    scale: Floats  # (j,): scales
    rotation: Floats  # (j, 3, 3): rotations
    shift: Floats  # (j, 3): shifts

    def of(self, number: Numbers, xyz: Floats) -> Floats:
        """Transform points, each by the similarity of its number."""
        moved: Floats = (
            self.scale[number, None] * np.einsum("nij,nj->ni", self.rotation[number], xyz) + self.shift[number]
        )
        return moved


@dataclass(frozen=True, eq=False)
class SolvedLinks:
    """Links after least squares."""

    similarities: Similarities  # from the model after each link into the model before it
    # (t, 3): coordinates in the model before minus those taken over from the model after, mm, also of rows not used
    residual: Floats
    weight: Floats  # (t, 3, 3): inverse covariances of the residuals' observations, mm^-2
    # (t, 3, 7): derivatives of the point taken over by shift, rotation and logarithm of the scale about the link's
    # centroid
    design: Floats
    cofactors: Floats  # (j, 7, 7): of these parameters
    centroid: Floats  # (j, 3): centroids in the model before, mm
    squares: Floats  # (j,): weighted squares of the rows used
    redundancy: Numbers  # (j,): three for every row used, minus seven


def common(models: StripModels) -> CommonPoints:
    """Find what neighbouring models have in common; a point of models i and i + 2 alone links nothing."""
    order = np.lexsort((models.model, models.node))
    model, node = models.model[order], models.node[order]
    both = np.flatnonzero((node[1:] == node[:-1]) & (model[1:] == model[:-1] + 1))
    before, after = order[both], order[both + 1]
    link = models.model[before]
    by_link = np.argsort(link, kind="stable")
    return CommonPoints(
        link=link[by_link], before=before[by_link], after=after[by_link], count=max(models.count - 1, 0)
    )


def closed_form(shared: CommonPoints, models: StripModels, share: Floats) -> tuple[Similarities, Floats]:
    """Similarities by singular values, from the model after into the model before, with weights ``share`` of the rows.

    Also the sums of squares (j, 2) that the best similarity leaves, and the best one of the other hand, mm^2.
    Source: [001] eq. 145-149; the determinant factor keeps reflections out, its opposite asks for one.
    """
    a, b = models.xyz[shared.before], models.xyz[shared.after]
    total = np.maximum(shared.sums(share), 1e-300)[:, None]
    mean_a, mean_b = (shared.sums(share[:, None] * each) / total for each in (a, b))
    da, db = a - mean_a[shared.link], b - mean_b[shared.link]
    cross = shared.sums(share[:, None, None] * da[:, :, None] * db[:, None, :])
    u, values, vt = np.linalg.svd(cross)
    sign = np.ones((shared.count, 3))
    sign[:, 2] = np.sign(np.linalg.det(u @ vt))
    size_a, size_b = (shared.sums(share * (each**2).sum(axis=1)) for each in (da, db))
    rotation = (u * sign[:, None, :]) @ vt
    along = np.column_stack([(values * sign).sum(axis=1), (values * sign * [1, 1, -1]).sum(axis=1)])
    scale = along[:, 0] / np.maximum(size_b, 1e-300)
    shift = mean_a - scale[:, None] * np.einsum("jik,jk->ji", rotation, mean_b)
    squares = size_a[:, None] - along**2 / np.maximum(size_b, 1e-300)[:, None]
    return Similarities(scale, rotation, shift), np.maximum(squares, 0.0)


def either_hand(source: Floats, target: Floats) -> tuple[float, float]:
    """Find the sums of squares that the best similarity of two sets of points leaves, and the best reflected one."""
    a, b = target - target.mean(axis=0), source - source.mean(axis=0)
    u, values, vt = np.linalg.svd(a.T @ b)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    along = np.array([(values * sign).sum(), (values * sign * [1, 1, -1]).sum()])
    left = np.maximum((a**2).sum() - along**2 / (b**2).sum(), 0.0)
    return float(left[0]), float(left[1])


def extents(shared: CommonPoints, models: StripModels, used: Flags) -> Floats:
    """How far the common points of each link are from a line: second over first extent in the model before, (j,)."""
    a, share = models.xyz[shared.before], used.astype(float)
    mean = shared.sums(share[:, None] * a) / np.maximum(shared.sums(share), 1.0)[:, None]
    da = (a - mean[shared.link]) * share[:, None]
    values = np.linalg.svd(shared.sums(da[:, :, None] * da[:, None, :]), compute_uv=False)
    return np.asarray(np.sqrt(values[:, 1] / np.maximum(values[:, 0], 1e-300)), float)


def solve(shared: CommonPoints, models: StripModels, used: Flags) -> SolvedLinks:
    """Least squares of all links together; every link has at least three rows in use that are not on one line.

    Minimises v^T (C_a + s^2 R C_b R^T)^-1 v with v = a - (s R b + t): the coordinates of both models carry errors.
    """
    share = used.astype(float)
    found, _ = closed_form(shared, models, share)
    a, b = models.xyz[shared.before], models.xyz[shared.after]
    variance_a, variance_b = models.sigma[shared.before] ** 2, models.sigma[shared.after] ** 2
    count = np.maximum(shared.sums(share), 1.0)[:, None]
    centroid = shared.sums(share[:, None] * a) / count
    arm = a - centroid[shared.link]
    size = np.sqrt(np.maximum(shared.sums(share * (arm**2).sum(axis=1)) / count[:, 0], 1e-300))
    unit = np.ones((shared.count, SIMILARITY_PARAMETERS))
    unit[:, 3:] = 1 / size[:, None]  # rotation and scale move the points by as much as a shift
    for _ in range(ITERATIONS):
        turn = found.scale[shared.link, None, None] * found.rotation[shared.link]
        covariance = (turn * variance_b[:, None, :]) @ turn.transpose(0, 2, 1)
        covariance[:, range(3), range(3)] += variance_a
        weight = np.asarray(np.linalg.inv(covariance), float)
        moved = found.of(shared.link, b)
        residual, design = a - moved, similarity_derivatives(moved - centroid[shared.link], np.zeros(3))
        scaled = design * unit[shared.link][:, None, :]
        weighted = scaled.transpose(0, 2, 1) @ weight * share[:, None, None]
        normal, right = shared.sums(weighted @ scaled), shared.sums(np.einsum("tij,tj->ti", weighted, residual))
        inverse = np.linalg.inv(normal)
        step = np.einsum("jik,jk->ji", inverse, right) * unit
        found = _corrected(found, step, centroid)
        if np.abs(step / unit).max(initial=0.0) < CONVERGED * size.max(initial=1.0):
            break
    residual = a - found.of(shared.link, b)
    return SolvedLinks(
        similarities=found,
        residual=residual,
        weight=weight,
        design=design,
        cofactors=inverse * unit[:, :, None] * unit[:, None, :],
        centroid=centroid,
        squares=shared.sums(share * np.einsum("ti,tij,tj->t", residual, weight, residual)),
        redundancy=3 * shared.sums(share).astype(np.intp) - SIMILARITY_PARAMETERS,
    )


def _corrected(found: Similarities, step: Floats, centroid: Floats) -> Similarities:
    """Compose the similarities with small ones about the centroids."""
    turn = from_vector(np.clip(step[:, 3:6], -LARGEST_STEP, LARGEST_STEP))
    growth = np.exp(np.clip(step[:, 6], -LARGEST_STEP, LARGEST_STEP))
    arm = found.shift - centroid
    shift = centroid + step[:, :3] + growth[:, None] * np.einsum("jik,jk->ji", turn, arm)
    u, _, vt = np.linalg.svd(turn @ found.rotation)
    return Similarities(found.scale * growth, u @ vt, shift)


class PointTests(NamedTuple):
    """Tests of common points; P the weights, Q_v the cofactors of the residuals v."""

    value: Floats  # (t,): v^T P (P Q_v P)^-1 P v, chi-square with ``freedom`` degrees; NaN for rows not used
    # (t, 3): estimated gross error (P Q_v P)^-1 P v, mm in the model before; of rows not used their residual
    error: Floats
    freedom: Numbers  # (t,): directions in which the others check the point: 3, fewer where they hardly fix the link


def studentised(shared: CommonPoints, solved: SolvedLinks, used: Flags) -> PointTests:
    """Test every common point as a whole: how much of the squares goes when it is left out.

    Source: [Baarda 1968], the three coordinates of a point together.
    """
    values, axes = np.linalg.eigh(solved.weight)
    root = (axes * np.sqrt(values)[:, None, :]) @ axes.transpose(0, 2, 1)  # symmetric, root @ root = weight
    scaled = root @ solved.design
    reduced = np.eye(3) - scaled @ solved.cofactors[shared.link] @ scaled.transpose(0, 2, 1)
    left, directions = np.linalg.eigh(reduced)
    checked = left > HELD
    inverse = np.where(checked, 1 / np.where(checked, left, 1.0), 0.0)
    white = np.einsum("tij,tj->ti", root, solved.residual)
    parts = np.einsum("tji,tj->ti", directions, white) * inverse
    estimate = np.einsum("tij,tj->ti", directions, parts)
    value = (white * estimate).sum(axis=1)
    error = np.linalg.solve(root, estimate[:, :, None])[:, :, 0]
    return PointTests(
        value=np.where(used, value, np.nan),
        error=np.where(used[:, None], error, solved.residual),
        freedom=np.where(used, checked.sum(axis=1), 0).astype(np.intp),
    )


MEDIAN = 2.366  # of chi-square with three degrees of freedom
MEDIAN_SPREAD = 1.124  # standard deviation of the ratio of a sample's median to it, times the root of the sample's size
SURE_SIGMAS = 2.6  # standard deviations beyond which the stated precision is contradicted
EQUALLY_GOOD = 9.2  # difference of two test values below which the odds are less than one in a hundred
LEFT = 4  # common points, centre included, that a link keeps
REFLECTED = 0.1  # squares of the best similarity of the other hand over those of the best one
CONSPICUOUS = 36.0  # mean square in units of the stated variance that makes a reflection worth a look
DETECTED = 21.5  # non-centrality of chi-square with three degrees of freedom found in 80 % of cases at a level of 0.001


@dataclass(frozen=True, eq=False)
class ScreenedLinks:
    """Links with their gross errors taken out."""

    shared: CommonPoints
    used: Flags  # (t,): rows that took part
    solved: SolvedLinks
    # value, limit: (t,), (j,): test values of the rows used, and the critical value of each link
    value: Floats
    limit: Floats
    # rows of ``shared`` that were taken out, worst first; the size is the difference from what the other points of the
    # link say, mm along the axes of the model before
    rejections: tuple[Rejection, ...]
    doubtful: tuple[tuple[int, ...], ...]  # rows of which one is wrong and which one cannot be told
    # variance of the model coordinates over what is stated, with which the tests were made; 1 unless contradicted
    factor: float
    reflected: Flags = field(default_factory=lambda: np.zeros(0, bool))  # (j,): links whose models fit as mirror images


def reflected(shared: CommonPoints, models: StripModels, used: Flags) -> Flags:
    """Links whose models fit each other only as mirror images, shape (j,).

    The similarity of the other hand leaves a tenth of the squares, and the best proper one far too much. Three points,
    or points in one plane, fit both ways and are False.
    """
    share = used.astype(float)
    found, squares = closed_form(shared, models, share)
    variance = (models.sigma[shared.before] ** 2).sum(axis=1)
    variance += found.scale[shared.link] ** 2 * (models.sigma[shared.after] ** 2).sum(axis=1)
    expected = shared.sums(share * variance)
    return np.asarray((squares[:, 0] > CONSPICUOUS * expected) & (squares[:, 1] < REFLECTED * squares[:, 0]), bool)


def screen_links(shared: CommonPoints, models: StripModels, settings: LinkSettings, kept: Flags) -> ScreenedLinks:
    """Solve the links of a strip and take out what contradicts the rest, but for the rows ``kept`` (t,).

    Every link has three common rows that are not on one line.
    """
    used, log = np.ones(len(shared.link), bool), list[Rejection]()
    mirrored = reflected(shared, models, used)
    limit = _limits(shared, used, settings.alpha)
    open_links = np.ones(shared.count, bool)
    while True:
        solved = solve(shared, models, used)
        tests = studentised(shared, solved, used)
        factor = _scatter(tests, solved)
        if settings.screening == "none":
            break
        worst = _worst(shared, models, used, used & ~kept, tests.value / factor, limit, open_links)
        if not len(worst):
            break
        for row in worst.tolist():
            link = int(shared.link[row])
            x, y, z = tests.error[row].tolist()
            size = float(tests.value[row] / factor)
            log.append(
                Rejection(kind="link", row=row, test="link", value=size, limit=float(limit[link]), size=(x, y, z))
            )
        used = used.copy()
        used[worst] = False
    value = tests.value / factor
    doubtful = _doubtful(shared, value, limit) if settings.screening != "none" else ()
    log.sort(key=lambda each: -each.value)
    return ScreenedLinks(
        shared=shared,
        used=used,
        solved=solved,
        value=value,
        limit=limit,
        rejections=tuple(log),
        doubtful=doubtful,
        factor=factor,
        reflected=mirrored,
    )


def _scatter(tests: PointTests, solved: SolvedLinks) -> float:
    """Variance factor by the median test value; 1 unless the stated precision is contradicted."""
    known = tests.value[tests.freedom == 3]  # every direction of the point is checked
    independent = solved.redundancy.sum() / 3
    if len(known) < LEFT or independent < LEFT:
        return 1.0
    ratio = np.median(known) / MEDIAN
    return ratio if ratio > 1 + SURE_SIGMAS * MEDIAN_SPREAD / np.sqrt(independent) else 1.0


def _limits(shared: CommonPoints, used: Flags, alpha: float) -> Floats:
    """Critical value of each link: the level is shared out among all common points of the strip."""
    return np.full(shared.count, chi2_quantile(1 - alpha / max(int(used.sum()), 1), 3))


def _worst(
    shared: CommonPoints,
    models: StripModels,
    used: Flags,
    free: Flags,
    value: Floats,
    limit: Floats,
    open_links: Flags,
) -> Numbers:
    """One of the ``free`` rows of each link that must go; links that cannot tell it, or would break, are closed."""
    size = np.where(free & open_links[shared.link] & (value > limit[shared.link]), value, -np.inf)
    rows = []
    for link in np.unique(shared.link[np.isfinite(size)]).tolist():
        rows_of_link = np.flatnonzero(shared.link == link)
        row = int(rows_of_link[np.argmax(size[rows_of_link])])
        alone = used.copy()
        alone[row] = False
        rivals = rows_of_link[used[rows_of_link] & (rows_of_link != row)]
        equal = (value[row] - value[rivals] < EQUALLY_GOOD).any()
        if equal or len(rivals) < LEFT - 1 or extents(shared, models, alone)[link] < THIN:
            open_links[link] = False
        else:
            rows.append(row)
    return np.array(rows, np.intp)


def _doubtful(shared: CommonPoints, value: Floats, limit: Floats) -> tuple[tuple[int, ...], ...]:
    """Rows of each link of which one is wrong, the worst first."""
    beyond = np.flatnonzero(value > limit[shared.link])
    found = []
    for link in np.unique(shared.link[beyond]).tolist():
        rows_of_link = np.flatnonzero(shared.link == link)
        rows_of_link = rows_of_link[np.argsort(-np.nan_to_num(value[rows_of_link], nan=-np.inf), kind="stable")]
        near = rows_of_link[value[rows_of_link[0]] - value[rows_of_link] < EQUALLY_GOOD]
        found.append(tuple(near.tolist()))
    return tuple(found)


def detectable(shared: CommonPoints, screened: ScreenedLinks) -> Floats:
    """Smallest error of each common point that its link finds in 80 % of cases, mm, shape (t,).

    In the direction in which the link checks the point least; infinite where it does not, NaN for rows not used.
    """
    solved = screened.solved
    weight, design = solved.weight, solved.design
    reduced = weight - weight @ design @ solved.cofactors[shared.link] @ design.transpose(0, 2, 1) @ weight
    least = np.linalg.eigvalsh((reduced + reduced.transpose(0, 2, 1)) / 2)[:, 0]
    checked = least > HELD * np.trace(weight, axis1=1, axis2=2)
    size = np.where(checked, 1 / np.maximum(least, 1e-300), np.inf)
    return np.where(screened.used, np.sqrt(DETECTED * screened.factor * size), np.nan)


AGREE = 4.0  # times the critical value of a link, for positions that several links lie between
NAMED = 4


@dataclass(frozen=True, eq=False)
class FormedModels:
    """A strip of independent models, in the scale of its first one."""

    models: StripModels
    links: ScreenedLinks
    places: Similarities  # from each model to the strip
    model_xyz: Floats  # (n, 3): strip coordinates of every row, from its own model
    used: Flags  # (n,): rows that count
    node: Numbers  # (k,): points and centres of the strip, ascending
    node_xyz: Floats  # (k, 3): their strip coordinates, means over their models
    node_models: Numbers  # (k,): number of those models
    photos: Numbers  # (f,): node of the centre of each photo of the strip, in flight order

    @property
    def point(self) -> Numbers:
        """Numbers of the points, ascending, shape (q,)."""
        return self.node[: self._points]

    @property
    def xyz(self) -> Floats:
        """Strip coordinates of the points, shape (q, 3)."""
        return self.node_xyz[: self._points]

    @property
    def model_count(self) -> Numbers:
        """Number of models of each point, shape (q,)."""
        return self.node_models[: self._points]

    @property
    def upright(self) -> bool:
        """Whether perspective centres tell which way is up."""
        return bool((self.node >= self.models.points).any())

    def overturned(self) -> FormedModels:
        """Return the strip turned by 180 degrees about its X axis."""
        turn = np.diag([1.0, -1.0, -1.0])
        places = Similarities(self.places.scale, turn @ self.places.rotation, self.places.shift @ turn)
        return replace(self, places=places, model_xyz=self.model_xyz @ turn, node_xyz=self.node_xyz @ turn)

    @property
    def photo_count(self) -> Numbers:
        """Number of photos that show each point, shape (q,): two for a model, one more for its neighbour."""
        rows = np.flatnonzero(self.used & (self.models.node < self.models.points))
        item, model = np.searchsorted(self.point, self.models.node[rows]), self.models.model[rows]
        photos = np.unique(np.column_stack([np.repeat(item, 2), (model[:, None] + [0, 1]).ravel()]), axis=0)
        return np.bincount(photos[:, 0], minlength=len(self.point))

    @property
    def _points(self) -> int:
        return int(np.searchsorted(self.node, self.models.points))

    @property
    def centers(self) -> Floats:
        """Perspective centres of the photos in flight order, NaN where none was measured, shape (f, 3)."""
        found = np.full((len(self.photos), 3), np.nan)
        row = np.searchsorted(self.node, self.photos)
        known = row < len(self.node)
        known[known] = self.node[row[known]] == self.photos[known]
        found[known] = self.node_xyz[row[known]]
        return found

    @property
    def ends(self) -> Floats:
        """Two places that tell the direction of the strip: its end photos, or the middles of its end models."""
        centers = self.centers[[0, -1]]
        if np.isfinite(centers).all():
            return centers
        middles = [self.model_xyz[self.models.model == number].mean(axis=0) for number in (0, self.models.count - 1)]
        if self.models.count > 1:
            return np.array(middles)
        alone = self.model_xyz[self.models.model == 0]
        _, _, vt = np.linalg.svd(alone - alone.mean(axis=0))
        return np.array([middles[0], middles[0] + vt[0]])


def require_links(shared: CommonPoints, models: StripModels, used: Flags, names: Sequence[str]) -> None:
    """Refuse links with fewer than three common points, or with all of them on one line (``used``: rows that count)."""
    count = np.bincount(shared.link[used], minlength=shared.count)
    for link in np.flatnonzero(count < LEAST_COMMON).tolist():
        msg = (
            f"models {names[link]} and {names[link + 1]} have {counted(int(count[link]), 'point')} in common, "
            "perspective centres included: seven parameters need three that are not on one line (three or more and the "
            f"common perspective centre are recommended){_neighbours(models, link, names)}"
        )
        raise GeometryError(msg, code="broken-link")
    centers = np.bincount(shared.link[used & (models.node[shared.before] >= models.points)], minlength=shared.count)
    for link in np.flatnonzero(extents(shared, models, used) < THIN).tolist():
        why = "" if centers[link] else "; with the common perspective centre it is determined"
        msg = (
            f"the common points of models {names[link]} and {names[link + 1]} lie on one line: the rotation about it "
            f"stays free{why}"
        )
        raise GeometryError(msg, code="link-on-a-line")


def _neighbours(models: StripModels, link: int, names: Sequence[str]) -> str:
    """Say which model shares most with the one that could not be joined, when it is not its neighbour."""
    nodes = [set(models.node[models.model == number].tolist()) for number in range(models.count)]
    for model in (link, link + 1):
        others = [number for number in range(models.count) if number not in {link, link + 1}]
        best = max(others, key=lambda number: len(nodes[model] & nodes[number]), default=model)
        number = len(nodes[model] & nodes[best])
        if abs(best - model) > 1 and number >= LEAST_COMMON:
            return (
                f"; model {names[model]} shares {number} with model {names[best]}: are they in the order of the flight?"
            )
    return ""


def form_from_models(models: StripModels, links: ScreenedLinks, photos: Numbers) -> FormedModels:
    """Form the strip; ``photos`` (f,) are the nodes of the centres of the photos, in flight order."""
    places = _chain(links.solved.similarities)
    xyz = places.of(models.model, models.xyz)
    used = _counting(models, links, places, xyz)
    turn = _upright(models, np.where(used[:, None], xyz, np.nan))
    places = Similarities(places.scale, turn @ places.rotation, places.shift @ turn.T)
    xyz = xyz @ turn.T
    node, inverse = np.unique(models.node[used], return_inverse=True)
    count = np.bincount(inverse, minlength=len(node))
    sums = np.column_stack([np.bincount(inverse, xyz[used, axis], len(node)) for axis in range(3)])
    return FormedModels(
        models=models,
        links=links,
        places=places,
        model_xyz=xyz,
        used=used,
        node=node,
        node_xyz=sums / np.maximum(count, 1)[:, None],
        node_models=count,
        photos=photos,
    )


def _chain(links: Similarities) -> Similarities:
    """Chain the similarities, from each model into the first: k' = k0 k, R' = R0 R, t' = k0 R0 t + t0."""
    count = len(links.scale) + 1
    scale, rotation, shift = np.ones(count), np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for number in range(count - 1):
        scale[number + 1] = scale[number] * links.scale[number]
        rotation[number + 1] = rotation[number] @ links.rotation[number]
        shift[number + 1] = scale[number] * rotation[number] @ links.shift[number] + shift[number]
    return Similarities(scale, rotation, shift)


def _upright(models: StripModels, xyz: Floats) -> Floats:
    """Rotation that lays the strip level: X from the first model to the last, Z from the points to the centres.

    Rows of NaN do not count.
    """
    center, known = models.node >= models.points, np.isfinite(xyz[:, 0])
    first, last = (xyz[known & (models.model == number)] for number in (0, models.count - 1))
    along = last.mean(axis=0) - first.mean(axis=0)
    if models.count == 1:
        ends = xyz[known & center]
        along = ends[-1] - ends[0] if len(ends) > 1 else np.linalg.svd(first - first.mean(axis=0))[2][0]
    up = np.zeros(3)
    for number in range(models.count):  # a model's own centres above its own points: the strip may be bent
        above, below = (xyz[known & which & (models.model == number)] for which in (center, ~center))
        if len(above) and len(below):
            up = up + above.mean(axis=0) - below.mean(axis=0)
    if not up.any():
        up = np.array([0.0, 0.0, 1.0])
    x = along / np.linalg.norm(along)
    z = up - (up @ x) * x
    if np.linalg.norm(z) < THIN * np.linalg.norm(up):
        return np.eye(3)
    z = z / np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def _counting(models: StripModels, links: ScreenedLinks, places: Similarities, xyz: Floats) -> Flags:
    """Rows that make the mean of their point.

    A rejected point is wrong in one of its two models. Where other models hold it too, the larger group that agrees
    stays; where they do not, nothing tells which is right, and neither counts.
    """
    used = np.ones(len(models.model), bool)
    shared = links.shared
    touched = np.unique(models.node[shared.before[~links.used]])
    for node in touched.tolist():
        rows = np.flatnonzero(models.node == node)
        rows = rows[np.argsort(models.model[rows], kind="stable")]
        groups = _agreeing(rows, models, links, places, xyz)
        sizes = np.bincount(groups)
        best = np.flatnonzero(sizes == sizes.max())
        used[rows] = (groups == best[0]) if len(best) == 1 else False
    return used


def _agreeing(rows: Numbers, models: StripModels, links: ScreenedLinks, places: Similarities, xyz: Floats) -> Numbers:
    """Group of each row of a point: rows that one link confirms, or that lie together, are of one group."""
    group = np.arange(len(rows))
    shared = links.shared
    limit = AGREE * float(links.limit.max(initial=0.0)) * links.factor
    for second in range(len(rows)):
        for first in range(second):
            link = np.flatnonzero((shared.before == rows[first]) & (shared.after == rows[second]))
            if len(link):
                agree = bool(links.used[link[0]])
            else:
                scale = places.scale[models.model[rows[[first, second]]]]
                variance = float(((scale[:, None] * models.sigma[rows[[first, second]]]) ** 2).sum()) / 3
                agree = float(((xyz[rows[first]] - xyz[rows[second]]) ** 2).sum()) < limit * variance
            if agree:
                group[group == group[second]] = group[first]
    return np.unique(group, return_inverse=True)[1].astype(np.intp)


def far_ends(formed: FormedModels) -> Floats:
    """Uncertainty of the far end of the model after each link, in standard deviations of a coordinate.

    Returns (j,), largest standard deviation of a coordinate over the median one of a coordinate of the model.
    """
    models, solved = formed.models, formed.links.solved
    rows = np.flatnonzero((models.model > 0) & (models.node < models.points))
    link = models.model[rows] - 1
    moved = solved.similarities.of(link, models.xyz[rows])
    design = similarity_derivatives(moved - solved.centroid[link], np.zeros(3))
    variance = np.einsum("nij,njk,nik->ni", design, solved.cofactors[link], design).max(axis=1)
    scale = solved.similarities.scale
    found = np.zeros(len(scale))
    np.maximum.at(found, link, variance)
    stated = np.array([np.median(models.sigma[rows[link == number]]) for number in range(len(scale))])
    ratio: Floats = np.sqrt(found) / np.maximum(scale * stated, 1e-300)
    return ratio


NEAREST = 3  # points at least that say where the ground below a centre is


def displacement_rows(xyz: Floats, above: Floats, terms: Sequence[tuple[str, ...]]) -> list[Floats]:
    """Displacements of centres by the coefficients of the polynomials of X, Y and Z, a list of three (n, 3, k).

    dX = fx - h dfz/dX, dY = fy - h dfz/dY, dZ = fz + h (dfx/dX + dfy/dY) / 2 with h = ``above``, the heights (n,) of
    the centres above the ground below them, and ``terms`` of the three polynomials by name.
    """
    x, y = xyz[:, 0], xyz[:, 1]
    found = []
    for axis, names in enumerate(terms):
        rows = np.zeros((len(xyz), 3, len(names)))
        for column, (i, j) in enumerate(POWERS[name] for name in names):
            by_x = i * x ** max(i - 1, 0) * y**j
            by_y = j * x**i * y ** max(j - 1, 0)
            rows[:, axis, column] = x**i * y**j
            if axis == 2:  # the heights tilt the model
                rows[:, 0, column] -= above * by_x
                rows[:, 1, column] -= above * by_y
            else:
                rows[:, 2, column] += above * (by_x, by_y)[axis] / 2
        found.append(rows)
    return found


def heights_above(centers: Floats, points: Floats) -> Floats:
    """Heights of centres above the ground below them: the mean of the points that are nearest along the strip."""
    near = min(max(len(points) // max(len(centers), 1), NEAREST), len(points))
    order = np.argsort(points[:, 0], kind="stable")
    x, z = points[order, 0], np.concatenate([[0.0], np.cumsum(points[order, 2])])
    first = np.clip(np.searchsorted(x, centers[:, 0]) - near // 2, 0, len(points) - near)
    return np.asarray(centers[:, 2] - (z[first + near] - z[first]) / near)
