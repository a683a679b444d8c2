"""One file for each command: its arguments, then load, call, print, exit code."""
