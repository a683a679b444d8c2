"""What the checks look at where models were measured: the strip of models, and where given points lie in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import MeasuredModels, ModelStrip, Settings
from photostrip.pipeline.strips.models import LinkedModels, link_strip
from photostrip.points import ControlPoints
from photostrip.strip.independent_models.formation import FormedModels

UP = np.array([0.0, 0.0, 1.0])  # of a strip of models with perspective centres


@dataclass(frozen=True, eq=False)
class ModelStripEvidence:
    """A strip of models with centres, and the given points in it."""

    strip: ModelStrip
    centers: Floats  # (f, 3): perspective centres of the photos that have one, in strip coordinates
    photos: tuple[str, ...]
    depth: Floats  # (f,): height of each above the points of its models
    rows: Numbers  # rows of the given points that the strip holds
    place: Floats  # place of each of them along the strip in bases, from 0 at the first photo
    breadth: float  # half breadth of the strip over its length


def form_strips(models: MeasuredModels, settings: Settings) -> Iterator[LinkedModels]:
    """Form the strips that can be formed, for evidence alone."""
    for strip in models.strips:
        try:
            yield link_strip(strip, models.points, settings)
        except (GeometryError, np.linalg.LinAlgError):
            continue


def model_strips(
    strips: Iterable[LinkedModels], point_ids: tuple[str, ...], control: ControlPoints
) -> Iterator[ModelStripEvidence]:
    """Collect what the gate looks at in strips that have two perspective centres."""
    for linked in strips:
        if np.isfinite(linked.formed.centers[:, 0]).sum() > 1:
            yield _evidence(linked.strip, linked.formed, control, point_ids)


def _evidence(
    strip: ModelStrip, formed: FormedModels, control: ControlPoints, point_ids: tuple[str, ...]
) -> ModelStripEvidence:
    known = np.flatnonzero(np.isfinite(formed.centers[:, 0]))
    centers, depth = formed.centers[known], _depths(formed)[known]
    places = rows_of_given(control.ids, formed.point, point_ids)
    rows = np.flatnonzero(places >= 0)
    xyz = formed.xyz[places[rows]]
    along = np.interp(xyz[:, 0], centers[:, 0], known.astype(float))
    length = max(float(np.ptp(centers[:, 0])), 1e-9)
    breadth = np.quantile(np.abs(formed.xyz[:, 1] - np.median(formed.xyz[:, 1])), 0.95) / length
    return ModelStripEvidence(
        strip=strip,
        centers=centers,
        photos=tuple(strip.photos[k] for k in known.tolist()),
        depth=depth,
        rows=rows,
        place=along,
        breadth=breadth,
    )


def _depths(formed: FormedModels) -> Floats:
    """Heights of the centres above the points of their models, strip coordinates; NaN without a centre."""
    models = formed.models
    point = (models.node < models.points) & formed.used
    count = np.bincount(models.model[point], minlength=models.count)
    ground = np.bincount(models.model[point], formed.model_xyz[point, 2], models.count) / np.maximum(count, 1)
    both = np.concatenate([ground[:1], (ground[1:] + ground[:-1]) / 2, ground[-1:]])
    return np.asarray(formed.centers[:, 2] - both)
