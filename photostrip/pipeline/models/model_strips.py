"""One strip of independent models, from model coordinates to adjusted points and perspective centres."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import Fault, GeometryError, InputError
from photostrip.pipeline.models import model_precision
from photostrip.pipeline.models.model_notes import link_notes
from photostrip.pipeline.results import ModelStages, StripResult
from photostrip.pipeline.strip import control_notes, control_of, polynomial_notes, to_ground, wrong_control_notes
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.gross_errors.control import control_screening
from photostrip.triangulation.independent_models import link_screening, linking, perspective_centers
from photostrip.triangulation.independent_models.formation import FormedModels, form_from_models, require_links
from photostrip.triangulation.polynomial import correction as polynomial

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.pipeline.inputs import MeasuredModels, ModelStrip, Settings
    from photostrip.points import ControlPoints, ModelPoints
    from photostrip.triangulation.independent_models.link_screening import ScreenedLinks
    from photostrip.triangulation.independent_models.linking import StripModels

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

LEAST_SOLID = 4  # points that can tell a body from its mirror image
CENTER = "center of photo "
MILLIMETRES = 1000.0  # in a metre
ADJUSTMENTS = ("polynomial", "similarity")


def adjust_all(
    models: MeasuredModels, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> tuple[StripResult, ...]:
    """Take all strips of independent models through the method.

    Returns
    -------
    tuple of StripResult
        In the project's order.

    Raises
    ------
    GeometryError, InputError
        As for ``adjust_models``; an adjustment that needs image coordinates is refused.
    """
    if settings.adjustment not in ADJUSTMENTS:
        fault = Fault(
            f"adjustment {settings.adjustment!r} needs image coordinates; the project gives model coordinates",
            code="needs-image-coordinates",
            key="processing.adjustment",
            expected=" or ".join(ADJUSTMENTS),
        )
        raise InputError(fault)
    require_named(settings.links, models.points)
    return tuple(adjust_models(strip, models.points, control, frames, settings) for strip in models.strips)


def require_named(settings: link_screening.LinkSettings, measured: ModelPoints) -> None:
    """Refuse entries of ``keep`` and ``drop`` that name nothing, and those in both.

    Raises
    ------
    InputError
        With a fault for each such entry.
    """
    if not (settings.keep or settings.drop):
        return
    nodes = [measured.name(node).removeprefix(CENTER) for node in measured.node.tolist()]
    known = {f"{measured.model_ids[k]}/{name}" for k, name in zip(measured.model.tolist(), nodes, strict=True)}
    faults = [
        Fault(
            f"`{entry}` names no measurement",
            code="no-such-measurement",
            key=f"processing.links.{key}",
            expected="model/point or model/photo, as in the table of models",
        )
        for key, entries in (("keep", settings.keep), ("drop", settings.drop))
        for entry in entries
        if entry not in known
    ]
    faults += [
        Fault(f"`{entry}` is to be kept and dropped", code="kept-and-dropped", key="processing.links.drop")
        for entry in settings.drop
        if entry in settings.keep
    ]
    if faults:
        raise InputError(faults)


def adjust_models(
    strip: ModelStrip, measured: ModelPoints, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Take one strip of independent models through the method.

    Parameters
    ----------
    strip : ModelStrip
        Photos and models in flight order.
    measured : ModelPoints
        Model coordinates of the whole project.
    control : ControlPoints
        Measured control of the project, no check points.

    Raises
    ------
    GeometryError, InputError
        When a link or the absolute orientation cannot be determined, or model coordinates or control are mirrored; the
        strip is named.
    """
    formed = form_models(strip, measured, settings)
    spread_at = partial(_precision, formed)
    here, rows = control_of(formed, control, measured.point_ids)
    try:
        intermediate, orientation, spread = to_ground(strip, formed, (here, rows), frames, spread_at)
    except InputError as error:
        if formed.upright or not _upside_down(error):
            raise _of_the_other_hand(strip, error) from error
        formed = formed.overturned()  # without centres nothing has told which way is up
        intermediate, orientation, spread = to_ground(strip, formed, (here, rows), frames, spread_at)
    _refuse_other_hand(strip, formed.xyz[rows], (here, frames, intermediate), spread)
    wrong: tuple[control_screening.ControlRejection, ...] = ()
    extent = _extent(formed, orientation)
    judged = None
    if settings.links.screening != "none":
        joint = model_precision.joint(formed, orientation, (here, rows), frames, intermediate)
        place = control_screening.StripAtControl(formed.xyz[rows], frames, intermediate, spread, *extent, joint)
        given = here
        here, wrong = control_screening.screen_control(given, place)
        judged = place.judged(given, here)
    if wrong:
        intermediate, orientation, spread = to_ground(strip, formed, (here, rows), frames, spread_at)
        extent = _extent(formed, orientation)
    xyz = orientation.similarity(formed.xyz)
    correction = None
    if settings.adjustment == "polynomial":
        targets = absolute_orientation.Targets(here, frames, intermediate)
        weight = absolute_orientation.weights(targets.turned(xyz[rows]), spread)
        correction = polynomial.fit(polynomial.FitProblem(xyz[rows], targets, weight, *extent), settings.polynomial)
    adjusted = xyz if correction is None else correction(xyz)
    places = _centers(formed, orientation, correction)
    depth = float(np.nanmean(places[:, 2]) - adjusted[:, 2].mean()) if np.isfinite(places).any() else float("nan")
    return StripResult(
        precision=spread,
        intermediate=intermediate,
        control=here,
        control_rows=rows,
        absolute=orientation,
        polynomial=correction,
        xyz=adjusted,
        cartesian=intermediate.cartesian_from_intermediate(adjusted),
        rays=formed.photo_count,
        depth=depth,
        notes=(
            *link_notes(strip, measured, formed),
            *wrong_control_notes(strip, wrong),
            *control_notes(strip, orientation),
            *polynomial_notes(strip, correction, adjusted),
        ),
        wrong_control=wrong,
        judged_control=judged,
        model_stages=ModelStages(
            strip=strip,
            formed=formed,
            centers=places,
            scales=orientation.similarity.scale * formed.places.scale * MILLIMETRES,
        ),
    )


