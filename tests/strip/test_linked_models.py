"""Links of independent models: exact recovery, weights, tests, degenerate cases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.arrays import Flags, Floats
from photostrip.errors import GeometryError, InputError
from photostrip.geometry.similarity import Similarity
from photostrip.pipeline.formed_models import form_models, models_of
from photostrip.pipeline.inputs import ModelStrip, Settings
from photostrip.points import ModelPoints
from photostrip.strip import linked_models
from photostrip.strip.linked_models import FormedModels, LinkSettings
from tests.models import SIGMA, truth

MICROMETRE = 1e-6  # m


def strip_of(measured: ModelPoints) -> ModelStrip:
    return ModelStrip("A", measured.photo_ids, measured.model_ids)


def formed_of(measured: ModelPoints, links: LinkSettings | None = None) -> FormedModels:
    return form_models(strip_of(measured), measured, Settings(links=links or LinkSettings()))


@settings(max_examples=25, deadline=None)
@given(models=st.integers(1, 8), across=st.integers(2, 5), seed=st.integers(0, 10_000))
def test_models_without_errors_come_back_whatever_their_axes(models: int, across: int, seed: int) -> None:
    true = truth(models, across, seed)
    formed = formed_of(true.measured())
    back = Similarity.from_points(formed.xyz, true.points[formed.point])
    assert np.abs(back(formed.xyz) - true.points[formed.point]).max() < MICROMETRE
    assert np.abs(back(formed.centers) - true.centers).max() < MICROMETRE
    assert back.rotation[2, 2] > 0.9  # the strip lies level, centres above, whatever the plotter's axes were


def test_the_estimate_is_that_of_a_general_optimiser() -> None:
    true = truth(2, 4, 3)
    measured = true.measured(np.random.default_rng(1).normal(size=(len(true.model), 3)), (0.01, 0.02, 0.05))
    models = models_of(strip_of(measured), measured, LinkSettings())
    shared = linked_models.common(models)
    solved = linked_models.solve(shared, models, np.ones(len(shared.link), bool))
    a, b = models.xyz[shared.before], models.xyz[shared.after]
    middle = b.mean(axis=0)
    start = solved.similarities

    def free(parameters: Floats) -> Floats:
        scale = np.exp(parameters[0])
        turn = scale * Rotation.from_rotvec(parameters[1:4]).as_matrix() @ start.rotation[0]
        moved = (b - middle) @ turn.T + parameters[4:]
        root = [
            np.linalg.cholesky(np.linalg.inv(np.diag(sa**2) + turn @ np.diag(sb**2) @ turn.T)).T
            for sa, sb in zip(models.sigma[shared.before], models.sigma[shared.after], strict=True)
        ]
        return np.concatenate([r @ v for r, v in zip(root, a - moved, strict=True)])

    guess = np.concatenate([[np.log(start.scale[0])], np.zeros(3), a.mean(axis=0)])
    found = least_squares(free, guess, x_scale=[1e-4, 1e-4, 1e-4, 1e-4, 0.01, 0.01, 0.01], xtol=1e-15, ftol=1e-15)
    # weights that follow the rotation are kept in every step, their derivatives are not: nothing at this precision
    assert found.cost * 2 == pytest.approx(solved.squares[0], rel=1e-4)
    scale, turn = np.exp(found.x[0]), Rotation.from_rotvec(found.x[1:4]).as_matrix() @ start.rotation[0]
    assert np.abs(scale * (b - middle) @ turn.T + found.x[4:] - start.of(shared.link, b)).max() < 0.1 * SIGMA[0]


@pytest.mark.parametrize("kind", ["point", "center"])
@pytest.mark.parametrize("size", [0.4, 30.0])
def test_a_gross_error_is_named_and_left_out(kind: str, size: float) -> None:
    true = truth(6, 4, 3)
    measured = true.measured(np.random.default_rng(3).normal(size=(len(true.model), 3)))
    points = len(true.points)
    wanted = (true.node >= points) if kind == "center" else (true.node < points)
    row = next(r for r in np.flatnonzero((true.model == 2) & wanted) if (true.node == true.node[r]).sum() == 2)
    xyz = measured.xyz.copy()
    xyz[row] += [size, -size, size]
    wrong = replace(measured, xyz=xyz)
    clean, found = formed_of(measured), formed_of(wrong)
    rejected = found.links.rejections
    assert [found.models.node[found.links.shared.before[each.row]] for each in rejected] == [true.node[row]]
    assert true.node[row] not in found.node  # in two models, and nothing says which is wrong
    assert np.linalg.norm(rejected[0].size) > 0.7 * size  # mm of the model before, whose scale differs
    for each in (clean, found):
        ground = np.concatenate([true.points, true.centers])[each.node]
        off = Similarity.from_points(each.node_xyz, ground).residuals(each.node_xyz, ground)
        assert 0.02 < np.sqrt((off**2).mean()) < 0.5  # metres; 0.4 mm are 3.6 m at 1:9000


def without(measured: ModelPoints, rows: Flags) -> ModelPoints:
    keep = ~rows
    return replace(
        measured,
        model=measured.model[keep],
        node=measured.node[keep],
        xyz=measured.xyz[keep],
        sigma=measured.sigma[keep],
    )


def test_two_common_points_are_too_few() -> None:
    true = truth(3, 2, 3)
    measured = true.measured()
    with pytest.raises(GeometryError, match="models M1 and M2 have 2 points in common") as told:
        formed_of(without(measured, (true.node >= len(true.points)) & (true.model == 1)))
    assert told.value.code == "broken-link"


def test_models_out_of_order_name_the_one_that_fits() -> None:
    measured = truth(5, 3, 3).measured()
    strip = ModelStrip("A", measured.photo_ids, ("M1", "M3", "M2", "M4", "M5"))
    with pytest.raises(GeometryError, match=r"model M1 shares 4 with model M2: are they in the order"):
        form_models(strip, measured, Settings())


@pytest.mark.parametrize("models", [("M2",), ("M1", "M4"), ("M5",)])
def test_a_mirrored_model_is_named(models: tuple[str, ...]) -> None:
    true = truth(5, 4, 3, relief=5.0)
    measured = true.measured(np.random.default_rng(3).normal(size=(len(true.model), 3)))
    xyz = measured.xyz.copy()
    odd = np.isin(np.array(measured.model_ids)[true.model], models)
    xyz[odd] = xyz[odd][:, [1, 0, 2]]
    with pytest.raises(InputError) as told:
        formed_of(replace(measured, xyz=xyz))
    assert told.value.faults[0].code == "mirrored-model"
    assert ", ".join(models) in told.value.faults[0].message


def test_points_on_a_line_need_the_center() -> None:
    true = truth(2, 3, 3)
    points = true.points.copy()
    points[3:6] = [[900.0, y, 0.0] for y in (-700.0, 0.0, 700.0)]
    measured = replace(true, points=points).measured()
    assert formed_of(measured).links.shared.count == 1
    with pytest.raises(GeometryError, match=r"lie on one line.*with the common perspective centre") as told:
        formed_of(without(measured, (true.node >= len(true.points)) & (true.model == 1)))
    assert told.value.code == "link-on-a-line"
