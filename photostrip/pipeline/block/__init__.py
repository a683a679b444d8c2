"""The bundle adjustment of a run: start values, problem, adjustment."""
