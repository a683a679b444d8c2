"""What a user types: a file for each command in ``commands``, and ``main``, which finds and calls them.

- ``command_table``: all commands, and ``photostrip --help``; ``options``: options that several commands share;
- ``stdout``: what is printed, in which form; ``stderr``: what is said meanwhile;
- ``failures``: which exit code a failure has, and how it is reported;
- ``option_groups``, ``section_option``, ``typed_values``, ``documents``, ``sheets``, ``whole_program``: what options
  and answers of several commands have in common;
- ``jobs``: what is too long for the file of its command: a batch, the baseline, manual pages.
"""
