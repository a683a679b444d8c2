"""The tables that a project names: reading all of them, and what must fit between them and the project file."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.formats.faults import Findings, NotANumber, meant, suggestion
from photostrip.formats.faults import number as read_number
from photostrip.formats.measured import (
    ROTATIONS,
    ControlTable,
    Manner,
    Measurements,
    OrientationTable,
    PositionTable,
    read_control,
    read_measurements,
    read_orientations,
    read_positions,
    refuse_repeated,
)
from photostrip.formats.models import ModelTable, correlations, read_models
from photostrip.geometry.rotation import SYSTEMS
from photostrip.notes import Note, counted, listed
from photostrip.pipeline.inputs import MeasuredModels, ModelStrip
from photostrip.points import ModelPoints, locate
from photostrip.project.conversion import ground_columns
from photostrip.project.keys import Control, Models, Strip
from photostrip.project.reading import Node, Reading, fault_at, form_of
from photostrip.project.references import ListedPhoto, listed_photos, marks_of

MILLIMETRES = {"mm": 1.0, "um": 1e-3, "m": 1e3}  # in a unit


@dataclass(frozen=True, eq=False)
class ModelTables:
    """What the tables of model coordinates hold."""

    # points; rows whose id is that of a photo are perspective centres, when there is no table of those
    points: ModelTable
    centers: ModelTable | None

    def center_rows(self, photos: Sequence[str]) -> Numbers:
        """Rows of the points' table that are perspective centres: none when these have a table of their own."""
        if self.centers is not None:
            return np.zeros(0, np.intp)
        known = set(photos)
        flags = np.array([name in known for name in self.points.target_ids], bool)
        return np.flatnonzero(flags[self.points.targets])

    def centers_of(self, photos: Sequence[str]) -> dict[str, dict[str, int]]:
        """Return the photos whose centres each model holds, and a row of theirs in the table they stand in."""
        read = self.points if self.centers is None else self.centers
        rows = self.center_rows(photos) if self.centers is None else np.arange(len(read.table))
        found: dict[str, dict[str, int]] = {name: {} for name in read.model_ids}
        for row in rows.tolist():
            found[read.model_ids[read.models[row]]][read.target_ids[read.targets[row]]] = row
        return found


def check_models(root: Node, tables: ModelTables, findings: Findings) -> dict[int, tuple[str, ...]]:
    """Return the models of every strip without faults, by its number, in flight order; refuse what does not fit."""
    photos = [photo.id for photo in listed_photos(root)]
    centers = tables.centers_of(photos)
    _refuse_centers(tables, photos, centers, findings)
    found: dict[int, tuple[str, ...]] = {}
    owner: dict[str, int] = {}
    for number, strip in enumerate(root.list_at("strips")):
        flight, models = [each.text for each in strip.list_at("photos")], strip.find("models")
        if models is None:
            names, faults = _by_centers(root, number, flight, centers)
        else:
            names = [each.text for each in models.elements]
            faults = list(_as_listed(root, number, flight, names, tables, centers))
        for place, name in enumerate(names):
            if owner.setdefault(name, number) != number or names.index(name) != place:
                message = f"model {name} appears twice in the strips"
                path = ("strips", number, "photos" if models is None else "models")
                faults.append(fault_at(root, path, message, "model-twice", fix="list every model once"))
        findings.add(*faults)
        if not faults:
            found[number] = tuple(names)
    return found


