"""Several adjustments of one project side by side: what each leaves at check points and at control."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

from photostrip.errors import PhotostripError
from photostrip.notes import Document, listed
from photostrip.report.page.parts import Words
from photostrip.report.page.tables import Field, note_of
from photostrip.result.verdict import headline_rms, standing_out
from photostrip.sheets.sheet import Fact, Rows, Sheet, hidden

ROLES, PARTS = ("check", "control"), ("plan", "height")
LEFT_OVER = (
    Field("count", "count"),
    Field("rms", "m 3"),
    Field("rms_um", "um 1", ""),
    Field("max", "m 3", "largest"),
    Field("worst", shown=False),
)
NO_CHECK = "There are no check points: which method is better cannot be told. Give some of the points `role: check`."


def methods_sheet(name: str, methods: Mapping[str, Document | PhotostripError]) -> Sheet:
    """Return adjustments by their names, each the document of its result or why it was refused."""
    done = {each: found for each, found in methods.items() if not isinstance(found, PhotostripError)}
    refused = {each: str(why) for each, why in methods.items() if isinstance(why, PhotostripError)}
    places = list(product(ROLES, PARTS))
    keys = [f"{role}_{part}_{each.key}" for role, part in places for each in LEFT_OVER]
    precision = [f"precision_{part}" for part in PARTS]
    rows: list[tuple[Any, ...]] = [
        (
            method,
            found["status"],
            "",
            found["counts"]["points"],
            found["summary"]["sigma0_um"],
            found["summary"]["redundancy"],
            *(headline_rms(found, role, part)[each.key] for role, part in places for each in LEFT_OVER),
            *_precision(found),
        )
        for method, found in done.items()
    ]
    rows += [(method, "refused", why, *[None] * (len(keys) + 5)) for method, why in refused.items()]
    names = hidden("adjustment", "status", "reason", "points", "sigma0_um", "redundancy", *keys, *precision)
    best = {part: _best(done, part) for part in PARTS}
    tables = [Rows("methods", "", names, rows), *(_table(done, role) for role in ROLES)]
    words = [Words(f"{method}: {why}", "failed") for method, why in refused.items()]
    tables.append(Rows("", "", (), (), below=[*words, _verdict(best)]))
    return Sheet("methods", f"Methods: {name}", [Fact("name", name), Fact("best", best)], tables)


def _precision(found: Document) -> list[float | None]:
    """Return the rms standard deviation of all points in plan and in height, where it is known."""
    known = found.get("precision")
    return [None if known is None else known["points"][part]["rms"] for part in PARTS]


def _table(done: Mapping[str, Document], role: str) -> Rows:
    shown = [each for each in LEFT_OVER if each.shown]
    columns = [Field("", head=f"at {role} points")]
    columns += [
        Field("", each.form, part, "points") if each.key == "count" else Field("", each.form, each.name)
        for part in PARTS
        for each in shown
    ]
    columns += [Field("", "m 3", f"σ {part}", rank=1) for part in PARTS if role == "check"]
    rows = [
        (
            method,
            *(headline_rms(found, role, part)[each.key] for part in PARTS for each in shown),
            *(_precision(found) if role == "check" else ()),
        )
        for method, found in done.items()
    ]
    odd = {name for found in done.values() for part in PARTS for name in standing_out(found, role, part)}
    note = note_of(
        "µm: at photo scale; σ: rms of the standard deviations of all points" if role == "check" else "",
        f"without {listed(sorted(odd))}, too far off beside the others" if odd else "",
    )
    return Rows("", "Methods side by side" if role == "check" and done else "", columns, rows, note=note)


def _best(done: Mapping[str, Document], part: str) -> str | None:
    rms = {method: headline_rms(found, "check", part)["rms"] for method, found in done.items()}
    known = {method: float(value) for method, value in rms.items() if value is not None}
    return min(known, key=known.__getitem__) if known else None


def _verdict(best: Mapping[str, str | None]) -> str:
    if not any(best.values()):
        return NO_CHECK
    if best["plan"] == best["height"]:
        return f"Smallest at check points: {best['plan']}."
    return f"Smallest at check points: {best['plan']} in plan, {best['height']} in height."
