"""Where in its files a project would be changed to put a finding right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from photostrip.errors import Fault
from photostrip.frozen import replace
from photostrip.notes import Finding
from photostrip.pipeline.inputs import ModelStrip, Strip
from photostrip.project.tables import Tables
from photostrip.project.yaml.tree import Node, steps


def places_of(
    findings: Iterable[Finding], tree: Node, tables: Tables, strips: Sequence[Strip | ModelStrip]
) -> Iterator[Finding]:
    """Return findings with the place of their key, else of the first point in a control list or photo in a strip."""
    for each in findings:
        if each.key:
            path, key = steps(each.key), each.key
        elif each.points and (row := _given(each.points, tables)) is not None:
            yield replace(each, file=row[0], line=row[1])
            continue
        else:
            path = _listed(each, strips)
            key = ""
        if not path or not tree.has(*path[:1]):
            yield each
            continue
        place = tree.place_of(path)
        yield replace(each, file=place.file, line=place.line, column=place.column, key=key)


def of_points(fault: Fault, tables: Tables) -> Fault:
    """Return a fault that knows only its points with the place of the first of them in a control list."""
    row = _given(fault.points, tables)
    return fault if row is None else replace(fault, file=row[0], line=row[1])


def _given(points: tuple[str, ...], tables: Tables) -> tuple[str, int] | None:
    """File and line of the first of some points that a control list gives."""
    for read in tables.control:
        if read is None:
            continue
        rows = np.flatnonzero(np.isin(np.array(read.ids, str), points))
        if len(rows):
            return read.table.file, int(read.table.lines[rows[0]])
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
