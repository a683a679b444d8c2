"""How well the causes of what is wrong with data are named, and how often something sound is blamed.

``python benchmarks/causes.py [--planted] [--sound] [--count N] [--first SEED] [--proof] [-v] [WORD ...]``

**Planted mistakes** (``planted.py``): N projects of each kind of mistake. Of those that can be told (by the sum of
squares alone, as ``planted.py`` defines it): in how many the first that the run presents names the cause, in how many
it is named at all, and in how many ``check`` names it. A cause is named by one of its codes with one of the photos,
points or strips concerned. What a run presents comes in the order of its verdict: errors, warnings, then what was given
and lost its say. Of all of them: in how many control that is as it was simulated was thrown out, and in how many a
shifted photo, a typing error or wrong check points were told, under whatever code, where that was not the mistake.

**Sound projects**: N of each layout that the program can simulate or plan, film and UAV, strips, blocks and photos in
any order. An alarm is a finding of ``check`` or ``run`` that changes the verdict; what a layout may be told of itself
(control at one end, on one line) is none. Projects of which no run can be made are counted beside them.

WORD chooses among kinds and layouts, ``-v`` names each miss. ``--proof`` runs the frozen list, over a thousand planted
mistakes: the seeds from 700000 on. These are proof seeds, not used while building; all others are free.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from benchmarks.planted import (
    CAMERAS,
    EVEN,
    GROUNDS,
    LONG,
    MISTAKES,
    OPK,
    WIDE,
    Case,
    Make,
    Mistake,
    apart,
    images,
    layout,
    oriented,
    sound,
    with_gnss,
    with_ties,
)
from photostrip.camera import Camera
from photostrip.errors import InputError, PhotostripError
from photostrip.geometry.rotation import angles, from_angles
from photostrip.notes import LOST_SAY
from photostrip.pipeline import gate
from photostrip.pipeline.run import triangulate
from photostrip.points import locate
from photostrip.result.document import document_of
from photostrip.simulation import (
    DIGITAL,
    FILM,
    Control,
    Film,
    Flight,
    Gnss,
    GrossError,
    Ground,
    Image,
    Models,
    Points,
    Spec,
    Terrain,
)
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.simulation import Simulation

    Rng = np.random.Generator

FIRST, PROOF = 100_000, 700_000  # seeds
FEW, PROOF_PLANTED, PROOF_SOUND = 1, 14, 20  # projects of each kind
WEAK = frozenset({"P501", "P502", "P503"})  # told of control that is weak indeed
COMMON = frozenset({"P107", "P110", "P111", "P112", "P208", "P209"})  # told of what smooth image errors move in common
METHODS = ("polynomial", "bundle")
FREE = ("principal_distance", "principal_point", "k1", "k2")
SOME, MOST = 0.3, 0.7
LEAST_COMMON, LEAST_IN_THREE = 6, 1  # points of two and of three photos that follow each other
EDGE = 112.0  # mm from the centre of a photo
SYSTEMATIC = 0.005  # mm, largest
FULL_FRAME = Camera("35 mm", principal_distance=35.0, format=(36.0, 24.0), pixel_size=0.0044)
ONE_INCH = Camera("1 inch", principal_distance=8.8, format=(13.2, 8.8), pixel_size=0.0024)
DENSE = (100, 200)  # points of a model
STATED_PX, TRUE_OVER_STATED = 0.6, 1.2  # of matched points

# ------------------------------------------------------------------------------------------------- sound layouts


def base_spec(rng: Rng, photos: int, *, lap: tuple[float, float] = (57.0, 68.0)) -> Spec:
    """Draw camera, ground, terrain and measurement."""
    camera = CAMERAS[rng.integers(len(CAMERAS))]
    scale = float(np.exp(rng.uniform(np.log(3000), np.log(30000))))
    tilt, sigma = float(rng.choice([0.5, 1.0, 2.0])), float(rng.choice([3.0, 5.0, 8.0]))
    ground_sigma = float(rng.choice([0.5, 1.0, 2.0])) * sigma * 1e-6 * scale
    height = scale * camera.principal_distance / 1000.0
    return Spec(
        camera=camera,
        ground=GROUNDS[rng.integers(4)],
        flight=Flight(
            photos=photos,
            end_lap_percent=float(rng.uniform(*lap)),
            scale=scale,
            heading_deg=float(rng.uniform(0, 360)),
            attitude_sigma_deg=(tilt, tilt, tilt),
        ),
        terrain=Terrain(relief=float(rng.choice([0.0, 0.03, 0.08])) * height),
        points=Points(rows=int(rng.choice([3, 5])), extra_per_model=int(rng.integers(4, 15))),
        control=Control(sigma=(ground_sigma, ground_sigma, 1.5 * ground_sigma)),
        image=Image(sigma_um=sigma),
    )


def some_photos(rng: Rng, low: int, high: int) -> int:
    """Draw a number of photos, each power of two as likely as the next."""
    return round(float(np.exp(rng.uniform(np.log(low), np.log(high + 0.4)))))


def every(spec: Spec, models: int, **control: Any) -> Spec:  # noqa: ANN401
    """Give a strip a band of control every so many models."""
    return replace(spec, control=replace(spec.control, every=models, **control))


def bands(low: int, high: int, method: str) -> Make:
    """Make strips with bands every 3 to 20 models."""

    def draw(rng: Rng) -> Spec:
        spec = base_spec(rng, some_photos(rng, low, high))
        return every(spec, int(rng.integers(3, 21)), per_band=int(rng.integers(2, 4)))

    return layout((11, low, high, METHODS.index(method)), draw, methods=(method,))


def anywhere(rng: Rng) -> Spec:
    """Draw strips of 6 to 40 photos with control in the corners or anywhere."""
    spec = base_spec(rng, int(rng.integers(6, 41)))
    control = str(rng.choice(["corners", "corners+centre", "random"]))
    return replace(spec, control=replace(spec.control, layout=control, count=int(rng.integers(8, 20))))


def overlap(rng: Rng) -> Spec:
    """Draw strips of 8 to 40 photos with an end lap of 75 to 85 %."""
    return every(base_spec(rng, int(rng.integers(8, 41)), lap=(75.0, 85.0)), int(rng.integers(6, 21)))


def in_block(rng: Rng) -> Spec:
    """Draw blocks of 2 to 5 strips with GNSS."""
    spec = base_spec(rng, int(rng.integers(5, 13)))
    flight = replace(
        spec.flight,
        strips=int(rng.integers(2, 6)),
        side_lap_percent=float(rng.choice([25.0, 60.0])),
        alternate=bool(rng.random() < EVEN),
    )
    return replace(spec, flight=flight, points=replace(spec.points, rows=5), gnss=Gnss(use=True))


def at_corners(simulation: Simulation, inputs: Inputs) -> Inputs:
    """Keep control at the corners of the block only."""
    truth, control = simulation.truth, inputs.control
    xyz = truth.points.xyz[locate(control.ids, truth.points.ids)]
    d = truth.centers - truth.centers.mean(axis=0)
    axes = np.linalg.svd(d, full_matrices=False)[2][:2]
    uv = (xyz - truth.centers.mean(axis=0)) @ axes.T
    chosen = {int(np.argmin(uv @ [a, b] + 1e12 * control.check)) for a in (-1, 1) for b in (-1, 1)}
    keep = control.check.copy()
    keep[sorted(chosen)] = True
    return replace(inputs, control=control.take(keep))


def some_control(rng: Rng, simulation: Simulation) -> Inputs:
    """Hold a block by its positions, with control in each strip, at the corners, in one strip only, or none."""
    inputs, kind, o = with_gnss(rng, simulation), int(rng.integers(4)), simulation.observations
    control = inputs.control
    if kind == 1:
        return at_corners(simulation, inputs)
    if kind == 2:
        shown = o.point[np.isin(np.array(o.photo_ids)[o.photo], simulation.strips[0][1])]
        return replace(inputs, control=control.take(control.check | np.isin(control.ids, np.array(o.point_ids)[shown])))
    return replace(inputs, control=control.take(control.check)) if kind == 3 else inputs


def gnss_strip(rng: Rng) -> Spec:
    """Draw single strips of 8 to 60 photos held by camera positions and a control point or a band here and there."""
    spec = base_spec(rng, int(rng.integers(8, 61)))
    kind = str(rng.choice(["corners", "random", "bands"]))
    control = replace(spec.control, layout=kind, bands=2, per_band=int(rng.integers(1, 4)), count=4)
    return replace(spec, gnss=Gnss(use=True), control=control)


def bare_block(rng: Rng) -> Spec:
    """Draw blocks without camera positions."""
    return replace(in_block(rng), gnss=None)


def models(rng: Rng) -> Spec:
    """Draw strips of independent models of 4 to 60 photos."""
    spec = base_spec(rng, int(rng.integers(4, 61)))
    kind = Models(centers=bool(rng.random() < MOST), axes=str(rng.choice(["level", "any"])))
    return every(replace(spec, models=kind), int(rng.integers(3, 21)))


def wide(rng: Rng) -> Spec:
    """Draw strips of a wide camera with many points, of which a turned one sees enough."""
    spec = every(base_spec(rng, int(rng.integers(5, 21)), lap=(62.0, 75.0)), int(rng.integers(3, 11)))
    return replace(spec, camera=WIDE, points=Points(rows=5, extra_per_model=25))


def wide_block(rng: Rng) -> Spec:
    """Draw three such strips flown to and fro."""
    spec = wide(rng)
    return replace(spec, flight=replace(spec.flight, strips=3, side_lap_percent=60.0, alternate=True))


def aside(rng: Rng, simulation: Simulation) -> Inputs:
    """Turn all cameras 15 to 42 degrees aside, ahead or back."""
    tilt = np.radians(rng.uniform(15.0, 42.0)) * rng.choice([-1.0, 1.0])
    return turned(rng, simulation, np.array([[tilt, 0.0, 0.0] if rng.random() < MOST else [0.0, tilt, 0.0]]))


def convergent(rng: Rng, simulation: Simulation) -> Inputs:
    """Turn cameras 8 to 18 degrees ahead and back in turn, as two heads on one mount look."""
    tilt = np.radians(rng.uniform(8.0, 18.0))
    return turned(rng, simulation, np.array([[0.0, tilt, 0.0], [0.0, -tilt, 0.0]]))


def turned(rng: Rng, simulation: Simulation, angle: np.ndarray) -> Inputs:
    """Turn the cameras of vertical photos by angles (k, 3) in turn; what they do not see then is left out.

    Raises InputError where neighbours are left with too few common points.
    """
    inputs = inputs_of(simulation)
    focal = float(rng.choice([88.0, 120.0]))
    o = inputs.observations
    ray = np.column_stack([o.xy, np.full(len(o.xy), -inputs.strips[0].camera.principal_distance)])
    ray = np.einsum("ni,nij->nj", ray, from_angles(angle, "omega-phi-kappa")[o.photo % len(angle)])
    xy = -focal * ray[:, :2] / ray[:, 2:]
    kept = images(replace(o, xy=xy), (np.abs(xy) < EDGE).all(axis=1) & (ray[:, 2] < 0))
    for strip in inputs.strips:
        on = [set(kept.point[kept.photo == o.photo_ids.index(photo)].tolist()) for photo in strip.photos]
        in_three = [len(one & other & third) for one, other, third in zip(on, on[1:], on[2:], strict=False)]
        if min(len(one & other) for one, other in pairwise(on)) < LEAST_COMMON or min(in_three) < LEAST_IN_THREE:
            raise InputError("too few common points are left")
    strips = tuple(replace(each, camera=replace(each.camera, principal_distance=focal)) for each in inputs.strips)
    return replace(inputs, observations=kept, strips=strips)


def calibrated(rng: Rng, simulation: Simulation) -> Inputs:
    """Ask for the calibration of a camera in a block held by positions and control."""
    inputs, camera = with_gnss(rng, simulation), simulation.camera
    off = replace(camera, principal_distance=camera.principal_distance + float(rng.normal(0, 0.05)))
    return replace(inputs, strips=tuple(replace(each, camera=off, calibrate=FREE) for each in inputs.strips))


def long_strip(rng: Rng) -> Spec:
    """Draw strips of 6 to 150 photos."""
    return every(base_spec(rng, some_photos(rng, 6, 150)), int(rng.integers(3, 21)))


def smooth_errors(rng: Rng, simulation: Simulation) -> Inputs:
    """Give all images the same errors of up to 5 µm, which no model describes."""
    inputs = with_gnss(rng, simulation)
    o = inputs.observations
    wave, phase = rng.normal(0.0, 1.0, (2, 4, 2)) * np.pi / 115.0, rng.uniform(0, 2 * np.pi, (2, 4))
    shift = np.column_stack([np.sin(o.xy @ wave[axis].T + phase[axis]).sum(axis=1) for axis in (0, 1)])
    shift *= SYSTEMATIC / np.abs(shift).max()
    return replace(inputs, observations=replace(o, xy=o.xy + shift))


def film(rng: Rng) -> Spec:
    """Draw strips of film with fiducial marks, irregular shrinkage, refraction."""
    spec = replace(base_spec(rng, int(rng.integers(5, 31))), camera=FILM)
    spec = replace(
        spec, film=Film(irregular_um=float(rng.choice([0.0, 3.0, 6.0]))), refraction=bool(rng.random() < EVEN)
    )
    return every(spec, int(rng.integers(3, 16)))


def two_zones(rng: Rng) -> Spec:
    """Draw strips over the border of two zones, with a list of control on either side."""
    zones = (("EPSG:32633", "EPSG:32634", 18.0, 49.0), ("EPSG:28404", "EPSG:28405", 24.0, 42.5),
             ("EPSG:31467", "EPSG:31468", 10.5, 51.0), ("EPSG:25832", "EPSG:25833", 12.0, 53.0))  # fmt: skip
    crs, second, border, north = zones[rng.integers(len(zones))]
    spec = replace(base_spec(rng, int(rng.integers(8, 31))), ground=Ground(crs, center_deg=(border, north)))
    spec = every(spec, int(rng.integers(3, 8)), second_crs=second, boundary_longitude_deg=border)
    return replace(spec, flight=replace(spec.flight, heading_deg=90.0))


def any_strip(rng: Rng) -> Spec:
    """Draw strips of 5 to 24 photos."""
    return every(base_spec(rng, int(rng.integers(5, 25))), int(rng.integers(3, 11)))


def started(rng: Rng, simulation: Simulation) -> Inputs:
    """Give orientations, as observations or as a start that is off by up to 500 m."""
    truth, observed = simulation.truth, bool(rng.random() < EVEN)
    n, off = len(truth.photo_ids), 0.3 if observed else float(rng.choice([20.0, 100.0, 500.0]))
    enu = truth.centers_ground + rng.normal(0.0, off, (n, 3))
    noise = 1e-4 if observed else float(rng.choice([0.01, 0.05]))
    values = angles(truth.rotations_local, OPK) + rng.normal(0.0, noise, (n, 3))
    return oriented(simulation, enu, values, sigma=(off, noise) if observed else None)


def dense(rng: Rng) -> Spec:
    """Draw strips and blocks with hundreds of points on a photo."""
    spec = in_block(rng)
    flight = replace(spec.flight, strips=int(rng.integers(1, 4)), end_lap_percent=float(rng.uniform(60, 82)))
    points = Points(rows=5, extra_per_model=int(rng.integers(60, 250)))
    return replace(spec, camera=DIGITAL, flight=flight, points=points)


def narrow(rng: Rng) -> Spec:
    """Draw strips and blocks of cameras of 305 mm, on film and on a sensor of 68 by 104 mm."""
    spec = in_block(rng)
    camera = LONG if rng.random() < EVEN else replace(DIGITAL, principal_distance=LONG.principal_distance)
    return replace(spec, camera=camera, flight=replace(spec.flight, strips=int(rng.integers(1, 4))))


def off_along_the_base(rng: Rng) -> tuple[GrossError, ...]:
    """Draw eight image coordinates that are wrong by up to a millimetre along the base."""
    return (GrossError("image", count=8, size_um=float(rng.uniform(100, 1000)), axis="x"),)


def large_block(rng: Rng) -> Spec:
    """Draw blocks of ten strips of forty photos."""
    spec = in_block(rng)
    return replace(spec, flight=replace(spec.flight, photos=40, strips=10, side_lap_percent=30.0))


def uav(camera: Camera, turn: float, *, tilt: float = 3.0, points: tuple[int, int] = (12, 40)) -> Callable[[Rng], Spec]:
    """Draw corridors of 2 to 4 strips flown at 60 to 120 m, 80 % by 70 %, with GNSS to centimetres or metres.

    turn: 0 with the long side of the image along the flight, 90 with it across.
    points: least and most points of a model beside the pass points.
    """

    def draw(rng: Rng) -> Spec:
        height, gnss = float(rng.uniform(60, 120)), ((0.02, 0.02, 0.03), (1.5, 1.5, 3.0))[rng.integers(2)]
        flight = Flight(
            photos=int(rng.integers(8, 21)),
            strips=int(rng.integers(2, 5)),
            end_lap_percent=80.0,
            side_lap_percent=70.0,
            flying_height=height,
            heading_deg=float(rng.uniform(0, 360)),
            alternate=bool(rng.random() < EVEN),
            photo_rotation_deg=turn,
            attitude_sigma_deg=(tilt, tilt, tilt),
            position_sigma=(0.5, 0.5, 0.5),
        )
        return Spec(
            camera=camera,
            ground=GROUNDS[rng.integers(4)],
            flight=flight,
            terrain=Terrain(relief=float(rng.choice([0.01, 0.04, 0.1])) * height, wavelength=height),
            points=Points(rows=5, extra_per_model=int(rng.integers(*points))),
            control=Control(layout=str(rng.choice(["bands", "corners+centre"])), sigma=(0.02, 0.02, 0.03)),
            image=Image(sigma_um=STATED_PX * 1000.0 * (camera.pixel_size or 0.0)),
            gnss=Gnss(sigma=gnss, use=True),
        )

    return draw


def matched(rng: Rng, simulation: Simulation) -> Inputs:
    """Give points the errors of matching: Student's t of 3 to 5 degrees, a fifth larger than is stated."""
    inputs, degrees = with_gnss(rng, simulation), float(rng.uniform(3.0, 5.0))
    o = inputs.observations
    error = rng.standard_t(degrees, o.xy.shape) * np.sqrt((degrees - 2.0) / degrees) * TRUE_OVER_STATED
    return replace(inputs, observations=replace(o, xy=simulation.truth.image + error * o.sigma))


