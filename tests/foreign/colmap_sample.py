"""The block of sample_data/colmap-quarry: a simulated flight as COLMAP leaves it, with a table of control and marks.

``python -m tests.foreign.colmap_sample`` writes it anew; the last digits of the model are those of the machine.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import photostrip
from photostrip.result.table import rows_of
from tests.foreign.colmap_models import SCALE, SPEC, TO_MODEL, Model, posed
from tests.source_tree import ROOT

FOLDER = ROOT / "sample_data" / "colmap-quarry"
PIXEL = 0.0024
WIDTH, HEIGHT = 5472, 3648
F = 8.8 / PIXEL
K1 = -2e-4 * 8.8**2
CAMERA = {
    "principal_point": [0, 0],
    "format": [WIDTH * PIXEL, HEIGHT * PIXEL],
    "distortion": {"model": "brown", "k": [-2e-4, 0, 0], "direction": "ideal_to_image"},
}
FOUND = [round(F + 9.0, 4), WIDTH / 2, HEIGHT / 2, round(K1 + 2e-4, 6)]  # a little off, as without control
WRONG = "Q03", "DJI_0007.JPG", 12.0  # a mark beside its point, in x, pixels


def write(folder: Path) -> None:
    """Write model and control table into a folder."""
    made = photostrip.simulate(
        SPEC,
        seed=11,
        camera={**SPEC["camera"], **CAMERA},  # type: ignore[dict-item]
        flight={"photos": 5, "strips": 3, "flying_height": 100, "end_lap_percent": 80, "side_lap_percent": 60},
        control={"layout": "random", "count": 2, "sigma": [0.01, 0.01, 0.015], "check": 30},
        points={"extra_per_model": 20},
        ground={"crs": "EPSG:32633"},
    )
    rows = [line.split(",") for line in made.files["observations.csv"].splitlines()[1:]]
    photos = rows_of(made.truth["photos"])
    names = {photo["id"]: f"DJI_{number:04}.JPG" for number, photo in enumerate(photos, 1)}
    middle = np.mean([[photo[axis] for axis in "xyz"] for photo in photos], axis=0)
    images = [
        (number, q.round(8), shift.round(6), 1, names[photo], xy.round(2), points)
        for number, (photo, q, shift, xy, points) in enumerate(
            posed(made, lambda place: TO_MODEL.apply(SCALE * (place - middle)), lambda count: count + 1), 1
        )
    ]
    model = Model({1: ("SIMPLE_RADIAL", WIDTH, HEIGHT, FOUND)}, images)
    model.write_text(folder / "sparse" / "0")
    given = [line.split(",") for line in made.files["control.csv"].splitlines()[1:]]
    titles = {row[0]: f"Q{number:02}" for number, row in enumerate(given, 1)}
    lines = ["gcp_label,image_file_name,x,y,x_map,y_map,elev"]
    for point, *place in ([row[0], *row[1:4]] for row in given):
        for row in (row for row in rows if row[1] == point):
            beside = WRONG[2] if (titles[point], names[row[0]]) == WRONG[:2] else 0.0
            x, y = float(row[2]) + beside, float(row[3])
            lines.append(",".join([titles[point], names[row[0]], f"{x:.1f}", f"{y:.1f}", *place]))
    (folder / "gcp.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write(FOLDER)
