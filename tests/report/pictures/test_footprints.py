"""Footprints lie on the ground of a simulation, whose shape is known everywhere."""

from __future__ import annotations

import copy
import math
import re
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.report.pictures.ground.footprints import footprint_pictures
from photostrip.report.pictures.ground.plan_view import plan_of
from photostrip.report.pictures.ground.terrain import footprints, straightened
from photostrip.result.quantities import MATRIX
from photostrip.simulation.ground import surface
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Ground, Image, Spec, Terrain
from tests.loops import nonempty
from tests.results import Document, by_rows, in_tables, rotation, solved
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.simulation.simulation import Simulation

pytestmark = pytest.mark.usefixtures("_no_findings")

SIDE = 2300.0  # of a photo on the ground, m
DISTANCE = 153.0


@cache
def flown(terrain: Terrain, seed: int = 1, sigma_um: float = 5.0) -> tuple[Simulation, Document]:
    """Fly two strips to the east over a flat world."""
    spec = Spec(
        seed=seed,
        ground=Ground("local"),
        flight=Flight(photos=5, strips=2, end_lap_percent=70.0, side_lap_percent=40.0),
        terrain=terrain,
        control=Control(check=4),
        image=Image(sigma_um),
    )
    simulation = simulate(spec)
    return simulation, by_rows(solved(inputs_of(simulation)).document)


def on_ground(document: Document) -> dict[str, NDArray[np.float64]]:
    """Return the footprints as east and north."""
    document = in_tables(document)
    plan = plan_of(document)
    first = document["photos"][0]
    cosine, sine = (plan.turned(1.0, 0.0)[0], plan.turned(0.0, 1.0)[0])
    return {
        photo: np.array(outline) @ np.array([[cosine, sine], [-sine, cosine]]) + (first["x"], first["y"])
        for photo, outline in footprints(document, plan).items()
    }


def borders(simulation: Simulation) -> dict[str, NDArray[np.float64]]:
    """Return where the borders of the true photos meet the true ground, looked for along each ray."""
    heights, truth, found = surface(simulation.spec), simulation.truth, {}
    along = np.linspace(-0.5, 0.5, 5)[:-1]
    side = np.stack([along, np.full(4, -0.5)], axis=1)
    quarter = np.array([[0.0, 1.0], [-1.0, 0.0]])
    frame = 230.0 * np.concatenate([side @ np.linalg.matrix_power(quarter, n) for n in range(4)])
    for photo, centre, turn in zip(truth.photo_ids, truth.centers, truth.rotations, strict=True):
        rays = np.column_stack([frame, np.full(len(frame), -DISTANCE)]) @ turn.T
        scale = np.linspace(0.3, 2.0, 4000)[:, None, None] * (centre[2] - heights.height) / DISTANCE
        places = centre + scale * rays
        below = places[..., 2] <= heights(places[..., 0], places[..., 1])
        assert below.any(axis=0).all()
        found[photo] = places[below.argmax(axis=0), np.arange(len(frame)), :2]
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("terrain", "allowed", "level"),
    [
        (Terrain(relief=60.0), 0.6, 0.8),
        (Terrain(relief=200.0), 1.9, 2.6),
        (Terrain(slope_percent=(10.0, 15.0)), 0.9, 7.0),
    ],
)
def test_borders_of_photos_lie_on_the_ground(terrain: Terrain, allowed: float, level: float) -> None:
    """Rms in percent of the side of a photo; on level ground it is at least ``level``."""
    errors, others = [], []
    simulation, document = flown(terrain, 1)
    points = {point["id"]: point["z"] for point in document["points"]}
    seen: dict[str, list[float]] = {}
    for row in document["residuals"]:
        seen.setdefault(row["photo"], []).append(points[row["point"]])
    true, found = borders(simulation), on_ground(document)
    assert set(found) == set(true)
    for photo in nonempty(document["photos"]):
        nearest = found[photo["id"]][:, None] - true[photo["id"]]
        order = np.linalg.norm(nearest, axis=2).argmin(axis=1)
        assert sorted(order) == list(range(16))
        errors.append(np.linalg.norm(nearest[np.arange(16), order], axis=1))
        centre = np.array([photo["x"], photo["y"]])
        frame = np.array(found[photo["id"]]) - centre
        assert np.isfinite(frame).all()
        mean = float(np.mean(seen[photo["id"]]))
        row = simulation.truth.photo_ids.index(photo["id"])
        at = surface(simulation.spec)(*true[photo["id"]].T)
        height = simulation.truth.centers[row, 2]
        others.append(np.linalg.norm(true[photo["id"]] - centre, axis=1) * abs((height - mean) / (height - at) - 1))
    rms = [100.0 * math.sqrt(np.mean(np.concatenate(sizes) ** 2)) / SIDE for sizes in (errors, others)]
    assert rms[0] < allowed
    assert rms[1] > level


