"""What a user types: commands by subject, and ``main``, which makes one program of them.

A command imports what it needs when it is called, so that ``--help`` is there at once. ``options`` has what several
commands share, ``output`` what they print and say, ``failures`` which exit code a failure has.
"""