def in_any_order(rng: Rng, simulation: Simulation) -> Inputs:
    """List all photos in any order."""
    inputs = with_gnss(rng, simulation)
    photos = [(strip, photo) for strip in inputs.strips for photo in strip.photos]
    singles = [replace(strip, id=photo, photos=(photo,), listed=False) for strip, photo in photos]
    return replace(inputs, strips=tuple(singles[k] for k in rng.permutation(len(singles))))


LAYOUTS: dict[str, tuple[Make, frozenset[str]]] = {  # with what may be told
    "strips of 4-8 photos": (sound, frozenset()),
    "6-60 photos, bands every 3-20, polynomial": (bands(6, 60, "polynomial"), frozenset()),
    "6-60 photos, bands every 3-20, bundle": (bands(6, 60, "bundle"), frozenset()),
    "60-300 photos, bands every 3-20, polynomial": (bands(60, 300, "polynomial"), frozenset()),
    "60-300 photos, bands every 3-20, bundle": (bands(60, 300, "bundle"), frozenset()),
    "corners, centre, random": (layout(12, anywhere, methods=METHODS), WEAK),
    "end lap of 75-85 %": (layout(13, overlap, methods=METHODS), frozenset()),
    "blocks held by GNSS": (layout(14, in_block, given=some_control), frozenset()),
    # points at random may lie below the line of the cameras
    "strips held by GNSS": (layout(15, gnss_strip, given=with_gnss), frozenset({"P502"})),
    "blocks by their control": (layout(16, bare_block, methods=METHODS), frozenset()),
    "blocks by four control points": (
        layout(27, bare_block, given=lambda _, simulation: at_corners(simulation, inputs_of(simulation))),
        frozenset(),
    ),
    "independent models": (layout(17, models, methods=("auto", "polynomial")), frozenset()),
    "oblique mounts": (layout(18, wide, methods=METHODS, given=aside), WEAK),  # not all control is seen
    "oblique blocks": (layout(28, wide_block, given=aside, fits=apart), WEAK),
    "convergent strips": (layout(29, wide, given=convergent, fits=apart), WEAK),
    "self-calibration": (layout(19, in_block, given=calibrated), frozenset()),
    "systematic errors of 5 µm, strips": (layout(20, long_strip, methods=METHODS, given=smooth_errors), COMMON),
    "systematic errors of 5 µm, blocks": (layout(30, in_block, given=smooth_errors), COMMON),
    "film with fiducial marks": (layout(21, film, methods=METHODS), frozenset()),
    "two lists in two zones": (layout(22, two_zones, methods=METHODS), frozenset()),
    "given orientations": (layout(23, any_strip, given=started), frozenset()),
    "dense points": (layout(24, dense), frozenset()),
    "narrow field of view, 305 mm": (layout(31, narrow, given=with_gnss), frozenset()),
    "blocks with wrong image coordinates": (with_ties(2, off_along_the_base), frozenset({"P304"})),
    "UAV corridor, 35 mm, long side along": (layout(32, uav(FULL_FRAME, 0.0), given=with_gnss), frozenset()),
    "UAV corridor, 35 mm, long side across": (layout(33, uav(FULL_FRAME, 90.0), given=with_gnss), frozenset()),
    "UAV corridor, 1 inch, long side along": (layout(34, uav(ONE_INCH, 0.0), given=with_gnss), frozenset()),
    "UAV corridor, 1 inch, long side across": (layout(35, uav(ONE_INCH, 90.0), given=with_gnss), frozenset()),
    "kite, photos in any order": (layout(36, uav(FULL_FRAME, 0.0, tilt=8.0), given=in_any_order), frozenset()),
    "SfM, 1000 rays a photo": (layout(37, uav(ONE_INCH, 90.0, points=DENSE), given=with_gnss), frozenset()),
    "SfM, 1000 rays a photo, heavy tails": (layout(38, uav(ONE_INCH, 90.0, points=DENSE), given=matched), frozenset()),
    "GNSS blocks of 10 strips of 40 photos": (
        layout(25, large_block, given=lambda rng, simulation: at_corners(simulation, with_gnss(rng, simulation))),
        frozenset(),
    ),
}  # fmt: skip

