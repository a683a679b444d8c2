"""Rows of derivatives against differences of the whole run; sums along the strip against everything written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.triangulation.error_propagation import covariances as precision
from photostrip.triangulation.polynomial import correction
from photostrip.triangulation.strip_formation.scale_transfer import StripFormationSettings
from tests.derivatives import (
    UNSCREENED,
    differenced,
    differenced_by_control,
    errors_of,
    every,
    spec,
    without_noise,
    written_out,
)
from tests.loops import nonempty

pytestmark = pytest.mark.usefixtures("_no_findings")

CLOSE = 1e-6  # of the largest derivative; differences of a run know no more
MIXED = {"xyz": 0.4, "xy": 0.3, "z": 0.3}


def settings(adjustment: str, transfer: str = "least_squares", intersection: str = "mean") -> Settings:
    degree = adjustment if adjustment in {"1", "2", "3"} else "auto"
    return Settings(
        adjustment="similarity" if adjustment == "similarity" else "polynomial",
        relative=UNSCREENED,
        formation=StripFormationSettings(transfer, intersection=intersection),
        polynomial=correction.PolynomialSettings(degree),
    )


CASES = [
    ("similarity", 60.0, 0.0, "least_squares", "mean", None),
    ("similarity", 80.0, 0.0, "distances", "mean", None),
    ("similarity", 62.0, 0.0, "distances", "left", None),
    ("similarity", 62.0, 95.7, "distances", "left", None),
    ("3", 62.0, 0.0, "least_squares", "mean", None),
    ("2", 70.0, 0.0, "least_squares", "mean", MIXED),
]


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
    found = errors_of(result)
    images, operator = found.errors.images, found.fit.operator
    misclosures = written_out(found.control.rows, found.errors)[:, 0]
    points = (
        written_out(every(found.errors.points), found.errors) - found.fit.influence(found.xyz) @ operator @ misclosures
    )
    (of_photos,) = found.photos()
    photos = written_out(of_photos.rows, found.errors) - of_photos.influence @ operator @ misclosures
    rng = np.random.default_rng(2)
    for image in nonempty(rng.choice(len(images.row), 4, replace=False).tolist()):
        axis = int(rng.integers(2))
        by_points, by_photos = differenced(result, (int(images.row[image]), axis), 2e-4)
        column, sigma = 2 * image + axis, images.sigma[image, axis]
        assert points[:, :, column] / sigma == pytest.approx(by_points, abs=CLOSE * np.abs(by_points).max())
        for part in (slice(0, 3), slice(3, 6)):
            expected = by_photos[:, part]
            close = 10 * CLOSE * np.abs(expected).max()
            assert photos[:, part, column] / sigma == pytest.approx(expected, abs=close)


@pytest.mark.slow
@pytest.mark.parametrize(("adjustment", "use"), [("similarity", MIXED), ("3", None), ("1", MIXED)])
def test_the_fit_passes_on_errors_of_the_control(adjustment: str, use: dict[str, float] | None) -> None:
    inputs, wanted = without_noise(spec(7, use=use)), settings(adjustment)
    result = triangulate(inputs, wanted)
    found = errors_of(result)
    by_control = found.fit.influence(found.xyz) @ found.fit.operator
    names = [inputs.control.ids.index(name) for name in result.strips[0].control.ids]
    for column in nonempty(range(0, len(found.control.point), 5)):
        row, axis = names[found.control.point[column]], int(found.control.axis[column])
        expected = differenced_by_control(result, row, axis, 0.01)
        # a map's coordinates are those of the ground to within its scale; a level axis turns by the Earth's curvature
        assert by_control[:, :, column] == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize(("photos", "lap"), [(3, 62.0), (4, 70.0), (11, 62.0), (9, 80.0)])
@pytest.mark.parametrize("adjustment", ["similarity", "2"])
def test_sums_along_the_strip_equal_the_whole_matrices(photos: int, lap: float, adjustment: str) -> None:
    """Covariances from sums over the models, against products of full rows."""
    result = triangulate(without_noise(spec(photos, lap, bands=min(4, photos))), settings(adjustment))
    found = errors_of(result)
    factor = 1.7
    fit = precision.of_parameters(found.errors, found.control, found.fit.operator, factor)
    misclosures = written_out(found.control.rows, found.errors)[:, 0]
    (of_photos,) = found.photos()
    for rows, influence in (
        (every(found.errors.points), found.fit.influence(found.xyz)),
        (of_photos.rows, of_photos.influence),
    ):
        by_control = influence @ found.fit.operator
        by_image = written_out(rows, found.errors) - by_control @ misclosures
        expected = by_image @ by_image.transpose(0, 2, 1)
        expected += (by_control * found.control.variance / factor) @ by_control.transpose(0, 2, 1)
        covariances = precision.covariances(found.errors, rows, fit, influence.__getitem__)
        size = np.sqrt(np.einsum("nii,njj->nij", expected, expected))
        assert np.abs(covariances - expected).max() < 1e-9 * size.max()
        for part in (slice(0, 3), slice(3, 6)):
            block = np.abs(expected[:, part, part])
            if block.size:
                assert covariances[:, part, part] == pytest.approx(expected[:, part, part], abs=1e-8 * block.max())


def test_the_operator_makes_the_correction_that_was_made() -> None:
    """Parameters times misclosures of a noisy strip are what the run subtracted."""
    wanted = settings("3")
    inputs = without_noise(spec(9))
    rng = np.random.default_rng(4)
    noisy = inputs.observations.xy + rng.normal(0, 0.005, inputs.observations.xy.shape)
    result = triangulate(replace(inputs, observations=replace(inputs.observations, xy=noisy)), wanted)
    (strip,) = result.strips
    found = errors_of(result)
    similar = strip.absolute.similarity(strip.formed.xyz)
    given = strip.absolute.misclosures[found.control.point, found.control.axis]
    moved = similar - found.fit.influence(found.xyz) @ (found.fit.operator @ given)
    assert moved == pytest.approx(strip.xyz, abs=1e-6)


def test_a_photo_goes_where_all_its_points_go() -> None:
    """Points that move together take the photo with them: the sum over its points is a motion of the whole."""
    result = triangulate(without_noise(spec(6)), settings("similarity"))
    found = errors_of(result)
    centers = result.strips[0].of_photos.resection.centers - found.errors.origin
    (photos,) = found.photos()
    assert photos.rows.by_similarity[:, :3, :3] == pytest.approx(np.broadcast_to(np.eye(3), (6, 3, 3)), abs=1e-9)
    assert photos.rows.by_similarity[:, :3, 6] == pytest.approx(centers, abs=1e-6)
    assert photos.rows.by_similarity[:, 3:, 3:6] == pytest.approx(np.broadcast_to(np.eye(3), (6, 3, 3)), abs=1e-9)
    assert photos.rows.by_similarity[:, 3:, [0, 1, 2, 6]] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ["similarity", "covariance"])
def test_points_without_a_model_have_rows_too(adjustment: str) -> None:
    """A point whose middle measurement is wrong is placed by the outer two; its derivatives against differences."""
    inputs = without_noise(spec(7, 62.0))
    observations = inputs.observations
    counts = np.bincount(observations.point)
    point = int(np.flatnonzero(counts == 3)[5])
    rows = np.flatnonzero(observations.point == point)
    rows = rows[np.argsort(observations.photo[rows])]
    xy = observations.xy.copy()
    xy[rows[1]] += [0.3, 0.4]
    inputs = replace(inputs, observations=replace(observations, xy=xy))
    plain = Settings(adjustment="similarity")
    result = triangulate(inputs, plain)
    formed = result.strips[0].of_photos.formed
    assert set(formed.bridging) == {rows[0], rows[2]}
    found = errors_of(result)
    place = int(np.searchsorted(formed.point, point))
    misclosures = written_out(found.control.rows, found.errors)[:, 0]
    by_image = (
        written_out(every(found.errors.points), found.errors)
        - found.fit.influence(found.xyz) @ found.fit.operator @ misclosures
    )
    for row in (rows[0], rows[2], int(np.flatnonzero(observations.photo == 3)[2])):
        by_points, _ = differenced(result, (int(row), 1), 2e-4)
        image = int(np.flatnonzero(found.errors.images.row == row)[0])
        derivative = by_image[place, :, 2 * image + 1] / found.errors.images.sigma[image, 1]
        assert derivative == pytest.approx(by_points[place], abs=CLOSE * np.abs(by_points).max())
    precise = triangulate(inputs, Settings(adjustment=adjustment)).precision
    assert precise is not None
    sigma = np.sqrt(np.diagonal(precise.points, axis1=1, axis2=2))
    ratio = sigma[place] / np.median(sigma, axis=0)
    assert (ratio > 0.5).all()
    assert (ratio < 3.0).all()
