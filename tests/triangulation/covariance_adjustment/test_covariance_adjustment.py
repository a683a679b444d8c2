"""The banded adjustment against the same written out in full; what it makes of wrong control; its special cases."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Result, StripResult
from photostrip.pipeline.run import triangulate
from photostrip.pipeline.strips.adjusting import adjust_formed
from photostrip.pipeline.strips.photos import form_strip
from photostrip.report.sections.project import project_section
from photostrip.result.document import document_of
from photostrip.triangulation.covariance_adjustment import (
    adjust,
    block_tridiagonal,
    conditions,
    dense_models,
    prediction,
    relinearisation,
    system,
)
from photostrip.triangulation.covariance_adjustment.columns import Columns
from photostrip.triangulation.covariance_adjustment.settings import CovarianceSettings
from photostrip.triangulation.polynomial import correction
from tests.derivatives import UNSCREENED, errors_of, spec, without_noise, written_out
from tests.draws import orthogonal_normal
from tests.loops import nonempty

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.error_propagation.strip_errors import StripErrors

    Floats = NDArray[np.float64]
    Prepared = tuple[StripErrors, conditions.Conditions]

pytestmark = pytest.mark.usefixtures("_no_findings")

COVARIANCE = Settings(adjustment="covariance", relative=UNSCREENED)
SIMILARITY = Settings(adjustment="similarity", relative=UNSCREENED)
STRIPS = 30  # drawn for a chi-square: their scatter is known to 13 %; benchmarks/precision.py takes more


@cache
def noisy(photos: int, lap: float, bands: int = 3, seed: int = 4) -> Result:
    """A strip with errors of 5 micrometres, oriented by the similarity alone."""
    inputs = without_noise(spec(photos, lap, bands=bands))
    errors = np.random.default_rng(seed).normal(0, 0.005, inputs.observations.xy.shape)
    observations = replace(inputs.observations, xy=inputs.observations.xy + errors)
    return triangulate(replace(inputs, observations=observations), SIMILARITY)


def prepared(result: Result, *, distances: bool) -> Prepared:
    found = errors_of(result)
    (strip,) = result.strips
    given = strip.absolute.misclosures[found.control.point, found.control.axis]
    wanted = conditions.conditions(
        found.errors, strip.of_photos.orientation, strip.of_photos.formed, found.control, given, distances=distances
    )
    return found.errors, wanted


@pytest.mark.parametrize("distances", [False, True])
@pytest.mark.parametrize(("photos", "lap"), [(2, 62.0), (3, 60.0), (4, 62.0), (8, 62.0), (9, 80.0)])
def test_the_band_gives_what_the_whole_matrix_gives(photos: int, lap: float, *, distances: bool) -> None:
    """Coordinates, covariances and test values against K [lambda; y] = [w; 0] with everything written out."""
    result = noisy(photos, lap, min(3, photos))
    errors, wanted = prepared(result, distances=distances)
    factor, n = 1.3, errors.models
    (strip,), found = result.strips, errors_of(result)
    control = strip.absolute.misclosures[found.control.point, found.control.axis]
    again = conditions.misclosures_at(wanted, strip.of_photos.formed, strip.absolute.similarity, control)
    assert again == pytest.approx(wanted.value, abs=1e-9)
    solved = system.system(errors, wanted, factor)
    tables = [errors.points.whole(), prediction.photo_rows(solved)]

    by_images = written_out(wanted.rows.without_similarity(), errors)[:, 0]
    design = np.zeros((len(wanted.value), 7 * (n + 1)))
    for row, model in enumerate(wanted.rows.first.tolist()):
        design[row, 7 * model : 7 * model + 7] = wanted.rows.by_similarity[row, 0]
        design[row, 7 * model + 7 : 7 * model + 14] = wanted.following[row]
    design = design[:, : 7 * n]
    corner = np.zeros((7 * n, 7 * n))
    whole = np.block([[by_images @ by_images.T + np.diag(wanted.noise / factor), design], [design.T, corner]])
    solution = np.linalg.solve(whole, np.concatenate([wanted.value, np.zeros(7 * n)]))
    inverse = np.linalg.inv(whole)
    cofactors = solved.cofactors
    assert cofactors == pytest.approx(np.diag(inverse)[: len(cofactors)], abs=1e-8 * np.abs(inverse).max())
    images = relinearisation.image_errors(solved)
    expected = by_images.T @ solution[: len(by_images)]
    assert images.ravel() == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())
    for rows in nonempty(tables):
        predicted = prediction.errors(solved, rows, images)
        covariances = prediction.covariances(solved, rows)
        own = written_out(rows.without_similarity(), errors)
        size = rows.by_similarity.shape[1]
        for thing in range(len(rows.first)):
            column = np.zeros((len(whole), size))
            column[: len(by_images)] = by_images @ own[thing].T
            start = len(by_images) + 7 * rows.first[thing]
            column[start : start + 7] = (rows.by_similarity[thing] @ wanted.local.to_common[rows.first[thing]]).T
            assert predicted[thing] == pytest.approx(column.T @ solution, abs=1e-9)
            moved = relinearisation.displacements(errors, rows, images)[thing]
            assert moved == pytest.approx(own[thing] @ images.ravel(), abs=1e-9)
            covariance = own[thing] @ own[thing].T - column.T @ inverse @ column
            assert covariances[thing] == pytest.approx(covariance, abs=1e-8 * np.abs(covariance).max())
    some = np.random.default_rng(1).permutation(len(errors.points.first))
    rows = errors.points.take(some).along(np.full((len(some), 3), 3**-0.5))
    own = written_out(rows.without_similarity(), errors)[:, 0]
    columns = np.zeros((len(whole), len(some)))
    columns[: len(by_images)] = by_images @ own.T
    for thing, model in enumerate(rows.first.tolist()):
        columns[len(by_images) + 7 * model :, thing][:7] = rows.by_similarity[thing, 0] @ wanted.local.to_common[model]
    expected = own @ own.T - columns.T @ inverse @ columns
    joint = prediction.joint_covariance(solved, rows)
    assert joint == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("large", [1, 100])
def test_blocks_are_eliminated_like_any_system(large: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Indefinite blocks of random numbers, some with places left, inverted by parts and at once: as the dense one."""
    monkeypatch.setattr(block_tridiagonal, "LARGE", large)
    rng, count, height = np.random.default_rng(8), 5, 6
    diagonal, beside = rng.normal(size=(count, height, height)), rng.normal(size=(count, height, height))
    diagonal = diagonal + diagonal.transpose(0, 2, 1) + np.diag([9.0, 9.0, -9.0, 9.0, -9.0, -9.0])
    beside[-1] = 0.0
    heights = [6, 5, 6, 6, 4]
    for number in nonempty((1, 4)):
        diagonal[number, heights[number] :], diagonal[number, :, heights[number] :] = 0.0, 0.0
        diagonal[number, range(heights[number], height), range(heights[number], height)] = 1.0
        beside[number, heights[number] :], beside[number - 1, :, heights[number] :] = 0.0, 0.0
    dense = np.zeros((count, height, count, height))
    for number in range(count):
        dense[number, :, number] = diagonal[number]
        if number + 1 < count:
            dense[number, :, number + 1], dense[number + 1, :, number] = beside[number], beside[number].T
    whole = dense.reshape(count * height, count * height)
    inverse = np.linalg.inv(whole).reshape(dense.shape)
    factors = block_tridiagonal.eliminate(diagonal, beside, [[], [1], [2, 3], [1, 2, 5], [3]], heights)

    right = rng.normal(size=(count, height, 3))
    for number, rows in enumerate(heights):
        right[number, rows:] = 0.0
    expected = np.linalg.solve(whole, right.reshape(-1, 3)).reshape(right.shape)
    assert factors.solve(right) == pytest.approx(expected, rel=1e-9)
    for number, block in nonempty(enumerate(factors.diagonal_of_inverse)):
        rows = heights[number]
        assert block == pytest.approx(inverse[number, :rows, number, :rows], abs=1e-9)
    for number in nonempty(range(1, count - 1)):
        near = slice(number - 1, number + 2)
        expected = np.einsum("iajb,jbk->iak", inverse[near, :, near], right[near])
        assert factors.solve_near(number, right[near]) == pytest.approx(expected, abs=1e-9)
    block, position = np.array([[0, 1, 0], [4, 4, 4], [3, 2, 2]]), np.array([[3, 0, 1], [3, 3, 0], [2, 2, 4]])
    entries = inverse[block[:, :, None], position[:, :, None], block[:, None], position[:, None]]
    assert factors.entries_of_inverse(block, position) == pytest.approx(entries, abs=1e-9)


