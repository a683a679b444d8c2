"""How each point was checked: limits of y parallaxes, what nothing checks, redundancy of what was given."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import photostrip
from photostrip.pipeline.inputs import Settings
from photostrip.report.page.parts import Table
from photostrip.report.pictures.result import pictures_of
from photostrip.report.pictures.svg import Picture
from photostrip.report.sections.accuracy_report import chosen_sections
from photostrip.result.bundle import bundle_of
from photostrip.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Gnss, GrossError, Points, Spec
from tests.loops import nonempty
from tests.pipeline.blocks import adjusted
from tests.results import Case, Document, case, solved, spec
from tests.simulated import inputs_of


def strip(adjustment: str, *, wrong: float = 0.0) -> Document:
    """Adjust a strip with a share of its rays of new points 0.3 mm off."""
    inputs = inputs_of(simulate(Spec(seed=5, flight=Flight(photos=6), points=Points(extra_per_model=20))))
    seen = inputs.observations
    rng = np.random.default_rng(5)
    given = np.isin(seen.point, [seen.point_ids.index(name) for name in inputs.control.ids])
    off = (rng.random(len(seen)) < wrong) & ~given
    xy = seen.xy + off[:, None] * rng.choice([-0.3, 0.3], seen.xy.shape)
    return solved(replace(inputs, observations=replace(seen, xy=xy)), Settings(adjustment=adjustment)).document


@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_two_rays_check_a_new_point_only_across_the_base(adjustment: str) -> None:
    """Their one condition is the y parallax; a third ray and given coordinates check along the base too."""
    document = strip(adjustment)
    found = Counter((row["rays"] > 2 or row["role"] == "control", row["checked"]) for row in document["points"])
    assert set(found) == {(False, "across"), (True, "along")}
    assert document["counts"]["points_checked"] == {
        "along": found[True, "along"], "across": found[False, "across"], "none": 0,
    }  # fmt: skip


def test_what_nothing_checks_may_hold_what_was_found_elsewhere() -> None:
    notes = {note["code"]: note["message"] for note in strip("bundle", wrong=0.06)["notes"]}
    told = "points are checked only across the base, 0 not at all: about as many of their rays may be"
    assert told in notes["unchecked-points"]
    assert "unchecked-points" not in {note["code"] for note in strip("bundle")["notes"]}


@cache
def run(screening: str, parallax_limit: float | None = None) -> Case:
    inputs = inputs_of(simulate(spec("projected", 1, 5.0, GrossError("image", size_um=300.0, axis="y"))))
    relative = replace(Settings().relative, screening=screening, parallax_limit=parallax_limit)
    return solved(inputs, Settings(adjustment="polynomial", relative=relative))


def limits(document: Document) -> list[float | None]:
    return [row["limit_um"] for row in document["models"]]


def test_a_parallax_limit_holds_where_grubbs_allows_more() -> None:
    found = run("parallax+grubbs", 0.004).document
    logged = [row for row in found["rejected"] if row["test"] == "parallax"]
    assert all(row["limit"] == 4.0 for row in nonempty(logged))
    assert max(each for each in limits(found) if each is not None) == 4.0


@pytest.mark.parametrize("screening", ["auto", "deletion", "robust", "tau", "parallax+grubbs"])
def test_what_was_used_lies_within_the_limits_and_what_was_rejected_beyond(screening: str) -> None:
    document = run(screening).document
    for model in nonempty(document["models"]):
        used = document["residuals"].where(photo=model["left"])["q_um"]
        assert 5.0 < model["limit_um"] < 60.0
        assert np.nanmedian(np.abs(used)) < model["limit_um"]
    size = {(row["left"], row["right"]): row["limit_um"] for row in document["models"]}
    wrong = [row for row in document["rejected"] if row["stage"] == "relative" and not row["readmitted"]]
    for row in nonempty(wrong):
        assert abs(row["parallax_um"]) > size[row["photo"], row["other_photo"]]


def histogram(document: Document) -> Picture:
    return next(each for each in pictures_of(document) if each.name == "histogram")


def test_the_histogram_has_the_limits_and_none_without_a_search() -> None:
    unsearched = run("none").document
    assert set(limits(unsearched)) == {None}
    assert "limit" not in histogram(unsearched).svg
    document = case().document
    drawn = histogram(document)
    known = sorted(each for each in limits(document) if each is not None)
    middle = float(np.median(known))
    assert f"median limit ±{middle:.1f} µm" in drawn.svg
    assert f"{known[0]:.1f} to {known[-1]:.1f} µm" in drawn.caption
    assert drawn.svg.count('class="line failed dashed"') == 3  # two in the panel of the y parallaxes, one in the legend
    bundle = solved(case().inputs, Settings(adjustment="bundle")).document
    of_bundle = histogram(bundle)
    assert f"±{bundle['bundle']['screening']['limit']:.2f}" in of_bundle.svg
    assert "y parallaxes" not in of_bundle.svg


def test_a_kind_of_which_all_was_rejected_has_no_redundancy() -> None:
    result = adjusted(simulate(Spec(flight=Flight(photos=5), gnss=Gnss(), control=Control(bands=2))))
    assert result.bundle is not None
    groups = [
        replace(each, sigma=np.full_like(each.sigma, np.inf)) if each.kind == "control" else each
        for each in result.bundle.groups
    ]
    block = bundle_of(replace(result, bundle=replace(result.bundle, groups=tuple(groups))))["bundle"]
    (control,) = (each for each in block["reliability"]["groups"] if each["group"] == "control")
    assert (control["observations"], control["redundancy"], control["smallest"]) == (0, 0.0, 0.0)
    assert control["detectable"] is None


def test_redundancy_numbers_of_control_and_positions_sum_up_to_those_of_their_group() -> None:
    document = photostrip.simulate({}, flight={"photos": 5}, gnss={"use": True}).project.run().document
    groups = {each["group"]: each["redundancy"] for each in document["bundle"]["reliability"]["groups"]}
    columns = [document["control"][f"redundancy_{k}"].astype(float) for k in (1, 2, 3)]
    assert np.nansum(columns) == pytest.approx(groups["control"], abs=0.02)
    positions = document["positions"]
    left, over, sigma, share = (
        np.array([positions[f"{key}_{axis}"] for axis in ("east", "north", "up")])
        for key in ("d", "normalised", "sigma", "redundancy")
    )
    assert share.sum() == pytest.approx(groups["position"], abs=0.02)
    assert over == pytest.approx(left / (sigma * np.sqrt(share)), abs=0.03)
    (table,) = (part for part in chosen_sections(document, names=["positions"])[0].parts if isinstance(part, Table))
    assert [row[2:5] for row in table.rows] == [tuple(f"{size:+z.3f}" for size in row) for row in left.T]
    # the error that is just found: noncentrality sigma / sqrt(r) (Baarda)
    rays, reliability = document["residuals"], document["bundle"]["reliability"]
    share, size = (rays[key].astype(float) for key in ("redundancy_x", "detectable_x_um"))
    known = share > 0.1
    expected = reliability["noncentrality"] * reliability["image_sigma_um"] / np.sqrt(share[known])
    assert size[known] == pytest.approx(expected, rel=1e-3)
    assert known.sum() > 50


@pytest.mark.slow
def test_wrong_control_within_the_limit_by_the_sigma0_that_it_enlarges_is_named() -> None:
    simulation = photostrip.simulate(
        {"camera": {"preset": "film"}, "ground": {"crs": "EPSG:32633", "center_deg": [14.2, 50.3]}},
        seed=1060,
        flight={"photos": 20, "end_lap_percent": 62, "heading_deg": 75, "attitude_sigma_deg": [1, 1, 2]},
        terrain={"height": 350, "relief": 90},
        points={"extra_per_model": 6},
        control={"every": 5, "per_band": 3, "check": 30, "sigma": [0.03, 0.03, 0.05]},
        gross_errors=[{"kind": "image", "count": 18, "size_um": 90}, {"kind": "control", "size_m": 0.6, "axis": "z"}],
    )
    (note,) = simulation.project.run().document["notes"].where(code="control-doubtful")
    assert note["points"] == [simulation.truth["errors"]["point"][-1]]
    assert "test value 4.72, limit 4.30); it was used: by the sigma0 found the test value is 4.18" in note["message"]
