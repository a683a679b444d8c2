"""Errors of a strip against differences of the whole run, and its covariances against derivatives written out."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.precision import photo_errors
from photostrip.pipeline.run import triangulate
from photostrip.strip import fitted_strip as fitted
from photostrip.strip import polynomial
from photostrip.strip.formed_strip import StripFormationSettings
from tests.derivatives import (
    UNSCREENED,
    differenced,
    fitted_strip,
    spec,
    without_noise,
    written_out,
)
from tests.loops import nonempty

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from photostrip.arrays import Floats
    from photostrip.pipeline.results import Result
    from photostrip.strip.fitted_strip import FittedStrip

pytestmark = pytest.mark.usefixtures("_no_findings")

CLOSE = 1e-6  # of the largest derivative; differences of a run know no more
MIXED = {"xyz": 0.4, "xy": 0.3, "z": 0.3}


def settings(adjustment: str, transfer: str = "least_squares", intersection: str = "mean") -> Settings:
    degree = adjustment if adjustment in {"1", "2", "3"} else "auto"
    return Settings(
        adjustment="similarity" if adjustment == "similarity" else "polynomial",
        relative=UNSCREENED,
        formation=StripFormationSettings(transfer, intersection=intersection),
        polynomial=polynomial.PolynomialSettings(degree),
    )


CASES = [
    ("similarity", 60.0, 0.0, "least_squares", "mean", None),
    ("similarity", 80.0, 0.0, "distances", "mean", None),
    ("similarity", 62.0, 0.0, "distances", "left", None),
    ("similarity", 62.0, 95.7, "distances", "left", None),
    ("3", 62.0, 0.0, "least_squares", "mean", None),
    ("2", 70.0, 0.0, "least_squares", "mean", MIXED),
]


def after_fit(found: FittedStrip, rows: csr_array, influence: Floats, size: int) -> Floats:
    """Derivatives (n, d, ...) of things of d rows by all errors of the strip, then of the control."""
    control = found.control
    misclosures = written_out(found.errors, found.errors.along(control.row, control.direction))
    by_control = influence @ found.fit.operator
    by_strip = written_out(found.errors, rows) - by_control @ misclosures
    whole = np.concatenate([by_strip, by_control * np.sqrt(control.variance)], axis=1)
    return whole.reshape(-1, size, whole.shape[1])


def points_of(found: FittedStrip) -> Floats:
    rows = found.errors.points(np.arange(len(found.xyz)))
    return after_fit(found, rows, found.fit.influence(found.xyz).reshape(rows.shape[0], -1), 3)


def photos_of(found: FittedStrip, result: Result) -> Floats:
    by = photo_errors(result.strips[0], found.errors, result.refined.observations)
    rows = by.by_point @ found.errors.points(np.arange(len(found.xyz))) + by.by_image
    return after_fit(found, rows, by.by_point @ found.fit.influence(found.xyz).reshape(3 * len(found.xyz), -1), 6)


@pytest.mark.slow
@pytest.mark.parametrize(("adjustment", "lap", "kappa", "transfer", "intersection", "use"), CASES)
def test_derivatives_are_those_of_the_whole_run(
    adjustment: str, lap: float, kappa: float, transfer: str, intersection: str, use: dict[str, float] | None
) -> None:
    """Relative orientation, chain, scale transfer, intersection, means, similarity, polynomials, resection at once."""
    wanted_strip = spec(8, lap, use=use)
    inputs = without_noise(replace(wanted_strip, flight=replace(wanted_strip.flight, photo_rotation_deg=kappa)))
    wanted = settings(adjustment, transfer, intersection)
    result = triangulate(inputs, wanted)
    found = fitted_strip(result)
    errors, points, photos = found.errors, points_of(found), photos_of(found, result)
    rng = np.random.default_rng(2)
    for image in nonempty(rng.choice(np.unique(errors.orientation.rows), 4, replace=False).tolist()):
        axis = int(rng.integers(2))
        by_points, by_photos = differenced(result, (image, axis), 2e-4)
        column, sigma = errors.image_columns(np.array(image))[axis], errors.sigma[image, axis]
        assert points[:, :, column] / sigma == pytest.approx(by_points, abs=CLOSE * np.abs(by_points).max())
        for part in (slice(0, 3), slice(3, 6)):
            expected = by_photos[:, part]
            close = 10 * CLOSE * np.abs(expected).max()
            assert photos[:, part, column] / sigma == pytest.approx(expected, abs=close)


@pytest.mark.parametrize(("photos", "lap"), [(2, 62.0), (4, 70.0), (9, 80.0)])
def test_covariances_are_products_of_derivatives(photos: int, lap: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of points and photos, some at a time, and of coordinates together; the variance factor is of images alone."""
    result = triangulate(without_noise(spec(photos, lap, bands=min(4, photos))), settings("similarity"))
    found, plain = fitted_strip(result, 1.7), fitted_strip(result)
    count = len(found.control.point)
    points, photo = (np.array(each) for each in (points_of(plain), photos_of(plain, result)))
    for derivatives in (points, photo):
        derivatives[..., :-count] *= np.sqrt(1.7)
    monkeypatch.setattr(fitted, "AT_A_TIME", 20 * photos)
    some = np.random.default_rng(1).permutation(len(points))
    assert found.covariances_of_points(some) == pytest.approx((points @ points.transpose(0, 2, 1))[some])
    by = photo_errors(result.strips[0], found.errors, result.refined.observations)
    covariances = found.covariances_of_photos(by, np.arange(photos))
    expected = photo @ photo.transpose(0, 2, 1)
    size = np.sqrt(np.einsum("nii->ni", expected))
    assert np.abs(
        covariances / size[:, None] / size[:, :, None] - expected / size[:, None] / size[:, :, None]
    ).max() < (1e-9)
    directions = np.random.default_rng(2).normal(size=(len(some), 3))
    along = np.einsum("ni,nic->nc", directions, points[some])
    expected = along @ along.T
    assert found.joint_covariance(some, directions) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
