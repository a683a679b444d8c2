"""The key ``export``: files for other programs that each run writes beside its result."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import PurePosixPath

from photostrip.errors import Fault, InputError
from photostrip.formats.text.numbers import shown
from photostrip.project.schema.sections import Text, text, wrong
from photostrip.strip.pixel_cameras import CONVENTIONS

GEOPACKAGE = "geopackage"
ENDINGS = {
    GEOPACKAGE: ".gpkg",
    "historix": "extrinsics.csv",
    "orthority": ".csv",
    "orthority-geojson": ".geojson",
    "omega-phi-kappa": ".txt",
    "colmap": "/",
    "opensfm": "reconstruction.json",
}
ENDINGS |= {f"cameras-{each}": f".{each}.yaml" for each in CONVENTIONS} | {"cameras": ".yaml"}
"""What a result is written as, and the ending that asks for it; that of a folder is ``/``."""
TABLES = ("points", "photos", "residuals", "parallaxes", "rejected", "refined", "reliability", "links")  # of a run


def form_of(target: str, asked: str = "") -> str:
    """Return the name of a form, as asked for or else by the ending; raises InputError for one that is unknown."""
    expected = "one of " + ", ".join(f"{name} ({ending})" for name, ending in ENDINGS.items())
    if asked:
        if asked not in ENDINGS:
            message = f"a result is not written as `{shown(asked)}`"
            raise InputError(Fault(message, "export", key="--to", expected=expected))
        return _installed(asked)
    found = next((name for name, ending in ENDINGS.items() if target.lower().endswith(ending)), "")
    if not found:
        raise InputError(Fault(f"`{shown(target)}` does not say by its ending what it is", "export", expected=expected))
    return _installed(found)


def _installed(form: str) -> str:
    """Refuse a form whose libraries are not there, before anything is computed."""
    try:
        missing = form == "historix" and not all(map(find_spec, ("laspy", "lazrs")))
    except ValueError:  # put out of action: sys.modules["laspy"] is None
        missing = True
    if missing:
        message = "a point cloud (LAZ) needs laspy with lazrs, which are not installed"
        raise InputError(Fault(message, "extra", fix="pip install photostrip[laz]"))
    return form


def export(value: object) -> Text:
    """Read the name of a file in the folder of a run."""
    name = text(value)
    try:
        form = form_of(name)
    except InputError as error:
        fault = error.faults[0]
        raise wrong(fault.message, code=fault.code, expected=fault.expected, fix=fault.fix) from None
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or name == "/":
        raise wrong(f"`{shown(name)}` does not lie in the folder of the run", code="export", expected="a name")
    if name == "project.resolved.yaml" or (form == "orthority" and str(path) in {f"{table}.csv" for table in TABLES}):
        message = f"{name} is a file of the result itself"
        raise wrong(message, code="export", fix=f"write other-{name}")
    return name
