"""LAPACK without the rest of scipy.linalg: the same functions, at a fiftieth of the time."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

from photostrip.triangulation.bundle.normal_equations import lapack as module

if TYPE_CHECKING:
    import pytest

ALONE = """
import sys
from photostrip.triangulation.bundle.normal_equations.lapack import lapack
functions = [lapack().dpbtrf, lapack().dpbtrs, lapack().dtrtri]
assert "scipy" not in sys.modules, "loaded with its package"
import scipy.linalg, scipy.linalg.lapack
assert functions == [getattr(scipy.linalg.lapack, name) for name in ("dpbtrf", "dpbtrs", "dtrtri")]
assert scipy.linalg.cholesky_banded([[4.0, 4.0], [1.0, 0.0]], lower=True)[0, 0] == 2.0
"""


def test_the_compiled_module_loads_alone_and_serves_scipy_afterwards() -> None:
    subprocess.run([sys.executable, "-c", ALONE], check=True)


def test_where_it_does_not_load_alone_scipy_gives_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy.linalg import lapack as whole

    def refused() -> None:
        raise ImportError

    module.lapack.cache_clear()
    monkeypatch.delitem(sys.modules, module.MODULE)
    monkeypatch.setattr(module, "_alone", refused)
    try:
        assert module.lapack() is whole
    finally:
        module.lapack.cache_clear()
