"""Strip polynomials: printed examples, what control can carry, what evidence supports, the traps of the method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.stats import f as f_distribution

from photostrip.arrays import Floats
from photostrip.geometry.similarity import Similarity
from photostrip.pipeline.inputs import Settings as RunSettings
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.strip import polynomial
from photostrip.strip.absolute_orientation import PointPrecision, weights
from photostrip.strip.polynomial import (
    DROP_ORDER,
    LADDER,
    POWERS,
    Evidence,
    FitProblem,
    Polynomial,
    PolynomialSettings,
    choose_terms,
    fit,
)
from tests.loops import nonempty
from tests.source_tree import ROOT
from tests.strips import MICROMETRE, Flown, control_points, fly, project, targets
from tests.vectors import Vector, cases

pytestmark = pytest.mark.usefixtures("_no_findings")

SEEDS = st.integers(0, 2**32 - 1)
CUBIC = ("1", "X", "Y", "XY", "X^2", "X^3")
SQUARE = ("1", "X", "Y", "XY", "X^2")
SPACING, BREADTH = 900.0, 1500.0  # metres


def columns(xyz: ArrayLike, terms: Sequence[str] = CUBIC) -> Floats:
    """Design written out by hand."""
    x, y, _ = np.asarray(xyz, float).T
    values = {"1": x * 0 + 1, "X": x, "Y": y, "XY": x * y, "X^2": x**2, "X^3": x**3}
    return np.column_stack([values[term] for term in terms])


def problem(
    xyz: ArrayLike,
    given_: ArrayLike,
    use: Sequence[str] = (),
    sigma: ArrayLike = 0.01,
    *,
    spacing: float = SPACING,
    azimuth_deg: float = 90.0,
) -> FitProblem:
    """Control points of a strip along X in a frame that is east, north, up."""
    points = {f"{number}": row for number, row in enumerate(np.asarray(given_, float))}
    control = control_points(points, dict(zip(points, use, strict=False)), sigma)
    return FitProblem(
        np.asarray(xyz, float),
        targets(control, azimuth_deg),
        weights(control, PointPrecision(0.0, 0.0)),
        spacing,
        BREADTH,
    )


def layout(stations: ArrayLike, rows: Sequence[float] = (-1400.0, 0.0, 1400.0), scatter: float = 60.0) -> Floats:
    """Control in bands across the strip, a little off their stations, with some relief."""
    along = np.asarray(stations, float)
    rng = np.random.default_rng(len(along))
    plan = np.array([[x, y] for x in along for y in rows])
    return np.column_stack([plan + rng.uniform(-scatter, scatter, plan.shape), rng.uniform(0, 200, len(plan))])


def bent(xyz: Floats, size: float, power: int) -> Floats:
    """Deformation of the strip that grows with a power of X to a size at its ends, in all axes."""
    return np.outer((xyz[:, 0] / 9000.0) ** power, [size, -0.8 * size, 1.2 * size])


SEVEN = np.linspace(-9000, 9000, 7)


@pytest.mark.parametrize("example", cases("polynomials"))
def test_the_examples_of_the_formula_book(example: Vector) -> None:
    xyz, given_ = np.array(example.input["photogrammetric_XYZ"]), np.array(example.input["geodetic_XYZ"])
    terms, expected, tol = tuple(example.input["terms"]), example.expected, example.tol
    design = columns(xyz, terms)
    assert np.linalg.matrix_rank(design / np.abs(design).max(axis=0)) == expected["rank"]
    found = fit(problem(xyz, given_), PolynomialSettings("3" if "X^3" in terms else "2"))
    if "error_or_fallback" in expected:
        assert [axis.terms for axis in found.axes] == [SQUARE] * 3
        assert found.degree == 2
        return
    reach = np.abs(design).max(axis=0)
    for number, name in enumerate("ABC"):
        axis = found.axes[number]
        assert axis.terms == terms
        effect = np.abs(axis.coefficients - expected[f"{name}_coefficients"]) * reach
        assert effect.max() < tol["coefficient_effect_m"]
        theirs = np.array(expected["residuals_V"])[:, number]
        assert np.allclose(axis.residuals, theirs, rtol=0, atol=tol["residuals_m"])
    corrected = found(np.array([example.input["new_point"]]))[0]
    assert np.allclose(corrected, expected["corrected_new_point"], rtol=0, atol=tol["corrected_point_m"])


def polynomial_scales(xyz: Floats) -> Floats:
    reach = np.abs(xyz[:, 0]).max()
    return np.array([1, reach, BREADTH, reach * BREADTH, reach**2, reach**3])


@pytest.mark.slow
@given(SEEDS)
@examples(max_examples=40)
def test_the_fit_is_weighted_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xyz = layout(SEVEN)
    plan, height = rng.uniform(0.05, 0.5, (2, 21, 1))
    given_ = xyz + rng.normal(0, 0.5, xyz.shape)
    found = fit(problem(xyz, given_, sigma=np.hstack([plan, plan, height])), PolynomialSettings("3"))
    design = columns(xyz) / polynomial_scales(xyz)
    for number, sigma in enumerate((plan, plan, height)):
        theirs, *_ = np.linalg.lstsq(design / sigma, (given_ - xyz)[:, number] / sigma[:, 0], rcond=None)
        axis = found.axes[number]
        assert np.allclose(axis.effects, theirs, rtol=0, atol=1e-8)
        assert np.allclose(axis.residuals, (xyz - given_)[:, number] + design @ theirs, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("points", "stations", "asked", "exact"),
    [
        (7, 4, CUBIC, CUBIC),
        (6, 4, SQUARE, CUBIC),
        (6, 3, SQUARE, SQUARE),
        (12, 3, SQUARE, SQUARE),
        (5, 3, ("1", "X", "Y", "X^2"), SQUARE),
        (5, 5, ("1", "X", "Y", "X^2"), SQUARE),
        (4, 3, ("1", "X", "Y"), ("1", "X", "Y", "X^2")),
        (4, 2, ("1", "X", "Y"), ("1", "X", "Y")),
        (8, 2, ("1", "X", "Y"), ("1", "X", "Y")),
        (3, 2, (), ("1", "X", "Y")),
        (2, 2, (), ()),
    ],
)
def test_the_ladder(points: int, stations: int, asked: tuple[str, ...], exact: tuple[str, ...]) -> None:
    along = np.linspace(-9000, 9000, stations)
    xyz = np.array([[along[n % stations], 1400.0 * (-1) ** (n // stations + n % stations), 0.0] for n in range(points)])
    one = problem(xyz, xyz)
    assert choose_terms(xyz, 3, one.sizes) == asked
    assert choose_terms(xyz, 3, one.sizes, forced=True) == exact


def test_every_term_can_be_dropped_and_stands_on_the_page() -> None:
    assert {*LADDER[0][0]} == {"1", *DROP_ORDER} == {*POWERS}
    terms = " + ".join(f"A_{n} {power}".removesuffix(" 1") for n, power in enumerate(POWERS))
    assert f" + {terms}$" in (ROOT / "docs/method.md").read_text(encoding="utf-8")


def noisy(seed: int, deformation: Floats, xyz: Floats, sigma: float = 0.05) -> FitProblem:
    """Control after a similarity: the deformation and noise, as far as seven parameters do not take them up."""
    rng = np.random.default_rng(seed)
    given_ = xyz + deformation + rng.normal(0, sigma, xyz.shape)
    return problem(Similarity.from_points(xyz, given_)(xyz), given_, sigma=sigma)


@pytest.mark.slow
@pytest.mark.parametrize(("power", "degree"), [(2, 2), (3, 3)])
def test_a_deformation_asks_for_its_degree(power: int, degree: int) -> None:
    xyz = layout(SEVEN)
    degrees = [fit(noisy(seed, bent(xyz, 3.0, power), xyz), PolynomialSettings()).degree for seed in range(30)]
    assert min(degrees) == degree
    assert degrees.count(degree) > 15  # a term too many is taken now and then; it costs little


@pytest.mark.slow
def test_without_deformation_the_similarity_is_kept_as_often_as_the_tests_say() -> None:
    xyz = layout(SEVEN)
    degrees = np.array([fit(noisy(seed, 0 * xyz, xyz), PolynomialSettings()).degree for seed in range(120)])
    kept = (degrees == 0).mean()
    assert 0.9 < kept < 1.0


def steps(found: Polynomial, group: str) -> list[Evidence]:
    return [evidence for evidence in found.evidence if evidence.group == group]


def test_the_f_test_is_that_of_two_sums_of_squares() -> None:
    xyz = layout(SEVEN)
    affine = np.column_stack([0 * xyz[:, 0], xyz[:, 1] * 1e-2, xyz[:, 1] * 1e-2])  # so that every degree is a step
    one = noisy(1, bent(xyz, 2.0, 2) + affine, xyz, sigma=0.05)
    one = replace(one, weight=one.weight * 1e6)  # the control's own sigma does not limit the variance
    found, squares = fit(one, PolynomialSettings()), {}
    for terms in (("1", "X", "Y"), SQUARE, CUBIC):
        design = columns(one.xyz, terms) / np.abs(columns(one.xyz, terms)).max(axis=0)
        residuals = one.misclosures - design @ np.linalg.lstsq(design, one.misclosures, rcond=None)[0]
        squares[len(terms)] = (residuals**2).sum(axis=0)
    second, third = steps(found, "height")[2:]
    assert (second.degree, second.against, second.accepted) == (2, 1, True)
    assert (third.degree, third.against) == (3, 2)
    for evidence, before, after in ((second, 3, 5), (third, 5, 6)):
        gained, left = 3 * (after - before), 3 * (21 - after)
        ratio = ((squares[before] - squares[after]) / (squares[after] / (21 - after))).sum() / gained
        assert evidence.f == pytest.approx(ratio, rel=1e-6)
        assert evidence.p == pytest.approx(f_distribution.sf(ratio, gained, left), rel=1e-6, abs=1e-12)


def left_out_by_refitting(
    one: FitProblem, terms: Sequence[str], axes: Sequence[int], groups: Sequence[ArrayLike]
) -> float:
    """Fit again and again without some of the control, and look at what was left out."""
    errors: list[float] = []
    for axis in axes:
        used = one.by_axis[:, axis] > 0
        root = np.sqrt(one.by_axis[:, axis])
        for rows in groups:
            rest = used.copy()
            rest[np.asarray(rows)] = False
            design = columns(one.xyz, terms)
            scale = np.abs(design).max(axis=0)
            target = -one.misclosures[:, axis]
            solution, *_ = np.linalg.lstsq((design / scale * root[:, None])[rest], (target * root)[rest], rcond=None)
            errors += (target - design / scale @ solution)[np.asarray(rows)].tolist()
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.slow
@given(SEEDS)
@examples(max_examples=20)
def test_bands_left_out_in_closed_form_are_refitted(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xyz = layout(SEVEN)
    sigma = np.repeat(rng.uniform(0.05, 0.2, (21, 1)), 3, axis=1)
    given_ = xyz + bent(xyz, 0.5, 2) + rng.normal(0, 1, xyz.shape) * sigma
    one = problem(xyz, given_, sigma=sigma)
    found = fit(one, PolynomialSettings("3"))
    inner = [np.arange(3 * band, 3 * band + 3) for band in range(1, 6)]
    for group, axes in nonempty(polynomial.GROUPS):
        for evidence in steps(found, group)[1:]:
            assert evidence.left_out_by == "band"
            terms = {1: ("1", "X", "Y"), 2: SQUARE, 3: CUBIC}[evidence.degree]
            assert evidence.left_out == pytest.approx(left_out_by_refitting(one, terms, axes, inner), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("bands_", [3, 4, 7])
def test_auto_is_never_worse_than_the_similarity_by_more_than_noise(bands_: int) -> None:
    """A strip that is not deformed: errors at points that are not control, over 40 strips."""
    xyz = layout(np.linspace(-9000, 9000, bands_))
    rng = np.random.default_rng(bands_)
    anywhere = rng.uniform([-9000, -1400, 0], [9000, 1400, 200], (40, 3))
    squares = {"similarity": 0.0, "auto": 0.0, "3": 0.0}
    for _ in range(40):
        given_ = xyz + rng.normal(0, 0.1, xyz.shape)
        similarity = Similarity.from_points(xyz, given_)
        one = problem(similarity(xyz), given_, sigma=0.1)
        moved = similarity(anywhere)
        squares["similarity"] += ((moved - anywhere) ** 2).sum()
        for degree in ("auto", "3"):
            squares[degree] += ((fit(one, PolynomialSettings(degree))(moved) - anywhere) ** 2).sum()
    auto, forced = (np.sqrt(squares[name] / squares["similarity"]) for name in ("auto", "3"))
    assert 1.0 <= auto < 1.25
    assert auto < forced  # the highest degree pays for every term


@pytest.mark.slow
@given(st.floats(0, 360))
@examples(max_examples=20)
def test_plan_control_comes_in_along_the_axes_of_its_ground_frame(azimuth: float) -> None:
    """The intermediate frame may be turned against the grid; the polynomial is that of the intermediate frame."""
    xyz = layout(SEVEN)
    deformation = bent(xyz, 2.0, 2)
    use = ["xy" if n % 2 else "xyz" for n in range(21)]
    one = problem(xyz, np.zeros((21, 3)), use, azimuth_deg=azimuth)
    ground = one.targets.intermediate.cartesian_from_intermediate(xyz + deformation)
    found = fit(problem(xyz, ground, use, azimuth_deg=azimuth), PolynomialSettings("2"))
    assert np.allclose(found(xyz), xyz + deformation, rtol=0, atol=1e-6)


def strip_result(flown: Flown, degree: str) -> Result:
    control = control_points({name: flown.xyz[flown.at[name]] for name in flown.bands(0, 4, 8)})
    return triangulate(project(flown, control), RunSettings("polynomial", polynomial=PolynomialSettings(degree)))


def test_a_degree_that_control_does_not_carry_is_said() -> None:
    flown = fly(3, 9, sigma=5 * MICROMETRE, extra=10)
    reduced = strip_result(flown, "3")
    assert reduced.strips[0].polynomial is not None
    assert reduced.strips[0].polynomial.degree == 2
    (note,) = [n for n in reduced.notes if n.code == "degree-reduced"]
    assert "degree 3 was asked for" in note.message
    assert "9 points at 3 stations in plan and 3 in height, supports degree 2" in note.message
    assert "degree-reduced" not in [note.code for note in strip_result(flown, "2").notes]


@pytest.mark.parametrize("degree", ["auto", "1", "2", "3"])
@pytest.mark.parametrize(("few", "many"), [("xyz", "z"), ("xyz", "xy")], ids=["few plan points", "few heights"])
def test_control_of_one_kind_leaves_the_other_axes_to_themselves(degree: str, few: str, many: str) -> None:
    xyz = layout(SEVEN)
    use = [few if n in {0, 2, 18} else many for n in range(21)]  # three full points at two stations
    found = fit(problem(xyz, xyz + bent(xyz, 3.0, 2), use), PolynomialSettings(degree))
    axes = (2,) if many == "z" else (0, 1)
    for number, axis in nonempty(enumerate(found.axes)):
        assert len(axis.terms) <= (6 if number in axes else 3)
        assert axis.redundancy >= 0
    if degree in {"2", "auto"}:
        anywhere = np.random.default_rng(1).uniform([-9000, -1400, 0], [9000, 1400, 200], (20, 3))
        error = found(anywhere) - anywhere - bent(anywhere, 3.0, 2)
        assert np.abs(error[:, axes]).max() < 1e-6
