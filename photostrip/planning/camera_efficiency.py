"""Which of several cameras does a survey with the fewest photos: the efficiency coefficient K = f m_p.

A height has the standard deviation m_h = H m_p / b with the flying height H = f m, the photo base b, and the standard
deviation m_p of an x parallax in the photo. At equal m_h the camera with the smaller K flies higher and covers more.

Source: [004b] eq. 1-8, with the corrections listed in docs/sources.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence


class ComparedCamera(NamedTuple):
    """A camera to compare."""

    name: str
    focal: float  # principal distance f, mm
    sigma: float  # standard deviation m_p of an x parallax, mm
    base: float  # photo base b, mm
    width: float  # width l of a photo across the flight, mm

    @property
    def coefficient(self) -> float:
        """K in mm², the smaller the better (eq. 4, 7, 8)."""
        return self.focal * self.sigma

    @property
    def height_ratio(self) -> float:
        """H / m_h = b / m_p: how many standard deviations of a height the flying height is."""
        return self.base / self.sigma


class Comparison(NamedTuple):
    """A camera beside another, both flown for the same standard deviation of heights, unless said otherwise."""

    scale: float  # ratio of the denominators of photo scale, m1 / m2
    # eta_mh: ratio of the standard deviations of heights, m_h1 / m_h2, where the two cover the same area
    height_error: float
    printed_area: float  # eta_S as printed (eq. 2): the scale to the first power
    area: float  # the ratio of the areas that a model covers: the scale squared
    photos: float  # how many times as many photos are needed for an area: the inverse of `area`


def compare(first: ComparedCamera, second: ComparedCamera) -> Comparison:
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
    return Comparison(
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
