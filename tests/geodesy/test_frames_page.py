"""The examples of docs/frames.md are frames that can be tied."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from tests.geodesy.frames import write_gtx

PAGE = Path(__file__).parents[2] / "docs" / "frames.md"
EXAMPLES = re.findall(r"^```yaml\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def description(entry: dict[str, Any]) -> FrameSpec:
    """Give the frame that one entry of a project file describes."""
    rest = {key: value for key, value in entry.items() if key in {"height", "geoid_undulation"}}
    if "ellipsoid" in entry:
        rest["ellipsoid"] = (entry["ellipsoid"]["a"], entry["ellipsoid"]["b"])
    return FrameSpec(entry["crs"], tuple(entry["axes"]), **rest)


@pytest.mark.parametrize("example", EXAMPLES)
def test_example(example: str, tmp_path: Path) -> None:
    write_gtx(tmp_path / "own_geoid.gtx", np.full((11, 11), 45.0), south=40.0, west=10.0, step=1.0)
    project = yaml.safe_load(example)
    control = [description(entry) for entry in project["control"]]
    output = description(project["output"]) if "output" in project else None
    frames, out = tie_frames(control, output, directory=tmp_path)
    assert [frame.spec for frame in frames] == control
    assert out.spec == (output or control[0])


def test_the_page_has_examples() -> None:
    assert len(EXAMPLES) >= 5