# ---------------------------------------------------------------------------------------------- what a run tells


class Said(NamedTuple):
    """A finding, or a warning on what was given and lost its say."""

    code: str
    text: str
    names: frozenset[str]


class Told(NamedTuple):
    """What `check` and `run` tell, in the order in which they do."""

    check: tuple[Said, ...]
    run: tuple[Said, ...]
    out: frozenset[str]  # control points of which coordinates were thrown out
    refusal: str  # why there is no result; nothing where there is one


ACCUSED = {  # of what something sound may be accused, and the words of it
    "photo": re.compile(r"^P109|photos? .*shifted|shifted photo"),
    "digit": re.compile(r"^P406|typing error|slip of a digit"),
    "checks": re.compile(r"^P411|check points? .*shift"),
}


def told(inputs: Inputs, settings: Settings) -> Told:
    """Examine and run a project."""
    out, refusal, lost = frozenset[str](), "", []
    try:
        document = document_of(triangulate(inputs, settings))
    except PhotostripError as error:
        findings, refusal = [vars(each) for each in error.findings], str(error)
    else:
        findings = document["findings"]
        lost = [note for code in LOST_SAY for note in document["notes"] if note["code"] == code]
        rows = document["control"]
        out = frozenset(row["id"] for row in rows if row["role"] == "control" and row["measured"] and row["rejected"])
    try:
        before = [vars(each) for each in gate.of_inputs(inputs, settings)]
    except PhotostripError:
        before = []
    return Told(presented(before), presented(findings) + presented(lost), out, refusal)


