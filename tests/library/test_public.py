"""The public names of the package: which there are, and that asking for them is what loads anything."""

from __future__ import annotations

import inspect

import pytest

import photostrip
from tests.loops import nonempty
from tests.test_startup import HEAVY, loaded_after

pytestmark = pytest.mark.usefixtures("_adjusted_once")

# What scripts of users rely on. A change here needs a line in CHANGELOG.md that says what to do instead.
PARAMETERS = {
    "check": ["project", "overrides"],
    "compare": ["result", "baseline", "tolerances"],
    "load": ["project", "overrides"],
    "plan": ["kind", "specification", "overrides"],
    "read_result": ["path"],
    "run": ["project", "overrides"],
    "simulate": ["specification", "overrides"],
}
MEMBERS = {
    "Check": ["document", "faults", "findings", "notes", "ok"],
    "Comparison": ["differences", "document", "report", "same"],
    "Plan": ["document", "files", "report"],
    "Project": ["check", "files_read", "loaded", "name", "overridden", "photos", "resolved", "run"],
    "Result": [
        "accuracy", "computed", "control", "covariance_of", "crs", "document", "files", "findings",
        "name", "notes", "pairs", "photos", "plot", "points", "rejected", "report", "residuals",
        "statement", "status", "strips", "summary", "trace", "write",
    ],
    "Simulation": ["files", "files_read", "project", "summary", "truth", "write"],
    "Table": [
        "columns", "in_frame", "joined", "meanings", "name", "of", "of_rows", "quantities", "to_arrow", "to_geopandas",
        "to_pandas", "units", "values", "where", "with_columns",
    ],
}  # fmt: skip
STEPS = [
    "absolute", "angles", "bundle", "chain", "closed_form", "curvature", "deformation", "frame", "from_angles",
    "interior", "intersection", "pair_scales", "polynomial", "refine", "relative", "resection", "scale_transfer",
    "strip",
]  # fmt: skip
STEP_VALUES = [
    "Absolute", "Bundle", "Camera", "ClosedForm", "Distortion", "Frame", "Interior", "Intersection", "OrientedPhoto",
    "PairScales", "Paraboloid", "Relative", "Strip",
]  # fmt: skip
ERRORS = ["GeometryError", "InputError", "PhotostripError"]


def test_the_public_names_are_these() -> None:
    assert photostrip.__all__ == sorted([*PARAMETERS, *MEMBERS, *ERRORS, "steps"])
    assert [name for name in photostrip.steps.__all__ if not name[0].isupper()] == STEPS
    assert [name for name in photostrip.steps.__all__ if name[0].isupper()] == STEP_VALUES
    assert dir(photostrip) == sorted([*photostrip.__all__, "__version__"])


@pytest.mark.parametrize("name", sorted(PARAMETERS))
def test_the_parameters_of_a_function_are_these(name: str) -> None:
    function = getattr(photostrip, name)
    assert list(inspect.signature(function).parameters) == PARAMETERS[name]
    assert "Raises" in function.__doc__ or name == "check"


@pytest.mark.parametrize("name", sorted(MEMBERS))
def test_the_members_of_a_class_are_these_and_explained(name: str) -> None:
    found = getattr(photostrip, name)
    parts = found.__mro__[:-1]
    source = "".join(map(inspect.getsource, parts))
    public = [member for part in parts for member in vars(part) if not member.startswith("_")]
    assert [
        member for member in nonempty(MEMBERS[name]) if member not in public and f"self.{member}" not in source
    ] == []
    assert [member for member in public if member not in MEMBERS[name]] == []
    assert [member for member in public if not inspect.getdoc(getattr(found, member))] == []


def test_an_unknown_name_is_refused_as_python_does() -> None:
    with pytest.raises(AttributeError, match="no attribute 'adjust'"):
        _ = photostrip.adjust


@pytest.mark.slow
def test_importing_the_package_loads_nothing_heavy() -> None:
    assert loaded_after("import photostrip; dir(photostrip)", HEAVY) == set()
    assert loaded_after("import photostrip; photostrip.run", HEAVY) <= {"numpy"}
