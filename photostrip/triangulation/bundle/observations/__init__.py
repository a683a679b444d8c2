"""What is observed in a bundle, and its partials by the parameters.

``problem`` holds all observations and start values; ``rays`` projects and differentiates, ``calibration`` has the
parameters of cameras, ``given_orientations`` camera positions and attitudes. In: arrays of a ``BundleProblem``; out:
misfits and partials in units of sigma.
"""
