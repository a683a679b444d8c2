"""Written projects: read again they are the simulation, and they are the same bytes every time."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photostrip.camera import Distortion
from photostrip.foreign.simulated import project_files
from photostrip.formats.files import write_files
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.project.loading import Project, load_project
from photostrip.result.table import rows_of
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
    Simulation,
    Spec,
    simulate,
)
from tests.loops import nonempty
from tests.results import rotation
from tests.simulated import inputs_of, settings_of
from tests.source_tree import ROOT

NONE = (0.0, 0.0, 0.0)
FREE = Spec(image=Image(sigma_um=0.0), control=Control(noise=NONE))
TINY = Spec(
    name="tiny",
    seed=5,
    ground=Ground(crs="local"),
    flight=Flight(photos=3),
    points=Points(extra_per_model=1),
    control=Control(check=1),
    gnss=Gnss(),
    film=Film(),
    gross_errors=(GrossError("image", photo="1002", point="1001-4", axis="x"),),
)


def written(simulation: Simulation, folder: Path) -> Project:
    """Write a simulation and read the project."""
    write_files(folder, project_files(simulation))
    return load_project(folder / "project.yaml")


VARIANTS = {
    "film": FREE,
    "um, y down": replace(FREE, image=Image(sigma_um=0.0, unit="um", y_axis="down")),
    "pixels from the corner": replace(FREE, camera=DIGITAL, image=Image(sigma_um=0.0, unit="px", y_axis="down")),
    "pixels from the middle": replace(FREE, camera=DIGITAL, image=Image(sigma_um=0.0, unit="px", y_axis="up")),
    "scanned film": replace(
        FREE, camera=replace(FILM, pixel_size=0.014), film=Film(), image=Image(sigma_um=0.0, unit="px", y_axis="down")
    ),
    "comparator": replace(FREE, film=Film(irregular_um=2.0)),
    "distortion": replace(
        FREE,
        refraction=True,
        camera=replace(
            FILM,
            name='a: "b" # c',
            principal_point=(0.1, -0.2),
            distortion=Distortion("brown", "ideal_to_image", (1e-8, -1e-13, 0.0), (1e-7, 0.0)),
        ),
    ),
    "distortion table": replace(
        FREE,
        camera=replace(
            FILM,
            distortion=Distortion(
                "radial-table", "image_to_ideal", radius=(0.0, 60.0, 120.0, 170.0), distortion=(0.0, 0.01, -0.004, 0.02)
            ),
        ),
    ),
    "north first": replace(
        FREE,
        ground=Ground("EPSG:31468", ("north", "east", "up"), "orthometric", 44.0, center_deg=(12.0, 48.0)),
        control=Control(noise=NONE, sigma=(0.03, 0.05, 0.09)),
    ),
    "degrees": replace(FREE, ground=Ground("EPSG:4979", ("north", "east", "up"), center_deg=(-70.0, -33.0))),
    "feet": replace(FREE, ground=Ground("EPSG:2263", center_deg=(-74.0, 40.7))),
    "another body": replace(
        FREE,
        ground=Ground("geocentric", ("x", "y", "z"), ellipsoid=(1737400.0, 1737400.0), center_deg=(23.0, 10.0)),
        flight=Flight(flying_height=5_000.0),
    ),
    "flat": replace(FREE, ground=Ground("local")),
    "two zones": replace(
        FREE,
        ground=Ground("EPSG:32633", center_deg=(18.0, 49.0)),
        control=Control(noise=NONE, every=2, second_crs="EPSG:32634"),
    ),
    "partly given": replace(
        FREE,
        ground=Ground(axes=("up", "north", "east")),
        control=Control(noise=NONE, use={"xyz": 0.4, "xy": 0.3, "z": 0.3}),
    ),
    "strips": replace(FREE, flight=Flight(strips=3, photos=6, alternate=True)),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_written_project_is_the_simulation(name: str, tmp_path: Path) -> None:
    done = simulate(VARIANTS[name])
    project = written(done, tmp_path)
    wanted, found = inputs_of(done), project.inputs
    assert [(s.id, s.camera, s.photos) for s in found.strips] == [(s.id, s.camera, s.photos) for s in wanted.strips]
    for one, other in ((found.observations, wanted.observations), (found.fiducials, wanted.fiducials)):
        if other is None:
            assert one is None
            continue
        assert one is not None
        assert (one.photo_ids, one.point_ids) == (other.photo_ids, other.point_ids)
        assert np.array_equal(one.photo, other.photo)
        assert np.array_equal(one.point, other.point)
        assert np.abs(one.xy - other.xy).max() < 1e-9  # mm
        assert one.sigma == pytest.approx(other.sigma, rel=1e-5)
    order = [found.control.ids.index(point) for point in wanted.control.ids]
    control = found.control.take(order)
    assert len(found.control) == len(wanted.control)
    for column in ("use", "check", "frame"):
        assert np.array_equal(getattr(control, column), getattr(wanted.control, column))
    unit = 1e-5 if name == "degrees" else 1.0
    gap = np.abs(control.enu - wanted.control.enu) / (unit, unit, 1.0)
    assert np.nanmax(gap) < 1e-6
    assert np.array_equal(np.isnan(control.enu), np.isnan(wanted.control.enu))
    assert control.sigma == pytest.approx(wanted.control.sigma)
    assert found.frames == wanted.frames
    assert project.settings == settings_of(done)


@pytest.mark.parametrize("name", ["film", "degrees", "north first", "another body", "flat"])
def test_the_truth_is_written_in_full(name: str) -> None:
    done = simulate(replace(VARIANTS[name], gross_errors=(GrossError("swap"), GrossError("control", axis="x"))))
    truth: dict[str, Any] = json.loads(project_files(done)["truth.json"])
    axes = truth["frame"]["axes"]
    columns = [("x", "y", "z").index(axis) if axis in "xyz" else ("east", "north", "up").index(axis) for axis in axes]
    assert truth["frame"]["crs"] == done.spec.ground.crs
    assert truth["seed"] == 1
    tolerance = np.where(np.array(columns) < 2, 1e-11, 1e-6) if name == "degrees" else np.full(3, 1e-6)
    for block, ids, enu in (
        ("points", done.observations.point_ids, done.truth.ground.xyz),
        ("photos", done.observations.photo_ids, done.truth.centers_ground),
    ):
        assert truth[block]["id"] == list(ids)
        found = np.column_stack([truth[block][axis] for axis in "xyz"])
        assert (np.abs(found - enu[:, columns]) < tolerance).all()
    for photo, turn in nonempty(zip(rows_of(truth["photos"]), done.truth.rotations_local, strict=True)):
        assert rotation(photo) == pytest.approx(turn, abs=1e-11)
        angles = from_alpha_omega_kappa(*np.radians([photo[f"angle_{k}"] for k in (1, 2, 3)]))
        assert angles == pytest.approx(turn, abs=1e-11)
    roles = {each["id"]: each["role"] for each in rows_of(truth["points"]) if each["role"] != "new"}
    given = zip(done.control.ids, done.control.check, strict=True)
    assert roles == {point: "check" if check else "control" for point, check in given}
    swap, control = rows_of(truth["errors"])
    assert [key for key, value in swap.items() if value is not None] == ["kind", "photo", "point", "other"]
    assert axes["xyz".index(control["axis"])] in {"east", "x"}
    assert abs(control["size_m"]) == 5.0


@pytest.mark.slow
def test_the_same_specification_gives_the_same_bytes() -> None:
    """In two processes, with different orders of sets and dictionaries of texts."""
    code = "from tests.foreign.test_simulated import digests\nprint(*digests(), sep='\\n')"
    environment = {"PYTHONHASHSEED": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == digests()


def digests() -> list[str]:
    """Give the names and the digests of all files of some variants."""
    specs = TINY, *(VARIANTS[name] for name in ("comparator", "distortion", "two zones", "partly given", "strips"))
    files = [project_files(simulate(spec)) for spec in specs]
    return [f"{name} {hashlib.sha256(text.encode()).hexdigest()}" for each in files for name, text in each.items()]


def test_another_seed_gives_other_files() -> None:
    one, two = (project_files(simulate(replace(TINY, seed=seed))) for seed in (5, 6))
    assert {name for name in one if one[name] != two[name]} == set(one) - {"project.yaml"}


def test_positions_are_named_only_when_they_are_to_be_used() -> None:
    assert "gnss.csv" not in project_files(simulate(TINY))["project.yaml"]
    text = project_files(simulate(replace(TINY, gnss=Gnss(use=True))))["project.yaml"]
    assert (
        'camera_positions:\n  file: gnss.csv\n  crs: "local"\n  axes: [east, north, up]\n  sigma: [0.1, 0.1, 0.15]\n'
        in text
    )
