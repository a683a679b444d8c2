"""Errors of the formed strip: sparse rows of derivatives by the image coordinates, one for every step and point.

The error of a model is an infinitesimal similarity (shift, rotation, scale) plus its deformation. From model to model
the similarities differ by *steps* (eq. 2). All of them hang on six *error components* of each model: the errors of the
five elements of its pair, and of the logarithm of the scale handed on to the next model. Every row is kept as
coefficients of a similarity, of a few components, and of a few image coordinates (eq. 3); the covariances among
components and image coordinates are exact products of their rows. Components of models i and k have image coordinates
in common when |i - k| <= 2: pairs share a photo, a scale transfer uses three.

All coordinates refer to the frame of the ground after the plain similarity; image coordinates count in their stated
standard deviations.

Source: derived; see docs/precision.md, eq. 2 and 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct
from photostrip.frozen import NamedTuple, dataclass, replace
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, Similarity, similarity_derivatives
from photostrip.points import take_rows
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import (
    COMPONENTS,
    ELEMENTS,
    MOVED,
    SCALE,
    SHARING,
    SPAN,
    ImagePoints,
    PlacedStrip,
    PointRows,
    add_rows,
)
from photostrip.triangulation.error_propagation import pair_errors
from photostrip.triangulation.error_propagation.pair_errors import PairErrors
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.resection.resection import runs
from photostrip.triangulation.strip_formation.scale_transfer import Junctions
from photostrip.triangulation.strip_formation.strip import FormedStrip

IMAGES = 4096  # image points whose products are summed together: what fits into the processor's cache
JUNCTION_ROWS = ("junction", "before", "after", "point", "ratio", "used", "limit", "weight")
# points of pairs differentiated together, of which the pairs' own derivatives then go: all at once take 28 MB more of
# 200 with 50 000 check points, a quarter and twice as many the same
SECTION = 8192


@dataclass(frozen=True, eq=False)
class StripErrors:
    """Everything that covariances of a strip are made of."""

    images: ImagePoints
    # (p, 7, 6): step from the similarity of each model to the next by the model's error components; after the last
    # model that of the last photo
    steps: Floats
    component_covariances: Floats  # (p, 3, 6, 6): Q, of each model with itself, the next and the one after
    points: PointRows
    # finds errors inside the pairs again, section by section: not always asked for
    sections: Callable[[], Iterator[tuple[Section, PairErrors]]]
    origin: Floats  # (3,): common origin of all similarities

    @property
    def models(self) -> int:
        return len(self.steps)

    @property
    def centers(self) -> Floats:
        """Perspective centres (p + 1, 3) from the origin, which is the mean of all, metres."""
        following = -self.steps[:, :3, SCALE]  # minus the centre that joins a model to the next
        return np.concatenate([-following.sum(axis=0)[None], following])


def differentiate_strip(
    orientation: Orientation, formed: FormedStrip, similarity: Similarity, position: Numbers, sigma: Floats
) -> StripErrors:
    """Rows of derivatives of a formed strip.

    similarity: from the strip to the frame of the ground.
    position: (k,), place in the strip of the photo of every image point in the observations.
    sigma: (k, 2), standard deviations of all image points in the observations, mm.
    """
    rotations = similarity.rotation @ formed.rotations
    across = formed.across if formed.left_ray else None
    scale = similarity.scale * formed.scale
    centers = similarity(formed.centers)
    origin = centers.mean(axis=0)
    row = distinct(orientation.rows)
    row = row[np.argsort(position[row], kind="stable")]
    strip = PlacedStrip(
        orientation=orientation,
        formed=formed,
        xyz=similarity(formed.xyz) - origin,
        centers=centers - origin,
        rotations=rotations,
        images=ImagePoints(
            row=row,
            photo=position[row],
            stated=sigma,
            components=np.zeros((len(row), 2, MOVED.stop - MOVED.start)),
        ),
        steps=np.zeros((len(scale), SIMILARITY_PARAMETERS, COMPONENTS)),
    )
    points = _PointsInMaking.of(strip)
    of_scale = np.zeros((2, len(scale), 5))
    sections = partial(_differentiated, orientation, formed.junctions, rotations, scale, across)
    for section, part in sections():
        own = section.numbers
        strip.steps[own] = _steps(part, strip.centers[1:][own])
        _add_components(strip.images, section, part, of_scale[:, own])
        points.add(section, part)
        del section, part  # before the next are made
    rows = points.finished()
    if len(formed.bridging):
        from photostrip.triangulation.covariance_adjustment.strip_rows.non_neighbour_errors import with_bridges

        rows = with_bridges(rows, strip)
    return StripErrors(
        images=strip.images,
        steps=strip.steps,
        component_covariances=_component_covariances(strip.images, len(strip.steps)),
        points=rows,
        sections=sections,
        origin=origin,
    )


class Section(NamedTuple):
    """Some neighbouring pairs, and the one behind them, which shares their last junction and opens the next section."""

    numbers: slice  # of these pairs in the strip
    orientation: Orientation  # of these pairs, renumbered
    rows: slice  # in the table of the strip's pairs, of the points of these pairs
    own: int  # how many of these rows belong to the pairs without the one behind
    passes: Numbers  # (t,): rows of the strip's pass points that lie between these pairs
    junctions: Junctions  # made of these; rows and junctions renumbered


def _sections(orientation: Orientation, junctions: Junctions) -> Iterator[Section]:
    """Cut a strip into sections."""
    ends = np.append(orientation.pairs.starts, len(orientation.pairs.pair))
    for first, stop in runs(ends, SECTION):
        last = min(stop + 1, orientation.pairs.size)
        rows = slice(int(ends[first]), int(ends[last]))
        inside = np.flatnonzero((junctions.junction >= first) & (junctions.junction < last - 1))
        joined = take_rows(junctions, inside, JUNCTION_ROWS)
        yield Section(
            numbers=slice(first, last),
            orientation=orientation.take(np.arange(first, last)),
            rows=rows,
            own=int(ends[stop]) - rows.start,
            passes=inside,
            junctions=replace(
                joined,
                junction=joined.junction - first,
                before=joined.before - rows.start,
                after=joined.after - rows.start,
            ),
        )


def _differentiated(
    orientation: Orientation, junctions: Junctions, rotations: Floats, scale: Floats, across: Floats | None
) -> Iterator[tuple[Section, PairErrors]]:
    """Differentiate a strip section by section; rotations (p + 1, 3, 3) and scales (p,) are those of its pairs."""
    for section in _sections(orientation, junctions):
        own = section.numbers
        yield (
            section,
            pair_errors.differentiate_pairs(
                section.orientation, rotations[own], scale[own], None if across is None else across[own]
            ),
        )


def scale_shares(joined: Junctions, pairs: PairErrors) -> tuple[Floats, Floats]:
    """Differentiate the logarithm of the scale handed on by the pass points, seen from the common centre.

    The scale k is the weighted mean of the ratios r = |b| / |a| of the vectors before and after: d ln k = sum p r
    (b . db / |b|^2 - a . da / |a|^2) / sum p r. The shares of ``after`` come without their sign.

    Returns before, after: (t, 3), by the point in the model before and after the junction, 1/metres; 0 for pass points
        that are not used.
    """
    shares = np.where(joined.used, joined.weight * joined.ratio, 0.0)
    shares = shares / np.bincount(joined.junction, shares)[joined.junction]
    vectors = (pairs.point[joined.before] - pairs.base[joined.junction], pairs.point[joined.after])
    before, after = (shares[:, None] * u / (u**2).sum(axis=1)[:, None] for u in vectors)
    return before, after


def _add_components(images: ImagePoints, section: Section, pairs: PairErrors, of_scale: Floats) -> None:
    """Put in what the image points of a section do to the error components.

    A point on photo i enters the elements of the models i - 1 and i directly, and the scale of the models i - 2 to i:
    by its own ray, and by the elements of both models of a junction.

    of_scale: (2, p, 5), scales handed on from these models, and from the models before them, by the elements of these;
        after the last model none is. What the last junction adds for the pair behind it stays for the next section.
    """
    orientation, joined, own = section.orientation, section.junctions, slice(section.own)
    before, after = scale_shares(joined, pairs)
    center_to_point = pairs.point_by_elements[joined.before] - pairs.base_by_elements[joined.junction]
    add_rows(of_scale[0], joined.junction, (before[:, None] @ center_to_point)[:, 0])
    by_next = after[:, None] @ pairs.point_by_elements[joined.after]
    add_rows(of_scale[1], joined.junction + 1, -by_next[:, 0])
    place, stated = images.rows_of(orientation.rows), images.stated[orientation.rows].reshape(-1, 4)
    by_parallax = pair_errors.elements_by_parallax(orientation, pairs.parallax_by_elements)[own]
    parallax = np.where(orientation.used[:, None], pairs.parallax_by_image * stated, 0.0)[own]
    scale, scale_before = ((by_parallax * shares[orientation.pairs.pair[own]]).sum(axis=1) for shares in of_scale)
    by_parallax = np.column_stack([by_parallax, scale])
    # of the models photo - 2, photo - 1 and photo; the last of each is the scale
    of_model = np.split(images.components, [1, 1 + COMPONENTS], axis=2)
    sides = (parallax[:, :2], place[own, 0], 2), (parallax[:, 2:], place[own, 1], 1)
    for by_image, image, slot in sides:
        of_model[slot][image] = by_image[:, :, None] * by_parallax[:, None, :]
    for by_image, image, slot in sides:
        of_model[slot - 1][image, :, -1] += by_image * scale_before[:, None]
    by_before = (before[:, None] @ pairs.point_by_image[joined.before])[:, 0] * stated[joined.before]
    by_after = (after[:, None] @ pairs.point_by_image[joined.after])[:, 0] * stated[joined.after]
    of_model[2][place[joined.before, 0], :, -1] += by_before[:, :2]
    of_model[1][place[joined.before, 1], :, -1] += by_before[:, 2:] - by_after[:, :2]
    of_model[0][place[joined.after, 1], :, -1] -= by_after[:, 2:]


def _steps(pairs: PairErrors, next_centers: Floats) -> Floats:
    """Derive steps by components: t = dB - theta x (S - O) - mu (S - O), theta, mu; S the centre joining the models."""
    steps = np.zeros((len(next_centers), SIMILARITY_PARAMETERS, COMPONENTS))
    steps[:, :3, ELEMENTS] = pairs.base_by_elements + cross_matrix(next_centers) @ pairs.rotation_by_elements
    steps[:, :3, SCALE] = -next_centers
    steps[:, 3:6, ELEMENTS] = pairs.rotation_by_elements
    steps[:, 6, SCALE] = 1.0
    return steps


def _component_covariances(images: ImagePoints, models: int) -> Floats:
    """Q(m, m + apart) = sum over common image points of their rows' products, shape (p, 3, 6, 6)."""
    photos = models + 1
    counts = np.bincount(images.photo, minlength=photos)
    rank = np.arange(len(images.photo)) - np.concatenate([[0], np.cumsum(counts)])[images.photo]
    gram = np.zeros((photos, SPAN * COMPONENTS, SPAN * COMPONENTS))
    for start, stop in runs(np.concatenate([[0], np.cumsum(counts)]), IMAGES):
        padded = np.zeros((stop - start, int(counts.max()), *images.components.shape[1:]))
        rows = slice(*np.searchsorted(images.photo, [start, stop]).tolist())
        padded[images.photo[rows] - start, rank[rows]] = images.components[rows]
        flat = padded.reshape(stop - start, -1, padded.shape[-1])
        gram[start:stop, MOVED, MOVED] = flat.transpose(0, 2, 1) @ flat
    gram = gram.reshape(photos, SPAN, COMPONENTS, SPAN, COMPONENTS)
    result = np.zeros((models, SPAN, COMPONENTS, COMPONENTS))
    for apart in range(SPAN):
        for slot in range(SPAN - apart):  # the earlier model is photo - 2 + slot
            of_photo = gram[SHARING - slot :, slot, :, slot + apart]
            result[: len(of_photo), apart] += of_photo[:models]
    return result


