"""What two results may differ by: for each kind of quantity so much, or so much of the quantity itself."""

from __future__ import annotations

from dataclasses import dataclass

# Kinds of quantities and the unit of their absolute tolerances. Statistics have two: metres, micrometres.
UNITS = {
    "plan": "m",
    "height": "m",
    "rotation": "deg",
    "sigma0": "um",
    "scale": "",
    "precision": "m",
    "statistics": "m",
    "counts": "",
}
SETS = ("ids", "choices", "rejected", "findings")


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of one kind of quantity; the larger of its two parts counts."""

    absolute: float = 0.0
    relative: float = 0.0  # difference allowed, as a share of the size in the baseline
    absolute_um: float = 0.0  # as `absolute`, for statistics in micrometres
    ignore: bool = False


@dataclass(frozen=True)
class SetTolerance:
    """How many elements of a set may be missing or new."""

    missing: int = 0
    new: int = 0
    ignore: bool = False


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of all kinds.

    The defaults let pass what another processor or another version of the numerical libraries changes, and hardly
    anything else: two units of the last digit that result.json shows.
    """

    # plan, height: ground points, perspective centres and differences at control, metres
    plan: Tolerance = Tolerance(absolute=0.0002)
    height: Tolerance = Tolerance(absolute=0.0002)
    # angle between two rotations, and elements of relative orientation, degrees
    rotation: Tolerance = Tolerance(absolute=2e-6)
    sigma0: Tolerance = Tolerance(absolute=0.02)  # standard deviation of an image coordinate of weight one, micrometres
    scale: Tolerance = Tolerance(relative=1e-8)  # scale factors of models, junctions and of the strip, ratios
    precision: Tolerance = Tolerance(absolute=0.0002, relative=0.001)
    statistics: Tolerance = Tolerance(absolute=0.0002, relative=0.001, absolute_um=0.11)
    counts: Tolerance = Tolerance()
    # ids, choices, rejected, findings: photos, points, models and given points; adjustment, degrees, terms, roles,
    # status and verdicts; measurements taken out; notes and points without coordinates
    ids: SetTolerance = SetTolerance()
    choices: SetTolerance = SetTolerance()
    rejected: SetTolerance = SetTolerance()
    findings: SetTolerance = SetTolerance()

    def of(self, kind: str) -> Tolerance:
        found: Tolerance = getattr(self, kind)
        return found

    def allowed(self, kind: str, unit: str, before: float) -> float:
        """Return the largest difference that is allowed for a number.

        The absolute part of a tolerance holds for numbers in the unit of their kind only: a statistic without a unit
        has the relative part alone.
        """
        tolerance = self.of(kind)
        absolute = tolerance.absolute if unit == UNITS[kind] else tolerance.absolute_um if unit == "um" else 0.0
        return max(absolute, tolerance.relative * abs(before))
