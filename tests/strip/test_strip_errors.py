"""Errors of a strip against differences of the whole run, and its covariances against derivatives written out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.sparse import csr_array  # noqa: TC002 - loaded anyway

from photostrip.arrays import Floats
from photostrip.geodesy.local_frame import IntermediateFrame
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.precision import fitted, photo_errors
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.pipeline.strip_method import OrientedStrip
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Image, Points, Spec
from photostrip.strip import fitted_strip as module_of_fit
from photostrip.strip import polynomial
from photostrip.strip.fitted_strip import FittedStrip
from photostrip.strip.formed_strip import StripFormationSettings
from photostrip.strip.relative_orientation import RelativeSettings
from photostrip.strip.strip_errors import StripErrors
from tests.loops import nonempty
from tests.simulated import inputs_of

UNSCREENED = RelativeSettings(screening="none")
SIGMA = 0.005  # mm


def spec(photos: int, lap: float = 62.0, *, rows: int = 4, use: dict[str, float] | None = None, bands: int = 4) -> Spec:
    """Give a small strip over a flat world with hills."""
    return Spec(
        flight=Flight(photos=photos, end_lap_percent=lap, heading_deg=70.0),
        points=Points(rows=rows, extra_per_model=2),
        control=Control(per_band=3, bands=bands, check=4, sigma=(0.05, 0.06, 0.08), use=use or {"xyz": 1.0}),
        image=Image(SIGMA * 1000),
    )


def without_noise(wanted: Spec) -> Inputs:
    """Give the inputs of a strip with true coordinates, and the standard deviations it would have."""
    control = replace(wanted.control, noise=(0.0, 0.0, 0.0))
    inputs = inputs_of(simulate(replace(wanted, image=Image(0.0), control=control)))
    sigma = np.full((len(inputs.observations), 2), wanted.image.sigma_um / 1000)
    return replace(inputs, observations=replace(inputs.observations, sigma=sigma))


def fitted_strip(result: Result, factor: float = 1.0) -> FittedStrip:
    """Errors of the first strip of a result after its fit to the control, before which it lay there undeformed."""
    strip = result.strips[0]
    oriented = OrientedStrip(
        stage=strip.of_photos,
        frames=result.frames,
        control=strip.control,
        control_rows=strip.control_rows,
        intermediate=strip.intermediate,
        absolute=strip.absolute,
        precision=strip.precision,
        settings=result.settings.absolute,
    )
    return fitted(strip, oriented, result.refined.observations, factor)


def written_out(errors: StripErrors, rows: csr_array) -> Floats:
    """Derivatives of sparse rows by all errors: each frame is the sum of the steps before it."""
    components = errors.components.toarray().reshape(errors.models, 6, -1)
    steps, elements = errors.steps @ components, components[:, :5]
    frames = np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])
    count = steps.shape[2]
    return np.asarray(rows @ np.concatenate([frames.reshape(-1, count), elements.reshape(-1, count), np.eye(count)]))


@dataclass(frozen=True, eq=False)
class Placed:
    """Points and photos of a result in the axes of one intermediate frame."""

    points: Floats
    centers: Floats
    rotations: Floats

    @classmethod
    def of(cls, result: Result, frame: IntermediateFrame) -> Placed:
        """Bring a result into a frame."""
        strip = result.strips[0]
        there = strip.intermediate
        centers = there.cartesian_from_intermediate(strip.resection.centers)
        return cls(
            frame.intermediate_from_cartesian(strip.cartesian),
            frame.intermediate_from_cartesian(centers),
            frame.intermediate_rotations(there.cartesian_rotations(strip.resection.rotations)),
        )

    def minus(self, other: Placed) -> tuple[Floats, Floats]:
        """Differences of points (q, 3) and of photos (m, 6): centres and small rotations."""
        turn = self.rotations @ other.rotations.transpose(0, 2, 1)
        skew = (turn - turn.transpose(0, 2, 1)) / 2
        vector = np.column_stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])
        return self.points - other.points, np.column_stack([self.centers - other.centers, vector])


def differenced(result: Result, image: tuple[int, int], step: float) -> tuple[Floats, Floats]:
    """Central difference of the whole run by one image coordinate, per mm."""
    inputs, placed = result.inputs, []
    for sign in (1, -1):
        xy = inputs.observations.xy.copy()
        xy[image] += sign * step
        placed.append(_again(result, replace(inputs, observations=replace(inputs.observations, xy=xy))))
    points, photos = placed[0].minus(placed[1])
    return points / (2 * step), photos / (2 * step)


def _again(result: Result, inputs: Inputs) -> Placed:
    """Run with other inputs, without what it says of its precision, in the frame of a run."""
    settings = replace(result.settings, precision=False)
    return Placed.of(triangulate(inputs, settings), result.strips[0].intermediate)


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
    monkeypatch.setattr(module_of_fit, "AT_A_TIME", 20 * photos)
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
