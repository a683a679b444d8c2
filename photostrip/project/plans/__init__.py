"""Files of `photostrip plan`."""
