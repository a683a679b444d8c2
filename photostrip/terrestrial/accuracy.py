"""How accurately correction directions must be measured for a given image accuracy, and the other way round.

The exact formulas hold for any orientation of the camera. Those of the source, kept for comparison, hold for a level
camera and inherit a misprint of its eq. 3 in the vertical direction. ``xz`` (..., 2) everywhere are image coordinates
in mm, reduced to the principal point; ``rotation`` (3, 3) takes the photo to the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.terrestrial.frame import ground_from_photo, partials
from photostrip.units import ARCSECONDS

LEVEL_CAMERA = 1e-12  # difference of a rotation from that of a level camera


class Theodolite(NamedTuple):
    """Standard deviations of directions measured in one round, in arcseconds, and the number of rounds."""

    horizontal: float
    vertical: float
    rounds: int


@dataclass(frozen=True, eq=False)
class RequiredAccuracy:
    """Standard deviations with which correction directions must be known."""

    angle: Floats  # (...): m_lambda', of the angle between a point and the optical axis as the photo gives it, radians
    horizontal: Floats  # (...): m_lambda, of a horizontal direction: an angle is the difference of two of them, radians
    vertical: Floats  # (...): m_beta, of a vertical direction, radians


def required(xz: ArrayLike, principal_distance: float, sigma: float, rotation: ArrayLike) -> RequiredAccuracy:
    """Accuracy of directions that corresponds to the standard deviation `sigma` of x, z and the principal distance, mm.

    For a level camera m_lambda' = m / sqrt(f^2 + x^2) and m_beta = m / sqrt(f^2 + x^2 + z^2).

    Source: [002] eq. 4-6 with all first-order terms and without the misprint of eq. 3.
    """
    by = partials(xz, principal_distance, rotation)
    errors = sigma * np.sqrt((by.by_xz**2).sum(axis=-1) + by.by_f**2)
    return RequiredAccuracy(errors[..., 0], errors[..., 0] / np.sqrt(2.0), errors[..., 1])


@dataclass(frozen=True, eq=False)
class Printed:
    """Standard deviations by the formulas as they are printed, for a level camera."""

    horizontal: Floats  # (...): m_lambda by eq. 5 and 6, which is right, radians
    # vertical_eq5, vertical_eq6: (...): m_beta by eq. 5 and by its shorter form eq. 6, radians
    vertical_eq5: Floats
    vertical_eq6: Floats


def as_printed(xz: ArrayLike, principal_distance: float, sigma: float) -> Printed:
    """Accuracy of directions by the formulas of the source, for a standard deviation `sigma` of image coordinates, mm.

    Source: [002] eq. 5 and 6 as printed, see ``photostrip sources``.
    """
    x, z = np.moveaxis(np.asarray(xz, float), -1, 0)
    f = principal_distance
    g = np.sqrt(1.0 + (x / f) ** 2)  # sec(lambda'), which should have been its inverse
    denominator = f**2 + (z * g) ** 2
    eq5 = sigma * g * np.sqrt(f**2 + z**2) / denominator
    return Printed(sigma / np.sqrt(2.0 * (f**2 + x**2)), eq5, sigma / np.sqrt(denominator))


def supported(
    xz: ArrayLike, principal_distance: float, horizontal: float, vertical: float, rotation: ArrayLike
) -> Floats:
    """Smallest standard deviations (..., 2) of image coordinates, mm, for which directions are accurate enough.

    Source: derived; ``required`` solved for m.
    """
    unit = required(xz, principal_distance, 1.0, rotation)
    return np.stack([horizontal / unit.horizontal, vertical / unit.vertical], axis=-1)


def rounds_for(sigma: float, wanted: float) -> int:
    """Return the number of rounds, each in both faces with `sigma`, whose mean has the standard deviation wanted."""
    return max(1, ceil((sigma / wanted) ** 2 - 1e-9))  # exactly four times is not more than four times


def grid(photo_format: tuple[float, float], step: float, *, level: bool = True) -> tuple[Floats, Floats]:
    """Coordinates x and z over the photo, mm, at which accuracy is tabulated: multiples of the step, and the edge.

    With a level camera one quarter of the photo stands for the others.
    """
    axes = []
    for size in photo_format:
        half = size / 2
        inside = step * np.arange(int(np.ceil(half / step - LEVEL_CAMERA)))
        upper = np.append(inside, half)
        axes.append(upper if level else np.concatenate([-upper[:0:-1], upper]))
    return axes[0], axes[1]


@dataclass(frozen=True)
class Example:
    """A worked example of the source."""

    camera: str
    # f, x, z, sigma: principal distance, image coordinates and their standard deviation, mm
    f: float
    x: float
    z: float
    sigma: float
    # horizontal, vertical: m_lambda and m_beta as printed, arcseconds
    horizontal: float
    vertical: float
    factor: float


# Source: [002], the two examples at its end.
EXAMPLES = (
    Example(camera="Photheo 19/1318", f=190.0, x=80.0, z=60.0, sigma=0.005, horizontal=3.5, vertical=5.0, factor=1.18),
    Example(camera="UMK 10/1318", f=100.0, x=80.0, z=60.0, sigma=0.005, horizontal=6.0, vertical=8.5, factor=1.18),
)


@dataclass(frozen=True)
class WorkedExample:
    """An example computed again, step by step; standard deviations in arcseconds."""

    example: Example
    horizontal: float  # m_lambda, exact
    printed_factor: float  # m_beta by eq. 6 with the factor that is printed: what the source computed
    # eq5, eq6: m_beta by eq. 5 and by eq. 6 with the factor of the camera
    eq5: float
    eq6: float
    factor: float  # the factor 1 + x^2/f^2 of the camera
    vertical: float  # m_beta, exact
    returned_z: float  # what z comes back as, when beta is computed by eq. 3 as printed and put into eq. 2, mm


def worked(example: Example) -> WorkedExample:
    """Compute an example of the source again, by the printed and by the exact formulas."""
    f, x, z, m = example.f, example.x, example.z, example.sigma
    exact = required([x, z], f, m, ground_from_photo(0.0))
    printed = as_printed([x, z], f, m)
    factor = 1.0 + (x / f) ** 2
    return WorkedExample(
        example=example,
        horizontal=float(exact.horizontal) * ARCSECONDS,
        printed_factor=float(m * ARCSECONDS / np.sqrt(f**2 + z**2 * example.factor)),
        eq5=float(printed.vertical_eq5) * ARCSECONDS,
        eq6=float(printed.vertical_eq6) * ARCSECONDS,
        factor=factor,
        vertical=float(exact.vertical) * ARCSECONDS,
        returned_z=z * factor,  # tan(beta) = z sec/f, and eq. 2 multiplies by f sec again
    )