def _refuse_centers(
    tables: ModelTables, photos: Sequence[str], centers: dict[str, dict[str, int]], findings: Findings
) -> None:
    """Refuse models with more than two perspective centres, and centres of models that hold nothing else."""
    read = tables.points if tables.centers is None else tables.centers
    measured = set(tables.points.model_ids)
    for name, shown in centers.items():
        rows = list(shown.values())
        if len(rows) > 2:
            message = f"model {name} has {len(rows)} perspective centres: {listed(list(shown))}"
            fix = "a model has those of its two photos; is one id used twice?"
            findings.add(read.table.fault(rows[2], read.target, message, "too-many-centers", fix=fix))
        if rows and name not in measured:
            message = f"model {name} has perspective centres and no point"
            fix = suggestion(name, tables.points.model_ids)
            findings.add(read.table.fault(rows[0], "model", message, "unknown-model", fix=fix))
    if tables.centers is None:
        return
    known = set(photos)
    for name, shown in centers.items():
        for photo, row in shown.items():
            if photo not in known:
                message = f"photo {photo} of model {name} belongs to no strip"
                findings.add(read.table.fault(row, "photo", message, "unknown-photo", fix=suggestion(photo, photos)))


def _by_centers(
    root: Node, number: int, flight: Sequence[str], centers: dict[str, dict[str, int]]
) -> tuple[list[str], list[Fault]]:
    """Find the model of each pair of neighbouring photos by its two perspective centres."""
    found, faults = [], []
    for place, pair in enumerate(pairwise(flight)):
        names = [name for name, shown in centers.items() if set(pair) <= set(shown)]
        path = ("strips", number, "photos", place + 1)
        if len(names) > 1:
            message = f"models {listed(names)} have the perspective centres of photos {pair[0]} and {pair[1]}"
            faults.append(fault_at(root, path, message, "model-twice", fix="list the models that count in `models`"))
        elif not names:
            message = f"no model has the perspective centres of photos {pair[0]} and {pair[1]}"
            fix = "list the models of the strip in flight order in `models`, or measure both centres"
            faults.append(fault_at(root, path, message, "no-model", fix=fix))
        found += names[:1]
    return found, faults


def _as_listed(
    root: Node,
    number: int,
    flight: Sequence[str],
    named: Sequence[str],
    tables: ModelTables,
    centers: dict[str, dict[str, int]],
) -> Iterator[Fault]:
    """Check the models that a strip lists: they exist, are one fewer than photos, and show the right photos."""
    path = ("strips", number, "models")
    if len(named) != len(flight) - 1:
        message = f"{counted(len(named), 'model')} listed for {counted(len(flight), 'photo')}"
        yield fault_at(root, path, message, "length", expected="one model for every two neighbouring photos")
    measured = list(tables.points.model_ids)
    for place, name in enumerate(named):
        if name not in measured:
            fix = suggestion(name, measured) or f"the models of {tables.points.table.file} are {listed(measured, 4)}"
            yield fault_at(root, (*path, place), f"model {name} is not measured", "unknown-model", fix=fix)
            continue
        pair = flight[place : place + 2]
        strange = [photo for photo in centers.get(name, {}) if photo not in pair]
        if strange and len(pair) > 1:
            message = (
                f"model {name} is listed between photos {pair[0]} and {pair[1]}, and has the perspective centre of "
                f"{strange[0]}"
            )
            fix = "put the models in flight order, or correct the id of the centre"
            yield fault_at(root, (*path, place), message, "wrong-center", fix=fix)


