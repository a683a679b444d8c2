"""Forming a strip of independent models: each takes its place from the one before it.

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
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.notes import counted
from photostrip.strip import model_links
from photostrip.strip.model_links import CommonPoints, ScreenedLinks, Similarities, StripModels
from photostrip.strip.polynomial_terms import POWERS

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
        places = model_links.Similarities(self.places.scale, turn @ self.places.rotation, self.places.shift @ turn)
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
    for link in np.flatnonzero(count < model_links.LEAST_COMMON).tolist():
        msg = (
            f"models {names[link]} and {names[link + 1]} have {counted(int(count[link]), 'point')} in common, "
            "perspective centres included: seven parameters need three that are not on one line (three or more and the "
            f"common perspective centre are recommended){_neighbours(models, link, names)}"
        )
        raise GeometryError(msg, code="broken-link")
    centers = np.bincount(shared.link[used & (models.node[shared.before] >= models.points)], minlength=shared.count)
    for link in np.flatnonzero(model_links.extents(shared, models, used) < model_links.THIN).tolist():
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
        if abs(best - model) > 1 and number >= model_links.LEAST_COMMON:
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
    places = model_links.Similarities(places.scale, turn @ places.rotation, places.shift @ turn.T)
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
    return model_links.Similarities(scale, rotation, shift)


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
    if np.linalg.norm(z) < model_links.THIN * np.linalg.norm(up):
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
