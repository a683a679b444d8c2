"""The strips and blocks in which mistakes are planted, the table of mistakes, and which of them can be told.

Short simulated strips of all kinds (film and digital cameras, 4 to 8 photos, end laps of 58 to 80 %, any azimuth and
turn of the photos, flat and hilly ground, projected, geographic, geocentric and local frames, few and many control
points in several layouts, measured well and badly), blocks and strips of independent models.

**Can be told.** A run with a mistake counts where the data say that something is wrong, whatever the program's search
makes of it. Sound project and planted one are adjusted with the search for gross errors off and nothing calibrated
(``processing.bundle.screening: none``), with the same noise and without the wrong images that were simulated beside it;
the weighted sum of squares of the residuals grows by more than the quantile of chi-square with as many degrees of
freedom as the mistake has columns (``Mistake.columns``) at the probability 1 - 1e-3. Where the planted project has no
network at all (refused, or not converging), it can be told. A growth says nothing of mistakes that change what is
observed, how it is weighted, in which order it is listed, or how control is laid out: these have no columns and count
always, under the condition that their functions state.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.errors import InputError, PhotostripError
from photostrip.geometry.rotation import angles, from_angles
from photostrip.pipeline.inputs import AUTO, CameraPositions, GivenOrientations
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import (
    DIGITAL,
    FILM,
    Control,
    Film,
    Flight,
    Gnss,
    GrossError,
    Ground,
    Image,
    Models,
    Points,
    Spec,
    Terrain,
    simulate,
)
from photostrip.statistics import chi2_quantile
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.points import PhotoPoints
    from photostrip.simulation import Simulation

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

TOLD_LEVEL = 1e-3  # probability that noise alone lets the sum of squares grow by as much
FOOT, US_FOOT = 0.3048, 1200 / 3937
GROSS_SHARE = 0.2  # of the strips have two gross errors of image coordinates, which are none of the mistakes
THIRD, HALF, LINE = 0.3, 0.55, 0.03  # of the length of the strip; of its half breadth
EVEN, LEAST_FULL = 0.5, 8
SHIFT = 5.0  # mm
HARMLESS = np.radians(0.3)  # rms of given angles: start values need not be better
BEYOND = 1 / 3  # of what the control spans, beyond which a sound strip does not reach at either end
TOLD_APART = 5.0  # standard deviations of an image coordinate
POSITION_SIGMA, ATTITUDE_SIGMA = 0.1, np.radians(0.02)  # metres, radians
OPK = "omega-phi-kappa"
PLAIN = 20.0  # times the noise, by which a slip stands out beside exchanged points
ATTEMPTS = 20
WIDE = replace(FILM, name="wide", principal_distance=88.0)
LONG = replace(FILM, name="long", principal_distance=305.0)
CAMERAS = (FILM, FILM, DIGITAL, WIDE, LONG)
GROUNDS = (
    Ground("EPSG:32633"),
    Ground("EPSG:32633", ("north", "east", "up")),
    Ground("EPSG:32719", center_deg=(-68.0, -33.0)),
    Ground("EPSG:25832", center_deg=(9.4, 47.5), height="orthometric", geoid_undulation=48.0),
    Ground("EPSG:4326"),
    Ground("geocentric", ("x", "y", "z")),
    Ground("local"),
    Ground("local"),
)


@dataclass(frozen=True, eq=False)
class Case:
    """A simulated project as it would be given."""

    simulation: Simulation
    inputs: Inputs
    settings: Settings
    rng: np.random.Generator

    @property
    def photos(self) -> tuple[str, ...]:
        return self.inputs.strips[0].photos

    @property
    def spec(self) -> Spec:
        return self.simulation.spec

    @property
    def kind(self) -> str:
        return {"EPSG:4326": "geographic"}.get(self.spec.ground.crs, self.spec.ground.crs.partition(":")[0])

    @property
    def metre(self) -> Floats:
        """Size of a metre in the units of its frame, roughly."""
        return np.array([1e-5, 1e-5, 1.0] if self.kind == "geographic" else [1.0, 1.0, 1.0])

    @property
    def noise(self) -> tuple[float, float]:
        """Standard deviation of a point of one model in plan and height with that of the control, metres."""
        if self.spec.models is not None:
            plan, height = (self.spec.models.sigma_um[axis] * 1e-6 * self.spec.scale for axis in (0, 2))
        else:
            plan = self.spec.image.sigma_um * 1e-6 * self.spec.scale
            height = plan * np.sqrt(2.0) * self.spec.flying_height / self.spec.base
        return float(np.hypot(plan, self.spec.control.sigma[0])), float(np.hypot(height, self.spec.control.sigma[2]))

    def full(self, *, check: bool = False) -> NDArray[np.intp]:
        """Rows of the control points (or check points) that are given in full and measured."""
        control, models = self.inputs.control, self.inputs.models
        measured = self.inputs.observations.point_ids if models is None else models.points.point_ids
        return np.flatnonzero(np.isin(control.ids, measured) & control.use.all(axis=1) & (control.check == check))

    def shows(self, photo: str) -> Flags:
        o = self.inputs.observations
        return np.asarray(o.photo == o.photo_ids.index(photo))


Make = Callable[[int], Case]
Planted = tuple["Inputs", frozenset[str]]  # the inputs and the ids that must be named; empty when none need be
Plant = Callable[[Case], Planted | None]  # None where the case has no room for the mistake
NOBODY: frozenset[str] = frozenset()

# ----------------------------------------------------------------------------------------------- strips and blocks


def layout(
    stream: int | tuple[int, ...],
    draw: Callable[[np.random.Generator], Spec],
    *,
    methods: tuple[str, ...] = (AUTO,),
    given: Callable[[np.random.Generator, Simulation], Inputs] = lambda _, simulation: inputs_of(simulation),
    fits: Callable[[Case], bool] = lambda _: True,
) -> Make:
    """Simulate what is drawn and make a project of it; drawn again where so few points do not suffice.

    stream: numbers of the stream of random numbers, beside the seed.
    given: what is given of a simulation.
    fits: whether a project will do.
    """

    def make(seed: int) -> Case:
        rng = np.random.default_rng([*np.atleast_1d(stream).tolist(), seed])
        for attempt in range(ATTEMPTS):
            try:
                simulation = simulate(replace(draw(rng), seed=seed * ATTEMPTS + attempt))
                inputs = given(rng, simulation)
            except InputError:
                continue
            settings = replace(settings_of(simulation), adjustment=str(rng.choice(methods)))
            case = Case(simulation, inputs, settings, rng)
            if fits(case):
                return case
        raise SystemExit(f"nothing can be made of seed {seed}")

    return make


def drawn(rng: np.random.Generator) -> Spec:
    camera = CAMERAS[rng.integers(len(CAMERAS))]
    scale = float(np.exp(rng.uniform(np.log(3000), np.log(40000))))
    height = scale * camera.principal_distance / 1000.0
    relief = float(rng.choice([0.0, 0.02, 0.05, 0.1])) * height
    tilt = float(rng.choice([0.3, 1.0, 2.5]))
    sigma = float(rng.choice([2.0, 5.0, 12.0]))
    ground_sigma = float(rng.choice([0.5, 1.0, 3.0])) * sigma * 1e-6 * scale
    rows = int(rng.choice([3, 3, 5]))
    shares: tuple[dict[str, float], ...] = ({"xyz": 1.0}, {"xyz": 1.0}, {"xyz": 0.7, "xy": 0.1, "z": 0.2})
    ground = GROUNDS[rng.integers(len(GROUNDS))]
    use = shares[rng.integers(3)] if ground.crs != "geocentric" else shares[0]
    kind = str(rng.choice(["bands", "bands", "bands", "corners", "corners+centre", "random"]))
    return Spec(
        camera=camera,
        ground=ground,
        flight=Flight(
            photos=int(rng.integers(4, 9)),
            end_lap_percent=float(rng.uniform(58, 80)),
            scale=scale,
            heading_deg=float(rng.uniform(0, 360)),
            photo_rotation_deg=float(rng.choice([0.0, 0.0, 0.0, 180.0, 90.0])),
            attitude_sigma_deg=(tilt, tilt, tilt),
        ),
        terrain=Terrain(relief=relief, slope_percent=(float(rng.uniform(-5, 5)), float(rng.uniform(-5, 5)))),
        points=Points(rows=rows, extra_per_model=int(rng.integers(3, 15))),
        control=Control(
            layout="bands" if len(use) > 1 else kind,
            bands=int(rng.integers(3 if len(use) > 1 else 2, 4)),
            per_band=3,
            count=int(rng.integers(8, 14)),
            use=use,
            sigma=(ground_sigma, ground_sigma, 1.5 * ground_sigma),
        ),
        image=Image(sigma_um=sigma),
        gross_errors=(GrossError("image", count=2),) if rng.random() < GROSS_SHARE else (),
    )


def in_block(rng: np.random.Generator) -> Spec:
    """Draw two or three strips over hills; InputError for a frame without heights."""
    spec = drawn(rng)
    if spec.ground.crs == "geocentric":
        raise InputError("heights are wanted")
    flight = replace(spec.flight, strips=int(rng.integers(2, 4)), side_lap_percent=float(rng.uniform(25, 40)))
    control = replace(spec.control, layout="bands", bands=3, use={"xyz": 1.0})
    hills = replace(spec.terrain, relief=max(spec.terrain.relief, 0.05 * spec.flying_height))
    points = replace(spec.points, rows=5)
    return replace(spec, flight=flight, control=control, terrain=hills, points=points, gross_errors=())


def in_models(rng: np.random.Generator) -> Spec:
    """Draw 6 to 40 independent models."""
    spec = drawn(rng)
    flight = replace(spec.flight, photos=int(rng.integers(7, 42)))
    control = replace(spec.control, layout="bands", every=int(rng.integers(3, 16)), use={"xyz": 1.0})
    return replace(spec, flight=flight, control=control, models=Models(), gross_errors=())


def at_the_edge_of_a_zone(rng: np.random.Generator) -> Spec:
    """Draw a strip where grid north is three to five degrees away from true north."""
    center = (15.0 + float(either(rng, 3.5, 5.5)), float(rng.uniform(58.0, 66.0)))
    return replace(drawn(rng), ground=Ground("EPSG:32633", center_deg=center), gross_errors=())


def with_gnss(_: np.random.Generator, simulation: Simulation) -> Inputs:
    """Give the inputs with the measured positions of the cameras, where there are any."""
    inputs, enu = inputs_of(simulation), simulation.gnss
    if enu is None or simulation.spec.gnss is None:
        return inputs
    n = len(enu)
    use, sigma, time = np.ones((n, 3), bool), np.tile(simulation.spec.gnss.sigma, (n, 1)), np.full(n, np.nan)
    positions = CameraPositions(simulation.truth.photo_ids, inputs.frames[0], enu, use, sigma, time)
    return replace(inputs, positions=positions)


def oriented(
    simulation: Simulation, enu: Floats, values: Floats, system: str = OPK, sigma: tuple[float, float] | None = None
) -> Inputs:
    """Give the inputs with orientations: a start, or observations of standard deviations in metres and radians."""
    inputs, photos = inputs_of(simulation), simulation.truth.photo_ids
    plan, turn = (np.full((len(enu), 3), each) for each in sigma or (np.nan, np.nan))
    frame, observed = inputs.output or inputs.frames[0], sigma is not None
    given = GivenOrientations(photos, frame, enu, values, system, plan, turn, observed)
    return replace(inputs, orientations=given)


def with_attitudes(rng: np.random.Generator, simulation: Simulation) -> Inputs:
    """Give measured orientations, whose angles refer to the grid."""
    truth, n = simulation.truth, len(simulation.truth.photo_ids)
    enu = truth.centers_ground + rng.normal(0.0, POSITION_SIGMA, (n, 3))
    values = angles(truth.rotations_local, OPK) + rng.normal(0.0, ATTITUDE_SIGMA, (n, 3))
    return oriented(simulation, enu, values, sigma=(POSITION_SIGMA, ATTITUDE_SIGMA))


def is_sound(case: Case) -> bool:
    """Whether nothing must be told of the layout of its control and points."""
    return holds_both_ends(case) and apart(case)


def holds_both_ends(case: Case) -> bool:
    """Whether neither end lies farther beyond the control than a third of what it spans: to leave one out is a mistake.

    Farther than half of it must be told; between a third and a half nothing is demanded.
    """
    control = case.inputs.control
    counts = control.use[:, 0] & ~control.check & np.isin(control.ids, case.inputs.observations.point_ids)
    along = np.clip(places(case)[0][counts], 0.0, 1.0)
    low, high = float(along.min(initial=1.0)), float(along.max(initial=0.0))
    return max(low, 1.0 - high) <= BEYOND * (high - low)


def apart(case: Case) -> bool:
    """Whether all points lie so far from each other that measurements tell them apart: none is one under two ids."""
    o, near = case.inputs.observations, TOLD_APART * case.spec.image.sigma_um / 1000.0
    for photo in range(len(o.photo_ids)):
        xy = o.xy[o.photo == photo]
        d = np.abs(xy[:, None, :] - xy[None, :, :]).max(axis=2)
        if (d[np.triu_indices(len(xy), 1)] < near).any():
            return False
    return True


def places(case: Case) -> tuple[Floats, Floats]:
    """Where given points lie, along the strip (0 at its first photo, 1 at its last) and across it (in bases)."""
    truth = case.simulation.truth
    index = {name: row for row, name in enumerate(truth.points.ids)}
    order = [truth.photo_ids.index(name) for name in case.photos]
    first, last = truth.centers[order[0]], truth.centers[order[-1]]
    length = float(np.linalg.norm(last - first))
    axis = (last - first) / length
    side = np.cross(truth.rotations[:, :, 2].mean(axis=0), axis)
    xyz = truth.points.xyz[[index[name] for name in case.inputs.control.ids]] - first
    return xyz @ axis / length, xyz @ side / case.spec.base


def with_ties(strips: int, gross: Callable[[np.random.Generator], tuple[GrossError, ...]] = lambda _: ()) -> Make:
    """Make blocks of so many strips with many points."""
    flight, points, control = Flight(photos=6, strips=strips), Points(extra_per_model=20), Control(bands=3)
    return layout(24, lambda rng: Spec(flight=flight, points=points, control=control, gross_errors=gross(rng)))


sound = layout(7, drawn, fits=is_sound)
block = layout(9, in_block)
of_models = layout(10, in_models)
with_positions = layout(7, lambda rng: replace(drawn(rng), gnss=Gnss(use=True)), given=with_gnss, fits=is_sound)
at_the_edge = layout(11, at_the_edge_of_a_zone, given=with_attitudes)

# --------------------------------------------------------------------------------- mistakes in images and cameras


def with_images(case: Case, **columns: object) -> Inputs:
    return replace(case.inputs, observations=replace(case.inputs.observations, **columns))  # type: ignore[arg-type]


def of_all_images(change: Callable[[Case, Floats], Floats]) -> Plant:
    """Change the image coordinates (n, 2) of all photos."""
    return lambda case: (with_images(case, xy=change(case, case.inputs.observations.xy)), NOBODY)


def of_one_photo(change: Callable[[Case, Floats], Floats], *, inside: bool = False) -> Plant:
    """Change the image coordinates (n, 2) of one photo, which may be none at the end of the strip."""

    def plant(case: Case) -> Planted:
        photos = case.photos[1:-1] if inside else [photo for strip in case.inputs.strips for photo in strip.photos]
        photo, xy = str(case.rng.choice(photos)), case.inputs.observations.xy.copy()
        xy[case.shows(photo)] = change(case, xy[case.shows(photo)])
        return with_images(case, xy=xy), frozenset({photo})

    return plant


def factor(*factors: float) -> Callable[[Case, Floats], Floats]:
    """Multiply coordinates by one of some factors."""
    return lambda case, xy: xy * float(case.rng.choice(factors))


def either(rng: np.random.Generator, low: float, high: float, size: int | tuple[int, int] | None = None) -> Floats:
    """Draw numbers from low to high of either sign."""
    return rng.choice([-1.0, 1.0], size) * rng.uniform(low, high, size)


def shifted(case: Case, xy: Floats) -> Floats:
    """Shift by 5 mm, whatever that does."""
    way = case.rng.normal(size=2)
    return xy + SHIFT * way / np.linalg.norm(way)


def bent(case: Case, xy: Floats) -> Floats:
    """Bend the images by 5 to 20 µm at three quarters of half the diagonal: k1 that nobody states."""
    radius = 0.75 * float(np.hypot(*xy.T).max())
    k1 = either(case.rng, 0.005, 0.02) / radius**3
    return xy * (1.0 + k1 * (xy**2).sum(axis=1)[:, None])


def bent_at_the_edge(case: Case, xy: Floats) -> Floats:
    """Bend the images by k1 of 30 to 100 µm at the edge, and by a k2 that takes most of it back there."""
    radius = 0.75 * float(np.hypot(*xy.T).max())
    k1, turned = either(case.rng, 0.03, 0.1) / radius**3, float(case.rng.uniform(0.5, 1.0))
    r2 = (xy**2).sum(axis=1)[:, None]
    return xy * (1.0 + k1 * r2 - turned * k1 * r2**2 / radius**2)


def decentred(case: Case, xy: Floats) -> Floats:
    """Decentre the lens: p1 and p2 of 10 to 40 µm at three quarters of half the diagonal."""
    radius = 0.75 * float(np.hypot(*xy.T).max())
    p = either(case.rng, 0.01, 0.04, 2) / radius**2
    return xy + p * (xy**2).sum(axis=1)[:, None] + 2.0 * xy * (xy @ p)[:, None]


def shrunk(low: float, high: float, axes: int = 2) -> Plant:
    """Let the film shrink or grow along one of the first image axes, by a share between two."""

    def change(case: Case, xy: Floats) -> Floats:
        along = np.eye(2)[case.rng.integers(axes)]
        return xy * (1.0 + along * either(case.rng, low, high))

    return of_all_images(change)


def marks_in_micrometres(case: Case) -> Planted | None:
    """Give fiducial marks, and with them all image coordinates, a thousand times too large or too small."""
    inputs = inputs_of(simulate(replace(case.spec, film=Film()))) if case.spec.camera.fiducials else None
    if inputs is None or inputs.fiducials is None:
        return None
    times = float(case.rng.choice([1000.0, 0.001, 25.4]))
    o, marks = inputs.observations, inputs.fiducials
    changed = (replace(o, xy=o.xy * times), replace(marks, xy=marks.xy * times))
    return replace(inputs, observations=changed[0], fiducials=changed[1]), NOBODY


def with_cameras(inputs: Inputs, **fields: object) -> Inputs:
    strips = [replace(each, camera=replace(each.camera, **fields)) for each in inputs.strips]  # type: ignore[arg-type]
    return replace(inputs, strips=tuple(strips))


def distance_times(change: Callable[[np.random.Generator], float]) -> Plant:
    """Give a principal distance that is off by a factor."""
    return lambda case: (
        with_cameras(case.inputs, principal_distance=case.spec.camera.principal_distance * change(case.rng)),
        NOBODY,
    )


def without_format(plant: Plant) -> Plant:
    """Leave out the format of the camera, where it has no marks, which would say as much."""

    def planted(case: Case) -> Planted | None:
        inputs, names = plant(case) or (case.inputs, NOBODY)
        return replace(with_cameras(inputs, format=None), fiducials=None), names

    return planted


def distance_of_one_strip(case: Case) -> Planted:
    """Give one strip of a block a camera of its own with a principal distance that is off by ten percent."""
    off = int(case.rng.integers(len(case.inputs.strips)))
    times = float(case.rng.choice([0.9, 1.1]))
    strips = list(case.inputs.strips)
    camera = strips[off].camera
    other = replace(camera, name="other", principal_distance=camera.principal_distance * times)
    strips[off] = replace(strips[off], camera=other)
    return replace(case.inputs, strips=tuple(strips)), frozenset({strips[off].id})


# ------------------------------------------------------------------------------------ mistakes in photos and ids


def with_photos(case: Case, photos: list[str]) -> Inputs:
    return replace(case.inputs, strips=(replace(case.inputs.strips[0], photos=tuple(photos)),))


def pair_exchanged(case: Case) -> Planted:
    photos = list(case.photos)
    place = int(case.rng.integers(len(photos) - 1))
    photos[place], photos[place + 1] = photos[place + 1], photos[place]
    return with_photos(case, photos), frozenset(photos[place : place + 2])


def moved(case: Case) -> Planted | None:
    photos = list(case.photos)
    photo = photos.pop(int(case.rng.integers(len(photos))))
    elsewhere = [k for k in range(len(photos) + 1) if abs(k - case.photos.index(photo)) > 1]
    if not elsewhere:
        return None
    photos.insert(int(case.rng.choice(elsewhere)), photo)
    return with_photos(case, photos), frozenset({photo})


def shuffled(case: Case) -> Planted:
    photos = list(case.photos)
    while photos in (list(case.photos), list(case.photos)[::-1]):
        case.rng.shuffle(photos)
    return with_photos(case, photos), NOBODY


def with_points(case: Case, photos: Iterable[str], order: Callable[[int], NDArray[np.int_]]) -> Inputs:
    """Give the inputs with the ids of some photos in another order."""
    point = case.inputs.observations.point.copy()
    for photo in photos:
        rows = np.flatnonzero(case.shows(photo))
        point[rows] = point[rows[order(len(rows))]]
    return with_images(case, point=point)


def ids_in_the_next_row(case: Case) -> Planted:
    photo = str(case.rng.choice(case.photos))
    return with_points(case, [photo], lambda rows: np.roll(np.arange(rows), 1)), frozenset({photo})


def no_overlap(case: Case) -> Planted:
    """Give the points of all photos from one on other names, as those of another flight."""
    o = case.inputs.observations
    place = int(case.rng.integers(1, len(case.photos)))
    later = np.isin(o.photo, [o.photo_ids.index(name) for name in case.photos[place:]])
    names = (*o.point_ids, *(f"{name}x" for name in o.point_ids))
    changed = replace(o, point_ids=names, point=np.where(later, o.point + len(o.point_ids), o.point))
    return replace(case.inputs, observations=changed), frozenset(case.photos[place - 1 : place + 1])


def measured_again(case: Case, rows: NDArray[np.intp], *, photo: str = "", point: str = "") -> PhotoPoints:
    """Give the image points with some of them a second time, under the name of another photo or point."""
    o = case.inputs.observations
    noise = case.rng.normal(0.0, case.spec.image.sigma_um / 1000.0, (len(rows), 2))
    return replace(
        o,
        photo_ids=(*o.photo_ids, photo) if photo else o.photo_ids,
        point_ids=(*o.point_ids, point) if point else o.point_ids,
        photo=np.r_[o.photo, np.full(len(rows), len(o.photo_ids)) if photo else o.photo[rows]],
        point=np.r_[o.point, np.full(len(rows), len(o.point_ids)) if point else o.point[rows]],
        xy=np.r_[o.xy, o.xy[rows] + noise],
        sigma=np.r_[o.sigma, o.sigma[rows]],
    )


def twice(case: Case) -> Planted:
    place = int(case.rng.integers(len(case.photos)))
    copied = measured_again(case, np.flatnonzero(case.shows(case.photos[place])), photo="copy")
    photos = [*case.photos[: place + 1], "copy", *case.photos[place + 1 :]]
    return replace(with_photos(case, photos), observations=copied), frozenset({case.photos[place], "copy"})


def two_ids(case: Case) -> Planted:
    o = case.inputs.observations
    place = int(case.rng.integers(len(case.photos) - 1))
    both = set(o.point[case.shows(case.photos[place])]) & set(o.point[case.shows(case.photos[place + 1])])
    number = int(case.rng.choice(sorted(both)))
    copied = measured_again(case, np.flatnonzero(o.point == number), point="again")
    return replace(case.inputs, observations=copied), frozenset({o.point_ids[number], "again"})


def photo_missing(case: Case) -> Planted | None:
    """Take one photo out of the list, where its neighbours overlap."""
    if case.spec.flight.end_lap_percent < 72 or len(case.photos) < 6:
        return None
    place = int(case.rng.integers(2, len(case.photos) - 2))
    photos = [*case.photos[:place], *case.photos[place + 1 :]]
    o = case.inputs.observations
    seen = [set(o.point[case.shows(name)].tolist()) for name in photos]
    if min(len(a & b) for a, b in pairwise(seen)) < 7:
        return None
    if min(len(a & b & c) for a, b, c in zip(seen, seen[1:], seen[2:], strict=False)) < 2:
        return None
    kept = images(o, ~case.shows(case.photos[place]))
    names, number = np.unique(kept.photo, return_inverse=True)
    kept = replace(kept, photo_ids=tuple(o.photo_ids[n] for n in names), photo=number)
    inputs = replace(with_photos(case, photos), observations=kept)
    return inputs, frozenset({case.photos[place - 1], case.photos[place + 1]})


def images(o: PhotoPoints, keep: Flags, point: NDArray[np.intp] | None = None) -> PhotoPoints:
    """Keep some image points, of other points where these are given."""
    point = o.point if point is None else point
    return replace(o, photo=o.photo[keep], point=point[keep], xy=o.xy[keep], sigma=o.sigma[keep])


def one_id(case: Case, one: int, other: int, keep: Flags | None = None) -> Planted:
    """Give a point the id of another; some image points are kept, as a rule all."""
    o = case.inputs.observations
    keep = np.ones(len(o.point), bool) if keep is None else keep
    observations = images(o, keep, np.where(o.point == other, one, o.point))
    return replace(case.inputs, observations=observations), frozenset({o.point_ids[one]})


def unknown_points(case: Case) -> Flags:
    return ~np.isin(case.inputs.observations.point_ids, case.inputs.control.ids)


def same_id(case: Case) -> Planted | None:
    """Give a point of the last photos the id of one of the first photos."""
    o = case.inputs.observations
    if len(case.photos) < 5:
        return None
    seen = [set(o.point[case.shows(name)].tolist()) for name in case.photos]
    free = {n for n in np.flatnonzero(unknown_points(case)).tolist() if sum(n in each for each in seen) == 2}
    first, last = sorted(seen[0] & seen[1] & free), sorted(seen[-1] & seen[-2] & free)
    if not first or not last or set(first) & set(last):
        return None
    return one_id(case, int(case.rng.choice(first)), int(case.rng.choice(last)))


def rays_by_strip(case: Case) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Count the rays (s, p) that each strip has of each point; in which strip each image point is."""
    o = case.inputs.observations
    strip_of = {photo: number for number, strip in enumerate(case.inputs.strips) for photo in strip.photos}
    owner = np.array([strip_of[photo] for photo in o.photo_ids])[o.photo]
    counts = [np.bincount(o.point[owner == k], minlength=len(o.point_ids)) for k in range(len(case.inputs.strips))]
    return np.array(counts), owner


