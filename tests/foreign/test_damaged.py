"""Damaged sources: a clean refusal with file and line or record, or a project that passes `check`; never more."""

from __future__ import annotations

import contextlib
import io
import os
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np
import pytest

from photostrip.project.check import check_project
from tests.foreign import historix_blocks, opensfm_models
from tests.foreign.colmap_models import small_model
from tests.foreign.converting import convert
from tests.foreign.test_control import HEAD, SIGMA, UTM, Block, mrk, pos
from tests.foreign.test_control import small as small_events
from tests.foreign.test_metashape import small as small_cameras
from tests.loops import nonempty

DAMAGED = int(os.environ.get("PHOTOSTRIP_DAMAGED", "40"))  # files of each kind
WORDS = [b"nan", b"inf", b"-1", b"0", b"1e999", b"1e300", b"-", b"#", b"x", b"\xff", b"\0", b"\n", b" ", b"\t", b"2.5",
         b"99999999999999999999", b"OPENCV", b"FOV", b"\r", b",", b'"', b"\xe2\x80\xa8"]  # fmt: skip
VALUES = [struct.pack("<d", each) for each in (np.nan, np.inf, -1.0, 0.0, 1e300)]
VALUES += [struct.pack("<Q", each) for each in (0, 1, 2**32, 2**62, 2**63, 2**64 - 1, 10**15)]


@dataclass(frozen=True)
class Source:
    """What is converted, the files of it that are damaged, and the share of them that is still good."""

    source: Path
    files: list[Path]
    options: tuple[str, ...] = ()
    least: float = 0.04
    without_ties: tuple[str, ...] = ()  # faults that `check` may tell of a source that has no tie points yet


def colmap_text(folder: Path) -> Source:
    source = small_model().write_text(folder / "model")
    return Source(source, [source / "cameras.txt", source / "images.txt"], least=0.1)


def colmap_binary(folder: Path) -> Source:
    source = small_model().write_binary(folder / "model")
    return Source(source, [source / "cameras.bin", source / "images.bin"], least=0.1)


def control_in_a_table(folder: Path) -> Source:
    block = Block(folder)
    block.marks = block.marks[:20]
    return Source(folder / "model", [block.table()], ("--control", str(block.table()), *UTM, *SIGMA))


def control_of_opendronemap(folder: Path) -> Source:
    block = Block(folder)
    block.marks = block.marks[:20]
    return Source(folder / "model", [block.odm()], ("--control", str(block.odm()), *UTM, *SIGMA))


def events_of(lines: list[str], folder: Path) -> Source:
    (events := folder / "events.pos").write_text("\n".join(lines), encoding="utf-8")
    return Source(small_model().write_text(folder / "model"), [events], ("--positions", str(events)))


def events_of_dji(folder: Path) -> Source:
    return events_of([mrk(n, each) for n, each in enumerate(small_events())], folder)


def events_of_rtklib(folder: Path) -> Source:
    return events_of([HEAD, *(pos(n, each) for n, each in enumerate(small_events()))], folder)


def metashape(folder: Path) -> Source:
    (source := folder / "cameras.xml").write_text(small_cameras(), encoding="utf-8")
    return Source(source, [source], ("--control", str(source), "--control-sigma", "1"), least=0.02)


def opensfm(folder: Path) -> Source:
    small = opensfm_models.reconstruction(small_model()), opensfm_models.tracks(small_model())
    source = opensfm_models.write(folder / "opensfm", [small[0]], small[1])
    return Source(source, [source / "reconstruction.json", source / "tracks.csv"])


def historix(folder: Path) -> Source:
    source = historix_blocks.copied(folder / "historix")
    without_ties = ("expected at least 4, better 12", "not tied", "camera_positions")
    return Source(
        source, [source / name for name in historix_blocks.FILES], historix_blocks.OPTIONS, 0.02, without_ties
    )


SOURCES: list[Callable[[Path], Source]] = [
    colmap_text, colmap_binary, control_in_a_table, control_of_opendronemap, events_of_dji, events_of_rtklib,
    metashape, opensfm, historix,
]  # fmt: skip


def damaged(data: bytes, random: Random, words: list[bytes]) -> bytes:
    """Give the bytes cut, shuffled, doubled, or with other bytes or words among them."""
    at, other = sorted(random.randrange(len(data) + 1) for _ in range(2))
    kind = random.randrange(7)
    if kind < 4:
        between = [b"", data[other:], random.randbytes(random.randrange(1, 12)) + data[at:], data[at:other] + data[at:]]
        return data[:at] + between[kind]
    if kind == 4:
        lines = data.split(b"\n")
        random.shuffle(lines)
        return b"\n".join(lines)
    word = random.choice(words)
    if kind == 5 and words is WORDS:
        parts = re.split(rb"([ \n])", data)
        parts[2 * random.randrange(len(parts) // 2)] = word
        return b"".join(parts)
    return data[:at] + word + data[at + len(word) :]


@pytest.mark.slow
@pytest.mark.parametrize("write", SOURCES)
def test_a_damaged_source_is_refused_or_written_whole(tmp_path: Path, write: Callable[[Path], Source]) -> None:
    random, written = Random(write.__name__), 0
    made = write(tmp_path)
    whole = {file: file.read_bytes() for file in made.files}
    place = re.compile(rf"({'|'.join(re.escape(file.name) for file in made.files)})(:\d+)*: ")
    for number in nonempty(range(DAMAGED)):
        for file, data in whole.items():
            file.write_bytes(data)
        file = random.choice(made.files)
        file.write_bytes(damaged(whole[file], random, VALUES if write is colmap_binary else WORDS))
        target, said = tmp_path / str(number), io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            code = convert(made.source, target, *made.options)
        assert code in {0, 2}, said.getvalue()
        assert target.exists() == (code == 0)
        if code == 2:
            assert place.search(said.getvalue()), said.getvalue()
        elif (written := written + 1) % 5 == 0:
            faults = [str(fault) for fault in check_project(target / "project.yaml").faults]
            assert [text for text in faults if not any(words in text for words in made.without_ties)] == [], file
    assert made.least * DAMAGED < written < 0.9 * DAMAGED
