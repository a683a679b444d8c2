"""The interior orientation of each photo in the result, and the refined image coordinates beside it."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from functools import cache

import numpy as np

from photostrip.formats.result_files import csv_pieces
from photostrip.library.result import Result
from photostrip.pipeline.inputs import Settings
from photostrip.report.page.parts import Table
from photostrip.report.sections.accuracy_report import chosen_sections
from photostrip.result.points import refined_table
from photostrip.simulation import Models, simulate
from photostrip.simulation.spec import Film
from tests.loops import nonempty
from tests.results import Case, case, solved, spec
from tests.simulated import inputs_of

MICROMETRES = 1e3  # in a millimetre


@cache
def film(transform: str = "affine", angle_unit: str = "deg") -> Case:
    settings = Settings(angle_unit=angle_unit)
    settings = replace(settings, interior=replace(settings.interior, transform=transform))
    return solved(inputs_of(simulate(replace(spec(), film=Film()))), settings)


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def transformed(coefficients: list[list[float]], x: float, y: float) -> tuple[float, float]:
    """Apply a transformation as the manual gives it."""
    top = [a * x + b * y + c * x * y + d for a, b, c, d in coefficients]
    return top[0] / top[2], top[1] / top[2]


def test_the_coefficients_and_residuals_are_those_of_the_measured_marks() -> None:
    for transform in ("affine", "projective"):
        inputs, document = film(transform).inputs, film(transform).document
        marks = inputs.fiducials
        assert marks is not None
        measured = {
            (marks.photo_ids[photo], marks.point_ids[mark]): xy
            for photo, mark, xy in zip(marks.photo, marks.point, marks.xy, strict=True)
        }
        assert [row["photo"] for row in document["fiducials"]] == list(inputs.strips[0].photos)
        for row in nonempty(document["fiducials"]):
            assert row["transform"] == transform
            calibrated = inputs.strips[0].camera.fiducials
            residuals = document["fiducial_marks"].where(photo=row["photo"])
            assert len(residuals) == row["marks"] == 8
            for each in residuals:
                xy = transformed(row["coefficients"], *measured[row["photo"], each["mark"]])
                expected = (np.array(xy) - calibrated[each["mark"]]) * MICROMETRES
                assert np.abs(expected - (each["vx_um"], each["vy_um"])).max() < 0.006  # µm; two decimals


def test_refined_csv_has_every_image_point_after_every_correction() -> None:
    known = film()
    camera = known.inputs.strips[0].camera
    coefficients = {row["photo"]: row["coefficients"] for row in known.document["fiducials"]}
    table = rows("".join(csv_pieces(refined_table(known.result))))
    assert len(table) == len(known.inputs.observations)
    assert [row["photo"] for row in table] == sorted(row["photo"] for row in table)
    assert camera.distortion is None
    for row in nonempty(table):
        x, y = transformed(coefficients[row["photo"]], *known.measured[row["photo"], row["point"]])
        x0, y0 = camera.principal_point
        assert abs(float(row["x_mm"]) - (x - x0)) < 1e-6
        assert abs(float(row["y_mm"]) - (y - y0)) < 1e-6
        assert abs(float(row["sigma_x_um"]) - 5.0) < 0.01


def test_refined_csv_is_written_of_photos_only_and_quotes_ids() -> None:
    assert "refined.csv" in Result(film().document, computed=film().result).files()
    models = solved(inputs_of(simulate(replace(spec(), models=Models()))))
    assert "refined.csv" not in Result(models.document, computed=models.result).files()
    inputs = case("local").inputs
    o = inputs.observations
    named = replace(o, photo_ids=tuple(f"{name},%s" for name in o.photo_ids))
    strips = tuple(replace(s, photos=tuple(f"{name},%s" for name in s.photos)) for s in inputs.strips)
    table = rows("".join(csv_pieces(refined_table(solved(replace(inputs, observations=named, strips=strips)).result))))
    assert {row["photo"] for row in table} == set(named.photo_ids)


def test_the_report_shows_every_mark_and_coefficient() -> None:
    (section,) = chosen_sections(film(angle_unit="gon").document, names=["fiducials"])
    shapes, coefficients, residuals = (part for part in section.parts if isinstance(part, Table))
    assert (len(shapes.rows), len(coefficients.rows), len(residuals.rows)) == (5, 10, 40)
    assert {column.unit for column in shapes.columns} == {"", "µm", "gon"}
    first = film().document["fiducial_marks"][0]
    assert residuals.rows[0] == ("1001", first["mark"], f"{first['vx_um']:.1f}", f"{first['vy_um']:.1f}")
    (section,) = chosen_sections(film("projective").document, names=["fiducials"])
    coefficients = [part for part in section.parts if isinstance(part, Table)][1]
    assert [row[1] for row in coefficients.rows[:3]] == ["x", "y", "divided by"]
