"""The banded adjustment against the same written out in full; what it makes of wrong control; its special cases."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Result, StripResult
from photostrip.pipeline.run import triangulate
from photostrip.pipeline.strips.adjusting import adjust_formed
from photostrip.pipeline.strips.photos import FormedPhotos, form_strip
from photostrip.report.sections.project import project_section
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Points, Spec, simulate
from photostrip.simulation.spec import Image
from photostrip.triangulation.covariance_adjustment import (
    adjust,
    block_tridiagonal,
    conditions,
    prediction,
    relinearisation,
    system,
)
from photostrip.triangulation.covariance_adjustment.settings import CovarianceSettings
from photostrip.triangulation.covariance_adjustment.strip_rows import strip_errors
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import ErrorRows
from photostrip.triangulation.error_propagation.control_errors import misclosures
from photostrip.triangulation.polynomial import correction
from photostrip.triangulation.strip_formation.strip import without_rows
from tests.derivatives import UNSCREENED, oriented_of, spec, without_noise
from tests.draws import orthogonal_normal
from tests.loops import nonempty
from tests.simulated import inputs_of
from tests.triangulation.covariance_adjustment.strip_rows import errors_of, every, written_out

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.covariance_adjustment.strip_rows.strip_errors import StripErrors

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


def alone(rows: ErrorRows) -> ErrorRows:
    """Leave out the similarities of the first models, which are unknowns and no errors."""
    return replace(rows, by_similarity=np.zeros_like(rows.by_similarity))


@dataclass(frozen=True, eq=False)
class WrittenOut:
    """The system [Q A; A^T 0] of a strip with everything written out.

    Its conditions are the steps from model to model, without an error of their own, then those of the program.
    """

    errors: StripErrors
    to_common: Floats  # (p + 1, 7, 7)
    steps: int  # conditions that are steps
    by_images: Floats  # (c, i): all conditions by all image coordinates
    solution: Floats
    inverse: Floats

    @classmethod
    def of(cls, errors: StripErrors, wanted: conditions.Conditions, factor: float) -> WrittenOut:
        """Build, solve and invert it."""
        n, rows, to_common = errors.models, wanted.rows, wanted.similarities.to_common
        count, from_common = 7 * (n - 1), np.linalg.inv(to_common)
        components = np.broadcast_to(np.eye(6), (n, 1, 6, 6))
        of_components = written_out(ErrorRows.without_images(np.arange(n), np.zeros((n, 6, 7)), components), errors)
        by_steps = -from_common[1:n] @ errors.steps[: n - 1] @ of_components[: n - 1]
        own = written_out(alone(rows), errors)[:, 0]
        by_images = np.concatenate([by_steps.reshape(count, own.shape[1]), own])
        design = np.zeros((len(by_images), 7 * n))
        for junction in range(n - 1):
            there = slice(7 * junction, 7 * junction + 7)
            design[there, there] = -from_common[junction + 1] @ to_common[junction]
            design[there, there.stop : there.stop + 7] = np.eye(7)
        for row, model in enumerate(rows.first.tolist()):
            design[count + row, 7 * model : 7 * model + 7] = rows.by_similarity[row, 0] @ to_common[model]
        noise = np.concatenate([np.zeros(count), wanted.noise / factor])
        corner = np.zeros((7 * n, 7 * n))
        whole = np.block([[by_images @ by_images.T + np.diag(noise), design], [design.T, corner]])
        solution = np.linalg.solve(whole, np.concatenate([np.zeros(count), wanted.value, np.zeros(7 * n)]))
        return cls(errors, to_common, count, by_images, solution, np.linalg.inv(whole))

    @property
    def of_conditions(self) -> slice:
        return slice(self.steps, len(self.by_images))

    @property
    def images(self) -> Floats:
        """Errors of all image coordinates, H^T lambda."""
        return np.asarray(self.by_images.T @ self.solution[: len(self.by_images)], float)

    def columns(self, rows: ErrorRows) -> tuple[Floats, Floats]:
        """Rows by all image coordinates, similarities left out, (n, d, i), and their columns b, (n, k, d)."""
        own = written_out(alone(rows), self.errors)
        result = np.zeros((len(rows.first), len(self.solution), own.shape[1]))
        result[:, : len(self.by_images)] = self.by_images @ own.transpose(0, 2, 1)
        for row, model in enumerate(rows.first.tolist()):
            start = len(self.by_images) + 7 * model
            result[row, start : start + 7] = (rows.by_similarity[row] @ self.to_common[model]).T
        return own, result


every_strip = pytest.mark.parametrize(("photos", "lap"), [(2, 62.0), (3, 60.0), (4, 62.0), (8, 62.0), (9, 80.0)])
FACTOR = 1.3


@cache
def solved_twice(photos: int, lap: float, *, distances: bool) -> tuple[system.System, WrittenOut]:
    errors, wanted = prepared(noisy(photos, lap, min(3, photos)), distances=distances)
    return system.system(errors, wanted, FACTOR), WrittenOut.of(errors, wanted, FACTOR)


@pytest.mark.parametrize("distances", [False, True])
@every_strip
def test_the_band_gives_what_the_whole_matrix_gives(photos: int, lap: float, *, distances: bool) -> None:
    """Correlates, errors of images and entries of the inverse against K [lambda; y] = [w; 0] written out."""
    solved, whole = solved_twice(photos, lap, distances=distances)
    result, wanted = noisy(photos, lap, min(3, photos)), solved.conditions
    (strip,), found = result.strips, errors_of(result)
    control = strip.absolute.misclosures[found.control.point, found.control.axis]
    again = conditions.misclosures_at(wanted, strip.of_photos.formed, strip.absolute.similarity, control)
    assert again == pytest.approx(wanted.value, abs=1e-9)
    correlates, largest = whole.solution[whole.of_conditions], np.abs(whole.inverse).max()
    assert solved.correlates == pytest.approx(correlates, abs=1e-8 * np.abs(correlates).max())
    assert solved.squares == pytest.approx(wanted.value @ correlates)
    images = relinearisation.image_errors(solved).ravel()
    assert images == pytest.approx(whole.images, abs=1e-8 * np.abs(images).max())
    cofactors = whole.inverse[whole.of_conditions, whole.of_conditions]
    every = np.arange(len(wanted.value))
    assert prediction.cofactors_of(solved, every) == pytest.approx(np.diag(cofactors), abs=1e-8 * largest)
    mixed = np.random.default_rng(2).permutation(every)
    part = prediction.part_of_inverse(solved, mixed)
    assert part == pytest.approx(cofactors[np.ix_(mixed, mixed)], abs=1e-8 * largest)


@pytest.mark.parametrize("distances", [False, True])
@every_strip
def test_points_and_photos_are_predicted_as_by_the_whole_matrix(photos: int, lap: float, *, distances: bool) -> None:
    solved, whole = solved_twice(photos, lap, distances=distances)
    errors, images, of_all = solved.errors, relinearisation.image_errors(solved), prediction.photo_rows(solved)
    components = relinearisation.component_errors(errors, images)
    of_points = prediction.errors(solved, errors.points, images), prediction.covariances(solved, errors.points)
    of_photos = prediction.photo_errors(solved), prediction.covariances(solved, of_all)
    tables = (every(errors.points), of_points), (of_all, of_photos)
    for rows, (predicted, covariances) in nonempty(tables):
        own, columns = whole.columns(rows)
        moved = relinearisation.displacements(components, rows, images)
        for row in range(len(rows.first)):
            assert predicted[row] == pytest.approx(columns[row].T @ whole.solution, abs=1e-9)
            assert moved[row] == pytest.approx(own[row] @ images.ravel(), abs=1e-9)
            covariance = own[row] @ own[row].T - columns[row].T @ whole.inverse @ columns[row]
            assert covariances[row] == pytest.approx(covariance, abs=1e-8 * np.abs(covariance).max())


@pytest.mark.parametrize("distances", [False, True])
@every_strip
def test_points_go_together_as_by_the_whole_matrix(photos: int, lap: float, *, distances: bool) -> None:
    """Joint covariances of coordinates, and what misclosures do to them."""
    solved, whole = solved_twice(photos, lap, distances=distances)
    points, rng = solved.errors.points, np.random.default_rng(1)
    some = rng.permutation(len(points.first))
    rows = points.take(some).along(np.full((len(some), 3), 3**-0.5))
    own, columns = (each.reshape(len(some), -1) for each in whole.columns(rows))
    expected = own @ own.T - columns @ whole.inverse @ columns.T
    assert prediction.joint_covariance(solved, rows) == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())
    every = rng.permutation(len(solved.conditions.value))
    for chosen in nonempty((every[:2], every)):  # the system is solved for these, or for the rows
        by_conditions = columns @ whole.inverse[:, whole.steps + chosen]
        for part in (np.arange(1), np.arange(len(some))):
            found = prediction.influence(solved, rows.take(part), chosen)[:, 0]
            assert found == pytest.approx(by_conditions[part], abs=1e-8 * np.abs(by_conditions).max())


@pytest.mark.parametrize("sigma", [1e-4, 100.0])
def test_control_of_any_precision_leaves_the_digits_of_points(sigma: float) -> None:
    """Of 0.1 mm, and 1000 times as uncertain as the strip: conditions of points are eliminated by their squares."""
    errors, wanted = prepared(noisy(9, 80.0), distances=True)
    wanted = replace(wanted, noise=np.where(wanted.kind == conditions.CONTROL, sigma**2, 0.0))
    solved, whole = system.system(errors, wanted, 1.0), WrittenOut.of(errors, wanted, 1.0)
    own, columns = whole.columns(every(errors.points))
    expected = own @ own.transpose(0, 2, 1) - columns.transpose(0, 2, 1) @ whole.inverse @ columns
    stated, found = (
        np.sqrt(np.diagonal(each, axis1=1, axis2=2))
        for each in (expected, prediction.covariances(solved, errors.points))
    )
    assert found == pytest.approx(stated, rel=1e-5)
    predicted = prediction.errors(solved, errors.points, relinearisation.image_errors(solved))
    assert predicted == pytest.approx(columns.transpose(0, 2, 1) @ whole.solution, abs=1e-6)


@pytest.mark.parametrize(("photos", "lap"), [(8, 62.0), (9, 80.0)])
def test_points_that_join_models_and_are_set_aside_leave_no_distances(photos: int, lap: float) -> None:
    """Of points whose rays contradict each other; that stand in later models, or in none."""
    before = oriented_of(noisy(photos, lap))
    stage, at_control = before.stage, before.absolute
    assert isinstance(stage, FormedPhotos)
    formed, orientation = stage.formed, stage.orientation
    new = np.setdiff1d(formed.point, formed.point[before.control_rows])
    _, earliest = np.unique(orientation.point, return_index=True)  # rows are ordered by model
    aside = np.isin(orientation.point, new[::4])
    aside[earliest[np.isin(orientation.point[earliest], new[1::4])]] = True
    formed = without_rows(formed, orientation, aside)
    observations = stage.observations
    position = stage.strip.positions(observations)
    errors = strip_errors.differentiate_strip(orientation, formed, at_control.similarity, position, observations.sigma)
    rows = np.searchsorted(formed.point, stage.formed.point[before.control_rows])
    control = misclosures(before.targets.turned(before.at_control), rows, at_control.axes)
    given = at_control.misclosures[control.point, control.axis]
    wanted = conditions.conditions(errors, orientation, formed, control, given)
    joined = formed.junctions
    assert joined.used.all()
    good = np.flatnonzero(~aside[joined.before] & ~aside[joined.after])
    left = wanted.source[wanted.kind == conditions.DISTANCE]
    assert set(left.tolist()) < set(good.tolist())
    assert len(left) == len(good) - len(np.unique(joined.junction[good]))
    solved, whole = system.system(errors, wanted, FACTOR), WrittenOut.of(errors, wanted, FACTOR)
    own, columns = whole.columns(every(errors.points))
    expected = own @ own.transpose(0, 2, 1) - columns.transpose(0, 2, 1) @ whole.inverse @ columns
    assert prediction.covariances(solved, errors.points) == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())
    predicted = prediction.errors(solved, errors.points, relinearisation.image_errors(solved))
    assert predicted == pytest.approx(columns.transpose(0, 2, 1) @ whole.solution, abs=1e-9)


def test_conditions_are_the_same_however_a_strip_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    _, at_once = prepared(noisy(9, 80.0), distances=True)
    monkeypatch.setattr(strip_errors, "SECTION", 1)
    _, wanted = prepared(noisy(9, 80.0), distances=True)
    assert wanted.source.tolist() == at_once.source.tolist()
    assert wanted.value == pytest.approx(at_once.value, abs=1e-12)
    for name in nonempty(("by_component", "by_image", "image", "item")):
        assert getattr(wanted.rows, name) == pytest.approx(getattr(at_once.rows, name), abs=1e-9)


@pytest.mark.slow
def test_short_bases_are_formed_again_before_a_sound_strip_is_contradicted(monkeypatch: pytest.MonkeyPatch) -> None:
    """13 photos a point at 15 micrometres: squares of the elements count in the mean of many distances."""
    flown = Spec(
        seed=102,
        flight=Flight(photos=20, end_lap_percent=94.0),
        points=Points(rows=5, extra_per_model=10),
        control=Control(every=3, check=0),
        image=Image(15.0),
    )
    inputs, found = inputs_of(simulate(flown)), []
    for enough in (adjust.ENOUGH, 1e9):
        monkeypatch.setattr(adjust, "ENOUGH", enough)
        result = triangulate(inputs, replace(COVARIANCE, precision=False))
        figures = result.strips[0].of_photos.covariance
        assert figures is not None
        codes = {note.code for note in result.notes} & {"strip-contradicted", "control-doubtful"}
        found.append((figures.formations, figures.tested.squares / figures.tested.redundancy, bool(codes)))
    (again, ratio, told), (once, before, told_before) = found
    assert again > once == 1
    assert ratio == pytest.approx(1.0, abs=0.04)
    assert before > ratio
    assert (told, told_before) == (False, True)


def test_of_equal_test_values_the_first_is_named_whatever_the_rounding() -> None:
    values = np.array([0.5, 15.23, -15.23 - 1e-11, 15.23 + 1e-11, 9.0])
    tested = prediction.AdjustmentTest(
        squares=1.0, redundancy=1, normalised=values, size=values, distances=0, level=0.01
    )
    assert tested.doubtful.tolist() == [1, 2, 3, 4]


@pytest.mark.slow
def test_a_long_free_end_keeps_its_digits() -> None:
    """Blocks of another width round otherwise; the similarity of every photo as an unknown lost five digits here."""
    result = noisy(150, 62.0, 2)
    errors, wanted = prepared(result, distances=True)
    ends = errors.models // 2
    far = (wanted.kind == conditions.CONTROL) & (wanted.rows.first > ends)
    wanted = replace(wanted, noise=np.where(far, 1e12, wanted.noise))
    narrow = system.system(errors, wanted, 1.0)
    points = errors.points
    padded = np.concatenate([points.by_component, np.zeros_like(points.by_component)], axis=1)
    wide = system.system(replace(errors, points=replace(points, by_component=padded)), wanted, 1.0)
    assert wide.blocks.width > narrow.blocks.width
    stated, again = (
        np.sqrt(np.diagonal(prediction.covariances(each, points), axis1=1, axis2=2)) for each in (narrow, wide)
    )
    assert stated.max() > 30.0  # metres
    assert again == pytest.approx(stated, rel=1e-7)


def test_blocks_are_eliminated_like_any_system() -> None:
    """Indefinite blocks of random numbers: as the dense one."""
    rng, count, height = np.random.default_rng(8), 5, 6
    diagonal, beside = rng.normal(size=(count, height, height)), rng.normal(size=(count, height, height))
    diagonal = diagonal + diagonal.transpose(0, 2, 1) + np.diag([9.0, 9.0, -9.0, 9.0, -9.0, -9.0])
    dense = np.zeros((count, height, count, height))
    for number in range(count):
        dense[number, :, number] = diagonal[number]
        if number + 1 < count:
            dense[number, :, number + 1], dense[number + 1, :, number] = beside[number], beside[number].T
    whole = dense.reshape(count * height, count * height)
    inverse = np.linalg.inv(whole)
    factors = block_tridiagonal.eliminate(diagonal, beside)
    right = rng.normal(size=(count, height, 3))
    expected = np.linalg.solve(whole, right.reshape(-1, 3)).reshape(right.shape)
    assert factors.solve(right) == pytest.approx(expected, rel=1e-9)
    for number in nonempty(range(count)):
        near = slice(number * height, (number + 2) * height)
        assert factors.near_diagonal(number, slice(None), slice(None)) == pytest.approx(inverse[near, near], abs=1e-9)
        rows = np.append(number * height + np.arange(1, height), (number + 1) * height + np.arange(2, height))
        rows = rows[rows < len(inverse)]
        part = factors.near_diagonal(number, slice(1, None), slice(2, None))
        assert part == pytest.approx(inverse[np.ix_(rows, rows)], abs=1e-9)


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
    inputs, own = result.inputs, result.strips[0].of_photos.solved
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
        told = [note.code for note in result.notes if note.code == "not-converged"]
        assert told == ["not-converged"] * (most == 1)
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


def adjusted(
    seed: int, *, wrong: float = 0.0, axis: int = 2, off: str = "", stated: float = 1.0
) -> tuple[StripResult, str]:
    """A strip of 12 photos with its errors, and one control point made wrong; one may be switched off.

    stated: stated over true standard deviation of the image coordinates.
    """
    inputs = without_noise(spec(12, bands=5))
    rng = np.random.default_rng(seed)
    xy = inputs.observations.xy + rng.normal(0, 0.005, inputs.observations.xy.shape)
    control = inputs.control
    given = control.enu + rng.normal(0, 1, control.enu.shape) * control.sigma
    row = [n for n, check in enumerate(control.check) if not check][7]
    given[row, axis] += wrong
    use = control.use & (np.array(control.ids) != off)[:, None]
    observations = replace(inputs.observations, xy=xy, sigma=stated * inputs.observations.sigma)
    changed = replace(inputs, observations=observations, control=replace(control, enu=given, use=use))
    return triangulate(changed, COVARIANCE).strips[0], control.ids[row]


@pytest.mark.slow
@pytest.mark.parametrize(("axis", "size"), [(0, 1.0), (1, -1.0), (2, 1.5)])
def test_a_wrong_control_point_is_named(axis: int, size: float) -> None:
    """And the error is estimated; without it no point is named."""
    strip, name = adjusted(3, wrong=size, axis=axis)
    notes = [note for note in strip.notes if note.code == "control-doubtful"]
    assert [note.points for note in notes] == [(name,)]
    assert not [note for note in strip.notes if note.code == "strip-contradicted"]  # that point explains it
    assert strip.of_photos.covariance is not None
    worst = strip.of_photos.covariance.tested.doubtful[0]
    assert strip.of_photos.covariance.tested.size[worst] == pytest.approx(size, abs=0.45)
    clean, _ = adjusted(3)
    assert not [note for note in clean.notes if note.code in {"control-doubtful", "strip-contradicted"}]


@pytest.mark.slow
def test_the_rest_is_tested_as_if_the_doubtful_point_were_not_given() -> None:
    strip, name = adjusted(3, wrong=1.0)
    figures = strip.of_photos.covariance
    assert figures is not None
    assert figures.rest is not None
    without, _ = adjusted(3, wrong=1.0, off=name)
    alone = without.of_photos.covariance
    assert alone is not None
    assert alone.rest is None  # nothing is doubtful there
    assert figures.rest.redundancy == alone.tested.redundancy == figures.tested.redundancy - 3
    assert figures.rest.squares == pytest.approx(alone.tested.squares, rel=1e-3)
    assert figures.tested.probability < 1e-3 < figures.rest.probability


@pytest.mark.slow
@pytest.mark.parametrize("stated", [1 / 3, 3.0])
def test_tests_hold_where_parallaxes_contradict_the_stated_sigma(stated: float) -> None:
    """Where the y parallaxes have found the true one, tests are made with it: no false alarm, nothing is missed."""
    strips = [adjusted(seed, stated=stated) for seed in nonempty(range(8))]
    strips.append(adjusted(8, wrong=1.2, stated=stated))
    found = [strip.of_photos.covariance for strip, _ in strips]
    assert {each.basis for each in found if each is not None} == {"a-posteriori"}
    tested = [each.tested for each in found if each is not None]
    ratio = np.array([each.squares / each.redundancy for each in tested[:-1]])
    assert ratio.mean() == pytest.approx(1.0, abs=0.25)  # not 9 and 1/9
    assert [len(each.doubtful) for each in tested[:-1]].count(0) >= 7
    strip, name = strips[-1]
    assert [note.points for note in strip.notes if note.code == "control-doubtful"] == [(name,)]


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
    notes = {note.code: note.message for note in strip.notes}
    assert "systematic errors of the images" in notes["strip-contradicted"]
    assert ("also without" in notes["strip-contradicted"]) == ("control-doubtful" in notes)  # none is to blame alone


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
