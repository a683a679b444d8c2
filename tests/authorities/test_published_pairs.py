"""Two published stereopairs: signs and order of every angle, relative orientation, the way to the ground."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geometry.rotation import about, angles, from_alpha_omega_kappa
from photostrip.geometry.similarity import Similarity
from photostrip.strip.formed_strip import intersect, model_points
from photostrip.strip.relative_orientation import collect_pairs, orient_pairs
from tests.strips import MICROMETRE, measured

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.strip.relative_orientation import Orientation

    Floats = NDArray[np.float64]

DATA = Path(__file__).parents[1] / "data" / "authorities"
LEFT, RIGHT = "1", "2"
F_VARIANT, F_DEWITT = 75.000, 152.113  # mm


def read(name: str) -> list[dict[str, str]]:
    with (DATA / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def columns(table: list[dict[str, str]], *names: str) -> Floats:
    return np.array([[float(row[name]) for name in names] for row in table])


def radians(text: str) -> float:
    """Degrees, minutes, seconds with a sign in front."""
    degrees, minutes, seconds = (float(part) for part in text.lstrip("+-").split())
    size = np.radians(degrees + minutes / 60 + seconds / 3600)
    return float(-size if text.startswith("-") else size)


def oriented(names: list[str], left: Floats, right: Floats, focal: float) -> Orientation:
    images = [dict(zip(names, xy, strict=True)) for xy in (left, right)]
    observations = measured(dict(zip((LEFT, RIGHT), images, strict=True)))
    pairs = collect_pairs(observations, (LEFT, RIGHT), focal)
    assert pairs.point.tolist() == list(range(len(names)))
    return orient_pairs(pairs, (LEFT, RIGHT))


# --------------------------------------------------------------------------------------------- variant 56


class Variant:
    """The exercise: measurements, published orientation, ground."""

    def __init__(self) -> None:
        folder = "pair-variant-56"
        images, stations = read(f"{folder}/image_points.csv"), read(f"{folder}/exterior_orientation.csv")
        self.names = [row["point"] for row in images]
        self.left = columns(images, "x1_mm", "y1_mm")
        self.right = self.left - columns(images, "p_mm", "q_mm")
        self.centers = columns(stations, "Xs_m", "Ys_m", "Zs_m")
        kinds = ("alpha", "omega", "kappa")
        self.angles = np.array([[radians(row[f"{kind}_dms"]) for kind in kinds] for row in stations])
        self.ground = columns(read(f"{folder}/ground_points.csv"), "X_m", "Y_m", "Z_m")

    def intersect(self, rotations: Floats) -> tuple[Floats, Floats]:
        """Ground coordinates, and y parallaxes at photo scale in mm, from the published stations."""
        rays = [
            rotation @ np.column_stack([xy, np.full(len(xy), -F_VARIANT)]).T
            for rotation, xy in zip(rotations, (self.left, self.right), strict=True)
        ]
        found = intersect(self.centers[1] - self.centers[0], rays[0], rays[1], F_VARIANT)
        assert found.sound.all()
        return found.xyz + self.centers[0], found.gap / found.ray_factor


def test_the_published_orientation_meets_in_the_ground() -> None:
    variant = Variant()
    xyz, parallax = variant.intersect(from_alpha_omega_kappa(*variant.angles.T))
    assert np.abs(xyz - variant.ground).max() < 0.006  # metres
    assert np.allclose(xyz[:, 0] / 700, np.round(xyz[:, 0] / 700), atol=1e-5)  # points at multiples of 700 m
    assert 0.1 * MICROMETRE < np.abs(parallax).max() < 0.5 * MICROMETRE  # of coordinates printed to a micrometre


@pytest.mark.parametrize("photo", [0, 1])
@pytest.mark.parametrize("kind", [0, 1, 2], ids=["alpha", "omega", "kappa"])
def test_no_angle_may_change_its_sign(photo: int, kind: int) -> None:
    variant = Variant()
    variant.angles[photo, kind] *= -1
    _, parallax = variant.intersect(from_alpha_omega_kappa(*variant.angles.T))
    assert 0.9 < np.abs(parallax).max() < 9.0  # mm


def test_no_other_order_of_rotation_will_do() -> None:
    variant = Variant()
    alpha, omega, kappa = variant.angles.T
    _, parallax = variant.intersect(about(0, omega) @ about(1, -alpha) @ about(2, kappa))
    assert np.abs(parallax).max() == pytest.approx(25 * MICROMETRE, rel=0.05)


def test_relative_orientation_of_the_published_pair() -> None:
    variant = Variant()
    found = oriented(variant.names, variant.left, variant.right, F_VARIANT)
    assert np.abs(found.parallax).max() < 0.02 * MICROMETRE
    direction, rotation = found.relative
    base = direction[0] / direction[0, 0] * 76.580
    assert base[1:] == pytest.approx([1.3386, 0.6620], abs=1e-4)
    degrees = np.degrees(angles(rotation[0], "omega-phi-kappa"))
    assert degrees == pytest.approx([-1.7338, -1.8488, 0.8174], abs=1e-4)


def test_orienting_the_model_on_its_ground_gives_the_published_stations() -> None:
    variant = Variant()
    found = oriented(variant.names, variant.left, variant.right, F_VARIANT)
    models = model_points(found)
    assert models.sound.all()
    direction, rotation = found.relative
    similarity = Similarity.from_points(models.vectors, variant.ground)
    centers = similarity(np.array([[0.0, 0, 0], direction[0]]))
    assert np.abs(centers - variant.centers).max() < 0.02  # metres
    assert similarity.scale / (76.580 / direction[0, 0]) == pytest.approx(9.1395, abs=1e-4)  # metres per mm
    second = similarity.rotation @ rotation[0]
    for matrix, published in zip((similarity.rotation, second), variant.angles, strict=True):
        assert np.abs(np.degrees(angles(matrix, "alpha-omega-kappa") - published)).max() < 0.001  # degrees


# ------------------------------------------------------------------------------------------------- Dewitt


def test_relative_orientation_of_dewitts_sample() -> None:
    table = read("pair-dewitt/image_points.csv")
    left, right = columns(table, "xl_mm", "yl_mm"), columns(table, "xr_mm", "yr_mm")
    found = oriented([row["point"] for row in table], left, right, F_DEWITT)
    direction, rotation = found.relative
    base = direction[0] / direction[0, 0] * (left - right)[:, 0].mean()
    assert base == pytest.approx([91.9825, -1.7187, -3.8105], abs=0.002)  # mm
    degrees = np.degrees(angles(rotation[0], "omega-phi-kappa"))
    assert degrees == pytest.approx([2.4077, 0.5550, -0.2053], abs=0.0005)
    largest = np.abs(found.parallax).max() / np.sqrt(2)  # the other program shares a y parallax between both photos
    assert largest == pytest.approx(2.6 * MICROMETRE, abs=0.05 * MICROMETRE)
