"""A result: its tables, its verdict, its report, its files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.formats.result_json import checked
from photostrip.notes import Document, named
from photostrip.result import table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.formats.files import Content
    from photostrip.pipeline.results import Result as Computed
    from photostrip.report.page.parts import Section
    from photostrip.report.pictures.svg import Picture
    from photostrip.result.description import Quantity

ReportForm = Literal["text", "md", "html", "json"]
RESULT, PAGE = "result.json", "report.html"


class Table(table.Table):
    """Columns of equal length by name: ``table["x"]`` is an array, ``len(table)`` the number of rows.

    Numbers are arrays of float, NaN where there is no value; counts without gaps are int, flags without gaps bool; all
    else are arrays of objects, None where there is none. Rows are dictionaries, with None where there is no value.
    Arrays cannot be written to: a copy can.
    """

    def __init__(
        self,
        name: str,
        columns: Mapping[str, NDArray[Any]],
        quantities: Mapping[str, Quantity],
        frame: Document | None = None,
    ) -> None:
        super().__init__(name, columns, quantities)
        self._frame = frame  # of its coordinates

    def _with(self, columns: Mapping[str, NDArray[Any]]) -> Table:
        return Table(self.name, columns, self.quantities, self._frame)

    def to_geopandas(self) -> Any:  # noqa: ANN401 (a library that need not be there)
        """Return points and photos as a ``geopandas.GeoDataFrame``: the data frame with a place on the map in each row.

        East, north, up in the reference system of the result; of geocentric coordinates longitude, latitude, height,
        of local ones without a system. Rows without coordinates have no place. Needs geopandas.
        Raises InputError for a table without coordinates, and ImportError where geopandas is not installed.
        """
        if self._frame is None or not {"x", "y", "z"} <= set(self.columns):
            message = f"the table {self.name} has no coordinates"
            raise InputError(Fault(message, "no-coordinate", fix="take result.points or result.photos"))
        try:
            geopandas = import_module("geopandas")
        except ModuleNotFoundError as error:
            if error.name != "geopandas":
                raise
            message = "to_geopandas() needs the package geopandas, which is not installed: pip install geopandas"
            raise ImportError(message, name="geopandas") from None
        from photostrip.foreign.adjusted import places_on_map

        places = np.column_stack([self[each] for each in "xyz"])
        known = np.isfinite(places).all(axis=1)
        places[known], crs = places_on_map(self._frame, places[known])
        points = np.where(known, geopandas.points_from_xy(*places.T), None)
        frame = geopandas.GeoDataFrame(self.to_pandas(), geometry=points, crs=crs)
        frame.attrs["units"] = self.units
        return frame


def _table(name: str, meaning: str) -> cached_property[Table]:
    """Return a property of a result that is one of its tables."""

    def of(result: Result) -> Table:
        given = result.document[name]
        columns = {key: given[key] for key in given.columns}
        return Table(name, columns, given.quantities, result.document["frame"])

    of.__doc__ = meaning
    return cached_property(of)


class Plots:
    """The pictures that a result holds numbers for, each by a method of its name; a notebook shows what it returns."""

    def __init__(self, document: Document) -> None:
        self._document = document

    def __getattr__(self, name: str) -> Callable[[], Picture]:
        """Return what draws a picture; its ``file()`` is SVG."""
        found = {} if name.startswith("_") else self._by_name()
        if name not in found:
            raise AttributeError(f"this result has no picture {name!r}: {', '.join(found)}")
        return lambda: found[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._by_name()]

    def _by_name(self) -> dict[str, Picture]:
        from photostrip.report.pictures.result import pictures_of

        return {picture.name.replace("-", "_"): picture for picture in pictures_of(self._document)}


class Result:
    """What a run found: the content of result.json, with its lists as tables.

    Lengths are metres, image coordinates micrometres, coordinates those of ``document["frame"]``; every column tells
    its unit (``result.points.units``).
    """

    def __init__(
        self,
        document: Document,
        *,
        computed: Computed | None = None,
        resolved: str = "",
        read: Sequence[str | PathLike[str]] = (),
        exports: Sequence[str] = (),
    ) -> None:
        self.document: Document = (
            document if not isinstance(document.get("points"), dict) else checked(document, "the result")
        )
        """The content of result.json: blocks of keys, and tables; ``document["points"]["x"]`` is an array."""
        self._read = read
        self.computed = computed
        """Every stage of the run that found it, with numbers that are not rounded; None where it was read."""
        self._resolved = resolved
        self._exports = exports

    @property
    def name(self) -> str:
        """Name of the project."""
        return str(self.document["name"])

    @property
    def status(self) -> str:
        """The verdict in one word: good, unverified, look or failed."""
        return str(self.document["status"])

    @property
    def crs(self) -> str:
        """Reference system of all ground coordinates, as a project has it: a code, a PROJ string, WKT, or local."""
        return str(self.document["frame"]["crs"])

    @property
    def accuracy(self) -> str:
        """How good the points are, in one sentence."""
        return str(self.document["verdict"]["accuracy"])

    @property
    def summary(self) -> Document:
        """Sigma0, scales, and the differences at control and check points."""
        return dict(self.document["summary"])

    points = _table("points", "Adjusted points: role, coordinates, standard deviations and covariances, rays.")
    photos = _table(
        "photos",
        "Exterior orientation of photos: perspective centre, angles, rotation by rows, standard deviations.",
    )
    pairs = _table("models", "Relative orientation of pairs, or the independent models: elements, parallaxes, scale.")
    strips = _table("strips", "The strips: counts, scale, sigma0, deformation.")
    control = _table("control", "Given points: adjusted minus given, standard deviations.")
    residuals = _table(
        "residuals", "Image residuals under the final orientations, a row for each ray; y parallaxes of the pairs."
    )
    rejected = _table("rejected", "Measurements that were taken out, with the test and the reason.")
    findings = _table("findings", "What the data say against themselves.")
    notes = _table("notes", "What the numbers need beside them to be read rightly.")

    def covariance_of(self, ids: Sequence[str] | str, *, joint: bool = False) -> Floats:
        """Return the covariances of points, in the order of the ids, along x, y, z of the frame.

        joint: of all points with each other, for distances and differences of points; of a bundle only, not
            of a saved result.
        Returns square metres, shape (n, 3, 3), joint (n, 3, n, 3); shape (3, 3) for a single id, which is no list. NaN
            where none was computed.
        Raises InputError for a point that the result does not have, and where joint covariances cannot be had.
        """
        names = [ids] if isinstance(ids, str) else list(ids)
        points = self.points
        rows = {name: row for row, name in enumerate(points["id"].tolist())}
        if unknown := [name for name in names if name not in rows]:
            message = f"the result has no {named('point', unknown)}"
            raise InputError(Fault(message, "unknown-point", points=tuple(unknown)))
        if joint:
            found = self._joint(np.array([rows[name] for name in names], np.intp))
            return found[0, :, 0] if isinstance(ids, str) else found
        found = np.full((len(names), 3, 3), np.nan)
        if "sigma_x" in points.columns and "cov_xy" in points.columns:
            at = [rows[name] for name in names]
            for k, axis in enumerate("xyz"):
                found[:, k, k] = points[f"sigma_{axis}"][at] ** 2
            for k, j, axes in ((0, 1, "xy"), (0, 2, "xz"), (1, 2, "yz")):
                found[:, k, j] = found[:, j, k] = points[f"cov_{axes}"][at]
        return found[0] if isinstance(ids, str) else found

    def _joint(self, rows: Numbers) -> Floats:
        """Return the joint covariances of rows of the table of points."""
        if not len(rows):
            return np.zeros((0, 3, 0, 3))
        if self.computed is None:
            message = "a saved result holds no covariances between points"
            raise InputError(Fault(message, "result-saved", fix="run the project again"))
        from photostrip.pipeline.precision import joint_covariance

        point_ids = self.computed.refined.observations.point_ids
        place = {point_ids[number]: row for row, number in enumerate(self.computed.points.number.tolist())}
        ids = self.points["id"][rows].tolist()
        found = joint_covariance(self.computed, np.array([place[name] for name in ids], np.intp))
        order = list(self.computed.output.order)
        return found[:, order][:, :, :, order]

    def report(self, form: ReportForm = "text", *, sections: Sequence[str] = (), everything: bool = True) -> str:
        """Return the accuracy report as text, Markdown, HTML or JSON.

        sections: names of the sections that are wanted, as those of ``photostrip report --section``.
        everything: False for the short report that the command prints by default; the page always has everything.
        Raises InputError for a saved result that is not whole; ValueError for another form.
        """
        from photostrip.report.sections.accuracy_report import NAMES, sections_of
        from photostrip.result.certificate import as_reported, faults_of_edited

        _require_form(form, get_args(ReportForm))
        if unknown := sorted(set(sections) - set(NAMES)):
            message = f"the report has no section {', '.join(unknown)}"
            raise InputError(Fault(message, "section", expected=f"one of {', '.join(NAMES)}"))
        if self.computed is not None or form == "json":
            return report_of(self.document, form, names=sections, everything=everything)
        with faults_of_edited("reported", (self.document, self.name)):
            document = as_reported(self.document, self.name)
            sections_of(document)  # what is incomplete is refused, whatever is asked for
            return report_of(document, form, names=sections, everything=everything)

    def statement(
        self,
        classes_cm: Mapping[str, float] | None = None,
    ) -> Document:
        """Return the accuracy statement of the result, as ``photostrip statement --format json`` prints it.

        classes_cm: classes that a contract asks for, by ``plan`` and ``height``.
        Raises InputError with every reason why nothing can be stated.
        """
        from photostrip.result.statement import statement_document

        return statement_document(self.document, self.name, classes_cm)

    def trace(self, form: str = "text") -> str:
        """Return every iteration with the symbols of the formulas: ``text``, ``md``, ``html``, ``json`` or ``csv``.

        Raises InputError for a saved result: it holds no iterations; ValueError for another form.
        """
        if self.computed is None:
            raise InputError(Fault("a saved result holds no iterations", "result-saved", fix="run the project again"))
        _require_form(form, ("text", "md", "html", "json", "csv"))
        from photostrip.report.page.layout import WIDEST_PAGE
        from photostrip.sheets.trace import trace_sheet

        return trace_sheet(self.computed).rendered(form, WIDEST_PAGE)

    def files(self, *, html: bool = False) -> dict[str, str]:
        """Return the files of the result, content by name: tables, the report as a page, result.json as the last."""
        page = {PAGE: self.report("html")} if html else {}
        return page | {name: "".join(pieces) for name, pieces in self._files().items()}

    def _files(self) -> dict[str, Iterable[str]]:
        from photostrip.formats.result_files import beside_json
        from photostrip.formats.result_json import json_pieces

        tables = beside_json(self.document, self._resolved, self.computed)
        return tables | {RESULT: json_pieces(self.document)}

    def _exported(self) -> dict[str, str | bytes]:
        if not self._exports:
            return {}
        from photostrip.foreign.exports import exported

        return exported(self.document, self._exports).files

    @property
    def plot(self) -> Plots:
        """The pictures of the report: ``plot.residuals()`` in a notebook; ``dir(plot)`` lists them."""
        return Plots(self.document)

    def write(self, folder: str | PathLike[str], *, html: bool = False) -> tuple[str, ...]:
        """Write the files of the result into a folder, as ``photostrip run -o`` does: all of them or none.

        Those for other programs are among them that its project asks for by ``export``.

        Where the report as a page fails, the others are written, and the error is raised then.
        Returns their names.
        Raises InputError where a file that the run read would be replaced.
        """
        from pathlib import Path

        from photostrip.formats.files import sweep, write_files

        sweep(Path(folder))
        page: dict[str, Content] = {}
        try:
            if html:
                page = {PAGE: self.report("html")}
        finally:
            files = page | self._exported() | self._files()
            write_files(Path(folder), files, map(Path, self._read))
            if html and not page:  # that of an earlier result would not be of this one
                (Path(folder) / PAGE).unlink(missing_ok=True)
        return tuple(files)

    def __repr__(self) -> str:
        """Say the verdict in a line."""
        return f"<Result {self.name}: {self.status.upper()}, {self.accuracy}>"

    def _repr_html_(self) -> str:
        """Return the verdict and the differences at given points for a notebook."""
        from html import escape

        rows = []
        for role in ("control", "check"):
            found: Document = self.document["summary"].get(role) or {}
            for part in ("plan", "height"):
                each = found.get(part)
                if each and each.get("count"):
                    cells = (role, part, str(each["count"]), f"{each['rms']:.3f}", f"{each['max']:.3f}", each["worst"])
                    rows.append("<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells) + "</tr>")
        heads = "".join(f"<th>{head}</th>" for head in ("role", "in", "points", "rms m", "largest m", "at"))
        table = f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>" if rows else ""
        verdict = f"<p><b>{escape(self.name)}: {self.status.upper()}</b> {escape(self.accuracy)}</p>"
        return verdict + table


def report_sections(
    document: Document,
    *,
    names: Sequence[str] = (),
    quiet: bool = False,
    everything: bool = False,
    width: int | None = None,
) -> tuple[str, Sequence[Section]]:
    """Return title and sections of the report; the title stands over whole reports only."""
    from photostrip.report.page.layout import USUAL
    from photostrip.report.sections.accuracy_report import chosen_sections, title_of

    sections = chosen_sections(document, quiet=quiet, everything=everything, names=names, width=width or USUAL)
    return "" if quiet or names else title_of(document), sections


def report_of(
    document: Document,
    form: str,
    *,
    width: int | None = None,
    ascii_only: bool = False,
    **parts: Any,  # noqa: ANN401 (of report_sections)
) -> str:
    """Return the report as text, Markdown, HTML, JSON (the document) or annotations of GitHub."""
    match form:
        case "json":
            from photostrip.formats.result_json import to_json

            return to_json(document, ascii_only=ascii_only)
        case "html":
            from photostrip.report.html import to_html

            return to_html(document)
        case "github":
            from photostrip.report.page.messages import annotated, result_findings

            return annotated(result_findings(document))
    from photostrip.report.page import layout

    title, sections = report_sections(document, width=width, **parts)
    if form == "md":
        return layout.to_markdown(title, sections, ascii_only=ascii_only)
    return layout.to_text(title, sections, width or layout.USUAL, ascii_only=ascii_only)


def _require_form(form: str, known: Sequence[str]) -> None:
    if form not in known:
        message = f"there is no form {form!r}: {', '.join(known)}"
        raise ValueError(message)


def read_result(path: str | PathLike[str]) -> Result:
    """Read a saved result: a result.json, the folder that holds it, or a baseline.

    Raises InputError with every fault of the file.
    """
    from pathlib import Path

    from photostrip.formats.result_json import read_baseline

    file = Path(path)
    return Result(read_baseline(str(file / RESULT if file.is_dir() else file)))
