"""What the gate looks at where models were measured: the strip of models, and given points in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import MeasuredModels, ModelStrip, Settings
from photostrip.pipeline.strips.models import form_models
from photostrip.plausibility.control.straightening import StripPoints
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
    on_strip: StripPoints
    place: Floats  # place of each of them along the strip in bases, from 0 at the first photo
    breadth: float  # half breadth of the strip over its length


def form_strips(models: MeasuredModels, settings: Settings) -> Iterator[tuple[ModelStrip, FormedModels]]:
    """Form the strips that can be formed, for evidence alone."""
    for strip in models.strips:
        try:
            yield strip, form_models(strip, models.points, settings)
        except (GeometryError, np.linalg.LinAlgError):
            continue


def model_strips(
    strips: Iterable[tuple[ModelStrip, FormedModels]], point_ids: tuple[str, ...], control: ControlPoints
) -> Iterator[ModelStripEvidence]:
    """Collect what the gate looks at in strips that have two perspective centres."""
    for strip, formed in strips:
        if np.isfinite(formed.centers[:, 0]).sum() > 1:
            yield _evidence(strip, formed, control, point_ids)


def _evidence(
    strip: ModelStrip, formed: FormedModels, control: ControlPoints, point_ids: tuple[str, ...]
) -> ModelStripEvidence:
    known = np.flatnonzero(np.isfinite(formed.centers[:, 0]))
    centers, depth = formed.centers[known], _depths(formed)[known]
    places = rows_of_given(control.ids, formed.point, point_ids)
    rows = np.flatnonzero(places >= 0)
    xyz, middle = formed.xyz[places[rows]], np.median(depth)
    turn = formed.places.rotation[formed.models.model]
    variance = np.einsum("nij,nj->ni", turn**2, formed.models.sigma**2)
    variance *= (formed.places.scale[formed.models.model] ** 2 * formed.links.factor)[:, None]
    plan, height = np.sqrt(np.median(variance[:, :2])), np.sqrt(np.median(variance[:, 2]))
    floor = 2.0 * float(plan) / abs(middle), 2.0 * float(height) / abs(middle)
    axes = np.tile(UP, (len(centers), 1))
    on_strip = StripPoints(strip.id, xyz, axes=axes, centers=centers, floor=floor, depth=abs(middle))
    along = np.interp(xyz[:, 0], centers[:, 0], known.astype(float))
    length = max(float(np.ptp(centers[:, 0])), 1e-9)
    breadth = np.quantile(np.abs(formed.xyz[:, 1] - np.median(formed.xyz[:, 1])), 0.95) / length
    return ModelStripEvidence(
        strip=strip,
        centers=centers,
        photos=tuple(strip.photos[k] for k in known.tolist()),
        depth=depth,
        rows=rows,
        on_strip=on_strip,
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