@pytest.mark.parametrize("lap", [60.0, 80.0])
def test_true_coordinates_come_back(lap: float) -> None:
    inputs = without_noise(spec(7, lap))
    result, plain = triangulate(inputs, COVARIANCE), triangulate(inputs, SIMILARITY)
    assert result.points.cartesian == pytest.approx(plain.points.cartesian, abs=1e-6)
    (strip,) = result.strips
    assert strip.of_photos.resection.rotations == pytest.approx(plain.strips[0].of_photos.resection.rotations, abs=1e-9)
    assert strip.of_photos.resection.residuals == pytest.approx(0.0, abs=1e-9)


def bent(photos: int, sigma: float) -> Inputs:
    """A strip with errors so large that squares of its bend count, as in a much longer one."""
    inputs = without_noise(spec(photos, bands=5))
    xy = inputs.observations.xy + np.random.default_rng(2).normal(0, sigma, inputs.observations.xy.shape)
    sigmas = np.full_like(inputs.observations.sigma, sigma)
    return replace(inputs, observations=replace(inputs.observations, xy=xy, sigma=sigmas))


def formed_from_what_is_taken_for_true(result: Result) -> Floats:
    """Lay the strip of the corrected image coordinates on what the adjustment gives the control: all points."""
    inputs, own = result.inputs, result.strips[0].of_photos.covariance
    assert own is not None
    xy, images = inputs.observations.xy.copy(), own.system.errors.images
    xy[images.row] -= relinearisation.image_errors(own.system) * images.sigma
    row_of = {inputs.observations.point_ids[number]: row for row, number in enumerate(result.points.number)}
    given = np.array([result.points.ground[row_of[name]] for name in inputs.control.ids])
    control = replace(inputs.control, enu=given)
    again = replace(inputs, observations=replace(inputs.observations, xy=xy), control=control)
    return triangulate(again, SIMILARITY).points.cartesian


