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
        (Spec(flight=Flight(photos=1)), "flight.photos: 1 photo cannot make a strip"),
        (Spec(flight=Flight(photos=200, strips=200)), "flight.photos: 40000 photos are too many"),
        (
            Spec(flight=Flight(end_lap_percent=-10.0)),
            "an end lap of -10 % cannot be simulated: .*; expected more than 50 and at most 95",
        ),
        (Spec(flight=Flight(end_lap_percent=NAN)), "flight.end_lap_percent: an end lap of nan %"),
        (Spec(flight=Flight(scale=5000.0, flying_height=800.0)), "flight.scale: scale and flying_height are both"),
        (Spec(flight=Flight(heading_deg=NAN)), "flight.heading_deg: nan degrees is out of range"),
        (Spec(flight=Flight(attitude_sigma_deg=(1.0, 80.0, 1.0))), "flight.attitude_sigma_deg: 80 degrees"),
        (Spec(terrain=Terrain(relief=1400.0)), "terrain.relief: the terrain rises to 1400 m"),
        (Spec(points=Points(rows=1)), "points.rows: 1 is out of range; expected 2 to 50"),
        (Spec(flight=Flight(photos=20_000), points=Points(extra_per_model=9_000)), "points are too many"),
        (Spec(control=Control(layout="circle")), "control.layout: the layout 'circle' is not known; expected bands"),
        (Spec(control=Control(per_band=4)), "control.per_band: 4 is out of range; expected 1 to 3"),
        (Spec(control=Control(use={"xz": 1.0})), "control.use.xz: 'xz' is no set of coordinates; expected xyz"),
        (Spec(control=Control(sigma=(0.0, 1.0, 1.0))), "control.sigma: 0 m is out of range"),
        (Spec(control=Control(boundary_longitude_deg=3.0)), "a boundary needs a second frame"),
        (Spec(ground=Ground(crs="local"), control=Control(second_crs="EPSG:32633")), "nobody knows where `local` lies"),
        (Spec(image=Image(sigma_um=-5.0)), "image.sigma_um: -5 um is out of range"),
        (Spec(image=Image(unit="px")), "image.unit: pixels need a size; add camera.pixel_size"),
        (Spec(camera=DIGITAL, film=Film()), "film: the film is deformed, but the camera has no three fiducial marks"),
        (Spec(camera=replace(FILM, format=None)), "camera.format: the camera has no format"),
        (
            Spec(camera=replace(FILM, distortion=Distortion("brown", "image_to_ideal", k=(-1e-3, 0.0, 0.0)))),
            "camera.distortion: camera film: the distortion has no inverse",
        ),
        (Spec(gross_errors=(GrossError("typo"),)), r"gross_errors\[0\].kind: .* of kind 'typo' are not known"),
        (Spec(gross_errors=(GrossError("image", axis="z"),)), "axis: an error of kind image has no axis 'z'"),
        (Spec(gross_errors=(GrossError("control", photo="1001"),)), "control is given on the ground"),
        (Spec(ground=Ground(crs="EPSG:99999999")), "PROJ does not know the coordinate reference system"),
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
