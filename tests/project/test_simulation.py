"""Specification files: what may stand in them, and where what is wrong with them is said to be."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from photostrip.camera import Distortion
from photostrip.errors import InputError
from photostrip.project.simulation import Specification, load_specification
from photostrip.simulation import (
    DIGITAL,
    Control,
    Film,
    Flight,
    Gnss,
    GrossError,
    Ground,
    Image,
    Models,
    Points,
    Spec,
    Terrain,
)  # fmt: skip
from tests.source_tree import ROOT

EXAMPLES = sorted((ROOT / "configs/simulate").glob("*.yaml"))
EVERYTHING = """\
photostrip_simulation: 1
name: all of it
seed: 7
camera:
  preset: digital
  name: "007"
  principal_distance: 80.5
  principal_point: [0.1, -0.2]
  format: [60, 50]
  pixel_size: 0.005
  fiducials: {A: [25, 20], B: [-25, 20], C: [-25, -20]}
  distortion: {model: brown, direction: ideal_to_image, k: [1.0e-8, 0, 0], p: [0, 1.0e-7]}
ground: {crs: geocentric, axes: [x, y, z], ellipsoid: {a: 1737400, b: 1737400}, center_deg: [20, -5]}
flight:
  photos: 8
  strips: 2
  end_lap_percent: 70
  side_lap_percent: 20
  flying_height: 5000
  heading_deg: 10
  alternate: yes
  photo_rotation_deg: 90
  attitude_sigma_deg: [0.5, 0.6, 0.7]
  position_sigma: [1, 2, 3]
terrain: {height: -20, relief: 30, wavelength: 4000, slope_percent: [1, -1]}
points: {rows: 5, reach_percent: 75, scatter_percent: 10, extra_per_model: 2}
control:
  layout: random
  bands: 4
  every: 3
  per_band: 2
  count: 6
  use: {xyz: 2, z: 1}
  check: 5
  sigma: [0.1, 0.2, 0.3]
  noise: [0, 0, 0]
image: {sigma_um: 1.5, unit: px, y_axis: down}
film: {scale_ppm: 1, shear_ppm: 2, irregular_um: 3, rotation_deg: 4, offset_mm: 5}
refraction: true
gross_errors:
  - {kind: image, count: 2, size_um: 50, photo: "1003", point: 0012, axis: y}
  - {kind: control, size_m: 3}
