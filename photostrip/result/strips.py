"""Strips in a result: pairs, junctions, independent models and their links, control, polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.notes import Document
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.given_points import compare_with_given
from photostrip.pipeline.precision import mean_points
from photostrip.pipeline.results import Adjusted, Result, StripResult
from photostrip.points import locate
from photostrip.result.given import differences, of_used
from photostrip.result.numbers import MATRIX, attributes, record, rms
from photostrip.result.table import Table
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.pair_screening import SEARCHES, GlobalTest, residual_sigma, tested
from photostrip.strip.pair_screening import stages as tests_of
from photostrip.strip.polynomial import Polynomial, degree_of
from photostrip.strip.relative_orientation import ELEMENTS, MINIMUM_POINTS, RelativeSettings


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
        return cls(squares=squares, redundancy=count - MINIMUM_POINTS, rms=np.sqrt(mean), worst=peak[first])


def sigma0_of_pairs(squares: Floats, redundancy: Numbers) -> float:
    """Return the standard deviation of an image coordinate from y parallaxes, in mm; NaN without redundancy.

    A y parallax is the difference of two coordinates: its variance is twice theirs.
    """
    total = int(redundancy.sum())
    return float(np.sqrt(squares.sum() / 2 / total)) if total > 0 else float("nan")


def models_of(result: Result) -> Table:
    """Return the table ``models``: relative orientation and scale of every pair, in flight order."""
    ids = result.refined.observations.point_ids
    parts = (_models(strip, ids, result.settings.relative) for strip in result.photo_strips)
    return Table.joined("models", parts)


def _models(strip: StripResult, ids: Sequence[str], relative: RelativeSettings) -> Table:
    stages, photos, sums = strip.of_photos, strip.strip.photos, Parallaxes.of(strip)
    oriented, formed, used = stages.orientation, stages.formed, stages.orientation.points_used
    columns = {
        "strip": strip.strip.id,
        "left": photos[:-1],
        "right": photos[1:],
        **_of_elements("elements", oriented.elements),
        **_of_elements("sigmas", oriented.sigmas),
        "sigma0_um": 1000.0 * oriented.sigma0,
        "rms_parallax_um": 1000.0 * sums.rms,
        "max_parallax_um": 1000.0 * np.abs(oriented.parallax[sums.worst]),
        "max_parallax_point": [ids[oriented.point[row]] for row in sums.worst],
        "points_used": used,
        "points_rejected": np.bincount(oriented.pairs.pair, minlength=len(used)) - used,
        "redundancy": sums.redundancy,
        **{f"zone_{k + 1}": column for k, column in enumerate(stages.screened.counts.T)},
        "detectable_um": 1000.0 * _detectable(strip),
        "limit_um": 1000.0 * _parallax_limits(stages, relative),
        "masked_errors_suspected": stages.screened.masked,
        "condition": oriented.condition,
        "iterations": oriented.iterations,
        "base": np.linalg.norm(np.diff(strip.placed.centers, axis=0), axis=1),
        "scale_factor": formed.scale_factor,
        "base_direction_deg": np.degrees(formed.base_direction),
        "base_inclination_deg": np.degrees(formed.base_inclination),
    }
    return Table.of("models", columns)


def _of_elements(name: str, values: Floats) -> dict[str, Floats]:
    return {f"{name}_{element}": column for element, column in zip(ELEMENTS, np.degrees(values).T, strict=True)}


def _detectable(strip: StripResult) -> Floats:
    """Largest of the smallest errors that can be found at the points of each pair, mm; NaN where one is never seen."""
    oriented = strip.of_photos.orientation
    size = np.where(oriented.used, strip.of_photos.screened.detectable, 0.0)
    worst = np.maximum.reduceat(np.nan_to_num(size, nan=0.0, posinf=np.inf), oriented.pairs.starts)
    return np.where(np.isfinite(worst), worst, np.nan)


def _parallax_limits(of_photos: FormedPhotos, settings: RelativeSettings) -> Floats:
    """Median parallax of each pair, mm, from which on the search takes a point out; NaN where nothing is tested.

    A limit that depends on the redundancy of a point is smaller where there is little of it.
    """
    oriented, test = of_photos.screened.orientation, GlobalTest.of(of_photos.screened.scatter.by_pair)
    pairs, limit = oriented.pairs, np.full(len(oriented.used), np.inf)
    if settings.screening in SEARCHES:
        limit = test.largest_limits(oriented.points_used)[pairs.pair] * residual_sigma(oriented, test.sigma)
    for name, bound in tests_of(settings, of_photos.sigma):
        found = tested(oriented, name, bound)
        limit = np.minimum(limit, found.limit * found.unit)
    known = np.flatnonzero(oriented.used & np.isfinite(limit))
    known = known[np.lexsort((limit[known], pairs.pair[known]))]
    ends = np.searchsorted(pairs.pair[known], np.arange(pairs.size + 1))
    twice = ends[:-1] + ends[1:]
    lower, upper = np.append(limit[known], np.nan)[[(twice - 1) // 2, twice // 2]]
    return np.where(ends[1:] > ends[:-1], (lower + upper) / 2, np.nan)


DIRECTIONS = ("along", "across", "up")
PPM = 1e6


def discrepancies(strip: StripResult) -> Floats:
    """Differences of what neighbouring models have in common, after minus before.

    Returns (t, 3), metres along the strip, to its left and up, of every pass point of every junction, or of everything
        common to two independent models; NaN where its rays were left out.
    """
    formed = strip.of_photos.formed if not strip.is_of_models else strip.of_models.formed
    common = formed.junctions if isinstance(formed, FormedStrip) else formed.links.shared
    gap = formed.model_xyz[common.after] - formed.model_xyz[common.before]
    similarity = strip.absolute.similarity
    return np.asarray(similarity.scale * gap @ similarity.rotation.T, float)


def junctions_of(result: Result) -> Table:
    """Return the list ``junctions``: the scale transfer at every photo that joins two models."""
    ids = result.refined.observations.point_ids
    return Table.joined("junctions", (_junctions(strip, ids) for strip in result.photo_strips))


def _junctions(strip: StripResult, ids: Sequence[str]) -> Table:
    photos, joined = strip.strip.photos, strip.of_photos.formed.junctions
    count, gap = len(joined.factor), discrepancies(strip)
    known = joined.used & ~np.isnan(gap[:, 0])  # points left out later, for their rays, have no place in the models
    squares = np.column_stack([np.bincount(joined.junction[known], column**2, count) for column in gap[known].T])
    size = np.sqrt(squares / np.maximum(np.bincount(joined.junction[known], minlength=count), 1)[:, None])
    left_out: list[list[str]] = [[] for _ in range(count)]
    for row in np.flatnonzero(~joined.used).tolist():
        left_out[joined.junction[row]].append(ids[joined.point[row]])
    columns = {
        "strip": strip.strip.id,
        "photo": photos[1:-1],
        "points_used": np.bincount(joined.junction, joined.used, count).astype(np.intp),
        "points_rejected": left_out,
        "factor": joined.factor,
        "spread_ppm": joined.spread * PPM,
        **along_the_strip("discrepancy", size),
        **along_the_strip("discrepancy_um", size / strip.scale_number * PPM),
    }
    return Table.of("junctions", columns)


def along_the_strip(name: str, values: Floats) -> dict[str, Floats]:
    """Return columns, or numbers, of values along the strip, across it and up: the last axis of an array."""
    return {f"{name}_{direction}": column for direction, column in zip(DIRECTIONS, values.T, strict=True)}


def sigma0_of_links(strip: StripResult) -> float:
    """Root of the variance of the model coordinates over what is stated; NaN without redundancy."""
    solved = strip.of_models.formed.links.solved
    redundancy = int(solved.redundancy.sum())
    return float(np.sqrt(solved.squares.sum() / redundancy)) if redundancy else float("nan")


def stated_sigma(strip: StripResult) -> float:
    """Root mean square of the stated standard deviations of points, mm."""
    models = strip.of_models.formed.models
    return rms(models.sigma[models.node < models.points])


def expected_drift(strip: StripResult) -> float:
    """Change of scale along the strip that the links let expect, ratio."""
    links = strip.of_models.formed.links
    return float(np.sqrt(links.solved.cofactors[:, 6, 6].sum() * links.factor)) if links.shared.count else float("nan")


def independent_models_of(result: Result) -> Table:
    """Return the list ``models``: what each model holds and how it lies in its strip, in flight order."""
    return Table.joined("models", map(_independent_models, result.model_strips))


def _independent_models(strip: StripResult) -> Table:
    formed, models, photos = strip.of_models.formed, strip.of_models.formed.models, strip.strip.photos
    point = models.node < models.points
    used = np.bincount(models.model[point & formed.used], minlength=models.count)
    columns = {
        "strip": strip.strip.id,
        "id": strip.of_models.strip.models,
        "left": photos[:-1],
        "right": photos[1:],
        **dict.fromkeys(("sigma0_um", "rms_parallax_um", "max_parallax_um")),
        "points_used": used,
        "points_rejected": np.bincount(models.model[point], minlength=models.count) - used,
        "centers": np.bincount(models.model[~point], minlength=models.count),
        "redundancy": None,
        "base": np.linalg.norm(np.diff(strip.placed.centers, axis=0), axis=1),
        "base_formed": np.linalg.norm(np.diff(formed.centers, axis=0), axis=1) * strip.absolute.similarity.scale,
        "scale_factor": formed.places.scale,
        "model_scale": strip.models.scales,
        **dict(zip(MATRIX, strip.models.rotations.reshape(-1, 9).T, strict=True)),
    }
    return Table.of("models", columns)


def links_of(result: Result) -> Table:
    """Return the list ``links``: how every model fits the one before it, in flight order."""
    return Table.of_rows("links", (link for strip in result.model_strips for link in _links(result, strip)))


def _links(result: Result, strip: StripResult) -> list[Document]:
    from photostrip.strip.linked_models import detectable

    formed, names = strip.of_models.formed, strip.of_models.strip.models
    links, models, shared, solved = formed.links, formed.models, formed.links.shared, formed.links.solved
    from photostrip.strip.linked_models import far_ends

    gap, far, smallest, found = discrepancies(strip), far_ends(formed), detectable(shared, links), []
    for number in range(shared.count):
        rows = np.flatnonzero(shared.link == number)
        used = rows[links.used[rows]]
        of_points = models.node[shared.before[used]] < models.points
        worst = used[np.argmax(links.value[used])]
        size = np.array([rms(column) for column in gap[used].T])
        redundancy = int(solved.redundancy[number])
        link: Document = {
            "strip": strip.strip.id,
            "photo": strip.strip.photos[number + 1],
            "before": names[number],
            "after": names[number + 1],
            "points_used": int(of_points.sum()),
            "points_rejected": names_of(result, models.node[shared.before[rows[~links.used[rows]]]]),
            "center": bool((~of_points).any()),
            "factor": solved.similarities.scale[number],
            "redundancy": redundancy,
            "sigma0": np.sqrt(solved.squares[number] / redundancy) if redundancy else np.nan,
            "largest": links.value[worst],
            "largest_point": names_of(result, models.node[shared.before[[worst]]])[0],
            "limit": links.limit[number],
            "detectable_um": smallest[used].max() * 1000.0,
            "far_end": far[number],
            **along_the_strip("discrepancy", size),
            **along_the_strip("discrepancy_um", size / strip.scale_number * PPM),
        }
        found.append(link)
    return found


def names_of(result: Result, nodes: Numbers) -> list[str]:
    """Name points, and perspective centres by their photos."""
    measured = result.inputs.models
    return [] if measured is None else [measured.points.name(int(node)) for node in nodes]


def residuals_of(result: Result, rank: Numbers) -> Table:
    """Return the table ``link_residuals``: differences of what neighbouring models have in common, link by link.

    After minus before, in micrometres along the axes of the model before; also of points that took no part.
    """
    found = []
    for strip in result.model_strips:
        formed, names = strip.of_models.formed, strip.of_models.strip.models
        links, node, shared = formed.links, formed.models.node, formed.links.shared
        place = np.concatenate([rank, len(rank) + np.arange(len(strip.strip.photos) + node.max(initial=0))])
        order = np.lexsort((place[node[shared.before]], shared.link))
        columns = {
            "strip": strip.strip.id,
            "before": np.array(names[:-1], object)[shared.link[order]],
            "after": np.array(names[1:], object)[shared.link[order]],
            "point": names_of(result, node[shared.before[order]]),
            **{f"v{axis}_um": -1000.0 * links.solved.residual[order, k] for k, axis in enumerate(CARTESIAN_AXES)},
            "test": links.value[order],
            "used": links.used[order],
        }
        found.append(Table.of("link_residuals", columns))
    return Table.joined("link_residuals", found)


def strip_of(result: Result, strip: StripResult) -> Document:
    """Return a row of ``strips``: what a strip is like and how well it holds together."""
    of_photos = not strip.is_of_models
    formed = strip.of_photos.formed.junctions if of_photos else strip.of_models.formed.links
    gap = discrepancies(strip)[formed.used]  # rms() passes over points left out for their rays
    base = np.linalg.norm(np.diff(strip.placed.centers, axis=0), axis=1)
    base = base[np.isfinite(base)]
    return {
        "id": strip.strip.id,
        "camera": strip.of_photos.strip.camera.name if of_photos else None,
        "photos": len(strip.strip.photos),
        "models": len(strip.strip.photos) - 1,
        "points": len(strip.formed.point),
        "photo_scale": strip.scale_number if of_photos else None,
        **({} if of_photos else {"model_scale": strip.scale_number}),
        "flying_height": strip.depth,
        "base": base.mean() if len(base) else np.nan,
        "azimuth_deg": np.degrees(strip.intermediate.azimuth) % 360,
        **(_fit_of_photos(result, strip) if of_photos else _fit_of_models(strip)),
        "precision_plan": strip.precision.plan,
        "precision_height": strip.precision.height,
        **along_the_strip("discrepancy", np.array([rms(column) for column in gap.T])),
        "scale_drift_expected_ppm": (_expected_drift(strip) if of_photos else expected_drift(strip)) * PPM,
        "scale_drift_found_ppm": _found_drift(strip) * PPM if of_photos else None,
    }


def _fit_of_photos(result: Result, strip: StripResult) -> Document:
    sums, oriented = Parallaxes.of(strip), strip.of_photos.orientation
    return {
        "sigma_given_um": 1000.0 * rms(result.refined.observations.sigma[strip.rows]),
        "sigma0_um": 1000.0 * sigma0_of_pairs(sums.squares, sums.redundancy),
        "redundancy": int(sums.redundancy.sum()),
        "rms_parallax_um": 1000.0 * rms(oriented.parallax[oriented.used]),
        "image_rms_um": 1000.0 * rms(strip.resection.residuals),
    }


def _fit_of_models(strip: StripResult) -> Document:
    stated = stated_sigma(strip)
    return {
        "sigma_given_um": 1000.0 * stated,
        "sigma0_um": 1000.0 * (sigma0_of_links(strip) * stated),
        "redundancy": int(strip.of_models.formed.links.solved.redundancy.sum()),
        "rms_parallax_um": None,
        "image_rms_um": None,
    }


def _expected_drift(strip: StripResult) -> float:
    """Change of scale along a strip of photos that the spread of the scale ratios lets expect, as a ratio.

    The scale is handed from model to model, so its error grows as a sum of independent ones.
    """
    joined = strip.of_photos.formed.junctions
    count = np.bincount(joined.junction, joined.used, len(joined.factor))
    with np.errstate(invalid="ignore"):
        return float(np.sqrt((joined.spread**2 / count).sum()))


def _found_drift(strip: StripResult) -> float:
    """Change of scale along the strip that the polynomial takes out; NaN when there is none."""
    correction = strip.polynomial
    if correction is None or not correction.axes[0].terms:
        return np.nan
    start, end = (_scale_change(correction, x) for x in strip.placed.centers[[0, -1], 0])
    return end - start


def _scale_change(correction: Polynomial, x: float) -> float:
    """Change of scale along the strip that the polynomial makes at one place, relative."""
    step = 1.0  # m
    ends = correction.corrections(np.array([[x + step, 0.0, 0.0], [x - step, 0.0, 0.0]]))
    return float(ends[0, 0] - ends[1, 0]) / (2 * step)


def absolute_of(strip: StripResult) -> Document:
    """Return a row of ``absolute``: the similarity of a strip to its control."""
    found, use = strip.absolute, strip.control.use
    misclosures = [rms(column) for column in np.where(use, found.misclosures, np.nan).T]
    return {
        "strip": strip.strip.id,
        "control_points": len(strip.control),
        "control_plan": int(use[:, 0].sum()),
        "control_height": int(use[:, 2].sum()),
        "scale": found.similarity.scale,
        **dict(zip(MATRIX, found.similarity.rotation.ravel(), strict=True)),
        **_angles(found.similarity.rotation),
        **{f"shift_{axis}": value for axis, value in zip(CARTESIAN_AXES, found.similarity.shift, strict=True)},
        **{f"origin_{axis}": value for axis, value in zip(CARTESIAN_AXES, strip.intermediate.origin, strict=True)},
        **{name.replace("r", "a"): value for name, value in zip(MATRIX, strip.intermediate.axes.ravel(), strict=True)},
        **attributes(found, "sigma0 redundancy condition iterations"),
        **{f"misclosure_rms_{axis}": value for axis, value in zip(GROUND_AXES, misclosures, strict=True)},
    }


def _angles(rotation: Floats) -> Document:
    names = ("angles_deg_alpha", "angles_deg_omega", "angles_deg_kappa")
    try:
        return dict(zip(names, np.degrees(alpha_omega_kappa(rotation)), strict=True))
    except GeometryError:
        return dict.fromkeys(names)


def polynomials_of(result: Result) -> Document:
    """Return what the correction of every strip is that has one, its terms and the evidence for its degree."""
    strips = [(strip.strip.id, strip.polynomial) for strip in result.strips if strip.polynomial is not None]
    if not strips:
        return {}
    return {
        "polynomials": Table.of_rows("polynomials", (_polynomial(strip, found) for strip, found in strips)),
        "polynomial_terms": Table.joined("polynomial_terms", (_terms(strip, found) for strip, found in strips)),
        "polynomial_evidence": Table.of_rows(
            "polynomial_evidence",
            ({"strip": strip, **asdict(step)} for strip, found in strips for step in found.evidence),
        ),
    }


def _polynomial(strip: str, found: Polynomial) -> Document:
    plan, _, height = (degree_of(axis.terms) for axis in found.axes)
    values: Document = {
        "strip": strip,
        "degree": found.degree,
        "asked": found.asked,
        "reach_from": found.reach[0],
        "reach_to": found.reach[1],
        "degree_plan": plan,
        "degree_height": height,
        "stations_plan": found.stations[0],
        "stations_height": found.stations[1],
    }
    for name, axis in zip(CARTESIAN_AXES, found.axes, strict=True):
        values |= {f"{key}_{name}": value for key, value in attributes(axis, "sigma0 redundancy condition").items()}
    return values


def _terms(strip: str, found: Polynomial) -> Table:
    parts = []
    for name, axis in zip(CARTESIAN_AXES, found.axes, strict=True):
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = axis.coefficients / axis.sigmas
        columns = {
            "strip": strip,
            "axis": name,
            "term": list(axis.terms),
            "coefficient": axis.coefficients,
            "sigma": axis.sigmas,
            "t": ratio,
            "effect": axis.effects,
        }
        parts.append(Table.of("polynomial_terms", columns))
    return Table.joined("polynomial_terms", parts)


def classical_of(result: Result) -> Document:
    """Return the block ``classical`` under its key; empty where not every strip has control enough of its own.

    The strips are those that the bundle started from: nothing is adjusted for it.
    """
    strips = () if result.bundle is None else result.bundle.start.strips
    if not strips or any(strip.polynomial is None for strip in strips):
        return {}
    try:
        alone = _strip_by_strip(result, strips)
    except (GeometryError, InputError):  # a polynomial that goes astray leaves the domain of a projection
        return {}
    control, found = result.inputs.control, of_used(alone, differences(alone))
    roles = {"control": ~control.check & control.use.any(axis=1), "check": control.check}
    left = {
        f"{role}_rms": {"plan": rms(found.plan[rows]), "height": rms(found.height[rows])}
        for role, rows in roles.items()
    }
    of_strips = Table.of_rows("classical.strips", map(_degrees, strips))
    return {"classical": record("classical", {"strips": of_strips, **left})}


def _degrees(strip: StripResult) -> Document:
    terms = [] if strip.polynomial is None else [axis.terms for axis in strip.polynomial.axes]
    plan, _, height = map(degree_of, terms)
    return {"strip": strip.strip.id, "degree_plan": plan, "degree_height": height}


def _strip_by_strip(result: Result, strips: Sequence[StripResult]) -> Result:
    """Give the result that the strips are by themselves, at given points alone."""
    observations, control = result.refined.observations, result.inputs.control
    number, cartesian = mean_points(strips)
    given = np.isin(number, locate(control.ids, observations.point_ids))
    points = Adjusted(
        number=number[given],
        cartesian=cartesian[given],
        ground=result.output.ground_from_cartesian(cartesian[given]),
        rays=np.zeros(int(given.sum()), np.intp),
    )
    rows, found = compare_with_given(control, result.frames, points, observations)
    return replace(
        result,
        strips=tuple(strips),
        points=points,
        control_rows=rows,
        control_differences=found,
        precision=None,
        bundle=None,
    )
