"""Film in a comparator: every photo has its own deformation and lies in its own place.

Independent models as a plotter gives them: each pair of photos in a system of its own.

A model holds the points that both its photos show, and their perspective centres. Its coordinates are true ones,
brought into the system of the instrument, with errors that do not depend on each other.

Gross errors: wrong image coordinates, wrong control coordinates, points mistaken for each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.geometry.rotation import about, from_vector
from photostrip.points import ModelPoints, PhotoPoints
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.spec import GrossError, Models, Spec

LENGTHS = (1.0, 0.7, 0.5)  # wavelengths of the irregular deformation, parts of the larger side of the photo


@dataclass(frozen=True, eq=False)
class Sheets:
    """What happens to the film of each photo."""

    matrix: Floats  # (m, 2, 2): affine part: comparator axes from photo axes, with the turn of the film
    offset: Floats  # (m, 2): place of the photo's origin in the comparator, mm
    wave: Floats  # (m, 2, w, 2): wave numbers of the irregular part of each coordinate, radians per mm
    phase: Floats  # (m, 2, w): their phases, radians
    amplitude: float  # their amplitude, mm

    def comparator_from_photo(self, photo: Numbers, xy: Floats) -> Floats:
        """Give comparator coordinates of points (n, 2) in the system of the fiducial marks, mm."""
        angle = np.einsum("ncwk,nk->ncw", self.wave[photo], xy) + self.phase[photo]
        moved = xy + self.amplitude * np.sin(angle).sum(axis=2)
        return np.asarray(np.einsum("nij,nj->ni", self.matrix[photo], moved) + self.offset[photo])


def sheets(spec: Spec, count: int) -> Sheets | None:
    """Deform the film of all photos; None when the specification has no film.

    Draws (`Purpose.FILM`): for each photo the normal numbers scale x, scale y, shear, turn, offset x, offset y; then
    for each photo, coordinate and wave a direction and a phase.
    """
    film = spec.film
    if film is None:
        return None
    draws = Draws(spec.seed, Purpose.FILM)
    normal, uniform = draws.normal(count, 6), 2.0 * np.pi * draws.uniform(count, 2, len(LENGTHS), 2)
    stretch = np.zeros((count, 2, 2))
    stretch[:, 0, 0], stretch[:, 1, 1] = 1.0 + film.scale_ppm * 1e-6 * normal[:, :2].T
    stretch[:, 0, 1] = film.shear_ppm * 1e-6 * normal[:, 2]
    turn = about(2, np.radians(film.rotation_deg) * normal[:, 3])[:, :2, :2]
    number = 2.0 * np.pi / (max(spec.format) * np.asarray(LENGTHS))
    direction = np.stack([np.cos(uniform[..., 0]), np.sin(uniform[..., 0])], axis=-1)
    return Sheets(
        matrix=turn @ stretch,
        offset=film.offset_mm * normal[:, 4:],
        wave=number[:, None] * direction,
        phase=uniform[..., 1],
        # sine waves of this amplitude add up to the rms
        amplitude=film.irregular_um / 1000.0 * np.sqrt(2.0 / len(LENGTHS)),
    )


TILT_SIGMA = np.radians(2.0)  # scatter of the axes of a level model
LOG_SCALE_SIGMA = 0.2  # scatter of the logarithm of the model scales
ORIGIN_SIGMA = 500.0  # mm from which the origin of a model is drawn
STATED_UM = 1.0  # stated of model coordinates without errors


@dataclass(frozen=True, eq=False)
class TruePlaces:
    """True places of points and photos, in the Cartesian frame."""

    photo_ids: tuple[str, ...]
    points: Floats  # (n, 3): points, in the order of the observations' points, metres
    centers: Floats  # (m, 3): perspective centres, metres
    rotations: Floats  # (m, 3, 3): image axes to the frame


def plotted(
    spec: Spec, strips: tuple[tuple[str, tuple[str, ...]], ...], observations: PhotoPoints, truth: TruePlaces
) -> ModelPoints | None:
    """Measure the models of all strips; None when none are asked for.

    Models ``M1``, ``M2`` and so on, in flight order, strip by strip; points in the order of the observations, which say
    which photo shows which point, then the two perspective centres. Random numbers (`Purpose.MODELS`): stream 0, for
    each model seven numbers, scale, rotation and origin; stream 1, for each row x, y, z.
    """
    if spec.models is None:
        return None
    wanted, place = spec.models, {name: k for k, name in enumerate(truth.photo_ids)}
    pairs = [(place[a], place[b]) for _, photos in strips for a, b in pairwise(photos)]
    systems = Draws(spec.seed, Purpose.MODELS).normal(len(pairs), 7)
    shows = [np.unique(observations.point[observations.photo == k]) for k in range(len(observations.photo_ids))]
    number = {name: k for k, name in enumerate(observations.photo_ids)}
    points = len(observations.point_ids)
    model, node, xyz = [], [], []
    for k, pair in enumerate(pairs):
        left, right = (shows[number[truth.photo_ids[photo]]] for photo in pair)
        common = np.intersect1d(left, right)
        rotation, scale = _system(wanted, spec.scale, truth, pair, systems[k])
        centers = truth.centers[list(pair)]
        ground = np.concatenate([truth.points[common], centers]) - centers.mean(axis=0)
        nodes = [*common.tolist(), *(points + photo for photo in pair)]
        model += [k] * len(nodes)
        node += nodes
        xyz.append(scale * ground @ rotation.T + ORIGIN_SIGMA * systems[k, 4:])
    rows = ModelPoints(
        model_ids=tuple(f"M{k + 1}" for k in range(len(pairs))),
        point_ids=observations.point_ids,
        photo_ids=truth.photo_ids,
        model=np.array(model, np.intp),
        node=np.array(node, np.intp),
        xyz=np.concatenate(xyz),
        sigma=np.zeros((len(node), 3)),
    )
    return _measured(spec, wanted, rows)


def _system(
    wanted: Models, photo_scale: float, truth: TruePlaces, pair: tuple[int, int], drawn: Floats
) -> tuple[Floats, float]:
    """Rotation from the ground to the axes of a model, and its scale in mm per metre."""
    scale = 1000.0 / (wanted.scale or photo_scale) * float(np.exp(LOG_SCALE_SIGMA * drawn[0]))
    if wanted.axes == "any":
        return from_vector(np.pi / 2 * drawn[1:4]), scale
    base = truth.centers[pair[1]] - truth.centers[pair[0]]
    up = truth.rotations[list(pair)][:, :, 2].sum(axis=0)
    x = base / np.linalg.norm(base)
    z = up - (up @ x) * x
    z = z / np.linalg.norm(z)
    level = np.array([x, np.cross(z, x), z])
    return from_vector(np.array([TILT_SIGMA * drawn[1], TILT_SIGMA * drawn[2], np.pi / 2 * drawn[3]])) @ level, scale


def _measured(spec: Spec, wanted: Models, rows: ModelPoints) -> ModelPoints:
    """Add the errors of measurement, the hand of the axes, and what is stated."""
    center = rows.node >= len(rows.point_ids)
    sigma = np.where(center[:, None], wanted.center_sigma_um, wanted.sigma_um) / 1000.0
    noise = Draws(spec.seed, Purpose.MODELS, 1).normal(len(rows), 3)
    hand = np.array([1.0, -1.0 if wanted.hand == "left-handed" else 1.0, 1.0])
    stated = np.where(sigma > 0, sigma, STATED_UM / 1000.0)
    keep = np.flatnonzero(~center) if not wanted.centers else np.arange(len(rows))
    return replace(
        rows,
        model=rows.model[keep],
        node=rows.node[keep],
        xyz=((rows.xyz + sigma * noise) * hand)[keep],
        sigma=stated[keep],
    )


AXES = "xyz"
HALF = 0.5


@dataclass(frozen=True)
class InjectedError:
    """One gross error that was put in."""

    kind: str  # ``image``, ``control`` or ``swap``
    point: str
    photo: str = ""  # the photo; empty for control
    # which coordinate; empty for a swap. In the image x to the right, y up; at control x, y, z stand for east, north,
    # up (X, Y, Z)
    axis: str = ""
    size: float = 0.0  # what was added to the coordinate: mm in the image, metres at control; 0 for a swap
    other: str = ""  # the point it was exchanged with


def spoil_control(spec: Spec, ids: tuple[str, ...], use: Flags) -> tuple[Floats, tuple[InjectedError, ...]]:
    """Choose gross errors of given coordinates: what is added to them (n, 3), metres, and the list of errors.

    Draws (`Purpose.GROSS`, a stream for each entry of the list): an order of all control points, then for each error a
    number for the axis and one for the sign. An error whose point is named has the sign of its size. No point gets two
    errors.

    use: (n, 3), which coordinates of the control points are given.
    Raises InputError when a point named is not a control point, or more errors are asked for than there are control
        points.
    """
    offset = np.zeros((len(ids), 3))
    free = np.ones(len(ids), dtype=bool)
    errors = []
    for number, entry in _entries(spec, {"control"}):
        draws = Draws(spec.seed, Purpose.GROSS, number)
        order = draws.order(len(ids))
        fits = np.array([entry.point in {None, name} for name in ids], dtype=bool)
        if entry.axis is not None:
            fits &= use[:, AXES.index(entry.axis)]
        rows = _take(order[(fits & free)[order]], number, entry)
        for row in rows:
            axis, sign = draws.uniform(2)
            given = [AXES.index(entry.axis)] if entry.axis else np.flatnonzero(use[row]).tolist()
            column = given[int(axis * len(given))]
            size = entry.size_m if entry.point or sign < HALF else -entry.size_m
            offset[row, column] += size
            free[row] = False
            errors.append(InjectedError("control", ids[row], axis=AXES[column], size=size))
    return offset, tuple(errors)


def spoil_images(spec: Spec, observations: PhotoPoints) -> tuple[PhotoPoints, tuple[InjectedError, ...]]:
    """Put gross errors into image coordinates.

    Draws (`Purpose.GROSS`, a stream for each entry of the list): an order of all image points, then for each error a
    number for the axis, one for the sign and one for the partner of a swap. An error whose photo and point are both
    named has the sign of its size. No image point gets two errors.

    Raises InputError when a photo does not show the point named, or more errors are asked for than there are image
        points.
    """
    xy = np.array(observations.xy)
    photo = np.array(observations.photo_ids)[observations.photo]
    point = np.array(observations.point_ids)[observations.point]
    free = np.ones(len(xy), dtype=bool)
    errors = []
    for number, entry in _entries(spec, {"image", "swap"}):
        draws = Draws(spec.seed, Purpose.GROSS, number)
        order = draws.order(len(xy))
        fits = np.ones(len(xy), bool) if entry.photo is None else photo == entry.photo
        fits &= entry.point is None or point == entry.point
        for _ in range(entry.count):
            row = _take(order[(fits & free)[order]], number, replace(entry, count=1))[0]
            axis, sign, partner = draws.uniform(3)
            free[row] = False
            if entry.kind == "swap":
                others = np.flatnonzero(free & (photo == photo[row]))
                if not len(others):
                    raise _too_many(number, entry)
                other = others[int(partner * len(others))]
                free[other] = False
                xy[[row, other]] = xy[[other, row]]
                errors.append(InjectedError("swap", str(point[row]), str(photo[row]), other=str(point[other])))
                continue
            column = AXES.index(entry.axis) if entry.axis else int(axis * 2)
            named = entry.photo is not None and entry.point is not None
            size = entry.size_um / 1000.0 * (1.0 if named or sign < HALF else -1.0)
            xy[row, column] += size
            errors.append(
                InjectedError(kind="image", point=str(point[row]), photo=str(photo[row]), axis=AXES[column], size=size)
            )
    return replace(observations, xy=xy), tuple(errors)


def _entries(spec: Spec, kinds: set[str]) -> list[tuple[int, GrossError]]:
    return [(number, entry) for number, entry in enumerate(spec.gross_errors) if entry.kind in kinds]


def _take(rows: Numbers, number: int, entry: GrossError) -> list[int]:
    if len(rows) < entry.count:
        raise _too_many(number, entry)
    return [int(row) for row in rows[: entry.count]]


def _too_many(number: int, entry: GrossError) -> InputError:
    names = " on photo " + entry.photo if entry.photo else ""
    names = (f" of point {entry.point}" if entry.point else "") + names
    what = "control coordinates" if entry.kind == "control" else "image points"
    return InputError(
        Fault(
            f"there are not enough {what}{names} for a gross error",
            code="simulation-gross",
            key=f"gross_errors[{number}]",
            fix="ask for fewer, or take a name that occurs in the written files",
        )
    )
