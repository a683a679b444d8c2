"""What plans of something flown have in common."""

from __future__ import annotations

from typing import Annotated

from photostrip.camera import Camera
from photostrip.planning.ideal_strip import StripGeometry
from photostrip.project.schema.sections import After, Positive, Range, Section, Triple, Words, bounded, key, rule, wrong
from photostrip.project.simulation import SimulatedCamera
from photostrip.project.terrestrial.ranges import IMAGE_SIGMA_UM

OVERLAP = Range(1.0, 99.0, "%")

Percent = Annotated[Positive, After(bounded(OVERLAP))]
SigmaUm = Annotated[Positive, After(bounded(IMAGE_SIGMA_UM))]


def all_positive(value: tuple[float, float, float]) -> tuple[float, float, float]:
    """Require three standard deviations that are not negative, at least one of them positive."""
    if min(value) < 0 or max(value) == 0:
        raise wrong("standard deviations are negative or all zero", code="range", expected="metres, 0 or more")
    return value


Sigmas = Annotated[Triple, After(all_positive)]


class Flown(Section):
    """A plan of something that is flown: camera, overlap, scale, measuring."""

    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    camera: SimulatedCamera = key("Camera; its lens counts as ideal", SimulatedCamera())
    end_lap_percent: Percent = key("Overlap of neighbouring photos", StripGeometry.end_lap_percent, unit="%")
    scale: Positive | None = key("Denominator of the photo scale; default: 10000", None)
    flying_height: Positive | None = key("Height above the ground, instead of `scale`", None, unit="m")
    image_sigma_um: SigmaUm = key("Standard deviation of an image coordinate", 5.0, unit="um")

    @rule
    def _one_scale(self) -> None:
        if self.scale is not None and self.flying_height is not None:
            raise wrong("photo scale and flying height are both given", at="flying_height", fix="remove one")

    def scale_of(self, camera: Camera) -> float:
        """Denominator of the photo scale, given itself or by the flying height."""
        by_height = (self.flying_height or 0.0) / camera.principal_distance * 1000.0
        return self.scale or by_height or StripGeometry.scale