def measured_models(
    tables: ModelTables | None, given: Models | None, flights: Sequence[Strip], placed: Mapping[int, Sequence[str]]
) -> MeasuredModels | None:
    """Bring the model coordinates of the strips into millimetres and right-handed axes; `placed`: models of each."""
    if tables is None or given is None:
        return None
    strips = [
        ModelStrip(str(each.id), tuple(map(str, each.photos)), tuple(placed[n])) for n, each in enumerate(flights)
    ]
    photos = [photo for strip in strips for photo in strip.photos]
    wanted = [model for strip in strips for model in strip.models]
    factor = MILLIMETRES[given.unit]
    hand = np.array([1.0, -1.0 if given.axes == "left-handed" else 1.0, 1.0])
    points, centers = tables.points, tables.centers
    is_center = np.zeros(len(points.table), bool)
    is_center[tables.center_rows(photos)] = True
    measured = _rows(points, np.flatnonzero(~is_center), wanted, given.sigma)
    parts = [measured, _rows(points, np.flatnonzero(is_center), wanted, given.center_sigma or given.sigma)]
    if centers is not None:
        parts.append(_rows(centers, np.arange(len(centers.table)), wanted, given.center_sigma or given.sigma))
    point_ids = tuple(dict.fromkeys(measured.targets))
    centers_of = [name for part in parts[1:] for name in part.targets]
    node = np.concatenate([locate(measured.targets, point_ids), locate(centers_of, photos) + len(point_ids)])
    covariance = np.concatenate([part.covariance for part in parts])
    correlation = correlations(np.concatenate([part.sigma for part in parts]), covariance)
    model_points = ModelPoints(
        model_ids=tuple(wanted),
        point_ids=point_ids,
        photo_ids=tuple(photos),
        model=locate([name for part in parts for name in part.models], wanted),
        node=node,
        xyz=np.concatenate([part.xyz for part in parts]) * factor * hand,
        sigma=np.concatenate([part.sigma for part in parts]) * factor,
        correlation=None if np.isnan(covariance).all() else correlation * hand[:, None] * hand,
    )
    return MeasuredModels(tuple(strips), model_points)


class _Rows(NamedTuple):
    """Rows of a table of model coordinates whose model is in a strip."""

    models: list[str]
    targets: list[str]
    xyz: Floats
    sigma: Floats
    covariance: Floats


def _rows(read: ModelTable, rows: Numbers, wanted: Sequence[str], default: Sequence[float] | None) -> _Rows:
    known = set(wanted)
    inside = np.array([name in known for name in read.model_ids], bool)
    rows = rows[inside[read.models[rows]]]
    sigma = read.sigma[rows]
    if default is not None:
        sigma = np.where(np.isnan(sigma), default, sigma)
    models = [read.model_ids[code] for code in read.models[rows]]
    return _Rows(
        models=models,
        targets=[read.target_ids[code] for code in read.targets[rows]],
        xyz=read.xyz[rows],
        sigma=sigma,
        covariance=read.covariance[rows],
    )


T = TypeVar("T")
LOOK_ALIKES = str.maketrans("авеѕіјкмнорстухoil", "abes1jkmh0pctyx011")  # after folding the case
_ENDINGS = re.compile(r"(?im)\.(?:tiff?|jpe?g|png|jp2|img)$")
_SIGNS = re.compile(r"[^\w\n]|_")
_ZEROS = re.compile(r"(?m)^([a-z]*)0+")


@dataclass(frozen=True, eq=False)
class Tables:
    """What the tables of a project hold; None where one cannot be read."""

    observations: Measurements | None
    fiducials: Measurements | None
    control: list[ControlTable | None]
    positions: PositionTable | None = None
    orientations: OrientationTable | None = None
    models: ModelTables | None = None


def read_tables(reading: Reading) -> Tables:
    """Read every table that the project names, whether or not the rest of the project is right."""
    root, photos = reading.root, frozenset(photo.id for photo in listed_photos(reading.root))

    def measured(section: str) -> Measurements | None:
        return reading.tables(
            (section, "file"), lambda paths, inner: read_measurements(paths, inner, _manner(root, section, photos))
        )

    observations, fiducials = measured("observations"), measured("fiducial_measurements")
    # an id is one text, in whichever tables it stands: those of check points take 60 bytes each
    known = {} if observations is None else dict(zip(observations.target_ids, observations.target_ids, strict=True))
    control: list[ControlTable | None] = []
    for number in range(len(root.list_at("control"))):
        read = _given_list(reading, read_control, "control", number)
        control.append(None if read is None else replace(read, ids=[known.get(name, name) for name in read.ids]))
    refuse_repeated(control, reading.findings)
    return Tables(
        observations=observations,
        fiducials=fiducials,
        control=control,
        positions=_given_list(reading, read_positions, "camera_positions"),
        orientations=reading.table(("orientations", "file"), partial(_orientations, root)),
        models=_model_tables(reading),
    )


