"""Forms in which what is signed is printed."""

from __future__ import annotations

from enum import StrEnum


class StatementFormat(StrEnum):
    """Forms of a statement and of a verification."""

    TEXT = "text"
    JSON = "json"
    MD = "md"
