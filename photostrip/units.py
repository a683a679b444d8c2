"""How many smaller units make a larger one."""

from __future__ import annotations

import math

MICROMETRES = 1000.0  # in a millimetre
MILLIMETRES = 1000.0  # in a metre
ARCSECONDS = 3600.0 * math.degrees(1.0)  # in a radian
