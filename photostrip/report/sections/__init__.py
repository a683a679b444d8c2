"""Sections of the accuracy report of a run."""
