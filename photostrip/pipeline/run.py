"""The whole walk, as a table of contents: numbers are those of the method in README.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from photostrip.errors import GeometryError, InputError
from photostrip.notes import Finding, Note
from photostrip.pipeline.common_points import join_strips
from photostrip.pipeline.frames import GroundFrames, TiedFrames, curvature_notes, datum_notes, tie_ground_frames
from photostrip.pipeline.given_points import compare_with_given, measured_control
from photostrip.pipeline.image_coordinates import PhotoCoordinates, correct, orient_interior
from photostrip.pipeline.inputs import AUTO, POLYNOMIAL, Inputs, Settings
from photostrip.pipeline.not_determined import not_determined
from photostrip.pipeline.plausibility import gate
from photostrip.pipeline.refusals import require_runnable, require_whole
from photostrip.pipeline.results import AdjustedStrips, Result
from photostrip.pipeline.strips.absolute import StripStage, on_control
from photostrip.pipeline.strips.adjusting import adjust
from photostrip.pipeline.strips.forming import as_single_photos, form_strips
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.pipeline.strips.stages import Stages
from photostrip.pipeline.unchecked_control import unchecked_control_notes
from photostrip.points import PhotoPoints


def triangulate(
    inputs: Inputs,
    settings: Settings,
    *,
    directory: Path | None = None,
    tied: TiedFrames | None = None,
    stages: Stages | None = None,
) -> Result:
    """Take a project through the whole strip method.

    directory: the project file's directory, where grids named by the frames are looked for first.
    tied: frames of these inputs that have been tied already; those of other inputs are not used.
    stages: what runs with other settings have made, and what they may take over from this one.
    Raises InputError when the settings or frames contradict each other or the control is left-handed.
    Raises GeometryError when a pair, a junction or the absolute orientation cannot be determined.

    Either error carries in ``findings`` what the data say against themselves.
    """
    ground = photo = None
    stages = stages or Stages("pairs")

    def of_failure() -> tuple[Finding, ...]:
        find = partial(gate.of_failure, inputs, settings, directory, photo, ground, stages)
        # of several methods that fail the first is told of: another need not look again
        return stages.once("failure", find, inputs, _of_any_method(settings), photo is None, ground is None)

    try:
        require_runnable(inputs, settings)
        ground = tie_ground_frames(inputs, settings, directory, tied)
        require_whole(inputs, ground.control)
        # 1 interior orientation
        photo = orient_interior(inputs, settings)
        result = _walk_by_any_method(inputs, settings, ground, photo, stages)
    except (InputError, GeometryError) as error:
        error.findings = of_failure()
        raise
    except np.linalg.LinAlgError as error:
        msg = f"the data contradict themselves so much that an equation cannot be solved ({str(error).lower()})"
        unsolvable = GeometryError(msg, code="singular")
        unsolvable.findings = of_failure()
        raise unsolvable from error
    return replace(result, findings=gate.of_result(result, directory, stages))


def _walk_by_any_method(
    inputs: Inputs, settings: Settings, ground: GroundFrames, photo: PhotoCoordinates, stages: Stages
) -> Result:
    """Walk, with `auto` again strip by strip with polynomials where a bundle cannot be had."""
    try:
        return _walk_from_orientations(inputs, settings, ground, photo, stages)
    except GeometryError as error:
        if settings.adjustment != AUTO or inputs.models is not None:
            raise
        try:
            result = _walk(inputs, replace(settings, adjustment=POLYNOMIAL), ground, photo, stages)
        except (GeometryError, InputError):
            raise error from None
        text = f"no bundle adjustment could be had, each strip is adjusted by polynomials in its place: {error}"
        note = Note("no-bundle", text, photos=error.photos, points=error.points)
        return replace(result, settings=settings, notes=(note, *result.notes))


def _walk_from_orientations(
    inputs: Inputs, settings: Settings, ground: GroundFrames, photo: PhotoCoordinates, stages: Stages
) -> Result:
    """Walk, and again with single photos at their given orientations in the place of a strip that cannot be formed."""
    try:
        return _walk(inputs, settings, ground, photo, stages)
    except GeometryError as error:
        cut = as_single_photos(inputs, settings, error)
        if cut is None:
            raise
        try:
            result = _walk_from_orientations(cut, settings, ground, photo, stages)
        except GeometryError:
            raise error from None
        text = f"{error}; all photos of the strip start from their given orientations in its place"
        note = Note("not-formed", text, photos=error.photos)
        return replace(result, notes=(note, *result.notes))


def _walk(inputs: Inputs, settings: Settings, ground: GroundFrames, photo: PhotoCoordinates, stages: Stages) -> Result:
    """Every stage takes what the stages before it found."""
    # 1 lens distortion, refraction
    refined = correct(photo, inputs, settings, ground, stages)
    # 2-3 relative orientation; base direction, orientation chain, space intersection, scale transfer
    formed = form_strips(inputs, refined.observations, settings, stages)

    def on_the_ground(inputs: Inputs, whole: Result | None = None) -> Result:
        strips = formed if whole is None else _as_left_by(whole, formed)
        adjusted = _adjusted(inputs, settings, ground, refined.observations, strips, stages, whole)
        missing = {}
        if whole is None:
            missing = not_determined(adjusted.observations, adjusted.points, inputs, adjusted.strips)
        # 6 residuals, check points
        rows, differences = compare_with_given(inputs.control, ground.control, adjusted.points, adjusted.observations)
        return Result(
            inputs=inputs,
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
    from photostrip.pipeline.cross_validation import cross_validate

    return replace(result, folds=cross_validate(result, partial(on_the_ground, whole=result)))


def _of_any_method(settings: Settings) -> Settings:
    """Return settings without what a comparison of methods changes."""
    return replace(settings, adjustment="", precision=False, cross_validation=False)


def _as_left_by(whole: Result, formed: Sequence[StripStage[Any]]) -> Sequence[StripStage[Any]]:
    """Give strips of photos without the wrong images of control that the whole adjustment found in them."""
    if whole.bundle is not None or whole.inputs.models is not None:
        return formed
    of_photos = zip(cast("Sequence[FormedPhotos]", formed), whole.strips, strict=True)
    return [
        replace(stage, formed=strip.of_photos.formed, wrong_rays=strip.of_photos.wrong_rays)
        for stage, strip in of_photos
    ]


def _adjusted(
    inputs: Inputs,
    settings: Settings,
    ground: GroundFrames,
    observations: PhotoPoints,
    formed: Sequence[StripStage[Any]],
    stages: Stages,
    whole: Result | None,
) -> AdjustedStrips:
    """Bring formed strips to the ground and adjust them, each by itself or all in a bundle."""
    control = measured_control(inputs.control, observations)
    if settings.together and inputs.models is None:
        # 4-5 all strips at once
        from photostrip.pipeline.block.adjust import adjust_block  # a strip needs none of its libraries

        of_photos = cast("Sequence[FormedPhotos]", formed)
        return adjust_block(
            inputs, settings, observations, control, ground, of_photos, None if whole is None else whole.bundle
        )
    # 4 intermediate frame, absolute orientation, wrong control
    frames = tuple((frame.spec, frame.origin) for frame in (*ground.control, ground.output))
    wanted = _of_any_method(settings)
    screened = [
        stages.once(
            "control",
            partial(on_control, strip, control, ground.control, settings, searched=whole is not None),
            strip,
            control,
            frames,
            wanted,
            whole is None,
        )
        for strip in formed
    ]
    # 5 polynomials
    strips = tuple(adjust(strip, settings) for strip in screened)
    # 6 back to the map, with standard deviations
    return join_strips(
        strips, screened, observations, inputs.control, ground.output, settings, of_checks=whole is not None
    )
