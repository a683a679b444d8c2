"""The free network of a formed strip: all its rays, to be adjusted and tested at once.

A strip of photos: its pairs oriented, its models joined, its rays tested all at once.

It is formed again without the wrong rays.

Strips among photos that are listed in no order.

Photos are laid side by side by their common points, two and two. A strip begins with the two photos that have most
points in common and goes on at both ends, from photo to photo, with the one that has most points in common, times the
cosine of its direction to straight on, of those that lie nearer to ahead than to aside, within 45 degrees. It is cut
where it cannot be formed. Neither the order of the tables nor the photos' kappa has a say in it; ids decide between
equals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.similarity import Similarity
from photostrip.network.adjustment import Selection
from photostrip.network.problem import BundleCameras, BundleProblem, BundleSettings, ImageObservations, StartValues
from photostrip.network.snooping import screen_bundle
from photostrip.notes import Note, counted, listed
from photostrip.pipeline.inputs import Inputs, Settings, Strip, kept_rows, rows_of
from photostrip.plausibility import mosaic
from photostrip.points import PhotoPoints
from photostrip.rejection import SEVERAL_RAYS, Rejection
from photostrip.statistics import normal_quantile
from photostrip.strip import absolute_orientation, corrections, pair_screening, resection
from photostrip.strip.formed_strip import (
    NOTHING_GIVEN,
    FirstPhoto,
    FormedStrip,
    StripFormationSettings,
    form_from_pairs,
    mean_points,
    without_points,
    without_rows,
)
from photostrip.strip.pair_screening import ALPHA, FIFTH_WRONG, ScreenedPairs
from photostrip.strip.relative_orientation import (
    MINIMUM_LEFT,
    MINIMUM_POINTS,
    Orientation,
    RelativeSettings,
    collect_pairs,
    orient_again,
    orient_unchecked,
    refuse_unusable,
)
from photostrip.strip.robust import MEDIAN_SPREAD, scales
from photostrip.strip.strip_errors import StripErrors, differentiate_strip


@dataclass(frozen=True, eq=False)
class StripRays:
    observations: PhotoPoints
    position: Numbers  # (n,): place in the strip of the photo of every image point; -1 for photos of other strips
    sigma: Floats  # (p,): standard deviations of a y parallax of weight one in each pair, mm
    weight: Floats  # (m,): weights of the rows of the pairs before anything was rejected
    stated: float  # standard deviation of an image coordinate of weight one, mm
    kept: Numbers  # rows that the user keeps: their points are not tested


STRIP_LEVEL = 0.012  # of a whole strip, and of what is rejected the part that is not wrong


def wrong_rays(oriented: Orientation, formed: FormedStrip, rays: StripRays) -> tuple[Rejection, ...] | None:
    """Test all rays of a strip, and return those that must not be used; rows are those of the observations.

    None where what is left holds the photos too badly for an adjustment.
    """
    rows = np.unique(oriented.rows)
    sigma = rays.observations.sigma[rows] * _spread_of_photos(oriented, rays)[rays.position[rows], None]
    problem = free_network(oriented, formed, rays.observations, rays.position, rows, sigma)
    kept = np.isin(rows, rays.kept)
    begin = replace(Selection.everything(problem), images=~_suspected(oriented, formed, rays, rows))
    try:
        found = screen_bundle(problem, begin, BundleSettings(level=STRIP_LEVEL), kept, rough=True)
    except GeometryError:
        return None
    return tuple(replace(each, row=int(rows[each.row])) for each in found.rejections if not each.readmitted)


def _suspected(oriented: Orientation, formed: FormedStrip, rays: StripRays, rows: Numbers) -> Flags:
    """Rays of the points that a pair or a junction rejected, and the user does not keep.

    Not suspected are the points of a pair, or of a junction, that would have too few others.
    """
    point, joined, pairs = rays.observations.point, formed.junctions, oriented.pairs
    suspected = np.zeros(len(rays.observations.point_ids), bool)
    suspected[np.append(oriented.point[~oriented.used], joined.point[~joined.used])] = True
    few = pairs.sums((oriented.used & ~suspected[oriented.point]).astype(float)) < MINIMUM_LEFT
    bare = np.bincount(joined.junction, joined.used & ~suspected[joined.point], pairs.size) == 0
    suspected[oriented.point[oriented.used & few[pairs.pair]]] = False
    suspected[joined.point[joined.used & bare[joined.junction]]] = False
    suspected[point[rays.kept]] = False
    return np.asarray(suspected[point[rows]], bool)


def _spread_of_photos(oriented: Orientation, rays: StripRays) -> Floats:
    """Give standard deviations of the image coordinates of each photo over the stated ones, (p + 1,).

    A photo is worse when the y parallaxes of both its pairs, the rejected ones among them, prove it even if a fifth of
    them are wrong.
    """
    pairs, weight = oriented.pairs, rays.weight
    count = pairs.sums((weight > 0).astype(float))
    redundancy = np.maximum(count - MINIMUM_POINTS, 1)
    found = scales(np.abs(oriented.parallax) * np.sqrt(weight), weight, pairs.pair, pairs.size) / rays.sigma
    found *= np.sqrt(count / redundancy)
    chance = normal_quantile(1 - np.sqrt(ALPHA / pairs.size)) * MEDIAN_SPREAD  # that both pairs show it
    factor = np.where(found > FIFTH_WRONG * (1 + chance / np.sqrt(redundancy)), found, 1.0)
    factor = np.minimum(np.append(factor, factor[-1]), np.append(factor[0], factor))
    # a parallax is that with a good photo
    return np.asarray(np.sqrt(2 * factor**2 - 1) * rays.sigma.max() / (np.sqrt(2.0) * rays.stated), float)


def free_network(
    oriented: Orientation,
    formed: FormedStrip,
    observations: PhotoPoints,
    position: Numbers,
    rows: Numbers,
    sigma: Floats,
) -> BundleProblem:
    """Rays (r,) as a bundle without control, from the formed strip.

    position: (n,): place in the strip of the photo of every image point.
    sigma: (r, 2): standard deviations of the rays, mm.
    """
    point, at = np.unique(observations.point[rows], return_inverse=True)
    xyz = np.full((len(point), 3), np.nan)
    for use in (np.isfinite(formed.model_xyz[:, 0]), oriented.used & np.isfinite(formed.model_xyz[:, 0])):
        mean = mean_points(oriented.point, formed.model_xyz, use)
        xyz[np.searchsorted(point, mean.point)] = mean.xyz
    images = ImageObservations(photo=position[rows], point=at.astype(np.intp), xy=observations.xy[rows], sigma=sigma)
    return BundleProblem(
        images=images,
        cameras=BundleCameras(np.zeros(len(formed.centers), np.intp), np.array([oriented.pairs.focal])),
        start=StartValues(formed.centers, formed.rotations, xyz),
    )


class ScreenedFormation(NamedTuple):
    """A strip without what its rays contradict."""

    orientation: Orientation
    formed: FormedStrip
    rejections: tuple[Rejection, ...]  # rays that must not be used, rows of the observations
    tested: bool = True  # False where the rays that were left could not be adjusted together


def form_screened(
    of_pairs: Orientation,
    rays: StripRays,
    photos: Sequence[str],
    settings: StripFormationSettings,
    *,
    readmit: bool,
    first: FirstPhoto = NOTHING_GIVEN,
) -> ScreenedFormation:
    """Form a strip, leave out what its rays contradict, take back what they confirm, and form it again.

    Where pairs and junctions had nothing to reject, nothing is looked for.

    readmit: whether points that a pair rejected may be taken back.
    first: as in ``form_from_pairs``.
    """
    formed = form_from_pairs(of_pairs, settings, photos, rays.sigma, first=first)
    if of_pairs.used.all() and formed.junctions.used.all():
        return ScreenedFormation(of_pairs, formed, ())

    found = wrong_rays(of_pairs, formed, rays)
    if found is None:
        return ScreenedFormation(of_pairs, formed, (), tested=False)
    used, aside = _uses(of_pairs, found, readmit=readmit)
    changed = np.unique(of_pairs.pairs.pair[used != of_pairs.used])
    oriented = orient_again(of_pairs, np.where(used, rays.weight, 0.0), changed) if len(changed) else of_pairs
    try:
        formed = form_from_pairs(oriented, settings, photos, rays.sigma, aside, searched=True, first=first)
    except GeometryError:
        oriented = of_pairs  # nothing would join two models: what joined them before stays
    formed = without_rows(formed, oriented, aside)
    return ScreenedFormation(oriented, _bridged(formed, oriented, rays, photos, found), found)


def _bridged(
    formed: FormedStrip, oriented: Orientation, rays: StripRays, photos: Sequence[str], found: Sequence[Rejection]
) -> FormedStrip:
    """Add the points whose good rays come from photos that are no neighbours."""
    rows = oriented.rows[~np.isin(oriented.point, formed.point)]
    good = np.unique(rows[~np.isin(rows, np.array([each.row for each in found], np.intp))])
    if not len(good):
        return formed
    return resection.bridge(formed, rays.observations, photos, oriented.pairs.focal, good)


def _uses(of_pairs: Orientation, found: Sequence[Rejection], *, readmit: bool) -> tuple[Flags, Flags]:
    """Rows of the pairs' table that orient their pair, and those of them that must not place their point.

    Where it cannot be told which of several rays is wrong, those pairs that found nothing wrong keep the point: its
    y parallaxes are good, its place is not. Pairs that would have fewer than five points keep those of their own
    search; the strip has redundancy where a pair of five has none.
    """
    wrong, unclear = np.zeros((2, int(of_pairs.rows.max()) + 1), bool)
    wrong[[each.row for each in found]] = True
    unclear[[each.row for each in found if each.cause == SEVERAL_RAYS]] = True
    gone, aside = (np.asarray(each[of_pairs.rows].any(axis=1), bool) for each in (wrong, unclear))
    used = np.where(aside | (not readmit), of_pairs.used & (aside | ~gone), ~gone)
    pairs = of_pairs.pairs
    left, had = (pairs.sums(each.astype(float)) for each in (used, of_pairs.used))
    poor = (left < np.minimum(MINIMUM_POINTS, had))[pairs.pair]
    return np.where(poor, of_pairs.used, used), aside


def with_readmitted(rejections: Sequence[Rejection], used: Flags) -> tuple[Rejection, ...]:
    """Mark the rejections of pairs that the strip took back; ``used`` (m,) are the rows used in the end."""
    return tuple(replace(each, readmitted=bool(used[each.row])) for each in rejections)


@dataclass(frozen=True, eq=False)
class FormedPhotos:
    """A strip of photos before it meets its control."""

    strip: Strip
    observations: PhotoPoints  # ideal image coordinates of the whole project
    sigma: float  # median standard deviation of the strip's image coordinates, mm
    screened: pair_screening.ScreenedPairs  # the search for gross errors in its pairs
    formed: FormedStrip
    wrong_rays: tuple[Rejection, ...]  # rays that the others of their points contradict
    rays_tested: bool = True  # whether those rays could be searched for

    @property
    def orientation(self) -> Orientation:
        """Relative orientation of the pairs, as the strip was formed."""
        return self.screened.orientation

    @property
    def point_ids(self) -> tuple[str, ...]:
        return self.observations.point_ids

    @property
    def point_precision(self) -> absolute_orientation.PointPrecision:
        """A-priori standard deviation of a point of one model, in the unit of the strip.

        Plan: that of an image coordinate at photo scale; height: that of an x parallax times the ratio of depth to
        base.
        """
        formed, pairs = self.formed, self.orientation.pairs
        arm = formed.model_xyz - formed.centers[pairs.pair]
        base = np.diff(formed.centers, axis=0)[pairs.pair]
        length = np.linalg.norm(base, axis=1)
        depth = np.linalg.norm(np.cross(arm, base), axis=1) / length
        good = np.isfinite(depth)
        depth_mean = float(depth[good].mean())
        plan = self.sigma * depth_mean / pairs.focal
        return absolute_orientation.PointPrecision(
            plan, plan * float(np.sqrt(2.0)) * depth_mean / float(length[good].mean())
        )

    @property
    def excess(self) -> float:
        """Variance of an image coordinate over what is stated, at least 1: as large as the pairs have proved."""
        return max(1.0, float(np.median(self.screened.scatter.by_pair)) ** 2 / (2 * self.sigma**2))

    def errors(self, similarity: Similarity) -> StripErrors:
        """Differentiate the strip after a similarity by its image coordinates, and by the doubts about its scales.

        They count in stated standard deviations: covariances are those of the strip when multiplied by ``excess``.
        """
        errors = differentiate_strip(self.orientation, self.formed, similarity, self.observations.sigma)
        return errors.with_doubt(self.formed.junctions.doubt / np.sqrt(self.excess))

    def covariance(self, similarity: Similarity) -> Callable[[Numbers, Floats], Floats]:
        """Give the covariance of coordinates along directions (w, 3) of rows (w,) of its points, after a similarity."""
        errors = self.errors(similarity)

        def of(row: Numbers, direction: Floats) -> Floats:
            along = errors.along(row, direction)
            first, _ = errors.frames(along)  # no test depends on what moves the whole section
            return errors.joint_covariance(along, first) * self.excess

        return of

    @property
    def rejections(self) -> tuple[Rejection, ...]:
        """Points taken out of pairs."""
        return self.screened.rejections

    def without_images(self, wrong: Mapping[str, Rejection]) -> FormedPhotos:
        o, photo = self.observations, self.strip.positions(self.observations)
        points, rays = [], []
        for name, each in wrong.items():
            points.append(o.point_ids.index(name))
            (row,) = np.flatnonzero((o.point == points[-1]) & (photo == each.other))
            rays.append(replace(each, row=int(row)))
        return replace(
            self,
            formed=without_points(self.formed, self.orientation, np.array(points, np.intp)),
            wrong_rays=(*self.wrong_rays, *rays),
        )

    @cached_property
    def rays_in_use(self) -> Numbers:
        """Rows of image points that are used in a model or place a point without one, in the order of the photos."""
        oriented, formed = self.orientation, self.formed
        in_models = oriented.rows[oriented.used & np.isfinite(formed.model_xyz).all(axis=1)]
        rows = np.unique(np.append(in_models, formed.bridging))
        return rows[np.argsort(self.strip.positions(self.observations)[rows], kind="stable")]


def touched(entries: Sequence[str], observations: PhotoPoints, rows: Numbers) -> Flags:
    """Which rows (m,) of a table of pairs, with the rows (m, 2) of their measurements, use one of a list."""
    return np.asarray(np.isin(rows, list(rows_of(entries, observations).values())).any(axis=1), bool)


def restored(screened: ScreenedPairs, weight: Floats, kept: Flags) -> ScreenedPairs:
    """Take rejected measurements back that the user keeps; their rejections are marked as re-admitted.

    weight, kept: (m,), weights before the search, and rows that are kept.
    """
    oriented = screened.orientation
    back = kept & ~oriented.used
    if not back.any():
        return screened
    restored_weight = np.where(back, weight, oriented.pairs.weight)
    oriented = orient_again(oriented, restored_weight, np.unique(oriented.pairs.pair[back]))
    log = tuple(replace(each, readmitted=each.readmitted or bool(back[each.row])) for each in screened.rejections)
    return replace(screened, orientation=oriented, rejections=log)


def screened_pairs(
    strip: Strip, observations: PhotoPoints, settings: RelativeSettings
) -> tuple[pair_screening.ScreenedPairs, Floats]:
    """Orient pairs, those among them that cannot be used, without what is wrong in them; and their weights before."""
    pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
    pairs = pairs.without(touched(settings.drop, observations, pairs.rows))
    first, converged = orient_unchecked(pairs)
    screened = pair_screening.screen_pairs(first, settings, strip.median_sigma(observations), converged)
    kept = touched(settings.keep, observations, pairs.rows)
    return restored(screened, pairs.weight, kept), pairs.weight


def form_strip(strip: Strip, observations: PhotoPoints, settings: Settings) -> FormedPhotos:
    """Form a strip from its pairs, without any control."""
    sigma = strip.median_sigma(observations)
    screened, weight = screened_pairs(strip, observations, settings.relative)
    # a fresh value: the rays that it finds, 48 bytes for each of its rows, go with it, what is kept of the stages stays
    oriented, scatter = replace(screened.orientation), screened.scatter.by_pair
    refuse_unusable(oriented, screened.converged, strip.photos)
    wrong: tuple[Rejection, ...] = ()
    tested = True
    if settings.relative.screening == "none":
        formed = form_from_pairs(oriented, settings.formation, strip.photos, scatter, first=strip.first)
    else:  # the strip decides what its pairs could not
        rays = StripRays(
            observations=observations,
            position=strip.positions(observations),
            sigma=scatter,
            weight=weight,
            stated=sigma,
            kept=kept_rows(settings.relative.keep, observations),
        )
        readmit = settings.relative.screening in pair_screening.SEARCHES
        oriented, formed, wrong, tested = form_screened(
            oriented,
            rays,
            strip.photos,
            settings.formation,
            readmit=readmit,
            first=strip.first,
        )
        rejections = with_readmitted(screened.rejections, oriented.used)
        # as a fresh value: the rays of the old one, 48 bytes for each of its rows, are not needed again
        screened = replace(screened, orientation=replace(oriented), rejections=rejections)
    return FormedPhotos(
        strip=strip,
        observations=observations,
        sigma=sigma,
        screened=screened,
        formed=formed,
        wrong_rays=wrong,
        rays_tested=tested,
    )


AHEAD = float(np.cos(np.pi / 4))

Run = tuple[int, ...]  # photos by number, one behind the other


class Start(NamedTuple):
    """Photos that are listed in no order, brought into strips or left to themselves."""

    inputs: Inputs
    note: Note


def starts(inputs: Inputs, measured: PhotoPoints, settings: Settings) -> Iterator[Start]:
    """Give the ways in which photos that are listed in no order may start, the likeliest first.

    With all their orientations given they start from these, whatever their arrangement; otherwise from strips that are
    found among them. Where some are given, the other way is the second.
    """
    oriented = _oriented(inputs)
    as_given = Start(inputs, _of_given(sum(oriented), len(oriented)))
    if all(oriented):
        yield as_given
    yield _with_strips_found(inputs, measured, settings)
    if any(oriented) and not all(oriented):
        yield as_given


def notes(start: Start, refused: Sequence[GeometryError]) -> Iterator[Note]:
    """Say how the photos started, and which start led nowhere."""
    yield start.note
    for error in refused:
        yield Note("start-refused", f"another start of the photos in no given order led nowhere: {error}", "note")


def refusal(inputs: Inputs, refused: GeometryError) -> GeometryError:
    """Say what to give where photos that are listed in no order cannot be oriented."""
    if all(_oriented(inputs)) or (refused.code == "strip-not-tied" and len(refused.photos) == 1):
        return refused
    message = (
        f"{refused}; where photos in no given order are too much for a start, give their orientations roughly "
        "(orientations, role: approximate), as a COLMAP model has them, or list them in flight order in `strips`"
    )
    return GeometryError(message, photos=refused.photos, points=refused.points, code=refused.code)


def _oriented(inputs: Inputs) -> list[bool]:
    """Whether the orientation of each photo that is listed in no order is given."""
    known = frozenset(() if inputs.orientations is None else inputs.orientations.photos)
    return [strip.id in known for strip in inputs.strips if not strip.listed]


def _of_given(oriented: int, photos: int) -> Note:
    of_all = "their given orientations" if oriented == photos else f"the given orientations of {oriented} of them"
    return Note("photos-in-no-order", f"{counted(photos, 'photo')} in no given order start from {of_all}", "note")


def _with_strips_found(inputs: Inputs, measured: PhotoPoints, settings: Settings) -> Start:
    """Put strips in the place of photos that are listed in no order, as far as some are found among them.

    A strip has one camera. Photos that join none stay what they are, strips of their own.
    """
    singles = [strip for strip in inputs.strips if not strip.listed]
    # refraction and curvature need heights, and bend rays by less than a tilt does
    plain = replace(settings.refinement, refraction=False, earth_radius=None)
    observations = corrections.refine(measured, inputs.cameras, plain).observations
    taken = {strip.id for strip in inputs.strips}
    found: list[Strip] = []
    for camera in dict.fromkeys(strip.camera.name for strip in singles):
        of_camera = [strip for strip in singles if strip.camera.name == camera]
        for strip in _of_camera(of_camera, observations, settings):
            name = strip.id
            while name in taken:
                name += "'"
            taken.add(name)
            found.append(replace(strip, id=name))
    member = {name for strip in found for name in strip.photos}
    left = [strip for strip in singles if strip.id not in member]
    place = {strip.id: number for number, strip in enumerate(singles)}
    found.sort(key=lambda each: place[each.photos[0]])
    ordered = sorted([*found, *left], key=lambda each: place[each.photos[0]])
    strips = (*(strip for strip in inputs.strips if strip.listed), *ordered)
    return Start(replace(inputs, strips=strips), _of_found(len(singles), found, left))


def _of_found(number: int, found: Sequence[Strip], left: Sequence[Strip]) -> Note:
    strips = [f"{strip.id} ({counted(len(strip.photos), 'photo')})" for strip in found]
    among = f"{counted(len(found), 'strip')} found among them, {listed(strips)}" if found else "no strip among them"
    text = f"{counted(number, 'photo')} in no given order: {among}"
    if left:
        alone = counted(len(left), "photo is", "photos are")
        text += f"; {alone} oriented one by one, {listed(strip.id for strip in left)}"
    return Note("photos-in-no-order", text, "note")


def _of_camera(singles: Sequence[Strip], observations: PhotoPoints, settings: Settings) -> Iterator[Strip]:
    """Find the strips among photos of one camera."""
    names = [strip.id for strip in singles]

    def made(run: Run) -> Strip:
        photos = tuple(names[number] for number in run)
        return replace(singles[run[0]], id=f"{photos[0]}-{photos[-1]}", photos=photos)

    def place_of_refusal(run: Run) -> int:
        try:
            form_strip(made(run), observations, settings)
        except GeometryError as error:
            named = [place for place, number in enumerate(run) if names[number] in error.photos]
            return named[-1] if named else len(run) - 1
        return 0

    for run in _runs(mosaic.link(observations, names), place_of_refusal):
        yield made(run if run[0] < run[-1] else run[::-1])


def _runs(links: mosaic.PhotoLinks, place_of_refusal: Callable[[Run], int]) -> list[Run]:
    """Find runs of photos.

    place_of_refusal: gives the place in a run before which it must be cut to be formed; 0 where it can be.
    """
    known = np.flatnonzero(links.fits & (links.count >= MINIMUM_POINTS))
    order = known[np.lexsort((*links.photo[known].T[::-1], -links.count[known]))].tolist()
    ways: dict[int, dict[int, Way]] = {}  # of each photo to others
    for row in order:
        one, other = links.photo[row].tolist()
        count, (to_other, to_one) = int(links.count[row]), (complex(base[row]) for base in links.bases)
        ways.setdefault(one, {})[other] = Way(count, to_other / max(abs(to_other), mosaic.TINY))
        ways.setdefault(other, {})[one] = Way(count, to_one / max(abs(to_one), mosaic.TINY))
    found: list[Run] = []
    free = set(ways)
    for row in order:
        one, other = links.photo[row].tolist()
        if one not in free or other not in free:
            continue
        ahead = _continued((one, other), ways, free)
        for run in _cut(_continued(ahead[::-1], ways, free), place_of_refusal):
            found.append(run)
            free -= set(run)
    return found


class Way(NamedTuple):
    """Where another photo lies on a photo."""

    points: int  # in common
    direction: complex  # of its centre, length 1


def _continued(run: Run, ways: Mapping[int, Mapping[int, Way]], free: AbstractSet[int]) -> Run:
    """Go on at the end of a run as long as a photo lies ahead."""
    left = free - set(run)
    while True:
        before, last = run[-2:]
        forward = -ways[last][before].direction
        ahead: list[tuple[float, int]] = []
        for other, way in ways[last].items():
            cosine = (way.direction * forward.conjugate()).real
            if cosine > AHEAD and other in left:
                ahead.append((way.points * cosine, -other))
        if not ahead:
            return run
        run = (*run, -max(ahead)[1])
        left -= {run[-1]}


def _cut(run: Run, place_of_refusal: Callable[[Run], int]) -> Iterator[Run]:
    """Cut a run into parts of two photos or more that can be formed."""
    if len(run) < 2:
        return
    place = place_of_refusal(run)
    if not place:
        yield run
        return
    yield from _cut(run[:place], place_of_refusal)
    yield from _cut(run[place:], place_of_refusal)
