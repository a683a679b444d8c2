"""The iterations of a strip once more, step by step, for those who want to follow them.

A run keeps what it found, not the way there. The same functions start again from the same values and hand over each
step; that they end where the run ended is tested.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.similarity import Similarity
from photostrip.strip import absolute_orientation
from photostrip.strip.relative_orientation import Pairs, collect_pairs, iterate_elements, solve_elements, start_values

if TYPE_CHECKING:  # single steps need none of it
    from photostrip.pipeline.results import Result, StripResult

START_DIGITS = 1  # of radians: where a pair starts whose start values do not lead to its solution
SAME_ELEMENTS = 1e-6  # radians


SimilarityStep = tuple[Similarity, float, Floats]  # before the step; [w v v]; three shifts, three rotations, the scale


@dataclass(frozen=True, eq=False)
class PairRound:
    """The iteration of a pair with one choice of points: alpha1', kappa1', alpha2', omega2', kappa2', radians."""

    points: int
    squares: Floats  # (n,): [w q q], sum of weighted squares of the y parallaxes before each step, mm^2
    added: Floats  # (n, 5): what each step adds
    elements: Floats  # (n + 1, 5): before each step and in the end


def pair_rounds(result: Result, strip: StripResult) -> list[list[PairRound]]:
    """Repeat the relative orientation of every pair: with all its points, then without those that were rejected."""
    final = strip.of_photos.orientation
    given = _with_all_points(result, strip)
    rounds = [[first] for first in first_rounds(given, final.elements)]
    changed = np.unique(given.pair[given.weight != final.pairs.weight])
    ends = np.array([each[-1].elements[-1] for each in rounds])
    for number, second in zip(changed.tolist(), _round(ends[changed], final.pairs.take(changed)), strict=True):
        rounds[number].append(second)
    return rounds


def _with_all_points(result: Result, strip: StripResult) -> Pairs:
    """Return the pairs of a strip as they were before any point was rejected."""
    photos, focal = strip.strip.photos, strip.of_photos.strip.camera.principal_distance
    pairs = collect_pairs(result.refined.observations, photos, focal)
    kept = set(map(tuple, strip.of_photos.orientation.rows.tolist()))
    return pairs.without(np.array([tuple(row) not in kept for row in pairs.rows.tolist()], bool))


def first_rounds(pairs: Pairs, wanted: Floats) -> list[PairRound]:
    """Repeat the iteration of pairs from their start values, which are to lead to the wanted elements (p, 5).

    A pair that had to start from other azimuths starts from rounded elements.
    """
    start = start_values(pairs)
    solved = solve_elements(pairs).elements
    reached = iterate_elements(start, pairs).elements
    turned = np.abs(np.sin((reached - solved) / 2)).max(axis=1) > SAME_ELEMENTS
    start[turned] = np.round(np.where(np.isfinite(solved), solved, wanted)[turned], START_DIGITS)
    return _round(start, pairs)


def _round(start: Floats, pairs: Pairs) -> list[PairRound]:
    """Iterate all pairs and keep their steps."""
    steps: list[list[tuple[float, Floats, Floats]]] = [[] for _ in range(pairs.size)]

    def watch(todo: Numbers, elements: Floats, squares: Floats, step: Floats) -> None:
        for number, *each in zip(todo.tolist(), squares, step, elements, strict=True):
            steps[number].append(tuple(each))

    if not pairs.size:
        return []
    ends = iterate_elements(start, pairs, watch).elements
    rounds = []
    for count, taken, end in zip(pairs.sums((pairs.weight > 0).astype(float)), steps, ends, strict=True):
        squares, added, elements = map(np.array, zip(*taken, strict=True))
        rounds.append(PairRound(int(count), squares, added, np.vstack([elements, end])))
    return rounds


def similarity_steps(result: Result, strip: StripResult) -> list[SimilarityStep]:
    """Repeat the absolute orientation of a strip on the control that was used."""
    points = strip.formed.xyz[strip.control_rows]
    targets = absolute_orientation.Targets(strip.control, result.frames, strip.intermediate)
    turned = targets.turned(strip.absolute.similarity(points))
    weight = absolute_orientation.weights(turned, strip.precision, result.settings.absolute.control_weights)
    steps: list[SimilarityStep] = []

    def watch(similarity: Similarity, step: Floats) -> None:
        xyz = similarity(points)
        squares = float((weight * targets.misclosures(xyz, targets.axes(xyz)) ** 2).sum())
        steps.append((replace(similarity), squares, step.copy()))

    absolute_orientation.lay(points, targets, weight, strip.formed.xyz, watch)
    return steps
