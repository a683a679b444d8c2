"""A result against the truth of its simulation, as sections."""

from __future__ import annotations

from collections.abc import Callable

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import micrometres, ratio
from photostrip.report.page.parts import DASH, Part, Section, Words
from photostrip.report.page.tables import Shown, number, tabulated, words

SHOWN = 20  # errors that were not found; --verbose prints all


def truth_sections(document: Document, *, everything: bool = False) -> tuple[Section, ...]:
    photos = {"role": "photos", **{key: document["photos"][key] for key in ("count", "plan", "height")}}
    columns = [
        words("true errors of", "role"),
        number("", "count"),
        *(each for part in ("plan", "height") for each in _columns(part)),
    ]
    turned = document["photos"]["rotation"]
    parts: list[Part] = [
        Words(truth_headline(document)),
        tabulated([*document["points"], photos], columns, note="e/σ: rms of the errors over their standard deviations"),
    ]
    if turned["rms"] is not None:
        worst = f"largest {turned['max']:.4f} deg, photo {turned['worst']}"
        parts.append(Words(f"Orientation of the photos: rms {turned['rms']:.4f} deg, {worst}."))
    missed = document["errors"]["missed"]
    shown = missed if everything else missed[:SHOWN]
    parts += [Words(_missed(each), mark="-") for each in shown]
    if len(missed) > len(shown):
        parts.append(Words(f"and {len(missed) - len(shown)} more"))
    return (Section("", tuple(parts)),)


def truth_headline(document: Document) -> str:
    """Say in one sentence what came of the gross errors that were put in."""
    errors = document["errors"]
    planted, missed = errors["planted"], len(errors["missed"])
    found = f"{planted - missed} of {counted(planted, 'gross error')} found" if planted else "no gross errors put in"
    sound = counted(errors["sound_rejected"], "sound measurement")
    return f"{document['name']} against its truth: {found}, {sound} rejected."


def _columns(part: str) -> list[Shown]:
    return [
        number(part, f"{part}.rms", 3, "m"),
        number("largest", f"{part}.max", 3, "m"),
        words("at", f"{part}.worst", rank=1),
        number("e/σ", _of(part, lambda found: ratio(found["normalised"])), str),
        number("in 95 %", _of(part, lambda found: f"{found['inside']} of {found['known']}"), str, rank=1),
    ]


def _of(part: str, write: Callable[[Document], str]) -> Callable[[Document], str]:
    """Return what writes how errors agree with their standard deviations, where these are known."""
    return lambda row: write(row[part]) if "normalised" in row[part] else DASH


def _missed(error: Document) -> str:
    """Say which gross error was not found."""
    size = f"{micrometres(error['size_um'])} µm" if error["size_um"] is not None else ""
    size = size or (f"{error['size_m']:.3f} m" if error["size_m"] is not None else "")
    point = f"points {error['point']} and {error['other']}" if error["other"] else f"point {error['point']}"
    where = f"photo {error['photo']}, {point}" if error["photo"] else point
    axis = f" in {error['axis']}" if error["axis"] else ""
    return f"not found: {error['kind']}, {where}{axis}{f', {size}' if size else ''}"
