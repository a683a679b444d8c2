"""Photos with their keypoints, as programs of structure from motion have them, put together as a block."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats, Numbers
from photostrip.errors import InputError
from photostrip.foreign.places import Place, unique
from photostrip.foreign.tables import ForeignBlock
from photostrip.formats.faults import LARGEST_NUMBER, SMALLEST_LENGTH, shown
from photostrip.formats.files import refuse
from photostrip.notes import counted, listed
from photostrip.strip import corrections
from photostrip.strip.pixel_cameras import PixelCamera, in_millimetres


@dataclass(frozen=True, eq=False)
class Photo:
    place: Place
    pose: Floats  # (7,): quaternion w, x, y, z and translation, from the world to the camera
    camera: str
    name: str
    xy: Floats  # (n, 2)
    points: Numbers  # (n,): numbers of points; -1 for a keypoint without one


@dataclass(frozen=True)
class Origin:
    """What the photos were read from."""

    source: str  # as "COLMAP model (binary)"
    files: tuple[str, ...]
    rays: str  # the file that the rays are from
    label: Callable[[int], str]  # id of a point by its number: one that no control point has
    frame: str = "the model's own, of any place, direction and scale"
    left_out: tuple[str, ...] = ()


def checked_camera(place: Place, name: str, given: PixelCamera) -> PixelCamera:
    """Return a camera that a project can have, or raise what is wrong with it."""
    if not all(SMALLEST_LENGTH < each < LARGEST_NUMBER for each in (*given.image_size, *given.focal_length)):
        raise place.wrong("width, height and focal length are not above 0", "range")
    if not (np.abs([*given.principal_point, *given.distortion.values()]) < LARGEST_NUMBER).all():
        raise place.wrong("a parameter is no number", "number")
    try:
        faults = corrections.distortion_faults(in_millimetres(name, given))
    except InputError as error:
        faults = list(error.faults)
    for fault in faults:
        raise place.wrong(fault.message, fault.code, fix=fault.fix)
    return given


def gathered(origin: Origin, cameras: Mapping[str, PixelCamera], photos: Sequence[Photo]) -> ForeignBlock:
    """Put the images in the order of their names, and leave out what determines nothing."""
    images = sorted(photos, key=lambda each: each.name)
    named = ((each.place, each.name.strip(), each) for each in images)
    by_name = dict(unique("an image called", named))
    for name, each in by_name.items():
        if not name or not name.isprintable():
            raise each.place.wrong(f"`{shown(name)}` is no name of a photo", expected="a text on one line")
        if each.camera not in cameras:
            raise each.place.wrong(f"there is no camera {shown(each.camera)}", "unknown-camera")
    kept = [each.points >= 0 for each in images]
    photo = np.repeat(np.arange(len(images)), [int(each.sum()) for each in kept])
    ids = np.concatenate([np.zeros(0, np.int64), *(each.points[rows] for each, rows in zip(images, kept, strict=True))])
    xy = np.concatenate([np.zeros((0, 2)), *(each.xy[rows] for each, rows in zip(images, kept, strict=True))])
    numbers, point = np.unique(ids, return_inverse=True)
    left_out = list(origin.left_out)
    _, first, times = np.unique(photo * len(numbers) + point, return_index=True, return_counts=True)
    if twice := int((times > 1).sum()):
        left_out.append(f"{counted(twice, 'point')} of a photo that stand on it twice: nothing says which is right")
    rows = first[times == 1]
    seen = np.bincount(point[rows], minlength=len(numbers))
    rows = np.sort(rows[seen[point[rows]] > 1])
    if alone := int((seen == 1).sum()):
        left_out.append(f"{counted(alone, 'point')} on one photo only")
    used = np.unique(photo[rows])
    if len(used) < len(images):
        names = [each.name for number, each in enumerate(images) if number not in set(used.tolist())]
        left_out.append(f"{counted(len(names), 'photo')} without points: {listed(names, 4)}")
    if not len(used):
        refuse(origin.rays, "no-points", "no point stands on two photos", fix="write a model with its tracks")
    poses = np.array([images[number].pose for number in used.tolist()])
    to_camera = Rotation.from_quat(poses[:, [1, 2, 3, 0]]).as_matrix()
    points = np.unique(point[rows])
    taken = {images[each].camera for each in used.tolist()}
    return ForeignBlock(
        source=origin.source,
        files=origin.files,
        cameras={name: each for name, each in cameras.items() if name in taken},
        photos=tuple(images[each].name.strip() for each in used.tolist()),
        camera_of=tuple(images[each].camera for each in used.tolist()),
        points=tuple(map(origin.label, numbers[points].tolist())),
        photo=np.searchsorted(used, photo[rows]),
        point=np.searchsorted(points, point[rows]),
        xy=xy[rows],
        centers=-np.einsum("nji,nj->ni", to_camera, poses[:, 4:]),
        rotations=to_camera.transpose(0, 2, 1) * (1.0, -1.0, -1.0),
        frame=origin.frame,
        left_out=tuple(left_out),
    )


def measured_alone(block: ForeignBlock) -> ForeignBlock:
    """Leave out photos without image points of a block whose orientations are given; without any it stays as it is."""
    used = np.unique(block.photo)
    if block.centers is None or block.rotations is None or len(used) in {0, len(block.photos)}:
        return block
    kept = used.tolist()
    lost = [name for place, name in enumerate(block.photos) if place not in set(kept)]
    camera_of = tuple(block.camera_of[place] for place in kept)
    return replace(
        block,
        cameras={name: each for name, each in block.cameras.items() if name in camera_of},
        photos=tuple(block.photos[place] for place in kept),
        camera_of=camera_of,
        photo=np.searchsorted(used, block.photo),
        centers=block.centers[used],
        rotations=block.rotations[used],
        center_sigma=None if block.center_sigma is None else block.center_sigma[used],
        left_out=(*block.left_out, f"{counted(len(lost), 'photo')} without points: {listed(lost, 4)}"),
    )
