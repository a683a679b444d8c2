"""What all control of a strip shares, that of one list, or its check points: a principal distance, another frame.

What a bundle adjustment took up as common to all camera positions, or to all photos of a camera.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import floor, log10

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.network.hypotheses import (
    ALL,
    BACKWARDS,
    DISTANCE,
    DRIFT,
    EXCHANGED,
    FILM,
    FORWARDS,
    HEIGHTS_ONLY,
    LENS,
    LIST,
    OF_CAMERAS,
    OF_LENSES,
    OF_PHOTOS,
    OFFSET,
    ORDER,
    POINT,
    REVERSED,
    SHIFT,
    SHOWN_SIGMAS,
    SIGMAS,
    Hypothesis,
)
from photostrip.network.observations import drift_columns
from photostrip.network.problem import CALIBRATION
from photostrip.network.reliability import CONTROL, POSITION, Parameter
from photostrip.notes import Finding, listed
from photostrip.pipeline.evidence import OnControl
from photostrip.pipeline.formed_models import LinkedModels
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.frames import curvature_left_out
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.results import Bundle, Result
from photostrip.plausibility import found
from photostrip.plausibility.finding import CAUSES, Evidence
from photostrip.plausibility.given_points import (
    CURVED_SIGMAS,
    Shared,
    ShiftedList,
    StretchedHeights,
    find_shared,
    significant,
)
from photostrip.points import ControlPoints
from photostrip.strip.fitted_strip import CheckErrors

Common = StretchedHeights | ShiftedList
FIX = "take it from the certificate"
LEAST_WRONG = 0.03  # of a principal distance, from which it is wrong and not only another one
OTHER_PLACE = "is its crs the right one: zone, datum, false easting?"
OTHER_HEIGHTS = "are its heights of the same kind as those of the others: `height`, `geoid_undulation`, datum?"


def of_formed(laid: OnControl, stage: FormedPhotos | LinkedModels) -> list[Finding]:
    """Name what the control of a strip shares that is formed, and not adjusted."""
    shared = find_shared(laid.counted)
    photos = stage.strip if isinstance(stage, FormedPhotos) else None
    return [] if shared is None else list(_named(shared, laid.counted.control, stage.strip.id, photos))


def _named(shared: Common, control: ControlPoints, strip: str, photos: Strip | None) -> Iterator[Finding]:
    """Name what the control of a strip shares; photos: the strip where it is one of photos, which have a camera."""
    if isinstance(shared, ShiftedList):
        yield shifted_list(shared, control, f"strip {strip}", (strip,), "")
    elif photos is not None:
        yield _stretched(photos, shared)


def shifted_list(shared: ShiftedList, control: ControlPoints, whose: str, strips: Sequence[str], then: str) -> Finding:
    """Name a control list that lies beside the other control, or beside all else that is given (P404, P407).

    shared: its number may be ``HEIGHTS_ONLY``, whatever the list.
    control: control that counts, of all lists.
    """
    plan, steps, evidence = _described(shared.shift, shared.sigma)
    inside = np.flatnonzero(control.frame == shared.number)
    key, what = f"control[{shared.number}]", f"control[{shared.number}] lies"
    if shared.number == HEIGHTS_ONLY:
        inside = np.flatnonzero(~control.use[:, :2].any(axis=1))
        key, what = "control", "what is given in height only lies"
    message = f"{what} beside the other control of {whose}, all of it by {steps}{then}"
    fix = OTHER_PLACE if plan else OTHER_HEIGHTS
    points = [control.ids[row] for row in inside.tolist()]
    return found("P407" if plan else "P404", message, fix, evidence, points=points, strips=strips, key=key)


def _described(shift: Floats, sigma: Floats) -> tuple[bool, str, Evidence]:
    """Say whether a shift (3,) is most significant in plan, and what it is; NaN where nothing is given."""
    plan = GROUND_AXES[int(np.nanargmax(np.abs(shift) / sigma))] != "up"
    known = [each for each in zip(GROUND_AXES, shift.tolist(), sigma.tolist(), strict=True) if np.isfinite(each[1])]
    steps = ", ".join(f"{step:+.2f} m {axis} (standard deviation {own:.2g} m)" for axis, step, own in known)
    return plan, steps, {f"offset_{axis}_m": step for axis, step, _ in known}


def find_shifted_checks(result: Result) -> Iterator[Finding]:
    """Find lists whose check points all lie beside the result by one shift (P411): they must not look wrong one by one.

    Strips that are adjusted one by one are tested together.
    """
    control = result.inputs.control
    lists = dict(zip(control.ids, control.frame.tolist(), strict=True))
    known = [each for each in (() if result.precision is None else result.precision.checks) if each is not None]
    rows = [np.array([lists[each.ids[point]] for point in each.point]) for each in known]
    for number in np.unique(control.frame[control.check]).tolist():
        of_list = [each.take(np.flatnonzero(own == number)) for each, own in zip(known, rows, strict=True)]
        axes, shared = _common_shift([each for each in of_list if each.coordinates])
        if shared is None:
            continue
        shift, sigma = np.full((2, 3), np.nan)
        shift[axes], sigma[axes] = -shared.value, shared.sigma
        plan, steps, evidence = _described(shift, sigma)
        points = [control.ids[row] for row in np.flatnonzero(control.check & (control.frame == number)).tolist()]
        key = f"control[{number}]"
        message = f"the check points of {key} all lie {steps} from where the adjustment puts them"
        fix = f"{OTHER_PLACE if plan else OTHER_HEIGHTS} The control may be off in place of them"
        yield found("P411", message, fix, evidence, points=points, key=key)


def _common_shift(checks: Sequence[CheckErrors]) -> tuple[Numbers, Shared | None]:
    """Test one shift of all check points against none, and against one wrong point; along the axes that are given."""
    axes = np.unique(np.array([axis for each in checks for axis in each.axis], np.intp))
    normal, pull, squares, alone = np.zeros((len(axes), len(axes))), np.zeros(len(axes)), 0.0, 0.0
    for each in checks:
        weight = np.linalg.inv(each.covariance)
        columns, pulled = (each.axis[:, None] == axes).astype(float), weight @ each.difference
        normal, pull = normal + columns.T @ weight @ columns, pull + columns.T @ pulled
        squares += float(each.difference @ pulled)
        for point in np.unique(each.point):
            rows = np.flatnonzero(each.point == point)
            alone = max(alone, float(pulled[rows] @ np.linalg.solve(weight[np.ix_(rows, rows)], pulled[rows])))
    count = sum(each.coordinates for each in checks)
    return axes, significant(normal, pull, squares, count - len(axes), alone)


def other_distance(
    camera: Camera, would_fit: float, message: str, fix: str, numbers: Evidence, strips: Sequence[str]
) -> Finding:
    """Name the principal distance that would fit: a small difference (P107) or a wrong one (P105)."""
    given = camera.principal_distance
    code = "P107" if abs(would_fit / given - 1.0) < LEAST_WRONG else "P105"
    evidence = numbers | {"principal_distance_mm": given, "would_fit_mm": would_fit}
    return found(code, message, fix, evidence, strips=strips, key=camera.distance_key)


def _stretched(strip: Strip, stretch: StretchedHeights) -> Finding:
    camera, factor = strip.camera, 1.0 / (1.0 + stretch.share)
    given = camera.principal_distance
    sigma = given * stretch.sigma * factor**2
    message = (
        f"the heights of strip {strip.id} are stretched by {100 * stretch.share:+.2f} % against its control, as by a "
        f"wrong principal distance: {camera.length(given * factor, '.2f', '.0f')} would fit (standard deviation "
        f"{camera.length(sigma, '.2g', '.2g')}), {camera.length(given)} is given"
    )
    numbers: Evidence = {"heights_stretched": stretch.share, "standard_deviation_mm": sigma}
    return other_distance(camera, given * factor, message, FIX, numbers, (strip.id,))


KEY = "camera_positions.correction"
CONTINUED = "The adjustment continued with it; `processing.self_calibration` confirms or refuses it"


def of_bundle(bundle: Bundle, inputs: Inputs, settings: Settings) -> Iterator[Finding]:
    """Name what a group of observations shares (P105, P107, P110, P111, P112, P208, P209, P404, P407)."""
    shared = bundle.screened.common
    yield from (_list(each, inputs) for each in shared if each.kind == LIST)
    if any(each.kind == DISTANCE for each in shared):
        of_cameras = (each for each in bundle.parameters if each.camera in inputs.camera_named)
        yield from (_distance(each, inputs) for each in of_cameras if _is_distance(each))
    radius = settings.absolute.earth_radius if curvature_left_out(inputs, settings) else None
    yield from _lens([each for each in shared if each.kind in OF_LENSES], bundle, inputs, radius)
    yield from (_point(each, bundle, inputs) for each in shared if each.kind == POINT)
    yield from (_film(each, bundle, inputs) for each in shared if each.kind == FILM)
    of_photos = [each for each in shared if each.kind in OF_PHOTOS]
    of_positions = [each for each in shared if each.kind in {OFFSET, DRIFT}]
    if len(of_photos) == 1:
        yield _photo(of_photos[0], bundle, inputs)
    elif of_photos and not of_positions:  # else they take up what one shift of wrong positions leaves
        yield _photos(of_photos, bundle, inputs)
    yield from (_order(each, bundle) for each in shared if each.kind == ORDER)
    if of_positions:
        yield from _positions(bundle, inputs, of_positions[-1])
    yield from (_sigmas(each, bundle) for each in shared if each.kind == SIGMAS)


def _sigmas(error: Hypothesis, bundle: Bundle) -> Finding:
    """Name standard deviations of positions that are too small, and how far these scatter: sqrt(vv / r) by axis."""
    problem, (group,) = bundle.screened.problem, (each for each in bundle.groups if each.kind == POSITION)
    axes = problem.position_axes
    factors = {f"{axes[0]} and {axes[1]}": error.factors[0], axes[2]: error.factors[1]}
    times = " and ".join(f"about {factor:.2g} times {where}" for where, factor in factors.items() if factor > 1.0)
    stated, scatter = {}, {}
    for axis, name, factor in zip(range(3), axes, np.repeat(error.factors, [2, 1]).tolist(), strict=True):
        given = np.isfinite(group.sigma[:, axis])
        if given.any():
            off, redundancy = group.error[given, axis], group.redundancy[given, axis]
            stated[name] = float(np.median(group.sigma[given, axis])) / factor
            scatter[name] = float(np.sqrt((off**2).sum() / max(redundancy.sum(), np.finfo(float).tiny)))
    wrong, right = (", ".join(f"{each:.2g}" for each in sigma.values()) for sigma in (stated, scatter))
    message = (
        f"the standard deviations of the camera positions ({wrong} m) are too small, {times}: they scatter by {right} "
        "m about where control and photos put them; the adjustment continued with standard deviations as much larger"
    )
    fix = CAUSES[SIGMAS].cure
    if len(scatter) == len(axes):
        fix += f" What they scatter by is `camera_positions.sigma: [{right}]`"
    numbers: Evidence = {f"factor_{where.replace(' ', '_')}": factor for where, factor in factors.items()}
    numbers |= {f"scatter_{axis}_m": each for axis, each in scatter.items()}
    photos = tuple(dict.fromkeys(problem.photo_name(int(each)) for each in problem.positions.photo))
    return found("P209", message, fix, numbers, photos=photos, key="camera_positions.sigma")


def _list(error: Hypothesis, inputs: Inputs) -> Finding:
    shift = ShiftedList(error.number, np.array(error.shift), np.array(error.sigma), gain=float("nan"))
    control = inputs.control.take(~inputs.control.check)
    strips = [each.id for each in inputs.strips]
    then = "; whether it or the others are wrong cannot be told" if LIST in error.rivals else ""
    return shifted_list(shift, control, "the block", strips, then)


def _is_distance(each: Parameter) -> bool:
    return each.name == "principal_distance" and abs(each.value) > SHOWN_SIGMAS * each.sigma


def _distance(parameter: Parameter, inputs: Inputs) -> Finding:
    camera = _camera(parameter.camera, inputs)
    would_fit = camera.principal_distance + parameter.value
    digits = 1 - floor(log10(max(camera.in_unit(parameter.sigma), 1e-6)))  # two of the standard deviation
    form = f".{max(2, digits)}f"
    of_cameras = inputs.positions is not None or (inputs.orientations is not None and inputs.orientations.observed)
    given = ["control"] * bool(inputs.frames) + ["camera positions"] * of_cameras
    message = (
        f"the photos of camera {camera.name} agree with {' and '.join(given)} at a principal distance of "
        f"{camera.length(would_fit, form, f'.{max(0, digits)}f')} (standard deviation "
        f"{camera.length(parameter.sigma, '.2g', '.2g')}); {camera.length(camera.principal_distance)} is given. The "
        "adjustment continued with the one that fits"
    )
    fix = f"{CAUSES[DISTANCE].cure}; if that agrees with what is given, {_decision(['principal_distance'])}"
    numbers: Evidence = {"standard_deviation_mm": parameter.sigma}
    return other_distance(camera, would_fit, message, fix, numbers, _strips_of(camera.name, inputs))


def _decision(names: Sequence[str]) -> str:
    return (
        f"write `processing.self_calibration: [{', '.join(names)}]` to have it estimated, or `never` to keep the "
        "camera as it is given"
    )


def _parameters(error: Hypothesis, bundle: Bundle, asked: str) -> list[Parameter]:
    """Return what was estimated of the camera that an error is of."""
    camera = bundle.screened.problem.camera_ids[error.number]
    return [each for each in bundle.parameters if each.camera == camera and each.name.startswith(asked)]


ORDERS = {
    REVERSED: "are those of the photos in reversed order",
    FORWARDS: "each belong to the photo after the one that they are given for",
    BACKWARDS: "each belong to the photo before the one that they are given for",
    EXCHANGED: "are exchanged",
}


def _order(error: Hypothesis, bundle: Bundle) -> Finding:
    problem = bundle.screened.problem
    of_rows = problem.positions.photo[list(error.pair) or slice(None)].tolist()
    photos = tuple(dict.fromkeys(problem.photo_name(each) for each in of_rows))
    whose = f"the camera positions of photos {listed(photos)}" if error.pair else "the camera positions"
    message = f"{whose} {ORDERS[error.of]}; the adjustment continued with them so"
    return found("P208", message, CAUSES[ORDER].cure, {"order": error.of}, photos=photos, key="camera_positions")


def _lens(
    errors: Sequence[Hypothesis], bundle: Bundle, inputs: Inputs, earth_radius: float | None
) -> Iterator[Finding]:
    """Name the distortion of each camera by everything that was found of it, and the curvature that it looks like.

    earth_radius: metres, where the ground frame does not have the curvature.
    """
    images = bundle.screened.problem.images
    radius, names = float(np.hypot(*images.xy.T).max()), list(CALIBRATION)
    for camera in dict.fromkeys(each.number for each in errors):
        columns = {column for each in errors if each.number == camera for column in OF_CAMERAS[each.kind]}
        kinds = [names[column] for column in sorted(columns)]
        name = bundle.screened.problem.camera_ids[camera]
        parameters = [each for each in bundle.parameters if each.camera == name and each.name in kinds]
        curved = None if earth_radius is None else _of_curvature(bundle, camera, earth_radius)
        numbers: Evidence = {"radius_mm": radius}
        if curved is not None and _looks_like(parameters, curved):
            numbers["k1_of_curvature"] = curved
        shown = [f"{_camera(name, inputs).length(radius, '.0f', '.0f')} from the principal point"]
        for each in parameters:
            um = radius ** CALIBRATION[each.name].power * 1000.0  # at that distance
            shown.append(
                f"{each.name} = {each.value:.3g} {each.unit}, {each.value * um:+.1f} µm (standard deviation "
                f"{each.sigma * um:.1f} µm)"
            )
            numbers |= {each.name: each.value, f"{each.name}_standard_deviation": each.sigma}
            numbers[f"{each.name}_um"] = each.value * um
        where = f"at a lens distortion that is not stated; {', '.join(shown)}"
        lens = _agreeing("P110", LENS, name, where, kinds, numbers, inputs)
        if "k1_of_curvature" in numbers:
            message = (
                "The Earth's curvature, which local coordinates taken as they are leave out, or a lens distortion that "
                f"is not stated bends what photos of camera {name} show: {', '.join(shown)}; the curvature would look "
                f"like k1 = {curved:.3g} mm^-2. {CONTINUED}"
            )
            fix = (
                "are these map coordinates: name their crs, or set `processing.earth_curvature: model`; is the plane a "
                f"true one (`earth_curvature: none`): {lens.fix}"
            )
            lens = replace(lens, message=message, fix=fix)
        yield lens


def _agreeing(
    code: str, cause: str, camera: str, where: str, names: Sequence[str], numbers: Evidence, inputs: Inputs
) -> Finding:
    """Name what a camera has beside what is given of it.

    names: of the parameters, as `processing.self_calibration` calls them.
    """
    message = f"photos of camera {camera} agree with each other and with what is given {where}. {CONTINUED}"
    fix = f"{CAUSES[cause].cure}; {_decision(names)}"
    return found(code, message, fix, numbers, strips=_strips_of(camera, inputs), key="processing.self_calibration")


def _of_curvature(bundle: Bundle, camera: int, earth_radius: float) -> float:
    """Return k1, mm^-2, that looks like the Earth's curvature in vertical photos: H / (2 R f^2). Source: [Kraus]."""
    problem, solution = bundle.screened.problem, bundle.screened.solution
    rays = problem.cameras.of_photo[problem.images.photo] == camera
    photo, point = problem.images.photo[rays], problem.images.point[rays]
    arm = solution.centers[photo] - solution.points[point]
    height = float(np.nanmedian(np.einsum("ni,ni->n", arm, solution.rotations[photo][:, :, 2])))
    return max(height, 0.0) / (2.0 * earth_radius * float(problem.cameras.focal[camera]) ** 2)


