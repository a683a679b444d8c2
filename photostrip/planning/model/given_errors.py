"""What given errors do to the points of one model.

They are errors of elements and of measured and given coordinates, or the misclosures that were found at the control.
Points, elements and their signs are those of ``single_model``; lengths are in one unit, as there.

Source: [000] eq. 1, 5-8; [003] eq. 10.8, 10.12.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.planning.model.deformation import base_frame_elements, parallax_error, surface_of_elements
from photostrip.planning.model.single_model import (
    AdjustedModel,
    ModelControl,
    adjust_model,
    influence,
    orientation_operator,
    orientation_parameters,
)


@dataclass(frozen=True, eq=False)
class ControlErrors:
    """Errors at the control, (n, 3) each."""

    measured: Floats  # of the measured model coordinates
    given: Floats  # of the given coordinates

    def misclosures(self, control: ModelControl, base: float, elements: Floats) -> Floats:
        """Return W = dx1 + dx2 - dX_geo (eq. 6): model minus given."""
        return self.measured + influence(control.points, base) @ elements - self.given


@dataclass(frozen=True, eq=False)
class ErrorParts:
    """Errors of points, each (q, 3): x, y, height."""

    # eq. 1: dx1 + dx2 - dx3
    measuring: Floats
    orientation: Floats
    absolute: Floats
    # eq. 8, the same total by what causes it: delta1 + delta2 + delta3
    from_measuring: Floats
    from_elements: Floats
    from_control: Floats

    @property
    def total(self) -> Floats:
        """Errors of the oriented model."""
        return self.measuring + self.orientation - self.absolute


def error_parts(
    points: ArrayLike, measured: ArrayLike, control: ModelControl, errors: ControlErrors, base: float, elements: Floats
) -> ErrorParts:
    """Errors of points of the oriented model that follow from given errors.

    points: (q, 3), x, y, depth.
    measured: (q, 3), errors of their measured model coordinates.
    elements: (5,), errors of dby, dbz, dkappa, dalpha, domega.
    """
    operator = orientation_operator(points, control)
    own, of_control = np.asarray(measured, float), influence(control.points, base) @ elements
    of_elements = influence(points, base) @ elements
    return ErrorParts(
        measuring=own,
        orientation=of_elements,
        absolute=_through(operator, errors.misclosures(control, base, elements)),
        from_measuring=own - _through(operator, errors.measured),
        from_elements=of_elements - _through(operator, of_control),
        from_control=_through(operator, errors.given),
    )


@dataclass(frozen=True, eq=False)
class Correction:
    """What misclosures at the control say of a model."""

    parameters: Floats  # (7,): of the plain absolute orientation, in the order of ``single_model.PARAMETERS``
    plain: Floats  # (q, 3): what the plain absolute orientation subtracts from the points: dx3
    adjusted: AdjustedModel  # the same with the elements as unknowns
    corrected: Floats  # (q, 3): what that subtracts


def correct_model(
    points: ArrayLike, control: ModelControl, misclosures: ArrayLike, base: float, elements: ArrayLike
) -> Correction:
    """Orient a model by its misclosures (n, 3), without and with the errors of the elements as unknowns.

    elements: (4, 4), a-priori covariance of the elements.
    """
    found = np.asarray(misclosures, float)
    adjusted = adjust_model(control, found, base, elements)
    return Correction(
        parameters=orientation_parameters(control, found),
        plain=_through(orientation_operator(points, control), found),
        adjusted=adjusted,
        corrected=adjusted.correction(points),
    )


@dataclass(frozen=True, eq=False)
class BentModel:
    """The surface into which errors of the elements bend a model."""

    surface: Floats  # (5,): E0, A, B, C, D of the heights, for x and y in mm at photo scale
    raised: Floats  # (q, 3): errors of points in the base frame, eq. 10.8: plan by the left ray, heights by the surface
    left: Floats  # (q, 3): what the absolute orientation leaves of the errors


def bend_model(points: Floats, control: ModelControl, base: float, focal: float, elements: Floats) -> BentModel:
    """Bend a level model by given errors (5,) of its elements; all lengths are in mm at photo scale."""
    xy = points[:, :2]
    turned = base_frame_elements(elements, base)
    c = parallax_error(xy, turned, focal, base)
    none = np.zeros((len(control.points), 3))
    parts = error_parts(points, np.zeros_like(points), control, ControlErrors(none, none), base, elements)
    return BentModel(
        surface=surface_of_elements(turned, 1.0, focal, base),
        raised=np.column_stack([xy / base * c[:, None], -focal / base * c]),
        left=parts.from_elements,
    )


def _through(operator: Floats, misclosures: Floats) -> Floats:
    return np.asarray(np.einsum("qanb,nb->qa", operator, misclosures), float)
