"""A strip of independent models: its models linked, its perspective centres moved with the ground below them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers, median, quantile
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geometry.similarity import Similarity
from photostrip.pipeline.inputs import ModelStrip, Settings
from photostrip.pipeline.overruling import CENTER
from photostrip.pipeline.results import ModelStages, StripResult
from photostrip.pipeline.strips import notes
from photostrip.pipeline.strips.model_notes import link_notes
from photostrip.points import ModelPoints, locate, take_rows
from photostrip.rejection import Rejection
from photostrip.strip.independent_models import (
    link_screening,
    linking,
    model_errors,
    model_misclosures,
    perspective_centers,
)
from photostrip.strip.independent_models.formation import FormedModels, form_from_models, require_links
from photostrip.strip.independent_models.link_screening import ScreenedLinks
from photostrip.strip.independent_models.linking import StripModels
from photostrip.strip.independent_models.settings import LinkSettings
from photostrip.strip.polynomial.correction import Polynomial
from photostrip.units import MILLIMETRES

if TYPE_CHECKING:
    from photostrip.pipeline.strips.absolute import OrientedStrip, ScreenedStrip

    Oriented = OrientedStrip[model_errors.ModelErrors]
    WithControlScreened = ScreenedStrip[model_errors.ModelErrors]

LEAST_SOLID = 4  # points that can tell a body from its mirror image


@dataclass(frozen=True, eq=False)
class LinkedModels:
    """A strip of independent models before it meets its control, a ``StripStage``."""

    strip: ModelStrip
    measured: ModelPoints  # model coordinates of the whole project
    formed: FormedModels

    @property
    def point_ids(self) -> tuple[str, ...]:
        return self.measured.point_ids

    def point_precision(self, scale: float) -> tuple[float, float]:
        """A-priori standard deviation of a point of one model in plan and height, metres."""
        models, places = self.formed.models, self.formed.places
        turn = (scale * places.scale)[:, None, None] * places.rotation
        variance = np.einsum("nij,nj->ni", turn[models.model] ** 2, models.sigma**2) * self.formed.links.factor
        point = models.node < models.points
        plan, height = median(variance[point, :2].mean(axis=1)), median(variance[point, 2])
        return float(np.sqrt(plan)), float(np.sqrt(height))

    def extent(self, similarity: Similarity) -> tuple[float, float]:
        xyz = similarity(self.formed.xyz)
        base = np.linalg.norm(np.diff(similarity(self.formed.centers), axis=0), axis=1)
        length = np.ptp(xyz[:, 0]) / self.formed.models.count
        spacing = float(base[np.isfinite(base)].mean()) if np.isfinite(base).any() else float(length)
        return spacing, max(quantile(np.abs(xyz[:, 1]), 0.95), 1e-6)

    def differentiate(self, similarity: Similarity) -> model_errors.ModelErrors:
        return model_errors.differentiate_models(self.formed, similarity)

    def misclosure_covariance(self, oriented: Oriented) -> Callable[[Numbers], Floats]:
        rows, factor = oriented.control_rows, self.formed.links.factor
        return lambda some: model_misclosures.covariance(oriented.errors, oriented.misclosures.take(some), rows, factor)

    def control_rays(self, _: Oriented) -> tuple[()]:
        return ()

    def without_images(self, _: Mapping[str, Rejection]) -> LinkedModels:
        return self

    def screens_control(self, settings: Settings) -> bool:
        return settings.links.screening != "none"

    def turned_over(self, refusal: InputError) -> LinkedModels:
        """Return the strip upside down: without centres nothing has told which way is up."""
        upside_down = any(fault.code == "left-handed-control" for fault in refusal.faults)
        if not upside_down:
            raise refusal
        if self.formed.upright:
            raise _left_handed(self.strip) from refusal
        return replace(self, formed=self.formed.overturned())

    def refuse_other_hand(self, oriented: Oriented) -> None:
        """Refuse a strip that a mirror image of it would fit far better; flat ground does not tell."""
        control, spread = oriented.control, oriented.precision
        full = control.use.all(axis=1)
        if full.sum() < LEAST_SOLID:
            return
        xyz = self.formed.xyz[oriented.control_rows]
        targets = oriented.targets.of(xyz)[full]
        as_it_is, mirrored = linking.either_hand(xyz[full], targets)
        expected = ((control.sigma[full] ** 2).sum(axis=1) + 2 * spread[0] ** 2 + spread[1] ** 2).sum()
        conspicuous = as_it_is > link_screening.CONSPICUOUS * expected
        if conspicuous and mirrored < link_screening.REFLECTED * as_it_is:
            raise _left_handed(self.strip)

    def adjusted(self, screened: WithControlScreened, correction: Polynomial | None, _: Settings) -> StripResult:
        """Adjust the points, and move the perspective centres with them."""
        oriented, strip, formed = screened.oriented, self.strip, self.formed
        xyz = oriented.xyz if correction is None else correction(oriented.xyz)
        similarity = oriented.absolute.similarity
        centers = _centers(formed, similarity, correction)
        known = np.isfinite(centers).any()
        return StripResult(
            precision=oriented.precision,
            intermediate=oriented.intermediate,
            control=oriented.control,
            control_rows=oriented.control_rows,
            absolute=oriented.absolute,
            polynomial=correction,
            xyz=xyz,
            cartesian=oriented.intermediate.cartesian_from_intermediate(xyz),
            rays=formed.photo_count,
            depth=float(np.nanmean(centers[:, 2]) - xyz[:, 2].mean()) if known else float("nan"),
            notes=(
                *link_notes(strip, self.measured, formed),
                *notes.wrong_control_notes(strip, screened.screened_control),
                *notes.control_notes(strip, oriented.absolute),
                *notes.polynomial_notes(strip, correction, xyz),
            ),
            screened_control=screened.screened_control,
            model_stages=ModelStages(
                strip=strip,
                formed=formed,
                centers=centers,
                scales=similarity.scale * formed.places.scale * MILLIMETRES,
            ),
        )


def link_strip(strip: ModelStrip, measured: ModelPoints, settings: Settings) -> LinkedModels:
    return LinkedModels(strip, measured, form_models(strip, measured, settings))


def form_models(strip: ModelStrip, measured: ModelPoints, settings: Settings) -> FormedModels:
    """Link the models of a strip and form it, without any control.

    measured: model coordinates of the whole project.
    Raises GeometryError, InputError when a link cannot be determined, or models are mirror images of each other.
    """
    models = models_of(strip, measured, settings.links)
    shared = linking.common(models)
    try:
        require_links(shared, models, np.ones(len(shared.link), bool), strip.models)
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, code=error.code) from error
    kept = _named(settings.links.keep, strip, measured, models)
    links = link_screening.screen_links(shared, models, settings.links, kept[shared.before] | kept[shared.after])
    _refuse_reflected(strip, links)
    photos = locate(strip.photos, measured.photo_ids)
    return form_from_models(models, links, np.where(photos < 0, -1, photos + len(measured.point_ids)))


def models_of(strip: ModelStrip, measured: ModelPoints, settings: LinkSettings) -> StripModels:
    """Take the models of a strip out of those of the project, row by row in flight order, without what is dropped."""
    place = locate(measured.model_ids, strip.models)[measured.model]
    rows = np.flatnonzero(place >= 0)
    rows = rows[np.lexsort((measured.node[rows], place[rows]))]
    whole = linking.StripModels(
        count=len(strip.models),
        points=len(measured.point_ids),
        row=rows,
        model=place[rows],
        node=measured.node[rows],
        xyz=measured.xyz[rows],
        sigma=measured.sigma[rows],
    )
    left = ~_named(settings.drop, strip, measured, whole)
    return take_rows(whole, left, ("row", "model", "node", "xyz", "sigma"))


def _named(names: Sequence[str], strip: ModelStrip, measured: ModelPoints, models: StripModels) -> Flags:
    """Rows that the user names as ``model/point`` or ``model/photo``."""
    found = np.zeros(len(models.model), bool)
    wanted = set(names)
    if wanted:
        for row, (model, node) in enumerate(zip(models.model.tolist(), models.node.tolist(), strict=True)):
            found[row] = f"{strip.models[model]}/{measured.name(node).removeprefix(CENTER)}" in wanted
    return found


def _refuse_reflected(strip: ModelStrip, links: ScreenedLinks) -> None:
    """Refuse models that are mirror images of their neighbours; the smaller group is named."""
    if not links.reflected.any():
        return
    hand = np.concatenate([[0], np.cumsum(links.reflected)]) % 2
    minority = hand if 2 * hand.sum() <= len(hand) else 1 - hand
    names = [name for name, odd in zip(strip.models, minority.tolist(), strict=True) if odd]
    listed = (
        f"model {names[0]} is a mirror image" if len(names) == 1 else f"models {', '.join(names)} are mirror images"
    )
    fault = Fault(
        f"strip {strip.id}: {listed} of the others: x and y are exchanged, or one axis has the wrong sign",
        code="mirrored-model",
        key="models.file",
        expected="all models in axes of the same hand",
        fix="exchange x and y in the table, or change the sign of one column",
    )
    raise InputError(fault)


def _left_handed(strip: ModelStrip) -> InputError:
    """Say that models and control are of different hands."""
    return InputError(
        Fault(
            f"strip {strip.id} fits its control only as a mirror image: the model coordinates or the control are "
            "left-handed",
            code="left-handed-models",
            key="models.axes",
            expected="right-handed, or left-handed when the axes of the plotter are",
            fix="set `models.axes: left-handed`, or put the axes of the control in the order of its columns",
        )
    )


def _centers(formed: FormedModels, similarity: Similarity, correction: Polynomial | None) -> Floats:
    """Perspective centres, moved with the ground below them."""
    placed = similarity(formed.centers)
    known = np.isfinite(placed).all(axis=1)
    if correction is None or not known.any():
        return placed
    found, axes = placed[known], correction.axes
    above = perspective_centers.heights_above(found, similarity(formed.xyz))
    rows = perspective_centers.displacement_rows(found, above, [axis.terms for axis in axes])
    placed[known] = found + sum(row @ axis.coefficients for row, axis in zip(rows, axes, strict=True))
    return placed
