"""The project with nothing left unsaid: every default filled in, every preset merged, as a project file again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from photostrip.formats.files import seen_from
from photostrip.geodesy.frame_spec import CARTESIAN_AXES
from photostrip.project.conversion import first_frame, output_spec
from photostrip.project.keys import Distortion, Ellipsoid, ProjectFile
from photostrip.project.reading import Node, path_of
from photostrip.project.sections import Section, Text

HEADER = (
    "# A project of photostrip with all defaults filled in. Paths are relative to the folder of the project file.\n"
)
AUTO = {"parallax_limit", "flying_height", "ground_height"}  # keys of which no value means `auto`
EMPTY = {"self_calibration"}  # lists of which none is not the same as no word
OF_PHOTOS = (
    "relative",
    "bundle",
    "scale_transfer",
    "intersection",
    "principal_point",
    "distortion",
    "refraction",
    "flying_height",
    "ground_height",
    "interior",
)
OF_MODELS = ("links",)  # what the other kind of measurements has no use for
LONGEST_LINE = 100


def completed(project: ProjectFile, root: Node, path: str, measured: Sequence[str] = ()) -> ProjectFile:
    """Fill in the defaults that depend on other keys, and make paths relative to the project's folder.

    measured: photos on which points are measured.

    Only keys for which nothing stands in are left empty.
    """
    observations, models = project.observations, project.models
    if observations is not None:
        usual = None if project.fiducial_measurements else "top-left" if observations.unit == "px" else "center"
        observations = observations.changed(
            file=_relative(root, path, "observations"),
            y_axis=observations.y_axis or "up",
            origin=observations.origin or usual,
        )
    if models is not None:
        centers = models.centers
        if centers is not None:
            centers = centers.changed(file=_relative(root, path, "models", "centers"))
        sigma = models.center_sigma or models.sigma
        models = models.changed(file=_relative(root, path, "models"), center_sigma=sigma, centers=centers)
    marks = project.fiducial_measurements
    if marks is not None and observations is not None:
        same = marks.unit in {None, observations.unit}
        marks = marks.changed(
            file=_relative(root, path, "fiducial_measurements"),
            unit=marks.unit or observations.unit,
            y_axis=marks.y_axis or observations.y_axis,
            sigma=marks.sigma or (observations.sigma if same else None),
        )
    control = [
        each.changed(file=_relative(root, path, "control", i), axes=each.axes or CARTESIAN_AXES)
        for i, each in enumerate(project.control)
    ]
    cameras: dict[str, Any] = {
        name: each.changed(file=_relative(root, path, name), axes=each.axes or CARTESIAN_AXES)
        for name in ("camera_positions", "orientations")
        if (each := getattr(project, name)) is not None
    }
    spec = output_spec(project.output, first_frame(project)) or first_frame(project)
    ellipsoid = None if spec.ellipsoid is None else Ellipsoid.model_construct(a=spec.ellipsoid[0], b=spec.ellipsoid[1])
    output = project.output.changed(
        crs=Text(spec.crs),
        axes=spec.axes,
        height=spec.height,
        geoid_undulation=spec.geoid_undulation,
        epoch=spec.epoch,
        ellipsoid=ellipsoid,
    )
    listed = project.camera_of
    rest = [Text(name) for name in dict.fromkeys(measured) if name not in listed]
    photos = [each.changed(photos=rest) if each.photos is None else each for each in project.photos]
    return project.changed(
        name=project.name or Text(Path(path).stem),
        extends=None,
        photos=photos,
        observations=observations,
        models=models,
        fiducial_measurements=marks,
        control=control,
        output=output,
        **cameras,
    )


def _relative(root: Node, project: str, *owner: str | int) -> Text | list[Text]:
    """Path of a table as seen from the project's folder, the same on every system; of several tables a list."""
    node = root.find(*owner, "file")
    if node is not None and node.elements:
        return [_seen(path_of(each, project), project) for each in node.elements]
    return _seen(path_of(node, project) if node is not None else "", project)


def _seen(path: str, project: str) -> Text:
    try:
        return Text(seen_from(path, Path(project).parent))
    except ValueError:  # another drive
        return Text(Path(path).resolve().as_posix())


def text_of(project: ProjectFile) -> str:
    """Write a project as YAML that reads as the same project; the same text for the same project everywhere.

    Texts of the user stand between quotation marks, so that other programs read ids as texts, too.
    """
    plain = _plain(project)
    for name in OF_PHOTOS if project.models is not None else OF_MODELS:
        plain["processing"].pop(name, None)
    return HEADER + yaml_text(plain)


def _plain(value: Any) -> Any:  # noqa: ANN401 (any value of a project)
    """Turn sections into mappings, without keys that say nothing."""
    if isinstance(value, Section):
        skipped = ("k0", "k", "p", "b") if isinstance(value, Distortion) and value.model == "radial-table" else ()
        fields = ((name, each) for name, each in value if name not in skipped)
        return {
            name: "auto" if each is None else _plain(each)
            for name, each in fields
            if each not in (None, [], {}) or (each is None and name in AUTO) or (each == [] and name in EMPTY)
        }
    if isinstance(value, dict):
        return {Text(name): _plain(each) for name, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value


class _Writer(yaml.SafeDumper):
    """Writes lists of values in brackets, and what the user chose between quotation marks."""

    def ignore_aliases(self, _data: object) -> bool:
        return True


def _list(writer: _Writer, value: list[Any]) -> yaml.Node:
    inside = not any(isinstance(each, dict) for each in value)
    return writer.represent_sequence("tag:yaml.org,2002:seq", value, flow_style=inside)


_Writer.add_representer(list, _list)
_Writer.add_representer(Text, lambda writer, text: writer.represent_scalar("tag:yaml.org,2002:str", text, style='"'))


def yaml_text(mapping: dict[str, Any]) -> str:
    """Write mappings, lists and values as a project file; a ``Text`` is a text for all readers of YAML."""
    return yaml.dump(
        mapping, Dumper=_Writer, sort_keys=False, allow_unicode=True, default_flow_style=False, width=LONGEST_LINE
    )
