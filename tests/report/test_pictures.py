"""Pictures: their numbers are those of the result, they are sound, stay inside, and are the same as files."""

from __future__ import annotations

import copy
import math
import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from photostrip.cli.main import main
from photostrip.pipeline.inputs import Settings
from photostrip.report.pictures.chart import MOST_DOTS, Axis, Map, Marks, Panel, Segments, chart, rows_of
from photostrip.report.pictures.places import plan_of, rays_of, shortened
from photostrip.report.pictures.plan import footprint_pictures, footprints
from photostrip.report.pictures.result import pictures_of
from photostrip.result.numbers import MATRIX
from photostrip.simulation import Models
from photostrip.simulation.flight import surface
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Ground, Image, Spec, Terrain
from tests.loops import nonempty
from tests.reports import saved
from tests.results import FRAMES, by_rows, case, in_tables, rotation, solved, spec
from tests.simulated import inputs_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.simulation.simulation import Simulation

    Document = dict[str, Any]

SAMPLE = ROOT / "sample_data" / "simulated-20" / "project.yaml"
SVG = "{http://www.w3.org/2000/svg}"


def drawn(document: Document, name: str) -> str:
    return next(picture.svg for picture in pictures_of(in_tables(document)) if picture.name == name)


def hints(svg: str) -> list[str]:
    root = ET.fromstring(svg)  # noqa: S314 (we wrote it)
    return [element.text or "" for element in root.iter(f"{SVG}title")][1:]


@pytest.mark.parametrize("frame", sorted(FRAMES))
def test_the_plan_has_the_distances_of_the_ground_and_residuals_stand_where_points_were_measured(frame: str) -> None:
    document = case(frame).document
    plan = plan_of(document)
    photos = plan.photos[plan.strips["A"]]
    bases = np.linalg.norm(np.diff(photos[:, :2], axis=0), axis=1)
    assert bases == pytest.approx([model["base"] for model in document["models"]], rel=6e-3)  # flattening, map scale
    assert (np.diff(photos[:, 0]) > 0).all()
    assert photos[0, :2] == pytest.approx(0.0, abs=1e-6)
    assert photos[-1, 1] == pytest.approx(0.0, abs=1e-6)
    # the flight goes to azimuth 70 degrees: north lies 70 degrees to its left
    assert math.degrees(math.atan2(plan.north[1], plan.north[0])) == pytest.approx(70.0, abs=2.5)
    rows = {row["id"]: row for row in document["control"]}
    known = np.flatnonzero(np.isfinite(plan.shift[:, 0])).tolist()
    assert len(known) >= 9
    for n in nonempty(known):
        assert math.hypot(*plan.shift[n, :2]) == pytest.approx(rows[plan.ids[n]]["plan"], abs=2e-4)
        assert plan.shift[n, 2] == rows[plan.ids[n]]["height"]
    one = case(frame)
    rays = rays_of(document)
    places = plan.images(rays.photo, rays.point)
    assert len(places) == len(document["residuals"])
    measured = [one.measured[sight] for sight in zip(rays.photo, rays.point, strict=True)]
    assert np.abs(places - measured).max() < 0.5  # mm


def test_points_have_their_differences_as_hints() -> None:
    """Also the one of which only the height was given."""
    document = by_rows(saved())
    of_height = document["control"][0] | {"dx": None, "dy": None, "plan": None}
    document["control"][0] = of_height
    assert of_height["measured"]
    of_plan, along = hints(drawn(document, "plan")), hints(drawn(document, "deformation"))
    for row in nonempty([row for row in document["control"] if row["measured"] and row["height"] is not None]):
        name = f"{row['role']} point {row['id']}"
        own = next(hint for hint in of_plan if hint.startswith(name))
        assert f"height {row['height']:+.3g} m" in own
        assert f"{name}: {row['height']:+.3f} m" in along


def test_vectors_are_drawn_to_the_scale_of_their_bar() -> None:
    document = case().document
    picture = ET.fromstring(drawn(document, "plan"))  # noqa: S314 (we wrote it)
    words = " ".join(element.text or "" for element in picture.iter(f"{SVG}text"))
    said = re.search(r"residuals (\d+) (mm|m)\b", words)
    assert said is not None
    bar = next(line for line in picture.iter(f"{SVG}line") if line.get("class") == "bar soft")
    scale = (float(bar.get("x2", 0)) - float(bar.get("x1", 0))) / (float(said[1]) / (1000 if said[2] == "mm" else 1))
    lengths = [
        math.dist(ends[:2], ends[2:])
        for path in picture.iter(f"{SVG}path")
        if path.get("class") in {"line control", "line check"}
        for ends in ([float(value) for value in re.findall(r"[\d.]+", path.get("d", ""))],)
    ]
    shift = plan_of(document).shift
    given = np.linalg.norm(shift[np.isfinite(shift[:, 0]), :2], axis=1)
    assert sorted(lengths) == pytest.approx(sorted(given * scale), abs=0.2)


