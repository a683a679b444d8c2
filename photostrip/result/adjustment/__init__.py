"""Blocks of the document about pairs, strips, models and their adjustment."""