def same_id_in_two_strips(case: Case) -> Planted | None:
    """Give a point of one strip the id of a point of another, a quarter of a base away at least."""
    o, truth = case.inputs.observations, case.simulation.truth
    rays, _ = rays_by_strip(case)
    ones, others = (np.flatnonzero(unknown_points(case) & (rays[k] > 1) & (rays[1 - k] == 0)) for k in (0, 1))
    if not len(ones) or not len(others):
        return None
    one, other = int(case.rng.choice(ones)), int(case.rng.choice(others))
    at = [truth.points.xyz[truth.points.ids.index(o.point_ids[each])] for each in (one, other)]
    return None if np.linalg.norm(at[0] - at[1]) < case.spec.base / 4 else one_id(case, one, other)


def same_id_nearby(case: Case) -> Planted:
    """Take two ties of two strips, 0.2 to 1 % of the flying height apart, for one: each strip shows one of them."""
    o, truth, wanted = case.inputs.observations, case.simulation.truth, case.rng.uniform(0.002, 0.01)
    rays, owner = rays_by_strip(case)
    ties = np.flatnonzero((rays > 1).all(axis=0) & unknown_points(case))
    at = np.array([truth.points.xyz[truth.points.ids.index(o.point_ids[each])] for each in ties])
    apart = np.linalg.norm(at[:, None] - at, axis=2) + np.diag(np.full(len(ties), np.inf))
    pair = np.unravel_index(int(np.abs(apart - wanted * case.spec.flying_height).argmin()), apart.shape)
    one, other = ties[list(pair)].tolist()
    return one_id(case, one, other, ~((o.point == one) & (owner == 1)) & ~((o.point == other) & (owner == 0)))


