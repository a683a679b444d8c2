"""What is in the files and not used, and why: said once, before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from photostrip.formats.faults import meant
from photostrip.formats.faults import number as read_number
from photostrip.formats.measured import ControlTable, GivenTable, Measurements, OrientationTable, PositionTable
from photostrip.formats.tables import Table
from photostrip.notes import Note, counted, listed
from photostrip.pipeline.inputs import AUTO, BUNDLE
from photostrip.points import locate
from photostrip.project.conversion import cameras, certificate_of
from photostrip.project.keys import Camera, Processing, ProjectFile
from photostrip.project.reading import NO_FILES, Node, key_path
from photostrip.project.resolved import OF_MODELS, OF_PHOTOS
from photostrip.project.sections import Section
from photostrip.project.tables import ModelTables, Tables, alike, rays
from photostrip.strip.fiducial_marks import POOR_FIT, Certificate

NEAR_NAMED = 3


class Condition(NamedTuple):
    """Keys of ``processing`` that do nothing unless other keys let them."""

    keys: tuple[str, ...]
    counts: Callable[[ProjectFile], bool]
    by: str  # what makes them count


def _adjusted(*methods: str) -> Callable[[ProjectFile], bool]:
    return lambda project: project.processing.adjustment in methods


def _curved(*ways: str) -> Callable[[ProjectFile], bool]:
    return lambda project: project.processing.earth_curvature in ways


CONDITIONS = (  # of several that a key has, the first that fails is told
    Condition(OF_PHOTOS, lambda project: project.models is None, "`observations` in place of `models`"),
    Condition(OF_MODELS, lambda project: project.models is not None, "`models` in place of `observations`"),
    Condition(
        ("relative.grubbs_alpha",),
        lambda project: project.processing.relative.screening in {"parallax+grubbs", "tau"},
        "`processing.relative.screening: parallax+grubbs` or `tau`",
    ),
    Condition(
        ("relative.parallax_limit",),
        lambda project: project.processing.relative.screening == "parallax+grubbs",
        "`processing.relative.screening: parallax+grubbs`",
    ),
    Condition(
        ("links.alpha",),
        lambda project: project.processing.links.screening == "auto",
        "`processing.links.screening: auto`",
    ),
    Condition(  # a bundle starts from it
        ("polynomial",), _adjusted("auto", "polynomial", "bundle"), "`processing.adjustment: polynomial` or `auto`"
    ),
    Condition(("bundle", "self_calibration"), _adjusted(AUTO, BUNDLE), "`processing.adjustment: bundle` or `auto`"),
    Condition(
        ("earth_radius", "earth_latitude", "earth_azimuth"),
        _curved("model", "image"),
        "`processing.earth_curvature: model` or `image`",
    ),
    Condition(
        ("earth_radius",),
        lambda project: project.processing.earth_latitude is None,
        "`processing.earth_curvature` without `earth_latitude`, whose radius takes its place",
    ),
    Condition(
        ("flying_height", "ground_height"),
        lambda project: project.processing.refraction or _curved("image")(project),
        "`processing.refraction: true` or `processing.earth_curvature: image`",
    ),
    Condition(("interior",), lambda project: project.fiducial_measurements is not None, "`fiducial_measurements`"),
)


def hints(project: ProjectFile, tables: Tables, root: Node) -> Iterator[Note]:
    """Explain every row and every definition that is not used: a note for each kind in each file."""
    photos = set(project.camera_of)
    yield from _unused_cameras(project, root)
    yield from _linear_distortion(project, root)
    yield from _without_effect(project, root)
    yield from _sigmas_of_rows(tables, root)
    for name, camera in project.cameras.items():
        if isinstance(camera, Camera) and (solved := certificate_of(camera)) is not None:
            yield _solved_marks(name, camera, solved, root)
    for measured in (tables.observations, tables.fiducials):
        if measured is not None and not photos.issuperset(measured.photo_ids):
            owners = np.array(measured.photo_ids, object)[measured.photo].tolist()
            yield from _in_no_strip(measured.table, owners, photos)
    if tables.models is not None:
        yield from _of_models(tables.models, tables.control, project)
        return
    observations, control = tables.observations, [read for read in tables.control if read is not None]
    if observations is None:
        return
    count = rays(observations, photos)
    given = {read.ids[row] for read in control for row in range(len(read.ids)) if read.used[row]}
    bundle = project.processing.adjustment in {AUTO, BUNDLE}
    yield from _measured_once(observations, count, given, together=bundle)
    for read in control:
        yield from _control_not_used(read, count, given)
    for name, given_cameras in (("camera_positions", tables.positions), ("orientations", tables.orientations)):
        if given_cameras is not None:
            yield from _cameras_not_used(project, name, given_cameras, photos)


def _of_models(models: ModelTables, control: Sequence[ControlTable | None], project: ProjectFile) -> Iterator[Note]:
    """Name models in no strip, and control that stands in none."""
    photos = [str(photo) for strip in project.strips for photo in strip.photos]
    used = _models_used(models, project, photos)
    read = models.points
    for each, what in ((read, "point"), (models.centers, "perspective centre")):
        strangers = [] if each is None else [name for name in each.model_ids if name not in used]
        if each is None or not strangers:
            continue
        rows = np.flatnonzero(np.isin(each.models, locate(strangers, each.model_ids)))
        number_of = counted(len(strangers), "model")
        verb = "is" if len(rows) == 1 else "are"
        message = f"{counted(len(rows), what)} of {number_of} in no strip {verb} not used: {listed(strangers)}"
        yield each.table.note(rows[0], "model-in-no-strip", message, key="model")
    centers = set(models.center_rows(photos).tolist())
    inside = np.array([name in used for name in read.model_ids], bool)[read.models]
    count: dict[str, int] = {}
    for row in np.flatnonzero(inside).tolist():
        if row not in centers:
            name = read.target_ids[read.targets[row]]
            count[name] = count.get(name, 0) + 1
    given = {table.ids[row] for table in control if table is not None for row in np.flatnonzero(table.used).tolist()}
    for table in control:
        if table is not None:
            yield from _control_not_used(table, count, given, "in any model")


def _models_used(models: ModelTables, project: ProjectFile, photos: Sequence[str]) -> set[str]:
    """Models that stand in strips: those that are listed, or have the centres of two neighbouring photos."""
    shown = models.centers_of(photos)
    used: set[str] = set()
    for strip in project.strips:
        if strip.models is not None:
            used |= set(map(str, strip.models))
            continue
        flight = [str(photo) for photo in strip.photos]
        pairs = [{*pair} for pair in pairwise(flight)]
        used |= {name for name, each in shown.items() if any(pair <= set(each) for pair in pairs)}
    return used


def _cameras_not_used(
    project: ProjectFile, name: str, read: PositionTable | OrientationTable, photos: set[str]
) -> Iterator[Note]:
    """Say which rows of a table of cameras are not used, and that the strip method uses none."""
    what = name.replace("_", " ")
    if project.processing.adjustment not in {AUTO, BUNDLE}:
        message = (
            f"the {what} are not used: the strip method has no place for them; `processing.adjustment: bundle` has"
        )
        yield Note("cameras-not-used", message, file=read.table.file, key=name)
    else:
        yield from (replace(note, severity="note") for note in _in_no_strip(read.table, read.ids, photos))


def _linear_distortion(project: ProjectFile, root: Node) -> Iterator[Note]:
    """Say which principal distance a camera has with its k0."""
    for name, given in project.cameras.items():
        if isinstance(given, Camera) and given.distortion is not None and given.distortion.k0:
            f = cameras(project)[name].principal_distance
            message = (
                f"k0 of camera {name} scales its image: the principal distance {given.principal_distance:g} mm becomes "
                f"{f:.6g} mm, and k, p are those beside it"
            )
            path = ("cameras", name, "distortion", "k0")
            yield root.place_of(path).note("linear-distortion", message, key=key_path(path))


def _unused_cameras(project: ProjectFile, root: Node) -> Iterator[Note]:
    used = {each.camera for each in project.groups}
    unused = [name for name in project.cameras if name not in used]
    if unused:
        verb = "belongs" if len(unused) == 1 else "belong"
        number = counted(len(unused), "camera")
        message = f"{number} {verb} to no strip: {listed(unused)}"
        key = key_path(("cameras", unused[0]))
        yield root.entries["cameras"].keys[unused[0]].note("unused-camera", message, key=key)


def _without_effect(project: ProjectFile, root: Node) -> Iterator[Note]:
    """Name the keys that the project itself sets, no preset, and that do nothing as the others stand.

    Defaults are not meant: a project with all of them filled in would say nothing else.
    """
    told = set[str]()
    for condition in CONDITIONS:
        for name in condition.keys if not condition.counts(project) else ():
            for path in _ends(root, ("processing", *name.split("."))):
                node, key = root.find(*path), key_path(path)
                own = node is not None and (node.place.file in NO_FILES or node.place.file == root.place.file)
                if own and key not in told and _value(project.processing, path) != _value(Processing(), path):
                    told.add(key)
                    message = f"`{key}` has no effect here: it counts with {condition.by}"
                    yield root.place_of(path).note("without-effect", message, key=key)


def _sigmas_of_rows(tables: Tables, root: Node) -> Iterator[Note]:
    """Name the `sigma` of a section, where every row of its table has another one of its own, which counts."""
    sections: list[tuple[tuple[str | int, ...], Measurements | GivenTable | None]] = [
        (("observations",), tables.observations if tables.fiducials is None else None),
        (("camera_positions",), tables.positions),
        *((("control", number), read) for number, read in enumerate(tables.control)),
    ]
    for path, read in sections:
        node = root.find(*path, "sigma")
        if read is None or node is None or node.place.file not in {root.place.file, *NO_FILES}:
            continue
        stated = np.array([read_number(each.text) for each in node.elements or [node]], float)
        use = read.use if isinstance(read, GivenTable) else np.ones(read.sigma.shape, bool)
        own = read.sigma[use]
        if len(own) and np.isfinite(own).all() and (own != np.broadcast_to(stated, use.shape)[use]).any():
            key, columns = key_path((*path, "sigma")), "sx, sy, sz" if use.shape[1] > len("xy") else "sx, sy"
            message = (
                f"`{key}` has no effect here: every row of {read.table.file} has its own ({columns}), which counts"
            )
            yield root.place_of((*path, "sigma")).note("without-effect", message, key=key)


def _ends(root: Node, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Give the paths of the keys of a section that stand in a file, or of the one key."""
    inner = root.mapping_at(*path) if isinstance(_value(Processing(), path), Section) else {}
    yield from ((*path, name) for name in inner) if inner else (path,)


