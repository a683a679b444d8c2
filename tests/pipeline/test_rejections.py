"""What is rejected depends on the measurements alone: not on the order of rows, on names, or on threads."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.formats.result_files import csv_pieces
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, GrossError, Points, Spec
from tests.loops import nonempty
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Inputs
    from photostrip.simulation.simulation import Simulation

pytestmark = pytest.mark.usefixtures("_no_findings")

STAGES = {"relative", "rays", "control"}


@cache
def flown() -> Simulation:
    """A strip of eight photos with gross errors of all sizes and a wrong control coordinate."""
    errors = [GrossError("image", count=3, size_um=size) for size in (60.0, 500.0, 8000.0)]
    return simulate(
        Spec(
            seed=5,
            flight=Flight(photos=8),
            points=Points(extra_per_model=8),
            control=Control(layout="bands", bands=4, per_band=3),
            gross_errors=(*errors, GrossError("control", size_m=6.0)),
        )
    )


def rejected(inputs: Inputs, adjustment: str = "auto") -> str:
    """Give rejected.csv."""
    settings = replace(settings_of(flown()), adjustment=adjustment)
    return "".join(csv_pieces(document_of(triangulate(inputs, settings))["rejected"]))


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def shuffled(inputs: Inputs, seed: int) -> Inputs:
    """Give the same measurements and control in another order, photos and points numbered anew."""
    rng = np.random.default_rng(seed)
    o, control = inputs.observations, inputs.control
    order = rng.permutation(len(o.point))
    photo, point = rng.permutation(len(o.photo_ids)), rng.permutation(len(o.point_ids))
    moved = replace(
        o,
        photo_ids=tuple(o.photo_ids[number] for number in photo),
        point_ids=tuple(o.point_ids[number] for number in point),
        photo=np.argsort(photo)[o.photo[order]],
        point=np.argsort(point)[o.point[order]],
        xy=o.xy[order],
        sigma=o.sigma[order],
    )
    return replace(inputs, observations=moved, control=control.take(rng.permutation(len(control))))


def renamed(inputs: Inputs) -> tuple[Inputs, dict[str, str]]:
    """Give every photo and every point another name, so that the order of the names is turned round."""
    o, control = inputs.observations, inputs.control
    names = sorted({*o.photo_ids, *o.point_ids, *control.ids})
    new = {name: f"n{len(names) - number:04d}" for number, name in enumerate(names)}

    def told(ids: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(new[name] for name in ids)

    strips = tuple(replace(strip, photos=told(strip.photos)) for strip in inputs.strips)
    observations = replace(o, photo_ids=told(o.photo_ids), point_ids=told(o.point_ids))
    return replace(inputs, strips=strips, observations=observations, control=replace(control, ids=told(control.ids))), {
        after: before for before, after in new.items()
    }


@pytest.mark.slow
def test_there_is_something_to_reject() -> None:
    found = rows(rejected(inputs_of(flown()), "polynomial"))
    assert {row["stage"] for row in found} >= STAGES
    for row in nonempty(found):
        assert float(row["size"]) != 0 or row["stage"] == "rays"
        assert row["size_unit"] == ("m" if row["stage"] == "control" else "um")
        assert (row["zone"] == "") == (row["stage"] == "control")
        assert row["readmitted"] in "01"
        assert row["value"]
        assert row["limit"]
    injected = {(error.photo, error.point) for error in flown().truth.errors if error.kind == "image"}
    blamed = {(row["blamed"], row["point"]) for row in found if row["blamed"]}
    assert len(blamed) >= 3
    assert blamed <= injected  # nobody else is blamed


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "adjustment"), [(1, "polynomial"), (2, "bundle")])
def test_the_order_of_rows_does_not_decide(seed: int, adjustment: str) -> None:
    inputs = inputs_of(flown())
    assert rejected(shuffled(inputs, seed), adjustment) == rejected(inputs, adjustment)


@pytest.mark.slow
def test_names_do_not_decide() -> None:
    inputs, old = renamed(inputs_of(flown()))
    columns = ("photo", "other_photo", "point", "blamed")
    found = [
        {key: old.get(value, value) if key in columns else value for key, value in row.items() if key != "reason"}
        for row in rows(rejected(inputs))
    ]
    expected = [
        {key: value for key, value in row.items() if key != "reason"} for row in rows(rejected(inputs_of(flown())))
    ]
    assert sorted(found, key=repr) == sorted(expected, key=repr)
