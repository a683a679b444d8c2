"""Film deformation beyond the transformation: through the marks, back again, better only where marks can see it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.camera import Camera
from photostrip.points import PhotoPoints
from photostrip.strip import interior
from photostrip.strip.corrections import InteriorSettings
from photostrip.strip.interior import FilmDeformation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

PICOMETRE = 1e-9  # mm
MICROMETRE = 1e-3
EDGE = 106.0
CORNERS = {"1": (EDGE, -EDGE), "2": (-EDGE, -EDGE), "3": (-EDGE, EDGE), "4": (EDGE, EDGE)}
EIGHT = CORNERS | {"5": (EDGE, 0.0), "6": (-EDGE, 0.0), "7": (0.0, EDGE), "8": (0.0, -EDGE)}
RESEAU = {f"{x}/{y}": (53.0 * x, 53.0 * y) for x in range(-2, 3) for y in range(-2, 3)}
PHOTOS = tuple(str(n) for n in range(60))


def bent(photo: NDArray[np.intp], xy: Floats, shape: Floats) -> Floats:
    """Film with a bend of its own on each photo: terms of second and third order, shrunk by 0.1 % in x."""
    u = xy / EDGE
    terms = np.stack([u[:, 0] ** 2, u[:, 0] * u[:, 1], u[:, 1] ** 2, (u**3).sum(1)], -1)
    return np.asarray(xy * [1.001, 1.0] + np.einsum("nck,nk->nc", shape[photo], terms))


def surveyed(
    marks: dict[str, tuple[float, float]], noise: float = 3e-3
) -> tuple[dict[str, Camera], PhotoPoints, PhotoPoints, Floats]:
    rng = np.random.default_rng(7)
    shape = rng.normal(0, 10e-3, (len(PHOTOS), 2, 4))
    n, m = len(PHOTOS), len(marks)
    photo, mark = np.repeat(np.arange(n), m), np.tile(np.arange(m), n)
    calibrated = np.array(list(marks.values()))[mark]
    seen = bent(photo, calibrated, shape) + rng.normal(0, noise, calibrated.shape)
    fiducials = PhotoPoints(PHOTOS, tuple(marks), photo, mark, seen, np.full((n * m, 2), 0.003))
    truth, owner = rng.uniform(-100, 100, (40 * n, 2)), np.repeat(np.arange(n), 40)
    ids = tuple(f"P{i}" for i in range(len(truth)))
    xy = bent(owner, truth, shape)
    points = PhotoPoints(PHOTOS, ids, owner, np.arange(len(truth)), xy, np.full((len(truth), 2), 0.005))
    camera = Camera("RC10", 153.0, fiducials=marks)
    return dict.fromkeys(PHOTOS, camera), fiducials, points, truth


def rms_um(marks: dict[str, tuple[float, float]], residuals: str) -> float:
    cameras, fiducials, points, truth = surveyed(marks)
    found = interior.orient(fiducials, cameras, InteriorSettings("affine", residuals))
    return float(np.sqrt(((interior.transform(points, found).xy - truth) ** 2).mean()) / MICROMETRE)


@given(st.integers(0, 2**32 - 1))
def test_the_spline_goes_through_the_marks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    marks = rng.uniform(-110, 110, (9, 2))
    film = FilmDeformation.from_residuals([marks], [rng.normal(0, 0.02, (9, 2))])
    assert np.abs(film.corrected(np.zeros(9, np.intp), film.nodes[0]) - marks).max() < PICOMETRE


@pytest.mark.parametrize(
    ("marks", "least", "most"),
    [(CORNERS, 0.9, 1.1), (EIGHT, 0.5, 0.7), (RESEAU, 0.3, 0.5)],
    ids=["four corners", "eight", "reseau"],
)
def test_interpolation_helps_as_far_as_the_marks_see_the_bend(
    marks: dict[str, tuple[float, float]], least: float, most: float
) -> None:
    assert least < rms_um(marks, "interpolate") / rms_um(marks, "ignore") < most


def test_photos_whose_marks_cannot_tell_are_named() -> None:
    cameras, fiducials, points, _ = surveyed(CORNERS)
    rows = ~((fiducials.photo == 3) & (fiducials.point == 2))
    fewer = PhotoPoints(
        PHOTOS,
        fiducials.point_ids,
        fiducials.photo[rows],
        fiducials.point[rows],
        fiducials.xy[rows],
        fiducials.sigma[rows],
    )
    ways = [interior.orient(fewer, cameras, InteriorSettings("affine", way)) for way in ("ignore", "interpolate")]
    (note,) = [note for note in ways[1].notes if note.code == "film-unseen"]
    assert note.photos == ("3",)
    one = points.photo == 3
    left, right = (interior.transform(points, found).xy[one] for found in ways)
    assert np.array_equal(left, right)
