"""Text files: in come bytes, out go arrays and ids that know the file, line and character they come from.

- ``source``, ``files``: where bytes come from, and everything that can go wrong before the first line;
- ``table_text``, ``table_reader``, ``tables``: a CSV table as text, its fields, reading it, what it holds;
- ``json_text``: JSON of other programs; ``numbers``: numbers as users write them;
  ``findings``: faults and notes, collected; ``writing``: files, whole or not.
"""
