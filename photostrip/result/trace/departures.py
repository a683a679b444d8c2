"""Where a run departs from the textbook of the strip method, and the key of the project that decides."""

from __future__ import annotations

from typing import NamedTuple

from photostrip.notes import Document
from photostrip.pipeline.inputs import Settings


class Departure(NamedTuple):
    subject: str
    source: str  # where the textbook decides
    key: str  # of ``processing``
    textbook: tuple[str, ...]  # values of the key that follow it
    words: str  # what the textbook does
    here: dict[str, str]  # what the program does, by value of the key


CHOICES = (
    Departure(
        subject="gross errors in pairs",
        source="[004a]",
        key="relative.screening",
        textbook=("parallax+grubbs",),
        words="residual y parallax, then Grubbs' test",
        here={
            "auto": "robust start where needed, search for the smallest set of wrong points, readmission",
            "tau": "residual over its own standard deviation",
            "deletion": "search for the smallest set of wrong points",
            "robust": "re-weighting",
            "none": "not searched for",
        },
    ),
    Departure(
        subject="intersection",
        source="eq. 138",
        key="intersection",
        textbook=("left",),
        words="point on the left ray",
        here={"mean": "Y is the mean of both rays, in the base frame"},
    ),
    Departure(
        subject="scale transfer",
        source="eq. 139-141",
        key="scale_transfer",
        textbook=("distances",),
        words="mean of the ratios of distances, weights as chosen",
        here={"least_squares": "ratios weighted by their precision"},
    ),
    Departure(
        subject="control",
        source="eq. 149",
        key="control_weights",
        textbook=("equal",),
        words="equal weights",
        here={"stated": "weighted by their standard deviations and those of the strip's points"},
    ),
    Departure(
        subject="adjustment",
        source="eq. 150",
        key="adjustment",
        textbook=("polynomial",),
        words="polynomials",
        here={
            "auto": "bundle adjustment, which the strip only starts; polynomials where there can be none",
            "similarity": "none",
            "bundle": "bundle adjustment, which the strip only starts",
        },
    ),
    Departure(
        subject="degree",
        source="eq. 150",
        key="polynomial.degree",
        textbook=("3",),
        words="cubic",
        here={"auto": "1 to 3 or none, by evidence", "1": "1", "2": "2"},
    ),
)


def departures_of(settings: Settings) -> list[Document]:
    """Return the choices in which a run departs from the textbook."""
    values = {
        "relative.screening": settings.relative.screening,
        "intersection": settings.formation.intersection,
        "scale_transfer": settings.formation.scale_transfer,
        "adjustment": settings.adjustment,
        "polynomial.degree": settings.polynomial.degree,
        "control_weights": settings.absolute.control_weights,
    }
    return [
        {
            "subject": choice.subject,
            "source": choice.source,
            "textbook": choice.words,
            "here": choice.here[values[choice.key]],
            "key": f"processing.{choice.key}: {choice.textbook[0]}",
        }
        for choice in CHOICES
        if values[choice.key] not in choice.textbook
    ]
