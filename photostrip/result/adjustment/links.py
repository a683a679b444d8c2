"""Independent models in their strips, and the links between them."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Numbers
from photostrip.geodesy.frame_spec import CARTESIAN_AXES
from photostrip.notes import Document
from photostrip.pipeline.results import Result, StripResult
from photostrip.result.adjustment.junctions import PPM, along_the_strip, discrepancies
from photostrip.result.numbers import rms
from photostrip.result.quantities import MATRIX
from photostrip.result.table import Table


def sigma0(strip: StripResult) -> float:
    """Root of the variance of the model coordinates over what is stated; NaN without redundancy."""
    solved = strip.of_models.formed.links.solved
    redundancy = int(solved.redundancy.sum())
    return float(np.sqrt(solved.squares.sum() / redundancy)) if redundancy else float("nan")


def stated_sigma(strip: StripResult) -> float:
    """Root mean square of the stated standard deviations of points, mm."""
    models = strip.of_models.formed.models
    return rms(models.sigma[models.node < models.points])


def expected_drift(strip: StripResult) -> float:
    """Change of scale along the strip that the links let expect, ratio."""
    links = strip.of_models.formed.links
    return float(np.sqrt(links.solved.cofactors[:, 6, 6].sum() * links.factor)) if links.shared.count else float("nan")


def models_of(result: Result) -> Table:
    """Return the list ``models``: what each model holds and how it lies in its strip, in flight order."""
    return Table.joined("models", map(_models, result.model_strips))


def _models(strip: StripResult) -> Table:
    formed, models, photos = strip.of_models.formed, strip.of_models.formed.models, strip.strip.photos
    point = models.node < models.points
    used = np.bincount(models.model[point & formed.used], minlength=models.count)
    columns = {
        "strip": strip.strip.id,
        "id": strip.of_models.strip.models,
        "left": photos[:-1],
        "right": photos[1:],
        **dict.fromkeys(("sigma0_um", "rms_parallax_um", "max_parallax_um")),
        "points_used": used,
        "points_rejected": np.bincount(models.model[point], minlength=models.count) - used,
        "centers": np.bincount(models.model[~point], minlength=models.count),
        "redundancy": None,
        "base": np.linalg.norm(np.diff(strip.centers, axis=0), axis=1),
        "base_formed": np.linalg.norm(np.diff(formed.centers, axis=0), axis=1) * strip.absolute.similarity.scale,
        "scale_factor": formed.places.scale,
        "model_scale": strip.of_models.scales,
        **dict(zip(MATRIX, strip.of_models.rotations.reshape(-1, 9).T, strict=True)),
    }
    return Table.of("models", columns)


def links_of(result: Result) -> Table:
    """Return the list ``links``: how every model fits the one before it, in flight order."""
    return Table.of_rows("links", (link for strip in result.model_strips for link in _links(result, strip)))


def _links(result: Result, strip: StripResult) -> list[Document]:
    from photostrip.strip.linked_models import detectable

    formed, names = strip.of_models.formed, strip.of_models.strip.models
    links, models, shared, solved = formed.links, formed.models, formed.links.shared, formed.links.solved
    from photostrip.strip.linked_models import far_ends

    gap, far, smallest, found = discrepancies(strip), far_ends(formed), detectable(shared, links), []
    for number in range(shared.count):
        rows = np.flatnonzero(shared.link == number)
        used = rows[links.used[rows]]
        of_points = models.node[shared.before[used]] < models.points
        worst = used[np.argmax(links.value[used])]
        size = np.array([rms(column) for column in gap[used].T])
        redundancy = int(solved.redundancy[number])
        link: Document = {
            "strip": strip.strip.id,
            "photo": strip.strip.photos[number + 1],
            "before": names[number],
            "after": names[number + 1],
            "points_used": int(of_points.sum()),
            "points_rejected": names_of(result, models.node[shared.before[rows[~links.used[rows]]]]),
            "center": bool((~of_points).any()),
            "factor": solved.similarities.scale[number],
            "redundancy": redundancy,
            "sigma0": np.sqrt(solved.squares[number] / redundancy) if redundancy else np.nan,
            "largest": links.value[worst],
            "largest_point": names_of(result, models.node[shared.before[[worst]]])[0],
            "limit": links.limit[number],
            "detectable_um": smallest[used].max() * 1000.0,
            "far_end": far[number],
            **along_the_strip("discrepancy", size),
            **along_the_strip("discrepancy_um", size / strip.scale_number * PPM),
        }
        found.append(link)
    return found


def names_of(result: Result, nodes: Numbers) -> list[str]:
    """Name points, and perspective centres by their photos."""
    measured = result.inputs.models
    return [] if measured is None else [measured.points.name(int(node)) for node in nodes]


def residuals_of(result: Result, rank: Numbers) -> Table:
    """Return the table ``link_residuals``: differences of what neighbouring models have in common, link by link.

    After minus before, in micrometres along the axes of the model before; also of points that took no part.
    """
    found = []
    for strip in result.model_strips:
        formed, names = strip.of_models.formed, strip.of_models.strip.models
        links, node, shared = formed.links, formed.models.node, formed.links.shared
        place = np.concatenate([rank, len(rank) + np.arange(len(strip.strip.photos) + node.max(initial=0))])
        order = np.lexsort((place[node[shared.before]], shared.link))
        columns = {
            "strip": strip.strip.id,
            "before": np.array(names[:-1], object)[shared.link[order]],
            "after": np.array(names[1:], object)[shared.link[order]],
            "point": names_of(result, node[shared.before[order]]),
            **{f"v{axis}_um": -1000.0 * links.solved.residual[order, k] for k, axis in enumerate(CARTESIAN_AXES)},
            "test": links.value[order],
            "used": links.used[order],
        }
        found.append(Table.of("link_residuals", columns))
    return Table.joined("link_residuals", found)