def _value(section: object, path: tuple[str, ...]) -> object:
    for name in path[1:]:
        section = getattr(section, name)
    return section


def _solved_marks(name: str, camera: Camera, solved: Certificate, root: Node) -> Note:
    """Tell how well the distances between the fiducial marks of a camera fit each other."""
    path = ("cameras", name, "fiducial_distances")
    worst = int(np.argmax(np.abs(solved.residuals)))
    first, second, _ = camera.fiducial_distances[worst]
    largest = float(abs(solved.residuals[worst]))
    message = f"camera {name}: {len(solved.marks)} fiducial marks from {counted(len(solved.residuals), 'distance')}"
    if solved.redundancy:
        scatter, most = 1000 * solved.sigma0, 1000 * largest
        message += f", standard deviation of one {scatter:.0f} µm, largest residual {most:.0f} µm at {first}-{second}"
    else:
        message += ": none is left over to check them"
    severity = "note" if solved.redundancy and largest <= POOR_FIT else "warning"
    return root.place_of(path).note("certificate", message, severity, key=key_path(path))


def _in_no_strip(table: Table, owners: Sequence[str], photos: set[str]) -> Iterator[Note]:
    """Name the photos of rows that stand in no strip; `owners`: the photo of each row."""
    rows = [row for row, name in enumerate(owners) if name not in photos]
    if rows:
        others = tuple(dict.fromkeys(owners[row] for row in rows))
        verb = "is" if len(rows) == 1 else "are"
        message = f"{counted(len(rows), 'row')} of {counted(len(others), 'photo')} in no strip {verb} not used"
        message = f"{message}: {listed(others)}{_twins(alike(others, photos))}"
        yield replace(table.note(rows[0], "photo-in-no-strip", message, key="photo"), photos=others)


