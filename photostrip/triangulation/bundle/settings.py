"""What is asked of the bundle adjustment beside the adjustment itself."""

from __future__ import annotations

from dataclasses import field

from photostrip.frozen import dataclass

SCREENINGS = ("snooping", "robust", "none")
TESTS = ("tau", "baarda")
CALIBRATION = ("principal_distance", "principal_point", "k1", "k2", "k3", "p1", "p2", "affinity", "shear")


@dataclass(frozen=True)
class BundleSettings:
    # how gross errors are searched for: ``"snooping"`` (one after the other, by the largest test value), ``"robust"``
    # (re-weighted first, then tested) or ``"none"``
    screening: str = "snooping"
    # ``"tau"``: residuals are compared with the sigma0 found; ``"baarda"``: with the stated standard deviations
    test: str = "tau"
    # probability that anything is rejected in an adjustment without gross errors; of many rejections the part that is
    # false
    level: float = 0.01
    # probability that the test of one good observation rejects it; None: the level, shared out among all of them
    alpha: float | None = None
    power: float = 0.80  # probability with which an error of the size of the minimal detectable one is found
    variance_components: bool = False  # whether the standard deviations of the groups of observations are estimated
    self_calibration: tuple[str, ...] = ()  # parameters of every camera that are estimated, of ``CALIBRATION``
    # a-priori standard deviations of these parameters about the given calibration, in their units; without one a
    # parameter is free
    calibration_sigma: dict[str, float] = field(default_factory=dict)
