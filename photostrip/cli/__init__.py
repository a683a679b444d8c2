"""What a user types: a file for each command in ``commands``, and ``main``, which makes one program of them.

- ``options``: options that several commands share;
- ``stdout``: what is printed, in which form; ``stderr``: what is said meanwhile;
- ``failures``: which exit code a failure has, and how it is reported;
- ``sheets``: how plans, steps and terrestrial computations are shown and written;
- ``jobs``: what is too long for the file of its command: a batch, a conversion.
"""
