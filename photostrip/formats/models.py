"""Measured model coordinates: tables ``model,point,x,y,z[,sx,sy,sz[,cov_xy,cov_xz,cov_yz]]`` and of ``photo`` alike.

Files of blocks, a model's id, lines ``point x y z`` and -99, are read as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.formats.faults import Findings
from photostrip.formats.measured import AXES, PHOTO, POINT, SIGMAS, numbers, refuse_without_sigma, sigmas
from photostrip.formats.tables import UNDECLARED, Column, Form, Table, read_table

MODEL = Column("model", aliases=("model_id", "pair", "stereopair"))
COVARIANCES = ("cov_xy", "cov_xz", "cov_yz")
COORDINATES = (
    *numbers(*AXES),
    *sigmas(*AXES),
    *(Column(name, number=True, required=False, filled=False) for name in COVARIANCES),
)
END = "-99"  # of a model, in a file of blocks
MODEL_POINTS = (MODEL, POINT, *COORDINATES)
MODEL_CENTERS = (MODEL, PHOTO, *COORDINATES)


@dataclass(frozen=True, eq=False)
class ModelTable:
    table: Table
    target: str  # what is measured: ``point`` or ``photo``, for its perspective centre
    model_ids: tuple[str, ...]
    target_ids: tuple[str, ...]
    # models, targets: (n,): numbers of the model and of the point of each row
    models: Numbers
    targets: Numbers
    # xyz, sigma: (n, 3): coordinates and standard deviations in the unit of the table; NaN where a cell is empty
    xyz: Floats
    sigma: Floats
    covariance: Floats  # (n, 3): of x and y, x and z, y and z in the square of that unit; NaN where a cell is empty


def read_models(
    file: str,
    findings: Findings,
    *,
    centers: bool = False,
    has_sigma: bool = True,
    form: Form = UNDECLARED,
) -> ModelTable | None:
    """Read a table of model coordinates; None when the header is wrong.

    has_sigma: whether the project has standard deviations for rows without them.
    form: how the table is written.
    """
    target = "photo" if centers else "point"
    rewritten = None if centers else rows_of_blocks
    layout = MODEL_CENTERS if centers else MODEL_POINTS
    table = read_table(file, layout, findings, form=form, rewritten=rewritten)
    if table is None:
        return None
    read = ModelTable(
        table=table,
        target=target,
        model_ids=table.ids["model"],
        target_ids=table.ids[target],
        models=table.codes["model"],
        targets=table.codes[target],
        xyz=table.columns(*AXES),
        sigma=table.columns(*SIGMAS),
        covariance=table.columns(*COVARIANCES),
    )
    if not has_sigma and not findings.number(file):
        fix = "set `models.sigma: [sx, sy, sz]` in the project file, or fill the columns sx, sy, sz"
        missing = np.asarray(np.isnan(read.sigma).any(axis=1, keepdims=True))
        refuse_without_sigma(table, missing, SIGMAS, fix, findings)
    _refuse_repeated(read, findings)
    _refuse_wrong_covariances(read, findings)
    return read


def correlations(sigma: Floats, covariance: Floats) -> Floats:
    """Matrices (n, 3, 3) of correlations from standard deviations and covariances of xy, xz, yz; NaN counts as 0."""
    found = np.tile(np.eye(3), (len(sigma), 1, 1))
    for (one, other), column in zip(((0, 1), (0, 2), (1, 2)), np.nan_to_num(covariance).T, strict=True):
        found[:, one, other] = found[:, other, one] = column / (sigma[:, one] * sigma[:, other])
    return found


def _refuse_wrong_covariances(read: ModelTable, findings: Findings) -> None:
    """Refuse covariances without standard deviations beside them, and those that no coordinates have."""
    given = np.flatnonzero(np.isfinite(read.covariance).any(axis=1))
    alone = np.asarray(np.isnan(read.sigma[given]).any(axis=1), bool)
    least = np.zeros(len(given))
    least[~alone] = np.linalg.eigvalsh(correlations(read.sigma[given[~alone]], read.covariance[given[~alone]]))[:, 0]
    for row, without in zip(given[least <= 0.0].tolist(), alone[least <= 0.0].tolist(), strict=True):
        message = "the row has covariances and no standard deviations"
        if not without:
            message = "no coordinates have these standard deviations and covariances: their matrix is not positive"
        expected = "sx, sy, sz and cov_xy with |cov_xy| < sx sy and so on, in the square of the unit of the coordinates"
        findings.add(read.table.fault(row, "x", message, "wrong-covariance", expected=expected))


def rows_of_blocks(data: bytes) -> bytes:
    """Make a table of a file of blocks, as programs for independent models write it; any other file stays as it is.

    Each model begins with a line that has its id alone, holds lines of a point, three coordinates and whatever else,
    parted by blanks, and ends with -99. Each row of the table stands in the line of its point.
    """
    lines = data.decode().splitlines()
    filled = [line.split() for line in lines if line.strip()]
    if not filled or len(filled[0]) != 1 or "," in filled[0][0] or not any(each == [END] for each in filled):
        return data
    found, model, header = [], "", ",".join(column.name for column in MODEL_POINTS if column.required)
    for fields in (line.split() for line in lines):
        text = ""
        if fields == [END]:
            model = ""
        elif fields and not model:
            model, text, header = fields[0], header, ""
        elif fields:
            text = ",".join(_quoted(each) for each in (model, *fields[:4]))
        found.append(text)
    return "\n".join(found).encode()


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if '"' in text or "," in text else text


def _refuse_repeated(read: ModelTable, findings: Findings) -> None:
    """Refuse a point that stands twice in one model: two points of one id, or a model that was written twice."""
    key = read.models * max(len(read.target_ids), 1) + read.targets
    order = np.argsort(key, kind="stable")
    again = order[1:][key[order][1:] == key[order][:-1]]
    first = {int(key[row]): int(row) for row in order[::-1].tolist()}
    whole = _written_twice(read, again)
    reported: set[int] = set()
    for row in sorted(again.tolist()):
        if findings.full(read.table.file):
            findings.count(read.table.file, 1)
            continue
        model, line = int(read.models[row]), read.table.lines[first[int(key[row])]]
        name = read.model_ids[model]
        if model in whole:
            if model not in reported:
                reported.add(model)
                message = (
                    f"model {name} appears twice: its points begin again here, and are already given in line {line}"
                )
                fix = "give one of the two another id, or remove it"
                findings.add(read.table.fault(row, "model", message, "model-twice", fix=fix))
            continue
        message = (
            f"{read.target} {read.target_ids[read.targets[row]]} is already measured in model {name}, in line {line}"
        )
        fix = "keep one of the two, or give one another id"
        findings.add(read.table.fault(row, read.target, message, "measured-twice", fix=fix))


def _written_twice(read: ModelTable, again: Numbers) -> set[int]:
    """Models of which half the rows or more stand a second time."""
    rows = np.bincount(read.models, minlength=len(read.model_ids))
    repeated = np.bincount(read.models[again], minlength=len(read.model_ids))
    return set(np.flatnonzero((repeated > 1) & (3 * repeated >= rows)).tolist())
