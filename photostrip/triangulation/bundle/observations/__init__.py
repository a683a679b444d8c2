"""What is observed in a bundle, and its partials by the parameters.

``problem`` holds all observations and start values; ``ray_batches`` lays the rays out in memory, ``collinearity``
projects and differentiates them, ``calibration`` adds the parameters of cameras, ``given_orientations`` camera
positions and attitudes. In: arrays of a ``BundleProblem``; out: misfits and partials in units of sigma.
"""
