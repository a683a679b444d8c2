"""All pictures of a result; what it does not hold has no picture."""

from __future__ import annotations

from photostrip.notes import Document
from photostrip.report.pictures.along import (
    check_pictures,
    deformation_pictures,
    parallax_pictures,
    position_pictures,
    precision_pictures,
)
from photostrip.report.pictures.places import plan_of
from photostrip.report.pictures.plan import footprint_pictures, plan_picture, precision_maps, tie_pictures
from photostrip.report.pictures.residuals import distortion_pictures, residual_pictures
from photostrip.report.pictures.svg import Picture

SECTIONS = {
    "parallaxes": "relative",
    "precision": "precision",
    "precision-plan": "precision",
    "precision-height": "precision",
    "deformation": "control",
    "check": "check",
    "positions": "positions",
    "residuals": "images",
    "image-plane": "images",
    "histogram": "images",
    "distortion": "camera images",
}
"""Sections of the report to which pictures belong, as ``--section`` names them: the first that there is.

The others are of the ground."""


def pictures_of(document: Document) -> list[Picture]:
    plan = plan_of(document)
    return [
        plan_picture(plan),
        *footprint_pictures(plan),
        *tie_pictures(plan),
        *parallax_pictures(document),
        *precision_pictures(document),
        *precision_maps(plan),
        *deformation_pictures(plan),
        *check_pictures(document),
        *position_pictures(document),
        *residual_pictures(plan),
        *distortion_pictures(document),
    ]


def picture_files(document: Document) -> dict[str, str]:
    """Return the pictures of a result as SVG files, content by file name."""
    return {f"{picture.name}.svg": picture.file() for picture in pictures_of(document)}
