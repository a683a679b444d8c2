"""Cameras compared by the table of the source and its misprints; the experiment with gross errors in pairs."""

from __future__ import annotations

import numpy as np
import pytest

from photostrip.planning.camera_efficiency import (
    PRINTED_BASE,
    PRINTED_TABLE,
    ComparedCamera,
    compare,
    sigma_from_mean_distortion,
    source_cameras,
)
from photostrip.planning.screening import (
    PairLayout,
    ScreeningSpec,
    error_effects,
    experiment_errors,
    screening_experiment,
    spoiled,
    standard_pairs,
)
from photostrip.strip import pair_screening
from photostrip.strip.relative_orientation import orient_unchecked
from tests.loops import nonempty
from tests.vectors import Vector, cases


@pytest.mark.parametrize("vector", cases("camera_efficiency", "camera-efficiency-1"))
def test_numbers_computed_apart(vector: Vector) -> None:
    given, want = vector.input, vector.expected
    cameras = [ComparedCamera("", f, m_p, given["b_mm"], given["b_mm"]) for f, m_p in given["cameras_f_mp"]]
    beside = [compare(camera, cameras[-1]) for camera in cameras]
    assert [camera.coefficient for camera in cameras] == pytest.approx(want["K"], rel=1e-12)
    assert [each.scale for each in beside] == pytest.approx(want["ratio_of_scale_denominators"], rel=1e-12)
    assert [each.printed_area for each in beside] == pytest.approx(want["eta_S_as_printed"], rel=1e-12)
    assert [each.area for each in beside] == pytest.approx(want["eta_S_true_area_ratio"], rel=1e-12)
    assert [each.height_error for each in beside] == pytest.approx(want["eta_mh"], rel=1e-12)
    assert [camera.height_ratio for camera in cameras] == pytest.approx(want["H_over_mh"], rel=1e-12)


def test_the_printed_table_and_its_misprints() -> None:
    cameras = source_cameras()
    last = cameras[-1]
    beside = [compare(camera, last) for camera in cameras]
    assert [round(c.coefficient, 2) for c in cameras] == pytest.approx(
        [r.coefficient for r in PRINTED_TABLE], abs=0.011
    )
    # the last heading ("sqrt(m_h) = 1 / tau_S"): the column is 1 / eta_mh, a ratio of lengths
    column = [row.area for row in PRINTED_TABLE]
    assert [1 / each.height_error for each in beside] == pytest.approx(column, abs=0.05)
    assert max(abs(each.area - printed) for each, printed in zip(beside, column, strict=True)) > 1.5
    assert max(abs(each.height_error**0.5 - printed) for each, printed in zip(beside, column, strict=True)) > 1
    # 1/5000 does not belong to the base of the other rows
    ratios = [camera.height_ratio / row.height_ratio for camera, row in zip(cameras, PRINTED_TABLE, strict=True)]
    assert ratios[:3] == pytest.approx([1, 1, 1], abs=0.01)
    assert ratios[3] == pytest.approx(1.09, abs=0.002)
    assert 5000 * last.sigma == pytest.approx(55)  # mm: it would need this base
    assert PRINTED_BASE == 60


def test_a_parallax_from_measuring_and_mean_distortion_scatters_so() -> None:
    rng = np.random.default_rng(7)
    count, measuring, spread = 200_000, 0.004, 0.006
    radial = spread * rng.normal(size=(count, 2))
    turned = np.cos(rng.uniform(0, 2 * np.pi, size=(count, 2)))
    x = measuring * rng.normal(size=(count, 2)) + radial * turned
    found = sigma_from_mean_distortion(measuring, float(np.abs(radial).mean()))
    assert (x[:, 0] - x[:, 1]).std() == pytest.approx(found, rel=0.01)
    assert sigma_from_mean_distortion(measuring, 0.0) == pytest.approx(np.sqrt(2) * measuring)


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "shares"), [(0.20, [51.9, 41.7, 6.4]), (0.03, [99.2, 0.0, 0.8])])
def test_the_published_rates(limit: float, shares: list[float]) -> None:
    """By an independent program with the same settings; one repetition scatters by 3.5 errors of 44."""
    spec = ScreeningSpec(methods=("parallax+grubbs",), repetitions=24, parallax_limit=limit)
    (found,) = screening_experiment(spec).methods
    assert 100 * np.array([found.parallax, found.later, found.missed]) == pytest.approx(shares, abs=3.0)
    assert 44 * (found.beside + found.instead) == pytest.approx(1.1, abs=0.9)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "share"), [("grubbs", 0.025), ("tau", 0.052)])
def test_false_alarms_of_clean_models(method: str, share: float) -> None:
    oriented, _ = orient_unchecked(standard_pairs(np.random.default_rng(2), 4000, PairLayout()))
    value, limit, _ = pair_screening.tested(oriented, method, 0.05)
    alarms = np.maximum.reduceat(value > limit, oriented.pairs.starts).mean()
    assert alarms == pytest.approx(share, abs=4 * np.sqrt(share / 4000))


def test_effects_are_what_orienting_again_finds() -> None:
    layout = PairLayout()
    pairs = standard_pairs(np.random.default_rng(2), 60, layout)
    clean, size = orient_unchecked(pairs)[0].elements, 0.02
    for zone, effect in nonempty(zip(range(1, 7), error_effects(pairs, layout), strict=True)):
        changes = []
        for point in np.flatnonzero(layout.zone == zone).tolist():
            errors = np.where(np.arange(layout.points) == point, size, 0.0)
            moved, _ = orient_unchecked(spoiled(pairs, np.tile(errors, 60)))
            changes.append((moved.elements - clean) / size)
        rms = np.sqrt(np.mean(np.square(changes), axis=(0, 1)))
        assert effect.elements == pytest.approx(rms, rel=5e-3)
        largest = np.abs(changes).max(axis=2)
        assert effect.largest == pytest.approx(np.sqrt(np.mean(largest**2)), rel=5e-3)


def test_without_a_search_every_error_stays_and_turns_its_pair() -> None:
    spec = ScreeningSpec(methods=("none",), repetitions=1, seed=4)
    (found,) = screening_experiment(spec).methods
    assert (found.missed, found.beside, found.instead) == (1.0, 0.0, 0.0)
    rng = np.random.default_rng(4)
    pairs = standard_pairs(rng, spec.models, spec.layout)
    errors = experiment_errors(rng, spec)
    assert (errors != 0).sum() == 44
    turned = orient_unchecked(spoiled(pairs, errors))[0].elements - orient_unchecked(pairs)[0].elements
    change = np.abs(turned).max(axis=1)
    assert [found.mean_change, found.worst_change] == pytest.approx([change.mean(), change.max()])
