"""Along the strips: what is left at given points, precision, check points, y parallaxes by the six zones of a pair."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from photostrip.notes import Document, counted
from photostrip.report.page.tables import short
from photostrip.report.pictures.chart import (
    MOST_NAMED,
    Areas,
    Floats,
    Layer,
    Line,
    Marks,
    Names,
    Panel,
    Segments,
    box,
    chart,
    nice,
    span,
)
from photostrip.report.pictures.places import Course, Plan, numbers, shortened
from photostrip.report.pictures.plan import ROLES
from photostrip.report.pictures.svg import Picture

MOST_STRIPS = 8  # that have panels
AXES = ("along", "x"), ("across", "y"), ("up", "z")  # of a strip, and of its polynomials
LEAST_KM = 2.0
CURVE_STEPS = 48
CUT = 10.0  # medians, at which differences stand at the ends of their axis


def worst_strips(sizes: Mapping[str, float]) -> list[str]:
    """Return the strips that are drawn, in their order: all, or those with the largest sizes."""
    worst = sorted(sizes, key=lambda strip: -sizes[strip])[:MOST_STRIPS]
    return [strip for strip in sizes if strip in worst]


def deformation_pictures(plan: Plan) -> list[Picture]:
    """Draw differences at given points along each strip; nothing without given points."""
    document = plan.document
    held = {row["id"]: row["strips"] for row in document["control"] if row["measured"]}
    after = {
        strip: [
            n
            for n in np.flatnonzero(np.isfinite(plan.shift).any(axis=1)).tolist()
            if not strip or strip in held.get(plan.ids[n], ())
        ]
        for strip, photos in plan.strips.items()
        if photos and (not strip or any(each["id"] == strip for each in document["strips"]))
    }
    before = {strip: [row for row in document.get("misclosures", []) if row["strip"] == strip] for strip in after}
    sizes = {
        strip: float(np.nanmax(np.abs(plan.shift[rows]), initial=0.0))
        for strip, rows in after.items()
        if rows or before[strip]
    }
    if not sizes:
        return []
    shown = worst_strips(sizes)
    panels = [panel for strip in shown for panel in _panels(plan, strip, after[strip], before[strip])]
    caption = "Differences at given points along each strip, along it, across it and in height: adjusted minus given"
    if any(before.values()):
        caption += "; circles: strip minus given after the similarity alone"
    if any(isinstance(layer, Line) for panel in panels for layer in panel.layers):
        caption += "; the line: what the polynomial takes out, on the axis of the strip"
    marks = [(panel.y, layer.at[:, 1]) for panel in panels for layer in panel.layers if isinstance(layer, Marks)]
    beyond = sum(int(((at < y[0]) | (at > y[1])).sum()) for y, at in marks if y)
    if beyond:
        caption += f"; {counted(beyond, 'difference')} beyond {CUT:.0f} times the median at the ends of their axes"
    if len(shown) < len(sizes):
        caption += f". {len(shown)} of {len(sizes)} strips, those with the largest differences"
    words = counted(len(shown), "strip")
    rows = [n for strip in shown for n in after[strip]]
    if rows:
        n, axis = divmod(int(np.nanargmax(np.abs(plan.shift[rows]))), 3)
        words += f"; the largest difference is {abs(plan.shift[rows[n]][axis]):.3f} m at {plan.ids[rows[n]]}"
    title = "Differences at given points" + (", before and after" if any(before.values()) else "")
    height = 150.0 if len(shown) > 1 else 230.0
    return [chart("deformation", (title, f"{caption}.", f"{words}."), panels, columns=3, height=height)]


def _panels(plan: Plan, strip: str, after: Sequence[int], before: Sequence[Document]) -> list[Panel]:
    course = plan.course(strip)
    ends = course.along(plan.photos[plan.strips[strip]][[0, -1]])
    of_km, unit = _unit(float(np.ptp(ends)))
    at, shift = of_km * course.along(plan.points[after]), course.turned(plan.shift[after])
    earlier = [row for row in before if row["id"] in plan.row]
    earlier_at = of_km * course.along(plan.points[plan.rows(row["id"] for row in earlier)])
    to_plan = Course(np.zeros(2), plan.north[::-1])  # of east, north and up
    missed = course.turned(to_plan.turned(numbers(earlier, "east", "north", "up")))
    ends = of_km * ends
    reach = span(np.concatenate([ends, at, earlier_at]), zero=False, room=0.02)
    block = next((row for row in plan.document.get("polynomials", []) if row["strip"] == strip), None)
    terms = list(plan.document["polynomial_terms"].where(strip=strip)) if block else []
    taken = plan.document["adjustment"] == "polynomial"
    panels = []
    for number, (axis, key) in enumerate(AXES):
        layers: list[Layer] = []
        of_axis = [row for row in terms if row["axis"] == key]
        if block and of_axis and earlier:
            places = np.linspace(min(*ends, *earlier_at), max(*ends, *earlier_at), CURVE_STEPS)
            metres = 1000.0 / of_km
            start = float(block["reach_from"]) - metres * float(earlier_at.min())  # X of the first photo
            curve = np.column_stack([places, -polynomial(of_axis, metres * places + start)])
            layers.append(Line(curve, "c2", "polynomial" if taken else "polynomial, not taken"))
        hints = [f"{row['id']} before: {size:+.3f} m" for row, size in zip(earlier, missed[:, number], strict=True)]
        at_before = np.column_stack([earlier_at, missed[:, number]])
        layers.append(Marks(at_before, "soft open", "dot", hints, "control before", 7.0))
        for role, (words, shape, _) in ROLES.items():
            own = [n for n, row in enumerate(after) if plan.role[row] == role]
            if own:
                places = np.column_stack([at[own], shift[own, number]])
                hints = [f"{words} {plan.ids[after[n]]}: {shift[n, number]:+.3f} m" for n in own]
                layers.append(Segments(places * (1.0, 0.0), places, f"{role} thin"))
                layers.append(Marks(places, role, shape, hints, words, 4.0))
        ranges = [layer.at[:, 1] for layer in layers if isinstance(layer, Line)]
        ranges += [_held(part) for part in (missed[:, number], shift[:, number])]
        title = f"strip {strip}, {axis}" if len(plan.document["strips"]) > 1 else axis
        labels = f"{unit} along the strip" if strip else f"{unit} from the first photo", "m"
        panels.append(Panel(layers, title, labels, x=reach, y=span(np.concatenate(ranges))))
    return panels


def _held(values: Floats) -> Floats:
    """Cut off what is many times as large as most, so that one gross error leaves the others their size."""
    sizes = np.abs(values[np.isfinite(values)])
    most = CUT * float(np.median(sizes)) if len(sizes) else 0.0
    return np.clip(values, -most, most)


def _unit(reach: float) -> tuple[float, str]:
    """Return what a kilometre has of the unit of an axis, and its name; a reach of 2 km and more is told in km."""
    return (1.0, "km") if reach >= LEAST_KM else (1000.0, "m")


def polynomial(terms: Sequence[Document], x: Floats) -> Floats:
    """Return a polynomial on the axis of the strip, where terms with Y vanish."""
    total = np.zeros_like(x)
    for row in terms:
        power = re.fullmatch(r"(?:1|X(?:\^(\d))?)", row["term"])
        if power:
            total += row["coefficient"] * x ** (0 if row["term"] == "1" else int(power[1] or 1))
    return total


CURVES = (
    ("plan", "points, plan", "c1"),
    ("height", "points, height", "c2"),
    ("centre_plan", "perspective centres, plan", "c3 dashed"),
    ("centre_height", "perspective centres, height", "c4 dotted"),
)


def precision_pictures(document: Document) -> list[Picture]:
    """Draw the standard deviations of points and perspective centres along every strip."""
    rows: list[Document] = document.get("precision", {}).get("along") or []
    if not rows:
        return []
    by_strip: dict[str, list[Document]] = {}
    for row in rows:
        by_strip.setdefault(row["strip"], []).append(row)
    keys = [key for key, *_ in CURVES]
    sizes = {strip: float(np.nanmax(numbers(own, *keys), initial=0.0)) for strip, own in by_strip.items()}
    shown, high = worst_strips(sizes), span(list(sizes.values()))
    panels = []
    for strip in shown:
        at = numbers(by_strip[strip], "distance") / 1000.0
        of_km, unit = _unit(float(np.nanmax(at, initial=0.0)))
        layers = [
            Line(np.hstack([of_km * at, numbers(by_strip[strip], key)]), kind, words) for key, words, kind in CURVES
        ]
        title = f"strip {strip}" if len(sizes) > 1 else ""
        panels.append(Panel(layers, title, (f"{unit} along the strip", "m"), y=high))
    caption = (
        "Standard deviations along each strip, mean of the points near each photo: they are smallest where the control"
        " stands."
    )
    if len(shown) < len(sizes):
        caption += f" {len(shown)} of {len(sizes)} strips, those with the largest of them."
    points = document["precision"]["points"]
    worst = [f"{name} {short(points[name]['max'], 3)} m at {points[name]['worst']}" for name in ("plan", "height")
             if points[name]["max"] is not None]  # fmt: skip
    words = "Precision along the strip", caption, "; ".join(worst) or "Not known."
    return [chart("precision", words, panels, columns=min(2, len(shown)), height=210.0 if len(shown) == 1 else 140.0)]


WORST_NAMED = 15  # check points that have their names where they crowd
LIMITS = {"plan": 2.448, "height": 1.960}  # 95 % of a length in plan by its covariance, and of a height


def check_pictures(document: Document) -> list[Picture]:
    """Draw check points over their standard deviations; nothing where these are not known."""
    rows: list[Document] = document.get("precision", {}).get("check", {}).get("points") or []
    caption = (
        "Differences at check points over their standard deviations: in plan the length in the metric of the "
        "covariance, in height with its sign. 95 % lie inside the band when these standard deviations are right."
    )
    words = "Check points against their precision", caption
    return _over_their_sigma("check", words, "check point", [row["id"] for row in rows], numbers(rows, *LIMITS))


def position_pictures(document: Document) -> list[Picture]:
    """Draw what is left at camera positions over its standard deviations, photo by photo; nothing without any."""
    rows: list[Document] = document.get("positions") or []
    east, north, up = numbers(rows, *(f"normalised_{axis}" for axis in ("east", "north", "up"))).T
    caption = (
        "Differences at camera positions over their standard deviations, photo by photo: in plan both together, in "
        "height with its sign; offset and drift are taken off. 95 % lie inside the band. "
    )
    words, sizes = ("Camera positions against their precision", caption), np.column_stack([np.hypot(east, north), up])
    return _over_their_sigma("positions", words, "photo", [row["photo"] for row in rows], sizes)


def _over_their_sigma(
    name: str, said: tuple[str, str], what: str, names: Sequence[str], sizes: Floats
) -> list[Picture]:
    """Draw differences in plan and in height (n, 2) over their standard deviations, with the limits of 95 %."""
    if not np.isfinite(sizes).any():
        return []
    ids, ends, panels = np.array(names), (0.0, len(names) + 1.0), []
    called, left_out = shortened(names) if what == "photo" else (dict(zip(names, names, strict=True)), "")
    for (part, limit), size in zip(LIMITS.items(), sizes.T, strict=True):
        at = np.column_stack([np.arange(1, len(ids) + 1), size])
        worst = np.argsort(-np.abs(np.nan_to_num(size)), kind="stable")
        sides = np.array([[limit], [-limit if part == "height" else limit]])
        band = box(ends, (-limit if part == "height" else 0.0, limit))
        left, right = (np.hstack([np.full_like(sides, end), sides]) for end in ends)
        layers: list[Layer] = [Areas([band], "area c1")]
        layers.append(Segments(left, right, "failed dashed", words="limit of 95 %"))
        layers.append(Segments(at * (1.0, 0.0), at, "check thin"))
        hints = np.array([f"{what} {one}: {each:+.2f}" for one, each in zip(ids, size, strict=True)])
        outside = np.abs(size) > limit
        looks = (~outside, "check", "square", "inside"), (outside, "failed open", "diamond", "outside")
        layers += [Marks(at[own], kind, shape, hints[own].tolist(), words, 4.0) for own, kind, shape, words in looks]
        known = [n for n in worst if np.isfinite(size[n])]
        named = known[: max(int(outside.sum()), WORST_NAMED if len(ids) > MOST_NAMED else len(ids))]
        layers.append(Names(at[named], [called[names[n]] for n in named]))
        panels.append(Panel(layers, part, (f"{what}s in their order", "d/σ"), x=ends, names=[""] * len(ids)))
    beyond = int((np.abs(sizes) > list(LIMITS.values())).any(axis=1).sum())
    words = f"{counted(len(ids), what)}, {beyond} outside the limits in plan or height."
    return [chart(name, (said[0], said[1].rstrip() + left_out, words), panels)]


# as the zones lie in the left photo, by rows: 3 and 4 on top, 1 and 2 on the base, 5 and 6 below
ZONES = {3: "top left", 4: "top right", 1: "left centre", 2: "right centre", 5: "bottom left", 6: "bottom right"}
MOST_POINTS = 2400  # of all zones that are drawn one by one
SHARE_ON_AXIS = 0.995  # share of the parallaxes that the axis holds; those beyond stand at its end


def _hint(ray: Document, right: str, size: float) -> str:
    return f"point {ray['point']} of {ray['photo']} – {right}: {size:+.1f} µm"


def parallax_pictures(document: Document) -> list[Picture]:
    """Draw the y parallaxes; nothing where none are known."""
    pairs = list(document["models"])
    pair_of = {pair["left"]: (n, pair["right"]) for n, pair in enumerate(pairs, 1)}
    left_out = document["rejected"].where(stage="relative", readmitted=False)
    rows = [
        (pair_of[ray["photo"]][0], ray["zone"], size, key == "q_um", _hint(ray, pair_of[ray["photo"]][1], size))
        for rays, key in ((document["residuals"], "q_um"), (left_out, "parallax_um"))
        for ray in rays
        if (size := ray[key]) is not None and ray["zone"] in ZONES and ray["photo"] in pair_of
    ]
    if not rows:
        return []
    number, zones, size, used = (np.array(column) for column in list(zip(*rows, strict=True))[:4])
    used, hints, strips = used.astype(bool), [row[4] for row in rows], [pair["strip"] for pair in pairs]
    tested = np.abs(size[used] if used.any() else size)
    limit = 1.05 * nice(max(float(np.quantile(tested, SHARE_ON_AXIS)), 1e-6))
    borders = np.array([(n + 0.5, limit) for n in range(1, len(pairs)) if strips[n] != strips[n - 1]]).reshape(-1, 2)
    at = np.column_stack([number, size])
    called, left_out = shortened([photo["id"] for photo in document["photos"]])
    lefts = [called.get(pair["left"], pair["left"]) for pair in pairs]
    panels = []
    for zone, where in ZONES.items():
        own, out = np.flatnonzero((zones == zone) & used), np.flatnonzero((zones == zone) & ~used)
        layers: list[Layer] = [Segments(borders * (1.0, -1.0), borders, "soft thin dashed")]
        if len(rows) <= MOST_POINTS:
            layers.append(Marks(at[own], "new", "dot", [hints[n] for n in own], "point", 3.3))
        layers.append(Marks(at[out], "failed open", "diamond", [hints[n] for n in out], "left out", 4.0))
        title = f"zone {zone}, {where}"
        if len(own):
            there, of_pair = np.unique(number[own], return_inverse=True)
            means = np.bincount(of_pair, size[own]) / np.bincount(of_pair)
            layers.append(Line(np.column_stack([there, means]), "c1 thin", "mean of the pair"))
            scatter = float(np.std(size[own], ddof=min(1, len(own) - 1)))
            title += f": {size[own].mean():+z.1f} ± {scatter / len(own) ** 0.5:.1f} µm, scatter {scatter:.1f}"
        panels.append(Panel(layers, title, ("left photo of the pair", "µm"), y=(-limit, limit), names=lefts))
    caption = (
        "Residual y parallaxes in the six standard zones, laid out as in the left photo, pair after pair. Above each "
        "zone the mean of all pairs and the scatter of one point: a mean off zero in all pairs alike tells of the "
        "camera, not of the pairs."
    )
    beyond = int((np.abs(size) > limit)[~used | (len(rows) <= MOST_POINTS)].sum())
    if beyond:
        caption += f" At the ends of the axis {counted(beyond, 'parallax', 'parallaxes')} beyond it."
    if len(borders):
        caption += " Upright lines part the strips."
    caption += left_out
    worst = int(np.argmax(np.where(used, np.abs(size), -1.0)))
    words = "y parallaxes by standard zone", caption, f"{counted(len(pairs), 'pair')}; the largest is {hints[worst]}."
    return [chart("parallaxes", words, panels, columns=2, height=130.0)]
