"""Colours, marks and sizes of all pictures, drawn by matplotlib (plans, terrestrial) or by ``svg`` (pages).

The colour-blind can distinguish them: the series are those of Okabe and Ito without yellow, which is lost on
white; what matters differs in mark or dash as well. The colours of roles are those of the light page, where
``templates/report.css`` has them for dark screens and paper, too.
"""

from __future__ import annotations

SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#6b7686")
ROLES = {"control": "#a8201a", "check": "#0b57a4", "new": "#6b7686", "photo": "#1c2430"}  # of a point, or a photo
MOVED, NOT_SIGNIFICANT, STABLE = ROLES["control"], ROLES["new"], ROLES["check"]  # points of a displacement
INK = "#1c2430"
SURFACE = "viridis"  # colour map of isolines: even steps for every eye, also in grey

USES = {  # of control: matplotlib's mark, and its name
    "xyz": ("^", "control"),
    "xy": ("s", "control in plan"),
    "z": ("o", "control in height"),
}
METHODS = {  # dashes of matplotlib
    "similarity": ":",
    "degree 1": (0, (1, 3)),
    "degree 2": "--",
    "degree 3": "-.",
    "bundle": "-",
}
SMALL_TEXT = 7  # points: ids, legends, ticks
LEVELS = 9  # isolines of a surface
DOTS_PER_INCH = 120  # of PNG
