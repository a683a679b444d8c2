"""How often the gate finds a planted mistake, and how often it finds one where there is none.

Short simulated strips of all kinds
(film and digital cameras, 4 to 8 photos, end laps of 58 to 80 %, any azimuth and turn of the photos, flat and hilly
ground, projected, geographic, geocentric and local frames, few and many control points in several layouts, measured
well and badly) are examined as they are, and with one mistake each. A mistake counts where its effect is larger than
three times what noise does; what that is stands beside each kind.

Usage: python benchmarks/plausibility.py [STRIPS] [SOUND] [FIRST SEED OF THE SOUND] [WORD ...] [--first SEED] [-v]
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.errors import InputError, PhotostripError
from photostrip.geometry.rotation import angles, from_angles
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations
from photostrip.pipeline.plausibility import gate
from photostrip.pipeline.run import triangulate
from photostrip.plausibility import KINDS
from photostrip.simulation import (
    DIGITAL,
    FILM,
    Control,
    Film,
    Flight,
    GrossError,
    Ground,
    Image,
    Models,
    Points,
    Spec,
    Terrain,
)
from photostrip.simulation.simulation import simulate
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.simulation.simulation import Simulation

    Floats = NDArray[np.float64]

FOOT = 0.3048
FIRST_SEED = 100_000  # before the planted mistakes
GROSS_SHARE = 0.2  # of the strips without a mistake have two gross errors of image coordinates, which are none of these
THIRD, HALF, LINE = 0.3, 0.55, 0.03  # of the length of the strip; of its half breadth
EVEN = 0.5
SHIFT = 5.0  # mm
PERCENTS_SEEN = 12.0  # standard deviations of the heights of the control together
HARMLESS = np.radians(0.3)  # rms of given angles: start values need not be better
BEYOND = 1 / 3  # of what the control spans, beyond which a sound strip does not reach at either end
TOLD_APART = 5.0  # standard deviations of an image coordinate
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
    """A simulated strip as it would be given."""

    simulation: Simulation
    inputs: Inputs
    settings: Settings
    rng: np.random.Generator

    @property
    def photos(self) -> tuple[str, ...]:
        """Photos of the strip."""
        return self.inputs.strips[0].photos

    @property
    def spec(self) -> Spec:
        """What was simulated."""
        return self.simulation.spec

    @property
    def noise(self) -> tuple[float, float]:
        """Standard deviation of a point of one model in plan and height with that of the control, metres."""
        if self.spec.models is not None:
            plan, height = (self.spec.models.sigma_um[axis] * 1e-6 * self.spec.scale for axis in (0, 2))
        else:
            plan = self.spec.image.sigma_um * 1e-6 * self.spec.scale
            height = plan * np.sqrt(2.0) * self.spec.flying_height / self.spec.base
        return float(np.hypot(plan, self.spec.control.sigma[0])), float(np.hypot(height, self.spec.control.sigma[2]))


def sound(seed: int) -> Case:
    """Simulate a strip without a mistake."""
    rng = np.random.default_rng([7, seed])
    for attempt in range(20):
        spec = drawn(rng, seed * 20 + attempt)
        try:
            simulation = simulate(spec)
        except InputError:
            continue  # the pass points of so few photos did not suffice
        case = Case(simulation, inputs_of(simulation), settings_of(simulation), rng)
        if holds_both_ends(case) and not in_one_place(case):
            return case
    raise SystemExit(f"no strip can be made of seed {seed}")


def block(seed: int) -> Case:
    """Simulate a block of two or three strips over hills, without a mistake."""
    rng = np.random.default_rng([9, seed])
    for attempt in range(20):
        spec = drawn(rng, seed * 20 + attempt)
        if spec.ground.crs == "geocentric":
            continue
        flight = replace(spec.flight, strips=int(rng.integers(2, 4)), side_lap_percent=float(rng.uniform(25, 40)))
        control = replace(spec.control, layout="bands", bands=3, use={"xyz": 1.0})
        hills = replace(spec.terrain, relief=max(spec.terrain.relief, 0.05 * spec.flying_height))
        spec = replace(spec, flight=flight, control=control, terrain=hills, points=replace(spec.points, rows=5))
        try:
            simulation = simulate(replace(spec, gross_errors=()))
        except InputError:
            continue
        return Case(simulation, inputs_of(simulation), settings_of(simulation), rng)
    raise SystemExit(f"no block can be made of seed {seed}")


def of_models(seed: int) -> Case:
    """Simulate a strip of 6 to 40 independent models, without a mistake."""
    rng = np.random.default_rng([10, seed])
    for attempt in range(20):
        spec = drawn(rng, seed * 20 + attempt)
        flight = replace(spec.flight, photos=int(rng.integers(7, 42)))
        control = replace(spec.control, layout="bands", every=int(rng.integers(3, 16)), use={"xyz": 1.0})
        spec = replace(spec, flight=flight, control=control, models=Models(), gross_errors=())
        try:
            simulation = simulate(spec)
        except InputError:
            continue
        return Case(simulation, inputs_of(simulation), settings_of(simulation), rng)
    raise SystemExit(f"no models can be made of seed {seed}")


def with_ties(strips: int) -> Callable[[int], Case]:
    """Simulate blocks of so many strips with many points, without a mistake."""

    def make(seed: int) -> Case:
        rng = np.random.default_rng([24, seed])
        flight, points = Flight(photos=6, strips=strips), Points(extra_per_model=20)
        simulation = simulate(Spec(seed=seed, flight=flight, control=Control(bands=3), points=points))
        return Case(simulation, inputs_of(simulation), settings_of(simulation), rng)

    return make


def holds_both_ends(case: Case) -> bool:
    """Whether neither end lies farther beyond the control than a third of what it spans: to leave one out is a mistake.

    Farther than half of it must be told; between a third and a half nothing is demanded.
    """
    control = case.inputs.control
    counts = control.use[:, 0] & ~control.check & np.isin(control.ids, case.inputs.observations.point_ids)
    along = np.clip(places(case)[0][counts], 0.0, 1.0)
    low, high = float(along.min(initial=1.0)), float(along.max(initial=0.0))
    return max(low, 1.0 - high) <= BEYOND * (high - low)


def in_one_place(case: Case) -> bool:
    """Whether two points lie so near to each other that no measurement tells them apart: one point under two ids."""
    o = case.inputs.observations
    near = TOLD_APART * case.spec.image.sigma_um / 1000.0
    for photo in range(len(o.photo_ids)):
        xy = o.xy[o.photo == photo]
        d = np.abs(xy[:, None, :] - xy[None, :, :]).max(axis=2)
        if (d[np.triu_indices(len(xy), 1)] < near).any():
            return True
    return False


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


def drawn(rng: np.random.Generator, seed: int) -> Spec:
    """Draw what is to be simulated."""
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
    layout = str(rng.choice(["bands", "bands", "bands", "corners", "corners+centre", "random"]))
    layout = "bands" if len(use) > 1 else layout
    return Spec(
        seed=seed,
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
            layout=layout,
            bands=int(rng.integers(3 if len(use) > 1 else 2, 4)),
            per_band=3,
            count=int(rng.integers(8, 14)),
            use=use,
            sigma=(ground_sigma, ground_sigma, 1.5 * ground_sigma),
        ),
        image=Image(sigma_um=sigma),
        gross_errors=(GrossError("image", count=2),) if rng.random() < GROSS_SHARE else (),
    )


# ------------------------------------------------------------------------------------------- planting mistakes

Planted = tuple["Inputs", frozenset[str]]  # the inputs and the ids that must be named; empty when none need be
NOBODY: frozenset[str] = frozenset()


def marks_in_micrometres(case: Case) -> Planted | None:
    """Give fiducial marks, and with them all image coordinates, a thousand times too large or too small."""
    if not case.spec.camera.fiducials:
        return None
    made = simulate(replace(case.spec, film=Film()))
    inputs = inputs_of(made)
    if inputs.fiducials is None:
        return None
    factor = float(case.rng.choice([1000.0, 0.001, 25.4]))
    o, marks = inputs.observations, inputs.fiducials
    changed = (replace(o, xy=o.xy * factor), replace(marks, xy=marks.xy * factor))
    return replace(inputs, observations=changed[0], fiducials=changed[1]), NOBODY


def with_xy(case: Case, xy: Floats) -> Inputs:
    """Give the inputs with other image coordinates."""
    return replace(case.inputs, observations=replace(case.inputs.observations, xy=xy))


def rows_of(case: Case, photo: str) -> NDArray[np.bool_]:
    """Find the image points of a photo."""
    o = case.inputs.observations
    return np.asarray(o.photo == o.photo_ids.index(photo))


def unit(case: Case) -> Planted | None:
    """Multiply all image coordinates by the factor of a wrong unit."""
    factor = float(case.rng.choice([1000.0, 0.001, 10.0, 0.1]))
    return with_xy(case, case.inputs.observations.xy * factor), NOBODY


def without_format(inputs: Inputs) -> Inputs:
    """Leave out the format of the camera, where it has no marks, which would say as much."""
    cameras = [replace(each.camera, format=None) for each in inputs.strips]
    strips = [replace(each, camera=camera) for each, camera in zip(inputs.strips, cameras, strict=True)]
    return replace(inputs, strips=tuple(strips), fiducials=None)


def unit_without_format(case: Case) -> Planted | None:
    """Give image coordinates ten times too large, without a format."""
    return without_format(with_xy(case, case.inputs.observations.xy * 10.0)), NOBODY


def distance_without_format(case: Case) -> Planted | None:
    """Give a tenth of the principal distance, without a format."""
    return without_format(with_camera(case, 0.1)), NOBODY


def ten_distances_without_format(case: Case) -> Planted | None:
    """Give ten times the principal distance, without a format; seen in pairs and in the heights of the control."""
    return (without_format(with_camera(case, 10.0)), NOBODY) if seen_in_heights(case, 0.9) else None


def unit_of_one(case: Case) -> Planted | None:
    """Give one photo in micrometres."""
    photo = str(case.rng.choice(case.photos))
    xy = case.inputs.observations.xy.copy()
    xy[rows_of(case, photo)] *= float(case.rng.choice([1000.0, 0.001, 10.0]))
    return with_xy(case, xy), frozenset({photo})


def y_down(case: Case) -> Planted | None:
    """Read y down as y up."""
    return with_xy(case, case.inputs.observations.xy * [1, -1]), NOBODY


def negatives(case: Case) -> Planted | None:
    """Read negatives as positives."""
    return with_xy(case, case.inputs.observations.xy * [-1, 1]), NOBODY


def x_and_y(case: Case) -> Planted | None:
    """Exchange x and y."""
    return with_xy(case, case.inputs.observations.xy[:, ::-1]), NOBODY


def one_mirrored(case: Case) -> Planted | None:
    """Turn one photo over."""
    photo = str(case.rng.choice(case.photos))
    xy, rows = case.inputs.observations.xy.copy(), rows_of(case, photo)
    xy[rows] = (xy[rows] * [1, -1], xy[rows] * [-1, 1], xy[rows][:, ::-1])[case.rng.integers(3)]
    return with_xy(case, xy), frozenset({photo})


def one_shifted(case: Case) -> Planted | None:
    """Shift all image coordinates of one photo by 5 mm, whatever that does."""
    photo = str(case.rng.choice([photo for strip in case.inputs.strips for photo in strip.photos]))
    way, xy = case.rng.normal(size=2), case.inputs.observations.xy.copy()
    xy[rows_of(case, photo)] += SHIFT * way / np.linalg.norm(way)
    return with_xy(case, xy), frozenset({photo})


def at_another_height(case: Case) -> Planted | None:
    """Reduce one photo inside the strip, as one taken from one and a half times the height or with another lens."""
    photo = str(case.rng.choice(case.photos[1:-1]))
    xy = case.inputs.observations.xy.copy()
    xy[rows_of(case, photo)] /= 1.5
    return with_xy(case, xy), frozenset({photo})


def with_camera(case: Case, factor: float) -> Inputs:
    """Give the inputs with another principal distance."""
    strips = tuple(
        replace(each, camera=replace(each.camera, principal_distance=each.camera.principal_distance * factor))
        for each in case.inputs.strips
    )
    return replace(case.inputs, strips=strips)


def lens(case: Case) -> Planted | None:
    """Bend the images by 20 to 40 µm at three quarters of half the diagonal, which nobody states."""
    o = case.inputs.observations
    radius = 0.75 * float(np.hypot(*o.xy.T).max())
    k1 = float(case.rng.choice([-1.0, 1.0])) * float(case.rng.uniform(0.02, 0.04)) / radius**3
    bent = o.xy * (1.0 + k1 * (o.xy**2).sum(axis=1)[:, None])
    return replace(case.inputs, observations=replace(o, xy=bent)), NOBODY


def film(case: Case) -> Planted | None:
    """Let the film shrink or grow by 0.1 to 0.3 % along one image axis."""
    o, factor = case.inputs.observations, np.ones(2)
    factor[case.rng.integers(2)] += float(case.rng.choice([-1.0, 1.0])) * float(case.rng.uniform(0.001, 0.003))
    return replace(case.inputs, observations=replace(o, xy=o.xy * factor)), NOBODY


def principal_point(case: Case) -> Planted | None:
    """Shift all images by half a millimetre to a millimetre."""
    o = case.inputs.observations
    shift = case.rng.choice([-1.0, 1.0], 2) * case.rng.uniform(0.5, 1.0, 2)
    return replace(case.inputs, observations=replace(o, xy=o.xy + shift)), NOBODY


def distance_by_ten(case: Case) -> Planted | None:
    """Misplace the decimal point of the principal distance."""
    return with_camera(case, float(case.rng.choice([10.0, 0.1, 1000.0, 0.001]))), NOBODY


def distance(case: Case) -> Planted | None:
    """Take the principal distance of another lens; seen in the heights of the control only."""
    factor = float(case.rng.choice([0.58, 0.73, 1.37, 2.0]))
    if not seen_in_heights(case, abs(factor - 1.0)):
        return None
    return with_camera(case, factor), NOBODY


def distance_of_one_strip(case: Case) -> Planted | None:
    """Give one strip of a block a camera of its own with a principal distance that is off by ten percent."""
    off = int(case.rng.integers(len(case.inputs.strips)))
    factor = float(case.rng.choice([0.9, 1.1]))
    strips = list(case.inputs.strips)
    camera = strips[off].camera
    other = replace(camera, name="other", principal_distance=camera.principal_distance * factor)
    strips[off] = replace(strips[off], camera=other)
    return replace(case.inputs, strips=tuple(strips)), frozenset({strips[off].id})


def distance_by_percents(case: Case) -> Planted | None:
    """Give a principal distance that is off by one to three percent; seen in the heights of the control only."""
    factor = 1.0 + float(case.rng.choice([-1.0, 1.0])) * float(case.rng.uniform(0.01, 0.03))
    seen = seen_in_heights(case, abs(factor - 1.0), PERCENTS_SEEN)
    return (with_camera(case, factor), NOBODY) if seen else None


def seen_in_heights(case: Case, change: float, sigmas: float | None = None) -> bool:
    """Whether a stretch of the heights moves the control by more than three times what noise does in a fit of them.

    sigmas: standard deviations by which it must, in place of that.
    """
    control = case.inputs.control
    o = case.inputs.observations
    rows = control.use.all(axis=1) & ~control.check & np.isin(control.ids, o.point_ids)
    if case.spec.ground.crs == "geocentric" or rows.sum() < 7:
        return False
    xyz = case.simulation.truth.ground.xyz
    index = {name: row for row, name in enumerate(case.simulation.truth.ground.ids)}
    enu = xyz[[index[name] for name, row in zip(control.ids, rows, strict=True) if row]]
    d = enu[:, :2] - enu[:, :2].mean(axis=0)
    u, _, _ = np.linalg.svd(d, full_matrices=False)
    along = d @ np.linalg.svd(d)[2][0]
    along /= np.abs(along).max()
    columns = np.column_stack([np.ones(len(d)), u, along**2, u.prod(axis=1)])
    left = enu[:, 2] - columns @ np.linalg.lstsq(columns, enu[:, 2], rcond=None)[0]
    freedom = len(left) - columns.shape[1] - 1
    if freedom < 3:
        return False
    least = 3.0 * critical(freedom) if sigmas is None else sigmas
    return change * float(np.linalg.norm(left)) > least * case.noise[1]


def critical(freedom: int) -> float:
    """Give what noise alone reaches once in a hundred thousand tests, in standard deviations."""
    from scipy.stats import t

    return float(t.ppf(1 - 1e-5, freedom))


def with_photos(case: Case, photos: list[str]) -> Inputs:
    """Give the inputs with another list of photos."""
    return replace(case.inputs, strips=(replace(case.inputs.strips[0], photos=tuple(photos)),))


def pair_exchanged(case: Case) -> Planted | None:
    """Exchange two neighbours in the list."""
    photos = list(case.photos)
    place = int(case.rng.integers(len(photos) - 1))
    photos[place], photos[place + 1] = photos[place + 1], photos[place]
    return with_photos(case, photos), frozenset(photos[place : place + 2])


def moved(case: Case) -> Planted | None:
    """List one photo somewhere else."""
    photos = list(case.photos)
    photo = photos.pop(int(case.rng.integers(len(photos))))
    places = [k for k in range(len(photos) + 1) if abs(k - case.photos.index(photo)) > 1]
    if not places:
        return None
    photos.insert(int(case.rng.choice(places)), photo)
    return with_photos(case, photos), frozenset({photo})


def shuffled(case: Case) -> Planted | None:
    """List all photos in a wrong order."""
    photos = list(case.photos)
    while photos in (list(case.photos), list(case.photos)[::-1]):
        case.rng.shuffle(photos)
    return with_photos(case, photos), NOBODY


def with_points(case: Case, photos: Iterable[str], order: Callable[[int], NDArray[np.int_]]) -> Inputs:
    """Give the inputs with the ids of some photos in another order."""
    point = case.inputs.observations.point.copy()
    for photo in photos:
        rows = np.flatnonzero(rows_of(case, photo))
        point[rows] = point[rows[order(len(rows))]]
    return replace(case.inputs, observations=replace(case.inputs.observations, point=point))


def ids_in_the_next_row(case: Case) -> Planted | None:
    """Write the ids of one photo one row too low."""
    photo = str(case.rng.choice(case.photos))
    return with_points(case, [photo], lambda rows: np.roll(np.arange(rows), 1)), frozenset({photo})


def numbered_anew(case: Case) -> Planted | None:
    """Give the points of all photos ids in any order."""
    return with_points(case, case.photos, case.rng.permutation), NOBODY


def no_overlap(case: Case) -> Planted | None:
    """Give the points of all photos from one on other names, as those of another flight."""
    o = case.inputs.observations
    place = int(case.rng.integers(1, len(case.photos)))
    later = np.isin(o.photo, [o.photo_ids.index(name) for name in case.photos[place:]])
    names = (*o.point_ids, *(f"{name}x" for name in o.point_ids))
    changed = replace(o, point_ids=names, point=np.where(later, o.point + len(o.point_ids), o.point))
    return replace(case.inputs, observations=changed), frozenset(case.photos[place - 1 : place + 1])


def twice(case: Case) -> Planted | None:
    """Give one photo a second time under another name, measured again."""
    o = case.inputs.observations
    place = int(case.rng.integers(len(case.photos)))
    rows = np.flatnonzero(rows_of(case, case.photos[place]))
    noise = case.rng.normal(0.0, case.spec.image.sigma_um / 1000.0, (len(rows), 2))
    copy = replace(
        o,
        photo_ids=(*o.photo_ids, "copy"),
        photo=np.r_[o.photo, np.full(len(rows), len(o.photo_ids))],
        point=np.r_[o.point, o.point[rows]],
        xy=np.r_[o.xy, o.xy[rows] + noise],
        sigma=np.r_[o.sigma, o.sigma[rows]],
    )
    photos = [*case.photos[: place + 1], "copy", *case.photos[place + 1 :]]
    return replace(with_photos(case, photos), observations=copy), frozenset({case.photos[place], "copy"})


def photo_missing(case: Case) -> Planted | None:
    """Take one photo out of the list, where its neighbours overlap."""
    if case.spec.flight.end_lap_percent < 72 or len(case.photos) < 6:
        return None
    place = int(case.rng.integers(2, len(case.photos) - 2))
    photos = [*case.photos[:place], *case.photos[place + 1 :]]
    o = case.inputs.observations
    seen = [set(o.point[rows_of(case, name)].tolist()) for name in photos]
    if min(len(a & b) for a, b in pairwise(seen)) < 7:
        return None
    if min(len(a & b & c) for a, b, c in zip(seen, seen[1:], seen[2:], strict=False)) < 2:
        return None
    kept = ~rows_of(case, case.photos[place])
    o = replace(o, photo=o.photo[kept], point=o.point[kept], xy=o.xy[kept], sigma=o.sigma[kept])
    inputs = replace(with_photos(case, photos), observations=compact(o))
    return inputs, frozenset({case.photos[place - 1], case.photos[place + 1]})


def compact(o: PhotoPoints) -> PhotoPoints:
    """Drop photos without points."""
    names = [o.photo_ids[n] for n in np.unique(o.photo)]
    number = np.searchsorted(np.unique(o.photo), o.photo)
    return replace(o, photo_ids=tuple(names), photo=number)


# ------------------------------------------------------------------------------------------ mistakes in the control


def with_control(case: Case, **columns: object) -> Inputs:
    """Give the inputs with other columns of the control."""
    changed: ControlPoints = replace(case.inputs.control, **columns)  # type: ignore[arg-type]
    return replace(case.inputs, control=changed)


def kind_of(case: Case) -> str:
    """Say which kind of frame the control has."""
    return {"EPSG:4326": "geographic"}.get(case.spec.ground.crs, case.spec.ground.crs.partition(":")[0])


def enough(case: Case, least: int = 6) -> bool:
    """Whether the control has some points in full, so that one of them can be told to be wrong."""
    control = case.inputs.control
    return int((control.use.all(axis=1) & ~control.check).sum()) >= least


def shown(case: Case) -> NDArray[np.bool_]:
    """Full points of the control that take part and that photos show."""
    control = case.inputs.control
    return np.asarray(
        np.isin(control.ids, case.inputs.observations.point_ids) & control.use.all(axis=1) & ~control.check
    )


def axes_exchanged(case: Case) -> Planted | None:
    """Exchange two axes of the control."""
    if kind_of(case) == "geocentric":
        return None
    control = case.inputs.control
    return with_control(case, enu=control.enu[:, [1, 0, 2]], use=control.use[:, [1, 0, 2]]), NOBODY


def left_handed(case: Case) -> Planted | None:
    """Count one axis of a local system backwards."""
    if kind_of(case) != "local":
        return None
    sign = ([-1, 1, 1], [1, -1, 1])[case.rng.integers(2)]
    return with_control(case, enu=case.inputs.control.enu * sign), NOBODY


def another_crs(case: Case) -> Planted | None:
    """Name a coordinate reference system of another country."""
    if kind_of(case) != "EPSG":
        return None
    crs = str(case.rng.choice(["EPSG:2154", "EPSG:31468", "EPSG:27700", "EPSG:21781", "EPSG:32650"]))
    if lies_there(case, crs):
        return None
    spec = replace(case.inputs.frames[0], crs=crs)
    return replace(case.inputs, frames=(spec,)), NOBODY


def feet(case: Case) -> Planted | None:
    """Give projected coordinates in feet, international or US survey."""
    if kind_of(case) != "EPSG":
        return None
    foot = float(case.rng.choice([FOOT, 1200 / 3937]))
    return with_control(case, enu=case.inputs.control.enu / foot), NOBODY


def lost_digits(case: Case) -> Planted | None:
    """Give projected coordinates in kilometres, or without their last digits."""
    if kind_of(case) != "EPSG":
        return None
    factor = float(case.rng.choice([0.1, 0.01, 0.001]))
    return with_control(case, enu=case.inputs.control.enu * factor), NOBODY


def in_two_lists(case: Case, change: Callable[[Floats], Floats]) -> Planted | None:
    """Put every third control point into a second list of the same frame, changed."""
    if kind_of(case) in {"geocentric", "geographic"} or not enough(case, 9):
        return None
    control = case.inputs.control
    full = np.flatnonzero(
        control.use.all(axis=1) & ~control.check & np.isin(control.ids, case.inputs.observations.point_ids)
    )
    second = full[::3] if len(full) >= 9 else full[:0]
    if len(second) < 3:
        return None
    enu, frame = control.enu.copy(), np.zeros(len(control), int)
    enu[second] = change(enu[second])
    frame[second] = 1
    inputs = with_control(case, enu=enu, frame=frame)
    return replace(inputs, frames=(case.inputs.frames[0],) * 2), NOBODY


def list_in_feet(case: Case) -> Planted | None:
    """Give one of two lists in feet."""
    return in_two_lists(case, lambda enu: enu / FOOT) if kind_of(case) == "local" else None


def list_in_another_frame(case: Case) -> Planted | None:
    """Give one of two lists in a frame that lies elsewhere."""
    shift = np.array([*case.rng.uniform(2.0, 8.0, 2) * case.spec.base * case.rng.choice([-1, 1], 2), 0.0])
    return in_two_lists(case, lambda enu: enu + shift)


def heights_of_another_kind(case: Case) -> Planted | None:
    """Give one of two lists heights that differ by a constant."""
    step = float(case.rng.choice([-1, 1]) * case.rng.uniform(15, 60))
    if step**2 < (3 * critical(3) * case.noise[1]) ** 2:
        return None
    return in_two_lists(case, lambda enu: enu + np.array([0.0, 0.0, step]))


def heights_down(case: Case) -> Planted | None:
    """Count heights downwards."""
    if kind_of(case) == "geographic" or not seen_in_heights(case, 1.0):
        return None
    return with_control(case, enu=case.inputs.control.enu * [1, 1, -1]), NOBODY


def height_points_of_another_kind(case: Case) -> Planted | None:
    """Give every third control point in height only, with heights that differ from the others by a constant."""
    step = float(case.rng.choice([-1, 1]) * case.rng.uniform(15, 60))
    if kind_of(case) == "geocentric" or step**2 < (3 * critical(3) * case.noise[1]) ** 2:
        return None
    control = case.inputs.control
    full = np.flatnonzero(
        control.use.all(axis=1) & ~control.check & np.isin(control.ids, case.inputs.observations.point_ids)
    )
    if len(full) < 9:
        return None
    use, enu = control.use.copy(), control.enu.copy()
    use[full[::3], :2] = False
    enu[full[::3], 2] += step
    return with_control(case, enu=enu, use=use), NOBODY


def heights_in_feet(case: Case) -> Planted | None:
    """Give heights in feet and plan in metres, or the other way round."""
    factor = float(case.rng.choice([1 / FOOT, FOOT]))
    if kind_of(case) == "geographic" or not seen_in_heights(case, min(abs(factor - 1.0), 1.0)):
        return None
    return with_control(case, enu=case.inputs.control.enu * [1, 1, factor]), NOBODY


def checks_shifted(case: Case) -> Planted | None:
    """Give all check points in another frame: off by twenty to sixty times the noise, in plan or in height."""
    control = case.inputs.control
    if kind_of(case) in {"geocentric", "geographic"} or control.check.sum() < 3:
        return None
    shift = case.rng.uniform(20.0, 60.0, 3) * [*case.noise[:1] * 2, case.noise[1]] * case.rng.choice([-1, 1], 3)
    shift[[2] if case.rng.random() < EVEN else [0, 1]] = 0.0
    return with_control(case, enu=control.enu + shift * control.check[:, None]), NOBODY


def slip_of_a_digit(case: Case, *, check: bool) -> Planted | None:
    """Change one digit of a given coordinate by one to nine."""
    control = case.inputs.control
    if kind_of(case) in {"geocentric", "geographic"} or not enough(case, 8):
        return None
    models = case.inputs.models
    measured = case.inputs.observations.point_ids if models is None else models.points.point_ids
    seen = np.isin(control.ids, measured) & control.use.all(axis=1) & (control.check == check)
    if not seen.any():
        return None
    row, axis = int(case.rng.choice(np.flatnonzero(seen))), int(case.rng.integers(3))
    noise = case.noise[0 if axis < 2 else 1]
    worth = 10.0 ** case.rng.integers(0, 4)
    text = f"{abs(control.enu[row, axis]):.3f}".rjust(12, "0")
    place = text.index(".") - 1 - round(np.log10(worth))
    digit = int(text[place])
    other = int(case.rng.choice([each for each in range(10) if each != digit]))
    step = (other - digit) * worth * np.sign(control.enu[row, axis] or 1.0)
    # what noise does at a point that takes no part: the end of a strip that is bent by what few points say
    if abs(step) < 3 * critical(6) * 2 * noise or worth < 12 * noise:
        return None
    enu = control.enu.copy()
    enu[row, axis] += step
    return with_control(case, enu=enu), frozenset({control.ids[row]})


def digit_too_many(case: Case) -> Planted | None:
    """Write one digit of a projected coordinate twice."""
    control = case.inputs.control
    if kind_of(case) != "EPSG" or not enough(case, 8):
        return None
    seen = np.isin(control.ids, case.inputs.observations.point_ids) & control.use.all(axis=1) & ~control.check
    row, axis = int(case.rng.choice(np.flatnonzero(seen))), int(case.rng.integers(2))
    text = f"{control.enu[row, axis]:.3f}"
    place = int(case.rng.integers(text.index(".")))
    enu = control.enu.copy()
    enu[row, axis] = float(text[: place + 1] + text[place:])
    return with_control(case, enu=enu), frozenset({control.ids[row]})


def exchanged(case: Case) -> Planted | None:
    """Exchange the coordinates of two control points."""
    control = case.inputs.control
    if not enough(case, 8):
        return None
    seen = np.flatnonzero(shown(case))
    if len(seen) < 8:
        return None
    one, other = (int(each) for each in case.rng.choice(seen, 2, replace=False))
    enu = control.enu.copy()
    enu[[one, other]] = enu[[other, one]]
    return with_control(case, enu=enu), frozenset({control.ids[one], control.ids[other]})


def slip_beside_exchanged(case: Case) -> Planted | None:
    """Exchange two control points, and change a digit of a third."""
    two = exchanged(case)
    slip = None if two is None else slip_of_a_digit(replace(case, inputs=two[0]), check=False)
    return None if slip is None or two is None or two[1] & slip[1] else slip


def in_the_next_row(case: Case) -> Planted | None:
    """Write the ids of all given points one row too low."""
    ids = case.inputs.control.ids
    return (with_control(case, ids=(*ids[-1:], *ids[:-1])), NOBODY) if enough(case, 8) else None


def of_other_points(case: Case) -> Planted | None:
    """Give the coordinates of the given points to other ids, in any order."""
    ids = list(case.inputs.control.ids)
    case.rng.shuffle(ids)
    return (with_control(case, ids=tuple(ids)), NOBODY) if enough(case, 8) else None


def other_columns_of_one(case: Case) -> Planted | None:
    """Give one point its coordinates in another order; seen where east and north differ in size."""
    control = case.inputs.control
    if kind_of(case) != "EPSG" or not enough(case, 8):
        return None
    row = int(case.rng.choice(np.flatnonzero(shown(case))))
    enu = control.enu.copy()
    enu[row] = enu[row, list([(1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)][case.rng.integers(4)])]
    return with_control(case, enu=enu), frozenset({control.ids[row]})


def row_copied(case: Case) -> Planted | None:
    """Give one point the coordinates of another."""
    control = case.inputs.control
    seen = np.flatnonzero(shown(case))
    if not enough(case, 8) or len(seen) < 8:
        return None
    one, other = (int(each) for each in case.rng.choice(seen, 2, replace=False))
    enu = control.enu.copy()
    enu[other] = enu[one]
    return with_control(case, enu=enu), frozenset({control.ids[other]})


def heights_of_nothing(case: Case) -> Planted | None:
    """Give all heights as zero, where the ground has relief."""
    if kind_of(case) == "geocentric" or not seen_in_heights(case, 0.5):
        return None
    return with_control(case, enu=case.inputs.control.enu * [1, 1, 0]), NOBODY


def heights_in_millimetres(case: Case) -> Planted | None:
    """Give all heights in millimetres, where the ground has relief."""
    if kind_of(case) == "geocentric" or not seen_in_heights(case, 0.5):
        return None
    return with_control(case, enu=case.inputs.control.enu * [1, 1, 1000]), NOBODY


def sigma_in_micrometres(case: Case) -> Planted | None:
    """State the standard deviation of image coordinates in micrometres."""
    o = case.inputs.observations
    return replace(case.inputs, observations=replace(o, sigma=o.sigma * 1000.0)), NOBODY


def counted_from_a_corner(case: Case) -> Planted | None:
    """Count image coordinates from a corner."""
    format_ = np.array(case.spec.camera.format or (230.0, 230.0))
    return with_xy(case, case.inputs.observations.xy + format_ / 2.0), NOBODY


def one_from_a_corner(case: Case) -> Planted | None:
    """Count the image coordinates of one photo from a corner."""
    photo = str(case.rng.choice(case.photos))
    xy = case.inputs.observations.xy.copy()
    xy[rows_of(case, photo)] += np.array(case.spec.camera.format or (230.0, 230.0)) / 2.0
    return with_xy(case, xy), frozenset({photo})


def same_id(case: Case) -> Planted | None:
    """Give a point of the last photos the id of one of the first photos."""
    o = case.inputs.observations
    given = set(case.inputs.control.ids)
    if len(case.photos) < 5:
        return None
    seen = [set(o.point[rows_of(case, name)].tolist()) for name in case.photos]
    inside = [sum(number in each for each in seen) for number in range(len(o.point_ids))]
    first = [n for n in seen[0] & seen[1] if inside[n] == 2 and o.point_ids[n] not in given]
    last = [n for n in seen[-1] & seen[-2] if inside[n] == 2 and o.point_ids[n] not in given]
    if not first or not last or set(first) & set(last):
        return None
    one, other = int(case.rng.choice(first)), int(case.rng.choice(last))
    changed = replace(o, point=np.where(o.point == other, one, o.point))
    return replace(case.inputs, observations=changed), frozenset({o.point_ids[one]})


def two_ids(case: Case) -> Planted | None:
    """Measure a point a second time under another id."""
    o = case.inputs.observations
    place = int(case.rng.integers(len(case.photos) - 1))
    both = set(o.point[rows_of(case, case.photos[place])]) & set(o.point[rows_of(case, case.photos[place + 1])])
    number = int(case.rng.choice(sorted(both)))
    rows = np.flatnonzero(o.point == number)
    noise = case.rng.normal(0.0, case.spec.image.sigma_um / 1000.0, (len(rows), 2))
    copy = replace(
        o,
        point_ids=(*o.point_ids, "again"),
        photo=np.r_[o.photo, o.photo[rows]],
        point=np.r_[o.point, np.full(len(rows), len(o.point_ids))],
        xy=np.r_[o.xy, o.xy[rows] + noise],
        sigma=np.r_[o.sigma, o.sigma[rows]],
    )
    return replace(case.inputs, observations=copy), frozenset({o.point_ids[number], "again"})


def same_id_in_two_strips(case: Case) -> Planted | None:
    """Give a point of one strip the id of a point of another, a quarter of a base away at least."""
    o, truth = case.inputs.observations, case.simulation.truth
    given = set(case.inputs.control.ids)
    rays, _ = rays_by_strip(case)
    free = np.array([name not in given for name in o.point_ids])
    ones, others = (np.flatnonzero(free & (rays[k] > 1) & (rays[1 - k] == 0)) for k in (0, 1))
    if not len(ones) or not len(others):
        return None
    one, other = int(case.rng.choice(ones)), int(case.rng.choice(others))
    places = [truth.points.xyz[truth.points.ids.index(o.point_ids[each])] for each in (one, other)]
    if np.linalg.norm(places[0] - places[1]) < case.spec.base / 4:
        return None
    changed = replace(o, point=np.where(o.point == other, one, o.point))
    return replace(case.inputs, observations=changed), frozenset({o.point_ids[one]})


def rays_by_strip(case: Case) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Count the rays (s, p) that each strip has of each point; in which strip each image point is."""
    o = case.inputs.observations
    strip_of = {photo: number for number, strip in enumerate(case.inputs.strips) for photo in strip.photos}
    owner = np.array([strip_of[photo] for photo in o.photo_ids])[o.photo]
    counts = [np.bincount(o.point[owner == k], minlength=len(o.point_ids)) for k in range(len(case.inputs.strips))]
    return np.array(counts), owner


