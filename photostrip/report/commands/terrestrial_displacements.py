"""Reports of displacements: from their document to sections of sentences, facts and tables."""

from __future__ import annotations

from collections.abc import Iterator

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import fixed, metres, micrometres, short, signed
from photostrip.report.page.parts import DASH, Column, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words

VERDICTS = {True: "moved", False: "", None: "not tested"}


def displacement_report(document: Document) -> tuple[str, tuple[Section, ...]]:
    """Return the report of displacements: verdict and set-up, the cameras, each epoch, rates, notes."""
    sections = [_overview(document)]
    if any(row["determined"] for row in document["cameras"]):
        sections.append(_camera_section(document))
    for epoch in range(1, len(document["epochs"])):
        sections += _epoch_sections(document, epoch)
    if any("rate" in point for point in document["points"]):
        sections.append(_rates(document))
    if document["notes"]:
        sections.append(_notes(document))
    return f"Displacements: {document['name']}", tuple(sections)


def one_station_report(document: Document) -> tuple[str, tuple[Section, ...]]:
    angles, camera, turn = document["orientation"], document["camera"], document["turn"]
    looking = ", ".join(f"{name} {fixed(angles[name], 4)}" for name in ("alpha", "omega", "kappa"))
    facts = [
        ("camera", f"{camera['name']}, f {short(camera['principal_distance_mm'], 9)} mm"),
        ("orientation", f"{looking} {angles['unit']}"),
    ]
    if turn is not None:
        names = (("right", "right"), ("up", "up"), ("ccw", "counter_clockwise"))
        text = ", ".join(
            f"{fixed(turn[f'{name}_arcsec'], 1)} ± {fixed(turn[f'sigma_{name}_arcsec'], 1)}″ {way}"
            for way, name in names
        )
        facts.append(("camera turned", f"{text}; taken out"))
    table = tabulated(
        document["points"],
        (
            words("point", "id"),
            number("d east", "dx", signed, "m"),
            number("d north", "dy", signed, "m"),
            number("d up", "dz", signed, "m"),
            number("±", "sigma_x", 3, "m"),
            number("±", "sigma_y", 3, "m"),
            number("±", "sigma_z", 3, "m"),
            number("length", "length", 3, "m"),
            number("test", "statistic", 1),
            number("limit", "limit", 1, rank=1),
            words("", lambda point: "stable" if point["stable"] else VERDICTS[point["significant"]]),
            words("seen", lambda point: "in space" if point["components"] == 3 else "across the ray"),
        ),
        note="test: chi-square of what is seen; axes are right, ahead, up of the camera where alpha is 0",
    )
    return "Displacements from one station", (Section("", (Facts(tuple(facts)),)), Section("Displacements", (table,)))


def _overview(document: Document) -> Section:
    summary, settings = document["summary"], document["settings"]
    left, right = (station["camera"] for station in document["stations"])
    cameras = [f"{each['name']} (f {short(each['principal_distance_mm'], 9)} mm)" for each in (left, right)]
    epochs = [epoch["id"] for epoch in document["epochs"]]
    verdict = (
        f"{counted(summary['significant'], 'point')} of {summary['determined'] - _stable_determined(document)} moved"
        f" between {epochs[0]} and {epochs[-1]} by more than chance allows ({short(100 * settings['significance'])} %"
        " level)."
    )
    facts = [
        ("cameras", cameras[0] if left == right else " and ".join(cameras)),
        ("base", f"{metres(document['base'])} m"),
        ("axes", ", ".join(document["frame"]["axes"])),
        ("epochs", ", ".join(epochs)),
        ("points", f"{summary['points']}, {summary['stable']} of them stable"),
        ("vertical parallaxes, rms", _parallaxes(document)),
        ("stable points, scatter", _scatter(summary)),
    ]
    return Section("", (Words(verdict, "look" if summary["significant"] else "good"), Facts(tuple(facts))))


def _stable_determined(document: Document) -> int:
    last = [point for point in document["points"] if point["stable"]]
    return sum("since_first" in point["epochs"][-1] for point in last)


def _parallaxes(document: Document) -> str:
    values = document["summary"]["parallax_rms_um"]
    if all(value is None for value in values):
        return "not measured: the rays were made to meet"
    return ", ".join(micrometres(value) for value in values) + " µm"


def _scatter(summary: Document) -> str:
    if summary["stable_scatter"] is None:
        return DASH
    lower, upper = summary["stable_scatter_range"]
    return (
        f"{fixed(summary['stable_scatter'], 2)} times the stated standard deviations; between {fixed(lower, 2)} and"
        f" {fixed(upper, 2)} is as expected"
    )


