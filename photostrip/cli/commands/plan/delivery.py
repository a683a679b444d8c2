"""How a plan is changed by options, printed and written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.commands.plan.options import Options
from photostrip.cli.documents import FORMS, Form, Rendering, write_rule
from photostrip.cli.options import RuleOfOutput, Silent, require_target
from photostrip.cli.stdout import Document
from photostrip.errors import Fault, InputError


@dataclass(frozen=True)
class Delivery:
    """Options of every plan: what it overrides, how it is printed, where it is written."""

    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Set a key of the plan, as in end_lap_percent=70; may be repeated."
        ),
    ] = None
    form: Annotated[Form, typer.Option("--format", help="How the answer is printed.")] = "text"
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write .json, .csv, .md, .txt, or of a strip .svg."),
    ] = None
    depfile: RuleOfOutput = None
    quiet: Silent = False

    def require_output(self, kind: str) -> None:
        """Refuse what cannot be written before anything is computed."""
        require_target(self.depfile, self.output)
        if self.output is None or self.output.suffix.lower() in FORMS or (self._is_picture() and kind == "strip"):
            return
        known = ", ".join(FORMS)
        message = f"no plan of a {kind} is written as '{self.output.suffix}': the name may end in {known}"
        raise typer.BadParameter(message + ", .svg" * (kind == "strip"), param_hint="--output")

    def _is_picture(self) -> bool:
        return self.output is not None and self.output.suffix.lower() == ".svg"

    def plan(self, kind: str, file: Path | None, options: Options) -> None:
        """Read a plan, compute it, print and write it."""
        from photostrip.library.plan import planned

        self.require_output(kind)
        with self.assigned(options) as assignments:
            plan = planned(kind, file, assignments)
        self.deliver(plan.document, plan.files)

    def deliver(self, document: Document, files: Sequence[str]) -> None:
        """Print a plan; write it, and the rule for make, when a file is named."""
        from photostrip.formats.output.plans.table import plan_csv
        from photostrip.report.commands.plans.report import plan_report

        rendering = Rendering(plan_report, plan_csv)
        if self.output is not None:
            from photostrip.formats.text.writing import write_text
            from photostrip.report.pictures.plan_strip import strip_plan_picture

            if self._is_picture():
                write_text(self.output, strip_plan_picture(document).file())
            else:
                write_text(self.output, rendering.rendered(document, FORMS[self.output.suffix.lower()]))
        if self.output is None or not self.quiet:
            rendering.show(document, self.form)
        write_rule(self.depfile, self.output, files)

    @contextmanager
    def assigned(self, options: Options) -> Iterator[list[str]]:
        """Turn options into assignments to keys; those of ``--set`` come last and win.

        Faults of the command line are reported at the option that they came from.
        """
        given = self.assignments or []
        overruled = {each.partition("=")[0] for each in given}
        names = {
            key.replace('"', ""): name
            for key, (name, value) in options.items()
            if value is not None and key not in overruled
        }
        try:
            yield [f"{key}={value}" for key, (_, value) in options.items() if value is not None] + given
        except InputError as error:
            raise InputError(_by_option(fault, names) for fault in error.faults) from None


def _by_option(fault: Fault, names: dict[str, str]) -> Fault:
    """Name the option in place of ``--set`` and the key that it stands for."""
    from photostrip.project.yaml.tree import COMMAND_LINE

    key = fault.key.replace('"', "")
    found = [name for each, name in names.items() if key and (key.startswith(each) or each.startswith(f"{key}."))]
    return replace(fault, file=found[-1], key="") if fault.file == COMMAND_LINE and found else fault
