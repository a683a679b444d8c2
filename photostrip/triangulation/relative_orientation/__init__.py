"""Relative orientation of all pairs of a strip: from image coordinates to five elements of each pair."""
