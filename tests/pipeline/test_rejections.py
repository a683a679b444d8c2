"""What is rejected depends on the measurements alone: not on the order of rows, on names, or on threads.

Measurements that the user keeps or drops, whatever the tests say.

A strip too long for the standard deviations of a polynomial says so, and what has them.
"""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.formats.result_files import csv_pieces
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, GrossError, Points, Spec, simulate
from photostrip.strip.relative_orientation import RelativeSettings as Relative
from tests.loops import nonempty
from tests.pipeline.blocks import measured, note
from tests.simulated import inputs_of, settings_of
from tests.strips import Flown, control_points, fly, project

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Inputs
    from photostrip.simulation import Simulation


pytestmark = pytest.mark.usefixtures("_no_findings")

STAGES = {"relative", "rays", "control"}


@cache
def flown() -> Simulation:
    """A strip of eight photos with gross errors of all sizes and a wrong control coordinate."""
    errors = [GrossError("image", count=3, size_um=size) for size in (60.0, 500.0, 8000.0)]
    points, control = Points(extra_per_model=8), Control(layout="bands", bands=4, per_band=3)
    wrong = (*errors, GrossError("control", size_m=6.0))
    return simulate(Spec(seed=5, flight=Flight(photos=8), points=points, control=control, gross_errors=wrong))


def rejected(inputs: Inputs, adjustment: str = "auto") -> str:
    """Give rejected.csv."""
    settings = replace(settings_of(flown()), adjustment=adjustment)
    return "".join(csv_pieces(document_of(triangulate(inputs, settings))["rejected"]))


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def shuffled(inputs: Inputs, seed: int) -> Inputs:
    """Give the same measurements and control in another order, photos and points numbered anew."""
    rng, control = np.random.default_rng(seed), inputs.control
    o = measured(inputs.observations, rng.permutation(len(inputs.observations)))
    photo, point = rng.permutation(len(o.photo_ids)), rng.permutation(len(o.point_ids))
    o = replace(o, photo=np.argsort(photo)[o.photo], photo_ids=tuple(o.photo_ids[row] for row in photo))
    anew = replace(o, point=np.argsort(point)[o.point], point_ids=tuple(o.point_ids[row] for row in point))
    return replace(inputs, observations=anew, control=control.take(rng.permutation(len(control))))


def renamed(inputs: Inputs) -> tuple[Inputs, dict[str, str]]:
    """Give every photo and every point another name, so that the order of the names is turned round."""
    o, control = inputs.observations, inputs.control
    names = sorted({*o.photo_ids, *o.point_ids, *control.ids})
    new = {name: f"n{len(names) - number:04d}" for number, name in enumerate(names)}

    def told(ids: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(new[name] for name in ids)

    strips = tuple(replace(strip, photos=told(strip.photos)) for strip in inputs.strips)
    table = replace(o, photo_ids=told(o.photo_ids), point_ids=told(o.point_ids))
    given = replace(control, ids=told(control.ids))
    old = {after: before for before, after in new.items()}
    return replace(inputs, strips=strips, observations=table, control=given), old


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

    def without_reason(inputs: Inputs) -> list[dict[str, str]]:
        return [{key: value for key, value in row.items() if key != "reason"} for row in rows(rejected(inputs))]

    found = [
        {key: old.get(value, value) if key in columns else value for key, value in row.items()}
        for row in without_reason(inputs)
    ]
    assert sorted(found, key=repr) == sorted(without_reason(inputs_of(flown())), key=repr)


WRONG = ("105", "p4_1")


def spoiled() -> Flown:
    strip = fly(3, 7, sigma=0.005, extra=60)
    o = strip.observations
    row = np.flatnonzero((o.photo == o.photo_ids.index(WRONG[0])) & (o.point == o.point_ids.index(WRONG[1])))
    xy = o.xy.copy()
    xy[row, 1] += 0.4
    return replace(strip, observations=replace(o, xy=xy))


def adjusted(keep: tuple[str, ...] = (), drop: tuple[str, ...] = ()) -> Result:
    strip = spoiled()
    control = control_points({name: strip.xyz[strip.at[name]] for name in strip.bands(0, 3, 6)})
    return triangulate(project(strip, control), Settings(relative=Relative(keep=list(keep), drop=list(drop))))


def in_use(result: Result, photo: str, point: str) -> bool:
    o, oriented = result.refined.observations, result.strips[0].of_photos.orientation
    (row,) = np.flatnonzero((o.photo == o.photo_ids.index(photo)) & (o.point == o.point_ids.index(point)))
    return bool((oriented.used & (oriented.rows == row).any(axis=1)).any())


@pytest.mark.slow
def test_a_measurement_that_is_kept_stays_in_use_and_is_reported() -> None:
    result = adjusted(keep=("105/p4_1",))
    assert in_use(result, *WRONG)
    assert "105/p4_1" in note(result, "user-keep").message
    back = [r for r in result.strips[0].of_photos.rejections if r.readmitted]
    assert {int(result.strips[0].of_photos.orientation.point[r.row]) for r in back} == {
        result.refined.observations.point_ids.index("p4_1")
    }


@pytest.mark.slow
def test_a_measurement_that_is_dropped_takes_no_part_and_is_reported() -> None:
    assert in_use(adjusted(), "103", "p2_0")
    result = adjusted(drop=("103/p2_0",))
    assert not in_use(result, "103", "p2_0")
    assert [each.code for each in result.notes if each.code.startswith("user-")] == ["user-drop"]


@pytest.mark.parametrize(
    ("keep", "drop", "words"),
    [
        (("105/nobody",), (), "names no measurement"),
        ((), ("999/p4_1",), "names no measurement"),
        (("103/p2_0",), ("103/p2_0",), "kept and dropped"),
    ],
)
def test_entries_that_make_no_sense_are_refused(keep: tuple[str, ...], drop: tuple[str, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        adjusted(keep, drop)


def test_beyond_400_photos_a_polynomial_asks_for_the_bundle() -> None:
    spec = Spec(flight=Flight(photos=401), points=Points(extra_per_model=1), control=Control(every=20, check=5))
    result = triangulate(inputs_of(simulate(spec)), Settings(adjustment="polynomial"))
    message = note(result, "no-precision").message
    assert "strip A has 401 photos" in message
    assert "`processing.adjustment: bundle`" in message
    document = document_of(result)
    assert "precision" not in document
    assert {point["sigma_z"] for point in document["points"]} == {None}
