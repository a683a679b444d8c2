"""What can be said about a project before anything is adjusted: ``photostrip check``.

The faults of the files were found while they were read. Here is the rest: whether photos, pairs, strips and control
have what an adjustment needs, what the ground frames make of a coordinate, which standard deviation each control
coordinate gets and from where, and what became of every row of every table.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.faults import Findings
from photostrip.formats.measured import ControlTable, Measurements
from photostrip.formats.models import ModelTable
from photostrip.formats.tables import Table
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Document, Finding, Note, counted, listed
from photostrip.pipeline import gate
from photostrip.pipeline.frames import orient_interior
from photostrip.pipeline.given_cameras import over_control
from photostrip.pipeline.inputs import BUNDLE, Inputs, MeasuredModels, require_measured, require_named, require_whole
from photostrip.points import locate
from photostrip.project.loading import Project, read_project
from photostrip.project.reading import fault_at, key_path
from photostrip.project.tables import Tables, rays
from photostrip.strip import corrections
from photostrip.units import MICROMETRES, MILLIMETRES

LEAST_SHARED = 4  # points that orient a photo
LEAST_PLAN, LEAST_HEIGHT = 2, 3  # control coordinates that seven parameters need


@dataclass(frozen=True)
class Checked:
    """What was found in one project."""

    path: str
    faults: tuple[Fault, ...]  # what must be put right before the project can be adjusted
    findings: tuple[Finding, ...]
    notes: tuple[Note, ...]
    document: Document  # what was decoded: counts, rows, frames, control; empty when the files could not be read

    @property
    def everything(self) -> tuple[Fault | Finding | Note, ...]:
        """Faults, then findings, then notes."""
        return self.faults + self.findings + self.notes

    @property
    def wrong(self) -> int:
        """How much must be put right: faults, and findings that stand against the whole result."""
        return len(self.faults) + sum(each.is_error for each in self.findings)

    @property
    def remarks(self) -> int:
        """How much else is reported."""
        return len(self.everything) - self.wrong


def check_project(path: Path, overrides: Sequence[str] = ()) -> Checked:
    """Check a project as far as that goes without adjusting it; nothing is raised for a faulty project."""
    try:
        project, tables = read_project(path, overrides)
    except InputError as error:
        return Checked(path=str(path), faults=error.faults, findings=error.findings, notes=(), document={})
    inputs, models = project.inputs, project.inputs.models
    faults = _refused(project, partial(require_measured, project.settings.relative, inputs.observations))
    if models is not None:
        faults += _refused(project, partial(require_named, project.settings.links, models.points))
    notes = list(project.hints)
    notes += _image_coordinates(project, faults)
    used = observations_used(inputs) if models is None else np.zeros(0, np.intp)
    faults += [*_neighbours(project), *_alone(project)] if models is None else links_of_models(project, models)
    # strips of a block may hang on others, or on cameras
    hung = len(inputs.strips) > 1 or inputs.positions is not None or inputs.orientations is not None
    if project.settings.adjustment != BUNDLE and not (project.settings.together and models is None and hung):
        faults += _control_of_strips(project, used)
    frames = _frames(project, tables, faults)
    if models is not None and (read := tables.models) is not None:
        sigma = {"model_sigma": sigma_of(project, "models", (read.points, read.centers), models.points.sigma)}
    else:
        measured = (tables.observations,)
        sigma = {"image_sigma": sigma_of(project, "observations", measured, inputs.observations.sigma)}
        pixels = {strip.camera.pixel_size if strip.camera.unit == "px" else None for strip in inputs.strips}
        if len(pixels) == 1 and (pixel := pixels.pop()) is not None:
            sigma["image_sigma"]["pixel_um"] = pixel * MICROMETRES
    gaps = gaps_of(inputs, used) if models is None else []
    if gaps and not project.settings.together:
        number = counted(len(gaps), "point is", "points are")
        message = f"{number} not on two neighbouring photos of one strip and cannot be used: {listed(gaps)}"
        notes.append(Note("no-neighbour", message, "note", points=tuple(gaps)))
    document: Document = {
        "name": inputs.name,
        "angle_unit": project.settings.angle_unit,
        "counts": _counts(project) | {"without_neighbour": len(gaps)},
        **sigma,
        "frames": frames,
        "control": list(_control(project, tables)),
        "cameras": list(_cameras(project)),
        "rows": table_rows(project, tables, gaps),
    }
    kept = Findings()  # of too many faults in one file they only count the rest
    kept.add(*dict.fromkeys(faults))
    return Checked(
        path=str(path),
        faults=kept.faults,
        findings=_against_themselves(project),
        notes=tuple(notes),
        document=document,
    )


def _against_themselves(project: Project) -> tuple[Finding, ...]:
    """Let the gate look for what the data alone show, without an adjustment."""
    try:
        return project.placed(gate.of_inputs(project.inputs, project.settings, project.directory))
    except (InputError, GeometryError):
        return ()  # what is wrong is reported as a fault


def _refused(project: Project, test: Callable[[], None]) -> list[Fault]:
    """Return what a test of the pipeline refuses, with its place in the project file."""
    try:
        with project.places():
            test()
    except InputError as error:
        return list(error.faults)
    return []


def _image_coordinates(project: Project, faults: list[Fault]) -> list[Note]:
    """Look at fiducial marks and distortion; what is refused there refuses the project."""
    inputs, notes = project.inputs, []
    try:
        with project.places():
            photo = orient_interior(inputs, project.settings)
            notes = [] if photo.interior is None else list(photo.interior.notes)
            # refraction and curvature need heights that only a run can find; they refuse nothing in a file
            wanted = replace(project.settings.refinement, refraction=False, earth_radius=None)
            corrections.refine(photo.observations, inputs.cameras, wanted)
    except InputError as error:
        faults += error.faults
    except GeometryError as error:
        faults.append(fault_at(project.tree, ("cameras",), str(error), error.code))
    return notes


def _neighbours(project: Project) -> Iterator[Fault]:
    """Refuse neighbouring photos with too few common points to be oriented, and three without one that carries scale.

    Points in common are counted from each photo on: with the next, and with the next two.
    """
    from photostrip.strip.relative_orientation import MINIMUM_POINTS

    seen = project.inputs.observations
    for i, strip in enumerate(project.inputs.strips):
        photos, place, width = strip.photos, strip.positions(seen), len(strip.photos) + 2
        key = np.unique((seen.point * width + place)[place >= 0])  # on the next photo it is larger by one
        on_next = np.diff(key, append=-1) == 1
        of_two, of_three = (
            np.bincount(key[rows] % width, minlength=width)
            for rows in (on_next, on_next & np.append(on_next[1:], False))
        )
        for j in np.flatnonzero(of_two[: len(photos) - 1] < MINIMUM_POINTS).tolist():
            message = f"photos {photos[j]} and {photos[j + 1]} have {counted(int(of_two[j]), 'point')} in common"
            fix, expected = "measure more, or correct the order of the photos", f"at least {MINIMUM_POINTS}, better 12"
            path = ("strips", i, "photos", j + 1)
            yield fault_at(project.tree, path, message, "too-few-common-points", expected=expected, fix=fix)
        for j in np.flatnonzero(of_three[: max(len(photos) - 2, 0)] == 0).tolist():
            names = photos[j : j + 3]
            message = f"no point is common to photos {', '.join(names[:2])} and {names[2]}: nothing carries the scale"
            fix = "measure at least one pass point on all three"
            yield fault_at(project.tree, ("strips", i, "photos", j + 1), message, "broken-joint", fix=fix)


def _alone(project: Project) -> Iterator[Fault]:
    """Refuse photos in no order that nothing orients: no orientation, too few points of control or other photos."""
    inputs, seen = project.inputs, project.inputs.observations
    given = () if inputs.orientations is None else inputs.orientations.photos
    times = np.bincount(seen.point, minlength=len(seen.point_ids))
    times[np.flatnonzero(locate(seen.point_ids, inputs.control.ids) >= 0)] += 1
    shared = np.bincount(seen.photo[times[seen.point] > 1], minlength=len(seen.photo_ids))
    counts = dict(zip(seen.photo_ids, shared.tolist(), strict=True))
    for strip in inputs.strips:
        if strip.listed or strip.id in given or counts[strip.id] >= LEAST_SHARED:
            continue
        number = counted(counts[strip.id], "point")
        message = f"photo {strip.id} has {number} of the control or of other photos"
        fix = "measure more, or give its orientation roughly (orientations, role: approximate)"
        expected = f"at least {LEAST_SHARED}, better 12"
        yield fault_at(project.tree, ("photos",), message, "photo-not-tied", expected=expected, fix=fix)


def _control_of_strips(project: Project, used: Numbers) -> Iterator[Fault]:
    """Refuse strips with too little measured control for seven parameters."""
    inputs = project.inputs
    given = locate(inputs.control.ids, inputs.observations.point_ids)
    for i, strip in enumerate(inputs.flights):
        points = inputs.observations.point[used == i] if inputs.models is None else points_of_strip(inputs.models, i)
        rows = np.isin(given, points) & ~inputs.control.check
        plan, height = (int(inputs.control.use[rows, axis].sum()) for axis in (0, 2))
        if plan >= LEAST_PLAN and height >= LEAST_HEIGHT:
            continue
        known = f"{counted(plan, 'control point')} in plan and {height} in height"
        message = f"strip {strip.id} has {known} on neighbouring photos"
        expected = f"at least {LEAST_PLAN} in plan and {LEAST_HEIGHT} in height, not on one line"
        path = ("strips", i, "id")
        fix = "measure more of the control on its photos"
        yield fault_at(project.tree, path, message, "too-little-control", expected=expected, fix=fix)


def _counts(project: Project) -> Document:
    inputs, measured = project.inputs, project.inputs.observations.point_ids
    given, shown = inputs.control, locate(inputs.control.ids, measured) >= 0
    return {
        "files": len(project.files),
        "strips": len(inputs.lines),
        "in_no_order": sum(not strip.listed for strip in inputs.strips),
        "photos": sum(len(strip.photos) for strip in inputs.flights),
        **({} if inputs.models is None else counts_of_models(inputs.models)),
        "image_points": len(inputs.observations),
        "points": len(measured),
        "new": len(measured) - int(shown.sum()),
        "control_plan": int((given.use[:, 0] & ~given.check & shown).sum()),
        "control_height": int((given.use[:, 2] & ~given.check & shown).sum()),
        "check_plan": int((given.use[:, 0] & given.check & shown).sum()),
        "check_height": int((given.use[:, 2] & given.check & shown).sum()),
    }


def _frames(project: Project, tables: Tables, faults: list[Fault]) -> list[Document]:
    """Decode the frame of each control list at its first point, there and back."""
    inputs = project.inputs
    with project.places():
        frames, output = tie_frames(inputs.frames, inputs.output, directory=project.directory)
    faults += _refused(project, partial(require_whole, inputs, frames))
    found = []
    for number, frame in enumerate(frames):
        read = tables.control[number]
        rows = np.flatnonzero((inputs.control.frame == number) & inputs.control.use[:, :2].all(axis=1))
        block: Document = {
            "file": "" if read is None else read.table.file,
            "frame": frame.describe(),
            "kind": frame.kind,
            "axes": list(frame.axes),
            "is_output": frame is output,
            "datum_accuracy": frame.datum_accuracy,
        }
        try:
            block |= _decoded(project, frame, rows)
        except (InputError, GeometryError) as error:
            path = ("control", number, "crs")
            texts = [fault.message for fault in error.faults] if isinstance(error, InputError) else [str(error)]
            fix = "are the axes in the order of the columns, is the crs the right one?"
            faults += [fault_at(project.tree, path, text, "ground-domain", fix=fix) for text in texts]
        found.append(block)
    if all(frame is not output for frame in frames):
        found.append({"file": "", "frame": output.describe(), "kind": output.kind, "is_output": True})
    return found


def _cameras(project: Project) -> Iterator[Document]:
    """Say of given positions of cameras in which frame they are, how precise, and where they lie beside the control."""
    inputs = project.inputs
    for at in over_control(inputs, inputs.observations, project.directory) if inputs.models is None else ():
        step = None if at.plan is None or not len(at.control) else at.plan.step
        yield {
            "key": at.given.key,
            "photos": len(at.given.photos),
            "frame": at.given.frame.name,
            "smallest_sigma_m": np.nanmin(at.given.sigma, axis=0).tolist(),
            "largest_sigma_m": np.nanmax(at.given.sigma, axis=0).tolist(),
            "above_control_m": None if step is None else float(step[2]),
            "beside_control_m": None if step is None else float(np.linalg.norm(step[:2])),
        }


def _decoded(project: Project, frame: GroundFrame, rows: Numbers) -> Document:
    """One point to longitude, latitude, height and back; the size of the convergence over all points."""
    control = project.inputs.control
    if not len(rows):
        return {}
    enu = control.enu[rows].copy()
    heights = enu[:, 2][~np.isnan(enu[:, 2])]
    enu[np.isnan(enu[:, 2]), 2] = heights.mean() if len(heights) else 0.0
    ids = [control.ids[row] for row in rows]
    cartesian = frame.cartesian_from_ground(enu, ids=ids)
    back = frame.ground_from_cartesian(cartesian[:1], ids=ids[:1])
    centre = cartesian.mean(axis=0)
    found: Document = {
        "point": ids[0],
        "given": frame.user_from_internal(control.enu[rows[0]]).tolist(),
        "cartesian": cartesian[0].tolist(),
        "back_mm": float(np.abs(frame.difference(back, enu[:1])).max() * MILLIMETRES),
        "span_m": float(2.0 * np.linalg.norm(cartesian - centre, axis=1).max()),
    }
    if frame.kind != "local":
        longitude, latitude, height = frame.geodetic(cartesian[:1])[0]
        found["geodetic"] = [float(np.degrees(longitude)), float(np.degrees(latitude)), float(height)]
    if frame.kind == "projected":
        angles = np.degrees(frame.convergence(cartesian))
        found["convergence_deg"] = [float(angles.min()), float(angles.max())]
    return found


def _control(project: Project, tables: Tables) -> Iterator[Document]:
    """Return the standard deviation of every control coordinate, in the user's order, and where it comes from."""
    if project.inputs.models is not None:
        photos = {name: len(each) for name, each in photos_of_points(project.inputs.models).items()}
    else:
        measured = project.inputs.observations
        count, total = len(measured.photo_ids), len(measured.point_ids)
        times = np.bincount(np.unique(measured.point * count + measured.photo) // count, minlength=total)
        photos = dict(zip(measured.point_ids, times.tolist(), strict=True))
    for number, read in enumerate(tables.control):
        if read is not None:
            yield from _of_list(project, number, read, photos)


def _of_list(project: Project, number: int, read: ControlTable, photos: dict[str, int]) -> Iterator[Document]:
    frame = project.inputs.frames[number]
    given = project.tree.find("control", number, "sigma")
    default: list[float | None] = (
        [None] * 3 if given is None else [float(each.text) for each in given.elements] or [None] * 3
    )
    source = source_of(project, ("control", number, "sigma"))
    columns = (read.check, read.table.lines, read.use, read.sigma, ~np.isnan(read.sigma))
    for name, check, line, use, sigma, stated in zip(read.ids, *(each.tolist() for each in columns), strict=True):
        here = {"source": "row", "file": read.table.file, "line": line, "key": ""}
        of_axes = list(zip(sigma, stated, default, use, strict=True))
        yield {
            "id": name,
            "role": "check" if check else "control",
            "file": read.table.file,
            "line": line,
            "axes": list(frame.axes),
            "counts": use,
            "sigma": [(own if its else usual) if counts else None for own, its, usual, counts in of_axes],
            "sigma_from": [(here if its else source) if counts else None for _, its, _, counts in of_axes],
            "photos": photos.get(name, 0),
        }


def links_of_models(project: Project, models: MeasuredModels) -> Iterator[Fault]:
    """Refuse neighbouring models that cannot be linked, and models of the other hand."""
    from photostrip.pipeline.formed_models import form_models

    for number, strip in enumerate(models.strips):
        try:
            form_models(strip, models.points, project.settings)
        except GeometryError as error:
            yield fault_at(project.tree, ("strips", number, "id"), str(error), error.code)
        except np.linalg.LinAlgError as error:
            message = (
                f"neighbouring models of strip {strip.id} cannot be linked: their coordinates contradict each other"
            )
            yield fault_at(project.tree, ("strips", number, "id"), f"{message} ({error})", "singular")
        except InputError as error:
            for fault in error.faults:
                words = {"expected": fault.expected, "fix": fault.fix}
                yield fault_at(project.tree, ("models", "file"), fault.message, fault.code, **words)


def source_of(project: Project, path: tuple[str | int, ...]) -> Document | None:
    """Say where a value of the project stands: in which file, line and key; None when it is not given."""
    if not project.tree.has(*path):
        return None
    place = project.tree.place_of(path)
    return {"source": "default", "file": place.file, "line": place.line, "key": key_path(path)}


def counts_of_models(models: MeasuredModels) -> Document:
    """Count models, their points and their perspective centres."""
    points = models.points.node < len(models.points.point_ids)
    return {
        "models": sum(len(strip.models) for strip in models.strips),
        "model_points": int(points.sum()),
        "model_centers": int((~points).sum()),
    }


def sigma_of(
    project: Project, section: str, tables: Iterable[Measurements | ModelTable | None], sigma: Floats
) -> Document:
    """Say which standard deviations (mm) the measured coordinates get, and how many rows of the tables have some."""
    read = [each for each in tables if each is not None]
    rows = sum(len(each.table) for each in read)
    stated = sum(int((~np.isnan(each.sigma).any(axis=1)).sum()) for each in read)
    return {
        "rows_with_own": stated,
        "rows_with_default": rows - stated,
        "default_from": source_of(project, (section, "sigma")),
        "smallest_um": float((sigma * MICROMETRES).min()) if len(sigma) else None,
        "largest_um": float((sigma * MICROMETRES).max()) if len(sigma) else None,
    }


def points_of_strip(models: MeasuredModels, number: int) -> Numbers:
    """Points that the models of a strip hold, by number."""
    points = models.points
    known = set(models.strips[number].models)
    inside = np.array([name in known for name in points.model_ids], bool)[points.model]
    return np.unique(points.node[inside & (points.node < len(points.point_ids))])


def photos_of_points(models: MeasuredModels) -> dict[str, set[str]]:
    shown = {
        name: strip.photos[place : place + 2] for strip in models.strips for place, name in enumerate(strip.models)
    }
    points = models.points
    found = {name: set[str]() for name in points.point_ids}
    for model, node in zip(points.model.tolist(), points.node.tolist(), strict=True):
        if node < len(points.point_ids):
            found[points.point_ids[node]].update(shown[points.model_ids[model]])
    return found


def observations_used(inputs: Inputs) -> Numbers:
    """Return the strip in which each image point takes part, shape (n,); -1 where no neighbouring photo shows it."""
    observations = inputs.observations
    places = {photo: (i, j) for i, strip in enumerate(inputs.strips) for j, photo in enumerate(strip.photos)}
    strip, place = np.array([places[name] for name in observations.photo_ids], np.intp).reshape(-1, 2).T
    strip, place = strip[observations.photo], place[observations.photo]
    # a photo's number in one long row of all strips, with a gap between strips: neighbours differ by one
    starts = np.cumsum([0, *(len(each.photos) + 1 for each in inputs.strips)])
    position = starts[strip] + place
    key = observations.point * (int(starts[-1]) + 1) + position
    present = np.sort(key)

    def shown(wanted: Numbers) -> Flags:
        at = np.searchsorted(present, wanted)
        return np.asarray(present[np.minimum(at, len(present) - 1)] == wanted)

    if not len(key):
        return np.zeros(0, np.intp)
    return np.where(shown(key - 1) | shown(key + 1), strip, -1)


def gaps_of(inputs: Inputs, used: Numbers) -> list[str]:
    """Name the points measured on two photos or more, of which no two are neighbours in a strip.

    used: what ``observations_used`` returns.
    """
    observations = inputs.observations
    paired = np.zeros(len(observations.point_ids), bool)
    paired[observations.point[used >= 0]] = True
    free = tuple(strip.id for strip in inputs.strips if not strip.listed)
    paired[observations.point[observations.places(free) >= 0]] = True  # neighbours are yet to be found
    count = np.bincount(observations.point, minlength=len(observations.point_ids))
    return [observations.point_ids[code] for code in np.flatnonzero(~paired & (count > 1))]


def table_rows(project: Project, tables: Tables, gaps: Sequence[str]) -> list[Document]:
    """Count the rows of each file, and those that are used; why others are not, notes say.

    gaps: points that no two neighbouring photos of a strip show, which are of use to a bundle alone.
    """
    inputs, bundle = project.inputs, project.settings.together
    # which rows are used, and of how many rows of its file each is made
    parts: list[tuple[Table, Flags, Numbers | None]] = []
    if tables.models is not None and inputs.models is not None:
        shown, known = set(inputs.models.points.point_ids), set(inputs.models.points.model_ids)
        measured = (each for each in (tables.models.points, tables.models.centers) if each is not None)
        parts += [(each.table, _among(each.model_ids, known)[each.models], None) for each in measured]
    else:
        photos = set(inputs.cameras)
        whole = {name for name, use in zip(inputs.control.ids, inputs.control.use, strict=True) if bundle and use.all()}
        count = {} if tables.observations is None else rays(tables.observations, photos)
        apart = set() if bundle else set(gaps)
        joining = {name for name, number in count.items() if number > 1 and name not in apart}
        shown = set(count) if bundle else joining
        if (read := tables.observations) is not None:
            kept = _among(read.photo_ids, photos)[read.photo] & _among(read.target_ids, joining | whole)[read.target]
            parts.append((read.table, kept, read.times))
        if (marks := tables.fiducials) is not None:
            parts.append((marks.table, _among(marks.photo_ids, photos)[marks.photo], marks.times))
        if (positions := tables.positions) is not None:
            parts.append((positions.table, _among(positions.ids, photos) & positions.used & bundle, None))
        if (orientations := tables.orientations) is not None:
            parts.append((orientations.table, _among(orientations.ids, photos) & bundle, None))
    control = (each for each in tables.control if each is not None)
    parts += [(each.table, each.used & _among(each.ids, shown), None) for each in control]
    return [
        {"file": file, "rows": int(number[inside].sum()), "used": int(number[inside & kept].sum())}
        for table, kept, times in parts
        for number in [np.ones(len(table), np.intp) if times is None else times]
        for file, inside in table.files
    ]


def _among(ids: Sequence[str], known: Container[str]) -> Flags:
    return np.array([name in known for name in ids], bool)
