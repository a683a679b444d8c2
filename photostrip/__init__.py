"""Analytical strip phototriangulation, from measured image coordinates to adjusted ground coordinates.

What scripts and notebooks call; it is loaded when it is first asked for::

    result = photostrip.run("project.yaml")
    result.points["x"], result.points.units["x"]
"""

from typing import TYPE_CHECKING, Any

from photostrip.threads import limit_threads

if TYPE_CHECKING:
    from photostrip import steps
    from photostrip.errors import GeometryError, InputError, PhotostripError
    from photostrip.library.comparison import Comparison, compare
    from photostrip.library.project import Check, Project, Simulation, check, load, run, simulate
    from photostrip.library.result import Result, Table, read_result
    from photostrip.library.sheets import Plan, plan

__version__ = "0.2.0"

# The module in which each public name stands. A change here is a change for every script of a user.
_HOMES = {
    "errors": ("GeometryError", "InputError", "PhotostripError"),
    "library.comparison": ("Comparison", "compare"),
    "library.project": ("Check", "Project", "Simulation", "check", "load", "run", "simulate"),
    "library.result": ("Result", "Table", "read_result"),
    "library.sheets": ("Plan", "plan"),
}
__all__ = [
    "Check",
    "Comparison",
    "GeometryError",
    "InputError",
    "PhotostripError",
    "Plan",
    "Project",
    "Result",
    "Simulation",
    "Table",
    "check",
    "compare",
    "load",
    "plan",
    "read_result",
    "run",
    "simulate",
    "steps",
]

# Before anything can import numpy: the thread pools read these variables once, when they are loaded.
limit_threads()


def __getattr__(name: str) -> Any:  # noqa: ANN401 (any of the public names)
    """Load a public name when it is first asked for."""
    from importlib import import_module

    if name == "steps":
        return import_module("photostrip.steps")
    for home, names in _HOMES.items():
        if name in names:
            found = getattr(import_module(f"photostrip.{home}"), name)
            globals()[name] = found
            return found
    message = f"module 'photostrip' has no attribute {name!r}"
    raise AttributeError(message)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
