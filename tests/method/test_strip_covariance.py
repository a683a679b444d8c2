"""The network is the strip with its misclosures distributed by its own covariance: docs/precision.md, equation 7."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import Similarity
from photostrip.pipeline.formed_photos import form_strip
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.points import locate
from photostrip.simulation import Control, Flight, Ground, Points, Spec, Terrain, simulate
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

STEP = 1e-5  # mm, of an image coordinate
PLAIN = Settings()
PLAIN = replace(
    PLAIN,
    adjustment="bundle",
    relative=replace(PLAIN.relative, screening="none"),
    bundle=replace(PLAIN.bundle, screening="none", test="baarda"),
)


def formed(inputs: Inputs, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Form the strip: its points (q, 3), and what must vanish in it, y parallaxes and differences between models."""
    strip = form_strip(inputs.strips[0], replace(inputs.observations, xy=xy), PLAIN)
    pairs = strip.orientation.pairs
    mean = strip.formed.xyz[np.searchsorted(strip.formed.point, inputs.observations.point[pairs.rows[:, 0]])]
    return strip.formed.xyz, strip.orientation.parallax, (strip.formed.model_xyz - mean).ravel()


def test_misclosures_distributed_by_the_covariance_of_the_strip_give_the_network() -> None:
    flight = Flight(photos=5, end_lap_percent=62.0)
    control = Control(bands=2, per_band=2, check=0)
    spec = Spec(
        flight=flight, ground=Ground("local"), terrain=Terrain(relief=80.0), points=Points(rows=3), control=control
    )
    inputs = inputs_of(simulate(spec))
    o, given = inputs.observations, inputs.control
    expected = triangulate(inputs, PLAIN)
    assert expected.precision is not None

    # the strip, its misclosures and the derivatives of both by the image coordinates, by central differences
    strip, parallax, differences = formed(inputs, o.xy)
    misclosures = np.concatenate([parallax, differences])
    points, closed = [], []
    for place in np.ndindex(*o.xy.shape):
        step = np.zeros_like(o.xy)
        step[place] = STEP
        ahead, behind = formed(inputs, o.xy + step), formed(inputs, o.xy - step)
        points.append((ahead[0] - behind[0]).ravel() / (2 * STEP))
        closed.append(np.concatenate([ahead[1] - behind[1], ahead[2] - behind[2]]) / (2 * STEP))
    rows = locate(given.ids, o.point_ids)
    to_ground = Similarity.from_points(strip[rows], given.enu)
    xyz = to_ground(strip)
    turned = to_ground.scale * to_ground.rotation
    by_points = np.einsum("ij,nqj->qin", turned, np.reshape(points, (len(points), -1, 3)))
    free = xyz - xyz.mean(axis=0)
    moves = np.concatenate(
        [np.broadcast_to(np.eye(3), (len(xyz), 3, 3)), -cross_matrix(free), free[:, :, None]], axis=2
    )

    # 0 = w - A p - H v - g: control with the similarity p that nothing gives, and what must vanish anyway
    of_control = by_points[rows].reshape(-1, len(points))
    h = np.concatenate([of_control, np.transpose(closed)])
    a = np.concatenate([moves[rows].reshape(-1, 7), np.zeros((len(misclosures), 7))])
    w = np.concatenate([(xyz[rows] - given.enu).ravel(), misclosures])
    noise = np.concatenate([given.sigma.ravel() ** 2, np.zeros(len(misclosures))])
    variance = o.sigma.ravel() ** 2
    kind = np.repeat(range(3), [len(of_control), len(parallax), len(misclosures) - len(parallax)])
    spread = (h**2 * variance).sum(axis=1) + noise
    scale = 1.0 / np.sqrt([spread[kind == each].max() for each in kind])  # their units differ
    # three times as many as are independent: of each redundant observation one
    inverse = np.linalg.pinv(
        ((h * variance) @ h.T + np.diag(noise)) * scale * scale[:, None], rcond=1e-5, hermitian=True
    )
    inverse *= scale * scale[:, None]
    normal = np.linalg.inv(a.T @ inverse @ a)
    similarity = normal @ a.T @ inverse @ w
    predicted = by_points * variance @ h.T @ inverse
    adjusted = xyz - moves @ similarity - predicted @ (w - a @ similarity)
    left = moves - predicted @ a
    by_images = by_points * variance
    covariance = (
        by_images @ by_points.transpose(0, 2, 1)
        - predicted @ h @ by_images.transpose(0, 2, 1)
        + left @ normal @ left.transpose(0, 2, 1)
    )

    sigma = np.sqrt(np.diagonal(expected.precision.points, axis1=1, axis2=2))
    assert (np.abs(adjusted - expected.points.cartesian) / sigma).max() < 0.03  # squares of the errors
    assert np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)) == pytest.approx(sigma, rel=2e-3)
