"""Analytical strip phototriangulation, from measured image coordinates to adjusted ground coordinates."""

from photostrip.threads import limit_threads

__version__ = "0.1.0"

# Before anything can import numpy: the thread pools read these variables once, when they are loaded.
limit_threads()
