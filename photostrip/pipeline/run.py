"""Control left out in turn: how far off the same adjustment is where it does not know the ground.

The strips are formed and their control is searched once; what is repeated is absolute orientation, polynomials or
bundle adjustment, and precision.

The whole walk, as a table of contents: numbers are those of the method in README.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Finding, Note
from photostrip.pipeline import formed_photos, gate
from photostrip.pipeline.block_adjustment import adjust_block
from photostrip.pipeline.block_start import FormedStrips, laid_on_ground
from photostrip.pipeline.frames import (
    GroundFrames,
    PhotoCoordinates,
    TiedFrames,
    curvature_notes,
    datum_notes,
    orient_interior,
    tie_ground_frames,
)
from photostrip.pipeline.given_points import (
    compare_with_given,
    measured_control,
    rejected_control,
    unchecked_control_notes,
)
from photostrip.pipeline.inputs import AUTO, BUNDLE, POLYNOMIAL, Inputs, Settings, require_runnable, require_whole
from photostrip.pipeline.precision import join_photos, join_strips, mean_points, not_determined
from photostrip.pipeline.results import AdjustedStrips, Fold, Result
from photostrip.pipeline.strip_method import (
    adjust_formed,
    adjusted,
    as_single_photos,
    form_photos,
    form_strips,
    on_control,
)
from photostrip.points import PhotoPoints
from photostrip.strip import corrections

FOLDS = 10  # adjustments that are made at most


def cross_validate(result: Result, adjust: Callable[[Inputs], Result]) -> tuple[Fold, ...]:
    """Adjust again without each point of the control, or without each of so many groups, and compare with it there.

    adjust: adjusts the formed strips with other control.
    """
    control, folds = result.inputs.control, []
    # nothing is searched again in strips: what the whole rejected stays out; a bundle leaves it out by itself
    use = control.use & ~rejected_control(result) if result.bundle is None else control.use
    taken = np.flatnonzero(~control.check & use.any(axis=1))
    for group in _groups(result):
        left_out = np.isin(np.arange(len(control)), group)
        given = replace(control, check=left_out, use=use).take(taken)
        ids = tuple(control.ids[row] for row in np.sort(group))
        try:
            folds.append(Fold(ids, adjust(replace(result.inputs, control=given))))
        except (GeometryError, InputError, np.linalg.LinAlgError) as error:
            folds.append(Fold(ids, None, str(error)))
    return tuple(folds)


def _groups(result: Result) -> list[Numbers]:
    """Return rows of the control to be left out together: single points, or points as far apart as can be.

    Control that was found wrong says nothing about the result and is not among them.
    """
    control = result.inputs.control
    used = control.use.any(axis=1) & ~control.check & ~rejected_control(result).any(axis=1)
    rows = np.flatnonzero(used & (result.control_rows >= 0))
    if len(rows) <= FOLDS:
        return [rows[[number]] for number in range(len(rows))]
    place = result.points.cartesian[result.control_rows[rows]]
    _, _, axes = np.linalg.svd(place - place.mean(axis=0), full_matrices=False)
    along = rows[np.argsort(place @ axes[0], kind="stable")]
    return [along[number::FOLDS] for number in range(FOLDS)]


@dataclass(frozen=True)
class Heights:
    """Mean heights above the ellipsoid, metres, or above the plane of a local frame."""

    flying: float
    ground: float


def correct(photo: PhotoCoordinates, inputs: Inputs, settings: Settings, ground: GroundFrames) -> corrections.Refined:
    """Image coordinates reduced to the principal point, free of distortion and refraction.

    Refraction and Earth curvature need heights; where they are not given, they are those of the strips without these
    corrections.
    """
    if inputs.models is not None:  # there are none: the observations only name the points
        return corrections.Refined(photo.observations, {})
    wanted = settings.refinement
    if wanted.needs_heights and (wanted.flying_height is None or wanted.ground_height is None):
        plain = replace(wanted, refraction=False, earth_radius=None)
        bent = corrections.refine(photo.observations, inputs.cameras, plain).observations
        heights = heights_of(bent, inputs, settings, ground)
        wanted = replace(wanted, flying_height=heights.flying, ground_height=heights.ground)
    return corrections.refine(photo.observations, inputs.cameras, wanted)


def heights_of(observations: PhotoPoints, inputs: Inputs, settings: Settings, ground: GroundFrames) -> Heights:
    """Mean heights of cameras and ground from the strips, adjusted as they will be, in the frames of the run."""
    control = measured_control(inputs.control, observations)
    formed = form_photos(inputs, observations, settings)
    if settings.together:
        adjusted = adjust_block(inputs, settings, observations, control, ground, formed)
        strips, points = adjusted.strips, adjusted.points.cartesian
        singles = () if adjusted.bundle is None else adjusted.bundle.singles
    else:
        strips = tuple(adjust_formed(stage, control, ground.control, settings) for stage in formed)
        points, singles = mean_points(strips).xyz, ()
    of_strips = [strip.intermediate.cartesian_from_intermediate(strip.placed.centers) for strip in strips]
    centers = np.concatenate([*of_strips, *(single.center[None] for single in singles)])
    frame = ground.control[0] if ground.control else ground.output
    return Heights(float(_heights(centers, frame).mean()), float(_heights(points, frame).mean()))


def _heights(points: Floats, frame: GroundFrame) -> Floats:
    heights: Floats = points[:, 2] if frame.kind == "local" else frame.geodetic(points)[:, 2]
    return heights


def triangulate(
    inputs: Inputs,
    settings: Settings,
    *,
    directory: Path | None = None,
    tied: TiedFrames | None = None,
) -> Result:
    """Take a project through the whole strip method.

    directory: the project file's directory, where grids named by the frames are looked for first.
    tied: frames of these inputs that have been tied already; those of other inputs are not used.
    Raises InputError when the settings or frames contradict each other or the control is left-handed.
    Raises GeometryError when a pair, a junction or the absolute orientation cannot be determined.

    Either error carries in ``findings`` what the data say against themselves.
    """
    ground = photo = None
    try:
        require_runnable(inputs, settings)
        ground = tie_ground_frames(inputs, settings, directory, tied)
        require_whole(inputs, ground.control)
        # 1 interior orientation
        photo = orient_interior(inputs, settings)
        gate.require_sound(inputs, settings, photo, directory)
        result = _walk_of_any_order(inputs, settings, ground, photo)
    except (InputError, GeometryError) as error:
        error.findings = _of_failure(inputs, settings, directory, ground, photo, error)
        raise
    except np.linalg.LinAlgError as error:
        msg = f"the data contradict themselves so much that an equation cannot be solved ({str(error).lower()})"
        unsolvable = GeometryError(msg, code="singular")
        unsolvable.findings = gate.of_failure(inputs, settings, directory, photo, ground)
        raise unsolvable from error
    return replace(result, findings=gate.of_result(result, directory))


def _of_failure(
    inputs: Inputs,
    settings: Settings,
    directory: Path | None,
    ground: GroundFrames | None,
    photo: PhotoCoordinates | None,
    error: InputError | GeometryError,
) -> tuple[Finding, ...]:
    """Find out why a run failed: strips that can be adjusted each by itself say more than strips only formed."""
    if inputs.orientations is not None and inputs.orientations.has_own_frame:
        inputs = replace(inputs, orientations=None)  # nothing can be said against them
    broken = error.photos if isinstance(error, GeometryError) else ()
    if settings.adjustment == BUNDLE and not broken and ground is not None and photo is not None:
        try:
            result = _walk(inputs, replace(settings, adjustment=POLYNOMIAL), ground, photo)
        except (GeometryError, InputError, np.linalg.LinAlgError):
            pass
        else:
            return gate.of_result(result, directory)
    return gate.of_failure(inputs, settings, directory, photo, ground, broken)


def _walk_of_any_order(inputs: Inputs, settings: Settings, ground: GroundFrames, photo: PhotoCoordinates) -> Result:
    """Walk from each of the starts that photos which are listed in no order have, until one leads to the end."""
    if all(strip.listed for strip in inputs.strips):
        return _walk_by_any_method(inputs, settings, ground, photo)

    refused: list[GeometryError] = []
    for start in formed_photos.starts(inputs, photo.observations, settings):
        try:
            result = _walk_by_any_method(start.inputs, settings, ground, photo)
        except GeometryError as error:
            refused.append(error)
        else:
            return replace(result, notes=(*formed_photos.notes(start, refused), *result.notes))
    raise formed_photos.refusal(inputs, refused[0]) from refused[0]


def _walk_by_any_method(inputs: Inputs, settings: Settings, ground: GroundFrames, photo: PhotoCoordinates) -> Result:
    """Walk, with `auto` again strip by strip with polynomials where a bundle cannot be had."""
    try:
        return _walk_from_orientations(inputs, settings, ground, photo)
    except GeometryError as error:
        if settings.adjustment != AUTO:
            raise
        try:
            result = _walk(inputs, replace(settings, adjustment=POLYNOMIAL), ground, photo)
        except (GeometryError, InputError):
            raise error from None
        text = f"no bundle adjustment could be had, each strip is adjusted by polynomials in its place: {error}"
        note = Note("no-bundle", text, photos=error.photos, points=error.points)
        return replace(result, settings=settings, notes=(note, *result.notes))


def _walk_from_orientations(
    inputs: Inputs, settings: Settings, ground: GroundFrames, photo: PhotoCoordinates
) -> Result:
    """Walk, and again with single photos in the place of a strip that cannot be formed."""
    try:
        return _walk(inputs, settings, ground, photo)
    except GeometryError as error:
        cut = as_single_photos(inputs, settings, error)
        if cut is None:
            raise
        try:
            result = _walk_from_orientations(cut, settings, ground, photo)
        except GeometryError:
            raise error from None
        starts = "from their given orientations" if inputs.orientations is not None else "on points of the other strips"
        text = f"{error}; all photos of the strip start {starts} in its place"
        note = Note("not-formed", text, photos=error.photos)
        return replace(result, notes=(note, *result.notes))


def _walk(inputs: Inputs, settings: Settings, ground: GroundFrames, photo: PhotoCoordinates) -> Result:
    """Every stage takes what the stages before it found."""
    # 1 lens distortion, refraction
    refined = correct(photo, inputs, settings, ground)
    inputs, ground, laid = laid_on_ground(inputs, refined.observations, ground)
    # 2-3 relative orientation; base direction, orientation chain, space intersection, scale transfer
    formed = form_strips(inputs, refined.observations, settings)

    def on_the_ground(inputs: Inputs, whole: Result | None = None) -> Result:
        adjusted = _adjusted(inputs, settings, ground, refined.observations, formed, whole)
        missing = {}
        if whole is None:
            missing = not_determined(adjusted, inputs)
        # 6 residuals, check points
        rows, differences = compare_with_given(inputs.control, ground.control, adjusted.points, adjusted.observations)
        return Result(
            inputs=replace(inputs, orientations=None) if laid else inputs,  # they are ours, and nothing to be judged
            settings=settings,
            frames=ground.control,
            output=ground.output,
            measured=photo.observations,
            interior=photo.interior,
            refined=replace(refined, observations=adjusted.observations),
            strips=adjusted.strips,
            points=adjusted.points,
            control_rows=rows,
            control_differences=differences,
            ties=adjusted.ties,
            not_determined=missing,
            notes=(
                *(photo.interior.notes if photo.interior is not None else ()),
                *laid,
                *adjusted.notes,
                *curvature_notes(inputs, settings, adjusted.strips),
                *datum_notes(inputs, ground),
                *unchecked_control_notes(adjusted, settings.bundle.power),
            ),
            precision=adjusted.precision,
            bundle=adjusted.bundle,
        )

    result = on_the_ground(inputs)
    # 6 what the result says of control that it has not seen
    if not settings.cross_validation:
        return result

    return replace(result, folds=cross_validate(result, partial(on_the_ground, whole=result)))


def _adjusted(
    inputs: Inputs,
    settings: Settings,
    ground: GroundFrames,
    observations: PhotoPoints,
    formed: FormedStrips,
    whole: Result | None,
) -> AdjustedStrips:
    """Bring formed strips to the ground and adjust them, all in one network or each by itself."""
    control = measured_control(inputs.control, observations)
    if settings.together:
        # 4-5 all strips at once
        before = None if whole is None else whole.bundle
        return adjust_block(inputs, settings, observations, control, ground, formed, before)
    # 4-5 intermediate frame, absolute orientation, wrong control, polynomials
    of_models, again = inputs.models is not None, whole is not None
    if whole is not None and not of_models:  # without the wrong images of control that the whole adjustment found
        formed = [strip.of_photos for strip in whole.strips]
    searched = again and not of_models
    screened = [on_control(stage, control, ground.control, settings, searched=searched) for stage in formed]
    strips = tuple(adjusted(strip, settings) for strip in screened)
    if of_models:
        return join_strips(strips, observations, ground.output)
    # 6 back to the map, with standard deviations
    return join_photos(strips, screened, observations, inputs.control, ground.output, settings, of_checks=again)
