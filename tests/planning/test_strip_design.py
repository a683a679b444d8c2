"""Planned strips: their geometry, expected precision against simulation, reliability, bands needed, best places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from photostrip.arrays import Floats
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.network.adjustment import solve
from photostrip.pipeline.formed_photos import form_strip
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.strip_method import adjust_formed
from photostrip.planning.ideal_strip import (
    BUNDLE,
    DEGREES,
    SIMILARITY,
    ControlLayout,
    IdealStrip,
    Spot,
    StripGeometry,
    accuracy,
    bundle_problem,
    control_of,
    ideal_strip,
    numbers_of,
    spots_of,
)
from photostrip.planning.strip_design import Demand, Placement, bands_needed, best_places, outcome, worst
from photostrip.points import ControlPoints
from photostrip.simulation import FILM, Points
from photostrip.strip import polynomial
from photostrip.strip.pair_screening import DETECTABLE
from photostrip.strip.relative_orientation import RelativeSettings
from tests.loops import nonempty

SEED = 20_240


def scatter(geometry: StripGeometry, layout: ControlLayout, methods: Sequence[str], count: int) -> dict[str, Floats]:
    """Give the standard deviations of the errors of all points over so many repetitions, (q, 3), by method.

    Every strip is formed once from its measurements, and taken to the ground by all methods.
    """
    strip = ideal_strip(geometry)
    errors: dict[str, list[Floats]] = {method: [] for method in methods}
    spots = spots_of(layout, geometry.photos, geometry.points.rows)
    frames, _ = tie_frames([FrameSpec("local", ("east", "north", "up"))])
    for number in range(count):
        rng = np.random.default_rng([SEED, number])
        inputs = measured(strip, spots, layout, rng)
        for method in methods:
            if method == BUNDLE:
                solved = bundled(strip, layout, inputs)
            else:
                formed = form_strip(inputs.strips[0], inputs.observations, run_settings(method))
                solved = adjust_formed(formed, inputs.control, frames, run_settings(method)).cartesian
            errors[method].append(solved - strip.xyz)
    return {method: np.std(each, axis=0) for method, each in errors.items()}


def measured(strip: IdealStrip, spots: tuple[Spot, ...], layout: ControlLayout, rng: np.random.Generator) -> Inputs:
    """Give a strip as it would be measured: errors in the image coordinates and in the control."""
    observed = strip.observations
    control = control_of(strip, spots, layout.sigma)
    names = tuple(observed.point_ids[strip.formed.point[number]] for number in numbers_of(strip, spots))
    return Inputs(
        "plan",
        (Strip("A", strip.geometry.camera, strip.photos),),
        replace(observed, xy=observed.xy + rng.normal(size=observed.xy.shape) * observed.sigma),
        ControlPoints(
            names,
            control.enu + rng.normal(size=control.enu.shape) * control.sigma,
            control.use,
            control.check,
            control.sigma,
        ),
        (FrameSpec("local", ("east", "north", "up")),),
    )


def run_settings(method: str) -> Settings:
    """Give settings of a run by one of the methods, without a search for gross errors."""
    return Settings(
        relative=RelativeSettings(screening="none"),
        polynomial=polynomial.PolynomialSettings(DEGREES.get(method, "auto")),
        adjustment="polynomial" if method in DEGREES else method,
        precision=False,  # it is what the plan says that is compared with the scatter
    )


def bundled(strip: IdealStrip, layout: ControlLayout, inputs: Inputs) -> Floats:
    """Coordinates of the points of the strip by a bundle adjustment that starts at the truth."""
    control = inputs.control
    names = [inputs.observations.point_ids[number] for number in strip.formed.point]
    numbers = np.array([names.index(name) for name in control.ids], np.intp)
    problem = bundle_problem(strip, layout, numbers, control)
    seen = np.isin(inputs.observations.point, strip.formed.point)
    given = np.where(control.use, control.enu, strip.xyz[numbers])
    problem = replace(
        problem,
        images=replace(problem.images, xy=inputs.observations.xy[seen]),
        control=replace(problem.control, xyz=given),
    )
    xyz: Floats = solve(problem).points
    return xyz


pytestmark = pytest.mark.usefixtures("_no_findings")

SIMPLE = Points(rows=3, scatter_percent=0.0, extra_per_model=0)


def strip_of(photos: int = 8, points: Points = SIMPLE, sigma: float = 0.005) -> IdealStrip:
    return ideal_strip(StripGeometry(FILM, photos, points=points, image_sigma=sigma))


def test_the_ideal_strip_is_what_was_asked_for() -> None:
    strip = ideal_strip(StripGeometry(FILM, 6, end_lap_percent=65.0, scale=8000.0))
    base = 230.0 * 0.35 * 8.0
    assert np.diff(strip.centers[:, 0]) == pytest.approx(np.full(5, base))
    assert strip.centers[:, 2] == pytest.approx(np.full(6, 153.0 * 8.0))
    assert strip.centers.mean(axis=0)[:2] == pytest.approx([0, 0], abs=1e-6)
    assert np.abs(strip.rotations - np.eye(3)).max() < 1e-9
    assert np.abs(strip.xyz[:, 2]).max() < 1e-9
    assert strip.xyz[:, 1].max() == pytest.approx(115.0 * 0.8 * 8.0)
    assert strip.similarity(strip.formed.xyz) == pytest.approx(strip.xyz, abs=1e-8)
    first = strip.at(0, 0)
    assert strip.xyz[first, :2] == pytest.approx([strip.centers[0, 0], 115.0 * 0.8 * 8.0])
    assert (strip.station >= 0).sum() == 6 * 5
    with pytest.raises(InputError, match="has no pass point in row 9"):
        strip.at(0, 8)
    with pytest.raises(InputError, match="cannot make a strip"):
        ideal_strip(StripGeometry(FILM, 2))


USUAL = StripGeometry.points


@pytest.mark.parametrize(
    ("layout", "places"),
    [
        (ControlLayout("", bands=2), [(1, 1), (1, 3), (1, 5), (9, 1), (9, 3), (9, 5)]),
        (ControlLayout("", every=5, per_band=1), [(1, 3), (6, 3), (9, 3)]),
        (ControlLayout("", every=4, per_band=2), [(1, 1), (1, 5), (5, 1), (5, 5), (9, 1), (9, 5)]),
        (ControlLayout("", bands=1, per_band=1), [(5, 3)]),
        (ControlLayout("", kind="corners"), [(1, 1), (1, 5), (9, 1), (9, 5)]),
        (ControlLayout("", kind="corners+centre"), [(1, 1), (1, 5), (5, 3), (9, 1), (9, 5)]),
        (ControlLayout("", kind="points", spots=(Spot(3, 2), Spot(2, 2))), [(2, 2), (3, 2)]),
    ],
)
def test_layouts(layout: ControlLayout, places: list[tuple[int, int]]) -> None:
    assert [(spot.photo, spot.row) for spot in spots_of(layout, 9, 5)] == places


@pytest.mark.parametrize(
    "layout",
    [
        ControlLayout("a", bands=12),
        ControlLayout("a", per_band=4),
        ControlLayout("a", spots=(Spot(6, 1),)),
        ControlLayout("a", spots=(Spot(1, 4),)),
    ],
)
def test_layouts_that_do_not_fit_are_refused(layout: ControlLayout) -> None:
    with pytest.raises(InputError) as caught:
        spots_of(layout, 5, 3)
    assert caught.value.faults[0].code == "plan-place"


@pytest.mark.slow
def test_expected_precision_is_the_scatter_of_whole_runs() -> None:
    single = (Spot(3, 2, "z"), Spot(5, 1, "xy"), Spot(6, 3))
    layout = ControlLayout("mixed", kind="corners", spots=single, sigma=(0.03, 0.03, 0.05))
    geometry = StripGeometry(FILM, 8)
    strip = ideal_strip(geometry)
    methods = (SIMILARITY, BUNDLE)
    scattered = scatter(geometry, layout, methods, 100)
    for method in nonempty(methods):
        expected = accuracy(strip, layout, spots_of(layout, 8, 5), method)
        ratio = expected.sigmas[expected.new] / scattered[method][expected.new]
        # 100 repetitions know the rms over all points to about 5 %, single coordinates to 7 %
        assert np.sqrt((ratio**2).mean()) == pytest.approx(1.0, abs=0.1)
        assert ratio.min() > 0.75
        assert ratio.max() < 1.35


def test_too_little_control_is_told_and_not_raised() -> None:
    found = outcome(strip_of(5), ControlLayout("", kind="points", spots=(Spot(1, 1), Spot(5, 1))), SIMILARITY)
    assert found.accuracy is None
    assert "2 in height" in found.reason
    with pytest.raises(GeometryError):
        accuracy(strip_of(5), ControlLayout(""), (Spot(1, 1),), SIMILARITY)


@pytest.mark.parametrize("method", [SIMILARITY, "degree 2"])
def test_detectable_errors_of_a_fit_are_those_of_prediction_without_the_point(method: str) -> None:
    strip = strip_of(9, USUAL)
    layout = ControlLayout("", bands=4)
    spots = spots_of(layout, 9, 5)
    whole = accuracy(strip, layout, spots, method)
    for number in (0, 4):
        without = tuple(replace(spot, use="xy") if k == number else spot for k, spot in enumerate(spots))
        left = accuracy(strip, layout, without, method)
        assert left.used == whole.used
        predicted = left.covariance[whole.control[number], 2, 2] + layout.sigma[2] ** 2
        assert whole.detectable[number, 2] == pytest.approx(DETECTABLE * np.sqrt(predicted), rel=1e-6)
        assert np.isnan(left.detectable[number, 2])


@pytest.mark.parametrize("method", [SIMILARITY, "degree 2", BUNDLE])
def test_the_number_of_bands_is_the_least(method: str) -> None:
    strip = strip_of(12)
    required = Demand(0.3, 0.4)
    needed = bands_needed(strip, ControlLayout("", per_band=2), method, required)
    if needed.bands is None:
        assert not required.met(needed.worst)
        return
    assert required.met(needed.worst)
    assert needed.points == 2 * needed.bands
    for bands in nonempty(range(2, needed.bands)):
        found = outcome(strip, ControlLayout("", bands=bands, per_band=2), method).accuracy
        assert found is None or not required.met(worst(found))


@pytest.mark.slow
@pytest.mark.parametrize(("method", "count"), [(SIMILARITY, 2), ("degree 2", 1), (BUNDLE, 1)])
def test_the_search_finds_the_very_best_places_of_a_small_strip(method: str, count: int) -> None:
    strip = strip_of(5)
    base = ControlLayout("corners", kind="corners")
    placed = best_places(strip, base, Placement(count, "corners", method), Demand(1.0, 1.0))
    fixed = spots_of(base, 5, 3)
    free = [Spot(p, r) for p in range(1, 6) for r in range(1, 4) if Spot(p, r) not in fixed]
    every = []
    for more in combinations(free, count):
        spots = tuple(sorted((*fixed, *more), key=lambda s: (s.photo, s.row)))
        every.append(max(worst(accuracy(strip, base, spots, method))))
    assert max(placed.found) <= max(placed.equal) + 1e-12
    # better places by less than 1 % are not told
    assert max(placed.found) <= min(every) / (1 - 0.0101)
    assert max(placed.found) >= min(every) - 1e-12


def test_measured_perspective_centres_help_the_bundle_only() -> None:
    strip = strip_of(12)
    plain, with_gnss = ControlLayout("", kind="corners"), ControlLayout("", kind="corners", gnss=(0.05, 0.05, 0.08))
    spots = spots_of(plain, 12, 3)
    without, offset, absolute = (
        worst(accuracy(strip, layout, spots, BUNDLE))
        for layout in (plain, with_gnss, replace(with_gnss, gnss_offset=False))
    )
    assert absolute[1] <= offset[1] < 0.5 * without[1]
    for method in (SIMILARITY, "degree 1"):
        assert worst(accuracy(strip, plain, spots, method)) == worst(accuracy(strip, with_gnss, spots, method))
    # without any offset the centres alone are control enough, with one they are too, but not in the plan's place
    none = ControlLayout("", kind="points", gnss=(0.05, 0.05, 0.08), gnss_offset=False)
    assert outcome(strip, none, SIMILARITY).accuracy is None
