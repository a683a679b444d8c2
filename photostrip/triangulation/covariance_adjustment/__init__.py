"""A strip adjusted with its own covariance: misclosures go to every point by least-squares prediction.

In come the errors of a strip (``error_propagation``) and its control; out come the errors of its points and photos with
their covariances, and tests of the whole and of every control coordinate. ``similarities`` are the unknowns,
``conditions`` are control and distances of pass points, ``windows`` says how both stand to the models around them;
``system`` eliminates the conditions point by point, and ``block_tridiagonal`` what is left. ``prediction`` reads
points, photos and tests from it by ``reduced`` rows, ``relinearisation`` forms a long strip again where it has turned
too much, ``left_out`` takes control out without eliminating again; ``adjust`` goes through all of it.

Source: derived; docs/precision.md, eq. 7.
"""
