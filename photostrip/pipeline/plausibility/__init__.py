"""The plausibility gate of a run: evidence gathered from the stages, findings told."""
