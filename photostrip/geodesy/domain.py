"""Points outside the domain of a projection, a geoid grid or a datum shift: found, and named in messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.notes import named

_ROWS_NAMED = 8


def finite_rows(rows: Floats) -> Flags:
    """Rows without an infinite number: PROJ marks what it cannot transform by infinity."""
    return np.asarray(np.isfinite(rows).all(axis=1))


def named_rows(bad: Flags, ids: Sequence[str] | None) -> str:
    """Say which rows are meant, the first of them by name; without ids by number, counted from 0."""
    rows = np.flatnonzero(bad)
    if ids is None:
        return named("row", [str(row) for row in rows], _ROWS_NAMED)
    return named("point", [ids[int(row)] for row in rows], _ROWS_NAMED)


def require_rows(good: Flags, trouble: str, ids: Sequence[str] | None) -> None:
    """Refuse coordinates given by the user that cannot be used."""
    if not good.all():
        raise InputError(Fault(f"{named_rows(~good, ids)}: {trouble}", code="ground-domain", points=_ids(~good, ids)))


def require_reached(good: Flags, trouble: str, ids: Sequence[str] | None) -> None:
    """Refuse computed points that cannot be expressed in a frame."""
    if not good.all():
        raise GeometryError(f"{named_rows(~good, ids)}: {trouble}", points=_ids(~good, ids), code="ground-domain")


def _ids(bad: Flags, ids: Sequence[str] | None) -> tuple[str, ...]:
    return () if ids is None else tuple(ids[int(row)] for row in np.flatnonzero(bad))
