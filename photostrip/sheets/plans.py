"""The plans of cameras, of a survey of displacements, and of an experiment with gross errors in pairs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.planning.camera_efficiency import ComparedCamera, FlownSurvey, by_efficiency, compare, suitability
from photostrip.planning.screening import ARC_MINUTES, ScreeningOutcome
from photostrip.report.page.tables import Cell, Field, fields
from photostrip.sheets.sheet import Fact, Rows, Sheet, hidden, listed
from photostrip.strip.relative_orientation import ELEMENTS
from photostrip.terrestrial.accuracy import PLACES, DisplacementSpec, plan_displacements
from photostrip.units import MICROMETRES


def camera_sheet(
    name: str, cameras: Sequence[ComparedCamera], reference: ComparedCamera, survey: FlownSurvey | None = None
) -> Sheet:
    """Return a comparison of cameras, one row for each camera in the order given."""
    order = [camera.name for camera in by_efficiency(cameras)]
    smallest = min(cameras, key=lambda camera: camera.coefficient).name
    facts = [
        Fact("name", name),
        Fact("fewest_photos", order[0], text=f"{order[0]}, at equal standard deviations of heights"),
        Fact(
            "smallest_coefficient",
            smallest,
            text=f"{smallest}: the order where bases and formats are equal",
            label="smallest K",
        ),
        Fact("reference", reference.name, text=f"{reference.name}: all ratios are to it", label="beside"),
    ]
    beside = {camera.name: compare(camera, reference) for camera in cameras}
    tables = [
        listed(
            "cameras",
            "",
            (
                Field("camera", of="name"),
                Field("principal_distance_mm", "mm g9", "f", of="focal"),
                Field("sigma_um", "um 1", "m_p", of=lambda camera: camera.sigma * MICROMETRES),
                Field("coefficient_mm2", "mm² 3", "K = f m_p", of="coefficient"),
                Field("height_ratio", "ratio 0", "H/m_h"),
                Field("eta_height", "ratio 3", "m_h", "equal area", of=lambda camera: beside[camera.name].height_error),
                Field("scale_ratio", "ratio 3", "scale", "equal m_h", of=lambda camera: beside[camera.name].scale),
                Field("eta_area_printed", "ratio 3", "area", "printed", of=lambda at: beside[at.name].printed_area),
                Field("eta_area", "ratio 3", "area", "equal m_h", of=lambda camera: beside[camera.name].area),
                Field("photos_ratio", "ratio 3", "photos", "equal m_h", of=lambda camera: beside[camera.name].photos),
                Field("base_mm", "mm 1", shown=False, of="base"),
                Field("useful_width_mm", "mm 1", shown=False, of="width"),
                Field("rank", shown=False, of=lambda camera: order.index(camera.name) + 1),
            ),
            cameras,
        ),
        listed(
            "models",
            "Their models",
            (
                Field("camera", of="name"),
                Field("base_mm", "mm 1", "base", of="base"),
                Field("useful_width_mm", "mm 1", "useful width", of="width"),
                Field("base_ratio", "ratio 2", "f/b", of=lambda camera: camera.focal / camera.base),
            ),
            cameras,
        ),
    ]
    if survey is not None:
        tables += _survey(cameras, survey, order, facts)
    return Sheet("cameras", "Efficiency of cameras", facts, tables)


def _survey(
    cameras: Sequence[ComparedCamera], survey: FlownSurvey, order: Sequence[str], facts: list[Fact]
) -> Iterator[Rows]:
    """Give what each camera does in one survey, and which of them takes its terrain."""
    terrain, flown = survey.terrain, {camera.name: survey.flown(camera) for camera in cameras}
    suited = {camera.name: suitability(camera, survey) for camera in cameras}
    best = next((name for name in order if suited[name].suits), None)
    slope = float(np.degrees(terrain.slope))
    asked = bool(terrain.relief or terrain.slope)
    facts += [
        Fact(
            "terrain",
            {"relief_m": terrain.relief, "slope_deg": round(slope, 3)},
            text=f"relief {terrain.relief:.0f} m, slopes up to {slope:.0f}°" if asked else "",
        ),
        Fact(
            "recommended",
            best,
            text=(f"{best}, the most efficient of those that take it" if best else "none of these cameras")
            if asked
            else "",
        ),
    ]
    yield listed(
        "survey",
        "What heights and areas cost",
        (
            Field("camera", of=lambda name: name),
            Field("scale", "ratio g4", of=lambda name: Cell(f"1:{flown[name].scale:.0f}", flown[name].scale)),
            Field("flying_height_m", "m 0", "H", of=lambda name: flown[name].flying_height),
            Field("sigma_z_m", "m 3", "m_h", of=lambda name: flown[name].height_sigma),
            Field("area_km2", "km² g4", "area S", of=lambda name: flown[name].area),
            Field(
                "sigma_z_per_area_m_km2",
                "m/km² g4",
                "m_h/S",
                of=lambda name: flown[name].height_sigma / flown[name].area,
            ),
            Field("photos_per_100_km2", "ratio 0", "photos", "per 100 km²", of=lambda name: 100 / flown[name].area),
        ),
        flown,
        note="S: what a model covers, of its useful width",
    )
    yield listed(
        "terrain_limits",
        "What the cameras take of the terrain",
        (
            Field("camera", of=lambda name: name),
            Field("lap_at_highest_percent", "percent 1", "overlap", "highest, %", of=lambda at: 100 * suited[at].lap),
            Field("largest_relief_m", "m 0", "relief", "largest, m", of=lambda name: suited[name].relief),
            Field("steepest_slope_deg", "deg 1", "slope", "steepest, °", of=lambda at: np.degrees(suited[at].slope)),
            Field("least_principal_distance_mm", "mm 1", "f", "least, mm", of=lambda name: suited[name].least_focal),
            Field("suits", head="takes it", of=lambda name: suited[name].suits),
        ),
        suited if asked else (),
        note="least f: of a camera with this format and base",
    )


def displacement_sheet(name: str, spec: DisplacementSpec) -> Sheet:
    """Return the plan of a survey of displacements, a row for each distance and place."""
    width, height = spec.camera.format or (np.nan, np.nan)
    turned = float(np.degrees(spec.convergence))
    inwards = f", each camera turned inwards by {turned:.4g}°" if turned else ""
    stations = "one, distances known" if spec.base is None else f"two, base {spec.base:.4g} m{inwards}"
    focal = spec.camera.principal_distance
    distances = np.repeat(spec.distances, len(PLACES)).tolist()
    facts = [
        Fact("name", name),
        Fact(
            "camera",
            {"name": spec.camera.name, "principal_distance_mm": focal, "format_mm": [width, height]},
            text=f"{spec.camera.name}, f {focal:.9g} mm, {width:.4g} × {height:.4g} mm",
        ),
        Fact("stations", 1 if spec.base is None else 2, text=stations),
        Fact("base_m", spec.base),
        Fact("convergence_deg", round(turned, 6)),
        Fact(
            "change_sigma_um",
            spec.sigma * MICROMETRES,
            "um 1",
            f"{spec.sigma * MICROMETRES:.1f} µm for a change of an image coordinate",
            "measuring",
        ),
        Fact(
            "power",
            spec.power,
            text=f"finds a displacement in {100 * spec.power:g} % of cases, and calls {100 * spec.significance:g} % of"
            " the points at rest moved",
            label="test",
        ),
        Fact("significance", spec.significance),
    ]
    axes = "right ahead up"
    points = Rows(
        "points",
        "Displacements between two epochs",
        (
            Field("distance_m", "m g4", "distance"),
            Field("place"),
            Field("x_m", "m 1", "x", rank=1),
            Field("y_m", "m 1", shown=False),
            Field("z_m", "m 1", "z", rank=1),
            *(Field(f"sigma_{axis}_m", "m 4", f"± {head}") for axis, head in zip("xyz", axes.split(), strict=True)),
            *fields("found_x_m found_y_m found_z_m worst_found_m", "m 4", f"{axes} worst", "found, m"),
        ),
        [
            (distance, each.place, *each.at, *each.sigma, *each.found, each.worst)
            for distance, each in zip(distances, plan_displacements(spec), strict=True)
        ],
        note="side, top: the outermost points that the photos show; found: the smallest displacement in that direction",
    )
    return Sheet("displacement", "Expected accuracy of displacements", facts, [points])


def screening_sheet(name: str, outcome: ScreeningOutcome) -> Sheet:
    """Return an experiment: detection by method, zone and size, and what an undetected error does to the elements."""
    spec, layout = outcome.spec, outcome.spec.layout
    sigma, errors, sizes = layout.parallax_sigma * MICROMETRES, spec.models + spec.second, sorted(set(spec.sizes))
    within = f"up to {layout.scatter:.4g} mm from their middles, {layout.width:.4g} mm off the base"
    facts = [
        Fact("name", name),
        Fact("models", spec.models),
        Fact(
            "repetitions",
            spec.repetitions,
            text=f"{spec.repetitions} times {spec.models}, f {layout.focal:.4g} mm, b {layout.base:.4g} mm",
            label="pairs",
        ),
        Fact(
            "layout",
            {
                "principal_distance_mm": layout.focal,
                "base_mm": layout.base,
                "width_mm": layout.width,
                "zone_points": list(layout.counts),
                "zone_reach_mm": layout.scatter,
            },
            text=f"{sum(layout.counts)}: {', '.join(map(str, layout.counts))} in the zones 1 to 6, {within}",
            label="points",
        ),
        Fact("parallax_sigma_um", sigma, "um 1", f"{sigma:.1f} µm for a y parallax", "measuring"),
        Fact("errors", errors, text=f"{errors} of a y parallax in {spec.models} pairs, two in some"),
        Fact("parallax_limit_um", round(spec.parallax_limit * MICROMETRES, 3)),
        Fact("grubbs_alpha", spec.grubbs_alpha),
    ]
    limit = f"limit {spec.parallax_limit * MICROMETRES:.4g} µm, {100 * spec.grubbs_alpha:g} %"
    methods = listed(
        "methods",
        "Methods",
        (
            Field("method"),
            Field("parallax_percent", "percent 1", "by parallax", of=lambda method: 100 * method.parallax),
            Field("later_percent", "percent 1", "by later tests", of=lambda method: 100 * method.later),
            Field("missed_percent", "percent 1", "missed", of=lambda method: 100 * method.missed),
            Field("beside_percent", "percent 1", "beside", "good lost, %", of=lambda method: 100 * method.beside),
            Field("instead_percent", "percent 1", "instead", "good lost, %", of=lambda method: 100 * method.instead),
            Field("mean_change_arcmin", "arcmin 1", "change", "mean, ′", of=lambda at: at.mean_change * ARC_MINUTES),
            Field("worst_change_arcmin", "arcmin 1", "change", "worst, ′", of=lambda at: at.worst_change * ARC_MINUTES),
        ),
        outcome.methods,
        note=f"in % of the errors; good points are lost beside wrong ones that are found, or instead of one that stays;"
        f" parallax+grubbs: {limit}; change: largest of the elements in pairs that kept an error",
    )
    detection = Rows(
        "detection",
        "",
        hidden("method", "zone", "size_um", "errors", "by_parallax", "found", "found_percent"),
        [
            (
                each.method,
                found.zone,
                round(found.size * MICROMETRES, 3),
                found.errors,
                found.by_parallax,
                found.found,
                round(100 * found.found / found.errors, 2) if found.errors else None,
            )
            for each in outcome.methods
            for found in each.detection
        ],
    )
    tables = [methods, detection, _shares(outcome, "zone"), _shares(outcome, "size"), _effects(outcome, sizes)]
    return Sheet(
        "screening", "Gross errors in relative orientation: what is found, and what is not", facts, tables, "detection"
    )


def _shares(outcome: ScreeningOutcome, key: str) -> Rows:
    """Print the shares that each method finds, by zone or by size; of the first test of the textbook its own, too."""
    factor, head = (1, "zone") if key == "zone" else (MICROMETRES, "size, µm")
    early = [each for each in outcome.methods if each.method == "parallax+grubbs"]
    counted_by = [(each, "by_parallax") for each in early] + [(each, "found") for each in outcome.methods]
    heads = [("parallax", "alone")] * len(early) + [(each.method, "") for each in outcome.methods]
    rows = []
    for value in dict.fromkeys(getattr(each, key) for each in outcome.methods[0].detection):
        errors = sum(each.errors for each in outcome.methods[0].detection if getattr(each, key) == value)
        shares = [
            100 * sum(getattr(each, name) for each in method.detection if getattr(each, key) == value) / errors
            if errors
            else None
            for method, name in counted_by
        ]
        rows.append((value * factor, errors, *shares))
    columns = (Field(f"{name}_{below}_percent".replace("__", "_"), "percent 1", name, below) for name, below in heads)
    title = f"Found, % of the errors of a {key}"
    first = Field("zone" if key == "zone" else "size_um", "ratio g4", head)
    return Rows(f"by_{key}", title, (first, Field("errors", "count"), *columns), rows)


def _effects(outcome: ScreeningOutcome, sizes: Sequence[float]) -> Rows:
    """Give the change of the elements by one undetected error: the worst by size, every one at the largest."""
    heads = dict(zip(ELEMENTS, ("α1′", "κ1′", "α2′", "ω2′", "κ2′"), strict=True))
    shown = f"{sizes[-1] * MICROMETRES:g} µm"
    return Rows(
        "effects",
        "What one undetected error does to the elements, minutes of arc",
        (
            Field("zone", "count"),
            *(
                Field(f"largest_{size * MICROMETRES:g}_um_arcmin", "arcmin 1", "largest", f"{size * MICROMETRES:g} µm")
                for size in sizes
            ),
            *(Field(f"{name}_arcmin", "arcmin 1", heads[name], shown) for name in ELEMENTS),
        ),
        [
            (
                each.zone,
                *(each.largest * size * ARC_MINUTES for size in sizes),
                *(value * sizes[-1] * ARC_MINUTES for value in each.elements),
            )
            for each in outcome.effects
        ],
        note="root mean squares over the pairs; largest: of the five elements of a pair",
    )
