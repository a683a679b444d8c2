"""Gross errors: wrong image coordinates, wrong control coordinates, points mistaken for each other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.points import PhotoPoints
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.spec import GrossError, Spec

AXES = "xyz"
HALF = 0.5


@dataclass(frozen=True)
class InjectedError:
    """One gross error that was put in."""

    kind: str  # ``image``, ``control`` or ``swap``
    point: str
    photo: str = ""  # the photo; empty for control
    # which coordinate; empty for a swap. In the image x to the right, y up; at control x, y, z stand for east, north,
    # up (X, Y, Z)
    axis: str = ""
    size: float = 0.0  # what was added to the coordinate: mm in the image, metres at control; 0 for a swap
    other: str = ""  # the point it was exchanged with


def spoil_control(spec: Spec, ids: tuple[str, ...], use: Flags) -> tuple[Floats, tuple[InjectedError, ...]]:
    """Choose gross errors of given coordinates: what is added to them (n, 3), metres, and the list of errors.

    Draws (`Purpose.GROSS`, a stream for each entry of the list): an order of all control points, then for each error a
    number for the axis and one for the sign. An error whose point is named has the sign of its size. No point gets two
    errors.

    use: (n, 3), which coordinates of the control points are given.
    Raises InputError when a point named is not a control point, or more errors are asked for than there are control
        points.
    """
    offset = np.zeros((len(ids), 3))
    free = np.ones(len(ids), dtype=bool)
    errors = []
    for number, entry in _entries(spec, {"control"}):
        draws = Draws(spec.seed, Purpose.GROSS, number)
        order = draws.order(len(ids))
        fits = np.array([entry.point in {None, name} for name in ids], dtype=bool)
        if entry.axis is not None:
            fits &= use[:, AXES.index(entry.axis)]
        rows = _take(order[(fits & free)[order]], number, entry)
        for row in rows:
            axis, sign = draws.uniform(2)
            given = [AXES.index(entry.axis)] if entry.axis else np.flatnonzero(use[row]).tolist()
            column = given[int(axis * len(given))]
            size = entry.size_m if entry.point or sign < HALF else -entry.size_m
            offset[row, column] += size
            free[row] = False
            errors.append(InjectedError("control", ids[row], axis=AXES[column], size=size))
    return offset, tuple(errors)


def spoil_images(spec: Spec, observations: PhotoPoints) -> tuple[PhotoPoints, tuple[InjectedError, ...]]:
    """Put gross errors into image coordinates.

    Draws (`Purpose.GROSS`, a stream for each entry of the list): an order of all image points, then for each error a
    number for the axis, one for the sign and one for the partner of a swap. An error whose photo and point are both
    named has the sign of its size. No image point gets two errors.

    Raises InputError when a photo does not show the point named, or more errors are asked for than there are image
        points.
    """
    xy = np.array(observations.xy)
    photo = np.array(observations.photo_ids)[observations.photo]
    point = np.array(observations.point_ids)[observations.point]
    free = np.ones(len(xy), dtype=bool)
    errors = []
    for number, entry in _entries(spec, {"image", "swap"}):
        draws = Draws(spec.seed, Purpose.GROSS, number)
        order = draws.order(len(xy))
        fits = np.ones(len(xy), bool) if entry.photo is None else photo == entry.photo
        fits &= entry.point is None or point == entry.point
        for _ in range(entry.count):
            row = _take(order[(fits & free)[order]], number, replace(entry, count=1))[0]
            axis, sign, partner = draws.uniform(3)
            free[row] = False
            if entry.kind == "swap":
                others = np.flatnonzero(free & (photo == photo[row]))
                if not len(others):
                    raise _too_many(number, entry)
                other = others[int(partner * len(others))]
                free[other] = False
                xy[[row, other]] = xy[[other, row]]
                errors.append(InjectedError("swap", str(point[row]), str(photo[row]), other=str(point[other])))
                continue
            column = AXES.index(entry.axis) if entry.axis else int(axis * 2)
            named = entry.photo is not None and entry.point is not None
            size = entry.size_um / 1000.0 * (1.0 if named or sign < HALF else -1.0)
            xy[row, column] += size
            errors.append(
                InjectedError(kind="image", point=str(point[row]), photo=str(photo[row]), axis=AXES[column], size=size)
            )
    return replace(observations, xy=xy), tuple(errors)


def _entries(spec: Spec, kinds: set[str]) -> list[tuple[int, GrossError]]:
    return [(number, entry) for number, entry in enumerate(spec.gross_errors) if entry.kind in kinds]


def _take(rows: Numbers, number: int, entry: GrossError) -> list[int]:
    if len(rows) < entry.count:
        raise _too_many(number, entry)
    return [int(row) for row in rows[: entry.count]]


def _too_many(number: int, entry: GrossError) -> InputError:
    names = " on photo " + entry.photo if entry.photo else ""
    names = (f" of point {entry.point}" if entry.point else "") + names
    what = "control coordinates" if entry.kind == "control" else "image points"
    return InputError(
        Fault(
            f"there are not enough {what}{names} for a gross error",
            code="simulation-gross",
            key=f"gross_errors[{number}]",
            fix="ask for fewer, or take a name that occurs in the written files",
        )
    )
