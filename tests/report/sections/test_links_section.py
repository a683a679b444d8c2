"""The links of a strip of independent models: the worst are shown first."""

from __future__ import annotations

import numpy as np

from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.report.page.parts import Table
from photostrip.report.page.tables import ALL_SHOWN
from photostrip.report.sections.formation import links_section
from photostrip.result.document import document_of
from tests.models import inputs, truth
from tests.results import in_tables


def test_links_without_redundancy_are_not_the_worst() -> None:
    true = truth(4, 4, 1)
    noise = np.random.default_rng(2).normal(size=(len(true.model), 3))
    document = document_of(triangulate(inputs(true, true.measured(noise, (0.01, 0.01, 0.02))), Settings()))
    link = document["links"][0]
    document["links"] = [link | {"before": "none", "sigma0": None} for _ in range(ALL_SHOWN)]
    document["links"] += [link | {"before": "some", "sigma0": 0.5} for _ in range(ALL_SHOWN)]
    (table,) = [part for part in links_section(in_tables(document), everything=False).parts if isinstance(part, Table)]
    cells = " ".join(cell for row in table.rows for cell in row)
    assert "some" in cells
    assert "none" not in cells
