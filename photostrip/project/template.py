"""The first files of a new project: a commented project file and the headers of its tables."""

from __future__ import annotations

import json
from pathlib import Path

from photostrip.errors import Fault, InputError

PROJECT = """\
# A project of photostrip. Fill in what is empty, then:
#   photostrip check project.yaml       names everything that is missing or wrong
#   photostrip run project.yaml -o result
# Every key, with its unit and default: `photostrip schema`, and docs/files/project.md.
# Ids (photos, points, strips, cameras) are text, whatever they look like: 0123 stays 0123.
photostrip: 1                       # number of the schema
name: {name}

cameras:
  camera-1:                         # any name; the strips refer to it
    principal_distance:             # mm, from the calibration certificate
    principal_point: [0, 0]         # mm, in the system of the fiducial marks; for digital cameras from the centre
    # format: [230, 230]            # mm, width and height of the photo; needed for pixels
    # pixel_size: 0.004             # mm; needed for pixels without calibrated fiducial marks
    # Calibrated fiducial marks, mm, by mark; with fiducial_measurements below:
    # fiducials: {{F1: [106, -106], F2: [-106, -106], F3: [-106, 106], F4: [106, 106]}}
    # Lens distortion; `direction` says which coordinates the formula starts from:
    # distortion: {{model: brown, k: [0, 0, 0], p: [0, 0], direction: image_to_ideal}}
    # distortion: {{model: radial-table, radius: [0, 50, 100], distortion: [0, 0, 0], direction: image_to_ideal}}

strips:
  - id: A
    camera: camera-1
    photos: []                      # ids in flight order, as in observations.csv: [1001, 1002, 1003]
# photos: {{camera: camera-1}}        # in place of strips: all measured photos, in no given order

observations:                       # points measured on photos
  file: observations.csv            # photo,point,x,y and, where rows differ, sx,sy
  unit: mm                          # mm | um | px
  y_axis: up                        # up | down; x grows to the right
  sigma:                            # standard deviation of an image coordinate, in `unit`

# fiducial_measurements:            # comparator or pixel coordinates of the fiducial marks
#   file: fiducials.csv             # photo,mark,x,y

control:                            # one list for each ground frame
  - file: control.csv               # point,x,y,z and, where wanted, use,role,sx,sy,sz
    crs:                            # "EPSG:32633" | a PROJ string | geocentric | local (right-handed, metres)
    axes: [east, north, up]         # what x, y, z of the table are; [north, east, up] where X points north
    height: ellipsoidal             # ellipsoidal | orthometric (then geoid_undulation: metres, or a vertical CRS)
    sigma:                          # metres, in the order of axes: [0.05, 0.05, 0.08]

output:
  angles: {{system: alpha-omega-kappa, unit: deg}} # or omega-phi-kappa, phi-omega-kappa; gon, rad

# What follows has defaults that suit most strips.
# processing:
#   adjustment: auto                # auto | polynomial | similarity | bundle
#   polynomial: {{degree: auto}}      # auto | 1 | 2 | 3
#   earth_curvature: auto           # auto | model | none
#   refraction: false
# tolerances: {{check_rms_xy: 0.40, check_rms_z: 0.60}}     # metres; exceeded: exit code 1
#
# Model coordinates measured on a plotter stand in place of cameras and observations (docs/independent-models.md):
# models:
#   file: models.csv                # model,point,x,y,z; a point with the id of a photo is its perspective centre
#   unit: mm                        # mm | um | m
#   sigma: [0.010, 0.010, 0.015]    # standard deviations of x, y, z, in `unit`
"""
OBSERVATIONS = "photo,point,x,y\n"
CONTROL = "point,x,y,z,use,role\n"
FIDUCIALS = "photo,mark,x,y\n"


def template_files(name: str) -> dict[str, str]:
    """Return the files of a new project; ``photostrip check`` names what is to be filled in, and nothing else."""
    quoted = json.dumps(name)  # YAML reads it as the same text, whatever it is
    return {
        "observations.csv": OBSERVATIONS,
        "control.csv": CONTROL,
        "fiducials.csv": FIDUCIALS,
        "project.yaml": PROJECT.format(name=quoted),
    }


def refuse_existing(folder: Path, names: list[str], fix: str = "choose another folder, or remove it") -> None:
    """Refuse to overwrite what a user may have written."""
    there = [folder / name for name in names if (folder / name).exists() or (folder / name).is_symlink()]
    if there:
        raise InputError(Fault("already exists and is not overwritten", "exists", str(path), fix=fix) for path in there)