def _looks_like(parameters: Sequence[Parameter], curved: float) -> bool:
    """Whether the distortion of a lens is that of the Earth's curvature alone, and not zero."""
    (first, *others) = parameters
    return not others and first.name == "k1" and abs(first.value - curved) < CURVED_SIGMAS * first.sigma < curved


def _point(error: Hypothesis, bundle: Bundle, inputs: Inputs) -> Finding:
    x, y = _parameters(error, bundle, "principal_point")
    camera = _camera(x.camera, inputs)
    unit, (off_x, off_y, sigma_x, sigma_y) = camera.unit, map(camera.in_unit, (x.value, y.value, x.sigma, y.sigma))
    form = ".1f" if unit == "px" else ".3f"
    where = (
        f"at a principal point that lies {off_x:+{form}}, {off_y:+{form}} {unit} from the given one (standard "
        f"deviations {sigma_x:{form}}, {sigma_y:{form}} {unit})"
    )
    numbers: Evidence = {"x_mm": x.value, "y_mm": y.value, "standard_deviation_mm": max(x.sigma, y.sigma)}
    return _agreeing("P111", POINT, x.camera, where, ["principal_point"], numbers, inputs)


def _film(error: Hypothesis, bundle: Bundle, inputs: Inputs) -> Finding:
    (affinity,), (shear,) = (_parameters(error, bundle, name) for name in ("affinity", "shear"))
    # b1 is what x must be stretched by: the film is shorter along x by as much
    percent, sigma, turned = -100.0 * affinity.value, 100.0 * affinity.sigma, float(np.degrees(shear.value))
    where = (
        f"where the images are {abs(percent):.3f} % (standard deviation {sigma:.3f} %) "
        f"{'longer' if percent > 0 else 'shorter'} along x than along y, its axes {abs(turned):.3f}° from a right angle"
    )
    numbers: Evidence = {"x_over_y_percent": percent, "standard_deviation_percent": sigma, "shear_deg": turned}
    return _agreeing("P112", FILM, affinity.camera, where, ["affinity", "shear"], numbers, inputs)


