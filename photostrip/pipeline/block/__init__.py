"""All strips of a project in one network.

What comes in are formed strips of photos or of independent models, control, camera positions and given orientations;
what goes out is a ``results.AdjustedStrips`` with orientations, points, covariances and calibration. ``datum``
and ``start`` bring all strips to the ground, ``problem`` collects the observations of photos, ``models`` those of
models, ``adjust`` solves and searches for gross errors, ``block_result`` puts the solution where the pipeline goes on,
with what it says beside its numbers. The equations are those of ``network``, see docs/bundle.md.
"""