def form_models(strip: ModelStrip, measured: ModelPoints, settings: Settings) -> FormedModels:
    """Link the models of a strip and form it, without any control.

    Parameters
    ----------
    strip : ModelStrip
        Photos and models in flight order.
    measured : ModelPoints
        Model coordinates of the whole project.

    Returns
    -------
    FormedModels
        The strip in the scale of its first model.

    Raises
    ------
    GeometryError, InputError
        When a link cannot be determined, or models are mirror images of each other.
    """
    models = models_of(strip, measured, settings.links)
    shared = linking.common(models)
    try:
        require_links(shared, models, np.ones(len(shared.link), bool), strip.models)
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, code=error.code) from error
    kept = _named(settings.links.keep, strip, measured, models)
    links = link_screening.screen_links(shared, models, settings.links, kept[shared.before] | kept[shared.after])
    _refuse_reflected(strip, links)
    number = {photo: node for node, photo in enumerate(measured.photo_ids, len(measured.point_ids))}
    photos = np.array([number.get(photo, -1) for photo in strip.photos], np.intp)
    return form_from_models(models, links, photos)


def models_of(strip: ModelStrip, measured: ModelPoints, settings: link_screening.LinkSettings) -> StripModels:
    """Take the models of a strip out of those of the project, without what the user drops.

    Returns
    -------
    StripModels
        Rows in the order of the models, then of the points.
    """
    number = {name: k for k, name in enumerate(strip.models)}
    place = np.array([number.get(name, -1) for name in measured.model_ids], np.intp)[measured.model]
    rows = np.flatnonzero(place >= 0)
    rows = rows[np.lexsort((measured.node[rows], place[rows]))]
    whole = linking.StripModels(
        len(strip.models),
        len(measured.point_ids),
        rows,
        place[rows],
        measured.node[rows],
        measured.xyz[rows],
        measured.sigma[rows],
    )
    left = ~_named(settings.drop, strip, measured, whole)
    return linking.StripModels(
        whole.count, whole.points, rows[left], whole.model[left], whole.node[left], whole.xyz[left], whole.sigma[left]
    )


