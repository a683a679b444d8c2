"""A result against the truth that it was simulated from: true errors, beside what the result says of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.notes import Document
from photostrip.result.certificate import OF_VALUES, faults_of_edited
from photostrip.result.description import block_at
from photostrip.result.distances import east_north_up, level, plan_and_height
from photostrip.result.numbers import MATRIX
from photostrip.result.reading import read
from photostrip.statistics import chi2_quantile

SCHEMA = 2  # of truth.json
ROLES = ("new", "check", "control")
PROBABLE = 0.95
PARTS = ("plan", "height")
COORDINATES = {"plan": 2, "height": 1}
FIX = "simulate it again"  # for a truth that was edited


def compare_with_truth(document: Document, truth: Document, files: tuple[str, str] = ("", "")) -> Document:
    """Compare the points, photos and rejections of a result with the truth of its simulation.

    Returns ``points`` by role and ``photos``: number, rms and largest error in plan and height, metres; for points also
        the rms of the errors over their standard deviations and how many lie within what 95 % would; ``photos`` with
        the rms of the angle between true and found orientation, degrees; ``errors``: how many gross errors were put in,
        which of them the result does not name, and how many measurements without one were rejected.
    Raises InputError when they are of different strips or frames, or one is not whole.
    """
    truth = _whole(truth, files[1])
    with faults_of_edited("compared with the truth", (document, files[0]), errors=OF_VALUES):
        _require_same_frame(document, truth, files)
        return {
            "photostrip_truth_comparison": 1,
            "result": files[0],
            "truth": files[1],
            "name": document["name"],
            "points": _points(document, truth, files),
            "photos": _photos(document, truth),
            "errors": _errors(document["rejected"], truth["errors"]),
        }


def _whole(truth: Document, file: str) -> Document:
    """Refuse a truth that was edited or is of another version, with every fault."""
    if truth.get("photostrip_truth") != SCHEMA:
        message = f"has the format {truth.get('photostrip_truth')!a:.40} of a truth"
        raise InputError(Fault(message, "result-schema", file, expected=str(SCHEMA), fix=FIX))
    return read(truth, file, block_at("truth"), FIX)


def _require_same_frame(document: Document, truth: Document, files: tuple[str, str]) -> None:
    for key in ("crs", "axes"):
        now, then = document["frame"][key], truth["frame"][key]
        if now != then:
            message = f"cannot be compared with {files[1] or 'the truth'}: frame.{key} is {now}"
            raise InputError(Fault(message, "not-comparable", files[0], key=f"frame.{key}", expected=str(then)))


def _points(document: Document, truth: Document, files: tuple[str, str]) -> list[Document]:
    """Return the errors of the points by role."""
    true = {row["id"]: row for row in truth["points"]}
    rows = [row for row in document["points"] if row["id"] in true and row["x"] is not None]
    if not rows:
        message = f"cannot be compared with {files[1] or 'the truth'}: no point is in both"
        raise InputError(
            Fault(message, "not-comparable", files[0], key="points", expected="the simulation it came from")
        )
    found = []
    for role in ROLES:
        of_role = [row for row in rows if row["role"] == role]
        if of_role:
            then = [true[row["id"]] for row in of_role]
            sizes = plan_and_height(document["frame"], _places(of_role), _places(then))
            squares = _normalised(document["frame"], of_role, then)
            found.append({"role": role, **_in_parts([row["id"] for row in of_role], sizes, squares)})
    return found


def _photos(document: Document, truth: Document) -> Document:
    """Return the errors of perspective centres and orientations."""
    true = {row["id"]: row for row in truth["photos"]}
    rows = [row for row in document["photos"] if row["id"] in true and row["x"] is not None]
    sizes = plan_and_height(document["frame"], _places(rows), _places([true[row["id"]] for row in rows]))
    found = _in_parts([row["id"] for row in rows], sizes, {})
    turned = [row for row in rows if row["r11"] is not None]
    now, then = (
        np.array([[each[name] for name in MATRIX] for each in rows], float).reshape(-1, 9)
        for rows in (turned, [true[row["id"]] for row in turned])
    )
    # 2 sqrt(2) sin(angle / 2) is the length of the difference of two rotations
    half = np.minimum(np.linalg.norm(now - then, axis=1) / np.sqrt(8.0), 1.0)
    angles = np.degrees(2.0 * np.arcsin(half))
    return {**found, "rotation": _spread([row["id"] for row in turned], angles, "deg")}


def _places(rows: Sequence[Document]) -> Floats:
    return np.array([[row[axis] for axis in "xyz"] for row in rows], float).reshape(-1, 3)


def _normalised(frame: Document, rows: Sequence[Document], true: Sequence[Document]) -> dict[str, Floats]:
    """Return e^T C^-1 e of the errors e in plan and in height with the covariances C of the result, where both are."""
    e, axes = east_north_up(frame, _places(rows), _places(true)), level(frame, _places(true))
    c = np.full((len(rows), 3, 3), np.nan)
    for n, row in enumerate(rows):
        if row.get("sigma_x") is not None:
            xy, xz, yz = (row[f"cov_{pair}"] for pair in ("xy", "xz", "yz"))
            full = [[row["sigma_x"] ** 2, xy, xz], [xy, row["sigma_y"] ** 2, yz], [xz, yz, row["sigma_z"] ** 2]]
            c[n] = axes[n] @ np.array(full) @ axes[n].T
    known = np.isfinite(c).all(axis=(1, 2))
    plan = np.linalg.solve(c[known, :2, :2], e[known, :2, None])[..., 0]
    return {"plan": (plan * e[known, :2]).sum(axis=1), "height": e[known, 2] ** 2 / c[known, 2, 2]}


def _in_parts(ids: Sequence[str], sizes: tuple[Floats, Floats], squares: dict[str, Floats]) -> Document:
    found: Document = {"count": len(ids)}
    for part, size in zip(PARTS, sizes, strict=True):
        found[part] = _spread(ids, size, "m")
        if len(known := squares.get(part, np.zeros(0))):
            found[part] |= {
                "normalised": float(np.sqrt(known.mean() / COORDINATES[part])),
                "inside": int((known <= chi2_quantile(PROBABLE, COORDINATES[part])).sum()),
                "known": len(known),
            }
    return found


def _spread(ids: Sequence[str], sizes: Floats, unit: str) -> Document:
    if not len(sizes):
        return {"rms": None, "max": None, "worst": "", "unit": unit}
    worst = int(np.argmax(sizes))
    return {
        "rms": float(np.sqrt((sizes**2).mean())),
        "max": float(sizes[worst]),
        "worst": ids[worst],
        "unit": unit,
    }


def _errors(rejected: Sequence[Document], planted: Sequence[Document]) -> Document:
    """Return which gross errors the rejections name; a ray is named by its photo and point, control by its point."""
    rays = {(photo, row["point"]) for row in rejected for photo in _photos_of(row)}
    given = {row["point"] for row in rejected if row["stage"] == "control"}
    wrong: set[tuple[str, str]] = set()
    missed = []
    for error in planted:
        photo, points = error["photo"] or "", [error["point"], *([error["other"]] if error.get("other") else [])]
        wrong |= {(photo, point) for point in points}
        named = any((photo, point) in rays for point in points) if photo else error["point"] in given
        if not named:
            missed.append(_named(error))
    sound = [row for row in rejected if not any((photo, row["point"]) in wrong for photo in (*_photos_of(row), ""))]
    return {"planted": len(planted), "missed": missed, "sound_rejected": len(sound)}


def _photos_of(row: Document) -> list[Any]:
    """Return the photos that a rejection takes the point out of: the blamed ones where they are known."""
    return list(row.get("blamed") or ()) or [each for each in (row["photo"], row["other_photo"]) if each]


def _named(error: Document) -> Document:
    return {key: error.get(key) for key in ("kind", "photo", "point", "other", "axis", "size_um", "size_m")}