def _given_list(reading: Reading, read: Callable[..., T | None], *where: str | int) -> T | None:
    """Read a list of given coordinates as far as its block says how."""
    node = reading.root.find(*where)
    if node is None:
        return None
    axes = [each.text for each in node.list_at("axes")]
    up = next((number for number, name in enumerate(axes[:3]) if name in {"up", "z"}), 2)  # column of the height
    sigma, form = node.has("sigma"), form_of(node)
    return reading.table((*where, "file"), lambda path, inner: read(path, up, inner, default_sigma=sigma, form=form))


def _model_tables(reading: Reading) -> ModelTables | None:
    """Read the tables of model coordinates; None when one that the project names could not be read."""
    root = reading.root

    def read(*where: str, has_sigma: bool) -> ModelTable | None:
        form, centers = form_of(root.find(*where)), len(where) > 1
        return reading.table(
            (*where, "file"),
            lambda path, inner: read_models(path, inner, centers=centers, has_sigma=has_sigma, form=form),
        )

    sigma = root.has("models", "sigma")
    points = read("models", has_sigma=sigma)
    centers = read("models", "centers", has_sigma=sigma or root.has("models", "center_sigma"))
    named = root.has("models", "centers")
    return None if points is None or (named and centers is None) else ModelTables(points, centers)


def _manner(root: Node, section: str, photos: frozenset[str]) -> Manner:
    """How a table of image coordinates is to be read, as far as the project says it."""
    marks, node = section == "fiducial_measurements", root.entries[section]
    source = node.find("sigma")
    if source is None and marks and node.word("unit") in {"", root.word("observations", "unit")}:
        source = root.find("observations", "sigma")
    try:
        sigma = None if source is None else read_number(source.text)
    except NotANumber:  # which the schema refuses
        sigma = None
    return Manner(
        marks=marks,
        has_sigma=source is not None,
        sigma=sigma,
        repeated=node.word("repeated"),
        form=form_of(node),
        photos=photos,
    )


def _orientations(root: Node, path: str, findings: Findings) -> OrientationTable | None:
    """Read given orientations by the names of their angles; nothing when the system is not known, which is reported."""
    node = root.entries["orientations"]
    system = node.word("angles", "system") or SYSTEMS[0]
    if system not in (*SYSTEMS, *ROTATIONS):
        return None
    observed = node.word("role") in {"", "observed"}
    needs = observed and not node.has("sigma"), observed and not node.has("sigma_angles")
    unit, form = node.word("angles", "unit") or "deg", form_of(node)
    return read_orientations(path, system, unit, findings, needs_sigma=needs, form=form)


def check_tables(root: Node, tables: Tables) -> Iterator[Fault]:
    """Return what does not fit between the tables and the project file."""
    photos = list(listed_photos(root, measured_photos(tables)))
    if tables.observations is not None:
        yield from _every_photo(root, photos, tables.observations, "no point")
    if tables.fiducials is not None:
        yield from _every_photo(root, photos, tables.fiducials, "no fiducial mark")
        yield from _known_marks(root, photos, tables.fiducials)
    for section, read in (("camera_positions", tables.positions), ("orientations", tables.orientations)):
        if read is not None:
            yield from _some_photo(root, photos, section, read)
    strips = {strip.word("id") for strip in root.list_at("strips")}
    for photo in photos:
        if photo.path[0] == "photos" and photo.id in strips:  # it may become a strip of its own
            message, fix = f"photo {photo.id} has the id of a strip", "give the strip another id"
            yield fault_at(root, photo.path, message, "duplicate-strip", fix=fix)
    if tables.positions is not None and root.word("camera_positions", "correction") == "drift":
        yield from _times(root, photos, tables.positions)


def measured_photos(tables: Tables) -> Sequence[str]:
    """Photos on which points are measured."""
    return () if tables.observations is None else tables.observations.photo_ids


