"""Independent models over a flat world: truth, and coordinates of plotters that stand anywhere and any way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from photostrip.pipeline.inputs import Inputs, MeasuredModels, ModelStrip
from photostrip.points import ControlPoints, ModelPoints, PhotoPoints
from tests.strips import LOCAL

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers


SIGMA = (0.010, 0.010, 0.015)  # mm
SCALE = 9000.0
BASE, HEIGHT, HALF_WIDTH = 900.0, 1500.0, 700.0  # m


@dataclass(frozen=True, eq=False)
class Truth:
    """A strip as it is: points and perspective centres in metres, rows of the models, from the ground to each in mm."""

    points: Floats  # (q, 3)
    centers: Floats  # (f, 3)
    model: Numbers  # (n,), with `node`: rows of the models
    node: Numbers
    scale: Floats  # (m,)
    rotation: Floats  # (m, 3, 3)
    shift: Floats  # (m, 3)

    @property
    def exact(self) -> Floats:
        """Model coordinates without errors, mm, shape (n, 3)."""
        ground = np.concatenate([self.points, self.centers])[self.node]
        turned = np.einsum("nij,nj->ni", self.rotation[self.model], ground)
        return np.asarray(self.scale[self.model, None] * turned + self.shift[self.model], float)

    def measured(self, noise: Floats | None = None, sigma: tuple[float, float, float] = SIGMA) -> ModelPoints:
        """Give the models as measured; `noise` in units of the standard deviations, shape (n, 3)."""
        xyz = self.exact if noise is None else self.exact + noise * sigma
        models = tuple(f"M{k + 1}" for k in range(len(self.scale)))
        points = tuple(f"P{k:03d}" for k in range(len(self.points)))
        photos = tuple(str(101 + k) for k in range(len(self.centers)))
        return ModelPoints(models, points, photos, self.model, self.node, xyz, np.tile(sigma, (len(xyz), 1)))


def truth(models: int = 6, across: int = 3, seed: int = 1, *, spread: float = 2.0, relief: float = 50.0) -> Truth:
    """Make a strip; `spread` is the size of the rotations of the plotter's axes, radians."""
    rng = np.random.default_rng(seed)
    places = np.arange(models + 1)
    aside, above = rng.normal(0, 20, (2, models + 1))
    centers = np.column_stack([BASE * places.astype(float), aside, HEIGHT + above])
    rows = [
        [BASE * k + rng.normal(0, 60), y + rng.normal(0, 40), rng.normal(0, relief)]
        for k in places
        for y in np.linspace(-HALF_WIDTH, HALF_WIDTH, across)
    ]
    owner = np.repeat(places, across)
    model, node = [], []
    for k in range(models):
        here = [*np.flatnonzero((owner == k) | (owner == k + 1)), len(rows) + k, len(rows) + k + 1]
        model += [k] * len(here)
        node += here
    return Truth(
        np.array(rows),
        centers,
        np.array(model, np.intp),
        np.array(node, np.intp),
        1000 / SCALE * np.exp(rng.normal(0, 0.2, models)),
        Rotation.from_rotvec(rng.normal(0, spread, (models, 3))).as_matrix(),
        rng.normal(0, 500, (models, 3)),
    )


def inputs(given: Truth, measured: ModelPoints, *, bands: int = 3, sigma: float = 0.02, noise: float = 0.0) -> Inputs:
    """Give a project: control in bands across the strip, all other points are check points."""
    photos = len(given.centers)
    across = len(given.points) // photos
    chosen = np.round(np.linspace(0, photos - 1, bands)).astype(int)
    check = ~np.isin(np.repeat(np.arange(photos), across), chosen)
    rng = np.random.default_rng(7)
    enu = given.points + rng.normal(0, noise, given.points.shape)
    nothing = np.zeros(0, np.intp)
    names = PhotoPoints((), measured.point_ids, nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2)))
    control = ControlPoints(
        measured.point_ids, enu, np.ones(enu.shape, bool), check, np.full(enu.shape, sigma), np.zeros(len(enu), np.intp)
    )
    strips = (ModelStrip("A", measured.photo_ids, measured.model_ids),)
    return Inputs("models", (), names, control, (LOCAL,), models=MeasuredModels(strips, measured))
