"""What took no part or was given: check points against their standard deviations, camera positions, calibration."""

from __future__ import annotations

import math
from xml.sax.saxutils import escape

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import (
    LEFT,
    WIDTH,
    Entry,
    Layout,
    framed,
    framed_by_photos,
    legend,
    span,
    unnumbered,
)
from photostrip.report.pictures.ground.sheet import ids
from photostrip.report.pictures.svg import Picture

LIMITS = {"plan": 2.448, "height": 1.960}  # 95 % of a length in plan by its covariance, and of a height
CELL = 46.0  # of a correlation matrix
INSIDE = "square", "mark check"
OUTSIDE = Entry("outside", "left-out", "diamond")
LARGE = 0.9  # a correlation that says that two parameters are hard to tell apart
WIDEST_NAME = 150.0  # for the names of the parameters
POSITIONS = ("d_east", "east"), ("d_north", "north"), ("d_up", "up")
SIGMAS = 2.0  # bars of given positions


def check_pictures(document: Document) -> list[Picture]:
    """Draw check points over their standard deviations; nothing where these are not known."""
    rows: list[Document] = document.get("precision", {}).get("check", {}).get("points") or []
    if not any(row[part] is not None for row in rows for part in LIMITS):
        return []
    layout = Layout(columns=1, height=150.0, number=2)
    drawn: list[str] = []
    for place, (part, limit) in enumerate(LIMITS.items()):
        known = [(n, row["id"], row[part]) for n, row in enumerate(rows, 1) if row[part] is not None]
        high = span([*(size for *_, size in known), limit, *([-limit] if part == "height" else [])])
        panel = layout.panel(place, (0.0, len(rows) + 1.0), high)
        sides = (1,) if part == "plan" else (-1, 1)
        band = panel.y(limit), panel.y(-limit if part == "height" else 0.0)
        drawn.append(svg.rectangle((panel.x.start, band[0]), (panel.x.end - panel.x.start, band[1] - band[0]), "band"))
        drawn += framed(unnumbered(panel), ("check points in their order", "z"), part)
        drawn += [
            svg.line((panel.x.start, panel.y(side * limit)), (panel.x.end, panel.y(side * limit)), "limit")
            for side in sides
        ]
        for n, name, size in known:
            drawn.append(svg.line(panel.at(n, 0.0), panel.at(n, size), "stem check"))
            hint = f"check point {name}: {size:+.2f}"
            drawn.append(svg.tested(panel.at(n, size), hint, INSIDE, 4.0, outside=abs(size) > limit))
        worst = sorted(known, key=lambda each: -abs(each[2]))
        places = [(name, panel.at(n, size)) for n, name, size in worst]
        drawn += ids(places, [at for _, at in places], (WIDTH, layout.whole))
    shape, kind = INSIDE
    drawn += legend([Entry("inside", kind, shape), OUTSIDE, Entry("limit of 95 %", "limit")])
    outside = sum(any(abs(row[part] or 0.0) > limit for part, limit in LIMITS.items()) for row in rows)
    caption = (
        "Differences at check points over their standard deviations: in plan the length in the metric of the "
        "covariance, in height with its sign. 95 % lie inside the band when these standard deviations are right."
    )
    words = f"{counted(len(rows), 'check point')}, {outside} outside the limits in plan or height."
    return [svg.picture("check", (WIDTH, layout.whole), drawn, "Check points against their precision", caption, words)]


