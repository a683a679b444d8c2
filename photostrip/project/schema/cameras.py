"""The blocks `cameras`, `strips` and `photos` of a project."""

from typing import Annotated

from pydantic import Discriminator, Tag

from photostrip import camera
from photostrip.errors import InputError
from photostrip.network.problem import ASKED
from photostrip.project.schema.ground import Angles
from photostrip.project.schema.sections import (
    Before,
    Id,
    Number,
    Pair,
    Positive,
    Read,
    Section,
    Triple,
    choice,
    if_empty,
    key,
    known_word,
    length,
    quoted,
    read_positive,
    rule,
    single,
    wrong,
)
from photostrip.strip import pixel_cameras
from photostrip.strip.fiducial_marks import PLACES
from photostrip.strip.pixel_cameras import CONVENTIONS, PIXEL_SIZE

Place = Annotated[str, choice(tuple(PLACES))]
Parameter = Annotated[str, choice(ASKED)]
AUTO, NEVER = "auto", "never"
MILLIMETRES, PIXELS = "mm", "px"


def _self_calibration(value: object) -> str | list[str]:
    if isinstance(value, list):
        return [known_word(single(each, f"one of {', '.join(ASKED)}"), ASKED) for each in value]
    return known_word(single(value, f"{AUTO}, {NEVER} or a list of parameters"), (AUTO, NEVER))


SelfCalibration = Annotated[
    str | list[str],
    Read(
        _self_calibration,
        {"anyOf": [{"enum": [AUTO, NEVER]}, {"type": "array", "items": {"enum": list(ASKED)}}]},
    ),
]


class Distortion(Section):
    """Lens distortion of a camera."""

    model: Annotated[str, choice(("brown", "radial-table"))] = key("`brown` or `radial-table`")
    direction: Annotated[str, choice(("image_to_ideal", "ideal_to_image"))] = key(
        "`image_to_ideal`: ideal = image + D(image); `ideal_to_image`: image = ideal + D(ideal)"
    )
    k: tuple[Number, Number, Number] = key(
        "Radial coefficients k1, k2, k3", (0.0, 0.0, 0.0), unit="mm^-2, mm^-4, mm^-6"
    )
    p: Pair = key("Decentring coefficients p1, p2", (0.0, 0.0), unit="mm^-1")
    b: Pair = key("Affinity b1 and shear b2: D_x gets b1 X + b2 Y", (0.0, 0.0))
    radius: list[Number] = key("Radial table: ascending distances from the principal point", [], unit="mm")
    distortion: list[Number] = key("Radial table: distortion at these distances, outwards positive", [], unit="mm")

    @rule
    def _one_model(self) -> None:
        table = self.model == "radial-table"
        for name in ("k", "p", "b") if table else ("radius", "distortion"):
            if name in self.model_fields_set:
                raise wrong(f"`{name}` does not belong to model {self.model}", at=name, fix="remove it or change model")
        if not table:
            return
        if len(self.radius) < 2 or len(self.radius) != len(self.distortion):
            message = f"{len(self.radius)} radii and {len(self.distortion)} values of distortion are given"
            raise wrong(message, at="distortion", expected="as many values as radii, at least two")
        steps = zip(self.radius, self.radius[1:], strict=False)
        if self.radius[0] < 0 or any(after <= before for before, after in steps):
            raise wrong("the radii do not ascend", at="radius", expected="distances from 0 upwards")


class CertifiedDistortion(Distortion):
    """Lens distortion of a camera as its certificate has it."""

    k0: Number = key("`brown`: the radial coefficient k0 of USGS, D = X k0: part of the principal distance", 0.0)

    @rule
    def _k0_scales_the_image(self) -> None:
        if self.k0 and self.model != "brown":
            raise wrong(f"`k0` does not belong to model {self.model}", at="k0", fix="remove it or change model")
        if not abs(self.k0) < 1.0:
            message = f"{self.k0:g} is out of range"
            raise wrong(message, code="range", at="k0", expected="a number near 0, as 1.2e-4, without unit")


Focal = Annotated[
    tuple[float, ...],
    Read(
        lambda value: tuple(map(read_positive, value if isinstance(value, list) and len(value) in {1, 2} else [value])),
        {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}]},
    ),
]


