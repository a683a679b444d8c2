"""Model coordinates of a project: reading their tables, and which model stands where in which strip."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault
from photostrip.formats.measured.models import ModelTable, correlations, read_models
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.notes import counted, listed
from photostrip.pipeline.inputs import MeasuredModels, ModelStrip
from photostrip.points import ModelPoints, locate
from photostrip.project.keys import Models
from photostrip.project.yaml.reading import form_of
from photostrip.project.yaml.references import listed_photos
from photostrip.project.yaml.tree import Node, fault_at

MILLIMETRES = {"mm": 1.0, "um": 1e-3, "m": 1e3}  # in a unit


@dataclass(frozen=True, eq=False)
class ModelTables:
    """What the tables of model coordinates hold."""

    # points; rows whose id is that of a photo are perspective centres, when there is no table of those
    points: ModelTable
    centers: ModelTable | None

    def center_rows(self, photos: Sequence[str]) -> Numbers:
        """Rows of the points' table that are perspective centres: none when these have a table of their own."""
        if self.centers is not None:
            return np.zeros(0, np.intp)
        known = set(photos)
        flags = np.array([name in known for name in self.points.target_ids], bool)
        return np.flatnonzero(flags[self.points.targets])

    def centers_of(self, photos: Sequence[str]) -> dict[str, dict[str, int]]:
        """Return the photos whose centres each model holds, and a row of theirs in the table they stand in."""
        read = self.points if self.centers is None else self.centers
        rows = self.center_rows(photos) if self.centers is None else np.arange(len(read.table))
        found: dict[str, dict[str, int]] = {name: {} for name in read.model_ids}
        for row in rows.tolist():
            found[read.model_ids[read.models[row]]][read.target_ids[read.targets[row]]] = row
        return found


def model_tables(points: ModelTable | None, centers: ModelTable | None, root: Node) -> ModelTables | None:
    """Put the tables together; None when one that the project names could not be read."""
    named = root.has("models", "centers")
    return None if points is None or (named and centers is None) else ModelTables(points, centers)


def read_model_points(path: str, root: Node, findings: Findings, *, centers: bool) -> ModelTable | None:
    """Read one of the two tables of model coordinates; the project says what rows without standard deviations get."""
    where = ("models", "centers") if centers else ("models",)
    node = root.find(*where)
    has_sigma = root.has("models", "sigma") or (centers and root.has("models", "center_sigma"))
    return read_models(path, findings, centers=centers, has_sigma=has_sigma, form=form_of(node))


def check_models(root: Node, tables: ModelTables, findings: Findings) -> dict[int, tuple[str, ...]]:
    """Return the models of every strip without faults, by its number, in flight order; refuse what does not fit."""
    photos = [photo.id for photo in listed_photos(root)]
    centers = tables.centers_of(photos)
    _refuse_centers(tables, photos, centers, findings)
    found: dict[int, tuple[str, ...]] = {}
    owner: dict[str, int] = {}
    for number, strip in enumerate(root.list_at("strips")):
        flight, models = [each.text for each in strip.list_at("photos")], strip.find("models")
        if models is None:
            names, faults = _by_centers(root, number, flight, centers)
        else:
            names = [each.text for each in models.elements]
            faults = list(_as_listed(root, number, flight, names, tables, centers))
        for place, name in enumerate(names):
            if owner.setdefault(name, number) != number or names.index(name) != place:
                message = f"model {name} appears twice in the strips"
                path = ("strips", number, "photos" if models is None else "models")
                faults.append(fault_at(root, path, message, "model-twice", fix="list every model once"))
        findings.add(*faults)
        if not faults:
            found[number] = tuple(names)
    return found


def _refuse_centers(
    tables: ModelTables, photos: Sequence[str], centers: dict[str, dict[str, int]], findings: Findings
) -> None:
    """Refuse models with more than two perspective centres, and centres of models that hold nothing else."""
    read = tables.points if tables.centers is None else tables.centers
    measured = set(tables.points.model_ids)
    for name, shown in centers.items():
        rows = list(shown.values())
        if len(rows) > 2:
            message = f"model {name} has {len(rows)} perspective centres: {listed(list(shown))}"
            fix = "a model has those of its two photos; is one id used twice?"
            findings.add(read.table.fault(rows[2], read.target, message, "too-many-centers", fix=fix))
        if rows and name not in measured:
            message = f"model {name} has perspective centres and no point"
            fix = suggestion(name, tables.points.model_ids)
            findings.add(read.table.fault(rows[0], "model", message, "unknown-model", fix=fix))
    if tables.centers is None:
        return
    known = set(photos)
    for name, shown in centers.items():
        for photo, row in shown.items():
            if photo not in known:
                message = f"photo {photo} of model {name} belongs to no strip"
                findings.add(read.table.fault(row, "photo", message, "unknown-photo", fix=suggestion(photo, photos)))


