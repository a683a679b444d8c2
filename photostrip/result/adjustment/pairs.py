"""Pairs, the joints between them, and what was taken out of both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.result.numbers import DEGREES, EXACT, GROUND, Document, micrometres, natural, rounded, significant
from photostrip.triangulation.gross_errors.control.control_screening import AXES
from photostrip.triangulation.gross_errors.rays.strip_screening import SEVERAL_RAYS, TWO_RAYS, WRONG_RAY
from photostrip.triangulation.relative_orientation.pairs import MINIMUM_POINTS
from photostrip.triangulation.relative_orientation.solution import ELEMENTS
from photostrip.triangulation.strip_formation.scale_ratios import depths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline import Result, StripResult
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.gross_errors.control.control_screening import ControlRejection
    from photostrip.triangulation.gross_errors.pairs.screening import PairRejection

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

PPM = 1e6
RATIO_DECIMALS = 1  # of parts per million
REASONS = {
    WRONG_RAY: "the other rays of the point meet without it",
    TWO_RAYS: "the two rays of the point contradict each other: neither is used",
    SEVERAL_RAYS: "the rays of the point contradict each other, and which is wrong cannot be told: none is used",
}


@dataclass(frozen=True, eq=False)
class Parallaxes:
    """What the residual y parallaxes of a strip's pairs come to."""

    squares: Floats  # (p,): sums of weighted squares, mm^2
    redundancy: Numbers  # (p,): points used minus five
    rms: Floats  # (p,): root mean square over the points used, mm
    worst: Numbers  # (p,): row of the largest one in the pairs' table

    @classmethod
    def of(cls, strip: StripResult) -> Parallaxes:
        """Sum up the parallaxes of a strip."""
        oriented = strip.of_photos.orientation
        pairs, used = oriented.pairs, oriented.used
        size = np.where(used, np.abs(oriented.parallax), -1.0)
        peak = np.flatnonzero(size == np.maximum.reduceat(size, pairs.starts)[pairs.pair])
        _, first = np.unique(pairs.pair[peak], return_index=True)
        count = oriented.points_used
        mean = pairs.sums(np.where(used, oriented.parallax**2, 0.0)) / np.maximum(count, 1)
        squares = pairs.sums(pairs.weight * oriented.parallax**2)
        return cls(squares, count - MINIMUM_POINTS, np.sqrt(mean), peak[first])


def sigma0(squares: Floats, redundancy: Numbers) -> float:
    """Return the standard deviation of an image coordinate from y parallaxes, in mm; NaN without redundancy.

    A y parallax is the difference of two coordinates: its variance is twice theirs.
    """
    total = int(redundancy.sum())
    return float(np.sqrt(squares.sum() / 2 / total)) if total > 0 else float("nan")


def models_of(result: Result) -> list[Document]:
    """Return the list ``models``: relative orientation and scale of every pair, in flight order."""
    ids = result.refined.observations.point_ids
    return [model for strip in result.photo_strips for model in _models(strip, ids)]


def _models(strip: StripResult, ids: Sequence[str]) -> list[Document]:
    oriented, formed, photos = strip.of_photos.orientation, strip.of_photos.formed, strip.strip.photos
    sums = Parallaxes.of(strip)
    used = oriented.points_used
    total = np.bincount(oriented.pairs.pair, minlength=len(used))
    base = np.linalg.norm(np.diff(strip.of_photos.resection.centers, axis=0), axis=1)
    columns = {
        "sigma0_um": micrometres(oriented.sigma0),
        "rms_parallax_um": micrometres(sums.rms),
        "max_parallax_um": micrometres(np.abs(oriented.parallax[sums.worst])),
        "max_parallax_point": [ids[oriented.point[row]] for row in sums.worst],
        "points_used": used.tolist(),
        "points_rejected": (total - used).tolist(),
        "redundancy": sums.redundancy.tolist(),
        "zones": strip.of_photos.screened.counts.tolist(),
        "detectable_um": micrometres(_detectable(strip)),
        "masked_errors_suspected": strip.of_photos.screened.masked.tolist(),
        "condition": significant(oriented.condition),
        "iterations": oriented.iterations.tolist(),
        "base": rounded(base, GROUND),
        "scale_factor": significant(formed.scale, EXACT),
        "base_direction_deg": rounded(np.degrees(formed.base_direction), DEGREES),
        "base_inclination_deg": rounded(np.degrees(formed.base_inclination), DEGREES),
    }
    elements = rounded(np.degrees(oriented.elements), DEGREES)
    sigmas = significant(np.degrees(oriented.sigmas))
    return [
        {
            "strip": strip.strip.id,
            "left": photos[number],
            "right": photos[number + 1],
            "elements": {"unit": "deg", **dict(zip(ELEMENTS, elements[number], strict=True))},
            "sigmas": {"unit": "deg", **dict(zip(ELEMENTS, sigmas[number], strict=True))},
            **dict(zip(columns, row, strict=True)),
        }
        for number, row in enumerate(zip(*columns.values(), strict=True))
    ]


