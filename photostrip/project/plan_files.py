"""Plans of a single model and of cameras: the YAML files, their keys, and the options that stand in for them.

A file is not needed: every key has a default or can be set on the command line, whose options are assignments to
these keys.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Self, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from photostrip.errors import InputError
from photostrip.formats.findings import Findings
from photostrip.planning import camera_efficiency
from photostrip.planning.model_plan import LAYOUTS, ControlPoint, ModelSpec, control_layout
from photostrip.project.document import COMMAND_LINE, Node, Place
from photostrip.project.merging import override, read_tree
from photostrip.project.schema import Id, Pair, Positive, Section, Words, key, wrong
from photostrip.project.simulation_spec import SimulatedCamera, Three, Whole, camera_of
from photostrip.project.terrestrial_presets import one_of
from photostrip.project.terrestrial_ranges import Range, bounded
from photostrip.project.validation import checked

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

T = TypeVar("T", bound=Section)

SCHEMA_NUMBER = "1"
USES = ("xyz", "xy", "z")
OVERLAP = Range(1.0, 99.0, "%")
REACH = Range(5.0, 100.0, "%")
IMAGE_SIGMA_UM = Range(1e-3, 1e4, "µm")
GRID = Range(2, 101, "points")
ZONE_POINTS = Range(1, 1000, "points")

Percent = Annotated[Positive, AfterValidator(bounded(OVERLAP))]
SigmaUm = Annotated[Positive, AfterValidator(bounded(IMAGE_SIGMA_UM))]


def _scale_or_height(scale: float | None, height: float | None) -> None:
    if scale is not None and height is not None:
        raise wrong("photo scale and flying height are both given", at="flying_height", fix="remove one")


def all_positive(value: tuple[float, float, float]) -> tuple[float, float, float]:
    """Require three standard deviations that are not negative, at least one of them positive."""
    if min(value) < 0 or max(value) == 0:
        raise wrong("standard deviations are negative or all zero", code="range", expected="metres, 0 or more")
    return value


Sigmas = Annotated[Three, AfterValidator(all_positive)]


# ----------------------------------------------------------------------------------------------------- one model


class ModelControlPoint(Section):
    """One control point."""

    at: Pair = key("x along the base and y to the left, from the left nadir, at photo scale", unit="mm")
    use: Annotated[Words, AfterValidator(one_of(*USES))] = key("`xyz`, `xy` or `z`", "xyz")


def _control_point(value: object) -> object:
    """Let a pair of numbers stand for a point that is given in full."""
    return {"at": value} if isinstance(value, list) else value


class ModelControl(Section):
    """The control of the model."""

    layout: Annotated[Words, AfterValidator(one_of(*LAYOUTS))] = key(
        "`corners`, `corners+centre`, or `six` standard points", "corners"
    )
    points: list[Annotated[ModelControlPoint, BeforeValidator(_control_point)]] = key(
        "Points instead of a layout: [x, y], or {at: [x, y], use: z}", []
    )
    sigma: Sigmas = key("Standard deviations along, across and in height", ModelSpec.control_sigma, unit="m")


class ModelOrientation(Section):
    """The points that orient the pair."""

    zone_points: Annotated[Whole, AfterValidator(bounded(ZONE_POINTS))] = key("Points in each of six zones", 1)
    points: list[Pair] = key("Points instead of zones: [x, y], from the left nadir", [], unit="mm")


class Grid(Section):
    """Where errors are computed."""

    columns: Annotated[Whole, AfterValidator(bounded(GRID))] = key("Points along the base", ModelSpec.grid[0])
    rows: Annotated[Whole, AfterValidator(bounded(GRID))] = key("Points across the flight", ModelSpec.grid[1])


class ModelPlanFile(Section):
    """Expected errors over one model. Every key but the first has a default."""

    photostrip_plan_model: Annotated[Words, AfterValidator(one_of(SCHEMA_NUMBER))] = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the plan", "model")
    camera: SimulatedCamera = key("Camera", SimulatedCamera.model_construct())
    end_lap_percent: Percent = key("Overlap of the two photos", 60.0, unit="%")
    base: Positive | None = key("Photo base, instead of the overlap", None, unit="mm")
    reach_percent: Annotated[Positive, AfterValidator(bounded(REACH))] = key(
        "Outermost points, of half the width of the photo", 80.0, unit="%"
    )
    scale: Positive | None = key("Denominator of the photo scale; default: 10000", None)
    flying_height: Positive | None = key("Height above the ground, instead of `scale`", None, unit="m")
    image_sigma_um: SigmaUm = key("Standard deviation of an image coordinate", 5.0, unit="um")
    orientation: ModelOrientation = key("Points that orient the pair", ModelOrientation.model_construct())
    control: ModelControl = key("Control", ModelControl.model_construct())
    grid: Grid = key("Where errors are computed", Grid.model_construct())

    @model_validator(mode="after")
    def _one_scale(self) -> Self:
        _scale_or_height(self.scale, self.flying_height)
        return self


@dataclass(frozen=True, eq=False)
class ModelPlan:
    """A plan of one model.

    Parameters
    ----------
    name : str
        Its name.
    camera : str
        Name of the camera.
    spec : ModelSpec
        What is to be computed.
    files : tuple of str
        Every file that was read.
    """

    name: str
    camera: str
    spec: ModelSpec
    files: tuple[str, ...]


def load_model_plan(path: Path | None, assignments: Sequence[str]) -> ModelPlan:
    """Read the plan of a model.

    Parameters
    ----------
    path : Path, optional
        The file; without one the assignments and defaults are the plan.
    assignments : sequence of str
        Assignments ``key.path=value``.

    Returns
    -------
    ModelPlan
        The plan.

    Raises
    ------
    InputError
        With every fault.
    """
    given, files, _ = read_plan(ModelPlanFile, path, assignments)
    camera = camera_of(given.camera)
    along, across = camera.format or (230.0, 230.0)
    base = given.base or along * (1.0 - given.end_lap_percent / 100.0)
    width = across / 2.0 * given.reach_percent / 100.0
    scale = given.scale or (given.flying_height or 0.0) / camera.principal_distance * 1000.0 or ModelSpec.scale
    points = tuple(ControlPoint(point.at, str(point.use)) for point in given.control.points)
    spec = ModelSpec(
        camera.principal_distance,
        base,
        width,
        scale,
        given.image_sigma_um / 1000.0,
        given.orientation.zone_points,
        tuple(given.orientation.points),
        points or control_layout(str(given.control.layout), base, width),
        given.control.sigma,
        (given.grid.columns, given.grid.rows),
    )
    return ModelPlan(str(given.name), camera.name, spec, files)


# ------------------------------------------------------------------------------------------------------- cameras


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


@dataclass(frozen=True, eq=False)
class CameraPlan:
    """Cameras to compare.

    Parameters
    ----------
    name : str
        Name of the comparison.
    cameras : tuple of Camera
        The cameras, in the order of the file.
    reference : Camera
        The one that the others stand beside.
    files : tuple of str
        Every file that was read.
    """

    name: str
    cameras: tuple[camera_efficiency.Camera, ...]
    reference: camera_efficiency.Camera
    files: tuple[str, ...]


def load_camera_plan(path: Path, assignments: Sequence[str]) -> CameraPlan:
    """Read a list of cameras to compare.

    Parameters
    ----------
    path : Path
        The file.
    assignments : sequence of str
        Assignments ``key.path=value``.

    Returns
    -------
    CameraPlan
        The cameras.

    Raises
    ------
    InputError
        With every fault.
    """
    given, files, _ = read_plan(CameraPlanFile, path, assignments)
    cameras = tuple(_plan_camera(str(name), each, given.end_lap_percent) for name, each in given.cameras.items())
    named = {camera.name: camera for camera in cameras}
    return CameraPlan(str(given.name), cameras, named.get(str(given.reference), cameras[-1]), files)


def _plan_camera(name: str, given: PlanCamera, end_lap: float) -> camera_efficiency.Camera:
    base = given.base
    if base is None and given.format is not None:
        base = given.format[0] * (1.0 - end_lap / 100.0)
    # without a format all cameras count as equally wide
    width = given.format[1] if given.format is not None else camera_efficiency.PRINTED_BASE
    return camera_efficiency.Camera(name, given.principal_distance, given.sigma_um / 1000.0, base or np.nan, width)


# ---------------------------------------------------------------------------------------------------- any plan


def read_plan(kind: type[T], path: Path | None, assignments: Sequence[str]) -> tuple[T, tuple[str, ...], Node]:
    """Read a plan file, or make one of assignments alone.

    Parameters
    ----------
    kind : type
        Schema of the file; its first key is the number of the schema.
    path : Path, optional
        The file.
    assignments : sequence of str
        Assignments ``key.path=value``.

    Returns
    -------
    Section
        What is given, with all defaults.
    tuple of str
        Every file that was read.
    Node
        The plan as a tree.

    Raises
    ------
    InputError
        With every fault.
    """
    findings, files = Findings(), list[str]()
    if path is None:
        first, place = next(iter(kind.model_fields)), Place(COMMAND_LINE)
        root: Node | None = Node({first: Node(SCHEMA_NUMBER, place)}, place, {first: place})
    else:
        root = read_tree(str(path), findings, files)
    if root is None:
        raise InputError(findings.faults)
    root = override(root, assignments, findings)
    given = checked(kind, root, findings)
    findings.stop()
    if given is None:  # cannot be: checked() had a reason, and stop() told it
        raise InputError(f"{path} is not a valid plan")
    return given, tuple(files), root