class PixelCamera(Section):
    """One camera as a program that counts in pixels gives it."""

    unit: Annotated[str, choice((PIXELS,))] = key("`px`: all of it is in pixels, as its convention counts")
    convention: Annotated[str, choice(tuple(CONVENTIONS))] = key(
        f"Whose signs, names and origins these are: {quoted(tuple(CONVENTIONS))}"
    )
    image_size: tuple[Positive, Positive] = key("Width and height of the photo", unit="px")
    focal_length: Focal = key("Focal length, or [fx, fy]", unit="px")
    principal_point: Pair = key("Principal point where the convention counts from, y down", unit="px")
    distortion: Annotated[dict[str, Number], Before(if_empty)] = key(
        "Coefficients by the names of the convention, as `{k1: -0.1}`", {}
    )
    pixel_size: Positive = key(
        "Size of a pixel; by default a micrometre, so that micrometres in reports are pixels", PIXEL_SIZE, unit="mm"
    )
    self_calibration: list[Parameter] | None = key(
        "Parameters of this camera that the bundle adjustment estimates. Default: `processing.self_calibration`",
        None,
    )

    @rule
    def _coefficients_have_counterparts(self) -> None:
        try:
            self.in_millimetres("")
        except InputError as error:
            fault = error.faults[0]
            raise wrong(fault.message, code=fault.code, at="distortion", fix=fault.fix) from None

    def in_millimetres(self, name: str) -> camera.Camera:
        """Return the camera as the program computes with it."""
        given = pixel_cameras.PixelCamera(
            convention=self.convention,
            image_size=self.image_size,
            focal_length=(self.focal_length[0], self.focal_length[-1]),
            principal_point=self.principal_point,
            distortion=self.distortion,
        )
        return pixel_cameras.in_millimetres(name, given, self.pixel_size)


class Camera(Section):
    """One camera, in millimetres."""

    unit: Annotated[str, choice((MILLIMETRES,))] | None = key("`mm`; `px` for a camera that is given in pixels", None)
    principal_distance: Positive = key("Principal distance", unit="mm")
    principal_point: Pair = key("Principal point in the system of the image coordinates", (0.0, 0.0), unit="mm")
    format: tuple[Positive, Positive] | None = key("Width and height of the photo; needed for pixels", None, unit="mm")
    pixel_size: Positive | None = key("Size of a pixel; needed for pixels without fiducial marks", None, unit="mm")
    fiducials: Annotated[dict[str, Pair], Before(if_empty)] = key(
        "Coordinates of the fiducial marks, by mark: calibrated, or nominal beside `fiducial_distances`", {}, unit="mm"
    )
    fiducial_places: Annotated[dict[str, Place], Before(if_empty)] = key(
        f"Where on the photo each mark is, for `fiducial_distances` without coordinates: {quoted(tuple(PLACES))}", {}
    )
    fiducial_distances: list[tuple[Id, Id, Positive]] = key(
        "Calibrated distances between marks, `[[F1, F2, 211.98], ...]`, where nothing else is calibrated", [], unit="mm"
    )
    distortion: CertifiedDistortion | None = key("Lens distortion", None)
    self_calibration: list[Parameter] | None = key(
        "Parameters of this camera that the bundle adjustment estimates. Default: `processing.self_calibration`",
        None,
    )

    @rule
    def _marks_have_a_place(self) -> None:
        if self.fiducial_places and (self.fiducials or not self.fiducial_distances):
            message = "places of fiducial marks are for distances between them without coordinates"
            raise wrong(message, at="fiducial_places", fix="remove them, or give fiducial_distances and no fiducials")
        if self.fiducial_distances and not (self.fiducials or self.fiducial_places):
            message = "distances alone do not say which mark is where"
            fix = "give fiducial_places: {F1: bottom-right, ...}, or nominal coordinates in fiducials"
            raise wrong(message, at="fiducial_distances", fix=fix)


def _unit(value: object) -> str:
    return PIXELS if isinstance(value, dict) and value.get("unit") == PIXELS else MILLIMETRES


AnyCamera = Annotated[Annotated[Camera, Tag(MILLIMETRES)] | Annotated[PixelCamera, Tag(PIXELS)], Discriminator(_unit)]


class FirstPhoto(Angles):
    """Orientation of the first photo of a strip, and the length of its first base: its frame and its scale."""

    angles: Triple = key("Angles of the first photo in the strip, in the order of their system", (0.0, 0.0, 0.0))
    base: Positive = key("Length of the first base in the strip", 1.0, unit="any")


class Strip(Section):
    """Photos of one flight line."""

    id: Id = key("Id of the strip")
    camera: Id | None = key("Camera of all its photos, a key of `cameras`; not with model coordinates", None)
    photos: Annotated[list[Id], length(1)] = key("Photos in flight order: two at least, or one in a bundle adjustment")
    models: Annotated[list[Id], length(1)] | None = key(
        "Independent models in flight order, one for every two neighbouring photos. Default: by their perspective"
        " centres",
        None,
    )
    first_photo: FirstPhoto | None = key(
        "Angles of the first photo and length of the first base, for strip coordinates as in a textbook", None
    )


class Photos(Section):
    """Photos of one camera in any order, among which a run finds the strips."""

    camera: Id = key("Camera of all these photos, a key of `cameras`")
    photos: Annotated[list[Id], length(1)] | None = key(
        "Their ids, in any order. Default: all measured photos that are listed nowhere else", None
    )
