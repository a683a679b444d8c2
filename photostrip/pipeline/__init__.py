"""The method from measured coordinates to the result: no disk, no YAML, no printing.

What comes in are ``inputs.Inputs`` and ``inputs.Settings``, what goes out is ``results.Result`` with every stage.
``run`` is the table of contents. Strips by themselves: ``formed_photos``, ``formed_models``, ``strip_method``. Strips
together: ``block_start``, ``block_problem``, ``block_adjustment``. Covariances: ``precision``. What data say against
themselves: ``gate`` asks the tests of ``plausibility`` about ``evidence`` (the images alone, formed strips, strips on
their control), ``given_on_ground``, ``given_cameras``, ``control_layout``, ``control_readings`` and ``shared_errors``;
nothing there changes what is adjusted.
The equations are those of ``strip`` and ``network``.
"""
