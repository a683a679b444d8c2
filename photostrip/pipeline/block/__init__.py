"""All strips of a project in one network.

What comes in are formed strips of photos or of independent models, control, camera positions and given orientations;
what goes out is a ``results.AdjustedStrips`` with orientations, points, covariances and calibration. ``own_frame``
brings orientations to the ground that lie in no known frame, ``datum`` and ``start`` all strips, ``problem`` collects
the observations of photos, ``models`` those of models, ``adjust`` solves and searches for gross errors,
``block_result`` puts the solution where the pipeline goes on, ``block_notes`` says what it says beside its numbers,
``check_points`` has the joint errors at check points. The equations are those of ``network``, see docs/bundle.md.
"""