def presented(findings: Iterable[Mapping[str, Any]]) -> tuple[Said, ...]:
    """Order what changes the verdict as the verdict does: errors before warnings, each as they come."""
    return tuple(
        Said(
            each["code"],
            f"{each['code']} {each.get('title', '')} {each['message']}",
            frozenset((*each["photos"], *each["points"], *each.get("strips", ()))),
        )
        for severity in ("error", "warning")
        for each in findings
        if each["severity"] == severity and not each.get("accepted")
    )


def names_it(said: Said, mistake: Mistake, ids: frozenset[str]) -> bool:
    """Whether it is the cause, of one of the ids where there are any."""
    return said.code in mistake.codes and (not ids or bool(ids & said.names))


def accused(said: Iterable[Said], checks: frozenset[str]) -> set[str]:
    """Say of what is accused.

    checks: sound check points, which must not be blamed in any other way either.
    """
    by_words = {kind for kind, words in ACCUSED.items() for each in said if words.search(each.text)}
    blamed = (each.names for each in said if each.code not in LOST_SAY)
    return by_words | {"checks" for names in blamed if names and names <= checks}


def spoiled(case: Case, inputs: Inputs) -> frozenset[str]:
    """Given points that are not given as they were simulated."""

    def rows(given: Inputs) -> dict[str, tuple[str, ...]]:
        control, frames = given.control, [str(given.frames[frame]) for frame in given.control.frame]
        columns = zip(control.ids, control.enu, control.use, control.sigma, frames, strict=True)
        return {name: tuple(map(str, (*enu, *use, *sigma, frame))) for name, enu, use, sigma, frame in columns}

    sound_rows = rows(case.inputs)
    return frozenset(name for name, row in rows(inputs).items() if row != sound_rows.get(name))


