"""What an adjusted strip has to fulfil: steps between models, control, distances of pass points.

Unknowns are the similarities of all models. Each is taken about the left perspective centre of its model and in metres
at the distance of a base, so that a strip of any length makes a system of the same condition.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ELEMENTS, ErrorRows
from photostrip.triangulation.error_propagation.strip_errors import scale_shares

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.geometry.similarity import Similarity
    from photostrip.triangulation.error_propagation.control_errors import Misclosures
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.strip import FormedStrip

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

JOINT, CONTROL, DISTANCE = 0, 1, 2


@dataclass(frozen=True)
class Settings:
    """Which misclosures an adjustment with the covariance of the strip distributes."""

    # whether distances of pass points from the common centres of their models count beside the control
    distances: bool = True


@dataclass(frozen=True, eq=False)
class Local:
    """Similarities of the models about their own left photos."""

    to_common: Floats  # (p, 7, 7): from the unknowns of each model to the similarity about the common origin
    from_common: Floats  # (p, 7, 7): the way back

    @classmethod
    def about(cls, centers: Floats, length: float) -> Local:
        """Make them for models whose left centres are given from the common origin, metres."""
        count = len(centers)
        shift = np.tile(np.eye(SIMILARITY_PARAMETERS), (count, 1, 1))
        shift[:, :3, 3:6], shift[:, :3, 6] = cross_matrix(centers), -centers
        back = np.tile(np.eye(SIMILARITY_PARAMETERS), (count, 1, 1))
        back[:, :3, 3:6], back[:, :3, 6] = -cross_matrix(centers), centers
        size = np.array([1.0] * 3 + [length] * 4)
        return cls(shift / size, back * size[:, None])


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions ``w = A y + H v + g``, in the order of the strip."""

    rows: ErrorRows  # H, d = 1; ``frame`` is A in the columns of the condition's own model
    following: Floats  # (n, 7): a in the columns of the next model
    value: Floats  # (n,): w, metres
    noise: Floats  # (n,): variance of g, metres^2
    kind: Numbers  # (n,): ``JOINT``, ``CONTROL`` or ``DISTANCE``
    source: Numbers  # (n,): joint; row of the misclosures; row of the junctions


def conditions(
    errors: StripErrors,
    strip: tuple[Orientation, FormedStrip],
    control: tuple[Misclosures, Floats],
    local: Local,
    *,
    distances: bool = True,
) -> Conditions:
    """Collect all conditions of a strip.

    Parameters
    ----------
    control : tuple of Misclosures and ndarray
        Control coordinates that count, and strip minus given in metres.
    distances : bool
        Whether distances of pass points from the common centres count.

    Returns
    -------
    Conditions
        Joints, control and distances, model by model.
    """
    slots = errors.points.by_component.shape[1]
    parts = [_joints(errors, local, slots), _control(*control, local)]
    if distances:
        parts.append(_distances(errors, *strip, max(slots, 2)))
    return _sorted(parts, max(slots, 2))


