"""Independent models in their network: start values, observations, and the result as the pipeline goes on with it.

A model's coordinates count from their mean: a plotter may have them start anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geometry.similarity import Similarity
from photostrip.network.adjustment import Selection
from photostrip.network.problem import BundleCameras, BundleProblem, ModelObservations, StartValues
from photostrip.pipeline.block.problem import control_begun, control_observations
from photostrip.pipeline.common_points import mean_points
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.inputs import MeasuredModels, Settings
from photostrip.pipeline.overruling import rows_of_models
from photostrip.pipeline.results import (
    BlockProblem,
    BlockStart,
    StripResult,
)
from photostrip.points import ControlPoints, ModelPoints, PhotoPoints, locate, located


def together(
    models: MeasuredModels, strips: tuple[StripResult, ...], strangers: Mapping[str, AbstractSet[int]], *, free: bool
) -> BlockStart:
    """Put the points and perspective centres of all strips together, and every model on its own of them."""
    measured, count = models.points, len(models.points.point_ids)
    nodes = np.full((count + len(measured.photo_ids), 3), np.nan)
    found = mean_points(strips, strangers)
    nodes[found.number] = found.xyz
    for strip in strips:
        places = count + locate(strip.strip.photos, measured.photo_ids)
        nodes[places] = strip.intermediate.cartesian_from_intermediate(strip.centers)
    names, unit = units_of(models)
    centred = _centred(measured)
    placed = []
    for number in range(len(names)):
        rows = np.flatnonzero((unit == number) & np.isfinite(nodes[measured.node, 0]))
        placed.append(Similarity.from_points(centred[rows], nodes[measured.node[rows]]))
    rotations, scales = np.array([each.rotation for each in placed]), np.array([each.scale for each in placed])
    centers = np.array([each.shift for each in placed])
    lost = np.isnan(nodes[:, 0])
    rows = np.flatnonzero(lost[measured.node] & (unit >= 0))  # of points that the strips have no place for
    own = unit[rows]
    moved = scales[own, None] * np.einsum("nij,nj->ni", rotations[own], centred[rows]) + centers[own]
    times = np.bincount(measured.node[rows], minlength=len(nodes))[:, None]
    sums = np.zeros_like(nodes)
    np.add.at(sums, measured.node[rows], moved)
    return BlockStart(
        strips=strips,
        photos=names,
        centers=centers,
        rotations=rotations,
        scales=scales,
        points=np.where(lost[:, None] & (times > 0), sums / np.maximum(times, 1), nodes),
        strangers=strangers,
        rough=np.zeros(len(names), bool),
        free=free,
    )


def units_of(models: MeasuredModels) -> tuple[tuple[str, ...], Numbers]:
    """Names of the models of all strips, and which of them each row of the model coordinates is of; -1: of none."""
    names = tuple(name for strip in models.strips for name in strip.models)
    return names, np.asarray(located(models.points.model_ids, names)[models.points.model], np.intp)


def _centred(measured: ModelPoints) -> Floats:
    """Model coordinates (n, 3) less their mean over the model, mm."""
    count = np.bincount(measured.model, minlength=len(measured.model_ids))
    sums = np.zeros((len(count), 3))
    np.add.at(sums, measured.model, measured.xyz)
    return np.asarray(measured.xyz - (sums / np.maximum(count, 1)[:, None])[measured.model], float)


def build(
    models: MeasuredModels,
    settings: Settings,
    observations: PhotoPoints,
    control: ControlPoints,
    ground: GroundFrames,
    start: BlockStart,
) -> BlockProblem:
    """Collect everything that is observed; at first without what the links between the models contradict."""
    measured = models.points
    origin: Floats = np.round(np.nanmean(start.points, axis=0, dtype=np.float64), -1)
    _, unit = units_of(models)
    rows = np.flatnonzero(~rows_of_models(settings.links.drop, measured) & (unit >= 0))
    given, control_rows = control_observations(control, ground.control, observations, start, origin)
    problem = BundleProblem(
        images=ModelObservations(
            photo=unit[rows],
            point=measured.node[rows],
            xy=_centred(measured)[rows],
            sigma=measured.sigma[rows],
            correlation=None if measured.correlation is None else measured.correlation[rows],
        ),
        cameras=BundleCameras(of_photo=np.zeros(0, np.intp), focal=np.zeros(0)),
        start=StartValues(
            centers=start.centers - origin,
            rotations=start.rotations,
            points=start.points - origin,
            scales=start.scales,
        ),
        control=given,
        photo_ids=start.photos,
        point_ids=tuple(map(measured.name, range(len(start.points)))),
    )
    agree = np.zeros(len(measured), bool)
    for strip in start.strips:
        formed = strip.of_models.formed
        agree[formed.models.row[formed.used]] = True
    level = tuple(ground.control[number].kind != "geocentric" for number in control.frame[control_rows].tolist())
    return BlockProblem(
        problem=problem,
        origin=origin,
        begin=replace(
            Selection.everything(problem),
            images=_begun(agree, rows, start, measured),
            control=control_begun(problem, control, control_rows, start),
        ),
        kept=rows_of_models(settings.links.keep, measured)[rows],
        rows=rows,
        control=control_rows,
        level={"control": level, "position": ()},
    )


def _begun(agree: Flags, rows: Numbers, start: BlockStart, measured: ModelPoints) -> Flags:
    """Rows that take part at first: what agrees within its strip, but for points that are others in another strip."""
    begun = agree[rows]
    for strip in start.strips:
        if strange := start.strangers.get(strip.strip.id):
            of_strip = np.isin(rows, strip.of_models.formed.models.row)
            begun &= ~(of_strip & np.isin(measured.node[rows], list(strange)))
    return begun
