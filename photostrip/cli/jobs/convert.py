"""Files of another program as a project in a folder, and a result as files for other programs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from photostrip.errors import Fault, InputError
from photostrip.foreign.control import Asked, with_control
from photostrip.foreign.events import with_events
from photostrip.foreign.exports import exported
from photostrip.foreign.gathering import measured_alone
from photostrip.foreign.metashape import ENDING
from photostrip.foreign.metashape_markers import with_markers, with_references
from photostrip.foreign.opensfm_control import with_ground_control
from photostrip.foreign.project import project_files, understood
from photostrip.foreign.sources import own_control, read_source
from photostrip.foreign.tables import ForeignBlock, Wanted
from photostrip.formats.output.result_json import read_result
from photostrip.formats.text.numbers import LARGEST_NUMBER, SMALLEST_LENGTH, NotANumber
from photostrip.formats.text.numbers import number as read_number
from photostrip.formats.text.writing import write_files
from photostrip.project.keys import TABLES, form_of
from photostrip.project.template import refuse_existing
from photostrip.result.statement.edited import EDITED, FIX, OF_WORDS, faults_of_edited, is_edited

RESULT = "result.json"


@dataclass(frozen=True)
class Options:
    """What is said beside the files."""

    sigma: float | None = None  # px
    pixel_size: float | None = None  # mm
    image_size: str | None = None  # px: width,height
    control: Path | None = None
    crs: str = ""
    control_sigma: str | None = None  # metres: one number, or three
    mark_sigma: float | None = None  # px
    mark_width: float | None = None  # px
    positions: Path | None = None
    positions_sigma: str | None = None  # metres: one number, or three


def converted(source: Path, output: Path, options: Options, *, force: bool) -> tuple[list[str], str]:
    """Write a project, all of its files or none; say what was understood, and what was written.

    Raises InputError with everything that is wrong with the options, or with the files.
    """
    control = options.control or own_control(source)
    faults = list(_faults(options, control))
    if faults or options.sigma is None:
        raise InputError(faults)
    wanted = Wanted(
        sigma=options.sigma,
        pixel_size=options.pixel_size,
        image_size=_two(options.image_size),
        positions_sigma=_three(options.positions_sigma),
    )
    block = read_source(source, wanted)
    if control is not None:
        asked = Asked(
            file=str(control),
            crs=options.crs,
            sigma=_three(options.control_sigma),
            mark_sigma=options.mark_sigma,
            width=options.mark_width,
        )
        block = _reader_of(asked.file)(block, asked)
    block = measured_alone(block)
    if options.positions is not None:
        xml = options.positions.suffix.casefold() == ENDING
        block = (with_references if xml else with_events)(block, str(options.positions))
    if not len(block.xy):
        message, fix = "nothing is measured on these photos", "give --control FILE, a table with its marks"
        if block.beside:
            message += ": tie points are in none of the files"
            fix = f"its markers are taken with {' or '.join(f'--control {file}' for file in block.beside)}; or {fix}"
        raise InputError(Fault(message, "no-points", str(source), key="--control", fix=fix))
    files = project_files(output.resolve().name or "project", block, wanted)
    if not force:
        refuse_existing(output, list(files))
    write_files(output, files, block.files)
    said = understood(block, wanted)
    width = max(map(len, said))
    lines = [f"{name:<{width}}  {text}" for name, text in said.items()]
    return lines, f"wrote {', '.join(files)} to {output}; next: photostrip check {output / 'project.yaml'}"


def _reader_of(control: str) -> Callable[[ForeignBlock, Asked], ForeignBlock]:
    if control.casefold().endswith((".json", ".json.gz")):
        return with_ground_control
    return with_markers if control.casefold().endswith(ENDING) else with_control


def is_result(source: Path) -> bool:
    """Tell a result, by its file or by the folder of a run, from what is to become a project."""
    return source.suffix == ".json" or (source / RESULT).is_file()


def written_for_others(source: Path, target: str, form: str, *, force: bool) -> list[str]:
    """Write a result in the form of another program, all of its files or none; say what is in them."""
    file = source / RESULT if source.is_dir() else source
    place = Path(target)
    if place.name in {"", ".."}:  # `./`, whose own name is needed
        place = place.resolve()
    form = form_of(target, form)
    saved = read_result(str(file))
    try:
        with faults_of_edited("exported", (saved, str(file))):
            found = exported(saved, [place.name + ("/" if target.endswith("/") else "")], form)
    except InputError as error:
        raise InputError(replace(each, file=each.file or str(file)) for each in error.faults) from None
    except OF_WORDS as error:  # orientations are not among the numbers that the certificate vouches for
        message = f"cannot be exported: a value is of another kind ({error})"
        fault = Fault(message, "result-incomplete", str(file), expected="a whole result.json", fix=FIX)
        raise InputError(fault) from error
    if not force and (form == "opensfm" or any("/" in name for name in found.files)):  # measurements may stand there
        refuse_existing(place.parent, list(found.files))
    write_files(place.parent, found.files, [file, *(file.parent / f"{name}.csv" for name in TABLES)])
    return [*([f"{file}: {EDITED}"] if is_edited(saved) else []), *found.said]


def _faults(options: Options, control: Path | None) -> Iterator[Fault]:
    if options.sigma is None:
        message = "the files do not say how precise an image coordinate is"
        fix = "give --sigma PX: features of SIFT scatter by 0.5 to 1 px"
        yield Fault(message, "option", key="--sigma", fix=fix)
    lengths: dict[str, tuple[float | None, str]] = {
        "--sigma": (options.sigma, "px"),
        "--pixel-size": (options.pixel_size, "mm"),
        "--mark-sigma": (options.mark_sigma, "px"),
        "--mark-width": (options.mark_width, "px"),
    }
    for option, (value, unit) in lengths.items():
        if value is not None and not SMALLEST_LENGTH < value < LARGEST_NUMBER:
            yield Fault(f"{value:g} {unit} is no length", "option", key=option, expected="a number larger than 0")
    for option, text in {
        "--control-sigma": options.control_sigma,
        "--positions-sigma": options.positions_sigma,
    }.items():
        if text is not None and _three(text) is None:
            expected = "one number in metres, or three with commas between them"
            yield Fault(f"`{text}` is no precision", "option", key=option, expected=expected)
    if options.image_size is not None and _two(options.image_size) is None:
        expected = "width and height in pixels with a comma between them, as 9000,9200"
        yield Fault(f"`{options.image_size}` is no size", "option", key="--image-size", expected=expected)
    given: dict[str, object] = {
        "--crs": options.crs,
        "--control-sigma": options.control_sigma,
        "--mark-sigma": options.mark_sigma,
        "--mark-width": options.mark_width,
    }
    for option, about in given.items():
        if control is None and about:
            yield Fault("there is no control that it is about", "option", key=option, fix="give --control FILE, too")


def _two(text: str | None) -> tuple[float, float] | None:
    """Read a width and a height; None for anything else."""
    try:
        width, height = map(read_number, (text or "").split(","))
    except (NotANumber, ValueError):
        return None
    return (width, height) if SMALLEST_LENGTH < min(width, height) <= max(width, height) < LARGEST_NUMBER else None


def _three(text: str | None) -> tuple[float, float, float] | None:
    """Read one standard deviation, or three; None for anything else."""
    words = (text or "").split(",")
    try:
        east, north, up = map(read_number, words * 3 if len(words) == 1 else words)
    except (NotANumber, ValueError):
        return None
    return (east, north, up) if min(east, north, up) > SMALLEST_LENGTH else None
