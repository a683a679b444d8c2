"""Single steps of the method as sections, and their points as a table."""

from __future__ import annotations

from functools import partial

from photostrip.notes import Document
from photostrip.report.page.numbers import fixed, power, short
from photostrip.report.page.parts import DASH, Facts, Part, Section, Words
from photostrip.report.page.tables import Shown, number, tabulated, words

TITLES = {
    "interior": "Interior orientation",
    "refine": "Refined image coordinates",
    "relative": "Relative orientation",
    "intersection": "Space intersection",
    "chain": "Orientation handed on along a strip",
    "scale": "Scale transfer",
    "strip": "Strip in model coordinates",
    "absolute": "Absolute orientation",
    "polynomial": "Polynomial",
    "resection": "Space resection",
    "bundle": "Bundle adjustment",
}


def step_report(document: Document) -> tuple[str, tuple[Section, ...]]:
    parts: list[Part] = []
    if document["values"]:
        parts.append(Facts(tuple((each["name"], _written(each)) for each in document["values"])))
    columns = [words(document["of"], lambda row: row[0])]
    columns += [
        number(each["name"], partial(_cell, place), each["decimals"], each["unit"])
        for place, each in enumerate(document["columns"], 1)
    ]
    if "photos" in document:
        unit = document["columns"][0]["unit"]
        parts.append(tabulated(document["photos"], _photos(unit)))
    sections = [Section("", (*parts, tabulated(document["points"], columns)))]
    sections += [_traced(each) for each in document.get("trace", ())]
    return TITLES[document["step"]], tuple(sections)


def _photos(unit: str) -> list[Shown]:
    """Return the columns of the photos of a strip."""
    columns = [words("photo", lambda row: row[0])]
    columns += [number(axis, partial(_cell, place), 4, unit) for place, axis in enumerate("xyz", 1)]
    turns = ("omega", "phi", "kappa")
    return [*columns, *(number(name, partial(_cell, place), 6, "deg") for place, name in enumerate(turns, 4))]


def _traced(table: Document) -> Section:
    """Show a table of the trace: what is exact to decimals or, where these are negative, to digits."""
    columns = [words("", lambda row: row[0])]
    for place, each in enumerate(table["columns"], 1):
        decimals = each["decimals"]
        form = decimals if decimals >= 0 else partial(power, digits=-1 - decimals)
        columns.append(number(each["name"], partial(_cell, place), form, each["unit"]))
    equations: list[Part] = [Words(each) for each in table["equations"]]
    return Section(table["title"], (*equations, tabulated(table["rows"], columns)))


def _cell(place: int, row: list[float]) -> float:
    return row[place]


def _written(value: Document) -> str:
    if value["value"] is None:
        return DASH
    if "digits" in value:
        return short(value["value"], value["digits"])
    digits = 6 if value["unit"] == "deg" else 4
    text = str(value["value"]) if isinstance(value["value"], int) else _digits(value["value"], digits)
    sigma = "" if value["sigma"] is None else f" ± {_digits(value['sigma'], digits)}"
    return f"{text}{sigma} {value['unit']}".rstrip()


def _digits(value: float, decimals: int) -> str:
    """Return a number with decimals, or with digits where decimals would show nothing of it."""
    return fixed(value, decimals) if abs(value) >= 10.0 ** (2 - decimals) else f"{value:.4g}"
