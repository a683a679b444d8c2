"""What the schema cannot see: values of the project file that must fit to each other.

All checks look at the tree, not at the validated project, so that they also run when something else is at fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from photostrip.errors import Fault
from photostrip.formats.faults import shown, suggestion
from photostrip.pipeline.inputs import AUTO, BUNDLE
from photostrip.project.keys import ProjectFile
from photostrip.project.reading import NO_FILES, KeyPath, Node, fault_at

LEAST_MARKS = 2


@dataclass(frozen=True)
class ListedPhoto:
    """One photo of a strip or of `photos`: its id, where it stands, and its camera."""

    id: str
    path: KeyPath
    camera: str


def groups_of_photos(root: Node) -> Iterator[tuple[KeyPath, Node]]:
    """Return the entries of `photos` and where they stand."""
    node = root.find("photos")
    if node is not None and node.entries:
        yield ("photos",), node
    elif node is not None:
        yield from ((("photos", i), each) for i, each in enumerate(node.elements))


def listed_photos(root: Node, measured: Sequence[str] = ()) -> Iterator[ListedPhoto]:
    """Return every photo of every strip and of `photos`.

    measured: photos that are measured; an entry of `photos` without a list has those that stand nowhere else.
    """
    strips = [(("strips", i), strip) for i, strip in enumerate(root.list_at("strips"))]
    listed: set[str] = set()
    others: list[tuple[KeyPath, Node]] = []
    for path, group in (*strips, *groups_of_photos(root)):
        for j, photo in enumerate(group.list_at("photos")):
            if photo.text:
                listed.add(photo.text)
                yield ListedPhoto(id=photo.text, path=(*path, "photos", j), camera=group.word("camera"))
        if path[0] == "photos" and not group.has("photos"):
            others.append((path, group))
    for path, group in others[:1]:
        for name in dict.fromkeys(measured):
            if name not in listed:
                yield ListedPhoto(id=name, path=(*path, "camera"), camera=group.word("camera"))


def check_references(root: Node) -> Iterator[Fault]:
    """Return what refers wrongly to something else in the project file."""
    for check in (
        _flown,
        _only_models if root.has("models") else _only_photos,
        _strips,
        _photos_in_any_order,
        _photos,
        _cameras,
        _system_of_coordinates,
        _units_of_sigma,
        _curvature,
        _needs_of_the_strip_method,
    ):
        yield from check(root)


NEEDED = {
    "cameras": "cameras by name",
    "observations": "points measured on photos, or `models` measured on a plotter",
}
NEEDS_IMAGES = {
    "earth_curvature": (("image",), "auto, model or none"),
    "refraction": (("true", "yes", "on"), "false"),
}
OF_PHOTOS = ("photos", "observations", "fiducial_measurements", "camera_positions", "orientations")


def _lacks(root: Node, name: str) -> bool:
    """Whether a file has no such key, not even misspelled, which the schema tells."""
    misspelled = (each for each in root.entries if each not in ProjectFile.model_fields)
    return not root.has(name) and not any(suggestion(each, [name]) for each in misspelled)


def _flown(root: Node) -> Iterator[Fault]:
    """Ask for photos."""
    if _lacks(root, "strips") and (root.has("models") or _lacks(root, "photos")):
        expected = "strips" if root.has("models") else "photos in flight order by strips; or `photos`, in any order"
        yield fault_at(root, ("strips",), "`strips` is missing", "missing-key", expected=expected)


def _only_photos(root: Node) -> Iterator[Fault]:
    """Ask for what image coordinates need."""
    for name, expected in NEEDED.items():
        if _lacks(root, name):
            yield fault_at(root, (name,), f"`{name}` is missing", "missing-key", expected=expected)
    for number, strip in enumerate(root.list_at("strips")):
        if isinstance(strip.value, dict) and not strip.has("camera"):
            expected = "camera of all its photos, a key of `cameras`"
            path = ("strips", number, "camera")
            yield fault_at(root, path, "`camera` is missing", "missing-key", expected=expected)
        if strip.has("models"):
            message, fix = "models are listed, but none are measured", "give their coordinates in `models`"
            yield fault_at(root, ("strips", number, "models"), message, "no-model", fix=fix)


def _only_models(root: Node) -> Iterator[Fault]:
    """Refuse what model coordinates exclude."""
    for name in OF_PHOTOS:
        if root.has(name):
            message = f"`{name}` and `models` exclude each other: a strip is made of photos or of models"
            yield fault_at(root, (name,), message, "photos-and-models", fix="remove one of the two")
    for number, strip in enumerate(root.list_at("strips")):
        if strip.has("first_photo"):
            message = "independent models stand in the frame of the first of them: `first_photo` is for photos"
            place = ("strips", number, "first_photo")
            yield fault_at(root, place, message, "needs-image-coordinates", fix="remove it")
    for name, (words, expected) in NEEDS_IMAGES.items():
        word = root.word("processing", name)
        if word.casefold() in words:
            message = f"`{name}: {word}` needs image coordinates; the project gives model coordinates"
            path = ("processing", name)
            yield fault_at(root, path, message, "needs-image-coordinates", expected=expected)


def _strips(root: Node) -> Iterator[Fault]:
    """Refuse strips of the same name and cameras that do not exist."""
    first: dict[str, int] = {}
    for number, strip in enumerate(root.list_at("strips")):
        name = strip.word("id")
        if name and first.setdefault(name, number) != number:
            line = root.place_of(("strips", first[name], "id")).line
            message = f"strip {shown(name)} already exists" + (f", in line {line}" if line else "")
            yield fault_at(root, ("strips", number, "id"), message, "duplicate-strip", fix="give it another id")
        yield from _known_camera(root, ("strips", number), strip)


def _known_camera(root: Node, path: KeyPath, group: Node) -> Iterator[Fault]:
    known, camera = list(root.mapping_at("cameras")), group.word("camera")
    if camera and known and camera not in known:
        message = f"there is no camera `{shown(camera)}`"
        expected, fix = f"one of {', '.join(known)}", suggestion(camera, known)
        yield fault_at(root, (*path, "camera"), message, "unknown-camera", expected=expected, fix=fix)


def _photos_in_any_order(root: Node) -> Iterator[Fault]:
    """Refuse in `photos` what only strips can have, and a second entry for all that is listed nowhere."""
    others: list[KeyPath] = []
    for path, group in groups_of_photos(root):
        yield from _known_camera(root, path, group)
        if group.entries and not group.has("photos"):
            others.append(path)
    for path in others[1:]:
        message = "a second entry without a list: the photos that are listed nowhere have one camera"
        yield fault_at(root, path, message, "second-rest", fix="list its photos")
    asked = root.word("processing", "adjustment")
    if root.has("photos") and not root.has("models") and asked not in {"", AUTO, BUNDLE}:
        message = f"photos in no given order need the bundle adjustment; `adjustment: {shown(asked)}` takes strips"
        path, fix = ("processing", "adjustment"), "or list the photos in flight order in `strips`"
        yield fault_at(root, path, message, "photo-without-strip", expected="auto or bundle", fix=fix)


def _photos(root: Node) -> Iterator[Fault]:
    """Refuse a photo that is listed twice, in one place or in two."""
    first: dict[str, KeyPath] = {}
    for photo in listed_photos(root):
        before = first.setdefault(photo.id, photo.path)
        if before == photo.path:
            continue
        strip = "" if before[0] == "photos" else root.word("strips", before[1], "id") or str(before[1])
        place = root.place_of(before)
        where = f"{place.file}:{place.line}:{place.column}" if place.line else place.file
        among = f"in strip {shown(strip)}" if strip else "in `photos`"
        message = f"photo {shown(photo.id)} is already listed, {among} ({where})"
        yield fault_at(root, photo.path, message, "duplicate-photo", fix="list every photo once")


def marks_of(camera: Node) -> Node | None:
    """Return the fiducial marks of a camera by name: their coordinates, or their places; None when it has none."""
    marks = camera.find("fiducials")
    return camera.find("fiducial_places") if marks is None else marks


def _cameras(root: Node) -> Iterator[Fault]:
    """Ask cameras for what their photos need: marks to orient by, the size of a pixel."""
    used = {group.word("camera") for group in root.list_at("strips")}
    used |= {group.word("camera") for _, group in groups_of_photos(root)}
    pixels = "px" in {root.word("observations", "unit"), root.word("fiducial_measurements", "unit")}
    marked = root.has("fiducial_measurements")
    units = {root.word("observations", "unit"), root.word("fiducial_measurements", "unit") or "px"}
    scanned = marked and units == {"px"}  # marks that are measured in pixels as the points are tell their size
    origin = root.word("observations", "origin") or ("top-left" if root.word("observations", "unit") == "px" else "")
    cornered = origin in {"top-left", "first-pixel"} and not marked
    for name, camera in root.mapping_at("cameras").items():
        path = ("cameras", name)
        marks = marks_of(camera)
        if marks is not None and len(marks.entries) == 1:
            message = "one mark alone cannot orient a photo"
            yield fault_at(root, (*path, "fiducials"), message, "length", expected="at least 2 marks")
        if name not in used or not isinstance(camera.value, dict):
            continue
        if marked and marks is None:
            message = f"fiducial marks are measured, but camera {shown(name)} has none"
            fix = "give their calibrated coordinates, or remove fiducial_measurements"
            yield fault_at(root, (*path, "fiducials"), message, "missing-key", fix=fix)
        if camera.word("unit") == "px":  # its pixels have a size, and its format is that of the image
            if root.has("observations") and root.word("observations", "unit") != "px":
                message = f"camera {shown(name)} is given in pixels, the image coordinates are not"
                fix = "give the camera in millimetres"
                yield fault_at(root, (*path, "unit"), message, "unit-elsewhere", expected="unit: mm", fix=fix)
            continue
        told = scanned and marks is not None
        if (pixels or origin == "first-pixel") and not told and "pixel_size" not in camera.entries:
            message = f"coordinates are measured in pixels, but camera {shown(name)} has no pixel_size"
            expected = "the size of a pixel in mm"
            yield fault_at(root, (*path, "pixel_size"), message, "missing-key", expected=expected)
        if cornered and "format" not in camera.entries:
            message = f"x and y begin at the {origin.replace('-', ' ')}, but camera {shown(name)} has no format"
            expected = "width and height in mm; or `observations.origin: center`"
            yield fault_at(root, (*path, "format"), message, "missing-key", expected=expected)


def _system_of_coordinates(root: Node) -> Iterator[Fault]:
    """Ask for the direction of y with pixels, and refuse an origin that would mean nothing."""
    if root.word("observations", "unit") == "px" and not root.has("observations", "y_axis"):
        message = "nothing says where y grows; with pixels both are in use"
        expected = "down (rows, as image viewers count) or up"
        yield fault_at(root, ("observations", "y_axis"), message, "missing-key", expected=expected)
    if root.has("fiducial_measurements") and root.has("observations", "origin"):
        message = "an origin means nothing here: the measured fiducial marks say where the photo lies"
        yield fault_at(root, ("observations", "origin"), message, "origin", fix="remove it")


def _units_of_sigma(root: Node) -> Iterator[Fault]:
    """Refuse a standard deviation that would take its unit from another file, as when a preset changes below it."""
    for section in ("observations", "fiducial_measurements"):
        sigma, unit = root.find(section, "sigma"), root.find(section, "unit")
        if sigma is None or unit is None or sigma.place.file in NO_FILES | {unit.place.file}:
            continue
        message = f"sigma stands in {sigma.place.file}, its unit in {unit.place.file}"
        yield fault_at(root, (section, "sigma"), message, "unit-elsewhere", fix="write both in one file")


def _curvature(root: Node) -> Iterator[Fault]:
    """Refuse to count the Earth's curvature twice: eq. 153 is for coordinates that do not carry it."""
    if root.word("processing", "earth_curvature") not in {"model", "image"}:
        return
    systems = [each.word("crs") for each in root.list_at("control")]
    curved = next((crs for crs in [*systems, root.word("output", "crs")] if crs not in {"", "local"}), "")
    if curved:
        message = f"Earth curvature would be counted twice: coordinates in {shown(curved)} already carry it"
        fix = "remove earth_curvature, or give plane coordinates of an unknown projection as `crs: local`"
        path = ("processing", "earth_curvature")
        yield fault_at(root, path, message, "curvature-twice", expected="auto", fix=fix)
    for section in ("camera_positions", "orientations"):  # they must lie in the control's frame
        crs = root.word(section, "crs")
        if crs not in {"", "local"}:
            message = f"Earth curvature would be counted twice: {section} in {shown(crs)} already carry it"
            fix = "remove earth_curvature, or give the positions in the `local` frame of the control"
            yield fault_at(root, (section, "crs"), message, "curvature-twice", expected="local", fix=fix)


def _needs_of_the_strip_method(root: Node) -> Iterator[Fault]:
    """Ask for two photos in each strip and for control, which a bundle adjustment can do without.

    One that nobody asked for needs something on the ground.
    """
    asked = root.word("processing", "adjustment")
    together = asked in {"", AUTO} and not root.has("models")
    if asked == BUNDLE or (together and (root.has("camera_positions") or root.has("orientations"))):
        return
    control = root.find("control")
    for number, strip in enumerate(root.list_at("strips")):
        if len(strip.list_at("photos")) == 1 and not together:
            path, fix = ("strips", number, "photos"), "or `processing.adjustment: bundle`, which takes single photos"
            message = "there is only one photo"
            yield fault_at(root, path, message, "length", expected="at least 2 photos", fix=fix)
    if _lacks(root, "control"):
        expected = "lists of given ground coordinates, each in its own frame"
        fix = "or `processing.adjustment: bundle`, which orients photos among themselves, without place and scale"
        yield fault_at(root, ("control",), "`control` is missing", "missing-key", expected=expected, fix=fix)
    elif control is not None and isinstance(control.value, list) and not control.value:
        expected = "at least 1 control list"
        yield fault_at(root, ("control",), "there is no control list", "length", expected=expected)
