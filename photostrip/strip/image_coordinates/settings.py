"""What is asked of the interior orientation and of the corrections of image coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace

from photostrip.camera import Camera


@dataclass(frozen=True)
class InteriorSettings:
    """How photo coordinates are formed from measured fiducial marks."""

    # ``"conformal"`` (two marks or more), ``"affine"`` (three or more), ``"bilinear"`` or ``"projective"`` (four or
    # more); ``"auto"``: affine from four marks on, so that one redundant mark for each axis is left, conformal with two
    # or three
    transform: str = "auto"
    # ``"interpolate"`` the residuals of the marks to the points, for film that is deformed in other ways than the
    # transformation has, or ``"ignore"`` them
    residuals: str = "ignore"


@dataclass(frozen=True)
class ImageCorrectionSettings:
    # principal_point, distortion: reduce to the principal point of the camera; take out its lens distortion
    principal_point: bool = True
    distortion: bool = True
    refraction: bool = False
    # flying_height, ground_height: mean heights of the perspective centers and of the ground above sea level, in
    # metres; None: derived from camera and control
    flying_height: float | None = None
    ground_height: float | None = None
    earth_radius: float | None = None  # radius of the Earth in metres for the correction in image space; None: none

    def applied_to(self, camera: Camera) -> Camera:
        """Return a camera with its principal point in the middle, or without distortion, where that is switched off."""
        point = camera.principal_point if self.principal_point else (0.0, 0.0)
        return replace(camera, principal_point=point, distortion=camera.distortion if self.distortion else None)

    @property
    def needs_heights(self) -> bool:
        """Whether a correction depends on the heights of camera and ground."""
        return self.refraction or self.earth_radius is not None
