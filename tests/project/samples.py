"""A small project that is right, to be changed in one place by each test."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from photostrip.errors import Fault, InputError
from photostrip.project.loading import Project, load_project

Y, P, C, F = "project.yaml", "observations.csv", "control.csv", "fiducials.csv"  # files of the sample
PROJECT = """\
photostrip: 1
name: sample
cameras:
  RC30:
    principal_distance: 153.217
    principal_point: [0.012, -0.004]
    format: [230, 230]
    distortion: {model: brown, k: [1e-8, 0, 0], direction: image_to_ideal}
strips:
  - id: A
    camera: RC30
    photos: [1001, 1002]
  - id: B
    camera: RC30
    photos: [2001, 2002]
observations:
  file: observations.csv
  unit: mm
  y_axis: up
  sigma: 0.005
control:
  - file: control.csv
    crs: EPSG:32633
    axes: [east, north, up]
    height: ellipsoidal
    sigma: [0.05, 0.06, 0.08]
output:
  angles: {system: omega-phi-kappa, unit: gon}
processing:
  relative:
    grubbs_alpha: 0.05
tolerances: {check_rms_xy: 0.40}
"""

OBSERVATIONS = """\
photo,point,x,y
1001,P1,10.5,-20.25
1001,P2,11.5,20.25
1002,P1,-80.5,-20.5
1002,P2,-79.5,20.0
2001,P2,10,20
2001,G1,30,40
2002,P2,-80,20
2002,G1,-60,40
"""

CONTROL = """\
point,x,y,z,use,role
G1,500100.12,4649871.40,212.31,xyz,control
P2,500200.12,4649971.40,,xy,check
"""

FIDUCIALS = """\
photo,mark,x,y
1001,F1,106.1,-106
1001,F2,-105.9,-106
1002,F1,106.1,-106
1002,F2,-105.9,-106
2001,F1,106.1,-106
2001,F2,-105.9,-106
2002,F1,106.1,-106
2002,F2,-105.9,-106
"""

MARKED = PROJECT.replace(
    "    distortion:", "    fiducials: {F1: [106, -106], F2: [-106, -106]}\n    distortion:"
).replace("control:\n", "fiducial_measurements: {file: fiducials.csv}\ncontrol:\n")

FILES = {Y: PROJECT, P: OBSERVATIONS, C: CONTROL}
MARKED_FILES = {**FILES, Y: MARKED, F: FIDUCIALS}


@dataclass(frozen=True)
class Sample:
    """The files of a project in a folder of its own."""

    folder: Path

    def write(self, name: str, content: str | bytes) -> Path:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def change(self, name: str, *texts: str) -> None:
        """Replace texts, each by the one after it, where they first stand."""
        content = (self.folder / name).read_text(encoding="utf-8")
        for old, new in zip(texts[::2], texts[1::2], strict=True):
            assert old in content, f"{old!r} is not in {name}"
            content = content.replace(old, new, 1)
        self.write(name, content)

    def load(self, overrides: Sequence[str] = ()) -> Project:
        return load_project(self.folder / "project.yaml", overrides)

    def faults(self, overrides: Sequence[str] = ()) -> tuple[Fault, ...]:
        try:
            self.load(overrides)
        except InputError as error:
            return error.faults
        return ()

    def lines(self, overrides: Sequence[str] = ()) -> list[str]:
        """Faults as the user reads them, without the folder."""
        return [str(fault).replace(f"{self.folder}/", "") for fault in self.faults(overrides)]

    def reads_as_the_same(self) -> str:
        """See that the resolved project reads as the project does, and give it."""
        first = self.load()
        self.write("project.yaml", first.resolved)
        again = self.load()
        assert (again.resolved, again.settings) == (first.resolved, first.settings)
        return first.resolved

    def tells(self, place: str, *words: str, overrides: Sequence[str] = (), alone: bool = False) -> None:
        """See that one fault begins with its place and has the words, and perhaps that it is the only one."""
        lines = self.lines(overrides)
        told = [line for line in lines if line.startswith(place) and all(word in line for word in words)]
        assert len(told) == 1, "\n".join(lines) or "no fault"
        assert lines == told or not alone

    def refuses(self, file: str, old: str, new: str, place: str, *words: str) -> None:
        """Change one thing, and see what is told of it."""
        self.change(file, old, new)
        self.tells(place, *words)


def sample(folder: Path, files: dict[str, str] | None = None) -> Sample:
    """Write a project that is right."""
    made = Sample(folder)
    for name, content in (FILES if files is None else files).items():
        made.write(name, content)
    return made
