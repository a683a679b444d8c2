"""What an adjusted strip has to fulfil: control, and distances of pass points from the common centres of their models.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.frozen import dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, Similarity, similarity_derivatives
from photostrip.triangulation.covariance_adjustment.similarities import PhotoSimilarities
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import COMPONENTS, ELEMENTS, SCALE, ErrorRows
from photostrip.triangulation.covariance_adjustment.strip_rows.strip_errors import Section, StripErrors, scale_shares
from photostrip.triangulation.error_propagation.control_errors import Misclosures
from photostrip.triangulation.error_propagation.pair_errors import PairErrors
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.strip_formation.strip import FormedStrip

CONTROL, DISTANCE = 0, 1


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions ``w = A y + B u + E v + g``, point by point: u the error components, v the errors of image points.

    Conditions of different points share no image point.
    """

    rows: ErrorRows  # d = 1; ``by_similarity`` by the similarity of the model ``first`` about the common origin
    point: Numbers  # (n,): point of each
    base: Numbers  # (n,): first model of that point, ascending
    value: Floats  # (n,): w, metres
    noise: Floats  # (n,): variance of g, metres^2
    kind: Numbers  # (n,): ``CONTROL`` or ``DISTANCE``
    source: Numbers  # (n,): row of the misclosures; row of the pass points
    similarities: PhotoSimilarities  # the unknowns y

    def of_control(self, coordinates: Numbers) -> Numbers:
        """Conditions of control coordinates, given by their rows in the misclosures."""
        rows = np.flatnonzero(self.kind == CONTROL)
        place = np.empty(len(rows), np.intp)
        place[self.source[rows]] = rows
        return place[coordinates]


@dataclass(frozen=True, eq=False)
class _Part:
    """Conditions of one kind."""

    rows: ErrorRows
    value: Floats
    noise: Floats
    source: Numbers


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
    count = len(misclosures)
    at_control = errors.points.take(control.row).along(control.direction)
    parts = [_Part(rows=at_control, value=misclosures, noise=control.variance, source=np.arange(count))]
    if distances:
        placed = np.asarray(np.isfinite(formed.model_xyz).all(axis=1), bool)
        for section, pairs in errors.sections():
            parts.append(_distances(errors, placed[section.rows], section, pairs))
            del section, pairs  # before the next are made
    rows = ErrorRows.joined([part.rows for part in parts])
    kind = np.where(np.arange(len(rows.first)) < count, CONTROL, DISTANCE)
    value, noise, source = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("value", "noise", "source")
    )
    del parts  # before all of it is put in order
    point = _points(errors, orientation, rows)
    base = errors.points.first[np.searchsorted(formed.point, point)]
    order = np.lexsort((point, base))
    return Conditions(
        rows=rows.take(order),
        point=point[order],
        base=base[order],
        value=value[order],
        noise=noise[order],
        kind=kind[order],
        source=source[order],
        similarities=PhotoSimilarities.of(errors),
    )


def _points(errors: StripErrors, orientation: Orientation, rows: ErrorRows) -> Numbers:
    """Points (n,) of rows, each of which image points of one point alone enter directly."""
    of_image = np.empty(len(errors.images.row), np.intp)
    of_image[errors.images.rows_of(orientation.rows)] = orientation.point[:, None]
    return of_image[rows.image[np.searchsorted(rows.item, np.arange(len(rows.first)))]]


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


def _distances(errors: StripErrors, placed: Flags, section: Section, pairs: PairErrors) -> _Part:
    """Distances of pass points from the common centre, after minus before the junction: w = L v.

    What lies across the ray is left out: its variance nearly vanishes to first order, and what is left of it would
    count as information. One point of each junction is left out too, the scale transfer having used up one of them:
    the one with the largest share in the scale.

    placed: (m,), rows of the pairs' table in the section that place their points. Where nothing better joins two
        models, points may join them whose rays contradict each other: their distances say nothing.
    """
    joined, images = section.junctions, errors.images
    chosen = np.flatnonzero(joined.used & placed[joined.before] & placed[joined.after])
    share, _ = scale_shares(joined, pairs)
    order = np.lexsort(((share[chosen] ** 2).sum(axis=1), joined.junction[chosen]))
    number = joined.junction[chosen][order]
    last = np.append(number[1:] != number[:-1], np.ones(min(len(number), 1), bool))
    chosen = np.sort(chosen[order[~last]])
    junction, before, after = joined.junction[chosen], joined.before[chosen], joined.after[chosen]
    first = junction + section.numbers.start
    ray_before, ray_after = pairs.point[before] - pairs.base[junction], pairs.point[after]
    lengths = np.linalg.norm(ray_before, axis=1) + np.linalg.norm(ray_after, axis=1)
    ray = (ray_before + ray_after) / lengths[:, None]
    along = (ray / np.linalg.norm(ray, axis=1)[:, None])[:, None]
    count = len(chosen)
    by_component = np.zeros((count, 2, 1, COMPONENTS))
    next_centers = -errors.steps[first, :3, SCALE]
    moved = similarity_derivatives(next_centers + ray_before, np.zeros(3))
    by_component[:, 0] = along @ moved @ errors.steps[first]
    by_component[:, 0, :, ELEMENTS] -= along @ pairs.point_by_elements[before]
    by_component[:, 1, :, ELEMENTS] += along @ pairs.point_by_elements[after]
    rows = section.orientation.rows  # three photos see the point: left before, both in the middle, right after
    image = images.rows_of(np.column_stack([rows[before, 0], rows[before, 1], rows[after, 1]])).ravel()
    by_before, by_after = along @ pairs.point_by_image[before], along @ pairs.point_by_image[after]
    by_image = np.stack([-by_before[..., :2], by_after[..., :2] - by_before[..., 2:], by_after[..., 2:]], axis=1)
    return _Part(
        rows=ErrorRows(
            first=first,
            by_similarity=np.broadcast_to(0.0, (count, 1, SIMILARITY_PARAMETERS)),
            by_component=by_component,
            item=np.repeat(np.arange(count), 3),
            image=image,
            by_image=by_image.reshape(-1, 1, 2) * images.sigma[image][:, None, :],
        ),
        value=np.einsum("ni,ni->n", along[:, 0], ray_after - ray_before),
        noise=np.broadcast_to(0.0, count),
        source=section.passes[chosen],
    )