@pytest.mark.slow
def test_passes_go_on_until_nothing_is_left_to_be_linear(monkeypatch: pytest.MonkeyPatch) -> None:
    """The strip formed from what the adjustment takes for true is the adjusted strip; after one pass it is not."""
    inputs = bent(20, 0.2)
    off, passes = [], []
    for most, fresh in ((10, 0.05), (10, 0.0), (1, 0.05)):  # with the first derivatives, with new ones, at once
        monkeypatch.setattr(adjust, "MOST_FORMATIONS", most)
        monkeypatch.setattr(adjust, "FRESH", fresh)
        result = triangulate(inputs, COVARIANCE)
        assert result.precision is not None
        sigma = np.sqrt(np.trace(result.precision.points, axis1=1, axis2=2))
        difference = formed_from_what_is_taken_for_true(result) - result.points.cartesian
        off.append(float(np.sqrt(np.mean((np.linalg.norm(difference, axis=1) / sigma) ** 2))))
        passes.append(document_of(result)["covariance"][0]["passes"])
    assert min(passes[:2]) > passes[2] == 1
    assert max(off[:2]) < 0.05  # of a standard deviation
    assert off[2] > 0.5


@pytest.mark.slow
def test_the_control_alone_when_asked_for() -> None:
    """Without the distances nothing is known better, and much is known worse; both forms say what took part."""
    inputs = noisy(9, 80.0).inputs
    alone = replace(COVARIANCE, covariance=CovarianceSettings(distances=False))
    found = [triangulate(inputs, wanted) for wanted in (alone, COVARIANCE)]
    documents = [document_of(result) for result in found]
    blocks = [document["covariance"][0] for document in documents]
    control = blocks[0]["control_coordinates"]
    assert [block["distances"] > 0 for block in blocks] == [False, True]
    assert [block["redundancy"] - block["distances"] for block in blocks] == [control - 7, control - 7]
    assert [document["settings"]["covariance"]["distances"] for document in documents] == [False, True]
    told = [project_section(document).parts[0] for document in documents]
    assert ["control alone" in str(part) for part in told] == [True, False]
    more, less = (each.precision.points for each in found if each.precision is not None)
    assert np.linalg.eigvalsh(more - less).min() > -1e-9
    plan = [np.sqrt((each[:, 0, 0] + each[:, 1, 1]).mean()) for each in (more, less)]
    assert 1.1 < plan[0] / plan[1] < 1.6  # a prototype's 80 % strips: 1.33


