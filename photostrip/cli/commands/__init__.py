"""One file for each command, ``shell`` for two: its arguments, then load, call, print, exit code."""