def misclosures_at(wanted: Conditions, formed: FormedStrip, similarity: Similarity, control: Floats) -> Floats:
    """Misclosures of the same conditions in the strip as it is formed from other image coordinates.

    Parameters
    ----------
    formed : FormedStrip
        The strip, with the same joints.
    control : ndarray, shape (w,)
        Strip minus given of the control coordinates, metres.

    Returns
    -------
    ndarray, shape (n,)
        Misclosures, metres.
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


def _sorted(parts: Sequence[Conditions], slots: int) -> Conditions:
    """Put conditions together, model by model."""
    count = np.concatenate([[0], np.cumsum([len(part.value) for part in parts])])
    order = np.argsort(np.concatenate([part.rows.first for part in parts]), kind="stable")
    place = np.empty(len(order), np.intp)
    place[order] = np.arange(len(order))
    item = place[np.concatenate([part.rows.item + start for part, start in zip(parts, count[:-1], strict=True)])]
    entry = np.argsort(item, kind="stable")
    core = np.zeros((len(order), slots, 1, COMPONENTS))
    for part, start in zip(parts, count[:-1], strict=True):
        core[start : start + len(part.value), : part.rows.by_component.shape[1]] = part.rows.by_component
    rows = ErrorRows(
        np.concatenate([part.rows.first for part in parts])[order],
        np.concatenate([part.rows.by_similarity for part in parts])[order],
        core[order],
        item[entry],
        np.concatenate([part.rows.image for part in parts])[entry],
        np.concatenate([part.rows.by_image for part in parts])[entry],
    )
    columns = (
        np.concatenate([getattr(part, name) for part in parts])[order]
        for name in ("following", "value", "noise", "kind", "source")
    )
    return Conditions(rows, *columns)


def _joints(errors: StripErrors, local: Local, slots: int) -> Conditions:
    """Seven for each joint: 0 = y(i+1) - y(i) carried over - step."""
    joints = errors.models - 1
    count = joints * SIMILARITY_PARAMETERS
    carried = -local.from_common[1:] @ local.to_common[:-1]
    core = np.zeros((joints, SIMILARITY_PARAMETERS, slots, 1, COMPONENTS))
    core[:, :, 0, 0] = -local.from_common[1:] @ errors.steps[:-1]
    none = np.zeros(0, np.intp)
    number = np.repeat(np.arange(joints), SIMILARITY_PARAMETERS)
    rows = ErrorRows(
        number,
        carried.reshape(count, 1, SIMILARITY_PARAMETERS),
        core.reshape(count, slots, 1, COMPONENTS),
        none,
        none,
        np.zeros((0, 1, 2)),
    )
    zero = np.zeros(count)
    return Conditions(
        rows, np.tile(np.eye(SIMILARITY_PARAMETERS), (joints, 1)), zero, zero, np.full(count, JOINT), number
    )


def _control(control: Misclosures, given: Floats, local: Local) -> Conditions:
    rows, count = control.rows, len(given)
    frame = rows.by_similarity @ local.to_common[rows.first]
    placed = ErrorRows(rows.first, frame, rows.by_component, rows.item, rows.image, rows.by_image)
    zero = np.zeros((count, SIMILARITY_PARAMETERS))
    return Conditions(placed, zero, given, control.variance, np.full(count, CONTROL), np.arange(count))


def _distances(errors: StripErrors, orientation: Orientation, formed: FormedStrip, slots: int) -> Conditions:
    """Distances of pass points from the common centre, after minus before the joint.

    What lies across the ray is left out: its variance nearly vanishes to first order, and what is left of it would
    count as information. One point of each joint is left out too, the scale transfer having used up one of them.
    """
    joined, pairs = formed.junctions, errors.pairs
    chosen = np.flatnonzero(joined.used)
    before_share, _ = scale_shares(orientation, formed, pairs)
    size = (before_share[chosen] ** 2).sum(axis=1)
    order = np.lexsort((size, joined.junction[chosen]))
    number = joined.junction[chosen][order]
    last = np.append(number[1:] != number[:-1], np.ones(min(len(number), 1), bool))
    chosen = np.sort(chosen[order[~last]])
    joint, before, after = joined.junction[chosen], joined.before[chosen], joined.after[chosen]
    arms = (pairs.point[before] - pairs.base[joint], pairs.point[after])
    lengths = [np.linalg.norm(arm, axis=1) for arm in arms]
    ray = (arms[0] + arms[1]) / (lengths[0] + lengths[1])[:, None]
    along = (ray / np.linalg.norm(ray, axis=1)[:, None])[:, None]
    core = np.zeros((len(chosen), slots, 1, COMPONENTS))
    center = centers_of(errors)[joint + 1]
    place = similarity_derivatives(center + arms[0], np.zeros(3))
    core[:, 0] = along @ place @ errors.steps[joint]
    core[:, 0, :, ELEMENTS] -= along @ pairs.point_by_elements[before]
    core[:, 1, :, ELEMENTS] += along @ pairs.point_by_elements[after]
    item, image, own = _own_of_distances(errors, orientation, (before, after), along)
    zero, count = np.zeros((len(chosen), 1, SIMILARITY_PARAMETERS)), len(chosen)
    rows = ErrorRows(joint, zero, core, item, image, own)
    value = np.einsum("ni,ni->n", along[:, 0], arms[1] - arms[0])
    return Conditions(rows, zero[:, 0], value, np.zeros(count), np.full(count, DISTANCE), chosen)


def centers_of(errors: StripErrors) -> Floats:
    """Perspective centres of all photos, from the common origin, shape (p + 1, 3), metres."""
    # the step's scale column is minus the centre that joins its model to the next
    following = -errors.steps[:, :3, 5]
    return np.concatenate([following[:1] - errors.pairs.base[:1], following])


def _own_of_distances(
    errors: StripErrors, orientation: Orientation, rows: tuple[Numbers, Numbers], along: Floats
) -> tuple[Numbers, Numbers, Floats]:
    """Image points of the three photos by which a distance is seen from both models."""
    images, pairs = errors.images, errors.pairs
    lookup = np.full(int(images.row.max()) + 1, -1)
    lookup[images.row] = np.arange(len(images.row))
    before, after = rows
    own_before, own_after = along @ pairs.point_by_image[before], along @ pairs.point_by_image[after]
    image = np.column_stack(
        [
            lookup[orientation.rows[before, 0]],
            lookup[orientation.rows[before, 1]],
            lookup[orientation.rows[after, 1]],
        ]
    )
    own = np.stack([-own_before[..., :2], own_after[..., :2] - own_before[..., 2:], own_after[..., 2:]], axis=1)
    item = np.repeat(np.arange(len(before)), 3)
    flat = image.ravel()
    return item, flat, own.reshape(-1, 1, 2) * images.sigma[flat][:, None, :]
