"""How many gross errors the search in pairs finds, and what those that it misses do to the elements.

The published experiment [004a] with a layout of one's own: pairs of random tilts and relief are measured with noise,
single points of them get an error of their y parallax, and every method searches the same pairs. What one error does
by itself follows from the elements' derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geometry.rotation import from_angles
from photostrip.strip.pair_screening import ScreenedPairs, screen_pairs
from photostrip.strip.relative_orientation import (
    MINIMUM_POINTS,
    Pairs,
    RelativeSettings,
    linearised_parallaxes,
    orient_unchecked,
    unusable_pairs,
)

ZONES = 6
ARC_MINUTES = 60 * 180 / np.pi  # in a radian


@dataclass(frozen=True)
class PairLayout:
    """Pairs of photos with points in the six standard zones; lengths in mm of the photo."""

    focal: float = 100.0
    base: float = 65.0
    width: float = 65.0  # distance of the side zones from the flight line
    counts: tuple[int, ...] = (2, 2, 3, 3, 3, 3)  # points of the zones 1 to 6
    scatter: float = 6.0  # how far points lie from the middle of their zone, in x and in y, at most
    tilt: float = 2.0  # degrees: the angles of both photos lie between it and its negative
    relief: float = 0.1  # of the flying height, likewise
    parallax_sigma: float = 0.01  # standard deviation of a y parallax

    @property
    def points(self) -> int:
        return sum(self.counts)

    @property
    def zone(self) -> Numbers:
        """Zone of each point of a pair, 1 to 6."""
        return np.repeat(np.arange(1, ZONES + 1), self.counts)


def standard_pairs(rng: np.random.Generator, models: int, layout: PairLayout) -> Pairs:
    """Draw pairs, measured with noise."""
    b, a, n = layout.base, layout.width, layout.points
    centers = np.array([[0, 0], [b, 0], [0, a], [b, a], [0, -a], [b, -a]])
    nadir = np.repeat(centers, layout.counts, axis=0) + rng.uniform(-layout.scatter, layout.scatter, (models, n, 2))
    depth = 1 + rng.uniform(-layout.relief, layout.relief, (models, n))
    ground = np.concatenate([nadir * depth[..., None], -layout.focal * depth[..., None]], axis=2)
    sides = []
    for base in (0.0, b):
        turn = from_angles(np.radians(rng.uniform(-layout.tilt, layout.tilt, (models, 3))), "omega-phi-kappa")
        ray = np.einsum("pni,pij->pnj", ground - np.array([base, 0.0, 0.0]), turn)
        sides.append((-layout.focal * ray[..., :2] / ray[..., 2:]).reshape(-1, 2))
    sides[0][:, 1] += rng.normal(0, layout.parallax_sigma, models * n)
    rows = np.arange(models * n)
    return Pairs(
        starts=np.arange(models) * n,
        pair=np.repeat(np.arange(models), n),
        left=sides[0],
        right=sides[1],
        weight=np.ones(models * n),
        focal=layout.focal,
        point=rows,
        rows=np.column_stack([rows, rows]),
    )


def spoiled(pairs: Pairs, errors: Floats) -> Pairs:
    left = pairs.left.copy()
    left[:, 1] += errors
    return replace(pairs, left=left)


def screened(pairs: Pairs, settings: RelativeSettings, of_strip: int, parallax_sigma: float) -> list[ScreenedPairs]:
    """Orient and search pairs, so many of them as one strip."""
    strips = [np.arange(of_strip) + of_strip * number for number in range(pairs.size // of_strip)]
    oriented, converged = orient_unchecked(pairs)
    sigma = parallax_sigma / float(np.sqrt(2.0))
    return [screen_pairs(oriented.take(rows), settings, sigma, converged[rows]) for rows in strips]


def rejected(results: Sequence[ScreenedPairs]) -> Flags:
    """Points that strips have lost, shape (strips, points)."""
    return np.array([~result.orientation.used for result in results])


@dataclass(frozen=True)
class ScreeningSpec:
    """An experiment; the defaults are the published one."""

    layout: PairLayout = PairLayout()
    models: int = 34
    second: int = 10  # models with a second error
    sizes: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5)  # of the errors, mm, each as often as any other
    methods: tuple[str, ...] = ("parallax+grubbs", "tau", "robust", "deletion", "auto")
    grubbs_alpha: float = 0.05
    parallax_limit: float = 0.2  # mm, of ``parallax+grubbs``
    repetitions: int = 20
    seed: int = 1

    def settings(self, method: str) -> RelativeSettings:
        limit = self.parallax_limit if method == "parallax+grubbs" else None
        return RelativeSettings(screening=method, grubbs_alpha=self.grubbs_alpha, parallax_limit=limit)


class FoundRates(NamedTuple):
    """Errors of one zone and size, and how many of them were found."""

    zone: int
    size: float  # mm
    errors: int
    found: int
    by_parallax: int  # of them by the residual parallax alone


class MethodOutcome(NamedTuple):
    """What a method made of the pairs."""

    method: str
    # shares of the errors, 0 to 1: found by the residual parallax alone, by later tests, not found
    parallax: float
    later: float
    missed: float
    # good points lost for each error: beside wrong ones that were found, and instead of one that stays in its pair
    beside: float
    instead: float
    detection: tuple[FoundRates, ...]
    # change of the elements in pairs that kept an error, against the same pairs without errors: the largest of the
    # five, radians; mean over those pairs, and the worst; NaN where no error was missed
    mean_change: float
    worst_change: float


class ErrorEffect(NamedTuple):
    """What one error of a zone does to the elements when it is not found, radians for each mm; root mean squares."""

    zone: int
    elements: tuple[float, ...]  # alpha1, kappa1, alpha2, omega2, kappa2
    largest: float  # of the five, in one pair


class ScreeningOutcome(NamedTuple):
    spec: ScreeningSpec
    methods: tuple[MethodOutcome, ...]
    effects: tuple[ErrorEffect, ...]


def experiment_errors(rng: np.random.Generator, spec: ScreeningSpec) -> Floats:
    """Draw the errors of one repetition after the other: one in each model, a second one in some."""
    errors = np.zeros((spec.repetitions * spec.models, spec.layout.points))
    for repetition in range(spec.repetitions):
        twice = set(rng.permutation(spec.models)[: spec.second].tolist())
        for model in range(spec.models):
            rows = rng.permutation(spec.layout.points)[: 1 + (model in twice)]
            sizes = rng.choice(spec.sizes, len(rows)) * rng.choice([-1, 1], len(rows))
            errors[repetition * spec.models + model, rows] = sizes
    return errors.ravel()


def screening_experiment(spec: ScreeningSpec) -> ScreeningOutcome:
    """Repeat the experiment with every method, each repetition as one strip.

    Raises InputError when the zones hold too few points for an orientation and a check.
    """
    if spec.layout.points <= MINIMUM_POINTS:
        message = f"{spec.layout.points} points orient a pair and check nothing"
        raise InputError(Fault(message, "plan-screening", expected=f"{MINIMUM_POINTS + 1} points or more"))
    rng = np.random.default_rng(spec.seed)
    pairs = standard_pairs(rng, spec.repetitions * spec.models, spec.layout)
    errors = experiment_errors(rng, spec)
    given, (clean, converged) = spoiled(pairs, errors), orient_unchecked(pairs)
    if unusable_pairs(clean, converged).any():
        message = "points in these zones do not orient a pair"
        raise GeometryError(message, code="plan-screening")
    methods = []
    for name in spec.methods:
        results = screened(given, spec.settings(name), spec.models, spec.layout.parallax_sigma)
        methods.append(_outcome(name, results, errors, clean.elements, spec))
    return ScreeningOutcome(spec=spec, methods=tuple(methods), effects=error_effects(pairs, spec.layout))


def _outcome(
    name: str, results: Sequence[ScreenedPairs], errors: Floats, elements: Floats, spec: ScreeningSpec
) -> MethodOutcome:
    """Count what was found, by stage, zone and size, and what was lost; see what the rest does."""
    shape = len(results), len(errors) // len(results)
    wrong, out, first = errors.reshape(shape) != 0, rejected(results), np.zeros(shape, bool)
    for number, result in enumerate(results):
        first[number, [each.row for each in result.rejections if each.test == "parallax"]] = True
    zone = np.tile(spec.layout.zone, errors.size // spec.layout.points).reshape(shape)
    size = np.abs(errors).reshape(shape)
    missed, total = wrong & ~out, float(wrong.sum())
    detection = []
    for number in np.unique(spec.layout.zone).tolist():
        for each in sorted(set(spec.sizes)):
            those = (zone == number) & (size == each)
            found, early = int((those & out).sum()), int((those & out & first).sum())
            detection.append(FoundRates(number, each, int(those.sum()), found, early))
    turned = np.concatenate([result.orientation.elements for result in results]) - elements
    change = np.abs((turned + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
    kept = missed.reshape(-1, spec.layout.points).any(axis=1)  # pairs that keep an error
    change, lost = change[kept], (out & ~wrong).reshape(-1, spec.layout.points).sum(axis=1)
    return MethodOutcome(
        method=name,
        parallax=float((wrong & first & out).sum()) / total,
        later=float((wrong & out & ~first).sum()) / total,
        missed=float(missed.sum()) / total,
        beside=float(lost[~kept].sum()) / total,
        instead=float(lost[kept].sum()) / total,
        detection=tuple(detection),
        mean_change=float(change.mean()) if len(change) else np.nan,
        worst_change=float(change.max()) if len(change) else np.nan,
    )


def error_effects(pairs: Pairs, layout: PairLayout) -> tuple[ErrorEffect, ...]:
    """Change of the elements by an error of one point: de = -(J^T J)^-1 J^T dq, by zone."""
    oriented, _ = orient_unchecked(pairs)
    _, jacobian = linearised_parallaxes(oriented.elements, pairs)
    by_point = np.einsum("mij,jm->mi", oriented.cofactors[pairs.pair], jacobian)
    zone, found = np.tile(layout.zone, pairs.size), []
    for number in np.unique(layout.zone).tolist():
        those = by_point[zone == number]
        rms = np.sqrt((those**2).mean(axis=0)).tolist()
        largest = float(np.sqrt((np.abs(those).max(axis=1) ** 2).mean()))
        found.append(ErrorEffect(zone=number, elements=tuple(rms), largest=largest))
    return tuple(found)