def _camera_section(document: Document) -> Section:
    heads = {"right": "right", "up": "up", "counter_clockwise": "ccw"}
    turns = {f"{name}_arcsec": head for name, head in heads.items()}
    sigmas = [f"sigma_{name}" for name in turns]
    columns = (
        words("epoch", "epoch"),
        words("camera", "side"),
        *(number(head, name, 1, "″") for name, head in turns.items()),
        *(number("±", name, 1, "″") for name in sigmas),
        number("points", "stable_points"),
        number("test", "statistic", 1),
        number("limit", "limit", 1),
        words("", _camera_verdict),
    )
    nothing = {**dict.fromkeys((*turns, *sigmas, "statistic", "limit")), "stable_points": DASH}
    note = "Turns against the first epoch in the camera's own axes; ccw: counter-clockwise for the photographer."
    return Section("Cameras", (tabulated([nothing | row for row in document["cameras"]], columns, note=note),))


def _camera_verdict(row: Document) -> str:
    if not row["determined"]:
        return "not determined"
    return f"{'turned' if row['turned'] else 'not significant'}, {'taken out' if row['removed'] else 'left in'}"


def _epoch_sections(document: Document, epoch: int) -> Iterator[Section]:
    """Tables of one epoch: since the first epoch, and since the one before."""
    epochs = [epoch["id"] for epoch in document["epochs"]]
    yield Section(f"{epochs[0]} to {epochs[epoch]}", (_steps(document, epoch, "since_first"),))
    if epoch > 1:
        yield Section(f"{epochs[epoch - 1]} to {epochs[epoch]}", (_steps(document, epoch, "since_previous"),))


def _steps(document: Document, epoch: int, key: str) -> Table:
    axes = document["frame"]["axes"]
    columns = (
        Column("point", left=True),
        *(Column(f"d {axis}", "m") for axis in axes),
        *(Column("±", "m") for _ in axes),
        Column("length", "m"),
        Column("ellipse", "m", rank=1),
        Column("azimuth", "deg", rank=1),
        Column("test"),
        Column("", left=True),
    )
    rows = []
    for point in document["points"]:
        entry = point["epochs"][epoch]
        step = entry.get(key)
        if step is None:
            rows.append((point["id"], *[DASH] * (len(columns) - 2), entry.get("reason", "")))
            continue
        ellipse = step["ellipse"]
        axes_of_ellipse = f"{metres(ellipse['major'])} × {metres(ellipse['minor'])}"
        rows.append(
            (
                point["id"],
                *(signed(step[f"d{axis}"]) for axis in "xyz"),
                *(metres(step[f"sigma_{axis}"]) for axis in "xyz"),
                metres(step["length"]),
                axes_of_ellipse if ellipse["major"] is not None else DASH,
                fixed(ellipse["azimuth_deg"], 0),
                fixed(step["statistic"], 1),
                ", ".join(filter(None, ("stable" if point["stable"] else "", VERDICTS[step["significant"]]))),
            )
        )
    settings = document["settings"]
    note = (
        f"Test: d' C⁻¹ d, limit {fixed(settings['limit'], 2)}; ± standard deviations; ellipse in plan,"
        f" {short(100 * (1 - settings['significance']))} %, azimuth of its major axis."
    )
    return Table(columns, tuple(rows), note=note)


def _rates(document: Document) -> Section:
    """Table of uniform motions."""
    unit = document["units"]["rate"].replace("metres", "m").replace(" per ", "/")
    axes = document["frame"]["axes"]
    columns = (
        words("point", "id"),
        *(
            number(f"v {name}", f"rate.d{axis}", "{:+z.4f}".format, unit)
            for axis, name in zip("xyz", axes, strict=True)
        ),
        *(number("±", f"rate.sigma_{axis}", 4, unit) for axis in "xyz"),
        number("speed", "rate.length", 4, unit),
        number("test", "rate.statistic", 1),
        number("misfit", "rate.misfit", 1),
        number("limit", "rate.misfit_limit", 1),
        words("", _motion),
    )
    moving = [point for point in document["points"] if point.get("rate") is not None]
    note = "Misfit: what a uniform motion leaves, chi-square; above its limit the motion is not uniform."
    return Section("Rates", (tabulated(moving, columns, note=note),))


def _motion(point: Document) -> str:
    rate = point["rate"]
    return ", ".join(filter(None, (VERDICTS[rate["significant"]], "not uniform" if rate["uniform"] is False else "")))


def _notes(document: Document) -> Section:
    parts: list[Part] = [
        Words(f"{note['severity']}: {note['message']}", "look" if note["severity"] == "warning" else "", "-")
        for note in document["notes"]
    ]
    return Section("Notes", tuple(parts))
