"""The same deformation of an oriented model in closed form, for level ground: sums over the control, no operators.

It checks the operators of ``single_model``, and is checked by them; the source prints this form.

Source: [000] eq. 9-11 with nine corrections, each listed by ``photostrip sources`` and shown to be necessary by a test.
With ``printed`` the functions compute what stands in print.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats

ORDER = ("dbz", "dkappa", "dalpha", "domega")


def control_sums(control: ArrayLike) -> Floats:
    """Add up c1 to c15 over the control points (n, 2): m(u, v) = sum of u v less the product of the sums over n."""
    x, y = np.asarray(control, float).T
    pairs = (
        (x, x), (y, y), (x, y), (x * x, x), (y * y, y), (x * x, y), (y * y, x), (x * y, y), (x * y, x),
        (x**3, x), (x**3, y), (x * x * y, x), (x * y * y, y), (x * x * y, y), (x * y * y, x),
    )  # fmt: skip
    return np.array([u @ v - u.sum() * v.sum() / len(x) for u, v in pairs])


def coefficients(points: ArrayLike, control: ArrayLike, base: float, depth: float, *, printed: bool = False) -> Floats:
    """Errors of points of the oriented model per error of each element.

    points, control: (q, 2), (n, 2), x and y from the left nadir; all control is given in plan and height.
    base, depth: b and the depth Z of all points.
    Returns (q, 3, 4), coefficients of x, y, height in the order of `ORDER`; dby drops out.
    """
    along, across = _plan(points, control, base, depth, printed=printed)
    return np.stack([along, across, _height(points, control, base)], axis=1)


class Kernels(NamedTuple):
    """What a misclosure at each control point gives to the coordinates of each point, shape (q, n) each."""

    # plan of a point from misclosures: x from x, x from y, y from x, y from y
    along_along: Floats
    along_across: Floats
    across_along: Floats
    across_across: Floats
    up: Floats  # height from height


def kernels(points: ArrayLike, control: ArrayLike, *, printed: bool = False) -> Kernels:
    """Give the weights that misclosures at the control have in eq. 9-11; all control is given in plan and height."""
    xy = np.asarray(control, float)
    c1, c2, c3 = control_sums(xy)[:3]
    x, y = (np.asarray(points, float) - xy.mean(axis=0)).T[:, :, None]
    u, v = (xy - xy.mean(axis=0)).T[:, None, :]
    size, area, share = c1 + c2, c1 * c2 - c3**2, 1 / len(xy)
    if printed:
        across, crossed = (y * u + x * v) / size, (y * v - x * u) / size
        tilt = -x * (c2 * u + c3 * v) - y * (c3 * u - c1 * v)
    else:
        across, crossed = (y * v + x * u) / size, (y * u - x * v) / size
        tilt = x * (c2 * u - c3 * v) - y * (c3 * u - c1 * v)
    return Kernels(
        along_along=share + (x * u + y * v) / size,
        along_across=(x * v - y * u) / size,
        across_along=crossed,
        across_across=share + across,
        up=share + tilt / area,
    )


def _reduced(points: ArrayLike, control: ArrayLike) -> dict[str, Floats]:
    """Return the differences [g] = g of the point less the mean of g over the control."""
    found = {}
    (x, y), (u, v) = np.asarray(points, float).T, np.asarray(control, float).T
    for name in ("x", "y", "xx", "xy", "yy", "xxx", "xxy", "xyy"):
        p, q = name.count("x"), name.count("y")
        found[name] = x**p * y**q - (u**p * v**q).mean()
    return found


def _plan(points: ArrayLike, control: ArrayLike, base: float, depth: float, *, printed: bool) -> tuple[Floats, Floats]:
    """Rows of x (eq. 9) and y (eq. 10)."""
    c1, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12, c13, c14, c15 = control_sums(control)
    b, z = base, depth
    p = (
        b / 2 * c3 - c5 - c9,
        b * c1 + b / 2 * c2 - c4 - c8,
        (b**2 + z**2) * c1 + (b**2 / 2 + z**2) * c2 - 2 * b * c4 - 1.5 * b * c8 + c10 + c14,
        b / 2 * c5 + b * c9 - c12 - c13,
    )
    q = (
        b / 2 * c1 - c7 + c8,
        b / 2 * c3 - c6 + c9,
        b**2 / 2 * c3 - 2 * b * c6 + 1.5 * b * c9 + c11 - c12,
        b / 2 * c7 - b * c8 + c14 - c15,
    )
    g = _reduced(points, control)
    x, y = g["x"] / (c1 + c2), g["y"] / (c1 + c2)  # X / B, Y / B
    kappa, other = 1 / b, 1 / (b * z)
    stretched, sign, turned, risen, squares = b**2 + z**2, -1.0, q[0], b**2 / 2 + z**2, g["yy"]
    if printed:
        stretched, sign, risen = b + z**2, 1.0, (b**2 + z**2) / 2
        turned = b / 2 * c1 - c7 - c8
        at, given = np.asarray(points, float)[:, 1], np.asarray(control, float)[:, 1]
        squares = at**2 - given.mean()
    along = (
        (g["xx"] - b * g["x"] + x * p[1] + y * q[1]) * other,
        (-g["xy"] - x * p[0] + y * q[0]) * kappa,
        (g["xxx"] - 2 * b * g["xx"] + stretched * g["x"] - x * p[2] - y * q[2]) * other,
        (g["xxy"] - b * g["xy"] + x * p[3] + sign * y * q[3]) * other,
    )
    across = (
        (g["xy"] - b / 2 * g["y"] + y * p[1] - x * q[1]) * other,
        (b / 2 * g["x"] - g["yy"] - y * p[0] - x * turned) * kappa,
        (g["xxy"] - 1.5 * b * g["xy"] + risen * g["y"] - y * p[2] + x * q[2]) * other,
        (-b / 2 * squares + g["xyy"] + y * p[3] + x * q[3]) * other,
    )
    return np.stack(along, axis=-1), np.stack(across, axis=-1)


def _height(points: ArrayLike, control: ArrayLike, base: float) -> Floats:
    """Rows of the height (eq. 11); dbz and dkappa do not deform heights."""
    c1, c2, c3, c4, _, c6, _, c8, c9, *_ = control_sums(control)
    g = _reduced(points, control)
    area = c1 * c2 - c3**2
    x, y = g["x"] / area, g["y"] / area
    bend = -g["xx"] + x * (c2 * c4 - c3 * c6) + y * (c1 * c6 - c3 * c4)
    twist = -g["xy"] + x * (c2 * c9 - c3 * c8) + y * (c1 * c8 - c3 * c9)
    zero = np.zeros_like(bend)
    return np.stack([zero, zero, bend / base, twist / base], axis=-1)
