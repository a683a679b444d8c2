"""``photostrip schema``: what may stand in the files that users write, for editors and other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.planning import PlanKind
from photostrip.strip import StepName
from photostrip.terrestrial import TerrestrialKind


def schema(
    simulation: Annotated[
        bool, typer.Option("--simulation", help="The specification of `photostrip simulate` instead.")
    ] = False,
    plan: Annotated[
        PlanKind | None,
        typer.Option("--plan", help="The file of this command of `photostrip plan` instead."),
    ] = None,
    terrestrial: Annotated[
        TerrestrialKind | None,
        typer.Option("--terrestrial", help="The file of this computation of `photostrip terrestrial` instead."),
    ] = None,
    step: Annotated[
        StepName | None, typer.Option("--step", help="The keys of this step of `photostrip step` instead.")
    ] = None,
    tolerances: Annotated[
        bool, typer.Option("--tolerances", help="The tolerance profile of `photostrip compare` instead.")
    ] = False,
    result: Annotated[bool, typer.Option("--result", help="What result.json may hold instead.")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="File to write, FILE.md as a table of keys; default: stdout."
        ),
    ] = None,
) -> None:
    """Print the JSON Schema of the project file, for editors.

    An editor that knows JSON Schema completes keys and explains them: write the schema to a file and begin the
    project file with `# yaml-language-server: $schema=photostrip.schema.json`.
    """
    import json

    from photostrip.formats.text.writing import write_text
    from photostrip.project.editors import keys_page, schema_of
    from photostrip.result.schema import result_page, result_schema

    asked: dict[str, object] = {"tolerances": tolerances, "simulation": simulation, plan or "": plan}
    asked |= {f"terrestrial {terrestrial}": terrestrial, f"step {step}": step}
    kind = next((name for name, chosen in asked.items() if chosen), "project")
    if output is not None and output.suffix == ".md":
        write_text(output, result_page() if result else keys_page(kind))
        return
    text = json.dumps(result_schema() if result else schema_of(kind), indent=2, ensure_ascii=True) + "\n"
    if output is None:
        typer.echo(text, nl=False)
    else:
        write_text(output, text)