gnss: {sigma: [0.1, 0.1, 0.1], use: true}
models: {sigma_um: [5, 6, 7], center_sigma_um: [8, 9, 10], scale: 8000, axes: any, hand: left-handed, centers: false}
"""


def specification(folder: Path, text: str, *overrides: str) -> Specification:
    """Read a specification."""
    (file := folder / "spec.yaml").write_text(text, encoding="utf-8")
    return load_specification(file, overrides)


def messages(folder: Path, text: str, *overrides: str) -> list[str]:
    """What is said of a specification that is refused, without the folder."""
    with pytest.raises(InputError) as caught:
        specification(folder, text, *overrides).simulate()
    assert caught.value.exit_code == 2
    return [str(fault).removeprefix(f"{folder}/") for fault in caught.value.faults]


def test_every_key_reaches_its_field(tmp_path: Path) -> None:
    spec = specification(tmp_path, EVERYTHING).spec
    distortion = Distortion("brown", "ideal_to_image", (1e-8, 0.0, 0.0), (0.0, 1e-7))
    assert spec.camera.distortion == distortion
    assert spec.camera.fiducials == {"A": (25.0, 20.0), "B": (-25.0, 20.0), "C": (-25.0, -20.0)}
    assert (spec.camera.name, spec.camera.principal_distance, spec.camera.format) == ("007", 80.5, (60.0, 50.0))
    assert (spec.camera.principal_point, spec.camera.pixel_size) == ((0.1, -0.2), 0.005)
    assert spec.ground == Ground(
        "geocentric", ("x", "y", "z"), ellipsoid=(1737400.0, 1737400.0), center_deg=(20.0, -5.0)
    )
    assert spec.flight == Flight(8, 2, 70.0, 20.0, None, 5000.0, 10.0, True, 90.0, (0.5, 0.6, 0.7), (1.0, 2.0, 3.0))
    assert spec.terrain == Terrain(-20.0, 30.0, 4000.0, (1.0, -1.0))
    assert spec.points == Points(5, 75.0, 10.0, 2)
    assert spec.control == Control("random", 4, 3, 2, 6, {"xyz": 2.0, "z": 1.0}, 5, (0.1, 0.2, 0.3), (0.0, 0.0, 0.0))
    assert spec.image == Image(1.5, "px", "down")
    assert spec.film == Film(1.0, 2.0, 3.0, 4.0, 5.0)
    assert spec.gross_errors == (
        GrossError("image", 2, 50.0, 5.0, "1003", "0012", "y"),
        GrossError("control", size_m=3.0),
    )
    assert spec.gnss == Gnss((0.1, 0.1, 0.1), use=True)
    assert spec.models == Models((5.0, 6.0, 7.0), (8.0, 9.0, 10.0), 8000.0, "any", "left-handed", centers=False)
    assert (spec.name, spec.seed, spec.refraction) == ("all of it", 7, True)
    changed = [part.name for part in fields(Spec) if getattr(spec, part.name) == getattr(Spec(), part.name)]
    assert changed == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", {}),
        ("film:\ngnss: {}\ncamera: {preset: digital}\n", {"film": Film(), "gnss": Gnss(), "camera": DIGITAL}),
        ("control: {use: z}\n", {"control": Control(use={"z": 1.0})}),  # one word says how all control is given
    ],
)
def test_what_is_not_said_is_the_default(tmp_path: Path, text: str, expected: dict[str, Any]) -> None:
    assert specification(tmp_path, f"photostrip_simulation: 1\n{text}").spec == Spec(**expected)


def test_keys_can_be_set_and_files_extended(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text("photostrip_simulation: 1\nseed: 3\nflight: {photos: 7}\n", encoding="utf-8")
    read = specification(tmp_path, "extends: base.yaml\nflight: {strips: 2}\n", "seed=9", "image.sigma_um=0")
    assert (read.spec.seed, read.spec.flight.photos, read.spec.flight.strips) == (9, 7, 2)
    assert read.spec.image.sigma_um == 0.0
    assert [Path(file).name for file in read.reading.files] == ["spec.yaml", "base.yaml"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("fligth: {photos: 3}", "2:1: fligth: the key `fligth` is not known; did you mean `flight`?"),
        ("flight: {heading: 3}", "2:10: flight.heading: the key `heading` is not known; did you mean `heading_deg`?"),
        ("flight: {photos: 2.5}", "2:18: flight.photos: 2.5 is not a whole number; expected a whole number"),
        ("flight: 3", "2:9: flight: a single value is given here; expected a mapping (lines `key: value`)"),
        ("control: {sigma: [1, 2]}", "2:18: control.sigma: 2 values in the list; expected 3 values"),
        (
            "camera: {preset: fil}",
            "2:18: camera.preset: `fil` is no preset; expected one of film, digital; did you mean `film`?",
        ),
        (
            "gross_errors: [{count: 1}]",
            "2:16: gross_errors[0].kind: `kind` is missing; expected `image`, `control` or `swap`",
        ),
        ("refraction: perhaps", "2:13: refraction: `perhaps` is neither true nor false; expected true or false"),
        ("flight: {photos: 0}", "2:18: flight.photos: 0 photos cannot make a strip; expected two or more"),
        ("control: {use: {xz: 1}}", "2:21: control.use.xz: 'xz' is no set of coordinates; expected xyz | xy | z"),
        (
            "gross_errors:\n  - {kind: image, axis: z}",
            "3:25: gross_errors[0].axis: an error of kind image has no axis 'z'; expected x | y",
        ),
        (
            "ground: {height: orthometric}",
            "2:18: ground.height: EPSG:32633 with orthometric heights does not say how high",
        ),
        (
            "control: {second_crs: EPSG:0}",
            "2:23: control.second_crs: PROJ does not know the coordinate reference system 'EPSG:0'",
        ),
        (
            "ground: {center_deg: [106, 8]}",
            "2:22: ground.center_deg: strips around longitude, latitude 106, 8 cannot be given in EPSG:32633",
        ),
        (
            "control: {second_crs: EPSG:32634, boundary_longitude_deg: 3}",
            "2:59: control.boundary_longitude_deg: all given points lie east of the boundary at 3 degrees; put it",
        ),
        ("flight: {attitude_sigma_deg: [9, 9, 9], photos: 30}", "2:9: flight: no point lies on photos 1"),
    ],
)
def test_faults_have_their_place(text: str, told: str, tmp_path: Path) -> None:
    assert messages(tmp_path, f"photostrip_simulation: 1\n{text}\n")[0].startswith(f"spec.yaml:{told}")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("seed: 1\n", "1:1: photostrip_simulation: `photostrip_simulation` is missing; expected number of this schema"),
        ("photostrip_simulation: 2\n", "1:24: photostrip_simulation: this version of photostrip does not read"),
    ],
)
def test_the_number_of_the_schema_is_asked_for(tmp_path: Path, text: str, told: str) -> None:
    (message,) = messages(tmp_path, text)
    assert message.startswith(f"spec.yaml:{told}")


def test_all_faults_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    text = "photostrip_simulation: 1\nsed: 1\nflight: {photos: x}\nimage: {unit: inch}\n"
    assert [message.split(": ")[1] for message in messages(tmp_path, text)] == ["sed", "flight.photos", "image.unit"]


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_the_examples_can_be_simulated(file: Path) -> None:
    done = load_specification(file).simulate()
    assert len(done.observations) > 250
    assert len(done.control) > 15


def test_there_is_an_example_of_each_kind() -> None:
    names = [file.stem for file in EXAMPLES]
    assert names == ["digital-corridor", "film-strip", "gross-errors", "independent-models", "zone-boundary"]
