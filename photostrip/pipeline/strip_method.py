"""A strip of independent models: its models linked, its perspective centres moved with the ground below them.

All strips of a project: formed without any control, and corrected by polynomials for what the similarity leaves.

Source: [001] eq. 150-152.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.similarity import Similarity
from photostrip.network.adjustment import BundleSolution, solve
from photostrip.network.problem import BundleCameras, BundleProblem, ModelObservations, StartValues
from photostrip.network.reliability import joint_cofactors
from photostrip.pipeline import photos_on_control
from photostrip.pipeline.formed_photos import FormedPhotos, form_strip
from photostrip.pipeline.inputs import (
    SIMILARITY,
    Inputs,
    ModelStrip,
    Settings,
    Strip,
    require_measured,
    require_named,
    require_weighted,
    rows_of_models,
)
from photostrip.pipeline.photos_on_control import (
    OrientedStrip,
    ScreenedPhotos,
    control_of,
    link_notes,
    strip_at_control,
    to_ground,
)
from photostrip.pipeline.results import ModelStages, StripResult
from photostrip.points import ControlPoints, ModelPoints, PhotoPoints, locate, take_rows
from photostrip.strip import absolute_orientation, control_screening, linked_models, polynomial
from photostrip.strip.linked_models import (
    FormedModels,
    LinkSettings,
    ScreenedLinks,
    StripModels,
    form_from_models,
    require_links,
)
from photostrip.strip.polynomial import Polynomial
from photostrip.units import MILLIMETRES

OVER = np.array([1.0, -1.0, -1.0])  # turns a strip by 180 degrees about its X axis
LEAST_SOLID = 4  # points that can tell a body from its mirror image


@dataclass(frozen=True, eq=False)
class LinkedModels:
    """A strip of independent models before it meets its control."""

    strip: ModelStrip
    measured: ModelPoints  # model coordinates of the whole project
    formed: FormedModels  # with points and models as all its links together place them
    network: BundleSolution  # of its models alone, in the system of the strip; points are those of the project
    over: bool = False  # whether the strip has been turned over since

    @property
    def point_precision(self) -> absolute_orientation.PointPrecision:
        """A-priori standard deviation of a point of one model, in the unit of the strip."""
        models, places = self.formed.models, self.formed.places
        turn = places.scale[:, None, None] * places.rotation
        variance = np.einsum("nij,nj->ni", turn[models.model] ** 2, models.sigma**2) * self.formed.links.factor
        point = models.node < models.points
        plan, height = np.median(variance[point, :2].mean(axis=1)), np.median(variance[point, 2])
        return absolute_orientation.PointPrecision(float(np.sqrt(plan)), float(np.sqrt(height)))

    def overturned(self) -> LinkedModels:
        """Return the strip turned by 180 degrees about its X axis; its network stays as it was."""
        return replace(self, formed=self.formed.overturned(), over=not self.over)


class OrientedModels(NamedTuple):
    """A strip of independent models with the similarity that lays it on its control."""

    linked: LinkedModels  # as it was laid
    oriented: OrientedStrip

    def misclosure_covariance(self, some: Numbers) -> Floats:
        """Covariance of misclosures at the control, strip and control together, metres^2, but for a similarity."""
        linked, similarity = self.linked, self.oriented.absolute.similarity
        found = self.oriented.misclosures.take(some)
        node = linked.formed.point[found.row]
        turned = similarity.rotation * (OVER if linked.over else 1.0)
        rows, across = np.arange(len(some)), found.direction @ turned * similarity.scale
        columns = 3 * node[:, None] + np.arange(3)
        places = (np.repeat(rows, 3), columns.ravel())
        functions = csr_array((across.ravel(), places), shape=(len(some), 3 * len(linked.network.points)))
        joint = joint_cofactors(linked.network, functions) * linked.formed.links.factor
        return np.asarray(joint + np.diag(found.variance), float)


class ScreenedModels(NamedTuple):
    """A strip of independent models on the control that is not contradicted by the strip and the other control."""

    models: OrientedModels
    screened_control: control_screening.ScreenedControl


def models_on_control(
    linked: LinkedModels,
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: Settings,
) -> ScreenedModels:
    """Lay a strip on that of its control which nothing contradicts.

    Raises as ``orient_models_on_control`` does.
    """
    models = orient_models_on_control(linked, control, frames, settings.absolute)
    if settings.links.screening == "none":
        return ScreenedModels(models, control_screening.not_screened(models.oriented.control))
    oriented = models.oriented
    screened = control_screening.screen_control(strip_at_control(oriented, (), models.misclosure_covariance))
    if screened.rejections:
        models = orient_models_on_control(linked, screened.kept, frames, settings.absolute)
    return ScreenedModels(models, screened)


def orient_models_on_control(
    linked: LinkedModels,
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedModels:
    """Lay a strip on its control; upside down where without perspective centres nothing has told which way is up.

    Raises GeometryError, InputError when the control does not determine the similarity, or strip and control are of
        different hands; the strip is named.
    """
    strip, formed = linked.strip, linked.formed
    inside, rows = control_of(formed, control, linked.measured.point_ids)
    try:
        oriented = to_ground(strip, formed, linked.point_precision, inside, rows, frames, settings)
    except InputError as refusal:
        if not any(fault.code == "left-handed-control" for fault in refusal.faults):
            raise
        if formed.upright:
            raise _left_handed(strip) from refusal
        linked = linked.overturned()
        oriented = to_ground(strip, linked.formed, linked.point_precision, inside, rows, frames, settings)
    _refuse_other_hand(oriented)
    return OrientedModels(linked, oriented)


def _refuse_other_hand(oriented: OrientedStrip) -> None:
    """Refuse a strip that a mirror image of it would fit far better; flat ground does not tell."""
    control, spread = oriented.control, oriented.precision
    full = control.use.all(axis=1)
    if full.sum() < LEAST_SOLID:
        return
    xyz = oriented.formed.xyz[oriented.control_rows]
    targets = oriented.targets.of(xyz)[full]
    as_it_is, mirrored = linked_models.either_hand(xyz[full], targets)
    expected = ((control.sigma[full] ** 2).sum(axis=1) + 2 * spread.plan**2 + spread.height**2).sum()
    conspicuous = as_it_is > linked_models.CONSPICUOUS * expected
    if conspicuous and mirrored < linked_models.REFLECTED * as_it_is:
        raise _left_handed(oriented.strip)


def adjusted_models(screened: ScreenedModels, correction: Polynomial | None) -> StripResult:
    """Adjust the points, and move the perspective centres with the ground below them."""
    linked, oriented = screened.models
    strip, formed = linked.strip, linked.formed
    xyz = oriented.xyz if correction is None else correction(oriented.xyz)
    similarity = oriented.absolute.similarity
    centers = _centers(formed, similarity, correction)
    return StripResult(
        precision=oriented.precision,
        intermediate=oriented.intermediate,
        control=oriented.control,
        control_rows=oriented.control_rows,
        absolute=oriented.absolute,
        polynomial=correction,
        xyz=xyz,
        cartesian=oriented.intermediate.cartesian_from_intermediate(xyz),
        rays=formed.photo_count,
        depth=depth_of(centers, xyz),
        notes=(
            *link_notes(strip, linked.measured, formed),
            *photos_on_control.wrong_control_notes(strip, screened.screened_control),
            *photos_on_control.control_notes(strip, oriented.absolute),
            *photos_on_control.polynomial_notes(strip, correction, xyz),
        ),
        screened_control=screened.screened_control,
        model_stages=ModelStages(
            strip=strip,
            formed=formed,
            centers=centers,
            rotations=similarity.rotation @ formed.places.rotation,
            scales=similarity.scale * formed.places.scale * MILLIMETRES,
        ),
    )


def depth_of(centers: Floats, xyz: Floats) -> float:
    """Mean height of perspective centres above the points, metres; NaN without any."""
    known = np.isfinite(centers).any()
    return float(np.nanmean(centers[:, 2]) - xyz[:, 2].mean()) if known else float("nan")


def link_strip(strip: ModelStrip, measured: ModelPoints, settings: Settings) -> LinkedModels:
    """Link the models of a strip and adjust them by themselves, without any control."""
    formed = form_models(strip, measured, settings)
    models, places = formed.models, formed.places
    rows = np.flatnonzero(formed.used)
    of_project = models.row[rows]
    nodes = np.zeros((len(measured.point_ids) + len(measured.photo_ids), 3))
    nodes[formed.node] = formed.node_xyz
    network = solve(
        BundleProblem(
            images=ModelObservations(
                photo=models.model[rows],
                point=models.node[rows],
                xy=models.xyz[rows],
                sigma=models.sigma[rows],
                correlation=None if measured.correlation is None else measured.correlation[of_project],
            ),
            cameras=BundleCameras(of_photo=np.zeros(0, np.intp), focal=np.zeros(0)),
            start=StartValues(centers=places.shift, rotations=places.rotation, points=nodes, scales=places.scale),
            photo_ids=strip.models,
            point_ids=tuple(map(measured.name, range(len(nodes)))),
        )
    )
    adjusted = linked_models.Similarities(network.scales, network.rotations, network.centers)
    formed = replace(
        formed,
        places=adjusted,
        model_xyz=adjusted.of(models.model, models.xyz),
        node_xyz=network.points[formed.node],
    )
    return LinkedModels(strip=strip, measured=measured, formed=formed, network=network)


def form_models(strip: ModelStrip, measured: ModelPoints, settings: Settings) -> FormedModels:
    """Link the models of a strip and form it, without any control.

    measured: model coordinates of the whole project.
    Raises GeometryError, InputError when a link cannot be determined, or models are mirror images of each other.
    """
    models = models_of(strip, measured, settings.links)
    shared = linked_models.common(models)
    try:
        require_links(shared, models, np.ones(len(shared.link), bool), strip.models)
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, code=error.code) from error
    kept = rows_of_models(settings.links.keep, measured)[models.row]
    links = linked_models.screen_links(shared, models, settings.links, kept[shared.before] | kept[shared.after])
    _refuse_reflected(strip, links)
    photos = locate(strip.photos, measured.photo_ids)
    return form_from_models(models, links, np.where(photos < 0, -1, photos + len(measured.point_ids)))


def models_of(strip: ModelStrip, measured: ModelPoints, settings: LinkSettings) -> StripModels:
    """Take the models of a strip out of those of the project, row by row in flight order, without what is dropped."""
    place = locate(measured.model_ids, strip.models)[measured.model]
    rows = np.flatnonzero(place >= 0)
    rows = rows[np.lexsort((measured.node[rows], place[rows]))]
    whole = linked_models.StripModels(
        count=len(strip.models),
        points=len(measured.point_ids),
        row=rows,
        model=place[rows],
        node=measured.node[rows],
        xyz=measured.xyz[rows],
        sigma=measured.sigma[rows],
    )
    left = ~rows_of_models(settings.drop, measured)[rows]
    return take_rows(whole, left, ("row", "model", "node", "xyz", "sigma"))


def _refuse_reflected(strip: ModelStrip, links: ScreenedLinks) -> None:
    """Refuse models that are mirror images of their neighbours; the smaller group is named."""
    if not links.reflected.any():
        return
    hand = np.concatenate([[0], np.cumsum(links.reflected)]) % 2
    minority = hand if 2 * hand.sum() <= len(hand) else 1 - hand
    names = [name for name, odd in zip(strip.models, minority.tolist(), strict=True) if odd]
    listed = (
        f"model {names[0]} is a mirror image" if len(names) == 1 else f"models {', '.join(names)} are mirror images"
    )
    fault = Fault(
        f"strip {strip.id}: {listed} of the others: x and y are exchanged, or one axis has the wrong sign",
        code="mirrored-model",
        key="models.file",
        expected="all models in axes of the same hand",
        fix="exchange x and y in the table, or change the sign of one column",
    )
    raise InputError(fault)


def _left_handed(strip: Strip | ModelStrip) -> InputError:
    """Say that models and control are of different hands."""
    return InputError(
        Fault(
            f"strip {strip.id} fits its control only as a mirror image: the model coordinates or the control are "
            "left-handed",
            code="left-handed-models",
            key="models.axes",
            expected="right-handed, or left-handed when the axes of the plotter are",
            fix="set `models.axes: left-handed`, or put the axes of the control in the order of its columns",
        )
    )


def _centers(formed: FormedModels, similarity: Similarity, correction: Polynomial | None) -> Floats:
    """Perspective centres, moved with the ground below them."""
    placed = similarity(formed.centers)
    known = np.isfinite(placed).all(axis=1)
    if correction is None or not known.any():
        return placed
    found, axes = placed[known], correction.axes
    above = linked_models.heights_above(found, similarity(formed.xyz))
    rows = linked_models.displacement_rows(found, above, [axis.terms for axis in axes])
    placed[known] = found + sum(row @ axis.coefficients for row, axis in zip(rows, axes, strict=True))
    return placed


def form_strips(
    inputs: Inputs, observations: PhotoPoints, settings: Settings
) -> list[FormedPhotos] | list[LinkedModels]:
    """Form the strips of a project, of photos or of independent models, each by itself."""
    models = inputs.models
    if models is None:
        return form_photos(inputs, observations, settings)
    require_named(settings.links, models.points)
    return [link_strip(strip, models.points, settings) for strip in models.strips]


def form_photos(inputs: Inputs, observations: PhotoPoints, settings: Settings) -> list[FormedPhotos]:
    """Form the strips of photos; a single photo, which only a bundle adjustment can orient, forms nothing."""
    require_measured(settings.relative, observations)
    require_weighted(settings.formation, observations)
    whole = [strip for strip in inputs.strips if len(strip.photos) > 1]
    if len(whole) < len(inputs.strips) and not settings.together:
        alone = next(strip.photos for strip in inputs.strips if len(strip.photos) == 1)
        msg = f"photo {alone[0]} is no strip: only a bundle adjustment can orient it"
        raise GeometryError(msg, photos=alone, code="one-photo")
    return [form_strip(strip, observations, settings) for strip in whole]


def as_single_photos(inputs: Inputs, settings: Settings, refused: GeometryError) -> Inputs | None:
    """Cut the strip that a refusal is about into single photos, to start from given orientations or on others' points.

    A bundle that diverges names none: then all strips are cut.

    None where orientations are not given for all photos and no strip is left beside them, the bundle rejects nothing,
    or positions of a strip share an error.
    """
    positions, named = inputs.positions, set(refused.photos)
    known = set() if inputs.orientations is None else set(inputs.orientations.photos)
    several = [strip for strip in inputs.strips if len(strip.photos) > 1 and named <= set(strip.photos)]
    if not several or not (named or refused.code == "bundle-diverged"):
        return None
    left = any(len(strip.photos) > 1 and strip not in several for strip in inputs.strips)
    if not left and not all(known.issuperset(strip.photos) for strip in several):
        return None
    if not settings.together or "none" in {settings.bundle.screening, settings.relative.screening}:
        return None
    if positions is not None and positions.correction != "none" and positions.group == "strip":
        return None

    def cut(strip: Strip) -> list[Strip]:
        names = [f"{strip.id}/{photo}" if strip.listed else photo for photo in strip.photos]
        singles = [replace(strip, id=name, photos=(photo,)) for name, photo in zip(names, strip.photos, strict=True)]
        return singles if strip in several else [strip]

    return replace(inputs, strips=tuple(chain(*map(cut, inputs.strips))))


def adjust_photos(screened: ScreenedPhotos, settings: Settings) -> StripResult:
    """Correct the deformation of a strip and orient its photos on the corrected points."""
    return photos_on_control.adjusted(screened, _correction(screened.photos.oriented, settings), settings)


def adjust_formed(
    stage: FormedPhotos | LinkedModels, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Lay a formed strip on its control and correct its deformation."""
    if isinstance(stage, FormedPhotos):
        return adjust_photos(photos_on_control.on_control(stage, control, frames, settings), settings)
    found = models_on_control(stage, control, frames, settings)
    return adjusted_models(found, _correction(found.models.oriented, settings))


def _correction(oriented: OrientedStrip, settings: Settings) -> polynomial.Polynomial | None:
    if settings.adjustment == SIMILARITY:
        return None
    spacing, breadth = oriented.extent
    problem = polynomial.FitProblem(
        xyz=oriented.at_control, targets=oriented.targets, weight=oriented.weights, spacing=spacing, breadth=breadth
    )
    return polynomial.fit(problem, settings.polynomial)
