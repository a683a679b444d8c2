"""All pictures of a result; as SVG files they have the style of the light page in them."""

from __future__ import annotations

import re
from importlib import resources

from photostrip.notes import Document
from photostrip.report.pictures.ground.footprints import footprint_pictures
from photostrip.report.pictures.ground.plan import plan_picture
from photostrip.report.pictures.ground.plan_view import plan_of
from photostrip.report.pictures.ground.precision_map import precision_maps
from photostrip.report.pictures.ground.ties import tie_pictures
from photostrip.report.pictures.result.along import deformation_pictures, precision_pictures
from photostrip.report.pictures.result.formed import junction_pictures, scale_pictures
from photostrip.report.pictures.result.parallaxes import parallax_pictures
from photostrip.report.pictures.result.residuals import residual_pictures
from photostrip.report.pictures.result.tested import check_pictures, correlation_pictures, position_pictures
from photostrip.report.pictures.svg import Picture
from photostrip.visible import visible

SECTIONS = {
    "parallaxes": ("relative",),
    "junctions": ("junctions", "links"),
    "scale": ("junctions",),
    "correlations": ("bundle",),
    "positions": ("bundle",),
    "precision": ("precision",),
    "precision-plan": ("precision",),
    "precision-height": ("precision",),
    "deformation": ("control",),
    "check": ("check",),
    "image-residuals": ("images",),
    "image-plane": ("images",),
    "histogram": ("images",),
}
"""Sections of the report to which pictures belong, as ``--section`` names them; the others are of the ground."""


def pictures_of(document: Document) -> list[Picture]:
    """Draw a result; what it does not hold has no picture."""
    plan = plan_of(document)
    return [
        plan_picture(document, plan),
        *footprint_pictures(document, plan),
        *tie_pictures(document, plan),
        *parallax_pictures(document),
        *junction_pictures(document),
        *scale_pictures(document, plan),
        *correlation_pictures(document),
        *position_pictures(document),
        *precision_pictures(document),
        *precision_maps(document, plan),
        *deformation_pictures(document, plan),
        *check_pictures(document),
        *residual_pictures(document),
    ]


def picture_files(document: Document) -> dict[str, str]:
    """Return the pictures of a result, content by file name."""
    style = _style()
    return {
        f"{each.name}.svg": visible(each.svg.replace(">", f">\n<style>\n{style}\n</style>\n", 1)) + "\n"
        for each in pictures_of(document)
    }


def _style() -> str:
    """Return the style of pictures with the colours written out: many programs know no variables of CSS."""
    folder = resources.files("photostrip.report") / "templates"
    page = (folder / "report.css").read_text(encoding="utf-8")
    colours = dict(re.findall(r"--(\w+): (#\w+);", page[: page.index("@media")]))
    rules = (folder / "pictures.css").read_text(encoding="utf-8").strip()
    return re.sub(r"var\(--(\w+)\)", lambda found: colours[found[1]], rules)
