"""Files as users and other programs write them: the only room that knows csv, gzip and json.

- :mod:`photostrip.formats.findings`: faults and notes collected while files are read;
- :mod:`photostrip.formats.files`: bytes and text of a file, and everything that can go wrong before its first line;
- :mod:`photostrip.formats.numbers`: numbers as users write them, and what is wrong with those that are none;
- :mod:`photostrip.formats.table_text`: the text of a CSV table, with the place of every cell;
- :mod:`photostrip.formats.tables`: a CSV table with its columns and rows;
- :mod:`photostrip.formats.observations`: points measured on photos, fiducial marks included;
- :mod:`photostrip.formats.control`: given ground coordinates.
"""
