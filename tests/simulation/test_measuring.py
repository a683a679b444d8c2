"""Measuring: noise, film and fiducial marks, positions of the cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from photostrip.simulation import Film, Flight, Gnss, Ground, Image, Points, Spec, simulate

LARGE = Spec(flight=Flight(photos=200), points=Points(extra_per_model=9))


def test_noise_is_normal_and_as_large_as_stated() -> None:
    done = simulate(replace(LARGE, image=Image(sigma_um=7.0)))
    error = (done.observations.xy - done.truth.image) / 0.007
    n = error.size
    assert error.std() == pytest.approx(1.0, abs=4 / np.sqrt(2 * n))
    assert abs(error.mean()) < 4 / np.sqrt(n)
    assert stats.kstest(error.ravel(), "norm").pvalue > 0.01
    assert abs(float(np.mean(error[:, 0] * error[:, 1]))) < 4 / np.sqrt(len(error))
    assert (done.observations.sigma == 0.007).all()


@pytest.mark.parametrize("irregular_um", [0.0, 4.0])
def test_an_affine_transformation_on_the_marks_finds_the_photo(irregular_um: float) -> None:
    film = Film(irregular_um=irregular_um)
    spec = Spec(image=Image(sigma_um=0.0), film=film)
    done, plain = simulate(spec), simulate(replace(spec, film=None))
    marks = done.fiducials
    assert marks is not None
    assert plain.fiducials is None
    calibrated = np.array([spec.camera.fiducials[name] for name in marks.point_ids])
    left = []
    for photo in range(10):
        on = marks.photo == photo
        design = np.column_stack([marks.xy[on], np.ones(on.sum())])
        solution, *_ = np.linalg.lstsq(design, calibrated[marks.point[on]], rcond=None)
        rows = done.observations.photo == photo
        restored = np.column_stack([done.observations.xy[rows], np.ones(rows.sum())]) @ solution
        left.append(restored - plain.observations.xy[rows])
    largest = np.abs(np.concatenate(left)).max()
    if irregular_um:
        assert 0.5 * irregular_um / 1000 < largest < 6 * irregular_um / 1000
    else:
        assert largest < 1e-9


@pytest.mark.parametrize("crs", ["EPSG:32733", "geocentric", "local"])
def test_camera_positions(crs: str) -> None:
    spec = replace(LARGE, ground=Ground(crs=crs, center_deg=(15.0, -20.0)), gnss=Gnss(sigma=(0.1, 0.2, 0.4)))
    done = simulate(spec)
    assert done.gnss is not None
    error = done.gnss - done.truth.centers_ground
    assert error.std(axis=0) == pytest.approx([0.1, 0.2, 0.4], rel=4 / np.sqrt(2 * 200))
    assert simulate(LARGE).gnss is None


def test_film_is_stretched_sheared_turned_and_shifted_as_stated() -> None:
    film = Film(scale_ppm=200.0, shear_ppm=60.0, rotation_deg=2.0, offset_mm=4.0)
    spec = Spec(flight=Flight(photos=400), image=Image(sigma_um=0.0), film=film)
    marks = simulate(spec).fiducials
    assert marks is not None
    xy = {name: marks.xy[marks.point == k] for k, name in enumerate(marks.point_ids)}
    across, upward = (xy["F8"] - xy["F6"]) / 220.0, (xy["F7"] - xy["F5"]) / 220.0
    spread = pytest.approx(1.0, rel=4 / np.sqrt(2 * 400))
    assert np.std(np.hypot(*across.T) - 1.0) / 200e-6 == spread
    turn = np.arctan2(across[:, 1], across[:, 0])
    assert np.degrees(turn).std() / 2.0 == spread
    angle = np.arctan2(upward[:, 1], upward[:, 0]) - turn - np.pi / 2
    assert angle.std() / 60e-6 == spread
    assert ((xy["F8"] + xy["F6"]) / 2).std() / 4.0 == pytest.approx(1.0, rel=4 / np.sqrt(4 * 400))
