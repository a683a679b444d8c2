"""A value of more than three fields is built by their names: nobody knows what the fourth of seven arguments means."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import pytest

from tests.source_tree import PACKAGE, ROOT, modules, nodes

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MOST = 3  # arguments without a name, and fields of a value that may be built so


@dataclass(frozen=True)
class Value:
    """A dataclass or named tuple as it stands in the source: its fields, and the full names of its bases."""

    fields: tuple[str, ...]
    bases: tuple[str, ...]
    is_value: bool


class Source:
    """The modules below a root: the values that they define, and what their names stand for."""

    def __init__(self, root: Path) -> None:
        self.nodes = {name: nodes(path) for name, path in modules(root).items()}
        self.names = {
            name: {
                node.name: f"{name}.{node.name}"
                for node in ast.iter_child_nodes(module)
                if isinstance(node, ast.ClassDef | ast.FunctionDef)
            }
            for name, (module, *_) in self.nodes.items()
        }
        for name, inside in self.nodes.items():
            for node in inside:
                if isinstance(node, ast.ImportFrom) and node.module:
                    for alias in node.names:
                        self.names[name].setdefault(alias.asname or alias.name, f"{node.module}.{alias.name}")
        self.values = {
            f"{name}.{node.name}": self._value(name, node)
            for name, inside in self.nodes.items()
            for node in inside
            if isinstance(node, ast.ClassDef)
        }

    def full_name(self, module: str, expression: ast.expr) -> str:
        """Give the full name of what an expression stands for, followed through modules that pass it on."""
        first, *rest = ast.unparse(expression).partition("[")[0].split(".")
        name = ".".join([self.names[module].get(first, first), *rest])
        home, _, last = name.rpartition(".")
        onwards = self.names.get(home, {}).get(last, name)
        return name if onwards == name else self.full_name(home, ast.Name(last))

    def _value(self, module: str, node: ast.ClassDef) -> Value:
        fields = [
            each.target.id
            for each in node.body
            if isinstance(each, ast.AnnAssign)
            and isinstance(each.target, ast.Name)
            and "ClassVar" not in ast.unparse(each.annotation)
            and not (isinstance(each.value, ast.Call) and "init=False" in ast.unparse(each.value))
        ]
        marks = [ast.unparse(each) for each in (*node.decorator_list, *node.bases)]
        is_value = any("dataclass" in mark or mark == "NamedTuple" for mark in marks)
        bases = tuple(self.full_name(module, base) for base in node.bases)
        return Value(tuple(fields), bases, is_value)

    @cache  # noqa: B019 (lives as long as the test)
    def fields(self, name: str) -> int:
        """Count the fields of a value, those of its bases too; 0 for what is no value."""
        value = self.values.get(name)
        if value is None:
            return 0
        inherited = sum(self.fields(base) for base in value.bases)
        return inherited + len(value.fields) if value.is_value or inherited else 0


def bare_calls(nodes: list[ast.AST]) -> Iterator[tuple[ast.Call, str]]:
    """Give the calls with more than three arguments without a name; of ``cls(...)`` also the class that it is."""
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    for node in nodes:
        if isinstance(node, ast.Call) and (len(node.args) > MOST or any(isinstance(a, ast.Starred) for a in node.args)):
            builds_itself = ast.unparse(node.func) == "cls"
            yield node, next((each.name for each in classes if builds_itself and node in ast.walk(each)), "")


def built_without_names(root: Path) -> list[str]:
    """Give every call below `root` that builds a value of more than three fields with four or more bare arguments."""
    source = Source(root)
    found = []
    for module, nodes_of_module in source.nodes.items():
        for node, inside in bare_calls(nodes_of_module):
            name = f"{module}.{inside}" if inside else source.full_name(module, node.func)
            if source.fields(name) > MOST:
                found.append(f"{module}:{node.lineno} builds {name.rpartition('.')[2]}")
    return found


@pytest.mark.slow
def test_values_are_built_by_name() -> None:
    assert built_without_names(ROOT) == []


VALUES = """
from dataclasses import dataclass
from typing import NamedTuple


@dataclass
class Wide:
    a: int
    b: int
    c: int
    d: int = 0

    @classmethod
    def of(cls):
        return {here}


class Narrow(NamedTuple):
    a: int
    b: int
    c: int


@dataclass
class Wider(Narrow):
    e: int
"""


@pytest.mark.parametrize(
    ("call", "found"),
    [
        ("Wide(1, 2, 3, 4)", True),
        ("Wide(1, 2, *rest)", True),
        ("Wide(1, 2, 3, d=4)", False),
        ("Wide(a=1, b=2, c=3, d=4)", False),
        ("Narrow(1, 2, 3)", False),
        ("Narrow(*three)", False),
        ("Wider(1, 2, 3, 4)", True),
        ("Other(1, 2, 3, 4)", False),
        ("values.Wide(1, 2, 3, 4)", True),
        ("passed.Wide(1, 2, 3, 4)", True),
    ],
)
def test_a_value_without_names_is_found(tmp_path: Path, call: str, *, found: bool) -> None:
    write(tmp_path, call=call)
    assert [each.partition(" ")[0] for each in built_without_names(tmp_path)] == [f"{PACKAGE}.calls:5"] * found


@pytest.mark.parametrize(("call", "found"), [("cls(1, 2, 3, 4)", True), ("cls(1, b=2, c=3)", False)])
def test_a_class_that_builds_itself_is_found(tmp_path: Path, call: str, *, found: bool) -> None:
    write(tmp_path, inside=call)
    assert bool(built_without_names(tmp_path)) is found


def write(root: Path, call: str = "None", inside: str = "None") -> None:
    """Write a package of values, a module that passes them on, and one that builds them."""
    texts = {
        "values": VALUES.replace("{here}", inside),
        "passed": f"from {PACKAGE}.values import Wide",
        "calls": f"from {PACKAGE} import passed, values\nfrom {PACKAGE}.passed import Wide\n"
        f"from {PACKAGE}.values import Narrow, Wider\n\n{call}",
    }
    for name, text in texts.items():
        path = root / PACKAGE / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
