"""The files of a batch: its summary as JSON and CSV, and the record beside every result."""

from __future__ import annotations

import json
from collections.abc import Sequence

from photostrip import __version__
from photostrip.formats.result_files import to_csv
from photostrip.notes import Document

SCHEMA = 1
COLUMNS = (
    "project", "output", "status", "exit_code", "adjustment", "strips", "photos", "points", "rejected", "sigma0_um",
    "rms_at", "rms_plan_m", "rms_height_m",
)  # fmt: skip


def summary_json(outcomes: Sequence[Document], exit_code: int, *, ascii_only: bool = False) -> str:
    """Return the summary as JSON, a line for each project in the order in which the user named them."""
    counts: dict[str, int] = {}
    for each in outcomes:
        counts[each["status"]] = counts.get(each["status"], 0) + 1
    head = {
        "photostrip_batch": SCHEMA,
        "version": __version__,
        "exit_code": exit_code,
        "finished": "not run" not in counts,
        "counts": dict(sorted(counts.items())),
    }
    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
    rows = ",\n".join(json.dumps(each, ensure_ascii=ascii_only) for each in outcomes)
    return "{\n" + ",\n".join(lines) + f',\n"projects": [\n{rows}\n]\n}}\n'


def summary_csv(outcomes: Sequence[Document]) -> str:
    """Return the summary as CSV: a row for each project, the first message in the last column."""
    messages = (" ".join(each["messages"][0].split()) if each["messages"] else "" for each in outcomes)
    rows = ([*(each[name] for name in COLUMNS), message] for each, message in zip(outcomes, messages, strict=True))
    return to_csv((*COLUMNS, "message"), rows)


def record_text(record: Document) -> str:
    """Write the record of a result, one key a line."""
    lines = (f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in record.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def parsed_record(data: bytes) -> Document | None:
    """Read the record of a result; None when it is none, or of another version."""
    try:
        record = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(record, dict) or record.get("photostrip_batch_record") != SCHEMA:
        return None
    shapes = {"program": dict, "project": str, "set": list, "inputs": dict, "outputs": dict, "outcome": dict}
    return record if all(type(record.get(key)) is shape for key, shape in shapes.items()) else None
