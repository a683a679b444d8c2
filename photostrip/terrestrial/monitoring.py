"""Displacements of all points in all epochs, with covariances, tests, and the turns of the cameras taken out.

The first epoch is the reference. A coordinate measured in epoch e is the sum of the truth, an error that all epochs
share (of the reference photos, when pseudo-parallaxes were measured against them) and an error of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.notes import Note
from photostrip.terrestrial.camera_motion import Motion, Turn
from photostrip.terrestrial.displacement import SPACE, limit, statistic
from photostrip.terrestrial.normal_case import StereoPair

MOVED_CAMERA = ("always", "auto", "never")
MEASURED, ABSENT, NO_REFERENCE, SMALL_PARALLAX, OUTSIDE = range(5)
REASONS = {
    ABSENT: "not measured",
    NO_REFERENCE: "not measured in the reference epoch",
    SMALL_PARALLAX: "x parallax too small or negative",
    OUTSIDE: "ray cannot be brought to the normal case",
}


@dataclass(frozen=True)
class MonitoringSettings:
    """How displacements are tested."""

    significance: float = 0.05  # probability of calling a point, or a camera, moved that did not move
    # ``"always"`` takes out the turn of a camera whenever the stable points determine it: the tests keep their level
    # whether the camera turned or not. ``"auto"`` takes it out when it is significant: a little more precise with few
    # stable points, but a turn just too small to be found makes up to twice as many points seem to move. ``"never"``
    # only reports it
    moved_camera: str = "always"


@dataclass(frozen=True, eq=False)
class Series:
    """Measurements of all epochs."""

    # points, epochs: ids; the first epoch is the reference
    points: tuple[str, ...]
    epochs: tuple[str, ...]
    # (e, n, 4): x, z of the left and x, z of the right photo in mm, reduced to the principal points. NaN where a point
    # was not measured; the last alone is NaN where z was not measured on the right photo
    coordinates: Floats
    of_epoch: Floats  # (e, n, 4): variances of the errors that an epoch has for itself, mm^2
    shared: Floats  # (n, 4): variances of the errors that all epochs share, mm^2
    stable: Flags  # (n,): points that are taken not to move
    times: Floats | None = None  # (e,), optional: times of the epochs in a unit of the user's choice, ascending


@dataclass(frozen=True, eq=False)
class CameraState:
    """What is known of one camera in one epoch."""

    epoch: int
    side: str  # ``"left"`` or ``"right"``
    turn: Turn | None  # the fitted turn; None where the stable points do not determine it
    moved: bool  # whether it is significant
    removed: bool  # whether it was taken out of the displacements


@dataclass(frozen=True, eq=False)
class Step:
    """Displacements between two epochs, or rates."""

    values: Floats  # (n, 3): on the ground: metres, or metres per unit of time; NaN where not determined
    covariance: Floats  # (n, 3, 3): its covariance; NaN where not determined

    @cached_property
    def statistic(self) -> Floats:
        """Test value, chi-square with three degrees of freedom where nothing moved, shape (n,)."""
        return statistic(self.values, self.covariance)

    @property
    def sigma(self) -> Floats:
        """Standard deviations, shape (n, 3)."""
        return np.asarray(np.sqrt(np.einsum("nii->ni", self.covariance)), float)


@dataclass(frozen=True, eq=False)
class Rates:
    """Uniform motion fitted to the epochs."""

    step: Step  # velocities, metres per unit of time
    # (n,): weighted sum of squares of what the uniform motion leaves; NaN where there are fewer than three epochs
    misfit: Floats
    dof: Numbers  # (n,): its degrees of freedom


@dataclass(frozen=True, eq=False)
class Monitoring:
    """Displacements of all points in all epochs."""

    series: Series
    pair: StereoPair
    settings: MonitoringSettings
    positions: tuple[Step, ...]  # coordinates on the ground in each epoch (``values``), with covariance
    # since_first, since_previous: displacements of each epoch after the first, on the ground
    since_first: tuple[Step, ...]
    since_previous: tuple[Step, ...]
    rates: Rates | None  # uniform motion, when the epochs have times
    reason: Numbers  # (e, n): why a point has no coordinates in an epoch: a key of ``REASONS``; 0 where it has
    # parallax, parallax_sigma: (e, n): vertical parallaxes in mm with their standard deviations; NaN where z was not
    # measured on the right photo
    parallax: Floats
    parallax_sigma: Floats
    # parallax_change, parallax_change_sigma: (e, n): their changes since the first epoch
    parallax_change: Floats
    parallax_change_sigma: Floats
    cameras: tuple[CameraState, ...]  # left and right camera of each epoch after the first
    # what the stable points say in each epoch after the first; None where there are none
    motions: tuple[Motion | None, ...]
    notes: tuple[Note, ...] = ()

    @property
    def limit(self) -> float:
        return limit(self.settings.significance, SPACE)

    def significant(self, step: Step) -> Flags:
        """Tell which displacements are larger than chance allows, shape (n,)."""
        return np.asarray(np.nan_to_num(step.statistic) > self.limit, bool)

    @property
    def rejected(self) -> list[tuple[int, str]]:
        """Epoch number and id of points that were given as stable and moved."""
        names = [name for name, yes in zip(self.series.points, self.series.stable, strict=True) if yes]
        return [
            (number, names[each.row])
            for number, motion in enumerate(self.motions, 1)
            if motion is not None
            for each in motion.rejected
        ]
