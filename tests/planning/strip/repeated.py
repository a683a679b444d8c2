"""One geometry, measured many times with errors: the scatter of adjusted points beside what a plan expects."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.network.adjustment import solve
from photostrip.pipeline.formed_photos import form_strip
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.strip_method import adjust_formed
from photostrip.planning.ideal_strip import (
    BUNDLE,
    DEGREES,
    ControlLayout,
    StripGeometry,
    bundle_problem,
    control_of,
    ideal_strip,
    numbers_of,
    spots_of,
)
from photostrip.points import ControlPoints
from photostrip.strip import polynomial
from photostrip.strip.relative_orientation import RelativeSettings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.planning.ideal_strip import IdealStrip, Spot

    Floats = NDArray[np.float64]

SEED = 20_240


def scatter(geometry: StripGeometry, layout: ControlLayout, methods: Sequence[str], count: int) -> dict[str, Floats]:
    """Give the standard deviations of the errors of all points over so many repetitions, (q, 3), by method.

    Every strip is formed once from its measurements, and taken to the ground by all methods.
    """
    strip = ideal_strip(geometry)
    errors: dict[str, list[Floats]] = {method: [] for method in methods}
    spots = spots_of(layout, geometry.photos, geometry.points.rows)
    frames, _ = tie_frames([FrameSpec("local", ("east", "north", "up"))])
    for number in range(count):
        rng = np.random.default_rng([SEED, number])
        inputs = measured(strip, spots, layout, rng)
        for method in methods:
            if method == BUNDLE:
                solved = bundled(strip, layout, inputs)
            else:
                formed = form_strip(inputs.strips[0], inputs.observations, run_settings(method))
                solved = adjust_formed(formed, inputs.control, frames, run_settings(method)).cartesian
            errors[method].append(solved - strip.xyz)
    return {method: np.std(each, axis=0) for method, each in errors.items()}


def measured(strip: IdealStrip, spots: tuple[Spot, ...], layout: ControlLayout, rng: np.random.Generator) -> Inputs:
    """Give a strip as it would be measured: errors in the image coordinates and in the control."""
    observed = strip.observations
    control = control_of(strip, spots, layout.sigma)
    names = tuple(observed.point_ids[strip.formed.point[number]] for number in numbers_of(strip, spots))
    return Inputs(
        "plan",
        (Strip("A", strip.geometry.camera, strip.photos),),
        replace(observed, xy=observed.xy + rng.normal(size=observed.xy.shape) * observed.sigma),
        ControlPoints(
            names,
            control.enu + rng.normal(size=control.enu.shape) * control.sigma,
            control.use,
            control.check,
            control.sigma,
        ),
        (FrameSpec("local", ("east", "north", "up")),),
    )


def run_settings(method: str) -> Settings:
    """Give settings of a run by one of the methods, without a search for gross errors."""
    return Settings(
        relative=RelativeSettings(screening="none"),
        polynomial=polynomial.PolynomialSettings(DEGREES.get(method, "auto")),
        adjustment="polynomial" if method in DEGREES else method,
        precision=False,  # it is what the plan says that is compared with the scatter
    )


def bundled(strip: IdealStrip, layout: ControlLayout, inputs: Inputs) -> Floats:
    """Coordinates of the points of the strip by a bundle adjustment that starts at the truth."""
    control = inputs.control
    names = [inputs.observations.point_ids[number] for number in strip.formed.point]
    numbers = np.array([names.index(name) for name in control.ids], np.intp)
    problem = bundle_problem(strip, layout, numbers, control)
    seen = np.isin(inputs.observations.point, strip.formed.point)
    given = np.where(control.use, control.enu, strip.xyz[numbers])
    problem = replace(
        problem,
        images=replace(problem.images, xy=inputs.observations.xy[seen]),
        control=replace(problem.control, xyz=given),
    )
    xyz: Floats = solve(problem).points
    return xyz
