"""Projects as users describe them: reading, checking and completing them, and nothing else.

- :mod:`photostrip.project.document`: YAML as a tree of texts that know where they stand;
- :mod:`photostrip.project.merging`: presets (``extends``) and overrides (``--set``);
- :mod:`photostrip.project.schema`: every key with its unit and default;
- :mod:`photostrip.project.validation`: the tree against the schema, in words;
- :mod:`photostrip.project.references`: what the values of the file owe each other;
- :mod:`photostrip.project.tables`: the tables that the file names;
- :mod:`photostrip.project.conversion`: units, axes and directions of the house;
- :mod:`photostrip.project.hints`: what is not used, and why;
- :mod:`photostrip.project.resolved`: the project with nothing left unsaid;
- :mod:`photostrip.project.loading`: all of it, in order.
"""
