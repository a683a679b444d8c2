"""What can be said about independent models before anything is adjusted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.measured.measurements import Measurements
from photostrip.formats.measured.models import ModelTable
from photostrip.notes import Document
from photostrip.pipeline.inputs import MeasuredModels
from photostrip.project.loading import Project
from photostrip.project.yaml.tree import fault_at, key_path
from photostrip.units import MICROMETRES


def links_of_models(project: Project, models: MeasuredModels) -> Iterator[Fault]:
    """Refuse neighbouring models that cannot be linked, and models of the other hand."""
    from photostrip.pipeline.strips.models import form_models  # strips of photos need none of it

    for number, strip in enumerate(models.strips):
        try:
            form_models(strip, models.points, project.settings)
        except GeometryError as error:
            yield fault_at(project.tree, ("strips", number, "id"), str(error), error.code)
        except np.linalg.LinAlgError as error:
            message = (
                f"neighbouring models of strip {strip.id} cannot be linked: their coordinates contradict each other"
            )
            yield fault_at(project.tree, ("strips", number, "id"), f"{message} ({error})", "singular")
        except InputError as error:
            for fault in error.faults:
                words = {"expected": fault.expected, "fix": fault.fix}
                yield fault_at(project.tree, ("models", "file"), fault.message, fault.code, **words)


def source_of(project: Project, path: tuple[str | int, ...]) -> Document | None:
    """Say where a value of the project stands: in which file, line and key; None when it is not given."""
    if not project.tree.has(*path):
        return None
    place = project.tree.place_of(path)
    return {"source": "default", "file": place.file, "line": place.line, "key": key_path(path)}


def counts_of_models(models: MeasuredModels) -> Document:
    """Count models, their points and their perspective centres."""
    points = models.points.node < len(models.points.point_ids)
    return {
        "models": sum(len(strip.models) for strip in models.strips),
        "model_points": int(points.sum()),
        "model_centers": int((~points).sum()),
    }


def sigma_of(
    project: Project, section: str, tables: Iterable[Measurements | ModelTable | None], sigma: Floats
) -> Document:
    """Say which standard deviations (mm) the measured coordinates get, and how many rows of the tables have some."""
    read = [each for each in tables if each is not None]
    rows = sum(len(each.table) for each in read)
    stated = sum(int((~np.isnan(each.sigma).any(axis=1)).sum()) for each in read)
    return {
        "rows_with_own": stated,
        "rows_with_default": rows - stated,
        "default_from": source_of(project, (section, "sigma")),
        "smallest_um": float((sigma * MICROMETRES).min()) if len(sigma) else None,
        "largest_um": float((sigma * MICROMETRES).max()) if len(sigma) else None,
    }


def points_of_strip(models: MeasuredModels, number: int) -> Numbers:
    """Points that the models of a strip hold, by number."""
    points = models.points
    known = set(models.strips[number].models)
    inside = np.array([name in known for name in points.model_ids], bool)[points.model]
    return np.unique(points.node[inside & (points.node < len(points.point_ids))])


def photos_of_points(models: MeasuredModels) -> dict[str, set[str]]:
    shown = {
        name: strip.photos[place : place + 2] for strip in models.strips for place, name in enumerate(strip.models)
    }
    points = models.points
    found = {name: set[str]() for name in points.point_ids}
    for model, node in zip(points.model.tolist(), points.node.tolist(), strict=True):
        if node < len(points.point_ids):
            found[points.point_ids[node]].update(shown[points.model_ids[model]])
    return found