def _photo(error: Hypothesis, bundle: Bundle, inputs: Inputs) -> Finding:
    problem = bundle.screened.problem
    name, camera = problem.photo_name(error.number), problem.camera_ids[problem.cameras.of_photo[error.number]]
    own = [each for each in bundle.parameters if each.camera == camera]
    rays = int((problem.images.photo == error.number).sum())
    numbers: Evidence
    if error.kind == SHIFT:
        x, y = (each for each in own if each.name.startswith("principal_point"))
        # in the adjustment the photo has a camera of its own
        written, owner = ("+.2f", "+.1f"), inputs.cameras[name]
        how = (
            f"shifted by {owner.length(x.value, *written)} in x and {owner.length(y.value, *written)} in y (standard "
            f"deviations {owner.in_unit(x.sigma):.2g} and {owner.length(y.sigma, '.2g', '.2g')})"
        )
        numbers = {"shift_x_mm": x.value, "shift_y_mm": y.value}
    else:
        (c,) = (each for each in own if each.name == "principal_distance")
        focal = problem.cameras.focal[problem.cameras.of_photo[error.number]]
        scale, sigma = 1.0 + c.value / focal, c.sigma / focal
        how = f"{scale:.4f} times as large as those of its neighbours (standard deviation {sigma:.1g})"
        numbers = {"scale": scale, "standard_deviation": sigma}
    message = (
        f"all image coordinates of photo {name} are {how}: once that is taken off, {rays} of its points agree with the "
        "neighbouring photos. The adjustment continued so"
    )
    strips = [strip.id for strip in inputs.strips if name in strip.photos]
    cure = CAUSES[error.kind].cure
    if error.number in problem.positions.photo:
        cure += "; or is its camera position wrong? over level ground both look alike"
    return found("P109", message, cure, numbers, photos=(name,), strips=strips)


