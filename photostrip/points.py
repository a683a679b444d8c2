"""Points and what is measured of them: frozen columns over read-only arrays, keyed by id."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from itertools import chain, count, repeat
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from photostrip.arrays import Flags, Floats, Numbers

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")


def frozen(values: ArrayLike, dtype: type = float, shape: tuple[int, ...] | None = None) -> NDArray[Any]:
    """Return a read-only array, copied only when needed; an empty or flat input can be brought into a shape."""
    array: NDArray[Any] = np.ascontiguousarray(values, dtype=dtype)
    if shape is not None:
        array = array.reshape(shape)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


def frozen_alike(values: ArrayLike, dtype: type, shape: tuple[int, ...]) -> NDArray[Any]:
    """Do the same for a column that mostly holds one value: where all rows are equal, the first stands for all."""
    array = np.asarray(values, dtype).reshape(shape)
    if len(array) > 1 and (array[0] == array[-1]).all() and (array == array[0]).all():
        return np.broadcast_to(array[0].copy(), shape)
    return frozen(array, dtype)


def take_rows(table: T, rows: Sequence[int] | Numbers | Flags, columns: Iterable[str]) -> T:
    """Select rows of a frozen table of columns, by number or by flag.

    columns: fields that hold a column, an array or a tuple; the others stay.
    """
    chosen: dict[str, Any] = {}
    for name in columns:
        column = getattr(table, name)
        numbers = np.asarray(rows) if len(column) else np.zeros(0, np.intp)
        if isinstance(column, tuple):
            chosen[name] = tuple(column[row] for row in np.arange(len(column))[numbers].tolist())
        else:
            chosen[name] = column[numbers]
    return replace(cast("Any", table), **chosen)


def locate(wanted: Iterable[str], ids: Iterable[str]) -> Numbers:
    """Place of each wanted id among ids; -1 for those that are not there."""
    place = dict(zip(ids, count(), strict=False))
    return np.fromiter(map(place.get, wanted, repeat(-1)), np.intp)


@lru_cache(maxsize=4)
def located(wanted: tuple[str, ...], ids: tuple[str, ...]) -> Numbers:
    """Do the same for ids that are asked for in many places of a run: given points, the photos of a strip."""
    found = locate(wanted, ids)
    found.setflags(write=False)
    return found


@dataclass(frozen=True, eq=False)
class PointTable:
    """Coordinates of points in one frame."""

    ids: tuple[str, ...]  # point ids, unique
    xyz: Floats  # (n, 3): coordinates in the unit of the frame

    def __post_init__(self) -> None:
        object.__setattr__(self, "xyz", frozen(self.xyz, shape=(len(self.ids), 3)))

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class PhotoPoints:
    """Points measured on photos, one row for each image point."""

    # photo_ids, point_ids: ids in order of first appearance; rows refer to them by number
    photo_ids: tuple[str, ...]
    point_ids: tuple[str, ...]
    # photo, point: (n,): numbers of the photo and of the point of each row
    photo: Numbers
    point: Numbers
    xy: Floats  # (n, 2): image coordinates in mm; x to the right, y up
    sigma: Floats  # (n, 2): their standard deviations in mm

    def __post_init__(self) -> None:
        for name in ("photo", "point"):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype=np.intp))
        n = len(self.photo)
        object.__setattr__(self, "xy", frozen(self.xy, shape=(n, 2)))
        object.__setattr__(self, "sigma", frozen_alike(self.sigma, float, (n, 2)))

    @classmethod
    def naming(cls, point_ids: tuple[str, ...]) -> Self:
        """Return a table that holds no image point and only names points, as those of models."""
        none, nothing = np.zeros(0, np.intp), np.zeros((0, 2))
        return cls(photo_ids=(), point_ids=point_ids, photo=none, point=none, xy=nothing, sigma=nothing)

    def __len__(self) -> int:
        return len(self.photo)

    @cached_property
    def photo_index(self) -> dict[str, int]:
        return {name: number for number, name in enumerate(self.photo_ids)}

    def places(self, photos: tuple[str, ...]) -> Numbers:
        """Place of the photo of every image point among some photos; -1 for the others."""
        return np.asarray(located(self.photo_ids, photos)[self.photo], np.intp)


@dataclass(frozen=True, eq=False)
class ControlPoints:
    """Given ground coordinates: what they are, which of them count, how good they are."""

    ids: tuple[str, ...]  # point ids, unique
    # (n, 3): given coordinates in the units of each point's own ground frame, in the internal order east, north, up
    # (geocentric: X, Y, Z). A coordinate that is not given is NaN
    enu: Floats
    use: Flags  # (n, 3): which coordinates count, in the same order
    check: Flags  # (n,): true for check points, which never influence a result
    sigma: Floats  # (n, 3): standard deviations in metres, in the same order
    # (n,): number of each point's ground frame in the project's list of frames
    frame: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))

    def __post_init__(self) -> None:
        n = len(self.ids)
        object.__setattr__(self, "enu", frozen(self.enu, shape=(n, 3)))
        object.__setattr__(self, "use", frozen(self.use, dtype=np.bool_, shape=(n, 3)))
        object.__setattr__(self, "check", frozen(self.check, dtype=np.bool_, shape=(n,)))
        object.__setattr__(self, "sigma", frozen_alike(self.sigma, float, (n, 3)))
        frame = self.frame if len(self.frame) else np.zeros(n, np.intp)
        object.__setattr__(self, "frame", frozen_alike(frame, np.intp, (n,)))

    def __len__(self) -> int:
        return len(self.ids)

    def take(self, rows: Sequence[int] | Numbers | Flags) -> ControlPoints:
        """Points of some rows, by number or by flag, in their order."""
        return take_rows(self, rows, (each.name for each in fields(self)))


def concatenated(tables: Sequence[ControlPoints]) -> ControlPoints:
    """Points of several tables, one after the other."""
    columns = {each.name: [getattr(table, each.name) for table in tables] for each in fields(ControlPoints)}
    ids = tuple(chain.from_iterable(columns.pop("ids")))
    return ControlPoints(ids=ids, **{name: np.concatenate(parts) for name, parts in columns.items()})


@dataclass(frozen=True, eq=False)
class ModelPoints:
    """Points and perspective centres measured in independent models, one row for each point of a model.

    Points and centres have one numbering: number ``k`` below ``len(point_ids)`` is a point, above it the perspective
    centre of photo ``photo_ids[k - len(point_ids)]``.
    """

    # model_ids, point_ids, photo_ids: ids; rows refer to them by number
    model_ids: tuple[str, ...]
    point_ids: tuple[str, ...]
    photo_ids: tuple[str, ...]
    # model, node: (n,): number of the model, and of the point or centre, of each row
    model: Numbers
    node: Numbers
    # (n, 3): model coordinates in mm, right-handed; every model has a scale, a rotation and an origin of its own
    xyz: Floats
    sigma: Floats  # (n, 3): their standard deviations in mm
    correlation: Floats | None = None  # (n, 3, 3): correlations of the three coordinates; None: there are none

    def __post_init__(self) -> None:
        for name in ("model", "node"):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype=np.intp))
        n = len(self.model)
        for name in ("xyz", "sigma"):
            object.__setattr__(self, name, frozen(getattr(self, name), shape=(n, 3)))
        if self.correlation is not None:
            object.__setattr__(self, "correlation", frozen(self.correlation, shape=(n, 3, 3)))

    def __len__(self) -> int:
        return len(self.model)

    def name(self, node: int) -> str:
        """Name a point, or a centre by its photo."""
        points = len(self.point_ids)
        return self.point_ids[node] if node < points else f"center of photo {self.photo_ids[node - points]}"
