"""Terrestrial projects on disk: written here line by line, so that each line can be made wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tests.terrestrial.simulated import CENTERS, World, turned, world

if TYPE_CHECKING:
    from pathlib import Path

PROJECT = """\
photostrip_terrestrial: 1
name: quarry
cameras:
  long: {principal_distance: 190.0, format: [160, 120]}
  wide: {preset: UMK 10/1318}
axes: [east, north, up]
stations:
  left: {camera: long, position: [1000.0, 2000.0, 150.0], alpha: LA, omega: LO, kappa: LK}
  right: {camera: wide, position: [1040.0, 2005.0, 152.0], alpha: RA, omega: RO, kappa: RK}
epochs: [{id: epoch 0, time: 0}, {id: epoch 1, time: 1}, {id: epoch 2, time: 2}]
measurements: {coordinates: coordinates.csv, unit: mm, sigma: 0.005}
stable: [P0, P1, P2, P3, P4, P5]
"""
TRUTH = turned(replace(world(number=12, moving=4, size=0.05), epochs=3), 60.0, -30.0, 45.0)


def project(unit: str = "deg") -> str:
    """Give the text of the project of ``TRUTH``."""
    per_radian = 180 / np.pi if unit == "deg" else 200 / np.pi
    text = PROJECT
    for letter, angles in zip("LR", TRUTH.attitudes, strict=True):
        for name, angle in zip("AOK", angles, strict=True):
            text = text.replace(f" {letter}{name}", f" {angle * per_radian:.12f}")
    return text


def coordinates(truth: World = TRUTH, seed: int = 1, sigma: float = 0.005, decimals: int = 4) -> str:
    """Give the table of image coordinates of a survey."""
    series = truth.measure(seed, sigma)
    lines = ["epoch,photo,point,x,z"]
    for number, epoch in enumerate(series.epochs):
        for row, point in enumerate(series.points):
            xl, zl, xr, zr = series.coordinates[number, row]
            lines.append(f"{epoch},left,{point},{xl:.{decimals}f},{zl:.{decimals}f}")
            lines.append(f"{epoch},right,{point},{xr:.{decimals}f},{zr:.{decimals}f}")
    return "\n".join(lines) + "\n"


def pseudo_parallaxes(truth: World = TRUTH, seed: int = 1, sigma: float = 0.005, decimals: int = 9) -> str:
    """Give the table of pseudo-parallaxes of a survey."""
    series = truth.measure(seed, sigma)
    first = series.coordinates[0]
    lines = ["point,epoch,x,z,p,q,dx,dz,dx_right,dz_right"]
    for number, epoch in enumerate(series.epochs[1:], 1):
        for row, point in enumerate(series.points):
            xl, zl, xr, zr = first[row]
            values = (xl, zl, xl - xr, zl - zr, *(series.coordinates[number, row] - first[row]))
            lines.append(f"{point},{epoch}," + ",".join(f"{value:.{decimals}f}" for value in values))
    return "\n".join(lines) + "\n"


def write(folder: Path, text: str | None = None, table: str | None = None, name: str = "coordinates.csv") -> Path:
    """Write a project with its table."""
    (folder / name).write_text(coordinates() if table is None else table, encoding="utf-8")
    path = folder / "survey.yaml"
    path.write_text(project() if text is None else text, encoding="utf-8")
    return path


__all__ = ["CENTERS", "TRUTH", "coordinates", "project", "pseudo_parallaxes", "write"]