@dataclass(frozen=True, eq=False)
class _PointsInMaking:
    """Rows of the points in the making: means over their k models, each brought back over the steps to the first."""

    strip: PlacedStrip
    # rows, item, slot: (t,): rows of the pairs' table that count, the point of each, and its model from the first of
    # the point on
    rows: Numbers
    item: Numbers
    slot: Numbers
    first: Numbers  # (q,): first model of each point
    by_component: Floats  # (q, s, 3, 6)
    starts: Numbers  # (q + 1,): where the image points of each point begin that enter directly
    image: Numbers  # (e,): these image points
    by_image: Floats  # (e, 3, 2): in mm so far
    entry: Numbers  # (n,): place of each image point among these, -1 of those that do not enter

    @classmethod
    def of(cls, strip: PlacedStrip) -> Self:
        """Lay out rows of zeros."""
        orientation, formed = strip.orientation, strip.formed
        rows = np.flatnonzero(orientation.used & np.isfinite(formed.model_xyz).all(axis=1))
        item = np.searchsorted(formed.point, orientation.point[rows])
        model, count = orientation.pairs.pair[rows], len(formed.point)
        first = np.full(count, len(strip.steps))
        np.minimum.at(first, item, model)
        if len(formed.home):
            first = np.where(formed.model_count == 0, formed.home, first)
        slot = model - first[item]
        point_of = np.full(len(strip.images.row), -1)
        point_of[strip.images.rows_of(orientation.rows[rows])] = item[:, None]
        image = np.flatnonzero(point_of >= 0)
        image = image[np.argsort(point_of[image], kind="stable")]
        entry = np.full(len(point_of), -1)
        entry[image] = np.arange(len(image))
        return cls(
            strip=strip,
            rows=rows,
            item=item,
            slot=slot,
            first=first,
            by_component=np.zeros((count, int(slot.max()) + 1, 3, COMPONENTS)),
            starts=np.searchsorted(point_of[image], np.arange(count + 1)),
            image=image,
            by_image=np.zeros((len(image), 3, 2)),
            entry=entry,
        )

    def add(self, section: Section, pairs: PairErrors) -> None:
        """Put in what the models of a section do to their points."""
        start = section.rows.start
        some = slice(*np.searchsorted(self.rows, [start, start + section.own]).tolist())
        rows, item = self.rows[some], self.item[some]
        share = (1 / self.strip.formed.model_count[item])[:, None, None]
        place = self.entry[self.strip.images.rows_of(self.strip.orientation.rows[rows])]
        for side, columns in ((0, slice(0, 2)), (1, slice(2, 4))):
            self.by_image[place[:, side]] += share * pairs.point_by_image[rows - start, :, columns]
        self.by_component[item, self.slot[some], :, ELEMENTS] = share * pairs.point_by_elements[rows - start]

    def finished(self) -> PointRows:
        """Return the rows, all models having been put in."""
        steps, by_component, first = self.strip.steps, self.by_component, self.first
        held = np.zeros(by_component.shape[:2])
        held[self.item, self.slot] = 1 / self.strip.formed.model_count[self.item]
        beyond = np.cumsum(held[:, ::-1], axis=1)[:, ::-1]
        xyz = self.strip.xyz
        for s in range(by_component.shape[1] - 1):  # share of the models after each slot
            moved = np.flatnonzero(beyond[:, s + 1] > 0)
            for some in np.split(moved, range(IMAGES, len(moved), IMAGES)):  # the steps of all take twice the memory
                along = similarity_derivatives(xyz[some], np.zeros(3)) @ steps[first[some] + s]
                by_component[some, s] += beyond[some, s + 1, None, None] * along
        by_image = self.by_image
        by_image *= self.strip.images.sigma[self.image][:, None, :]
        return PointRows(
            xyz=xyz,
            first=first,
            by_component=by_component,
            starts=self.starts,
            image=self.image,
            by_image=by_image,
        )
