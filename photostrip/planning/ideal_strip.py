"""The strip that a flight is meant to give, and where control is to be placed along it.

Level photos at equal distances, pass points where they belong, no errors: it is simulated and taken through the
operations of the strip method, so that what is planned is what will be computed.

How precise a planned strip becomes with a layout of control, by each method of adjustment.

The covariances are those that a run reports for a measured strip: nothing is propagated anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.local_frame import IntermediateFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.similarity import Similarity
from photostrip.network import problem as bundle
from photostrip.network.adjustment import solve
from photostrip.network.reliability import cofactors_of as bundle_precision
from photostrip.notes import counted
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.simulation import Control, Flight, Ground, Image, Points, Simulation, Spec, Terrain, simulate
from photostrip.strip import absolute_orientation, fitted_strip, polynomial
from photostrip.strip.fitted_strip import FittedStrip
from photostrip.strip.formed_strip import FormedStrip, StripFormationSettings, form_from_pairs
from photostrip.strip.pair_screening import DETECTABLE
from photostrip.strip.relative_orientation import Orientation, collect_pairs, orient_pairs
from photostrip.strip.strip_errors import StripErrors, differentiate_strip

SAME = 1e-6  # of a base: a point this near to the nadir of a photo belongs to its column
LEAST_PHOTOS = 3
USUAL_POINTS = Points(rows=5, scatter_percent=0.0, extra_per_model=0)
LAYOUTS = ("bands", "corners", "corners+centre", "points")
USES = {"xyz": (True, True, True), "xy": (True, True, False), "z": (False, False, True)}
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class StripGeometry:
    """What is flown and measured."""

    camera: Camera  # the camera; its lens counts as ideal
    photos: int
    end_lap_percent: float = 60.0
    scale: float = 10_000.0
    # pass points: rows of them across the flight at each nadir, and further ones in each model
    points: Points = USUAL_POINTS
    image_sigma: float = 0.005  # standard deviation of an image coordinate, mm

    @property
    def base(self) -> float:
        """Distance of neighbouring perspective centres, metres."""
        return self._spec.base

    @property
    def _spec(self) -> Spec:
        flight = Flight(
            photos=self.photos,
            end_lap_percent=self.end_lap_percent,
            scale=self.scale,
            attitude_sigma_deg=(0.0, 0.0, 0.0),
            position_sigma=(0.0, 0.0, 0.0),
        )
        return Spec(
            name="plan",
            camera=replace(self.camera, principal_point=(0.0, 0.0), distortion=None, fiducials={}),
            ground=Ground(crs="local"),
            flight=flight,
            terrain=Terrain(height=0.0, relief=0.0),
            points=self.points,
            control=Control(layout="corners", check=0),
            image=Image(sigma_um=0.0),
        )

    def simulated(self) -> Simulation:
        """Simulate it without any errors, flown along X of a local frame."""
        return simulate(self._spec)


@dataclass(frozen=True, eq=False)
class IdealStrip:
    """An error-free strip with its derivatives."""

    geometry: StripGeometry
    photos: tuple[str, ...]  # photos in flight order
    observations: PhotoPoints  # image coordinates without errors, with their standard deviations
    orientation: Orientation
    formed: FormedStrip  # the strip in the frame of its first photo
    # from there to the ground: X along the strip, Y to its left, Z up, metres, the middle of the strip at 0
    similarity: Similarity
    xyz: Floats  # (q, 3): points of ``formed.point`` on the ground
    # centers, rotations: (m, 3), (m, 3, 3): photos on the ground
    centers: Floats
    rotations: Floats
    # station, row: (q,): photo at whose nadir a point lies and its row from left to right; -1 for further points
    station: Numbers
    row: Numbers
    errors: StripErrors  # derivatives of the strip by the image coordinates

    def at(self, station: int, row: int) -> int:
        """Return the point of a row, from left to right, at the nadir of a photo, both counted from 0."""
        found = np.flatnonzero((self.station == station) & (self.row == row))
        if not len(found):
            message = f"photo {station + 1} has no pass point in row {row + 1}"
            expected = f"photos 1 to {self.geometry.photos}, rows 1 to {self.geometry.points.rows}"
            raise InputError(Fault(message, "plan-place", key="points", expected=expected))
        return int(found[0])


def ideal_strip(geometry: StripGeometry) -> IdealStrip:
    """Simulate a strip without errors and form it; photos that do not overlap enough are refused."""
    if geometry.photos < LEAST_PHOTOS:
        message = f"{counted(geometry.photos, 'photo')} cannot make a strip; a single model is planned by `plan model`"
        raise InputError(Fault(message, "plan-photos", key="photos", expected=f"{LEAST_PHOTOS} or more"))
    simulation = geometry.simulated()
    observed = simulation.observations
    sigma = np.full(observed.sigma.shape, geometry.image_sigma)
    observations = replace(observed, xy=simulation.truth.image, sigma=sigma)
    photos = simulation.strips[0][1]
    pairs = collect_pairs(observations, photos, geometry.camera.principal_distance)
    orientation = orient_pairs(pairs, photos)
    formed = form_from_pairs(orientation, StripFormationSettings(), photos)
    middle = simulation.truth.centers.mean(axis=0)
    middle[2] = 0.0
    truth = simulation.truth.points.xyz - middle
    # the formed strip is carried to the ground
    xyz = truth[formed.point]
    similarity = Similarity.from_points(formed.xyz, xyz)
    centers = similarity(formed.centers)
    station, row = _columns(geometry, centers, xyz)
    return IdealStrip(
        geometry=geometry,
        photos=photos,
        observations=observations,
        orientation=orientation,
        formed=formed,
        similarity=similarity,
        xyz=xyz,
        centers=centers,
        rotations=similarity.rotation @ formed.rotations,
        station=station,
        row=row,
        errors=differentiate_strip(orientation, formed, similarity, observations.sigma),
    )


def _columns(geometry: StripGeometry, centers: Floats, xyz: Floats) -> tuple[Numbers, Numbers]:
    """Photo at whose nadir each point lies, and its row from left to right; -1 for others."""
    near = np.abs(xyz[:, None, 0] - centers[None, :, 0])
    station = near.argmin(axis=1)
    station[near.min(axis=1) > SAME * geometry.base] = -1
    row = np.full(len(xyz), -1)
    for each in range(len(centers)):
        column = np.flatnonzero(station == each)
        row[column[np.argsort(-xyz[column, 1])]] = np.arange(len(column))
    return station, row


@dataclass(frozen=True)
class Spot:
    """One control point."""

    photo: int  # photo at whose nadir it lies, counted from 1
    row: int  # row of pass points from left to right, counted from 1
    use: str = "xyz"  # ``xyz``, ``xy`` or ``z``


@dataclass(frozen=True)
class ControlLayout:
    """A layout of control to be compared with others."""

    name: str
    kind: str = "bands"
    bands: int = 3  # number of bands, spread evenly from the first to the last photo
    every: int | None = None  # models from band to band, instead of `bands`; the last photo always has a band
    per_band: int = 3  # points of a band: 1 in the middle, 2 at the edges, and so on
    use: str = "xyz"  # ``xyz``, ``xy`` or ``z`` of the points of bands and corners
    spots: tuple[Spot, ...] = ()  # points, for ``points`` instead of bands, and in addition to the others
    sigma: Triple = (0.05, 0.05, 0.08)  # standard deviations along, across and in height, metres
    # standard deviations of measured perspective centres along, across and in height, metres
    gnss: Triple | None = None
    gnss_offset: bool = True  # whether they have a constant offset, which is to be determined


def spots_of(layout: ControlLayout, photos: int, rows: int) -> tuple[Spot, ...]:
    """Control points of a layout by photo and row, none twice; a spot named one by one wins over one of a band.

    Raises InputError when a spot lies outside the strip, or a band has more points than there are rows.
    """
    last = photos - 1
    if layout.kind == "points":
        places = []
    elif layout.kind == "bands":
        places = [(photo, row) for photo in _stations(layout, last) for row in across(layout.per_band, rows)]
    else:
        places = [(photo, row) for photo in (0, last) for row in across(2, rows)]
        if layout.kind == "corners+centre":
            places += [(photos // 2, row) for row in across(1, rows)]
    chosen = {(photo, row): Spot(photo + 1, row + 1, layout.use) for photo, row in places}
    for spot in layout.spots:
        if not (1 <= spot.photo <= photos and 1 <= spot.row <= rows):
            message = f"there is no row {spot.row} at photo {spot.photo}"
            expected = f"photos 1 to {photos}, rows 1 to {rows}"
            raise InputError(Fault(message, "plan-place", key="layouts", expected=expected))
        chosen[spot.photo - 1, spot.row - 1] = spot
    return tuple(chosen[place] for place in sorted(chosen))


def _stations(layout: ControlLayout, last: int) -> list[int]:
    """Photos of the bands, from 0."""
    if layout.every is not None:
        return sorted({*range(0, last + 1, layout.every), last})
    count = layout.bands
    if not 1 <= count <= last + 1:
        message = f"{counted(count, 'band')} cannot be placed on {last + 1} photos"
        raise InputError(Fault(message, "plan-place", key="layouts", expected=f"1 to {last + 1} bands"))
    return sorted({round(place) for place in np.linspace(0, last, count).tolist()}) if count > 1 else [last // 2]


def across(count: int, rows: int) -> list[int]:
    """Rows of the points of a band, spread evenly: the middle one, both edges, and so on."""
    if not 1 <= count <= rows:
        message = f"a band of {counted(count, 'point')} does not fit into {counted(rows, 'row')} of pass points"
        raise InputError(Fault(message, "plan-place", key="layouts", expected=f"1 to {rows} points"))
    return [rows // 2] if count == 1 else sorted({round(place) for place in np.linspace(0, rows - 1, count).tolist()})


def numbers_of(strip: IdealStrip, spots: tuple[Spot, ...]) -> list[int]:
    """Return the numbers of control points among the points of a strip."""
    return [strip.at(spot.photo - 1, spot.row - 1) for spot in spots]


SIMILARITY, BUNDLE = "similarity", "bundle"
DEGREES = {"degree 1": "1", "degree 2": "2", "degree 3": "3"}
METHODS = (SIMILARITY, *DEGREES, BUNDLE)
NO_REDUNDANCY = 1e-9  # redundancy number of a control coordinate that nothing checks


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Expected precision of a strip."""

    method: str
    used: str  # what the control carries of it: ``degree 2`` where degree 3 was asked for and three bands are given
    covariance: Floats  # (q, 3, 3): of the points of the strip, along, across and up, metres^2
    control: Numbers  # (c,): points that are control
    # (c, 3): smallest error of each given coordinate that a test at 0.1 % finds in 80 % of cases, metres; infinite
    # where nothing checks it, NaN where it is not given
    detectable: Floats

    @property
    def sigmas(self) -> Floats:
        """Standard deviations along, across and up, shape (q, 3)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def plan_and_height(self) -> Floats:
        """Standard deviations in plan (both coordinates together) and in height, shape (q, 2)."""
        variance = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.sqrt(np.column_stack([variance[:, 0] + variance[:, 1], variance[:, 2]]))

    @property
    def new(self) -> Numbers:
        """Points that are not control."""
        return np.delete(np.arange(len(self.covariance)), self.control)


def control_of(strip: IdealStrip, spots: tuple[Spot, ...], sigma: Triple) -> ControlPoints:
    """Return the control points of a layout along X, Y, Z of the strip, in the order of the spots."""
    numbers = numbers_of(strip, spots)
    ids = tuple(f"{spot.photo}/{spot.row}" for spot in spots)
    use = np.array([USES[spot.use] for spot in spots], bool).reshape(-1, 3)
    given = np.broadcast_to(np.array(sigma, float), use.shape)
    return ControlPoints(
        ids=ids, enu=np.where(use, strip.xyz[numbers], np.nan), use=use, check=np.zeros(len(ids), bool), sigma=given
    )


def accuracy(strip: IdealStrip, layout: ControlLayout, spots: tuple[Spot, ...], method: str) -> Accuracy:
    """Compute the expected precision of a strip with one layout of control, by one method.

    The layout gives the precision of the control and of measured perspective centres, which only the bundle uses.

    Raises GeometryError when the control does not determine the strip.
    """
    control = control_of(strip, spots, layout.sigma)
    if method == BUNDLE:
        return _bundle(strip, layout, spots, control)
    plan, height = int(control.use[:, 0].sum()), int(control.use[:, 2].sum())
    if plan < 2 or height < 3:
        message = f"{counted(plan, 'control point')} in plan and {height} in height cannot orient a strip"
        raise GeometryError(message, code="plan-control")
    return _fitted(strip, np.array(numbers_of(strip, spots), np.intp), control, method)


def _fitted(strip: IdealStrip, numbers: Numbers, control: ControlPoints, method: str) -> Accuracy:
    """Similarity, and polynomials of a fixed degree as far as the control carries them, as a run would fit them.

    The absolute orientation refuses control that leaves the strip a motion.
    """
    frames, _ = tie_frames([FrameSpec("local", ("east", "north", "up"))])
    intermediate = IntermediateFrame.at_local_centre(strip.xyz[numbers[control.use[:, 0]]], np.pi / 2)
    targets = absolute_orientation.Targets(control, frames, intermediate)
    weight = absolute_orientation.weights(control, _precision(strip))
    absolute_orientation.lay(strip.formed.xyz[numbers], targets, weight, strip.formed.xyz)
    xyz = intermediate.intermediate_from_cartesian(strip.xyz)
    terms: list[tuple[str, ...]] = [(), (), ()]
    if method in DEGREES:
        breadth = max(np.quantile(np.abs(xyz[:, 1]), 0.95), 1e-6)
        problem = polynomial.FitProblem(
            xyz=xyz[numbers], targets=targets, weight=weight, spacing=strip.geometry.base, breadth=breadth
        )
        terms = [axis.terms for axis in polynomial.fit(problem, polynomial.PolynomialSettings(DEGREES[method])).axes]
    found = fitted_strip.misclosures(control, numbers, targets.axes(xyz[numbers]))
    shift = intermediate.intermediate_from_cartesian(strip.errors.origin[None])[0]
    fit = fitted_strip.fit_operator(found, weight, xyz[numbers], terms, shift)
    fitted = FittedStrip(errors=strip.errors, control=found, fit=fit, xyz=xyz, factor=1.0)
    covariance = fitted.covariances_of_points(np.arange(len(xyz)))
    share = np.einsum("wi,wit,tw->w", found.direction, fit.influence(xyz[found.row]), fit.operator)
    variance = np.diagonal(covariance, axis1=1, axis2=2)[numbers[found.point], found.axis]
    residual = variance + found.variance * (1 - 2 * share)
    detectable = np.full((len(numbers), 3), np.nan)
    free = 1 - share
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(free > NO_REDUNDANCY, DETECTABLE * np.sqrt(np.maximum(residual, 0.0)) / free, np.inf)
    detectable[found.point, found.axis] = size
    return Accuracy(
        method=method,
        used=_used(terms) if method in DEGREES else method,
        covariance=covariance,
        control=numbers,
        detectable=detectable,
    )


def _used(terms: list[tuple[str, ...]]) -> str:
    """Say which degree the control carries; plan and height apart where they differ."""
    powers = [polynomial.degree_of(each) for each in (terms[0], terms[2])]
    names = ["similarity" if power == 0 else f"degree {power}" for power in powers]
    return names[0] if names[0] == names[1] else f"{names[0]} in plan, {names[1]} in height"


def _precision(strip: IdealStrip) -> absolute_orientation.PointPrecision:
    """A-priori standard deviation of a point of one model in plan and height, metres, as a run takes it."""
    geometry = strip.geometry
    plan = geometry.image_sigma * geometry.scale / 1000.0
    depth = float(strip.centers[:, 2].mean())
    height = plan * float(np.sqrt(2.0)) * depth / geometry.base
    return absolute_orientation.PointPrecision(plan, height)


def _bundle(strip: IdealStrip, layout: ControlLayout, spots: tuple[Spot, ...], control: ControlPoints) -> Accuracy:
    """All rays with control and perspective centres in one solution."""
    numbers = np.array(numbers_of(strip, spots), np.intp)
    problem = bundle_problem(strip, layout, numbers, control)
    found = bundle_precision(solve(problem))
    given = np.where(control.use, control.sigma, np.nan)
    redundant = np.diagonal(found.control_residuals, axis1=1, axis2=2) / given**2
    with np.errstate(divide="ignore", invalid="ignore"):
        detectable = np.where(redundant > NO_REDUNDANCY, DETECTABLE * given / np.sqrt(redundant), np.inf)
    return Accuracy(
        method=BUNDLE,
        used=BUNDLE,
        covariance=found.points,
        control=numbers,
        detectable=np.where(control.use, detectable, np.nan),
    )


def bundle_problem(
    strip: IdealStrip, layout: ControlLayout, numbers: Numbers, control: ControlPoints
) -> bundle.BundleProblem:
    """Return the strip and its control (point `numbers`) as a bundle adjustment that starts at the truth."""
    observed = strip.observations
    point = np.full(len(observed.point_ids), -1)
    point[strip.formed.point] = np.arange(len(strip.formed.point))
    rows = np.flatnonzero(point[observed.point] >= 0)
    place = {name: number for number, name in enumerate(strip.photos)}
    photo = np.array([place[name] for name in observed.photo_ids], np.intp)[observed.photo[rows]]
    axes = np.broadcast_to(np.eye(3), (len(numbers), 3, 3))
    count = len(strip.centers)
    return bundle.BundleProblem(
        images=bundle.ImageObservations(
            photo=photo, point=point[observed.point[rows]], xy=observed.xy[rows], sigma=observed.sigma[rows]
        ),
        cameras=bundle.BundleCameras(np.zeros(count, np.intp), np.array([strip.geometry.camera.principal_distance])),
        start=bundle.StartValues(strip.centers, strip.rotations, strip.xyz),
        control=bundle.ControlObservations(
            point=numbers, xyz=strip.xyz[numbers], axes=axes, sigma=np.where(control.use, control.sigma, np.inf)
        ),
        positions=_positions(strip, layout),
    )


def _positions(strip: IdealStrip, layout: ControlLayout) -> bundle.PositionObservations:
    """Return all perspective centres, with a constant offset that is free or absent; none where none are measured."""
    if layout.gnss is None:
        return bundle.PositionObservations()
    count = len(strip.centers)
    return bundle.PositionObservations(
        photo=np.arange(count),
        xyz=strip.centers,
        axes=np.broadcast_to(np.eye(3), (count, 3, 3)),
        sigma=np.broadcast_to(np.array(layout.gnss, float), (count, 3)),
        lever=np.zeros((count, 3)),
        group=np.zeros(count, np.intp),
        time=np.linspace(-1.0, 1.0, count),
        offset_sigma=np.full((1, 3), np.inf if layout.gnss_offset else 0.0),
        drift_sigma=np.zeros((1, 3)),
    )
