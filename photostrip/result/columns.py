"""Columns of the CSV files beside result.json, with the quantities of the keys that they are written from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, cast

from photostrip.notes import Document
from photostrip.result.description import Quantity, table_at
from photostrip.result.numbers import GROUND, RoundedColumn
from photostrip.result.quantities import angle_decimals, coordinate_decimals
from photostrip.result.records import Records

AZIMUTH_DECIMALS = {"deg": 1, "gon": 1, "rad": 3}
MATRIX = [f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)]


class Column(NamedTuple):
    """A column of a table beside result.json."""

    name: str
    key: str  # in the records behind the table
    quantity: Quantity


def columns(block: str, names: str) -> list[Column]:
    """List columns by the keys of the records of a block; ``name=key`` where a column has another name."""
    table = table_at(block)
    pairs = [(name, key or name) for name, _, key in (each.partition("=") for each in names.split())]
    return [Column(name, key, found) for name, key in pairs if isinstance(found := table[key], Quantity)]


rejected_csv = partial(
    columns,
    "rejected",
    "strip photo other_photo point stage test value limit unit reason zone size size_unit readmitted blamed",
)
refined_csv = partial(columns, "refined", "photo point x_mm y_mm sigma_x_um sigma_y_um")
residuals_csv = partial(columns, "residuals", "photo point=points vx_um vy_um used")
parallaxes_csv = partial(columns, "parallaxes", "left right point=points q_um used")
links_csv = partial(columns, "link_residuals", "before after point=points vx_um vy_um vz_um test used")
reliability_csv = partial(
    columns, "residuals", "photo point=points redundancy_x redundancy_y test_x test_y detectable_x_um detectable_y_um"
)


def points_csv(unit: str) -> list[Column]:
    """List the columns of points.csv for a unit of angles; the keys are those of flat records."""
    names = "point=id role x y z sigma_x sigma_y sigma_z rays models checked image_rms_um cov_xy cov_xz cov_yz"
    (azimuth,) = columns("points", "ellipse_azimuth_deg")
    name, decimals = f"ellipse_azimuth_{unit}", AZIMUTH_DECIMALS[unit]
    azimuth = Column(name, name, replace(azimuth.quantity, unit=unit, decimals=decimals))
    return [*columns("points", f"{names} ellipse_a ellipse_b"), azimuth]


def photos_csv(angles: Document) -> list[Column]:
    """List the columns of photos.csv for a system and a unit of angles; the keys are those of flat records."""
    decimals, unit = angle_decimals(angles["unit"]), angles["unit"]
    names = [f"{name}_{unit}" for name in angles["system"].split("-")]
    angle = Quantity(meaning="angle of the photo", kind="number", unit=unit, decimals=decimals)
    sigma = Quantity(meaning="standard deviation of the angle", kind="number", unit=unit, decimals=decimals)
    return [
        *columns("photos", "photo=id strip x y z"),
        *(Column(name, name, angle) for name in names),
        *(each._replace(key=each.name) for each in columns("photos", " ".join(f"{name}=rotation" for name in MATRIX))),
        *columns("photos", "image_rms_um points"),
        *columns("points", "sigma_x sigma_y sigma_z"),
        *(Column(f"sigma_{name}", f"sigma_{name}", sigma) for name in names),
    ]


def flat_photos(photos: Records | Sequence[Document], listed: Iterable[Column]) -> Records:
    """Return photos with the keys of photos.csv: one for each angle, number of the matrix and standard deviation."""
    angles = photos[0]["angles"]
    names = [f"{name}_{angles['unit']}" for name in angles["system"].split("-")]
    paths: dict[str, tuple[str | int, ...]] = {
        **{name: ("angles", "values", place) for place, name in enumerate(names)},
        **{name: ("rotation", place) for place, name in enumerate(MATRIX)},
        **{f"sigma_{axis}": ("sigma", axis) for axis in "xyz"},
        **{f"sigma_{name}": ("sigma", "angles", place) for place, name in enumerate(names)},
    }
    return Records({each.key: _at(photos, paths.get(each.key, (each.key,))) for each in listed})


def _at(found: Any, path: Iterable[str | int]) -> Sequence[Any]:  # noqa: ANN401 (records or a column)
    """Return the column that keys and places of numbers lead to; None where something on the way is not known."""
    for step in path:
        if isinstance(found, Records):
            found = found.columns[str(step)]
        elif isinstance(found, RoundedColumn):
            found = RoundedColumn(found.values[:, int(step)])
        elif isinstance(step, int):
            found = [None if each is None else each[step] for each in found]
        else:
            found = [None if each is None else each.get(step) for each in found]
    return cast("Sequence[Any]", found)


def in_frame(listed: Iterable[Column], frame: Document) -> list[Column]:
    """Give the coordinates among columns the decimals of their frame."""
    decimals = dict(
        zip("xyz", coordinate_decimals(frame["kind"], frame["axes"], frame.get("decimals", GROUND)), strict=True)
    )
    return [
        each._replace(quantity=replace(each.quantity, kind="number", decimals=decimals[each.key]))
        if each.key in decimals
        else each
        for each in listed
    ]
