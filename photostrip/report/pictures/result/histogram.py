"""How residuals are distributed, with the limits of the search for gross errors that tested them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist, median
from typing import NamedTuple

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import WIDTH, Entry, Layout, Panel, framed, legend, steps
from photostrip.report.pictures.ground.image_plane import Residual
from photostrip.report.pictures.svg import Picture

BARS = 33  # of a histogram, an odd number
LEAST_REACH = 4.5  # standard deviations that a histogram holds, at least


class Sample(NamedTuple):
    """Residuals and what they were tested against."""

    name: str
    values: list[float]
    unit: str
    sigma: float
    limits: list[float]  # none: not tested
    reach: float  # what the axis holds, to both sides

    @property
    def limit(self) -> float:
        return median(self.limits)


def _sample(name: str, values: list[float], unit: str, sigma: float, limits: list[float]) -> Sample:
    reach = max(LEAST_REACH * sigma, 1.1 * max(limits, default=0.0)) or 1.0
    return Sample(name=name, values=values, unit=unit, sigma=sigma, limits=limits, reach=reach)


def histogram_picture(document: Document, used: Sequence[Residual]) -> Picture:
    """Draw the residuals of a bundle standardised; of strips in µm, beside the y parallaxes that were tested."""
    tested = [value for each in used if each.test for value in each.test]
    if tested:
        limit = document["bundle"]["screening"]["limit"]
        samples = [_sample("image residuals", tested, "standard deviations", 1.0, [limit])]
    else:
        sizes = [value for each in used for value in each.size]
        samples = [_sample("image residuals", sizes, "µm", rms(sizes), []), *_parallaxes(document)]
    layout = Layout(columns=len(samples), height=240.0, number=len(samples))
    drawn: list[str] = []
    for place, sample in enumerate(samples):
        counts, curve = _columns(sample)
        top = 1.08 * max(*counts, *(y for _, y in curve))
        panel = layout.panel(place, (-sample.reach, sample.reach), (0.0, top))
        drawn += _panel(panel, sample, counts, sample.name if len(samples) > 1 else "")
        drawn.append(steps(panel, curve, "curve curve-2"))
    drawn += legend(_entries(samples))
    beyond = sum(abs(value) > each.reach for each in samples for value in each.values)
    caption = _caption(samples, bundle=bool(tested))
    if beyond:
        caption += (
            f" {counted(beyond, 'residual')} beyond the axis {'is' if beyond == 1 else 'are'} counted at its ends."
        )
    words = " ".join(_words(each) for each in samples)
    return svg.picture("histogram", (WIDTH, layout.whole), drawn, "Distribution of the residuals", caption, words)


def rms(values: Sequence[float]) -> float:
    return math.sqrt(math.fsum(value**2 for value in values) / len(values)) if values else 0.0


def _parallaxes(document: Document) -> list[Sample]:
    """Return the y parallaxes of the points used, with the limits of their pairs; nothing without either."""
    limits = [row["limit_um"] for row in document["models"] if row.get("limit_um") is not None]
    values = [row["q_um"] for row in document["parallaxes"] if row["used"] and row["q_um"] is not None]
    if not limits or not values:
        return []
    return [_sample("y parallaxes of the pairs", values, "µm", rms(values), limits)]


def _columns(sample: Sample) -> tuple[list[int], list[tuple[float, float]]]:
    """Return the counts of the classes, and the normal curve."""
    width, counts = 2 * sample.reach / BARS, [0] * BARS
    for value in sample.values:
        counts[min(max(int((value + sample.reach) / width), 0), BARS - 1)] += 1
    normal, scale = NormalDist(0.0, sample.sigma or 1.0), len(sample.values) * width
    return counts, [(x, scale * normal.pdf(x)) for x in (sample.reach * (n / 60.0 - 1.0) for n in range(121))]


def _panel(panel: Panel, sample: Sample, counts: Sequence[int], title: str) -> list[str]:
    width = 2 * sample.reach / BARS
    drawn = []
    if sample.limits:
        low, high = min(sample.limits), max(sample.limits)
        for ends in ((-high, -low), (low, high)) if high > low else ():
            (x, y), (right, zero) = panel.at(ends[0], panel.y.high), panel.at(ends[1], panel.y.low)
            drawn.append(svg.rectangle((x, y), (right - x, zero - y), "limits"))
    for number, count in enumerate(counts):
        (x, y), (right, zero) = (
            panel.at(number * width - sample.reach, count),
            panel.at((number + 1) * width - sample.reach, 0.0),
        )
        if count:
            drawn.append(svg.rectangle((x, y), (right - x, zero - y), "column", counted(count, "residual")))
    drawn += framed(panel, (f"residual, {sample.unit}", "number"), title)
    for side in (-1, 1) if sample.limits else ():
        at = side * sample.limit
        drawn.append(svg.line(panel.at(at, panel.y.low), panel.at(at, panel.y.high), "limit"))
    return drawn


def _entries(samples: Sequence[Sample]) -> list[Entry]:
    sigmas = ", ".join(f"{each.sigma:.3g}{' µm' if each.unit == 'µm' else ''}" for each in samples)
    found = [Entry("residuals", "column", "square"), Entry(f"normal curve, σ = {sigmas}", "curve curve-2")]
    for each in samples:
        if each.limits:
            words = f"median limit ±{each.limit:.1f} µm" if each.unit == "µm" else f"rejected beyond ±{each.limit:.2f}"
            found.append(Entry(words, "limit"))
        if each.limits and max(each.limits) > min(each.limits):
            found.append(Entry("all limits", "limits", "square"))
    return found


def _caption(samples: Sequence[Sample], *, bundle: bool) -> str:
    if bundle:
        return (
            "How the image residuals are distributed, each over its own standard deviation, with the limits of the "
            "search for gross errors."
        )
    caption = (
        "How the image residuals are distributed. They are smaller than the errors of the measurements, of which the "
        "orientations took up a part; gross errors were sought in the y parallaxes of the pairs, not here."
    )
    for each in samples[1:]:
        low, high = min(each.limits), max(each.limits)
        caption += (
            f" On the right the y parallaxes of the points used, and the limit beyond which a point of ordinary "
            f"redundancy is taken out: {each.limit:.1f} µm in the median of the pairs, {low:.1f} to {high:.1f} µm."
        )
    return caption


def _words(sample: Sample) -> str:
    three = sum(abs(value) > 3 * sample.sigma for value in sample.values)
    chance = 2 * NormalDist().cdf(-3.0) * len(sample.values)
    return (
        f"{len(sample.values)} {sample.name.split(' of ')[0]}, {three} beyond three standard deviations; "
        f"{chance:.1f} would be by chance."
    )
