"""Saved results that somebody edited: their numbers are not those of their certificate."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from photostrip.errors import Fault, InputError
from photostrip.notes import Document
from photostrip.result.table import Table
from photostrip.result.verdict import FAILED, LOOK

WITHOUT_PLACE: Document = {"strip": "", "photos": [], "points": [], "key": ""}
FIX = "run the project again"
EDITED = "its numbers are not those of its certificate: it was edited after it was written"
# what Python raises on a value that is not of the form that is expected there, and on a word that is none of a few
OF_VALUES: tuple[type[Exception], ...] = (ArithmeticError, AttributeError, IndexError, TypeError, ValueError)
OF_WORDS = (*OF_VALUES, KeyError)


def is_edited(document: Document) -> bool:
    """Whether a result has other numbers than when it was written; of one without a certificate nobody knows."""
    from photostrip.result.statement.certificate import result_hash  # with numpy

    certificate = document.get("certificate")
    if not certificate:
        return False
    try:
        return bool(result_hash(document) != certificate["result_sha256"])
    except OF_WORDS:
        return True


def as_reported(document: Document, file: str) -> Document:
    """Return a saved result as it is reported: one that was edited says so, and is never GOOD."""
    if not is_edited(document):
        return document
    verdict, note = document["verdict"], f"{file}: {EDITED}"
    warning = {"code": "result-edited", "severity": "warning", "message": EDITED, "file": file, "line": 0, "column": 0}
    edited = {
        "status": document["status"] if document["status"] == FAILED else LOOK,
        "verdict": verdict | {"look_at": [f"{note}; {FIX}", *verdict["look_at"]]},
        "notes": Table.of_rows("notes", [warning | WITHOUT_PLACE, *document["notes"]]),
    }
    return {**document, **edited}


@contextmanager
def faults_of_edited(
    doing: str, *given: tuple[Document, str], errors: tuple[type[Exception], ...] = OF_WORDS
) -> Iterator[None]:
    """Turn what a document has in another form than it was written in into a fault of its file.

    A key that is missing has been told when it was read. Where the certificates vouch for all
    documents, an error is one of this program, and stays what it is.
    doing: ``reported`` or ``compared``.
    given: documents with their files, that which has no certificate last.
    errors: those that a document can be the cause of.
    """
    try:
        yield
    except errors as error:
        for document, file in given:
            if is_edited(document):
                raise InputError(Fault(f"cannot be {doing}: {EDITED}", "result-edited", file, fix=FIX)) from error
            if not document.get("certificate"):
                message = f"cannot be {doing}: a value is of another kind ({error})"
                raise InputError(
                    Fault(message, "result-incomplete", file, expected="a whole result.json", fix=FIX)
                ) from error
        raise