def same_id_far_away(case: Case) -> Planted:
    """Give a point of the third strip the id of one of the first, which it does not overlap."""
    (rays, _), free = rays_by_strip(case), unknown_points(case)
    ones = np.flatnonzero(free & (rays[0] > 1) & (rays[2] == 0))
    others = np.flatnonzero(free & (rays[2] > 1) & (rays[:2] == 0).all(axis=0))
    return one_id(case, int(case.rng.choice(ones)), int(case.rng.choice(others)))


# ------------------------------------------------------------------------------------------ mistakes in the control


def with_control(case: Case, **columns: object) -> Inputs:
    return replace(case.inputs, control=replace(case.inputs.control, **columns))  # type: ignore[arg-type]


def of_all_given(change: Callable[[Case, Floats], Floats], kinds: str = "EPSG local geographic") -> Plant:
    """Change all given coordinates (n, 3), in frames of some kinds."""

    def plant(case: Case) -> Planted | None:
        if case.kind not in kinds.split():
            return None
        return with_control(case, enu=change(case, case.inputs.control.enu)), NOBODY

    return plant


def enough(case: Case) -> bool:
    """Whether the control has eight points in full, so that one of them can be told to be wrong."""
    control = case.inputs.control
    return int((control.use.all(axis=1) & ~control.check).sum()) >= LEAST_FULL


