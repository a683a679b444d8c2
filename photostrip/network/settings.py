"""What is asked of the bundle adjustment beside the adjustment itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

SCREENINGS = ("snooping", "robust", "none")
TESTS = ("tau", "baarda")


class CameraParameter(NamedTuple):
    """A calibration parameter of a camera."""

    asked: str  # what a user asks for; the principal point is asked for as one
    power: int  # of the distance from the principal point by which its correction of an image coordinate grows
    axis: str = ""

    @property
    def title(self) -> str:
        return f"{self.asked} {self.axis}".rstrip()

    @property
    def unit(self) -> str:
        return {0: "mm", 1: "1"}.get(self.power, f"mm^-{self.power - 1}")


CALIBRATION = {
    "c": CameraParameter("principal_distance", 0),
    "x0": CameraParameter("principal_point", 0, "x"),
    "y0": CameraParameter("principal_point", 0, "y"),
    "k1": CameraParameter("k1", 3),
    "k2": CameraParameter("k2", 5),
    "k3": CameraParameter("k3", 7),
    "p1": CameraParameter("p1", 2),
    "p2": CameraParameter("p2", 2),
    "b1": CameraParameter("affinity", 1),
    "b2": CameraParameter("shear", 1),
}
"""The calibration parameters of a camera, in the order of their columns: what ``corrections`` corrects by."""
ASKED = tuple(dict.fromkeys(each.asked for each in CALIBRATION.values()))


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
    # whether lens distortion, film, principal point and distance are estimated where the observations ask for them
    search_cameras: bool = True
    # a-priori standard deviations of these parameters about the given calibration, in their units; without one a
    # parameter is free
    calibration_sigma: dict[str, float] = field(default_factory=dict)
