"""Points and their tables: read-only, joined by id, never across frames."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.points import ControlPoints, PhotoPoints, PointTable, frozen, frozen_alike, locate, located


def table(ids: list[str] | tuple[str, ...]) -> PointTable:
    return PointTable(tuple(ids), np.arange(3 * len(ids), dtype=float))


def control(n: int = 4) -> ControlPoints:
    enu = np.arange(3.0 * n).reshape(n, 3)
    enu[1:2, :2] = np.nan
    use = ~np.isnan(enu)
    check = np.arange(n) % 2 == 1
    return ControlPoints(tuple("ABCDEFGH"[:n]), enu, use, check, np.full((n, 3), 0.05), np.arange(n))


@pytest.mark.parametrize("wanted", [("c", "a"), ("b",), ("x", "c")])
def test_places_that_are_kept_are_those_of_the_ids_asked_for_and_cannot_be_written(wanted: tuple[str, ...]) -> None:
    ids = ("a", "b", "c")
    assert located(wanted, ids).tolist() == located(wanted, ids).tolist() == locate(wanted, ids).tolist()
    assert located(wanted, ids[::-1]).tolist() == locate(wanted, ids[::-1]).tolist()
    with pytest.raises(ValueError, match="read-only"):
        located(wanted, ids)[0] = 5


# ----------------------------------------------------------------------------------------------- frozen


def test_frozen_arrays_cannot_be_written() -> None:
    array = frozen([1, 2, 3])
    assert array.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 5
    with pytest.raises(ValueError, match="read-only"):
        frozen(np.zeros(3))[0] = 5
    assert frozen(array) is array  # nothing is copied twice


@pytest.mark.parametrize("rows", [[[0.1, 0.2]] * 4, [[0.1, 0.2]] * 3 + [[0.1, 0.3]], [[np.nan, 1.0]] * 2, [], [[1, 2]]])
def test_a_column_of_one_value_is_held_once(rows: list[list[float]]) -> None:
    held = frozen_alike(rows, float, (len(rows), 2))
    assert np.array_equal(held, np.reshape(rows, (-1, 2)), equal_nan=True)
    assert not held.flags.writeable
    assert (held.strides[0] == 0) == (rows == [[0.1, 0.2]] * 4)
    assert held[np.array([0, len(rows) - 1])].flags.c_contiguous if rows else not len(held)
    assert frozen_alike([3, 3], np.intp, (2,)).dtype == np.intp
    assert frozen_alike([3, 4], np.intp, (2,)).dtype == np.intp


def test_frozen_leaves_the_caller_his_array() -> None:
    own = np.zeros(3)
    frozen(own)
    own[0] = 1  # still his to write
    assert own.flags.writeable


def test_frozen_brings_any_layout_into_shape() -> None:
    turned = frozen(np.arange(6).reshape(2, 3).T)
    assert turned.flags.c_contiguous
    assert turned.shape == (3, 2)
    assert frozen([], shape=(0, 3)).shape == (0, 3)
    assert frozen([True, False], dtype=np.bool_).dtype == np.bool_


# ------------------------------------------------------------------------------------------- PointTable


def test_rows_are_found_by_id_and_cannot_be_changed() -> None:
    points = table(["0123", "123", "NO"])
    assert locate(["123", "0123", "23"], points.ids).tolist() == [1, 0, -1]  # ids are text: 0123 is not 123
    assert points.xyz.shape == (3, 3)
    with pytest.raises(ValueError, match="read-only"):
        points.xyz[0, 0] = 1


def test_coordinates_must_fit_the_ids() -> None:
    with pytest.raises(ValueError, match="reshape"):
        PointTable(("1", "2"), np.zeros((3, 3)))


# ------------------------------------------------------------------------------------------ PhotoPoints


def test_image_points_are_columns() -> None:
    points = PhotoPoints(("1",), ("a", "b"), np.array([0, 0]), np.array([0, 1]), np.zeros((2, 2)), np.ones((2, 2)))
    assert len(points) == 2
    for column in (points.photo, points.point, points.xy, points.sigma):
        assert not column.flags.writeable
    with pytest.raises(ValueError, match="reshape"):
        PhotoPoints(("1",), ("a",), np.array([0]), np.array([0]), np.zeros((2, 2)), np.ones((1, 2)))


# ---------------------------------------------------------------------------------------- ControlPoints


@given(st.lists(st.booleans(), min_size=4, max_size=4))
def test_rows_taken_by_mask_or_number_are_the_same(mask: list[bool]) -> None:
    points = control()
    numbers = np.flatnonzero(mask)
    by_mask, by_number = points.take(np.array(mask)), points.take(numbers)
    for part in (by_mask, by_number):
        assert part.ids == tuple(points.ids[i] for i in numbers)
        assert np.array_equal(part.enu, points.enu[numbers], equal_nan=True)
        assert np.array_equal(part.use, points.use[numbers])
        assert np.array_equal(part.check, points.check[numbers])
        assert np.array_equal(part.sigma, points.sigma[numbers])
        assert np.array_equal(part.frame, points.frame[numbers])


def test_rows_keep_the_order_asked_for() -> None:
    assert control().take([3, 0]).ids == ("D", "A")
    assert len(control().take(np.zeros(0, np.intp))) == 0
    assert len(control(0).take(np.zeros(0, np.intp))) == 0


def test_one_ground_frame_when_none_is_said() -> None:
    points = ControlPoints(("A", "B"), np.zeros((2, 3)), np.ones((2, 3), bool), np.zeros(2, bool), np.ones((2, 3)))
    assert np.array_equal(points.frame, [0, 0])
    for column in (points.enu, points.use, points.check, points.sigma, points.frame):
        assert not column.flags.writeable
