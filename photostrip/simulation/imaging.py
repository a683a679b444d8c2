"""From points in space to image coordinates: rays and the limits of the photo.

``photo`` (n,) is the number of the photo of each row; rays (n, 3) lead from its perspective centre, Cartesian frame.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.simulation.flight import Photos
from photostrip.simulation.spec import Spec
from photostrip.strip.image_coordinates import lens_distortion
from photostrip.strip.image_coordinates.refraction import refraction_constant

USABLE = 0.97  # part of the width and height of the photo that is measured in
BENDING_STEPS = 6  # each gains four digits


def project(photos: Photos, photo: Numbers, ray: Floats, principal_distance: float) -> tuple[Floats, Floats]:
    """Central projection of rays (of any length) into photos, one for each row.

    Returns xy: (n, 2), ideal image coordinates from the principal point, mm.
    Returns depth: (n,), part of the ray along the camera's axis; negative for what lies behind the camera.
    """
    turned = np.einsum("ni,nij->nj", ray, photos.rotations[photo])
    depth = -turned[:, 2]
    safe = np.where(depth > 0.0, depth, np.inf)
    return principal_distance * turned[:, :2] / safe[:, None], depth


def bent(photos: Photos, photo: Numbers, ray: Floats, ground_height: float) -> Floats:
    """Directions in which the cameras see the ends of rays, metres, through the standard atmosphere.

    `ground_height` is the mean height of the terrain above sea level.

    Source: derived, refraction in plane layers: tan(alpha) = tan(theta) (1 - K / cos(theta)^2) for the straight line
    alpha and the direction theta in which it is seen, both from the nadir, whatever the tilt of the photo.
    """
    constant = np.array([refraction_constant(height, ground_height) for height in photos.height.tolist()])[photo]
    up = photos.up[photo]
    down = -np.einsum("ni,ni->n", ray, up)
    aside = ray + down[:, None] * up
    square = np.einsum("ni,ni->n", aside, aside) / down**2
    stretch = np.ones(len(ray))
    for _ in range(BENDING_STEPS):
        stretch = 1.0 / (1.0 - constant * (1.0 + square * stretch**2))
    return np.asarray(aside * stretch[:, None] - down[:, None] * up)


def sees(spec: Spec, photos: Photos, photo: Numbers, xyz: Floats) -> Flags:
    """Whether a photo shows a point (n, 3), Cartesian frame, well within its format, one point for each row."""
    xy, depth = project(photos, photo, xyz - photos.centers[photo], spec.camera.principal_distance)
    inside = (np.abs(xy + spec.camera.principal_point) <= USABLE / 2.0 * np.asarray(spec.format)).all(axis=1)
    if spec.camera.distortion is not None:
        inside &= np.hypot(xy[:, 0], xy[:, 1]) <= USABLE * lens_distortion.reach(spec.camera.distortion)[1]
    return np.asarray(inside & (depth > 0.0))
