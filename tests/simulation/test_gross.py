"""Gross errors stand exactly where the truth says, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.points import locate
from photostrip.simulation import (
    Control,
    Flight,
    GrossError,
    Ground,
    Image,
    InjectedError,
    Simulation,
    Spec,
    simulate,
)
from tests.loops import nonempty

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