def _named(names: Sequence[str], strip: ModelStrip, measured: ModelPoints, models: StripModels) -> Flags:
    """Rows that the user names as ``model/point`` or ``model/photo``."""
    found = np.zeros(len(models.model), bool)
    wanted = set(names)
    if wanted:
        for row, (model, node) in enumerate(zip(models.model.tolist(), models.node.tolist(), strict=True)):
            found[row] = f"{strip.models[model]}/{measured.name(node).removeprefix(CENTER)}" in wanted
    return found


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
        f"strip {strip.id}: {listed} of the others: x and y are exchanged, or one axis has the other sign",
        code="mirrored-model",
        key="models.file",
        expected="all models in axes of the same hand",
        fix="exchange x and y in the table, or change the sign of one column",
    )
    raise InputError(fault)


def _upside_down(error: InputError) -> bool:
    """Whether a strip fits its control only upside down."""
    return any(fault.code == "left-handed-control" for fault in error.faults)


def _of_the_other_hand(strip: ModelStrip, error: InputError) -> InputError:
    """Say of a strip that fits its control upside down that the models may be left-handed as well."""
    return _left_handed(strip) if _upside_down(error) else error


def _refuse_other_hand(
    strip: ModelStrip,
    xyz: Floats,
    given: tuple[ControlPoints, Sequence[GroundFrame], IntermediateFrame],
    spread: tuple[float, float],
) -> None:
    """Refuse a strip that a mirror image of it would fit far better; flat ground does not tell."""
    control, frames, intermediate = given
    full = control.use.all(axis=1)
    if full.sum() < LEAST_SOLID:
        return
    targets = absolute_orientation.Targets(control, frames, intermediate).of(xyz)[full]
    own, other = linking.either_hand(xyz[full], targets)
    expected = ((control.sigma[full] ** 2).sum(axis=1) + 2 * spread[0] ** 2 + spread[1] ** 2).sum()
    if own > link_screening.CONSPICUOUS * expected and other < link_screening.REFLECTED * own:
        raise _left_handed(strip)


def _left_handed(strip: ModelStrip) -> InputError:
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


def _precision(formed: FormedModels, scale: float) -> tuple[float, float]:
    """A-priori standard deviation of a point of one model in plan and height, metres."""
    models, places = formed.models, formed.places
    turn = (scale * places.scale)[:, None, None] * places.rotation
    variance = np.einsum("nij,nj->ni", turn[models.model] ** 2, models.sigma**2) * formed.links.factor
    point = models.node < models.points
    plan, height = np.median(variance[point, :2].mean(axis=1)), np.median(variance[point, 2])
    return float(np.sqrt(plan)), float(np.sqrt(height))


def _extent(formed: FormedModels, orientation: absolute_orientation.AbsoluteOrientation) -> tuple[float, float]:
    """Mean base and half width of the strip, metres."""
    xyz = orientation.similarity(formed.xyz)
    base = np.linalg.norm(np.diff(orientation.similarity(formed.centers), axis=0), axis=1)
    length = np.ptp(xyz[:, 0]) / formed.models.count
    spacing = float(base[np.isfinite(base)].mean()) if np.isfinite(base).any() else float(length)
    return spacing, max(float(np.quantile(np.abs(xyz[:, 1]), 0.95)), 1e-6)


def _centers(
    formed: FormedModels,
    orientation: absolute_orientation.AbsoluteOrientation,
    correction: polynomial.Polynomial | None,
) -> Floats:
    """Perspective centres, moved with the ground below them."""
    placed = orientation.similarity(formed.centers)
    known = np.isfinite(placed).all(axis=1)
    if correction is None or not known.any():
        return placed
    here, axes = placed[known], correction.axes
    above = perspective_centers.heights_above(here, orientation.similarity(formed.xyz))
    rows = perspective_centers.displacement_rows(here, above, [axis.terms for axis in axes])
    placed[known] = here + sum(row @ axis.coefficients for row, axis in zip(rows, axes, strict=True))
    return placed
