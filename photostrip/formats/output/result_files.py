"""The document of a result as text: result.json, and the CSV tables beside it."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, InputError
from photostrip.formats.text.files import MEGABYTE, decode, read_bytes, refuse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from photostrip.result.numbers import Document, Plain

LARGEST_RESULT = 1000 * MEGABYTE
SCHEMA = 1
LINE = 160  # characters up to which a dictionary stands on one line
NEEDS_QUOTES = re.compile(r'[",\r\n]|^\s|\s$')
GEOGRAPHIC_DECIMALS, GROUND_DECIMALS, COVARIANCE_DECIMALS = 10, 4, 8
COVARIANCES = ("cov_xy", "cov_xz", "cov_yz")
ELLIPSE = "ellipse_a,ellipse_b,ellipse_azimuth_deg"

_encode = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
_encode_ascii = json.JSONEncoder(ensure_ascii=True, allow_nan=False).encode


def to_json(document: Document, *, ascii_only: bool = False) -> str:
    """Return the text of result.json.

    Parameters
    ----------
    ascii_only : bool
        Whether letters beyond ASCII are to be written as escapes.

    Returns
    -------
    str
        JSON: one key after the other, each element of a list of records on a line of its own, so that results can be
        compared line by line.
    """
    encode = _encode_ascii if ascii_only else _encode
    return "{\n" + ",\n".join(f"{encode(key)}: {_block(value, encode)}" for key, value in document.items()) + "\n}\n"


def _block(value: Plain, encode: Callable[[Plain], str]) -> str:
    text = encode(value)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        # One call for the whole list, lines broken afterwards, in front of the first key of each record. Inside a
        # string these signs cannot stand, its quotation marks being escaped; between records a line feed is a blank.
        begin = f"{{{encode(next(iter(value[0])))}: "
        return "[\n" + text[1:-1].replace(f"}}, {begin}", f"}},\n{begin}") + "\n]"
    if isinstance(value, dict) and len(text) > LINE:
        return "{\n" + ",\n".join(f"  {encode(key)}: {encode(each)}" for key, each in value.items()) + "\n}"
    return text


def read_result(file: str) -> Document:
    """Read a result.json.

    Raises
    ------
    InputError
        When the file cannot be read, is not JSON or not a result of photostrip.
    """
    text, _ = decode(file, read_bytes(file, LARGEST_RESULT))
    try:
        document: Any = json.loads(text)
    except json.JSONDecodeError as error:
        message = f"is not JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        fix = "a result.json that was not written to its end? run the project again"
        raise InputError(Fault(message, "result-json", file, error.lineno, error.colno, fix=fix)) from None
    except RecursionError:
        refuse(file, "result-json", "is nested too deeply", expected="a result.json of photostrip")
    if not isinstance(document, dict) or "photostrip_result" not in document:
        refuse(file, "result-kind", "has no key `photostrip_result`", expected="a result.json of photostrip")
    if document["photostrip_result"] != SCHEMA:
        refuse(
            file,
            "result-schema",
            f"has the result format {document['photostrip_result']!r}",
            expected=str(SCHEMA),
            fix="run the project again with this version of photostrip",
        )
    return document


# ------------------------------------------------------------------------------------------------------- tables


def result_files(document: Document, resolved: str = "") -> dict[str, str]:
    """Return all files of a result.

    Parameters
    ----------
    resolved : str
        Text of project.resolved.yaml; none is written when it is empty.

    Returns
    -------
    dict of str to str
        Content by file name; result.json comes last: when it is there, all are.
    """
    files = {name: table(document) for name, table in TABLES.items()}
    if "bundle" in document:
        files["reliability.csv"] = reliability_csv(document)
    if "link_residuals" in document:
        files["links.csv"] = links_csv(document)
    if resolved:
        files["project.resolved.yaml"] = resolved
    return {**files, "result.json": to_json(document)}


def _table(header: str, rows: Iterable[str]) -> str:
    return f"{header}\n{''.join(rows)}"


def _cell(text: str | None) -> str:
    """Quote an id where CSV needs it."""
    if text is None:
        return ""
    return '"' + text.replace('"', '""') + '"' if NEEDS_QUOTES.search(text) or not text else text


def _number(decimals: int) -> Callable[[float | None], str]:
    form = f"%.{decimals}f"
    return lambda value: "" if value is None else form % value


def _coordinates(document: Document) -> Callable[[Document], str]:
    """Return the writer of x, y, z: angles with more decimals than metres."""
    frame = document["frame"]
    angle = _number(GEOGRAPHIC_DECIMALS if frame["kind"] == "geographic" else GROUND_DECIMALS)
    metre = _number(GROUND_DECIMALS)
    x, y, z = (metre if axis == "up" else angle for axis in frame["axes"])
    return lambda row: f"{x(row['x'])},{y(row['y'])},{z(row['z'])}"


def points_csv(document: Document) -> str:
    """Give points.csv: all points with their coordinates."""
    place, metre, micrometre = _coordinates(document), _number(GROUND_DECIMALS), _number(2)
    header = f"point,role,x,y,z,sigma_x,sigma_y,sigma_z,rays,models,image_rms_um,{','.join(COVARIANCES)},{ELLIPSE}"
    square, degree = _number(COVARIANCE_DECIMALS), _number(1)
    return _table(
        header,
        (
            f"{_cell(row['id'])},{row['role']},{place(row)},"
            f"{metre(row['sigma_x'])},{metre(row['sigma_y'])},{metre(row['sigma_z'])},"
            f"{row['rays']},{row['models']},{micrometre(row['image_rms_um'])},"
            f"{','.join(square(row.get(key)) for key in COVARIANCES)},"
            f"{metre(row.get('ellipse_a'))},{metre(row.get('ellipse_b'))},{degree(row.get('ellipse_azimuth_deg'))}\n"
            for row in document["points"]
        ),
    )


def photos_csv(document: Document) -> str:
    """Give photos.csv: perspective centres, angles and rotation matrices."""
    place, micrometre, cosine = _coordinates(document), _number(2), _number(12)
    photos = document["photos"]
    angles = photos[0]["angles"] if photos else {"system": "alpha-omega-kappa", "unit": "deg"}
    names = [f"{name}_{angles['unit']}" for name in angles["system"].split("-")]
    angle = _number(9 if angles["unit"] == "rad" else 6)
    matrix = ",".join(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))
    metre = _number(GROUND_DECIMALS)
    sigmas = ",".join(f"sigma_{name}" for name in ("x", "y", "z", *names))
    return _table(
        f"photo,strip,x,y,z,{','.join(names)},{matrix},image_rms_um,points,{sigmas}",
        (
            f"{_cell(row['id'])},{_cell(row['strip'])},{place(row)},"
            f"{','.join(map(angle, row['angles']['values'] or (None,) * 3))},"
            f"{','.join(map(cosine, row['rotation'] or (None,) * 9))},"
            f"{micrometre(row['image_rms_um'])},{row['points']},"
            f"{_photo_sigmas(row['sigma'], metre, angle)}\n"
            for row in photos
        ),
    )


def _photo_sigmas(
    sigma: Document | None, metre: Callable[[float | None], str], angle: Callable[[float | None], str]
) -> str:
    if sigma is None:
        return ",,,,,"
    return ",".join([*(metre(sigma[axis]) for axis in "xyz"), *map(angle, sigma["angles"] or (None,) * 3)])


def residuals_csv(document: Document) -> str:
    """Give residuals.csv: image residuals of all measurements."""
    return _table("photo,point,vx_um,vy_um,used", _grouped(document["residuals"], ("photo",), ("vx_um", "vy_um")))


def parallaxes_csv(document: Document) -> str:
    """Give parallaxes.csv: y parallaxes of all points of all pairs."""
    return _table("left,right,point,q_um,used", _grouped(document["parallaxes"], ("left", "right"), ("q_um",)))


def links_csv(document: Document) -> str:
    """Give links.csv: what neighbouring models have in common, after minus before."""
    groups, numbers = document["link_residuals"], ("vx_um", "vy_um", "vz_um", "test")
    return _table(f"before,after,point,{','.join(numbers)},used", _grouped(groups, ("before", "after"), numbers))


def _grouped(groups: Iterable[Document], heads: Sequence[str], numbers: Sequence[str]) -> Iterable[str]:
    """Rows of points that stand together under a photo or a pair."""
    cells: dict[str, str] = {}
    for group in groups:
        head = ",".join(_cell(group[name]) for name in heads).replace("%", "%%")
        points = [cells.get(point) or cells.setdefault(point, _cell(point)) for point in group["points"]]
        columns, form = [group[name] for name in numbers], "%.2f"
        if any(None in column for column in columns):
            columns, form = [["" if v is None else f"{v:.2f}" for v in column] for column in columns], "%s"
        line = f"{head},%s,{','.join([form] * len(columns))},%d\n"
        yield "".join([line % row for row in zip(points, *columns, group["used"], strict=True)])


def rejected_csv(document: Document) -> str:
    """Give rejected.csv: measurements that were taken out, and why."""
    number = _number(2)
    return _table(
        "strip,photo,other_photo,point,stage,test,value,limit,unit,reason,zone,size,size_unit,readmitted,blamed",
        (
            f"{_cell(row['strip'])},{_cell(row['photo'])},{_cell(row['other_photo'])},"
            f"{_cell(row['point'])},{row['stage']},{row['test']},{number(row['value'])},{number(row['limit'])},"
            f"{row['unit']},{_cell(row['reason'])},{row.get('zone') or ''},{number(row.get('size'))},"
            f"{row.get('size_unit', '')},{int(row.get('readmitted', False))},"
            f"{_cell(';'.join(row.get('blamed', ())) or None)}\n"
            for row in document["rejected"]
        ),
    )


def reliability_csv(document: Document) -> str:
    """Give reliability.csv: how well each ray of a bundle adjustment is checked by the others."""
    header = "photo,point,redundancy_x,redundancy_y,test_x,test_y,detectable_x_um,detectable_y_um"
    names = header.split(",")[2:]
    formats = [_number(3), _number(3), *[_number(2)] * 4]
    rows = (
        f"{_cell(group['photo'])},{_cell(point)},{','.join(f(v) for f, v in zip(formats, values, strict=True))}\n"
        for group in document["residuals"]
        for point, *values in zip(group["points"], *(group[name] for name in names), strict=True)
        if values[0] is not None
    )
    return _table(header, rows)


TABLES: dict[str, Callable[[Document], str]] = {
    "points.csv": points_csv,
    "photos.csv": photos_csv,
    "residuals.csv": residuals_csv,
    "parallaxes.csv": parallaxes_csv,
    "rejected.csv": rejected_csv,
}
