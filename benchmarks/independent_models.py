"""Independent models against the same strips by image coordinates, precision against repetitions, gross errors.

Run it as ``python benchmarks/independent_models.py [--strips N] [--repetitions N]``. Every simulated strip is adjusted
three times: by its image coordinates; as independent models that are made of the same image coordinates, each pair
oriented and intersected by itself and then laid into a system of its own; and as models of a plotter, whose coordinates
carry errors that do not depend on each other, as large as those of the models made of images.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from photostrip.geometry.rotation import from_vector  # noqa: E402
from photostrip.network.settings import BundleSettings  # noqa: E402
from photostrip.pipeline.inputs import Inputs, MeasuredModels, ModelStrip, Settings  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.pipeline.strips.models import form_models  # noqa: E402
from photostrip.points import ModelPoints, PhotoPoints  # noqa: E402
from photostrip.simulation import Control, Flight, Image, Models, Points, Simulation, Spec, simulate  # noqa: E402
from photostrip.strip.independent_models.settings import LinkSettings  # noqa: E402
from photostrip.strip.relative_orientation.orientation import orient_unchecked  # noqa: E402
from photostrip.strip.relative_orientation.pairs import collect_pairs  # noqa: E402
from photostrip.strip.strip_formation.strip import model_points  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

IMAGE_UM = 5.0
BASE, DEPTH = 87.4, 153.0  # mm at photo scale, of the simulated strips
SIZES = (2.0, 5.0, 10.0, 50.0, 1000.0)  # of a gross error, in standard deviations
PLOTTED = (IMAGE_UM, IMAGE_UM, IMAGE_UM * 2.0**0.5 * DEPTH / BASE)  # a point of one pair of photos


def spec_of(photos: int, seed: int, models: Models | None = None) -> Spec:
    """Give a strip with three bands of control."""
    return Spec(
        seed=seed,
        flight=Flight(photos=photos, end_lap_percent=62.0),
        points=Points(extra_per_model=4),
        control=Control(bands=3, per_band=3),
        image=Image(sigma_um=IMAGE_UM),
        models=models,
    )


def models_of_images(simulation: Simulation, rng: np.random.Generator) -> Inputs:
    """Independent models made of image coordinates: each pair by itself, in any system."""
    (name, photos), observations = simulation.strips[0], simulation.observations
    pairs = collect_pairs(observations, photos, simulation.camera.principal_distance)
    oriented, _ = orient_unchecked(pairs)
    stereo = model_points(oriented)
    base, _ = oriented.relative
    points = len(observations.point_ids)
    model, node, xyz = [], [], []
    for k in range(len(photos) - 1):
        rows = np.flatnonzero((oriented.pairs.pair == k) & stereo.sound)
        here = BASE * np.concatenate([stereo.vectors[rows], [np.zeros(3)], [base[k]]])
        turn, scale, shift = from_vector(rng.normal(0, 1.5, 3)), np.exp(rng.normal(0, 0.2)), rng.normal(0, 300, 3)
        xyz.append(scale * here @ turn.T + shift)
        model += [k] * len(here)
        node += [*pairs.point[rows].tolist(), points + k, points + k + 1]
    names = tuple(f"M{k + 1}" for k in range(len(photos) - 1))
    sigma = np.tile(np.array(PLOTTED).max() / 1000, (len(node), 3))  # in axes that lie any way
    table = ModelPoints(
        names, observations.point_ids, photos, np.array(model), np.array(node), np.concatenate(xyz), sigma
    )
    nothing = np.zeros(0, np.intp)
    named = PhotoPoints((), table.point_ids, nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2)))
    plain = inputs_of(simulation)
    measured = MeasuredModels((ModelStrip(name, photos, names),), table)
    return replace(plain, strips=(), observations=named, models=measured)


def errors_of(given: Inputs, simulation: Simulation, settings: Settings) -> Floats:
    """Errors of the points that are not control, in plan and height, metres."""
    result = triangulate(given, settings)
    place = {name: row for row, name in enumerate(simulation.truth.points.ids)}
    names = [result.refined.observations.point_ids[number] for number in result.points.number]
    off = result.points.cartesian - simulation.truth.points.xyz[[place[name] for name in names]]
    level = np.einsum("nij,nj->ni", result.output.level_axes_at(result.points.cartesian), off)
    new = np.array([role != "control" for role in result.roles])
    return np.column_stack([np.hypot(level[new, 0], level[new, 1]) / np.sqrt(2), np.abs(level[new, 2])])


def accuracy(strips: int) -> None:
    """Print the errors of the three ways, in micrometres at photo scale."""
    print("| models | adjustment | images, plan / height | models of these images | plotter | models / images |")
    print("|---|---|---|---|---|---|")
    for models in (6, 12, 20):
        for adjustment in ("polynomial", "bundle"):
            settings = Settings(adjustment=adjustment, precision=False)
            found: list[list[Floats]] = [[], [], []]
            for seed in range(strips):
                images = simulate(spec_of(models + 1, seed))
                found[0].append(errors_of(inputs_of(images), images, settings))
                given = models_of_images(images, np.random.default_rng(seed))
                found[1].append(errors_of(given, images, settings))
                plotted = simulate(spec_of(models + 1, seed, Models(sigma_um=PLOTTED, center_sigma_um=PLOTTED)))
                found[2].append(errors_of(inputs_of(plotted), plotted, settings))
            scale = spec_of(models + 1, 0).scale / 1e6
            size = [np.sqrt((np.concatenate(each) ** 2).mean(axis=0)) / scale for each in found]
            cells = " | ".join(f"{plan:.1f} / {height:.1f}" for plan, height in size)
            ratio = " / ".join(f"{value:.2f}" for value in size[1] / size[0])
            print(f"| {models} | {adjustment} | {cells} | {ratio} |")


def control_bands(strips: int) -> None:
    """Print errors of the network over those of polynomials at the check points of 24 models, by bands of control."""
    print("| bands | east | north | height |")
    print("|---|---|---|---|")
    for bands in (3, 5, 9):
        off: dict[str, list[Floats]] = {"bundle": [], "polynomial": []}
        for seed in range(101, 101 + strips):
            spec = Spec(seed=seed, flight=Flight(photos=25), control=Control(bands=bands), models=Models())
            given = inputs_of(simulate(spec))
            for adjustment, differences in off.items():
                result = triangulate(given, Settings(adjustment=adjustment, precision=False))
                differences.append(result.control_differences[given.control.check])
        network, polynomial = (np.sqrt(np.nanmean(np.concatenate(each) ** 2, axis=0)) for each in off.values())
        print(f"| {bands} | " + " | ".join(f"{ratio:.2f}" for ratio in network / polynomial) + " |")


def precision(repetitions: int) -> None:
    """Print the scatter of repeated measurements over the standard deviations that are stated."""
    print("| models | points, mean (least to largest) | centers, mean (least to largest) |")
    print("|---|---|---|")
    settings = Settings("bundle", bundle=BundleSettings(test="baarda"), links=LinkSettings("none"))
    for models in (3, 8):
        ratios = scatter(models, settings, repetitions)
        cells = " | ".join(f"{r.mean():.3f} ({r.min():.2f} to {r.max():.2f})" for r in ratios)
        print(f"| {models} | {cells} |")


def scatter(models: int, settings: Settings, repetitions: int) -> list[Floats]:
    """Scatter over stated standard deviation, of every coordinate of points and of centres."""
    simulation = simulate(spec_of(models + 1, 1, Models()))
    given, rng = inputs_of(simulation), np.random.default_rng(1)
    assert given.models is not None  # noqa: S101
    points, control = given.models.points, given.control
    exact = inputs_of(simulate(spec_of(models + 1, 1, Models((0, 0, 0), (0, 0, 0)))))
    assert exact.models is not None  # noqa: S101
    whole = triangulate(given, settings)
    assert whole.precision is not None  # noqa: S101
    places: list[list[Floats]] = [[], []]
    for _ in range(repetitions):
        measured = replace(points, xyz=exact.models.points.xyz + points.sigma * rng.normal(size=points.xyz.shape))
        moved = replace(control, enu=control.enu + control.sigma * rng.normal(size=control.enu.shape))
        again = replace(given, control=moved, models=replace(given.models, points=measured))
        found = triangulate(again, replace(settings, precision=False))
        (strip,) = found.strips
        places[0].append(found.points.cartesian)
        places[1].append(strip.intermediate.cartesian_from_intermediate(strip.centers))
    stated = [whole.precision.points, whole.precision.photos[0][:, :3, :3]]
    return [
        np.std(place, axis=0, ddof=1) / np.sqrt(np.diagonal(each, axis1=1, axis2=2))
        for place, each in zip(places, stated, strict=True)
    ]


def gross_errors(strips: int) -> None:
    """Print how often a wrong coordinate of a common point is found, named alone, and how often a good one is lost."""
    print("| gross error, sigma | found | found, and nothing else | rejected without errors, of links |")
    print("|---|---|---|---|")
    settings = Settings()
    for size in SIZES:
        found = alone = lost = links = 0
        for seed in range(strips):
            given = inputs_of(simulate(spec_of(9, seed, Models())))
            assert given.models is not None  # noqa: S101
            points, (strip,) = given.models.points, given.models.strips
            rng = np.random.default_rng(seed)
            twice = np.flatnonzero((np.bincount(points.node)[points.node] == 2) & (points.node < len(points.point_ids)))
            row = int(rng.choice(twice))
            xyz = points.xyz.copy()
            xyz[row, rng.integers(3)] += size * points.sigma[row].max() * rng.choice([-1.0, 1.0])
            formed = form_models(strip, replace(points, xyz=xyz), settings)
            gone = [int(formed.models.node[formed.links.shared.before[each.row]]) for each in formed.links.rejections]
            found += int(points.node[row]) in gone
            alone += gone == [int(points.node[row])]
            clean = form_models(strip, points, settings)
            lost += len({int(clean.links.shared.link[each.row]) for each in clean.links.rejections})
            links += clean.links.shared.count
        print(
            f"| {size:g} | {100 * found / strips:.0f} % | {100 * alone / strips:.0f} % | {100 * lost / links:.1f} % |"
        )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--strips", type=int, default=40)
    parser.add_argument("--repetitions", type=int, default=500)
    options = parser.parse_args()
    print(f"Errors of new and check points, µm at photo scale, {options.strips} strips\n")
    accuracy(options.strips)
    print(f"\nNetwork over polynomials at check points, {options.strips} strips of 24 models from plotters\n")
    control_bands(options.strips)
    print(f"\nScatter of {options.repetitions} repetitions over the standard deviations stated\n")
    precision(options.repetitions)
    print(f"\nGross errors in links, {5 * options.strips} strips of 8 models\n")
    gross_errors(5 * options.strips)


if __name__ == "__main__":
    main()