def adjusted(seed: int, *, wrong: float = 0.0, axis: int = 2) -> tuple[StripResult, str]:
    """A strip of 12 photos with its errors, and one control point made wrong."""
    inputs = without_noise(spec(12, bands=5))
    rng = np.random.default_rng(seed)
    xy = inputs.observations.xy + rng.normal(0, 0.005, inputs.observations.xy.shape)
    control = inputs.control
    given = control.enu + rng.normal(0, 1, control.enu.shape) * control.sigma
    row = [n for n, check in enumerate(control.check) if not check][7]
    given[row, axis] += wrong
    changed = replace(inputs, observations=replace(inputs.observations, xy=xy), control=replace(control, enu=given))
    return triangulate(changed, COVARIANCE).strips[0], control.ids[row]


@pytest.mark.slow
@pytest.mark.parametrize(("axis", "size"), [(0, 1.0), (1, -1.0), (2, 1.5)])
def test_a_wrong_control_point_is_named(axis: int, size: float) -> None:
    """And the error is estimated; without it no point is named."""
    strip, name = adjusted(3, wrong=size, axis=axis)
    notes = [note for note in strip.notes if note.code == "control-doubtful"]
    assert [note.points for note in notes] == [(name,)]
    assert strip.of_photos.covariance is not None
    worst = strip.of_photos.covariance.tested.doubtful[0]
    assert strip.of_photos.covariance.tested.size[worst] == pytest.approx(size, abs=0.45)
    clean, _ = adjusted(3)
    assert not [note for note in clean.notes if note.code in {"control-doubtful", "strip-contradicted"}]


@pytest.mark.slow
def test_sums_of_squares_follow_chi_square() -> None:
    """Mean and scatter of the test of the whole over 30 strips, and of the test values of control."""
    found = [adjusted(seed)[0].of_photos.covariance for seed in range(STRIPS)]
    tested = [each.tested for each in found if each is not None]
    ratio = np.array([each.squares / each.redundancy for each in tested])
    expected = np.sqrt(2 / tested[0].redundancy)
    assert ratio.mean() == pytest.approx(1.0, abs=4 * expected / np.sqrt(STRIPS))
    assert ratio.std(ddof=1) == pytest.approx(expected, rel=0.4)
    values = np.concatenate([each.normalised for each in tested])
    assert np.sqrt(np.mean(values**2)) == pytest.approx(1.0, abs=0.06)


