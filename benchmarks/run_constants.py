"""What some constants of a run are good for: each as it is, halved, doubled and taken out, on projects where it counts.

``GROWN``, from which a movement that is hardly determined is told; ``TURNED``, how well given rotations say what is
level in a start; ``HOPELESS``, when a pair is given up; ``MANY_OF_PHOTO``, from which lost points of a photo are told;
``FAR_FROM_RAY``, from which a ray that misses an approximate orientation begins outside.

Usage: python benchmarks/run_constants.py [PROJECTS] [--first N] [--only WORD ...]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from benchmarks import false_alarms, plausibility  # noqa: E402
from benchmarks.ablation import put  # noqa: E402
from photostrip.errors import PhotostripError  # noqa: E402
from photostrip.geometry.rotation import angles  # noqa: E402
from photostrip.network import defects  # noqa: E402
from photostrip.pipeline.block import datum, problem  # noqa: E402
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations, Inputs, Settings  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.points import locate  # noqa: E402
from photostrip.result import verdict  # noqa: E402
from photostrip.result.document import document_of  # noqa: E402
from photostrip.simulation import Control, Flight, GrossError, Ground, Points, Spec  # noqa: E402
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.strip.relative_orientation import solution  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from photostrip.pipeline.results import Result
    from photostrip.points import PointTable

BUNDLE = Settings(adjustment="bundle")
SIGMA = 0.1  # of camera positions, metres
WRONG = 0.3  # of the image points
RIGHT = 1.0  # metres rms
NEVER = float("inf")


class Project(NamedTuple):
    """A project as it is run."""

    name: str
    inputs: Inputs
    settings: Settings
    named: frozenset[str] = frozenset()  # photos that should be told of
    truth: PointTable | None = None


def positions_of(seed: int, spec: Spec, control: str, cameras: str) -> Inputs:
    """Give some coordinates of control and of noisy camera positions."""
    simulation, rng = simulate(replace(spec, seed=seed)), np.random.default_rng(seed)
    inputs, photos = inputs_of(simulation), simulation.truth.photo_ids
    points = inputs.control
    use = points.use & (points.check[:, None] | np.array([axis in control for axis in "xyz"]))
    points = replace(points, enu=np.where(use, points.enu, np.nan), use=use).take(use.any(axis=1))
    shape = (len(photos), 3)
    given = CameraPositions(
        photos=photos,
        frame=inputs.frames[0],
        enu=simulation.truth.centers_ground + rng.normal(0.0, SIGMA, shape),
        use=np.tile([axis in cameras for axis in "xyz"], (len(photos), 1)),
        sigma=np.full(shape, SIGMA),
        time=np.full(len(photos), np.nan),
    )
    return replace(inputs, control=points, positions=given)


def weakly_held(seeds: range) -> Iterator[Project]:
    """Make strips that nothing but camera positions, or their heights, hold level; and blocks that are well held."""
    straight = Spec(ground=Ground(crs="local"), flight=Flight(photos=6, position_sigma=(0.0, 0.0, 0.0)))
    for seed in seeds:
        yield Project("one straight strip", positions_of(seed, straight, "", "xyz"), BUNDLE)
        yield Project("plan and camera heights", positions_of(seed, straight, "xy", "z"), BUNDLE)
        block = replace(straight, flight=Flight(photos=5, strips=2), control=Control(bands=2))
        yield Project("two strips, plan and camera heights", positions_of(seed, block, "xy", "z"), BUNDLE)
        for name in ("blocks held by GNSS", "strips held by GNSS", "blocks by their control"):
            sound = false_alarms.LAYOUTS[name](seed)
            yield Project("sound", sound.inputs, replace(sound.settings, adjustment="bundle"))


def by_orientations(seeds: range) -> Iterator[Project]:
    """Make strips that nothing but their given orientations brings to the ground."""
    for seed in seeds:
        given = false_alarms.given_orientations(seed)
        bare = given.inputs.control.take(given.inputs.control.check)
        yield Project("orientations alone", replace(given.inputs, control=bare), BUNDLE)


def hopeless(seeds: range) -> Iterator[Project]:
    """Make a strip of 800 points a photo of which a third are wrong by 5 mm: three quarters of its pairs."""
    flight = Flight(photos=20, end_lap_percent=94.0)
    spec = Spec(seed=seeds[0], flight=flight, points=Points(rows=5, extra_per_model=60), control=Control(every=3))
    count = round(WRONG * len(simulate(spec).observations))
    wrong = simulate(replace(spec, gross_errors=(GrossError("image", count=count, size_um=5000.0),)))
    yield Project("a third wrong", inputs_of(wrong), Settings())


def half_a_pair(seeds: range) -> Iterator[Project]:
    """Make strips with approximate orientations and half of a pair's points wrong by up to 50 mm."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        simulation = simulate(Spec(seed=seed, flight=Flight(photos=6), points=Points(extra_per_model=8)))
        o, truth, pair = simulation.observations, simulation.truth, int(rng.integers(5))
        common = np.flatnonzero((o.photo == pair + 1) & np.isin(o.point, o.point[o.photo == pair]))
        wrong = rng.permutation(common)[: len(common) // 2]
        xy = o.xy.copy()
        xy[wrong] += rng.uniform(-50.0, 50.0, (len(wrong), 2))
        shape = (len(truth.photo_ids), 3)
        given = GivenOrientations(
            photos=truth.photo_ids,
            frame=simulation.frames[0],
            enu=truth.centers_ground + rng.normal(0.0, 20.0, shape),
            angles=angles(truth.rotations_local, "omega-phi-kappa") + rng.normal(0.0, 0.01, shape),
            system="omega-phi-kappa",
            sigma=np.full(shape, np.nan),
            sigma_angles=np.full(shape, np.nan),
            observed=False,
        )
        inputs = replace(inputs_of(simulation), observations=replace(o, xy=xy), orientations=given)
        yield Project("half of a pair wrong", inputs, BUNDLE, truth=truth.points)


def shifted(seeds: range) -> Iterator[Project]:
    """Make strips with one shifted photo, or some wrong measurements."""
    for seed in seeds:
        case = plausibility.sound(seed)
        method = false_alarms.METHODS[seed % len(false_alarms.METHODS)]
        inputs, named = plausibility.one_shifted(case) or (case.inputs, frozenset())
        yield Project("one photo shifted", inputs, replace(case.settings, adjustment=method), named)
        count = max(2, round(0.05 * len(case.inputs.observations)))
        wrong = simulate(replace(case.spec, gross_errors=(GrossError("image", count=count),)))
        yield Project("5 % wrong", inputs_of(wrong), replace(case.settings, adjustment=method))


def run(project: Project) -> Result | None:
    """Adjust a project; None where it is refused."""
    try:
        return triangulate(project.inputs, project.settings)
    except PhotostripError:
        return None


def weak_told(project: Project) -> str:
    """Say whether a movement is told that is hardly determined."""
    result = run(project)
    if result is None:
        return "refused"
    return "told" if any(note.code == "weak-datum" for note in result.notes) else "not told"


def done(project: Project) -> str:
    """Say whether there is a result, and where the truth is known whether its points are right."""
    result = run(project)
    if result is None:
        return "refused"
    if project.truth is None:
        return "done"
    names = [result.refined.observations.point_ids[number] for number in result.points.number]
    off = result.points.cartesian - project.truth.xyz[locate(names, project.truth.ids)]
    return "right" if np.sqrt((off**2).sum(axis=1).mean()) < RIGHT else "wrong"


def photo_told(project: Project) -> str:
    """Say whether the verdict tells how many points photos lost, and of which."""
    result = run(project)
    if result is None:
        return "refused"
    texts = [text for text in document_of(result)["verdict"]["look_at"] if "points were rejected" in text]
    if not texts:
        return "none told"
    own = any(f"photo {name}:" in text for name in project.named for text in texts)
    if not own:
        return "others told"
    first = texts[0].partition(":")[0].removeprefix("photo ")
    return "right one first" if first in project.named else "right one among them"


class Constant(NamedTuple):
    """A constant with what it is tried on."""

    home: str
    name: str
    values: tuple[object, ...]  # as it is first
    projects: Callable[[range], Iterator[Project]]
    outcome: Callable[[Project], str]


CONSTANTS = (
    Constant(defects.__name__, "GROWN", (4.0, 2.0, 8.0, 0.0, NEVER), weakly_held, weak_told),
    Constant(datum.__name__, "TURNED", (0.01, 0.005, 0.02, NEVER), by_orientations, done),
    Constant(problem.__name__, "FAR_FROM_RAY", (5.0, 2.5, 10.0, NEVER), half_a_pair, done),
    Constant(solution.__name__, "HOPELESS", ((12, 0.01), (6, 0.01), (24, 0.01), (30, 0.01)), hopeless, done),
    Constant(verdict.__name__, "MANY_OF_PHOTO", (0.2, 0.1, 0.4, 0.0, 1.0), shifted, photo_told),
)


def line(constant: Constant, seeds: range, value: object) -> str:
    """Run all projects with one value, and count what comes of them."""
    put(constant.home, constant.name, value)
    found: dict[str, Counter[str]] = {}
    spent = 0.0
    for project in constant.projects(seeds):
        begin = time.process_time()
        outcome = constant.outcome(project)
        spent += time.process_time() - begin
        found.setdefault(project.name, Counter())[outcome] += 1
    cells = "; ".join(
        f"{name}: {', '.join(f'{count} {what}' for what, count in sorted(counts.items()))}"
        for name, counts in found.items()
    )
    return f"{constant.name} = {value}: {cells}; {spent:.1f} s"


def main() -> None:
    """Print a line for every value of every constant."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("projects", type=int, nargs="?", default=10, help="of each kind (default 10)")
    parser.add_argument("--first", type=int, default=7_500_001)
    parser.add_argument("--only", nargs="+", default=("",), metavar="WORD", help="constants whose name has a word")
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.projects)
    for constant in CONSTANTS:
        if any(word in constant.name for word in asked.only):
            with get_context("fork").Pool(1, maxtasksperchild=1) as pool:
                for text in pool.imap(partial(line, constant, seeds), constant.values, chunksize=1):
                    print(text, flush=True)


if __name__ == "__main__":
    main()
