"""What is asked of the bundle adjustment beside the adjustment itself.

What a bundle adjustment is given: frozen arrays, in one Cartesian frame, without files and without ids to look up.

All coordinates are metres in one right-handed Cartesian frame whose origin lies near the points (a geocentric frame
is shifted: 6 400 km in front of every number would cost three digits). All image coordinates are ideal: millimetres,
relative to the principal point, without distortion. Rotations take photo axes to the Cartesian frame.

A sigma that is infinite switches an observation off; a sigma of zero is refused.

A problem made ready: what does not change during the adjustment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Distortion
from photostrip.geodesy.frame_spec import GROUND_AXES

SCREENINGS = ("snooping", "none")
TESTS = ("tau", "baarda")


class CameraParameter(NamedTuple):
    """A calibration parameter of a camera."""

    asked: str  # what a user asks for; the principal point is asked for as one
    power: int  # of the distance from the principal point by which its correction of an image coordinate grows
    axis: str = ""

    @property
    def title(self) -> str:
        return f"{self.asked} {self.axis}".rstrip()

    @property
    def unit(self) -> str:
        return {0: "mm", 1: "1"}.get(self.power, f"mm^-{self.power - 1}")


CALIBRATION = {
    "c": CameraParameter("principal_distance", 0),
    "x0": CameraParameter("principal_point", 0, "x"),
    "y0": CameraParameter("principal_point", 0, "y"),
    "k1": CameraParameter("k1", 3),
    "k2": CameraParameter("k2", 5),
    "k3": CameraParameter("k3", 7),
    "p1": CameraParameter("p1", 2),
    "p2": CameraParameter("p2", 2),
    "b1": CameraParameter("affinity", 1),
    "b2": CameraParameter("shear", 1),
}
"""The calibration parameters of a camera, in the order of their columns: what ``corrections`` corrects by."""
ASKED = tuple(dict.fromkeys(each.asked for each in CALIBRATION.values()))


@dataclass(frozen=True)
class BundleSettings:
    screening: str = "snooping"  # how gross errors are searched for: by the largest test values, or ``"none"``
    # ``"tau"``: residuals are compared with the sigma0 found; ``"baarda"``: with the stated standard deviations
    test: str = "tau"
    # probability that anything is rejected in an adjustment without gross errors; of many rejections the part that is
    # false
    level: float = 0.01
    # probability that the test of one good observation rejects it; None: the level, shared out among all of them
    alpha: float | None = None
    power: float = 0.80  # probability with which an error of the size of the minimal detectable one is found
    variance_components: bool = False  # whether the standard deviations of the groups of observations are estimated
    # whether lens distortion, film, principal point and distance are estimated where the observations ask for them
    search_cameras: bool = True
    # a-priori standard deviations of these parameters about the given calibration, in their units; without one a
    # parameter is free
    calibration_sigma: dict[str, float] = field(default_factory=dict)


def _no_rows(*shape: int) -> Floats:
    return np.zeros((0, *shape))


def _no_numbers() -> Numbers:
    return np.zeros(0, np.intp)


@dataclass(frozen=True, eq=False)
class ImageObservations:
    """Measured rays; or points of independent models, ``R' (X - T) / k`` with T, R, k those of the model.

    A ray has c = 2 coordinates, a point of a model, which then stands for the photo, 3.
    """

    # photo, point: (n,): photo and point of each ray. A point is measured at most once on a photo. Any order; by photo
    # is fastest
    photo: Numbers
    point: Numbers
    xy: Floats  # (n, c): ideal image coordinates relative to the principal point, or right-handed ones of models, mm
    sigma: Floats  # (n, c): their standard deviations in mm
    correlation: Floats | None = None  # (n, 3, 3): correlations of the coordinates of models; None: there are none

    def __len__(self) -> int:
        return len(self.photo)

    @property
    def of_models(self) -> bool:
        return self.xy.shape[1] == 3

    def take(self, rows: Flags) -> ImageObservations:
        correlation = None if self.correlation is None else self.correlation[rows]
        return ImageObservations(self.photo[rows], self.point[rows], self.xy[rows], self.sigma[rows], correlation)


@dataclass(frozen=True, eq=False)
class ControlObservations:
    """Given coordinates of points. What is observed are ``axes @ (X - xyz)``, each with its own sigma."""

    point: Numbers = field(default_factory=_no_numbers)  # (c,): point of each row; a point may stand in several rows
    # (c, 3): given position, Cartesian, metres. Where a coordinate is not given (height of a plan-only point) any value
    # near the truth does: its sigma is infinite
    xyz: Floats = field(default_factory=lambda: _no_rows(3))
    # (c, 3, 3): directions of the three coordinates as rows, orthonormal: east, north, up of the frame of the list at
    # the point (``GroundFrame.axes_at``), so that plan-only and height-only mean what they say in every frame
    axes: Floats = field(default_factory=lambda: _no_rows(3, 3))
    # (c, 3): standard deviations along the three axes, metres; infinite: not given
    sigma: Floats = field(default_factory=lambda: _no_rows(3))
    frame: Numbers = field(default_factory=_no_numbers)  # (c,): list that gives each row; without: all in one
    height_only: Flags | None = None  # (c,): rows that were given in height only, whatever takes part; None: not said

    def __len__(self) -> int:
        return len(self.point)

    @property
    def lists(self) -> Numbers:
        """Number (c,) of the list that gives each row."""
        return self.frame if len(self.frame) else np.zeros(len(self), np.intp)


@dataclass(frozen=True, eq=False)
class PositionObservations:
    """Given camera positions, of the perspective centre or of an antenna.

    What is observed are ``axes @ (S + R @ lever - xyz) - offset - drift * time``, with offset and drift of the group.
    """

    photo: Numbers = field(default_factory=_no_numbers)  # (g,): photo of each row
    xyz: Floats = field(default_factory=lambda: _no_rows(3))  # (g, 3): given position, Cartesian, metres
    # (g, 3, 3): directions of the three coordinates as rows, as for ``ControlObservations``
    axes: Floats = field(default_factory=lambda: _no_rows(3, 3))
    # (g, 3): standard deviations along the axes, metres; infinite: not given
    sigma: Floats = field(default_factory=lambda: _no_rows(3))
    # (g, 3): antenna minus perspective centre in photo axes, metres
    lever: Floats = field(default_factory=lambda: _no_rows(3))
    # (g,): group (a strip, say) whose offset and drift count; -1: none
    group: Numbers = field(default_factory=_no_numbers)
    # (g,): what the drift is multiplied with: time or place along the strip, best centred
    time: Floats = field(default_factory=_no_rows)
    # offset_sigma, drift_sigma: (groups, 3): a-priori standard deviations of the three components of a group's offset
    # (metres) and drift (metres per unit of time) about zero; infinite: free; 0: there is none. They are what has to be
    # added to what is given
    offset_sigma: Floats = field(default_factory=lambda: _no_rows(3))
    drift_sigma: Floats = field(default_factory=lambda: _no_rows(3))

    def __len__(self) -> int:
        return len(self.photo)


@dataclass(frozen=True, eq=False)
class AttitudeObservations:
    """Given attitudes of photos; a given perspective centre is a row of ``PositionObservations``."""

    photo: Numbers = field(default_factory=_no_numbers)  # (a,): photo of each row
    # (a, 3, 3): given rotations, photo to Cartesian frame
    rotations: Floats = field(default_factory=lambda: _no_rows(3, 3))
    # (a, 3): standard deviations of the rotations about the three photo axes, radians; infinite: not given
    sigma: Floats = field(default_factory=lambda: _no_rows(3))

    def __len__(self) -> int:
        return len(self.photo)


@dataclass(frozen=True, eq=False)
class BundleCameras:
    """Cameras of the photos, and what is to be calibrated."""

    of_photo: Numbers = field(default_factory=_no_numbers)  # (m,): camera of each photo; of models there are none
    focal: Floats = field(default_factory=_no_rows)  # (cameras,): principal distances in mm
    # (cameras, 10), or None: a-priori standard deviations of the parameters ``CALIBRATION`` about zero, in mm and
    # powers of mm; infinite: free; 0: not a parameter. None: no calibration
    sigma: Floats | None = None
    # (cameras, 10), or None: the same for parameters that an adjustment takes up unasked; None: free
    prior: Floats | None = None
    # of each camera: the given distortion, taken out of the image coordinates; (): none
    distortion: tuple[Distortion | None, ...] = ()
    # (cameras,), or None: the camera whose other unknown parameters each has, too; None: every one has its own
    like: Numbers | None = None

    @property
    def unknown(self) -> Numbers:
        """Place of each parameter among the unknowns, (cameras, 10); -1: not an unknown."""
        found = np.full((len(self.focal), len(CALIBRATION)), -1)
        if self.sigma is not None:
            free = self.sigma > 0.0
            found[free] = np.arange(int(free.sum()))
        return found if self.like is None else np.where(found >= 0, found, found[self.like])

    def with_unknown(self, cameras: Numbers, columns: Sequence[int]) -> BundleCameras:
        """Return the cameras with more parameters of some of them unknown."""
        sigma = np.zeros((len(self.focal), len(CALIBRATION))) if self.sigma is None else self.sigma.copy()
        prior = np.full(sigma.shape, np.inf) if self.prior is None else self.prior
        for column in columns:
            new = cameras[sigma[cameras, column] == 0.0]
            sigma[new, column] = prior[new, column]
        return replace(self, sigma=sigma)


@dataclass(frozen=True, eq=False)
class StartValues:
    centers: Floats  # (m, 3): perspective centres, Cartesian, metres
    rotations: Floats  # (m, 3, 3): rotations, photo to Cartesian frame
    points: Floats  # (q, 3): points, Cartesian, metres
    scales: Floats | None = None  # (m,): of models: metres per millimetre; None: photos


@dataclass(frozen=True, eq=False)
class Parameters:
    """Values of all unknowns."""

    centers: Floats  # (m, 3): perspective centres, or origins of models, metres
    rotations: Floats  # (m, 3, 3): rotations, photo or model to Cartesian frame
    scales: Floats  # (m,): scales of models, metres per millimetre; 1 for photos
    points: Floats  # (q, 3): points, metres
    common: Floats  # (p,): calibration parameters, offsets, drifts


@dataclass(frozen=True, eq=False)
class BundleProblem:
    """All observations and all start values of one network.

    Its units are photos or independent models, its points are those of the ground; the perspective centres that models
    measure are points, too.
    """

    images: ImageObservations
    cameras: BundleCameras
    start: StartValues  # start values; they say how many photos (m) and points (q) there are
    control: ControlObservations = field(default_factory=ControlObservations)
    positions: PositionObservations = field(default_factory=PositionObservations)
    attitudes: AttitudeObservations = field(default_factory=AttitudeObservations)
    # photo_ids, point_ids, camera_ids, group_ids: names for messages; empty: the numbers
    photo_ids: tuple[str, ...] = ()
    point_ids: tuple[str, ...] = ()
    camera_ids: tuple[str, ...] = ()
    group_ids: tuple[str, ...] = ()
    position_axes: tuple[str, str, str] = GROUND_AXES  # names of the rows of ``positions.axes``

    @property
    def photos(self) -> int:
        return len(self.start.centers)

    @property
    def points(self) -> int:
        return len(self.start.points)

    @property
    def of_models(self) -> bool:
        """Whether the units are independent models."""
        return self.images.of_models

    @property
    def unit(self) -> str:
        return "model" if self.of_models else "photo"

    @property
    def unknowns(self) -> int:
        """Unknowns of a unit: shift and rotation in its own axes, of a model the logarithm of its scale."""
        return 7 if self.of_models else 6

    @property
    def least(self) -> int:
        """Measurements that place a point: rays of two photos, or coordinates in one model."""
        return 1 if self.of_models else 2

    def photo_name(self, number: int) -> str:
        return self.photo_ids[number] if self.photo_ids else f"number {number}"

    def point_name(self, number: int) -> str:
        return self.point_ids[number] if self.point_ids else f"number {number}"

    def common_names(self) -> tuple[str, ...]:
        """Names of the parameters that many photos share, in the order of ``BundleSolution.common``.

        First calibration parameters (``camera RC30: k1``), then offsets and drifts of positions (``positions A: offset
        east``; the component counts along the rows of the axes).
        """
        names, parameters = [], [each.title.replace("_", " ") for each in CALIBRATION.values()]
        if self.cameras.sigma is not None:
            for camera, row in enumerate(self.cameras.sigma):
                name = self.camera_ids[camera] if self.camera_ids else f"number {camera}"
                names += [f"camera {name}: {parameters[k]}" for k in np.flatnonzero(row > 0.0)]
        for title, sigma in (("offset", self.positions.offset_sigma), ("drift", self.positions.drift_sigma)):
            for group, axis in np.argwhere(sigma > 0.0).tolist():
                name = self.group_ids[group] if self.group_ids else f"group {group}"
                names.append(f"positions {name}: {title} {self.position_axes[axis]}")
        return tuple(names)


TOGETHER = 64  # points that are worked on together: twice and half as many take as long
COMPARED = 8  # first photos by which points are put beside others on the same ones


class NearPoints(NamedTuple):
    """Some points on nearly the same photos: their photos are few, and fill a small dense matrix."""

    points: Numbers  # (s,): the points
    photos: Numbers  # (u,): their photos, by rank
    ray: Numbers  # (n,): rays of these points
    # (n,): photo and point of each of them, as places in the above
    photo: Numbers
    point: Numbers


@dataclass(frozen=True, eq=False)
class PreparedProblem:
    """A problem with everything about it that does not change during the adjustment."""

    problem: BundleProblem
    calibrated: int  # how many of the common parameters are those of cameras; they come first
    prior: Floats  # (p,): a-priori sigmas of all common parameters
    measured: Flags  # (q,): points with rays
    joined: csr_array  # (m, m): how many points each pair of photos shares; every photo with itself
    rank: Numbers  # (m,): place of each photo in an order in which photos that share points are near each other
    # row, column: (b,): pairs of photos that share points, by rank, row >= column, sorted
    row: Numbers
    column: Numbers
    own: Numbers  # (m,): which of the pairs is each photo with itself
    near: tuple[NearPoints, ...]

    @property
    def begun(self) -> Parameters:
        """The start values, all common parameters zero."""
        start = self.problem.start
        return Parameters(
            centers=start.centers,
            rotations=start.rotations,
            scales=np.ones(len(start.centers)) if start.scales is None else start.scales,
            points=start.points,
            common=np.zeros(len(self.prior)),
        )

    def pair(self, row: Numbers, column: Numbers) -> Numbers:
        """Which of the pairs two photos are, by rank; -1: they share no point, or row < column."""
        size = len(self.rank)
        keys, wanted = self.row * size + self.column, row * size + column
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[place] == wanted, place, -1)


def prepare(problem: BundleProblem) -> PreparedProblem:
    """Find what does not change during the adjustment."""
    of_cameras = np.zeros(0) if problem.cameras.sigma is None else problem.cameras.sigma
    drifts = (problem.positions.offset_sigma, problem.positions.drift_sigma)
    sigmas = [sigma[sigma > 0.0] for sigma in (of_cameras, *drifts)]
    images, m, q = problem.images, problem.photos, problem.points
    shown = csr_array((np.ones(len(images)), (images.photo, images.point)), shape=(m, q))
    joined = csr_array(shown @ shown.T + csr_array((np.ones(m), (np.arange(m), np.arange(m))), shape=(m, m)))
    rank = _order(joined)
    one, other = (rank[each] for each in joined.nonzero())
    row, column = np.divmod(np.sort((one * m + other)[one >= other]), m)
    own = np.flatnonzero(row == column)
    return PreparedProblem(
        problem=problem,
        calibrated=len(sigmas[0]),
        prior=np.concatenate(sigmas),
        measured=np.bincount(images.point, minlength=q) > 0,
        joined=joined,
        rank=rank,
        row=row,
        column=column,
        own=own[rank],
        near=tuple(_near_points(images, rank, q)),
    )


def _order(joined: csr_array) -> Numbers:
    """Place of each photo in the narrower of two orders: as given, and reverse Cuthill-McKee."""
    row, column = joined.nonzero()
    rank = np.empty(joined.shape[0], np.intp)
    rank[reverse_cuthill_mckee(joined, symmetric_mode=True)] = np.arange(len(rank))
    narrower = np.abs(rank[row] - rank[column]).max(initial=0) < np.abs(row - column).max(initial=0)
    return rank if narrower else np.arange(len(rank))


def _near_points(images: ImageObservations, rank: Numbers, points: int) -> list[NearPoints]:
    """Cut the points with rays into pieces on nearly the same photos."""
    photo = rank[images.photo]
    rays = np.lexsort((photo, images.point))
    count = np.bincount(images.point, minlength=points)
    place = np.arange(len(rays)) - np.repeat(np.cumsum(count) - count, count)
    first = np.full((COMPARED, points), -1)
    shown = place < COMPARED
    first[place[shown], images.point[rays[shown]]] = photo[rays[shown]]
    by_photos = np.lexsort(first[::-1])
    by_photos = by_photos[count[by_photos] > 0]
    at = np.empty(points, np.intp)
    at[by_photos] = np.arange(len(by_photos))
    rays = np.argsort(at[images.point], kind="stable")
    edges = np.searchsorted(at[images.point[rays]], np.arange(TOGETHER, len(by_photos), TOGETHER))
    found = []
    for piece, ray in enumerate(np.split(rays, edges)):
        photos, own = np.unique(photo[ray], return_inverse=True)
        begin = piece * TOGETHER
        some = by_photos[begin : begin + TOGETHER]
        place = at[images.point[ray]] - begin
        found.append(NearPoints(points=some, photos=photos, ray=ray, photo=own, point=place))
    return found