@pytest.mark.slow
def test_coordinates_worse_than_stated_are_told() -> None:
    """A lens that distorts is in no covariance: the test of the whole fails."""
    inputs = without_noise(spec(12, bands=5))
    observations = inputs.observations
    xy = observations.xy + np.random.default_rng(1).normal(0, 0.001, observations.xy.shape)
    radius = np.linalg.norm(xy, axis=1, keepdims=True)
    bent = xy * (1 + 0.03 * (radius / 100) ** 2 / 100)  # 30 micrometres at 100 mm
    sharp = replace(observations, xy=bent, sigma=np.full_like(observations.sigma, 0.001))
    (strip,) = triangulate(replace(inputs, observations=sharp), COVARIANCE).strips
    assert strip.of_photos.covariance is not None
    tested = strip.of_photos.covariance.tested
    assert tested.probability < 1e-3
    assert {note.code for note in strip.notes} & {"control-doubtful", "strip-contradicted"}


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ["similarity", "covariance", "bundle"])
def test_check_points_together_follow_chi_square(adjustment: str) -> None:
    """Joint test of twelve check points over 30 repetitions: mean and scatter as chi-square has them."""
    wanted = spec(10)
    base = without_noise(replace(wanted, control=replace(wanted.control, check=12)))
    rng = np.random.default_rng(6)
    squares, coordinates = [], 0
    for _ in range(STRIPS):
        xy = base.observations.xy + rng.normal(0, 0.005, base.observations.xy.shape)
        errors = rng.normal(0, 1, base.control.enu.shape) * np.where(base.control.use, base.control.sigma, 0.0)
        control = replace(base.control, enu=base.control.enu + errors)
        again = replace(base, observations=replace(base.observations, xy=xy), control=control)
        precision = triangulate(again, Settings(adjustment=adjustment, relative=UNSCREENED)).precision
        assert precision is not None
        test = precision.checks[0]
        assert test is not None
        squares.append(test.squares)
        coordinates = test.coordinates
    scatter = np.sqrt(2.0 * coordinates)
    assert np.mean(squares) == pytest.approx(coordinates, abs=3.5 * scatter / np.sqrt(STRIPS))
    assert np.std(squares, ddof=1) == pytest.approx(scatter, rel=3.5 / np.sqrt(2 * STRIPS))


@pytest.mark.slow
def test_repetitions_scatter_as_stated() -> None:
    """One strip of six photos with mixed control drawn anew 60 times, which knows the scatter to about 4 %."""
    inputs = without_noise(spec(6, use={"xyz": 0.5, "xy": 0.25, "z": 0.25}))
    base = Settings(relative=UNSCREENED, polynomial=correction.PolynomialSettings("2"))
    settings = {name: replace(base, adjustment=name) for name in ("polynomial", "covariance")}
    truth, rng = triangulate(inputs, base), np.random.default_rng(12)
    strip, true = truth.strips[0].of_photos.strip, truth.points.cartesian
    measured = np.flatnonzero(np.isin(inputs.control.ids, truth.strips[0].control.ids))
    squares = {name: np.zeros_like(true) for name in settings}
    image, ground = inputs.observations.xy, inputs.control.enu
    for drawn in orthogonal_normal(rng, 60, image.size + ground.size):
        of_image, of_control = np.split(drawn, [image.size])
        xy = image + 0.005 * of_image.reshape(image.shape)
        errors = of_control.reshape(ground.shape) * np.where(inputs.control.use, inputs.control.sigma, 0.0)
        control = replace(inputs.control, enu=ground + errors).take(measured)
        observations = replace(inputs.observations, xy=xy)
        formed = form_strip(strip, observations, base)
        for name, wanted in settings.items():
            found = adjust_formed(formed, control, truth.frames, wanted)
            squares[name] += (found.cartesian - true) ** 2
    noisy_xy = image + rng.normal(0, 0.005, image.shape)
    once = replace(inputs, observations=replace(inputs.observations, xy=noisy_xy))
    for name, wanted in nonempty(settings.items()):
        precision = triangulate(once, wanted).precision
        assert precision is not None
        factor = (0.005 / precision.sigma[0]) ** 2 if precision.basis[0] == "a-posteriori" else 1.0
        stated = np.sqrt(factor * np.diagonal(precision.points, axis1=1, axis2=2).mean(axis=0))
        assert stated / np.sqrt(squares[name].mean(axis=0) / 60) == pytest.approx(np.ones(3), abs=0.1)


