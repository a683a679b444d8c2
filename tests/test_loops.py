"""No test loops over nothing: what is looped over is written there, or goes through ``nonempty``."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

import pytest

from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator

# Functions and methods that give as many values as they are given.
KEEPING = {"enumerate", "list", "product", "reversed", "sorted", "tuple", "zip"}
METHODS = {"items", "keys", "tolist", "values"}


def unguarded(text: str) -> list[int]:
    """Give the lines of the loops and of ``all(...)`` in tests that assert nothing when there is nothing."""
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    return [
        values.lineno
        for test in functions
        if test.name.startswith("test_")
        for values in _asserted_over(test, inner=False)
        if not _written(values)
    ]


def _asserted_over(node: ast.AST, *, inner: bool) -> Iterator[ast.expr]:
    """Give what the outermost loops with an assertion, and the assertions of all, run over."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.For) and not inner and any(isinstance(each, ast.Assert) for each in ast.walk(part)):
            yield part.iter
        if isinstance(part, ast.Assert) and not inner:
            for call in ast.walk(part.test):
                if isinstance(call, ast.Call) and ast.unparse(call.func) == "all":
                    for values in call.args:
                        if isinstance(values, ast.GeneratorExp):
                            yield values.generators[0].iter
        yield from _asserted_over(part, inner=inner or isinstance(part, ast.For))


def _written(values: ast.expr) -> bool:
    """Say whether values stand in the source, as a constant of the module, or are tested to be there."""
    match values:
        case ast.Call(func=ast.Name(id="map"), args=[_, inside]):
            found = _written(inside)
        case ast.Call(func=ast.Name(id="range"), args=numbers):
            found = all(map(_written, numbers))
        case ast.Call(func=ast.Name(id=name), args=[first, *_]):
            found = name == "nonempty" or (name in KEEPING and _written(first))
        case ast.Call(func=ast.Attribute(value=inside, attr=name), args=[]):
            found = name in METHODS and _written(inside)
        case ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Set(elts=parts) | ast.Dict(values=parts):
            found = bool(parts)
        case _:
            found = isinstance(values, ast.Constant) or (isinstance(values, ast.Name) and values.id.isupper())
    return found


@pytest.mark.slow
def test_no_test_loops_over_nothing() -> None:
    files = nonempty((ROOT / "tests").rglob("test_*.py"))
    found = {str(file.relative_to(ROOT)): unguarded(file.read_text(encoding="utf-8")) for file in files}
    assert {file: lines for file, lines in found.items() if lines} == {}


@pytest.mark.parametrize(
    ("body", "found"),
    [
        ("for x in values():\n        assert x", True),
        ("for i, x in enumerate(values):\n        assert x", True),
        ("if 1:\n        for x in table['rows']:\n            assert x", True),
        ("assert all(x > 0 for x in values())", True),
        ("for x in nonempty(values()):\n        assert x", False),
        ("for x in nonempty(values()):\n        for y in x:\n            assert y", False),
        ("for i, x in enumerate(nonempty(values)):\n        assert x", False),
        ("for x in (1, 2):\n        assert x", False),
        ("for x in VALUES.items():\n        assert x", False),
        ("for i in range(3):\n        assert i < 3", False),
        ("for i in range(n):\n        assert i < 3", True),
        ("for x in []:\n        assert x", True),
        ("for x in values():\n        print(x)", False),
    ],
)
def test_a_loop_over_nothing_is_found(body: str, *, found: bool) -> None:
    assert bool(unguarded(f"def test_it():\n    {body}\n")) is found