def turned(document: Document, number: int, degrees: float) -> Document:
    """Return a result one of whose photos looks up to the left by an angle."""
    made = copy.deepcopy(document)
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    made["photos"][number].update(zip(MATRIX, [1, 0, 0, 0, cosine, -sine, 0, sine, cosine], strict=True))
    return made


@pytest.mark.parametrize("tilt", [0.0, 30.0, 45.0, 60.0, 85.0])
def test_oblique_photos_show_the_ground_before_the_horizon(tilt: float) -> None:
    _, document = flown(Terrain(relief=0.0), sigma_um=0.0)
    made = turned(document, 2, tilt)
    photo = made["photos"][2]
    way = np.array([[*place, 300.0] for place in on_ground(made)[photo["id"]]]) - [photo[axis] for axis in "xyz"]
    image = way @ rotation(photo)
    image = -DISTANCE * image[:, :2] / image[:, 2:]
    steep = -way[:, 2] / np.linalg.norm(way, axis=1)
    # the upper border, unless rays of it do not come down: then the line below the horizon
    limit = DISTANCE * (math.cos(math.radians(tilt)) - 0.1) / math.sin(math.radians(tilt)) if tilt else math.inf
    top = min(115.0, limit)
    for x, y in nonempty(image.tolist()):
        borders = abs(abs(x) - 115.0), abs(y + 115.0), abs(y - top)
        assert min(borders) < 0.02  # mm
        assert -115.02 < y < top + 0.02
    assert image[:, 1].max() == pytest.approx(top, abs=0.02)
    assert steep.min() > 0.05


def test_photos_that_show_no_ground_have_no_footprint() -> None:
    _, document = flown(Terrain(relief=0.0), sigma_um=0.0)
    photo = document["photos"][2]["id"]
    whole = set(on_ground(document))
    assert set(on_ground(turned(document, 2, 140.0))) == whole - {photo}
    below = copy.deepcopy(document)
    below["photos"][2]["z"] = 250.0
    assert set(on_ground(below)) == whole - {photo}
    without = copy.deepcopy(document)
    without["residuals"] = [row for row in document["residuals"] if row["photo"] != photo]
    assert set(on_ground(without)) == whole - {photo}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_points_tell_of_the_height(count: int) -> None:
    _, document = flown(Terrain(relief=60.0))
    made = copy.deepcopy(document)
    third = made["photos"][2]["id"]
    kept = [row["point"] for row in made["residuals"] if row["photo"] == third][:count]
    made["points"] = [point for point in made["points"] if point["id"] in kept]
    found = on_ground(made)
    assert third in found
    for photo, outline in nonempty(found.items()):
        extent = np.ptp(outline, axis=0)
        assert extent == pytest.approx((SIDE, SIDE), rel=0.1), photo  # hills of 60 m from 1530 m, tilts of 1 degree


def test_the_overlap_is_counted_within_the_outlines() -> None:
    """Photos one above the other show all their ground twice."""
    _, document = flown(Terrain(relief=60.0))
    made = copy.deepcopy(document)
    first = made["photos"][0]
    made["photos"] = [first, first | {"id": "again"}, *made["photos"][1:]]
    made["residuals"] += [row | {"photo": "again"} for row in made["residuals"] if row["photo"] == first["id"]]
    made["photos"], made["strips"] = made["photos"][:2], made["strips"][:1]
    made = in_tables(made)
    drawn = footprint_pictures(made, plan_of(made))[0].svg
    assert 'class="overlap overlap-2"' in drawn
    assert drawn.count('class="overlap overlap-1"') == 1  # of the legend


def test_straight_sides_lose_their_corners() -> None:
    square = [(0.0, 0.0), (5.0, 0.2), (10.0, 0.0), (10.0, 10.0), (4.0, 8.0), (0.0, 10.0)]
    assert straightened(square, 0.5) == [square[0], *square[2:]]


def test_ids_stand_in_footprints_that_have_room_for_them() -> None:
    _, document = flown(Terrain(relief=0.0))
    shown = in_tables(document)
    (picture,) = footprint_pictures(shown, plan_of(shown))
    assert len(re.findall(r'class="label id"', picture.svg)) == len(document["photos"])
    assert 'class="outline"' in picture.svg
    longer = copy.deepcopy(dict(document))
    for photo in longer["photos"]:  # as wide as the id is long
        photo["id"] = "p" * 60 + photo["id"]
    for row in longer["residuals"]:
        row["photo"] = "p" * 60 + row["photo"]
    shown = in_tables(longer)
    (picture,) = footprint_pictures(shown, plan_of(shown))
    assert 'class="label id"' not in picture.svg
    assert 'class="outline narrow"' in picture.svg
