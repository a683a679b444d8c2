"""A point measured several times on one photo: refused, or averaged with its spread noted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.formats.measured.measurements import Measurements
from photostrip.formats.text.findings import Findings
from photostrip.notes import Note, counted

POLICIES = ("refuse", "average")
LEAST_TOGETHER = 4  # points measured several times, of which more than
MOST_SHARE = 0.5  # disagree for one reason
REACH_SHARE = 0.98  # of the coordinates
AGREEING_SHARE = 3e-4  # of what coordinates reach to: 30 micrometres of 100 mm
FARTHEST_SIGMAS = 10.0  # standard deviations from the mean; beyond, two measurements are not of one point
DECIMALS = 9  # of the unit of a table: what is left beyond is rounding


def refuse(read: Measurements, target: str, findings: Findings) -> None:
    """Refuse a second measurement of the same point, or mark, on the same photo."""
    key = _key(read)
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(key[order][1:] == key[order][:-1]) + 1
    first: dict[int, int] = {}
    for told, place in enumerate(again):
        if findings.full(read.table.file):
            findings.count(read.table.file, len(again) - told)
            return
        row = int(order[place])
        number = first.setdefault(int(key[row]), int(order[place - 1]))
        name, photo = read.target_ids[read.target[row]], read.photo_ids[read.photo[row]]
        message = f"{target} {name} is already measured on photo {photo}, in {read.table.lines_of(number)}"
        fix = "keep one of the two, give one another id, or set `repeated: average`"
        findings.add(read.table.fault(row, target, message, "measured-twice", fix=fix))


def averaged(read: Measurements, target: str, default: float | None, findings: Findings) -> Measurements:
    """Replace several measurements of a point, or mark, on a photo by their weighted mean.

    The mean stands where the first measurement stood. Its standard deviation follows from those of the measurements,
    not from their spread, which becomes a note. Measurements too far apart to be of one point are refused.

    default: standard deviation of rows without one, in the unit of the table.
    """
    _, first, group, count = np.unique(_key(read), return_index=True, return_inverse=True, return_counts=True)
    if (count == 1).all():
        return read
    sigma = np.where(np.isnan(read.sigma), np.nan if default is None else default, read.sigma)
    weight = np.where(np.isfinite(sigma), sigma, 1.0) ** -2.0
    total = _sums(group, weight)
    mean = _sums(group, weight * read.xy) / total
    off = np.where(count[group, None] > 1, read.xy - mean[group], 0.0)
    ratio = np.abs(off) / sigma
    if not _refuse_all(read, target, off, ratio, group, findings):
        _refuse_far(read, target, ratio, group, findings)
    findings.notes.append(_spread(read, target, off, count))
    of_mean = np.where(np.isnan(_sums(group, sigma)), np.nan, total**-0.5)
    order = np.argsort(first)
    rows, several = first[order], count[order, None] > 1
    return replace(
        read,
        table=read.table.take(rows),
        photo=read.photo[rows],
        target=read.target[rows],
        xy=np.where(several, mean[order], read.xy[rows]),
        sigma=np.where(several, of_mean[order], read.sigma[rows]),
        times=count[order],
    )


def _key(read: Measurements) -> Numbers:
    return np.asarray(read.photo * len(read.target_ids) + read.target, np.intp)


def _sums(group: Numbers, values: Floats) -> Floats:
    return np.stack([np.bincount(group, column) for column in values.T], axis=1, dtype=float)


def _refuse_all(
    read: Measurements, target: str, off: Floats, ratio: Floats, group: Numbers, findings: Findings
) -> bool:
    """Refuse measurements of which most disagree: they have one cause, often the unit.

    Measurements that differ by next to nothing of what they reach to agree, and what they are tested against is wrong.
    """
    several = np.bincount(group)[group] > 1
    far = several & (np.nan_to_num(ratio.max(axis=1)) > FARTHEST_SIGMAS)
    names = len(np.unique(group[several]))
    if names < LEAST_TOGETHER or far.sum() <= MOST_SHARE * several.sum():
        return False
    scatter = np.median(np.abs(off[several]).max(axis=1))
    reach = np.quantile(np.abs(read.xy), REACH_SHARE)
    head = (
        f"{names} {target}s are measured several times on a photo, and {len(np.unique(group[far]))} of them lie more "
        f"than {FARTHEST_SIGMAS:g} standard deviations from their mean"
    )
    if scatter < AGREEING_SHARE * reach:
        message = (
            f"{head}, by {scatter:.2g}, of coordinates that reach to {reach:.4g}: they agree as measurements do, so "
            "that the unit or the standard deviation is wrong"
        )
        fix = "correct `observations.unit` or `observations.sigma`"
    else:
        message = f"{head}, by {scatter:.2g}, of coordinates that reach to {reach:.4g}"
        fix = (
            "were photos set up again between two pairs, or points renumbered? reduce coordinates to the fiducial marks"
        )
    findings.add(read.table.fault(int(np.argmax(far)), target, message, "measurements-disagree", fix=fix))
    return True


def _refuse_far(read: Measurements, target: str, ratio: Floats, group: Numbers, findings: Findings) -> None:
    """Refuse measurements that lie farther from their mean than one point's can."""
    farthest = np.zeros(group.max() + 1)
    np.maximum.at(farthest, group, np.nan_to_num(ratio.max(axis=1)))
    for number in np.flatnonzero(farthest > FARTHEST_SIGMAS).tolist():
        if findings.full(read.table.file):
            findings.count(read.table.file, 1)
            continue
        rows = np.flatnonzero(group == number)
        apart = np.ptp(read.xy[rows], axis=0)
        name, photo = read.target_ids[read.target[rows[0]]], read.photo_ids[read.photo[rows[0]]]
        lines = read.table.lines_of(*rows.tolist())
        message = (
            f"{target} {name} is measured {len(rows)} times on photo {photo} ({lines}), up to {apart.max():g} in "
            f"{'xy'[int(apart.argmax())]} apart: {farthest[number]:.0f} standard deviations from the mean"
        )
        fix = "remove the wrong one, or give the other point an id of its own"
        findings.add(read.table.fault(int(rows[-1]), target, message, "measurements-disagree", fix=fix))


def _spread(read: Measurements, target: str, off: Floats, count: Numbers) -> Note:
    """Tell how well repeated measurements agree."""
    several = count > 1
    freedom = int((count[several] - 1).sum())
    off = np.round(off, DECIMALS)
    scatter = np.sqrt((off**2).sum(axis=0) / freedom)
    worst = int(np.abs(off).max(axis=1).argmax())
    name, photo = read.target_ids[read.target[worst]], read.photo_ids[read.photo[worst]]
    message = (
        f"{counted(int(several.sum()), target)} measured up to {count.max()} times on a photo, the mean is used; one"
        f" measurement scatters by {scatter[0]:.3g} in x and {scatter[1]:.3g} in y (standard deviations, unit of the"
        f" table), the worst is {target} {name} on photo {photo}, {np.abs(off[worst]).max():.3g} off its mean"
    )
    line, file = int(read.table.lines[worst]), read.table.file_of(worst)
    return Note("measurements-averaged", message, "note", photos=(photo,), points=(name,), file=file, line=line)
