"""A result of independent models: their links, places and perspective centres in place of pairs and image residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.models.model_notes import far_ends
from photostrip.result.adjustment.pairs import PPM, from_control
from photostrip.result.numbers import (
    DEGREES,
    EXACT,
    GROUND,
    ROTATION,
    Document,
    Plain,
    micrometres,
    rms,
    rounded,
    significant,
)
from photostrip.result.points.ground import coordinates
from photostrip.result.points.precision import UPPER
from photostrip.triangulation.independent_models.link_screening import detectable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline import Result, StripResult

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

DIRECTIONS = ("along", "across", "up")
AXES = ("x", "y", "z")
MICROMETRES = 1000.0  # in a millimetre
ANOTHER_POINT = 0.05  # of the extent of a model: an error as large is one of identity


def _directed(values: Plain, names: Sequence[str] = DIRECTIONS) -> Document:
    return dict(zip(names, values, strict=True))


def gaps(strip: StripResult) -> Floats:
    """Differences of what neighbouring models have in common, after minus before.

    Returns
    -------
    ndarray, shape (t, 3)
        Metres along the strip, to its left and up, of every common point of every link.
    """
    shared, similarity, formed = strip.of_models.formed.links.shared, strip.absolute.similarity, strip.of_models.formed
    gap = formed.model_xyz[shared.after] - formed.model_xyz[shared.before]
    found: Floats = similarity.scale * gap @ similarity.rotation.T
    return found


def _sigma0(strip: StripResult) -> float:
    """Root of the variance of the model coordinates over what is stated; NaN without redundancy."""
    solved = strip.of_models.formed.links.solved
    redundancy = int(solved.redundancy.sum())
    return float(np.sqrt(solved.squares.sum() / redundancy)) if redundancy else float("nan")


def _stated(strip: StripResult) -> float:
    """Root mean square of the stated standard deviations of points, mm."""
    models = strip.of_models.formed.models
    return rms(models.sigma[models.node < models.points].ravel())


def strips_of(result: Result) -> list[Document]:
    """Return the list ``strips``: what each strip is like and how well it holds together."""
    return [_strip(strip) for strip in result.model_strips]


def _strip(strip: StripResult) -> Document:
    formed, links = strip.of_models.formed, strip.of_models.formed.links
    base = np.linalg.norm(np.diff(strip.centers, axis=0), axis=1)
    known = base[np.isfinite(base)]
    gap_rms = [rms(column) for column in gaps(strip)[links.used].T]
    return {
        "id": strip.strip.id,
        "camera": None,
        "photos": len(strip.strip.photos),
        "models": formed.models.count,
        "points": len(formed.point),
        "photo_scale": None,
        "model_scale": rounded(strip.scale_number, 1),
        "flying_height": rounded(strip.depth, 2),
        "base": rounded(known.mean() if len(known) else np.nan, 2),
        "azimuth_deg": rounded(np.degrees(strip.intermediate.azimuth) % 360, DEGREES),
        "sigma_given_um": micrometres(_stated(strip)),
        "sigma0_um": micrometres(_sigma0(strip) * _stated(strip)),
        "redundancy": int(links.solved.redundancy.sum()),
        "rms_parallax_um": None,
        "image_rms_um": None,
        "precision": {"plan": rounded(strip.precision[0], GROUND), "height": rounded(strip.precision[1], GROUND)},
        "discrepancy": _directed(rounded(gap_rms, GROUND)),
        "scale_drift": {"expected_ppm": rounded(_drift(strip), 1), "found_ppm": None},
    }


def _drift(strip: StripResult) -> float:
    """Change of scale along the strip that the links let expect, parts per million."""
    variance = strip.of_models.formed.links.solved.cofactors[:, 6, 6].sum() * strip.of_models.formed.links.factor
    return float(np.sqrt(variance)) * PPM if strip.of_models.formed.links.shared.count else float("nan")


def counts_of(result: Result) -> Document:
    """Return what the block ``counts`` says of models beside points and control."""
    links = [strip.of_models.formed.links for strip in result.model_strips]
    points = [
        strip.of_models.formed.models.node < strip.of_models.formed.models.points for strip in result.model_strips
    ]
    return {
        "models": sum(strip.of_models.formed.models.count for strip in result.model_strips),
        "image_points": 0,
        "image_points_used": 0,
        "model_points": sum(int(each.sum()) for each in points),
        "model_points_used": sum(
            int((each & strip.of_models.formed.used).sum())
            for each, strip in zip(points, result.model_strips, strict=True)
        ),
        "model_centers": sum(int((~each).sum()) for each in points),
        "pass_point_transfers": sum(int(each.used.sum()) for each in links),
        "rejected_in_pairs": 0,
        "rejected_in_scale_transfer": 0,
        "rejected_for_rays": 0,
        "rejected_in_links": sum(len(each.rejections) for each in links),
    }


def summary_of(result: Result) -> Document:
    """Return what the block ``summary`` says of models, before what is left at given points."""
    strips = result.model_strips
    redundancy = np.array([strip.of_models.formed.links.solved.redundancy.sum() for strip in strips])
    share = redundancy / max(int(redundancy.sum()), 1)
    ratio = float(np.sqrt((share * np.nan_to_num([_sigma0(strip) ** 2 for strip in strips])).sum()))
    stated = rms(np.array([_stated(strip) for strip in strips]))
    models = np.array([strip.of_models.formed.models.count for strip in strips])
    return {
        "sigma0_um": micrometres(ratio * stated if redundancy.sum() else np.nan),
        "sigma_given_um": micrometres(stated),
        "redundancy": int(redundancy.sum()),
        "max_parallax_um": None,
        "image_rms_um": None,
        "photo_scale": None,
        "model_scale": rounded(np.average([strip.scale_number for strip in strips], weights=models), 1),
        "flying_height": rounded(np.average([strip.depth for strip in strips], weights=models), 2),
    }


# --------------------------------------------------------------------------------------------- models and links


def models_of(result: Result) -> list[Document]:
    """Return the list ``models``: what each model holds and how it lies in its strip, in flight order."""
    return [model for strip in result.model_strips for model in _models(strip)]


def _models(strip: StripResult) -> list[Document]:
    formed, models, photos = strip.of_models.formed, strip.of_models.formed.models, strip.strip.photos
    point = models.node < models.points
    used = np.bincount(models.model[point & formed.used], minlength=models.count)
    total = np.bincount(models.model[point], minlength=models.count)
    center = np.bincount(models.model[~point], minlength=models.count)
    base = np.linalg.norm(np.diff(strip.centers, axis=0), axis=1)
    turned = strip.absolute.similarity.rotation @ formed.places.rotation
    columns = zip(
        strip.of_models.strip.models,
        used.tolist(),
        (total - used).tolist(),
        center.tolist(),
        rounded(base, GROUND),
        significant(formed.places.scale, EXACT),
        rounded(strip.of_models.scales, 1),
        rounded(turned.reshape(-1, 9), ROTATION),
        strict=True,
    )
    return [
        {
            "strip": strip.strip.id, "id": name, "left": photos[number], "right": photos[number + 1],
            "elements": None, "sigma0_um": None, "rms_parallax_um": None, "max_parallax_um": None,
            "points_used": points, "points_rejected": out, "centers": centers, "redundancy": None,
            "base": length, "scale_factor": factor, "model_scale": scale, "rotation": rotation,
        }
        for number, (name, points, out, centers, length, factor, scale, rotation) in enumerate(columns)
    ]  # fmt: skip


def links_of(result: Result) -> list[Document]:
    """Return the list ``links``: how every model fits the one before it, in flight order."""
    return [link for strip in result.model_strips for link in _links(result, strip)]


def _links(result: Result, strip: StripResult) -> list[Document]:
    links, models = strip.of_models.formed.links, strip.of_models.formed.models
    shared, solved, names = links.shared, links.solved, strip.of_models.strip.models
    gap, far, found = gaps(strip), far_ends(strip.of_models.formed), []
    smallest = detectable(shared, links)
    for number in range(shared.count):
        rows = np.flatnonzero(shared.link == number)
        used = rows[links.used[rows]]
        nodes = models.node[shared.before[rows]]
        worst = used[np.argmax(links.value[used])]
        size = rounded([rms(column) for column in gap[used].T], GROUND)
        redundancy = int(solved.redundancy[number])
        found.append(
            {
                "strip": strip.strip.id,
                "photo": strip.strip.photos[number + 1],
                "before": names[number],
                "after": names[number + 1],
                "points_used": int((models.node[shared.before[used]] < models.points).sum()),
                "points_rejected": [_name(result, int(node)) for node, row in zip(nodes, rows, strict=True)
                                    if not links.used[row]],
                "center": bool((models.node[shared.before[used]] >= models.points).any()),
                "factor": significant(solved.similarities.scale[number], EXACT),
                "redundancy": redundancy,
                "sigma0": significant(np.sqrt(solved.squares[number] / redundancy) if redundancy else np.nan),
                "largest": rounded(links.value[worst], 2),
                "largest_point": _name(result, int(models.node[shared.before[worst]])),
                "limit": rounded(links.limit[number], 2),
                "detectable_um": micrometres(_finite(smallest[used].max())),
                "far_end": rounded(far[number], 2),
                "discrepancy": _directed(size),
                "discrepancy_um": _directed(
                    rounded([rms(column) / strip.scale_number * PPM for column in gap[used].T], 1)
                ),
            }
        )  # fmt: skip
    return found


def _finite(value: float) -> float:
    return float(value) if np.isfinite(value) else float("nan")


def _name(result: Result, node: int) -> str:
    """Name a point, or a perspective centre by its photo."""
    measured = result.inputs.models
    return "" if measured is None else measured.points.name(node)


def residuals_of(result: Result, rank: Numbers) -> list[Document]:
    """Return the list ``link_residuals``: differences of what neighbouring models have in common, link by link.

    After minus before, in micrometres along the axes of the model before; also of points that took no part.
    """
    found = []
    for strip in result.model_strips:
        links, models, names = strip.of_models.formed.links, strip.of_models.formed.models, strip.of_models.strip.models
        shared = links.shared
        place = np.concatenate([rank, len(rank) + np.arange(len(strip.strip.photos) + models.node.max(initial=0))])
        for number in range(shared.count):
            rows = np.flatnonzero(shared.link == number)
            rows = rows[np.argsort(place[models.node[shared.before[rows]]], kind="stable")]
            values = micrometres(-links.solved.residual[rows])
            found.append(
                {
                    "strip": strip.strip.id,
                    "before": names[number],
                    "after": names[number + 1],
                    "points": [_name(result, int(node)) for node in models.node[shared.before[rows]]],
                    **{f"v{axis}_um": [row[k] for row in values] for k, axis in enumerate(AXES)},
                    "test": rounded(links.value[rows], 2),
                    "used": links.used[rows].tolist(),
                }
            )
    return found


def rejected_of(result: Result) -> list[Document]:
    """Return what was taken out of links and control, as in the list ``rejected``."""
    found = []
    for strip in result.model_strips:
        shared, formed, names = (
            strip.of_models.formed.links.shared,
            strip.of_models.formed,
            strip.of_models.strip.models,
        )
        for each in strip.of_models.formed.links.rejections:
            link = each.link
            before, after = shared.before[each.row], shared.after[each.row]
            size = float(np.linalg.norm(each.error)) * MICROMETRES
            guilty = _guilty((names[link], names[link + 1]), (formed.used[before], formed.used[after]))
            parts = ", ".join(
                f"{axis} {value * MICROMETRES:+.0f}" for axis, value in zip(AXES, each.error, strict=True)
            )
            found.append(
                {
                    "strip": strip.strip.id,
                    "photo": strip.strip.photos[link + 1],
                    "other_photo": None,
                    "point": _name(result, int(formed.models.node[before])),
                    "stage": "link",
                    "test": "link",
                    "value": rounded(each.value, 2),
                    "limit": rounded(each.limit, 2),
                    "unit": "",
                    "parallax_um": None,
                    "zone": None,
                    "size": rounded(size, 2),
                    "size_unit": "um",
                    "readmitted": False,
                    "reason": f"models {names[link]} and {names[link + 1]} contradict each other by {parts} µm"
                    f"{_other_point(strip, int(before), size / MICROMETRES)}; {guilty}",
                    "models": [names[link], names[link + 1]],
                }
            )
        found += [from_control(strip, wrong) for wrong in strip.wrong_control]
    return found


def _other_point(strip: StripResult, row: int, size: float) -> str:
    """Say that a difference is of the size of the model, as where one id stands for two points."""
    models = strip.of_models.formed.models
    xyz = models.xyz[models.model == models.model[row]]
    extent = float(np.linalg.norm(xyz - xyz.mean(axis=0), axis=1).max())
    return ", as where one id stands for two points" if size > ANOTHER_POINT * extent else ""


def _guilty(names: tuple[str, str], used: tuple[bool, bool]) -> str:
    """Say which model is wrong, as far as other models of the point tell."""
    if used[0] == used[1]:
        return "which one is wrong cannot be told, and the mean is made of neither"
    return f"other models agree with {names[0] if used[0] else names[1]}: {names[1] if used[0] else names[0]} is wrong"


# ------------------------------------------------------------------------------------------------------- photos


def photos_of(result: Result) -> list[Document]:
    """List ``photos``: perspective centres in flight order; rotations of photos are not known from models."""
    return [photo for number, strip in enumerate(result.model_strips) for photo in _photos(result, number, strip)]


def _photos(result: Result, number: int, strip: StripResult) -> list[Document]:
    photos, models = strip.strip.photos, strip.of_models.formed.models
    known = np.flatnonzero(np.isfinite(strip.centers).all(axis=1))
    cartesian = strip.intermediate.cartesian_from_intermediate(strip.centers[known])
    ids = [f"at the center of photo {photos[row]}" for row in known.tolist()]
    places = coordinates(result.output, result.output.ground_from_cartesian(cartesian, ids=ids))
    sigmas = _sigmas(result, number, known, cartesian)
    rows: dict[int, tuple[Plain, Document]] = {
        row: (place, sigma) for row, place, sigma in zip(known.tolist(), places, sigmas, strict=True)
    }
    point = models.node < models.points
    count = np.bincount(models.model[point & strip.of_models.formed.used], minlength=models.count).tolist()
    system, unit = result.settings.angle_system, result.settings.angle_unit
    found = []
    for row, photo in enumerate(photos):
        place, sigma = rows.get(row, ((None, None, None), {"sigma": None}))
        found.append(
            {
                "id": photo, "strip": strip.strip.id, "x": place[0], "y": place[1], "z": place[2], "rotation": None,
                "angles": {"system": system, "unit": unit, "values": None}, **sigma, "image_rms_um": None,
                "points": max(count[max(row - 1, 0) : row + 1]), "resected": None,
            }
        )  # fmt: skip
    return found


def _sigmas(result: Result, number: int, known: Numbers, cartesian: Floats) -> list[Document]:
    """Give standard deviations and covariances of centres; those of the angles are not known."""
    if result.precision is None:
        return [{"sigma": None} for _ in known]
    axes = result.output.axes_at(cartesian)[:, list(result.output.order)]
    covariances = np.full((len(known), 6, 6), np.nan)
    covariances[:, :3, :3] = axes @ result.precision.photos[number][known][:, :3, :3] @ axes.transpose(0, 2, 1)
    sigma = rounded(np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)[:, :3]), GROUND)
    mixed = significant(covariances[:, *UPPER])
    return [
        {"sigma": {"x": x, "y": y, "z": z, "angles": None}, "covariance": row}
        for (x, y, z), row in zip(sigma, mixed, strict=True)
    ]
