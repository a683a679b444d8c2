"""Ways to read the given coordinates: columns, signs, units, rows of ids, lists, the principal distance of the photos.

Each is a row of ``READINGS``. Where a formed strip does not fit its control, it is laid on it under each of them, and
what is written has a likelihood: that of the misclosures by their joint covariance, with a price for what is taken out.
The likeliest is named, if the strip fits under it and chance does not make as much of so many. Where none fits,
something may be common to all heights or to one list (``find_shared``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.similarity import collinearity
from photostrip.network.hypotheses import HEIGHTS_ONLY
from photostrip.notes import Finding, listed
from photostrip.pipeline import evidence
from photostrip.pipeline.evidence import HeldStrip, OnControl
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.shared_errors import FIX, other_distance, shifted_list
from photostrip.plausibility import found
from photostrip.plausibility.finding import Evidence
from photostrip.plausibility.given_points import LIMIT, ShiftedList, StretchedHeights, find_shared
from photostrip.plausibility.units import FOOT, KINDS_OF_FEET, REACH_SHARE
from photostrip.points import ControlPoints, PhotoPoints, locate
from photostrip.strip.absolute_orientation import MOST_OFF, WEAK_LIMIT
from photostrip.strip.control_screening import ROUNDING

LEVEL = 1e-6  # of naming a reading where the control is read as it should be: a run fails because of it
SEARCH_LEVEL = 0.01  # of taking anything out of sound control
AS_IT_IS = (0, 1, 2)
HEIGHTS, ALL = "heights", "all"
UNITS = "bring heights and plan into one unit, or name a crs with the right unit of height"
HEIGHT = 2
DISTANCES = np.log(10.0) * np.linspace(-1.0, 1.0, 9)  # logarithms of factors, each 1.78 times the one before
UNIT_FACTOR = 5.0  # a principal distance off by more may be right, and the decimal point of the image coordinates wrong
LITTLE = 0.1  # of a principal distance: another certificate, or focus
NEAR, STEPS = 1e-4, 20  # of a principal distance, within which it is found, and trials for it
LEAST_FULL = 3  # full points that always fit
LEAST_HEIGHTS = 2  # that are the same by chance
ALIKE = 1e-6  # of the logarithm of a likelihood: rounding, where a similarity turns one reading into the other


@dataclass(frozen=True)
class Reading:
    """A way to read given coordinates, east, north, up, from those that are written."""

    code: str
    text: str
    fix: str
    order: tuple[int, int, int] = AS_IT_IS  # columns that are east, north, up
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of them; a negative one turns them over about their middle
    rows: int = 0  # by which the coordinates are moved down against the ids
    of_list: bool = False  # whether one list is read so, and not all of them
    without: str = ""  # coordinates that lie beside the others: ``HEIGHTS`` of a list, or ``ALL``
    distance: float = 1.0  # by which the principal distance is multiplied
    mirrored: bool = False  # whether it is the strip that is read otherwise: as the mirror image of itself

    @property
    def turns(self) -> bool:
        """Whether it says which way is up, or is a mirror image: then the photos must look down upon the ground."""
        return self.mirrored or self.order != AS_IT_IS or min(self.factor) < 0

    def __call__(self, control: ControlPoints, number: int | None = None) -> ControlPoints:
        """Read all given points, or those of one list."""
        rows = np.arange(len(control)) if number is None else np.flatnonzero(control.frame == number)
        source, order = np.roll(rows, self.rows), list(self.order)
        columns = {}
        for name in ("enu", "use", "sigma"):
            columns[name] = np.array(getattr(control, name))
            columns[name][rows] = columns[name][source][:, order]
        factor, some = np.array(self.factor), columns["enu"][rows]
        middle = _medians(some, columns["use"][rows])
        columns["enu"][rows] = np.where(factor < 0, middle + factor * (some - middle), factor * some)
        return replace(control, **columns)

    def beside(self, control: ControlPoints, number: int | None) -> Flags:
        """Coordinates (n, 3) that lie beside the others; of points given in height only, where it is no list."""
        inside = ~control.use[:, :HEIGHT].any(axis=1) if number is None else control.frame == number
        axes = np.array([self.without == ALL, self.without == ALL, bool(self.without)])
        return np.asarray(np.logical_and.outer(inside, axes), bool)

    def as_written(self, columns: Floats, *, signed: bool) -> Floats:
        """Bring values (n, 3) along east, north, up as they are read back to the columns as they are written."""
        result = np.empty_like(columns)
        result[:, list(self.order)] = columns / (self.factor if signed else np.abs(self.factor))
        return result


def _columns(*order: int, of_list: bool = False) -> Reading:
    names = ", ".join(GROUND_AXES[each] for each in order)
    text = f"what is called east, north, up is {names}"
    return Reading("P401", text, "", order=(order[0], order[1], order[2]), of_list=of_list)


def _heights(factor: float, text: str) -> Reading:
    return Reading("P405", text, UNITS, factor=(1.0, 1.0, factor))


AS_GIVEN = Reading("", "", "")
DISTANCE = Reading("P105", "", "", distance=np.nan)  # which is estimated
MIRRORED = Reading("P401", "", "", mirrored=True)  # of several causes, which fit alike
EXCHANGED = (1, 0, 2)  # columns of the plan
PLAN_EXCHANGED = _columns(*EXCHANGED)
OF_POSITIONS = "camera positions lie over it only so"
READINGS = (
    MIRRORED,
    PLAN_EXCHANGED,  # which degrees, and places with another map scale, tell from a mirror image
    _columns(*EXCHANGED, of_list=True),
    _columns(2, 1, 0),
    _columns(0, 2, 1),
    _columns(1, 2, 0),
    _columns(2, 0, 1),
    Reading("P401", "heights are counted downwards", "give heights, positive upwards", factor=(1.0, 1.0, -1.0)),
    Reading("P401", "it is turned over: perspective centres or heights are counted downwards",
            "give heights and z positive upwards", factor=(1.0, -1.0, -1.0)),
    _heights(FOOT, "heights in feet, plan in metres"),
    _heights(1 / FOOT, "heights in metres, plan in feet"),
    _heights(1e-3, "heights in millimetres, plan in metres"),
    _heights(1e-2, "heights in centimetres, plan in metres"),
    _heights(1e3, "heights in kilometres, plan in metres"),
    Reading("P409", "the coordinates are moved down by one row", "put the ids into the rows of their coordinates",
            rows=1),
    Reading("P409", "the coordinates are moved up by one row", "put the ids into the rows of their coordinates",
            rows=-1),
    Reading("P403", "metres read as feet", "name the right unit: the crs counts in feet, the numbers are metres",
            factor=(1 / FOOT, 1 / FOOT, 1 / FOOT), of_list=True),
    Reading("P403", "feet read as metres",
            f"name the right unit: a crs in feet, or metres in the table; {KINDS_OF_FEET}",
            factor=(FOOT, FOOT, FOOT), of_list=True),
    Reading("P404", "", "", without=HEIGHTS),
    Reading("P404", "", "", of_list=True, without=HEIGHTS),
    Reading("P407", "", "", of_list=True, without=ALL),
    DISTANCE,
)  # fmt: skip
"""Ways to read given coordinates that are wrong as a whole; of two that fit alike the first is named."""


class Better(NamedTuple):
    """A reading under which a strip fits its control."""

    reading: Reading
    number: int | None  # list that is read so; None for all
    laid: OnControl


def find_reading(
    held: HeldStrip, control: ControlPoints, frames: Sequence[GroundFrame], as_given: OnControl | None
) -> Better | None:
    """Find the reading under which a strip fits its control better than as it is given; None without one.

    Other principal distances, for which it is formed many times, are asked about only where its heights ask for them.
    """
    lists, sizes = np.unique(control.frame[held.given], return_counts=True)
    smaller = lists[np.argsort(sizes, kind="stable")][:-1].tolist()  # against a majority nothing is said
    ways = [(each, number) for each in READINGS for number in (smaller if each.of_list else [None])]
    best, least, price = None, np.inf, float(np.log(len(ways) / LEVEL))
    if as_given is not None and not as_given.is_buried:
        if _excess(as_given) < price and not as_given.found.out:
            return None
        least = _cost(as_given, AS_GIVEN) - price
    for reading, number in ways:
        aside = reading.beside(control, number)
        if not _is_asked(reading, best, as_given) or (reading.without and not aside[held.given].any()):
            continue
        way, unknowns = reading, int(aside[held.given].any(axis=0).sum())
        if reading is DISTANCE:
            factor, tried = _best_distance(held, control, frames, closely=_stretched(as_given))
            way, unknowns = replace(reading, distance=factor), 1
        else:
            strip = held.mirrored if reading.mirrored else held
            tried = strip.read(reading(control, number), frames, aside)
        if tried is None or not tried.fits or (reading.turns and not _stands(reading, tried)):
            continue
        cost = _cost(tried, way, unknowns, number)
        if cost < least - ALIKE:
            best, least = Better(reading=way, number=number, laid=tried), cost
    return best


def _is_asked(reading: Reading, best: Better | None, as_given: OnControl | None) -> bool:
    """Whether a reading could explain what another does not: that found before, or the control as it is given."""
    if reading is DISTANCE:
        return best is None and (as_given is None or not as_given.fits)
    if reading.code == "P405":
        return as_given is None or _tells(as_given, reading.factor[HEIGHT])
    return best is None or not (best.reading.mirrored and reading.order == EXCHANGED)


def _stands(reading: Reading, laid: OnControl) -> bool:
    """Whether the photos look down upon the ground under a reading that turns the control.

    All orders of the axes of one hand are one movement, so that a strip fits under each of them alike. Models without
    perspective centres do not know which way is up, and prove no column of heights.
    """
    return laid.looks_down or (laid.looks_down is None and reading.order == AS_IT_IS)


def _best_distance(
    held: HeldStrip, control: ControlPoints, frames: Sequence[GroundFrame], *, closely: bool
) -> tuple[float, OnControl | None]:
    """Form a strip with other principal distances, up to ten times shorter or longer, and find the likeliest.

    closely: whether any may be right, and not only one with the decimal point elsewhere.
    Returns the factor of the principal distance, and the strip with it on its control; None where none is formed.
    """
    costs: dict[float, float] = {}

    def cost(logarithm: float) -> float:
        formed = held.at_distance(float(np.exp(logarithm)))
        tried = None if formed is None else formed.read(control, frames)
        costs[logarithm] = np.inf if tried is None else _cost(tried, AS_GIVEN)
        return costs[logarithm]

    if closely:
        from scipy.optimize import minimize_scalar  # a sixth of a second that few runs need

        coarse = [cost(each) for each in DISTANCES]
        if not np.isfinite(coarse).any():
            return 1.0, None
        best = int(np.argmin(coarse))
        around = DISTANCES[max(best - 1, 0)], DISTANCES[min(best + 1, len(DISTANCES) - 1)]
        for inside in (around, (-LITTLE, LITTLE)):  # one that is off by little is likely in a narrow range only
            with np.errstate(invalid="ignore"):  # where it is not formed
                minimize_scalar(cost, bounds=inside, method="bounded", options={"xatol": NEAR, "maxiter": STEPS})
    elif isinstance(held.stage, FormedPhotos) and held.stage.strip.camera.format is None:  # else its size would tell
        for each in DISTANCES[[0, -1]]:
            cost(float(each))
    if not costs:
        return 1.0, None
    factor = float(np.exp(min(costs, key=lambda each: costs[each])))
    formed = held.at_distance(factor)
    return factor, None if formed is None else formed.read(control, frames)


def _stretched(as_given: OnControl | None) -> bool:
    """Whether a strip fits no control as it is, and its heights ask for another principal distance."""
    if as_given is None or as_given.fits:
        return False
    return isinstance(find_shared(as_given.counted), StretchedHeights)


def _tells(laid: OnControl, factor: float) -> bool:
    """Whether heights in another unit would differ by more than they are known: those of level ground do not."""
    place, points = laid.place.coordinates, laid.points
    heights, of_heights = points.enu[points.use[:, HEIGHT], HEIGHT], place.axis == HEIGHT
    known = np.sqrt(laid.place.joint_covariance.diagonal()[of_heights])
    return bool(len(heights) and abs(factor - 1.0) * np.ptp(heights) > LIMIT * np.median(known))


def _excess(laid: OnControl) -> float:
    """By how much the likelihood could rise where nothing was taken out: what is left beyond the redundancy."""
    return max(laid.left.squares - laid.left.freedom, 0.0) / 2.0


def _cost(laid: OnControl, reading: Reading, unknowns: int = 0, number: int | None = None) -> float:
    """Minus the logarithm of the likelihood of the coordinates as they are written, but for a constant.

    What was taken out is as likely as a single test of a search demands, and so is each unknown of the reading: a shift
    along an axis, a principal distance.
    """
    place, points = laid.place.coordinates, laid.points
    read = np.ones(len(points), bool) if number is None else points.frame == number
    factor = np.where(read[:, None], np.abs(reading.factor), 1.0)[place.point, place.axis]
    each = np.log(len(place.point) / SEARCH_LEVEL)
    unknown = len(laid.found.out) + unknowns
    size = np.linalg.slogdet(laid.place.joint_covariance)[1]
    return float(laid.left.squares / 2.0 + size / 2.0 - np.log(factor).sum() + each * unknown)


def named(better: Better, as_given: OnControl | None, held: HeldStrip, frames: Sequence[GroundFrame]) -> Finding:
    """Name the reading under which a strip fits its control (P105, P401, P403, P404, P405, P407, P409).

    frames: those in which it is given.
    """
    reading, number, tried = better
    strip = held.stage.strip.id
    if reading.without:
        return _beside(better, strip)
    numbers: Evidence = {"variance_factor": tried.variance, "coordinates": tried.found.whole.coordinates}
    if as_given is not None:
        numbers["variance_factor_as_given"] = as_given.variance
    key = "control" if number is None else f"control[{number}]"
    before = "cannot be laid on its control as it is given"
    if as_given is not None:
        before = f"is {_size(as_given):.3g} m off its control as it is given"
        before = "would lie below its control as it is given" if as_given.is_buried else before
    head = f"strip {strip} {before}, and {_size(tried):.2g} m off it if"
    if reading.distance != 1.0 and isinstance(held.stage, FormedPhotos):
        return _of_distance(held.stage.strip, reading.distance, head, numbers)
    if reading.mirrored:
        return found(reading.code, f"{head} it is mirrored", "", numbers, points=tried.points.ids, strips=(strip,))
    lists = np.unique(tried.points.frame).tolist() if number is None else [number]
    axes_of = {f"control[{each}]": frames[each].axes for each in lists}
    fix = reading.fix or f"write {axes_to_write(axes_of, reading.order)}"
    points = () if number is None else tried.points.take(tried.points.frame == number).ids
    return found(reading.code, f"{head} {reading.text}", fix, numbers, points=points, strips=(strip,), key=key)


def axes_to_write(axes_of: Mapping[str, Sequence[str]], order: tuple[int, int, int]) -> str:
    """Say which axes the project file must give to some of its lists, so that these columns are east, north, up."""
    columns = {key: [GROUND_AXES[order.index(place)] for place in _places(axes)] for key, axes in axes_of.items()}
    if any("x" in axes for axes in axes_of.values()):
        columns = {key: [CARTESIAN_AXES[GROUND_AXES.index(axis)] for axis in each] for key, each in columns.items()}
    return " and ".join(f"`{key}.axes: [{', '.join(each)}]`" for key, each in columns.items())


def _places(axes: Sequence[str]) -> list[int]:
    """Which of the axes each column is, 0 to 2."""
    return [(CARTESIAN_AXES if "x" in axes else GROUND_AXES).index(axis) for axis in axes]


def of_mirrored(
    findings: Sequence[Finding],
    inputs: Inputs,
    frames: Sequence[GroundFrame],
    *,
    in_place: bool,
    others_fit: bool,
    with_positions: bool | None,
) -> list[Finding]:
    """Name what may have mirrored strips, all of them together (P103, P401).

    Two axes of the control exchanged, those of the photos, or one of them turned: each fits as well as the others. What
    tells them apart is the place of the control on the Earth, strips that fit it as it is, camera positions, lists of
    both hands, and a format that holds the points one way only.

    findings: of each strip that fits as its mirror image, with the control that it shows.
    in_place, others_fit: whether the axes of the control are right, as its place or other strips tell.
    with_positions: whether camera positions go with the control as it is given, or as it is exchanged; None unknown.
    """
    if not findings:
        return []
    strips, points = (tuple(name for each in findings for name in getattr(each, kind)) for kind in ("strips", "points"))
    lists = np.unique(inputs.control.frame[locate(points, inputs.control.ids)]).tolist()
    axes_of = {f"control[{number}]": frames[number].axes for number in lists}
    if with_positions and inputs.positions is not None:
        axes_of["camera_positions"] = inputs.positions.frame.axes
    hands = {round(float(np.linalg.det(np.eye(3)[_places(axes)]))) for axes in axes_of.values()}
    of_strips = [strip for strip in inputs.strips if strip.id in strips]
    by_positions = with_positions is False
    causes, by_format = (dict[str, str](), False) if by_positions else _of_photos(of_strips, inputs)
    reasons = {
        "their format holds the points only so": by_format,
        "the control is right: other strips fit it as it is": others_fit,
        "the control is right: it lies where its crs is": in_place,
        "the control is right: lists of both hands agree": len(hands) > 1,
        OF_POSITIONS: by_positions,
    }
    why = next((reason for reason, holds in reasons.items() if holds), "")
    by_control = why in {"", OF_POSITIONS}
    if by_control:
        two = "two of X, Y, Z" if "x" in frames[lists[0]].axes else "east and north"
        of_both = " and of the camera positions" if with_positions else ""
        backwards = ", or one of them counts backwards" if frames[lists[0]].kind == "local" and not by_positions else ""
        causes = {f"{two} of the control{of_both} are exchanged{backwards}": axes_to_write(axes_of, EXCHANGED)} | causes
    head = f"strips {listed(strips)} are mirrored: " if len(strips) > 1 else ""
    message = f"{head}{findings[0].message}: {', or '.join(causes)}{why and f' ({why})'}"
    fix = f"write {', or '.join(causes.values())}" + ("; all fit alike" if len(causes) > 1 else "")
    if others_fit:
        fix = "correct the rows of its photos, and nothing that the project says of all"
    key = "control" if by_control else "models" if inputs.models is not None else "observations"
    return [found("P401" if by_control else "P103", message, fix, findings[0].evidence, strips=strips, key=key)]


def _of_photos(strips: Sequence[Strip], inputs: Inputs) -> tuple[dict[str, str], bool]:
    """Say how image coordinates of strips, or their models, may have come to be mirrored, and what is to be written.

    Returns causes and cures, and whether the format proves them: it holds the points only where x and y are exchanged.
    """
    if inputs.models is not None:
        return {"the models are of the other hand": inputs.other_hand}, False
    if inputs.fiducials is not None:  # which turn the photos to the hand of the calibrated marks
        return {"the calibrated marks are mirrored": "the right signs in `fiducials` of the camera"}, False
    turned = {"y of the photos counts the other way": inputs.other_hand} if inputs.other_hand else {}
    exchanged = {"x and y of the photos are exchanged": "`observations.columns: {x: y, y: x}`"}
    as_written, crosswise = (_inside(strips, inputs.observations, axes) for axes in ([0, 1], [1, 0]))
    if as_written == crosswise or not turned:
        return turned | exchanged, False
    return (turned, False) if as_written else (exchanged, True)


def _inside(strips: Sequence[Strip], observations: PhotoPoints, axes: list[int]) -> bool:
    """Whether the formats of strips hold their image points, of which x and y are these axes."""
    for strip in strips:
        if strip.camera.format is not None:
            xy = observations.xy[strip.positions(observations) >= 0][:, axes]
            if (np.quantile(np.abs(xy), REACH_SHARE, axis=0) > np.array(strip.camera.format) / 2.0).any():
                return False
    return True


def find_distance(
    strip: Strip, observations: PhotoPoints, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> list[Finding]:
    """Name the principal distance with which alone a strip can be formed, and fits its control."""
    for start in np.exp(DISTANCES[[0, -1]]).tolist():
        stage = evidence.form(evidence.at_distance(strip, start), observations, settings)
        if stage is None:
            continue
        factor, laid = _best_distance(HeldStrip.of(stage, control, settings), control, frames, closely=True)
        if laid is not None and laid.fits:
            head = f"strip {strip.id} cannot be formed, and is {_size(laid):.2g} m off its control if"
            return [_of_distance(strip, start * factor, head, {"variance_factor": laid.variance})]
        break
    return []


def _of_distance(strip: Strip, factor: float, head: str, numbers: Evidence) -> Finding:
    """Name a principal distance off by a power of ten (P105), or images that are, whose size nobody knows (P101)."""
    camera = strip.camera
    would_fit = camera.principal_distance * factor
    about, given = camera.length(would_fit, ".3g", ".0f"), camera.length(camera.principal_distance)
    message = f"{head} the principal distance is about {about}; {given} is given"
    if camera.format is not None or 1.0 / UNIT_FACTOR < factor < UNIT_FACTOR:
        return other_distance(camera, would_fit, message, FIX, numbers, (strip.id,))
    message += f"; or the image coordinates are {1 / factor:.4g} times as large"
    fix = f"correct `observations.unit`, or the principal distance: {FIX}"
    return found("P101", message, fix, numbers, strips=(strip.id,), key="observations.unit")


def _beside(better: Better, strip: str) -> Finding:
    """Say how what lies beside the other control lies there (P404, P407)."""
    reading, number, laid = better
    off, sigma = laid.off
    inside = np.flatnonzero(reading.beside(laid.points, number).any(axis=1))
    shift, spread = (_medians(each[inside], np.isfinite(each[inside])) for each in (off, sigma))
    shifted = ShiftedList(HEIGHTS_ONLY if number is None else number, shift, spread, gain=float("nan"))
    return shifted_list(shifted, laid.points.take(inside), f"strip {strip}", (strip,), "")


def _medians(values: Floats, known: Flags) -> Floats:
    """Medians (3,) of the known ones of values (n, 3); NaN of none."""
    parts = (column[use] for column, use in zip(values.T, known.T, strict=True))
    return np.array([np.median(part) if len(part) else np.nan for part in parts])


def _size(laid: OnControl) -> float:
    """Median distance of a control coordinate from where the strip and all the others put it, metres."""
    whole = laid.found.whole
    own = whole.matrix.diagonal()[: whole.coordinates]
    checked = own > ROUNDING
    off = np.abs(whole.pull[: whole.coordinates][checked] / own[checked] / whole.size[: whole.coordinates][checked])
    return float(np.median(off)) if checked.any() else float("nan")


def of_heights(held: HeldStrip, as_given: OnControl | None) -> list[Finding]:
    """Say that all heights of the control are the same number, and the strip shows another relief (P410)."""
    if as_given is None:
        return []
    strip, points = held.stage.strip.id, as_given.counted.control
    heights = points.enu[points.use[:, HEIGHT], HEIGHT]
    taken_out = as_given.counted.coordinates.axis[list(as_given.found.coordinates)]
    # on level ground all heights are one number, and one of them is taken out for a wrong image of its point
    contradicted = not as_given.fits or np.count_nonzero(taken_out == HEIGHT) > 1
    if not contradicted or len(heights) <= LEAST_HEIGHTS or np.ptp(heights) > 0.0:
        return []
    message = (
        f"strip {strip}: all {len(heights)} heights of the control are {heights[0]:g} m, and the photos show another "
        "relief"
    )
    numbers: Evidence = {"height_m": float(heights[0]), "points": len(heights)}
    cure = "give the heights, or `use: xy` where they are not known"
    return [found("P410", message, cure, numbers, strips=(strip,), key="control")]


def of_whole_control(
    held: HeldStrip, as_given: OnControl | None, control: ControlPoints, frames: Sequence[GroundFrame]
) -> list[Finding]:
    """Say that a strip fits its control under no reading (P409)."""
    strip = held.stage.strip.id
    fix = "do its ids and coordinates belong to these photos, and to the points that were measured?"
    if as_given is None:
        full = control.use[held.given].all(axis=1)
        shown = held.stage.formed.xyz[held.rows[full]]
        if len(shown) <= LEAST_FULL or collinearity(shown) < WEAK_LIMIT**2 or held.lies_on(control, frames):
            return []  # it may be too little, or known too badly
        message = f"strip {strip} cannot be laid on its control, however that is read"
        return [found("P409", message, fix, {"points": len(shown)}, strips=(strip,), key="control")]
    if as_given.fits:
        return []
    placed, off = as_given.counted.placed, _size(as_given)
    half = float(np.ptp(placed, axis=0).max()) / 2.0
    if off <= MOST_OFF * half:
        return []
    message = (
        f"strip {strip} does not fit its control, however it is laid on it: half of the control coordinates are "
        f"more than {off:.4g} m off, and the control reaches {half:.4g} m from its middle"
    )
    numbers = {"misclosure_m": off, "extent_of_control_m": half}
    return [found("P409", message, fix, numbers, strips=(strip,), key="control")]