def _times(root: Node, photos: list[ListedPhoto], read: PositionTable) -> Iterator[Fault]:
    """Refuse a drift of photos in no given order without times: their numbers stand for none."""
    free = {photo.id for photo in photos if photo.path[0] == "photos"}
    if any(name in free for name in read.ids) and not np.isfinite(read.time).all():
        message = f"a drift of photos in no given order needs times, and {read.table.file} lacks some"
        fix = "fill its column time, or write `correction: offset`"
        yield fault_at(root, ("camera_positions", "correction"), message, "no-time", fix=fix)


def _some_photo(
    root: Node, photos: list[ListedPhoto], section: str, read: PositionTable | OrientationTable
) -> Iterator[Fault]:
    """Refuse a table of cameras that has none of the strips' photos."""
    known = {photo.id for photo in photos}
    if not known or known & set(read.ids) or not len(read.table):
        return
    near = alike([photo.id for photo in photos], read.ids)
    named = f"; {meant(*next(iter(near.items())))}" if near else ""
    message = f"{read.table.file} has none of the photos of the strips; its photos are {listed(read.ids, 4)}{named}"
    fix = "write the ids of the photos the same way in both files"
    yield fault_at(root, (section, "file"), message, "not-measured", fix=fix)


def _every_photo(root: Node, photos: list[ListedPhoto], read: Measurements, nothing: str) -> Iterator[Fault]:
    """Refuse photos of strips on which nothing is measured."""
    file = read.table.file
    known, measured = {photo.id for photo in photos}, set(read.photo_ids)
    missing = [photo for photo in photos if photo.id not in measured]
    if not missing or not len(read.table):
        return
    strangers = [name for name in read.photo_ids if name not in known]
    if len(missing) == len(known) > 1:
        message = f"{file} has {nothing} on any photo of the strips; its photos are {listed(strangers, 4)}"
        fix = "write the ids of the photos the same way in both files"
        yield fault_at(root, missing[0].path[:1], message, "not-measured", fix=fix)
        return
    near = alike([photo.id for photo in missing], strangers)
    for photo in missing:
        twin = near.get(photo.id)
        of_strip = photo.path[0] == "strips"
        fix = meant(photo.id, twin) if twin else f"measure it, or remove it{' from the strip' if of_strip else ''}"
        message = f"{file} has {nothing} on photo {photo.id}"
        yield fault_at(root, photo.path, message, "not-measured", fix=fix)


def _known_marks(root: Node, photos: list[ListedPhoto], read: Measurements) -> Iterator[Fault]:
    """Refuse measured marks that the camera of the photo does not have."""
    cameras = list(dict.fromkeys(photo.camera for photo in photos))
    number = {photo.id: cameras.index(photo.camera) for photo in photos}
    owner = np.array([number.get(name, -1) for name in read.photo_ids], np.intp)[read.photo]
    _, rows = np.unique(owner * len(read.target_ids) + read.target, return_index=True)  # each mark of a camera once
    for row in sorted(rows[owner[rows] >= 0].tolist()):
        camera, mark = cameras[owner[row]], read.target_ids[read.target[row]]
        owner_node = root.find("cameras", camera)
        marks = None if owner_node is None else marks_of(owner_node)
        if marks is None or not marks.entries or mark in marks.entries:
            continue
        fix = suggestion(mark, marks.entries)
        expected = f"one of {', '.join(marks.entries)}"
        message = f"camera {camera} has no mark {mark}"
        yield read.table.fault(row, "mark", message, "unknown-mark", expected=expected, fix=fix)


