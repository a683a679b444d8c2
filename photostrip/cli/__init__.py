"""What a user types: a file for each command in ``commands``, and ``main``, which makes one program of them.

- ``options``, ``section_option``, ``option_groups``: options that several commands share;
- ``stdout``: what is printed, in which form; ``stderr``: what is said meanwhile;
- ``failures``: which exit code a failure has, and how it is reported;
- ``documents``, ``sheets``: how plans and terrestrial computations are shown;
- ``jobs``: what is too long for the file of its command: a batch, a conversion, the sources.
"""
