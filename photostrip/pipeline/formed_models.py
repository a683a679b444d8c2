"""A strip of independent models: its models linked, and adjusted by themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geometry.similarity import Similarity
from photostrip.network.adjustment import BundleSolution, solve
from photostrip.network.problem import BundleCameras, BundleProblem, ImageObservations, StartValues
from photostrip.network.reliability import joint_cofactors
from photostrip.pipeline.inputs import ModelStrip, Settings, rows_of_models
from photostrip.points import ModelPoints, locate, take_rows
from photostrip.strip import absolute_orientation, linked_models
from photostrip.strip.linked_models import (
    FormedModels,
    LinkSettings,
    ScreenedLinks,
    StripModels,
    form_from_models,
    require_links,
)

OVER = np.array([1.0, -1.0, -1.0])  # turns a strip by 180 degrees about its X axis


@dataclass(frozen=True, eq=False)
class LinkedModels:
    """A strip of independent models before it meets its control."""

    strip: ModelStrip
    measured: ModelPoints  # model coordinates of the whole project
    formed: FormedModels  # with points and models as all its links together place them
    network: BundleSolution  # of its models alone, in the system of the strip; points are those of the project
    over: bool = False  # whether the strip has been turned over since

    @property
    def point_ids(self) -> tuple[str, ...]:
        return self.measured.point_ids

    @property
    def point_precision(self) -> absolute_orientation.PointPrecision:
        """A-priori standard deviation of a point of one model, in the unit of the strip."""
        models, places = self.formed.models, self.formed.places
        turn = places.scale[:, None, None] * places.rotation
        variance = np.einsum("nij,nj->ni", turn[models.model] ** 2, models.sigma**2) * self.formed.links.factor
        point = models.node < models.points
        plan, height = np.median(variance[point, :2].mean(axis=1)), np.median(variance[point, 2])
        return absolute_orientation.PointPrecision(float(np.sqrt(plan)), float(np.sqrt(height)))

    def covariance(self, similarity: Similarity) -> Callable[[Numbers, Floats], Floats]:
        """Give the covariance of coordinates along directions (w, 3) of rows (w,) of its points, after a similarity."""
        turned = similarity.rotation * (OVER if self.over else 1.0)

        def of(row: Numbers, direction: Floats) -> Floats:
            columns = 3 * self.formed.point[row][:, None] + np.arange(3)
            places = np.repeat(np.arange(len(row)), 3), columns.ravel()
            across, shape = direction @ turned * similarity.scale, (len(row), 3 * len(self.network.points))
            functions = csr_array((across.ravel(), places), shape=shape)
            return joint_cofactors(self.network, functions) * self.formed.links.factor

        return of

    def overturned(self) -> LinkedModels:
        """Return the strip turned by 180 degrees about its X axis; its network stays as it was."""
        return replace(self, formed=self.formed.overturned(), over=not self.over)


def link_strip(strip: ModelStrip, measured: ModelPoints, settings: Settings) -> LinkedModels:
    """Link the models of a strip and adjust them by themselves, without any control."""
    formed = form_models(strip, measured, settings)
    models, places = formed.models, formed.places
    rows = np.flatnonzero(formed.used)
    of_project = models.row[rows]
    nodes = np.zeros((len(measured.point_ids) + len(measured.photo_ids), 3))
    nodes[formed.node] = formed.node_xyz
    network = solve(
        BundleProblem(
            images=ImageObservations(
                photo=models.model[rows],
                point=models.node[rows],
                xy=models.xyz[rows],
                sigma=models.sigma[rows],
                correlation=None if measured.correlation is None else measured.correlation[of_project],
            ),
            cameras=BundleCameras(),
            start=StartValues(centers=places.shift, rotations=places.rotation, points=nodes, scales=places.scale),
            photo_ids=strip.models,
            point_ids=tuple(map(measured.name, range(len(nodes)))),
        )
    )
    adjusted = linked_models.Similarities(network.scales, network.rotations, network.centers)
    formed = replace(
        formed,
        places=adjusted,
        model_xyz=adjusted.of(models.model, models.xyz),
        node_xyz=network.points[formed.node],
    )
    return LinkedModels(strip=strip, measured=measured, formed=formed, network=network)


def form_models(strip: ModelStrip, measured: ModelPoints, settings: Settings) -> FormedModels:
    """Link the models of a strip and form it, without any control.

    measured: model coordinates of the whole project.
    Raises GeometryError, InputError when a link cannot be determined, or models are mirror images of each other.
    """
    models = models_of(strip, measured, settings.links)
    shared = linked_models.common(models)
    try:
        require_links(shared, models, np.ones(len(shared.link), bool), strip.models)
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, code=error.code) from error
    kept = rows_of_models(settings.links.keep, measured)[models.row]
    links = linked_models.screen_links(shared, models, settings.links, kept[shared.before] | kept[shared.after])
    _refuse_reflected(strip, links)
    photos = locate(strip.photos, measured.photo_ids)
    return form_from_models(models, links, np.where(photos < 0, -1, photos + len(measured.point_ids)))


def models_of(strip: ModelStrip, measured: ModelPoints, settings: LinkSettings) -> StripModels:
    """Take the models of a strip out of those of the project, row by row in flight order, without what is dropped."""
    place = locate(measured.model_ids, strip.models)[measured.model]
    rows = np.flatnonzero(place >= 0)
    rows = rows[np.lexsort((measured.node[rows], place[rows]))]
    whole = linked_models.StripModels(
        count=len(strip.models),
        points=len(measured.point_ids),
        row=rows,
        model=place[rows],
        node=measured.node[rows],
        xyz=measured.xyz[rows],
        sigma=measured.sigma[rows],
    )
    left = ~rows_of_models(settings.drop, measured)[rows]
    return take_rows(whole, left, ("row", "model", "node", "xyz", "sigma"))


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
