"""The plausibility gate of a run: ``gate`` gathers evidence from inputs and stages and returns findings.

In come the inputs and settings of a run, or its result; out come findings (``plausibility.KINDS``). The tests stand in
``plausibility``; here is what they are asked about: ``evidence`` the image coordinates alone, and strips formed for
evidence alone, ``given_control`` and ``given_cameras`` what is given on the ground, ``on_control`` a formed strip on
its control, ``control_readings`` the ways to read it, ``control_layout`` where control lies, ``shared_errors`` what
control, or all camera positions, have in common. Nothing here changes what is adjusted.
"""
