"""Reports of the commands beside `run`."""