def _measured_once(
    read: Measurements, count: dict[str, int], given: set[str], *, together: bool = False
) -> Iterator[Note]:
    """Name points that one photo alone sees, control apart; in a bundle such control helps to orient the photo."""
    once = [name for name, number in count.items() if number == 1]
    control = [name for name in once if name in given]
    new = [name for name in once if name not in given]
    if control and not together:
        number = counted(len(control), "control or check point is", "control or check points are")
        message = f"{number} measured on one photo only and cannot be used: {', '.join(control)}"
        row = _first_row(read, control)
        yield read.table.note(row, "control-measured-once", message, key="point", points=control)
    if new:
        near = alike(new, given - set(once))
        what = f"{counted(len(new), 'point is', 'points are')} measured on one photo only and cannot be determined"
        message, row = f"{what}: {listed(new)}{_twins(near)}", _first_row(read, new)
        yield read.table.note(row, "measured-once", message, "note", key="point", points=new)


def _first_row(read: Measurements, points: Sequence[str]) -> int:
    """First row of any of some points."""
    return int(np.flatnonzero(np.isin(read.target, locate(points, read.target_ids)))[0])


def _control_not_used(
    read: ControlTable, count: dict[str, int], given: set[str], where: str = "on any photo"
) -> Iterator[Note]:
    """Name given points of which nothing counts, then those that nothing shows and measured points that may be them."""
    used = read.used.tolist()
    off = [name for name, use in zip(read.ids, used, strict=True) if not use]
    if off:
        message = f"{counted(len(off), 'point is', 'points are')} switched off (use: off): {listed(off)}"
        yield read.table.note(used.index(False), "control-off", message, "note", key="use", points=off)
    missing = [name for name, use in zip(read.ids, used, strict=True) if use and name not in count]
    if missing:
        near = alike(missing, [name for name in count if name not in given])
        number = counted(len(missing), "control or check point is", "control or check points are")
        message = f"{number} not measured {where}: {listed(missing)}{_twins(near)}"
        row, level = read.ids.index(missing[0]), "warning" if near else "note"
        yield read.table.note(row, "control-not-measured", message, level, key="point", points=missing)


def _twins(near: dict[str, str]) -> str:
    """Say which other names may be meant."""
    if not near:
        return ""
    pairs = [f"`{name}`, {meant(name, twin)}" for name, twin in list(near.items())[:NEAR_NAMED]]
    return "; " + " ".join(pairs)
