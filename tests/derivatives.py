"""Derivatives of a whole run by differences, and the errors of its strips."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.photos_on_control import OrientedPhotos, OrientedStrip
from photostrip.pipeline.precision import fitted
from photostrip.pipeline.run import triangulate
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Image, Points, Spec
from photostrip.strip.relative_orientation import RelativeSettings
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import Result
    from photostrip.strip.fitted_strip import FittedStrip
    from photostrip.strip.strip_errors import StripErrors

    Floats = NDArray[np.float64]

UNSCREENED = RelativeSettings(screening="none")
SIGMA = 0.005  # mm


def spec(photos: int, lap: float = 62.0, *, rows: int = 4, use: dict[str, float] | None = None, bands: int = 4) -> Spec:
    """Give a small strip over a flat world with hills."""
    return Spec(
        flight=Flight(photos=photos, end_lap_percent=lap, heading_deg=70.0),
        points=Points(rows=rows, extra_per_model=2),
        control=Control(per_band=3, bands=bands, check=4, sigma=(0.05, 0.06, 0.08), use=use or {"xyz": 1.0}),
        image=Image(SIGMA * 1000),
    )


def without_noise(wanted: Spec) -> Inputs:
    """Give the inputs of a strip with true coordinates, and the standard deviations it would have."""
    control = replace(wanted.control, noise=(0.0, 0.0, 0.0))
    inputs = inputs_of(simulate(replace(wanted, image=Image(0.0), control=control)))
    sigma = np.full((len(inputs.observations), 2), wanted.image.sigma_um / 1000)
    return replace(inputs, observations=replace(inputs.observations, sigma=sigma))


def fitted_strip(result: Result, factor: float = 1.0) -> FittedStrip:
    """Errors of the strip of a result after its fit to the control."""
    return fitted(result.strips[0], oriented_of(result), factor)


def oriented_of(result: Result, number: int = 0) -> OrientedPhotos:
    """Return a strip of a result as it lay on its control before its deformation was corrected."""
    strip = result.strips[number]
    photos = strip.of_photos
    stage = FormedPhotos(
        strip=photos.strip,
        observations=result.refined.observations,
        sigma=photos.sigma,
        screened=photos.screened,
        formed=photos.formed,
        wrong_rays=photos.wrong_rays,
    )
    oriented = OrientedStrip(
        strip=photos.strip,
        formed=photos.formed,
        frames=result.frames,
        control=strip.control,
        control_rows=strip.control_rows,
        intermediate=strip.intermediate,
        absolute=strip.absolute,
        precision=strip.precision,
        settings=result.settings.absolute,
    )
    return OrientedPhotos(stage, oriented)


def written_out(errors: StripErrors, rows: csr_array) -> Floats:
    """Derivatives of sparse rows by all errors: each frame is the sum of the steps before it."""
    components = errors.components.toarray().reshape(errors.models, 6, -1)
    steps, elements = errors.steps @ components, components[:, :5]
    frames = np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])
    count = steps.shape[2]
    return np.asarray(rows @ np.concatenate([frames.reshape(-1, count), elements.reshape(-1, count), np.eye(count)]))


@dataclass(frozen=True, eq=False)
class Placed:
    """Points and photos of a result in the axes of one intermediate frame."""

    points: Floats
    centers: Floats
    rotations: Floats

    @classmethod
    def of(cls, result: Result, frame: IntermediateFrame) -> Placed:
        """Bring a result into a frame."""
        strip = result.strips[0]
        there = strip.intermediate
        centers = there.cartesian_from_intermediate(strip.of_photos.resection.centers)
        return cls(
            frame.intermediate_from_cartesian(strip.cartesian),
            frame.intermediate_from_cartesian(centers),
            frame.intermediate_rotations(there.cartesian_rotations(strip.of_photos.resection.rotations)),
        )

    def minus(self, other: Placed) -> tuple[Floats, Floats]:
        """Differences of points (q, 3) and of photos (m, 6): centres and small rotations."""
        turn = self.rotations @ other.rotations.transpose(0, 2, 1)
        skew = (turn - turn.transpose(0, 2, 1)) / 2
        vector = np.column_stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])
        return self.points - other.points, np.column_stack([self.centers - other.centers, vector])


def differenced(result: Result, image: tuple[int, int], step: float) -> tuple[Floats, Floats]:
    """Central difference of the whole run by one image coordinate, per mm."""
    inputs, placed = result.inputs, []
    for sign in (1, -1):
        xy = inputs.observations.xy.copy()
        xy[image] += sign * step
        placed.append(_again(result, replace(inputs, observations=replace(inputs.observations, xy=xy))))
    points, photos = placed[0].minus(placed[1])
    return points / (2 * step), photos / (2 * step)


def differenced_by_control(result: Result, row: int, axis: int, step: float) -> Floats:
    """Central difference of the points of the whole run by one given coordinate."""
    inputs, placed = result.inputs, []
    for sign in (1, -1):
        enu = inputs.control.enu.copy()
        enu[row, axis] += sign * step
        placed.append(_again(result, replace(inputs, control=replace(inputs.control, enu=enu))))
    return placed[0].minus(placed[1])[0] / (2 * step)


def _again(result: Result, inputs: Inputs) -> Placed:
    """Run with other inputs, without what it says of its precision, in the frame of a run."""
    settings = replace(result.settings, precision=False)
    return Placed.of(triangulate(inputs, settings), result.strips[0].intermediate)
