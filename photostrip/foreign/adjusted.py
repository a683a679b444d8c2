"""A result as other programs need it: all of it in one Cartesian frame, its cameras in pixels, its image points.

It is made from the document, so that a saved result gives the same files as the run that wrote it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera, Distortion
from photostrip.errors import Fault, InputError
from photostrip.geodesy.crs import map_entry
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.network.observations import AFFINE, POINT, PRINCIPAL_DISTANCE, K, P, corrected, corrections
from photostrip.network.problem import CALIBRATION, BundleCameras
from photostrip.notes import Document
from photostrip.result.numbers import MATRIX
from photostrip.strip.corrections import distortion_reach, image_from_ideal
from photostrip.strip.pixel_cameras import PIXEL_SIZE, PixelCamera, in_pixels

WHOLE = 1e-6  # of a pixel, up to which rounding may make a photo larger
TO_CAMERA = np.diag([1.0, -1.0, -1.0])  # from image axes to x to the right, y down, z ahead
SEEN = 0.005  # pixels, from which on two decimals are not zero
GRID = 21  # lines of points in which the nearest camera of another program is sought


class Rays(NamedTuple):
    """Image points of one photo."""

    points: Numbers  # rows of the points
    xy: Floats  # (n, 2): measured, from the principal point over the principal distance, y up; all corrections made
    used: Flags  # whether they took part


@dataclass(frozen=True, eq=False)
class FileCamera:
    """A camera as other programs have it."""

    own: Camera  # with the calibration that was found
    nearest: Camera  # whose distortion is one that other programs know
    pixels: PixelCamera  # the nearest by the convention of COLMAP; its size may end within a pixel
    departure: float  # largest distance in pixels from the camera of the result

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in whole pixels."""
        width, height = (ceil(each - WHOLE) for each in self.pixels.image_size)
        return width, height

    def image(self, xy: Floats) -> Floats:
        """Image points in pixels from the corner of the first one, y down, of ideal ones at distance 1, y up."""
        x, y = xy[:, 0], -xy[:, 1]
        k1, k2, k3, p1, p2 = (self.pixels.distortion[each] for each in ("k1", "k2", "k3", "p1", "p2"))
        square = x**2 + y**2
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        distorted = np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x**2),
                y * radial + 2.0 * p2 * x * y + p1 * (square + 2.0 * y**2),
            ],
            axis=-1,
        )
        return np.asarray(distorted * self.pixels.focal_length + self.pixels.principal_point, float)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The photos and points of a result, the photos in its order as far as they are oriented."""

    document: Document
    ground: GroundFrame
    photos: tuple[Document, ...]
    enu_centers: Floats  # (m, 3): east, north, up in the units of the frame
    points: tuple[Document, ...]
    enu: Floats  # (n, 3)

    @cached_property
    def centers(self) -> Floats:
        """Perspective centres in the Cartesian frame, metres."""
        return self.ground.cartesian_from_ground(self.enu_centers, ids=[each["id"] for each in self.photos])

    @cached_property
    def level(self) -> Floats:
        """Rotations (m, 3, 3) from image axes to those of the frame at the perspective centres."""
        return coordinates(self.photos, MATRIX).reshape(-1, 3, 3)

    @cached_property
    def rotations(self) -> Floats:
        """Rotations (m, 3, 3) from image axes to the Cartesian frame."""
        axes = self.ground.axes_at(self.centers, self.enu_centers)
        return np.asarray(axes.transpose(0, 2, 1) @ self.level, float)

    @cached_property
    def xyz(self) -> Floats:
        """Points in the Cartesian frame, metres."""
        return self.ground.cartesian_from_ground(self.enu, ids=[each["id"] for each in self.points])

    @cached_property
    def camera_of(self) -> tuple[str, ...]:
        """Camera of each photo; one that an adjustment found shifted or enlarged has one of its own."""
        own = {each["camera"] for each in self._calibration}
        photos = zip((each["id"] for each in self.photos), self.given_camera_of, strict=True)
        return tuple(f"{name} of photo {photo}" * (f"of photo {photo}" in own) or name for photo, name in photos)

    @cached_property
    def given_camera_of(self) -> tuple[str, ...]:
        of_strip = {each["id"]: each["camera"] for each in self.document["strips"]}
        alone = {photo: each["id"] for each in self.document["cameras"] for photo in each.get("single_photos") or ()}
        return tuple(alone.get(each["id"]) or of_strip.get(each["strip"], "") for each in self.photos)

    @cached_property
    def _calibration(self) -> list[Document]:
        return list(self.document.get("bundle", {}).get("calibration", ()))

    @cached_property
    def rays(self) -> tuple[Rays, ...]:
        """Image points of each photo whose points have coordinates."""
        row_of = {each["id"]: row for row, each in enumerate(self.points)}
        focal = {each["id"]: each["principal_distance_mm"] for each in self.document["cameras"]}
        measured: dict[str, list[Any]] = {each["id"]: [] for each in self.photos}
        rays = map(self.document["residuals"].values, ("photo", "point", "vx_um", "vy_um", "used"))
        for photo, point, *ray in zip(*rays, strict=True):
            if photo in measured and point in row_of and ray[0] is not None:
                measured[photo].append((row_of[point], *ray))
        found = []
        for number, (kept, camera) in enumerate(zip(measured.values(), self.given_camera_of, strict=True)):
            columns = np.array(kept, float).reshape(-1, 4)
            points = columns[:, 0].astype(np.intp)
            xy = seen(self.xyz[points], self.centers[number], self.rotations[number])
            found.append(Rays(points, xy + columns[:, 1:3] / (1000.0 * focal[camera]), columns[:, 3] > 0))
        return tuple(found)

    @cached_property
    def cameras(self) -> Mapping[str, FileCamera]:
        """The cameras of the photos, with the calibration that was found."""
        estimated: dict[str, Floats] = defaultdict(lambda: np.zeros(len(CALIBRATION)))
        column = {each.title: number for number, each in enumerate(CALIBRATION.values())}
        for each in self._calibration:
            estimated[each["camera"]][column[each["parameter"]]] = each["value"]
        names = dict(zip(self.camera_of, self.given_camera_of, strict=True))
        own = {name: name.removeprefix(f"{like} ") if name != like else "" for name, like in names.items()}
        return {
            name: _in_file(_camera(each | {"id": name}), estimated[like] + estimated[own[name]], self._edge(name))
            for each in self.document["cameras"]
            for name, like in names.items()
            if like == each["id"]
        }

    def _edge(self, camera: str) -> Floats:
        """Largest coordinates of the image points of a camera, over its principal distance."""
        of_it = [rays.xy for rays, each in zip(self.rays, self.camera_of, strict=True) if each == camera]
        return np.asarray(np.abs(np.concatenate(of_it)).max(axis=0, initial=1e-6), float)

    def computed(self, number: int) -> Floats:
        """Return the adjusted image points of a photo, from the principal point over the principal distance, y up."""
        return seen(self.xyz[self.rays[number].points], self.centers[number], self.rotations[number])

    def on_map(self, xyz: Floats, enu: Floats | None = None) -> Floats:
        """Coordinates as maps have them: those of the result; longitude and latitude in place of geocentric.

        enu: those of the same points in the frame, where they are known.
        """
        return _on_map(self.ground, xyz, enu)

    def said_of_map(self) -> list[str]:
        """Say by how much who takes the coordinates of a map for Cartesian ones is wrong."""
        departure, photo = self.bent() if self.ground.kind == "projected" else (0.0, "")
        if departure < SEEN:
            return []
        moved = f"the map taken for Cartesian moves image points by up to {departure:.2f} px (photo {photo})"
        return [f"{moved}: curvature of the Earth, scale of the map"]

    def said_of_cameras(self) -> list[str]:
        """Say which cameras are not exactly those of the result, and whose pixels are not those of the photos."""
        said = [
            f"camera {name}: its distortion as k1, k2, k3, p1, p2 of OpenCV, within {each.departure:.3f} px"
            for name, each in self.cameras.items()
            if each.departure
        ]
        for each in self.document["cameras"]:
            if each["id"] in self.cameras and (each["fiducials"] or not each.get("pixel_size_mm")):
                size = 1000.0 * (each.get("pixel_size_mm") or PIXEL_SIZE)
                said.append(
                    f"camera {each['id']}: pixels of {size:g} µm about the middle of the photo, its marks in place"
                )
        return said

    def require_photos(self, form: str) -> None:
        """Refuse a result whose photos have no orientation."""
        if not self.photos:
            message = f"independent models give no orientation of photos, which {form} is made of"
            raise InputError(Fault(message, "export", fix="write a GeoPackage (.gpkg)"))

    def require_one_place(self, form: str) -> None:
        """Refuse strips that were adjusted each by itself: a point on two of them has no one place."""
        if self.document["adjustment"] != "bundle" and len(self.document["strips"]) > 1:
            message = f"strips adjusted each by itself have points of their own, where {form} has one for all"
            raise InputError(Fault(message, "export", fix="run with --set processing.adjustment=bundle"))

    def into_cameras(self, origin: Floats, axes: Floats) -> tuple[Floats, Floats]:
        """Rotations (m, 3, 3) and shifts (m, 3) from a frame to the cameras: x to the right, y down, z ahead.

        origin, axes: of the frame, in the Cartesian one; its axes as rows.
        """
        rotations = TO_CAMERA @ self.rotations.transpose(0, 2, 1) @ axes.T
        return rotations, -np.einsum("nij,nj->ni", rotations, (self.centers - origin) @ axes.T)

    def bent(self) -> tuple[float, str]:
        """Largest distance in pixels of image points by the coordinates of the frame from the true ones, and its photo.

        Who takes the coordinates of a map for Cartesian ones neglects the curvature of the Earth and the scale of the
        map.
        """
        largest = 0.0, ""
        for number, (rays, camera) in enumerate(zip(self.rays, self.camera_of, strict=True)):
            if not len(rays.points):
                continue
            by_map = seen(self.enu[rays.points], self.enu_centers[number], self.level[number])
            written = self.cameras[camera]
            away = float(np.linalg.norm(written.image(by_map) - written.image(self.computed(number)), axis=1).max())
            largest = max(largest, (away, self.photos[number]["id"]))
        return largest


def adjusted(document: Document) -> Adjusted:
    """Take what other programs need out of the content of result.json.

    Raises InputError for a frame that cannot be computed with here.
    """
    frame = document["frame"]
    ground, columns = _ground_frame(frame), _columns(frame["axes"])
    photos = tuple(each for each in document["photos"] if each["r11"] is not None)
    points = tuple(document["points"])
    return Adjusted(
        document=document,
        ground=ground,
        photos=photos,
        enu_centers=coordinates(photos)[:, columns],
        points=points,
        enu=coordinates(points)[:, columns],
    )


def require_squares(camera: Camera, form: str) -> None:
    """Refuse pixels that are no squares."""
    if any(camera.pixel_affinity):
        message = f"pixels of camera {camera.name} are no squares, for which {form} has no key"
        raise InputError(Fault(message, "export", fix="write it in pixels (.metashape.yaml)"))


def places_on_map(frame: Document, xyz: Floats) -> tuple[Floats, str | None]:
    """Return coordinates (n, 3) of the frame of a result as maps have them, and the reference system of the plan.

    East, north, up, whatever the order of the frame; longitude, latitude in degrees and height in place of geocentric
    ones. None: a local frame, which has no reference system.
    Raises InputError for a frame that cannot be computed with here.
    """
    ground, enu = _ground_frame(frame), xyz[:, _columns(frame["axes"])]
    if ground.kind == "local":
        return enu, None
    known = map_entry(ground.spec)
    places = _on_map(ground, ground.cartesian_from_ground(enu), enu)
    return places, f"EPSG:{known.epsg}" if known.epsg else known.wkt


def _on_map(ground: GroundFrame, xyz: Floats, enu: Floats | None = None) -> Floats:
    if ground.kind == "geocentric":
        geodetic = ground.geodetic(xyz)
        return np.column_stack([np.degrees(geodetic[:, :2]), geodetic[:, 2]])
    return ground.ground_from_cartesian(xyz) if enu is None else enu.copy()


def coordinates(records: tuple[Document, ...], names: tuple[str, ...] = ("x", "y", "z")) -> Floats:
    """Return three columns of records, NaN where one has no value."""
    return np.array([[each[name] for name in names] for each in records], float).reshape(-1, 3)


def seen(points: Floats, center: Floats, rotation: Floats) -> Floats:
    """Ideal image points (n, 2) at the distance 1, y up."""
    ray = (points - center) @ rotation
    return np.asarray(-ray[:, :2] / ray[:, 2:], float)


def _columns(axes: list[str]) -> list[int]:
    """Columns of x, y, z that are east, north, up."""
    return [axes.index(each) for each in (GROUND_AXES if "east" in axes else CARTESIAN_AXES)]


def _ground_frame(frame: Document) -> GroundFrame:
    curvature: Document = frame.get("curvature") or {}
    first, second, third = frame["axes"]
    spec = FrameSpec(
        crs=frame["crs"],
        axes=(first, second, third),
        height=frame["heights"],
        geoid_undulation=frame.get("geoid_undulation"),
        ellipsoid=tuple(frame["ellipsoid"]) if frame["crs"] == "geocentric" else None,
        curvature_radius=curvature.get("radius"),
    )
    try:
        ground = tie_frames([], spec)[1]
    except InputError as error:
        raise InputError(replace(each, key="frame.crs") for each in error.faults) from None
    return ground.with_origin(curvature["origin"]) if curvature else ground


def _camera(given: Document) -> Camera:
    """Return a camera of the document; without a format it is as large as its photos were measured."""
    size, lens = given["format_mm"], None
    if given["lens_model"] is not None:
        stated = {key.removeprefix("lens_"): value for key, value in given.items() if key.startswith("lens_") and value}
        columns: dict[str, Any] = {key: tuple(v) if isinstance(v, list) else v for key, v in stated.items()}
        lens = Distortion(**columns)
    unit, pixel_size = given.get("unit") or "mm", given.get("pixel_size_mm")
    b1, b2 = given.get("pixel_affinity") or (0.0, 0.0)
    return Camera(
        name=given["id"],
        principal_distance=given["principal_distance_mm"],
        principal_point=tuple(given["principal_point_mm"]),
        format=None if size is None else tuple(size),
        pixel_size=None if (unit, pixel_size) == ("px", PIXEL_SIZE) else pixel_size,  # nobody knows it
        pixel_affinity=(b1, b2),
        distortion=lens,
        unit=unit,
    )


def _in_file(camera: Camera, values: Floats, edge: Floats) -> FileCamera:
    """Return a camera as COLMAP has it: the same where COLMAP knows its distortion, else the nearest.

    values: (10,), what a calibration added to it.
    edge: (2,), largest image coordinates over the principal distance.
    """
    lens, pixel = camera.distortion, camera.pixel_size or PIXEL_SIZE
    reach = edge * camera.principal_distance
    width, height = camera.format or (2.0 * reach + 2.0 * np.abs(camera.principal_point)).tolist()
    size = width / pixel, height / pixel
    known = lens is None or (lens.direction == "ideal_to_image" and lens.model == "brown" and not any(lens.b))
    if known and not values.any():
        return FileCamera(own=camera, nearest=camera, pixels=in_pixels(camera, "colmap", size), departure=0.0)
    x, y = (np.linspace(-each, each, GRID) for each in reach)
    given = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    if lens is not None:
        given = given[np.linalg.norm(given, axis=1) < distortion_reach(lens)[1]]
    cameras = BundleCameras(np.zeros(1, np.intp), np.array([camera.principal_distance]), distortion=(lens,))
    ideal = corrected(cameras, values[None], given, np.zeros(len(given), np.intp))
    ideal /= camera.principal_distance + values[PRINCIPAL_DISTANCE]
    image = (given if lens is None else image_from_ideal(given, lens)) + camera.principal_point
    nearest = _nearest(camera, ideal, image, stretched=bool(values[AFFINE].any() or (lens and any(lens.b))))
    own, pixels = nearest if values.any() else camera, in_pixels(nearest, "colmap", size)
    found = FileCamera(own=own, nearest=nearest, pixels=pixels, departure=0.0)
    stretch, shear = camera.pixel_affinity
    u, v = ((1.0 + stretch) * image[:, 0] + shear * image[:, 1]) / pixel, -image[:, 1] / pixel
    true = np.stack([u, v], axis=-1) + np.array(size) / 2.0
    return replace(found, departure=float(np.linalg.norm(found.image(ideal) - true, axis=1).max()))


def _nearest(camera: Camera, ideal: Floats, image: Floats, *, stretched: bool) -> Camera:
    """Fit a camera with Brown's distortion from ideal to image coordinates, by least squares of image coordinates (mm).

    ideal: (n, 2), at the distance 1.
    """
    changes = corrections(ideal.T)
    changes[PRINCIPAL_DISTANCE] = ideal.T
    wanted = [PRINCIPAL_DISTANCE, *POINT, *K, *P, *(AFFINE[:1] if stretched else [])]
    design = changes[wanted].reshape(len(wanted), -1).T
    found = np.zeros(len(CALIBRATION))
    found[wanted] = np.linalg.lstsq(design, image.T.ravel(), rcond=None)[0]
    f, (x0, y0), k, p = found[PRINCIPAL_DISTANCE], -found[POINT], found[K], found[P]
    stretch, shear = camera.pixel_affinity
    wide = float(found[AFFINE[0]] / f)
    return replace(
        camera,
        principal_distance=float(f),
        principal_point=(float(x0 / (1.0 + wide)), float(y0)),
        pixel_affinity=((1.0 + stretch) * (1.0 + wide) - 1.0, shear),
        distortion=Distortion(
            "brown",
            "ideal_to_image",
            k=(float(k[0] / f**3), float(k[1] / f**5), float(k[2] / f**7)),
            p=(float(p[0] / f**2), float(p[1] / f**2)),
        ),
    )
