"""Profiles of accuracy classes: YAML files with the limits that a norm sets to check points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated

from photostrip.project.schema.sections import Read, Section, key
from photostrip.project.schema.values import Positive, Whole, Words, schema_number
from photostrip.project.yaml.reading import Reading
from photostrip.result.statement.classes import MEASURES, AccuracyClass, ClassProfile

SCHEMA_NUMBER = 1
_read_schema_number = schema_number("photostrip_statement", SCHEMA_NUMBER, " of accuracy classes")
SchemaNumber = Annotated[int, Read(_read_schema_number, {"const": SCHEMA_NUMBER})]


class PlanLimits(Section):
    """Limits in plan; what is not named has none."""

    rmse: Positive | None = key("Rms error in plan", None, unit="m")
    rmse_axis: Positive | None = key("Rms error of each of the two coordinates", None, unit="m")
    accuracy: Positive | None = key("Rms error in plan together with that of the survey", None, unit="m")
    mean: Positive | None = key("Mean error in plan", None, unit="m")
    p90: Positive | None = key("Error in plan that at most one point in ten exceeds", None, unit="m")
    largest: Positive | None = key("Largest error in plan", None, unit="m")
    ce90: Positive | None = key("Radius that holds 90 % of the points", None, unit="m")
    ce95: Positive | None = key("Radius that holds 95 % of the points", None, unit="m")
    radial95: Positive | None = key("Accuracy in plan at the 95 % level as the NSSDA computes it", None, unit="m")


class HeightLimits(Section):
    """Limits in height; what is not named has none."""

    rmse: Positive | None = key("Rms error in height", None, unit="m")
    accuracy: Positive | None = key("Rms error in height together with that of the survey", None, unit="m")
    mean: Positive | None = key("Mean size of the errors in height", None, unit="m")
    p90: Positive | None = key("Error in height that at most one point in ten exceeds", None, unit="m")
    largest: Positive | None = key("Largest error in height", None, unit="m")
    le90: Positive | None = key("Error in height that 90 % of the points keep", None, unit="m")
    le95: Positive | None = key("Error in height that 95 % of the points keep", None, unit="m")


class ClassBlock(Section):
    """A class of the norm."""

    name: Words = key("What the norm calls it")
    plan: PlanLimits = key("Limits in plan", PlanLimits())
    height: HeightLimits = key("Limits in height", HeightLimits())
    source: Words | None = key("Where its numbers come from, when not from that of the profile", None)


class ClassFile(Section):
    """A profile of accuracy classes, the narrowest first."""

    photostrip_statement: SchemaNumber = key("Number of this schema")
    extends: Words | None = key("Another profile whose keys are taken where this one has none", None)
    name: Words = key("The norm, as the statement names it")
    source: Words = key("Document, edition and section from which the numbers come")
    check_points: Whole = key("Number of check points that the norm asks for", 1)
    classes: list[ClassBlock] = key("The classes, the narrowest first")


def load_classes(path: Path) -> tuple[ClassProfile, Sequence[str]]:
    """Read a profile of classes and name the files it was read from, or raise every fault of it."""
    reading = Reading.of(str(path))
    given = reading.checked(ClassFile)
    if given is not None:
        _check(reading, given)
    given = reading.complete(given)
    classes = tuple(
        AccuracyClass(
            name=str(each.name),
            limits={part: limits for part in MEASURES if (limits := _limits(getattr(each, part)))},
            source=str(each.source or ""),
        )
        for each in given.classes
    )
    profile = ClassProfile(
        name=str(given.name), source=str(given.source), classes=classes, check_points=given.check_points
    )
    return profile, reading.files


def _limits(block: Section) -> dict[str, float]:
    return {name: value for name, value in block.values().items() if value is not None}


def _check(reading: Reading, given: ClassFile) -> None:
    """Refuse what no reader of a statement could understand."""
    if not given.classes:
        reading.refuse(("classes",), "names no class", "no-value", expected="at least one class")
    if given.check_points < 1:
        reading.refuse(("check_points",), "is out of range", "range", expected="1 or more")
    names = [str(each.name) for each in given.classes]
    for number, each in enumerate(given.classes):
        if names.index(str(each.name)) < number:
            message = f"the class `{each.name}` stands twice"
            reading.refuse(("classes", number, "name"), message, "duplicate-class", fix="rename one")
        if not _limits(each.plan) and not _limits(each.height):
            message = f"the class `{each.name}` has no limit"
            reading.refuse(("classes", number), message, "no-value", expected="a limit in plan or in height")
    for number, (one, other) in enumerate(pairwise(given.classes), 1):
        pairs = [
            (limit, after[name])
            for before, after in (
                (_limits(one.plan), _limits(other.plan)),
                (_limits(one.height), _limits(other.height)),
            )
            for name, limit in before.items()
            if name in after
        ]
        if pairs and all(after < before for before, after in pairs):  # a statement names the first that is kept
            message = f"the class `{other.name}` is narrower than `{one.name}` before it"
            reading.refuse(("classes", number), message, "order", expected="the narrowest class first")
