"""How often the gate finds a mistake where there is none, in every layout that the program can simulate or plan.

Run it as ``python benchmarks/false_alarms.py [--count N] [--first SEED] [-v] [words]``; words choose among the layouts,
``-v`` names every finding. Each row examines sound strips or blocks of one kind, ``check`` and ``run`` together, and
counts those with any finding; those of which no run can be made count no more. Where control itself is laid weakly
(at one end, on one line), that may be told.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from benchmarks import plausibility
from photostrip.errors import InputError, PhotostripError
from photostrip.geometry.rotation import angles, from_angles
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations
from photostrip.pipeline.plausibility import gate
from photostrip.pipeline.run import triangulate
from photostrip.points import locate
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
)
from photostrip.simulation.simulation import simulate
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.simulation.simulation import Simulation

    Rng = np.random.Generator

WIDE = plausibility.WIDE
WEAK = {"P501", "P502", "P503"}  # told of control that is weak indeed
ATTEMPTS = 20
METHODS = ("polynomial", "bundle")
FREE = ("principal_distance", "principal_point", "k1", "k2")
OBLIQUE_DEG = (15.0, 42.0)
SOME, HALF, MOST = 0.3, 0.5, 0.7
LEAST_COMMON = 6
EDGE = 112.0  # mm from the centre of a photo
SYSTEMATIC = 0.005  # mm, largest


@dataclass(frozen=True, eq=False)
class Sound:
    """A project without a mistake."""

    inputs: Inputs
    settings: Settings
    spec: Spec
    allowed: frozenset[str] = frozenset()


def made(rng: Rng, seed: int, draw: Callable[[Rng], Spec]) -> Simulation:
    """Simulate what is drawn; drawn again where so few points do not suffice."""
    for attempt in range(ATTEMPTS):
        spec = replace(draw(rng), seed=seed * ATTEMPTS + attempt)
        try:
            return simulate(spec)
        except InputError:
            continue
    raise SystemExit(f"nothing can be made of seed {seed}")


def base_spec(rng: Rng, photos: int, *, lap: tuple[float, float] = (57.0, 68.0)) -> Spec:
    """Draw camera, ground, terrain and measurement."""
    camera = plausibility.CAMERAS[rng.integers(len(plausibility.CAMERAS))]
    scale = float(np.exp(rng.uniform(np.log(3000), np.log(30000))))
    tilt, sigma = float(rng.choice([0.5, 1.0, 2.0])), float(rng.choice([3.0, 5.0, 8.0]))
    ground_sigma = float(rng.choice([0.5, 1.0, 2.0])) * sigma * 1e-6 * scale
    height = scale * camera.principal_distance / 1000.0
    return Spec(
        camera=camera,
        ground=plausibility.GROUNDS[rng.integers(4)],
        flight=Flight(
            photos=photos,
            end_lap_percent=float(rng.uniform(*lap)),
            scale=scale,
            heading_deg=float(rng.uniform(0, 360)),
            attitude_sigma_deg=(tilt, tilt, tilt),
        ),
        terrain=Terrain(relief=float(rng.choice([0.0, 0.03, 0.08])) * height),
        points=Points(rows=int(rng.choice([3, 5])), extra_per_model=int(rng.integers(4, 15))),
        control=Control(sigma=(ground_sigma, ground_sigma, 1.5 * ground_sigma)),
        image=Image(sigma_um=sigma),
    )


def sound_of(simulation: Simulation, adjustment: str, *, weak: bool = False) -> Sound:
    """Make the project of a simulation."""
    settings = replace(settings_of(simulation), adjustment=adjustment)
    return Sound(inputs_of(simulation), settings, simulation.spec, frozenset(WEAK if weak else ()))


def short(seed: int) -> Sound:
    """Make strips of 4 to 8 photos of all kinds, some with two wrong image coordinates."""
    case = plausibility.sound(seed + 700_000)
    return Sound(case.inputs, case.settings, case.spec)


def bands(low: int, high: int, method: str) -> Callable[[int], Sound]:
    """Make strips with bands every 3 to 20 models."""

    def make(seed: int) -> Sound:
        rng = np.random.default_rng([11, low, high, METHODS.index(method), seed])

        def draw(rng: Rng) -> Spec:
            photos = round(float(np.exp(rng.uniform(np.log(low), np.log(high + 0.4)))))
            spec = base_spec(rng, photos)
            control = replace(spec.control, every=int(rng.integers(3, 21)), per_band=int(rng.integers(2, 4)))
            return replace(spec, control=control)

        return sound_of(made(rng, seed, draw), method)

    return make


def layouts(seed: int) -> Sound:
    """Make strips of 6 to 40 photos with control in the corners or anywhere."""
    rng = np.random.default_rng([12, seed])

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(6, 41)))
        layout = str(rng.choice(["corners", "corners+centre", "random"]))
        return replace(spec, control=replace(spec.control, layout=layout, count=int(rng.integers(8, 20))))

    return sound_of(made(rng, seed, draw), str(rng.choice(METHODS)), weak=True)


def overlap(seed: int) -> Sound:
    """Make strips of 8 to 40 photos with an end lap of 75 to 85 %."""
    rng = np.random.default_rng([13, seed])

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(8, 41)), lap=(75.0, 85.0))
        return replace(spec, control=replace(spec.control, every=int(rng.integers(6, 21))))

    return sound_of(made(rng, seed, draw), str(rng.choice(METHODS)))


def in_block(rng: Rng) -> Spec:
    """Draw a block."""
    spec = base_spec(rng, int(rng.integers(5, 13)))
    flight = replace(
        spec.flight,
        strips=int(rng.integers(2, 6)),
        side_lap_percent=float(rng.choice([25.0, 60.0])),
        alternate=bool(rng.random() < HALF),
    )
    return replace(spec, flight=flight, points=replace(spec.points, rows=5), gnss=Gnss(use=True))


def with_gnss(simulation: Simulation) -> Inputs:
    """Give the inputs with the measured positions of the cameras."""
    inputs, enu = inputs_of(simulation), simulation.gnss
    if enu is None or simulation.spec.gnss is None:
        raise TypeError
    n = len(enu)
    positions = CameraPositions(
        photos=simulation.truth.photo_ids,
        frame=inputs.frames[0],
        enu=enu,
        use=np.ones((n, 3), bool),
        sigma=np.tile(simulation.spec.gnss.sigma, (n, 1)),
        time=np.full(n, np.nan),
    )
    return replace(inputs, positions=positions)


def at_corners(simulation: Simulation, inputs: Inputs) -> Inputs:
    """Keep control at the corners of the block only."""
    truth, control = simulation.truth, inputs.control
    xyz = truth.points.xyz[locate(control.ids, truth.points.ids)]
    d = truth.centers - truth.centers.mean(axis=0)
    axes = np.linalg.svd(d, full_matrices=False)[2][:2]
    uv = (xyz - truth.centers.mean(axis=0)) @ axes.T
    chosen = {int(np.argmin(uv @ [a, b] + 1e12 * control.check)) for a in (-1, 1) for b in (-1, 1)}
    keep = control.check.copy()
    keep[sorted(chosen)] = True
    return replace(inputs, control=control.take(keep))


def gnss_block(seed: int) -> Sound:
    """Make blocks held by camera positions, with control at the corners, in each strip, in one strip only, or none."""
    rng = np.random.default_rng([14, seed])
    simulation = made(rng, seed, in_block)
    inputs = with_gnss(simulation)
    kind = int(rng.integers(4))
    if kind == 1:
        inputs = at_corners(simulation, inputs)
    elif kind == 2:
        first = set(simulation.strips[0][1])
        shown = {
            simulation.observations.point_ids[p]
            for p, photo in zip(simulation.observations.point, simulation.observations.photo, strict=True)
            if simulation.observations.photo_ids[photo] in first
        }
        keep = [bool(c) or name in shown for name, c in zip(inputs.control.ids, inputs.control.check, strict=True)]
        inputs = replace(inputs, control=inputs.control.take(np.array(keep)))
    elif kind == 3:
        inputs = replace(inputs, control=inputs.control.take(inputs.control.check))
    return Sound(inputs, replace(settings_of(simulation), adjustment="bundle"), simulation.spec)


def gnss_strip(seed: int) -> Sound:
    """Make single strips of 8 to 60 photos held by camera positions and a control point or a band here and there."""
    rng = np.random.default_rng([15, seed])

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(8, 61)))
        layout = str(rng.choice(["corners", "random", "bands"]))
        control = replace(spec.control, layout=layout, bands=2, per_band=int(rng.integers(1, 4)), count=4)
        return replace(spec, gnss=Gnss(use=True), control=control)

    simulation = made(rng, seed, draw)
    # points at random may lie below the line of the cameras
    allowed = frozenset({"P502"} if simulation.spec.control.layout == "random" else ())
    return Sound(with_gnss(simulation), replace(settings_of(simulation), adjustment="bundle"), simulation.spec, allowed)


def plain_block(seed: int) -> Sound:
    """Make blocks without camera positions, control in each strip or in the corners and along the rim."""
    rng = np.random.default_rng([16, seed])
    simulation = made(rng, seed, lambda rng: replace(in_block(rng), gnss=None))
    method = str(rng.choice(METHODS))
    inputs = inputs_of(simulation)
    if method == "bundle" and rng.random() < HALF:
        inputs = at_corners(simulation, inputs)
    return Sound(inputs, replace(settings_of(simulation), adjustment=method), simulation.spec)


def models(seed: int) -> Sound:
    """Make strips of independent models of 4 to 60 photos."""
    rng = np.random.default_rng([17, seed])

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(4, 61)))
        kind = Models(centers=bool(rng.random() < MOST), axes=str(rng.choice(["level", "any"])))
        return replace(spec, models=kind, control=replace(spec.control, every=int(rng.integers(3, 21))))

    simulation = made(rng, seed, draw)
    return sound_of(simulation, str(rng.choice(["auto", "polynomial"])))


def oblique(seed: int) -> Sound:
    """Put cameras on a mount that looks 15 to 42 degrees aside, ahead or back."""
    rng = np.random.default_rng([18, seed])

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(5, 21)), lap=(62.0, 75.0))
        control = replace(spec.control, every=int(rng.integers(3, 11)))
        return replace(spec, camera=WIDE, points=Points(rows=5, extra_per_model=25), control=control)

    for attempt in range(ATTEMPTS):
        simulation = made(rng, seed + attempt, draw)
        inputs = aside(rng, inputs_of(simulation))
        if common_points(inputs) >= LEAST_COMMON:  # else it could not be run
            break
    settings = replace(settings_of(simulation), adjustment=str(rng.choice(METHODS)))
    return Sound(inputs, settings, simulation.spec, frozenset(WEAK))  # not all control is seen


def aside(rng: Rng, inputs: Inputs) -> Inputs:
    """Turn the cameras of vertical photos aside; what they do not see then is left out."""
    tilt = np.radians(rng.uniform(*OBLIQUE_DEG)) * rng.choice([-1.0, 1.0])
    turn = from_angles(np.array([[tilt, 0.0, 0.0] if rng.random() < MOST else [0.0, tilt, 0.0]]), "omega-phi-kappa")[0]
    focal = float(rng.choice([88.0, 120.0]))
    o = inputs.observations
    ray = np.column_stack([o.xy, np.full(len(o.xy), -inputs.strips[0].camera.principal_distance)]) @ turn
    xy = -focal * ray[:, :2] / ray[:, 2:]
    rows = np.flatnonzero((np.abs(xy) < EDGE).all(axis=1) & (ray[:, 2] < 0))
    kept = replace(o, photo=o.photo[rows], point=o.point[rows], xy=xy[rows], sigma=o.sigma[rows])
    camera = replace(inputs.strips[0].camera, principal_distance=focal)
    strips = tuple(replace(each, camera=camera) for each in inputs.strips)
    return replace(inputs, observations=kept, strips=strips)


def common_points(inputs: Inputs) -> int:
    """Count the points that two photos that follow each other have in common, at least."""
    o = inputs.observations
    on = [set(o.point[o.photo == o.photo_ids.index(photo)].tolist()) for photo in inputs.strips[0].photos]
    return min(len(one & other) for one, other in pairwise(on))


def calibrating(seed: int) -> Sound:
    """Make blocks held by camera positions and control whose camera is calibrated in the adjustment."""
    rng = np.random.default_rng([19, seed])
    simulation = made(rng, seed, in_block)
    inputs = with_gnss(simulation)
    camera = simulation.camera
    off = replace(camera, principal_distance=camera.principal_distance + float(rng.normal(0, 0.05)))
    inputs = replace(inputs, strips=tuple(replace(each, camera=off, calibrate=FREE) for each in inputs.strips))
    settings = replace(settings_of(simulation), adjustment="bundle")
    return Sound(inputs, settings, simulation.spec)


def systematic(seed: int) -> Sound:
    """Make strips and blocks whose images all have the same errors of up to 5 µm, which no model describes."""
    rng = np.random.default_rng([20, seed])

    def draw(rng: Rng) -> Spec:
        if rng.random() < SOME:
            return in_block(rng)
        spec = base_spec(rng, round(float(np.exp(rng.uniform(np.log(6), np.log(150))))))
        return replace(spec, control=replace(spec.control, every=int(rng.integers(3, 21))))

    simulation = made(rng, seed, draw)
    inputs = inputs_of(simulation) if simulation.gnss is None else with_gnss(simulation)
    o = inputs.observations
    wave, phase = rng.normal(0.0, 1.0, (2, 4, 2)) * np.pi / 115.0, rng.uniform(0, 2 * np.pi, (2, 4))
    shift = np.column_stack([np.sin(o.xy @ wave[axis].T + phase[axis]).sum(axis=1) for axis in (0, 1)])
    shift *= SYSTEMATIC / np.abs(shift).max()
    inputs = replace(inputs, observations=replace(o, xy=o.xy + shift))
    method = "bundle" if simulation.gnss is not None else str(rng.choice(METHODS))
    # what they move in common is a warning in its own right, not a mistake in a table
    allowed = frozenset({"P107", "P208"})
    return Sound(inputs, replace(settings_of(simulation), adjustment=method), simulation.spec, allowed)


def film(seed: int) -> Sound:
    """Make strips of film with fiducial marks, irregular shrinkage, refraction."""
    rng = np.random.default_rng([21, seed])

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(5, 31)))
        return replace(
            spec,
            camera=FILM,
            film=Film(irregular_um=float(rng.choice([0.0, 3.0, 6.0]))),
            refraction=bool(rng.random() < HALF),
            control=replace(spec.control, every=int(rng.integers(3, 16))),
        )

    return sound_of(made(rng, seed, draw), str(rng.choice(METHODS)))


def two_lists(seed: int) -> Sound:
    """Make strips over the border of two zones, with a list of control on either side."""
    rng = np.random.default_rng([22, seed])
    zones = (("EPSG:32633", "EPSG:32634", 18.0, 49.0), ("EPSG:28404", "EPSG:28405", 24.0, 42.5),
             ("EPSG:31467", "EPSG:31468", 10.5, 51.0), ("EPSG:25832", "EPSG:25833", 12.0, 53.0))  # fmt: skip
    crs, second, border, north = zones[rng.integers(len(zones))]

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(8, 31)))
        return replace(
            spec,
            ground=Ground(crs, center_deg=(border, north)),
            flight=replace(spec.flight, heading_deg=90.0),
            control=replace(
                spec.control, every=int(rng.integers(3, 8)), second_crs=second, boundary_longitude_deg=border
            ),
        )

    return sound_of(made(rng, seed, draw), str(rng.choice(METHODS)))


def given_orientations(seed: int) -> Sound:
    """Make strips whose orientations are given, as observations or as a start that is off by up to 500 m."""
    rng = np.random.default_rng([23, seed])

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, int(rng.integers(5, 25)))
        return replace(spec, control=replace(spec.control, every=int(rng.integers(3, 11))))

    simulation = made(rng, seed, draw)
    inputs, truth = inputs_of(simulation), simulation.truth
    values = angles(truth.rotations_local, "omega-phi-kappa")
    observed = bool(rng.random() < HALF)
    n, off = len(values), 0.3 if observed else float(rng.choice([20.0, 100.0, 500.0]))
    enu = truth.centers_ground + rng.normal(0.0, off, (n, 3))
    noise = 1e-4 if observed else float(rng.choice([0.01, 0.05]))
    values = values + rng.normal(0.0, noise, (n, 3))
    known = (np.full((n, 3), off), np.full((n, 3), noise)) if observed else (np.full((n, 3), np.nan),) * 2
    given = GivenOrientations(
        photos=truth.photo_ids, frame=inputs.frames[0], enu=enu, angles=values, system="omega-phi-kappa",
        sigma=known[0], sigma_angles=known[1], observed=observed,
    )  # fmt: skip
    settings = replace(settings_of(simulation), adjustment="bundle")
    return Sound(replace(inputs, orientations=given), settings, simulation.spec)


def dense(seed: int) -> Sound:
    """Make strips and blocks with hundreds of points on a photo, as matching gives them."""
    rng = np.random.default_rng([24, seed])

    def draw(rng: Rng) -> Spec:
        spec = in_block(rng)
        flight = replace(spec.flight, strips=int(rng.integers(1, 4)), end_lap_percent=float(rng.uniform(60, 82)))
        points = Points(rows=5, extra_per_model=int(rng.integers(60, 250)))
        return replace(spec, camera=DIGITAL, flight=flight, points=points)

    return sound_of(made(rng, seed, draw), "bundle")


def wrong_images(seed: int) -> Sound:
    """Make blocks of two strips with eight image coordinates that are wrong by up to a millimetre along the base."""
    size = float(np.random.default_rng([26, seed]).uniform(100, 1000))
    spec = plausibility.with_ties(2)(seed).spec
    simulation = simulate(replace(spec, gross_errors=(GrossError("image", count=8, size_um=size, axis="x"),)))
    return Sound(inputs_of(simulation), settings_of(simulation), simulation.spec, frozenset({"P304"}))


def large_block(seed: int) -> Sound:
    """Make blocks of ten strips of forty photos, held by GNSS and control in the corners."""
    rng = np.random.default_rng([25, seed])

    def draw(rng: Rng) -> Spec:
        spec = in_block(rng)
        return replace(spec, flight=replace(spec.flight, photos=40, strips=10, side_lap_percent=30.0))

    simulation = made(rng, seed, draw)
    inputs = at_corners(simulation, with_gnss(simulation))
    return Sound(inputs, replace(settings_of(simulation), adjustment="bundle"), simulation.spec)


LAYOUTS: dict[str, Callable[[int], Sound]] = {
    "strips of 4-8 photos": short,
    "6-60 photos, bands every 3-20, polynomial": bands(6, 60, "polynomial"),
    "6-60 photos, bands every 3-20, bundle": bands(6, 60, "bundle"),
    "60-300 photos, bands every 3-20, polynomial": bands(60, 300, "polynomial"),
    "60-300 photos, bands every 3-20, bundle": bands(60, 300, "bundle"),
    "corners, centre, random": layouts,
    "end lap of 75-85 %": overlap,
    "blocks held by GNSS": gnss_block,
    "strips held by GNSS": gnss_strip,
    "blocks by their control": plain_block,
    "independent models": models,
    "oblique mounts": oblique,
    "self-calibration": calibrating,
    "systematic errors of 5 µm": systematic,
    "film with fiducial marks": film,
    "two lists in two zones": two_lists,
    "given orientations": given_orientations,
    "dense points": dense,
    "blocks with wrong image coordinates": wrong_images,
    "GNSS blocks of 10 strips of 40 photos": large_block,
}


def examine(sound: Sound) -> tuple[dict[str, set[str]], str]:
    """Find codes with the ids that they name, and why there is no result, where there is none."""
    told = plausibility.told(sound.inputs, sound.settings)
    named = {code: told.before.get(code, set()) | told.after.get(code, set()) for code in told.before | told.after}
    return {code: ids for code, ids in named.items() if code not in sound.allowed}, told.refusal


def shares(name: str, make: Callable[[int], Sound], seeds: range) -> None:
    """Print what share of the processor time of its runs the gate takes in a layout, and the longest gate."""
    spent = whole = longest = 0.0
    examine_result = gate.of_result

    def timed(*given: Any) -> tuple[Finding, ...]:  # noqa: ANN401
        nonlocal spent, longest
        begin = time.process_time()
        found = examine_result(*given)
        taken = time.process_time() - begin
        spent, longest = spent + taken, max(longest, taken)
        return found

    with patch.object(gate, "of_result", timed):
        for seed in seeds:
            sound = make(seed)
            begin = time.process_time()
            with suppress(PhotostripError):
                triangulate(sound.inputs, sound.settings)
            whole += time.process_time() - begin
    run = whole / len(seeds)
    print(f"{name:<46} {run:6.3f} {spent / len(seeds):6.3f} {100 * spent / whole:5.1f} % {longest:6.3f}", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("-v", action="store_true", dest="verbose")
    parser.add_argument("words", nargs="*")
    parser.add_argument("--shares", action="store_true", help="the gate's share of the seconds of a run instead")
    asked = parser.parse_args()
    if asked.shares:
        print(f"{'layout':<46} {'run s':>6} {'gate s':>6} {'share':>7} {'most s':>6}")
        for name, make in LAYOUTS.items():
            if not asked.words or any(word in name for word in asked.words):
                shares(name, make, range(asked.first, asked.first + asked.count))
        return
    done = wrong = 0
    print(f"{'layout':<46} {'sound':>5} {'alarms':>6}  codes")
    for name, make in LAYOUTS.items():
        if asked.words and not any(word in name for word in asked.words):
            continue
        codes: Counter[str] = Counter()
        alarms = refused = 0
        for seed in range(asked.first, asked.first + asked.count):
            sound = make(seed)
            named, refusal = examine(sound)
            if refusal:  # a project that cannot be run is not sound
                refused += 1
                if asked.verbose:
                    print(f"  {name}, seed {seed} cannot be run: {refusal}")
                continue
            alarms += bool(named)
            codes.update(list(named))
            if named and asked.verbose:
                print(f"  alarm {name}, seed {seed}: {named}\n    {sound.settings.adjustment} {sound.spec}")
        sound_ones = asked.count - refused
        done, wrong = done + sound_ones, wrong + alarms
        told = ", ".join(f"{code} {count}" for code, count in sorted(codes.items()))
        print(f"{name:<46} {sound_ones:>5} {alarms:>6}  {told}", flush=True)
    print(f"{'all':<46} {done:>5} {wrong:>6}  {100 * wrong / max(done, 1):.2f} %")


if __name__ == "__main__":
    main()
