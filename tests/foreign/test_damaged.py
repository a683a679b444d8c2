"""Damaged models: a clean refusal with file and line or record, or a project that passes `check`; never more."""

from __future__ import annotations

import contextlib
import io
import os
import re
import struct
from random import Random
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.cli.main import main
from photostrip.project.checks.check import check_project
from tests.foreign.colmap_models import Model
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path

DAMAGED = int(os.environ.get("PHOTOSTRIP_DAMAGED", "150"))  # files of each kind
WORDS = [b"nan", b"inf", b"-1", b"0", b"1e999", b"1e300", b"-", b"#", b"x", b"\xff", b"\0", b"\n", b" ", b"\t", b"2.5",
         b"99999999999999999999", b"OPENCV", b"FOV", b"\r", b",", b'"', b"\xe2\x80\xa8"]  # fmt: skip
VALUES = [struct.pack("<d", each) for each in (np.nan, np.inf, -1.0, 0.0, 1e300)]
VALUES += [struct.pack("<Q", each) for each in (0, 1, 2**32, 2**62, 2**63, 2**64 - 1, 10**15)]
PLACE = re.compile(r"(cameras|images)\.(txt|bin)(:\d+)*: ")


def model() -> Model:
    """Give a small one: two cameras, four photos, twelve points."""
    images = []
    for number in range(4):
        xy = np.random.default_rng(number).uniform(10.0, 990.0, (12, 2)).round(2)
        pose = np.array([0.0, 1.0, 0.0, 0.01 * number]), np.array([-5.0 * number, 0.0, 50.0])
        images.append((number + 1, *pose, 1 + number % 2, f"DJI {number}.JPG", xy, list(range(12))))
    opencv = ("OPENCV", 1000, 1000, [900.0, 901.0, 500.0, 500.0, 0.01, 0.0, 0.0, 0.0])
    return Model({1: ("SIMPLE_RADIAL", 1000, 1000, [900.0, 500.0, 500.0, 0.01]), 2: opencv}, images)


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
@pytest.mark.parametrize("ending", ["txt", "bin"])
def test_a_damaged_model_is_refused_or_written_whole(tmp_path: Path, ending: str) -> None:
    random, words = Random(ending), WORDS if ending == "txt" else VALUES
    folder = model().write(tmp_path / "model", "text" if ending == "txt" else "binary")
    whole = {name: (folder / name).read_bytes() for name in (f"cameras.{ending}", f"images.{ending}")}
    written = 0
    for number in nonempty(range(DAMAGED)):
        for name, data in whole.items():
            (folder / name).write_bytes(data)
        name = random.choice(list(whole))
        (folder / name).write_bytes(damaged(whole[name], random, words))
        target, said = tmp_path / str(number), io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            code = main(["convert", str(folder), "-o", str(target), "--sigma", "0.5"])
        assert code in {0, 2}, said.getvalue()
        assert target.exists() == (code == 0)
        if code == 2:
            assert PLACE.search(said.getvalue()), said.getvalue()
        elif (written := written + 1) % 10 == 0:
            assert check_project(target / "project.yaml").faults == (), (folder / name).read_bytes()
    assert 0.1 * DAMAGED < written < 0.9 * DAMAGED
