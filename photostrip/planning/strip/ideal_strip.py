"""The strip that a flight is meant to give, and where control is to be placed along it.

Level photos at equal distances, pass points where they belong, no errors: it is simulated and taken through the
operations of the strip method, so that what is planned is what will be computed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import Fault, InputError
from photostrip.geometry.similarity import Similarity
from photostrip.notes import counted
from photostrip.points import PhotoPoints
from photostrip.simulation import Control, Flight, Ground, Image, Points, Simulation, Spec, Terrain, simulate
from photostrip.strip.error_propagation.strip_errors import StripErrors, differentiate_strip
from photostrip.strip.relative_orientation.orientation import Orientation, orient_pairs
from photostrip.strip.relative_orientation.pairs import collect_pairs
from photostrip.strip.strip_formation.scale_transfer import StripFormationSettings
from photostrip.strip.strip_formation.strip import FormedStrip, form_from_pairs

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
