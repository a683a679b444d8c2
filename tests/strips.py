"""Photos over a flat world, projected by the collinearity equations alone: pairs and strips whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from photostrip.camera import Camera
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.local_frame import IntermediateFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.inputs import Inputs, Strip
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.strip.absolute_orientation import Targets
from photostrip.strip.relative_orientation import Pairs, collect_pairs, orient_pairs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from photostrip.arrays import Floats
    from photostrip.strip.relative_orientation import Orientation


MICROMETRE = 1e-3  # mm
LOCAL = FrameSpec("local", ("east", "north", "up"))
STATED_SIGMA = 0.005  # mm, stated of image coordinates that have no errors


def attitude(angles_deg: ArrayLike) -> Floats:
    """Rotations from alpha, omega, kappa in degrees, by a library that is not ours."""
    turn = np.atleast_2d(np.asarray(angles_deg, float)) * [-1.0, 1.0, 1.0]
    matrices: Floats = Rotation.from_euler("YXZ", turn, degrees=True).as_matrix()
    return matrices


def photograph(xyz: Floats, center: Floats, rotation: Floats, focal: float) -> Floats:
    """Central projection of points onto one photo, mm."""
    ray = (xyz - center) @ rotation
    xy: Floats = -focal * ray[:, :2] / ray[:, 2:]
    return xy


def measured(photos: Mapping[str, Mapping[str, ArrayLike]], sigma: float = STATED_SIGMA) -> PhotoPoints:
    """Table of image points given by photo and point."""
    points = tuple(dict.fromkeys(name for image in photos.values() for name in image))
    number = {name: n for n, name in enumerate(points)}
    rows = [(n, number[name], *np.asarray(xy)) for n, image in enumerate(photos.values()) for name, xy in image.items()]
    columns = np.array(rows, float).reshape(-1, 4)
    photo, point = columns[:, :2].T.astype(int)
    return PhotoPoints(tuple(photos), points, photo, point, columns[:, 2:], np.full((len(rows), 2), sigma))


@dataclass(frozen=True, eq=False)
class TruePairs:
    """Stereopairs with known orientation, the same number of points on each: base direction and right rotation."""

    pairs: Pairs
    base: Floats  # (p, 3), unit, in the left photo's frame
    rotation: Floats  # (p, 3, 3), right to left photo

    def orient(self) -> Orientation:
        """Orient all pairs; photos are called L0, R0, L1, ..."""
        names = [f"{number}" for number in range(self.pairs.size + 1)]
        return orient_pairs(self.pairs, names)

    def errors(self, elements: Floats) -> Floats:
        """Largest error of base direction and rotation of each pair, radians."""
        found = relative_geometry(elements)
        turn = np.abs(found[1] - self.rotation).max(axis=(1, 2))
        worst: Floats = np.maximum(np.linalg.norm(found[0] - self.base, axis=1), turn)
        return worst


def relative_geometry(elements: Floats) -> tuple[Floats, Floats]:
    """Base direction and rotation of the right photo in the left photo's frame, from base-frame elements."""
    zero = np.zeros(len(elements))
    left = attitude(np.degrees(np.column_stack([elements[:, 0], zero, elements[:, 1]])))
    right = attitude(np.degrees(elements[:, 2:]))
    return left[:, 0, :], left.transpose(0, 2, 1) @ right


def batch(left: Floats, right: Floats, focal: float) -> Pairs:
    """Pairs of arrays of shape (p, n, 2), unit weights."""
    p, n = left.shape[:2]
    rows = np.arange(p * n)
    return Pairs(
        starts=np.arange(p) * n,
        pair=np.repeat(np.arange(p), n),
        left=left.reshape(-1, 2),
        right=right.reshape(-1, 2),
        weight=np.ones(p * n),
        focal=focal,
        point=rows,
        rows=np.column_stack([rows, rows]),
    )


def true_pairs(
    rng: np.random.Generator,
    pairs: int = 1,
    *,
    focal: float = 153.0,
    counts: Sequence[int] = (2, 2, 2, 2, 2, 2),
    tilt_deg: float = 5.0,
    kappa_deg: float = 180.0,
    relief: float = 0.1,
    reach: float = 0.6,
    sigma: float = 0.0,
) -> TruePairs:
    """Random pairs: both photos tilted and turned, ground with relief, standard points scattered by a tenth."""
    a = b = reach * focal
    standard = np.array([[0, 0], [b, 0], [0, a], [b, a], [0, -a], [b, -a]], float)
    nadir = np.repeat(standard, counts, axis=0) + rng.uniform(-0.1 * a, 0.1 * a, (pairs, sum(counts), 2))
    depth = focal * (1 + rng.uniform(-relief, relief, nadir.shape[:2]))
    ground: Floats = np.concatenate([nadir * (depth / focal)[..., None], -depth[..., None]], axis=2)
    angles = rng.uniform(-tilt_deg, tilt_deg, (2, pairs, 3))
    angles[0, :, 2] = kappa_deg * rng.uniform(-1, 1, pairs)
    angles[1, :, 2] += angles[0, :, 2]
    bases = np.array([b, 0.0, 0.0]) + rng.normal(0, 0.03 * b, (pairs, 3))
    first, second = attitude(angles[0]), attitude(angles[1])
    left = np.array([photograph(x, np.zeros(3), r, focal) for x, r in zip(ground, first, strict=True)])
    right = np.array([photograph(x, s, r, focal) for x, s, r in zip(ground, bases, second, strict=True)])
    noise = rng.normal(0, sigma, (2, *left.shape)) if sigma else np.zeros((2, *left.shape))
    base = np.einsum("pji,pj->pi", first, bases) / np.linalg.norm(bases, axis=1)[:, None]
    return TruePairs(batch(left + noise[0], right + noise[1], focal), base, first.transpose(0, 2, 1) @ second)


