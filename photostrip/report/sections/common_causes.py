"""What many observations share: causes that the search took up, and what was estimated of cameras and positions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import nlargest
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

from photostrip.notes import Document, counted, listed
from photostrip.report.page.numbers import metres, short, signed

Row = tuple[str, str]
AXES = "east", "north", "up"

SENTENCES = {
    "offset": "offset of the camera positions of {of}",
    "drift": "drift of the camera positions of {of}",
    "order of positions": "camera positions {of}",
    "control list": "without {of}",
}
"""How a cause is said; any other is that of a camera or of a photo."""
OF_POSITIONS = {"offset", "drift"}  # each is the other of fewer or more unknowns: no rivals
ORDERS = {
    "reversed": "in reversed order",
    "forwards": "each given to the photo after its own",
    "backwards": "each given to the photo before its own",
    "exchanged": "of two photos exchanged",
}


def taken_up(block: Document, most: int) -> Iterator[Row]:
    """Say in a line for each cause what the project does not state and the adjustment went on with."""
    causes: dict[str, list[Document]] = {}
    for each in block["taken_up"]:
        causes.setdefault(each["cause"], []).append(each)
    for cause, rows in causes.items():
        of = listed(map(_whose, rows), most)
        whose = cause.replace("of a photo", f"of {'photo' if len(rows) == 1 else 'photos'}")
        text = SENTENCES.get(cause, f"{whose} {of}").format(of=of)
        alike = OF_POSITIONS if cause in OF_POSITIONS else set()
        rivals = dict.fromkeys(rival for row in rows for rival in row["rivals"] if rival not in alike)
        others = listed(f"another {rival}" if rival == cause else rival for rival in rivals)
        yield "taken up", f"{text}; {others} would explain it nearly as well" if rivals else text


def _whose(row: Document) -> str:
    if row["cause"] == "control list":
        known = (
            (axis, row[f"shift_{axis}"], row[f"sigma_{axis}"]) for axis in AXES if row[f"shift_{axis}"] is not None
        )
        steps = ", ".join(f"{signed(step)} m {axis} (σ {metres(sigma)})" for axis, step, sigma in known)
        return f"{row['of']}, which lies {steps} beside all else"
    if row["cause"].endswith("photo"):
        return str(row["of"])
    return ORDERS.get(row["of"], row["of"]) if row["cause"] in SENTENCES else f"of camera {row['of']}"


class _Estimated(NamedTuple):
    """A camera, or a group of camera positions, and what was estimated of it."""

    text: str
    size: float  # largest value in units of its standard deviation


def estimated(document: Document, most: int) -> Iterator[Row]:
    """Say in a line for each camera and group of positions what was estimated; of many the most significant."""
    block = document["bundle"]
    pixels = {camera["id"]: camera["pixel_size_mm"] for camera in document["cameras"]}
    found = [*_cameras(block, pixels), *_positions(block["corrections"])]
    for place in sorted(nlargest(most, range(len(found)), key=lambda place: found[place].size)):
        yield "estimated", found[place].text
    if len(found) > most:
        more = counted(len(found) - most, "more camera or group of positions", "more cameras or groups of positions")
        yield "estimated", f"{more}, less significant: --section bundle"
    yield from _hardly_told_apart(block["correlations"], most)


def _hardly_told_apart(rows: Sequence[Document], most: int) -> Iterator[Row]:
    """Name what is common to many observations and what else could stand for it; not two parameters of cameras."""
    shared = ("camera ", "positions ")
    pairs = [
        f"{row['first']} with {row['second']} {row['value']:+.3f}"
        for row in rows
        if any(row[key].startswith(shared) for key in ("first", "second"))
        and not all(row[key].startswith("camera ") for key in ("first", "second"))
    ]
    if pairs:
        yield "highly correlated", listed(pairs, most)


def _cameras(block: Document, pixels: Mapping[str, float | None]) -> Iterator[_Estimated]:
    for camera, group in groupby(block["calibration"], key=itemgetter("camera")):
        own = list(group)
        said = ", ".join(_parameter(each, pixels.get(camera)) for each in own)
        pairs = [(each, *pair) for each in own if (pair := _strongest(block["calibration"], each))]
        if pairs:
            row, other, value = max(pairs, key=lambda pair: abs(pair[2]))
            said += f"; largest correlation {value:+.2f}, {row['parameter'].replace('_', ' ')} with {other}"
        yield _Estimated(f"camera {camera}: {said}", _largest(own, "value", "sigma"))


def _strongest(rows: Sequence[Document], row: Document) -> tuple[str, float] | None:
    """Return which other parameter of a calibration a parameter is most correlated with, and how much."""
    others = [
        (
            each["parameter"].replace("_", " ") + (f" of {each['camera']}" if each["camera"] != row["camera"] else ""),
            value,
        )
        for each, value in zip(rows, row["correlations"], strict=False)
        if (each["camera"], each["parameter"]) != (row["camera"], row["parameter"]) and value is not None
    ]
    return max(others, key=lambda pair: abs(pair[1]), default=None)


def _parameter(row: Document, pixel: float | None) -> str:
    """Say a parameter with its standard deviation, lengths in pixels too, and whether it could be chance."""
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    more = f", {short(row['value'] / pixel, 3)} px" if pixel and row["unit"] == "mm" else ""
    more += "" if row["significant"] else ", not significant"
    name = row["parameter"].replace("_", " ")
    return f"{name} {short(row['value'])}{unit} (σ {short(row['sigma'], 2)}{more})"


def _positions(rows: Sequence[Document]) -> Iterator[_Estimated]:
    for group, corrections in groupby(rows, key=itemgetter("group")):
        own = list(corrections)
        said = []
        for kind, parts in groupby(own, key=itemgetter("kind")):
            steps = ", ".join(f"{signed(r['whole'])} m {r['axis']} (σ {metres(r['whole_sigma'])})" for r in parts)
            said.append(f"from the first to the last {steps} more" if kind == "drift" else steps)
        text = f"camera positions of {group}: added {'; '.join(said)}"
        yield _Estimated(text, _largest(own, "whole", "whole_sigma"))


def _largest(rows: Iterable[Document], value: str, sigma: str) -> float:
    return max(abs(row[value]) / row[sigma] if row[sigma] else float("inf") for row in rows)
