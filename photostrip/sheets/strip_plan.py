"""The plan of a strip and its control: plan is both coordinates together, photos and rows count from 1."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document, counted, listed
from photostrip.planning.ideal_strip import ControlLayout, IdealStrip, Spot, numbers_of
from photostrip.planning.strip_design import BestPlaces, DesignReport, Outcome, along_the_strip, worst
from photostrip.report.page.parts import DASH, Words
from photostrip.report.page.tables import Cell, Field, fields, written
from photostrip.result.numbers import rms
from photostrip.sheets.sheet import Fact, Rows, Sheet, plain, table, taken

PHOTOS_SHOWN = 11  # columns of the tables along a strip
PLACES_SHOWN = 6
SYMMETRY = 6  # decimals of metres that decide which point is the worst: strips are symmetric
WHO = (Field("layout"), Field("method"))
WORST = fields("worst_plan_m worst_z_m", "m 3", "worst_plan worst_height")


def strip_sheet(name: str, report: DesignReport) -> Sheet:
    """Return the plan of a strip, with bands needed and best places when asked for."""
    geometry, required = report.design.geometry, report.design.required
    focal = geometry.camera.principal_distance
    height, base, points = report.strip.centers[0, 2], geometry.base, len(report.strip.xyz)
    flight = f"{geometry.photos} photos, 1:{geometry.scale:g}, {geometry.end_lap_percent:.4g} % overlap; {height:.0f} m"
    measuring = f"{1000 * geometry.image_sigma:.1f} µm; {counted(points, 'point')},"
    wanted = {"plan": required.plan, "height": required.height}
    facts = [
        Fact("name", name),
        Fact(
            "camera",
            {"name": geometry.camera.name, "principal_distance_mm": focal},
            text=f"{geometry.camera.name}, f {focal:.9g} mm",
        ),
        Fact(
            "geometry",
            {
                "photos": geometry.photos,
                "models": geometry.photos - 1,
                "end_lap_percent": geometry.end_lap_percent,
                "scale": plain(geometry.scale, "ratio g7"),
                "flying_height_m": plain(height, "m 0"),
                "base_m": plain(base, "m 0"),
                "rows": geometry.points.rows,
                "points": points,
            },
            text=f"{flight} above the ground, base {base:.0f} m",
            label="strip",
        ),
        Fact(
            "image_sigma_um",
            1000 * geometry.image_sigma,
            "um 1",
            f"{measuring} {counted(geometry.points.rows, 'row')} at each nadir",
            "measuring",
        ),
        Fact(
            "required_m",
            wanted,
            text=", ".join(f"{value:.3f} m in {key}" for key, value in wanted.items() if value is not None),
            label="required",
        ),
    ]
    tables = [_layouts(report), _accuracy(report), _along(report), _detectable(report), _needed(report)]
    if report.placed is not None:
        tables.append(_placed(report.placed))
    return Sheet("strip", "Expected accuracy of a strip", facts, tables, main="along")


def _layouts(report: DesignReport) -> Rows:
    spots = {each.layout.name: each.spots for each in report.outcomes}

    def at(layout: ControlLayout) -> Cell:
        chosen = spots[layout.name]
        places = map(_spot, chosen, report.strip.xyz[numbers_of(report.strip, chosen)])
        return Cell(listed(map(_at, chosen), PLACES_SHOWN), list(places))

    columns = (
        Field("name", head="layout"),
        Field("count", "count", "points", of=lambda layout: len(spots[layout.name])),
        Field(
            "sigma_m",
            head="σ of control",
            below="along, across, up, m",
            of=lambda each: Cell(written(each.sigma, "m 3"), each.sigma),
        ),
        Field("gnss_sigma_m", head="σ of perspective centres", below="m", of=_gnss),
        Field("gnss_offset", shown=False, of=lambda each: None if each.gnss is None else each.gnss_offset),
        Field("points", head="at photo/row", rank=1, of=at),
    )
    return table("layouts", "", taken(columns, report.design.layouts))


def _gnss(layout: ControlLayout) -> Cell:
    if layout.gnss is None:
        return Cell("not measured", None)
    return Cell(f"{written(layout.gnss, 'm 3')}{', offset free' if layout.gnss_offset else ''}", layout.gnss)


def _spot(spot: Spot, at: Floats | None = None) -> Document:
    place = {} if at is None else {"x_m": plain(float(at[0]), "m 0"), "y_m": plain(float(at[1]), "m 0")}
    return {"photo": spot.photo, "row": spot.row, "use": spot.use, **place}


def _at(spot: Spot) -> str:
    return f"{spot.photo}/{spot.row}{'' if spot.use == 'xyz' else f' {spot.use}'}"


def _accuracy(report: DesignReport) -> Rows:
    meets = report.design.required != type(report.design.required)()
    refused = [each for each in report.outcomes if each.accuracy is None or not len(each.accuracy.new)]
    reasons = [f"{each.layout.name}, {each.method}: {each.reason or 'every point is control'}." for each in refused]
    return Rows(
        "accuracy",
        "Expected standard deviations of new points",
        (
            *WHO,
            Field("rms_plan_m", "m 3", "plan rms"),
            Field("worst_plan_m", "m 3", "worst"),
            Field("rms_z_m", "m 3", "height rms"),
            Field("worst_z_m", "m 3", "worst"),
            Field("worst_z_at", "count", "at photo"),
            Field("worst_plan_at", shown=False),
            Field("meets", shown=meets),
            Field("used", head="the control carries", rank=1),
        ),
        [_outcome(each, report) for each in report.outcomes],
        note="plan: both coordinates together; photo: nearest to the worst height",
        below=[Words(each, "look", mark="-") for each in reasons],
    )


def _outcome(outcome: Outcome, report: DesignReport) -> tuple[Any, ...]:
    found, who = outcome.accuracy, (outcome.layout.name, outcome.method)
    if found is None or not len(found.new):
        return (*who, *[None] * 7, Cell("too little", None))
    sigmas, limits = found.plan_and_height[found.new], worst(found)
    at = [_place(report.strip, int(found.new[np.argmax(np.round(sigmas[:, k], SYMMETRY))])) for k in range(2)]
    used = Cell("" if found.used == outcome.method else found.used, found.used)
    means = [rms(sigmas[:, k]) for k in range(2)]
    meets = report.design.required.met(limits)
    return (*who, means[0], limits[0], means[1], limits[1], Cell(str(at[1]["photo"]), at[1]), at[0], meets, used)


def _place(strip: IdealStrip, number: int) -> Document:
    x, y = strip.xyz[number, :2].tolist()
    photo = 1 + int(np.argmin(np.abs(strip.centers[:, 0] - x)))
    return {"photo": photo, "x_m": plain(x, "m 0"), "y_m": plain(y, "m 0")}


def _determined(report: DesignReport) -> Iterator[Outcome]:
    return (each for each in report.outcomes if each.accuracy is not None and len(each.accuracy.new))


def _along(report: DesignReport) -> Rows:
    near = "Along the strip: worst standard deviation in {} near each photo, m"
    return Rows(
        "along",
        "",
        (
            *WHO,
            Field("photo", "count"),
            Field("plan_m", "m 2", near.format("plan")),
            Field("z_m", "m 2", near.format("height")),
        ),
        [
            (each.layout.name, each.method, photo, *values)
            for each in _determined(report)
            if each.accuracy is not None
            for photo, values in enumerate(along_the_strip(report.strip, each.accuracy).tolist(), 1)
        ],
        across="photo",
        tables=("z_m", "plan_m"),
        most=PHOTOS_SHOWN,
    )


def _detectable(report: DesignReport) -> Rows:
    """Give the errors that are found at each control point, and print the largest; never where nothing checks it."""
    rows = []
    for each in _determined(report):
        size = each.accuracy.detectable if each.accuracy is not None else np.zeros((0, 3))
        if not len(size):
            continue
        order = np.where(np.isnan(size), -1.0, size)
        plan, height = order[:, :2].max(axis=1), order[:, 2]
        at = [each.spots[int(np.argmax(np.round(values, 4)))] for values in (plan, height)]
        every = [
            _spot(spot) | dict(zip(("x_m", "y_m", "z_m"), map(_size, row), strict=True))
            for spot, row in zip(each.spots, order.tolist(), strict=True)
        ]
        rows.append(
            (
                each.layout.name,
                each.method,
                *(Cell(_found(float(values.max())), _size(float(values.max()))) for values in (plan, height)),
                Cell(f"{_at(at[0])} in plan, {_at(at[1])} in height", every),
            )
        )
    return Rows(
        "detectable",
        "Smallest control error that is found",
        (*WHO, *fields("plan_m z_m", "m 3", "plan height"), Field("points", head="worst at photo/row")),
        rows,
        note="found in 80 % of cases by a test at 0.1 %, at the worst control point",
    )


def _size(size: float) -> float | str | None:
    """Return a detectable error as JSON has it, which knows no infinity."""
    return "never" if np.isinf(size) else None if size < 0 else float(plain(size, "m 3"))


def _found(size: float) -> str:
    return "never" if np.isinf(size) else DASH if size < 0 else f"{size:.3f}"


def _needed(report: DesignReport) -> Rows:
    return Rows(
        "needed",
        "Bands of control that the required accuracy needs",
        (Field("method"), Field("bands", "count"), Field("points", "count"), *WORST),
        [
            (each.method, Cell("not reached", None) if each.bands is None else each.bands, each.points, *each.worst)
            for each in report.needed
        ],
        note="evenly spread from the first to the last photo, at most one at every photo",
    )


def _placed(placed: BestPlaces) -> Rows:
    head = f"{counted(len(placed.spots), 'point')} added to `{placed.placement.into}`, adjusted by"
    gain = round(100 * placed.gain, 1)
    told = f"search beats equal spacing by {gain:.1f} % at the worst points."
    text = told if gain else "search finds no places that beat equal spacing by 1 % or more."
    kinds: tuple[tuple[str, tuple[float, float], Sequence[Spot]], ...] = (
        (placed.placement.into, placed.before, ()),
        ("equal spacing", placed.equal, placed.equal_spots),
        ("places found", placed.found, placed.spots),
    )
    return Rows(
        "placed",
        "Best places for further control points",
        (Field("control"), *WORST, Field("points", head="further points at photo/row")),
        [(name, *limits, Cell(", ".join(map(_at, spots)), [*map(_spot, spots)])) for name, limits, spots in kinds],
        note=f"{placed.tried} layouts tried",
        above=(f"{head} {placed.placement.method}: the {text}",),
    )
