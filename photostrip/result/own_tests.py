"""The tests of the verdict: what each found, as a probability by chance, on one rank.

Five questions share one level equally (``TEST_LEVEL``), and the tests of a question share its part: a probability
here is that of the test times the number of tests of its question (Bonferroni), so that each is held against the same
level. The fifth question, whether a given point stands out beside the others, is put where the differences are made
(``points.standing_out``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from photostrip.notes import Document
from photostrip.statistics import chi2_p_value, f_p_value

PARTS = "plan", "height"
LEAST_STATED = 0.005  # micrometres, which the document rounds to nothing

SIGMA0, RESIDUALS, PAIRS = "sigma0", "image residuals", "pairs"
CHECKS, LEFT_OUT = "check points", "control left out in turn"
ALIKE, MODELS = "models deformed alike", "deformed models"


class Pair(NamedTuple):
    """What a pair's sigma0 says."""

    place: int  # its row in ``models``
    found: float  # sigma0, micrometres
    others: float  # that of the other pairs together, 0 where there is none
    # probabilities, of all pairs together, of so large a sigma0 beside the others, and with what is stated
    among: float
    beside_stated: float


def probabilities(document: Document) -> dict[str, float]:
    """Return the probability by chance of what each test found, those that could be made."""
    seen = {CHECKS: _checks(document), LEFT_OUT: document.get("cross_validation", {}).get("p")}
    made = {name: p for name, p in seen.items() if p is not None}
    common = [each["p"] for each in document.get("common_deformation", {}).values() if each["p"] is not None]
    single = [row["p"] for row in document.get("deformations", []) if row["p"] is not None]  # of all models
    found = {
        SIGMA0: [2 * _larger(sigma0_ratio(document), document["summary"]["redundancy"])],
        RESIDUALS: [2 * _larger(residuals_ratio(document), 2 * document["counts"]["image_points_used"])],
        PAIRS: [p for pair in pairs(document) for p in (pair.among, pair.beside_stated)],
        **{name: [p * len(made)] for name, p in made.items()},
        ALIKE: [p * len(common) * 2 for p in common],
        MODELS: [p * 2 for p in single],
    }
    return {name: min(1.0, *values) for name, values in found.items() if values}


def stated(document: Document) -> float:
    """Return the stated standard deviation of an image or model coordinate, micrometres."""
    return max(float(document["summary"]["sigma_given_um"]), LEAST_STATED)


def sigma0_ratio(document: Document) -> float:
    """Return sigma0 in units of what is stated, of the bundle, or of the pairs or links."""
    test = document.get("bundle", {}).get("sigma0_test")
    return float(test["sigma0"] if test else (document["summary"]["sigma0_um"] or 0.0) / stated(document))


def residuals_ratio(document: Document) -> float:
    """Return the image residuals under the final orientations, rms, in units of what is stated.

    They have fewer redundant coordinates than there are: chance makes them smaller than this.
    """
    return float((document["summary"]["image_rms_um"] or 0.0) / stated(document))


def _larger(ratio: float, redundancy: int) -> float:
    """Probability of a larger ratio of a standard deviation to the true one by chance."""
    return chi2_p_value(ratio**2 * redundancy, redundancy)


def pairs(document: Document) -> list[Pair]:
    """Return what every pair's sigma0 says, beside the other pairs and beside what is stated."""
    columns = (document["models"].values(key) for key in ("sigma0_um", "redundancy"))
    known = [(k, found, own) for k, (found, own) in enumerate(zip(*columns, strict=True)) if found is not None]
    squares, redundancy = sum(own * found**2 for _, found, own in known), sum(own for _, _, own in known)
    tests, given = 2 * len(known), stated(document)
    pairs = []
    for place, found, own in known:
        left = redundancy - own
        others = (max(squares - own * found**2, 0.0) / left) ** 0.5 if left else 0.0
        among = f_p_value((found / others) ** 2, own, left) if others and own else 1.0
        alone = chi2_p_value((found / given) ** 2 * own, own)
        pairs.append(
            Pair(
                place=place,
                found=found,
                others=others,
                among=min(1.0, among * tests),
                beside_stated=min(1.0, alone * tests),
            )
        )
    return pairs


def _checks(document: Document) -> float | None:
    """Return the probability of the check points: of all together, and of their rms in plan and in height."""
    check = document.get("precision", {}).get("check")
    if not check:
        return None
    chances: Sequence[float] = [
        p for p in (*(check[part]["p"] for part in PARTS), *(test["p"] for test in check["tests"])) if p is not None
    ]
    return min(1.0, min(chances) * len(chances)) if chances else None