def position_pictures(document: Document) -> list[Picture]:
    """Draw the differences at measured camera positions, photo by photo."""
    rows: list[Document] = document.get("bundle", {}).get("positions") or []
    if not rows:
        return []
    sizes = [abs(row[key]) for row in rows for key, _ in POSITIONS if row[key] is not None]
    sizes += [SIGMAS * sigma for row in rows for _, name in POSITIONS if (sigma := row[f"sigma_{name}"]) is not None]
    reach = max(sizes, default=1.0) * 1.08
    layout = Layout(columns=1, height=120.0, number=len(POSITIONS))
    drawn: list[str] = []
    single = len(rows) <= WIDTH / 3
    for place, (key, name) in enumerate(POSITIONS):
        panel = layout.panel(place, (0.0, len(rows) + 1.0), (-reach, reach))
        drawn += framed_by_photos(panel, [row["photo"] for row in rows], ("photo", "m"), name)
        for n, row in enumerate(rows, 1):
            size, sigma = row[key], row[f"sigma_{name}"]
            if size is None:
                continue
            if sigma is not None and single:
                drawn.append(svg.line(panel.at(n, -SIGMAS * sigma), panel.at(n, SIGMAS * sigma), "given"))
            hint = f"photo {row['photo']}, {name}: {size:+.3f} m"
            outside = sigma is not None and abs(size) > SIGMAS * sigma
            drawn.append(svg.tested(panel.at(n, size), hint, ("dot", "fill-1"), 5.0, outside=outside))
    drawn += legend(
        [Entry("difference", "fill-1", "dot"), Entry("beyond two standard deviations", "left-out", "diamond")]
        + ([Entry("two given standard deviations", "given")] if single else [])
    )
    caption = "Adjusted minus given camera positions, photo by photo, offset and drift taken off."
    worst = max(rows, key=lambda row: max(abs(row[key] or 0.0) for key, _ in POSITIONS))
    words = f"{counted(len(rows), 'camera position')}; the largest difference is at photo {worst['photo']}."
    return [svg.picture("positions", (WIDTH, layout.whole), drawn, "Camera positions", caption, words)]


def correlation_pictures(document: Document) -> list[Picture]:
    """Draw how far the parameters of a self-calibration are told apart, camera by camera."""
    rows: list[Document] = document.get("bundle", {}).get("calibration") or []
    known = [row for row in rows if row["correlations"]]
    if len(known) <= 1:
        return []
    single = len({row["camera"] for row in known}) == 1
    names = [("" if single else f"{row['camera']}: ") + row["parameter"] for row in known]
    count = len(names)
    cell = min(CELL, (WIDTH - LEFT - WIDEST_NAME - 40.0) / count)
    left, top = LEFT + WIDEST_NAME, 44.0 + WIDEST_NAME * 0.72
    numbered = cell >= CELL * 0.7
    room = cell - 12.0 if numbered else cell
    drawn, largest = [], (0.0, "", "")
    for i, (one, row) in enumerate(zip(names, known, strict=True)):
        x, y = left + (i + 0.5) * cell + 4.0, top + i * cell
        drawn.append(svg.text((left - 8.0, y + cell / 2 + 4.5), one, "", "end"))
        turn = f"rotate(-40 {svg.number(x)} {svg.number(top - 8.0)})"
        drawn.append(svg.element("text", escape(one), kind="label", x=x, y=top - 8.0, transform=turn))
        for j, (other, value) in enumerate(zip(names, row["correlations"], strict=False)):
            corner = left + j * cell, y
            drawn.append(svg.rectangle(corner, (cell, cell), "cell"))
            if value is None:
                continue
            middle = corner[0] + cell / 2
            if i != j:
                place, size = (middle, y + room / 2 + 1.0), 0.48 * room * math.sqrt(abs(value))
                kind = "positive" if value >= 0 else "negative"
                drawn.append(svg.circle(place, size, kind, f"{one}, {other}: {value:+.3f}"))
                largest = max(largest, (abs(value), one, other))
            if numbered:
                words = "1" if i == j else f"{value:+z.2f}"
                drawn.append(svg.text((middle, y + cell - 4.0), words, "id", "middle"))
    drawn += legend([Entry("positive", "positive", "square"), Entry("negative", "negative", "square")])
    caption = (
        "Correlations of the calibration parameters; the area of a circle is their size. Parameters with more than "
        f"{LARGE:g} stand for each other: their values together are better known than each of them."
    )
    strongest = f"{largest[0]:.2f}, of {largest[1]} with {largest[2]}"
    words = f"{counted(count, 'parameter')}; the largest correlation is {strongest}."
    extent = WIDTH, top + count * cell + 24.0
    return [svg.picture("correlations", extent, drawn, "Correlations of the calibration", caption, words)]
