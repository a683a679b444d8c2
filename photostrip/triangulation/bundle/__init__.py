"""Bundle adjustment: all rays of all photos with control and camera positions in one least-squares solution.

In comes a ``BundleProblem`` (``observations.problem``), out come a ``BundleSolution`` and its ``Cofactors``: ``solve``
leads from the one to the other over the reduced ``normal_equations`` of the ``parameters``; ``robust`` weighs rays,
``selection`` takes observations out and back, ``settings`` and ``solution`` are what comes in and out beside;
``common_errors`` finds what groups of given coordinates share, ``camera_errors`` what photos of a camera do,
``quality`` says how good everything is. Arrays in, arrays out: frames, ids and files are the business of the pipeline.

Source: [Granshaw 1980]; step control after [Marquardt 1963].
"""