@dataclass(frozen=True, eq=False)
class Flown:
    """One strip flown along X: what is measured and what is true, metres."""

    observations: PhotoPoints
    xyz: Floats  # of all points of the observations, in their order
    centers: Floats
    rotations: Floats
    focal: float
    base: float
    height: float
    at: dict[str, int] = field(default_factory=dict)  # number of each point

    @property
    def photos(self) -> tuple[str, ...]:
        """Photos in flight order."""
        return self.observations.photo_ids

    def oriented(self) -> Orientation:
        """Relative orientation of all pairs, nothing screened."""
        return orient_pairs(collect_pairs(self.observations, self.photos, self.focal), self.photos)

    def bands(self, *stations: int, rows: Sequence[int] = (-1, 0, 1)) -> tuple[str, ...]:
        """Names of the points of some rows across the strip at some photos."""
        return tuple(f"p{station}_{row}" for station in stations for row in rows)


def fly(
    seed: int = 0,
    photos: int = 5,
    *,
    focal: float = 153.0,
    scale: float = 10_000.0,
    overlap: float = 0.62,
    sigma: float = 0.0,
    tilt_deg: float = 1.0,
    kappa_deg: float = 0.0,
    relief: float = 0.05,
    extra: int = 0,
) -> Flown:
    """Fly a strip: three points abeam of every photo (p3_-1, p3_0, p3_1) and `extra` anywhere (e0, e1, ...)."""
    rng = np.random.default_rng(seed)
    side = 230.0  # mm, of the photo
    height, base = focal * scale / 1000, (1 - overlap) * side * scale / 1000
    half = 0.40 * side * scale / 1000
    centers = np.column_stack([np.arange(photos) * base, np.zeros(photos), np.full(photos, height)])
    centers = centers + rng.normal(0, 0.02 * base, (photos, 3))
    rotations = attitude(rng.normal(0, tilt_deg, (photos, 3)) + np.array([0, 0, kappa_deg]))
    names = [f"p{n}_{row}" for n in range(photos) for row in (-1, 0, 1)] + [f"e{n}" for n in range(extra)]
    plan = np.array([[n * base, row * half] for n in range(photos) for row in (-1, 0, 1)])
    plan = plan + rng.normal(0, 0.04 * base, plan.shape)
    anywhere = np.column_stack([rng.uniform(0, (photos - 1) * base, extra), rng.uniform(-half, half, extra)])
    plan = np.concatenate([plan, anywhere])
    xyz = np.column_stack([plan, rng.uniform(-relief, relief, len(plan)) * height])
    images: dict[str, dict[str, Floats]] = {}
    for n in range(photos):
        # the format is that of a photo that hangs level, so that tilts and kappa do not change who sees what
        seen = np.flatnonzero(np.abs(xyz[:, 0] - centers[n, 0]) < 0.47 * side * scale / 1000)
        xy = photograph(xyz[seen], centers[n], rotations[n], focal)
        xy = xy + rng.normal(0, sigma, xy.shape) if sigma else xy
        images[f"{101 + n}"] = {names[i]: image for i, image in zip(seen, xy, strict=True)}
    observations = measured(images, sigma or STATED_SIGMA)
    rows = [names.index(name) for name in observations.point_ids]
    at = {name: n for n, name in enumerate(observations.point_ids)}
    return Flown(observations, xyz[rows], centers, rotations, focal, base, height, at)


def control_points(
    points: Mapping[str, ArrayLike],
    use: Mapping[str, str] | None = None,
    sigma: ArrayLike = 0.05,
    check: Sequence[str] = (),
) -> ControlPoints:
    """Control by name; `use` gives ``xyz``, ``xy`` or ``z``, full when it does not name the point."""
    names = tuple(points)
    kinds = [(use or {}).get(name, "xyz") for name in names]
    flags = np.array([["x" in kind, "y" in kind, "z" in kind] for kind in kinds]).reshape(-1, 3)
    given = np.where(flags, np.array([np.asarray(points[name], float) for name in names]).reshape(-1, 3), np.nan)
    sigmas = np.broadcast_to(np.asarray(sigma, float), given.shape)
    return ControlPoints(names, given, flags, np.array([name in check for name in names], bool), sigmas)


def targets(control: ControlPoints, azimuth_deg: float = 90.0, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Targets:
    """Control seen from a flat intermediate frame; with azimuth 90 its axes are east, north, up."""
    frames, _ = tie_frames([LOCAL])
    middle = np.asarray(origin, float).reshape(1, 3)
    return Targets(control, frames, IntermediateFrame.at_local_centre(middle, np.radians(azimuth_deg)))


def project(flown: Flown, control: ControlPoints, name: str = "test") -> Inputs:
    """Everything a run needs for one flown strip with control in a flat world."""
    strip = Strip("A", Camera("camera", flown.focal), flown.photos)
    return Inputs(name, (strip,), flown.observations, control, (LOCAL,))
