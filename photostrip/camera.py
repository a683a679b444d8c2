"""The camera: everything about it that turns image coordinates into directions."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Distortion:
    """Lens distortion as the project states it."""

    model: str  # ``"brown"`` or ``"radial-table"``
    direction: str  # ``"image_to_ideal"``: ideal = image + D(image); ``"ideal_to_image"``: image = ideal + D(ideal)
    k: tuple[float, float, float] = (0.0, 0.0, 0.0)  # radial coefficients k1, k2, k3 in mm^-2, mm^-4, mm^-6 (Brown)
    p: tuple[float, float] = (0.0, 0.0)  # decentering coefficients p1, p2 in mm^-1 (Brown)
    # affinity b1 and shear b2 of the image, dimensionless (Brown): D_x gets b1 X + b2 Y
    b: tuple[float, float] = (0.0, 0.0)
    # radius, distortion: radial table in mm: distances from the principal point and distortion there
    radius: tuple[float, ...] = ()
    distortion: tuple[float, ...] = ()


@dataclass(frozen=True)
class Camera:
    """Interior orientation of one camera."""

    name: str  # name of the camera in the project
    principal_distance: float  # principal distance f in mm, positive
    # x0, y0 in mm in the system of the image coordinates (of the fiducial marks for film)
    principal_point: tuple[float, float] = (0.0, 0.0)
    format: tuple[float, float] | None = None  # width and height of the photo in mm
    # calibrated coordinates of the fiducial marks in mm
    fiducials: dict[str, tuple[float, float]] = field(default_factory=dict)
    pixel_size: float | None = None  # size of a pixel in mm, for digital cameras
    # b1, b2: how pixels of x depart from squares: u = (1 + b1) x + b2 y, of measured u and x, y in the image
    pixel_affinity: tuple[float, float] = (0.0, 0.0)
    distortion: Distortion | None = None
    # of what the project says of it: ``"px"`` is a camera in pixels, perhaps of a size that nobody knows
    unit: str = "mm"

    @property
    def distance_key(self) -> str:
        """Key of its principal distance in the project."""
        return f"cameras.{self.name}.{'focal_length' if self.unit == 'px' else 'principal_distance'}"

    @property
    def size_key(self) -> str:
        """Key of its format in the project."""
        return f"cameras.{self.name}.{'image_size' if self.unit == 'px' else 'format'}"

    def length(self, value: float, form: str = "g", in_pixels: str = "g") -> str:
        """Write a length in the image (mm) in the unit in which the project gives the camera."""
        return f"{self.in_unit(value):{in_pixels if self.unit == 'px' else form}} {self.unit}"

    def in_unit(self, value: float) -> float:
        return value / self.pixel_size if self.unit == "px" and self.pixel_size else value
