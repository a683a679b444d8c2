"""Rotations, similarities and plane transformations."""
