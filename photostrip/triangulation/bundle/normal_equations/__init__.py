"""Reduced normal equations of the bundle: their structure, solvers, datum and defects."""
