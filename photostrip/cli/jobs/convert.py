"""Files of another program as a project in a folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from photostrip.errors import Fault, InputError
from photostrip.foreign import colmap
from photostrip.foreign.project import Wanted, project_files, understood
from photostrip.formats.text.numbers import LARGEST_NUMBER, SMALLEST_LENGTH
from photostrip.formats.text.writing import write_files
from photostrip.project.template import refuse_existing


def converted(
    source: Path, output: Path, sigma: float | None, pixel_size: float | None, *, force: bool
) -> tuple[list[str], str]:
    """Write a project, all of its files or none; say what was understood, and what was written.

    Raises InputError with everything that is wrong with the options, or with the files.
    """
    faults = [*_length("--sigma", sigma, "px"), *_length("--pixel-size", pixel_size, "mm")]
    if sigma is None:
        message = "the files do not say how precise an image coordinate is"
        fix = "give --sigma PX: features of SIFT scatter by 0.5 to 1 px"
        faults.append(Fault(message, "option", key="--sigma", fix=fix))
    if faults or sigma is None:
        raise InputError(faults)
    block, wanted = colmap.read(source), Wanted(sigma, pixel_size)
    files = project_files(output.resolve().name or "project", block, wanted)
    if not force:
        refuse_existing(output, list(files))
    write_files(output, files, block.files)
    said = understood(block, wanted)
    width = max(map(len, said))
    lines = [f"{name:<{width}}  {text}" for name, text in said.items()]
    return lines, f"wrote {', '.join(files)} to {output}; next: photostrip check {output / 'project.yaml'}"


def _length(option: str, value: float | None, unit: str) -> Iterator[Fault]:
    if value is not None and not SMALLEST_LENGTH < value < LARGEST_NUMBER:
        yield Fault(f"{value:g} {unit} is no length", "option", key=option, expected="a number larger than 0")
