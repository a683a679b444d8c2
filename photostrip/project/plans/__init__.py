"""The files of ``photostrip plan``: in comes YAML or options alone, out go the specifications of ``planning``.

- ``flown``: what all plans of something flown have, and how they are read;
- ``model``, ``strip``, ``cameras``, ``displacement``, ``screening``: one kind of plan each.
"""