def _detectable(strip: StripResult) -> Floats:
    """Largest of the smallest errors that can be found at the points of each pair, mm; NaN where one is never seen."""
    size = np.where(strip.of_photos.orientation.used, strip.of_photos.screened.detectable, 0.0)
    worst = np.maximum.reduceat(np.nan_to_num(size, nan=0.0, posinf=np.inf), strip.of_photos.orientation.pairs.starts)
    return np.where(np.isfinite(worst), worst, np.nan)


def parallaxes_of(result: Result, rank: Numbers) -> list[Document]:
    """Return the list ``parallaxes``: y parallaxes of all points of every pair, in natural order of the points."""
    ids = result.refined.observations.point_ids
    found = []
    for strip in result.photo_strips:
        oriented, photos = strip.of_photos.orientation, strip.strip.photos
        order = np.lexsort((rank[oriented.point], oriented.pairs.pair))
        names = [ids[number] for number in oriented.point[order]]
        values, used = micrometres(oriented.parallax[order]), oriented.used[order].tolist()
        redundancy = rounded(np.where(oriented.used, oriented.redundancy, np.nan)[order], 3)
        detectable = rounded(1000 * strip.of_photos.screened.detectable[order], 1)
        zone = strip.of_photos.screened.zone[order].tolist()
        ends = [*oriented.pairs.starts.tolist(), len(names)]
        found += [
            {
                "strip": strip.strip.id,
                "left": photos[n],
                "right": photos[n + 1],
                "points": names[ends[n] : ends[n + 1]],
                "q_um": values[ends[n] : ends[n + 1]],
                "used": used[ends[n] : ends[n + 1]],
                "zone": zone[ends[n] : ends[n + 1]],
                "redundancy": redundancy[ends[n] : ends[n + 1]],
                "detectable_um": detectable[ends[n] : ends[n + 1]],
            }
            for n in range(len(photos) - 1)
        ]
    return found


def junctions_of(result: Result) -> list[Document]:
    """Return the list ``junctions``: the scale transfer at every photo that joins two models."""
    ids = result.refined.observations.point_ids
    return [junction for strip in result.photo_strips for junction in _junctions(strip, ids)]


def _junctions(strip: StripResult, ids: Sequence[str]) -> list[Document]:
    photos, joined = strip.strip.photos, strip.of_photos.formed.junctions
    joints = len(joined.factor)
    count = np.bincount(joined.junction, joined.used, joints).astype(np.intp)
    gap = discrepancies(strip)
    known = joined.used & ~np.isnan(gap[:, 0])  # points left out later, for their rays, have no place in the models
    squares = np.column_stack([np.bincount(joined.junction[known], gap[known, axis] ** 2, joints) for axis in range(3)])
    size = np.sqrt(squares / np.maximum(np.bincount(joined.junction[known], minlength=joints), 1)[:, None])
    metres, in_photo = rounded(size, GROUND), rounded(size / strip.scale_number * PPM, 1)
    left_out: dict[int, list[str]] = {}
    for row in np.flatnonzero(~joined.used).tolist():
        left_out.setdefault(int(joined.junction[row]), []).append(ids[joined.point[row]])
    columns = zip(
        count.tolist(),
        significant(joined.factor, EXACT),
        rounded(joined.spread * PPM, RATIO_DECIMALS),
        metres,
        in_photo,
        strict=True,
    )
    return [
        {
            "strip": strip.strip.id,
            "photo": photos[number + 1],
            "photos": list(photos[number : number + 3]),
            "points_used": points,
            "points_rejected": left_out.get(number, []),
            "factor": factor,
            "spread_ppm": spread,
            "discrepancy": dict(zip(("along", "across", "up"), ground, strict=True)),
            "discrepancy_um": dict(zip(("along", "across", "up"), image, strict=True)),
        }
        for number, (points, factor, spread, ground, image) in enumerate(columns)
    ]


