"""What is measured: noise, film, marks, positions of the cameras, control, and gross errors where the truth says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from photostrip.errors import InputError
from photostrip.points import locate
from photostrip.simulation import (
    Control,
    Film,
    Flight,
    Gnss,
    GrossError,
    Ground,
    Image,
    InjectedError,
    Points,
    Simulation,
    Spec,
    simulate,
)
from photostrip.simulation.placement import band_photos
from tests.loops import nonempty

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


def true_ground(done: Simulation, ids: tuple[str, ...]) -> np.ndarray:
    """True coordinates of points in the output frame."""
    return done.truth.ground.xyz[locate(ids, done.truth.ground.ids)]


def stations(done: Simulation) -> list[list[int]]:
    """Photos on which each control point lies."""
    o = done.observations
    number = {name: k for k, name in enumerate(o.point_ids)}
    control = [name for name, check in zip(done.control.ids, done.control.check, strict=True) if not check]
    return [sorted(o.photo[o.point == number[name]].tolist()) for name in control]


@pytest.mark.parametrize(
    ("photos", "bands", "every", "expected"),
    [
        (21, 3, None, [0, 10, 20]),
        (21, 4, None, [0, 7, 13, 20]),
        (10, 1, None, [4]),
        (10, 2, None, [0, 9]),
        (21, 3, 5, [0, 5, 10, 15, 20]),
        (20, 3, 5, [0, 5, 10, 15, 19]),
        (3, 3, None, [0, 1, 2]),
    ],
)
def test_bands(photos: int, bands: int, every: int | None, expected: list[int]) -> None:
    spec = Spec(flight=Flight(photos=photos), control=Control(bands=bands, every=every))
    assert band_photos(spec) == expected
    done = simulate(spec)
    seen = stations(done)
    assert len(seen) == 3 * len(expected)
    assert all(station in seen[3 * k + i] for k, station in nonempty(enumerate(expected)) for i in range(3))


@pytest.mark.parametrize("crs", ["EPSG:32633", "EPSG:4979", "geocentric", "local"])
def test_noise_of_control_is_normal_and_as_large_as_stated(crs: str) -> None:
    sigma = np.array([0.03, 0.06, 0.12])
    spec = Spec(
        flight=Flight(photos=150),
        ground=Ground(crs=crs, center_deg=(15.0, 0.0)),
        points=Points(extra_per_model=9),
        control=Control(layout="random", count=1500, check=0, sigma=(0.03, 0.06, 0.12)),
    )
    done = simulate(spec)
    error = done.control.enu - true_ground(done, done.control.ids)
    if crs == "EPSG:4979":
        error *= np.radians(6_378_000.0), np.radians(6_335_000.0), 1.0  # metres per degree at the equator
    for column, s in nonempty(zip(error.T, sigma, strict=True)):
        assert column.std() == pytest.approx(s, rel=4 / np.sqrt(2 * 1500))
        assert stats.kstest(column / s, "norm").pvalue > 0.01
    assert done.control.sigma == pytest.approx(np.tile(sigma, (1500, 1)))
    double = simulate(replace(spec, control=replace(spec.control, noise=(0.06, 0.12, 0.24))))
    assert double.control.sigma == pytest.approx(done.control.sigma)
    assert double.control.enu - done.control.enu == pytest.approx(
        done.control.enu - true_ground(done, done.control.ids), abs=1e-6
    )


FREE = Spec(image=Image(sigma_um=0.0), control=Control(noise=(0.0, 0.0, 0.0)))


def row_of(done: Simulation, photo: str, point: str) -> int:
    """Row of an image point."""
    o = done.observations
    (row,) = np.flatnonzero((o.photo == o.photo_ids.index(photo)) & (o.point == o.point_ids.index(point)))
    return int(row)


def changed(done: Simulation) -> dict[tuple[int, int], float]:
    """Coordinates that differ from the truth, and by how much."""
    off = done.observations.xy - done.truth.image
    return {(int(r), int(c)): float(off[r, c]) for r, c in np.argwhere(np.abs(off) > 1e-9)}


def test_a_named_image_error() -> None:
    entry = GrossError("image", photo="1003", point="1002-2", axis="y", size_um=-250.0)
    done = simulate(replace(FREE, gross_errors=(entry,)))
    assert done.truth.errors == (InjectedError("image", "1002-2", "1003", "y", -0.25),)
    ((place, size),) = changed(done).items()
    assert place == (row_of(done, "1003", "1002-2"), 1)
    assert size == pytest.approx(-0.25)


def test_points_mistaken_for_each_other() -> None:
    spec = replace(FREE, control=Control(check=0, noise=(0.0, 0.0, 0.0)))
    done = simulate(
        replace(spec, gross_errors=(GrossError("swap", count=3), GrossError("swap", photo="1005", point="1005-1")))
    )
    assert len(done.truth.errors) == 4
    assert done.truth.errors[3].photo == "1005"
    assert done.truth.errors[3].point == "1005-1"
    rows = set()
    for error in nonempty(done.truth.errors):
        one, other = row_of(done, error.photo, error.point), row_of(done, error.photo, error.other)
        assert np.array_equal(done.observations.xy[one], done.truth.image[other])
        assert np.array_equal(done.observations.xy[other], done.truth.image[one])
        rows |= {one, other}
    assert len(rows) == 8
    assert {row for row, _ in changed(done)} == rows


@pytest.mark.parametrize("crs", ["EPSG:32633", "local", "geocentric"])
def test_control_errors(crs: str) -> None:
    entries = (GrossError("control", point="G02", axis="z", size_m=-3.0), GrossError("control", count=2, size_m=8.0))
    done = simulate(replace(FREE, ground=Ground(crs=crs), gross_errors=entries))
    true = done.truth.ground.xyz[locate(done.control.ids, done.truth.ground.ids)]
    off = done.control.enu - true
    assert done.truth.errors[0] == InjectedError("control", "G02", axis="z", size=-3.0)
    expected = np.zeros_like(off)
    for error in done.truth.errors:
        expected[done.control.ids.index(error.point), "xyz".index(error.axis)] = error.size
    assert np.count_nonzero(expected) == 3
    assert off == pytest.approx(expected, abs=0.005)  # grid metres against metres
    assert not off[done.control.check].any() or np.abs(off[done.control.check]).max() < 1e-6


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (GrossError("image", photo="9999"), r"gross_errors\[0\]: there are not enough image points on photo 9999"),
        (GrossError("image", photo="1001", point="G09"), "not enough image points of point G09 on photo 1001"),
        (GrossError("image", count=100_000), "not enough image points for a gross error"),
        (GrossError("control", point="K01"), "not enough control coordinates of point K01"),
        (GrossError("control", count=10), "not enough control coordinates"),
        (GrossError("swap", count=84), "not enough image points"),
    ],
)
def test_places_that_do_not_exist_are_refused(entry: GrossError, message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(replace(FREE, flight=Flight(), gross_errors=(entry,)))
