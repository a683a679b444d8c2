"""What an adjusted strip has to fulfil: steps between models, control, distances of pass points.

Unknowns are the similarities of all models. Each is taken about the left perspective centre of its model and in metres
at the distance of a base, so that a strip of any length makes a system of the same condition.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import dataclass, replace
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, Similarity, similarity_derivatives
from photostrip.triangulation.error_propagation.control_errors import Misclosures
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ELEMENTS, SCALE, ErrorRows
from photostrip.triangulation.error_propagation.pair_errors import PairErrors
from photostrip.triangulation.error_propagation.strip_errors import StripErrors, scale_shares
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.strip_formation.strip import FormedStrip

JUNCTION, CONTROL, DISTANCE = 0, 1, 2
# distances at all junctions over which a point reaches, at most: the time grows with their third power, see the table
# in docs/precision.md; strips of 3 photos a point keep 333
MOST_DISTANCES = 1000


@dataclass(frozen=True, eq=False)
class LocalSimilarities:
    """Similarities of the models about their own left photos."""

    to_common: Floats  # (p, 7, 7): from the unknowns of each model to the similarity about the common origin
    from_common: Floats  # (p, 7, 7): the way back
    length: float  # mean base, by which rotations and logarithms of scales are multiplied, metres
    centers: Floats  # (p + 1, 3): perspective centres of all photos from the common origin, metres

    @classmethod
    def of(cls, errors: StripErrors, base: Floats) -> Self:
        """Take them about the left centres C of the models, of bases (p, 3): t_common = t - theta x C - lambda C."""
        # the step's scale column is minus the centre that joins its model to the next
        following = -errors.steps[:, :3, SCALE]
        centers = np.concatenate([following[:1] - base[:1], following])
        left, length = centers[:-1], float(np.linalg.norm(base, axis=1).mean())
        shift = np.tile(np.eye(SIMILARITY_PARAMETERS), (len(left), 1, 1))
        shift[:, :3, 3:6], shift[:, :3, 6] = cross_matrix(left), -left
        back = np.tile(np.eye(SIMILARITY_PARAMETERS), (len(left), 1, 1))
        back[:, :3, 3:6], back[:, :3, 6] = -cross_matrix(left), left
        size = np.array([1.0] * 3 + [length] * 4)
        return cls(to_common=shift / size, from_common=back * size[:, None], length=length, centers=centers)


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions ``w = A y + H v + g``, in the order of the strip."""

    rows: ErrorRows  # H, d = 1; ``by_similarity`` is A in the columns of the condition's own model
    following: Floats  # (n, 7): A in the columns of the next model
    value: Floats  # (n,): w, metres
    noise: Floats  # (n,): variance of g, metres^2
    kind: Numbers  # (n,): ``JUNCTION``, ``CONTROL`` or ``DISTANCE``
    source: Numbers  # (n,): junction; row of the misclosures; row of the pass points
    local: LocalSimilarities  # the unknowns y

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Put conditions together, model by model."""
        rows = ErrorRows.joined([part.rows for part in parts])
        order = np.argsort(rows.first, kind="stable")
        columns = {
            name: np.concatenate([getattr(part, name) for part in parts])[order]
            for name in ("following", "value", "noise", "kind", "source")
        }
        return cls(rows=rows.take(order), local=parts[0].local, **columns)

    def of_control(self, coordinates: Numbers) -> Numbers:
        """Conditions of control coordinates, given by their rows in the misclosures."""
        rows = np.flatnonzero(self.kind == CONTROL)
        place = np.empty(len(rows), np.intp)
        place[self.source[rows]] = rows
        return place[coordinates]


def conditions(
    errors: StripErrors,
    orientation: Orientation,
    formed: FormedStrip,
    control: Misclosures,
    misclosures: Floats,
    *,
    distances: bool = True,
) -> Conditions:
    """Collect all conditions of a strip; `misclosures` (w,) is strip minus given of the control coordinates, metres."""
    pairs = errors.make_pairs()
    local = LocalSimilarities.of(errors, pairs.base)
    parts = [_junctions(errors, local), _control(control, misclosures, local)]
    if distances:
        parts.append(_distances(errors, pairs, orientation, formed, local))
    return Conditions.joined(parts)


def misclosures_at(wanted: Conditions, formed: FormedStrip, similarity: Similarity, control: Floats) -> Floats:
    """Misclosures (n,) of the same conditions in the strip as it is formed from other image coordinates.

    ``control`` (w,) is strip minus given of the control coordinates there, metres.
    """
    result = np.zeros(len(wanted.value))
    is_control, is_distance = wanted.kind == CONTROL, wanted.kind == DISTANCE
    result[is_control] = control[wanted.source[is_control]]
    rows = wanted.source[is_distance]
    joined = formed.junctions
    center = formed.centers[joined.junction[rows] + 1]
    before, after = (formed.model_xyz[side[rows]] - center for side in (joined.before, joined.after))
    ray = before / np.linalg.norm(before, axis=1)[:, None] + after / np.linalg.norm(after, axis=1)[:, None]
    along = ((after - before) * ray).sum(axis=1) / np.linalg.norm(ray, axis=1)
    result[is_distance] = similarity.scale * along
    return result


def _junctions(errors: StripErrors, local: LocalSimilarities) -> Conditions:
    """Seven for each junction: 0 = y(i+1) - y(i) carried over - S u(i)."""
    junctions = errors.models - 1
    count = junctions * SIMILARITY_PARAMETERS
    carried = -local.from_common[1:] @ local.to_common[:-1]
    by_component = -local.from_common[1:] @ errors.steps[:-1]
    number = np.repeat(np.arange(junctions), SIMILARITY_PARAMETERS)
    return Conditions(
        rows=ErrorRows.without_images(
            number,
            carried.reshape(count, 1, SIMILARITY_PARAMETERS),
            by_component.reshape(count, 1, 1, COMPONENTS),
        ),
        following=np.tile(np.eye(SIMILARITY_PARAMETERS), (junctions, 1)),
        value=np.zeros(count),
        noise=np.zeros(count),
        kind=np.full(count, JUNCTION),
        source=number,
        local=local,
    )


def _control(control: Misclosures, misclosures: Floats, local: LocalSimilarities) -> Conditions:
    rows, count = control.rows, len(misclosures)
    return Conditions(
        rows=replace(rows, by_similarity=rows.by_similarity @ local.to_common[rows.first]),
        following=np.zeros((count, SIMILARITY_PARAMETERS)),
        value=misclosures,
        noise=control.variance,
        kind=np.full(count, CONTROL),
        source=np.arange(count),
        local=local,
    )


def _distances(
    errors: StripErrors, pairs: PairErrors, orientation: Orientation, formed: FormedStrip, local: LocalSimilarities
) -> Conditions:
    """Distances of pass points from the common centre, after minus before the junction: w = L v.

    What lies across the ray is left out: its variance nearly vanishes to first order, and what is left of it would
    count as information. One point of each junction is left out too, the scale transfer having used up one of them:
    the one with the largest share in the scale.
    """
    joined, images = formed.junctions, errors.images
    chosen = np.flatnonzero(joined.used)
    share, _ = scale_shares(joined, pairs)
    order = np.lexsort(((share[chosen] ** 2).sum(axis=1), joined.junction[chosen]))
    number = joined.junction[chosen][order]
    last = np.append(number[1:] != number[:-1], np.ones(min(len(number), 1), bool))
    chosen = np.sort(chosen[order[~last]])
    across = pairs.point[joined.after[chosen], 1]
    chosen = np.sort(
        chosen[_spread(joined.junction[chosen], across, MOST_DISTANCES // errors.points.by_component.shape[1])]
    )
    junction, before, after = joined.junction[chosen], joined.before[chosen], joined.after[chosen]
    ray_before, ray_after = pairs.point[before] - pairs.base[junction], pairs.point[after]
    lengths = np.linalg.norm(ray_before, axis=1) + np.linalg.norm(ray_after, axis=1)
    ray = (ray_before + ray_after) / lengths[:, None]
    along = (ray / np.linalg.norm(ray, axis=1)[:, None])[:, None]
    count = len(chosen)
    by_component = np.zeros((count, 2, 1, COMPONENTS))
    moved = similarity_derivatives(local.centers[junction + 1] + ray_before, np.zeros(3))
    by_component[:, 0] = along @ moved @ errors.steps[junction]
    by_component[:, 0, :, ELEMENTS] -= along @ pairs.point_by_elements[before]
    by_component[:, 1, :, ELEMENTS] += along @ pairs.point_by_elements[after]
    rows = orientation.rows  # three photos see the point: left before, both in the middle, right after
    image = images.rows_of(np.column_stack([rows[before, 0], rows[before, 1], rows[after, 1]])).ravel()
    by_before, by_after = along @ pairs.point_by_image[before], along @ pairs.point_by_image[after]
    by_image = np.stack([-by_before[..., :2], by_after[..., :2] - by_before[..., 2:], by_after[..., 2:]], axis=1)
    none = np.zeros((count, 1, SIMILARITY_PARAMETERS))
    return Conditions(
        rows=ErrorRows(
            first=junction,
            by_similarity=none,
            by_component=by_component,
            item=np.repeat(np.arange(count), 3),
            image=image,
            by_image=by_image.reshape(-1, 1, 2) * images.sigma[image][:, None, :],
        ),
        following=none[:, 0],
        value=np.einsum("ni,ni->n", along[:, 0], ray_after - ray_before),
        noise=np.zeros(count),
        kind=np.full(count, DISTANCE),
        source=chosen,
        local=local,
    )


def _spread(junction: Numbers, across: Floats, most: int) -> Numbers:
    """Rows of at most so many of each junction, from one side of the strip to the other."""
    order = np.lexsort((across, junction))
    _, begin, count = np.unique(junction, return_index=True, return_counts=True)
    rank = np.arange(len(order)) - np.repeat(begin, count)
    step = np.maximum(np.repeat(count, count) / most, 1.0)
    return np.asarray(order[np.floor(rank / step) != np.floor((rank - 1) / step)], np.intp)
