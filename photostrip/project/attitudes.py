"""Given rotations as the project says what they are: angles in a system, quaternions, matrices; from which north."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.formats.measured.exterior import QUATERNION, ROTATIONS
from photostrip.geometry.rotation import about, angle_rates, angles, from_angles, separable_angles
from photostrip.project.schema.ground import GivenAngles

AHEAD = about(0, np.pi / 2.0)  # of image axes: a camera that looked down looks ahead


class Attitudes(NamedTuple):
    angles: Floats  # (n, 3): radians, in a system of ``geometry.rotation.SYSTEMS``
    system: str
    sigma_turns: Floats  # (n, 3): standard deviations of small turns about the axes of the photo, radians
    stated: bool  # whether angles and system are the user's own


def attitudes(values: Floats, sigma: Floats, given: GivenAngles, north: Floats | None) -> Attitudes:
    """Return rotations from image axes (x right, y up, z towards the viewer) to grid east, grid north, normal.

    values: (n, 3) angles in radians; (n, 4) quaternions w, x, y, z; (n, 9) matrices by rows.
    sigma: (n, 3) standard deviations of the angles, of others of small turns about the image axes, radians.
    north: azimuth of grid north at each photo, radians, where the rotations count from true north.
    """
    stated = given.system not in ROTATIONS
    if stated:
        rotations, rates = from_angles(values, given.system), angle_rates(values, given.system)
        if given.looks == "ahead":
            rotations, stated = rotations @ AHEAD, False
        sigma = np.sqrt(np.einsum("nij,nj->ni", (rotations.transpose(0, 2, 1) @ rates) ** 2, sigma**2))
    else:
        rotations = _rotations(values, given)
    if north is None and stated:
        return Attitudes(angles=values, system=given.system, sigma_turns=sigma, stated=stated)
    if north is not None:  # an azimuth from grid north is smaller by the convergence
        rotations = about(2, north) @ rotations
    if stated:
        try:
            return Attitudes(
                angles=angles(rotations, given.system), system=given.system, sigma_turns=sigma, stated=stated
            )
        except GeometryError:
            pass
    system, separable = separable_angles(rotations)
    return Attitudes(angles=separable, system=system, sigma_turns=sigma, stated=False)


def _rotations(values: Floats, given: GivenAngles) -> Floats:
    """Return the nearest rotations to quaternions, or to matrices as they are printed with few digits."""
    from scipy.spatial.transform import Rotation  # takes 30 ms to load, and angles do without

    if given.system == QUATERNION:
        found = Rotation.from_quat(values[:, [1, 2, 3, 0]]).as_matrix()
    else:
        found = Rotation.from_matrix(values.reshape(-1, 3, 3)).as_matrix()
    if given.rotates == "ground_to_image":
        found = found.transpose(0, 2, 1)
    turned = found if given.y_axis == "up" else found * (1.0, -1.0, -1.0)
    return np.asarray(turned, float)
