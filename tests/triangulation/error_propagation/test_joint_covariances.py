"""Joint covariances of coordinates along a strip against products of full rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.triangulation.error_propagation import covariances as precision
from photostrip.triangulation.error_propagation import joint_covariances
from tests.derivatives import UNSCREENED, errors_of, spec, without_noise, written_out
from tests.loops import nonempty

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from photostrip.triangulation.error_propagation.derivatives import ErrorRows, PointRows

pytestmark = pytest.mark.usefixtures("_no_findings")

CLOSE = 1e-10  # of the largest standard deviations: sums of thousands of products agree so far


def single(points: PointRows, some: np.ndarray) -> ErrorRows:
    """Coordinates of points in random directions, three of each, in no order."""
    rng = np.random.default_rng(3)
    rows = rng.permutation(np.repeat(some, 3))
    direction = rng.normal(size=(len(rows), 3))
    return points.take(rows).along(direction / np.linalg.norm(direction, axis=1)[:, None])


def close(found: Floats, expected: Floats) -> bool:
    size = np.sqrt(np.diag(expected))
    return bool((np.abs(found - expected) <= CLOSE * size * size[:, None]).all())


@pytest.mark.parametrize(("photos", "lap"), [(2, 62.0), (3, 62.0), (11, 62.0), (9, 80.0)])
def test_joint_covariances_are_products_of_whole_rows(photos: int, lap: float) -> None:
    """Wherever along the strip the coordinates lie."""
    wanted = Settings(adjustment="polynomial" if photos > 3 else "similarity", relative=UNSCREENED)
    found = errors_of(triangulate(without_noise(spec(photos, lap, bands=min(4, photos))), wanted))
    errors, factor = found.errors, 1.3
    along = precision.along_strip(errors)
    fit = precision.of_parameters(errors, found.control, found.fit.operator, factor)
    misclosures = written_out(found.control.rows, errors)[:, 0]
    count, last = len(errors.points.first), int(errors.points.first.max())
    late = np.flatnonzero(errors.points.first >= last - 1)
    for some in nonempty([np.arange(count), late, np.array([0, count - 1])]):
        rows = single(errors.points, some)
        whole = written_out(rows, errors)[:, 0]
        assert close(joint_covariances.joint_covariance(errors, rows, along), whole @ whole.T)
        influence = np.random.default_rng(5).normal(size=(len(rows.first), len(found.fit.operator)))
        by_control = influence @ found.fit.operator
        left = whole - by_control @ misclosures
        expected = left @ left.T + (by_control * found.control.variance / factor) @ by_control.T
        assert close(joint_covariances.after_fit(errors, rows, fit, influence), expected)
