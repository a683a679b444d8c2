"""Stages that are asked for again: by other methods of adjustment, and by what looks into a failure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, Literal, TypeVar

import numpy as np

from photostrip.errors import GeometryError, InputError

T = TypeVar("T")
Stage = Literal["pairs", "strip", "control", "shifted", "failure"]
"""Pairs searched, a strip formed, on its control without what is wrong, a shifted photo looked for in it, what speaks
for a failure."""


class Stages:
    """What was made before, or why it could not be."""

    def __init__(self, *kept: Stage) -> None:
        self._made: dict[Stage, list[tuple[tuple[object, ...], Any]]] = {name: [] for name in kept}

    def once(self, name: Stage, make: Callable[[], T], *given: object) -> T:
        """Return what a stage that is kept made from equal values before, or make it.

        Raises the GeometryError or InputError that it raised then.
        """
        made: list[tuple[tuple[object, ...], T | GeometryError | InputError]] = self._made.get(name, [])
        known = [each for values, each in made if alike(values, given)]
        if known:
            found = known[0]
        else:
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
    if isinstance(one, tuple) and isinstance(other, tuple) and set(map(type, one)) != {str}:
        return len(one) == len(other) and all(map(alike, one, other))
    return bool(one == other)
