"""What the program says of its precision, against what a block of draws at right angles shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.network.adjustment import solve
from photostrip.network.cofactors import cofactors_of
from photostrip.simulation import Control, Flight, Image, Points, Spec, simulate
from tests.draws import orthogonal_normal
from tests.simulated_bundle import problem_of, truth_of

WITHIN = 0.03


@pytest.mark.slow
def test_scatter_is_what_was_predicted() -> None:
    spec = Spec(
        flight=Flight(photos=3, strips=2),
        points=Points(rows=3, extra_per_model=1),
        control=Control(bands=2, noise=(0.0, 0.0, 0.0)),
        image=Image(sigma_um=0.0),
    )
    simulation = simulate(spec)
    exact = problem_of(simulation, shift=0.1, turn=1e-4)
    exact = replace(exact, images=replace(exact.images, sigma=np.full((len(exact.images), 2), 0.005)))
    truth, control = truth_of(simulation), exact.control
    predicted = cofactors_of(solve(exact))
    random = np.random.default_rng(1)
    points, centers, chi_squares = [], [], []
    images = exact.images.sigma.size
    values = images + control.sigma.size
    for drawn in orthogonal_normal(random, values, values):
        of_images, of_control = drawn[:images].reshape(-1, 2), drawn[images:].reshape(-1, 3)
        image = exact.images.xy + exact.images.sigma * of_images
        error = np.einsum("nij,ni->nj", control.axes, control.sigma * of_control)
        solution = solve(
            replace(exact, images=replace(exact.images, xy=image), control=replace(control, xyz=control.xyz + error))
        )
        points.append(solution.points - truth.points)
        centers.append(solution.centers - truth.centers)
        chi_squares.append(solution.chi_square)
    seen = ~np.isnan(predicted.points[:, 0, 0])
    for errors, cofactors in (
        (np.array(points)[:, seen], predicted.points[seen]),
        (np.array(centers), predicted.photos[:, :3, :3]),
    ):
        ratio = (errors**2).mean(axis=0) / np.einsum("nii->ni", cofactors)
        assert np.sqrt(ratio.mean()) == pytest.approx(1.0, abs=WITHIN)
        assert (np.sqrt(ratio.mean(axis=0)) > 1.0 - 2 * WITHIN).all()
        assert (np.sqrt(ratio.mean(axis=0)) < 1.0 + 2 * WITHIN).all()
        # Covariances too: squared errors in the metric of the cofactors have three degrees of freedom.
        whole = np.einsum("kni,nij,knj->kn", errors, np.linalg.inv(cofactors), errors).mean()
        assert whole == pytest.approx(3.0, rel=2 * WITHIN)
    # Sums of squares have as many degrees of freedom as the redundancy says.
    freedom = solution.redundancy
    assert np.mean(chi_squares) == pytest.approx(freedom, abs=4.0 * np.sqrt(2.0 * freedom / 200))
    assert np.var(chi_squares) == pytest.approx(2.0 * freedom, rel=4.0 * np.sqrt(2.0 / 200))
