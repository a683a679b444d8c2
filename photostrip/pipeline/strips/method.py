"""All strips of a project: formed without any control, and corrected by polynomials for what the similarity leaves.

Source: [001] eq. 150-152.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

from photostrip.errors import GeometryError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.overruling import require_measured, require_named, require_weighted
from photostrip.pipeline.inputs import SIMILARITY, Inputs, Settings, Strip
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.strips import absolute, models
from photostrip.pipeline.strips.absolute import OrientedStrip, ScreenedPhotos
from photostrip.pipeline.strips.models import LinkedModels, link_strip
from photostrip.pipeline.strips.photos import FormedPhotos, form_strip
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.strip import polynomial


def form_strips(
    inputs: Inputs, observations: PhotoPoints, settings: Settings
) -> list[FormedPhotos] | list[LinkedModels]:
    """Form the strips of a project, of photos or of independent models, each by itself."""
    models = inputs.models
    if models is None:
        return form_photos(inputs, observations, settings)
    require_named(settings.links, models.points)
    return [link_strip(strip, models.points, settings) for strip in models.strips]


def form_photos(inputs: Inputs, observations: PhotoPoints, settings: Settings) -> list[FormedPhotos]:
    """Form the strips of photos; a single photo, which only a bundle adjustment can orient, forms nothing."""
    require_measured(settings.relative, observations)
    require_weighted(settings.formation, observations)
    whole = [strip for strip in inputs.strips if len(strip.photos) > 1]
    if len(whole) < len(inputs.strips) and not settings.together:
        alone = next(strip.photos for strip in inputs.strips if len(strip.photos) == 1)
        msg = f"photo {alone[0]} is no strip: only a bundle adjustment can orient it"
        raise GeometryError(msg, photos=alone, code="one-photo")
    return [form_strip(strip, observations, settings) for strip in whole]


def as_single_photos(inputs: Inputs, settings: Settings, refused: GeometryError) -> Inputs | None:
    """Cut the strip that a refusal is about into single photos, to start from given orientations or on others' points.

    A bundle that diverges names none: then all strips are cut.

    None where orientations are not given for all photos and no strip is left beside them, the bundle rejects nothing,
    or positions of a strip share an error.
    """
    positions, named = inputs.positions, set(refused.photos)
    known = set() if inputs.orientations is None else set(inputs.orientations.photos)
    several = [strip for strip in inputs.strips if len(strip.photos) > 1 and named <= set(strip.photos)]
    if not several or not (named or refused.code == "bundle-diverged"):
        return None
    left = any(len(strip.photos) > 1 and strip not in several for strip in inputs.strips)
    if not left and not all(known.issuperset(strip.photos) for strip in several):
        return None
    if not settings.together or "none" in {settings.bundle.screening, settings.relative.screening}:
        return None
    if positions is not None and positions.correction != "none" and positions.group == "strip":
        return None

    def cut(strip: Strip) -> list[Strip]:
        names = [f"{strip.id}/{photo}" if strip.listed else photo for photo in strip.photos]
        singles = [replace(strip, id=name, photos=(photo,)) for name, photo in zip(names, strip.photos, strict=True)]
        return singles if strip in several else [strip]

    return replace(inputs, strips=tuple(chain(*map(cut, inputs.strips))))


def adjust_photos(screened: ScreenedPhotos, settings: Settings) -> StripResult:
    """Correct the deformation of a strip and orient its photos on the corrected points."""
    return absolute.adjusted(screened, _correction(screened.photos.oriented, settings), settings)


def adjust_formed(
    stage: FormedPhotos | LinkedModels, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Lay a formed strip on its control and correct its deformation."""
    if isinstance(stage, FormedPhotos):
        return adjust_photos(absolute.on_control(stage, control, frames, settings), settings)
    found = models.on_control(stage, control, frames, settings)
    return models.adjusted(found, _correction(found.models.oriented, settings))


def _correction(oriented: OrientedStrip, settings: Settings) -> polynomial.Polynomial | None:
    if settings.adjustment == SIMILARITY:
        return None
    spacing, breadth = oriented.extent
    problem = polynomial.FitProblem(
        xyz=oriented.at_control, targets=oriented.targets, weight=oriented.weights, spacing=spacing, breadth=breadth
    )
    return polynomial.fit(problem, settings.polynomial)