def discrepancies(strip: StripResult) -> Floats:
    """Differences of points common to neighbouring models, after minus before.

    Returns
    -------
    ndarray, shape (t, 3)
        Metres along the strip, to its left and up, of every pass point of every joint; NaN where its rays were
        left out.
    """
    joined, similarity = strip.of_photos.formed.junctions, strip.absolute.similarity
    gap = strip.of_photos.formed.model_xyz[joined.after] - strip.of_photos.formed.model_xyz[joined.before]
    return similarity.scale * gap @ similarity.rotation.T


# --------------------------------------------------------------------------------------------------- rejections


def rejected_of(result: Result) -> list[Document]:
    """Return the list ``rejected``: what was taken out of pairs, scale transfers, points and control, in flight order.

    Within a pair or a joint they stand in natural order of the points: the order of the tables does not show. A
    measurement that was taken back in the end is in it, marked.
    """
    ids = result.refined.observations.point_ids
    found = []
    for strip in result.photo_strips:
        oriented = strip.of_photos.orientation
        pair, point = oriented.pairs.pair, oriented.point
        gone = sorted(strip.of_photos.rejections, key=lambda each: (int(pair[each.row]), natural(ids[point[each.row]])))
        found += [_from_pair(strip, rejection, result.refined.observations) for rejection in gone]
        found += _from_joints(strip, ids)
        found += _from_rays(strip, result.refined.observations)
        found += [from_control(strip, wrong) for wrong in strip.wrong_control]
    return found


def _from_pair(strip: StripResult, rejection: PairRejection, observations: PhotoPoints) -> Document:
    pair = int(strip.of_photos.orientation.pairs.pair[rejection.row])
    left, right = strip.strip.photos[pair : pair + 2]
    size = rejection.size * 1000
    reason = f"y parallax {size:.1f} µm in the pair oriented without it"
    unit, value, limit = "", rejection.value, rejection.limit
    if rejection.test == "in front":
        reason = "the rays do not meet in front of the cameras"
    elif rejection.test == "parallax":
        unit, value, limit = "um", value * 1000, limit * 1000
    if rejection.readmitted:
        reason = "taken back: the pair or the strip oriented on the other points predicts it, or the user keeps it"
    told = [row for row in _told(strip) if row in strip.of_photos.orientation.rows[rejection.row]]
    blamed = [observations.photo_ids[observations.photo[row]] for row in told]
    if blamed and not rejection.readmitted:
        reason += f"; the wrong ray is that of photo {', '.join(blamed)}: the others of the point meet without it"
    elif rejection.test != "in front" and not rejection.readmitted:
        reason += "; which of its two rays is wrong cannot be told"
    return {
        "strip": strip.strip.id,
        "photo": left,
        "other_photo": right,
        "point": observations.point_ids[strip.of_photos.orientation.point[rejection.row]],
        "stage": "relative",
        "test": rejection.test,
        "value": rounded(value, 2),
        "limit": rounded(limit, 2),
        "unit": unit,
        "parallax_um": rounded(size, 2),
        "zone": rejection.zone or None,
        "size": rounded(size, 2),
        "size_unit": "um",
        "readmitted": rejection.readmitted,
        "blamed": [] if rejection.readmitted else blamed,
        "reason": reason,
    }


def _told(strip: StripResult) -> list[int]:
    """Rows of the observations that are known to be wrong, of their points' rays."""
    found = strip.of_photos.contradictions
    return [int(row) for row, kind in zip(found.wrong, found.kind, strict=True) if kind == WRONG_RAY]


def _from_joints(strip: StripResult, ids: Sequence[str]) -> list[Document]:
    """Pass points that did not belong in a scale transfer; the error as that of an x parallax in one of the models."""
    joined, zone = strip.of_photos.formed.junctions, strip.of_photos.screened.zone
    out = np.flatnonzero(~joined.used).tolist()
    rows = np.array(
        sorted(out, key=lambda row: (int(joined.junction[row]), natural(ids[int(joined.point[row])]))), np.intp
    )
    joint = joined.junction[rows]
    base, _ = strip.of_photos.orientation.relative
    deviation = joined.ratio[rows] / joined.factor[joint] - 1
    depth = depths(strip.of_photos.formed.vectors[joined.after[rows]], base[joint + 1])
    size = deviation * strip.of_photos.orientation.pairs.focal / depth * 1000
    return [
        {
            "strip": strip.strip.id,
            "photo": strip.strip.photos[joined.junction[row] + 1],
            "other_photo": None,
            "point": ids[joined.point[row]],
            "stage": "scale_transfer",
            "test": "ratio",
            "value": rounded(abs(off) * PPM, RATIO_DECIMALS),
            "limit": rounded(joined.limit[row] * PPM, RATIO_DECIMALS),
            "unit": "ppm",
            "parallax_um": None,
            "zone": int(zone[joined.after[row]]),
            "size": rounded(shift, 2),
            "size_unit": "um",
            "readmitted": False,
            "blamed": [],
            "reason": f"scale ratio {abs(off) * PPM:.0f} ppm from that of the other pass points: an x parallax wrong "
            f"by {shift:.1f} µm would explain it",
        }
        for row, off, shift in zip(rows.tolist(), deviation.tolist(), size.tolist(), strict=True)
    ]


