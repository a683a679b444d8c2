"""The accuracy statement, a section of the report and the page of ``photostrip statement``; the certificate."""

from __future__ import annotations

from collections.abc import Iterator

from photostrip.notes import Document, listed
from photostrip.report.page.parts import DASH, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import Field, metres, signed, tabulated

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
MEAN_ERROR = 128  # number of the measure that has a sign
NAMES = {"photostrip": "photostrip", "python": "Python", "numpy": "numpy", "scipy": "scipy", "pyproj": "pyproj"}
OF_FRAMES = {"proj": "PROJ", "epsg": "EPSG data set"}


def statement(document: Document) -> Iterator[Part]:
    if "statement" not in document:
        return
    block = document["statement"]
    if block["status"] == "refused":
        yield Words("No accuracy can be stated by a norm:")
        for each in block["reasons"]:
            points = f": {listed(each['points'])}" if each["points"] else ""
            yield Words(f"{each['message']}{points}; {each['fix']}", mark="-")
        return
    yield from (Words(text, mark="-") for text in block["sentences"])
    yield _accuracies(block)
    yield from (Words(text, mark="-") for text in block["remarks"])
    yield Words("photostrip statement writes it with the measures of ISO 19157, to be signed.")


def statement_report(document: Document, *, quiet: bool = False) -> tuple[str, tuple[Section, ...]]:
    """Return title and sections of a statement; with `quiet` what is stated alone."""
    verdict = Words(HEADLINES[document["status"]], STYLES[document["status"]])
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
    keys = ("count", "rmse", "survey", "accuracy")
    columns = (
        *(Field("part", head=""), Field("symbol", head=""), Field("points", "count")),
        *(Field(head, "cm 1") for head in ("rms", "survey", "together")),
        Field("class", "cm 0"),
    )
    rows = []
    for part, symbol in SYMBOLS.items():
        count, *sizes = (block[part].get(key) for key in keys)
        of_class = block[part]["class_cm"]
        rows.append((part, symbol, "" if count is None else count, *map(_centimetres, sizes), of_class))
    note = "rms: of the differences; survey: of the check points themselves; class: the narrowest of whole centimetres"
    return tabulated(columns, rows, note)


def _centimetres(value: float | None) -> float | None:
    return None if value is None else CENTIMETRES * value


def _measures(document: Document) -> Table:
    circle, line = document["circle"], document["line"]
    rows = [
        (
            f"ISO 19157, {each['id']}",
            each["name"] + (f" ({each['alias']})" if each["alias"] else ""),
            each["part"],
            (signed if each["id"] == MEAN_ERROR else metres)(each["value_m"]),
        )
        for each in document["iso_19157"]
    ]
    rows += [
        ("NSSDA", "1.7308 RMSE_r, 95 %", "plan", metres(circle["radial95"])),
        ("NSSDA", "2.4477 (RMSE_x + RMSE_y) / 2, 95 %", "plan", metres(circle["ce95"])),
        ("NSSDA", "1.9600 RMSE_z, 95 %", "height", metres(line["le95"])),
    ]
    columns = (*map(Field, ("norm", "measure", "of")), Field("value", "m 3"))
    return tabulated(columns, rows, "of the differences at the check points, without the error of their survey")


def _check_points(document: Document) -> Table:
    columns = (
        Field("point"),
        *(Field(f"d {axis}", "m +3") for axis in document["axes_of_frame"]),
        *(Field("plan", "m 3"), Field("height", "m +3")),
    )
    keys = ("id", "dx", "dy", "dz", "plan", "height")
    rows = ([row[key] for key in keys] for row in document["check_points"])
    return tabulated(columns, rows, "adjusted minus given")


def certificate(document: Document) -> Iterator[Part]:
    if "certificate" not in document:
        return
    block = document["certificate"]
    versions = block["versions"]
    frames = ", ".join(f"{OF_FRAMES[name]} {versions[name]}" for name in OF_FRAMES if versions[name])
    epochs = list(dict.fromkeys(f"{epoch:.3f}" for epoch in block["epochs"] if epoch is not None))
    yield Facts(
        (
            ("Result", block["result_sha256"]),
            ("Project with all defaults", block["resolved_sha256"]),
            ("Overridden", "; ".join(block["set"]) or "nothing"),
            ("Epochs", ", ".join(epochs) or "none given"),
            ("Computed by", ", ".join(f"{NAMES[name]} {versions[name]}" for name in NAMES)),
            ("Frames by", frames or DASH),
        )
    )
    files = [(row["file"], row["sha256"]) for rows in (block["inputs"], block["grids"]) for row in rows]
    yield tabulated((Field("file"), Field("SHA-256")), files)