def same_id_nearby(case: Case) -> Planted | None:
    """Take two ties of two strips, 0.2 to 1 % of the flying height apart, for one: each strip shows one of them."""
    o, truth, wanted = case.inputs.observations, case.simulation.truth, case.rng.uniform(0.002, 0.01)
    rays, owner = rays_by_strip(case)
    free = np.array([name in truth.points.ids and name not in case.inputs.control.ids for name in o.point_ids])
    ties = np.flatnonzero((rays > 1).all(axis=0) & free)
    places = np.array([truth.points.xyz[truth.points.ids.index(o.point_ids[each])] for each in ties])
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.diag(np.full(len(ties), np.inf))
    pair = np.unravel_index(int(np.abs(apart - wanted * case.spec.flying_height).argmin()), apart.shape)
    one, other = ties[list(pair)].tolist()
    keep = ~((o.point == one) & (owner == 1)) & ~((o.point == other) & (owner == 0))
    point = np.where(o.point == other, one, o.point)[keep]
    changed = replace(o, photo=o.photo[keep], point=point, xy=o.xy[keep], sigma=o.sigma[keep])
    return replace(case.inputs, observations=changed), frozenset({o.point_ids[one]})


def same_id_far_away(case: Case) -> Planted | None:
    """Give a point of the third strip the id of one of the first, which it does not overlap."""
    o, (rays, _) = case.inputs.observations, rays_by_strip(case)
    free = np.array([name not in case.inputs.control.ids for name in o.point_ids])
    ones = np.flatnonzero(free & (rays[0] > 1) & (rays[2] == 0))
    others = np.flatnonzero(free & (rays[2] > 1) & (rays[:2] == 0).all(axis=0))
    one, other = int(case.rng.choice(ones)), int(case.rng.choice(others))
    changed = replace(o, point=np.where(o.point == other, one, o.point))
    return replace(case.inputs, observations=changed), frozenset({o.point_ids[one]})


