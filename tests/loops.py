"""Loops that assert something: over nothing they would assert nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable

T = TypeVar("T")


def nonempty(values: Iterable[T]) -> list[T]:
    """Give what a test loops over, and fail when there is nothing."""
    found = list(values)
    assert found, "a loop over nothing asserts nothing"
    return found
