"""The cameras of a result as a block ``cameras`` of a project, with the calibration that was found.

In millimetres, or as a program that counts in pixels has them.
"""

from __future__ import annotations

from collections.abc import Iterator

from photostrip.foreign.adjusted import Adjusted, require_squares
from photostrip.foreign.project import camera_in_pixels, in_project
from photostrip.notes import Document, given_in_pixels, in_pixels
from photostrip.project.resolved import yaml_text
from photostrip.project.sections import Text
from photostrip.strip.pixel_cameras import CONVENTIONS
from photostrip.strip.pixel_cameras import in_pixels as by_convention


def write(block: Adjusted, target: str, form: str) -> tuple[dict[str, str | bytes], list[str]]:
    """Return the block, for a project or, by the convention in the name of the form, for another program.

    In a project a camera that was given in pixels is in pixels, whose size nobody may know.

    Raises InputError for pixels that are no squares, in millimetres, and for what a convention does not know.
    """
    block.require_photos("a block of cameras")
    _, _, asked = form.partition("-")
    cameras: Document = {}
    for name, each in block.cameras.items():
        size = {} if each.own.pixel_size is None else {"pixel_size": each.own.pixel_size}
        own_unit = "" if each.own.unit == "mm" else "metashape" if each.own.pixel_affinity[1] else "opencv"
        if (convention := asked or own_unit) in CONVENTIONS:
            cameras[Text(name)] = (
                camera_in_pixels(by_convention(each.nearest, convention, each.pixels.image_size)) | size
            )
        else:
            require_squares(each.own, "a camera in millimetres")
            cameras[Text(name)] = in_project(each.own)
    text = "".join(_found(block.document)) + yaml_text({"cameras": cameras})
    return {target: text}, block.said_of_cameras()


def _found(document: Document) -> Iterator[str]:
    """Say what the calibration added, with its standard deviations."""
    sizes = given_in_pixels(document)
    for row in document.get("bundle", {}).get("calibration", ()):
        each = in_pixels(row, sizes[row["camera"]]) if row["camera"] in sizes else row
        named = f"camera {each['camera']}, {each['parameter']}: {each['value']:+g} {each['unit']}"
        yield f"# {named} by the calibration, standard deviation {each['sigma']:g}; it is in these numbers\n"
