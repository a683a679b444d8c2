"""The project file: every key, its unit, its default. Each description ends with the unit."""

from typing import Annotated

from photostrip.formats.text.findings import suggestion
from photostrip.formats.text.numbers import shown
from photostrip.plausibility import KINDS
from photostrip.project.schema.cameras import AnyCamera, Photos, Strip
from photostrip.project.schema.exports import ENDINGS, GEOPACKAGE, export, form_of
from photostrip.project.schema.ground import CameraPositions, Control, Orientations, Output
from photostrip.project.schema.measurements import FiducialMeasurements, Models, Observations
from photostrip.project.schema.processing import Processing
from photostrip.project.schema.sections import (
    Before,
    OneOrMany,
    Positive,
    Read,
    Section,
    Words,
    if_empty,
    key,
    length,
    rule,
    schema_number,
    single,
    text,
    wrong,
)


def _finding(value: object) -> str:
    """Read the code of a finding, alone or with the one id that it is accepted for."""
    expected = "a code such as P201, or P201/1003 for one photo, point or strip"
    word = single(value, expected)
    code, _, _ = word.partition("/")
    if code not in KINDS:
        message = f"there is no finding `{shown(code)}`"
        raise wrong(message, code="no-such-finding", expected=expected, fix=suggestion(code, KINDS))
    return text(word)


Accepted = Annotated[str, Read(_finding, {"type": "string", "pattern": "^P[0-9]{3}(/.+)?$"})]


Exported = Annotated[str, Read(export, {"type": "string"})]


class Tolerances(Section):
    """Largest allowed values; where one is exceeded the exit code is 1."""

    check_rms_xy: Positive | None = key("Largest rms of the check points in plan", None, unit="m")
    check_rms_z: Positive | None = key("Largest rms of the check points in height", None, unit="m")
    check_max_xy: Positive | None = key("Largest difference at a check point in plan", None, unit="m")
    check_max_z: Positive | None = key("Largest difference at a check point in height", None, unit="m")
    control_rms_xy: Positive | None = key("Largest rms of the control points in plan", None, unit="m")
    control_rms_z: Positive | None = key("Largest rms of the control points in height", None, unit="m")
    sigma0_um: Positive | None = key("Largest sigma0 of the image coordinates", None, unit="um")


class ProjectFile(Section):
    """A project of photostrip: what was measured, what is given, and what is to be done.

    All paths are relative to the file itself. All ids are text, quoted or not.
    """

    photostrip: Annotated[int, schema_number("photostrip")] = key("Number of this schema")
    name: Words | None = key("Name of the project; default: the file's name without its ending", None)
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    cameras: Annotated[dict[str, AnyCamera], length(1), Before(if_empty)] = key(
        "Cameras by name; needed with `observations`", {}
    )
    strips: Annotated[list[Strip], length(1)] = key(
        "Strips: photos in flight order; beside or in place of `photos`", []
    )
    photos: Annotated[list[Photos], length(1), OneOrMany()] = key(
        "Photos in no given order, for the bundle adjustment: `{camera: name}`, or a list of `{camera, photos}`", []
    )
    observations: Observations | None = key("Points measured on photos; or `models`", None)
    models: Models | None = key("Independent models measured on a plotter, in place of `observations`", None)
    fiducial_measurements: FiducialMeasurements | None = key("Fiducial marks measured on photos", None)
    control: list[Control] = key(
        "Lists of given ground coordinates, each in its own frame; a bundle adjustment may do without", []
    )
    camera_positions: CameraPositions | None = key("Measured positions of the cameras, for the bundle adjustment", None)
    orientations: Orientations | None = key("Given exterior orientations, for the bundle adjustment", None)
    output: Output = key("Frame and angles of the results", Output())
    processing: Processing = key("What is computed and how", Processing())
    tolerances: Tolerances = key("Largest allowed values; where one is exceeded the exit code is 1", Tolerances())
    accept: list[Accepted] = key(
        "Findings that were looked at and are accepted: codes, or `code/id` for one photo, point or strip",
        [],
    )
    export: list[Exported] = key(
        "Files for other programs that each run with -o writes beside its result, by their ending: "
        + ", ".join(f"`{ending}` {name}" for name, ending in ENDINGS.items()),
        [],
    )

    @rule
    def _models_have_no_oriented_photos(self) -> None:
        for name in self.export:
            if self.models is not None and form_of(name) != GEOPACKAGE:
                message = f"independent models give no orientation of photos, which {name} is made of"
                raise wrong(message, code="export", at="export", fix="remove it; a GeoPackage (.gpkg) can be written")

    @property
    def camera_of(self) -> dict[str, str | None]:
        """Camera of every photo that is listed: of the strips, then of `photos`."""
        return {str(photo): group.camera for group in self.groups for photo in group.photos or []}

    @property
    def groups(self) -> list[Strip | Photos]:
        """Photos with a camera in common: of the strips, then of `photos`."""
        return [*self.strips, *self.photos]
