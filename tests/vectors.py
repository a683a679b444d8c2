"""Numeric examples of the formulas, computed apart from this program (``tests/data/test_vectors.yaml``)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml

DATA = Path(__file__).parent / "data"


@dataclass(frozen=True, slots=True)
class Vector:
    """One example: what goes in, what must come out, and how closely.

    Units are millimetres for photo coordinates and metres on the ground; angles are radians unless the key ends in
    ``_deg``; matrices are lists of rows.
    """

    id: str
    source: str
    about: str
    input: dict[str, Any]
    expected: dict[str, Any]
    tol: dict[str, Any]


@cache
def _sections() -> dict[str, list[Vector]]:
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    text = (DATA / "test_vectors.yaml").read_text(encoding="utf-8")
    sections = yaml.load(text, Loader=loader)["sections"]  # noqa: S506 (both loaders are the safe one)
    return {name: [Vector(**entry) for entry in entries] for name, entries in sections.items()}


def section(name: str) -> list[Vector]:
    """Give every example of one section, in order."""
    return _sections()[name]


def vector(id_: str) -> Vector:
    """Give the one example with this id, whatever its section."""
    return next(each for entries in _sections().values() for each in entries if each.id == id_)


def cases(name: str, prefix: str = "") -> list[Any]:
    """Give the examples of one section whose id begins with `prefix` as parameters for ``pytest.mark.parametrize``."""
    return [pytest.param(each, id=each.id) for each in section(name) if each.id.startswith(prefix)]
