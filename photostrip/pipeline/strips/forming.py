"""All strips of a project formed, without any control."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from photostrip.errors import GeometryError, InputError
from photostrip.frozen import replace
from photostrip.pipeline import overruling
from photostrip.pipeline.refusals import require_adjustment_of_models
from photostrip.pipeline.strips.photos import FormedPhotos, form_strip

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.pipeline.strips.absolute import StripStage
    from photostrip.points import PhotoPoints


T = TypeVar("T")
Stage = Literal["pairs", "strip", "control", "failure"]
"""Pairs searched, a strip formed, a strip on its control without what is wrong, what speaks for a failure."""


def form_strips(inputs: Inputs, observations: PhotoPoints, settings: Settings, stages: Stages) -> list[StripStage[Any]]:
    """Form the strips of a project, of photos or of independent models, each by itself."""
    models = inputs.models
    if models is None:
        return list(form_photos(inputs, observations, settings, stages))
    from photostrip.pipeline.strips.models import link_strip  # strips of photos need none of it

    require_adjustment_of_models(settings)
    overruling.require_named(settings.links, models.points)
    wanted = replace(settings, adjustment="")
    return [
        stages.once("strip", partial(link_strip, strip, models.points, settings), strip, models.points, wanted)
        for strip in models.strips
    ]


def form_photos(inputs: Inputs, observations: PhotoPoints, settings: Settings, stages: Stages) -> list[FormedPhotos]:
    """Form the strips of photos; a single photo, which only a bundle adjustment can orient, forms nothing."""
    overruling.require(settings.relative, observations)
    overruling.require_weighted(settings.formation, observations)
    whole = [strip for strip in inputs.strips if len(strip.photos) > 1 or settings.adjustment != "bundle"]
    given = (observations, settings.relative, settings.formation)
    return [
        stages.once("strip", partial(form_strip, strip, observations, settings, stages), strip, *given)
        for strip in whole
    ]


class Stages:
    """What was made before, or why it could not be: for other methods of adjustment, and to look into a failure."""

    def __init__(self, *kept: Stage) -> None:
        self._made: dict[Stage, list[tuple[tuple[object, ...], Any]]] = {name: [] for name in kept}

    def once(self, name: Stage, make: Callable[[], T], *given: object) -> T:
        """Return what a stage that is kept made from equal values before, or make it.

        Raises the GeometryError or InputError that it raised then.
        """
        made: list[tuple[tuple[object, ...], T | GeometryError | InputError]] = self._made.get(name, [])
        found = next((each for values, each in made if alike(values, given)), None)
        if found is None:
            try:
                found = make()
            except (GeometryError, InputError) as error:
                found = error
            made.append((given, found))
        if isinstance(found, (GeometryError, InputError)):
            raise found
        return found


def alike(one: object, other: object) -> bool:
    """Whether two values say the same: arrays and tables by what they hold."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, np.asarray(other), equal_nan=one.dtype.kind == "f")
    if is_dataclass(one):
        return all(alike(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    return bool(one == other)
