"""Blocks of the document about points, control, photos and their precision."""
