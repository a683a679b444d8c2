"""The schema: every key described, with its unit and the default of the mathematics; pages say what is read."""

import json
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from photostrip.cli.main import main
from photostrip.formats.faults import Findings
from photostrip.formats.measured import Manner, read_control, read_measurements
from photostrip.pipeline.inputs import Settings
from photostrip.project.editors import KINDS, keys_page, schema_of
from photostrip.project.keys import Output, ProjectFile, Tolerances
from photostrip.project.reading import Node, Place, checked, parse
from photostrip.project.sections import Section
from tests.loops import nonempty
from tests.pages import blocks
from tests.source_tree import ROOT

PLACE = Place("a.yaml", 1, 1)
UNITS = {"principal_distance": "mm", "sigma0_um": "um", "check_rms_z": "m", "parallax_limit": "mm", "earth_radius": "m"}


def keys(schema: dict[str, Any], definitions: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Give every key that the JSON Schema describes, with its description."""
    for name, each in schema.get("properties", {}).items():
        yield name, each
        inside: tuple[Any, ...] = (each, each.get("items"), each.get("additionalProperties"))
        kinds = [
            kind
            for inner in inside
            if isinstance(inner, dict)
            for kind in (*inner.get("anyOf", ()), *inner.get("oneOf", ()))
        ]
        for inner in (*inside, *kinds):
            if isinstance(inner, dict) and "$ref" in inner:
                yield from keys(definitions[inner["$ref"].rpartition("/")[2]], definitions)


def every_key() -> list[tuple[str, dict[str, Any]]]:
    schema = schema_of("project")
    return list(keys(schema, schema["$defs"]))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_key_of_every_kind_of_file_is_described(kind: str) -> None:
    schema = schema_of(kind)
    assert schema["title"] == KINDS[kind][2]
    found = nonempty(keys(schema, schema.get("$defs", {})))
    assert [name for name, each in found if not each.get("description")] == []


def test_units_stand_in_the_description_and_by_themselves() -> None:
    found = dict(every_key())
    assert {name: found[name]["unit"] for name in UNITS} == UNITS
    assert [
        name for name, each in found.items() if "unit" in each and f"[{each['unit']}]" not in each["description"]
    ] == []


def test_editors_are_told_what_is_read() -> None:
    schema = schema_of("project")
    definitions = schema["$defs"]
    assert schema["required"] == ["photostrip"]
    assert schema["allOf"] == [
        {"anyOf": [{"required": ["cameras", "observations"]}, {"required": ["models"]}]},
        {"anyOf": [{"required": ["strips"]}, {"required": ["photos"]}]},
    ]
    one, many = schema["properties"]["photos"]["anyOf"]
    assert one == many["items"] == {"$ref": "#/$defs/Photos"}
    assert schema["additionalProperties"] is False
    assert [name for name, each in definitions.items() if each.get("additionalProperties") is not False] == []
    assert definitions["Relative"]["properties"]["parallax_limit"]["default"] == "auto"
    assert definitions["Polynomial"]["properties"]["degree"]["enum"] == ["auto", 1, 2, 3]
    assert "number" in definitions["Strip"]["properties"]["photos"]["items"]["type"]
    assert schema["properties"]["cameras"]["minProperties"] == 1
    text = json.dumps(schema)
    assert '"default": null' not in text
    assert '{"type": "null"}' not in text


def test_every_setting_of_the_mathematics_has_a_key() -> None:
    settings = Settings()
    names = {field.name for part in ("relative", "formation", "absolute", "polynomial", "bundle", "interior",
                                   "refinement")
             for field in fields(getattr(settings, part))}  # fmt: skip
    known = {name for name, _ in every_key()} | {"search_cameras"}  # `self_calibration: auto`
    assert names - known == set()


def test_all_of_tolerances_and_output_may_be_left_out() -> None:
    assert set(dict(Tolerances()).values()) == {None}
    assert Output().crs is None


def below(kind: type[Section]) -> list[type[Section]]:
    return [each for inner in kind.__subclasses__() for each in (inner, *below(inner))]


def test_every_section_refuses_unknown_keys() -> None:
    for kind in nonempty(below(Section)):
        findings = Findings()
        assert checked(kind, Node({"unheard_of": Node("1", PLACE)}, PLACE), findings) is None
        assert {fault.key: fault for fault in findings.faults}["unheard_of"].code == "unknown-key"


def test_the_page_of_keys_has_every_one_with_default_and_unit() -> None:
    rows = keys_page("project").splitlines()
    shown = {(row.split("`")[1], row.split(" | ")[2].removesuffix(" |")) for row in rows if row.startswith("| `")}
    assert {(name, each["description"]) for name, each in every_key()} == shown
    assert "| `grubbs_alpha` | 0.05 | Probability of rejecting a good point of a pair without gross errors |" in rows
    assert "| `variance_components` | false |" in keys_page("project")
    assert "| `principal_distance` | required | Principal distance [mm] |" in rows


PAGES = ROOT / "docs" / "files"


def block(page: str, kind: str, number: int = 0) -> str:
    """Give the content of a block of a page."""
    found = [each for each in blocks(PAGES / page) if each.kind == kind]
    return "\n".join(found[number].lines) + "\n"


def test_the_whole_example_of_a_project_is_right() -> None:
    findings = Findings()
    root = parse(block("project.md", "yaml"), "project.yaml", findings)
    assert root is not None
    root.entries.pop("extends")
    assert checked(ProjectFile, root, findings) is not None
    assert findings.faults == ()


@pytest.mark.parametrize(("page", "rows"), [("observations.md", 4), ("fiducials.md", 4), ("control.md", 4)])
def test_the_example_of_a_table_is_right(tmp_path: Path, page: str, rows: int) -> None:
    path, findings = tmp_path / "table.csv", Findings()
    path.write_text(block(page, "text"), encoding="utf-8")
    if page == "control.md":
        control = read_control(str(path), 2, findings)
        assert control is not None
        assert len(control.table) == rows
    else:
        read = read_measurements([str(path)], findings, Manner(marks=page == "fiducials.md"))
        assert read is not None
        assert len(read.table) == rows
    assert (findings.faults, findings.notes) == ((), [])


def test_the_command_writes_the_page_of_any_kind_of_file(tmp_path: Path) -> None:
    assert main(["schema", "--plan", "strip", "-o", str(tmp_path / "keys.md")]) == 0
    assert (tmp_path / "keys.md").read_text(encoding="utf-8") == keys_page("strip")