def _from_rays(strip: StripResult, observations: PhotoPoints) -> list[Document]:
    """Rays that contradict the others of their point, in natural order of the points, then in flight order.

    A ray that all its pairs have rejected stands with those.
    """
    found, news = strip.of_photos.contradictions, rejected_by_strip(strip)
    zone = _zones_of(strip, len(observations))
    names = [observations.point_ids[number] for number in found.point]
    place = {photo: number for number, photo in enumerate(strip.strip.photos)}
    position = [place[observations.photo_ids[observations.photo[row]]] for row in found.wrong]
    rows = []
    for number in sorted(range(len(names)), key=lambda each: (natural(names[each]), position[each])):
        kind = found.kind[number]
        if not news[number]:
            continue
        size = found.size[number]
        largest = float(size[np.argmax(np.abs(size))]) if np.isfinite(size).all() else float("nan")
        rows.append(
            {
                "strip": strip.strip.id,
                "photo": observations.photo_ids[observations.photo[found.wrong[number]]],
                "other_photo": None,
                "point": names[number],
                "stage": "rays",
                "test": "strip",
                "value": rounded(found.value[number], 2),
                "limit": rounded(found.limit[number], 2),
                "unit": "",
                "parallax_um": None,
                "zone": int(zone[found.wrong[number]]) or None,
                "size": rounded(largest * 1000, 2) if np.isfinite(largest) else None,
                "size_unit": "um" if np.isfinite(largest) else "",
                "readmitted": False,
                "blamed": [observations.photo_ids[observations.photo[found.wrong[number]]]]
                if kind == WRONG_RAY
                else [],
                "reason": REASONS[kind],
            }
        )
    return rows


def _zones_of(strip: StripResult, rays: int) -> Numbers:
    """Return the standard zone of each image point in the pair with the next photo or the one before; 0 in none."""
    zone = np.zeros(rays, np.intp)
    for side in (1, 0):
        zone[strip.of_photos.orientation.rows[:, side]] = strip.of_photos.screened.zone
    return zone


def rejected_by_strip(strip: StripResult) -> Flags:
    """Tell which of the measurements that the strip found wrong had not been rejected by all their pairs.

    Returns
    -------
    ndarray of bool
        For each entry of ``strip.contradictions``.
    """
    oriented = strip.of_photos.orientation
    logged = np.zeros(len(oriented.point), bool)
    logged[[each.row for each in strip.of_photos.rejections if not each.readmitted]] = True
    news: Flags = np.isin(strip.of_photos.contradictions.wrong, oriented.rows[~logged])
    return news


def from_control(strip: StripResult, wrong: ControlRejection) -> Document:
    """Return an entry of ``rejected``: wrong control."""
    sizes = dict(zip(AXES, wrong.size, strict=True))
    reason = "; ".join(f"{axis} by about {sizes[axis]:+.2f} m" for axis in wrong.axes)
    if wrong.exchanged_with:
        reason += f"; fits when exchanged with {wrong.exchanged_with}"
    return {
        "strip": strip.strip.id,
        "photo": None,
        "other_photo": None,
        "point": wrong.id,
        "stage": "control",
        "test": "left out",
        "value": rounded(wrong.value, 2),
        "limit": rounded(wrong.limit, 2),
        "unit": "",
        "parallax_um": None,
        "zone": None,
        "size": rounded(max((sizes[axis] for axis in wrong.axes), key=abs, default=0.0), GROUND),
        "size_unit": "m",
        "readmitted": False,
        "blamed": [],
        "reason": f"given coordinates contradict the strip and the other control: {reason}",
    }
