"""What all positions, photos of a camera or points of a list share is named as such and costs no good observation."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import chi2, norm

from benchmarks import planted
from photostrip.camera import Camera, Distortion
from photostrip.network.hypotheses import log_probability, log_probability_of_any
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import FILM, Control, Flight, Gnss, GrossError, Image, Points, Spec, Terrain, simulate
from tests.loops import nonempty
from tests.pipeline import blocks
from tests.pipeline.blocks import calibrating, errors, lost, measured, moved, offset, rms, with_camera
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import Result
    from photostrip.simulation import Simulation


def adjusted(
    *, strips: int = 2, shift: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0), rows: slice | np.ndarray = slice(None)
) -> tuple[Simulation, Result]:
    """Adjust a block whose control stands at both ends, with measured camera positions that are shifted."""
    simulation = simulate(Spec(seed=7, flight=Flight(photos=10, strips=strips), control=Control(bands=2), gnss=Gnss()))
    inputs = planted.with_gnss(np.random.default_rng(), simulation)
    assert inputs.positions is not None
    read = replace(inputs.positions, enu=inputs.positions.enu[rows] + np.asarray(shift, float))
    return simulation, blocks.adjusted(simulation, replace(inputs, positions=read))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("strips", "shift"), [(1, (10.0, 0.0, 0.0)), (2, (7.0, -7.0, 0.0)), (1, (0.0, 0.0, 10.0)), (1, (0.0, 0.0, -600.0))]
)
def test_a_common_offset_of_the_positions_is_named_and_taken_up(strips: int, shift: tuple[float, float, float]) -> None:
    """Tested one by one, 12 control coordinates and 23 positions went, and points were 7 to 10 m off."""
    simulation, result = adjusted(strips=strips, shift=shift)
    (finding,) = result.findings
    assert (finding.code, finding.key) == ("P208", "camera_positions.correction")
    assert "`correction: offset`" in finding.message
    assert offset(finding) == pytest.approx(shift, abs=0.6)
    assert lost(result, "control", "position") == []
    assert rms(simulation, result) < 0.4


def test_a_drift_of_the_positions_is_named() -> None:
    _, result = adjusted(strips=1, shift=np.arange(10)[:, None] * np.array([0.5, 0.0, 0.2]))
    (finding,) = result.findings
    assert "`correction: drift`" in finding.message
    assert finding.evidence["drift_east_m"] == pytest.approx(4.5, abs=0.3)
    assert lost(result, "control", "position") == []


SCATTER = np.random.default_rng(4).normal(0.0, 20.0 * np.array([0.10, 0.10, 0.15]), (20, 3))  # 20 times as stated
TWO = np.isin(np.arange(20), [4, 15])[:, None] * 3.0 * SCATTER


@pytest.mark.parametrize(
    ("shift", "codes"), [(SCATTER, ["P209"]), (SCATTER + 7, ["P208", "P209"]), (TWO, []), (TWO + 7, ["P208"])]
)
def test_positions_that_scatter_are_told_from_wrong_ones_and_from_an_offset(
    shift: np.ndarray, codes: list[str]
) -> None:
    """Lens, drift and shifted photos were accused, and 60 coordinates were rejected one by one."""
    simulation, result = adjusted(shift=shift)
    assert sorted({each.code for each in result.findings}) == codes
    assert bool(lost(result, "position")) == ("P209" not in codes)
    assert rms(simulation, result) < 0.4
    for finding in [each for each in result.findings if each.code == "P209"]:
        assert finding.key == "camera_positions.sigma"
        factors = [finding.evidence[key] for key in ("factor_east_and_north", "factor_up")]
        assert factors == pytest.approx([20, 20], rel=0.3)


HILLS = Spec(seed=5, flight=Flight(photos=8), control=Control(bands=4), terrain=Terrain(relief=150.0))


@pytest.mark.parametrize("share", [-0.01, 0.02])
def test_the_strip_method_names_a_principal_distance_off_by_a_percent(share: float) -> None:
    """Control was rejected one by one, or bent the strip, and heights were off by a metre."""
    simulation = simulate(HILLS)
    inputs = with_camera(inputs_of(simulation), principal_distance=153.0 * (1.0 + share))
    result = triangulate(inputs, settings_of(simulation))
    (finding,) = result.findings
    assert (finding.code, finding.key) == ("P107", "cameras.film.principal_distance")
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
    assert (finding.code, finding.key) == ("P208", "camera_positions")
    assert finding.evidence["order"] == order
    moved = np.flatnonzero(np.arange(10)[rows] != np.arange(10)) if order == "exchanged" else np.arange(10)
    assert finding.photos == tuple(simulation.truth.photo_ids[row] for row in moved)
    assert lost(result, "control", "position") == []
    assert rms(simulation, result) < 1.2 * rms(*adjusted(strips=1))


@pytest.mark.parametrize("adjustment", ["auto", "polynomial"])
def test_what_is_given_in_height_only_may_be_of_another_kind(adjustment: str) -> None:
    """Benchmarks above the geoid beside points from GNSS above the ellipsoid, in one list."""
    made = simulate(Spec(seed=5, flight=Flight(photos=10), control=Control(every=3, use={"xyz": 0.6, "z": 0.4})))
    inputs = inputs_of(made)
    only = inputs.control.use[:, 2] & ~inputs.control.use[:, 0] & ~inputs.control.check
    result = triangulate(moved(inputs, only, [0, 0, 31]), replace(settings_of(made), adjustment=adjustment))
    (finding,) = result.findings
    assert finding.code == "P404"
    assert "what is given in height only" in finding.message
    assert set(finding.points) <= {inputs.control.ids[row] for row in np.flatnonzero(only)}
    assert finding.evidence["offset_up_m"] == pytest.approx(31.0, abs=0.5)


FOUR_BANDS = Spec(seed=3, flight=Flight(photos=10), control=Control(bands=4))


def two_lists(shift: Sequence[float]) -> Result:
    """Adjust a strip of which every third control point stands in a second list, shifted as a whole."""
    simulation = simulate(FOUR_BANDS)
    inputs = inputs_of(simulation)
    second = np.arange(len(inputs.control)) % 3 == 0
    control = replace(moved(inputs, second, shift).control, frame=second.astype(np.intp))
    frames = (inputs.frames[0], replace(inputs.frames[0]))
    return triangulate(replace(inputs, control=control, frames=frames), settings_of(simulation))


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "code", "axes"), [((2.0, 1.0, 0.0), "P407", 3), ((0.0, 0.0, 2.0), "P404", 1)])
def test_a_bundle_leaves_the_list_out_as_a_whole(shift: tuple[float, float, float], code: str, axes: int) -> None:
    """Good control of the other list went with it, one point after the other."""
    result = two_lists(shift)
    (finding,) = result.findings
    assert (finding.code, finding.key) == (code, "control[1]")
    assert offset(finding) == pytest.approx(shift, abs=0.3)
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
    simulation = simulate(FOUR_BANDS)
    inputs = inputs_of(simulation)
    rows = np.flatnonzero(inputs.control.check)[:count]
    return triangulate(moved(inputs, rows, shift), replace(settings_of(simulation), adjustment=adjustment))


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
    assert offset(finding) == pytest.approx(shift, abs=0.3)
    (line,) = document_of(result)["verdict"]["look_at"]
    assert line.startswith("P411 the check points of control[0] all lie")
    for count in (1, 2):
        assert "P411" not in {each.code for each in with_moved_checks(shift, count, adjustment).findings}


SPEC = replace(
    FOUR_BANDS, flight=Flight(photos=8, strips=2), control=Control(bands=3), points=Points(extra_per_model=20)
)


def with_shared_ids(simulation: Simulation, inputs: Inputs, count: int, distance: float) -> tuple[Inputs, set[str]]:
    """Let two ties near each other have one id, the one in the first strip, the other in the second."""
    o = inputs.observations
    truth = dict(zip(simulation.truth.points.ids, simulation.truth.points.xyz, strict=True))
    first = np.isin(o.photo, [o.photo_ids.index(name) for name in inputs.strips[0].photos])
    times = np.array([np.bincount(o.point[rows], minlength=len(o.point_ids)) for rows in (first, ~first)])
    free = np.array([name in truth and name not in inputs.control.ids for name in o.point_ids])
    ties = np.flatnonzero((times > 1).all(axis=0) & free)
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
    return replace(inputs, observations=measured(replace(o, point=point), keep)), names


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


K1 = -2e-8  # mm^-2: 20 µm at 100 mm
LENS = Distortion("brown", "image_to_ideal", k=(K1, 0.0, 0.0))


def strip_of(seed: int, photos: int = 30, *wrong: GrossError) -> Spec:
    points, control = Points(extra_per_model=6), Control(bands=8)
    return Spec(seed=seed, flight=Flight(photos=photos), points=points, control=control, gross_errors=wrong)


def undistorted(simulation: Simulation, **settings: object) -> Result:
    """Adjust a simulation as if its camera had no distortion."""
    return blocks.adjusted(simulation, with_camera(inputs_of(simulation), distortion=None), **settings)


def taken_up(result: Result) -> list[str]:
    assert result.bundle is not None
    return [each.name for each in result.bundle.parameters]


def height_rms(simulation: Simulation, result: Result) -> float:
    """Rms of the errors in height, metres."""
    return float(np.sqrt((errors(simulation, result)[:, 2] ** 2).mean()))


@pytest.mark.slow
def test_an_unstated_lens_is_named_and_costs_nothing() -> None:
    spec = strip_of(21)
    sound, bent = simulate(spec), simulate(replace(spec, camera=replace(FILM, distortion=LENS)))
    result = undistorted(bent)
    (finding,) = result.findings
    assert (finding.code, finding.key) == ("P110", "processing.self_calibration")
    assert "[k1]" in finding.fix
    assert finding.evidence["k1"] == pytest.approx(K1, abs=4 * float(finding.evidence["k1_standard_deviation"]))
    assert lost(result, "control") == []
    assert height_rms(bent, result) < 1.1 * height_rms(sound, undistorted(sound))
    left = undistorted(bent, search_cameras=False)
    assert taken_up(left) == []
    assert height_rms(bent, left) > 1.3 * height_rms(bent, result)


@pytest.mark.slow
def test_film_that_shrank_one_way_is_named_and_no_control_is_doubted() -> None:
    sound = simulate(strip_of(25, 12))
    inputs = inputs_of(sound)
    shrunk = replace(inputs, observations=replace(inputs.observations, xy=inputs.observations.xy * [0.998, 1.0]))
    result = triangulate(shrunk, settings_of(sound))
    (finding,) = result.findings
    assert finding.code == "P112"
    assert "[affinity, shear]" in finding.fix
    assert finding.evidence["x_over_y_percent"] == pytest.approx(-0.2, abs=0.01)
    assert lost(result, "control") == []
    assert height_rms(sound, result) < 1.1 * height_rms(sound, triangulate(inputs, settings_of(sound)))


@pytest.mark.slow
def test_gross_errors_are_no_error_of_a_camera() -> None:
    for seed in range(31, 33):
        wrong = (GrossError("image", count=8, size_um=150.0), GrossError("control", count=2, size_m=3.0))
        assert taken_up(undistorted(simulate(strip_of(seed, 20, *wrong)))) == []


@pytest.mark.slow
def test_a_lens_that_nobody_calibrated_costs_no_more_than_one_that_is_asked_for() -> None:
    """Two strips of a drone, turned by ten degrees: f 1 % off, the principal point 0.1 mm, k1 and k2 unstated."""
    stated = Camera("uav", principal_distance=8.8, format=(13.2, 8.8), pixel_size=0.0024)
    lens = Distortion("brown", "image_to_ideal", k=(2e-4, -3e-6, 0.0))
    true = replace(stated, principal_distance=8.888, principal_point=(0.1, -0.07), distortion=lens)
    flight = Flight(6, 2, end_lap_percent=80, side_lap_percent=70, flying_height=60, attitude_sigma_deg=(10, 10, 5))
    control = Control(layout="random", count=12, check=10, sigma=(0.01, 0.01, 0.015))
    points, terrain = Points(rows=5, extra_per_model=15), Terrain(relief=8.0)
    spec = Spec(camera=true, flight=flight, terrain=terrain, points=points, control=control, image=Image(sigma_um=1.4))
    simulation = simulate(spec)
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    inputs = replace(inputs, strips=tuple(replace(strip, camera=stated) for strip in inputs.strips))
    found = triangulate(inputs, settings)
    assert [each.code for each in found.findings] == ["P107", "P110", "P111"]
    assert "[k1, k2]" in found.findings[1].fix
    assert lost(found, "control") == []
    asked = calibrating(inputs, "principal_distance", "principal_point", "k1", "k2")
    assert errors(simulation, found) == pytest.approx(errors(simulation, triangulate(asked, settings)), abs=1e-6)


def test_probabilities_are_those_of_scipy_and_go_on_where_numbers_end() -> None:
    for squares, freedom in ((3.0, 1), (30.0, 2), (200.0, 12)):
        assert log_probability(squares, freedom) == pytest.approx(chi2.logsf(squares, freedom), rel=1e-9)
    assert log_probability(4000.0, 1) == pytest.approx(norm.logsf(4000.0**0.5) + np.log(2.0), rel=1e-5)
    assert log_probability_of_any(36.0, 1, 100) == pytest.approx(norm.logsf(6.0) + np.log(200.0), rel=1e-9)
    assert log_probability_of_any(0.0, 1, 100) == 0.0