def sigma_of_given(case: Case) -> Planted | None:
    """State standard deviations of given points in millimetres."""
    return with_control(case, sigma=case.inputs.control.sigma * 1000.0), NOBODY


def lies_there(case: Case, crs: str) -> bool:
    """Whether the control lies in the area of a coordinate reference system, or less than half of it away."""
    from pyproj import CRS, Transformer

    area = CRS(crs).area_of_use
    control = case.inputs.control
    plan = control.enu[control.use[:, 0], :2]
    lon, lat = Transformer.from_crs(crs, CRS(crs).geodetic_crs, always_xy=True).transform(*plan.T)
    if area is None:
        return False
    wide, high = (area.east - area.west) / 2, (area.north - area.south) / 2
    inside = (lon > area.west - wide) & (lon < area.east + wide) & (lat > area.south - high) & (lat < area.north + high)
    return bool(inside.any())


def kept(case: Case, wanted: Callable[[Floats, Floats], NDArray[np.bool_]]) -> Planted | None:
    """Keep control where it is wanted, by its place along the strip (0 to 1) and across it (in bases)."""
    o, control = case.inputs.observations, case.inputs.control
    along, across = places(case)
    keep = control.check | wanted(along, across)
    inside = keep & ~control.check & control.use.all(axis=1) & np.isin(control.ids, o.point_ids)
    if inside.sum() < 3 or len(case.photos) < 6:
        return None
    return replace(case.inputs, control=control.take(keep & (control.check | inside))), NOBODY


