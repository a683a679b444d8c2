"""``photostrip step``: single steps of the method, from a table of points, for teaching and checking."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from photostrip.cli.documents import FORMS, Form, Rendering
from photostrip.cli.option_groups import command_group, subcommand
from photostrip.cli.options import Silent, require_target
from photostrip.cli.stdout import Document

step = command_group("Single steps of the method, from a table of points: for teaching and checking.")

Table = Annotated[Path, typer.Argument(metavar="FILE", help="Table of points (CSV).", show_default=False)]
Focal = Annotated[float, typer.Option("--principal-distance", "-f", metavar="MM", min=1e-6, help="Principal distance.")]
Base = Annotated[float, typer.Option("--base", metavar="B", min=1e-9, help="Length of the first base.")]
Unit = Annotated[str, typer.Option("--unit", metavar="NAME", help="What ground or model coordinates are in.")]
Sigma = Annotated[
    float, typer.Option("--sigma-um", metavar="UM", min=1e-6, help="Standard deviation of an image coordinate.")
]


@dataclass(frozen=True)
class Delivery:
    """How a step is printed, and where it is written."""

    form: Annotated[Form, typer.Option("--format", help="How the answer is printed.")] = "text"
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write .json, .csv, .md or .txt.")
    ] = None
    trace: Annotated[
        bool, typer.Option("--trace", help="The equations with their numbers, too: every iteration, every point.")
    ] = False
    quiet: Silent = False

    def deliver(self, document: Document, trace: Callable[[], list[Document]]) -> None:
        """Print a step; write it when a file is named."""
        if self.trace:
            document["trace"] = trace()
        from photostrip.formats.output.csv_text import to_csv
        from photostrip.report.commands.steps import step_report

        def table(document: Document) -> str:
            return to_csv([document["of"], *(each["name"] for each in document["columns"])], document["points"])

        rendering = Rendering(step_report, table)
        if self.output is not None:
            from photostrip.formats.text.writing import write_text

            write_text(self.output, rendering.rendered(document, FORMS[self.output.suffix.lower()]))
        if self.output is None or not self.quiet:
            rendering.show(document, self.form)

    def checked(self) -> None:
        """Refuse a file that cannot be written before anything is computed."""
        require_target(None, self.output)
        if self.output is not None and self.output.suffix.lower() not in FORMS:
            message = f"no step is written as '{self.output.suffix}': the name may end in {', '.join(FORMS)}"
            raise typer.BadParameter(message, param_hint="--output")


def _command(name: str, columns: str, example: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    text = f"\b\nColumns of FILE: {columns}\n\b\nExample:\n  photostrip step {name} {example}"
    return subcommand(step, name, text)


@dataclass(frozen=True)
class Model:
    """What photos make a model with."""

    focal: Focal
    base: Base = 100.0


@_command("interior", "mark, x, y, x_photo, y_photo", "marks.csv --transform conformal")
def interior(
    *,
    file: Table,
    transform: Annotated[
        Literal["conformal", "affine", "bilinear", "projective"],
        typer.Option("--transform", help="From measured to photo coordinates."),
    ] = "affine",
    delivery: Delivery,
) -> None:
    """Fit the transformation of measured fiducial marks to calibrated ones, mm."""
    from photostrip.library import step_documents, step_traces, steps

    ids, (measured, calibrated) = _read(file, "interior", delivery)
    found = steps.interior(measured, calibrated, transform)
    document = step_documents.interior(ids, found)
    delivery.deliver(document, lambda: step_traces.interior(ids, measured, calibrated, found))


@_command("refine", "point, x, y", "points.csv -f 152.12 --principal-point 0.012,-0.004 --k 2.5e-8,0,0")
def refine(
    *,
    file: Table,
    focal: Focal,
    principal_point: Annotated[
        str, typer.Option("--principal-point", metavar="X,Y", help="Principal point, mm.")
    ] = "0,0",
    k: Annotated[
        str, typer.Option("--k", metavar="K1,K2,K3", help="Radial distortion, from image to ideal coordinates.")
    ] = "0,0,0",
    flying_height: Annotated[
        float | None, typer.Option("--flying-height", metavar="M", help="Above sea level; corrects refraction.")
    ] = None,
    ground_height: Annotated[
        float, typer.Option("--ground-height", metavar="M", help="Of the terrain, above sea level.")
    ] = 0.0,
    delivery: Delivery,
) -> None:
    """Reduce photo coordinates, mm, to the principal point, and correct lens distortion and refraction."""
    from photostrip.camera import Camera, Distortion
    from photostrip.library import step_documents, step_traces, steps

    ids, (xy,) = _read(file, "refine", delivery)
    k1, k2, k3 = _numbers(k, 3, "--k")
    x0, y0 = _numbers(principal_point, 2, "--principal-point")
    lens = Distortion(model="brown", direction="image_to_ideal", k=(k1, k2, k3)) if any((k1, k2, k3)) else None
    camera = Camera(name="camera", principal_distance=focal, principal_point=(x0, y0), distortion=lens)
    refined = steps.refine(xy, camera, flying_height=flying_height, ground_height=ground_height)
    delivery.deliver(step_documents.refine(ids, xy, refined), lambda: step_traces.refine(ids, xy, refined, camera))


@_command("relative", "point, x_left, y_left, x_right, y_right", "pair.csv -f 153 --base 920 --unit m")
def relative(
    *,
    file: Table,
    model: Model,
    unit: Unit = "mm",
    delivery: Delivery,
) -> None:
    """Orient two photos relative to each other, image coordinates in mm, and form their model in any unit.

    The elements stand relative to the base, and as bx, by, bz and angles of the right photo in the system of the left.
    """
    from photostrip.library import step_documents, step_traces, steps

    ids, (left, right) = _read(file, "relative", delivery)
    found = steps.relative(left, right, model.focal, base=model.base)
    document = step_documents.relative(ids, found, model.base, unit)
    delivery.deliver(document, lambda: step_traces.relative(ids, left, right, model.focal, found, model.base))


@_command(
    "intersection",
    "point, x_left, y_left, x_right, y_right",
    "pair.csv -f 153 --base 920,0,0 --left 0,0,0 --right 0.2,-0.1,1.4",
)
def intersection(
    *,
    file: Table,
    focal: Focal,
    base: Annotated[str, typer.Option("--base", metavar="BX,BY,BZ", help="From the left to the right centre.")],
    left: Annotated[
        str, typer.Option("--left", metavar="W,P,K", help="Omega, phi, kappa of the left photo, degrees.")
    ] = "0,0,0",
    right: Annotated[
        str, typer.Option("--right", metavar="W,P,K", help="Omega, phi, kappa of the right photo, degrees.")
    ] = "0,0,0",
    unit: Unit = "m",
    left_ray: Annotated[
        bool, typer.Option("--left-ray", help="Y of the left ray, as printed, instead of the mean of both.")
    ] = False,
    delivery: Delivery,
) -> None:
    """Intersect the rays of two photos of known orientation; points stand relative to the left perspective centre."""
    import numpy as np

    from photostrip.library import step_documents, step_traces, steps

    ids, (one, other) = _read(file, "intersection", delivery)
    turned = _rotation(_numbers(left, 3, "--left")), _rotation(_numbers(right, 3, "--right"))
    b = np.array(_numbers(base, 3, "--base"))
    found = steps.intersection(one, other, focal, base=b, rotations=turned, left_ray=left_ray)
    document = step_documents.intersection(ids, found, unit)
    delivery.deliver(document, lambda: step_traces.intersection(ids, (one, other), focal, b, turned))


@_command("chain", "photo, omega, phi, kappa (degrees)", "strip.csv")
def chain(*, file: Table, delivery: Delivery) -> None:
    """Hand the orientation on along a strip: each photo is given in the system of the photo before it.

    The first photo is given in the system of the strip: 0, 0, 0, or its angles there.
    """
    import numpy as np

    from photostrip.library import step_documents, step_traces, steps

    ids, (given,) = _read(file, "chain", delivery)
    rotations = np.array([_rotation(each) for each in given.tolist()])
    handed = steps.chain(rotations[1:], rotations[0])
    delivery.deliver(step_documents.chain(ids, handed), lambda: step_traces.chain(ids, rotations, handed))


@_command("scale", "point, x, y, z, x_next, y_next, z_next", "junction.csv")
def scale(*, file: Table, delivery: Delivery) -> None:
    """Bring a model to the scale of the one before it by common points, each from the perspective centre of both."""
    from photostrip.library import step_documents, step_traces, steps

    ids, (first, second) = _read(file, "scale", delivery)
    factor, departures = steps.scale_transfer(first, second)
    document = step_documents.scale(ids, factor, departures)
    delivery.deliver(document, lambda: step_traces.scale(ids, first, second, factor))


@_command("strip", "photo, point, x, y", "images.csv -f 153 --base 92 --unit mm")
def strip(
    *,
    file: Table,
    model: Model,
    unit: Unit = "mm",
    scale_transfer: Annotated[
        Literal["least_squares", "distances"], typer.Option("--scale-transfer", help="Weights of the pass points.")
    ] = "least_squares",
    delivery: Delivery,
) -> None:
    """Form a strip from photos alone, in the order of the table: model coordinates in the system of the first photo.

    Image coordinates in mm. The steps in between are `relative`, `chain`, `intersection` and `scale`.
    """
    from photostrip.library import step_documents, step_traces, steps

    photos, points, rays = _read_rays(file, delivery)
    names = photos, points
    found = steps.strip(rays, model.focal, base=model.base, scale_transfer=scale_transfer, names=names)
    document = step_documents.strip(photos, points, found, unit)
    delivery.deliver(document, lambda: step_traces.strip(photos, found))


@_command("absolute", "point, x, y, z, x_ground, y_ground, z_ground", "control.csv")
def absolute(*, file: Table, unit: Unit = "m", delivery: Delivery) -> None:
    """Fit a model to points that are known in Cartesian ground coordinates, by seven parameters."""
    from photostrip.library import step_documents, step_traces, steps

    ids, (model, ground) = _read(file, "absolute", delivery)
    found = steps.absolute(model, ground)
    document = step_documents.absolute(ids, found, unit)
    delivery.deliver(document, lambda: step_traces.absolute(ids, model, ground, found, unit))


@_command("polynomial", "point, x, y, z, misclosure", "control.csv --terms 1,X,Y,X^2")
def polynomial(
    *,
    file: Table,
    terms: Annotated[str, typer.Option("--terms", metavar="A,B,...", help="Of 1, X, Y, XY, X^2 and X^3.")] = "1,X,Y",
    unit: Unit = "m",
    delivery: Delivery,
) -> None:
    """Fit the deformation of a strip along one axis: misclosures, strip minus given, at control points."""
    from photostrip.library import step_documents, step_traces, steps

    ids, (xyz, misclosures) = _read(file, "polynomial", delivery)
    wanted, values = [each.strip() for each in terms.split(",")], misclosures[:, 0]
    found = steps.polynomial(xyz, values, wanted)
    document = step_documents.polynomial(ids, wanted, *found, unit)
    delivery.deliver(document, lambda: step_traces.polynomial(ids, xyz, values, wanted, found))


@_command("resection", "point, x, y, x_ground, y_ground, z_ground", "photo.csv -f 152.12 --sigma-um 8")
def resection(*, file: Table, focal: Focal, sigma_um: Sigma = 5.0, unit: Unit = "m", delivery: Delivery) -> None:
    """Orient one photo on known points, at any attitude, image coordinates in mm."""
    from photostrip.library import step_documents, step_traces, steps

    ids, (xy, ground) = _read(file, "resection", delivery)
    found = steps.resection(xy, ground, focal, sigma=sigma_um / 1000.0)
    document = step_documents.resection(ids, found, unit)
    delivery.deliver(document, lambda: step_traces.resection(ids, xy, ground, focal, found, unit))


@_command("bundle", "photo, point, x, y", "images.csv -f 153 --control control.csv --sigma-um 5")
def bundle(
    *,
    file: Table,
    model: Model,
    control: Annotated[
        Path | None,
        typer.Option("--control", metavar="FILE", help="Given points: point, x_ground, y_ground, z_ground."),
    ] = None,
    control_sigma: Annotated[
        float, typer.Option("--control-sigma", metavar="S", min=1e-9, help="Standard deviation of a given coordinate.")
    ] = 0.05,
    sigma_um: Sigma = 5.0,
    unit: Unit = "m",
    delivery: Delivery,
) -> None:
    """Adjust all photos and points at once, from the strip that they form, in the order of the table.

    Image coordinates in mm. Without control: a free network in model coordinates, as long as its first base says.
    """
    from photostrip.library import step_documents, step_traces, steps

    photos, points, rays = _read_rays(file, delivery)
    ground = None if control is None else _given(control, points, delivery)
    found = steps.bundle(
        rays,
        model.focal,
        ground=ground,
        base=model.base,
        sigma=sigma_um / 1000.0,
        ground_sigma=control_sigma,
        names=(photos, points),
    )
    document = step_documents.bundle(photos, points, found, ground, unit)
    delivery.deliver(document, lambda: step_traces.bundle(photos, points, rays, model.focal, found, unit))


def _read(file: Path, name: str, delivery: Delivery) -> tuple[list[str], Any]:
    """Read the table of a step; a file that cannot be written is refused before."""
    from photostrip.formats.measured.steps import read_step

    delivery.checked()
    return read_step(str(file), name)


def _read_rays(file: Path, delivery: Delivery) -> tuple[tuple[str, ...], tuple[str, ...], Any]:
    """Read image coordinates of all photos: ids of photos and points, and the rays."""
    from photostrip.formats.measured.steps import read_rays

    delivery.checked()
    read = read_rays(str(file))
    return read.photo_ids, read.target_ids, (read.photo, read.target, read.xy)


def _given(control: Path, points: tuple[str, ...], delivery: Delivery) -> Any:  # noqa: ANN401 (an array)
    """Read given coordinates of points in their order; NaN for a point without."""
    import numpy as np

    ids, (ground,) = _read(control, "bundle", delivery)
    at = dict(zip(ids, ground, strict=True))
    return np.array([at.get(point, np.full(3, np.nan)) for point in points])


def _numbers(text: str, count: int, option: str) -> list[float]:
    """Return the numbers of an option, or refuse it."""
    try:
        found = [float(each) for each in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count or not all(-1e12 < each < 1e12 for each in found):  # noqa: PLR2004 (no NaN, no infinity)
        raise typer.BadParameter(f"'{text}' is not {count} numbers with commas between them", param_hint=option)
    return found


def _rotation(degrees: list[float]) -> Any:  # noqa: ANN401 (an array)
    from math import radians

    from photostrip.geometry.rotation import from_angles

    return from_angles([radians(each) for each in degrees], "omega-phi-kappa")
