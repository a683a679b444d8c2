"""Where in its files a project would be changed to put a finding right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Numbers
from photostrip.errors import Fault
from photostrip.notes import Finding
from photostrip.pipeline.inputs import ModelStrip, Strip
from photostrip.project.tables import Tables
from photostrip.project.yaml.tree import Node, steps


@dataclass(frozen=True, eq=False)
class ListedPoints:
    """Where the points of a control list stand: all that is kept of it while a project is run."""

    file: str
    ids: Sequence[str]
    lines: Numbers  # (n,): line of each id, counted from 1


def listed_points(tables: Tables) -> tuple[ListedPoints, ...]:
    """Return where the points of all control lists stand that could be read."""
    return tuple(
        ListedPoints(read.table.file, read.ids, read.table.lines) for read in tables.control if read is not None
    )


def places_of(
    findings: Iterable[Finding], tree: Node, control: Sequence[ListedPoints], strips: Sequence[Strip | ModelStrip]
) -> Iterator[Finding]:
    """Return findings with the place of their key, else of the first point in a control list or photo in a strip."""
    for each in findings:
        if each.key:
            path, key = steps(each.key), each.key
        elif each.points and (row := _given(each.points, control)) is not None:
            yield replace(each, file=row[0], line=row[1])
            continue
        else:
            path = _listed(each, strips[: len(tree.list_at("strips"))])
            path = path or (("photos",) if each.photos or each.strips else ())
            key = ""
        if not path or not tree.has(*path[:1]):
            yield each
            continue
        place = tree.place_of(path)
        yield replace(each, file=place.file, line=place.line, column=place.column, key=key)


def of_points(fault: Fault, control: Sequence[ListedPoints]) -> Fault:
    """Return a fault that knows only its points with the place of the first of them in a control list."""
    row = _given(fault.points, control)
    return fault if row is None else replace(fault, file=row[0], line=row[1])


def _given(points: tuple[str, ...], control: Sequence[ListedPoints]) -> tuple[str, int] | None:
    """File and line of the first of some points that a control list gives."""
    for listed in control:
        rows = np.flatnonzero(np.isin(np.array(listed.ids, str), points))
        if len(rows):
            return listed.file, int(listed.lines[rows[0]])
    return None


def _listed(finding: Finding, strips: Sequence[Strip | ModelStrip]) -> tuple[str | int, ...]:
    """Path of the first photo, or of the strip, that a finding names."""
    for number, strip in enumerate(strips):
        if finding.strips and strip.id not in finding.strips:
            continue
        for photo in finding.photos:
            if photo in strip.photos:
                return ("strips", number, "photos", strip.photos.index(photo))
        if finding.strips:
            return ("strips", number, "id")
    return ()
