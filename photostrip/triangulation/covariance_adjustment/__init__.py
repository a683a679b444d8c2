"""A strip adjusted with its own covariance: misclosures go to every point by least-squares prediction.

In come the errors of a strip (``error_propagation``) and its control; out come the errors of its points and photos with
their covariances, and tests of the whole and of every control coordinate. ``conditions`` collects junctions, control
and distances of pass points, ``system`` puts them into a banded system that ``block_tridiagonal`` eliminates,
``prediction`` reads points, photos and tests from it by their ``columns``, with ``dense_models`` where models have many
points, ``relinearisation`` forms a long strip again where it has turned too much, ``left_out`` takes control out
without eliminating again; ``adjust`` goes through all of it.

Source: derived; docs/precision.md, eq. 7.
"""
