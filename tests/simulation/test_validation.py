"""What cannot be simulated is refused in words, everything at once, with exit code 2."""

from __future__ import annotations

from dataclasses import replace

import pytest

from photostrip.camera import Distortion
from photostrip.errors import InputError
from photostrip.simulation import (
    DIGITAL,
    FILM,
    Control,
    Film,
    Flight,
    Gnss,
    GrossError,
    Ground,
    Image,
    Points,
    Spec,
    Terrain,
    simulate,
)

NAN = float("nan")


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (Spec(flight=Flight(photos=0)), "flight.photos: 0 photos cannot make a strip; expected two or more"),
        (Spec(flight=Flight(photos=1)), "flight.photos: 1 photo cannot make a strip"),
        (Spec(flight=Flight(strips=0)), "flight.strips: 0 strips cannot be simulated"),
        (Spec(flight=Flight(photos=10**9)), "flight.photos: 1000000000 photos are too many; expected at most 20000"),
        (Spec(flight=Flight(photos=200, strips=200)), "flight.photos: 40000 photos are too many"),
        (
            Spec(flight=Flight(end_lap_percent=-10.0)),
            (
                "flight.end_lap_percent: an end lap of -10 % cannot be simulated: with it no point lies on three photos"
                "; expected more than 50 and at most 95"
            ),
        ),
        (Spec(flight=Flight(end_lap_percent=50.0)), "no point lies on three photos"),
        (Spec(flight=Flight(end_lap_percent=100.0)), "photos hardly move"),
        (Spec(flight=Flight(end_lap_percent=NAN)), "flight.end_lap_percent: an end lap of nan %"),
        (
            Spec(flight=Flight(side_lap_percent=-1.0)),
            "flight.side_lap_percent: -1 % is out of range; expected 0 to 90 %",
        ),
        (Spec(flight=Flight(scale=0.0)), "flight.scale: 0 is out of range"),
        (
            Spec(flight=Flight(scale=5000.0, flying_height=800.0)),
            "flight.scale: scale and flying_height are both given",
        ),
        (Spec(flight=Flight(flying_height=-5.0)), "flight.flying_height: -5 m is out of range"),
        (Spec(flight=Flight(heading_deg=NAN)), "flight.heading_deg: nan degrees is out of range"),
        (Spec(flight=Flight(attitude_sigma_deg=(1.0, 80.0, 1.0))), "flight.attitude_sigma_deg: 80 degrees"),
        (Spec(terrain=Terrain(relief=-1.0)), "terrain.relief: -1 m is out of range"),
        (
            Spec(terrain=Terrain(relief=1400.0)),
            "terrain.relief: the terrain rises to 1400 m above its mean height, the camera",
        ),
        (Spec(terrain=Terrain(slope_percent=(40.0, 0.0))), "terrain.relief: the terrain rises to 1900 m"),
        (Spec(points=Points(rows=1)), "points.rows: 1 is out of range; expected 2 to 50"),
        (Spec(points=Points(extra_per_model=-1)), "points.extra_per_model: -1"),
        (Spec(flight=Flight(photos=20_000), points=Points(extra_per_model=9_000)), "points are too many"),
        (
            Spec(control=Control(layout="circle")),
            r"control.layout: the layout 'circle' is not known; expected bands \| corners",
        ),
        (Spec(control=Control(per_band=4)), "control.per_band: 4 is out of range; expected 1 to 3"),
        (Spec(control=Control(bands=11)), "control.bands: 11 is out of range; expected 1 to 10"),
        (Spec(control=Control(every=0)), "control.every: 0 models is out of range"),
        (Spec(control=Control(layout="random", count=0)), "control.count: 0"),
        (
            Spec(control=Control(use={"xz": 1.0})),
            r"control.use.xz: 'xz' is no set of coordinates; expected xyz \| xy \| z",
        ),
        (Spec(control=Control(use={"xyz": 0.0})), "control.use: no coordinates are given at all"),
        (Spec(control=Control(sigma=(0.0, 1.0, 1.0))), "control.sigma: 0 m is out of range"),
        (Spec(control=Control(check=-1)), "control.check: -1"),
        (Spec(control=Control(boundary_longitude_deg=3.0)), "a boundary needs a second frame"),
        (Spec(ground=Ground(crs="local"), control=Control(second_crs="EPSG:32633")), "nobody knows where `local` lies"),
        (Spec(image=Image(sigma_um=-5.0)), "image.sigma_um: -5 um is out of range"),
        (Spec(image=Image(unit="px")), "image.unit: pixels need a size; add camera.pixel_size"),
        (Spec(image=Image(unit="inch")), "image.unit: the unit 'inch' is not known"),
        (Spec(image=Image(y_axis="left")), "image.y_axis: 'left' is not known"),
        (Spec(camera=DIGITAL, film=Film()), "film: the film is deformed, but the camera has no three fiducial marks"),
        (Spec(film=Film(scale_ppm=-1.0)), "film.scale_ppm: -1 is out of range"),
        (Spec(gnss=Gnss(sigma=(0.0, 0.1, 0.1))), "gnss.sigma: 0 m"),
        (Spec(camera=replace(FILM, principal_distance=0.0)), "camera.principal_distance: 0 mm is out of range"),
        (Spec(camera=replace(FILM, format=None)), "camera.format: the camera has no format"),
        (
            Spec(camera=replace(FILM, distortion=Distortion("brown", "image_to_ideal", k=(-1e-3, 0.0, 0.0)))),
            "camera.distortion: camera film: the distortion has no inverse",
        ),
        (
            Spec(gross_errors=(GrossError("typo"),)),
            r"gross_errors\[0\].kind: gross errors of kind 'typo' are not known",
        ),
        (Spec(gross_errors=(GrossError("image", count=0),)), r"gross_errors\[0\].count: 0"),
        (
            Spec(gross_errors=(GrossError("image", axis="z"),)),
            r"gross_errors\[0\].axis: an error of kind image has no axis 'z'",
        ),
        (Spec(gross_errors=(GrossError("image", size_um=NAN),)), r"gross_errors\[0\].size_um: the size of the error"),
        (Spec(gross_errors=(GrossError("control", photo="1001"),)), "control is given on the ground"),
        (Spec(ground=Ground(center_deg=(10.0, 95.0))), "ground.center_deg: 10, 95 is no place"),
        (Spec(ground=Ground(crs="EPSG:99999999")), "PROJ does not know the coordinate reference system"),
        (Spec(ground=Ground(axes=("east", "east", "up"))), "axes"),
        (
            Spec(flight=Flight(photos=2000, flying_height=100_000.0), ground=Ground(crs="EPSG:4979")),
            "strips of 120261 km are too long for a body of 6382 km radius",
        ),
    ],
)
def test_refused(spec: Spec, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        simulate(spec)
    assert caught.value.exit_code == 2


def test_all_faults_at_once() -> None:
    spec = Spec(
        flight=Flight(photos=0, heading_deg=1e9), image=Image(unit="inch", sigma_um=-1.0), control=Control(layout="?")
    )
    with pytest.raises(InputError) as caught:
        simulate(spec)
    keys = [fault.key for fault in caught.value.faults]
    assert keys == ["flight.photos", "flight.heading_deg", "control.layout", "image.sigma_um", "image.unit"]
