"""The method from measured coordinates to the result: no disk, no YAML, no printing.

What comes in are ``inputs.Inputs`` and ``inputs.Settings``, what goes out is ``results.Result`` with every stage.
``run`` is the table of contents; frames, image coordinates, given and common points have a module each, strips by
themselves stand in ``strips/``, strips together in ``block/``, covariances in ``precision``, and what the data say
against themselves in ``plausibility/``. The equations are those of ``strip/`` and ``network/``.
"""