def test_points_that_findings_name_have_a_ring_and_their_id() -> None:
    document = by_rows(case().document)
    bad = next(row["id"] for row in document["points"] if row["role"] == "new")
    document["findings"] = []
    assert "failed open" not in drawn(document, "plan")
    named: tuple[tuple[str, list[str]], ...] = (("P1", [bad]), ("P2", [bad, "no such point"]), ("P3", []))
    document["findings"] = [{"code": code, "points": points} for code, points in named]
    svg = drawn(document, "plan")
    rings = re.findall(r'<circle cx="([^"]+)" cy="([^"]+)" r="9" class="mark failed open"><title>([^<]+)<', svg)
    ((x, y, hint),) = rings
    assert hint == f"point {bad}: P1, P2"
    assert re.search(rf'<circle cx="{x}" cy="{y}" [^>]*class="mark new"><title>new point {bad}', svg)
    assert f">{bad}</text>" in svg


def test_parallaxes_have_the_mean_of_their_zone_and_ties_count_the_points_in_common() -> None:
    document = case().document
    sizes = document["residuals"].where(zone=1)["q_um"]
    assert f"zone 1, left centre: {np.mean(sizes):+.1f} ± " in drawn(document, "parallaxes")
    document = case(strips=2).document
    on: dict[str, set[str]] = {}
    for row in document["residuals"].where(used=True):
        on.setdefault(row["photo"], set()).add(row["point"])
    found = [re.fullmatch(r"(\w+) and (\w+): (\d+) points?", hint) for hint in hints(drawn(document, "ties"))]
    counts = {(tie[1], tie[2]): int(tie[3]) for tie in found if tie}
    names = sorted(on)
    expected = {(a, b): len(on[a] & on[b]) for n, a in enumerate(names) for b in names[n + 1 :] if on[a] & on[b]}
    assert counts == expected


def test_every_picture_is_sound_and_stays_inside_and_as_a_file_needs_no_page() -> None:
    for frame, strips in (("projected", 1), ("north first", 2)):
        for picture in pictures_of(case(frame, strips).document):
            root = ET.fromstring(picture.svg)  # noqa: S314 (we wrote it)
            _, _, width, height = (float(value) for value in root.get("viewBox", "").split())
            assert root.find(f"{SVG}title") is not None
            assert root.find(f"{SVG}desc") is not None
            for element in root.iter():
                for names, limit in ((("x1", "x2", "cx", "x"), width), (("y1", "y2", "cy", "y"), height)):
                    for name in names:
                        assert 0 <= float(element.get(name, 0)) <= limit, ET.tostring(element)
            text = picture.file()
            assert text == picture._repr_svg_()
            assert "var(--" not in text
            assert ET.fromstring(text).find(f"{SVG}style") is not None  # noqa: S314 (we wrote it)


def test_a_result_without_control_and_precision_has_pictures_of_the_rest() -> None:
    document = by_rows(case().document)
    document.pop("precision", None)
    document["control"], document["misclosures"] = [], []
    for row in document["points"]:
        row.update(role="new", ellipse_a=None, sigma_z=None)
    names = {picture.name for picture in pictures_of(case().document)}
    left = {"precision", "precision-plan", "precision-height", "deformation", "check"}
    assert left < names
    assert {picture.name for picture in pictures_of(in_tables(document))} == names - left


@cache
def of_models(*, centers: bool) -> Document:
    inputs = inputs_of(simulate(replace(spec(strips=2), models=Models(centers=centers))))
    found: Document = by_rows(solved(inputs, Settings(adjustment="polynomial")).document)
    return found


def test_models_without_centres_have_a_plan_of_their_points_and_a_strip_is_drawn_without_one() -> None:
    document = of_models(centers=False)
    assert {photo["x"] for photo in document["photos"]} == {None}
    svg = drawn(document, "plan")
    ids = [point["id"] for point in document["points"] if point["role"] == "check"]
    assert all(f"check point {name}," in svg for name in nonempty(ids))
    document = copy.deepcopy(of_models(centers=True))
    first, second = document["photos"][:2]
    first.update(x=None, y=None, z=None)
    assert f">photo {second['id']}<" in drawn(document, "plan")
    assert f">photo {first['id']}<" not in drawn(document, "plan")


