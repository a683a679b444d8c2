"""Files as users and other programs write them: the only room that knows csv, gzip and json.

- ``findings``: faults and notes collected while files are read;
- ``files``: bytes and text of a file, and everything that can go wrong before its first line;
- ``numbers``: numbers as users write them, and what is wrong with those that are none;
- ``table_text``: the text of a CSV table, with the place of every cell;
- ``tables``: a CSV table with its columns and rows;
- ``observations``: points measured on photos, fiducial marks included;
- ``control``: given ground coordinates.
"""
