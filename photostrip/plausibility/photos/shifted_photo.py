"""Photos whose image coordinates are all shifted: marks in another order, another principal point.

A shift looks much like a tilt and a move of the photo. What it leaves of residuals is small beside it, and the search
for gross errors takes out the points that show it most. A strip is therefore looked at where a photo has large
residuals, or has lost many of its points, or where given points do not agree with the strip; what tells then is an
adjustment in which the principal point of the photo is unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.notes import Finding, counted
from photostrip.plausibility.finding import found
from photostrip.points import PhotoPoints

if TYPE_CHECKING:
    from photostrip.network.gross_errors.shifted_photo import ShiftedPhoto

POOR_SQUARES = 2.0  # mean square of the residuals of a photo, in variances, from which it is looked at
LOST_SQUARES = 8.0  # what a rejected ray counts as: four standard deviations in one coordinate
FITTING_SIGMA0 = 1.3  # of a photo and its neighbours, over what is stated: more is left by what is no shift
LEAST_AGREEING = 0.5  # of the points of a photo, that agree with its neighbours once it is shifted
FIX = (
    "look at its fiducial marks (do their numbers go with the certificate, was the photo turned on the comparator?) "
    "and at the order and the signs of its principal point"
)


@dataclass(frozen=True, eq=False)
class AdjustedPhotos:
    """The photos of a strip as a run left them."""

    strip: str
    photos: tuple[str, ...]
    sigma: float  # standard deviation of an image coordinate, mm
    rms: Floats  # (n,): of the image residuals of each photo, mm
    rows: Numbers  # (m,): image points that took part
    doubted: bool  # whether given points do not agree with the strip


def find_shifted_photo(
    rows: Numbers,
    observations: PhotoPoints,
    adjusted: AdjustedPhotos,
    tried: Callable[[Numbers, int], ShiftedPhoto | None],
) -> Iterator[Finding]:
    """Find the photo of a strip whose image coordinates are all shifted (P109), at most one.

    rows: (p, 2): image points of the pairs.
    tried: adjusts with the principal point of a photo, or of one near it; takes the place in the strip of the photo of
        every image point, and that of the photo.
    """
    position = observations.places(adjusted.photos)
    misfit = _misfit(position, np.unique(rows), adjusted)
    if not (adjusted.doubted or misfit.max() > POOR_SQUARES):
        return
    shifted = tried(position, int(misfit.argmax()))
    if shifted is None or shifted.sigma0 > FITTING_SIGMA0 or shifted.agreeing < LEAST_AGREEING * shifted.measured:
        return
    name, (x, y) = adjusted.photos[shifted.photo], shifted.shift.tolist()
    message = (
        f"all image coordinates of photo {name} are shifted by {x:+.2f} mm in x and {y:+.2f} mm in y (standard "
        f"deviations {shifted.sigma[0]:.2g} and {shifted.sigma[1]:.2g} mm): once that is taken off, {shifted.agreeing} "
        f"of its {counted(shifted.measured, 'point')} agree with the neighbouring photos"
    )
    numbers = {"shift_x_mm": x, "shift_y_mm": y, "explained_variances": shifted.gain}
    yield found("P109", message, FIX, numbers, photos=(name,), strips=(adjusted.strip,))


def _misfit(position: Numbers, rows: Numbers, adjusted: AdjustedPhotos) -> Floats:
    """Mean square of the residuals of each photo, (n,), in variances, those of rejected rays as large as may be."""
    size = len(adjusted.photos)
    used = np.bincount(position[adjusted.rows], minlength=size)
    lost = np.bincount(position[rows[~np.isin(rows, adjusted.rows)]], minlength=size)
    squares = used * (adjusted.rms / adjusted.sigma) ** 2 + lost * LOST_SQUARES
    return np.asarray(np.nan_to_num(squares) / np.maximum(used + lost, 1), float)