def test_many_points_are_thinned_which_the_caption_says_and_panels_without_any_drawn() -> None:
    at = np.random.default_rng(1).uniform(0.0, 100.0, (3 * MOST_DOTS, 2))
    picture = chart("many", ("Many", "A caption.", ""), [Map([Marks(at, words="new point")])])
    assert picture.svg.count("h0") == MOST_DOTS
    words = f"Of {3 * MOST_DOTS} points one in 3 is drawn; `points` in result.json has all."
    assert picture.caption == f"A caption. {words}"
    nothing = Marks(np.zeros((0, 2)))
    assert "</svg>" in chart("empty", ("", "", ""), [Panel([nothing]), Panel([nothing], log=True), Map([nothing])]).svg


def test_long_maps_are_cut_into_rows_in_which_nothing_is_torn_and_long_names_are_shortened() -> None:
    at = np.column_stack([np.linspace(0.0, 1000.0, 100), np.tile([0.0, 10.0], 50)])
    rows = rows_of(at)
    assert (rows > 3, rows_of(at * (0.1, 1.0))) == (True, 1)
    picture = chart("long", ("", "", ""), [Map([Segments(at, at + np.array([5.0, 0.0]))], rows=rows)])
    ends = np.array(re.findall(r'd="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)"', picture.svg), float)
    assert ends[:, 2] - ends[:, 0] == pytest.approx(4.1 * rows, rel=0.03)  # 5 of 1000 m, 912 wide
    assert (ends[:, 3] == ends[:, 1]).all()
    assert len(set(ends[:, 1])) == 2 * rows
    named, words = shortened(["DJI_0007.JPG", "DJI_0012.JPG"])
    assert list(named.values()) == ["07", "12"]
    assert "“DJI_00” before and “.JPG” after" in words
    assert shortened(["1001", "1002"]) == ({"1001": "1001", "1002": "1002"}, "")


def test_ticks_are_round_and_inside() -> None:
    axis = Axis(-0.37, 1.21, 300.0, 20.0)
    assert [value for value, _ in axis.ticks()] == pytest.approx([0.0, 0.5, 1.0])
    assert axis([-0.37, 1.21, 9.0]).tolist() == [300.0, 20.0, 20.0]
    assert [words for _, words in Axis(0.08, 3.0, 0.0, 100.0, log=True).ticks()] == ["0.1", "0.2", "0.5", "1", "2"]
    names = [f"photo {n}" for n in range(100)]
    shown = Axis(0.0, 101.0, 0.0, 300.0, names=names).ticks()
    assert shown[0] == (1.0, "photo 0")
    assert len(shown) < 6


SIDE = 2300.0  # of a photo on the ground, m
DISTANCE = 153.0


@cache
def flown(terrain: Terrain, sigma_um: float = 5.0) -> tuple[Simulation, Document]:
    """Fly two strips to the east over a flat world."""
    flight = Flight(photos=5, strips=2, end_lap_percent=70.0, side_lap_percent=40.0)
    of_flight = Spec(
        seed=1, ground=Ground("local"), flight=flight, terrain=terrain, control=Control(check=4), image=Image(sigma_um)
    )
    simulation = simulate(of_flight)
    return simulation, by_rows(solved(inputs_of(simulation)).document)


def on_ground(document: Document) -> dict[str, NDArray[np.float64]]:
    """Return the footprints as east and north."""
    plan = plan_of(in_tables(document))
    first, (sine, cosine) = document["photos"][0], plan.north
    turn = np.array([[cosine, sine], [-sine, cosine]])
    return {photo: outline @ turn + (first["x"], first["y"]) for photo, outline in footprints(plan).items()}


def corners(simulation: Simulation) -> dict[str, NDArray[np.float64]]:
    """Return where the corners of the true photos meet the true ground, looked for along each ray."""
    heights, truth, places = surface(simulation.spec), simulation.truth, {}
    frame = 115.0 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    for photo, centre, turn in zip(truth.photo_ids, truth.centers, truth.rotations, strict=True):
        rays = np.column_stack([frame, np.full(4, -DISTANCE)]) @ turn.T
        scale = np.linspace(0.3, 2.0, 4000)[:, None, None] * (centre[2] - heights.height) / DISTANCE
        along = centre + scale * rays
        below = along[..., 2] <= heights(along[..., 0], along[..., 1])
        places[photo] = along[below.argmax(axis=0), np.arange(4), :2]
    return places


