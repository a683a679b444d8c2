"""A formed strip on its control: intermediate frame, absolute orientation.

Source: [001] eq. 142-149.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import IntermediateFrame, mean_position, strip_azimuth
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import ModelStrip, Strip
from photostrip.points import ControlPoints
from photostrip.strip import absolute_orientation, fitted_strip
from photostrip.strip.fitted_strip import Misclosures
from photostrip.strip.gross_errors.control_search import ControlRay, StripAtControl
from photostrip.strip.strip_formation.strip import FormedStrip

if TYPE_CHECKING:
    from photostrip.strip.independent_models.formation import FormedModels


@dataclass(frozen=True, eq=False)
class OrientedStrip:
    """A strip, of photos or of independent models, with the similarity that lays it on its control."""

    strip: Strip | ModelStrip
    formed: FormedStrip | FormedModels
    frames: Sequence[GroundFrame]  # ground frames of the control lists
    control: ControlPoints  # control that the strip holds
    control_rows: Numbers  # (n,): its rows in the strip's points
    intermediate: IntermediateFrame
    absolute: absolute_orientation.AbsoluteOrientation
    precision: absolute_orientation.PointPrecision  # that gave the weights, metres
    settings: absolute_orientation.AbsoluteSettings

    @cached_property
    def targets(self) -> absolute_orientation.Targets:
        """The control in the intermediate frame."""
        return absolute_orientation.Targets(self.control, self.frames, self.intermediate)

    @property
    def xyz(self) -> Floats:
        """Points of the strip after the similarity, intermediate frame, metres, shape (q, 3); worked out anew."""
        return self.absolute.similarity(self.formed.xyz)

    @cached_property
    def at_control(self) -> Floats:
        """Those that are control, shape (n, 3)."""
        xyz: Floats = self.xyz[self.control_rows]
        return xyz

    @cached_property
    def weights(self) -> Floats:
        """Weights of the control coordinates, shape (n, 3)."""
        turned = self.targets.turned(self.at_control)
        return absolute_orientation.weights(turned, self.precision, self.settings.control_weights)

    @cached_property
    def extent(self) -> tuple[float, float]:
        """Mean base and half width of the strip, metres; without perspective centres the mean length of a model."""
        xyz, centers = self.xyz, self.absolute.similarity(self.formed.centers)
        bases = np.linalg.norm(np.diff(centers, axis=0), axis=1)
        spacing = np.nanmean(bases) if np.isfinite(bases).any() else np.ptp(xyz[:, 0]) / max(len(bases), 1)
        return float(spacing), max(np.quantile(np.abs(xyz[:, 1]), 0.95), 1e-6)

    @cached_property
    def misclosures(self) -> Misclosures:
        """Control coordinates that count."""
        turned = self.targets.turned(self.at_control)
        return fitted_strip.misclosures(turned, self.control_rows, self.absolute.axes)


def strip_at_control(
    oriented: OrientedStrip, rays: Sequence[ControlRay], covariance: Callable[[Numbers], Floats]
) -> StripAtControl:
    """Put together what wrong control is searched with.

    rays: rays of control points that stand on two photos; models have none.
    covariance: gives that of some misclosures (w,), strip and control together, metres^2, but for a similarity.
    """
    coordinates = oriented.misclosures
    moved = similarity_derivatives(oriented.at_control[coordinates.point], oriented.at_control.mean(axis=0))
    return StripAtControl(
        targets=oriented.targets,
        xyz=oriented.formed.xyz[oriented.control_rows],
        similarity=oriented.absolute.similarity,
        weight=oriented.weights,
        rays=rays,
        coordinates=coordinates,
        design=np.einsum("wi,wij->wj", coordinates.direction, moved),
        covariance=covariance,
        share=1.0,
    )


def control_of(
    formed: FormedStrip | FormedModels, control: ControlPoints, point_ids: tuple[str, ...]
) -> tuple[ControlPoints, Numbers]:
    """Control points that have strip coordinates, and their rows there."""
    rows = rows_of_given(control.ids, formed.point, point_ids)
    inside = rows >= 0
    return control.take(inside), rows[inside]


def to_ground(
    strip: Strip | ModelStrip,
    formed: FormedStrip | FormedModels,
    point_precision: absolute_orientation.PointPrecision,
    control: ControlPoints,
    rows: Numbers,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedStrip:
    """Intermediate frame with X along the strip, and the similarity into it.

    A provisional similarity in the frame of azimuth 0 gives the direction of the strip and its scale, hence the
    weights; the final one is made in the frame turned along the strip.

    point_precision: of a point of one model, in the unit of the strip.
    control: control that the strip holds.
    rows: (n,), its rows in the points of the strip.
    Raises GeometryError when the control does not determine the similarity; the strip is named.
    """
    if not len(control):
        msg = f"strip {strip.id}: none of its points is a control point"
        raise GeometryError(msg, photos=strip.photos, code="no-control")
    try:
        provisional_frame = middle_frame(control, frames)
        provisional = absolute_orientation.lay(
            formed.xyz[rows],
            absolute_orientation.Targets(control, frames, provisional_frame),
            control.use.astype(float),
            formed.xyz,
        )
        ends = provisional.similarity(formed.ends)
        intermediate = provisional_frame.with_azimuth(strip_azimuth(ends[0], ends[1]))
        precision = point_precision.at(provisional.similarity.scale)
        targets = absolute_orientation.Targets(control, frames, intermediate)
        cartesian = provisional_frame.cartesian_from_intermediate(provisional.similarity(formed.xyz[rows]))
        turned = targets.turned(intermediate.intermediate_from_cartesian(cartesian))
        weight = absolute_orientation.weights(turned, precision, settings.control_weights)
        final = absolute_orientation.orient(formed.xyz[rows], targets, weight, formed.xyz)
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, points=error.points, code=error.code) from error
    return OrientedStrip(
        strip=strip,
        formed=formed,
        frames=frames,
        control=control,
        control_rows=rows,
        intermediate=intermediate,
        absolute=final,
        precision=precision,
        settings=settings,
    )


def middle_frame(control: ControlPoints, frames: Sequence[GroundFrame]) -> IntermediateFrame:
    """Return the frame at the control's centre of gravity, X to the north.

    control: control; points without plan position do not count, a missing height is taken from the others.
    Raises GeometryError when no point gives a plan position.
    """
    known = ~np.isnan(control.enu[:, :2]).any(axis=1) & control.use[:, 0]
    chosen = control.take(known)
    heights = np.where(control.use[:, 2], control.enu[:, 2], np.nan)
    mean = float(np.nanmean(heights)) if np.isfinite(heights).any() else 0.0
    cartesian = np.empty((len(chosen), 3))
    for number, frame in enumerate(frames):
        rows = chosen.frame == number
        if rows.any():
            enu = chosen.enu[rows].copy()
            enu[~chosen.use[rows, 2], 2] = mean
            cartesian[rows] = frame.cartesian_from_ground(enu, ids=[chosen.ids[i] for i in np.flatnonzero(rows)])
    if not len(chosen):
        msg = "nothing that is given has a plan position"
        raise GeometryError(msg, points=control.ids, code="too-little-control")
    if frames[0].kind == "local":
        return IntermediateFrame.at_local_centre(cartesian, 0.0)
    lon, lat, height = frames[0].geodetic(cartesian).T
    lat0, lon0, _ = mean_position(lat, lon, height)
    return IntermediateFrame.at_centre(cartesian, lat0, lon0, 0.0)
