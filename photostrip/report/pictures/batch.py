"""Where the strips of a batch lie: a picture for each body, the strips of all projects by their verdicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.notes import Document, counted
from photostrip.report.pictures.chart import Layer, Map, Marks, Names, Segments, chart, ground_bar
from photostrip.report.pictures.svg import Picture

NAMED = 40  # projects whose names stand in the description
LOOKS = {
    "good": ("dot", "good"),
    "unverified": ("square", "look"),
    "look": ("diamond", "look"),
    "failed": ("triangle", "failed"),
}


def batch_maps(outcomes: Sequence[Document]) -> list[Picture]:
    """Draw the projects whose place on a body is known; of several bodies, that of the most projects first."""
    bodies: dict[float, list[Document]] = {}
    for outcome in outcomes:
        if outcome.get("track"):
            bodies.setdefault(outcome["body"], []).append(outcome)
    ranked = sorted(bodies.values(), key=len, reverse=True)
    return [_map(number, projects) for number, projects in enumerate(ranked, 1)]


def _map(number: int, projects: Sequence[Document]) -> Picture:
    degrees = np.array([end for each in projects for strip in each["track"] for end in strip])
    middle = float(degrees[:, 1].mean())
    metres = np.radians(projects[0]["body"]) * np.array([np.cos(np.radians(middle)), 1.0])
    names = [str(each["output"] or each["project"]) for each in projects]
    layers: list[Layer] = []
    for status, (shape, colour) in LOOKS.items():
        own = [n for n, each in enumerate(projects) if each["status"] == status]
        if own:
            ends = np.array([strip for n in own for strip in projects[n]["track"]]) * metres
            first = np.array([projects[n]["track"][0][0] for n in own]) * metres
            hints = [f"{projects[n]['project']}: {status}" for n in own]
            layers.append(Segments(ends[:, 0], ends[:, 1], colour))
            layers.append(Marks(first, colour, shape, hints, status))
    layers.append(Names(np.array([each["track"][0][0] for each in projects]) * metres, names))
    places = ", ".join(f"{name} ({each['status']})" for name, each in list(zip(names, projects, strict=True))[:NAMED])
    words = (
        f"{counted(len(projects), 'project')} on a body of {projects[0]['body'] / 1000:.0f} km radius",
        f"A line for each strip, a mark at its first photo; north is up, true lengths at latitude {middle:.1f}°",
        f"Strips of {places}",
    )
    bars = [ground_bar(float(np.ptp(degrees * metres, axis=0).max()))]
    return chart(f"map-{number}", words, [Map(layers)], bars=bars)