def axes_exchanged(case: Case) -> Planted | None:
    control, order = case.inputs.control, [1, 0, 2]
    if case.kind == "geocentric":
        return None
    return with_control(case, enu=control.enu[:, order], use=control.use[:, order]), NOBODY


def another_crs(case: Case) -> Planted | None:
    """Name a coordinate reference system of another country, where such coordinates lie nowhere."""
    crs = str(case.rng.choice(["EPSG:31468", "EPSG:27700", "EPSG:21781"]))
    frames = (replace(case.inputs.frames[0], crs=crs),)
    return (replace(case.inputs, frames=frames), NOBODY) if case.kind == "EPSG" else None


def in_two_lists(change: Callable[[Case, Floats], Floats], kinds: str = "EPSG local") -> Plant:
    """Put every third control point into a second list of the same frame, changed."""

    def plant(case: Case) -> Planted | None:
        control, second = case.inputs.control, case.full()[::3]
        if case.kind not in kinds.split() or len(case.full()) < 9:
            return None
        enu, frame = control.enu.copy(), np.zeros(len(control), int)
        enu[second] = change(case, enu[second])
        frame[second] = 1
        return replace(with_control(case, enu=enu, frame=frame), frames=(case.inputs.frames[0],) * 2), NOBODY

    return plant


