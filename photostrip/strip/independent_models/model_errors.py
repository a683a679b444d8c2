"""Errors of a strip of independent models by the errors of its model coordinates: covariances, linear in its length.

A link is a least-squares similarity, so its error, a *step*, is a sum over the coordinates of its common points in both
models. The similarity of a model is the sum of the steps before it; a point is displaced by that of its model and by
its own coordinates. Steps have coordinates in common only with their neighbours: those of the model between them.
Everything refers to the frame of the ground after the plain similarity, metres.

Source: derived; see docs/independent-models.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, Similarity, similarity_derivatives
from photostrip.strip.independent_models.formation import FormedModels


@dataclass(frozen=True, eq=False)
class ModelErrors:
    """Everything that covariances of a strip of independent models are made of."""

    origin: Floats  # (3,): common origin of all similarities
    covariance: Floats  # (n, 3, 3): covariance of the coordinates of every row, metres^2 along the axes of the ground
    # before, after: (n,): entry of `gain` with which a row enters the link behind and the link before its model; -1 for
    # none
    before: Numbers
    after: Numbers
    gain: Floats  # (t, 7, 3): step of each link by the difference of a common point, the row before minus the row after
    link: Numbers  # (t,): link of each entry
    # first, second: (t,): row of each entry in the model before and in the model after
    first: Numbers
    second: Numbers
    model: Numbers  # (n,): model of every row
    item: Numbers  # (n,): node of every row, counted in `FormedModels.node`; -1 for rows that make no mean
    share: Floats  # (n,): share of the row in the mean of its node
    by_similarity: Floats  # (k, 3, 7): displacement of every node by a similarity
    models: int


def differentiate_models(formed: FormedModels, similarity: Similarity) -> ModelErrors:
    """Differentiate the linking of models; ``similarity`` leads from the strip to the frame of the ground."""
    models, links = formed.models, formed.links
    scale = similarity.scale * formed.places.scale
    turn = scale[:, None, None] * (similarity.rotation @ formed.places.rotation)
    turned = turn[models.model] * models.sigma[:, None, :]
    covariance = turned @ turned.transpose(0, 2, 1)
    nodes = similarity(formed.node_xyz)
    origin = nodes.mean(axis=0)
    used = np.flatnonzero(links.used)
    link, first, second = links.shared.link[used], links.shared.before[used], links.shared.after[used]
    xyz = similarity(formed.model_xyz)
    gain = _gains(link, xyz[first], covariance[first] + covariance[second], origin, links.shared.count)
    before, after = np.full(len(models.model), -1), np.full(len(models.model), -1)
    before[first], after[second] = np.arange(len(used)), np.arange(len(used))
    item = np.where(formed.used, np.searchsorted(formed.node, models.node), -1)
    return ModelErrors(
        origin=origin,
        covariance=covariance,
        before=before,
        after=after,
        gain=gain,
        link=link,
        first=first,
        second=second,
        model=models.model,
        item=item,
        share=np.where(formed.used, 1 / formed.node_models[np.maximum(item, 0)], 0.0),
        by_similarity=similarity_derivatives(nodes, origin),
        models=models.count,
    )


def section(errors: ModelErrors, nodes: Numbers) -> ModelErrors:
    """Errors of the models that hold some nodes, relative to the first of these models.

    What the links before them do moves all the nodes by one similarity. Without it the covariances do not grow with the
    length of the strip before the section, nor does the work.
    """
    model = errors.model[np.isin(errors.item, nodes)]
    first, last = int(model.min()), int(model.max())
    rows = np.flatnonzero((errors.model >= first) & (errors.model <= last))
    entries = np.flatnonzero((errors.link >= first) & (errors.link < last))
    row, entry = np.full(len(errors.model), -1), np.full(len(errors.link) + 1, -1)
    row[rows], entry[entries] = np.arange(len(rows)), np.arange(len(entries))  # and entry[-1], none, stays none
    return replace(
        errors,
        covariance=errors.covariance[rows],
        before=entry[errors.before[rows]],
        after=entry[errors.after[rows]],
        gain=errors.gain[entries],
        link=errors.link[entries] - first,
        first=row[errors.first[entries]],
        second=row[errors.second[entries]],
        model=errors.model[rows] - first,
        item=errors.item[rows],
        share=errors.share[rows],
        models=last - first + 1,
    )


def _gains(link: Numbers, xyz: Floats, covariance: Floats, origin: Floats, count: int) -> Floats:
    """Parameters of each link by the differences of its points: N^-1 D^T P, then moved to the common origin."""
    number = np.maximum(np.bincount(link, minlength=count), 1)[:, None]
    center = np.column_stack([np.bincount(link, xyz[:, axis], count) for axis in range(3)]) / number
    arm = xyz - center[link]
    size = np.sqrt(np.bincount(link, (arm**2).sum(axis=1), count) / number[:, 0])
    unit = np.ones((count, SIMILARITY_PARAMETERS))
    unit[:, 3:] = 1 / np.maximum(size, 1e-300)[:, None]
    design = similarity_derivatives(arm, np.zeros(3)) * unit[link][:, None, :]
    weighted = design.transpose(0, 2, 1) @ np.linalg.inv(covariance)
    normal = np.zeros((count, SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS))
    np.add.at(normal, link, weighted @ design)
    moved = np.tile(np.eye(SIMILARITY_PARAMETERS), (count, 1, 1))  # from the link's centre to the common origin
    offset = center - origin
    moved[:, :3, 3:6] = cross_matrix(offset)
    moved[:, :3, 6] = -offset
    operator = moved @ (unit[:, :, None] * np.linalg.inv(normal))
    return np.asarray(operator[link] @ weighted, float)


def sums(errors: ModelErrors, nodes: Numbers, weights: Floats) -> Floats:
    """Coefficients (t, n, 3) of the model coordinates of all rows in weighted sums of displacements of nodes.

    nodes: (c,), nodes, counted as ``FormedModels.node``, each at most once.
    weights: (t, c, 3), weight of each coordinate of each node in each sum.
    """
    place = np.full(len(errors.by_similarity), -1)
    place[nodes] = np.arange(len(nodes))
    rows = np.flatnonzero((errors.item >= 0) & (place[errors.item] >= 0))
    shares = errors.share[rows, None] * weights[:, place[errors.item[rows]]]
    found = np.zeros((len(weights), len(errors.model), 3))
    found[:, rows] = shares
    by_model = np.zeros((errors.models, len(weights), SIMILARITY_PARAMETERS))
    np.add.at(by_model, errors.model[rows], np.einsum("tri,rij->rtj", shares, errors.by_similarity[errors.item[rows]]))
    beyond = np.cumsum(by_model[::-1], axis=0)[::-1][1:]  # of all models after each link
    by_row = np.einsum("etj,eji->tei", beyond[errors.link], errors.gain)
    found[:, errors.first] += by_row
    found[:, errors.second] -= by_row
    return found


def covariance_of_sums(errors: ModelErrors, one: Floats) -> Floats:
    """Covariances of sums given by ``sums``, metres^2, shape (t, t)."""
    spread = np.einsum("trj,rij->tri", one, errors.covariance).reshape(len(one), -1)
    product = one.reshape(len(one), -1) @ spread.T
    return np.asarray((product + product.T) / 2, float)


def with_sums(errors: ModelErrors, coefficients: Floats) -> Floats:
    """Covariances (k, 3, t) of the displacements of all nodes with sums of model coordinates of ``sums``."""
    by_row = np.einsum("rij,trj->rit", errors.covariance, coefficients)
    steps = np.zeros((errors.models, SIMILARITY_PARAMETERS, len(coefficients)))
    np.add.at(steps, errors.link + 1, errors.gain @ (by_row[errors.first] - by_row[errors.second]))
    frames = np.cumsum(steps, axis=0)
    rows = np.flatnonzero(errors.item >= 0)
    item, share = errors.item[rows], errors.share[rows]
    result = np.zeros((len(errors.by_similarity), 3, len(coefficients)))
    parts = errors.by_similarity[item] @ frames[errors.model[rows]] + by_row[rows]
    np.add.at(result, item, share[:, None, None] * parts)
    return result


def covariances(errors: ModelErrors) -> Floats:
    """Covariances (k, 3, 3) of the nodes of the formed strip relative to its first model, metres^2.

    A node is displaced by ``B (xi + sum of b_j step_j) + sum of its own coordinates`` with xi the similarity of its
    first model and b_j the share of its models after link j. xi and the steps correlate with their neighbours only.
    """
    steps, mixed = _steps(errors)
    chain = np.zeros((errors.models, SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS))
    behind = np.zeros((errors.models, SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS))
    behind[1:-1] = mixed
    added = steps + behind[:-1] + behind[:-1].transpose(0, 2, 1)
    chain[1:] = np.cumsum(added, axis=0)
    rows = np.flatnonzero(errors.item >= 0)
    item, model, share = errors.item[rows], errors.model[rows], errors.share[rows]
    first = np.full(len(errors.by_similarity), errors.models)
    np.minimum.at(first, item, model)
    held = np.zeros((len(errors.by_similarity), int((model - first[item]).max(initial=0)) + 2))
    np.add.at(held, (item, model - first[item]), share)
    beyond = np.cumsum(held[:, ::-1], axis=1)[:, ::-1][:, 1:]  # share of the models after each slot's link
    place = chain[first].copy()
    for slot in range(beyond.shape[1] - 1):
        held_on = np.flatnonzero(beyond[:, slot] > 0)
        link, part = first[held_on] + slot, beyond[held_on, slot, None, None]
        cross = beyond[held_on, slot - 1, None, None] * part * mixed[link - 1] if slot else part * behind[link]
        place[held_on] += part**2 * steps[link] + cross + cross.transpose(0, 2, 1)
    return _with_coordinates(errors, place, rows, first, beyond)


def _steps(errors: ModelErrors) -> tuple[Floats, Floats]:
    """Covariances of the steps, shape (j, 7, 7), and of each with the next, shape (j - 1, 7, 7)."""
    both = errors.covariance[errors.first] + errors.covariance[errors.second]
    count = errors.models - 1
    steps = np.zeros((count, SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS))
    np.add.at(steps, errors.link, errors.gain @ both @ errors.gain.transpose(0, 2, 1))
    mixed = np.zeros((max(count - 1, 0), SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS))
    rows = np.flatnonzero((errors.before >= 0) & (errors.after >= 0))  # of a model between two links
    earlier, later = errors.gain[errors.after[rows]], errors.gain[errors.before[rows]]
    np.add.at(mixed, errors.model[rows] - 1, -earlier @ errors.covariance[rows] @ later.transpose(0, 2, 1))
    return steps, mixed


def _with_coordinates(errors: ModelErrors, place: Floats, rows: Numbers, first: Numbers, beyond: Floats) -> Floats:
    """Add what the coordinates of the nodes do to what their similarities do."""
    item, model, share = errors.item[rows], errors.model[rows], errors.share[rows]
    slot = model - first[item]
    mixed = np.zeros((len(place), SIMILARITY_PARAMETERS, 3))
    shares = share[:, None, None] * errors.covariance[rows]
    behind, ahead = errors.after[rows], errors.before[rows]
    inside = np.flatnonzero(behind >= 0)
    part = np.where(slot[inside] > 0, beyond[item[inside], np.maximum(slot[inside] - 1, 0)], 1.0)
    np.add.at(mixed, item[inside], -part[:, None, None] * (errors.gain[behind[inside]] @ shares[inside]))
    inside = np.flatnonzero(ahead >= 0)
    part = beyond[item[inside], slot[inside]]
    np.add.at(mixed, item[inside], part[:, None, None] * (errors.gain[ahead[inside]] @ shares[inside]))
    cross = errors.by_similarity @ mixed
    result = errors.by_similarity @ place @ errors.by_similarity.transpose(0, 2, 1) + cross + cross.transpose(0, 2, 1)
    np.add.at(result, item, share[:, None, None] * shares)
    return result


def far_ends(formed: FormedModels) -> Floats:
    """Uncertainty of the far end of the model after each link, in standard deviations of a coordinate.

    Returns (j,), largest standard deviation of a coordinate over the median one of a coordinate of the model.
    """
    models, solved = formed.models, formed.links.solved
    rows = np.flatnonzero((models.model > 0) & (models.node < models.points))
    link = models.model[rows] - 1
    moved = solved.similarities.of(link, models.xyz[rows])
    design = similarity_derivatives(moved - solved.centroid[link], np.zeros(3))
    variance = np.einsum("nij,njk,nik->ni", design, solved.cofactors[link], design).max(axis=1)
    scale = solved.similarities.scale
    found = np.zeros(len(scale))
    np.maximum.at(found, link, variance)
    stated = np.array([np.median(models.sigma[rows[link == number]]) for number in range(len(scale))])
    ratio: Floats = np.sqrt(found) / np.maximum(scale * stated, 1e-300)
    return ratio