@pytest.mark.slow
@pytest.mark.parametrize("terrain", [Terrain(relief=60.0), Terrain(slope_percent=(10.0, 15.0))])
def test_corners_of_photos_lie_on_the_ground(terrain: Terrain) -> None:
    """Rms in percent of the side of a photo; on level ground the slope alone makes it 7."""
    simulation, document = flown(terrain)
    true, shown = corners(simulation), on_ground(document)
    assert set(shown) == set(true)
    off = np.concatenate([shown[photo] - true[photo] for photo in true])
    assert 100.0 * math.sqrt(np.mean(np.sum(off**2, axis=1))) / SIDE < 1.5


def turned(document: Document, number: int, degrees: float) -> Document:
    """Return a result one of whose photos looks up to the left by an angle."""
    made = copy.deepcopy(document)
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    made["photos"][number].update(zip(MATRIX, [1, 0, 0, 0, cosine, -sine, 0, sine, cosine], strict=True))
    return made


@pytest.mark.parametrize("tilt", [0.0, 45.0, 85.0])
def test_oblique_photos_show_the_ground_before_the_horizon(tilt: float) -> None:
    _, document = flown(Terrain(relief=0.0), sigma_um=0.0)
    made = turned(document, 2, tilt)
    photo = made["photos"][2]
    way = np.array([[*place, 300.0] for place in on_ground(made)[photo["id"]]]) - [photo[axis] for axis in "xyz"]
    image = way @ rotation(photo)
    image = -DISTANCE * image[:, :2] / image[:, 2:]
    # the upper border, unless rays of it do not come down: then the line below the horizon
    limit = DISTANCE * (math.cos(math.radians(tilt)) - 0.1) / math.sin(math.radians(tilt)) if tilt else math.inf
    top = min(115.0, limit)
    assert np.abs(image[:, 0]) == pytest.approx(115.0, abs=0.02)
    assert sorted(image[:, 1]) == pytest.approx([-115.0, -115.0, top, top], abs=0.02)


def test_photos_that_show_no_ground_have_no_footprint() -> None:
    _, document = flown(Terrain(relief=0.0), sigma_um=0.0)
    photo = document["photos"][2]["id"]
    whole = set(on_ground(document))
    assert set(on_ground(turned(document, 2, 140.0))) == whole - {photo}
    below = copy.deepcopy(document)
    below["photos"][2]["z"] = 250.0
    assert set(on_ground(below)) == whole - {photo}
    without = copy.deepcopy(document)
    without["residuals"] = [row for row in document["residuals"] if row["photo"] != photo]
    assert set(on_ground(without)) == whole - {photo}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_points_tell_of_the_height(count: int) -> None:
    _, document = flown(Terrain(relief=60.0))
    made = copy.deepcopy(document)
    third = made["photos"][2]["id"]
    kept = [row["point"] for row in made["residuals"] if row["photo"] == third][:count]
    made["points"] = [point for point in made["points"] if point["id"] in kept]
    shown = on_ground(made)
    assert third in shown
    for outline in nonempty(shown.values()):
        assert np.ptp(outline, axis=0) == pytest.approx((SIDE, SIDE), rel=0.1)  # hills of 60 m from 1530 m, tilts of 1°


def test_the_overlap_is_counted_within_the_outlines() -> None:
    """Photos one above the other show all their ground twice."""
    _, document = flown(Terrain(relief=60.0))
    made = copy.deepcopy(document)
    first = made["photos"][0]
    made["photos"], made["strips"] = [first, first | {"id": "again"}], made["strips"][:1]
    made["residuals"] += [row | {"photo": "again"} for row in made["residuals"] if row["photo"] == first["id"]]
    (picture,) = footprint_pictures(plan_of(in_tables(made)))
    assert ">2 photos<" in picture.svg
    assert ">1 photo<" not in picture.svg


@pytest.mark.slow
def test_the_picture_in_the_documentation_is_the_one_that_is_written(tmp_path: Path) -> None:
    plots, again = tmp_path / "plots", tmp_path / "again"
    polynomial = ("--set", "processing.adjustment=polynomial")
    assert main(["run", str(SAMPLE), *polynomial, "-q", "-o", str(tmp_path), "--plots", str(plots)]) == 0
    assert (plots / "deformation.svg").read_bytes() == (ROOT / "docs" / "pictures" / "deformation.svg").read_bytes()
    table = (ROOT / "docs" / "commands" / "report.md").read_text(encoding="utf-8")
    written = {path.name: path.read_bytes() for path in plots.iterdir()}
    assert len(written) > 10
    assert {name for name in written if f"`{name}`" not in table} == set()
    assert main(["report", str(tmp_path / "result.json"), "-q", "--plots", str(again)]) == 0
    assert {path.name: path.read_bytes() for path in again.iterdir()} == written
