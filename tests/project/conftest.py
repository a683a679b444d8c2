"""Projects that are right, each in a folder of its own."""

from pathlib import Path

import pytest

from tests.project.samples import MARKED_FILES, Sample, sample


@pytest.fixture
def project(tmp_path: Path) -> Sample:
    return sample(tmp_path)


@pytest.fixture
def marked(tmp_path: Path) -> Sample:
    """The same with measured fiducial marks."""
    return sample(tmp_path, MARKED_FILES)