def farther(case: Case, enu: Floats) -> Floats:
    """Lie in another frame, two to eight bases away."""
    return enu + np.array([*case.rng.uniform(2.0, 8.0, 2) * case.spec.base * case.rng.choice([-1, 1], 2), 0.0])


def higher(low: float, high: float) -> Callable[[Case, Floats], Floats]:
    return lambda case, enu: enu + np.array([0.0, 0.0, either(case.rng, low, high)])


def height_points_of_another_kind(case: Case) -> Planted | None:
    """Give every third control point in height only, with heights that differ from the others by a constant."""
    control, full = case.inputs.control, case.full()
    if case.kind == "geocentric" or len(full) < 9:
        return None
    use, enu = control.use.copy(), control.enu.copy()
    use[full[::3], :2] = False
    enu[full[::3], 2] += either(case.rng, 15, 60)
    return with_control(case, enu=enu, use=use), NOBODY


def checks_shifted(case: Case) -> Planted | None:
    """Give all check points in another frame: off by twenty to sixty times the noise, in plan or in height."""
    control = case.inputs.control
    if case.kind in {"geocentric", "geographic"} or control.check.sum() < 3:
        return None
    shift = case.rng.uniform(20.0, 60.0, 3) * [*case.noise[:1] * 2, case.noise[1]] * case.rng.choice([-1, 1], 3)
    shift[[2] if case.rng.random() < EVEN else [0, 1]] = 0.0
    return with_control(case, enu=control.enu + shift * control.check[:, None]), NOBODY


