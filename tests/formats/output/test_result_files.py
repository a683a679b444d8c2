"""result.json and the tables: the same numbers in both, read back as they were; other files are refused."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from typing import TYPE_CHECKING

import pytest

from photostrip.errors import InputError
from photostrip.formats.output.result_json import read_result, to_json
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from tests.loops import nonempty
from tests.results import FRAMES, case, result_files, solved
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.results import Document

pytestmark = pytest.mark.usefixtures("_adjusted_once")

ODD_IDS = [
    "0123",
    "NO",
    "1:20",
    "1e3",
    "~",
    'say "no"',
    "a,b",
    "a}, {",
    "точка",
    "点",
    "x\u0301",
    "\\",
    "=1+1",
    " ",
    "nan",
]


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(text)))


def with_odd_ids() -> Document:
    """The first points and photos of a project under ids that other programs stumble over."""
    inputs = case("local").inputs
    o = inputs.observations
    points = (*ODD_IDS, *o.point_ids[len(ODD_IDS) :])
    photos = tuple(f"{name} %s,{n}" for n, name in enumerate(o.photo_ids))
    name_of = dict(zip(o.point_ids, points, strict=True))
    control = replace(inputs.control, ids=tuple(name_of[name] for name in inputs.control.ids))
    (strip,) = inputs.strips
    number = dict(zip(o.photo_ids, photos, strict=True))
    strips = (replace(strip, photos=tuple(number[photo] for photo in strip.photos)),)
    renamed = replace(o, point_ids=points, photo_ids=photos)
    return solved(replace(inputs, observations=renamed, control=control, strips=strips)).document


@pytest.mark.slow
def test_json_gives_back_the_document() -> None:
    for document in (case("projected", 2).document, with_odd_ids()):
        assert json.loads(to_json(document)) == document
        assert json.loads(to_json(document, ascii_only=True)) == document
    assert to_json(with_odd_ids(), ascii_only=True).isascii()
    assert not to_json(with_odd_ids()).isascii()


def test_every_record_stands_on_a_line_of_its_own() -> None:
    document = case("projected", 2).document
    lines = to_json(document).splitlines()
    for key in ("points", "photos", "models", "control", "residuals"):
        start = lines.index(f'"{key}": [')
        for number, record in enumerate(document[key], start + 1):
            assert json.loads(lines[number].removesuffix(",")) == record


@pytest.mark.slow
def test_two_runs_write_the_same_bytes() -> None:
    """In two processes, with different orders of sets and dictionaries of texts."""
    code = (
        "from tests.results import *\nimport hashlib\n"
        "files = result_files(case('projected', 2).document, 'resolved')\n"
        "print({name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()})"
    )
    environment = {"PYTHONHASHSEED": "1", "PATH": "", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    with redirect_stdout(StringIO()) as here:
        exec(code, {})  # noqa: S102 (the same, in this process)
    assert done.stdout == here.getvalue()
    assert "result.json" in done.stdout


def test_result_json_comes_last() -> None:
    names = list(result_files(case("local").document, "text: 1\n"))
    assert names[-1] == "result.json"
    tables = {f"{name}.csv" for name in ("points", "photos", "residuals", "parallaxes", "rejected")}
    assert set(names) == tables | {"project.resolved.yaml", "result.json"}
    assert "project.resolved.yaml" not in result_files(case("local").document)


# ------------------------------------------------------------------------------------------------------- tables


def number(text: str) -> float | None:
    return float(text) if text else None


@pytest.mark.parametrize("frame", FRAMES)
def test_points_csv_says_what_result_json_says(frame: str) -> None:
    document = case(frame).document
    table = rows(result_files(document)["points.csv"])
    assert len(table) == len(document["points"])
    for row, point in nonempty(zip(table, document["points"], strict=True)):
        assert (row["point"], row["role"]) == (point["id"], point["role"])
        for key in ("x", "y", "z", "sigma_x", "image_rms_um"):
            assert number(row[key]) == point[key]
        assert (int(row["rays"]), int(row["models"])) == (point["rays"], point["models"])


def test_longitudes_have_ten_decimals_and_heights_four() -> None:
    row = rows(result_files(case("geographic").document)["points.csv"])[0]
    assert [len(row[key].partition(".")[2]) for key in "xyz"] == [10, 10, 4]
    row = rows(result_files(case("projected").document)["points.csv"])[0]
    assert [len(row[key].partition(".")[2]) for key in "xyz"] == [4, 4, 4]


def test_photos_csv_says_what_result_json_says() -> None:
    document = case("north first").document
    table = rows(result_files(document)["photos.csv"])
    for row, photo in nonempty(zip(table, document["photos"], strict=True)):
        assert (row["photo"], row["strip"]) == (photo["id"], photo["strip"])
        assert [float(row[key]) for key in "xyz"] == [photo[key] for key in "xyz"]
        assert [float(row[f"{name}_deg"]) for name in ("alpha", "omega", "kappa")] == photo["angles"]["values"]
        cosines = [float(row[f"r{i}{j}"]) for i in (1, 2, 3) for j in (1, 2, 3)]
        assert cosines == photo["rotation"]


def test_residuals_csv_says_what_result_json_says() -> None:
    for document in (case("projected", 2).document, with_odd_ids()):
        expected = [
            (group["photo"], point, vx, vy, "1" if used else "0")
            for group in document["residuals"]
            for point, vx, vy, used in zip(group["points"], group["vx_um"], group["vy_um"], group["used"], strict=True)
        ]
        table = rows(result_files(document)["residuals.csv"])
        assert expected == [
            (row["photo"], row["point"], number(row["vx_um"]), number(row["vy_um"]), row["used"]) for row in table
        ]


def test_a_measurement_without_a_residual_has_empty_cells() -> None:
    document = case("local").document
    changed = json.loads(to_json(document))
    changed["residuals"][0]["vx_um"][0] = changed["residuals"][0]["vy_um"][0] = None
    before, after = (result_files(each)["residuals.csv"].splitlines() for each in (document, changed))
    group = changed["residuals"][0]
    assert after[1] == f"{group['photo']},{group['points'][0]},,,{int(group['used'][0])}"
    assert after[2:] == before[2:]


def test_parallaxes_csv_says_what_result_json_says() -> None:
    document = with_odd_ids()
    expected = [
        (pair["left"], pair["right"], point, q, "1" if used else "0")
        for pair in document["parallaxes"]
        for point, q, used in zip(pair["points"], pair["q_um"], pair["used"], strict=True)
    ]
    table = rows(result_files(document)["parallaxes.csv"])
    assert expected == [(r["left"], r["right"], r["point"], number(r["q_um"]), r["used"]) for r in table]


def test_rejected_csv_says_what_result_json_says() -> None:
    document = case("local").document
    document = {**document, "rejected": [rejection("P1", "1002", 12.34), rejection("P,2", None, None)]}
    table = rows(result_files(document)["rejected.csv"])
    assert [row["point"] for row in table] == ["P1", "P,2"]
    assert [row["other_photo"] for row in table] == ["1002", ""]
    assert [number(row["value"]) for row in table] == [12.34, None]
    assert [row["reason"] for row in table] == ['too "large", it seems'] * 2


def rejection(point: str, other: str | None, value: float | None) -> Document:
    return {
        "strip": "A", "photo": "1001", "other_photo": other, "point": point, "stage": "relative", "test": "parallax",
        "value": value, "limit": 3.0, "unit": "um", "parallax_um": value, "zone": 1, "reason": 'too "large", it seems',
    }  # fmt: skip


# ------------------------------------------------------------------------------------------------------ reading


@pytest.mark.slow
def test_a_result_is_read_back(tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    file.write_text(to_json(with_odd_ids()), encoding="utf-8")
    assert read_result(str(file)) == with_odd_ids()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", ":1:2: is not JSON"),
        ('{"a": 1,}', ":1:"),
        ("[1, 2]", "has no key `photostrip_result`"),
        ('{"name": "x"}', "has no key `photostrip_result`"),
        ('{"photostrip_result": 2}', "has the result format 2; expected 1"),
        ('{"photostrip_result": "1"}', "has the result format '1'; expected 1"),
        ("[" * 100_000, "nested too deeply"),
        ("", "is empty"),
        ("\x00", "NUL"),
    ],
)
def test_what_is_no_result_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "result.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_result(str(file))
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(file))


def test_a_missing_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_result(str(tmp_path / "result.json"))


def test_the_result_does_not_change_when_it_is_written() -> None:
    result = triangulate(case("local").inputs, case("local").result.settings)
    first = to_json(document_of(result))
    result_files(document_of(result))
    assert to_json(document_of(result)) == first
