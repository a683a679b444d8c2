"""Simulated blocks as Metashape exports them: cameras and markers of a chunk, XML."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

import photostrip
from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.result.table import rows_of
from tests.foreign.colmap_models import K1, P1, P2, SPEC, F
from tests.results import rotation

UTM = (
    'PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84",DATUM["World Geodetic System 1984",SPHEROID["WGS 84",6378137,'
    '298.257223563,AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0],UNIT["degree",'
    '0.01745329251994328],AUTHORITY["EPSG","4326"]],PROJECTION["Transverse_Mercator"],AUTHORITY["EPSG","32633"]]'
)
TO_CHUNK = Rotation.from_rotvec([0.9, -0.4, 2.0])
SCALE = 12.35  # metres in a unit of the chunk
CY = 5500 / 3 + 5 - 3667 / 2  # the frame of the simulation is no whole number of pixels high
CALIBRATION = f"""\
        <calibration type="frame" class="initial"><f>3000</f></calibration>
        <calibration type="frame" class="adjusted">
          <resolution width="5500" height="3667"/>
          <f>{F!r}</f><cx>10</cx><cy>{CY!r}</cy><k1>{K1!r}</k1><p1>{P2!r}</p1><p2>{P1!r}</p2>
        </calibration>
        <covariance><params>f cx</params><coeffs>0.04 0 0 0.01</coeffs></covariance>"""


def label_of(photo: str) -> str:
    return f"flight {photo[0]}/Фото & {photo}"


def simulated(folder: Path, crs: str = "EPSG:32633", **changes: object) -> Document:
    """Write a simulated project into a folder, and give the truth."""
    simulation = photostrip.simulate({**SPEC, "ground": {"crs": crs}, **changes})
    simulation.write(folder)
    return simulation.truth


def cameras(truth: Document, to_earth: Floats, origin: Floats) -> list[str]:
    """Give the photos with true orientations; `to_earth` turns ground axes (n, 3, 3), `origin` has the centres."""
    lines = []
    for number, (photo, axes, center) in enumerate(zip(rows_of(truth["photos"]), to_earth, origin, strict=True)):
        upright = axes @ rotation(photo) * (1.0, -1.0, -1.0)
        matrix = np.eye(4)
        matrix[:3, :3] = TO_CHUNK.inv().as_matrix() @ upright
        matrix[:3, 3] = TO_CHUNK.inv().apply((center - origin.mean(axis=0)) / SCALE)
        label = quoteattr(label_of(photo["id"]))
        lines += [
            f'      <camera id="{40 + number}" sensor_id="7" component_id="0" label={label}>',
            f"        <transform>{' '.join(map(repr, matrix.ravel().tolist()))}</transform>",
            "        <location_covariance>4e-6 0 0 0 4e-6 0 0 0 4e-6</location_covariance>",
            "      </camera>",
        ]
    return lines


def markers(native: Path, truth: Document) -> tuple[list[str], list[str]]:
    """Give the control of a native project and its marks."""
    cameras_of = {photo["id"]: 40 + number for number, photo in enumerate(rows_of(truth["photos"]))}
    with (native / "observations.csv").open(encoding="utf-8") as file:
        rays = [row for row in csv.DictReader(file) if row["point"][0] in "GK"]
    with (native / "control.csv").open(encoding="utf-8") as file:
        control = list(csv.DictReader(file))
    lines, marks = [], []
    for number, row in enumerate(control):
        enabled = "false" if row["role"] == "check" else "true"
        place = f'x="{row["x"]}" y="{row["y"]}" z="{row["z"]}" sx="0.01" sy="0.01" sz="0.015" enabled="{enabled}"'
        lines.append(f'      <marker id="{number}" label="{row["point"]}"><reference {place}/></marker>')
        own = [ray for ray in rays if ray["point"] == row["point"]]
        marks.append(f'          <marker marker_id="{number}">')
        for ray in own:
            place = f'x="{ray["x"]}" y="{ray["y"]}"'
            marks.append(f'            <location camera_id="{cameras_of[ray["photo"]]}" pinned="true" {place}/>')
        marks.append("          </marker>")
    return lines, marks


def document(photos: list[str], points: tuple[list[str], list[str]], reference: str, origin: Floats) -> str:
    transform = (
        f"<rotation locked='true'>{' '.join(map(repr, TO_CHUNK.as_matrix().ravel().tolist()))}</rotation>"
        f"<translation>{' '.join(map(repr, origin.mean(axis=0).tolist()))}</translation><scale>{SCALE}</scale>"
    )
    return "\n".join([
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<document version="2.0.0">',
        '  <chunk label="Chunk 1" enabled="true">',
        '    <sensors next_id="8">',
        '      <sensor id="7" label="FC6310" type="frame">',
        '        <resolution width="5500" height="3667"/>',
        '        <property name="pixel_width" value="0.0024"/>',
        CALIBRATION,
        "      </sensor>",
        "    </sensors>",
        '    <components next_id="1" active_id="0">',
        f'      <component id="0" label="Component 1"><transform>{transform}</transform></component>',
        "    </components>",
        '    <cameras next_id="99" next_group_id="1">',
        '     <group id="0" label="Group 1" type="folder">',
        *photos,
        "     </group>",
        '      <camera id="98" sensor_id="7" label="not aligned"><orientation>1</orientation></camera>',
        "    </cameras>",
        '    <markers next_id="9">',
        *points[0],
        "    </markers>",
        '    <frames next_id="1">',
        '      <frame id="0">',
        "        <markers>",
        *points[1],
        "        </markers>",
        "      </frame>",
        "    </frames>",
        f"    <reference>{reference}</reference>",
        '    <settings><property name="accuracy_markers" value="0.02"/></settings>',
        "  </chunk>",
        "</document>",
        "",
    ])  # fmt: skip