# ------------------------------------------------------------------------------------------------------ the tables


def plant(mistake: Mistake, count: int, first: int, *, verbose: bool) -> Counter[str]:
    """Plant one kind of mistake in many projects; print and give how often it was named, and what was blamed."""
    counts: Counter[str] = Counter()
    for seed in range(first, first + 12 * count):
        if counts["runs"] == count:
            break
        case = mistake.make(seed)
        planted = mistake.plant(case)
        if planted is None:
            continue
        inputs, ids = planted
        found, wrong = told(inputs, mistake.settings(case)), spoiled(case, inputs)
        control = case.inputs.control
        checks = frozenset(np.array(control.ids)[control.check].tolist()) - wrong
        others = [each for each in found.run if not names_it(each, mistake, ids)]
        results = {"runs", *accused(others, checks), *(["lost"] if found.out - wrong else [])}
        if mistake.can_be_told(seed, inputs):
            results.add("told")
            results |= {"first" for each in found.run[:1] if names_it(each, mistake, ids)}
            results |= {"named" for each in found.run if names_it(each, mistake, ids)}
            results |= {"check" for each in found.check if names_it(each, mistake, ids)}
        counts.update(results)
        if verbose and (("told" in results and "first" not in results) or results & {"lost", *ACCUSED}):
            print(f"  {mistake.name}, seed {seed}, {sorted(ids)}: {sorted(results)}; out {sorted(found.out - wrong)}")
            print("".join(f"    {each.text[:160]}\n" for each in found.run[:5]), f"   {found.refusal[:160]}")
    print(row(mistake.name, counts), flush=True)
    return counts


