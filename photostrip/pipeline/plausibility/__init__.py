"""The plausibility gate of a run: ``gate`` gathers evidence from inputs and stages and returns findings.

In come the inputs and settings of a run, or its result; out come findings (``plausibility.KINDS``). The
tests stand in ``plausibility``; here is what they are asked about: ``image_evidence`` the image
coordinates alone, ``base_directions`` the order of photos by relative orientation, ``evidence`` and ``model_evidence``
strips formed for evidence alone and given points in them, ``given_control`` and ``given_cameras`` what is given on the
ground, ``on_control`` a formed strip on its control, ``control_readings`` the ways to read it, ``control_layout`` where
control lies, ``shared_control`` and ``shared_errors`` what control, or all camera positions, have in common,
``predicted`` what the adjustment predicts of given coordinates. Nothing here changes what is adjusted.
"""