def _by_centers(
    root: Node, number: int, flight: Sequence[str], centers: dict[str, dict[str, int]]
) -> tuple[list[str], list[Fault]]:
    """Find the model of each pair of neighbouring photos by its two perspective centres."""
    found, faults = [], []
    for place, pair in enumerate(pairwise(flight)):
        names = [name for name, shown in centers.items() if set(pair) <= set(shown)]
        path = ("strips", number, "photos", place + 1)
        if len(names) > 1:
            message = f"models {listed(names)} have the perspective centres of photos {pair[0]} and {pair[1]}"
            faults.append(fault_at(root, path, message, "model-twice", fix="list the models that count in `models`"))
        elif not names:
            message = f"no model has the perspective centres of photos {pair[0]} and {pair[1]}"
            fix = "list the models of the strip in flight order in `models`, or measure both centres"
            faults.append(fault_at(root, path, message, "no-model", fix=fix))
        found += names[:1]
    return found, faults


def _as_listed(
    root: Node,
    number: int,
    flight: Sequence[str],
    named: Sequence[str],
    tables: ModelTables,
    centers: dict[str, dict[str, int]],
) -> Iterator[Fault]:
    """Check the models that a strip lists: they exist, are one fewer than photos, and show the right photos."""
    path = ("strips", number, "models")
    if len(named) != len(flight) - 1:
        message = f"{counted(len(named), 'model')} listed for {counted(len(flight), 'photo')}"
        yield fault_at(root, path, message, "length", expected="one model for every two neighbouring photos")
    measured = list(tables.points.model_ids)
    for place, name in enumerate(named):
        if name not in measured:
            fix = suggestion(name, measured) or f"the models of {tables.points.table.file} are {listed(measured, 4)}"
            yield fault_at(root, (*path, place), f"model {name} is not measured", "unknown-model", fix=fix)
            continue
        pair = flight[place : place + 2]
        strange = [photo for photo in centers.get(name, {}) if photo not in pair]
        if strange and len(pair) > 1:
            message = (
                f"model {name} is listed between photos {pair[0]} and {pair[1]}, and has the perspective centre of "
                f"{strange[0]}"
            )
            fix = "put the models in flight order, or correct the id of the centre"
            yield fault_at(root, (*path, place), message, "wrong-center", fix=fix)


def measured_models(tables: ModelTables, given: Models, strips: Sequence[ModelStrip]) -> MeasuredModels:
    """Bring the model coordinates of the strips into millimetres and right-handed axes."""
    photos = [photo for strip in strips for photo in strip.photos]
    wanted = [model for strip in strips for model in strip.models]
    factor = MILLIMETRES[given.unit]
    hand = np.array([1.0, -1.0 if given.axes == "left-handed" else 1.0, 1.0])
    points, centers = tables.points, tables.centers
    is_center = np.zeros(len(points.table), bool)
    is_center[tables.center_rows(photos)] = True
    measured = _rows(points, np.flatnonzero(~is_center), wanted, given.sigma)
    parts = [measured, _rows(points, np.flatnonzero(is_center), wanted, given.center_sigma or given.sigma)]
    if centers is not None:
        parts.append(_rows(centers, np.arange(len(centers.table)), wanted, given.center_sigma or given.sigma))
    point_ids = tuple(dict.fromkeys(measured.targets))
    centers_of = [name for part in parts[1:] for name in part.targets]
    node = np.concatenate([locate(measured.targets, point_ids), locate(centers_of, photos) + len(point_ids)])
    covariance = np.concatenate([part.covariance for part in parts])
    correlation = correlations(np.concatenate([part.sigma for part in parts]), covariance)
    model_points = ModelPoints(
        model_ids=tuple(wanted),
        point_ids=point_ids,
        photo_ids=tuple(photos),
        model=locate([name for part in parts for name in part.models], wanted),
        node=node,
        xyz=np.concatenate([part.xyz for part in parts]) * factor * hand,
        sigma=np.concatenate([part.sigma for part in parts]) * factor,
        correlation=None if np.isnan(covariance).all() else correlation * hand[:, None] * hand,
    )
    return MeasuredModels(tuple(strips), model_points)


class _Rows(NamedTuple):
    """Rows of a table of model coordinates whose model is in a strip."""

    models: list[str]
    targets: list[str]
    xyz: Floats
    sigma: Floats
    covariance: Floats


def _rows(read: ModelTable, rows: Numbers, wanted: Sequence[str], default: Sequence[float] | None) -> _Rows:
    known = set(wanted)
    inside = np.array([name in known for name in read.model_ids], bool)
    rows = rows[inside[read.models[rows]]]
    sigma = read.sigma[rows]
    if default is not None:
        sigma = np.where(np.isnan(sigma), default, sigma)
    models = [read.model_ids[code] for code in read.models[rows]]
    return _Rows(
        models=models,
        targets=[read.target_ids[code] for code in read.targets[rows]],
        xyz=read.xyz[rows],
        sigma=sigma,
        covariance=read.covariance[rows],
    )
