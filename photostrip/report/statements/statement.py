"""The accuracy statement, a section of the report and the page of ``photostrip statement``; the certificate."""

from __future__ import annotations

from photostrip.notes import Document, listed
from photostrip.report.page.numbers import fixed, metres, signed
from photostrip.report.page.parts import DASH, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words

STYLES = {"tested": "good", "reduced": "look", "not met": "failed"}
HEADLINES = {
    "tested": "TESTED as the standard asks.",
    "reduced": "DOES NOT MEET THE MINIMUM number of check points of the standard.",
    "not met": "DOES NOT MEET the class that is asked for.",
}
SYMBOLS = {"plan": "RMSE_H", "height": "RMSE_V", "space": "RMSE_3D"}
CONFIRMED = (
    "I have seen that the check points took no part in the adjustment, were surveyed independently of the control to "
    "the standard deviations given above, lie on open ground and are spread over the whole area."
)
LINE = "________________________________"
CENTIMETRES = 100.0
NAMES = {"photostrip": "photostrip", "python": "Python", "numpy": "numpy", "scipy": "scipy", "pyproj": "pyproj"}
OF_FRAMES = {"proj": "PROJ", "epsg": "EPSG data set"}


def statement_section(document: Document) -> Section:
    block = document["statement"]
    if block["status"] == "refused":
        parts: list[Part] = [Words("No accuracy can be stated by a norm:")]
        parts += [Words(f"{_reason(each)}; {each['fix']}", mark="-") for each in block["reasons"]]
        return Section("Accuracy statement", tuple(parts))
    parts = [Words(text, mark="-") for text in block["sentences"]]
    parts.append(_accuracies(block))
    parts += [Words(text, mark="-") for text in block["remarks"]]
    parts.append(Words("photostrip statement writes it with the measures of ISO 19157, to be signed."))
    return Section("Accuracy statement", tuple(parts))


def _reason(reason: Document) -> str:
    points = f": {listed(reason['points'])}" if reason["points"] else ""
    return f"{reason['message']}{points}"


def statement_report(document: Document, *, quiet: bool = False) -> tuple[str, tuple[Section, ...]]:
    """Return title and sections of a statement; with `quiet` what is stated alone."""
    verdict = Words(_headline(document), STYLES[document["status"]])
    sentences = tuple(Words(text, mark=f"{place}.") for place, text in enumerate(document["sentences"], 1))
    if quiet:
        return "", (Section("", (verdict, *sentences)),)
    found = [
        Section("Statement", (verdict, *sentences)),
        Section("What went in", (_facts(document), _accuracies(document))),
        Section("Measures", (_measures(document),)),
        Section("Check points", (_check_points(document),)),
    ]
    remarks: list[Part] = [Words(text, mark="-") for text in document["remarks"]]
    sign = Facts(tuple((label, LINE) for label in ("Place, date", "Name, office", "Signature")))
    end = Section("To be signed", (*remarks, Words(CONFIRMED), sign))
    return f"Accuracy statement: {document['name']}", (*found, end)


def _headline(document: Document) -> str:
    return HEADLINES[document["status"]]


def _facts(document: Document) -> Facts:
    counts = " and ".join(f"{document[part]['count']} in {part}" for part in ("plan", "height"))
    asked = " and ".join(f"{size:g} cm in {part}" for part, size in document["asked_cm"].items())
    return Facts(
        (
            ("Result", f"{document['name']}, {document['verdict'].upper()}, adjustment {document['adjustment']}"),
            ("Frame", document["frame"]),
            ("Check points", counts),
            *((("Classes asked for", asked),) if asked else ()),
            ("Standard", document["standard"]),
            ("Made by", f"photostrip {document['version']}"),
            ("SHA-256", document["result_sha256"]),
        )
    )


def _accuracies(block: Document) -> Table:
    rows = [{"part": part, "count": None, "rmse": None, "survey": None, **block[part]} for part in SYMBOLS]
    columns = (
        words("", "part"),
        words("", lambda row: SYMBOLS[row["part"]]),
        number("points", lambda row: row["count"], lambda count: "" if count is None else str(count)),
        number("rms", "rmse", _centimetres, "cm"),
        number("survey", "survey", _centimetres, "cm"),
        number("together", "accuracy", _centimetres, "cm"),
        number("class", "class_cm", lambda size: fixed(size, 0), "cm"),
    )
    note = "rms: of the differences; survey: of the check points themselves; class: the narrowest of whole centimetres"
    return tabulated(rows, columns, note=note)


def _centimetres(value: float | None) -> str:
    return fixed(None if value is None else CENTIMETRES * value, 1)


def _measures(document: Document) -> Table:
    circle, line = document["circle"], document["line"]
    rows = [{"norm": f"ISO 19157, {each['id']}", **each} for each in document["iso_19157"]]
    nssda = {"alias": "", "norm": "NSSDA"}
    rows += [
        {**nssda, "name": "1.7308 RMSE_r, 95 %", "part": "plan", "value_m": circle["radial95"]},
        {**nssda, "name": "2.4477 (RMSE_x + RMSE_y) / 2, 95 %", "part": "plan", "value_m": circle["ce95"]},
        {**nssda, "name": "1.9600 RMSE_z, 95 %", "part": "height", "value_m": line["le95"]},
    ]
    columns = (
        words("norm", "norm"),
        words("measure", lambda row: row["name"] + (f" ({row['alias']})" if row["alias"] else "")),
        words("of", "part"),
        number("value", lambda row: row, lambda row: (signed if row.get("id") == 128 else metres)(row["value_m"]), "m"),
    )
    return tabulated(rows, columns, note="of the differences at the check points, without the error of their survey")


def _check_points(document: Document) -> Table:
    axes = zip(document["axes_of_frame"], ("dx", "dy", "dz"), strict=True)
    columns = (
        words("point", "id"),
        *(number(f"d {axis}", key, signed, "m") for axis, key in axes),
        number("plan", "plan", metres, "m"),
        number("height", "height", signed, "m"),
    )
    return tabulated(document["check_points"], columns, note="adjusted minus given")


def certificate_section(document: Document) -> Section:
    block = document["certificate"]
    found = block["versions"]
    epochs = list(dict.fromkeys(f"{epoch:.3f}" for epoch in block["epochs"] if epoch is not None))
    facts = Facts(
        (
            ("Result", block["result_sha256"]),
            ("Project with all defaults", block["resolved_sha256"]),
            ("Overridden", "; ".join(block["set"]) or "nothing"),
            ("Epochs", ", ".join(epochs) or "none given"),
            ("Computed by", ", ".join(f"{NAMES[name]} {found[name]}" for name in NAMES)),
            ("Frames by", ", ".join(f"{OF_FRAMES[name]} {found[name]}" for name in OF_FRAMES if found[name]) or DASH),
        )
    )
    files = tabulated([*block["inputs"], *block["grids"]], (words("file", "file"), words("SHA-256", "sha256")))
    return Section("Certificate", (facts, files))
