"""Make a copy of docs/ ready for the site (``python -m tests.reference COPY``): reference, tables, plain fences.

Names come from docstrings, commands from their help, keys of files from their descriptions, findings from their kinds.
A line ``<!-- table: NAME -->`` of a page becomes the table of that name.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import inspect
import json
import re
import textwrap
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from typer.cli import get_docs_for_click

import photostrip
from photostrip.cli.main import PROGRAM
from photostrip.cli.main import main as command_line
from photostrip.plausibility import KINDS
from photostrip.plausibility.finding import CAUSES
from photostrip.project.editors import KINDS as FILES
from photostrip.project.editors import keys_page
from photostrip.result.description import result_page
from tests.renew_notebooks import page as notebook_page

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

ARGUMENT = re.compile(r"(?:[a-z_]\w*(?:, (?=[a-z_]))?)+: ")  # ``left, right: ...`` in a docstring
PARAGRAPH = re.compile(r"(Returns|Raises|Source:?) ?")
WIDTH = 100  # of a signature on one line
STEPS = ("interior", "refine", "relative", "chain", "intersection", "scale_transfer", "strip", "absolute", "polynomial",
         "resection", "bundle", "frame", "curvature", "pair_scales", "closed_form", "deformation", "from_angles",
         "angles")  # fmt: skip


def python_page() -> str:
    """Write every public name with its signature and what its docstring says."""
    found = [getattr(photostrip, name) for name in photostrip.__all__ if name != "steps"]
    functions = [each for each in found if inspect.isfunction(each)]
    errors = [each for each in found if inspect.isclass(each) and issubclass(each, Exception)]
    classes = [each for each in found if inspect.isclass(each) and each not in errors]
    steps = [getattr(photostrip.steps, name) for name in STEPS]
    above = "What stays from version to version: see [In Python](../library.md#what-stays)."
    lines = ["# Reference: Python", "", above, ""]
    for title, listed in (("Functions", functions), ("Objects", classes), ("Errors", errors)):
        lines += [f"## {title}", ""]
        for each in listed:
            lines += _function(each, "photostrip.") if inspect.isfunction(each) else _class(each)
    lines += ["## Steps: `photostrip.steps`", "", *_prose(inspect.getdoc(photostrip.steps) or "")]
    for each in steps:
        lines += _function(each, "steps.")
    for name in photostrip.steps.__all__:
        lines += _class(getattr(photostrip.steps, name)) if name[0].isupper() else []
    return "\n".join(lines)


def _function(function: Callable[..., Any], above: str) -> list[str]:
    lines = [f"### `{above}{function.__name__}`", "", "```python", _signature(function), "```", ""]
    return [*lines, *_prose(inspect.getdoc(function) or "")]


def _class(kind: type) -> list[str]:
    """Write a class with its attributes, properties and methods."""
    lines = [f"### `{kind.__name__}`", "", *_prose(inspect.getdoc(kind) or "")]
    rows = [*_attributes(kind), *_properties(kind)]
    if rows:
        lines += ["| attribute | |", "|---|---|", *(f"| `{name}` | {_escaped(text)} |" for name, text in rows), ""]
    for name, member in _members(kind).items():
        if inspect.isfunction(member) and (not name.startswith("_") or name == "__getitem__"):
            title = f"`{kind.__name__}[key]`" if name == "__getitem__" else f"`{kind.__name__}.{name}`"
            lines += [f"#### {title}", "", "```python", _signature(member), "```", ""]
            lines += _prose(inspect.getdoc(member) or "")
    return lines


def _members(kind: type) -> dict[str, Any]:
    """Give the members of a class, those of its bases first."""
    return {name: member for part in reversed(kind.__mro__[:-1]) for name, member in vars(part).items()}


def _properties(kind: type) -> Iterator[tuple[str, str]]:
    for name, member in _members(kind).items():
        if not name.startswith("_") and (isinstance(member, property) or hasattr(member, "attrname")):
            yield name, " ".join((inspect.getdoc(member) or "").split())


def _attributes(kind: type) -> Iterator[tuple[str, str]]:
    """Return what a class sets in its ``__init__`` and describes below, and fields with the comment beside them."""
    source = textwrap.dedent(inspect.getsource(kind))
    lines, (tree,) = source.splitlines(), ast.parse(source).body
    assert isinstance(tree, ast.ClassDef)
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            beside = lines[node.lineno - 1].partition("  # ")[2]
            above: list[str] = []
            for line in reversed(lines[: node.lineno - 1]):
                if not line.strip().startswith("# ") or beside:
                    break
                above.insert(0, line.strip().removeprefix("# "))
            yield node.target.id, beside or " ".join(above) or _below(tree.body, node)
        if isinstance(node, ast.FunctionDef) and node.name == "__init__":
            for one in node.body:
                for target in ast.walk(one) if _below(node.body, one) else ():
                    if isinstance(target, ast.Attribute) and isinstance(target.ctx, ast.Store):
                        yield target.attr, _below(node.body, one)


def _below(body: list[ast.stmt], one: ast.stmt) -> str:
    """Return the text that stands below a statement."""
    after = dict(pairwise(body)).get(one)
    if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
        return " ".join(str(after.value.value).split())
    return ""


def _signature(function: Callable[..., Any]) -> str:
    signature, parts = inspect.signature(function), []
    for name, each in signature.parameters.items():
        if each.kind is each.KEYWORD_ONLY and "*" not in parts:
            parts.append("*")
        stars = "**" if each.kind is each.VAR_KEYWORD else ""
        default = "" if each.default is each.empty else f" = {each.default!r}"
        parts += [f"{stars}{name}: {each.annotation}{default}"] if name != "self" else []
    head, back = f"{function.__name__}(", f") -> {signature.return_annotation}"
    one = head + ", ".join(parts) + back
    return one if len(one) <= WIDTH else "\n".join([head, *(f"    {each}," for each in parts), back])


def _prose(text: str) -> list[str]:
    """Write a docstring: paragraphs, arguments as a list, and what is returned and raised on lines of their own."""
    lines: list[str] = []
    for paragraph in text.split("\n\n"):
        items: list[str] = []
        for line in paragraph.splitlines():
            argument = ARGUMENT.match(line)
            if argument:
                names = ", ".join(f"`{name}`" for name in argument[0].removesuffix(": ").split(", "))
                items.append(f"- {names}: {_escaped(line[argument.end() :])}")
            elif PARAGRAPH.match(line) or not items:
                items.append(_escaped(line))
            else:
                items[-1] += f" {_escaped(line.strip())}"
        for before, item in zip(["", *items], items, strict=False):
            lines += [""] if not (before.startswith("- ") and item.startswith("- ")) else []
            lines.append(item)
        lines.append("")
    return [line for before, line in zip(["", *lines], lines, strict=False) if line or before]


def _escaped(text: str) -> str:
    """Keep signs of Markdown outside of code, and write code as Markdown does."""
    parts = re.split(r"(``.*?``|`[^`]*`)", text)
    return "".join(
        f"`{part.strip('`')}`" if part.startswith("`") else re.sub(r"([*^~<$|])", r"\\\1", part) for part in parts
    )


def command_page() -> str:
    """Write every command with its arguments and options, as ``--help`` has them."""
    program = typer.main.get_command(PROGRAM)
    context = typer.Context(program, info_name="photostrip", resilient_parsing=True)
    page = get_docs_for_click(obj=program, ctx=context, name="photostrip", title="Reference: commands")
    page = re.sub(r"(?s)\*\*Commands\*\*:\n.*?(?=\n## )", "", page, count=1)
    return re.sub(r"\x08\n(.+):\n((?:  .+\n)+)", lambda found: f"{found[1]}:\n\n```text\n{found[2]}```\n", page)


def key_pages() -> dict[str, str]:
    """Write the keys of result.json, and those of all files that no page of their own has."""
    lines = ["# Reference: keys of plans, terrestrial computations, steps, tolerance profiles", ""]
    for kind, (*_, title) in FILES.items():
        if kind not in TABLES:
            lines += [f"## {title}", "", re.sub(r"(?m)^### `", "### in `", keys_page(kind))]
    above = "# Reference: keys of result.json\n\nWhat the blocks are for: see [the result](../files/result.md).\n\n"
    return {"keys": "\n".join(lines), "result": above + result_page()}


def causes() -> str:
    """List what competes in an adjustment."""
    rows = [
        (cause.title, cause.shows, ", ".join(name if name in KINDS else f"`{name}`" for name in cause.told),
         cause.cure, cause.example)
        for cause in CAUSES.values()
    ]  # fmt: skip
    return _table(("cause", "how it shows", "told as", "what cures it", "example"), rows)


def findings() -> str:
    """List every kind of finding, errors in bold."""
    rows = [(code, f"**{kind.title}**" if kind.severity == "error" else kind.title, kind.shows)
            for code, kind in KINDS.items()]  # fmt: skip
    return _table(("code", "finding (in bold: an error)", "how it shows"), rows)


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ("---",) * len(head), *rows))


def rooms() -> str:
    """List the rooms of the program with what their docstrings say first."""
    root = Path(photostrip.__file__).parent
    rows = [
        (f"`{folder.parent.relative_to(root).as_posix()}/`",
         (ast.get_docstring(ast.parse(folder.read_text(encoding="utf-8"))) or "").partition("\n")[0].replace("``", "`"))
        for folder in sorted(root.rglob("__init__.py"))[1:]
    ]  # fmt: skip
    return _table(("room", "what it holds"), rows)


TABLES: dict[str, Callable[[], str]] = {
    "causes": causes,
    "findings": findings,
    "rooms": rooms,
    "project": lambda: keys_page("project"),
    "simulation": lambda: keys_page("simulation"),
}


def for_the_site(page: str) -> str:
    """Put the tables in, and take away what stands behind the kind of a block: sites take such a line for prose."""
    page = re.sub(r"(?m)^<!-- table: (\w+) -->$", lambda found: TABLES[found[1]](), page).replace(".ipynb)", ".md)")
    return re.sub(r"(?m)^(```[a-z]+) .*$", r"\1", page)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.reference", description=__doc__)
    parser.add_argument("folder", type=Path, metavar="COPY")
    copy = parser.parse_args().folder
    for page in copy.rglob("*.md"):
        page.write_text(for_the_site(page.read_text(encoding="utf-8")), encoding="utf-8")
    for notebook in copy.rglob("*.ipynb"):
        text = notebook_page(json.loads(notebook.read_text(encoding="utf-8")))
        notebook.with_suffix(".md").write_text(text, encoding="utf-8")
    (folder := copy / "reference").mkdir(parents=True, exist_ok=True)
    (folder / "python.md").write_text(python_page(), encoding="utf-8")
    (folder / "commands.md").write_text(command_page(), encoding="utf-8")
    for name, text in key_pages().items():
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
    with (folder / "sources.md").open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
        command_line(["sources", "--format", "md"])


if __name__ == "__main__":
    main()
