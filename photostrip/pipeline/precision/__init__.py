"""Covariances of every strip of a run, and the test of its check points."""
