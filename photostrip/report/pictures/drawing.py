"""A figure of matplotlib and its bytes: the same input gives the same bytes, whatever the user's configuration says.

matplotlib is an extra; it is imported when a picture is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from photostrip.errors import Fault, InputError
from photostrip.report.pictures.style import DOTS_PER_INCH, LEVELS, SURFACE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INSTALL = "pip install photostrip[report]"


def check_matplotlib(key: str, of: str = "") -> None:
    """Refuse pictures without matplotlib, before anything is computed."""
    try:
        missing = find_spec("matplotlib") is None
    except ValueError:  # put out of action: sys.modules["matplotlib"] is None
        missing = True
    if missing:
        message = f"{of}pictures need matplotlib, which is not installed"
        raise InputError(Fault(message, "extra", key=key, fix=INSTALL))


@contextmanager
def drawn_alike() -> Iterator[None]:
    """Draw in matplotlib's own style, with words as words and without random ids."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams["svg.hashsalt"] = "photostrip"
        mpl.rcParams["svg.fonttype"] = "none"
        yield


def new_figure(width: float, height: float, title: str = "") -> Figure:
    """Return an empty figure; its size is in inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    if title:
        figure.suptitle(title)
    return figure


def as_svg(figure: Figure) -> str:
    """Return a figure as SVG, without date and without blanks at the ends of lines."""
    stream = BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": "photostrip"})
    return "".join(f"{line.rstrip()}\n" for line in stream.getvalue().decode().splitlines())


def as_png(figure: Figure) -> bytes:
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=DOTS_PER_INCH, metadata={"Software": "photostrip"})
    return stream.getvalue()


def isolines(axes: Axes, x: ArrayLike, y: ArrayLike, surface: ArrayLike, *, filled: bool) -> None:
    """Draw lines of equal value with their numbers; none on a plane.

    The surface has a row for each y. Filled areas are dark where the value is small.
    """
    if np.ptp(surface) > 0:
        colours = f"{SURFACE}_r" if filled else SURFACE
        if filled:
            axes.contourf(x, y, surface, levels=LEVELS, cmap=colours, alpha=0.35)
        axes.clabel(axes.contour(x, y, surface, levels=LEVELS, cmap=colours), fmt="%.3g")