def row(name: str, counts: Counter[str]) -> str:
    """Write the counts of a kind."""
    shares = [f"{100 * counts[key] / counts['told']:5.0f} %" if counts["told"] else "      -" for key in SHARES]
    return f"{name:<48} {counts['runs']:>5} {counts['told']:>5} {' '.join(shares)}  " + " ".join(
        f"{counts[key] or '.':>6}" for key in ("lost", *ACCUSED)
    )


SHARES = ("first", "named", "check")


def all_planted(count: int, first: int, words: list[str], *, verbose: bool) -> None:
    """Print the table of planted mistakes, and its sums beside their goals."""
    head = f"{'mistake':<48} {'runs':>5} {'told':>5} {'first':>7} {'named':>7} {'check':>7}  "
    print(head + " ".join(f"{key:>6}" for key in ("lost", *ACCUSED)))
    total, of_columns = Counter[str](), Counter[str]()
    for mistake in MISTAKES:
        if chosen(mistake.name, words):
            counts = plant(mistake, count, first, verbose=verbose)
            total.update(counts)
            of_columns.update(counts if mistake.columns else {})
    print(row("those that are columns of the design", of_columns))
    print(row("all", total))
    runs, able = max(total["runs"], 1), max(total["told"], 1)
    print(f"true cause first: {100 * total['first'] / able:.1f} % of {able} that can be told (goal: 85 %)")
    print(f"sound control thrown out: {100 * total['lost'] / runs:.2f} % of {runs} runs (goal: at most 0.3 %)")
    false = sum(total[key] for key in ACCUSED)
    print(f"photo, digit or check points accused falsely: {100 * false / runs:.2f} % (goal: at most 0.2 %)", flush=True)


