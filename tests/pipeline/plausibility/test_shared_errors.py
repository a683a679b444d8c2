"""What all camera positions share, or all photos of a camera, is named as such and costs no good observation.

A control list that lies beside the others as a whole is named as such, and none of its points alone.

One id for two points in two strips is named; a wrong image coordinate of a tie is not taken for it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import CameraPositions
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Gnss, GrossError, Points, Spec, Terrain, simulate
from tests.loops import nonempty
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import Result
    from photostrip.simulation import Simulation


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


def two_lists(shift: Sequence[float]) -> Result:
    """Adjust a strip of which every third control point stands in a second list, shifted as a whole."""
    spec = Spec(seed=3, flight=Flight(photos=10), control=Control(bands=4))
    simulation = simulate(spec)
    inputs = inputs_of(simulation)
    control = inputs.control
    second = np.arange(len(control)) % 3 == 0
    control = replace(control, frame=second.astype(np.intp), enu=control.enu + np.outer(second, shift))
    frames = (inputs.frames[0], replace(inputs.frames[0]))
    return triangulate(replace(inputs, control=control, frames=frames), settings_of(simulation))


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "code", "axes"), [((2.0, 1.0, 0.0), "P407", 3), ((0.0, 0.0, 2.0), "P404", 1)])
def test_a_bundle_leaves_the_list_out_as_a_whole(shift: tuple[float, float, float], code: str, axes: int) -> None:
    """Good control of the other list went with it, one point after the other."""
    result = two_lists(shift)
    (finding,) = result.findings
    assert (finding.code, finding.key) == (code, "control[1]")
    assert [finding.evidence[f"offset_{axis}_m"] for axis in ("east", "north", "up")] == pytest.approx(shift, abs=0.3)
    assert finding.message.endswith("cannot be told")  # of two lists
    assert result.strips[0].wrong_control == ()
    assert result.bundle is not None
    screened = result.bundle.screened
    assert screened.rejections == ()
    given = np.isfinite(screened.problem.control.sigma).sum(axis=1)
    assert set(given[screened.problem.control.frame == 1].tolist()) == {3 - axes}
    assert set(given[screened.problem.control.frame == 0].tolist()) == {3}


def with_moved_checks(shift: Sequence[float], count: int, adjustment: str) -> Result:
    """Adjust a strip of which so many of ten check points are shifted."""
    simulation = simulate(Spec(seed=3, flight=Flight(photos=10), control=Control(bands=4)))
    inputs = inputs_of(simulation)
    enu = inputs.control.enu.copy()
    enu[np.flatnonzero(inputs.control.check)[:count]] += shift
    settings = replace(settings_of(simulation), adjustment=adjustment)
    return triangulate(replace(inputs, control=replace(inputs.control, enu=enu)), settings)


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "adjustment"), [((2.0, 1.0, 0.0), "polynomial"), ((0.0, 0.0, 2.0), "bundle")])
def test_check_points_that_lie_beside_the_result_are_named_together(
    shift: tuple[float, float, float], adjustment: str
) -> None:
    """Each looked as bad as the others, so none stood out; a single one is no shift of all."""
    result = with_moved_checks(shift, 10, adjustment)
    (finding,) = result.findings
    assert (finding.code, finding.key) == ("P411", "control[0]")
    assert set(finding.points) == {name for name in result.inputs.control.ids if name.startswith("K")}
    assert [finding.evidence[f"offset_{axis}_m"] for axis in ("east", "north", "up")] == pytest.approx(shift, abs=0.3)
    (line,) = document_of(result)["verdict"]["look_at"]
    assert line.startswith("P411 the check points of control[0] all lie")
    for count in (1, 2):
        assert "P411" not in {each.code for each in with_moved_checks(shift, count, adjustment).findings}


SPEC = Spec(
    seed=3,
    flight=Flight(photos=8, strips=2),
    control=Control(bands=3),
    points=Points(extra_per_model=20),
)


def with_shared_ids(simulation: Simulation, inputs: Inputs, count: int, distance: float) -> tuple[Inputs, set[str]]:
    """Let two ties near each other have one id, the one in the first strip, the other in the second."""
    o = inputs.observations
    truth = dict(zip(simulation.truth.points.ids, simulation.truth.points.xyz, strict=True))
    first = np.isin(o.photo, [o.photo_ids.index(name) for name in inputs.strips[0].photos])
    in_both = (np.bincount(o.point[first], minlength=len(o.point_ids)) > 1) & (
        np.bincount(o.point[~first], minlength=len(o.point_ids)) > 1
    )
    free = np.array([name in truth and name not in inputs.control.ids for name in o.point_ids])
    ties = np.flatnonzero(in_both & free)
    place = np.array([truth[o.point_ids[each]] for each in ties])
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    point, keep, names = o.point.copy(), np.ones(len(o), bool), set()
    for _ in range(count):
        pair = np.unravel_index(int(np.abs(apart - distance).argmin()), apart.shape)
        apart[list(pair)] = np.inf
        apart[:, list(pair)] = np.inf
        one, other = ties[list(pair)].tolist()
        keep &= ~((o.point == one) & ~first) & ~((o.point == other) & first)
        point[(o.point == other) & ~first] = one
        names.add(o.point_ids[one])
    changed = replace(o, photo=o.photo[keep], point=point[keep], xy=o.xy[keep], sigma=o.sigma[keep])
    return replace(inputs, observations=changed), names


@pytest.mark.slow
@pytest.mark.parametrize(("method", "apart"), [("polynomial", 50.0), ("bundle", 50.0), ("bundle", 800.0)])
def test_ids_that_two_strips_share_by_mistake_are_named(method: str, apart: float) -> None:
    """Three ids for points 50 m apart: the run was called good; 800 m apart, a bundle did not converge."""
    simulation = simulate(SPEC)
    inputs, names = with_shared_ids(simulation, inputs_of(simulation), 3, apart)
    result = triangulate(inputs, replace(settings_of(simulation), adjustment=method))
    found = [each for each in result.findings if each.code == "P301"]
    assert {name for each in found for name in each.points} == names
    of_polynomial, height = method == "polynomial", simulation.spec.flying_height
    for each in nonempty(found):  # a bundle compares photos, whatever strips they form
        far = float(each.evidence["distance_m" if of_polynomial else "apart_over_distance"])
        least, by = (0.8, 1.0) if of_polynomial else (0.6, height)  # the cameras are farther away than high
        assert least < far * by / apart < 1.2
        by_strip = [set(each.photos) & set(strip.photos) for strip in inputs.strips]
        assert each.strips == ("A", "B") if of_polynomial else all(by_strip)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 150.0, 400.0])
def test_wrong_image_coordinates_are_no_shared_ids(size: float) -> None:
    """A coordinate along the base that is off moves a point of two rays in one strip only, which is told as such."""
    errors = (GrossError("image", count=8, size_um=size, axis="x"),) if size else ()
    simulation = simulate(replace(SPEC, gross_errors=errors))
    settings = replace(settings_of(simulation), adjustment="polynomial")  # a bundle rejects them
    findings = triangulate(inputs_of(simulation), settings).findings
    assert {each.code for each in findings} == ({"P304"} if size > 200 else set())
    assert {name for each in findings for name in each.points} <= {each.point for each in simulation.truth.errors}
