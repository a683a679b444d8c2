"""A formed strip on its control, however that is read: what it predicts of each coordinate, and how well.

The errors of a strip by those of its image coordinates are known, all of them together, so that a strip which bends as
they let it contradicts nothing. Under each reading the strip is laid on its control by a similarity, and what no other
control predicts is taken out, as a run with polynomials does (``control_search``). Points far away from all others
are predicted and take no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import PhotostripError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.similarity import Similarity
from photostrip.network.cofactors import coordinates_of, joint_cofactors
from photostrip.pipeline.given_points import cartesian_of, rows_of_given
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.plausibility import evidence
from photostrip.pipeline.strips import absolute, models
from photostrip.pipeline.strips.absolute import OrientedStrip, strip_at_control
from photostrip.pipeline.strips.models import LinkedModels
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.plausibility.given_points import far_away
from photostrip.points import ControlPoints
from photostrip.strip.control_screening import BENT, FoundErrors, first_search, kept_of, majority, search
from photostrip.strip.control_search import JointAdjustment, StripAtControl, adjust

MOST_POINTS = 60  # control points that are looked at together: of more some are drawn, evenly along the strip
AS_FORMED = Similarity(1.0, np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class OnControl:
    """A strip on the control that it shows, under one reading of it."""

    points: ControlPoints  # as they are read, those far away among the others
    place: StripAtControl  # all of them at the strip, which was laid on those that count
    counted: StripAtControl  # those that are not far away
    kept: Flags  # (n, 3): coordinates that the others predict
    found: FoundErrors  # what they do not predict, far points aside

    @cached_property
    def left(self) -> JointAdjustment:
        return self.found.left

    @property
    def variance(self) -> float:
        """Variance factor of what is left."""
        return self.left.squares / max(self.left.freedom, 1)

    @property
    def fits(self) -> bool:
        """Whether no more is wrong with the strip than some of its control, and never most of it."""
        most_stay = self.found.whole.allows(self.found.coordinates)
        return most_stay and self.left.freedom > 0 and self.variance <= BENT**2

    @cached_property
    def off(self) -> tuple[Floats, Floats]:
        """Given minus predicted by all others (n, 3), and standard deviations, metres; NaN where it took part."""
        place = self.place.coordinates
        gone = set(np.flatnonzero(~self.kept[place.point, place.axis]).tolist())
        off, sigma = np.full((2, len(self.points), 3), np.nan)
        if not gone:
            return off, sigma
        laid = self.place.laid_on(self.kept)
        whole = adjust(laid, laid.misclosures(), self.place.joint_covariance)
        for point in whole.points:
            part = [column for column in point if column in gone]
            if part:
                others = whole.without([column for column in gone if column not in part])
                where = place.point[part], place.axis[part]
                off[where] = -others.estimate(part)
                cofactor = others.cofactor(part).diagonal() * max(self.variance, 1.0)
                sigma[where] = np.sqrt(np.maximum(cofactor, 0.0)) / others.size[part]
        return off, sigma


@dataclass(frozen=True, eq=False)
class HeldStrip:
    """A formed strip, and the control points that it shows."""

    stage: FormedPhotos | LinkedModels
    given: Numbers  # (n,): rows of these in the table of given points
    rows: Numbers  # (n,): their rows in the strip's points
    settings: Settings

    @classmethod
    def of(cls, stage: FormedPhotos | LinkedModels, control: ControlPoints, settings: Settings) -> HeldStrip:
        ids = stage.observations.point_ids if isinstance(stage, FormedPhotos) else stage.measured.point_ids
        rows = rows_of_given(control.ids, stage.formed.point, ids)
        placed = np.asarray(np.isfinite(stage.formed.xyz).all(axis=1), bool)
        given = np.flatnonzero((rows >= 0) & placed[rows] & control.use.any(axis=1) & ~control.check)
        if len(given) > MOST_POINTS:
            xyz = stage.formed.xyz[rows[given]]
            along = np.argsort((xyz - xyz.mean(axis=0)) @ np.linalg.svd(xyz - xyz.mean(axis=0))[2][0], kind="stable")
            given = np.sort(given[along[np.linspace(0, len(given) - 1, MOST_POINTS).astype(np.intp)]])
        return cls(stage=stage, given=given, rows=rows[given], settings=settings)

    @cached_property
    def covariance(self) -> Floats:
        """Covariance (3 n, 3 n) of those points, in the unit of the strip, but for a similarity."""
        stage = self.stage
        if isinstance(stage, FormedPhotos):
            errors = stage.errors(AS_FORMED)
            points = errors.points(self.rows)
            return errors.joint_covariance(points, errors.frames(points)[0]) * stage.excess
        joint = joint_cofactors(stage.network, coordinates_of(stage.network, stage.formed.point[self.rows]))
        return joint * stage.formed.links.factor

    def at_distance(self, factor: float) -> HeldStrip | None:
        """Return the strip formed with so many times its principal distance; None of models, or where it cannot be."""
        if not isinstance(self.stage, FormedPhotos):
            return None
        stage = evidence.formed_at_distance(self.stage, factor, self.settings)
        if stage is None or not np.isin(self.stage.formed.point[self.rows], stage.formed.point).all():
            return None
        rows = np.searchsorted(stage.formed.point, self.stage.formed.point[self.rows])
        return HeldStrip(stage=stage, given=self.given, rows=rows, settings=self.settings)

    def read(
        self,
        control: ControlPoints,
        frames: Sequence[GroundFrame],
        aside: Flags | None = None,
        *,
        as_given: bool = False,
    ) -> OnControl | None:
        """Lay the strip on its control as it is read; None where that does not hold it, or no frame has such places.

        aside: (c, 3), coordinates of the table of given points that take no part.
        as_given: search as a run does, which finds much that is wrong, too.
        """
        points = control.take(self.given)
        moved = np.where(points.use, far_away(np.where(points.use, points.enu, np.nan), points.frame), 0.0)
        points = replace(points, enu=points.enu - moved)
        counts = points.use & (moved == 0.0).all(axis=1)[:, None]
        counts &= True if aside is None else ~aside[self.given]
        some = np.flatnonzero(counts.any(axis=1))
        counted = replace(points, use=counts).take(some)
        try:
            stage, oriented = self._oriented(self._majority(counted, some, frames) if as_given else counted, frames)
            everything = np.arange(len(points))
            at_all, at_counted = self._at(stage, oriented, points, everything), self._at(stage, oriented, counted, some)
            found = search(at_counted) if as_given else first_search(at_counted)
            if found is None:
                return None
            kept = np.zeros_like(counts)
            kept[some] = kept_of(at_counted, found)
        except (PhotostripError, np.linalg.LinAlgError):
            return None
        return OnControl(points=points, place=at_all, counted=at_counted, kept=kept, found=found)

    def lies_on(self, control: ControlPoints, frames: Sequence[GroundFrame]) -> bool:
        """Whether the strip can be laid on its control at all, as that is read."""
        try:
            self._oriented(control.take(self.given), frames)
        except (PhotostripError, np.linalg.LinAlgError):
            return False
        return True

    def _majority(self, control: ControlPoints, some: Numbers, frames: Sequence[GroundFrame]) -> ControlPoints:
        """Control without the full points that go least with most of the others, to lay the strip on at first."""
        full = np.flatnonzero(control.use.all(axis=1))
        xyz = self.stage.formed.xyz[self.rows[some[full]]]
        kept = np.ones(len(control), bool)
        kept[full] = majority(xyz, cartesian_of(control.take(full), frames))
        return control.take(kept)

    def _oriented(
        self, control: ControlPoints, frames: Sequence[GroundFrame]
    ) -> tuple[FormedPhotos | LinkedModels, OrientedStrip]:
        if isinstance(self.stage, FormedPhotos):
            photos = absolute.orient_on_control(self.stage, control, frames, self.settings.absolute)
            return photos.stage, photos.oriented
        linked = models.orient_on_control(self.stage, control, frames, self.settings.absolute)
        return linked.linked, linked.oriented

    def _at(
        self, stage: FormedPhotos | LinkedModels, oriented: OrientedStrip, points: ControlPoints, some: Numbers
    ) -> StripAtControl:
        """Compare the strip with some of these points."""
        at = replace(oriented, control=points, control_rows=self.rows[some])
        at = replace(at, absolute=replace(oriented.absolute, axes=at.targets.axes(at.at_control)))
        found, similarity = at.misclosures, oriented.absolute.similarity
        turned = found.direction @ similarity.rotation * similarity.scale
        if isinstance(stage, LinkedModels) and stage.over:
            turned = turned * models.OVER
        place = some[found.point]
        block = self.covariance.reshape(len(self.rows), 3, len(self.rows), 3)[place][:, :, place]
        joint = np.einsum("wi,wivj,vj->wv", turned, block, turned) + np.diag(found.variance)
        return strip_at_control(at, (), lambda wanted: joint[np.ix_(wanted, wanted)])