def loose(names: Sequence[str]) -> list[str]:
    """Reduce ids to what survives slips of the pen: no signs, no case, no leading zeros, one alphabet.

    ``GCP-7``, ``gcp 07`` and ``GCP7`` become the same text, and so do ``1001`` and ``1001.tif``.
    """
    if not names:
        return []
    # all at once: thirty thousand points take 20 ms, one by one 200 ms
    lines = "\n".join(name.replace("\n", " ") for name in names)
    lines = _ENDINGS.sub("", unicodedata.normalize("NFKC", lines)).casefold().translate(LOOK_ALIKES)
    return _ZEROS.sub(r"\1", _SIGNS.sub("", lines)).split("\n")


def alike(names: Sequence[str], candidates: Iterable[str]) -> dict[str, str]:
    """Find the candidate for each name that has exactly one which differs only by slips of the pen."""
    others = list(candidates)
    forms = loose(others)
    times = Counter(forms)
    by_form = {form: each for form, each in zip(forms, others, strict=True) if form and times[form] == 1}
    found = {name: by_form.get(form, "") for name, form in zip(names, loose(names), strict=True)}
    return {name: twin for name, twin in found.items() if twin and twin != name}


def rays(read: Measurements, photos: set[str]) -> dict[str, int]:
    """Count the photos of strips on which each point is measured; points on none are left out."""
    kept = np.array([name in photos for name in read.photo_ids], bool)[read.photo]
    count = np.bincount(read.target[kept], minlength=len(read.target_ids))
    return {name: number for name, number in zip(read.target_ids, count.tolist(), strict=True) if number}


def in_one_zone(
    tables: Sequence[ControlTable], lists: Sequence[Control], root: Node
) -> tuple[list[ControlTable], list[Note]]:
    """Bring lists with `other_zone` into the zone of the first list, through the points that stand in both.

    These may have ``use: off`` in either; check points join nothing. Heights stay as they are.
    Raises InputError where a list has fewer than two such points.
    """
    found, notes, faults = list(tables), [], []
    for number, (read, given) in enumerate(zip(tables, lists, strict=True)):
        if not given.other_zone:
            continue
        from photostrip.geodesy.crs import FEWEST_COMMON, join_zones

        place = ("control", number, "other_zone")
        if number == 0:
            message = "the other lists are brought into the zone of the first one"
            faults.append(fault_at(root, place, message, "zone-joint", fix="put another list first"))
            continue
        first, columns, first_columns = tables[0], ground_columns(given)[:2], ground_columns(lists[0])[:2]
        rows = {name: row for row, name in enumerate(first.ids) if not first.check[row]}
        pairs = [(row, rows[name]) for row, name in enumerate(read.ids) if name in rows and not read.check[row]]
        here, there = np.array(pairs, np.intp).reshape(-1, 2).T
        both = read.xyz[here][:, columns], first.xyz[there][:, first_columns]
        known = np.isfinite(both[0]).all(axis=1) & np.isfinite(both[1]).all(axis=1)
        if len(np.unique(both[0][known], axis=0)) < FEWEST_COMMON:
            message = f"{counted(int(known.sum()), 'point')} of this list in the first one, too, to join the two zones"
            expected = f"{FEWEST_COMMON} or more, with `use: off` in one of the lists; 4 for the third power"
            faults.append(fault_at(root, place, message, "zone-joint", expected=expected))
            continue
        joint = join_zones(both[0][known], both[1][known])
        xyz = read.xyz.copy()
        xyz[:, columns] = joint(read.xyz[:, columns])
        found[number] = replace(read, xyz=xyz)
        names = [read.ids[row] for row in here[known].tolist()]
        off = np.linalg.norm(joint.residuals, axis=1)
        left = f"rms {np.sqrt((off**2).mean()):.3f} m, largest {off.max():.3f} m at {names[int(off.argmax())]}"
        checked = left if joint.redundancy else "nothing checks them"
        message = (
            f"list {number + 1} of the control is brought into the zone of the first by {len(names)} points of both,"
            f" {listed(names, 6)}, with powers up to {joint.degree}: {checked}"
        )
        notes.append(Note("zones-joined", message, severity="note"))
    if faults:
        raise InputError(faults)
    return found, notes
