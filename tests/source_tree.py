"""The package as a tree of modules and what each of them imports, read from the source without running it."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = "photostrip"


@dataclass(frozen=True, slots=True)
class Import:
    """One imported name: in which module, on which line, and its full dotted name."""

    module: str
    line: int
    target: str

    def __str__(self) -> str:
        return f"{self.module}:{self.line} imports {self.target}"


@cache
def modules(root: Path = ROOT) -> dict[str, Path]:
    """Give every module of the package below `root` with its file."""
    found = {}
    for path in sorted((root / PACKAGE).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Give every node of a module, itself first; read once for all tests of a process."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))))


@cache
def imports(root: Path = ROOT) -> list[Import]:
    """Give every import of the package, also those inside functions and under ``TYPE_CHECKING``.

    ``from a import b`` counts as ``a.b``; whether ``a.b`` is a module or a name in ``a`` is for the caller to see.
    """
    return [found for module, path in modules(root).items() for found in _imports_of(module, path)]


def _imports_of(module: str, path: Path) -> list[Import]:
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found += [Import(module, node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")
                base = ".".join([*above[: len(above) - node.level + 1], *([base] if base else [])])
            found += [Import(module, node.lineno, f"{base}.{alias.name}") for alias in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
            found += [
                Import(module, node.lineno, argument.value)
                for argument in node.args[:1]
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str)
            ]
    return found


def resolve(target: str, known: dict[str, Path]) -> str:
    """Give the module that `target` names or stands in; empty when it is not of this package."""
    while target and target not in known:
        target = target.rpartition(".")[0]
    return target
