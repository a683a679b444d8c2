"""The block ``statement`` of a result: the figures at its check points, and what forbids to state them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.notes import Document
from photostrip.pipeline.results import Result
from photostrip.result.points.given import Differences
from photostrip.result.quantities import record
from photostrip.result.statement.figures import figures_of
from photostrip.result.statement.stating import reason, stated
from photostrip.result.table import Table
from photostrip.result.verdict import FAILED, UNVERIFIED


def statement_of(result: Result, found: Differences, document: Document) -> Document:
    """Return the block ``statement`` of a document that has its verdict."""
    control = result.inputs.control
    measured = control.check & (result.control_rows >= 0)
    figures = figures_of(found.parts[measured], _sigma(result, measured))
    ids = [name for name, yes in zip(control.ids, control.check.tolist(), strict=True) if yes]
    given = zip(*map(document["control"].values, ("id", "role", "stands_out")), strict=True)
    odd = [name for name, role, parts in given if role == "check" and parts]
    block = {
        "status": "",
        "not_measured": len(ids) - int(measured.sum()),
        "reasons": Table.of_rows("statement.reasons", _reasons(document, figures, ids, odd)),
        **figures,
        "sentences": [],
        "remarks": [],
    }
    return stated(record("statement", block))


def _sigma(result: Result, rows: Flags) -> Floats:
    """Return the standard deviations of given points to the east, to the north and up; shape (n, 3)."""
    control = result.inputs.control
    sigma = control.sigma.copy()
    for number, frame in enumerate(result.frames):
        at = np.flatnonzero(rows & (control.frame == number))
        if frame.kind == "geocentric" and len(at):
            level = frame.level_axes_at(result.points.cartesian[result.control_rows[at]])
            sigma[at] = np.sqrt(np.einsum("nka,nk->na", level**2, control.sigma[at] ** 2))
    found: Floats = sigma[rows]
    return found


def _reasons(document: Document, figures: Document, ids: Sequence[str], odd: Sequence[str]) -> Iterator[Document]:
    """Say what forbids a statement, whatever class is asked for."""
    if not figures["plan"]["count"] and not figures["height"]["count"]:
        text = "there is no check point" if not ids else f"none of the {len(ids)} check points is measured"
        yield reason("statement-no-check-points", text, "measure points that took no part and give them `role: check`")
    if document["frame"]["kind"] == "local":
        text = "the frame is local: accuracy cannot be stated in a reference system that nobody else has"
        yield reason("statement-frame", text, "give the control with its coordinate reference system (`crs`)")
    if document["status"] in {FAILED, UNVERIFIED}:
        text = f"the verdict on the result is {document['status'].upper()}"
        yield reason("statement-verdict", text, "settle what the report names first")
    if odd:
        text = f"{len(odd)} of {len(ids)} check points do not go with the others"
        yield reason("statement-odd-points", text, "find out what is wrong with them; do not leave them out", odd)
    checks = set(ids)
    named = {point for each in document["findings"] if not each["accepted"] for point in each["points"]}
    if blamed := [name for name in ids if name in named & checks and name not in odd]:
        text = f"{len(blamed)} of {len(ids)} check points are named by a finding that nobody has accepted"
        yield reason("statement-odd-points", text, "settle the finding, or accept it in the project", blamed)
