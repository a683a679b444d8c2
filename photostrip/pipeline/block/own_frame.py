"""Orientations in a frame of their own, as a structure-from-motion model has them, laid on what is known.

Their place, direction and scale may be any; they are only a start. Points of the control are intersected in their frame
from the rays, and a similarity takes these points, and the cameras where positions are known, to the ground.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_angles, separable_angles
from photostrip.geometry.similarity import Similarity
from photostrip.notes import Note
from photostrip.pipeline.block.datum import OF_PHOTO, Known, Oriented, known_of, on_given, with_cameras
from photostrip.pipeline.block.start import points_as_given
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.given_points import cartesian_of, measured_control
from photostrip.pipeline.inputs import Inputs
from photostrip.points import ControlPoints, PhotoPoints, locate
from photostrip.strip.gross_errors.control.control_screening import majority
from photostrip.strip.resection.collinearity import KnownPhotos
from photostrip.strip.resection.ray_intersection import intersect_points


def laid_on_ground(
    inputs: Inputs, observations: PhotoPoints, ground: GroundFrames
) -> tuple[Inputs, GroundFrames, tuple[Note, ...]]:
    """Bring orientations in a frame of their own into that of the output, where anything else is known on the ground.

    Raises GeometryError where what is known does not say where they lie.
    """
    given = inputs.orientations
    if given is None or not given.has_own_frame or ground.orientations is not None:
        return inputs, ground, ()
    known = known_of(inputs, measured_control(inputs.control, observations), ground)
    block = Oriented(given.photos, given.enu, from_angles(given.angles, given.system))
    local, as_they_are = known.output.kind == "local", (inputs, replace(ground, orientations=ground.output), ())
    given_of = dict(zip(block.names, zip(block.centers, block.rotations, strict=True), strict=True))
    if local and points_as_given(inputs, observations, given_of) is None:
        return as_they_are  # angles in another unit agree with nothing, and are judged in the frame that is named
    try:
        similarity, what = _similarity(inputs, observations, known, block)
    except GeometryError:
        if local:
            return as_they_are
        raise
    centers = similarity(block.centers)
    turned = known.output.axes_at(centers) @ similarity.rotation @ block.rotations
    system, angles = separable_angles(turned)
    enu = known.output.ground_from_cartesian(centers, ids=given.photos)
    laid = replace(given, frame=known.output.spec, enu=enu, angles=angles, system=system)
    text = f"orientations are in a frame of their own and were laid on {what}: 1 unit of it is {similarity.scale:.6g} m"
    note = Note("orientations-laid", text, "note", key="orientations.crs")
    return replace(inputs, orientations=laid), replace(ground, orientations=ground.output), (note,)


def _similarity(inputs: Inputs, observations: PhotoPoints, known: Known, block: Oriented) -> tuple[Similarity, str]:
    """From the frame of the orientations to the Cartesian one, by control or else with the cameras; and by what."""
    cameras = known.cameras.take(np.isin(known.cameras.ids, [OF_PHOTO.format(name) for name in block.names]))
    xyz = _intersected(inputs, observations, known.control, block)
    there = np.isfinite(xyz[:, 0])
    control, xyz = known.control.take(there), xyz[there]
    full = np.flatnonzero(control.use.all(axis=1))
    fit = majority(xyz[full], cartesian_of(control.take(full), known.frames))  # wrong ones are found later
    kept = np.delete(np.arange(len(control)), full[~fit])
    control, xyz = control.take(kept), xyz[kept]
    try:
        return on_given(xyz, control, known, np.concatenate([xyz, block.centers])), "the control"
    except GeometryError as error:
        if not len(cameras):
            message = (
                f"nothing says where the given orientations lie, whose frame is `local`: of the control {len(there)} "
                f"are measured, {int(there.sum())} of them on two photos or more, {len(control)} of these agree; "
                "three that are not on a line are needed, or camera positions"
            )
            raise GeometryError(message, photos=block.names, code="strip-not-tied") from error
    return with_cameras(block, (xyz, control), cameras, known), "the camera positions"


def _intersected(inputs: Inputs, observations: PhotoPoints, control: ControlPoints, block: Oriented) -> Floats:
    """Control points in the frame of the orientations, (n, 3); NaN where fewer than two photos show them."""
    number = np.full(len(observations.point_ids), -1)
    number[locate(control.ids, observations.point_ids)] = np.arange(len(control))
    place = observations.places(tuple(block.names))
    rows = np.flatnonzero((number[observations.point] >= 0) & (place >= 0))
    focal = {photo: camera.principal_distance for photo, camera in inputs.cameras.items()}
    photos = KnownPhotos(
        centers=block.centers, rotations=block.rotations, focal=np.array([focal[each] for each in block.names])
    )
    where = place[rows], number[observations.point[rows]]
    return intersect_points(observations.xy[rows], observations.sigma[rows], where, photos, len(control)).xyz
