"""Control left out of the solved system against the same strip solved without it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from photostrip.triangulation.covariance_adjustment import (
    conditions,
    prediction,
    relinearisation,
    system,
)
from photostrip.triangulation.covariance_adjustment.left_out import Without, _predicted, left_out_errors
from tests.loops import nonempty
from tests.triangulation.covariance_adjustment.strip_rows import errors_of
from tests.triangulation.covariance_adjustment.test_covariance_adjustment import noisy

pytestmark = pytest.mark.usefixtures("_no_findings")
FACTOR = 1.3


@pytest.mark.parametrize(("photos", "lap"), [(5, 62.0), (9, 80.0)])
def test_groups_are_predicted_as_without_them(photos: int, lap: float) -> None:
    result = noisy(photos, lap, 4)
    (strip,), found = result.strips, errors_of(result)
    control = found.control
    given = strip.absolute.misclosures[control.point, control.axis]
    parts = (found.errors, strip.of_photos.orientation, strip.of_photos.formed)
    solved = system.system(found.errors, conditions.conditions(*parts, control, given), FACTOR)
    groups = [np.flatnonzero(np.isin(control.point, rows)) for rows in ([0], [3, 4, 5], [7])]
    for rows, left_out in nonempty(zip(groups, left_out_errors(solved, groups), strict=True)):
        rest = np.setdiff1d(np.arange(len(given)), rows)
        without = conditions.conditions(*parts, control.take(rest), given[rest])
        rest_alone, there = system.system(found.errors, without, FACTOR), found.along(control.take(rows))
        images = relinearisation.image_errors(rest_alone)
        predicted = prediction.errors(rest_alone, rest_alone.errors.points, images)[strip.control_rows]
        along = np.einsum("wi,wi->w", control.direction[rows], predicted[control.point[rows]])
        error = given[rows] - along
        assert left_out.errors == pytest.approx(error, abs=1e-7)
        variance = prediction.covariances(rest_alone, there)[:, 0, 0] + control.variance[rows] / FACTOR
        if len(rows) == 1:
            assert left_out.squares == pytest.approx(error[0] ** 2 / variance[0])
        assert left_out.squares > 0


def test_a_strip_predicts_the_same_in_parts_of_which_some_hold_no_wanted_coordinate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A strip of 200 photos with ten check points ended as an internal error."""
    result = noisy(9, 80.0, 4)
    (strip,), found = result.strips, errors_of(result)
    given = strip.absolute.misclosures[found.control.point, found.control.axis]
    parts = (found.errors, strip.of_photos.orientation, strip.of_photos.formed)
    solved = system.system(found.errors, conditions.conditions(*parts, found.control, given), FACTOR)
    wanted = found.along(found.control.take(np.arange(3)))
    at_once = prediction.joint_covariance(solved, wanted)
    every = found.errors.points
    covariances = prediction.covariances(solved, every)
    monkeypatch.setattr(system, "AT_A_TIME", 1)
    assert prediction.joint_covariance(solved, wanted) == pytest.approx(at_once)
    assert prediction.covariances(solved, every) == pytest.approx(covariances)
    again = system.system(found.errors, solved.conditions, FACTOR)
    assert again.solution == pytest.approx(solved.solution)
    assert again.correlates == pytest.approx(solved.correlates)


def test_parts_are_bounded_however_many_points_begin_in_a_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1500 points a model in 12 photos of 92 % nearly all begin in the first: they took 775 MB together."""
    result = noisy(9, 80.0, 4)
    (strip,), found = result.strips, errors_of(result)
    given = strip.absolute.misclosures[found.control.point, found.control.axis]
    wanted = conditions.conditions(
        found.errors, strip.of_photos.orientation, strip.of_photos.formed, found.control, given
    )
    assert np.bincount(wanted.base).max() > 12
    monkeypatch.setattr(system, "AT_A_TIME", 12)
    parts = list(system.system(found.errors, wanted, FACTOR).roots.pieces())
    assert (parts[0].start, parts[-1].stop) == (0, len(wanted.point))
    for before, after in nonempty(pairwise(parts)):
        assert before.stop == after.start
        assert wanted.point[before.stop - 1] != wanted.point[after.start]
        assert before.stop - before.start <= 12


def test_control_that_alone_holds_the_strip_cannot_be_predicted() -> None:
    result = noisy(4, 62.0, 3)
    (strip,), found = result.strips, errors_of(result)
    some = found.control.take(np.flatnonzero(found.control.point < 3))  # one band
    given = strip.absolute.misclosures[some.point, some.axis]
    wanted = conditions.conditions(found.errors, strip.of_photos.orientation, strip.of_photos.formed, some, given)
    (left_out,) = left_out_errors(system.system(found.errors, wanted, 1.0), [np.arange(6)])
    assert not np.isfinite(left_out.errors).any()


def test_a_coordinate_of_no_information_cannot_be_predicted() -> None:
    """Image coordinates in another unit left such a one, and a warning of numpy in the user's face."""
    left_out = _predicted(np.array([[0.0, 1e-9], [1e-9, 1.0]]), np.ones(2))
    assert not np.isfinite(left_out.errors).any()


def test_points_that_take_no_part_have_the_covariances_of_an_adjustment_without_them() -> None:
    result = noisy(5, 62.0, 4)
    (strip,), found = result.strips, errors_of(result)
    control = found.control
    given = strip.absolute.misclosures[control.point, control.axis]
    parts = (found.errors, strip.of_photos.orientation, strip.of_photos.formed)
    solved = system.system(found.errors, conditions.conditions(*parts, control, given), FACTOR)
    gone = np.flatnonzero(np.isin(control.point, [1, 4, 7]) & ~((control.point == 4) & (control.axis == 2)))
    rest = np.setdiff1d(np.arange(len(given)), gone)
    alone = system.system(found.errors, conditions.conditions(*parts, control.take(rest), given[rest]), FACTOR)
    left_out = Without.of(solved, gone)
    points, covariance = left_out.points(control, FACTOR)
    assert points.tolist() == [1, 7]  # the height of point 4 takes part
    there = control.take(np.flatnonzero(np.isin(control.point, points)))
    direction = there.direction.reshape(2, 3, 3)
    along = np.einsum("pai,piqj,qbj->paqb", direction, covariance, direction)
    assert along.reshape(6, 6) == pytest.approx(
        prediction.joint_covariance(alone, found.along(there)), rel=1e-6, abs=1e-9
    )
    of_height = Without.of(solved, np.flatnonzero((control.point == 4) & (control.axis == 2)))
    assert of_height.points(control, FACTOR).covariance.shape == (0, 3, 0, 3)
    change = left_out.columns.columns @ left_out.inverse @ solved.correlates[left_out.rows]
    assert left_out.change.solution == pytest.approx(-change, abs=1e-9)
