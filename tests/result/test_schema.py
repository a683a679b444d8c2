"""The schema of result.json: every result keeps it, an edited one does not, and every key has a meaning."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.cli.main import main
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.result.description import result_page, result_schema
from photostrip.result.document import document_of
from photostrip.result.table import plain_of
from photostrip.simulation import Models, Spec, simulate
from tests.loops import nonempty
from tests.results import case, spec
from tests.simulated import inputs_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SCHEMA = result_schema()
VALIDATOR = pytest.importorskip("jsonschema").Draft202012Validator(SCHEMA)


def faults(document: dict[str, Any]) -> list[str]:
    """Give what JSON Schema has against a document."""
    return [f"{error.json_path}: {error.message}" for error in VALIDATOR.iter_errors(document)]


def results() -> Iterator[dict[str, Any]]:
    for name in ("simulated-20", "apollo15-metric-strip", "sxb-strasbourg"):
        yield json.loads((ROOT / f"sample_data/{name}/baseline.json").read_text(encoding="utf-8")) | {"version": ""}
    yield plain_of(case().document)
    yield plain_of(document_of(triangulate(case("projected", 2).inputs, Settings(adjustment="bundle"))))
    strips = inputs_of(simulate(Spec(models=Models(), flight=spec().flight)))
    yield plain_of(document_of(triangulate(strips, Settings())))


@pytest.mark.slow
def test_every_result_keeps_the_schema() -> None:
    for document in nonempty(list(results())):
        assert faults(document) == []


@pytest.mark.slow
def test_the_schema_is_one() -> None:
    VALIDATOR.check_schema(SCHEMA)


@pytest.mark.parametrize(
    ("keys", "value", "block"),
    [
        (("points", "x", 0), "a", "$.points"),
        (("points", "rays", 0), 2.5, "$.points"),
        (("points",), [], "$.points"),
        (("control", "strips", 1), ["b", 2], "$.control"),
        (("summary", "sigma0_um"), [1.0], "$.summary"),
        (("verdict", "verified"), 1, "$.verdict"),
        (("photostrip_result",), 1, "$.photostrip_result: 2 was expected"),
    ],
)
def test_an_edited_result_does_not(keys: tuple[str | int, ...], value: object, block: str) -> None:
    document = deepcopy(plain_of(case().document))
    part = document
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    (found,) = faults(document)
    assert found.startswith(block)


def test_every_key_has_a_meaning_and_every_number_a_unit() -> None:
    found = [each for block in (SCHEMA, *SCHEMA["$defs"].values()) for each in block["properties"].values()]
    values = [each if "description" in each else each["items"] for each in found if not {"$ref", "anyOf"} & each.keys()]
    assert len(values) > 400
    assert [each for each in values if not each["description"]] == []
    rows = result_page().splitlines()[2:]
    assert "| `points.sigma_x` | m | standard deviation of the coordinate |" in rows
    assert "| `points.x` | that of the frame | coordinate of the point; of several strips the mean |" in rows
    assert [row for row in nonempty(rows) if row.count(" | ") < 2] == []


def test_the_command_prints_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "--result"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA
    assert main(["schema", "--result", "-o", str(tmp_path / "keys.md")]) == 0
    assert (tmp_path / "keys.md").read_text(encoding="utf-8") == result_page()