def _photos(errors: Sequence[Hypothesis], bundle: Bundle, inputs: Inputs) -> Finding:
    """Name the cameras of photos that go with the others only by shifts of their own: no single photo is to blame."""
    names = tuple(dict.fromkeys(bundle.screened.problem.photo_name(each.number) for each in errors))
    strips = [strip for strip in inputs.strips if not set(names).isdisjoint(strip.photos)]
    cameras = list(dict.fromkeys(strip.camera.name for strip in strips))
    message = (
        f"{len(names)} photos of camera {listed(cameras)} go with the others only where their image coordinates are "
        f"shifted or enlarged, each by itself ({listed(names)}): what is given of the camera, or of these photos, is "
        "wrong"
    )
    fix = "look at principal distance and principal point of the camera, and at the fiducial marks of these photos"
    of_strips = [strip.id for strip in strips]
    return found("P111", message, fix, {"photos": len(names)}, strips=of_strips, key=f"cameras.{cameras[0]}")


def _camera(name: str, inputs: Inputs) -> Camera:
    """Return a camera by its name; of a shifted photo, which no strip names, one that is given as its own is."""
    return inputs.camera_named.get(name, inputs.strips[0].camera)


def _strips_of(camera: str, inputs: Inputs) -> list[str]:
    return [each.id for each in inputs.strips if each.camera.name == camera]


