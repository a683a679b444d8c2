"""Independent models as a plotter gives them: each pair of photos in a system of its own.

A model holds the points that both its photos show, and their perspective centres. Its coordinates are true ones,
brought into the system of the instrument, with errors that do not depend on each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.rotation import from_vector
from photostrip.points import ModelPoints, PhotoPoints
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.spec import Models, Spec

TILT_SIGMA = np.radians(2.0)  # scatter of the axes of a level model
LOG_SCALE_SIGMA = 0.2  # scatter of the logarithm of the model scales
ORIGIN_SIGMA = 500.0  # mm from which the origin of a model is drawn
STATED_UM = 1.0  # stated of model coordinates without errors


@dataclass(frozen=True, eq=False)
class TruePlaces:
    """True places of points and photos, in the Cartesian frame."""

    photo_ids: tuple[str, ...]
    points: Floats  # (n, 3): points, in the order of the observations' points, metres
    centers: Floats  # (m, 3): perspective centres, metres
    rotations: Floats  # (m, 3, 3): image axes to the frame


def plotted(
    spec: Spec, strips: tuple[tuple[str, tuple[str, ...]], ...], observations: PhotoPoints, truth: TruePlaces
) -> ModelPoints | None:
    """Measure the models of all strips; None when none are asked for.

    Models ``M1``, ``M2`` and so on, in flight order, strip by strip; points in the order of the observations, which say
    which photo shows which point, then the two perspective centres. Random numbers (`Purpose.MODELS`): stream 0, for
    each model seven numbers, scale, rotation and origin; stream 1, for each row x, y, z.
    """
    if spec.models is None:
        return None
    wanted, place = spec.models, {name: k for k, name in enumerate(truth.photo_ids)}
    pairs = [(place[a], place[b]) for _, photos in strips for a, b in pairwise(photos)]
    systems = Draws(spec.seed, Purpose.MODELS).normal(len(pairs), 7)
    shows = [np.unique(observations.point[observations.photo == k]) for k in range(len(observations.photo_ids))]
    number = {name: k for k, name in enumerate(observations.photo_ids)}
    points = len(observations.point_ids)
    model, node, xyz = [], [], []
    for k, pair in enumerate(pairs):
        left, right = (shows[number[truth.photo_ids[photo]]] for photo in pair)
        common = np.intersect1d(left, right)
        rotation, scale = _system(wanted, spec.scale, truth, pair, systems[k])
        centers = truth.centers[list(pair)]
        ground = np.concatenate([truth.points[common], centers]) - centers.mean(axis=0)
        nodes = [*common.tolist(), *(points + photo for photo in pair)]
        model += [k] * len(nodes)
        node += nodes
        xyz.append(scale * ground @ rotation.T + ORIGIN_SIGMA * systems[k, 4:])
    rows = ModelPoints(
        model_ids=tuple(f"M{k + 1}" for k in range(len(pairs))),
        point_ids=observations.point_ids,
        photo_ids=truth.photo_ids,
        model=np.array(model, np.intp),
        node=np.array(node, np.intp),
        xyz=np.concatenate(xyz),
        sigma=np.zeros((len(node), 3)),
    )
    return _measured(spec, wanted, rows)


def _system(
    wanted: Models, photo_scale: float, truth: TruePlaces, pair: tuple[int, int], drawn: Floats
) -> tuple[Floats, float]:
    """Rotation from the ground to the axes of a model, and its scale in mm per metre."""
    scale = 1000.0 / (wanted.scale or photo_scale) * float(np.exp(LOG_SCALE_SIGMA * drawn[0]))
    if wanted.axes == "any":
        return from_vector(np.pi / 2 * drawn[1:4]), scale
    base = truth.centers[pair[1]] - truth.centers[pair[0]]
    up = truth.rotations[list(pair)][:, :, 2].sum(axis=0)
    x = base / np.linalg.norm(base)
    z = up - (up @ x) * x
    z = z / np.linalg.norm(z)
    level = np.array([x, np.cross(z, x), z])
    return from_vector(np.array([TILT_SIGMA * drawn[1], TILT_SIGMA * drawn[2], np.pi / 2 * drawn[3]])) @ level, scale


def _measured(spec: Spec, wanted: Models, rows: ModelPoints) -> ModelPoints:
    """Add the errors of measurement, the hand of the axes, and what is stated."""
    center = rows.node >= len(rows.point_ids)
    sigma = np.where(center[:, None], wanted.center_sigma_um, wanted.sigma_um) / 1000.0
    noise = Draws(spec.seed, Purpose.MODELS, 1).normal(len(rows), 3)
    hand = np.array([1.0, -1.0 if wanted.hand == "left-handed" else 1.0, 1.0])
    stated = np.where(sigma > 0, sigma, STATED_UM / 1000.0)
    keep = np.flatnonzero(~center) if not wanted.centers else np.arange(len(rows))
    return replace(
        rows,
        model=rows.model[keep],
        node=rows.node[keep],
        xyz=((rows.xyz + sigma * noise) * hand)[keep],
        sigma=stated[keep],
    )
