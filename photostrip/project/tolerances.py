"""Tolerance profiles: YAML files that say what two results may differ by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

from photostrip.comparison import SetTolerance, Tolerance, Tolerances
from photostrip.formats.faults import LARGEST_NUMBER
from photostrip.project.reading import read_keys
from photostrip.project.sections import Flag, NotNegative, Range, SchemaNumber, Section, Whole, Words, key

USUAL = Tolerances()
T = TypeVar("T", bound=Section)


Count = Annotated[Whole, Range(0, LARGEST_NUMBER, "")]


class Absolute(Section):
    """Tolerance of what has a size of its own."""

    absolute: NotNegative | None = key("Difference allowed, in the unit of the kind", None)
    ignore: Flag = key("Do not compare this kind", default=False)


class Both(Absolute):
    """Tolerance that may grow with the quantity; the larger part counts."""

    relative: NotNegative | None = key("Difference allowed, as a share of the baseline", None)


class Statistics(Both):
    """Tolerance of statistics, which come in metres and in micrometres."""

    absolute_um: NotNegative | None = key("Difference allowed of statistics in micrometres", None)


class Members(Section):
    """Tolerance of a set."""

    missing: Count | None = key("Members that may be missing", None)
    new: Count | None = key("Members that may be new", None)
    ignore: Flag = key("Do not compare this set", default=False)


def _usual(kind: type[T], usual: Tolerance | SetTolerance) -> T:
    """Return a section that holds the defaults."""
    return kind.model_construct(**{name: getattr(usual, name) for name in kind.model_fields})


class ToleranceFile(Section):
    """A tolerance profile. What is not named keeps its default."""

    photostrip_tolerances: SchemaNumber = key("Number of this schema")
    extends: Words | None = key("Another profile whose keys are taken where this one has none", None)
    plan: Absolute = key("Places in plan", _usual(Absolute, USUAL.plan), unit="m")
    height: Absolute = key("Heights", _usual(Absolute, USUAL.height), unit="m")
    rotation: Absolute = key("Angles of rotations", _usual(Absolute, USUAL.rotation), unit="deg")
    sigma0: Both = key("Standard deviation of unit weight", _usual(Both, USUAL.sigma0), unit="um")
    scale: Both = key("Scale factors", _usual(Both, USUAL.scale))
    precision: Both = key("Standard deviations of points and photos", _usual(Both, USUAL.precision), unit="m")
    statistics: Statistics = key("Rms values, means, test values", _usual(Statistics, USUAL.statistics), unit="m")
    counts: Both = key("Numbers of points, redundancies", _usual(Both, USUAL.counts))
    ids: Members = key("Photos, points, models, given points", _usual(Members, USUAL.ids))
    choices: Members = key("Degrees, terms, roles, verdicts", _usual(Members, USUAL.choices))
    rejected: Members = key("Measurements taken out", _usual(Members, USUAL.rejected))
    findings: Members = key("Notes, points without coordinates", _usual(Members, USUAL.findings))


def load_tolerances(path: Path) -> tuple[Tolerances, Sequence[str]]:
    """Read a tolerance profile and name the files it was read from, or raise every fault of it."""
    given, reading = read_keys(ToleranceFile, path)
    kinds = {name: _completed(getattr(USUAL, name), getattr(given, name)) for name in Tolerances.__dataclass_fields__}
    return Tolerances(**kinds), reading.files


def _completed(usual: Tolerance | SetTolerance, given: Section) -> Any:  # noqa: ANN401 (the type of `usual`)
    """Lay what is given over the default."""
    return replace(usual, **{name: value for name, value in given if value is not None})
