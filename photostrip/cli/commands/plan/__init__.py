"""``photostrip plan``: a module for each command; ``options`` and ``delivery`` are what several of them have."""
