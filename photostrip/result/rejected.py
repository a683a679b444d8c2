"""What was taken out, from pairs to the bundle, with test and reason in words; what was given and lost its say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter

import numpy as np

from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.network.problem import BundleProblem
from photostrip.network.testing import START
from photostrip.notes import Document, Note, named
from photostrip.pipeline.results import Bundle, Result, StripResult
from photostrip.points import PhotoPoints
from photostrip.rejection import SEVERAL_RAYS, TWO_RAYS, WRONG_RAY, Rejection
from photostrip.result.bundle import GroupKind, kinds, names_of_observation
from photostrip.result.description import block_at
from photostrip.result.numbers import DECIMALS_BY_UNIT, Plain, natural, natural_rank, rounded
from photostrip.result.points import ImageResiduals
from photostrip.result.strips import PPM, names_of
from photostrip.result.table import Table
from photostrip.strip.control_screening import EITHER, EXCHANGED
from photostrip.strip.formed_strip import depths, model_points
from photostrip.units import MICROMETRES

ANOTHER_POINT = 0.05  # of the extent of a model: an error as large is one of identity
REASONS = {
    WRONG_RAY: "the other rays of the point meet without it",
    TWO_RAYS: "the two rays of the point contradict each other: neither is used",
    SEVERAL_RAYS: "the rays of the point contradict each other, and it cannot be told which is wrong: none is used",
}
REASONS_OF_MODELS = {
    TWO_RAYS: "two models contradict each other at the point: it takes part in neither",
    SEVERAL_RAYS: "the models contradict each other at the point, and it cannot be told which is wrong: none counts",
}
EMPTY: Document = {
    **{key: None for key, entry in block_at("rejected").items() if not entry.optional},
    **dict.fromkeys(("strip", "stage", "test", "unit", "reason"), ""),
    "size_unit": "um",
    "readmitted": False,
    "blamed": [],
}


def rejected_of(result: Result) -> Table:
    """Return the table ``rejected``: what was taken out of pairs, scale transfers, points and control, in flight order.

    Within a pair, a junction or a link they stand in natural order of the points: the order of the tables does not
    show. A measurement that was taken back in the end is in it, marked. What a bundle adjustment took out comes last.
    """
    rows = _rows(result)
    if result.model_strips:
        rows = [{**each, "models": each.get("models", [])} for each in rows]
    return Table.of_rows("rejected", rows)


def _rows(result: Result) -> list[Document]:
    observations = result.refined.observations
    found: list[Document] = []
    for strip in result.strips:
        if not strip.is_of_models:
            found += _from_pairs(strip, observations)
            found += _from_junctions(strip, observations)
            found += _from_rays(strip, observations)
        else:
            found += _from_links(result, strip)
        found += [_from_control(strip, wrong, strip.control.ids[wrong.row]) for wrong in strip.wrong_control]
    if result.bundle is None:
        return found
    written = kinds(result.settings.angle_unit, of_models=bool(result.model_strips))
    return _after_bundle(result.bundle, found) + _from_bundle(result.bundle, written)


def _entry(**values: object) -> Document:
    return EMPTY | values


def _from_pairs(strip: StripResult, observations: PhotoPoints) -> list[Document]:
    ids, photos, oriented = observations.point_ids, strip.strip.photos, strip.of_photos.orientation
    wrong_rays = {each.row for each in strip.of_photos.wrong_rays if each.cause == WRONG_RAY}
    pair, point, zone, rank = oriented.pairs.pair, oriented.point, strip.of_photos.screened.zone, natural_rank(ids)
    found = []
    for each in sorted(strip.of_photos.rejections, key=lambda each: (int(pair[each.row]), int(rank[point[each.row]]))):
        left, rays = int(pair[each.row]), oriented.rows[each.row].tolist()
        wrong = [] if each.readmitted else [row for row in rays if row in wrong_rays]
        blamed = [observations.photo_ids[observations.photo[row]] for row in wrong]
        in_um, size = each.test == "parallax", each.worst * MICROMETRES
        entry = _entry(
            strip=strip.strip.id,
            photo=photos[left],
            other_photo=photos[left + 1],
            point=ids[point[each.row]],
            stage="relative",
            **_tested(each, MICROMETRES if in_um else 1.0),
            unit="um" if in_um else "",
            parallax_um=size,
            zone=zone[each.row],
            size=size,
            readmitted=each.readmitted,
            blamed=blamed,
            reason=_reason_of_pair(each, size, blamed),
        )
        found.append(entry)
    return found


def _tested(rejection: Rejection, factor: float = 1.0) -> Document:
    return {"test": rejection.test, "value": rejection.value * factor, "limit": rejection.limit * factor}


def _reason_of_pair(rejection: Rejection, size: float, blamed: list[str]) -> str:
    if rejection.readmitted:
        return "taken back: the pair or the strip oriented on the other points predicts it, or the user keeps it"
    front = rejection.test == "in front"
    reason = "the rays do not meet in front of the cameras"
    reason = reason if front else f"y parallax {size:.1f} µm in the pair oriented without it"
    if blamed:
        return f"{reason}; the wrong ray is that of photo {', '.join(blamed)}: the others of the point meet without it"
    return reason if front else f"{reason}; which of its two rays is wrong cannot be told"


def _from_junctions(strip: StripResult, observations: PhotoPoints) -> list[Document]:
    """Pass points that did not belong in a scale transfer; the error as that of an x parallax in one of the models."""
    stages, ids = strip.of_photos, observations.point_ids
    joined, oriented = stages.formed.junctions, stages.orientation
    out: list[int] = np.flatnonzero(~joined.used).tolist()
    if not out:
        return []
    rank = natural_rank(ids)
    out.sort(key=lambda row: (int(joined.junction[row]), int(rank[joined.point[row]])))
    rows = np.array(out, np.intp)
    base, _ = oriented.relative
    deviation = joined.ratio[rows] / joined.factor[joined.junction[rows]] - 1
    models = model_points(oriented, stages.formed.first, left_ray=stages.formed.left_ray)
    depth = depths(models.vectors[joined.after[rows]], base[joined.junction[rows] + 1])
    size = deviation * oriented.pairs.focal / depth * MICROMETRES
    return [
        _entry(
            strip=strip.strip.id,
            photo=strip.strip.photos[joined.junction[row] + 1],
            point=ids[joined.point[row]],
            stage="scale_transfer",
            test="ratio",
            value=abs(off) * PPM,
            limit=joined.limit[row] * PPM,
            unit="ppm",
            zone=stages.screened.zone[joined.after[row]],
            size=shift,
            reason=f"scale ratio {abs(off) * PPM:.0f} ppm from that of the other pass points: an x parallax wrong "
            f"by {shift:.1f} µm would explain it",
        )
        for row, off, shift in zip(rows.tolist(), deviation.tolist(), size.tolist(), strict=True)
    ]


def _from_rays(strip: StripResult, observations: PhotoPoints) -> list[Document]:
    """Rays that contradict the others of their point, in natural order of the points, then in flight order.

    A ray that all its pairs have rejected stands with those.
    """
    in_pair = np.zeros(len(observations), np.intp)  # with the next photo, else with the one before
    for side in (1, 0):
        in_pair[strip.of_photos.orientation.rows[:, side]] = strip.of_photos.screened.zone
    photo_of = {photo: number for number, photo in enumerate(strip.strip.photos)}
    rank, found = natural_rank(observations.point_ids), []
    for each in rejected_by_strip(strip):
        photo = observations.photo_ids[observations.photo[each.row]]
        number = observations.point[each.row]
        point, size = observations.point_ids[number], each.worst * MICROMETRES
        if each.kind == "control":
            entry = _from_control(strip, each, point, photo)
        else:
            entry = _entry(
                strip=strip.strip.id,
                photo=photo,
                point=point,
                stage="rays",
                **(_tested(each) | {"test": "strip"}),
                zone=in_pair[each.row] or None,
                size=size,
                size_unit="um" if np.isfinite(size) else "",
                blamed=[photo] if each.cause == WRONG_RAY else [],
                reason=REASONS[each.cause],
            )
        found.append(((int(rank[number]), photo_of[photo]), entry))
    return [entry for _, entry in sorted(found, key=itemgetter(0))]


def rejected_by_strip(strip: StripResult) -> list[Rejection]:
    """Return the wrong rays of the strip that had not been rejected by all their pairs already."""
    oriented = strip.of_photos.orientation
    logged = np.zeros(len(oriented.point), bool)
    logged[[each.row for each in strip.of_photos.rejections if not each.readmitted]] = True
    wanted = {each.row for each in strip.of_photos.wrong_rays}
    left = wanted and wanted.intersection(oriented.rows[~logged].ravel().tolist())
    return [each for each in strip.of_photos.wrong_rays if each.row in left]


def _from_control(strip: StripResult, wrong: Rejection, point: str, photo: str = "") -> Document:
    reason = "; ".join(f"{GROUND_AXES[axis]} by about {wrong.size[axis]:+.2f} m" for axis in wrong.axes)
    if wrong.cause == EXCHANGED:
        reason += f"; fits when exchanged with {strip.control.ids[wrong.other]}"
    if wrong.cause == EITHER:
        reason += f"; this or the ray of photo {photo} is wrong, nothing tells which: the error lies on the other ray"
    elif photo:
        reason += f"; the wrong ray is that of photo {photo}: the error lies along the other ray"
    return _entry(
        strip=strip.strip.id,
        point=point,
        stage="control",
        test=wrong.test,
        value=wrong.value,
        limit=wrong.limit,
        size=wrong.worst,
        size_unit="m",
        blamed=[photo] if photo and wrong.cause != EITHER else [],
        reason=f"given coordinates contradict the strip and the other control: {reason}",
    )


def _from_links(result: Result, strip: StripResult) -> list[Document]:
    formed, names, found = strip.of_models.formed, strip.of_models.strip.models, []
    for each in formed.links.rejections:
        link = int(formed.links.shared.link[each.row])
        before, after = formed.links.shared.before[each.row], formed.links.shared.after[each.row]
        pair = [names[link], names[link + 1]]
        parts = ", ".join(
            f"{axis} {value * MICROMETRES:+.0f}" for axis, value in zip(CARTESIAN_AXES, each.size, strict=True)
        )
        size = float(np.linalg.norm(each.size))
        if formed.used[before] == formed.used[after]:
            wrong = "it cannot be told which one is wrong, and neither enters the mean"
        else:
            right, other = pair if formed.used[before] else pair[::-1]
            wrong = f"other models agree with {right}: {other} is wrong"
        entry = _entry(
            strip=strip.strip.id,
            photo=strip.strip.photos[link + 1],
            point=names_of(result, formed.models.node[[before]])[0],
            stage="link",
            test="link",
            value=each.value,
            limit=each.limit,
            size=size * MICROMETRES,
            reason=f"models {pair[0]} and {pair[1]} contradict each other by {parts} µm"
            f"{_other_point(strip, int(before), size)}; {wrong}",
            models=pair,
        )
        found.append(entry)
    return found


def _other_point(strip: StripResult, row: int, size: float) -> str:
    """Say that a difference is of the size of the model, as where one id stands for two points."""
    models = strip.of_models.formed.models
    xyz = models.xyz[models.model == models.model[row]]
    extent = float(np.linalg.norm(xyz - xyz.mean(axis=0), axis=1).max())
    return ", as where one id stands for two points" if size > ANOTHER_POINT * extent else ""


def _after_bundle(found: Bundle, rejected: list[Document]) -> list[Document]:
    """Mark as re-admitted what the strip method had taken out and the bundle adjustment uses after all."""
    if not rejected:  # the names of all rays take longer than the adjustment
        return rejected
    problem, selection = found.block.problem, found.screened.selection
    images, control = problem.images, problem.control
    inside = np.flatnonzero(selection.images).tolist()
    used = {(problem.photo_name(int(images.photo[n])), problem.point_name(int(images.point[n]))) for n in inside}
    whole = np.flatnonzero((selection.control | ~np.isfinite(control.sigma)).all(axis=1))
    held = {problem.point_name(int(point)) for point in control.point[whole]}
    after_all = {"readmitted": True, "blamed": [], "reason": "used by the bundle adjustment"}
    rows = []
    for each in rejected:
        photos = [photo for photo in (each["photo"], each["other_photo"]) if photo is not None]
        photos = each.get("models") or photos
        back = all((photo, each["point"]) in used for photo in photos) if photos else each["point"] in held
        rows.append(each | after_all if back else each)
    return rows


def _from_bundle(found: Bundle, written: Mapping[str, GroupKind]) -> list[Document]:
    """Observations that the search in the bundle took out, in its order; what it began without by point and photo."""
    every, problem = found.screened.rejections, found.block.problem
    of_models = problem.of_models
    strip_of = {
        unit: strip.strip.id
        for strip in reversed(found.start.strips)
        for unit in (strip.of_models.strip.models if of_models else strip.strip.photos)
    }
    entries = []
    for each in every:
        kind = written[each.kind]
        unit, point = names_of_observation(problem, each.kind, each.row)
        size = rounded(each.worst * kind.factor, DECIMALS_BY_UNIT[kind.unit])
        entry = _entry(
            strip=strip_of.get(unit or "", ""),
            photo=None if of_models else unit,
            **({"models": [] if unit is None else [unit]} if of_models else {}),
            point=point,
            stage="bundle",
            **_tested(each),
            size=size,
            size_unit=kind.unit,
            readmitted=each.readmitted,
            blamed=[unit] if each.cause == WRONG_RAY and not each.readmitted and not of_models else [],
            reason=_reason_of_bundle(each, kind, size, problem),
        )
        entries.append(entry)
    begun = [each for each in entries if each["test"] == START]
    begun.sort(key=lambda each: (natural(each["point"] or ""), natural(each["photo"] or "")))
    return begun + [each for each in entries if each["test"] != START]


def _reason_of_bundle(each: Rejection, kind: GroupKind, size: Plain, problem: BundleProblem) -> str:
    if each.readmitted:
        return "taken back: it fits after the others went"
    if each.cause in {TWO_RAYS, SEVERAL_RAYS}:
        return REASONS_OF_MODELS[each.cause] if problem.of_models else REASONS[each.cause]
    if size is None:
        return "does not fit the other observations"
    return f"{kind.axes[each.axes[0]]} is wrong by about {size:+g} {kind.unit.replace('um', 'µm')}"


FAR = 5.0  # stated standard deviations; a sound coordinate is as far off once in two million
NAMED_BY = {"control-image", "control-measured-once"}  # notes that say more of a lost point
ROLES = {"control": False, "check": True}  # whether it is a check point; control comes first: it holds the others

Images = dict[str, dict[str, tuple[str, ...]]]  # of points: what is said of their images, with the photos concerned


def lost_say_notes(
    result: Result, residuals: Sequence[ImageResiduals], rejected: Table, said: Iterable[Note]
) -> Iterator[Note]:
    """Name given points without coordinates, rejected images of the others, then images in use that do not fit.

    What ``use: off`` switches off, and what no photo shows, never had a say.

    rejected: the table ``rejected`` of the document.
    said: the notes of the run.
    """
    control = result.inputs.control
    told = {name for note in said if note.code in NAMED_BY for name in note.points}
    order = np.argsort(natural_rank(control.ids))
    counting = order[control.use[order].any(axis=1)]
    points: dict[str, list[str]] = {}
    for role, check in ROLES.items():
        names = [(control.ids[row], result.control_rows[row] >= 0) for row in counting if control.check[row] == check]
        points[role] = [name for name, there in names if there]
        lost = [name for name, there in names if not there and name in result.not_determined and name not in told]
        yield from _lost(role, {name: result.not_determined[name] for name in lost})
    out, far = _rejected(rejected, in_bundle=result.bundle is not None), _far_off(result, residuals)
    yield from _of_images("given-ray", "rejected: {}; measure them again", points, out)
    yield from _of_images("given-residual", f"used and more than {FAR:g} standard deviations off: {{}}", points, far)


def _lost(role: str, lost: dict[str, str]) -> Iterator[Note]:
    reasons: dict[str, list[str]] = {}
    for name, why in lost.items():
        reasons.setdefault(why, []).append(name)
    if reasons:
        texts = [f"{named(f'{role} point', names, len(names))} took no part: {why}" for why, names in reasons.items()]
        yield Note("check-lost" if ROLES[role] else "control-lost", "; ".join(texts), points=tuple(lost))


def _rejected(rejected: Table, *, in_bundle: bool) -> Images:
    """Return the images that stay rejected; a bundle decides on each of them again."""
    found: Images = {}
    for each in rejected:
        if each["photo"] is None or each["readmitted"] or (in_bundle and each["stage"] != "bundle"):
            continue
        photos = each.get("blamed") or [photo for photo in (each["photo"], each["other_photo"]) if photo is not None]
        where = f"models {' and '.join(each['models'])}" if each.get("models") else f"photo {' or '.join(photos)}"
        found.setdefault(each["point"], {})[where] = tuple(photos)
    return found


def _far_off(result: Result, residuals: Iterable[ImageResiduals]) -> Images:
    """Return the images that took part and have residuals beyond ``FAR``, with the size of these.

    What a similarity leaves or a polynomial bends of a strip is in residuals too: these say nothing of single images.
    """
    observations, found = result.refined.observations, Images()
    for each in residuals if result.bundle is not None else ():
        ratio = np.abs(each.residuals) / observations.sigma[each.rows]
        for place in np.flatnonzero(each.used & (ratio > FAR).any(axis=1)).tolist():
            row, photo = each.rows[place], each.strip.photos[each.photo[place]]
            size = f"photo {photo}, {np.hypot(*each.residuals[place]) * MICROMETRES:.0f} µm"
            found.setdefault(observations.point_ids[observations.point[row]], {})[size] = (photo,)
    return found


def _of_images(code: str, text: str, points: dict[str, list[str]], images: Images) -> Iterator[Note]:
    concerned = {role: [name for name in names if name in images] for role, names in points.items()}
    every = [name for names in concerned.values() for name in names]
    if every:
        texts = [
            named(f"{role} point", [f"{name} ({'; '.join(images[name])})" for name in names], len(names))
            for role, names in concerned.items()
            if names
        ]
        photos = dict.fromkeys(photo for name in every for some in images[name].values() for photo in some)
        message = f"images of given points are {text.format(' and '.join(texts))}"
        yield Note(code, message, photos=tuple(photos), points=tuple(every))
