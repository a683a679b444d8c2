"""Cameras to compare: the YAML file and its keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from photostrip.planning import camera_efficiency
from photostrip.project.plans.flown import SCHEMA_NUMBER, Percent, SigmaUm, read_plan
from photostrip.project.schema.values import Id, Positive, Section, Words, key, one_of, wrong

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


class PlanCamera(Section):
    """One camera to compare."""

    principal_distance: Positive = key("Principal distance", unit="mm")
    sigma_um: SigmaUm = key("Standard deviation of an x parallax in the photo", unit="um")
    base: Positive | None = key("Photo base; default: from `format` and the overlap", None, unit="mm")
    format: tuple[Positive, Positive] | None = key("Length along and width across the flight", None, unit="mm")

    @model_validator(mode="after")
    def _has_a_base(self) -> Self:
        if self.base is None and self.format is None:
            raise wrong("nothing says how long the photo base is", code="missing-key", expected="`base` or `format`")
        return self


class CameraPlanFile(Section):
    """Cameras to compare."""

    photostrip_plan_cameras: Annotated[Words, AfterValidator(one_of(SCHEMA_NUMBER))] = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the comparison", "cameras")
    end_lap_percent: Percent = key("Overlap, for cameras without `base`", 60.0, unit="%")
    reference: Id | None = key("Camera that the others stand beside; default: the last", None)
    cameras: Annotated[dict[Id, PlanCamera], Field(min_length=1)] = key("Cameras by name")

    @model_validator(mode="after")
    def _reference_is_there(self) -> Self:
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
        return self


class CameraPlan(NamedTuple):
    """Cameras to compare."""

    name: str
    cameras: tuple[camera_efficiency.ComparedCamera, ...]
    reference: camera_efficiency.ComparedCamera
    files: Sequence[str]


def load_camera_plan(path: Path, assignments: Sequence[str]) -> CameraPlan:
    """Read a list of cameras to compare, or raise every fault of it."""
    given, reading = read_plan(CameraPlanFile, path, assignments)
    cameras = tuple(_plan_camera(str(name), each, given.end_lap_percent) for name, each in given.cameras.items())
    named = {camera.name: camera for camera in cameras}
    return CameraPlan(
        name=str(given.name),
        cameras=cameras,
        reference=named.get(str(given.reference), cameras[-1]),
        files=reading.files,
    )


def _plan_camera(name: str, given: PlanCamera, end_lap: float) -> camera_efficiency.ComparedCamera:
    base = given.base
    if base is None and given.format is not None:
        base = given.format[0] * (1.0 - end_lap / 100.0)
    # without a format all cameras count as equally wide
    width = given.format[1] if given.format is not None else camera_efficiency.PRINTED_BASE
    return camera_efficiency.ComparedCamera(
        name=name, focal=given.principal_distance, sigma=given.sigma_um / 1000.0, base=base or np.nan, width=width
    )