def slip_of_a_digit(case: Case, *, check: bool = False, least: float = 0.0) -> Planted | None:
    """Change one digit of a given coordinate by one to nine; of a check point so that it stands out.

    least: times the noise that the slip must have.
    """
    control, rows = case.inputs.control, case.full(check=check)
    if case.kind in {"geocentric", "geographic"} or not enough(case) or not len(rows):
        return None
    row, axis = int(case.rng.choice(rows)), int(case.rng.integers(3))
    worth = 10.0 ** case.rng.integers(0, 4)
    text = f"{abs(control.enu[row, axis]):.3f}".rjust(12, "0")
    digit = int(text[text.index(".") - 1 - round(np.log10(worth))])
    other = int(case.rng.choice([each for each in range(10) if each != digit]))
    step = (other - digit) * worth * np.sign(control.enu[row, axis] or 1.0)
    if abs(step) < least * case.noise[0 if axis < 2 else 1]:
        return None
    enu = control.enu.copy()
    enu[row, axis] += step
    return with_control(case, enu=enu), frozenset({control.ids[row]})


def of_one_given(change: Callable[[Case, Floats], Floats]) -> Plant:
    """Change the projected coordinates (3,) of one of eight control points."""

    def plant(case: Case) -> Planted | None:
        if case.kind != "EPSG" or not enough(case):
            return None
        row, enu = int(case.rng.choice(case.full())), case.inputs.control.enu.copy()
        enu[row] = change(case, enu[row].copy())
        return with_control(case, enu=enu), frozenset({case.inputs.control.ids[row]})

    return plant


def digit_twice(case: Case, enu: Floats) -> Floats:
    axis = int(case.rng.integers(2))
    text = f"{enu[axis]:.3f}"
    place = int(case.rng.integers(text.index(".")))
    enu[axis] = float(text[: place + 1] + text[place:])
    return enu


def in_other_columns(case: Case, enu: Floats) -> Floats:
    """Take the columns in another order; east and north differ in size."""
    return enu[list([(1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)][case.rng.integers(4)])]


def of_two_given(change: Callable[[Floats, int, int], Floats], wrong: slice) -> Plant:
    """Mix up the coordinates (n, 3) of two of eight control points; one or both are wrong then."""

    def plant(case: Case) -> Planted | None:
        control, rows = case.inputs.control, case.full()
        if not enough(case) or len(rows) < 8:
            return None
        one, other = (int(each) for each in case.rng.choice(rows, 2, replace=False))
        enu = change(control.enu.copy(), one, other)
        return with_control(case, enu=enu), frozenset((control.ids[one], control.ids[other])[wrong])

    return plant


def swapped(enu: Floats, one: int, other: int) -> Floats:
    enu[[one, other]] = enu[[other, one]]
    return enu


def copied(enu: Floats, one: int, other: int) -> Floats:
    enu[other] = enu[one]
    return enu


exchanged = of_two_given(swapped, slice(2))
row_copied = of_two_given(copied, slice(1, 2))


def slip_beside_exchanged(case: Case) -> Planted | None:
    """Exchange two control points, and change a digit of a third by more than twenty times the noise."""
    two = exchanged(case)
    slip = None if two is None else slip_of_a_digit(replace(case, inputs=two[0]), least=PLAIN)
    return None if slip is None or two is None or two[1] & slip[1] else (slip[0], two[1] | slip[1])


def ids_of_given(order: Callable[[Case, tuple[str, ...]], list[str]]) -> Plant:
    """Give the coordinates of the given points to other ids."""
    return lambda case: (
        (with_control(case, ids=tuple(order(case, case.inputs.control.ids))), NOBODY) if enough(case) else None
    )


def kept(wanted: Callable[[Case, Floats, Floats], Flags]) -> Plant:
    """Keep control where it is wanted, by its place along the strip (0 to 1) and across it (in bases)."""

    def plant(case: Case) -> Planted | None:
        control = case.inputs.control
        keep = wanted(case, *places(case)) & np.isin(np.arange(len(control)), case.full())
        if keep.sum() < 3 or len(case.photos) < 6:
            return None
        return replace(case.inputs, control=control.take(keep | control.check)), NOBODY

    return plant


def near_the_line(case: Case, _: Floats, across: Floats) -> Flags:
    """Lie along the flight, within three percent of the half breadth of the strip."""
    half = 0.5 * case.spec.format[1] / 1000 * case.spec.scale / case.spec.base  # in bases
    return np.abs(across) < LINE * half


# ---------------------------------------------------------------------------------- given angles, camera positions


