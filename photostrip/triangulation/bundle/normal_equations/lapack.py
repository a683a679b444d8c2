"""Functions of LAPACK on bands, from scipy's compiled module alone.

``import scipy.linalg`` takes as long as numpy, yaml and pyproj together (0.25 s), the module that it takes them from
0.005 s.
"""

from __future__ import annotations

import sys
from functools import cache
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from typing import Any

MODULE = "scipy.linalg._flapack"  # as scipy calls it: who imports scipy.linalg later finds it loaded


@cache
def lapack() -> Any:  # noqa: ANN401 (a compiled module)
    """Load scipy's compiled LAPACK at first need; through scipy.linalg where it does not load alone."""
    if MODULE not in sys.modules:
        try:
            sys.modules[MODULE] = _alone()
        except ImportError:
            from scipy.linalg import lapack as whole

            return whole
    return sys.modules[MODULE]


def _alone() -> Any:  # noqa: ANN401
    scipy = find_spec("scipy")  # does not import it
    folders = [f"{folder}/linalg" for folder in (scipy.submodule_search_locations or ())] if scipy else []
    spec = PathFinder.find_spec(MODULE, folders)
    if spec is None or spec.loader is None:
        raise ImportError(MODULE)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
