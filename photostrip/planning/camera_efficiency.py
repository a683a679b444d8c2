"""Which of several cameras does a survey with the fewest photos: the efficiency coefficient K = f m_p.

A height has the standard deviation m_h = H m_p / b with the flying height H = f m, the photo base b, and the standard
deviation m_p of an x parallax in the photo. At equal m_h the camera with the smaller K flies higher and covers more.

Source: [004b] eq. 1-8, with the corrections that ``photostrip sources`` lists.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.camera import Distortion
from photostrip.strip.corrections import ideal_from_image
from photostrip.units import MILLIMETRES

KILOMETRE = 1e6  # mm
GRID = 41  # points along and across a model in which a distortion is tried


class ComparedCamera(NamedTuple):
    name: str
    focal: float  # principal distance f, mm
    sigma: float  # standard deviation m_p of an x parallax, mm
    base: float  # photo base b, mm
    width: float  # useful width l of a photo across the flight, mm
    length: float | None = None  # length L of a photo along the flight, mm

    @property
    def coefficient(self) -> float:
        """K in mm², the smaller the better (eq. 4, 7, 8)."""
        return self.focal * self.sigma

    @property
    def height_ratio(self) -> float:
        """H / m_h = b / m_p: how many standard deviations of a height the flying height is."""
        return self.base / self.sigma


def sigma_from_mean_distortion(measuring: float, mean: float) -> float:
    """Return the standard deviation of an x parallax from measuring and the mean size of a radial distortion, mm.

    The distortion counts as normally distributed, with a mean square of pi/2 times the square of its mean size; on the
    average over all directions half of it lies along x, in each of the two photos.

    measuring: standard deviation of an image coordinate.
    """
    return float(np.sqrt(2 * measuring**2 + np.pi / 2 * mean**2))


def sigma_from_distortion(measuring: float, distortion: Distortion, base: float, length: float, width: float) -> float:
    """Return the standard deviation of an x parallax from measuring and a distortion that is left, mm.

    What the distortion gives to x parallaxes all over the model, less its mean, which goes into the height datum.

    Raises InputError when the model is larger than the table of the distortion.
    """
    x, y = np.meshgrid(np.linspace(base - length / 2, length / 2, GRID), np.linspace(-width / 2, width / 2, GRID))
    left = np.column_stack([x.ravel(), y.ravel()])
    moved = [(ideal_from_image(points, distortion) - points)[:, 0] for points in (left, left - (base, 0.0))]
    return float(np.sqrt(2 * measuring**2 + (moved[0] - moved[1]).var()))


@dataclass(frozen=True)
class FlownCamera:
    """A camera flown over ground: what a height and an area cost."""

    camera: ComparedCamera
    scale: float  # denominator m of the photo scale

    @property
    def flying_height(self) -> float:
        """H above the ground, metres."""
        return self.camera.focal * self.scale / MILLIMETRES

    @property
    def height_sigma(self) -> float:
        """m_h = H m_p / b, metres."""
        return self.flying_height / self.camera.height_ratio

    @property
    def area(self) -> float:
        """Ground S of the useful part of a model, km²."""
        return self.camera.base * self.camera.width * (self.scale / KILOMETRE) ** 2


def scale_of(camera: ComparedCamera, height_sigma: float) -> float:
    """Return the denominator of the photo scale at which heights have a standard deviation, metres."""
    return height_sigma * MILLIMETRES * camera.height_ratio / camera.focal


@dataclass(frozen=True)
class HighGround:
    """Ground that is no plane."""

    relief: float = 0.0  # difference between the highest and the lowest ground, metres; half of it is above the mean
    slope: float = 0.0  # steepest slope that is to be seen, radians


@dataclass(frozen=True)
class FlownSurvey:
    """What is flown with every camera: one of scale, flying height or standard deviation of heights; and over what."""

    scale: float | None = None  # denominator
    flying_height: float | None = None  # metres
    height_sigma: float | None = None  # metres
    terrain: HighGround = HighGround()

    def flown(self, camera: ComparedCamera) -> FlownCamera:
        if self.height_sigma is not None:
            return FlownCamera(camera, scale_of(camera, self.height_sigma))
        if self.flying_height is not None:
            return FlownCamera(camera, self.flying_height * MILLIMETRES / camera.focal)
        return FlownCamera(camera, self.scale or np.nan)


class Suitability(NamedTuple):
    """What a camera can take of a terrain (derived)."""

    # largest relief, metres: up to it some of the highest ground stands on three photos of the strip; NaN where the
    # length of the photo is not known
    relief: float
    lap: float  # overlap at the highest ground, a share; NaN where the length is not known
    slope: float  # steepest slope of which nothing in a model is hidden from one of its photos, radians
    suits: bool
    # smallest principal distance, mm, that takes the terrain with this format and base; infinite where none does: the
    # relief asks for a flying height, which goes with the principal distance where the photo scale is given
    least_focal: float


def suitability(camera: ComparedCamera, survey: FlownSurvey) -> Suitability:
    """Compare a camera with the terrain of a survey.

    A photo at the height h above the mean ground sees a base as b H / (H - h), so the overlap is more than a half, and
    scale can be carried from model to model, up to h = H (1 - 2 b / L). The outermost point of a model is seen from the
    farther photo at hypot(b, l / 2) from its nadir; a slope that falls away from the photo is hidden where it is
    steeper than f over that.
    """
    flown, terrain = survey.flown(camera), survey.terrain
    above = terrain.relief / 2
    share = np.nan if camera.length is None else 1 - 2 * camera.base / camera.length
    outermost = float(np.hypot(camera.base, camera.width / 2))
    highest = share * flown.flying_height
    lap = np.nan
    if camera.length is not None and above < flown.flying_height:
        lap = 1 - camera.base / camera.length * flown.flying_height / (flown.flying_height - above)
    steepest = float(np.arctan(camera.focal / outermost))
    by_relief = 0.0
    if above and survey.scale is not None and share > 0:
        by_relief = above * MILLIMETRES / (share * flown.scale)
    elif above and not above <= highest:
        by_relief = np.inf
    return Suitability(
        relief=2 * highest,
        lap=lap,
        slope=steepest,
        suits=bool((not above or above <= highest) and terrain.slope <= steepest),
        least_focal=max(by_relief, outermost * float(np.tan(terrain.slope))),
    )


class Compared(NamedTuple):
    """A camera beside another, both flown for the same standard deviation of heights, unless said otherwise."""

    scale: float  # ratio of the denominators of photo scale, m1 / m2
    # eta_mh: ratio of the standard deviations of heights, m_h1 / m_h2, where the two cover the same area
    height_error: float
    printed_area: float  # eta_S as printed (eq. 2): the scale to the first power
    area: float  # the ratio of the areas that a model covers: the scale squared
    photos: float  # how many times as many photos are needed for an area: the inverse of `area`


def compare(first: ComparedCamera, second: ComparedCamera) -> Compared:
    """Compare two cameras: ratios, first to second.

    Formats and bases may differ; with equal ones the printed and the true ratio of areas are the scale ratio and its
    square.
    """
    base, width = first.base / second.base, first.width / second.width
    coefficient = first.coefficient / second.coefficient
    scale = base / coefficient  # at equal m_h: m = m_h b / (f m_p)
    area = base * width * scale**2
    # at equal area the scales are as 1 / sqrt(b l)
    height_error = coefficient / base / (base * width) ** 0.5
    return Compared(
        scale=scale, height_error=height_error, printed_area=base * width * scale, area=area, photos=1 / area
    )


class PrintedRow(NamedTuple):
    """A row of the table of the source, as it is printed."""

    # focal, sigma: f and m_p, mm
    focal: float
    sigma: float
    coefficient: float  # K, mm²
    height_ratio: float
    area: float


PRINTED_BASE = 60.0  # mm: the base that the printed H / m_h belong to
# [004b], the table; the last heading is misprinted
PRINTED_TABLE = (
    PrintedRow(focal=70.0, sigma=0.017, coefficient=1.2, height_ratio=3500.0, area=1.8),
    PrintedRow(focal=100.0, sigma=0.015, coefficient=1.5, height_ratio=4000.0, area=1.45),
    PrintedRow(focal=140.0, sigma=0.0125, coefficient=1.75, height_ratio=4800.0, area=1.25),
    PrintedRow(focal=200.0, sigma=0.011, coefficient=2.2, height_ratio=5000.0, area=1.0),
)


def source_cameras() -> tuple[ComparedCamera, ...]:
    """Return the four cameras of the source's table, all with the base of 60 mm and one format."""
    return tuple(
        ComparedCamera(
            name=f"f {row.focal:g} mm", focal=row.focal, sigma=row.sigma, base=PRINTED_BASE, width=PRINTED_BASE
        )
        for row in PRINTED_TABLE
    )


def by_efficiency(cameras: Sequence[ComparedCamera]) -> list[ComparedCamera]:
    """Cameras from the best to the worst by the area of a model at equal m_h; with equal bases and formats, by K."""
    return sorted(cameras, key=lambda camera: -camera.width * camera.base**3 / camera.coefficient**2)
