"""A simulation as a project: the files that ``photostrip run`` reads.

Files are the same to the byte for the same specification: fixed decimals, no time stamps, points in the order in
which they were placed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

from photostrip.camera import Camera
from photostrip.formats.output import simulation_tables as tables
from photostrip.formats.output.simulation_tables import on_one_line
from photostrip.formats.output.simulation_truth import truth_text
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import counted
from photostrip.pipeline.inputs import ModelStrip
from photostrip.points import ModelPoints
from photostrip.simulation import Simulation


def project_files(simulation: Simulation) -> dict[str, str]:
    """Write a simulation as a project: content by file name, the tables, ``truth.json``, ``project.yaml`` last."""
    frames, output = tie_frames(simulation.frames)
    files = {}
    if simulation.models is None:
        files["observations.csv"] = tables.measurements_csv(simulation, simulation.observations, "point")
    else:
        files["models.csv"] = tables.models_csv(simulation, simulation.models)
    if simulation.fiducials is not None:
        files["fiducials.csv"] = tables.measurements_csv(simulation, simulation.fiducials, "mark")
    for number, frame in enumerate(frames):
        files[control_file(number)] = tables.control_csv(simulation, number, frame)
    if simulation.gnss is not None:
        files["gnss.csv"] = tables.gnss_csv(simulation, simulation.gnss, output)
    files["truth.json"] = truth_text(simulation, output)
    files["project.yaml"] = _project(simulation)
    return files


def model_strips(simulation: Simulation, points: ModelPoints) -> Iterator[ModelStrip]:
    """Name the strips of models as a project does, one for each strip of photos."""
    first = 0
    for name, photos in simulation.strips:
        end = first + len(photos) - 1
        yield ModelStrip(name, photos, points.model_ids[first:end])
        first = end


def control_file(number: int) -> str:
    """Name of a control list: ``control.csv``, ``control_2.csv``."""
    return "control.csv" if number == 0 else f"control_{number + 1}.csv"


def _project(simulation: Simulation) -> str:
    """Write the project file. Every text stands in quotation marks, as JSON writes it, which YAML reads."""
    spec = simulation.spec
    lines = ["photostrip: 1", f"name: {on_one_line(spec.name)}"]
    lines += _of_photos(simulation) if simulation.models is None else _of_models(simulation, simulation.models)
    lines += ["control:"]
    for number, frame in enumerate(simulation.frames):
        lines += _listed(control_file(number), frame, spec.control.sigma, "  - ", "    ")
    if spec.gnss is not None and spec.gnss.use:
        lines += ["camera_positions:", *_listed("gnss.csv", simulation.frames[0], spec.gnss.sigma, "  ", "  ")]
    if spec.refraction:
        lines += ["processing:", "  refraction: true"]
    return "\n".join(lines) + "\n"


def _of_models(simulation: Simulation, measured: ModelPoints) -> list[str]:
    lines = ["strips:"]
    listed = simulation.spec.models is not None and not simulation.spec.models.centers
    for strip in model_strips(simulation, measured):
        lines += [f"  - id: {on_one_line(strip.id)}", f"    photos: {on_one_line(strip.photos)}"]
        if listed:  # without centres nothing else tells which photos a model shows
            lines += [f"    models: {on_one_line(strip.models)}"]
    lines += ["models:", "  file: models.csv", "  unit: mm"]
    if simulation.spec.models is not None and simulation.spec.models.hand != "right-handed":
        lines += [f"  axes: {simulation.spec.models.hand}"]
    center = measured.node >= len(measured.point_ids)
    for key, rows in (("sigma", ~center), ("center_sigma", center)):
        if rows.any():
            lines += [f"  {key}: {on_one_line([float(f'{value:.6g}') for value in measured.sigma[rows][0].tolist()])}"]
    return lines


def _of_photos(simulation: Simulation) -> list[str]:
    """Lines of cameras, strips and image coordinates."""
    spec = simulation.spec
    lines = ["cameras:", *_camera(spec.camera), "strips:"]
    for name, photos in simulation.strips:
        lines += [
            f"  - id: {on_one_line(name)}",
            f"    camera: {on_one_line(spec.camera.name)}",
            f"    photos: {on_one_line(photos)}",
        ]
    unit = tables.unit_size(spec.camera, spec.image.unit)
    sigma = float(simulation.observations.sigma[0, 0]) / unit
    lines += [
        "observations:",
        "  file: observations.csv",
        f"  unit: {spec.image.unit}",
        f"  y_axis: {spec.image.y_axis}",
    ]
    if origin := tables.image_origin(simulation):
        lines += [f"  origin: {origin}"]
    lines += [f"  sigma: {sigma:.6g}"]
    if simulation.fiducials is not None:
        lines += ["fiducial_measurements:", "  file: fiducials.csv"]
    return lines


def _camera(camera: Camera) -> list[str]:
    lines = [
        f"  {on_one_line(camera.name)}:",
        f"    principal_distance: {camera.principal_distance!r}",
        f"    principal_point: {on_one_line(camera.principal_point)}",
        f"    format: {on_one_line(camera.format)}",
    ]
    if camera.pixel_size is not None:
        lines += [f"    pixel_size: {camera.pixel_size!r}"]
    if camera.fiducials:
        lines += [
            "    fiducials:",
            *(f"      {on_one_line(mark)}: {on_one_line(xy)}" for mark, xy in camera.fiducials.items()),
        ]
    if camera.distortion is not None:
        shape = asdict(camera.distortion)
        names = ("k", "p", "b") if camera.distortion.model == "brown" else ("radius", "distortion")
        lines += ["    distortion:", f"      model: {shape['model']}", f"      direction: {shape['direction']}"]
        lines += [f"      {name}: {on_one_line(shape[name])}" for name in names]
    return lines


def _listed(file: str, frame: FrameSpec, sigma: tuple[float, float, float], first: str, indent: str) -> list[str]:
    """Lines of a list of ground coordinates: its file, its frame, its standard deviations in the order of the axes."""
    names = ("east", "north", "up") if "east" in frame.axes else ("x", "y", "z")
    lines = [
        f"{first}file: {file}",
        f"{indent}crs: {on_one_line(frame.crs)}",
        f"{indent}axes: [{', '.join(frame.axes)}]",
    ]
    if frame.height != "ellipsoidal":
        lines += [f"{indent}height: {frame.height}"]
    if frame.geoid_undulation is not None:
        lines += [f"{indent}geoid_undulation: {frame.geoid_undulation!r}"]
    if frame.ellipsoid is not None:
        lines += [f"{indent}ellipsoid: {{a: {frame.ellipsoid[0]!r}, b: {frame.ellipsoid[1]!r}}}"]
    return [*lines, f"{indent}sigma: {on_one_line([sigma[names.index(axis)] for axis in frame.axes])}"]


def summary(simulation: Simulation) -> str:
    """Say in one line what was simulated: counts of strips, photos, points and errors, photo scale and seed."""
    spec, control, models = simulation.spec, simulation.control, simulation.models
    check = int(control.check.sum())
    measured = (
        counted(len(simulation.observations), "image point")
        if models is None
        else f"{counted(len(models), 'point')} of {counted(len(models.model_ids), 'model')}"
    )
    parts = [
        counted(len(simulation.strips), "strip"),
        counted(len(simulation.truth.photo_ids), "photo"),
        f"scale 1:{spec.scale:.0f}",
        counted(len(simulation.truth.points), "point"),
        measured,
        counted(len(control) - check, "control point"),
        counted(check, "check point"),
    ]
    if simulation.truth.errors:
        parts.append(counted(len(simulation.truth.errors), "gross error"))
    return ", ".join([*parts, f"seed {spec.seed}"])
