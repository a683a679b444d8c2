"""Ids survive the whole way: from the tables through a run into every file of the result, and through the report."""

from __future__ import annotations

import csv
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
import yaml

from photostrip.cli.main import main
from photostrip.formats.result_json import read_result
from photostrip.simulation.spec import Points
from photostrip.visible import visible
from tests import calls
from tests.loops import nonempty
from tests.project.test_ids import ODD
from tests.results import spec, write_project

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Capture

    Both = tuple[Path, Path, dict[str, str], dict[str, str]]

pytestmark = pytest.mark.usefixtures("_adjusted_once")

PHOTOS = ["0123", "NO", "1:20", "1e3", "~"]
NAMES = ["Камера", "+7", "-1"]  # camera, strip, project


def rows(path: Path) -> list[dict[str, str]]:
    return calls.rows(path.read_text(encoding="utf-8"))


def renamed(folder: Path, target: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Write the project anew with other ids, by programs that are not ours; give the new ids of photos and points."""
    project = yaml.load((folder / "project.yaml").read_text(encoding="utf-8"), yaml.BaseLoader)  # noqa: S506 (texts only)
    tables = {name: rows(folder / name) for name in ("observations.csv", "control.csv")}
    photos = dict(zip(project["strips"][0]["photos"], PHOTOS, strict=True))
    names = dict.fromkeys(row["point"] for row in (*tables["observations.csv"], *tables["control.csv"]))
    odd = [*ODD, *(f"Точка {n}" for n in range(len(names)))]
    points = dict(zip(names, odd[: len(names)], strict=True))
    camera = next(iter(project["cameras"]))
    project["name"] = NAMES[2]
    project["cameras"] = {NAMES[0]: project["cameras"][camera]}
    project["strips"][0] |= {"id": NAMES[1], "camera": NAMES[0], "photos": PHOTOS}
    target.mkdir()
    (target / "project.yaml").write_text(yaml.safe_dump(project, allow_unicode=True), encoding="utf-8")
    for name, table in tables.items():
        new = {"point": points, "photo": photos}
        with (target / name).open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, list(table[0]))
            writer.writeheader()
            writer.writerows(
                {key: new[key][cell] if key in new else cell for key, cell in row.items()} for row in table
            )
    return photos, points


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Both:
    """Run the project with plain and with odd ids."""
    base = tmp_path_factory.mktemp("ids")
    path = write_project(base / "plain", replace(spec(), points=Points(extra_per_model=12)))
    photos, points = renamed(path.parent, base / "odd")
    for name in ("plain", "odd"):
        assert main(["run", str(base / name / "project.yaml"), "-o", str(base / f"{name}-result"), "--quiet"]) == 0
    return base / "plain-result", base / "odd-result", photos, points


def test_the_result_has_the_same_numbers_under_the_new_ids(both: Both) -> None:
    plain, odd, photos, points = both
    one, two = (read_result(str(each / "result.json")) for each in (plain, odd))
    assert [two["name"], two["strips"][0]["id"], two["cameras"][0]["id"]] == [NAMES[2], NAMES[1], NAMES[0]]
    assert [row["id"] for row in two["photos"]] == PHOTOS
    there = {row["id"]: row for row in two["points"]}
    assert set(there) == {points[row["id"]] for row in one["points"]}
    for row in nonempty(one["points"]):
        for key in ("x", "y", "z"):
            assert there[points[row["id"]]][key] == pytest.approx(row[key], abs=1e-3)
    assert {row["id"] for row in two["control"]} == {points[row["id"]] for row in one["control"]}
    assert len(photos) == len(PHOTOS)


@pytest.mark.parametrize(
    ("table", "column"), [("points", "point"), ("photos", "photo"), ("residuals", "point"), ("residuals", "photo")]
)
def test_the_tables_of_the_result(both: Both, table: str, column: str) -> None:
    plain, odd, photos, points = both
    new = photos if column == "photo" else points
    before, after = (rows(each / f"{table}.csv") for each in (plain, odd))
    assert sorted(new[row[column]] for row in before) == sorted(row[column] for row in after)


def test_the_resolved_project_runs_and_gives_the_same(both: Both, tmp_path: Path) -> None:
    odd = both[1]
    folder = odd.parent / "odd"
    resolved = folder / "resolved.yaml"
    resolved.write_text((odd / "project.resolved.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["run", str(resolved), "-o", str(tmp_path / "again"), "--quiet"]) == 0
    resolved.unlink()
    for name in ("points.csv", "photos.csv", "residuals.csv"):
        assert (tmp_path / "again" / name).read_bytes() == (odd / name).read_bytes()
    one, two = (read_result(str(each / "result.json")) for each in (odd, tmp_path / "again"))
    hashes = [each.pop("certificate")["result_sha256"] for each in (one, two)]  # it names the files, which are others
    assert one == two
    assert hashes[0] == hashes[1]


def test_the_report_shows_them(both: Both, capsys: Capture) -> None:
    assert main(["report", str(both[1]), "--verbose", "--width", "200"]) == 0
    out = capsys.readouterr().out
    document = read_result(str(both[1] / "result.json"))
    short = [row["id"] for row in document["control"] if len(row["id"]) < 12]
    assert short
    assert [name for name in nonempty(short) if visible(name) not in out] == []


@pytest.mark.parametrize(
    ("measured", "given", "words"),
    [
        ("Tégé", "Te\u0301ge\u0301", "it looks the same, but is NFC in Unicode, and here NFD"),
        ("Te\u0301ge\u0301", "Tégé", "it looks the same, but is NFD in Unicode, and here NFC"),
        ("A12", "А12", "its `A` is Latin, and here `А` is Cyrillic"),
        ("P-1", "P1", ""),
    ],
)
def test_of_ids_that_look_the_same_the_difference_is_told(
    tmp_path: Path, capsys: Capture, measured: str, given: str, words: str
) -> None:
    project = write_project(tmp_path, spec())
    for name, new in (("observations.csv", measured), ("control.csv", given)):
        text = (tmp_path / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text.replace("G01,", f"{new},"), encoding="utf-8")
    main(["check", str(project)])
    said = calls.words("".join(capsys.readouterr()))
    assert f"`{given}`, did you mean `{measured}`?" in said
    assert words in said
    assert words or "looks the same" not in said
