"""Run the notebooks where they lie and store what they show: ``python -m tests.renew_notebooks``."""

from __future__ import annotations

import ast
import contextlib
import io
import json
from pathlib import Path
from typing import Any

from tests.source_tree import ROOT

NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))
SHOWN = {"text/html": "_repr_html_", "image/svg+xml": "_repr_svg_"}  # what Jupyter asks an object for

Notebook = dict[str, Any]


def run(path: Path) -> Notebook:
    """Give a notebook as it is with the outputs that it has now."""
    notebook: Notebook = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, object] = {}
    with contextlib.chdir(path.parent):  # as Jupyter does
        for number, cell in enumerate((each for each in notebook["cells"] if each["cell_type"] == "code"), 1):
            cell["execution_count"], cell["outputs"] = number, _outputs("".join(cell["source"]), number, names)
    return notebook


def _outputs(code: str, number: int, names: dict[str, object]) -> list[dict[str, Any]]:
    """Run a cell; give what it prints and what Jupyter shows of its last line."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), names)  # noqa: S102 (our own notebook)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # noqa: S307 (our own notebook)
    found: list[dict[str, Any]] = []
    if printed.getvalue():
        found.append({"name": "stdout", "output_type": "stream", "text": lines(printed.getvalue())})
    if value is not None:
        data = {kind: lines(getattr(value, name)()) for kind, name in SHOWN.items() if hasattr(value, name)}
        if "image/svg+xml" not in data:
            data["text/plain"] = lines(repr(value))
        found.append({"output_type": "execute_result", "execution_count": number, "metadata": {}, "data": data})
    return found


def lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def page(notebook: Notebook) -> str:
    """Give a notebook as a page of the site."""
    parts = []
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(text)
            continue
        parts.append(f"```python\n{text}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {"text/plain": output.get("text")})
            kind = next(each for each in ("image/svg+xml", "text/html", "text/plain") if each in data)
            shown = "".join(data[kind])
            parts.append(f"```text\n{shown.rstrip()}\n```" if kind == "text/plain" else f"<div>\n{shown}\n</div>")
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Store the outputs of every notebook."""
    for path in NOTEBOOKS:
        path.write_text(json.dumps(run(path), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