def _positions(bundle: Bundle, inputs: Inputs, error: Hypothesis) -> Iterator[Finding]:
    problem, solution, precision = bundle.screened.problem, bundle.screened.solution, bundle.screened.precision
    given = problem.positions
    calibrated = len(solution.common) - int((given.offset_sigma > 0).sum() + (given.drift_sigma > 0).sum())
    sigma = np.sqrt(np.diag(precision.common)) * bundle.unit
    for group, (offset, drift) in enumerate(zip(*drift_columns(given, calibrated), strict=True)):
        columns = np.concatenate([offset, drift])
        columns = columns[columns >= 0]
        if not (np.abs(solution.common[columns]) > SHOWN_SIGMAS * sigma[columns]).any():
            continue
        # unknowns are what has to be added to what is given
        off, drifted = (-np.where(each >= 0, solution.common[each], np.nan) for each in (offset, drift))
        length = float(np.ptp(given.time[given.group == group]))
        yield _finding(bundle, inputs, error, group, off, drifted * length if error.kind == DRIFT else None)


def _finding(
    bundle: Bundle, inputs: Inputs, error: Hypothesis, group: int, offset: Floats, drift: Floats | None
) -> Finding:
    problem = bundle.screened.problem
    rows = np.flatnonzero(problem.positions.group == group)
    axes = problem.position_axes
    name = problem.group_ids[group]
    whose = "" if error.of == ALL else f" {name}" if name.startswith("of the ") else f" of strip {name}"
    message = f"the camera positions{whose} all lie {_steps(offset, axes)} from where control and photos put them"
    evidence = _numbers("offset", offset, axes)
    correction = "offset"
    if drift is not None:
        message += f", and drift by {_steps(drift, axes)} from the first to the last"
        evidence |= _numbers("drift", drift, axes)
        correction = "drift"
    message += f"; the adjustment continued as with `correction: {correction}`"
    if DISTANCE in error.rivals:
        message += ". A wrong principal distance would explain it nearly as well"
    given = int(np.isfinite(bundle.block.problem.control.sigma).sum())
    rejected = sum(each.kind == CONTROL for each in bundle.screened.out)
    if rejected > given / 2:
        message += (
            f". Control and camera positions contradict each other: {rejected} of {given} control coordinates were "
            "rejected all the same, and which of the two is right cannot be told"
        )
    fix = f"{CAUSES[error.kind].cure}; what cannot be put right is taken up by `correction: {correction}`"
    if error.of == ALL and len(inputs.strips) > 1:
        fix += " with `group: block`"
    timed = inputs.positions is None or np.isfinite(inputs.positions.time).all()
    if drift is not None and not timed and not all(strip.listed for strip in inputs.strips):
        fix += ", which of photos in no given order needs their times: fill the column time"
    photos = tuple(dict.fromkeys(problem.photo_name(int(each)) for each in problem.positions.photo[rows]))
    return found("P208", message, fix, evidence, photos=photos, key=KEY)


def _steps(step: Floats, axes: tuple[str, str, str]) -> str:
    """Write what is known of a step: of heights alone only up."""
    return ", ".join(f"{each:+z.2f} m {axis}" for each, axis in zip(step, axes, strict=True) if np.isfinite(each))


def _numbers(name: str, step: Floats, axes: tuple[str, str, str]) -> Evidence:
    return {f"{name}_{axis}_m": float(each) for axis, each in zip(axes, step, strict=True) if np.isfinite(each)}