def test_points_on_many_photos_leave_so_many_distances_to_each_junction(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that are left lie from one side of the strip to the other; nothing else changes; it is said."""
    whole = prepared(noisy(8, 80.0), distances=True)[1]
    monkeypatch.setattr(conditions, "MOST_DISTANCES", 20)
    result = noisy(8, 80.0)
    errors, wanted = prepared(result, distances=True)
    most = 20 // errors.points.by_component.shape[1]
    (strip,) = result.strips
    joined, every = strip.of_photos.formed.junctions, set(whole.source[whole.kind == conditions.DISTANCE].tolist())
    left = wanted.source[wanted.kind == conditions.DISTANCE]
    assert set(left.tolist()) < every
    for junction in nonempty(np.unique(joined.junction[sorted(every)]).tolist()):
        of_junction = np.array([each for each in sorted(every) if joined.junction[each] == junction])
        across = errors.make_pairs().point[joined.after[of_junction], 1]
        chosen = np.isin(of_junction, left)
        assert chosen.sum() == min(most, len(of_junction))
        assert across[chosen].min() == across.min()
        assert np.ptp(across[chosen]) > 0.5 * np.ptp(across)
    notes = triangulate(result.inputs, COVARIANCE).notes
    (note,) = (each for each in notes if each.code == "distances-left-out")
    assert f"{len(left)} of {len(every)} distances" in note.message
    auto = Settings(relative=UNSCREENED)
    compared = triangulate(result.inputs, auto)
    assert [each for each in compared.notes if each.code == note.code] == [note]
    monkeypatch.setattr("photostrip.pipeline.strips.choosing.method_of", lambda _: "polynomial")
    taken = triangulate(result.inputs, auto)
    choice = taken.strips[0].choice
    assert choice is not None
    assert choice.taken == "polynomial"
    assert [each for each in taken.notes if each.code == note.code] == [note]
    monkeypatch.undo()
    assert note.code not in {each.code for each in triangulate(result.inputs, COVARIANCE).notes}


@pytest.mark.parametrize(("photos", "lap"), [(2, 62.0), (9, 62.0), (9, 80.0)])
def test_many_points_of_a_model_get_their_covariances_together(photos: int, lap: float) -> None:
    """A strip of 2000 points a photo took 41 s and 3.2 GB, a product with the inverse for each coordinate."""
    errors, wanted = prepared(noisy(photos, lap, min(3, photos)), distances=True)
    solved = system.system(errors, wanted, 1.3)
    some = errors.points.take(np.random.default_rng(1).permutation(len(errors.points.first))[::2])
    one_by_one = prediction.covariances(solved, some)
    copies = errors.points.take(np.repeat(np.arange(len(errors.points.first)), 40))
    assert dense_models.are_dense(Columns.of(solved, copies))
    assert not dense_models.are_dense(Columns.of(solved, some))
    columns = Columns.of(solved, some.take(np.argsort(some.first, kind="stable")))
    direct, together = prediction._explained(columns), dense_models.explained(columns)
    assert together == pytest.approx(direct, abs=1e-12 * np.abs(direct).max())
    assert prediction.covariances(solved, copies)[::40] == pytest.approx(
        prediction.covariances(solved, errors.points.whole()), abs=1e-12 * np.abs(one_by_one).max()
    )
