"""How precise points and photos of a run are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.pipeline.precision import photo_precision, strip_precision

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.pipeline.results import Adjusted, Precision, StripResult
    from photostrip.pipeline.strips.absolute import OrientedStrip
    from photostrip.points import ControlPoints, PhotoPoints


def precision_of(
    strips: Sequence[StripResult],
    oriented: Sequence[OrientedStrip[Any]],
    observations: PhotoPoints,
    given: ControlPoints,
    points: Adjusted,
) -> Precision:
    """Covariances of all points and photos, and the test of the check points of each strip.

    oriented: the same strips before their deformation was corrected.
    observations: ideal image coordinates of the project.
    given: all given points, check points too.
    """
    each = [_of_strip(*pair, observations, given) for pair in zip(strips, oriented, strict=True)]
    return strip_precision.joined(each, strips, points)


def _of_strip(
    strip: StripResult, oriented: OrientedStrip[Any], observations: PhotoPoints, given: ControlPoints
) -> strip_precision.StripPrecision:
    if strip.photo_stages is not None:
        return photo_precision.of_photos(strip, oriented, observations, given)
    from photostrip.pipeline.precision import model_precision  # strips of photos need none of it

    return model_precision.of_models(strip, oriented, observations, given)
