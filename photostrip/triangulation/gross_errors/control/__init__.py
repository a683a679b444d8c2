"""Gross errors in the control."""
