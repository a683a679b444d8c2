"""Gross errors that only the strip as a whole can show."""
