"""The trace of every iteration."""
