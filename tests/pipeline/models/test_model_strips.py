"""Strips of independent models from their coordinates to the ground: truth, precision, what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.network.settings import BundleSettings
from photostrip.pipeline.inputs import Inputs, MeasuredModels, Settings
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.run import triangulate
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Ground, Models, Points, Spec, simulate
from photostrip.strip import polynomial
from photostrip.strip.gross_errors import control_search
from photostrip.strip.independent_models import formation
from photostrip.strip.independent_models.linking import LinkSettings
from tests.loops import nonempty
from tests.models import inputs, truth
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.points import ModelPoints

    Floats = NDArray[np.float64]

EXACT = 1e-6  # m
FREE = (0.0, 0.0, 0.0)
PLAIN = Settings(adjustment="similarity")


def with_points(given: Inputs, points: ModelPoints) -> Inputs:
    assert given.models is not None
    return replace(given, models=replace(given.models, points=points))


def linked(given: Inputs, settings: Settings = PLAIN) -> StripResult:
    (strip,) = triangulate(given, settings).strips
    return strip


@pytest.mark.parametrize(
    ("crs", "adjustment", "hand"),
    [
        ("EPSG:32633", "polynomial", "right-handed"),
        ("local", "similarity", "left-handed"),
        ("geocentric", "polynomial", "left-handed"),
        ("geocentric", "similarity", "right-handed"),
    ],
)
def test_models_without_errors_come_back_to_the_truth(crs: str, adjustment: str, hand: str) -> None:
    axes = ("x", "y", "z") if crs == "geocentric" else ("east", "north", "up")
    asked = Models(sigma_um=FREE, center_sigma_um=FREE, axes="any", hand=hand)
    spec = Spec(ground=Ground(crs, axes), flight=Flight(photos=7, strips=2), control=Control(noise=FREE), models=asked)
    simulated = simulate(spec)
    result = triangulate(inputs_of(simulated), Settings(adjustment=adjustment))
    assert np.abs(result.points.cartesian - simulated.truth.points.xyz[result.points.number]).max() < EXACT
    place = {photo: row for row, photo in enumerate(simulated.truth.photo_ids)}
    for strip in nonempty(result.strips):
        found = strip.intermediate.cartesian_from_intermediate(strip.centers)
        assert np.abs(found - simulated.truth.centers[[place[photo] for photo in strip.strip.photos]]).max() < EXACT
    assert len(result.ties.number) > 3
    assert np.abs(result.ties.difference).max() < EXACT


def test_a_bent_strip_takes_its_centers_along() -> None:
    """A strip that is bent as a beam: the polynomial straightens the ground, and the centres above it with it."""
    given = truth(8, 3, 2)
    bend = 2e-7  # 1/m: 2.6 m of height at the ends, and 2.1 m along the strip at the height of the centres
    middle = given.centers[:, 0].mean()

    def bent(xyz: Floats) -> Floats:
        x, up = xyz[:, 0] - middle, xyz[:, 2]
        return np.column_stack([xyz[:, 0] - 2 * bend * x * up, xyz[:, 1], up + bend * x**2])

    beam = replace(given, points=bent(given.points), centers=bent(given.centers))
    points = beam.measured()
    settings = Settings("polynomial", polynomial=polynomial.PolynomialSettings("2"))
    plain, strip = (linked(inputs(given, points, bands=9), each) for each in (PLAIN, settings))
    off = [np.abs(s.intermediate.cartesian_from_intermediate(s.centers) - given.centers).max() for s in (plain, strip)]
    assert off[0] > 1.0
    assert off[1] < 0.05


def test_the_hand_of_the_axes_is_told() -> None:
    given = truth(5, 3, 2, relief=3.0)
    measured = given.measured()
    mirrored = replace(measured, xyz=measured.xyz * [1.0, -1.0, 1.0])
    with pytest.raises(InputError) as told:
        triangulate(inputs(given, mirrored), PLAIN)
    assert [fault.code for fault in told.value.faults] == ["left-handed-models"]
    swapped = inputs(given, measured)
    control = replace(swapped.control, enu=swapped.control.enu[:, [1, 0, 2]])
    with pytest.raises(InputError) as told:
        triangulate(replace(swapped, control=control), PLAIN)
    assert [fault.code for fault in told.value.faults] == ["left-handed-models"]


def test_centers_may_be_missing() -> None:
    given = truth(5, 4, 2)
    measured = given.measured()
    points = len(given.points)
    for gone in (given.node == points + 2, given.node >= points):
        rows = np.flatnonzero(~gone)
        some = replace(
            measured, model=given.model[rows], node=given.node[rows], xyz=measured.xyz[rows], sigma=measured.sigma[rows]
        )
        result = triangulate(inputs(given, some), Settings())
        assert np.abs(result.points.cartesian - given.points).max() < EXACT
        document = document_of(result)
        empty = [photo["id"] for photo in document["photos"] if photo["x"] is None]
        assert empty == (["103"] if gone.sum() == 2 else list(measured.photo_ids))
        assert {note["code"] for note in document["notes"]} >= {"link-without-center"}
        assert len(sections_of(document)) > 10


@pytest.mark.parametrize("coordinates", [100, 27])
def test_a_wrong_control_point_is_named(monkeypatch: pytest.MonkeyPatch, coordinates: int) -> None:
    """In sections, too."""
    monkeypatch.setattr(control_search, "LARGEST_SECTION", coordinates)
    given = truth(8, 3, 4)
    noise = np.random.default_rng(1).normal(size=(len(given.model), 3))
    whole = inputs(given, given.measured(noise), bands=5)
    enu = whole.control.enu.copy()
    row = int(np.flatnonzero(~whole.control.check)[4])
    enu[row, 2] += 5.0
    strip = linked(replace(whole, control=replace(whole.control, enu=enu)))
    assert [(each.row, each.axes) for each in strip.wrong_control] == [
        (strip.control.ids.index(whole.control.ids[row]), (2,))
    ]
    assert strip.wrong_control[0].size[2] == pytest.approx(5.0, abs=1.0)


def test_entries_that_name_nothing_are_refused() -> None:
    given = truth(3)
    lists = LinkSettings(keep=("M1/P001", "M9/P001"), drop=("M1/P001", "M2/104", "M2/102"))
    with pytest.raises(InputError) as told:
        triangulate(inputs(given, given.measured()), Settings(links=lists))
    assert [(fault.key, fault.message.split("`")[1]) for fault in told.value.faults] == [
        ("processing.links.keep", "M9/P001"),
        ("processing.links.drop", "M2/104"),
        ("processing.links.drop", "M1/P001"),
    ]


def test_a_model_alone_is_a_strip() -> None:
    given = truth(1, 4, 4)
    result = triangulate(inputs(given, given.measured(), bands=2), PLAIN)
    assert np.abs(result.points.cartesian - given.points).max() < EXACT
    assert len(sections_of(document_of(result))) > 10


# ---------------------------------------------------------------------------------------------------- precision


def test_centers_follow_the_polynomial_as_a_stiff_body() -> None:
    """The rows are the polynomial at the ground, tilted by its slope, stretched by its scale: by differences."""
    rng = np.random.default_rng(3)
    terms = [("1", "X", "Y", "XY", "X^2", "X^3")] * 3
    coefficients = rng.normal(size=(3, 6)) * 1e-3
    place, above, step = np.array([[0.7, -0.4, 2.0]]), np.array([1.5]), 1e-6

    def field(x: float, y: float) -> Floats:
        return np.asarray(coefficients @ np.array([1.0, x, y, x * y, x**2, x**3]), float)

    x, y = 0.7, -0.4
    by_x = (field(x + step, y) - field(x - step, y)) / (2 * step)
    by_y = (field(x, y + step) - field(x, y - step)) / (2 * step)
    rows = formation.displacement_rows(place, above, terms)
    found = sum(row[0] @ c for row, c in zip(rows, coefficients, strict=True))
    tilt = 1.5 * np.array([-by_x[2], -by_y[2], (by_x[0] + by_y[1]) / 2])
    np.testing.assert_allclose(found, field(x, y) + tilt, atol=1e-9)


SEARCHED_FOR_NOTHING = Settings(links=LinkSettings("none"))


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_standard_deviations_are_those_of_repetitions() -> None:
    """The squares of errors at right angles that have their own size add up to the variance of what is linear."""
    given, rng = truth(3, 3, 1), np.random.default_rng(5)
    first = inputs(given, given.measured(rng.normal(size=(len(given.model), 3))), bands=2)
    settings = replace(SEARCHED_FOR_NOTHING, bundle=BundleSettings(test="baarda"))
    whole = triangulate(first, settings)
    assert whole.precision is not None
    assert whole.precision.basis == ("a-priori",)
    points, places = [], []
    taken = ~first.control.check
    values = 3 * len(given.model) + 3 * int(taken.sum())
    for drawn in np.linalg.qr(rng.normal(size=(values, values)))[0] * np.sqrt(values):
        of_models, of_control = np.split(drawn.reshape(-1, 3), [len(given.model)])
        again = with_points(first, given.measured(of_models))
        enu = first.control.enu.copy()
        enu[taken] += 0.02 * of_control
        found = triangulate(replace(again, control=replace(first.control, enu=enu)), settings)
        (strip,) = found.strips
        points.append(found.points.cartesian - given.points[found.points.number])
        places.append(strip.intermediate.cartesian_from_intermediate(strip.centers) - given.centers)
    for samples, covariances in (
        (np.array(points), whole.precision.points),
        (np.array(places), whole.precision.photos[0][:, :3, :3]),
    ):
        ratio = np.sqrt((samples**2).mean(axis=0) / np.diagonal(covariances, axis1=1, axis2=2))
        assert ratio.min() > 0.99
        assert ratio.max() < 1.01


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_check_points_lie_within_what_is_stated() -> None:
    squares = coordinates = 0.0
    for seed in range(12):
        given = truth(8, 3, seed)
        noise = np.random.default_rng(seed).normal(size=(len(given.model), 3))
        result = triangulate(inputs(given, given.measured(noise)), Settings())
        assert result.precision is not None
        (test,) = result.precision.checks
        assert test is not None
        squares, coordinates = squares + test.squares, coordinates + test.coordinates
    assert 0.85 < squares / coordinates < 1.15  # of 650 coordinates


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_the_network_is_better_than_the_chain_with_polynomials() -> None:
    """Plan by a third and more; heights as far as the control leaves them to the models."""
    off: dict[str, list[Floats]] = {"auto": [], "polynomial": []}
    for seed in range(101, 107):
        simulated = simulate(Spec(seed=seed, flight=Flight(photos=25), control=Control(bands=5), models=Models()))
        given = inputs_of(simulated)
        for adjustment, found in off.items():
            result = triangulate(given, Settings(adjustment=adjustment, precision=False))
            found.append(result.control_differences[given.control.check])
    rms = {key: np.sqrt(np.nanmean(np.concatenate(found) ** 2, axis=0)) for key, found in off.items()}
    assert (rms["auto"] / rms["polynomial"] < [0.75, 0.75, 0.9]).all()


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_correlated_model_coordinates_count_as_such() -> None:
    """Heights that go with x, as of a plotter read obliquely: known, they are weighted; ignored, points get worse."""
    given, rng = truth(8, 3, 1), np.random.default_rng(3)
    root = np.linalg.cholesky(np.array([[1.0, 0.0, 0.95], [0.0, 1.0, 0.0], [0.95, 0.0, 1.0]]))
    off: dict[bool, list[Floats]] = {True: [], False: []}
    for _ in range(12):
        noise = rng.normal(size=(len(given.model), 3)) @ root.T
        measured = given.measured(noise)
        known = replace(measured, correlation=np.tile(root @ root.T, (len(measured), 1, 1)))
        for told, found in off.items():
            result = triangulate(inputs(given, known if told else measured), SEARCHED_FOR_NOTHING)
            found.append(result.points.cartesian - given.points[result.points.number])
    rms = {told: np.sqrt(np.mean(np.concatenate(found) ** 2)) for told, found in off.items()}
    assert rms[True] < 0.95 * rms[False]


@pytest.mark.slow
def test_a_block_of_models_is_more_precise_than_its_strips() -> None:
    spec = Spec(flight=Flight(photos=6, strips=2), models=Models())
    given = inputs_of(simulate(spec))
    result = triangulate(given, Settings())
    assert result.precision is not None
    assert np.isfinite(result.precision.points).all()
    assert given.models is not None
    alone = []
    for number, strip in nonempty(enumerate(given.models.strips)):
        only = replace(given, models=MeasuredModels((strip,), given.models.points))
        alone.append(triangulate(only, Settings()))
        assert len(alone[number].strips) == 1
    both = np.intersect1d(alone[0].points.number, alone[1].points.number)
    assert len(both)
    size = [np.trace(r.precision.points, axis1=1, axis2=2)[np.isin(r.points.number, both)] for r in (*alone, result)]  # type: ignore[union-attr]
    assert (size[2] < np.minimum(size[0], size[1])).all()


# ------------------------------------------------------------------------------------------------- mistakes


def mistaken(kind: str) -> Inputs:
    """A strip with one mistake in it."""
    given = inputs_of(
        simulate(Spec(seed=4, flight=Flight(photos=10), points=Points(extra_per_model=4), models=Models()))
    )
    assert given.models is not None
    points, control = given.models.points, given.control
    xyz, enu, sigma = points.xyz.copy(), control.enu.copy(), points.sigma
    inside = points.node < len(points.point_ids)
    twice = [k for k in np.flatnonzero((points.model == 3) & inside) if (points.node == points.node[k]).sum() == 2]
    if kind == "a model in metres":
        xyz[points.model == 2] /= 1000
    elif kind == "one id for two points":
        xyz[twice[0]] = xyz[twice[-1]] + [3.0, -2.0, 0.1]
    elif kind == "sigma in mm":
        sigma = sigma * 1000
    elif kind == "sigma in m":
        sigma = sigma / 1000
    elif kind == "centers below":
        for model in range(len(points.model_ids)):
            rows = points.model == model
            ground = xyz[rows & inside, 2].mean()
            xyz[rows & ~inside, 2] = 2 * ground - xyz[rows & ~inside, 2]
    elif kind == "control swapped":
        enu = enu[:, [1, 0, 2]]
    elif kind == "a digit":
        enu[np.flatnonzero(~control.check)[3], 0] += 1000.0
    elif kind == "heights in feet":
        enu[:, 2] /= 0.3048
    whole = replace(given, control=replace(control, enu=enu))
    return with_points(whole, replace(points, xyz=xyz, sigma=sigma))


@pytest.mark.parametrize(
    ("kind", "notes", "findings"),
    [
        ("nothing", set(), set()),
        ("a model in metres", {"odd-scale"}, set()),
        ("sigma in mm", {"sigma-unit", "unit-weight"}, set()),
        ("sigma in m", {"sigma-unit", "sigma-contradicted", "unit-weight"}, set()),
        ("a digit", {"control-rejected"}, {"P406"}),
        ("heights in feet", {"control-doubtful", "unit-weight"}, {"P405"}),
    ],
)
def test_mistakes_that_a_result_tells(kind: str, notes: set[str], findings: set[str]) -> None:
    result = triangulate(mistaken(kind), Settings(precision=False))
    assert {note.code for note in result.notes} - {"weak-link"} == notes
    assert {finding.code for finding in result.findings} == findings


@pytest.mark.parametrize(("model", "name", "left", "told"), [(3, "1004-2", 3, True), (7, "1007-4", 5, False)])
def test_a_link_that_its_search_leaves_three_points_is_told(model: int, name: str, left: int, *, told: bool) -> None:
    """With three points only two conditions say that these are the right ones."""
    given = mistaken("nothing")
    assert given.models is not None
    points, xyz = given.models.points, given.models.points.xyz.copy()
    row = np.flatnonzero((points.model == model) & (points.node == points.point_ids.index(name)))
    xyz[row, 0] += 1.0
    result = triangulate(with_points(given, replace(points, xyz=xyz)), PLAIN)
    (strip,) = result.strips
    assert strip.model_stages is not None
    links = strip.model_stages.formed.links
    assert links.used[links.shared.link == model - 1].sum() == left
    assert [note.points for note in result.notes if note.code == "contradicting-link"] == [(name,)] * told


@pytest.mark.parametrize(("name", "lost"), [("G01", False), ("G04", True)])
def test_control_measured_wrongly_in_a_model_is_told(name: str, *, lost: bool) -> None:
    """In one model its given coordinates contradict it and show as rejected; of two models none places it."""
    given = mistaken("nothing")
    assert given.models is not None
    points, xyz = given.models.points, given.models.points.xyz.copy()
    xyz[np.flatnonzero(points.node == points.point_ids.index(name))[0], 0] += 1.0
    document = document_of(triangulate(with_points(given, replace(points, xyz=xyz)), PLAIN))
    (row,) = (row for row in document["control"] if row["id"] == name)
    assert (row["measured"], bool(row["rejected"])) == (not lost, not lost)
    (text,) = (text for text in document["verdict"]["look_at"] if name in text)
    assert text.startswith(f"control point {name} {'took no part' if lost else 'contradicts the strip'}")


@pytest.mark.parametrize(("kind", "finding"), [("control swapped", "P401"), ("centers below", "P401")])
def test_mistakes_that_stop_a_run(kind: str, finding: str) -> None:
    with pytest.raises(InputError) as told:
        triangulate(mistaken(kind), Settings(precision=False))
    assert [fault.code for fault in told.value.faults] == ["left-handed-models"]
    assert finding in {each.code for each in told.value.findings}


def test_one_id_for_two_points_is_told() -> None:
    result = triangulate(mistaken("one id for two points"), Settings(precision=False))
    (row,) = [row for row in document_of(result)["rejected"] if row["stage"] == "link"]
    assert "as where one id stands for two points" in row["reason"]
    assert row["models"] in (["M3", "M4"], ["M4", "M5"])
    assert row["point"] in result.not_determined