def at_one_end(case: Case) -> Planted | None:
    """Keep control in the first third of the strip only."""
    return kept(case, lambda along, _: along < THIRD)


def on_one_line(case: Case) -> Planted | None:
    """Keep control along the flight only, within a twentieth of the half breadth of the strip."""
    format_ = case.spec.camera.format or (230.0, 230.0)
    half = 0.5 * format_[1] / 1000 * case.spec.scale / case.spec.base  # in bases
    return kept(case, lambda _, across: np.abs(across) < LINE * half)


def half_of_the_strip(case: Case) -> Planted | None:
    """Keep control in the first 55 % of the strip only."""
    return kept(case, lambda along, _: along < HALF)


# --------------------------------------------------------------------------------------------------- given angles


def with_angles(case: Case, read: Callable[[Floats], Floats], system: str) -> Inputs:
    """Give orientations whose angles were read in another way."""
    truth = case.simulation.truth
    spec = case.inputs.output or case.inputs.frames[0]
    values = read(angles(truth.rotations_local, "omega-phi-kappa"))
    nan = np.full((len(values), 3), np.nan)
    given = GivenOrientations(truth.photo_ids, spec, truth.centers_ground, values, system, nan, nan, observed=False)
    return replace(case.inputs, orientations=given)


def turned(case: Case, values: Floats, system: str) -> bool:
    """Whether angles are off by more than three times what noise turns photos by, and by more than harms a start."""
    steps = case.simulation.truth.rotations_local.transpose(0, 2, 1) @ from_angles(values, system)
    off = np.arccos(np.clip((np.trace(steps, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    noise = case.noise[1] / case.spec.base
    return bool(np.sqrt((off**2).mean()) > max(3.0 * noise, HARMLESS))


def angle_unit(case: Case) -> Planted | None:
    """Read gons as degrees, degrees as radians, and the like."""
    factor = float(case.rng.choice([200 / 180, 180 / 200, 180 / np.pi, np.pi / 180]))
    inputs = with_angles(case, lambda values: values * factor, "omega-phi-kappa")
    given = inputs.orientations
    if given is None or not turned(case, given.angles, given.system):
        return None
    return inputs, NOBODY


def angle_system(case: Case) -> Planted | None:
    """Read omega, phi, kappa as another system, or with another sense of kappa."""
    if case.spec.flight.attitude_sigma_deg[0] < 1.0:
        return None
    sense = case.rng.random() < EVEN
    read, system = ([1, 1, -1], "omega-phi-kappa") if sense else ([1, 1, 1], "alpha-omega-kappa")
    inputs = with_angles(case, lambda values: values * read, system)
    given = inputs.orientations
    if given is None or not turned(case, given.angles, given.system):
        return None
    return inputs, NOBODY


def with_positions(case: Case, change: Callable[[Floats], Floats]) -> Inputs | None:
    """Give positions of the cameras, changed."""
    if case.spec.ground.crs == "geocentric":
        return None
    truth, spec = case.simulation.truth, case.inputs.frames[0]
    enu = change(truth.centers_ground.copy())
    n = len(enu)
    given = CameraPositions(truth.photo_ids, spec, enu, np.ones((n, 3), bool), np.full((n, 3), 0.1), np.full(n, np.nan))
    return replace(case.inputs, positions=given)


def positions_below_ground(case: Case) -> Planted | None:
    """Give heights of the cameras below the ground, as of another vertical datum or counted downwards."""
    inputs = with_positions(case, lambda enu: enu - [0.0, 0.0, 1.2 * case.spec.flying_height])
    return None if inputs is None else (inputs, frozenset(case.photos))


def positions_in_feet(case: Case) -> Planted | None:
    """Give heights of the cameras in feet."""
    inputs = with_positions(case, lambda enu: enu / [1.0, 1.0, FOOT])
    return None if inputs is None else (inputs, frozenset(case.photos))


def one_position_high(case: Case) -> Planted | None:
    """Give one camera inside the strip a height that is off by half the flying height."""
    row = int(case.rng.integers(1, len(case.photos) - 1))
    step = 0.5 * case.spec.flying_height * float(case.rng.choice([-1, 1]))
    inputs = with_positions(case, lambda enu: enu + np.outer(np.arange(len(enu)) == row, [0.0, 0.0, step]))
    return None if inputs is None else (inputs, frozenset({case.simulation.truth.photo_ids[row]}))


def positions_shifted(case: Case) -> Planted | None:
    """Give all camera positions a common offset, as of another datum or of an antenna."""
    shift = case.rng.uniform(20.0, 60.0, 3) * case.rng.choice([-1, 1], 3) * max(*case.noise, 0.1)
    degrees = [1e-5, 1e-5, 1.0] if kind_of(case) == "geographic" else 1.0
    inputs = with_positions(case, lambda enu: enu + shift * degrees)
    return None if inputs is None else (inputs, NOBODY)


def positions_drifting(case: Case) -> Planted | None:
    """Let all camera positions drift from the first photo to the last."""
    shift = case.rng.uniform(40.0, 80.0, 3) * case.rng.choice([-1, 1], 3) * max(*case.noise, 0.1)
    degrees = [1e-5, 1e-5, 1.0] if kind_of(case) == "geographic" else 1.0
    inputs = with_positions(case, lambda enu: enu + np.linspace(0.0, 1.0, len(enu))[:, None] * shift * degrees)
    return None if inputs is None else (inputs, NOBODY)


def positions_exchanged(case: Case) -> Planted | None:
    """Exchange the positions of two neighbours."""
    row = int(case.rng.integers(len(case.photos) - 1))
    order = np.arange(len(case.photos))
    order[[row, row + 1]] = row + 1, row
    inputs = with_positions(case, lambda enu: enu[order])
    return None if inputs is None else (inputs, frozenset(case.simulation.truth.photo_ids[row : row + 2]))


# ------------------------------------------------------------------------------------------------------- the table


@dataclass(frozen=True)
class Mistake:
    """One kind of mistake: how it is planted, which codes tell it, and when it counts."""

    name: str
    plant: Callable[[Case], Planted | None]
    codes: tuple[str, ...]
    make: Callable[[int], Case] = sound
    adjustment: str | None = None  # None: what a simulated project asks for

    def settings(self, case: Case) -> Settings:
        """Give the settings of the run that must tell it."""
        return case.settings if self.adjustment is None else replace(case.settings, adjustment=self.adjustment)


MISTAKES = (
    Mistake("image coordinates in another unit", unit, ("P101",)),
    Mistake("ten times too large, no format", unit_without_format, ("P101",)),
    Mistake("a tenth of the principal distance, no format", distance_without_format, ("P101",)),
    Mistake("ten principal distances, no format", ten_distances_without_format, ("P101", "P105")),
    Mistake("one photo in another unit", unit_of_one, ("P102",)),
    Mistake("y down read as y up", y_down, ("P103", "P401")),
    Mistake("negatives read as positives", negatives, ("P103", "P401")),
    Mistake("x and y of the images exchanged", x_and_y, ("P103", "P401")),
    Mistake("one photo mirrored", one_mirrored, ("P104",)),
    Mistake("one photo shifted by 5 mm", one_shifted, ("P109",)),
    Mistake("one photo shifted by 5 mm, block", one_shifted, ("P109",), block),
    Mistake("one photo shifted by 5 mm, bundle", one_shifted, ("P109",), block, "bundle"),
    Mistake("fiducial marks in another unit", marks_in_micrometres, ("P106",)),
    Mistake("principal distance off by 10 or 1000", distance_by_ten, ("P105",)),
    Mistake("principal distance of another lens", distance, ("P105",)),
    Mistake("principal distance off by 1 to 3 %", distance_by_percents, ("P107", "P105")),
    Mistake("principal distance of one strip off by 10 %", distance_of_one_strip, ("P105",), block, "bundle"),
    Mistake("lens distortion that is not stated, bundle", lens, ("P110",), adjustment="bundle"),
    Mistake("film that shrank one way, bundle", film, ("P112",), adjustment="bundle"),
    Mistake("principal point elsewhere, bundle", principal_point, ("P111",), block, "bundle"),
    Mistake("two neighbours exchanged in the list", pair_exchanged, ("P201",)),
    Mistake("a photo listed elsewhere", moved, ("P201",)),
    Mistake("all photos out of order", shuffled, ("P201",)),
    Mistake("no overlap from one photo on", no_overlap, ("P202",)),
    Mistake("a photo twice", twice, ("P203",)),
    Mistake("a photo at another height", at_another_height, ("P205",)),
    Mistake("a photo left out of the list", photo_missing, ("P206",)),
    Mistake("given perspective centres below ground", positions_below_ground, ("P204",)),
    Mistake("their heights in feet", positions_in_feet, ("P205",)),
    Mistake("one given height off by half", one_position_high, ("P205",)),
    Mistake("two given positions exchanged", positions_exchanged, ("P206", "P207")),
    Mistake("camera positions off by a common offset", positions_shifted, ("P208",), sound, "bundle"),
    Mistake("camera positions that drift", positions_drifting, ("P208",), sound, "bundle"),
    Mistake("one id for two points", same_id, ("P301",)),
    Mistake("one id for two points of two strips", same_id_in_two_strips, ("P301",), block),
    Mistake("one id for two points of two strips, bundle", same_id_in_two_strips, ("P301",), block, "bundle"),
    Mistake("one id for two points nearby in two strips", same_id_nearby, ("P301", "P304"), with_ties(2)),
    Mistake("one id in strips that do not overlap", same_id_far_away, ("P301",), with_ties(3)),
    Mistake("two ids for one point", two_ids, ("P302",)),
    Mistake("ids of one photo in the next row", ids_in_the_next_row, ("P303",)),
    Mistake("points in another order on each photo", numbered_anew, ("P303",)),
    Mistake("axes of the control exchanged", axes_exchanged, ("P401", "P103")),
    Mistake("an axis of a local system backwards", left_handed, ("P401",)),
    Mistake("crs of another country", another_crs, ("P402",)),
    Mistake("control in feet (projected)", feet, ("P403",)),
    Mistake("control times 0.1 to 0.001 (projected)", lost_digits, ("P402",)),
    Mistake("one of two lists in feet", list_in_feet, ("P403",)),
    Mistake("one of two lists in another frame", list_in_another_frame, ("P407",)),
    Mistake("heights of two kinds in two lists", heights_of_another_kind, ("P404",)),
    Mistake("one of two lists in another frame, bundle", list_in_another_frame, ("P407",), block, "bundle"),
    Mistake("heights of two kinds in two lists, bundle", heights_of_another_kind, ("P404",), block, "bundle"),
    Mistake("heights of two kinds in one list", height_points_of_another_kind, ("P404",)),
    Mistake("heights counted downwards", heights_down, ("P401",)),
    Mistake("heights in feet, plan in metres", heights_in_feet, ("P405",)),
    Mistake("slip of a digit, control", lambda case: slip_of_a_digit(case, check=False), ("P406",)),
    Mistake("slip of a digit, check point", lambda case: slip_of_a_digit(case, check=True), ("P406",)),
    Mistake("a digit written twice", digit_too_many, ("P406",)),
    Mistake("slip of a digit, models", lambda case: slip_of_a_digit(case, check=False), ("P406",), of_models),
    Mistake("all check points shifted", checks_shifted, ("P411",)),
    Mistake("all check points shifted, bundle", checks_shifted, ("P411",), block, "bundle"),
    Mistake("all check points shifted, models", checks_shifted, ("P411",), of_models),
    Mistake("two control points exchanged", exchanged, ("P408",)),
    Mistake("slip of a digit, two others exchanged", slip_beside_exchanged, ("P406",)),
    Mistake("ids of given points in the next row", in_the_next_row, ("P409",)),
    Mistake("given points with coordinates of others", of_other_points, ("P409",)),
    Mistake("one given point in other columns", other_columns_of_one, ("P406",)),
    Mistake("row of a given point copied", row_copied, ("P410",)),
    Mistake("all heights zero", heights_of_nothing, ("P410",)),
    Mistake("heights in millimetres", heights_in_millimetres, ("P405",)),
    Mistake("standard deviation of images in micrometres", sigma_in_micrometres, ("P108",)),
    Mistake("standard deviation of control in millimetres", sigma_of_given, ("P108",)),
    Mistake("image coordinates from a corner", counted_from_a_corner, ("P101",)),
    Mistake("one photo from a corner", one_from_a_corner, ("P101",)),
    Mistake("control at one end", at_one_end, ("P501",)),
    Mistake("control on one line", on_one_line, ("P502",)),
    Mistake("control in one half", half_of_the_strip, ("P501", "P503")),
    Mistake("angles in another unit", angle_unit, ("P601",)),
    Mistake("angles in another system", angle_system, ("P602",)),
)


class Told(NamedTuple):
    """What `check` and `run` tell: codes with the ids that they name."""

    before: dict[str, set[str]]
    after: dict[str, set[str]]
    refusal: str  # why there is no result; nothing where there is one


def told(inputs: Inputs, settings: Settings) -> Told:
    """Say what `check` tells, and what `run` tells."""
    refusal = ""
    try:
        findings = triangulate(inputs, settings).findings
    except PhotostripError as error:
        findings, refusal = error.findings, str(error)
    try:
        before = gate.of_inputs(inputs, settings)
    except PhotostripError:
        before = ()
    return Told(by_code(before), by_code(findings), refusal)


def by_code(findings: Iterable[Finding]) -> dict[str, set[str]]:
    """Give the codes of findings with the ids that they name."""
    named: dict[str, set[str]] = {}
    for each in findings:
        named.setdefault(each.code, set()).update(each.names)
    return named


def is_found(named: dict[str, set[str]], mistake: Mistake, ids: frozenset[str]) -> bool:
    """Whether one of the codes was told and names what it must name."""
    return any(code in named and (not ids or ids & named[code]) for code in mistake.codes)


def false_alarms(strips: int, first: int, *, verbose: bool) -> None:
    """Examine strips without a mistake and print what was told."""
    alarms: Counter[str] = Counter()
    wrong = 0
    for seed in range(first, first + strips):
        case = sound(seed)
        found = told(case.inputs, case.settings)
        named = found.before | found.after
        wrong += bool(named)
        alarms.update(list(named))
        if named and verbose:
            print("  alarm", seed, named, case.spec)
    print(f"{strips} strips without a mistake: {wrong} with a finding, {100 * wrong / strips:.2f} %")
    for code, count in sorted(alarms.items()):
        print(f"  {code} {KINDS[code].title}: {count}")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    what = "strips of each mistake (100), strips without one (1000) and their first seed (0), words of mistakes' names"
    parser.add_argument("what", nargs="*", metavar="STRIPS SOUND SEED WORD", help=what)
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed before that of the first planted mistake")
    parser.add_argument("-v", action="store_true", dest="verbose", help="name every failure")
    asked = parser.parse_args()
    numbers = [int(each) for each in asked.what if each.isdecimal()]
    strips, without, first = (numbers + [100, 1000, 0][len(numbers) :])[:3]
    words = [each for each in asked.what if not each.isdecimal()]
    if without:
        false_alarms(without, first, verbose=asked.verbose)
    print(f"{'mistake':<44} {'code':<10} {'strips':>6} {'check':>7} {'run':>7}")
    for mistake in MISTAKES:
        if not words or any(each in mistake.name for each in words):
            row(mistake, strips, asked.first, verbose=asked.verbose)


def row(mistake: Mistake, strips: int, first: int, *, verbose: bool) -> None:
    """Plant one mistake in many strips and print how often it was found."""
    done, by_check, by_run, seed = 0, 0, 0, first
    while done < strips and seed < first + 12 * strips:
        seed += 1
        case = mistake.make(seed)
        planted = mistake.plant(case)
        if planted is None:
            continue
        inputs, ids = planted
        found = told(inputs, mistake.settings(case))
        done += 1
        by_check += is_found(found.before, mistake, ids)
        by_run += is_found(found.after, mistake, ids)
        if not is_found(found.after, mistake, ids) and verbose:
            print("  missed", seed, sorted(ids), found.after, case.spec)
    share = [f"{100 * each / max(done, 1):.1f} %" for each in (by_check, by_run)]
    print(f"{mistake.name:<44} {'/'.join(mistake.codes):<10} {done:>6} {share[0]:>7} {share[1]:>7}", flush=True)


if __name__ == "__main__":
    main()
