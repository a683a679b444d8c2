"""One file for each command, ``shell`` and ``info`` for two: its arguments, then load, call, print, exit code."""
