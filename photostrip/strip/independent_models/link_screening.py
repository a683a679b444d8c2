"""Gross errors in links: common points that contradict the others, and models of the other hand.

A point is tested as a whole, plan and height of both models together, by the squares that go when it is left out. One
point of a link goes at a time, the worst first. Where two points explain the same contradiction equally well, none goes
and both are named: with three points and a centre that happens.

Source: [Baarda 1968]; order and limits derived, see docs/independent-models.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.rejection import Rejection
from photostrip.statistics import chi2_quantile
from photostrip.strip.independent_models import linking
from photostrip.strip.independent_models.linking import CommonPoints, PointTests, SolvedLinks, StripModels
from photostrip.strip.independent_models.settings import LinkSettings

MEDIAN = 2.366  # of chi-square with three degrees of freedom
MEDIAN_SPREAD = 1.124  # standard deviation of the ratio of a sample's median to it, times the root of the sample's size
SURE_SIGMAS = 2.6  # standard deviations beyond which the stated precision is contradicted
EQUALLY_GOOD = 9.2  # difference of two test values below which the odds are less than one in a hundred
LEFT = 4  # common points, centre included, that a link keeps
REFLECTED = 0.1  # squares of the best similarity of the other hand over those of the best one
CONSPICUOUS = 36.0  # mean square in units of the stated variance that makes a reflection worth a look
DETECTED = 21.5  # non-centrality of chi-square with three degrees of freedom found in 80 % of cases at a level of 0.001


@dataclass(frozen=True, eq=False)
class ScreenedLinks:
    """Links with their gross errors taken out."""

    shared: CommonPoints
    used: Flags  # (t,): rows that took part
    solved: SolvedLinks
    # value, limit: (t,), (j,): test values of the rows used, and the critical value of each link
    value: Floats
    limit: Floats
    # rows of ``shared`` that were taken out, worst first; the size is the difference from what the other points of the
    # link say, mm along the axes of the model before
    rejections: tuple[Rejection, ...]
    doubtful: tuple[tuple[int, ...], ...]  # rows of which one is wrong and which one cannot be told
    # variance of the model coordinates over what is stated, with which the tests were made; 1 unless contradicted
    factor: float
    reflected: Flags = field(default_factory=lambda: np.zeros(0, bool))  # (j,): links whose models fit as mirror images


def reflected(shared: CommonPoints, models: StripModels, used: Flags) -> Flags:
    """Links whose models fit each other only as mirror images, shape (j,).

    The similarity of the other hand leaves a tenth of the squares, and the best proper one far too much. Three points,
    or points in one plane, fit both ways and are False.
    """
    share = used.astype(float)
    found, squares = linking.closed_form(shared, models, share)
    variance = (models.sigma[shared.before] ** 2).sum(axis=1)
    variance += found.scale[shared.link] ** 2 * (models.sigma[shared.after] ** 2).sum(axis=1)
    expected = shared.sums(share * variance)
    return np.asarray((squares[:, 0] > CONSPICUOUS * expected) & (squares[:, 1] < REFLECTED * squares[:, 0]), bool)


def screen_links(shared: CommonPoints, models: StripModels, settings: LinkSettings, kept: Flags) -> ScreenedLinks:
    """Solve the links of a strip and take out what contradicts the rest, but for the rows ``kept`` (t,).

    Every link has three common rows that are not on one line.
    """
    used, log = np.ones(len(shared.link), bool), list[Rejection]()
    mirrored = reflected(shared, models, used)
    limit = _limits(shared, used, settings.alpha)
    open_links = np.ones(shared.count, bool)
    while True:
        solved = linking.solve(shared, models, used)
        tests = linking.studentised(shared, solved, used)
        factor = _scatter(tests, solved)
        if settings.screening == "none":
            break
        worst = _worst(shared, models, used, used & ~kept, tests.value / factor, limit, open_links)
        if not len(worst):
            break
        for row in worst.tolist():
            link = int(shared.link[row])
            x, y, z = tests.error[row].tolist()
            size = float(tests.value[row] / factor)
            log.append(
                Rejection(kind="link", row=row, test="link", value=size, limit=float(limit[link]), size=(x, y, z))
            )
        used = used.copy()
        used[worst] = False
    value = tests.value / factor
    doubtful = _doubtful(shared, value, limit) if settings.screening != "none" else ()
    log.sort(key=lambda each: -each.value)
    return ScreenedLinks(
        shared=shared,
        used=used,
        solved=solved,
        value=value,
        limit=limit,
        rejections=tuple(log),
        doubtful=doubtful,
        factor=factor,
        reflected=mirrored,
    )


def _scatter(tests: PointTests, solved: SolvedLinks) -> float:
    """Variance factor by the median test value; 1 unless the stated precision is contradicted."""
    known = tests.value[tests.freedom == 3]  # every direction of the point is checked
    independent = solved.redundancy.sum() / 3
    if len(known) < LEFT or independent < LEFT:
        return 1.0
    ratio = np.median(known) / MEDIAN
    return ratio if ratio > 1 + SURE_SIGMAS * MEDIAN_SPREAD / np.sqrt(independent) else 1.0


def _limits(shared: CommonPoints, used: Flags, alpha: float) -> Floats:
    """Critical value of each link: the level is shared out among all common points of the strip."""
    return np.full(shared.count, chi2_quantile(1 - alpha / max(int(used.sum()), 1), 3))


def _worst(
    shared: CommonPoints,
    models: StripModels,
    used: Flags,
    free: Flags,
    value: Floats,
    limit: Floats,
    open_links: Flags,
) -> Numbers:
    """One of the ``free`` rows of each link that must go; links that cannot tell it, or would break, are closed."""
    size = np.where(free & open_links[shared.link] & (value > limit[shared.link]), value, -np.inf)
    rows = []
    for link in np.unique(shared.link[np.isfinite(size)]).tolist():
        rows_of_link = np.flatnonzero(shared.link == link)
        row = int(rows_of_link[np.argmax(size[rows_of_link])])
        alone = used.copy()
        alone[row] = False
        rivals = rows_of_link[used[rows_of_link] & (rows_of_link != row)]
        equal = (value[row] - value[rivals] < EQUALLY_GOOD).any()
        if equal or len(rivals) < LEFT - 1 or linking.extents(shared, models, alone)[link] < linking.THIN:
            open_links[link] = False
        else:
            rows.append(row)
    return np.array(rows, np.intp)


def _doubtful(shared: CommonPoints, value: Floats, limit: Floats) -> tuple[tuple[int, ...], ...]:
    """Rows of each link of which one is wrong, the worst first."""
    beyond = np.flatnonzero(value > limit[shared.link])
    found = []
    for link in np.unique(shared.link[beyond]).tolist():
        rows_of_link = np.flatnonzero(shared.link == link)
        rows_of_link = rows_of_link[np.argsort(-np.nan_to_num(value[rows_of_link], nan=-np.inf), kind="stable")]
        near = rows_of_link[value[rows_of_link[0]] - value[rows_of_link] < EQUALLY_GOOD]
        found.append(tuple(near.tolist()))
    return tuple(found)


def detectable(shared: CommonPoints, screened: ScreenedLinks) -> Floats:
    """Smallest error of each common point that its link finds in 80 % of cases, mm, shape (t,).

    In the direction in which the link checks the point least; infinite where it does not, NaN for rows not used.
    """
    solved = screened.solved
    weight, design = solved.weight, solved.design
    reduced = weight - weight @ design @ solved.cofactors[shared.link] @ design.transpose(0, 2, 1) @ weight
    least = np.linalg.eigvalsh((reduced + reduced.transpose(0, 2, 1)) / 2)[:, 0]
    checked = least > linking.HELD * np.trace(weight, axis1=1, axis2=2)
    size = np.where(checked, 1 / np.maximum(least, 1e-300), np.inf)
    return np.where(screened.used, np.sqrt(DETECTED * screened.factor * size), np.nan)