def of_angles(read: Callable[[Case, Floats], Floats], system: str = OPK, tilt: float = 0.0) -> Plant:
    """Give a start whose omega, phi, kappa (n, 3) were read in another way, where that turns the photos.

    By more than three times what noise does, and by more than harms a start.

    tilt: least standard deviation of the attitude, degrees.
    """

    def plant(case: Case) -> Planted | None:
        truth = case.simulation.truth
        if case.spec.flight.attitude_sigma_deg[0] < tilt:
            return None
        values = read(case, angles(truth.rotations_local, OPK))
        steps = truth.rotations_local.transpose(0, 2, 1) @ from_angles(values, system)
        off = np.arccos(np.clip((np.trace(steps, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
        if np.sqrt((off**2).mean()) <= max(3.0 * case.noise[1] / case.spec.base, HARMLESS):
            return None
        return oriented(case.simulation, truth.centers_ground, values, system), NOBODY

    return plant


def against_true_north(case: Case) -> Planted | None:
    """Give angles of a projected frame against true north: all photos are turned by the meridian convergence."""
    from pyproj import Proj

    given = case.inputs.orientations
    if given is None:
        return None
    convergence = Proj(case.spec.ground.crs).get_factors(*case.spec.ground.center_deg).meridian_convergence
    # grid north lies east of true north by the convergence, and angles count to the left
    turn = from_angles(np.radians([[0.0, 0.0, -convergence]]), given.system)[0]
    north = angles(turn @ from_angles(given.angles, given.system), given.system)
    return replace(case.inputs, orientations=replace(given, angles=north)), NOBODY


def of_positions(change: Callable[[Case, Floats], Floats]) -> Plant:
    """Change the measured positions (m, 3) of cameras; those that are changed must be named."""

    def plant(case: Case) -> Planted | None:
        given = case.inputs.positions
        if given is None:
            return None
        enu = change(case, given.enu.copy())
        names = np.array(given.photos)[(enu != given.enu).any(axis=1)]
        return replace(case.inputs, positions=replace(given, enu=enu)), frozenset(names.tolist())

    return plant


def offset(case: Case, low: float, high: float, rows: int = 1) -> Floats:
    """Draw offsets in all axes, in units of the noise, in the units of the frame."""
    return either(case.rng, low, high, (rows, 3)) * max(*case.noise, 0.1) * case.metre


def one_high(case: Case, enu: Floats) -> Floats:
    """Lift or lower one camera inside the strip by half the flying height."""
    enu[case.rng.integers(1, len(enu) - 1), 2] += 0.5 * case.spec.flying_height * case.rng.choice([-1, 1])
    return enu


def neighbours_swapped(case: Case, enu: Floats) -> Floats:
    row = int(case.rng.integers(len(enu) - 1))
    return swapped(enu, row, row + 1)


# ------------------------------------------------------------------------------------------------------- the table


@dataclass(frozen=True)
class Mistake:
    """One kind of mistake: how it is planted, which codes of findings and warnings name it, and when it counts."""

    name: str
    plant: Plant
    codes: tuple[str, ...]
    columns: int = 0  # of the design that it changes; 0: it counts always
    make: Make = sound
    adjustment: str | None = None  # None: what a simulated project asks for

    def settings(self, case: Case) -> Settings:
        """Give the settings of the run that must tell it."""
        return case.settings if self.adjustment is None else replace(case.settings, adjustment=self.adjustment)

    def can_be_told(self, seed: int, inputs: Inputs) -> bool:
        """Whether the sum of squares grows by what noise does not explain; see the module.

        inputs: the planted ones of the case of this seed.
        """
        if not self.columns:
            return True
        growth = squares(self.make(seed), inputs) - squares_of_sound(self.make, seed)
        return growth > chi2_quantile(1.0 - TOLD_LEVEL, self.columns)


@cache
def squares_of_sound(make: Make, seed: int) -> float:
    """Weighted sum of squares of a case without a mistake."""
    case = make(seed)
    return squares(case, case.inputs)


def squares(case: Case, inputs: Inputs) -> float:
    """Weighted sum of squares of the residuals where nothing is searched for; infinite where there is no network."""
    o, wrong = inputs.observations, {(each.photo, each.point) for each in case.simulation.truth.errors}
    named = zip(o.photo.tolist(), o.point.tolist(), strict=True)
    keep = [(o.photo_ids[photo], o.point_ids[point]) not in wrong for photo, point in named]
    settings = replace(
        case.settings,
        adjustment="bundle",
        precision=False,
        bundle=replace(case.settings.bundle, screening="none"),
        relative=replace(case.settings.relative, screening="none"),
        links=replace(case.settings.links, screening="none"),
    )
    try:
        result = triangulate(replace(inputs, observations=images(o, np.array(keep, bool))), settings)
    except PhotostripError:
        return np.inf
    found = document_of(result)["bundle"]
    return float(found["sigma0"] ** 2 * found["redundancy"])


OFF = ("control-rejected", "position-rejected")  # warnings on single coordinates that the adjustment threw out
MISTAKES = (
    Mistake("image coordinates in another unit", of_all_images(factor(1000.0, 0.001, 10.0, 0.1)), ("P101",)),
    Mistake("ten times too large, no format", without_format(of_all_images(factor(10.0))), ("P101",)),
    Mistake("ten times too small, no format, block", without_format(of_all_images(factor(0.1))), ("P101",), make=block),
    Mistake("pixels of an image of another width", of_all_images(factor(0.5, 2 / 3, 0.75, 4 / 3, 1.5, 2.0)),
            ("P101", "P105", "P107"), 1),
    Mistake("a tenth of the principal distance, no format", without_format(distance_times(lambda _: 0.1)), ("P101",)),
    Mistake("ten principal distances, no format", without_format(distance_times(lambda _: 10.0)), ("P101", "P105"), 1),
    Mistake("one photo in another unit", of_one_photo(factor(1000.0, 0.001, 10.0)), ("P102",)),
    Mistake("y down read as y up", of_all_images(lambda _, xy: xy * [1, -1]), ("P103", "P401")),
    Mistake("negatives read as positives", of_all_images(lambda _, xy: xy * [-1, 1]), ("P103", "P401")),
    Mistake("x and y of the images exchanged", of_all_images(lambda _, xy: xy[:, ::-1]), ("P103", "P401")),
    Mistake("one photo mirrored",
            of_one_photo(lambda case, xy: (xy * [1, -1], xy * [-1, 1], xy[:, ::-1])[case.rng.integers(3)]), ("P104",)),
    Mistake("one photo shifted by 5 mm", of_one_photo(shifted), ("P109",), 2),
    Mistake("one photo shifted by 5 mm, block", of_one_photo(shifted), ("P109",), 2, block),
    Mistake("fiducial marks in another unit", marks_in_micrometres, ("P106",)),
    Mistake("principal distance off by 10 or 1000",
            distance_times(lambda rng: float(rng.choice([10.0, 0.1, 1000.0, 0.001]))), ("P105",)),
    Mistake("principal distance of another lens",
            distance_times(lambda rng: float(rng.choice([0.58, 0.73, 1.37, 2.0]))), ("P105", "P107"), 1),
    Mistake("principal distance off by 1 to 3 %", distance_times(lambda rng: 1.0 + float(either(rng, 0.01, 0.03))),
            ("P107", "P105"), 1),
    Mistake("principal distance of one strip off by 10 %", distance_of_one_strip, ("P105",), 1, block),
    Mistake("lens distortion of 5 to 20 µm not stated", of_all_images(bent), ("P110",), 1),
    Mistake("film 0.1 to 0.3 % short or long one way", shrunk(0.001, 0.003), ("P112",), 1),
    Mistake("film 0.03 to 0.07 % short or long in x", shrunk(0.0003, 0.0007, 1), ("P112",), 1),
    Mistake("principal point off by 0.05 to 0.3 mm",
            of_all_images(lambda case, xy: xy + either(case.rng, 0.05, 0.3, 2)), ("P111",), 2, block),
    Mistake("two neighbours exchanged in the list", pair_exchanged, ("P201",)),
    Mistake("a photo listed elsewhere", moved, ("P201",)),
    Mistake("all photos out of order", shuffled, ("P201",)),
    Mistake("no overlap from one photo on", no_overlap, ("P202",)),
    Mistake("a photo twice", twice, ("P203",)),
    Mistake("a photo at another height", of_one_photo(lambda _, xy: xy / 1.5, inside=True), ("P109", "P205"), 1),
    Mistake("a photo left out of the list", photo_missing, ("P206",)),
    Mistake("camera positions below ground",
            of_positions(lambda case, enu: enu - [0.0, 0.0, 1.2 * case.spec.flying_height]),
            ("P204",), 1, with_positions),
    Mistake("their heights in feet", of_positions(lambda _, enu: enu / [1.0, 1.0, FOOT]), ("P405",), 1, with_positions),
    Mistake("one height of them off by half", of_positions(one_high), ("P205", *OFF), 1, with_positions),
    Mistake("two camera positions exchanged", of_positions(neighbours_swapped),
            ("P208", "P206", "P207", *OFF), 1, with_positions),
    Mistake("camera positions in reversed order", of_positions(lambda _, enu: enu[::-1]), ("P208",), 1, with_positions),
    Mistake("camera positions moved by one photo",
            of_positions(lambda case, enu: np.roll(enu, case.rng.choice([-1, 1]), axis=0)),
            ("P208",), 1, with_positions),
    Mistake("camera positions off by a common offset", of_positions(lambda case, enu: enu + offset(case, 20.0, 60.0)),
            ("P208",), 3, with_positions),
    Mistake("camera positions that drift",
            of_positions(lambda case, enu: enu + np.linspace(0, 1, len(enu))[:, None] * offset(case, 40, 80)),
            ("P208",), 3, with_positions),
    Mistake("camera positions worse than stated",
            of_positions(lambda case, enu: enu + offset(case, 0, 40, len(enu))), ("P209",), 2, with_positions),
    Mistake("one id for two points", same_id, ("P301",), 3),
    Mistake("one id for two points of two strips", same_id_in_two_strips, ("P301",), 3, block),
    Mistake("one id of two strips, polynomials", same_id_in_two_strips, ("P301",), 3, block, "polynomial"),
    Mistake("one id for two points nearby in two strips", same_id_nearby, ("P301", "P304"), make=with_ties(2)),
    Mistake("one id in strips that do not overlap", same_id_far_away, ("P301",), 3, with_ties(3)),
    Mistake("two ids for one point", two_ids, ("P302",)),
    Mistake("ids of one photo in the next row", ids_in_the_next_row, ("P303",)),
    Mistake("points in another order on each photo",
            lambda case: (with_points(case, case.photos, case.rng.permutation), NOBODY), ("P303",)),
    Mistake("axes of the control exchanged", axes_exchanged, ("P401", "P103")),
    Mistake("an axis of a local system backwards",
            of_all_given(lambda case, enu: enu * ([-1, 1, 1], [1, -1, 1])[case.rng.integers(2)], "local"), ("P401",)),
    Mistake("crs of another country", another_crs, ("P402",)),
    Mistake("control in feet (projected)",
            of_all_given(lambda case, enu: enu / case.rng.choice([FOOT, US_FOOT]), "EPSG"), ("P403",)),
    Mistake("control times 0.1 to 0.001 (projected)", of_all_given(factor(0.1, 0.01, 0.001), "EPSG"), ("P402",)),
    Mistake("one of two lists in feet", in_two_lists(lambda _, enu: enu / FOOT, "local"), ("P403",), 1),
    Mistake("one of two lists in another frame", in_two_lists(farther), ("P407",), 2),
    Mistake("one of two lists in another frame, block", in_two_lists(farther), ("P407",), 2, block),
    Mistake("heights of two kinds in two lists", in_two_lists(higher(15, 60)), ("P404",), 1),
    Mistake("heights of two kinds in two lists, block", in_two_lists(higher(15, 60)), ("P404",), 1, block),
    Mistake("second list 0.3 m up or down, block", in_two_lists(higher(0.3, 0.3)), ("P404", "P407"), 1, block),
    Mistake("second list 0.6 m up or down, block", in_two_lists(higher(0.6, 0.6)), ("P404", "P407"), 1, block),
    Mistake("heights of two kinds in one list", height_points_of_another_kind, ("P404",), 1),
    Mistake("heights counted downwards", of_all_given(lambda _, enu: enu * [1, 1, -1], "EPSG local"), ("P401",), 1),
    Mistake("heights in feet, plan in metres",
            of_all_given(lambda case, enu: enu * [1, 1, case.rng.choice([1 / FOOT, FOOT])], "EPSG local"),
            ("P405",), 1),
    Mistake("heights in millimetres", of_all_given(lambda _, enu: enu * [1, 1, 1000]), ("P405",), 1),
    Mistake("all heights zero", of_all_given(lambda _, enu: enu * [1, 1, 0]), ("P410",), 1),
    Mistake("slip of a digit, control", slip_of_a_digit, ("P406", *OFF), 1),
    Mistake("slip of a digit, polynomials", slip_of_a_digit, ("P406", *OFF), 1, adjustment="polynomial"),
    Mistake("slip of a digit, models", slip_of_a_digit, ("P406", *OFF), 1, of_models),
    Mistake("slip of a digit, check point", partial(slip_of_a_digit, check=True, least=PLAIN), ("P406",)),
    Mistake("a digit written twice", of_one_given(digit_twice), ("P406", *OFF), 1),
    Mistake("slip of a digit, two others exchanged", slip_beside_exchanged, ("P406", "P408", *OFF)),
    Mistake("two control points exchanged", exchanged, ("P408",), 1),
    Mistake("ids of given points in the next row", ids_of_given(lambda _, ids: [*ids[-1:], *ids[:-1]]), ("P409",)),
    Mistake("given points with coordinates of others",
            ids_of_given(lambda case, ids: [ids[k] for k in case.rng.permutation(len(ids))]), ("P409",)),
    Mistake("one given point in other columns", of_one_given(in_other_columns), ("P406", *OFF), 1),
    Mistake("row of a given point copied", row_copied, ("P410",)),
    Mistake("all check points shifted", checks_shifted, ("P411",)),
    Mistake("all check points shifted, block", checks_shifted, ("P411",), make=block),
    Mistake("all check points shifted, models", checks_shifted, ("P411",), make=of_models),
    Mistake("standard deviation of images in micrometres",
            lambda case: (with_images(case, sigma=case.inputs.observations.sigma * 1000.0), NOBODY), ("P108",)),
    Mistake("standard deviation of control in millimetres",
            lambda case: (with_control(case, sigma=case.inputs.control.sigma * 1000.0), NOBODY), ("P108",)),
    Mistake("image coordinates from a corner", of_all_images(lambda case, xy: xy + np.divide(case.spec.format, 2)),
            ("P101",)),
    Mistake("one photo from a corner", of_one_photo(lambda case, xy: xy + np.divide(case.spec.format, 2)), ("P101",)),
    Mistake("control at one end", kept(lambda _, along, __: along < THIRD), ("P501",)),
    Mistake("control on one line", kept(near_the_line), ("P502",)),
    Mistake("control in one half", kept(lambda _, along, __: along < HALF), ("P501", "P503")),
    Mistake("angles in another unit", of_angles(factor(200 / 180, 180 / 200, 180 / np.pi, np.pi / 180)), ("P601",)),
    Mistake("angles in another system", of_angles(lambda _, values: values, "alpha-omega-kappa", tilt=1.0), ("P602",)),
    Mistake("angles with another sense of kappa", of_angles(lambda _, values: values * [1, 1, -1], tilt=1.0),
            ("P602",)),
    Mistake("angles against true north in a grid", against_true_north, ("P602",), 1, at_the_edge),
    Mistake("k1 and k2 not stated", of_all_images(bent_at_the_edge), ("P110",), 2),
    Mistake("decentred lens not stated", of_all_images(decentred), ("P110",), 2),
)  # fmt: skip


def mistake(name: str) -> Mistake:
    return next(each for each in MISTAKES if each.name == name)
