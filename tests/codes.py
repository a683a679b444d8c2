"""Every code that photostrip can tell, read from the calls in its source."""

from __future__ import annotations

import ast
import re
from functools import cache
from typing import TYPE_CHECKING

from tests.source_tree import modules, nodes

if TYPE_CHECKING:
    from collections.abc import Iterator

CODE = re.compile(r"[a-z]+(-[a-z0-9]+)*")
# What is called, and which of its positional arguments is the code, the likeliest first; as a keyword it is `code`.
FUNCTIONS: dict[str, tuple[int, ...]] = {
    "Fault": (1,), "GeometryError": (), "Note": (0,), "Refusal": (), "_note": (0,), "_of_images": (0,), "_refuse": (2,),
    "fault": (0,), "fault_at": (3,), "reason": (0,), "refuse": (1,), "wrong": (),
}  # fmt: skip
# A place in the project file knows where it stands; a table takes row and column before message and code.
METHODS: dict[str, tuple[int, ...]] = {"_add": (3,), "_refuse": (2,), "fault": (3, 1), "note": (0, 1), "refuse": (2, 1)}
UNNAMED = {"input", "geometry", "tolerance", "value"}  # what has no code of its own


@cache
def codes() -> dict[str, str]:
    """Give every code with the first place where it is told: ``module:line``."""
    found = dict.fromkeys(UNNAMED, "photostrip.errors")
    for module, path in sorted(modules().items()):
        for node in nodes(path):
            for expression in _candidates(node):
                for code in _texts(expression):
                    if CODE.fullmatch(code):
                        found.setdefault(code, f"{module}:{expression.lineno}")
    return found


def _candidates(node: ast.AST) -> Iterator[ast.expr]:
    """Give the argument of a call that is a code, and the code of a returned pair (message, code)."""
    if isinstance(node, ast.Return) and isinstance(node.value, ast.Tuple) and len(node.value.elts) == 2:
        last = node.value.elts[1]
        if any("-" in text for text in _texts(last)):
            yield last
    if not isinstance(node, ast.Call):
        return
    if isinstance(node.func, ast.Name):
        known, name = FUNCTIONS, node.func.id
    elif isinstance(node.func, ast.Attribute):
        known, name = METHODS, node.func.attr
    else:
        return
    if name not in known:
        return
    yield from (each.value for each in node.keywords if each.arg == "code")
    given = [node.args[place] for place in known[name] if len(node.args) > place]
    yield from [argument for argument in given if any(_texts(argument))][:1]


def _texts(expression: ast.expr) -> Iterator[str]:
    """Give the texts that an expression can be: a constant, or either side of a condition."""
    if isinstance(expression, ast.Constant) and isinstance(expression.value, str):
        yield expression.value
    elif isinstance(expression, ast.IfExp):
        yield from _texts(expression.body)
        yield from _texts(expression.orelse)