def all_sound(count: int, first: int, words: list[str], *, verbose: bool) -> None:
    """Print the table of sound projects, and its sum beside the goal."""
    print(f"{'layout':<46} {'sound':>5} {'alarms':>6} {'lost':>5} {'refused':>7}  codes")
    total: Counter[str] = Counter()
    for name, (make, allowed) in LAYOUTS.items():
        counts: Counter[str] = Counter()
        codes: Counter[str] = Counter()
        for seed in range(first, first + count) if chosen(name, words) else ():
            case = make(seed)
            found = told(case.inputs, case.settings)
            alarms = {each.code for each in (*found.check, *found.run)} - allowed - set(LOST_SAY)
            results = {"refused"} if found.refusal else {"sound", *(["lost"] if found.out else [])}
            counts.update(results | {"alarms" for _ in alarms})
            codes.update(alarms)
            if verbose and (alarms or found.out or found.refusal):
                print(f"  {name}, seed {seed}: {sorted(alarms)}; out {sorted(found.out)}; {found.refusal[:200]}")
        if counts:
            of_codes = ", ".join(f"{code} {number}" for code, number in sorted(codes.items()))
            numbers = f"{counts['sound']:>5} {counts['alarms']:>6} {counts['lost']:>5} {counts['refused']:>7}"
            print(f"{name:<46} {numbers}  {of_codes}", flush=True)
            total.update(counts)
    runs = max(total["sound"] + total["refused"], 1)
    print(f"alarms: {100 * total['alarms'] / runs:.2f} % of {runs} sound projects (goal: at most 0.5 %), "
          f"{total['refused']} refused, sound control thrown out in {total['lost']}")  # fmt: skip


def chosen(name: str, words: list[str]) -> bool:
    """Whether one of the words is in a name; without words all are chosen."""
    return not words or any(word in name for word in words)


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="WORD", help="parts of the names of mistakes and layouts")
    parser.add_argument("--planted", action="store_true", help="planted mistakes only")
    parser.add_argument("--sound", action="store_true", help="sound projects only")
    parser.add_argument("--count", type=int, help=f"projects of each kind ({FEW})")
    parser.add_argument("--first", type=int, default=FIRST, metavar="SEED", help=f"first seed ({FIRST})")
    parser.add_argument("--proof", action="store_true", help="the frozen list, with seeds not used while building")
    parser.add_argument("-v", action="store_true", dest="verbose", help="name each miss")
    asked = parser.parse_args()
    first = PROOF if asked.proof else asked.first
    planted, without = (PROOF_PLANTED, PROOF_SOUND) if asked.proof else (asked.count or FEW,) * 2
    if not asked.sound:
        all_planted(planted, first, asked.words, verbose=asked.verbose)
    if not asked.planted:
        all_sound(without, first, asked.words, verbose=asked.verbose)


if __name__ == "__main__":
    main()
