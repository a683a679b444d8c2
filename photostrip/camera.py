"""The camera: everything about it that turns image coordinates into directions."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Distortion:
    """Lens distortion as the project states it.

    Parameters
    ----------
    model : str
        ``"brown"`` or ``"radial-table"``.
    direction : str
        ``"image_to_ideal"``: ideal = image + D(image); ``"ideal_to_image"``: image = ideal + D(ideal).
    k : tuple of float
        Radial coefficients k1, k2, k3 in mm^-2, mm^-4, mm^-6 (Brown).
    p : tuple of float
        Decentering coefficients p1, p2 in mm^-1 (Brown).
    b : tuple of float
        Affinity b1 and shear b2 of the image, dimensionless (Brown): D_x gets b1 X + b2 Y.
    radius, distortion : tuple of float
        Radial table in mm: distances from the principal point and distortion there.
    """

    model: str
    direction: str
    k: tuple[float, float, float] = (0.0, 0.0, 0.0)
    p: tuple[float, float] = (0.0, 0.0)
    b: tuple[float, float] = (0.0, 0.0)
    radius: tuple[float, ...] = ()
    distortion: tuple[float, ...] = ()


@dataclass(frozen=True)
class Camera:
    """Interior orientation of one camera.

    Parameters
    ----------
    name : str
        Name of the camera in the project.
    principal_distance : float
        Principal distance f in mm, positive.
    principal_point : tuple of float
        x0, y0 in mm in the system of the image coordinates (of the fiducial marks for film).
    format : tuple of float, optional
        Width and height of the photo in mm.
    fiducials : dict of str to tuple of float
        Calibrated coordinates of the fiducial marks in mm.
    pixel_size : float, optional
        Size of a pixel in mm, for digital cameras.
    """

    name: str
    principal_distance: float
    principal_point: tuple[float, float] = (0.0, 0.0)
    format: tuple[float, float] | None = None
    fiducials: dict[str, tuple[float, float]] = field(default_factory=dict)
    pixel_size: float | None = None
    distortion: Distortion | None = None
