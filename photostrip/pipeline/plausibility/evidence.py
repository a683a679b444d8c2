"""What the checks look at: strips formed for evidence, and where points lie along them.

``steps`` everywhere holds, by photo, the centre of the next photo as it lies on that photo, mm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import GeometryError, InputError
from photostrip.pipeline.inputs import Settings, Strip
from photostrip.pipeline.results import PhotoStages
from photostrip.pipeline.strips.photos import FormedPhotos, form_strip
from photostrip.points import ControlPoints, PhotoPoints, locate, located, take_rows
from photostrip.strip.image_coordinates import corrections
from photostrip.strip.relative_orientation.orientation import orient_unchecked, unusable_pairs
from photostrip.strip.relative_orientation.pairs import collect_pairs

BREADTH_SHARE = 0.95  # of the image points lie within the half breadth of a strip
LEAST_RAYS = 2  # photos that must show a given point


def form(strip: Strip, observations: PhotoPoints, settings: Settings) -> FormedPhotos | None:
    """Form a strip as a run does; None when a pair or a junction cannot be determined, or of a single photo."""
    if len(strip.photos) < 2:
        return None
    try:
        return form_strip(strip, observations, settings)
    except (GeometryError, InputError, np.linalg.LinAlgError):
        return None


def at_distance(strip: Strip, factor: float) -> Strip:
    """Return a strip whose camera has so many times its principal distance."""
    return replace(strip, camera=replace(strip.camera, principal_distance=strip.camera.principal_distance * factor))


def formed_at_distance(stage: FormedPhotos, factor: float, settings: Settings) -> FormedPhotos | None:
    """Form a strip again with so many times its principal distance, by the rays that it used; None where it cannot be.

    Nothing is searched for in it: that takes most of the time where the distance is wrong, and proves nothing.
    """
    strip = at_distance(stage.strip, factor)
    rays = take_rows(stage.observations, stage.rays_in_use, ("photo", "point", "xy", "sigma"))
    plain = replace(settings, relative=replace(settings.relative, screening="none"))
    try:
        oriented, converged = orient_unchecked(collect_pairs(rays, strip.photos, strip.camera.principal_distance))
        usable = not unusable_pairs(oriented, converged).any()
    except (GeometryError, np.linalg.LinAlgError):
        return None
    return form(strip, rays, plain) if usable else None


def as_formed(stages: PhotoStages, observations: PhotoPoints) -> FormedPhotos:
    """Return a strip as a run has formed it, before it met its control."""
    return FormedPhotos(
        strip=stages.strip,
        observations=observations,
        sigma=stages.sigma,
        screened=stages.screened,
        formed=stages.formed,
        wrong_rays=stages.wrong_rays,
    )


def up(stage: FormedPhotos) -> Floats:
    """Where the cameras look from, of length one."""
    mean = stage.formed.rotations[:, :, 2].mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12), float)


def depth(stage: FormedPhotos) -> Floats:
    """Height of every perspective centre above the points of its models, shape (n,)."""
    upwards, pair = up(stage), stage.orientation.pairs.pair
    height = stage.formed.model_xyz @ upwards
    good = np.isfinite(height) & stage.orientation.used
    count = np.maximum(np.bincount(pair[good], minlength=stage.orientation.pairs.size), 1)
    ground = np.bincount(pair[good], height[good], stage.orientation.pairs.size) / count
    centers = stage.formed.centers @ upwards
    return np.concatenate([centers[:1] - ground[:1], centers[1:] - ground])


def ideal(observations: PhotoPoints, cameras: Mapping[str, Camera], settings: Settings) -> PhotoPoints:
    """Image points free of distortion, without refraction, whose heights are not known; else as they are."""
    try:
        return corrections.refine(observations, cameras, replace(settings.refinement, refraction=False)).observations
    except InputError:
        return observations


def _base_angle(photos: Sequence[str], steps: Mapping[str, complex]) -> float:
    """Mean direction on the photos towards the next one, radians."""
    known = np.array([steps.get(photo, complex("nan")) for photo in photos])
    known = known[np.isfinite(known) & (known != 0)]
    return float(np.angle((known / np.abs(known)).sum())) if len(known) else 0.0


def places_along_strip(
    strip: Strip, observations: PhotoPoints, control: ControlPoints, steps: Mapping[str, complex]
) -> tuple[Numbers, Floats]:
    """Say where along a strip given points lie.

    Returns rows: (m,), rows of the given points that at least two of its photos show.
    Returns place: (m,), where they lie along the strip in bases, from 0 at the first photo; the mean of what its photos
        say.
    """
    rows, along = places_in_photos(strip, observations, steps)
    size = len(observations.point_ids)
    count = np.bincount(observations.point[rows], minlength=size)
    total = np.bincount(observations.point[rows], along, size)
    numbers = located(control.ids, observations.point_ids)
    given = np.flatnonzero((numbers >= 0) & (count[numbers] >= LEAST_RAYS))
    chosen = numbers[given]
    return given, total[chosen] / count[chosen]


def places_in_photos(strip: Strip, observations: PhotoPoints, steps: Mapping[str, complex]) -> tuple[Numbers, Floats]:
    """Say where each photo of a strip puts its points along the strip.

    Returns rows: (m,), image points of the strip.
    Returns along: (m,), their places in bases, from 0 at the first photo.
    """
    position = strip.positions(observations)
    rows = np.flatnonzero(position >= 0)
    step = np.array([steps.get(photo, complex("nan")) for photo in strip.photos])
    known = np.isfinite(step) & (step != 0)
    usual = complex(np.median(step[known].real), np.median(step[known].imag)) if known.any() else 1.0
    step = np.where(known, step, usual)[position[rows]]
    along = (observations.xy[rows] * np.column_stack([step.real, step.imag])).sum(axis=1) / np.abs(step) ** 2
    return rows, position[rows] + (along if known.any() else 0.0)


def half_breadth(
    strip: Strip,
    observations: PhotoPoints,
    ids: Sequence[str],
    plan: Floats,
    place: Floats,
    steps: Mapping[str, complex],
) -> float:
    """Half the breadth of a strip, metres; 0 where two given points do not tell its scale.

    The scale is that of photos that show two given points or more, or else that of the bases between given points.

    ids, plan, place: given points, their plan coordinates (n, 2), metres, and their places along the strip (n,), bases.
    """
    inside = strip.positions(observations) >= 0
    angle = _base_angle(strip.photos, steps)
    across = observations.xy[inside] @ [-np.sin(angle), np.cos(angle)]
    half = np.quantile(np.abs(across), BREADTH_SHARE)
    given = locate(observations.point_ids, ids)[observations.point]
    rows = np.flatnonzero(inside & (given >= 0))
    rows = rows[np.argsort(observations.photo[rows], kind="stable")]
    one, other = rows[:-1], rows[1:]
    same = (observations.photo[one] == observations.photo[other]) & (given[one] != given[other])
    one, other = one[same], other[same]
    image = np.linalg.norm(observations.xy[one] - observations.xy[other], axis=1)
    ground = np.linalg.norm(plan[given[one]] - plan[given[other]], axis=1)
    if not (image > 0).any():
        order = np.argsort(place, kind="stable")
        base = np.median([abs(step) for photo in strip.photos if (step := steps.get(photo, 0.0))] or [np.nan])
        image = np.diff(place[order]) * float(base)
        ground = np.linalg.norm(np.diff(plan[order], axis=0), axis=1)
    good = image > 0
    return half * np.median(ground[good] / image[good]) if good.any() else 0.0
