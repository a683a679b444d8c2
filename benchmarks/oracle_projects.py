"""The projects of the oracle: specifications with their seeds, made anew in a temporary folder each time.

Nothing here knows the inside of the program: projects are simulated by ``photostrip.simulate`` and changed by keys of
the project file; rings and crossing strips, which it does not simulate, are photographed here.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported

import numpy as np  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402

import photostrip  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]

Document = dict[str, Any]
Spec = Mapping[str, Any]
Edit = Callable[[Path, Document], None]

BUNDLE = ("bundle",)
CLASSICAL = ("polynomial", "similarity")
EVERY = ("bundle", "auto", "polynomial", "similarity")


@dataclass(frozen=True)
class Project:
    """One project of the oracle, and the ways in which it is adjusted.

    Parameters
    ----------
    name : str
        Its name.
    methods : tuple of str
        Values of ``processing.adjustment``.
    spec : dict, optional
        What ``photostrip.simulate`` makes it from; a project without one is made by ``write``.
    keys : dict
        Keys of the project file with other values than the simulation gives them.
    edit : callable, optional
        What is changed in its folder beside that; it is given the truth.
    write : callable, optional
        Writes the project into a folder and returns the project file; in place of ``spec``.
    quick : bool
        Whether it is one of the few that take half a minute together.
    """

    name: str
    methods: tuple[str, ...]
    spec: Spec | None = None
    keys: Mapping[str, Any] = field(default_factory=dict)
    edit: Edit | None = None
    write: Callable[[Path], Path] | None = None
    quick: bool = False

    def made(self, folder: Path) -> tuple[Path, Document | None]:
        """Write it into a folder: its project file, and the truth where there is one."""
        if self.write is not None:
            return self.write(folder), None
        simulation = photostrip.simulate(self.spec or {})
        simulation.write(folder)
        truth = simulation.truth
        if self.edit is not None:
            self.edit(folder, truth)
        return folder / "project.yaml", truth


# ---------------------------------------------------------------------------------------------------- 40 strips

SHORT = (6, 6, 7, 7, 8, 8, 9, 10, 10, 11, 12, 12, 13, 14, 15, 16, 16, 18, 20, 20)
SIZES = (*SHORT, 22, 22, 24, 25, 26, 28, 30, 30, 35, 35, 40, 45, 50, 60, 60, 80, 100, 150, 200, 300)
LAPS = (60.0, 62.0, 66.0, 70.0, 80.0)
PARTLY: Spec = {"xyz": 0.5, "xy": 0.25, "z": 0.25}
CONTROLS: tuple[Spec, ...] = (
    {"bands": 3, "per_band": 3},
    {"every": 5, "per_band": 2, "sigma": [0.03, 0.03, 0.05]},
    {"layout": "corners+centre"},
    {"layout": "random", "count": 12, "use": PARTLY},
    {"bands": 4, "per_band": 3, "sigma": [0.02, 0.02, 0.02]},
    {"bands": 2, "per_band": 3},
    {"every": 4, "per_band": 3, "check": 25},
)
OF_LONG: Spec = {"every": 12, "per_band": 3}
SEED = 1200
LONG = 45  # photos from which a strip has control every so often
LENS: Spec = {"preset": "digital", "distortion": {"model": "brown", "direction": "image_to_ideal", "k": [2e-7, 0, 0]}}
CAMERAS: tuple[Spec, ...] = ({"preset": "film"}, {"preset": "digital"}, LENS)
GROUNDS: tuple[Spec, ...] = (
    {"crs": "EPSG:32633"},
    {"crs": "local"},
    {"crs": "geocentric", "axes": ["x", "y", "z"]},
)
WRONG_IMAGES = (40.0, 150.0, 600.0)  # micrometres


def strip(number: int) -> Project:
    """Give strip 0 to 39: every second one has gross errors; the rest changes by periods that share no factor."""
    photos, spoiled = SIZES[number], number % 2 == 1
    camera = CAMERAS[number % 3]
    errors: list[Document] = []
    if spoiled:
        share = max(1, photos // 6)
        errors = [{"kind": "image", "count": share, "size_um": size} for size in WRONG_IMAGES]
        errors += [{"kind": "control", "size_m": 5.0}] if number % 4 == 3 else []
        errors += [{"kind": "swap"}] if number % 8 == 1 else []
    ground = GROUNDS[number // 3 % 3]
    control = OF_LONG if photos >= LONG else CONTROLS[number % 7]
    if ground["crs"] == "geocentric":
        control = {**control, "use": {"xyz": 1.0}}  # no part of a geocentric point can count
    spec = {
        "name": f"strip-{number:02d}",
        "seed": SEED + number,
        "camera": camera,
        "ground": ground,
        "flight": {"photos": photos, "end_lap_percent": LAPS[number % 5], "heading_deg": 37.0 * number % 360.0},
        "terrain": {"relief": (60.0, 0.0, 150.0, 20.0)[number % 4]},
        "points": {"rows": 5 if number % 3 == 1 else 3, "extra_per_model": (4, 8, 2)[number // 2 % 3]},
        "control": control,
        "gross_errors": errors,
    }
    if camera["preset"] == "film" and number % 4 in {0, 3}:
        spec["film"] = {}
    if number % 6 == 0 and number // 3 % 3 != 1:
        spec["refraction"] = True
    methods: tuple[str, ...] = ("bundle", "auto", "polynomial")
    if number % 4 in {0, 1}:
        methods = EVERY
    return Project(f"strip-{number:02d}", methods, spec, quick=number in {0, 3, 7, 18})


# ------------------------------------------------------------------------------------------- samples and blocks


def sample(name: str, keys: Mapping[str, Any] | None = None, title: str = "") -> Project:
    return Project(
        f"sample-{title or name}", EVERY, keys=keys or {}, write=lambda _: ROOT / "sample_data" / name / "project.yaml"
    )


def block(
    name: str,
    flight: Spec,
    *,
    methods: tuple[str, ...] = BUNDLE,
    keys: Mapping[str, Any] | None = None,
    edit: Edit | None = None,
    quick: bool = False,
    **spec: Any,  # noqa: ANN401 (values of a specification)
) -> Project:
    whole = {"name": name, "flight": flight, "control": {"bands": 3, "per_band": 3}, **spec}
    return Project(name, methods, whole, keys or {}, edit, quick=quick)


WRONG: list[Document] = [{"kind": "image", "count": 6, "size_um": size} for size in WRONG_IMAGES]
LEVER = (0.11, -0.05, 1.24)  # metres, along the image axes
PLACES = (0.10, 0.10, 0.15)  # standard deviations of camera positions, metres
TURNS = (0.003, 0.003, 0.008)  # of angles, degrees


def cameras_of(
    seed: int,
    *,
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0),
    wrong: tuple[int, ...] = (),
) -> Edit:
    """Write ``cameras.csv``: positions with errors that a strip shares, and angles.

    lever: antenna along the image axes; offset, drift: of the first strip, the others have it turned round; metres, and
    metres for each photo; wrong: photos, by number, whose position is 8 m off.
    """

    def write(folder: Path, truth: Document) -> None:
        rng, photos = np.random.default_rng(seed), truth["photos"]
        strips = sorted({photo["strip"] for photo in photos})
        first = {name: min(n for n, photo in enumerate(photos) if photo["strip"] == name) for name in strips}
        rows = []
        for number, photo in enumerate(photos):
            place = np.array([photo["x"], photo["y"], photo["z"]])
            place += np.array(photo["rotation"]).reshape(3, 3) @ np.array(lever)
            along = number - first[photo["strip"]]
            sign = 1.0 if photo["strip"] == strips[0] else -1.0
            place += sign * (np.array(offset) + along * np.array(drift)) + rng.normal(0.0, PLACES)
            place += np.array([8.0, 0.0, 0.0]) if number in wrong else 0.0
            angles = np.array(photo["angles"]["values"]) + rng.normal(0.0, TURNS)
            row = [photo["id"], *(f"{value:.4f}" for value in place), *(f"{value:.6f}" for value in angles)]
            rows.append([*row, f"{100.0 + 4.5 * along:.2f}"])
        head = ["photo", "x", "y", "z", "alpha", "omega", "kappa", "time"]
        with (folder / "cameras.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([head, *rows])

    return write


FRAME: Spec = {"file": "cameras.csv", "crs": "EPSG:32633", "axes": ["east", "north", "up"], "sigma": list(PLACES)}
OBSERVED: Spec = {**FRAME, "role": "observed", "sigma_angles": list(TURNS)}
APPROXIMATE: Spec = {key: FRAME[key] for key in ("file", "crs", "axes")} | {"role": "approximate"}


def singly(photos: int) -> list[Document]:
    """Return the strips of a project whose photos are a strip each."""
    return [{"id": f"S{n}", "camera": "film", "photos": [f"{1001 + n}"]} for n in range(photos)]


def bundle_keys(**keys: Any) -> Document:  # noqa: ANN401 (values of a project file)
    return {"processing": {"bundle": keys}}


def blocks() -> list[Project]:
    """Give blocks of strips, and what ties photos to the ground but control."""
    two = {"photos": 8, "strips": 2}
    three = {"photos": 7, "strips": 3, "side_lap_percent": 25.0, "alternate": True}
    long = {"photos": 16}
    corners = {"layout": "corners"}
    dense = {"bands": 8, "per_band": 3}
    several = ("bundle", "auto", "polynomial")
    return [
        block("block-2x8", two, methods=several, seed=2001, quick=True),
        block("block-3x7", three, methods=several, seed=2002, gross_errors=WRONG),
        block("block-4x12", {"photos": 12, "strips": 4}, seed=2003, control=corners),
        block("block-5x10-wide", {"photos": 10, "strips": 5, "side_lap_percent": 60.0}, seed=2004),
        block("block-10x6-wide", {"photos": 6, "strips": 10, "side_lap_percent": 30.0}, seed=2005, gross_errors=WRONG),
        block("long-laps-90", {"photos": 40, "end_lap_percent": 90.0}, seed=2006, control={"bands": 4}),
        block(
            "block-two-lists",
            {"photos": 8, "strips": 2},
            methods=several,
            seed=2007,
            ground={"center_deg": [18.0, 49.2]},
            control={"every": 2, "second_crs": "EPSG:32634"},
        ),
        # camera positions
        block("gnss", two, seed=2101, control=corners, gnss={"use": True}, quick=True),
        block("gnss-alone", three, seed=2102, gnss={"use": True}, keys={"control": []}),
        block(
            "gnss-lever-offset",
            two,
            seed=2103,
            edit=cameras_of(1, lever=LEVER, offset=(0.8, -0.5, 1.1)),
            keys={"camera_positions": {**FRAME, "lever_arm": list(LEVER), "correction": "offset"}},
        ),
        block(
            "gnss-drift",
            long,
            seed=2104,
            edit=cameras_of(2, offset=(0.8, -0.5, 1.1), drift=(0.05, 0.02, -0.04)),
            keys={"camera_positions": {**FRAME, "correction": "drift"}},
        ),
        block(
            "gnss-block-offset",
            three,
            seed=2105,
            gross_errors=WRONG,
            edit=cameras_of(3, offset=(0.0, 0.0, 0.0), wrong=(5,)),
            keys={"camera_positions": {**FRAME, "correction": "offset", "group": "block"}},
        ),
        block(
            "gnss-unsaid-offset", two, seed=2106, edit=cameras_of(4, offset=(0, 0, 4)), keys={"camera_positions": FRAME}
        ),
        # attitudes
        block("attitudes", two, seed=2201, edit=cameras_of(5), keys={"orientations": OBSERVED}, quick=True),
        block("attitudes-alone", long, seed=2202, edit=cameras_of(6), keys={"orientations": OBSERVED, "control": []}),
        block("attitudes-start", two, seed=2203, edit=cameras_of(7), keys={"orientations": APPROXIMATE, "control": []}),
        # photos alone
        block("single-photos", {"photos": 8}, seed=2301, control=dense, keys={"strips": singly(8)}, quick=True),
        block(
            "single-photos-start",
            {"photos": 8},
            seed=2302,
            control={"bands": 3},
            edit=cameras_of(8),
            keys={"strips": singly(8), "orientations": APPROXIMATE},
            gross_errors=WRONG[:1],
        ),
        # no datum
        block("free-strip", {"photos": 10}, seed=2401, keys={"control": []}, quick=True),
        block("free-block", three, seed=2402, keys={"control": []}, gross_errors=WRONG),
        block("free-pair", {"photos": 2}, seed=2403, control={"bands": 2}, keys={"control": []}),
        # calibration
        block(
            "calibration",
            {"photos": 10, "strips": 2},
            seed=2501,
            terrain={"relief": 150.0},
            camera={
                "preset": "digital",
                "distortion": {"model": "brown", "direction": "image_to_ideal", "k": [4e-7, 0, 0]},
            },
            keys={
                "cameras": {"digital": {"principal_distance": 100.52, "distortion": {"k": [0, 0, 0]}}},
                "processing": {"self_calibration": ["principal_distance", "principal_point", "k1", "k2", "p1", "p2"]},
            },
            quick=True,
        ),
        block(
            "calibration-gnss",
            three,
            seed=2502,
            gnss={"use": True},
            keys={
                "camera_positions": {"correction": "offset"},
                "processing": {
                    "self_calibration": ["principal_distance", "k1", "affinity", "shear"],
                    "bundle": {"calibration_sigma": {"principal_distance": 0.02}},
                },
            },
        ),
        # standard deviations, tests
        block(
            "components",
            {"photos": 12, "strips": 3},
            seed=2601,
            control={"bands": 4, "noise": [0.12, 0.12, 0.2]},
            gnss={"use": True},
            gross_errors=WRONG,
            keys=bundle_keys(variance_components=True),
        ),
        block(
            "components-strip",
            {"photos": 20},
            seed=2602,
            control={"every": 3},
            keys=bundle_keys(variance_components=True),
        ),
        block("robust", {"photos": 20}, seed=2603, gross_errors=WRONG, keys=bundle_keys(screening="robust")),
        block("baarda", {"photos": 20}, seed=2604, gross_errors=WRONG, keys=bundle_keys(test="baarda", alpha=0.001)),
        block("unscreened", {"photos": 12}, seed=2605, gross_errors=WRONG[:1], keys=bundle_keys(screening="none")),
        block(
            "left-out-in-turn",
            {"photos": 12},
            seed=2606,
            methods=("bundle", "polynomial"),
            keys={"processing": {"cross_validation": True}},
        ),
        Project("ring", BUNDLE, write=ring),
        Project("crossing", BUNDLE, write=crossing),
    ]


def models() -> list[Project]:
    """Give strips of independent models."""
    some: list[tuple[str, Spec, Spec, list[Document]]] = [
        ("models-6", {"photos": 7}, {}, []),
        ("models-12-any", {"photos": 13}, {"axes": "any", "hand": "left-handed"}, []),
        ("models-20-wrong", {"photos": 21}, {}, [{"kind": "control", "size_m": 5.0}]),
        ("models-10-without-centres", {"photos": 11}, {"centers": False}, []),
        ("models-3x6", {"photos": 7, "strips": 3}, {}, []),
    ]
    return [
        Project(
            name,
            CLASSICAL,
            {"name": name, "seed": 2700 + n, "flight": flight, "models": given, "gross_errors": wrong},
            edit=spoiled_models if wrong else None,
            quick=n == 0,
        )
        for n, (name, flight, given, wrong) in enumerate(some)
    ]


def spoiled_models(folder: Path, _: Document) -> None:
    """Move every 40th row of the models by 0.2 to 2 mm along an axis."""
    rng, place = np.random.default_rng(11), folder / "models.csv"
    with place.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    for row in rows[7::40]:
        axis = 2 + int(rng.integers(3))
        row[axis] = f"{float(row[axis]) + rng.uniform(0.2, 2.0):.4f}"
    with place.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])


# -------------------------------------------------------------------------------------- photographed without simulate

FOCAL, SIDE, HEIGHT = 153.0, 230.0, 1530.0  # mm, mm, metres above the ground
SIGMA = 0.005  # mm


def ring(folder: Path) -> Path:
    """Photos on a circle whose last ones show what the first ones show: no order makes the band narrow."""
    photos, radius = 30, 4500.0
    turn = 2 * np.pi * np.arange(photos) / photos
    centers = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(photos, HEIGHT)])
    return photographed(folder, {"A": (centers, turn + np.pi / 2)}, np.random.default_rng(21))


def crossing(folder: Path) -> Path:
    """Three parallel strips, and two across them that have no control of their own."""
    base, apart = 0.4 * SIDE * HEIGHT / FOCAL, 0.75 * SIDE * HEIGHT / FOCAL
    strips = {}
    for n in range(3):
        centers = np.column_stack([base * np.arange(10), np.full(10, apart * n), np.full(10, HEIGHT)])
        strips["ABC"[n]] = (centers, np.zeros(10))
    for n, x in enumerate((2 * base, 7 * base)):
        centers = np.column_stack([np.full(7, x), base * np.arange(7) - base / 2, np.full(7, HEIGHT)])
        strips["XY"[n]] = (centers, np.full(7, np.pi / 2))
    return photographed(folder, strips, np.random.default_rng(22))


def photographed(folder: Path, strips: Mapping[str, tuple[Floats, Floats]], rng: np.random.Generator) -> Path:
    """Photograph ground with points at random, and write the project; control are points near the ends of a grid.

    strips: perspective centres and kappa of each.
    """
    centers = np.concatenate([each for each, _ in strips.values()]) + rng.normal(0.0, 8.0, (sum_of(strips), 3))
    kappa = np.concatenate([each for _, each in strips.values()])
    angles = np.column_stack([kappa, rng.normal(0.0, 0.02, (len(kappa), 2))])
    rotations = Rotation.from_euler("ZYX", angles).as_matrix()
    reach = 0.5 * SIDE * HEIGHT / FOCAL
    low, high = centers[:, :2].min(axis=0) - reach, centers[:, :2].max(axis=0) + reach
    count = int(np.prod((high - low) / reach) * 24)
    plan = rng.uniform(low, high, (count, 2))
    ground = np.column_stack([plan, 40.0 * np.sin(plan[:, 0] / 900.0) + 30.0 * np.cos(plan[:, 1] / 700.0)])
    names = [f"{100 * n + k + 1}" for n, (each, _) in enumerate(strips.values(), 1) for k in range(len(each))]
    images, seen = [], np.zeros(count, int)
    for name, center, rotation in zip(names, centers, rotations, strict=True):
        ray = (ground - center) @ rotation
        xy = -FOCAL * ray[:, :2] / ray[:, 2:]
        inside = np.flatnonzero((np.abs(xy) < 0.47 * SIDE).all(axis=1))
        seen[inside] += 1
        measured = xy[inside] + rng.normal(0.0, SIGMA, (len(inside), 2))
        images += [(name, at, x, y) for at, (x, y) in zip(inside.tolist(), measured.tolist(), strict=True)]
    rows = [[name, f"P{at:04d}", f"{x:.4f}", f"{y:.4f}"] for name, at, x, y in images if seen[at] > 1]
    shown = np.flatnonzero(seen > 2)
    corners = np.array([[x, y] for x in (0.02, 0.5, 0.98) for y in (0.02, 0.5, 0.98)]) * (high - low) + low
    control = sorted({int(shown[np.argmin(((plan[shown] - at) ** 2).sum(axis=1))]) for at in corners})
    given = [[f"P{at:04d}", *(f"{v:.4f}" for v in ground[at] + rng.normal(0.0, 0.05, 3)), "control"] for at in control]
    checks = [at for at in shown.tolist() if at not in control][:: max(1, len(shown) // 20)]
    given += [[f"P{at:04d}", *(f"{v:.4f}" for v in ground[at] + rng.normal(0.0, 0.05, 3)), "check"] for at in checks]
    for table, head, body in (
        ("observations.csv", ["photo", "point", "x", "y"], rows),
        ("control.csv", ["point", "x", "y", "z", "role"], given),
    ):
        with (folder / table).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([head, *body])
    ends = np.cumsum([0, *(len(each) for each, _ in strips.values())])
    project = {
        "photostrip": 1,
        "name": "photographed",
        "cameras": {"film": {"principal_distance": FOCAL, "format": [SIDE, SIDE]}},
        "strips": [
            {"id": name, "camera": "film", "photos": names[ends[n] : ends[n + 1]]} for n, name in enumerate(strips)
        ],
        "observations": {"file": "observations.csv", "unit": "mm", "y_axis": "up", "sigma": SIGMA},
        "control": [
            {"file": "control.csv", "crs": "local", "axes": ["east", "north", "up"], "sigma": [0.05, 0.05, 0.05]}
        ],
    }
    path = folder / "project.yaml"
    path.write_text(json.dumps(project), encoding="utf-8")  # JSON is YAML
    return path


def sum_of(strips: Mapping[str, tuple[Floats, Floats]]) -> int:
    return sum(len(each) for each, _ in strips.values())


def projects() -> list[Project]:
    """Give all projects of the oracle, in their order."""
    samples = [
        sample("simulated-20"),
        sample("sxb-strasbourg"),
        sample("apollo15-metric-strip"),
    ]
    return [*samples, *blocks(), *models(), *(strip(number) for number in range(len(SIZES)))]
