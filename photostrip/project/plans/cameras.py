"""Cameras to compare: the YAML file and its keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from photostrip.errors import InputError
from photostrip.planning import camera_efficiency
from photostrip.project.conversion import distortion_of
from photostrip.project.plans.flown import Percent, SigmaUm
from photostrip.project.schema.cameras import Distortion
from photostrip.project.schema.sections import (
    After,
    FirstSchema,
    Id,
    Number,
    Positive,
    Range,
    Section,
    Words,
    bounded,
    key,
    length,
    rule,
    wrong,
)
from photostrip.project.yaml.reading import read_keys
from photostrip.units import MICROMETRES

Lap = Annotated[Number, After(bounded(Range(0.0, 90.0, "%")))]
Relief = Annotated[Number, After(bounded(Range(0.0, 9000.0, "m")))]
Slope = Annotated[Number, After(bounded(Range(0.0, 89.0, "deg")))]
FLOWN = ("scale", "flying_height", "height_sigma")


class PlanCamera(Section):
    """One camera to compare."""

    principal_distance: Positive = key("Principal distance", unit="mm")
    sigma_um: SigmaUm | None = key("Standard deviation of an x parallax in the photo", None, unit="um")
    image_sigma_um: SigmaUm | None = key(
        "Standard deviation of an image coordinate, instead of that of a parallax", None, unit="um"
    )
    mean_distortion_um: Positive | None = key("Mean size of the radial distortion that is left", None, unit="um")
    distortion: Distortion | None = key("The distortion that is left, instead of its mean size", None)
    base: Positive | None = key("Photo base; default: from `format` and the overlap", None, unit="mm")
    format: tuple[Positive, Positive] | None = key("Length along and width across the flight", None, unit="mm")

    @rule
    def _has_a_base(self) -> None:
        if self.base is None and self.format is None:
            raise wrong("nothing says how long the photo base is", code="missing-key", expected="`base` or `format`")

    @rule
    def _has_one_precision(self) -> None:
        if (self.sigma_um is None) == (self.image_sigma_um is None):
            what = "nothing says" if self.sigma_um is None else "two keys say"
            message = f"{what} how well an x parallax is known"
            raise wrong(message, code="missing-key", expected="`sigma_um` or `image_sigma_um`")
        left = [name for name in ("mean_distortion_um", "distortion") if getattr(self, name) is not None]
        if left and self.sigma_um is not None:
            message = f"`{left[0]}` adds to the errors of measuring, and `sigma_um` has all errors in it"
            raise wrong(message, code="two-keys", at=left[0], fix="give `image_sigma_um` instead of `sigma_um`")
        if len(left) > 1:
            message = "the distortion that is left and its mean size are both given"
            raise wrong(message, code="two-keys", at=left[0], fix="remove one")
        if self.distortion is not None and self.format is None:
            message = "where the distortion lies in a model follows from the format, which is not given"
            raise wrong(message, code="missing-key", at="distortion", expected="`format`")


class CameraPlanFile(Section):
    """Cameras to compare."""

    photostrip_plan_cameras: FirstSchema = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the comparison", "cameras")
    end_lap_percent: Percent = key("Overlap, for cameras without `base`", 60.0, unit="%")
    side_lap_percent: Lap = key("Overlap of neighbouring strips: what is left of the width is useful", 0.0, unit="%")
    scale: Positive | None = key("Denominator of the photo scale that all are flown at", None)
    flying_height: Positive | None = key("Height above the ground that all are flown at, instead", None, unit="m")
    height_sigma: Positive | None = key("Standard deviation that heights shall have, instead", None, unit="m")
    relief: Relief = key("Difference between the highest and the lowest ground", 0.0, unit="m")
    slope_deg: Slope = key("Steepest slope that is to be seen", 0.0, unit="deg")
    reference: Id | None = key("Camera that the others stand beside; default: the last", None)
    cameras: Annotated[dict[Id, PlanCamera], length(1)] = key("Cameras by name")

    @rule
    def _reference_is_there(self) -> None:
        if self.reference is not None and self.reference not in self.cameras:
            expected = f"one of {', '.join(self.cameras)}"
            raise wrong(
                f"there is no camera `{self.reference}`", code="unknown-camera", at="reference", expected=expected
            )
        wide = [name for name, camera in self.cameras.items() if camera.format is not None]
        if wide and len(wide) < len(self.cameras):
            lacking = next(name for name in self.cameras if name not in wide)
            message = f"camera `{lacking}` has no format, and others have: areas cannot be compared"
            raise wrong(message, code="missing-key", at="cameras", fix="give `format` for all cameras, or for none")

    @rule
    def _flown_one_way(self) -> None:
        given = [name for name in FLOWN if getattr(self, name) is not None]
        if len(given) > 1:
            raise wrong(f"`{given[0]}` and `{given[1]}` are both given", code="two-keys", at=given[1], fix="remove one")
        ground = [name for name in ("relief", "slope_deg") if getattr(self, name)]
        if ground and not given:
            message = "what a camera takes of a terrain depends on how it is flown"
            raise wrong(
                message, code="missing-key", at=ground[0], expected="`scale`, `flying_height` or `height_sigma`"
            )
        if self.relief and any(camera.format is None for camera in self.cameras.values()):
            message = "how far photos overlap on high ground follows from their format, which is not given"
            raise wrong(message, code="missing-key", at="relief", fix="give `format` for all cameras")


class CameraPlan(NamedTuple):
    name: str
    cameras: tuple[camera_efficiency.ComparedCamera, ...]
    reference: camera_efficiency.ComparedCamera
    survey: camera_efficiency.FlownSurvey | None  # nothing where only the cameras are compared
    files: Sequence[str]


def load_camera_plan(path: Path, assignments: Sequence[str]) -> CameraPlan:
    """Read a list of cameras to compare, or raise every fault of it."""
    given, reading = read_keys(CameraPlanFile, path, assignments)
    cameras = tuple(_plan_camera(str(name), each, given) for name, each in given.cameras.items())
    named = {camera.name: camera for camera in cameras}
    return CameraPlan(
        name=str(given.name),
        cameras=cameras,
        reference=named.get(str(given.reference), cameras[-1]),
        survey=_survey(given),
        files=reading.files,
    )


def _survey(given: CameraPlanFile) -> camera_efficiency.FlownSurvey | None:
    if all(getattr(given, name) is None for name in FLOWN):
        return None
    return camera_efficiency.FlownSurvey(
        scale=given.scale,
        flying_height=given.flying_height,
        height_sigma=given.height_sigma,
        terrain=camera_efficiency.HighGround(given.relief, float(np.radians(given.slope_deg))),
    )


def _plan_camera(name: str, given: PlanCamera, plan: CameraPlanFile) -> camera_efficiency.ComparedCamera:
    # without a format all cameras count as equally wide
    length, width = given.format or (None, camera_efficiency.PRINTED_BASE)
    base = given.base
    if base is None and length is not None:
        base = length * (1.0 - plan.end_lap_percent / 100.0)
    useful = width * (1.0 - plan.side_lap_percent / 100.0)
    return camera_efficiency.ComparedCamera(
        name=name,
        focal=given.principal_distance,
        sigma=_sigma(name, given, base or np.nan, useful),
        base=base or np.nan,
        width=useful,
        length=length,
    )


def _sigma(name: str, given: PlanCamera, base: float, width: float) -> float:
    """Return m_p, mm."""
    if given.sigma_um is not None:
        return given.sigma_um / MICROMETRES
    measuring = (given.image_sigma_um or 0.0) / MICROMETRES
    if given.distortion is None or given.format is None:
        mean = (given.mean_distortion_um or 0.0) / MICROMETRES
        return camera_efficiency.sigma_from_mean_distortion(measuring, mean)
    try:
        return camera_efficiency.sigma_from_distortion(
            measuring, distortion_of(given.distortion), base=base, length=given.format[0], width=width
        )
    except InputError as error:
        raise InputError(replace(fault, key=f"cameras.{name}.distortion") for fault in error.faults) from None
