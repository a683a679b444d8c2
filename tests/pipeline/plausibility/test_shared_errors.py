"""What all camera positions share, or all photos of a camera, is named as such and costs no good observation."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import CameraPositions
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, GrossError, Spec, Terrain
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Gnss
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.pipeline.results import Result
    from photostrip.simulation.simulation import Simulation


def adjusted(
    *,
    strips: int = 2,
    shift: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    distance: float = 1.0,
    seed: int = 7,
    control: Control | None = None,
    use: tuple[bool, bool, bool] = (True, True, True),
    rows: slice | np.ndarray = slice(None),
) -> tuple[Simulation, Result]:
    """Adjust a block whose control stands at both ends, with measured camera positions that are shifted."""
    flight = Flight(photos=10, strips=strips)
    simulation = simulate(Spec(seed=seed, flight=flight, control=control or Control(bands=2), gnss=Gnss()))
    inputs, photos = inputs_of(simulation), simulation.truth.photo_ids
    assert simulation.gnss is not None
    inputs = replace(
        inputs,
        strips=tuple(
            replace(each, camera=replace(each.camera, principal_distance=each.camera.principal_distance * distance))
            for each in inputs.strips
        ),
        positions=CameraPositions(
            photos=photos,
            frame=inputs.frames[0],
            enu=simulation.gnss[rows] + np.asarray(shift, float),
            use=np.tile(use, (len(photos), 1)),
            sigma=np.tile((0.10, 0.10, 0.15), (len(photos), 1)),
            time=np.full(len(photos), np.nan),
        ),
    )
    return simulation, triangulate(inputs, replace(settings_of(simulation), adjustment="bundle"))


def rms(simulation: Simulation, result: Result) -> float:
    """Root mean square distance of the adjusted points from their true places, metres."""
    truth = dict(zip(simulation.truth.points.ids, simulation.truth.points.xyz, strict=True))
    names = result.refined.observations.point_ids
    rows = [row for row, number in enumerate(result.points.number.tolist()) if names[number] in truth]
    off = [result.points.cartesian[row] - truth[names[int(result.points.number[row])]] for row in rows]
    return float(np.sqrt((np.array(off) ** 2).sum(axis=1).mean()))


def lost(result: Result) -> list[str]:
    """Kinds of the given coordinates that were taken out."""
    assert result.bundle is not None
    return [each.kind for each in result.bundle.screened.rejections if each.kind != "image" and not each.readmitted]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("strips", "shift"), [(1, (10.0, 0.0, 0.0)), (2, (7.0, -7.0, 0.0)), (1, (0.0, 0.0, 10.0)), (1, (0.0, 0.0, -600.0))]
)
def test_a_common_offset_of_the_positions_is_named_and_taken_up(strips: int, shift: tuple[float, float, float]) -> None:
    """Tested one by one, 12 control coordinates and 23 positions went, and points were 7 to 10 m off."""
    simulation, result = adjusted(strips=strips, shift=shift)
    (finding,) = result.findings
    assert finding.code == "P208"
    assert finding.key == "camera_positions.correction"
    assert "`correction: offset`" in finding.message
    assert [finding.evidence[f"offset_{axis}_m"] for axis in ("east", "north", "up")] == pytest.approx(shift, abs=0.6)
    assert lost(result) == []
    assert rms(simulation, result) < 0.4


@pytest.mark.slow
def test_a_drift_of_the_positions_is_named() -> None:
    """Half a metre from photo to photo."""
    _, result = adjusted(strips=1, shift=np.arange(10)[:, None] * np.array([0.5, 0.0, 0.2]))
    (finding,) = result.findings
    assert "`correction: drift`" in finding.message
    assert finding.evidence["drift_east_m"] == pytest.approx(4.5, abs=0.3)
    assert lost(result) == []


HILLS = Spec(seed=5, flight=Flight(photos=8), control=Control(bands=4), terrain=Terrain(relief=150.0))


def on_hills(share: float, *errors: GrossError) -> Result:
    """Adjust a strip over hills by the strip method."""
    simulation = simulate(replace(HILLS, gross_errors=errors))
    inputs = inputs_of(simulation)
    (strip,) = inputs.strips
    camera = replace(strip.camera, principal_distance=strip.camera.principal_distance * (1.0 + share))
    return triangulate(replace(inputs, strips=(replace(strip, camera=camera),)), settings_of(simulation))


@pytest.mark.parametrize("share", [-0.01, 0.02])
def test_the_strip_method_names_a_principal_distance_off_by_a_percent(share: float) -> None:
    """Control was rejected one by one, or bent the strip, and heights were off by a metre."""
    result = on_hills(share)
    (finding,) = result.findings
    assert finding.code == "P107"
    assert finding.key == "cameras.film.principal_distance"
    assert finding.evidence["would_fit_mm"] == pytest.approx(153.0, abs=0.4)
    assert result.strips[0].wrong_control == ()


@pytest.mark.parametrize(
    ("rows", "order"),
    [
        (slice(None, None, -1), "reversed"),
        (np.arange(10) - 1, "backwards"),
        ((np.arange(10) + 1) % 10, "forwards"),
        (np.array([0, 1, 2, 6, 4, 5, 3, 7, 8, 9]), "exchanged"),
    ],
)
def test_positions_of_other_photos_are_named_and_put_right(rows: slice | np.ndarray, order: str) -> None:
    """Sound control was blamed, or the adjustment did not converge."""
    simulation, result = adjusted(strips=1, rows=rows)
    (finding,) = result.findings
    assert finding.code == "P208"
    assert finding.key == "camera_positions"
    assert finding.evidence["order"] == order
    moved = np.flatnonzero(np.arange(10)[rows] != np.arange(10)) if order == "exchanged" else np.arange(10)
    assert finding.photos == tuple(simulation.truth.photo_ids[row] for row in moved)
    assert [kind for kind in lost(result) if kind == "control"] == []
    assert rms(simulation, result) < 1.2 * rms(*adjusted(strips=1))


@pytest.mark.parametrize("adjustment", ["auto", "polynomial"])
def test_what_is_given_in_height_only_may_be_of_another_kind(adjustment: str) -> None:
    """Benchmarks above the geoid beside points from GNSS above the ellipsoid, in one list."""
    made = simulate(Spec(seed=5, flight=Flight(photos=10), control=Control(every=3, use={"xyz": 0.6, "z": 0.4})))
    inputs = inputs_of(made)
    only = inputs.control.use[:, 2] & ~inputs.control.use[:, 0] & ~inputs.control.check
    enu = inputs.control.enu + np.outer(only, [0.0, 0.0, 31.0])
    wrong = replace(inputs, control=replace(inputs.control, enu=enu))
    result = triangulate(wrong, replace(settings_of(made), adjustment=adjustment))
    (finding,) = [each for each in result.findings if each.code == "P404"]
    assert "what is given in height only" in finding.message
    assert set(finding.points) <= {inputs.control.ids[row] for row in np.flatnonzero(only)}
    assert finding.evidence["offset_up_m"] == pytest.approx(31.0, abs=0.5)
    assert {each.code for each in result.findings} == {"P404"}
