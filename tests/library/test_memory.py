"""Memory that one more check point takes, counted by allocation: the same on every machine, busy or not."""

from __future__ import annotations

import tracemalloc

from photostrip.formats.result_files import beside_json
from photostrip.formats.result_json import json_pieces
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Points, Spec
from tests.loops import nonempty
from tests.simulated import inputs_of, settings_of

FEW, MANY = (1000, 20), (5000, 90)  # check points, and points of each model beside its rows of Gruber points
MOST = 4200, 4600  # bytes a check point, of a run and of its result; 4086 and 4494 when this was written


def peaks(check: int, extra: int) -> tuple[int, int]:
    """Bytes at the peak of a run of 60 photos, and of what is made of its result."""
    spec = Spec(
        flight=Flight(photos=60, end_lap_percent=62.0),
        points=Points(rows=5, extra_per_model=extra, reach_percent=75.0),
        control=Control(every=12, check=check),
    )
    simulation = simulate(spec)
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    tracemalloc.start()
    try:
        result = triangulate(inputs, settings)
        of_run = peak_since_last()
        document = document_of(result)
        for pieces in nonempty((json_pieces(document), *beside_json(document, "", result).values())):
            for _ in pieces:
                pass  # each is written and goes
        return of_run, peak_since_last()
    finally:
        tracemalloc.stop()


def peak_since_last() -> int:
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    return peak


def test_one_more_check_point_takes_kilobytes() -> None:
    peaks(100, 10)  # what is loaded and kept once does not count
    (run_few, result_few), (run_many, result_many) = peaks(*FEW), peaks(*MANY)
    more, (run, result) = MANY[0] - FEW[0], MOST
    assert (run_many - run_few) / more < run
    assert (result_many - result_few) / more < result
