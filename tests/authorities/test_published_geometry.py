"""Published pairs, a similarity with standard deviations on both sides, limits and examples of tests for outliers."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.geometry.rotation import about, angles, from_alpha_omega_kappa
from photostrip.geometry.similarity import Similarity
from photostrip.statistics import grubbs_limit
from photostrip.strip.absolute_orientation import orient
from photostrip.strip.formed_strip import intersect, model_points
from photostrip.strip.relative_orientation import Orientation, collect_pairs, orient_pairs
from photostrip.strip.resection import KnownPhotos, intersect_points, space_resection
from tests.strips import MICROMETRE, control_points, measured, targets

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


def test_the_published_pair_comes_back_from_its_points_and_its_points_from_the_pair() -> None:
    variant, sides, sigma = Variant(), [], 0.0005
    rotations = from_alpha_omega_kappa(*variant.angles.T)
    for number, xy in enumerate((variant.left, variant.right)):
        found = space_resection(xy, np.full(xy.shape, sigma), variant.ground, F_VARIANT)
        assert np.abs(found.center - variant.centers[number]).max() < 0.02  # image coordinates have three decimals
        assert np.abs(found.rotation - rotations[number]).max() < 3e-5
        sides.append(xy)
    count = len(variant.ground)
    rows = np.repeat([0, 1], count), np.tile(np.arange(count), 2)
    known = KnownPhotos(variant.centers, rotations, np.full(2, F_VARIANT))
    met = intersect_points(np.concatenate(sides), np.full((2 * count, 2), sigma), rows, known, count)
    assert np.abs(met.xyz - variant.ground).max() < 0.006


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


POINTS = Path(__file__).parents[1] / "data" / "authorities" / "similarity-ghilani"


def points_of(*names: str) -> Floats:
    with (POINTS / "points.csv").open(encoding="utf-8", newline="") as file:
        return np.array([[float(row[name]) for name in names] for row in csv.DictReader(file)])


SOURCE, TARGET = points_of("x", "y", "z"), points_of("X", "Y", "Z")


def textbook_angles(rotation: Floats) -> Floats:
    """Angles w, p, k in degrees of M = R3(k) R2(p) R1(w); the rotation is the transpose of M."""
    return np.asarray(Rotation.from_matrix(rotation).as_euler("XYZ", degrees=True), float)


def test_equal_weights() -> None:
    found = Similarity.from_points(SOURCE, TARGET)
    assert found.scale == pytest.approx(0.9499569402, abs=1e-9)
    assert textbook_angles(found.rotation) == pytest.approx([2.284095, -0.550826, -135.462901], abs=1e-6)
    assert found.shift == pytest.approx([10233.8258, 6549.9683, 720.8789], abs=1e-4)
    sigma0 = np.sqrt((found.residuals(SOURCE, TARGET) ** 2).sum() / 5)
    assert sigma0 == pytest.approx(0.0612, abs=5e-5)


def test_standard_deviations_of_both_sides() -> None:
    """The published solution knows that turned source coordinates are correlated; without that it differs by 1 mm."""
    names = [f"{number}" for number in range(4)]
    sigma_source = points_of("sx_mm", "sy_mm", "sz_mm") / 1000
    sigma_target = points_of("sX_cm", "sY_cm", "sZ_cm") / 100
    start = Similarity.from_points(SOURCE, TARGET)
    variance = sigma_target**2 + start.scale**2 * sigma_source**2 @ (start.rotation**2).T
    middle = TARGET.mean(axis=0)
    control = control_points(dict(zip(names, TARGET, strict=True)))
    found = orient(SOURCE, targets(control, origin=middle), 1 / variance).similarity
    assert found.shift + middle == pytest.approx([10233.8542, 6549.9641, 720.8663], abs=0.001)  # metres
    assert found.scale == pytest.approx(0.9499549354, abs=3e-7)
    assert abs(found.scale - 0.9499549354) < abs(start.scale - 0.9499549354) / 5


# F. E. Grubbs: Procedures for detecting outlying observations in samples, Technometrics 11 (1969), table 1:
# one-sided critical values by number of observations, at 5 %, 2.5 % and 1 %.
PRINTED = {
    3: (1.15, 1.15, 1.15),
    4: (1.46, 1.48, 1.49),
    5: (1.67, 1.71, 1.75),
    6: (1.82, 1.89, 1.94),
    7: (1.94, 2.02, 2.10),
    8: (2.03, 2.13, 2.22),
    10: (2.18, 2.29, 2.41),
    12: (2.29, 2.41, 2.55),
    15: (2.41, 2.55, 2.71),
    16: (2.44, 2.59, 2.75),
    18: (2.50, 2.65, 2.82),
    20: (2.56, 2.71, 2.88),
}


@pytest.mark.parametrize("n", PRINTED)
def test_the_table_of_grubbs(n: int) -> None:
    found = [grubbs_limit(n, 2 * alpha) for alpha in (0.05, 0.025, 0.01)]
    assert found == pytest.approx(PRINTED[n], abs=0.0071)  # the last printed digit is not always rounded
    assert grubbs_limit(n, 0.05) == pytest.approx(PRINTED[n][1], abs=0.0071)


def test_the_mass_spectrometer_of_the_nist_handbook() -> None:
    """NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.5.17.1: G = 2.469, critical value 2.032 (one-sided, 5 %)."""
    sample = np.array([199.31, 199.53, 200.19, 200.82, 201.92, 201.95, 202.18, 245.57])
    value = (sample.max() - sample.mean()) / sample.std(ddof=1)
    limit = grubbs_limit(8, 2 * 0.05)
    assert value == pytest.approx(2.469, abs=0.0005)
    assert limit == pytest.approx(2.032, abs=0.0005)
    rest = sample[:-1]
    assert (rest.max() - rest.mean()) / rest.std(ddof=1) < grubbs_limit(7, 2 * 0.05)
