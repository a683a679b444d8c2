"""How the position of each point is checked: across the base and along it, only across, or not at all.

What two photos show of a point has one condition, the y parallax: an error along the base moves the point and leaves no
residual. A third photo, a second model or given coordinates check that too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from photostrip.arrays import Flags, Numbers
from photostrip.network import reliability
from photostrip.notes import Document, Note, counted
from photostrip.pipeline.given_points import rejected_control
from photostrip.pipeline.results import Bundle, Result
from photostrip.points import locate
from photostrip.rejection import UNCONTROLLED
from photostrip.result.table import Table

CHECKED = NONE, ACROSS, ALONG = "none", "across", "along"


def checked_of(result: Result, models: Numbers) -> Numbers:
    """Return the place in ``CHECKED`` of every point, in the order of ``result.points``.

    models: of every point, how many gave it.
    """
    return _of_strips(result, models) if result.bundle is None else _of_bundle(result, result.bundle)


def _of_bundle(result: Result, bundle: Bundle) -> Numbers:
    """In how many directions of the image, of the model, every error of a ray shows in its own residuals.

    The redundancy numbers of a ray are the eigenvalues of its block of cofactors over its variances: one for each
    direction. The ray that is checked least says it of its point.
    """
    problem, precision = bundle.screened.problem, bundle.screened.precision
    (group,) = (each for each in bundle.groups if each.kind == reliability.IMAGE)
    shares = precision.image_residuals / group.sigma[:, :, None] / group.sigma[:, None, :]
    directions = (np.linalg.eigvalsh(shares) >= UNCONTROLLED).sum(axis=1)
    every = group.sigma.shape[1]
    of_ray = np.where(directions == every, 2, np.minimum(directions, 1))
    ids = result.refined.observations.point_ids
    numbers, place = np.unique(problem.images.point, return_inverse=True)
    rows = np.searchsorted(result.points.number, locate(map(problem.point_name, numbers.tolist()), ids))
    found = np.zeros(len(result.points.number), np.intp)
    least = np.full(len(numbers), len(CHECKED) - 1)
    np.minimum.at(least, place, of_ray)
    found[rows] = least
    return found


def _of_strips(result: Result, models: Numbers) -> Numbers:
    """By a second model, or by control, along the base; else across, where the pair has redundancy there."""
    control, numbers = result.inputs.control, result.points.number
    across: Flags = np.zeros(len(result.refined.observations.point_ids), bool)
    for strip in result.photo_strips:
        oriented = strip.of_photos.orientation
        across[oriented.point[oriented.used & (oriented.redundancy >= UNCONTROLLED)]] = True
    given = ~control.check & (control.use & ~rejected_control(result)).all(axis=1) & (result.control_rows >= 0)
    along = models > 1
    along[result.control_rows[given]] = True
    return np.where(along, 2, across[numbers].astype(np.intp))


def counts_of(points: Table) -> Document:
    """Count the points by how they are checked, best first."""
    number = Counter(points.values("checked"))
    return {"points_checked": {name: number[name] for name in reversed(CHECKED)}}


def unchecked_notes(points: Table, rejected: Table, measured: int) -> Iterator[Note]:
    """Say what may be left in points that nothing checks along the base, where as many rays were found wrong.

    rejected: the table ``rejected`` of the document.
    measured: number of all image points.
    """
    wrong = {each["point"] for each in rejected if each["photo"] is not None and not each["readmitted"]}
    share, number = len(wrong) / max(measured, 1), counts_of(points)["points_checked"]
    if share * points["rays"][points["checked"] != ALONG].sum() < 1.0:
        return
    text = (
        f"rays of {counted(len(wrong), 'point')} were found wrong, {100 * share:.1f} % of all rays; "
        f"{counted(number[ACROSS], 'point is', 'points are')} checked only across the base, {number[NONE]} not at all: "
        f"about as many of their rays may be wrong along it, which no residual shows and no standard deviation contains"
    )
    yield Note("unchecked-points", text, severity="note")
