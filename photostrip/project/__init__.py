"""Projects as users describe them: reading, checking and completing them, and nothing else.

- ``document``: YAML as a tree of texts that know where they stand;
- ``merging``: presets (``extends``) and overrides (``--set``);
- ``schema``: every key with its unit and default;
- ``validation``: the tree against the schema, in words;
- ``references``: what the values of the file owe each other;
- ``tables``: the tables that the file names;
- ``conversion``: units, axes and directions of the house;
- ``hints``: what is not used, and why;
- ``resolved``: the project with nothing left unsaid;
- ``loading``: all of it, in order.
"""
